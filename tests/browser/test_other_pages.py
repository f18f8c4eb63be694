"""The pages of ``navfuse allan`` and ``navfuse compare-filters`` in a browser."""

from __future__ import annotations

import pytest

from browser.accessibility import faint, findings
from browser.pages import write_page

VIEWS = pytest.mark.parametrize(
    ("phone", "dark"),
    [
        pytest.param(False, False, marks=pytest.mark.slow),
        (True, True),
        pytest.param(True, False, marks=pytest.mark.slow),
        pytest.param(False, True, marks=pytest.mark.slow),
    ],
    ids=["desk-light", "phone-dark", "phone-light", "desk-dark"],
)


@pytest.fixture(scope="session", params=["comparison", pytest.param("allan", marks=pytest.mark.slow)])
def other(request, written, tmp_path_factory):
    """Path of one of the pages."""
    name = request.param
    return written(name, lambda path: write_page(name, tmp_path_factory.mktemp(name), path))


@VIEWS
def test_it_is_drawn_accessible_and_no_wider_than_the_screen(visit, other, phone, dark):
    seen = visit(other, phone=phone, dark=dark)
    seen.until("() => document.readyState === 'complete' && document.querySelectorAll('.plot').length > 0")
    seen.until("() => [...document.querySelectorAll('.plot')].every((plot) => plot.querySelector('.main-svg'))")
    assert findings(seen) == []
    assert faint(seen) == []
    assert seen.overflow() == []
