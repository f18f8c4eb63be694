from __future__ import annotations

from dataclasses import replace

import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfuse.data.result import Innovations, Result
from navfuse.data.trajectory import Trajectory
from navfuse.report.series import (
    break_wraps,
    decimate,
    distance,
    east_north,
    fix_status,
    gaps,
    origin_of,
    thin,
    withheld_windows,
)


def test_local_coordinates_are_the_tangent_plane():
    lat, lon = np.radians([48.0, 48.03, 47.98]), np.radians([11.0, 11.02, 11.05])
    track = Trajectory(np.arange(3.0), lat, lon, np.array([500.0, 520.0, 480.0]))
    east, north, _ = pymap3d.geodetic2enu(
        48.0 + np.array([0.0, 0.03, -0.02]), 11.0 + np.array([0.0, 0.02, 0.05]), track.height, 48.0, 11.0, 500.0
    )
    np.testing.assert_allclose(east_north(track, origin_of(track)), np.column_stack((east, north)), atol=1e-6)


def along_meridian(time, north):
    lat, lon, height = pymap3d.ned2geodetic(north, 0.0 * north, 0.0 * north, 48.0, 11.0, 0.0)
    return Trajectory(time, np.radians(lat), np.radians(lon), height)


def test_distance_is_the_path_and_not_the_noise_of_standing():
    time = np.arange(0.0, 100.0, 0.05)
    north = 10.0 * np.clip(time - 50.0, 0.0, 30.0)
    jitter = 0.02 * np.random.default_rng(0).standard_normal(time.size)
    assert distance(along_meridian(time, north + jitter)) == pytest.approx(300.0, abs=1.0)
    assert distance(along_meridian(time, jitter)) == 0.0


@given(st.integers(1, 5000), st.integers(1, 4), st.integers(20, 3000), st.integers(0, 4999))
def test_decimation_keeps_every_spike_and_the_limit(n, k, limit, spike):
    spike = min(spike, n - 1)
    values = np.random.default_rng(n).uniform(-1.0, 1.0, (n, k))
    values[spike, k - 1] = 100.0
    rows = decimate(values, limit)
    assert rows.size <= max(limit, 2 * k + 2)
    assert spike in rows
    assert rows[0] == 0
    assert rows[-1] == n - 1
    assert (np.diff(rows) > 0).all()
    for column in values.T:
        assert column[rows].min() == column.min()
        assert column[rows].max() == column.max()


def test_decimation_keeps_extremes_of_every_stretch():
    values = np.sin(np.arange(100_000) * 0.7)
    rows = decimate(values, 400)
    assert rows.size <= 400
    for stretch in np.array_split(np.arange(100_000), 50):
        kept = values[rows[(rows >= stretch[0]) & (rows <= stretch[-1])]]
        assert kept.max() > 0.999
        assert kept.min() < -0.999


def test_decimation_keeps_breaks_and_short_curves():
    values = np.zeros(10_000)
    values[5000] = np.nan
    values[7000:7500] = np.nan
    rows = decimate(values, 200)
    assert rows.size <= 200
    assert 5000 in rows
    assert np.isnan(values[rows]).sum() > 3
    np.testing.assert_array_equal(decimate(np.arange(7.0), 7), np.arange(7))
    assert decimate(np.full(50, np.nan), 20).size <= 20


def test_thinning_spreads_points_evenly():
    np.testing.assert_array_equal(thin(5, 10), np.arange(5))
    rows = thin(1001, 11)
    np.testing.assert_array_equal(rows, np.arange(0, 1001, 100))


def test_wraps_become_breaks():
    found = break_wraps(np.array([350.0, 355.0, 2.0, 10.0, 359.0]), 360.0)
    np.testing.assert_array_equal(found, [350.0, 355.0, np.nan, 10.0, np.nan])


def run(time, status, source="gnss_position", span=(0.0, 100.0)):
    m = len(time)
    z = np.column_stack((np.arange(m), np.zeros(m), np.zeros(m))).astype(float)
    records = Innovations(
        np.asarray(time, dtype=float),
        np.full(m, source),
        np.asarray(status),
        np.ones(m),
        np.full(m, 3),
        z,
        np.ones((m, 3)),
        np.arange(m),
    )
    ends = np.array(span)
    return Result(Trajectory(ends, np.zeros(2), np.zeros(2), np.zeros(2)), innovations=records)


def test_gaps_count_the_ends_and_come_longest_first():
    time = np.concatenate((np.arange(5.0, 40.0), np.arange(60.0, 97.0)))
    found = gaps(run(time, np.full(time.size, "used")))
    assert [window[:2] for window in found] == [(39.0, 60.0), (0.0, 5.0), (96.0, 100.0)]


def test_rejected_and_withheld_fixes_do_not_close_a_gap_but_a_reset_does():
    time = np.arange(0.0, 101.0)
    status = np.full(101, "used", dtype="U8")
    status[20:40] = "rejected"
    status[30] = "reset"
    status[70:75] = "withheld"
    assert [window[:2] for window in gaps(run(time, status))] == [(19.0, 30.0), (30.0, 40.0), (69.0, 75.0)]


def test_without_a_used_fix_the_gap_is_the_whole_run():
    assert [window[:2] for window in gaps(run([5.0], ["rejected"]))] == [(0.0, 100.0)]
    assert [window[:2] for window in gaps(run([], np.empty(0, dtype="U8")))] == [(0.0, 100.0)]


def test_withheld_windows_with_their_largest_difference():
    time = np.arange(0.0, 10.0)
    status = np.array(
        ["used", "withheld", "withheld", "used", "rejected", "used", "used", "used", "withheld", "withheld"]
    )
    result = run(time, status)
    found = withheld_windows(result.innovations)
    assert [tuple(window) for window in found] == [(1.0, 2.0, 2.0), (8.0, 9.0, 9.0)]
    blind = replace(result.innovations, z=np.full((10, 3), np.nan))
    assert np.isnan(withheld_windows(blind)[0].largest_m)
    assert withheld_windows(Innovations.empty()) == []


def test_status_of_every_fix(drive):
    result, _ = drive
    status = fix_status(result)
    assert status is not None
    assert {name: int((status == name).sum()) for name in set(status)} == {"used": 96, "rejected": 3, "withheld": 20}
    assert (fix_status(replace(result, innovations=Innovations.empty())) == "unused").all()
    assert fix_status(replace(result, fixes=None)) is None
