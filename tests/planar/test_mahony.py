"""The filter in space: agrees with the plane, converges, finds a bias; attitude of gravity and field."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from navfuse.errors import ConfigError, InputError
from navfuse.planar import complementary_attitude, complementary_yaw, measured_dcm, planar_dcm


def test_attitude_of_gravity_and_field():
    """Roll, pitch, heading in that convention: C_nb = Rz(heading) Ry(pitch) Rx(roll)."""
    C = Rotation.from_euler("ZYX", [[2.5, -0.3, 0.4], [-1.0, 0.8, -2.0]]).as_matrix()
    field_n = Rotation.from_euler("Z", -0.19).apply([22.0, 0.0, 44.0])
    accel_b = np.einsum("nji,j->ni", C, [0.0, 0.0, -9.81])
    field_b = np.einsum("nji,j->ni", C, field_n)
    np.testing.assert_allclose(measured_dcm(accel_b, field_b, -0.19), C, atol=1e-14)
    with pytest.raises(InputError, match="row 1: specific force and field are parallel"):
        measured_dcm([[0.0, 0.0, -9.8]], [[0.0, 0.0, 40.0]])
    with pytest.raises(InputError, match="parallel or zero"):
        measured_dcm([[0.0, 0.0, 0.0]], [[0.0, 0.0, 40.0]])


def test_about_the_vertical_it_is_the_filter_of_the_plane():
    rng = np.random.default_rng(4)
    time = np.arange(500) * 0.02
    rate = rng.normal(0.0, 2.0, 500)
    yaw = rng.normal(1.0, 0.5, 500)
    yaw[100:120] = np.nan
    dcm = np.zeros((500, 3, 3))
    dcm[:, :2, :2], dcm[:, 2, 2] = planar_dcm(yaw), 1.0
    found, bias = complementary_attitude(time, np.outer(rate, [0.0, 0.0, 1.0]), dcm, 1.5)
    plane = complementary_yaw(time, rate, yaw, 1.5)
    difference = np.arctan2(found[:, 1, 0], found[:, 0, 0]) - plane
    assert np.abs(np.angle(np.exp(1j * difference))).max() < 1e-12
    assert not bias.any()


def test_follows_a_true_attitude_and_stays_a_rotation():
    rng = np.random.default_rng(6)
    time = np.arange(2000) * 0.01
    gyro = rng.normal(0.0, 2.0, (2000, 3))
    C = [np.eye(3)]
    for rate in gyro[1:]:
        C.append(C[-1] @ Rotation.from_rotvec(rate * 0.01).as_matrix())
    C = np.array(C)
    found, _ = complementary_attitude(time, gyro, C, 1.0)
    assert np.abs(found - C).max() < 1e-10
    np.testing.assert_allclose(found[-1] @ found[-1].T, np.eye(3), atol=1e-11)


def test_converges_from_any_axis_as_in_the_plane():
    time = np.linspace(0.0, 4.0, 40_001)
    start = Rotation.from_rotvec(1.2 * np.array([0.6, -0.48, 0.64])).as_matrix()
    measured = np.broadcast_to(np.eye(3), (time.size, 3, 3))
    found, _ = complementary_attitude(time, np.zeros((time.size, 3)), measured, 1.0, start=start)
    angle = Rotation.from_matrix(found).magnitude()
    assert np.abs(angle - 2.0 * np.arctan(np.tan(0.6) * np.exp(-time))).max() < 1e-4


def test_bias_of_the_gyros_is_found():
    time = np.arange(6000) * 0.01
    true_bias = np.array([0.02, -0.05, 0.03])
    measured = np.broadcast_to(Rotation.from_euler("ZYX", [1.0, 0.2, -0.4]).as_matrix(), (time.size, 3, 3))
    found, bias = complementary_attitude(time, np.tile(true_bias, (time.size, 1)), measured, 1.0, 0.2)
    np.testing.assert_allclose(bias[-1], true_bias, atol=1e-5)
    assert np.abs(found[-1] - measured[0]).max() < 1e-4


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"gain": -1.0}, ConfigError, "gain = -1.0"),
        ({"bias_gain": 5.0}, ConfigError, "bias_gain = 5.0"),
        ({"dcm": np.zeros((3, 9))}, InputError, "dcm has shape"),
        ({"dcm": np.full((3, 3, 3), np.nan)}, InputError, "no row holds an attitude"),
        ({"gyro": [[0, 0, 0], [0, 0, np.inf], [0, 0, 0]]}, InputError, "gyro: row 2 is not finite"),
    ],
)
def test_what_cannot_be(changes, error, message):
    given = {"time": [0.0, 0.1, 0.2], "gyro": np.zeros((3, 3)), "dcm": np.tile(np.eye(3), (3, 1, 1))} | changes
    with pytest.raises(error, match=message):
        complementary_attitude(**given)
