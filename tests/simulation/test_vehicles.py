from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.errors import ConfigError
from navfuse.simulation import car_drive, circle_flight, figure_eight_flight, static

T = np.linspace(0.0, 300.0, 6001)


@pytest.fixture(name="car", scope="module")
def _car():
    return car_drive(300.0, seed=7)


def velocity_b(motion, time):
    return np.einsum("kji,kj->ki", motion.C_eb(time), motion.v_e(time))


def test_the_car_stands_then_drives(car):
    standing = T < 20.0
    assert np.abs(car.v_e(T[standing])).max() < 1e-6
    assert np.abs(car.w_eb_b(T[standing])).max() < 1e-8
    speed = np.linalg.norm(car.v_e(T), axis=1)
    assert 10.0 < speed.max() < 15.1
    assert speed[T > 25.0].mean() > 5.0


def test_the_car_does_not_slip(car):
    v_b = velocity_b(car, T)
    assert np.abs(v_b[:, 1]).max() < 2e-6
    assert v_b[:, 0].min() > -1e-6
    squat = np.abs(v_b[:, 2]) / np.maximum(v_b[:, 0], 1.0)
    assert 1e-3 < squat.max() < math.radians(0.5)


def test_the_car_stays_within_what_a_driver_does(car):
    trajectory = car.trajectory(T)
    force = car.f_b(T)
    assert np.abs(force[:, :2]).max() < 4.0
    assert 8.5 < -force[:, 2].max()
    assert 1.0 < np.degrees(np.abs(trajectory.attitude[:, 0])).max() < 6.0
    assert 1.0 < np.degrees(np.abs(trajectory.attitude[:, 1])).max() < 6.0
    assert np.ptp(trajectory.height) > 0.5
    turn_rate = car.w_eb_b(T)[:, 2]
    assert turn_rate.max() > 0.2
    assert turn_rate.min() < -0.2


def test_the_car_leans_outwards_and_squats_backwards():
    flat = car_drive(200.0, seed=1, hills=0.0)
    t = np.linspace(0.0, 200.0, 4001)
    roll, pitch = flat.trajectory(t).attitude[:, :2].T
    lateral, forward = flat.a_e(t), velocity_b(flat, t)[:, 0]
    lateral = np.einsum("kji,kj->ki", flat.C_eb(t), lateral)
    np.testing.assert_allclose(roll, -math.radians(4.0) * lateral[:, 1] / 9.80665, atol=1e-4)
    np.testing.assert_allclose(pitch, math.radians(1.5) * np.gradient(forward, t) / 9.80665, atol=5e-4)
    assert np.abs(roll).max() > 0.01
    assert np.abs(pitch).max() > 0.004


def test_without_hills_the_height_stays():
    np.testing.assert_allclose(car_drive(120.0, seed=1, hills=0.0).trajectory(T[:2400]).height, 100.0, atol=1e-6)


def test_the_same_seed_gives_the_same_drive_and_another_one_another():
    one, same, other = (car_drive(100.0, seed=seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(one.coefficients, same.coefficients)
    assert np.linalg.norm(one.r_e(90.0) - other.r_e(90.0)) > 1.0


def test_a_longer_drive_begins_like_a_shorter_one():
    short, long = car_drive(100.0, seed=5), car_drive(400.0, seed=5)
    np.testing.assert_allclose(short.r_e(T[:1900]), long.r_e(T[:1900]), atol=1e-6)


@pytest.mark.parametrize("lat", [-math.pi / 2.0, -0.9, 0.0, math.pi / 2.0])
@pytest.mark.parametrize("lon", [0.0, math.pi])
def test_a_drive_is_the_same_anywhere(lat, lon):
    here, there = car_drive(60.0, seed=5, hills=0.0), car_drive(60.0, seed=5, lat=lat, lon=lon, hills=0.0)
    t = T[T <= 60.0]
    np.testing.assert_allclose(velocity_b(there, t), velocity_b(here, t), rtol=1e-5, atol=1e-4)
    np.testing.assert_allclose(there.w_eb_b(t), here.w_eb_b(t), atol=2e-4)
    start = there.trajectory(0.0)
    assert start.height[0] == pytest.approx(100.0, abs=1e-8)
    if abs(lat) < 1.5:
        assert start.lat[0] == pytest.approx(lat, abs=1e-12)
        assert abs(start.lon[0]) == pytest.approx(lon, abs=1e-12)
        assert start.attitude[0, 2] == pytest.approx(0.6, abs=1e-9)


@pytest.mark.parametrize("lat", [0.8, math.pi / 2.0])
def test_turns_are_coordinated(lat):
    motion = figure_eight_flight(300.0, lat=lat)
    force, v_b = motion.f_b(T), velocity_b(motion, T)
    assert np.abs(force[:, 1]).max() < 1e-5
    assert np.abs(v_b[:, 1:]).max() < 1e-5
    np.testing.assert_allclose(v_b[:, 0], 60.0, rtol=0.01)


def test_the_figure_eight_turns_both_ways_and_comes_back():
    motion = figure_eight_flight(300.0, straight=20.0, climb=100.0)
    trajectory = motion.trajectory(T)
    roll = trajectory.attitude[:, 0]
    assert roll.max() == pytest.approx(0.45, abs=0.05)
    assert roll.min() == pytest.approx(-0.45, abs=0.05)
    assert np.ptp(trajectory.height) == pytest.approx(100.0, abs=0.1)
    period = 2.0 * math.pi * 60.0 / (9.80665 * math.tan(0.45)) + 5.0
    before, after = motion.trajectory(20.0).attitude[0, 2], motion.trajectory(20.0 + period).attitude[0, 2]
    assert abs(after - before) < 0.01 or abs(after - before) > 2.0 * math.pi - 0.01
    assert np.linalg.norm(motion.r_e(20.0) - motion.r_e(20.0 + period)) < 1000.0


def test_the_circle_goes_round_to_the_right():
    motion = circle_flight(200.0, climb=0.0)
    t = T[(T > 30.0) & (T <= 200.0)]
    roll = motion.trajectory(t).attitude[:, 0]
    np.testing.assert_allclose(roll, 0.45, atol=0.01)
    assert motion.w_eb_b(t)[:, 2].min() > 0.0


def test_a_tripod_stands_still_as_told():
    motion = static(100.0, 0.4, -3.0, 20.0, 0.1, -0.2, 6.0)
    trajectory = motion.trajectory(np.linspace(0.0, 100.0, 11))
    for values, expected in ((trajectory.lat, 0.4), (trajectory.lon, -3.0)):
        np.testing.assert_allclose(values, expected, atol=1e-15)
    np.testing.assert_allclose(trajectory.height, 20.0, atol=1e-8)
    np.testing.assert_allclose(trajectory.attitude, np.tile([0.1, -0.2, 6.0], (11, 1)), atol=1e-9)
    np.testing.assert_allclose(trajectory.velocity_n, 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: static(0.0), "duration must be positive and finite, not 0.0"),
        (lambda: car_drive(-1.0), "duration must be positive"),
        (lambda: car_drive(math.nan), "duration must be positive"),
        (lambda: car_drive(10.0, standing=-1.0), "standing must not be negative, and hills .*, not -1.0"),
        (lambda: car_drive(10.0, hills=-0.1), "hills must be a slope in 0 .. 1, not 20.0 and -0.1"),
        (lambda: figure_eight_flight(math.inf), "duration must be positive and finite"),
        (lambda: circle_flight(10.0, speed=0.0), "speed must be positive"),
        (lambda: circle_flight(10.0, straight=-2.0), "straight must not be negative"),
        (lambda: figure_eight_flight(10.0, bank=1.5), r"bank must lie in \(0, 1.4\) rad, not 1.5"),
    ],
)
def test_impossible_vehicles_are_refused(make, message):
    with pytest.raises(ConfigError, match=message):
        make()
