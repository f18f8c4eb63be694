"""axe-core over every page that navfuse writes: in light and dark, on a desk and on a phone."""

from __future__ import annotations

import pytest

from browser.accessibility import findings
from browser.cases import CASES

SHORT = "all-rejected"
OTHERS = [name if name == SHORT else pytest.param(name, marks=pytest.mark.slow) for name in CASES]
VIEWS = pytest.mark.parametrize(
    ("phone", "dark"),
    [
        (False, False),
        (True, True),
        pytest.param(True, False, marks=pytest.mark.slow),
        pytest.param(False, True, marks=pytest.mark.slow),
    ],
    ids=["desk-light", "phone-dark", "phone-light", "desk-dark"],
)


@VIEWS
@pytest.mark.parametrize("name", OTHERS)
def test_the_report(visit, case_page, name, phone, dark):
    report = visit(case_page(name), phone=phone, dark=dark).ready()
    report.page.locator("summary").first.click()
    for chart in (report.map(), report.charts()[0]):
        chart.show()
    assert findings(report) == []
