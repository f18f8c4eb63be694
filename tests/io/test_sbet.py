from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from navfuse.core.earth import radii
from navfuse.errors import InputError, NavfuseWarning
from navfuse.io.sbet import read_sbet
from navfuse.io.trajectory_table import read_trajectory

POSPAC = (
    (
        1.516310028360710e05, 5.680211852972264e-01, -2.041654392303940e00, 1.077152953296560e02,
        -2.332420866600025e00, -3.335067504871401e-01, -3.093961631767838e-02,
        -2.813407149321339e-02, -2.429905393889139e-02, 3.046773230278662e00, -2.198414736922658e-02,
        7.859639737752390e-01, 7.849084719295495e-01, -2.978807916450262e-01,
        6.226807982589819e-05, 9.312162756440178e-03, 7.217812320996525e-02,
    ),
    (
        1.516310078318641e05, 5.680211834722869e-01, -2.041654392034053e00, 1.077151424357507e02,
        -2.336228229691271e00, -3.324663118952635e-01, -3.022948961008987e-02,
        -2.813856631423094e-02, -2.425215669392169e-02, 3.047131105236811e00, -2.198416007932108e-02,
        8.397590491636475e-01, 3.252165276637165e-01, -1.558883225990844e-01,
        8.379685112283802e-04, 7.372886784718076e-03, 7.179027672314571e-02,
    ),
)  # fmt: skip
"""Two consecutive records of a file by POSPac, 5 ms apart: the figures in PDAL's SbetReaderTest.cpp."""


def record(time: float = 0.0, **changes: float) -> list[float]:
    motion = ("vx", "vy", "vz", "roll", "pitch", "heading", "wander", "ax", "ay", "az", "wx", "wy", "wz")
    names = ("time", "lat", "lon", "height", *motion)
    values = dict.fromkeys(names, 0.0) | {"time": time, "lat": 0.8, "lon": 0.2, "height": 500.0} | changes
    return list(values.values())


def save(path: Path, rows) -> Path:
    path.write_bytes(b"".join(struct.pack(f"<{len(row)}d", *row) for row in rows))
    return path


def test_signs_of_a_file_by_pospac(tmp_path):
    """Position moves with the decoded velocity, attitude turns with the angular rate, velocity by the acceleration.

    The motion between the records is 11.6 mm, so that the two agree to the noise of the positions only. East would have
    the other sign (0.62 m/s off) with a wander frame of north, east, down, and the height too (0.06 m/s off).
    """
    read = read_sbet(save(tmp_path / "sbet_x.out", POSPAC))
    dt = read.time[1] - read.time[0]
    R_M, R_N = radii(np.sin(read.lat[0]))
    moved = np.array(
        [
            (R_M + read.height[0]) * (read.lat[1] - read.lat[0]),
            (R_N + read.height[0]) * np.cos(read.lat[0]) * (read.lon[1] - read.lon[0]),
            read.height[0] - read.height[1],
        ]
    )
    assert read.velocity_n is not None
    assert read.attitude is not None
    np.testing.assert_allclose(moved / dt, read.velocity_n.mean(axis=0), rtol=0, atol=0.025)
    np.testing.assert_allclose(np.degrees(read.attitude[0]), [-1.611964, -1.392233, 174.567247 + 1.259599], atol=1e-5)
    acceleration = np.diff(read.velocity_n, axis=0)[0] / dt
    heading = read.attitude[0, 2]
    forward = np.array([np.cos(heading), np.sin(heading)]) @ acceleration[:2]
    assert abs(forward - 0.81) < 0.1
    assert np.sign(acceleration[2]) == np.sign(POSPAC[0][13])
    turned = np.diff(read.attitude, axis=0)[0] / dt
    np.testing.assert_allclose(turned[1:], np.mean([row[15:] for row in POSPAC], axis=0), rtol=0, atol=2e-3)


def test_wander_angle(tmp_path):
    """North and 30 degrees of wander: x points 30 degrees west of north, y is to its left; heading is what is left."""
    angle = np.radians(30.0)
    row = record(vx=np.cos(angle), vy=-np.sin(angle), vz=-2.0, heading=np.radians(20.0), wander=angle)
    read = read_sbet(save(tmp_path / "t.sbet", [row]))
    np.testing.assert_allclose(read.velocity_n, [[1.0, 0.0, 2.0]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(np.degrees(read.attitude), [[0.0, 0.0, 350.0]], rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["t.sbet", "sbet_mission.out", "T.SBET"])
def test_read_as_a_trajectory(tmp_path, name):
    path = save(tmp_path / name, [record(k / 10.0) for k in range(10)])
    read = read_trajectory(path)
    assert read.source == str(path)
    np.testing.assert_allclose(read.time, np.arange(10) / 10.0)
    assert read.sd_position is None


def test_longitude_to_360(tmp_path):
    read = read_sbet(save(tmp_path / "t.sbet", [record(lon=4.0), record(1.0, lon=-np.pi), record(2.0, lon=np.pi)]))
    np.testing.assert_allclose(read.lon, [4.0 - 2.0 * np.pi, -np.pi, np.pi], rtol=0, atol=1e-15)


def test_seconds_that_begin_anew(tmp_path):
    path = save(tmp_path / "t.sbet", [record(604799.9), record(0.0), record(0.1)])
    with pytest.warns(NavfuseWarning, match="begin anew at record 2; a week was added"):
        read = read_sbet(path)
    np.testing.assert_allclose(read.time, [604799.9, 604800.0, 604800.1], rtol=0, atol=1e-9)


def test_cut_off(tmp_path):
    path = save(tmp_path / "t.sbet", [record()])
    path.write_bytes(path.read_bytes()[:-3])
    with pytest.raises(InputError, match="133 bytes are not whole SBET records of 136 bytes"):
        read_sbet(path)


def test_big_endian_or_text(tmp_path):
    path = tmp_path / "t.out"
    path.write_bytes(struct.pack(">17d", *record(100.0)))
    with pytest.raises(InputError, match="record 1: the time .* cannot be.*little-endian"):
        read_sbet(path)
    path.write_text("x" * 136)
    with pytest.raises(InputError, match="record 1: the time .* cannot be"):
        read_sbet(path)


def test_not_a_number(tmp_path):
    with pytest.raises(InputError, match="record 2 holds a value that is no number, 1 records do"):
        read_sbet(save(tmp_path / "t.sbet", [record(), record(1.0, vx=np.nan)]))


@pytest.mark.parametrize("changes", [{"lat": 48.0}, {"lon": 11.5}, {"vx": 1e6}, {"pitch": 2.0}, {"heading": 270.0}])
def test_degrees_and_other_absurdities(tmp_path, changes):
    (name,) = changes
    with pytest.raises(InputError, match=f"record 2: .*{name} = .* cannot be"):
        read_sbet(save(tmp_path / "t.sbet", [record(), record(1.0, **changes)]))


@pytest.mark.parametrize("second", [0.0, -1.0])
def test_times_that_do_not_increase(tmp_path, second):
    with pytest.raises(InputError, match="record 2: the time .* does not follow"):
        read_sbet(save(tmp_path / "t.sbet", [record(0.0), record(second)]))


def test_other_files(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_sbet(tmp_path / "t.sbet")
    (tmp_path / "t.sbet").touch()
    with pytest.raises(InputError, match="empty"):
        read_sbet(tmp_path / "t.sbet")
    with pytest.raises(InputError, match=r"known are \.csv, \.parquet, \.pos, \.sbet, \.out"):
        read_trajectory(save(tmp_path / "t.bin", [record()]))


def accuracies(time: float, *values: float) -> list[float]:
    return [time, *values] if values else [time, 0.01, 0.02, 0.03, 0.1, 0.2, 0.3, 1.0, 2.0, 3.0]


def test_accuracies_of_fewer_records(tmp_path):
    sbet = save(tmp_path / "t.sbet", [record(k / 10.0) for k in range(21)])
    smrmsg = save(tmp_path / "smrmsg.out", [accuracies(0.5), [1.5, *(2.0 * np.array(accuracies(0.0)[1:]))]])
    read = read_sbet(sbet, smrmsg)
    assert read.sd_position is not None
    assert read.sd_attitude is not None
    np.testing.assert_allclose(read.sd_position[[0, 5, 10, 20], 0], [0.01, 0.01, 0.015, 0.02], rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.degrees(read.sd_attitude[0]) * 60.0, [1.0, 2.0, 3.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(read.sd_velocity[0], [0.1, 0.2, 0.3], rtol=0, atol=1e-12)


def test_accuracies_of_another_file(tmp_path):
    sbet = save(tmp_path / "t.sbet", [record(k / 10.0) for k in range(21)])
    with pytest.raises(InputError, match="do not belong together"):
        read_sbet(sbet, save(tmp_path / "smrmsg.out", [accuracies(100.0), accuracies(101.0)]))


def test_accuracies_below_zero(tmp_path):
    sbet = save(tmp_path / "t.sbet", [record(k / 10.0) for k in range(21)])
    with pytest.raises(InputError, match="sd_east is negative"):
        read_sbet(sbet, save(tmp_path / "smrmsg.out", [accuracies(1.0, 0.1, -0.1, *[0.1] * 7)]))
