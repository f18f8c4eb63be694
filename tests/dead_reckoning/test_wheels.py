"""Wheels to speed and yaw rate: exact for a rigid vehicle, slip found, impossible geometry refused."""

import numpy as np
import pytest

from navfuse.data.aiding_logs import WheelSpeedLog
from navfuse.dead_reckoning.wheels import Wheel, WheelGeometry, wheel_motion
from navfuse.errors import ConfigError, InputError

MOWER = {
    "front_left": Wheel(0.3, -0.2, steered=True),
    "front_right": Wheel(0.3, 0.2, steered=True),
    "rear_left": Wheel(-0.2, -0.2),
    "rear_right": Wheel(-0.2, 0.2),
}
N = 400
T = 0.5 * np.arange(N)
U = 1.0 + 0.8 * np.sin(0.05 * T)
W = 0.6 * np.sin(0.21 * T)


def rolled(geometry, u=U, w=W, backwards=False):
    """Wheel speeds of a rigid vehicle, from the velocity vector of each wheel."""
    columns = []
    for wheel in geometry.wheels.values():
        ahead = wheel.forward - geometry.axle
        velocity = np.column_stack((u - w * wheel.right, w * ahead))
        sign = -1.0 if backwards else 1.0
        columns.append(sign * np.hypot(*velocity.T) if wheel.steered else velocity[:, 0])
    return WheelSpeedLog(T[: len(u)], tuple(geometry.wheels), np.column_stack(columns))


@pytest.mark.parametrize(
    "names", [tuple(MOWER), ("rear_left", "rear_right"), ("front_left", "rear_left", "rear_right")]
)
def test_a_rigid_vehicle_is_found_exactly(names):
    geometry = WheelGeometry({name: MOWER[name] for name in names})
    found = wheel_motion(rolled(geometry), geometry)
    np.testing.assert_allclose(found.speed, U, atol=1e-9)
    np.testing.assert_allclose(found.yaw_rate, W, atol=1e-9)
    assert not found.slipped.any()
    assert geometry.lever == (0.2, 0.0)
    steps = found.steps()
    np.testing.assert_allclose(steps.distance, 0.5 * U[1:], atol=1e-9)
    np.testing.assert_allclose(found.steps(2.0 * W).turn, W[1:], atol=1e-12)


def test_in_reverse():
    geometry = WheelGeometry(MOWER)
    found = wheel_motion(rolled(geometry, -U, W, backwards=True), geometry)
    np.testing.assert_allclose(found.speed, -U, atol=1e-9)
    np.testing.assert_allclose(found.yaw_rate, W, atol=1e-9)


def test_measured_steering_angles_and_one_wheel_with_a_gyro():
    angle = np.arctan2(W * 0.5, U)
    geometry = WheelGeometry({"front": Wheel(0.3, 0.0, steered=True), "rear": Wheel(-0.2, 0.0)})
    log = rolled(geometry)
    found = wheel_motion(log, geometry, steering={"front": angle}, yaw_rate=W)
    np.testing.assert_allclose(found.speed, U, atol=1e-9)
    one = WheelGeometry({"rear": Wheel(-0.2, 0.3)})
    alone = wheel_motion(rolled(one), one, yaw_rate=W)
    np.testing.assert_allclose(alone.speed, U, atol=1e-9)
    # steering angles alone tell the yaw rate
    np.testing.assert_allclose(wheel_motion(log, geometry, steering={"front": angle}).yaw_rate, W, atol=1e-9)


def test_the_error_is_as_large_as_it_says():
    rng = np.random.default_rng(4)
    geometry = WheelGeometry(MOWER)
    log = rolled(geometry)
    noisy = WheelSpeedLog(log.time, log.wheels, log.speed + 0.02 * rng.standard_normal(log.speed.shape))
    found = wheel_motion(noisy, geometry, sd_speed=0.02)
    for error, sd in ((found.speed - U, found.sd_speed), (found.yaw_rate - W, found.sd_yaw_rate)):
        assert 0.85 < np.mean((error / sd) ** 2) < 1.15
    assert found.slipped.sum() == 0


def test_a_slipping_wheel_is_named_and_left_out():
    geometry = WheelGeometry(MOWER)
    log = rolled(geometry)
    spun = log.speed.copy()
    spun[100:120, 2] += 0.8
    found = wheel_motion(WheelSpeedLog(log.time, log.wheels, spun), geometry, sd_speed=0.02, yaw_rate=W)
    assert found.slipped[100:120, 2].all()
    assert found.slipped.sum() == 20
    assert np.isnan(found.residual[110, 2])
    np.testing.assert_allclose(found.speed, U, atol=1e-9)


def test_a_wheel_without_a_reading_or_not_to_be_trusted_is_not_used():
    geometry = WheelGeometry({**MOWER, "rear_left": Wheel(-0.2, -0.2, used=False)})
    log = rolled(geometry)
    broken = log.speed.copy()
    broken[:, 2] = 50.0
    broken[5, 1] = np.nan
    found = wheel_motion(WheelSpeedLog(log.time, log.wheels, broken), geometry)
    np.testing.assert_allclose(found.speed, U, atol=1e-6)


@pytest.mark.parametrize(
    ("wheels", "message"),
    [
        ({}, "no wheel to use"),
        ({"a": Wheel(0.0, 0.0, used=False)}, "no wheel to use"),
        ({"a": Wheel(0.0, 200.0)}, "places are in metres"),
        ({"a": Wheel(np.nan, 0.0)}, "places are in metres"),
        ({"a": Wheel(0.0, 1.0, steered=True)}, "every wheel is steered"),
        ({"a": Wheel(0.0, -1.0), "b": Wheel(2.5, 1.0)}, "not on one axle"),
        ({"a": Wheel(0.0, -1.0), "b": Wheel(0.0, -1.0)}, "wheels a and b are in one place"),
    ],
)
def test_a_geometry_that_cannot_be(wheels, message):
    with pytest.raises(ConfigError, match=message):
        WheelGeometry(wheels)


def test_wheels_that_do_not_tell():
    geometry = WheelGeometry({"rear": Wheel(-0.2, 0.3)})
    with pytest.raises(ConfigError, match=r"at 0\.000 s the wheels do not tell speed and yaw rate"):
        wheel_motion(rolled(geometry), geometry)
    with pytest.raises(ConfigError, match="has no wheel 'rear'; it has left"):
        wheel_motion(WheelSpeedLog(T, ("left",), np.ones((N, 1))), geometry)
    with pytest.raises(InputError, match=r"yaw_rate has shape \(3,\)"):
        wheel_motion(rolled(geometry), geometry, yaw_rate=np.zeros(3))
    with pytest.raises(ConfigError, match="steering angle of 'rear', which is not a steered wheel"):
        wheel_motion(rolled(geometry), geometry, yaw_rate=W, steering={"rear": W})
    with pytest.raises(ConfigError, match="must be positive"):
        wheel_motion(rolled(geometry), geometry, sd_speed=0.0)
