from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pymap3d
import pytest
from hypothesis import given

from navfuse.errors import ConfigError
from navfuse.io.exports.kitti import write_kitti
from navfuse.io.exports.tum import continuous, write_tum
from reference.export_tracks import LEAP_SECOND, MIDNIGHT, WEEK_END, export_track, tracks


def tum(track, **options) -> tuple[list[str], np.ndarray]:
    """Comments and rows of a TUM file."""
    with TemporaryDirectory() as folder:
        write_tum(Path(folder) / "t.tum", track, **options)
        lines = (Path(folder) / "t.tum").read_text().splitlines()
    return [line for line in lines if line[0] == "#"], np.array(
        [[float(field) for field in line.split(" ")] for line in lines if line[0] != "#"]
    )


def kitti(track, **options) -> np.ndarray:
    """Matrices (n, 3, 4) of a KITTI file."""
    with TemporaryDirectory() as folder:
        write_kitti(Path(folder) / "t.txt", track, **options)
        lines = (Path(folder) / "t.txt").read_text().splitlines()
    return np.array([[float(field) for field in line.split(" ")] for line in lines]).reshape(-1, 3, 4)


def matrices(q: np.ndarray) -> np.ndarray:
    """Rotation matrices of unit quaternions x, y, z, w."""
    x, y, z, w = q.T
    return np.moveaxis(
        np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        ),
        -1,
        0,
    )


def body_axes_e(track) -> np.ndarray:
    """Forward, right and down of the body as ECEF vectors, columns of (n, 3, 3), by the definitions of the angles."""
    axes = []
    rows = zip(track.trajectory.lat, track.trajectory.lon, track.trajectory.attitude, strict=True)
    for lat, lon, (roll, pitch, heading) in rows:
        north = np.array([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
        east = np.array([-np.sin(lon), np.cos(lon), 0.0])
        down = -np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
        ahead = np.cos(heading) * north + np.sin(heading) * east
        right = -np.sin(heading) * north + np.cos(heading) * east
        forward = np.cos(pitch) * ahead - np.sin(pitch) * down
        below = np.sin(pitch) * ahead + np.cos(pitch) * down
        axes.append([forward, np.cos(roll) * right + np.sin(roll) * below, np.cos(roll) * below - np.sin(roll) * right])
    return np.moveaxis(np.array(axes), 1, 2)


def enu_e(track) -> np.ndarray:
    """East, north and up of the first epoch as ECEF vectors, columns."""
    lat, lon = track.trajectory.lat[0], track.trajectory.lon[0]
    east = [-np.sin(lon), np.cos(lon), 0.0]
    north = [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)]
    return np.column_stack([east, north, np.cross(east, north)])


def ecef(track) -> np.ndarray:
    t = track.trajectory
    return np.column_stack(pymap3d.geodetic2ecef(t.lat, t.lon, t.height, deg=False))


@given(tracks())
def test_tum(track):
    comments, rows = tum(track)
    assert comments[0].startswith("# world enu, body flu, time log, point: IMU")
    assert comments[1] == "# timestamp tx ty tz qx qy qz qw"
    np.testing.assert_allclose(rows[:, 0], track.trajectory.time, rtol=0, atol=5.1e-7)
    r_e = ecef(track)
    np.testing.assert_allclose(rows[:, 1:4], (r_e - r_e[0]) @ enu_e(track), rtol=0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(rows[:, 4:], axis=1), 1.0, rtol=0, atol=3e-9)
    flu_e = body_axes_e(track) * (1.0, -1.0, -1.0)
    np.testing.assert_allclose(matrices(rows[:, 4:]), enu_e(track).T @ flu_e, rtol=0, atol=2e-8)
    assert rows[0, 7] >= 0.0


@given(tracks())
def test_kitti(track):
    poses = kitti(track)
    first, r_e = body_axes_e(track)[0], ecef(track)
    rdf_e = body_axes_e(track)[:, :, [1, 2, 0]]
    np.testing.assert_allclose(poses[0], np.eye(3, 4), rtol=0, atol=2e-16)
    np.testing.assert_allclose(poses[:, :, :3], first[:, [1, 2, 0]].T @ rdf_e, rtol=0, atol=2e-9)
    expected = (r_e - r_e[0]) @ first[:, [1, 2, 0]]
    np.testing.assert_allclose(poses[:, :, 3], expected, rtol=5e-10, atol=2e-8)


@pytest.mark.parametrize("body", ["flu", "frd", "rdf"])
@pytest.mark.parametrize("world", ["enu", "ned", "first"])
def test_every_choice_of_frames(world, body):
    """TUM and KITTI of the same frames agree, and all choices are the same motion."""
    track = export_track(40)
    poses = kitti(track, world=world, body=body)
    comments, rows = tum(track, world=world, body=body)
    assert comments[0].startswith(f"# world {world}, body {body},")
    np.testing.assert_allclose(matrices(rows[:, 4:]), poses[:, :, :3], rtol=0, atol=1e-8)
    np.testing.assert_allclose(rows[:, 1:4], poses[:, :, 3], rtol=0, atol=1e-6)
    axes = {"flu": [0, -1, -2], "frd": [0, 1, 2], "rdf": [1, 2, 0]}[body]
    signs = {"flu": (1.0, -1.0, -1.0)}.get(body, (1.0, 1.0, 1.0))
    body_e = body_axes_e(track)[:, :, np.abs(axes)] * signs
    enu = enu_e(track)
    world_e = {"enu": enu, "ned": enu[:, [1, 0, 2]] * (1.0, 1.0, -1.0), "first": body_e[0]}[world]
    np.testing.assert_allclose(poses[:, :, :3], world_e.T @ body_e, rtol=0, atol=2e-9)


@pytest.mark.parametrize(
    ("attitude", "quaternion"),
    [
        ((0.0, 0.0, 90.0), (0.0, 0.0, 0.0, 1.0)),
        ((0.0, 0.0, 0.0), (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))),
        ((0.0, 10.0, 90.0), (0.0, -np.sin(np.radians(5.0)), 0.0, np.cos(np.radians(5.0)))),
        ((10.0, 0.0, 90.0), (np.sin(np.radians(5.0)), 0.0, 0.0, np.cos(np.radians(5.0)))),
        ((0.0, 0.0, 180.0), (0.0, 0.0, -np.sqrt(0.5), np.sqrt(0.5))),
    ],
)
def test_tum_of_plain_attitudes(attitude, quaternion):
    """Looking east is the unit quaternion; nose up turns against y, which points left; a right roll with x."""
    _, rows = tum(export_track(1, attitude=np.radians([attitude])))
    np.testing.assert_allclose(rows[0, 4:], quaternion, rtol=0, atol=1e-9)


def test_kitti_of_a_drive():
    """10 m ahead is z, then 5 m to the right is x, 2 m up is minus y, whatever the heading."""
    heading = np.radians(30.0)
    origin = (48.0, 11.5, 500.0)
    steps = [(0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (10.0, 5.0, 0.0), (10.0, 5.0, 2.0)]
    points = [
        pymap3d.enu2geodetic(
            ahead * np.sin(heading) + right * np.cos(heading),
            ahead * np.cos(heading) - right * np.sin(heading),
            up,
            *origin,
        )
        for ahead, right, up in steps
    ]
    lat, lon, height = (np.array(column) for column in zip(*points, strict=True))
    track = export_track(
        4, lat=np.radians(lat), lon=np.radians(lon), height=height, attitude=np.tile([0.0, 0.0, heading], (4, 1))
    )
    expected = [(0.0, 0.0, 0.0), (0.0, 0.0, 10.0), (5.0, 0.0, 10.0), (5.0, -2.0, 10.0)]
    np.testing.assert_allclose(kitti(track)[:, :, 3], expected, rtol=0, atol=1e-6)


def test_quaternions_do_not_jump():
    """Two full turns: the sign never flips between neighbours, though every quaternion has a twin of either sign."""
    n = 400
    attitude = np.column_stack([np.zeros(n), np.zeros(n), np.linspace(0.0, 4.0 * np.pi, n) % (2.0 * np.pi)])
    _, rows = tum(export_track(n, attitude=attitude))
    assert (np.sum(rows[1:, 4:] * rows[:-1, 4:], axis=1) > 0.99).all()
    assert rows[:, 7].min() < -0.9
    jumping = rows[:, 4:] * np.where(np.arange(n) % 3, 1.0, -1.0)[:, None]
    np.testing.assert_allclose(continuous(jumping), rows[:, 4:], rtol=0, atol=1e-15)


@pytest.mark.parametrize("epoch", [MIDNIGHT, WEEK_END])
def test_tum_times(epoch):
    track = export_track(100, epoch=epoch)
    gps = 2300 * 604800.0 + epoch.tow + track.trajectory.time
    comments, rows = tum(track, time="gps")
    assert "time gps" in comments[0]
    np.testing.assert_allclose(rows[:, 0], gps, rtol=0, atol=1e-6)
    _, rows = tum(track, time="unix")
    np.testing.assert_allclose(rows[:, 0], gps + 315964800.0 - 18.0, rtol=0, atol=1e-6)


def test_tum_unix_time_in_a_leap_second():
    """1483228800 is 2017-01-01 00:00:00 UTC; the leap second before it has its stamps already."""
    _, rows = tum(export_track(5, rate=1.0, epoch=LEAP_SECOND), time="unix")
    assert (rows[:, 0] - 1483228800.0).tolist() == [-2.0, -1.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize("time", ["gps", "unix"])
def test_tum_without_an_epoch(time):
    with pytest.raises(ConfigError, match=f"a TUM file with time {time} holds GPS time"):
        tum(export_track(epoch=None), time=time)


def test_text_of_the_files(tmp_path):
    """No minus zeros, no exponents in TUM, twelve fields in KITTI, stamps that keep their digits."""
    write_tum(tmp_path / "t.tum", export_track(3), time="gps")
    write_kitti(tmp_path / "t.txt", export_track(3))
    lines = (tmp_path / "t.tum").read_text().splitlines()[2:]
    assert lines[0].startswith("1391212795.000000 0.000000 0.000000 0.000000 ")
    assert all(re.fullmatch(r"-?\d+\.\d{6}( -?\d+\.\d{6}){3}( -?\d\.\d{9}){4}", line) for line in lines)
    lines = (tmp_path / "t.txt").read_text().splitlines()
    assert [len(line.split(" ")) for line in lines] == [12] * 3
    assert "-0.000000000e+00" not in lines[0]
