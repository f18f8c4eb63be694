"""The mechanization in both frames against the motion that the increments came from and the differential equations."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.data.nav_state import to_ecef, to_ned
from navfuse.imu.increments import ImuIncrements
from navfuse.mechanization.ecef import step_ecef
from navfuse.mechanization.ned import step_ned
from navfuse.simulation import car_drive, circle_flight, figure_eight_flight, static
from reference.engine_runs import mechanize, nav_at, perfect_increments
from reference.mechanization_twin import integrate_ecef
from reference.navigation_algebra import angle_between, earth_fixed, error, frame_of

FRAMES = pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])

MOTIONS = {
    "car": lambda: car_drive(120.0, seed=3),
    "car across the equator": lambda: car_drive(120.0, seed=4, lat=-2e-6, heading=0.1, standing=2.0),
    "car across the date line": lambda: car_drive(120.0, seed=5, lon=math.pi - 1e-6, heading=1.6, standing=2.0),
    "flight": lambda: figure_eight_flight(120.0, speed=100.0),
    "flight across the equator and the date line": lambda: circle_flight(
        120.0, lat=1e-4, lon=1e-4 - math.pi, heading=3.9, speed=100.0
    ),
    "flight at 86 degrees north": lambda: circle_flight(120.0, lat=1.5, speed=100.0),
    "flight at 86 degrees south": lambda: figure_eight_flight(120.0, lat=-1.5, speed=100.0, heading=4.0),
    "tripod": lambda: static(120.0, roll=3.0, pitch=-1.2, heading=2.0, lat=-0.7),
    "tripod straight up": lambda: static(120.0, pitch=0.5 * math.pi, heading=1.0),
    "tripod on the equator": lambda: static(120.0, lat=0.0, lon=math.pi, heading=1.0),
}


def final_errors(motion, rate, ecef):
    """Position [m], velocity [m/s] and attitude [rad] error at the end of free navigation with ideal sensors."""
    nav, _ = mechanize(perfect_increments(motion, rate), nav_at(motion, motion.start, ecef), ecef)
    d = error(nav_at(motion, motion.end, ecef), nav, ecef)
    return np.linalg.norm(d.reshape(3, 3), axis=1)


@FRAMES
@pytest.mark.parametrize("name", MOTIONS)
def test_perfect_increments_give_the_motion_back(name, ecef):
    position, velocity, attitude = final_errors(MOTIONS[name](), 100.0, ecef)
    assert position < 2e-4
    assert velocity < 1e-6
    assert attitude < 1e-9


@FRAMES
@pytest.mark.parametrize("name", ["car", "flight", "flight at 86 degrees north"])
def test_errors_fall_with_the_square_of_the_interval(name, ecef):
    motion = MOTIONS[name]()
    coarse, fine = final_errors(motion, 20.0, ecef), final_errors(motion, 40.0, ecef)
    assert np.all(coarse > 3.5 * fine)


HOUR = {
    "car": lambda: car_drive(3600.0, seed=3),
    "flight": lambda: figure_eight_flight(3600.0, speed=100.0),
    "straight flight at 250 m/s": lambda: circle_flight(3600.0, heading=0.7, speed=250.0, height=1e4, straight=3600.0),
}


@FRAMES
@pytest.mark.parametrize("name", HOUR)
def test_an_hour_of_free_inertial_navigation_drifts_by_less_than_two_centimetres(name, ecef):
    motion = HOUR[name]()
    nav, rows = mechanize(perfect_increments(motion, 100.0), nav_at(motion, 0.0, ecef), ecef, out_rate=0.1)
    times = 10.0 * np.arange(len(rows))
    assert times[-1] == pytest.approx(motion.end, abs=10.0)
    estimates = {**dict(zip(times, rows, strict=True)), motion.end: nav}
    drift = [
        math.hypot(*error(nav_at(motion, time, ecef=False), to_ned(row) if ecef else row, ecef=False)[:2])
        for time, row in estimates.items()
    ]
    assert max(drift) < 0.02


@FRAMES
@pytest.mark.parametrize(
    ("w", "f"),
    [
        ((0.0, 0.0, 0.0), (0.5, -0.3, -9.7)),
        ((0.3, -0.2, 2.0), (0.5, -0.3, -9.8)),
        ((0.0, 0.7, 0.0), (4.0, 0.0, -9.0)),
        ((-6.0, 0.1, 0.0), (0.0, 1.0, -9.8)),
    ],
    ids=["no rotation", "spin", "looping through the vertical", "roll"],
)
def test_constant_rotation_follows_the_differential_equations(w, f, ecef):
    w, f = np.array(w), np.array(f)
    motion = static(1.0, lat=0.6, lon=-2.0, roll=0.3, pitch=-0.4, heading=5.0)
    nav = nav_at(motion, 0.0, ecef)
    r, v, C = earth_fixed(nav, ecef)
    v = v + C @ np.array([20.0, -3.0, 1.0])
    nav[3:6] = frame_of(nav, ecef) @ v
    time = np.linspace(0.0, 20.0, 2001)
    n = time.size - 1
    increments = ImuIncrements(time, np.tile(0.01 * w, (n, 1)), np.tile(0.01 * f, (n, 1)))
    r1, v1, C1 = integrate_ecef(lambda t: w, lambda t: f, np.array([0.0, 20.0]), r, v, C, max_step=0.2, tolerance=1e-12)
    r2, v2, C2 = earth_fixed(mechanize(increments, nav, ecef)[0], ecef)
    assert np.linalg.norm(r2 - r1[1]) < 2e-3
    assert np.linalg.norm(v2 - v1[1]) < 2e-5
    assert angle_between(C2, C1[1]) < 1e-9


@FRAMES
def test_a_step_returns_the_increment_of_specific_force_in_its_frame(ecef):
    motion = figure_eight_flight(60.0, straight=5.0, bank=0.8)
    increments = perfect_increments(motion, 100.0)
    step = step_ecef if ecef else step_ned
    for k in (100, 1500, 4000):
        nav = nav_at(motion, increments.time[k], ecef)
        returned = step(nav, 0.01, *increments.inc_theta_b[k], *increments.inc_v_b[k])
        nodes, weights = np.polynomial.legendre.leggauss(5)
        at = increments.time[k] + 0.005 * (1.0 + nodes)
        to_m = motion.C_eb(at) if ecef else motion.C_nb(at)
        wanted = 0.005 * np.einsum("p,pij,pj->i", weights, to_m, motion.f_b(at))
        dv = returned if ecef else returned[0]
        assert np.abs(np.array(dv) - wanted).max() < 1e-7
        if not ecef:
            assert returned[1:] == pytest.approx((np.sin(nav[0]), np.cos(nav[0])), rel=1e-14)


@FRAMES
def test_the_quaternion_keeps_its_length(ecef):
    motion = figure_eight_flight(60.0, straight=5.0)
    nav, _ = mechanize(perfect_increments(motion, 100.0), nav_at(motion, 0.0, ecef), ecef)
    assert abs(np.linalg.norm(nav[6:]) - 1.0) < 1e-14


@FRAMES
def test_the_propagator_takes_the_same_steps_as_the_step_function(ecef):
    motion = car_drive(30.0, seed=1, standing=1.0)
    increments = perfect_increments(motion, 50.0)
    nav = nav_at(motion, 0.0, ecef)
    whole, _ = mechanize(increments, nav, ecef)
    step = step_ecef if ecef else step_ned
    for dt, theta, dv in zip(increments.dt, increments.inc_theta_b, increments.inc_v_b, strict=True):
        step(nav, dt, *theta, *dv)
    assert np.array_equal(nav, whole)


def test_gravity_is_all_that_a_body_in_free_fall_feels():
    motion = static(1.0, lat=0.4, height=2000.0)
    time = np.linspace(0.0, 4.0, 401)
    increments = ImuIncrements(time, np.zeros((400, 3)), np.zeros((400, 3)))
    r0, v0, C0 = earth_fixed(nav_at(motion, 0.0, ecef=False), ecef=False)
    r1, v1, _ = integrate_ecef(lambda t: np.zeros(3), lambda t: np.zeros(3), time[[0, -1]], r0, v0, C0)
    end = to_ecef(mechanize(increments, nav_at(motion, 0.0, ecef=False), ecef=False)[0])
    assert np.linalg.norm(end[:3] - r1[1]) < 1e-5
    assert np.linalg.norm(end[3:6] - v1[1]) < 1e-6
