"""The report in light and dark, on a desk and on a phone, on paper, with little motion, and without any script."""

from __future__ import annotations

import pytest

from browser.accessibility import faint
from browser.cases import CASES
from browser.visit import INK

SHORT = "all-rejected"
OTHERS = [name if name == SHORT else pytest.param(name, marks=pytest.mark.slow) for name in CASES]
LONG = {"width": 1280, "height": 16000}


@pytest.mark.parametrize("name", OTHERS)
def test_everything_in_the_plots_stands_out_also_when_the_scheme_changes(visit, case_page, name):
    report = visit(case_page(name), viewport=LONG).ready()
    charts = [report.map(), *report.charts()]
    inks = [chart.show().ink() for chart in charts]
    assert faint(report) == []
    report.page.emulate_media(color_scheme="dark")
    for chart, ink in zip(charts, inks, strict=True):
        chart.until(f"box => ({INK})(box) !== '{ink}'")
    assert faint(report) == []


@pytest.mark.parametrize("name", OTHERS)
def test_a_phone_shows_it_without_scrolling_sideways(visit, case_page, name):
    report = visit(case_page(name), phone=True).ready()
    assert report.overflow() == []
    for chart in (report.map(), *report.charts()):
        assert chart.show().frame()["width"] > 200.0
    assert report.overflow() == []
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
    rate = next(chart for chart in report.charts() if "IMU rate" in chart.title)
    rate.show().wait_for(span)


@pytest.mark.parametrize("dark", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["light", "dark"])
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
