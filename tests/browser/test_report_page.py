"""The report of a run in a browser: everything is drawn, nothing is said or asked for, and the plots move together."""

from __future__ import annotations

import pytest

from browser.cases import CASES, TOW
from browser.visit import Chart, Visit

QUICK = ("all-rejected",)
TALL = {"width": 1280, "height": 16000}
"""Everything is in view at once, so that every plot follows at once."""


@pytest.fixture(
    scope="module", params=[name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in CASES]
)
def report(request, visits, case_page) -> Visit:
    """The page of a case; each test begins with the whole run shown."""
    return visits(case_page(request.param), viewport=TALL).ready()


@pytest.fixture
def charts(report) -> list[Chart]:
    """The plots over time, the whole run in them."""
    return report.whole_run().time_charts()


def assert_all_show(charts, span):
    """The fields and every plot over time span the same."""
    for chart in charts:
        chart.wait_for(span)
    assert charts[0].visit.span() == pytest.approx(span, abs=0.006)


def test_every_figure_is_drawn_or_says_why_not(report):
    for empty in report.page.locator(".empty").all():
        assert empty.locator("h3").inner_text()
        assert len(empty.locator("p").inner_text()) > len("Not shown: ")
    charts = report.charts()
    assert len(charts) >= 5
    assert report.page.locator("main figure").count() == len(charts) + 1
    for chart in (report.map(), *charts):
        assert chart.show().points() > 0, chart.title
        assert "NaN" not in chart.box.evaluate(
            "box => [...box.querySelectorAll('path')].map((p) => p.getAttribute('d')).join()"
        )


def test_dragging_in_one_plot_zooms_all(report, charts):
    start, end = report.span()
    chart = charts[len(charts) // 2].show()
    chart.drag(0.25, 0.6)
    expected = start + 0.25 * (end - start), start + 0.6 * (end - start)
    tolerance = 2.0 * (end - start) / chart.frame()["width"]
    chart.wait_for(expected, tolerance)
    assert_all_show(charts, chart.range())


def test_a_double_click_shows_everything_again(report, charts):
    whole = report.span()
    chart = charts[0].show()
    chart.drag(0.3, 0.5)
    assert chart.range() != pytest.approx(whole, abs=0.01)
    for _ in range(10):  # two clicks count as one only within 0.3 s, which a busy machine may miss
        report.page.mouse.dblclick(*chart.point(0.5))
        if chart.range() == pytest.approx(whole, abs=0.01):
            break
    assert_all_show(charts, whole)


def test_the_fields_zoom_by_keyboard_alone(report, charts):
    start, end = report.span()
    span = round(start + 0.4 * (end - start), 2), round(start + 0.7 * (end - start), 2)
    keyboard = report.page.keyboard
    report.page.focus("#from")
    keyboard.press("Control+A")
    keyboard.type(f"{span[0]:.2f}")
    keyboard.press("Tab")
    assert report.page.evaluate("document.activeElement.id") == "to"
    keyboard.press("Control+A")
    keyboard.type(f"{span[1]:.2f}")
    keyboard.press("Enter")
    assert_all_show(charts, span)
    while report.page.evaluate("document.activeElement.id") != "all":
        keyboard.press("Tab")
    keyboard.press("Enter")
    assert_all_show(charts, (start, end))


def test_the_keyboard_moves_window_and_cursor_of_every_plot(report, charts):
    press = report.page.keyboard.press
    start, end = charts[0].range()
    length = end - start
    charts[1].focus()
    press("Escape")
    press("+")
    assert_all_show(charts, (start + 0.25 * length, start + 0.75 * length))
    press("Shift+ArrowRight")
    assert_all_show(charts, (start + 0.375 * length, start + 0.875 * length))
    press("-")
    assert charts[0].range()[1] == pytest.approx(end, abs=0.01)
    press("0")
    assert_all_show(charts, (start, end))
    press("Home")
    press("ArrowRight")
    press("ArrowRight")
    for chart in charts:
        assert chart.cursor() == pytest.approx(start + 0.02 * length, abs=2.0 * length / chart.frame()["width"])
    assert f"{start + 0.02 * length:.2f} s" in report.page.inner_text("#readout")
    assert report.page.locator("#spoken").text_content()
    press("End")
    assert charts[0].cursor() == pytest.approx(end, abs=2.0 * length / charts[0].frame()["width"])
    press("Escape")
    assert charts[0].cursor() is None


def test_the_slider_moves_the_cursor_and_the_buttons_the_window(report, charts):
    start, end = charts[0].range()
    length = end - start
    report.page.fill("#cursor", "250")
    for chart in charts:
        assert chart.cursor() == pytest.approx(start + 0.25 * length, abs=2.0 * length / chart.frame()["width"])
    report.page.click("#nearer")
    assert_all_show(charts, (start + 0.125 * length, start + 0.625 * length))
    report.page.click("#later")
    assert_all_show(charts, (start + 0.25 * length, start + 0.75 * length))
    report.page.click("#farther")
    report.page.click("#farther")
    assert_all_show(charts, (start, end))


@pytest.mark.parametrize(("first", "last"), [("", ""), ("-1e9", "1e9"), ("9e99", "-9e99")])
def test_nonsense_in_the_fields_changes_nothing_and_goes_away(report, charts, first, last):
    whole = charts[0].range()
    for field, text in (("#from", first), ("#to", last)):
        report.page.fill(field, text)
        report.page.press(field, "Enter")
    assert report.page.input_value("#from") != ""
    assert_all_show(charts, whole)


def test_a_legend_hides_and_shows_its_curve(report, charts):
    for chart in (charts[0], report.map()):
        chart.show()
        button = chart.legend().first
        drawn = chart.points()
        button.focus()
        report.page.keyboard.press("Space")
        assert button.get_attribute("aria-pressed") == "false"
        assert chart.points() < drawn
        report.page.keyboard.press("Space")
        assert button.get_attribute("aria-pressed") == "true"
        assert chart.points() == drawn


def test_pointing_at_a_time_plot_marks_the_place_on_the_map(report, charts):
    span = charts[0].range()
    charts[0].hover(0.4)
    charts[0].until("box => box._hoverdata && box._hoverdata.length > 0")
    time = charts[0].box.evaluate("box => box._hoverdata[0].x")
    assert time == pytest.approx(span[0] + 0.4 * (span[1] - span[0]), abs=0.05 * (span[1] - span[0]))
    spot = report.page.locator("#map .spot")
    spot.wait_for()
    box = spot.bounding_box()
    place = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
    assert place == pytest.approx(report.map().place_at(time), abs=2.0)


def test_pointing_at_the_map_marks_the_time_in_every_plot(report, charts):
    start, end = charts[0].range()
    pixels = 2.0 * (end - start) / charts[0].frame()["width"]
    chart = report.map()
    chart.point_at(start + 0.6 * (end - start))
    for _ in range(100):
        time = chart.box.evaluate(
            "box => box._hoverdata && box._hoverdata.length ? box._hoverdata[0].customdata : null"
        )
        cursors = [other.cursor() for other in charts]
        if time is not None and cursors == pytest.approx([time] * len(charts), abs=pixels):
            break
        report.page.wait_for_timeout(50)
    else:
        pytest.fail(f"pointing at {time} s gave {cursors}")
    assert chart.place_at(time) == pytest.approx(chart.place_at(start + 0.6 * (end - start)), abs=25.0)


def test_pointing_at_the_star_of_the_start_marks_a_time_there(report, charts):
    """The vehicle may stand there for a while, so any time at that place will do."""
    chart = report.map()
    chart.point_at(charts[0].range()[0])
    chart.until("box => box._hoverdata && box._hoverdata.length > 0")
    time = charts[0].cursor()
    assert time is not None
    assert chart.place_at(time) == pytest.approx(chart.place_at(charts[0].range()[0]), abs=20.0)
    assert report.events == []


@pytest.mark.slow
def test_the_page_of_an_hour_at_200_hz_is_small(case_page):
    assert case_page("car").stat().st_size <= 4_000_000


@pytest.mark.slow
def test_log_time_and_time_of_week_differ_by_the_epoch(visit, case_page):
    report = visit(case_page("drive"), viewport=TALL).ready()
    chart = report.charts()[0].show()
    span = report.span()
    assert chart.range() == pytest.approx(span, abs=0.006)
    report.page.select_option("#scale", "log")
    chart.wait_for((span[0] - TOW, span[1] - TOW), 0.02)
    assert report.span() == pytest.approx((span[0] - TOW, span[1] - TOW), abs=0.02)
    report.page.select_option("#scale", "gps")
    chart.wait_for(span, 0.02)
