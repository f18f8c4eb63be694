from __future__ import annotations

import pytest

from navfuse.core.nearest import nearest


@pytest.mark.parametrize(
    ("word", "cutoff", "found"),
    [
        ("grde", 0.4, "grade"),
        ("axis", 0.4, "axes"),
        ("zzz", 0.4, None),
        ("axis", 0.9, None),
        (17, 0.4, None),
        ("", 0.4, None),
    ],
)
def test_the_known_word_most_like_another(word, cutoff, found):
    assert nearest(word, ("grade", "axes", "file"), cutoff) == found
    assert nearest(word, (), cutoff) is None
