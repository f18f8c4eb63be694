from __future__ import annotations

import math

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from navfuse.errors import InputError
from navfuse.simulation import Motion, car_drive, circle_flight, figure_eight_flight, static
from reference.mechanization_twin import W_IE, gravity_e, skew

EARTH_AXIS = np.array([0.0, 0.0, W_IE])


def tumbling(duration: float = 10.0, lat: float = 0.7) -> Motion:
    """Straight up and over with all axes turning at up to 2 rad/s, accelerating at up to 3 g."""
    t = np.linspace(0.0, duration, round(duration * 50) + 1)
    start = np.array(pymap3d.geodetic2ecef(lat, 0.3, 500.0, deg=False))
    r_e = start + np.column_stack([20.0 * np.sin(1.2 * t), 15.0 * np.cos(0.9 * t), 30.0 * np.sin(0.7 * t + 0.3)])
    angles = np.column_stack([1.5 * np.sin(1.1 * t), 1.7 * np.sin(0.8 * t + 1.0), 2.0 * t])
    return Motion.from_knots(t, r_e, Rotation.from_euler("XYZ", angles).as_quat(scalar_first=True))


MOTIONS = {
    "car": lambda: car_drive(60.0, seed=2, standing=5.0),
    "car at the north pole": lambda: car_drive(60.0, seed=2, standing=5.0, lat=math.pi / 2.0),
    "figure eight": lambda: figure_eight_flight(60.0, straight=5.0),
    "circle over the date line": lambda: circle_flight(60.0, lat=-0.4, lon=math.pi, straight=5.0, speed=200.0),
    "tumbling": tumbling,
}


@pytest.fixture(params=MOTIONS, name="motion", scope="module")
def _motion(request):
    return MOTIONS[request.param]()


@pytest.fixture(name="times")
def _times(motion):
    return np.random.default_rng(0).uniform(motion.start + 0.1, motion.end - 0.1, 300)


def test_velocity_is_the_rate_of_position(motion, times):
    h = 1e-3
    numeric = (motion.r_e(times + h) - motion.r_e(times - h)) / (2.0 * h)
    np.testing.assert_allclose(motion.v_e(times), numeric, atol=1e-4)


def test_acceleration_is_the_rate_of_velocity(motion, times):
    h = 1e-3
    numeric = (motion.v_e(times + h) - motion.v_e(times - h)) / (2.0 * h)
    np.testing.assert_allclose(motion.a_e(times), numeric, atol=1e-4)


def test_angular_rate_is_the_rate_of_attitude_against_the_stars(motion, times):
    h = 1e-3

    def attitude(t):
        return Rotation.from_rotvec(np.outer(t, EARTH_AXIS)) * Rotation.from_matrix(motion.C_eb(t))

    numeric = (attitude(times - h).inv() * attitude(times + h)).as_rotvec() / (2.0 * h)
    np.testing.assert_allclose(motion.w_ib_b(times), numeric, atol=1e-5)


def test_angular_rate_against_the_earth_leaves_out_the_earth(motion, times):
    earth_rate_b = np.einsum("kji,j->ki", motion.C_eb(times), EARTH_AXIS)
    np.testing.assert_allclose(motion.w_ib_b(times) - motion.w_eb_b(times), earth_rate_b, atol=1e-12)


def test_specific_force_is_newtons_law_against_the_stars(motion, times):
    h = 1e-3

    def inertial_velocity(t):
        return Rotation.from_rotvec(np.outer(t, EARTH_AXIS)).apply(motion.v_e(t) + np.cross(EARTH_AXIS, motion.r_e(t)))

    acceleration_i = (inertial_velocity(times + h) - inertial_velocity(times - h)) / (2.0 * h)
    acceleration_e = Rotation.from_rotvec(np.outer(times, EARTH_AXIS)).inv().apply(acceleration_i)
    centrifugal = -skew(EARTH_AXIS) @ skew(EARTH_AXIS)
    gravitation = np.array([gravity_e(r) - centrifugal @ r for r in motion.r_e(times)])
    force_b = np.einsum("kji,kj->ki", motion.C_eb(times), acceleration_e - gravitation)
    np.testing.assert_allclose(motion.f_b(times), force_b, atol=1e-4)


def test_quaternion_and_matrices_agree(motion, times):
    q_eb, C_eb = motion.q_eb(times), motion.C_eb(times)
    np.testing.assert_allclose(np.linalg.norm(q_eb, axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(Rotation.from_quat(q_eb, scalar_first=True).as_matrix(), C_eb, atol=1e-14)
    np.testing.assert_allclose(np.einsum("kij,klj->kil", C_eb, C_eb), np.tile(np.eye(3), (300, 1, 1)), atol=1e-14)


def test_trajectory_is_the_motion_in_local_terms(motion, times):
    times = np.sort(times)
    trajectory = motion.trajectory(times)
    r_e = np.column_stack(pymap3d.geodetic2ecef(trajectory.lat, trajectory.lon, trajectory.height, deg=False))
    np.testing.assert_allclose(r_e, motion.r_e(times), atol=1e-8)
    v_e = np.column_stack(pymap3d.ned2ecef(*trajectory.velocity_n.T, trajectory.lat, trajectory.lon, 0.0, deg=False))
    v_e -= np.column_stack(pymap3d.geodetic2ecef(trajectory.lat, trajectory.lon, np.zeros(times.size), deg=False))
    np.testing.assert_allclose(v_e, motion.v_e(times), atol=1e-7)
    C_nb = Rotation.from_euler("ZYX", trajectory.attitude[:, ::-1]).as_matrix()
    np.testing.assert_allclose(C_nb, motion.C_nb(times), atol=1e-9)
    C_ne = np.stack(
        [np.column_stack(_ned_axes(lat, lon)) for lat, lon in zip(trajectory.lat, trajectory.lon, strict=True)]
    )
    np.testing.assert_allclose(np.einsum("kji,kjl->kil", C_ne, motion.C_eb(times)), motion.C_nb(times), atol=1e-12)


def _ned_axes(lat, lon):
    north = [-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)]
    down = [-math.cos(lat) * math.cos(lon), -math.cos(lat) * math.sin(lon), -math.sin(lat)]
    return north, np.cross(down, north), down


@pytest.mark.parametrize("lat_deg", [-90.0, -45.0, 0.0, 30.0, 90.0])
@pytest.mark.parametrize("lon_deg", [0.0, 180.0, -77.0])
def test_a_level_body_at_rest_reads_minus_gravity_and_earth_rate(lat_deg, lon_deg):
    lat, lon = math.radians(lat_deg), math.radians(lon_deg)
    motion = static(10.0, lat, lon, 250.0)
    t = np.linspace(0.0, 10.0, 21)
    g = np.linalg.norm(gravity_e(np.array(pymap3d.geodetic2ecef(lat, lon, 250.0, deg=False))))
    np.testing.assert_allclose(motion.f_b(t), np.tile([0.0, 0.0, -g], (21, 1)), atol=1e-9)
    expected = W_IE * np.array([math.cos(lat), 0.0, -math.sin(lat)])
    np.testing.assert_allclose(motion.w_ib_b(t), np.tile(expected, (21, 1)), atol=1e-14)


def test_a_tilted_body_at_rest_reads_gravity_along_its_own_axes():
    roll, pitch, heading = 0.3, -0.5, 2.0
    motion = static(10.0, 0.9, -1.0, 0.0, roll, pitch, heading)
    C_nb = Rotation.from_euler("ZYX", [heading, pitch, roll]).as_matrix()
    np.testing.assert_allclose(motion.C_nb(5.0), C_nb, atol=1e-9)
    g = np.linalg.norm(motion.f_b(5.0))
    np.testing.assert_allclose(motion.f_b(5.0), g * np.array([math.sin(pitch), -math.sin(roll) * math.cos(pitch), -math.cos(roll) * math.cos(pitch)]), atol=1e-8)  # fmt: skip  # noqa: E501
    np.testing.assert_allclose(
        motion.w_ib_b(5.0), C_nb.T @ [W_IE * math.cos(0.9), 0.0, -W_IE * math.sin(0.9)], atol=1e-14
    )


def test_the_motion_passes_through_its_knots_whatever_the_sign_of_the_quaternions():
    rng = np.random.default_rng(1)
    t = np.sort(rng.uniform(0.0, 10.0, 40))
    r_e = 6.4e6 + np.cumsum(rng.standard_normal((40, 3)), axis=0)
    attitude = Rotation.from_rotvec(np.cumsum(0.1 * rng.standard_normal((40, 3)), axis=0))
    q = attitude.as_quat(scalar_first=True) * rng.choice([-1.0, 1.0], 40)[:, None]
    motion = Motion.from_knots(t, r_e, q)
    assert (motion.start, motion.end) == (t[0], t[-1])
    np.testing.assert_allclose(motion.r_e(t), r_e, atol=1e-8)
    np.testing.assert_allclose(motion.C_eb(t), attitude.as_matrix(), atol=1e-12)


def test_interpolation_error_falls_with_the_sixth_power_of_the_spacing():
    def error(intervals):
        t = np.linspace(0.0, 10.0, intervals + 1)
        r_e = np.column_stack([np.sin(t), np.cos(1.3 * t), t])
        motion = Motion.from_knots(t, r_e, np.tile([1.0, 0.0, 0.0, 0.0], (t.size, 1)))
        s = np.linspace(2.0, 8.0, 1001)
        return np.abs(motion.r_e(s) - np.column_stack([np.sin(s), np.cos(1.3 * s), s])).max()

    assert math.log2(error(40) / error(80)) == pytest.approx(6.0, abs=0.3)


def test_one_time_gives_one_vector_and_order_does_not_matter():
    motion = tumbling()
    times = np.array([7.0, 1.0, 10.0, 0.0])
    for method in (
        motion.r_e,
        motion.v_e,
        motion.a_e,
        motion.w_eb_b,
        motion.w_ib_b,
        motion.f_b,
        motion.q_eb,
        motion.C_eb,
        motion.C_nb,
    ):
        many = method(times)
        for k, t in enumerate(times):
            np.testing.assert_array_equal(method(t), many[k])
    state = motion.at(times)
    np.testing.assert_array_equal(state.f_b, motion.f_b(times))
    np.testing.assert_array_equal(state.time, times)


def test_times_outside_are_refused():
    motion = static(10.0)
    with pytest.raises(InputError, match="known from 0 s to 10 s, not from -1 s to 5 s"):
        motion.r_e([5.0, -1.0])
    with pytest.raises(InputError, match="known from 0 s to 10 s"):
        motion.f_b(10.1)
    with pytest.raises(InputError, match="known from 0 s to 10 s"):
        motion.f_b(math.nan)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t, r, q: (t, r[:-1], q), r"r_e \(n, 3\)"),
        (lambda t, r, q: (t, r, q[:, :3]), r"q_eb \(n, 4\)"),
        (lambda t, r, q: (t[:5], r[:5], q[:5]), "at least 6 knots, not 5"),
        (lambda t, r, q: (t, r * np.nan, q), "must be finite"),
        (lambda t, r, q: (t[[0, 1, 3, 2, 4, 5, 6, 7]], r, q), "must increase"),
    ],
)
def test_impossible_knots_are_refused(change, message):
    t, r_e, q = np.arange(8.0), np.ones((8, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (8, 1))
    with pytest.raises(InputError, match=message):
        Motion.from_knots(*change(t, r_e, q))
