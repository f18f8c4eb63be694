from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given

import navfuse
from navfuse.errors import NavfuseWarning
from navfuse.io.exports.pos import write_pos
from navfuse.io.trajectory_table import read_trajectory
from reference.export_tracks import LEAP_SECOND, MIDNIGHT, WEEK_END, export_track, gps_seconds, metres_apart, tracks


def parse(path: Path) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Header, GPS seconds since 1980-01-06 and the fields after them, of a .pos file in GPS time."""
    lines = path.read_text().splitlines()
    header = [line for line in lines if line.startswith("%")]
    rows = [line.split() for line in lines if not line.startswith("%")]
    stamps = []
    for day, clock, *_ in rows:
        clock, _, fraction = clock.partition(".")
        moment = datetime.strptime(f"{day} {clock}", "%Y/%m/%d %H:%M:%S")
        stamps.append((moment - datetime(1980, 1, 6)) / timedelta(seconds=1) + float(f"0.{fraction}"))
    return header, np.array(stamps), np.array([[float(field) for field in row[2:]] for row in rows])


@given(tracks())
def test_an_independent_parse(track):
    with TemporaryDirectory() as folder:
        write_pos(Path(folder) / "t.pos", track)
        header, stamps, rows = parse(Path(folder) / "t.pos")
    assert header[-1].split()[1:4] == ["GPST", "latitude(deg)", "longitude(deg)"]
    np.testing.assert_allclose(stamps, gps_seconds(track), rtol=0, atol=1e-6)
    assert (metres_apart(rows[:, 0], rows[:, 1], track) < 1e-4).all()
    trajectory = track.trajectory
    np.testing.assert_allclose(rows[:, 2], trajectory.height, rtol=0, atol=5.1e-5)
    assert (rows[:, 3] == 1).all()
    assert (rows[:, 4] == 14).all()
    np.testing.assert_allclose(rows[:, 5:8], trajectory.sd_position, rtol=0, atol=5.1e-5)
    assert not rows[:, 8:13].any()
    np.testing.assert_allclose(rows[:, 13:16], trajectory.velocity_n * (1, 1, -1), rtol=0, atol=5.1e-6)
    np.testing.assert_allclose(rows[:, 16:19], trajectory.sd_velocity, rtol=0, atol=5.1e-6)
    assert not rows[:, 19:].any()


def test_the_column_line_is_that_of_rtklib(shared_data, tmp_path):
    """Byte for byte that of RTKPOST 2.4.3, and so are the widths of the rows below it."""
    theirs = (shared_data / "taroz-matrtklib" / "rover_rtk.pos").read_text().splitlines()
    write_pos(tmp_path / "t.pos", export_track())
    ours = (tmp_path / "t.pos").read_text().splitlines()
    first = next(k for k, line in enumerate(theirs) if not line.startswith("%"))
    assert ours[3:5] == theirs[first - 2 : first]
    assert len(ours[5]) == len(theirs[first])
    assert [k for k, sign in enumerate(ours[5]) if sign == "."] == [
        k for k, sign in enumerate(theirs[first]) if sign == "."
    ]


@pytest.mark.parametrize("epoch", [MIDNIGHT, WEEK_END, LEAP_SECOND])
def test_navfuse_reads_it_back(epoch, tmp_path):
    track = export_track(epoch=epoch)
    write_pos(tmp_path / "t.pos", track)
    log = navfuse.read_gnss(tmp_path / "t.pos", epoch=epoch)
    trajectory = track.trajectory
    np.testing.assert_allclose(log.time, trajectory.time, rtol=0, atol=1e-6)
    assert (metres_apart(np.degrees(log.lat), np.degrees(log.lon), track) < 1e-4).all()
    np.testing.assert_allclose(log.height, trajectory.height, rtol=0, atol=5.1e-5)
    np.testing.assert_allclose(log.velocity_n, trajectory.velocity_n, rtol=0, atol=5.1e-6)
    np.testing.assert_allclose(log.sd_position, trajectory.sd_position, rtol=0, atol=5.1e-5)
    np.testing.assert_allclose(log.sd_velocity, trajectory.sd_velocity, rtol=0, atol=5.1e-6)
    assert set(log.fix) == {"rtk-fixed"}
    assert set(log.n_satellites) == {14}


@pytest.mark.parametrize(("lat", "lon"), [(0.0, 100.0), (-33.0, 180.0), (48.0, 0.0)])
def test_navfuse_reads_lines_that_are_crossed(lat, lon, tmp_path):
    """Equator, date line and Greenwich, in the middle of the track."""
    here = export_track(200)
    lon_deg = (lon + np.degrees(here.trajectory.lon - here.trajectory.lon[100]) + 180.0) % 360.0 - 180.0
    track = export_track(
        200, lat=np.radians(lat) + here.trajectory.lat - here.trajectory.lat[100], lon=np.radians(lon_deg)
    )
    write_pos(tmp_path / "t.pos", track)
    trajectory = read_trajectory(tmp_path / "t.pos")
    assert (metres_apart(np.degrees(trajectory.lat), np.degrees(trajectory.lon), track) < 1e-4).all()
    np.testing.assert_allclose(trajectory.velocity_n, track.trajectory.velocity_n, rtol=0, atol=5.1e-6)
    assert trajectory.sd_position is None


def test_dead_reckoning_is_no_fix(tmp_path):
    fix = np.full(100, "rtk-float")
    fix[40:60] = "none"
    track = export_track(fix=fix)
    write_pos(tmp_path / "t.pos", track)
    _, _, rows = parse(tmp_path / "t.pos")
    assert rows[:, 3].tolist() == [2] * 40 + [7] * 20 + [2] * 40
    with pytest.warns(NavfuseWarning, match="20 of 100 rows hold no position"):
        log = navfuse.read_gnss(tmp_path / "t.pos")
    assert len(log.time) == 80
    assert len(read_trajectory(tmp_path / "t.pos")) == 100


@pytest.mark.parametrize(
    ("fix", "code"), [("sbas", 3), ("dgps", 4), ("single", 5), ("ppp", 6), ("no such type", 5), (None, 5)]
)
def test_quality(fix, code, tmp_path):
    write_pos(tmp_path / "t.pos", export_track(5, fix=None if fix is None else np.full(5, fix)))
    assert (parse(tmp_path / "t.pos")[2][:, 3] == code).all()


def test_positions_only(tmp_path):
    track = export_track(
        velocity_n=None, attitude=None, sd_position=None, sd_velocity=None, sd_attitude=None, n_satellites=None
    )
    write_pos(tmp_path / "t.pos", track)
    header, _, rows = parse(tmp_path / "t.pos")
    read = read_trajectory(tmp_path / "t.pos")
    assert "vn(m/s)" not in header[-1]
    assert rows.shape == (100, 13)
    assert not rows[:, 4:].any()
    assert (metres_apart(*np.degrees([read.lat, read.lon]), track) < 1e-4).all()


def test_small_sigmas_are_not_zero(tmp_path):
    """They would read as unknown, or as perfect."""
    write_pos(
        tmp_path / "t.pos", export_track(sd_position=np.full((100, 3), 1e-6), sd_velocity=np.full((100, 3), 1e-9))
    )
    log = navfuse.read_gnss(tmp_path / "t.pos")
    assert (log.sd_position == 1e-4).all()
    assert log.sd_velocity is not None
    assert (log.sd_velocity == 1e-5).all()


def test_height_above_the_geoid(tmp_path):
    """The file says so, and navfuse's reader warns of it."""
    track = replace(export_track(), height="geoid")
    write_pos(tmp_path / "t.pos", track)
    header, _, rows = parse(tmp_path / "t.pos")
    assert "WGS84/geodetic" in header[-2]
    np.testing.assert_allclose(rows[:, 2], track.trajectory.height - 46.1234, rtol=0, atol=5.1e-5)
    with pytest.warns(NavfuseWarning, match="above the geoid"):
        navfuse.read_gnss(tmp_path / "t.pos")


def test_stamps_between_milliseconds(tmp_path):
    """At 30 m/s half a millisecond is 15 mm: the stamps get the digits they need, and the columns move with them."""
    track = export_track(100, time=np.arange(100) / 10.0 + 0.000123)
    write_pos(tmp_path / "t.pos", track)
    header, stamps, _ = parse(tmp_path / "t.pos")
    np.testing.assert_allclose(stamps, gps_seconds(track), rtol=0, atol=1e-6)
    first = (tmp_path / "t.pos").read_text().splitlines()[5]
    assert header[-1].index("latitude(deg)") + len("latitude(deg)") == first.index("48.00") + len("48.000000000")
    np.testing.assert_allclose(
        navfuse.read_gnss(tmp_path / "t.pos", epoch=MIDNIGHT).time, track.trajectory.time, rtol=0, atol=1e-6
    )


def test_a_point_with_line_breaks(tmp_path):
    write_pos(tmp_path / "t.pos", export_track(5, point="roof\n2024/01/01 00:00:00 1 2 3"))
    assert parse(tmp_path / "t.pos")[2].shape[0] == 5
