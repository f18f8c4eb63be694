"""The report in light and dark, on a desk and on a phone, on paper, with little motion, and without any script."""

from __future__ import annotations

import pytest

from browser.accessibility import faint
from browser.cases import CASES

SHORT = "all-rejected"
OTHERS = [name if name == SHORT else pytest.param(name, marks=pytest.mark.slow) for name in CASES]
LONG = {"width": 1280, "height": 16000}


@pytest.mark.parametrize("name", OTHERS)
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_everything_in_the_plots_stands_out(visit, case_page, name, dark):
    report = visit(case_page(name), dark=dark, viewport=LONG).ready()
    assert len(report.time_charts()) > 0
    assert faint(report) == []


def test_the_plots_follow_when_the_scheme_changes(visit, case_page):
    report = visit(case_page(SHORT)).ready()
    chart = report.charts()[0].show()
    ink = "box => getComputedStyle(box.querySelector('svg text')).fill"
    before = chart.box.evaluate(ink)
    report.page.emulate_media(color_scheme="dark")
    chart.until(f"box => ({ink})(box) !== '{before}'")
    assert faint(report) == []


@pytest.mark.parametrize("name", OTHERS)
def test_a_phone_shows_it_without_scrolling_sideways(visit, case_page, name):
    report = visit(case_page(name), phone=True).ready()
    assert report.overflow() == []
    for chart in (report.map(), *report.charts()):
        chart.show()
        assert chart.frame()["width"] > 200.0
    assert report.overflow() == []


def test_a_finger_scrolls_over_a_plot_and_taps_a_legend(visit, case_page):
    report = visit(case_page(SHORT), phone=True).ready()
    chart = report.charts()[0].show()
    assert chart.box.evaluate("box => box._fullLayout.dragmode") is False
    assert chart.box.locator(".nsewdrag").first.evaluate("node => getComputedStyle(node).touchAction") != "none"
    drawn = chart.points()
    chart.legend().first.tap()
    assert chart.points() < drawn


def test_only_what_is_looked_at_is_drawn(visit, case_page):
    report = visit(case_page(SHORT)).ready()
    drawn = "() => document.querySelectorAll('[data-drawn=yes]').length"
    report.until(f"() => ({drawn})() > 0")
    assert report.page.evaluate(drawn) < len(report.charts())
    first = report.charts()[0].show()
    first.drag(0.3, 0.5)
    span = first.range()
    report.time_charts()[-1].wait_for(span)


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_it_prints_with_every_plot(visit, case_page, dark):
    report = visit(case_page(SHORT), dark=dark).ready()
    paper = report.page.pdf(prefer_css_page_size=True)
    assert paper.startswith(b"%PDF")
    assert report.page.evaluate(
        "[...document.querySelectorAll('[data-panel]')].every((box) => box.dataset.drawn === 'yes')"
    )
    report.page.emulate_media(media="print")
    assert report.page.locator(".verdict").is_visible()


def test_nothing_moves_where_little_motion_is_wanted(visit, case_page):
    report = visit(case_page(SHORT), reduced_motion="reduce").ready()
    report.page.locator("a[href='#details']").click()
    report.page.locator("summary").first.click()
    report.map().show()
    assert report.page.evaluate("document.getAnimations().length") == 0
    assert report.page.evaluate("getComputedStyle(document.documentElement).scrollBehavior") == "auto"


@pytest.mark.parametrize("name", OTHERS)
@pytest.mark.parametrize("phone", [False, True], ids=["desk", "phone"])
def test_verdict_numbers_and_tables_need_no_script(visit, case_page, name, phone):
    report = visit(case_page(name), phone=phone, java_script_enabled=False)
    page = report.page
    page.wait_for_load_state()
    for part in ("h1", ".verdict h2", ".cards dd"):
        assert page.locator(part).first.is_visible()
        assert page.locator(part).first.inner_text().strip()
    page.locator("summary").first.click()
    tables = page.locator("table").all()
    assert tables
    for table in tables:
        table.scroll_into_view_if_needed()
        assert table.is_visible()
    assert "JavaScript" in page.inner_text("#message")
