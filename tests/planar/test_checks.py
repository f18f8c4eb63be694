"""A yaw and a gyro that do not belong together are told apart."""

import numpy as np
import pytest

from navfuse.errors import InputError
from navfuse.planar import check_yaw_against_gyro, magnetic_yaw


@pytest.fixture
def drive():
    rng = np.random.default_rng(9)
    time = np.arange(3000) * 0.02
    rate = 0.8 * np.sin(0.3 * time) + 0.2
    yaw = np.concatenate(([0.4], 0.4 + np.cumsum(rate[1:] * 0.02)))
    field = np.column_stack((22.0 * np.cos(yaw), -22.0 * np.sin(yaw))) + rng.normal(0.0, 0.3, (3000, 2))
    return time, rate + rng.normal(0.0, 0.01, 3000), field


def test_what_belongs_together_has_a_slope_of_one(drive):
    time, rate, field = drive
    yaw = magnetic_yaw(field)
    assert check_yaw_against_gyro(time, rate, yaw) == pytest.approx(1.0, abs=0.05)
    yaw[::2] = np.nan
    assert check_yaw_against_gyro(time, rate, yaw) == pytest.approx(1.0, abs=0.05)
    assert check_yaw_against_gyro(time, rate, np.unwrap(magnetic_yaw(field))) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("signs", [(1, -1), (-1, 1)])
def test_an_inverted_axis_of_the_magnetometer(drive, signs):
    time, rate, field = drive
    with pytest.raises(InputError, match=r"turns against the gyro \(-1\.0\d rad"):
        check_yaw_against_gyro(time, rate, magnetic_yaw(field * signs))


def test_two_inverted_axes_are_half_a_turn_which_only_a_position_shows(drive):
    time, rate, field = drive
    assert check_yaw_against_gyro(time, rate, magnetic_yaw(-field)) == pytest.approx(1.0, abs=0.05)


def test_units(drive):
    time, rate, field = drive
    yaw = magnetic_yaw(field)
    with pytest.raises(InputError, match="gyro_z is in deg/s"):
        check_yaw_against_gyro(time, np.degrees(rate), yaw)
    for degrees in (np.degrees(yaw), np.degrees(yaw) % 360.0, np.degrees(np.unwrap(yaw))):
        with pytest.raises(InputError, match="it is in degrees"):
            check_yaw_against_gyro(time, rate, degrees)


def test_unrelated_and_frozen_yaw(drive):
    time, rate, _ = drive
    noise = np.random.default_rng(1).uniform(-np.pi, np.pi, time.size)
    with pytest.raises(InputError, match="do not turn together"):
        check_yaw_against_gyro(time, rate, noise)
    with pytest.raises(InputError, match="stands still"):
        check_yaw_against_gyro(time, rate, np.zeros_like(time))


def test_a_vehicle_that_does_not_turn_tells_nothing(drive):
    time, _, field = drive
    assert check_yaw_against_gyro(time, np.full_like(time, 0.001), magnetic_yaw(field)) is None
    assert check_yaw_against_gyro(time, np.ones_like(time), np.full_like(time, np.nan)) is None
