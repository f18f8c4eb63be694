from __future__ import annotations

import numpy as np
import pytest

from navfuse.errors import NavfuseWarning
from navfuse.imu.grades import GRADES
from navfuse.io.imu_table import read_imu
from navfuse.io.spikes import spikes
from navfuse.io.tables import write_table
from navfuse.simulation import car_drive, simulate

RATE = 100.0


def log(kind="increments", seed=1):
    motion = car_drive(60.0, seed=seed, standing=5.0)
    return simulate(motion, GRADES["consumer"], seed, imu_rate=RATE, imu_kind=kind).imu


def size(kind, value):
    return value / RATE if kind == "increments" else value


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_a_sound_log_has_none(kind):
    for seed in range(5):
        imu = log(kind, seed)
        assert spikes(imu.time, imu.gyro, imu.accel, kind).size == 0


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize(("sensor", "height"), [("gyro", 8.0), ("gyro", -100.0), ("accel", 150.0), ("accel", -5e4)])
def test_single_wild_rows_are_found(kind, axis, sensor, height):
    imu = log(kind)
    for row in (700, 2500, 5000):
        getattr(imu, sensor)[row, axis] += size(kind, height)
    assert spikes(imu.time, imu.gyro, imu.accel, kind).tolist() == [700, 2500, 5000]


def test_a_shock_that_rings_is_left_alone():
    imu = log()
    ringing = np.exp(-np.arange(30) / 8.0) * np.cos(1.8 * np.arange(30))
    imu.accel[3000:3030, 2] += size("increments", 300.0) * ringing
    assert spikes(imu.time, imu.gyro, imu.accel, "increments").size == 0


def test_a_step_is_left_alone():
    imu = log()
    imu.gyro[3000:, 2] += size("increments", 20.0)
    assert spikes(imu.time, imu.gyro, imu.accel, "increments").size == 0


def test_a_log_that_is_wild_throughout_is_not_judged():
    imu = log()
    rng = np.random.default_rng(0)
    rows = rng.choice(np.arange(5, imu.time.size - 5, 4), imu.time.size // 50, replace=False)
    imu.gyro[rows] += size("increments", 30.0) * rng.standard_normal((rows.size, 3))
    assert spikes(imu.time, imu.gyro, imu.accel, "increments").size == 0


def test_few_rows_are_not_judged():
    assert spikes(np.arange(10.0), np.zeros((10, 3)), np.zeros((10, 3)), "rates").size == 0


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_reading_repairs_and_counts_them(tmp_path, kind):
    imu = log(kind)
    names = ("gyro_{}_radps", "accel_{}_mps2") if kind == "rates" else ("dtheta_{}_rad", "dvel_{}_mps")
    gyro = imu.gyro.copy()
    gyro[2000, 2] = size(kind, 100.0)
    columns = {"time_s": imu.time}
    for name, values in zip(names, (gyro, imu.accel), strict=True):
        columns |= {name.format(axis): values[:, k] for k, axis in enumerate("xyz")}
    write_table(tmp_path / "imu.parquet", columns)
    done = "left out" if kind == "rates" else "interpolated"
    with pytest.warns(NavfuseWarning, match=f"single rows far out .* were {done}: 1 of them, the first is row 2001"):
        read = read_imu(tmp_path / "imu.parquet")
    if kind == "rates":
        assert read.time.size == imu.time.size - 1
        assert 2000 / RATE not in read.time
    else:
        assert np.array_equal(np.delete(read.gyro, 2000, axis=0), np.delete(imu.gyro, 2000, axis=0))
        neighbours = 0.5 * (imu.gyro[1999] + imu.gyro[2001])
        np.testing.assert_allclose(read.gyro[2000], neighbours, rtol=1e-9)
