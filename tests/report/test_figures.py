"""The figures draw what the functions of the report say; every figure has units; every absence has a message."""

from __future__ import annotations

import re
import sys
from dataclasses import replace

import numpy as np
import pytest

import navfuse
from navfuse.analysis.metrics import errors
from navfuse.analysis.separation import separation
from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.imu_overview import ImuOverview
from navfuse.data.result import Innovations, StateHistory
from navfuse.errors import ConfigError, InputError
from navfuse.report import quality
from navfuse.report.figures import (
    FIGURES,
    FigureUnavailable,
    draw,
    figure_attitude,
    figure_biases,
    figure_error_cdf,
    figure_errors,
    figure_gnss_sigmas,
    figure_imu_rate,
    figure_innovations,
    figure_map,
    figure_nis,
    figure_position,
    figure_residuals,
    figure_satellites,
    figure_separation,
    figure_sigmas,
    figure_spectra,
    figure_states,
    figure_velocity,
    names_of,
)
from navfuse.report.figures_style import clock_of, power_text, sheet
from navfuse.report.series import decimate, gaps


@pytest.fixture(scope="module")
def full(drive):
    """The drive with all that a figure can ask for: satellites, fix types, the inertial overview with gaps, a gate."""
    result, truth = drive
    n = result.fixes.time.size
    fix = np.where(np.arange(n) % 7 == 0, "rtk-float", "rtk-fixed")
    fixes = replace(result.fixes, fix=fix, n_satellites=8 + np.arange(n) % 5)
    time = 1000.0 + np.arange(120.0) + 0.5
    frequency = np.linspace(0.1, 50.0, 400)
    imu = ImuOverview(
        time, 100.0 - (np.arange(120) == 40), 100.0, np.array([1040.2, 1090.0]), np.array([0.5, 0.03]), frequency,
        np.outer(1.0 / frequency, [1.0, 2.0, 3.0]) * 1e-6, np.outer(1.0 / frequency, [1.0, 2.0, 3.0]) * 1e-4,
    )  # fmt: skip
    summary = result.summary | {"settings": {"gnss": {"gate_probability": 0.9999}}}
    return replace(result, fixes=fixes, imu=imu, summary=summary), truth


def lines(axes):
    """Label -> (x, y) of the curves of a panel, without their breaks."""
    found = {}
    for line in axes.get_lines():
        x, y = (np.asarray(values, dtype=float) for values in line.get_data())
        keep = np.isfinite(y)
        found.setdefault(line.get_label(), (x[keep], y[keep]))
    return found


def panels(figure):
    return [axes for axes in figure.axes if axes.get_visible()]


def labels_of(figure):
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def same(curve, x, y):
    """Every drawn point is one of the series, and the extremes of the series are drawn."""
    rows = np.searchsorted(x, curve[0])
    np.testing.assert_allclose(curve[0], x[rows], atol=1e-9)
    np.testing.assert_allclose(curve[1], y[rows], rtol=0, atol=1e-9 * max(1.0, np.abs(y).max()))
    assert (curve[1].min(), curve[1].max()) == pytest.approx((y.min(), y.max()), abs=1e-12)


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_has_units_and_a_width(full, name, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    import matplotlib

    before = dict(matplotlib.rcParams)
    figure = draw(name, *full, size="single")
    assert dict(matplotlib.rcParams) == before
    assert figure.get_size_inches()[0] * 25.4 == pytest.approx(88.0)
    assert 40.0 < figure.get_size_inches()[1] * 25.4 < 240.0
    for axes in panels(figure):
        assert re.search(r"\[.+\]$|^fix type$", axes.get_ylabel()), axes.get_ylabel()
        assert axes.yaxis.label.get_fontsize() == 8.0
    stated = [axes.get_xlabel() for axes in panels(figure) if axes.get_xlabel()]
    assert stated
    assert all(text.endswith("]") for text in stated)


def test_map(drive):
    figure = figure_map(*drive)
    (axes,) = figure.axes
    assert axes.get_aspect() == 1.0
    assert labels_of(figure) == [
        "fixes used",
        "fixes rejected",
        "fixes withheld",
        "filter",
        "smoother",
        "truth",
        "start",
    ]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("east of the start [m]", "north of the start [m]")
    assert labels_of(figure_map(replace(drive[0], fixes=None))) == ["filter", "smoother", "start"]


def test_a_map_follows_tracks_and_used_fixes_and_counts_what_is_outside(drive):
    result, truth = drive
    lat = result.fixes.lat.copy()
    lat[25] += 1.0
    figure = figure_map(replace(result, fixes=replace(result.fixes, lat=lat)), truth)
    assert "fixes rejected (1 of 3 outside)" in labels_of(figure)
    low, high = figure.axes[0].get_ylim()
    assert high - low < 1000.0


def test_a_long_way_is_drawn_in_kilometres(drive):
    result = replace(drive[0], fixes=None, smoothed=None)
    forward = result.forward
    far = replace(forward, lat=forward.lat[0] + 20.0 * (forward.lat - forward.lat[0]))
    axes = figure_map(replace(result, forward=far)).axes[0]
    assert axes.get_ylabel() == "north of the start [km]"
    north = lines(axes)["filter"][1]
    assert np.ptp(north) == pytest.approx(np.ptp(far.lat) * 6.37e3, rel=0.02)


def test_a_track_over_the_date_line_stays_in_one_piece(drive):
    result, truth = drive

    def moved(track):
        lon = track.lon - result.forward.lon[0] + np.pi - 2e-5
        return replace(track, lon=np.mod(lon + np.pi, 2.0 * np.pi) - np.pi)

    here = lines(figure_map(result, truth).axes[0])["truth"]
    there_result = replace(result, forward=moved(result.forward), smoothed=moved(result.smoothed), fixes=None)
    there = lines(figure_map(there_result, moved(truth)).axes[0])["truth"]
    np.testing.assert_allclose(there[0], here[0], atol=0.01)


def test_errors_are_those_of_the_comparison(drive):
    result, truth = drive
    figure = figure_errors(result, truth, skip_s=10.0)
    found = panels(figure)
    assert [axes.get_ylabel() for axes in found][::3] == ["north [m]", "east [m]", "down [m]"]
    assert [axes.get_ylabel() for axes in found][2::3] == ["roll [deg]", "pitch [deg]", "heading [deg]"]
    assert [axes.get_title() for axes in found[:3]] == ["position error", "velocity error", "attitude error"]
    assert found[-1].get_xlabel() == "time [s]"
    for label, track in (("filter", result.forward), ("smoother", result.smoothed)):
        series = errors(track, truth, skip_s=10.0)
        same(lines(found[0])[label], series.time, series.position[:, 0])
        same(lines(found[8])[label], series.time, np.degrees(series.attitude[:, 2]))
    assert labels_of(figure) == ["filter ±3σ", "filter", "smoother ±3σ", "smoother", "no position fix used"]
    assert found[0].get_lines()[0].get_linestyle() != found[0].get_lines()[1].get_linestyle()
    shown = np.abs(found[0].get_ylim())
    assert (shown > np.abs(found[0].get_lines()[0].get_ydata()).max()).all()


def test_a_truth_with_positions_only_gives_one_column(drive):
    result, truth = drive
    bare = replace(truth, velocity_n=None, attitude=None)
    assert len(figure_errors(replace(result, smoothed=None), bare).axes) == 3
    exact = replace(result, forward=bare, smoothed=None)
    assert len(figure_errors(exact, bare).axes) == 3


def test_outages_are_shaded(drive):
    result, truth = drive
    shaded = [c for c in figure_errors(result, truth).axes[0].collections if c.get_label() == "no position fix used"]
    corners = [path.get_extents() for path in shaded[0].get_paths()]
    assert [(box.x0, box.x1) for box in corners] == [(w.start, w.end) for w in gaps(result)]
    alone = figure_position(replace(result, innovations=Innovations.empty()))
    assert "no position fix used" not in labels_of(alone)


def test_a_spike_survives_the_thinning(make_drive):
    result, _ = make_drive(duration_s=400.0, rate_hz=20.0)
    height = result.forward.height.copy()
    height[4321] += 77.0
    spiked = replace(result, forward=replace(result.forward, height=height), smoothed=None)
    x, y = lines(figure_position(spiked).axes[2])["filter"]
    assert x.size <= 2000 < height.size
    assert y.max() == height[4321]
    np.testing.assert_array_equal(y, height[decimate(height, 2000)])


def test_a_curve_breaks_where_the_trajectory_does(drive):
    result = drive[0]
    keep = (result.forward.time < 1030.0) | (result.forward.time > 1040.0)
    holed = replace(result, forward=result.forward.take(keep), smoothed=None)
    x, y = figure_velocity(holed).axes[0].get_lines()[0].get_data()
    assert np.isnan(y[(x > 1030.0) & (x < 1040.0)]).all()
    assert np.isnan(y).sum() == 1


def test_motion_is_the_trajectory(drive):
    result, truth = drive
    velocity, attitude = figure_velocity(result, truth), figure_attitude(result, truth)
    same(lines(velocity.axes[1])["smoother"], result.smoothed.time, result.smoothed.velocity_n[:, 1])
    same(lines(attitude.axes[1])["filter"], result.forward.time, np.degrees(result.forward.attitude[:, 1]))
    heading = attitude.axes[2].get_lines()[0].get_ydata()
    assert np.nanmax(np.abs(np.diff(heading))) < 180.0


def test_a_longer_truth_does_not_widen_the_motion(drive, make_drive):
    result, _ = drive
    longer = make_drive(duration_s=300.0)[1]
    x, _ = lines(figure_position(result, longer).axes[0])["truth"]
    assert x.max() == result.forward.time[-1]
    elsewhere = replace(longer, time=longer.time + 1e4)
    assert "truth" not in labels_of(figure_map(result, elsewhere))


def test_spikes_do_not_hide_the_band(drive):
    result, _ = drive
    track = result.forward
    height = track.height.copy()
    height[[300, 900]] += (500.0, -500.0)
    calm = figure_separation(result).axes
    spiky = figure_separation(replace(result, forward=replace(track, height=height))).axes
    down = next(k for k, axes in enumerate(calm) if axes.get_ylabel().startswith("down"))
    assert spiky[down].get_ylim()[1] < 3.0 * calm[down].get_ylim()[1]
    marks = [line for line in spiky[down].lines if line.get_label() == "beyond the axis"]
    assert [line.get_marker() for line in marks] == ["v", "^"]
    assert not [line for line in calm[down].lines if line.get_label() == "beyond the axis"]


def test_sigmas_and_separation(drive):
    result, _ = drive
    axes = figure_sigmas(result).axes
    assert axes[0].get_yscale() == "log"
    same(lines(axes[0])["smoother"], result.smoothed.time, result.smoothed.sd_position[:, 0])
    found = separation(result.forward, result.smoothed)
    figure = figure_separation(result)
    same(lines(figure.axes[0])["filter − smoother"], found.time, found.position[:, 0])
    assert lines(figure_separation(result, skip_s=60.0).axes[0])["filter − smoother"][0].min() == 1060.0


def test_the_error_cdf_says_what_the_percentiles_say(drive):
    result, truth = drive
    figure = figure_error_cdf(result, truth)
    series = errors(result.forward, truth)
    magnitude, share = quality.error_cdf(series.columns()["position_horizontal"])
    x, y = lines(figure.axes[0])["filter"]
    np.testing.assert_allclose(np.interp(x, magnitude, 100.0 * share), y, atol=1e-9)
    found = quality.position_percentiles(series)
    note = figure.axes[0].texts[0].get_text()
    assert f"filter: CEP50 {found.cep50:.3g} m, CEP95 {found.cep95:.3g} m" in note
    assert f"LE95 {found.le95:.3g} m" in figure.axes[1].texts[0].get_text()


def test_innovations_stand_in_their_gates(full):
    result, _ = full
    figure = figure_innovations(result)
    assert [axes.get_ylabel() for axes in figure.axes] == ["north [m]", "east [m]", "down [m]"]
    assert labels_of(figure) == ["used", "rejected", "withheld", "±3σ", "gate", "no position fix used"]
    records = result.innovations
    used = records.status == "used"
    drawn = next(c for c in figure.axes[1].collections if c.get_label() == "used").get_offsets()
    np.testing.assert_allclose(drawn, np.column_stack((records.time[used], records.z[used, 1])))
    limits = quality.gate_limits(records, 0.9999)
    same(lines(figure.axes[0])["gate"], records.time, np.sqrt(limits) * records.sd[:, 0])


def test_innovations_out_of_range_are_told_at_the_edge(full):
    result = full[0]
    z = result.innovations.z.copy()
    z[25] = 500.0
    figure = figure_innovations(replace(result, innovations=replace(result.innovations, z=z)))
    low, high = figure.axes[0].get_ylim()
    assert high < 50.0
    mark = next(line for line in figure.axes[0].get_lines() if line.get_marker() == "^")
    assert (mark.get_xdata()[0], mark.get_ydata()[0]) == (1026.0, high)
    assert low == -high


def test_nis_and_residuals(full):
    result = full[0]
    figure = figure_nis(result)
    running = quality.running_nis(result.innovations)
    same(lines(figure.axes[1])["running mean"], running.time, running.mean)
    _, bound = lines(figure.axes[0])["χ² 99 %"]
    np.testing.assert_allclose(bound, 11.3449, atol=1e-4)
    counted = result.innovations.select(result.innovations.status != "withheld")
    histogram = quality.residual_histogram(quality.normalised(counted))
    figure = figure_residuals(result)
    np.testing.assert_allclose(lines(figure.axes[0])["standard normal"][1], histogram.expected)
    np.testing.assert_allclose(figure.axes[0].patches[0].get_data().values, histogram.density)
    assert f"n = {histogram.n}, " in figure.axes[0].texts[0].get_text()


def test_states_are_drawn_in_the_unit_of_the_axis(drive):
    result = drive[0]
    figure = figure_states(result)
    assert [axes.get_ylabel() for axes in figure.axes[:2]] == ["x [deg/h]", "x [mg]"]
    bias = result.states["gyro_bias"]
    same(lines(figure.axes[2])["filter"], bias.time, np.degrees(bias.values[:, 1]) * 3600.0)
    own = {"odo scale": StateHistory(bias.time, bias.values[:, :1], bias.sd[:, :1])}
    figure = figure_states(replace(result, states=result.states | own), ["odo scale"])
    assert ([axes.get_ylabel() for axes in figure.axes], figure.axes[0].get_title()) == (["1 [SI]"], "odo scale")
    assert len(panels(figure_biases(replace(result, states=result.states | own)))) == 6


def test_sensors(full):
    result = full[0]
    sigmas = quality.gnss_sigmas(result, "gnss_position")
    figure = figure_gnss_sigmas(result)
    x, y = lines(figure.axes[2])["stated"]
    np.testing.assert_allclose((x, y), (sigmas.time, sigmas.stated[:, 2]))
    figure = figure_satellites(result)
    same(lines(figure.axes[0])["_child0"], result.fixes.time, result.fixes.n_satellites)
    assert [text.get_text() for text in figure.axes[1].get_yticklabels()] == ["rtk-fixed", "rtk-float"]
    figure = figure_imu_rate(result)
    same(lines(figure.axes[0])["rate"], result.imu.time, result.imu.rate)
    assert {"usual: 100 Hz", "gaps: 2"} <= set(labels_of(figure))
    figure = figure_spectra(result)
    assert (figure.axes[1].get_xscale(), figure.axes[1].get_yscale()) == ("log", "log")
    np.testing.assert_allclose(lines(figure.axes[1])["y"][1], np.sqrt(result.imu.accel_psd[:, 1]))
    np.testing.assert_allclose(lines(figure.axes[0])["x"][1], np.degrees(np.sqrt(result.imu.gyro_psd[:, 0])))


def test_many_rare_fix_types_are_put_together(full):
    result = full[0]
    fix = np.array([f"type {k % 12}" for k in range(result.fixes.time.size)])
    figure = figure_satellites(replace(result, fixes=replace(result.fixes, fix=fix)))
    shown = [text.get_text() for text in figure.axes[1].get_yticklabels()]
    assert (len(shown), shown[-1]) == (8, "others")


ABSENT = {
    "errors": (lambda r: r, "errors: needs a truth to compare with; give --truth FILE"),
    "error_cdf": (lambda r: r, "error_cdf: needs a truth"),
    "separation": (lambda r: replace(r, smoothed=None), "separation: this run has no smoother"),
    "velocity": (lambda r: bared(r, velocity_n=None), "velocity: the trajectories of this run have no velocity"),
    "attitude": (lambda r: bared(r, attitude=None), "attitude: the trajectories of this run have no attitude"),
    "sigmas": (lambda r: bared(r, sd_position=None, sd_velocity=None, sd_attitude=None), "no standard deviations"),
    "innovations": (lambda r: replace(r, innovations=Innovations.empty()), "no innovations, it was offered no meas"),
    "nis": (lambda r: replace(r, innovations=late(r)), "no innovations, every measurement came too late"),
    "residuals": (lambda r: replace(r, innovations=withheld(r)), "no measurement of this run was used or rejected"),
    "states": (lambda r: replace(r, states={}), "states: this result has no sensor states (no states.parquet in its f"),
    "biases": (lambda r: replace(r, states={"clock": r.states["gyro_bias"]}), "no inertial biases among its states"),
    "gnss_sigmas": (lambda r: replace(r, fixes=None), "gnss_sigmas: this result has no GNSS fixes (no fixes.parquet"),
    "satellites": (lambda r: r, "satellites: the GNSS log states neither satellites nor fix types"),
    "imu_rate": (lambda r: r, "imu_rate: this result has no overview of the IMU (no imu.json in its folder); run it"),
    "spectra": (lambda r: r, "spectra: this result has no overview of the IMU"),
}


def bared(result, **absent):
    return replace(result, forward=replace(result.forward, **absent), smoothed=replace(result.smoothed, **absent))


def late(result):
    records = result.innovations
    n = len(records)
    nothing = np.full((n, 3), np.nan)
    return replace(
        records, status=np.full(n, "late"), dof=np.zeros(n, int), nis=np.full(n, np.nan), z=nothing, sd=nothing
    )


def withheld(result):
    return replace(result.innovations, status=np.full(len(result.innovations), "withheld"))


@pytest.mark.parametrize("name", ABSENT)
def test_what_is_missing_is_said(drive, name):
    change, message = ABSENT[name]
    with pytest.raises(FigureUnavailable, match=re.escape(message)):
        draw(name, change(drive[0]))


def test_more_that_can_be_missing(full):
    result = full[0]
    short = ImuOverview(*(np.empty(0),) * 2, 0.0, *(np.empty(0),) * 3, *(np.empty((0, 3)),) * 2)
    for figure, message in (
        (figure_imu_rate, "imu_rate: the inertial log is too short"),
        (figure_spectra, "spectra: the"),
    ):
        with pytest.raises(FigureUnavailable, match=message):
            figure(replace(result, imu=short))
    with pytest.raises(FigureUnavailable, match="gnss_sigmas: too few fixes were used"):
        figure_gnss_sigmas(replace(result, innovations=withheld(result)))
    with pytest.raises(FigureUnavailable, match="satellites: the GNSS log of this run is empty"):
        figure_satellites(replace(result, fixes=result.fixes.take(slice(0, 0))))
    with pytest.raises(FigureUnavailable, match="no two epochs after the first 500 s"):
        figure_separation(result, skip_s=500.0)
    with pytest.raises(FigureUnavailable, match="nis: no innovation of this run has a size above zero"):
        figure_nis(replace(result, innovations=replace(result.innovations, nis=np.zeros(len(result.innovations)))))
    with pytest.raises(
        FigureUnavailable, match="no block 'gyro_bais' among gyro_bias, accel_bias; did you mean gyro_bias"
    ):
        figure_states(result, ["gyro_bais"])
    with pytest.raises(FigureUnavailable, match="biases: this result has no sensor states"):
        figure_biases(replace(result, states={}))


def test_a_truth_of_another_time_is_an_error_and_not_just_missing(drive):
    result, truth = drive
    with pytest.raises(InputError, match="no time in common") as found:
        figure_errors(result, replace(truth, time=truth.time + 1e5))
    assert not isinstance(found.value, FigureUnavailable)


@pytest.mark.parametrize("name", ["$x$", "$\\frac", "a_{b}^$", "^_", "\x00\ud800\n", "传感器"])
def test_names_are_text_and_nothing_else(full, name):
    """Drawn outside the settings of the figures too, where matplotlib reads dollars as formulas."""
    result = full[0]
    records = replace(result.innovations, source=np.full(len(result.innovations), name))
    fix = np.full(result.fixes.time.size, name)
    odd = replace(
        result, innovations=records, states={name: result.states["gyro_bias"]}, fixes=replace(result.fixes, fix=fix)
    )
    drawn = name.isascii() and name.isprintable()
    for figure in (figure_innovations(odd), figure_nis(odd), figure_states(odd), figure_satellites(odd)):
        texts = [axes.get_title() for axes in figure.axes] + [t.get_text() for t in figure.axes[-1].get_yticklabels()]
        assert not drawn or any(name.replace("_", " ").strip() in text for text in texts)
    if drawn:
        figure.draw_without_rendering()
        figure_residuals(odd).draw_without_rendering()


def test_a_run_of_three_epochs_and_one_of_one(full):
    result, truth = full
    short = replace(
        result,
        forward=result.forward.take(slice(0, 3)),
        smoothed=result.smoothed.take(slice(0, 3)),
        innovations=result.innovations.select(slice(0, 1)),
        states={name: StateHistory(*(x[:1] for x in history)) for name, history in result.states.items()},
    )
    for name in ("map", "position", "errors", "error_cdf", "separation", "innovations", "residuals", "states"):
        draw(name, short, truth)
    draw("nis", short, truth).draw_without_rendering()
    one = replace(short, forward=result.forward.take(slice(0, 1)), smoothed=None, innovations=Innovations.empty())
    for name in ("position", "sigmas"):
        draw(name, one)
    draw("map", one).draw_without_rendering()


def test_a_still_stretch_is_not_blown_up(drive):
    forward = drive[0].forward
    n = len(forward)
    still = replace(forward, lat=np.full(n, 0.5), lon=np.full(n, 1.0), height=np.full(n, 3.0))
    result = replace(drive[0], forward=still, smoothed=None, fixes=None)
    low, high = figure_map(result).axes[0].get_xlim()
    assert high - low == pytest.approx(0.02)
    low, high = figure_position(result).axes[2].get_ylim()
    assert high - low > 0.01


def test_clocks(drive):
    result = drive[0]
    epoch = GpsEpoch.of(2374, 243258.0)
    known = replace(result, epoch=epoch)
    assert clock_of(result).label == "time [s]"
    assert (clock_of(known).label, clock_of(known).at(1000.0)) == ("GPS time [s of week 2374]", 244258.0)
    utc = clock_of(known, "utc")
    assert utc.label == "UTC, 2025-07-08"
    # GPS 244258 s of the week is 19:50:58 of its third day, 18 leap seconds before that in UTC.
    assert utc.at(1000.0) == pytest.approx(19 * 3600 + 50 * 60 + 40)
    axes = figure_position(known, time="utc").axes[2]
    axes.figure.draw_without_rendering()
    shown = [text.get_text() for text in axes.get_xticklabels()]
    assert "19:51:00" in shown
    far = replace(result, forward=replace(result.forward, time=result.forward.time + 1.7e9))
    assert (clock_of(far).label, clock_of(far).at(1.7e9 + 1000.0)) == ("time since 1700001000 s [s]", 0.0)
    with pytest.raises(ConfigError, match="time 'utc': the GPS time of this run is not known; give gnss.epoch_week_s"):
        clock_of(result, "utc")
    with pytest.raises(ConfigError, match="time 'gsp' has to be one of auto, gps, utc, log; did you mean gps"):
        clock_of(known, "gsp")


def test_sizes():
    assert (sheet("single").width, sheet("double").width, sheet("slide").height) == (88.0, 181.0, 142.875)
    assert (sheet("120x80.5").width, sheet((120.0, 80.5)).height) == (120.0, 80.5)
    for size in ("singel", "120", "axb", "-5x10"):
        with pytest.raises(ConfigError, match="has to be single, double, slide or WIDTHxHEIGHT in millimetres"):
            sheet(size)
    with pytest.raises(ConfigError, match="did you mean single"):
        sheet("singel")
    for size in ("5x100", "100x99999", (float("nan"), 50.0)):
        with pytest.raises(ConfigError, match="is out of the range 20 to 2000 mm"):
            sheet(size)


def test_ticks_of_logarithms_are_numbers():
    assert [power_text(x) for x in (0.01, 50.0, 1e-5, 2e-6, 1e6)] == ["0.01", "50", "10⁻⁵", "2·10⁻⁶", "10⁶"]


def test_names():
    assert names_of("all") == list(FIGURES)
    assert names_of(" map, error-cdf,map") == ["map", "error_cdf"]
    with pytest.raises(ConfigError, match="no figure 'erors'; did you mean errors\\?; there are map, "):
        names_of("erors")
    with pytest.raises(ConfigError, match="no figure is named"):
        names_of([])


def test_the_package_offers_them():
    from navfuse import figures

    assert navfuse.figures is figures
    assert figures.__name__ == "navfuse.figures"
    assert figures.figure_map is figure_map
    assert all(name in figures.__all__ for name in (f"figure_{name}" for name in FIGURES))
