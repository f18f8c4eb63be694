from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from navfuse.errors import ConfigError
from navfuse.simulation import (
    VEHICLES,
    Accelerate,
    Climb,
    FigureEight,
    Hold,
    Stop,
    Turn,
    aircraft,
    boat,
    car,
    drive,
    drone,
    pedestrian,
)
from reference.missions import NAMES, mission


def velocity_b(motion, time):
    return np.einsum("kji,kj->ki", motion.C_eb(time), motion.v_e(time))


@pytest.fixture(params=NAMES, name="named", scope="module")
def _named(request):
    return request.param, mission(request.param, 120.0)


def test_acceleration_and_angular_rate_are_continuous(named):
    name, motion = named
    inner = motion.knots[1:-1]
    before, after = motion.at(np.nextafter(inner, 0.0)), motion.at(inner)
    np.testing.assert_allclose(before.a_e, after.a_e, atol=1e-6)
    np.testing.assert_allclose(before.w_eb_b, after.w_eb_b, atol=1e-9)
    t = np.arange(0.0, 120.0, 1e-3)
    steepest = {"pedestrian": 400.0}.get(name, 20.0)
    assert np.abs(np.diff(motion.a_e(t), axis=0)).max() < steepest * 1e-3
    assert np.abs(np.diff(motion.w_eb_b(t), axis=0)).max() < steepest * 1e-3


def test_a_car_does_not_slip_even_in_hills():
    motion = mission("car", 120.0)
    t = np.arange(0.0, 120.0, 0.013)
    v_b = velocity_b(motion, t)
    assert np.abs(v_b[:, 1]).max() < 5e-7
    assert v_b[:, 0].min() > -1e-8
    assert np.ptp(motion.trajectory(t).height) > 1.0


def test_a_car_leans_outwards_squats_and_follows_the_slope():
    motion = drive(car(), [Accelerate(20.0, 3.0), Hold(2.0), Climb(20.0, 2.0), Hold(5.0), Turn(3.0, lateral=4.0)])
    t = np.linspace(0.0, motion.end, 5000)
    trajectory, v_b = motion.trajectory(t), velocity_b(motion, t)
    a_b = np.einsum("kji,kj->ki", motion.C_eb(t), motion.a_e(t))
    roll, pitch = trajectory.attitude[:, 0], trajectory.attitude[:, 1]
    np.testing.assert_allclose(roll, -math.radians(4.0) * a_b[:, 1] / 9.80665, atol=3e-4)
    squat = np.arctan2(v_b[:, 2], np.maximum(v_b[:, 0], 1e-3))
    moving = v_b[:, 0] > 0.1
    np.testing.assert_allclose(
        -squat[moving], -math.radians(1.5) * np.gradient(v_b[:, 0], t)[moving] / 9.80665, atol=2e-3
    )
    slope = np.arctan2(-trajectory.velocity_n[:, 2], np.hypot(*trajectory.velocity_n[:, :2].T))
    np.testing.assert_allclose((pitch - slope)[moving], squat[moving], atol=1e-4)
    assert slope[moving].max() == pytest.approx(math.atan(0.1), abs=1e-3)
    assert np.abs(a_b[:, 1]).max() == pytest.approx(4.0, rel=0.01)
    assert np.abs(a_b[:, 0]).max() == pytest.approx(3.0, rel=0.01)


def test_a_standing_car_stands_exactly():
    motion = drive(car(0.05), [Hold(10.0), Accelerate(10.0), Stop(8.0), Accelerate(5.0)], heading=1.0)
    t = np.linspace(0.0, 9.9, 500)
    np.testing.assert_array_equal(motion.v_e(t), 0.0)
    np.testing.assert_array_equal(motion.w_eb_b(t), 0.0)
    still = np.flatnonzero(np.linalg.norm(motion.v_e(np.arange(12.0, motion.end, 0.01)), axis=1) == 0.0)
    assert still.size > 750


@pytest.mark.parametrize("place", [(0.8, 0.2), (0.5 * math.pi, 0.0), (-0.3, math.pi)])
def test_turns_of_an_aircraft_are_coordinated(place):
    motion = drive(aircraft(), [Accelerate(70.0), FigureEight(), Climb(100.0)], lat=place[0], lon=place[1], height=1e3)
    t = np.arange(0.0, motion.end, 0.037)
    force, v_b = motion.f_b(t), velocity_b(motion, t)
    assert np.abs(force[:, 1]).max() < 2e-5
    assert np.abs(v_b[:, 1:]).max() < 2e-5
    bank = math.atan(7.0 / 9.81)
    assert motion.trajectory(t).attitude[:, 0].max() == pytest.approx(bank, abs=0.01)


def test_a_boat_rolls_about_its_course_as_told():
    motion = drive(boat(0.06, 0.02, 0.4, seed=3), [Accelerate(5.0), Hold(900.0)], heading=0.5)
    t = np.arange(60.0, 900.0, 0.1)
    trajectory = motion.trajectory(t)
    assert trajectory.attitude[:, 0].std() == pytest.approx(0.06, rel=0.1)
    assert trajectory.attitude[:, 1].std() == pytest.approx(0.02, rel=0.1)
    assert trajectory.height.std() == pytest.approx(0.4, rel=0.1)
    assert trajectory.attitude[:, 2].mean() == pytest.approx(0.5, abs=0.01)
    north, east = trajectory.velocity_n[:, 0], trajectory.velocity_n[:, 1]
    assert np.abs(east * math.cos(0.5) - north * math.sin(0.5)).max() < 2e-2
    calm = drive(boat(0.0, 0.0, 0.0), [Accelerate(5.0), Turn(2.0)])
    assert np.abs(calm.trajectory(np.linspace(0.0, calm.end, 500)).attitude[:, :2]).max() < 1e-9


def test_a_drone_pushes_along_its_axis_and_balances_drag():
    motion = mission("drone", 120.0)
    t = np.arange(0.0, 120.0, 0.013)
    balanced = motion.f_b(t) + 0.25 * velocity_b(motion, t)
    assert np.abs(balanced[:, :2]).max() < 2e-5
    assert balanced[:, 2].max() < -4.0
    cruise = drive(drone(0.25), [Accelerate(10.0), Hold(20.0)])
    assert cruise.trajectory(cruise.end - 5.0).attitude[0, 1] == pytest.approx(-math.atan(2.5 / 9.81), abs=1e-3)


@pytest.mark.parametrize("side", [0.08, -0.08])
def test_a_foot_stands_exactly_once_a_stride_and_follows_the_walker(side):
    stride = 1.1
    motion = drive(pedestrian(stride, side), [Hold(6.0), Accelerate(1.4), Hold(30.0), Turn(1.5), Stop(5.0)])
    for k in range(int(motion.end / stride)):
        t = stride * k + np.linspace(0.0, 0.9 * stride / 6.0, 30)
        t = t[t <= motion.end]
        np.testing.assert_array_equal(motion.v_e(t), 0.0)
        np.testing.assert_array_equal(motion.w_eb_b(t), 0.0)
    t = np.arange(0.0, motion.end, 0.01)
    speed = np.linalg.norm(motion.v_e(t), axis=1)
    walking = (t > 12.0) & (t < 32.0)
    assert np.mean(speed[walking] < 1e-12) == pytest.approx(1.0 / 3.0, abs=0.06)
    assert 3.0 < speed.max() < 5.0
    trajectory = motion.trajectory(t)
    assert np.ptp(trajectory.height) == pytest.approx(0.12, abs=1e-3)
    distance = np.linalg.norm(motion.r_e(32.0 // stride * stride) - motion.r_e(12.0 // stride * stride))
    assert distance / (32.0 // stride * stride - 12.0 // stride * stride) == pytest.approx(1.4, abs=1e-3)
    walker = drive(
        dataclasses.replace(car(), turn_rate=2.0, ramp=1.0, acceleration=1.0, braking=1.0, lateral=2.0),
        [Hold(6.0), Accelerate(1.4), Hold(30.0)],
    )
    k = stride * 20
    offset = walker.C_eb(k).T @ (motion.r_e(k) - walker.r_e(k))
    np.testing.assert_allclose(offset, [0.0, side, 0.0], atol=1e-3)


def test_the_same_seed_gives_the_same_waves_and_hills():
    for make in (boat, car):
        one, same, other = (
            drive(make(0.05, seed=seed), [Hold(5.0), Accelerate(5.0), Hold(60.0)]).coefficients for seed in (1, 1, 2)
        )
        np.testing.assert_array_equal(one, same)
        assert np.abs(one - other).max() > 1e-3


def test_the_names_of_scenarios_are_the_vehicles():
    assert {name: make().name.split()[1] for name, make in VEHICLES.items()} == dict(
        zip(VEHICLES, VEHICLES, strict=True)
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: car(-0.1), "hills must not be negative, not -0.1"),
        (lambda: boat(roll=0.6), "roll of a boat must lie in 0 .. 0.5, not 0.6"),
        (lambda: boat(heave=math.nan), "heave of a boat must lie in 0 .. 5"),
        (lambda: drone(-1.0), "drag of a drone must not be negative"),
        (lambda: pedestrian(0.1), "stride of a pedestrian must lie in 0.6 .. 3 s, not 0.1"),
        (lambda: dataclasses.replace(car(), lateral=0.0), "a car: the limit lateral must be positive, not 0.0"),
        (lambda: dataclasses.replace(car(), slowest=70.0), "slowest must lie in 0 <= slowest < fastest, not 70.0"),
    ],
)
def test_impossible_vehicles_are_refused(make, message):
    with pytest.raises(ConfigError, match=message):
        make()
