from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from navfuse.attitude.heading_logs import (
    YawRateLog,
    check_heading_against_gyro,
    magnetic_heading,
    yaw_rate_from_imu,
)
from navfuse.data.aiding_logs import HeadingLog, MagnetometerLog
from navfuse.data.logs import ImuLog
from navfuse.errors import InputError

DEGREE = np.pi / 180.0


def turning(seed=0):
    """A yaw gyro and a compass of 4 deg on a body that turns to and fro by several turns."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 120.0, 0.1)
    rate = 0.5 * np.sin(2.0 * np.pi * time / 40.0)
    yaw = YawRateLog(time, rate + 0.02)
    at = time[::5]
    heading = YawRateLog(time, rate).turned(at) + 1.0 + 4.0 * DEGREE * rng.standard_normal(at.size)
    return yaw, HeadingLog(at, np.mod(heading, 2.0 * np.pi), source="compass.csv")


def test_good_headings_pass():
    assert check_heading_against_gyro(*turning()) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (lambda psi: -psi, "turn against the gyro"),
        (lambda psi: psi * DEGREE, "radians that were read as degrees"),
        (lambda psi: 0.0 * psi + 1.0, "do not turn while the gyro does"),
    ],
)
def test_headings_that_cannot_be_right_are_named(fault, message):
    yaw, heading = turning()
    wrong = HeadingLog(heading.time, np.mod(fault(heading.heading), 2.0 * np.pi), source="compass.csv")
    with pytest.raises(InputError, match=f"compass.csv: .*{message}"):
        check_heading_against_gyro(yaw, wrong)


def test_without_turns_nothing_is_told():
    time = np.arange(0.0, 50.0, 0.5)
    assert check_heading_against_gyro(YawRateLog(time, 0.0 * time), HeadingLog(time, 0.0 * time)) is None


@pytest.mark.parametrize(("roll", "pitch"), [(0.0, 0.0), (0.4, -0.3), (-1.2, 0.9)])
def test_magnetic_heading_of_a_tilted_sensor(roll, pitch):
    heading = np.array([0.1, 2.0, 4.0, 6.2])
    field_n = np.array([20e-6, 0.0, 44e-6])
    C_nb = Rotation.from_euler("ZYX", np.column_stack([heading, np.full(4, pitch), np.full(4, roll)]))
    log = MagnetometerLog(np.arange(4.0), C_nb.inv().apply(field_n))
    np.testing.assert_allclose(magnetic_heading(log, roll, pitch).heading, heading, atol=1e-12)


def test_yaw_rate_of_an_inclined_sensor():
    dt, roll, pitch, yaw_rate = 0.01, 0.3, -0.2, 0.7
    C_nb = Rotation.from_euler("ZYX", [0.0, pitch, roll])
    w_b = C_nb.inv().apply([0.0, 0.0, yaw_rate])
    time = dt * np.arange(100)
    imu = ImuLog(time, np.tile(w_b, (100, 1)), np.zeros((100, 3)))
    log = yaw_rate_from_imu(imu, roll, pitch)
    np.testing.assert_allclose(log.rate, yaw_rate, rtol=1e-12)
    assert log.turned(time)[-1] == pytest.approx(yaw_rate * 0.99, rel=1e-12)
    with pytest.raises(InputError, match="pitch within 80 deg"):
        yaw_rate_from_imu(imu, 0.0, np.radians(85.0))


def test_flawed_logs_are_refused():
    with pytest.raises(InputError, match="row 2 has a rate or stamp that is not finite"):
        YawRateLog(np.arange(4.0), np.array([0.0, 0.0, np.nan, 0.0]))
    with pytest.raises(InputError, match="row 1 .* does not increase"):
        YawRateLog(np.array([0.0, 0.0, 1.0]), np.zeros(3))
    with pytest.raises(InputError, match="one rate per stamp"):
        YawRateLog(np.arange(4.0), np.zeros(3))
    with pytest.raises(InputError, match="row 1 holds no field"):
        magnetic_heading(MagnetometerLog(np.arange(2.0), np.array([[1e-5, 0.0, 0.0], [0.0, 0.0, 0.0]])))
