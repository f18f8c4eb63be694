"""Page and figure of a comparison: self-contained, every axis with its unit, the curves those of the comparison."""

from __future__ import annotations

import json
import re
import sys

import numpy as np
import pytest

from navfuse.analysis.consistency import nis_summary
from navfuse.analysis.filter_comparison import (
    EstimatorRun,
    FilterComparison,
    NeesSummary,
    compare_solution,
    running_rms,
)
from navfuse.data.result import Innovations
from navfuse.data.trajectory import Trajectory
from navfuse.errors import OutputError
from navfuse.report.comparison_curves import COLORS, CURVE_POINTS, panels
from navfuse.report.comparison_figure import figure_comparison, write_figure
from navfuse.report.comparison_page import render, write_page


def trajectory(n, north_m=0.0, up_m=0.0, lon=None):
    time = np.arange(float(n))
    lat = np.radians(42.0 + 1e-3 * time) + north_m / 6.38e6
    lon = np.radians(-71.0 + 5e-4 * time) if lon is None else lon
    attitude, velocity = np.zeros((n, 3)), np.tile([111.0, 41.0, 0.0], (n, 1))
    return Trajectory(time, lat, lon, np.full(n, 3000.0 + up_m), velocity, attitude, source="a<b>.csv")


def comparison(names=("ekf", "ukf"), n=200, against_truth=True, smoothed=True, **changes):
    truth = trajectory(n, **changes)
    runs = []
    for k, name in enumerate(names):
        off = 1.0 + k
        nees = {"position": NeesSummary(3, truth.time, np.full(n, 3.0))} if against_truth else {}
        back = compare_solution(trajectory(n, 0.5 * off, **changes), truth) if smoothed else None
        forward = compare_solution(trajectory(n, off, 2.0 * off, **changes), truth)
        notes = ("it <script> wandered",) if k else ()
        nothing = {}
        runs.append(
            EstimatorRun(name, 15, forward, back, nees, nothing, nis_summary(Innovations.empty()), 1e-3, n - 1, notes)
        )
    return FilterComparison("folder/p<1>.toml", truth, against_truth, tuple(runs))


@pytest.mark.parametrize("against_truth", [True, False])
def test_every_axis_has_its_unit_and_every_panel_its_curves(against_truth):
    found = comparison(against_truth=against_truth)
    drawn = panels(found)
    keys = ["track", "great-circle", "latitude", "longitude", "altitude", "running-rmse", "distance"]
    assert [panel.key for panel in drawn] == keys
    for panel in drawn:
        assert re.search(r"\[(m|s|deg)\]$", panel.x)
        assert re.search(r"\[(m|deg)\]$", panel.y)
        kinds = [curve.kind for curve in panel.curves if curve.kind != "reference"]
        assert kinds == ["filter", "filter", "smoother", "smoother"]
    other, difference = ("truth", "error") if against_truth else ("fixes", "difference from the fixes")
    assert drawn[0].curves[0].name == other
    assert difference in drawn[6].title
    assert ("RMSE" in drawn[5].title) == against_truth
    assert "over the last 60 s" in drawn[5].title


def test_curves_are_those_of_the_comparison():
    found = comparison()
    by_key = {panel.key: panel for panel in panels(found)}
    forward = found.runs[1].forward
    for key, values in (
        ("great-circle", forward.great_circle),
        ("distance", forward.distance),
        ("running-rmse", running_rms(forward.errors.time, forward.distance)),
    ):
        curve = by_key[key].curves[1]
        assert curve.name.startswith("ukf: ")
        np.testing.assert_array_equal(curve.x, forward.errors.time)
        np.testing.assert_array_equal(curve.y, values)
    assert by_key["distance"].curves[1].name == f"ukf: MAE {forward.distance.mean():.3g} m"
    np.testing.assert_array_equal(by_key["altitude"].curves[1].y, found.reference.height + 2.0)
    np.testing.assert_array_equal(by_key["track"].curves[2].y, np.degrees(forward.trajectory.lat))
    assert by_key["track"].ratio == pytest.approx(1.0 / np.cos(np.radians(42.1)), rel=1e-3)


def test_smoother_and_filter_share_a_colour_and_estimators_do_not():
    found = comparison(("ekf", "ukf", "ckf", "iekf", "a", "b"))
    curves = panels(found)[6].curves
    colors = {kind: [curve.color for curve in curves if curve.kind == kind] for kind in ("filter", "smoother")}
    assert colors["filter"] == colors["smoother"] == list(COLORS[:6])
    assert len(set(COLORS)) == len(COLORS) == 8


def test_colours_are_legible_on_white():
    def luminance(color):
        parts = np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
        linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
        return linear @ [0.2126, 0.7152, 0.0722]

    assert all(1.05 / (luminance(color) + 0.05) > 3.0 for color in COLORS)


def test_long_curves_are_thinned_without_losing_a_spike():
    found = comparison(("ekf",), n=20000, smoothed=False)
    found.runs[0].forward.great_circle[12345] = 99.0
    curve = panels(found)[1].curves[0]
    assert curve.y.size <= CURVE_POINTS
    assert curve.y.max() == 99.0


def test_no_line_crosses_the_date_line():
    lon = np.radians(np.concatenate([np.linspace(179.0, 180.0, 100), np.linspace(-180.0, -179.0, 100)]))
    drawn = panels(comparison(lon=lon))
    for panel in (drawn[0], drawn[3]):
        values = panel.curves[1].x if panel.key == "track" else panel.curves[1].y
        assert np.isnan(values).any()
        assert np.nanmax(np.abs(np.diff(values))) < 1.0


def test_the_reference_does_not_set_the_scale():
    found = comparison(n=100)
    longer = trajectory(5000)
    wide = FilterComparison(found.project, longer, True, found.runs)
    assert panels(wide)[2].curves[0].x.max() == 99.0


def test_page_is_self_contained_and_says_what_it_shows(tmp_path):
    found = comparison()
    write_page(tmp_path / "page.html", found)
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert text == render(found)
    head = text[: text.index("<script>")]
    assert "default-src 'none'" in head
    assert not re.search(r'(src|href)="', text[: text.index("<script>")] + text[text.rindex("<script>") :])
    assert "p&lt;1&gt;.toml" in head
    assert "ukf: it &lt;script&gt; wandered" in head
    for _, _, values in found.table():
        for value in values:
            assert f"<td>{value}</td>" in head
    assert "Errors against the truth a&lt;b&gt;.csv" in head
    last = text[text.rindex("<script>const panels = ") :]
    plots = json.loads(last[len("<script>const panels = ") : last.index(";\nfor (const")])
    assert [plot[0] for plot in plots] == [panel.key for panel in panels(found)]
    for key, traces, layout in plots:
        assert f'id="{key}"' in head
        assert "[" in layout["xaxis"]["title"]["text"]
        assert "[" in layout["yaxis"]["title"]["text"]
        shown = [trace["visible"] for trace in traces if "smoothed" in trace["name"]]
        assert shown == ["legendonly"] * 2
    np.testing.assert_allclose(plots[6][1][0]["y"], found.runs[0].forward.distance, rtol=1e-9)


def test_a_broken_covariance_has_a_row_of_its_own():
    found = comparison()
    label = "  epochs of a covariance not positive definite"
    assert label not in [row[0] for row in found.table()]
    found.runs[1].nees["position"].values[:3] = np.nan
    assert (label, "", ["0", "3"]) in found.table()


def test_page_warns_where_there_is_no_truth():
    text = render(comparison(against_truth=False))
    assert '<li class="warning">There is no truth: DIFFERENCES FROM THE FIXES' in text
    assert "NEES" not in text[: text.index("<script>")]


def test_figure_draws_every_panel(tmp_path):
    found = comparison()
    figure = figure_comparison(found)
    by_label = {axes.get_title(): axes for axes in figure.axes}
    assert len(by_label) == 7
    for panel in panels(found):
        axes = by_label[panel.title]
        assert (axes.get_xlabel(), axes.get_ylabel()) == (panel.x, panel.y)
        for line, curve in zip(axes.get_lines(), panel.curves, strict=True):
            np.testing.assert_array_equal(line.get_ydata(), curve.y)
            assert line.get_color() == curve.color
            assert (line.get_linestyle() == "--") == (curve.kind == "smoother")
        if panel.from_zero:
            assert axes.get_ylim()[0] == 0.0
    write_figure(tmp_path / "figure.png", found)
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")


def test_a_start_off_the_scale_is_told():
    found = comparison(("ekf",), smoothed=False)
    found.runs[0].forward.great_circle[2] = 500.0
    axes = next(axes for axes in figure_comparison(found).axes if axes.get_title().startswith("Great-circle"))
    assert axes.get_title().endswith("at the start up to 500 m, off the scale")
    assert axes.get_ylim()[1] < 2.0
    found.runs[0].forward.great_circle[150] = 400.0
    axes = next(axes for axes in figure_comparison(found).axes if axes.get_title().startswith("Great-circle"))
    assert "off the scale" not in axes.get_title()
    assert axes.get_ylim()[1] == pytest.approx(525.0)


def test_figure_needs_no_global_plotting_state(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    figure_comparison(comparison(("ekf",)))


@pytest.mark.parametrize("write", [write_page, write_figure])
def test_a_folder_in_the_way(tmp_path, write):
    with pytest.raises(OutputError, match="is a folder, not a file"):
        write(tmp_path, comparison(("ekf",), n=20))
