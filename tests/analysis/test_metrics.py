from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfuse.analysis.metrics import QUANTITIES, ErrorSeries, compare, errors, summarize
from navfuse.data.trajectory import Trajectory
from navfuse.errors import InputError


def path(time, lat_deg=48.0, lon_deg=11.0, source="truth"):
    """Northeast at 10 m/s and climbing, turning at 2 deg/s: positions follow the velocity on the ellipsoid."""
    time = np.asarray(time, dtype=float)
    north, east = 8.0 * (time - time[0]), 6.0 * (time - time[0])
    lat, lon, height = pymap3d.ned2geodetic(north, east, -0.5 * (time - time[0]), lat_deg, lon_deg, 200.0)
    velocity = np.tile([8.0, 6.0, -0.5], (time.size, 1))
    attitude = np.radians(np.column_stack((0.1 * time, -2.0 + 0.0 * time, np.mod(350.0 + 2.0 * time, 360.0))))
    return Trajectory(time, np.radians(lat), np.radians(lon), height, velocity, attitude, source=source)


def moved(trajectory, ned):
    """The trajectory displaced by north, east, down [m], each epoch in its own local axes."""
    lat, lon, height = pymap3d.ned2geodetic(
        *ned, np.degrees(trajectory.lat), np.degrees(trajectory.lon), trajectory.height
    )
    return replace(trajectory, lat=np.radians(lat), lon=np.radians(lon), height=height, source="solution")


@given(
    st.floats(-89.0, 89.0),
    st.floats(-180.0, 180.0),
    st.tuples(*[st.floats(-500.0, 500.0)] * 3),
)
def test_a_displacement_is_found_anywhere(lat_deg, lon_deg, ned):
    truth = path(np.arange(0.0, 3.0), lat_deg, lon_deg)
    found = errors(moved(truth, ned), truth).position
    np.testing.assert_allclose(found, np.tile(ned, (3, 1)), atol=1e-6)


@pytest.mark.parametrize("lat_deg", [90.0, -90.0, 89.99999])
def test_a_displacement_is_found_at_the_poles(lat_deg):
    truth = path(np.arange(0.0, 3.0), lat_deg, 25.0)
    np.testing.assert_allclose(
        errors(moved(truth, (3.0, -4.0, 2.0)), truth).position, [[3.0, -4.0, 2.0]] * 3, atol=1e-6
    )


def test_errors_are_solution_minus_truth():
    truth = path(np.arange(0.0, 20.0))
    solution = replace(
        moved(truth, (1.0, -2.0, 2.0)),
        velocity_n=truth.velocity_n + np.array([0.1, 0.2, -0.2]),
        attitude=truth.attitude + np.radians([0.5, -0.25, 1.0]),
    )
    metrics = compare(solution, truth)
    expected = {
        "position_north": 1.0,
        "position_east": -2.0,
        "position_down": 2.0,
        "position_horizontal": np.sqrt(5.0),
        "position_3d": 3.0,
        "velocity_north": 0.1,
        "velocity_east": 0.2,
        "velocity_down": -0.2,
        "velocity_3d": 0.3,
        "roll": 0.5,
        "pitch": -0.25,
        "heading": 1.0,
    }
    for name, value in expected.items():
        assert metrics.statistics[name].mean == pytest.approx(value, abs=5e-5), name
        assert metrics.statistics[name].rms == pytest.approx(abs(value), abs=5e-5), name
    assert metrics.statistics["attitude_3d"].rms == pytest.approx(1.14, abs=0.03)
    assert metrics.source == "solution against truth"
    assert metrics.consistency == {}


@pytest.mark.parametrize(
    ("estimated", "true", "error"), [(359.9, 0.1, -0.2), (0.1, 359.9, 0.2), (10.0, 370.0, 0.0), (181.0, -180.0, 1.0)]
)
def test_heading_errors_are_wrapped(estimated, true, error):
    truth = path(np.arange(0.0, 3.0))
    truth = replace(truth, attitude=np.radians(np.tile([0.0, 0.0, true], (3, 1))))
    solution = replace(truth, attitude=np.radians(np.tile([0.0, 0.0, estimated], (3, 1))))
    np.testing.assert_allclose(
        np.degrees(errors(solution, truth).attitude), np.tile([0.0, 0.0, error], (3, 1)), atol=1e-9
    )


def test_heading_is_interpolated_through_north():
    truth = path(np.arange(0.0, 9.0))
    every_other = np.arange(0, 9, 2)
    solution = Trajectory(
        truth.time[every_other],
        truth.lat[every_other],
        truth.lon[every_other],
        truth.height[every_other],
        attitude=truth.attitude[every_other],
    )
    found = errors(solution, truth)
    assert found.velocity is None
    np.testing.assert_allclose(np.degrees(found.attitude), 0.0, atol=2e-3)


def test_the_angle_between_attitudes_survives_gimbal_lock():
    """Nose straight up, roll and heading each 40 deg off but together the same attitude turned by 0.1 deg."""
    truth = path(np.arange(0.0, 3.0))
    truth = replace(truth, attitude=np.tile([np.radians(10.0), np.pi / 2, np.radians(20.0)], (3, 1)))
    solution = replace(truth, attitude=np.tile([np.radians(50.0), np.pi / 2, np.radians(60.1)], (3, 1)))
    np.testing.assert_allclose(np.degrees(errors(solution, truth).attitude_angle), 0.1, atol=1e-6)


@pytest.mark.parametrize("step", [0.01, 0.1, 1.0])
def test_the_truth_may_be_denser_or_sparser(step):
    solution = path(np.arange(0.0, 10.05, 0.1), source="solution")
    truth = path(np.arange(0.0, 10.0 + step / 2, step))
    found = errors(solution, truth)
    assert found.time.size in (truth.time.size, truth.time.size - 1)
    np.testing.assert_allclose(found.position, 0.0, atol=1e-5)
    np.testing.assert_allclose(np.degrees(found.attitude), 0.0, atol=1e-4)


def test_only_the_common_time_is_compared():
    solution, truth = path(np.arange(5.0, 15.05, 0.1)), path(np.arange(0.0, 12.0))
    metrics = compare(solution, truth)
    assert (metrics.start_s, metrics.end_s, metrics.n) == (5.0, 11.0, 7)


def test_skip_and_until_count_from_the_common_start_and_are_half_open():
    solution, truth = path(np.arange(5.0, 30.0)), path(np.arange(0.0, 40.0))
    metrics = compare(solution, truth, skip_s=2.0, until_s=10.0)
    assert (metrics.start_s, metrics.end_s, metrics.n) == (7.0, 14.0, 8)


def test_gaps_are_left_out_and_counted():
    full = path(np.arange(0.0, 60.0))
    keep = (full.time < 20.0) | (full.time > 40.0)
    solution = Trajectory(full.time[keep], full.lat[keep], full.lon[keep], full.height[keep])
    metrics = compare(solution, full)
    assert (metrics.n, metrics.skipped) == (39, 21)
    assert compare(solution, full, max_gap_s=30.0).skipped == 0


def test_nothing_in_common_names_both_spans():
    solution, truth = path(np.arange(0.0, 10.0), source="a.csv"), path(np.arange(100.0, 110.0), source="b.csv")
    with pytest.raises(
        InputError,
        match=r"a\.csv \(0\.000 \.\. 9\.000 s\) and b\.csv \(100\.000 \.\. 109\.000 s\) have no time in common",
    ):
        compare(solution, truth)


def test_nothing_left_to_compare_says_why():
    truth = path(np.arange(0.0, 10.0))
    with pytest.raises(InputError, match=r"nothing to compare from 50 s to the end after the common start 0\.000 s"):
        compare(truth, truth, skip_s=50.0)
    with pytest.raises(InputError, match="from 2 s to 2 s"):
        compare(truth, truth, skip_s=2.0, until_s=2.0)
    solution = path(np.array([0.0, 0.1, 0.2, 9.8, 9.9]))
    with pytest.raises(InputError, match="and 5 epochs fall in gaps"):
        compare(solution, truth, skip_s=2.0, until_s=7.0)


def test_unordered_times_are_refused():
    truth = path(np.arange(0.0, 10.0))
    shuffled = replace(truth, time=truth.time[::-1].copy(), source="backwards.csv")
    with pytest.raises(InputError, match=r"backwards\.csv: time does not increase at row 1"):
        compare(shuffled, truth)
    with pytest.raises(InputError, match=r"backwards\.csv: time does not increase at row 1"):
        compare(truth, shuffled)


def series_of(north, sd=None):
    position = np.column_stack((north, np.zeros_like(north), np.zeros_like(north)))
    return ErrorSeries(np.arange(north.size, dtype=float), position, None, None, None, sd, None, None, 0, "made up")


def test_statistics_of_known_errors():
    north = np.arange(-50.0, 51.0)
    found = summarize(series_of(north)).statistics["position_north"]
    assert found.n == 101
    assert found.mean == pytest.approx(0.0, abs=1e-12)
    assert found.rms == pytest.approx(np.sqrt(50.0 * 51.0 / 3.0))
    assert found[3:] == pytest.approx(np.percentile(np.abs(north), [50, 68, 95, 99, 100]))
    assert found.max == 50.0
    assert summarize(series_of(north - 3.0)).statistics["position_north"].mean == pytest.approx(-3.0)


def test_missing_values_are_not_counted():
    found = summarize(series_of(np.array([3.0, np.nan, -4.0]))).statistics["position_north"]
    assert (found.n, found.max) == (2, 4.0)
    assert found.rms == pytest.approx(np.sqrt(12.5))
    nothing = summarize(series_of(np.full(3, np.nan))).statistics["position_north"]
    assert nothing.n == 0
    assert np.isnan(nothing.rms)


def test_consistency_of_known_errors():
    sd = np.full((100, 3), 2.0)
    rng = np.random.default_rng(3)
    series = replace(series_of(np.zeros(100), sd), position=2.0 * rng.standard_normal((100, 3)))
    right = summarize(series).consistency["position"]
    assert right.n == 300
    assert right.nees_per_dof == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / 300.0))
    assert right.inside_3_sigma > 0.98
    doubled = summarize(replace(series, sd_position=sd / 2.0)).consistency["position"]
    assert doubled.nees_per_dof == pytest.approx(4.0 * right.nees_per_dof)
    exact = summarize(replace(series, position=np.full((100, 3), 6.5))).consistency["position"]
    assert (exact.nees_per_dof, exact.inside_3_sigma) == (pytest.approx(3.25**2), 0.0)


def test_components_without_a_sigma_are_left_out_of_the_consistency():
    sd = np.column_stack((np.ones(4), np.zeros(4), np.full(4, np.nan)))
    assert summarize(series_of(np.ones(4), sd)).consistency["position"].n == 4
    nothing = summarize(series_of(np.ones(4), np.zeros((4, 3)))).consistency["position"]
    assert nothing.n == 0
    assert np.isnan(nothing.nees_per_dof)


def test_sigmas_are_interpolated_and_joined_with_those_of_the_truth():
    time = np.arange(0.0, 5.0)
    solution = replace(path(time), sd_position=np.column_stack([3.0 + 2.0 * time] * 3), sd_velocity=np.ones((5, 3)))
    truth = path(np.array([0.0, 0.5, 2.0]))
    found = errors(solution, truth)
    np.testing.assert_allclose(found.sd_position, np.repeat([[3.0], [4.0], [7.0]], 3, axis=1))
    assert found.sd_attitude is None
    joined = errors(solution, replace(truth, sd_position=np.full((3, 3), 3.0), sd_velocity=np.full((3, 3), np.nan)))
    np.testing.assert_allclose(joined.sd_position[1], 5.0)
    np.testing.assert_allclose(joined.sd_velocity, 1.0)
    assert set(summarize(joined).consistency) == {"position", "velocity"}


def test_dictionary_carries_units_and_is_json():
    truth = path(np.arange(0.0, 10.0))
    found = json.loads(json.dumps(compare(moved(truth, (0.0, 0.0, 1.0)), truth).to_dict()))
    assert set(found["errors"]) >= {"position_north_m", "velocity_3d_mps", "heading_deg", "attitude_3d_deg"}
    assert found["errors"]["position_down_m"]["rms"] == pytest.approx(1.0, abs=1e-6)
    assert (found["epochs"], found["start_s"], found["end_s"]) == (10, 0.0, 9.0)


def test_rows_have_labels_and_units_in_order():
    truth = path(np.arange(0.0, 10.0))
    rows = compare(truth, truth).rows()
    assert [(label, unit) for label, unit, _ in rows][:5] == [
        ("position north", "m"),
        ("position east", "m"),
        ("position down", "m"),
        ("position horizontal", "m"),
        ("position 3-D", "m"),
    ]
    assert len(rows) == len(QUANTITIES)
    bare = Trajectory(truth.time, truth.lat, truth.lon, truth.height)
    assert [label for label, _, _ in compare(truth, bare).rows()][-1] == "position 3-D"
