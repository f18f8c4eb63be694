"""What a run stops for, what it warns of, and that it is silent otherwise."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

from navfuse.errors import InputError
from navfuse.inspection.quick import quick_check
from navfuse.io.gnss_table import read_gnss
from navfuse.io.imu_table import read_imu


@pytest.fixture(scope="module")
def logs(city):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return read_imu(city / "imu.parquet"), read_gnss(city / "gnss.csv")


def test_clean_logs_pass(logs):
    assert quick_check(*logs) == []


def test_an_ideal_sensor_may_have_a_constant_axis(logs):
    imu, gnss = logs
    smooth = np.zeros_like(imu.gyro)
    smooth[:, 2] = 1e-3 * np.sin(0.1 * imu.time)
    assert quick_check(replace(imu, gyro=smooth), gnss) == []


def test_a_dead_axis_stops_the_run(logs):
    imu, gnss = logs
    gyro = imu.gyro.copy()
    gyro[:, 1] = 0.0
    with pytest.raises(InputError, match="gyro along y of the vehicle stays at 0 in all rows"):
        quick_check(replace(imu, gyro=gyro), gnss)


def test_an_axis_that_stuck_for_a_while_is_warned_of(logs):
    imu, _gnss = logs
    accel = imu.accel.copy()
    accel[20000:22000, 0] = accel[20000, 0]
    (note,) = quick_check(replace(imu, accel=accel), None)
    assert "accelerometer along x of the vehicle stays at" in note
    assert "from 200" in note


def test_another_scale_of_time_stops_the_run(logs):
    imu, gnss = logs
    with pytest.raises(InputError, match="imu.time_offset_s = 604800"):
        quick_check(imu, replace(gnss, time=gnss.time + 604800.0))


@pytest.mark.parametrize(("factor", "word"), [(100.0, "too large"), (0.01, "too small")])
def test_absurd_sigmas_are_warned_of(logs, factor, word):
    imu, gnss = logs
    (note,) = quick_check(imu, replace(gnss, sd_position=gnss.sd_position * factor))
    assert word in note
