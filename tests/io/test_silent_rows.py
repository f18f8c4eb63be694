"""A sensor that fell silent: zeros, or the same row over and over."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.errors import NavfuseWarning
from navfuse.io.imu_table import read_imu
from navfuse.io.repair import silent_rows
from navfuse.io.tables import write_table


def log(n=1000):
    rng = np.random.default_rng(0)
    gyro, accel = rng.normal(0.0, 0.1, (n, 3)), rng.normal(0.0, 0.1, (n, 3))
    accel[:, 2] -= 9.8
    return gyro, accel


def test_a_sound_log_has_none():
    assert not silent_rows(*log()).any()


def test_zeros_are_silent():
    gyro, accel = log()
    gyro[100:150] = accel[100:150] = 0.0
    assert np.flatnonzero(silent_rows(gyro, accel)).tolist() == list(range(100, 150))


def test_stuck_rows_are_silent_but_the_first():
    gyro, accel = log()
    gyro[300:320], accel[300:320] = gyro[300], accel[300]
    assert np.flatnonzero(silent_rows(gyro, accel)).tolist() == list(range(301, 320))


def test_a_few_equal_rows_are_chance():
    gyro, accel = log()
    gyro[300:309], accel[300:309] = gyro[300], accel[300]
    assert not silent_rows(gyro, accel).any()


def test_an_ideal_sensor_at_rest_is_not_silent():
    assert not silent_rows(np.zeros((500, 3)), np.tile([0.0, 0.0, -9.8], (500, 1))).any()


def test_reading_says_how_many_and_where(tmp_path):
    gyro, accel = log()
    gyro[100:150] = accel[100:150] = 0.0
    columns = {"time_s": 0.01 * np.arange(1000)}
    columns |= {f"gyro_{a}_radps": gyro[:, k] for k, a in enumerate("xyz")}
    columns |= {f"accel_{a}_mps2": accel[:, k] for k, a in enumerate("xyz")}
    write_table(tmp_path / "imu.parquet", columns)
    with pytest.warns(NavfuseWarning, match="50 of 1000 rows hold zeros only .* the first at 1 s"):
        read = read_imu(tmp_path / "imu.parquet")
    assert read.time.size == 950
    assert np.diff(read.time).max() == pytest.approx(0.51)
