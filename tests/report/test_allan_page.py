from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from navfuse.analysis.allan.study import StudySettings, study
from navfuse.io.static_record import Channel, StaticRecord
from navfuse.report.allan_figures import ALLAN_KINDS, duration, figure_allan, row_limits
from navfuse.report.allan_page import render
from navfuse.report.allan_tables import axis_rows, notices, summary_lines, to_dict
from navfuse.report.allan_units import amount

RATE, G = 50.0, 9.80665


@pytest.fixture(scope="module")
def found():
    rng = np.random.default_rng(0)
    gyro = np.radians(0.01) * np.sqrt(RATE) * rng.standard_normal((20_000, 3)) * [1.0, 1.0, 30.0]
    gyro[100:300, 1] = gyro[100, 1]
    accel = np.round(1e-3 * G * rng.standard_normal((20_000, 2)) / 0.01) * 0.01
    channels = [Channel(f"gyro {a}", "gyro", gyro[:, k]) for k, a in enumerate("xyz")]
    channels += [Channel(f"accel {a}", "accel", accel[:, k]) for k, a in enumerate("xy")]
    record = StaticRecord(tuple(channels), RATE, 0.0, "rates", None, "a/b<script>/log.csv")
    return study(record, StudySettings(kinds=("oadev", "mdev"), grid="octave", terms=("N", "B")))


def panels(page):
    data, _ = json.JSONDecoder().raw_decode(page.rsplit("const panels = ", 1)[1])
    return {panel["id"]: panel for panel in data}


def test_nothing_is_fetched_and_the_record_is_only_text(found):
    page = render(found)
    without_plotly = re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r"(src|href)=\"(?!#)", without_plotly)
    assert "default-src 'none'" in page
    assert "a/b&lt;script&gt;/log.csv" in page
    assert "b<script>" not in page


def test_every_curve_has_a_role_in_both_colour_sets_and_every_axis_a_unit(found):
    page = render(found)
    light, dark = page.split("prefers-color-scheme: dark", 1)
    assert len(panels(page)) == 3 * len(found.axes)
    for panel in panels(page).values():
        assert re.search(r"\[.+\]$", panel["x"]["title"])
        assert re.search(r"\[.+\]$", panel["y"]["title"])
        for trace in panel["traces"]:
            assert f"--{trace['role']}: #" in light
            assert f"--{trace['role']}: #" in dark.split("</style>")[0]


def test_deviations_with_intervals_model_and_asymptotes(found):
    panel = panels(render(found))["deviation0"]
    names = [trace["name"] for trace in panel["traces"]]
    assert names[:3] == [
        "overlapping Allan deviation, 68.3 % interval",
        "modified Allan deviation, 68.3 % interval",
        "fitted model",
    ]
    assert names[3].startswith("N = 0.6")
    curve, factor = found.axes[0].curves["oadev"], np.radians(1.0) / 3600.0
    measured = panel["traces"][0]
    assert measured["y"] == pytest.approx(curve.deviation / factor, rel=1e-6)
    assert np.add(measured["y"], measured["up"]) == pytest.approx(curve.high / factor, rel=1e-5)
    assert np.subtract(measured["y"], measured["down"]) == pytest.approx(curve.low / factor, rel=1e-5)
    model = next(trace for trace in panel["traces"] if trace["name"] == "fitted model")
    middle = 100
    wanted = np.sqrt(found.axes[0].identification.allan_variance(np.array([model["x"][middle]])))[0] / factor
    assert model["y"][middle] == pytest.approx(wanted, rel=1e-6)


def test_panels_of_a_sensor_share_limits_that_hold_every_axis(found):
    low, high = row_limits(found, "gyro")
    figure = figure_allan(found)
    shown = [axes for axes in figure.axes if axes.get_visible()]
    assert len(shown) == 5
    for axes, axis in zip(shown, found.axes, strict=True):
        assert axes.get_title() == axis.name
        assert axes.get_xlabel() == "averaging time [s]"
        assert axes.get_ylim() == pytest.approx(row_limits(found, axis.sensor))
    values = np.concatenate([axis.curves["oadev"].deviation for axis in found.of("gyro")]) / (np.radians(1.0) / 3600.0)
    assert low < values.min()
    assert values.max() < high
    page = panels(render(found))
    assert page["deviation0"]["y"]["range"] == page["deviation2"]["y"]["range"]


def test_legends_of_the_figure_stay_off_the_curves(found):
    figure = figure_allan(found)
    figure.canvas.draw()
    for axes in figure.axes:
        if axes.get_visible():
            assert axes.get_legend().get_window_extent().y1 < axes.get_window_extent().y0
            first = axes.get_legend().get_texts()[0].get_text()
            assert first == "measured, 68.3 % interval"


def test_the_model_is_an_allan_deviation_and_is_called_so(found):
    modified = replace(found, settings=replace(found.settings, kinds=("mdev", "oadev")))
    assert "fitted model as Allan deviation" in render(modified)
    labels = [text.get_text() for text in figure_allan(modified).axes[0].get_legend().get_texts()]
    assert "fitted model as Allan deviation" in labels
    deviations = to_dict(found)["axes"]["gyro_x"]["deviations"]
    assert {kind: "model_dph" in entry for kind, entry in deviations.items()} == {"oadev": True, "mdev": False}
    assert "mdev" not in ALLAN_KINDS


def test_the_path_stands_once_and_no_warning_repeats_it(found):
    assert any("gyro y repeats one value" in text for text in notices(found))
    assert not any("log.csv" in text for text in notices(found))
    assert all(text.startswith("log.csv: ") for text in notices(found, "log.csv"))
    assert render(found).count("a/b&lt;script&gt;") == 1


def test_every_number_of_the_summary_has_its_unit(found):
    rows = {row[0]: row for row in axis_rows(found)}
    assert rows["accel x"][3] == "1.02 mg"
    assert rows["gyro x"][3] == ""
    assert any(re.search(r"accel x: mean -?[\d.]+ ug, standard deviation [\d.]+ mg, resolution 1.02 mg;", line)
               for line in summary_lines(found))  # fmt: skip


@pytest.mark.parametrize(
    ("value", "sensor", "text"),
    [
        (np.radians(99.0) / 3600.0, "gyro", "99.00 deg/h"),
        (-np.radians(1.0), "gyro", "-1.000 deg/s"),
        (0.0, "gyro", "0.000 deg/h"),
        (999e-6 * G, "accel", "999.0 ug"),
        (-5e-3 * G, "accel", "-5.000 mg"),
        (-1.016 * G, "accel", "-1.016 g"),
        (np.nan, "accel", "- ug"),
    ],
)
def test_amounts(value, sensor, text):
    assert amount(value, sensor) == text


@pytest.mark.parametrize(
    ("seconds", "text"), [(60.0, "60 s"), (600.0, "10 min"), (7199.0, "120 min"), (10000.0, "2.78 h")]
)
def test_durations(seconds, text):
    assert duration(seconds) == text
