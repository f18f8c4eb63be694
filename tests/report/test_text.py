from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfuse.report.text import label, shown


@given(st.text(), st.integers(3, 60))
def test_what_is_shown_can_be_written_and_is_no_longer_than_asked(text, longest):
    found = shown(text, longest)
    assert len(found) <= longest
    found.encode("utf-8")
    assert not any(ord(character) < 32 and character not in "\t\n" for character in found)
    assert shown(found, longest) == found


@pytest.mark.parametrize("character", ["\x00", "\x1b", "\x7f", "\x85", "\u202e", "\u2066", "\ufeff", "\ud800", "\r"])
def test_characters_that_do_harm_are_replaced(character):
    assert shown(f"a{character}b") == "a\ufffdb"


def test_ordinary_text_stays():
    for text in ("<script>alert('1')</script>", "Größe [µm] ±3σ\tå\n", "日本語", "😀"):
        assert shown(text) == text
    assert shown(12.5) == "12.5"


def test_the_middle_of_long_text_is_left_out():
    found = shown("a" * 500 + "b" * 500, 30)
    assert len(found) == 30
    assert found.startswith("aaaa")
    assert found.endswith("bbbb")
    assert "…" in found
    assert len(label("x_" * 100)) == 32
    assert label("gyro_bias") == "gyro bias"
