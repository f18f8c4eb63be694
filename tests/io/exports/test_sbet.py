from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import given

from navfuse.data.gps_epoch import GpsEpoch
from navfuse.io.exports.sbet import write_sbet
from navfuse.io.exports.smrmsg import write_smrmsg
from navfuse.io.sbet import read_sbet
from reference.export_tracks import MIDNIGHT, WEEK_END, export_track, gps_seconds, tracks


def records(path: Path, doubles: int) -> np.ndarray:
    return np.array(list(struct.iter_unpack(f"<{doubles}d", path.read_bytes())))


@given(tracks())
def test_an_independent_reader(track):
    """Field by field as the format's table has them; velocities by the formula with the wander angle."""
    with TemporaryDirectory() as folder:
        write_sbet(Path(folder) / "t.sbet", track)
        rows = records(Path(folder) / "t.sbet", 17)
    trajectory = track.trajectory
    assert rows.shape == (len(trajectory), 17)
    weeks = (gps_seconds(track) - rows[:, 0]) / 604800.0
    np.testing.assert_allclose(weeks, np.floor(gps_seconds(track)[0] / 604800.0), rtol=0, atol=1e-11)
    np.testing.assert_array_equal(rows[:, 1], trajectory.lat)
    np.testing.assert_array_equal(rows[:, 2], trajectory.lon)
    np.testing.assert_array_equal(rows[:, 3], trajectory.height)
    x, y, z, wander = *rows[:, 4:7].T, rows[:, 10]
    north, east = x * np.cos(wander) - y * np.sin(wander), -x * np.sin(wander) - y * np.cos(wander)
    np.testing.assert_array_equal(np.column_stack([north, east, -z]), trajectory.velocity_n)
    np.testing.assert_array_equal(rows[:, 7:9], trajectory.attitude[:, :2])
    np.testing.assert_array_equal(rows[:, 9] - wander, trajectory.attitude[:, 2])
    np.testing.assert_array_equal(rows[:, 11:14], track.a_eb_b)
    np.testing.assert_array_equal(rows[:, 14:17], track.w_nb_b)


@given(tracks())
def test_round_trip(track):
    with TemporaryDirectory() as folder:
        write_sbet(Path(folder) / "t.sbet", track)
        write_smrmsg(Path(folder) / "smrmsg_t.out", track)
        read = read_sbet(Path(folder) / "t.sbet", Path(folder) / "smrmsg_t.out")
    trajectory = track.trajectory
    for name in ("lat", "lon", "height", "velocity_n", "attitude", "sd_position", "sd_velocity"):
        np.testing.assert_array_equal(getattr(read, name), getattr(trajectory, name))
    np.testing.assert_allclose(read.sd_attitude, trajectory.sd_attitude, rtol=0, atol=1e-15)


def test_seconds_go_on_at_the_end_of_the_week(tmp_path):
    write_sbet(tmp_path / "t.sbet", export_track(100, epoch=WEEK_END))
    time = records(tmp_path / "t.sbet", 17)[:, 0]
    assert time[0] == 604795.0
    np.testing.assert_allclose(time, 604795.0 + np.arange(100) / 10.0, rtol=0, atol=1e-9)


def test_a_log_that_counts_from_an_earlier_week(tmp_path):
    """Seconds are those of the week of the first epoch, not of the week of the log's epoch."""
    track = export_track(10, epoch=GpsEpoch(2299, 100.0), time=604800.0 + 50.0 + np.arange(10) / 10.0)
    write_sbet(tmp_path / "t.sbet", track)
    np.testing.assert_allclose(records(tmp_path / "t.sbet", 17)[:, 0], 150.0 + np.arange(10) / 10.0, rtol=0, atol=1e-9)


def test_height_above_the_geoid(tmp_path):
    track = replace(export_track(), height="geoid")
    write_sbet(tmp_path / "t.sbet", track)
    np.testing.assert_array_equal(records(tmp_path / "t.sbet", 17)[:, 3], track.trajectory.height - 46.1234)


def test_no_acceleration_and_rate(tmp_path):
    write_sbet(tmp_path / "t.sbet", export_track(a_eb_b=None, w_nb_b=None))
    assert not records(tmp_path / "t.sbet", 17)[:, 11:].any()


def test_smrmsg(tmp_path):
    """0.01, 0.02 and 0.1 degrees are 0.6, 1.2 and 6 minutes of arc."""
    write_smrmsg(tmp_path / "t.out", export_track(50, epoch=MIDNIGHT))
    rows = records(tmp_path / "t.out", 10)
    np.testing.assert_allclose(rows[:, 0], MIDNIGHT.tow + np.arange(50) / 10.0, rtol=0, atol=1e-9)
    expected = [0.01, 0.02, 0.03, 0.011, 0.012, 0.013, 0.6, 1.2, 6.0]
    np.testing.assert_allclose(rows[:, 1:], np.tile(expected, (50, 1)), rtol=0, atol=1e-12)
