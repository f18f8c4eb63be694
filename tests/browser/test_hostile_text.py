"""Whatever a file calls its columns, sensors, states and fixes shows as text, in HTML and in plots, and never runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.logs import SHARED

from browser.cases import ten_seconds
from browser.visit import Chart
from navfuse.report.page import write_report

SHORT = (
    "<script>pwned=1</script>",
    "</script><script>pwned=2",
    '"><img src=x onerror=pwned=3>',
    "<a href=javascript:pwned=4>x</a>",
    "javascript:pwned=5",
    "${pwned=6}%{y}",
    "<b>bold</b><br>&lt;i&gt;",
    "__proto__",
    "constructor",
    "--><!-- $title",
)
"""Short enough to stand in legends and on axes uncut."""
LONG = "<img src=x onerror='window.pwned=7;alert(1)'>" * 3 + "</title></style></script><script>window.pwned=8</script>"
NAMES = (*SHORT[:9], LONG)


@pytest.fixture(scope="module")
def hostile(visits, written, tmp_path_factory):
    """The page of a run in which every text that can come from outside is hostile."""

    def write(path):
        result, truth = ten_seconds(SHARED, tmp_path_factory.mktemp("hostile"))
        records, fixes, state = result.innovations, result.fixes, result.states["gyro_bias"]
        spread = np.array(NAMES, dtype=object)
        result = replace(
            result,
            forward=replace(result.forward, source=LONG),
            innovations=replace(records, source=spread[np.arange(len(records)) % len(NAMES)]),
            states=dict.fromkeys(NAMES, state),
            summary={name: {LONG: [name, {"javascript:pwned=9": name}]} for name in NAMES},
            warnings=NAMES,
            fixes=replace(
                fixes,
                source=LONG,
                notes=NAMES,
                fix=spread[np.arange(fixes.time.size) % 3],
                n_satellites=np.full(fixes.time.size, 9),
            ),
        )
        write_report(path, result, replace(truth, source=LONG), title=" ".join(SHORT[:4]))

    return visits(written("hostile", write), viewport={"width": 1280, "height": 20000}).ready()


def shown(name):
    """A name as a label shows it."""
    return name.replace("_", " ").strip()


def test_nothing_ran(hostile):
    for chart in (hostile.map(), *hostile.charts()):
        chart.show()
    page = hostile.page
    page.locator("summary").first.click()
    assert page.evaluate("typeof window.pwned") == "undefined"
    assert page.evaluate("document.querySelectorAll('img, iframe, object, embed, link, base, form, svg a').length") == 0
    assert page.evaluate("[...document.querySelectorAll('a')].every((a) => a.getAttribute('href').startsWith('#'))")
    assert page.evaluate("document.querySelectorAll('script').length") <= 5
    handlers = (
        "[...document.querySelectorAll('*')].flatMap((e) => e.getAttributeNames()).filter((n) => n.startsWith('on'))"
    )
    assert page.evaluate(handlers) == []
    assert page.evaluate("Object.keys(Object.prototype).length") == 0


def test_it_is_readable_as_text(hostile):
    page = hostile.page
    assert page.title() == " ".join(SHORT[:4])
    assert page.inner_text("h1") == " ".join(SHORT[:4])
    verdict = page.inner_text(".verdict")
    headings = page.locator("h3").all_inner_texts()
    for name in SHORT[:9]:
        assert name in verdict
        assert any(shown(name) in heading for heading in headings)
    assert LONG in verdict


def texts(chart):
    """Everything that stands in a plot, a text each."""
    return chart.box.evaluate("box => [...box.querySelectorAll('svg text')].map((text) => text.textContent)")


def test_axes_legends_and_hover_labels_show_it_as_text(hostile):
    for chart in hostile.charts():
        chart.show()
    consistency = next(chart for chart in hostile.charts() if chart.title.startswith("Consistency"))
    titles = "\n".join(texts(consistency))
    for name in SHORT[:9]:
        assert shown(name) in titles
    legend = hostile.map().legend().all_inner_texts()
    for name in SHORT[:3]:
        assert any(name[:12] in entry for entry in legend), legend


def test_hover_labels_show_it_as_text(hostile):
    chart: Chart = next(chart for chart in hostile.charts() if "satellites" in chart.title)
    seen = []
    for across in (0.5, 0.55, 0.6):
        chart.hover(across)
        chart.until("box => box.querySelector('.hoverlayer text')")
        seen += chart.box.evaluate(
            "box => [...box.querySelectorAll('.hoverlayer text')].map((text) => text.textContent)"
        )
    for name in SHORT[:3]:
        assert any(name[:12] in text for text in seen), seen
