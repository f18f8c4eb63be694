from __future__ import annotations

import math

import numpy as np
import pymap3d
import pytest
from scipy.integrate import quad

from navfuse.simulation.paths import STEEPEST, LocalMap, SmoothSteps, Terrain, Turning, integrate_path

STEPS = SmoothSteps(2.0, [(1.0, 2.0, 3.0), (3.0, 1.0, -4.0), (6.0, 0.5, 1.0)])


def test_steps_hold_between_their_changes():
    np.testing.assert_allclose(
        STEPS.value([0.0, 1.0, 3.0, 4.0, 5.0, 6.0, 6.5, 9.0]), [2, 2, 5, 1, 1, 1, 2, 2], atol=1e-13
    )
    assert STEPS.value(2.0) == pytest.approx(3.5)
    assert SmoothSteps(7.0, []).value(3.0) == 7.0
    assert SmoothSteps(7.0, []).rate(3.0) == 0.0


def test_rate_is_the_derivative_and_its_peak_is_known():
    t = np.linspace(0.0, 8.0, 2001)
    h = 1e-5
    numeric = (STEPS.value(t + h) - STEPS.value(t - h)) / (2.0 * h)
    np.testing.assert_allclose(STEPS.rate(t), numeric, atol=1e-7)
    assert np.abs(STEPS.rate(t)).max() == pytest.approx(STEEPEST * 4.0 / 1.0, rel=1e-6)


@pytest.mark.parametrize(
    ("joint", "side", "value"), [(1, 1, 2), (3, -1, 5), (3, 1, 5), (4, -1, 1), (6, 1, 1), (6.5, -1, 2)]
)
def test_four_derivatives_vanish_at_the_ends_of_a_step(joint, side, value):
    near, far = (abs(STEPS.value(joint + side * h) - value) for h in (0.01, 0.02))
    assert math.log2(far / near) == pytest.approx(5.0, abs=0.2)


@pytest.mark.parametrize("t", [0.3, 1.0, 1.7, 2.9, 3.5, 5.0, 6.2, 8.0])
def test_integral_counts_from_the_first_step(t):
    expected = quad(STEPS.value, 1.0, t, points=[x for x in (3.0, 4.0, 6.0, 6.5) if 1.0 < x < t], epsabs=1e-12)[0]
    assert STEPS.integral(t) == pytest.approx(expected, abs=1e-11)


def test_turning_integrates_its_rate():
    course = Turning(0.5, SmoothSteps(0.0, [(2.0, 1.0, 0.2)]))
    assert course.value(1.0) == 0.5
    assert course.value(10.0) == pytest.approx(0.5 + 0.2 * 7.5)
    assert course.rate(10.0) == pytest.approx(0.2)


def test_path_is_the_integral_of_speed_along_course():
    speed, course = SmoothSteps(1.0, [(1.0, 3.0, 9.0)]), SmoothSteps(0.4, [(2.0, 4.0, 1.5)])
    north, east = integrate_path(np.linspace(0.0, 10.0, 101), speed, course)
    breaks = {"points": [1.0, 2.0, 4.0, 6.0], "epsabs": 1e-12}
    assert north[-1] == pytest.approx(
        quad(lambda t: speed.value(t) * math.cos(course.value(t)), 0, 10, **breaks)[0], abs=1e-9
    )
    assert east[-1] == pytest.approx(
        quad(lambda t: speed.value(t) * math.sin(course.value(t)), 0, 10, **breaks)[0], abs=1e-9
    )


PLACES = [(0.8, 0.2), (0.0, math.pi), (math.pi / 2.0, 0.0), (-math.pi / 2.0, 1.0), (1.5707, -2.0)]


@pytest.mark.parametrize(("lat", "lon"), PLACES)
def test_the_plane_lies_on_the_ellipsoid_and_keeps_heights(lat, lon):
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-3e5, 3e5, (2, 50))
    height = rng.uniform(-100.0, 9000.0, 50)
    local = LocalMap.at(lat, lon)
    r_e = local.position(x, y, height)
    np.testing.assert_allclose(pymap3d.ecef2geodetic(*r_e.T)[2], height, atol=1e-6)
    r_origin = np.array(pymap3d.geodetic2ecef(lat, lon, 0.0, deg=False))
    np.testing.assert_allclose(local.position(np.zeros(1), np.zeros(1), np.zeros(1))[0], r_origin, atol=1e-8)
    length = np.linalg.norm(local.position(np.array([100.0]), np.array([50.0]), np.zeros(1))[0] - r_origin)
    assert length == pytest.approx(math.hypot(100.0, 50.0), rel=1e-7)


@pytest.mark.parametrize(("lat", "lon"), PLACES)
def test_directions_of_the_map_are_north_and_east(lat, lon):
    local = LocalMap.at(lat, lon)
    step = local.tangent(np.zeros(2), np.zeros(2), np.zeros(2), np.array([1.0, 0.0]), np.array([0.0, 1.0]))
    step /= np.linalg.norm(step, axis=1)[:, None]
    np.testing.assert_allclose(
        step[0], [-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)], atol=1e-12
    )
    np.testing.assert_allclose(step[1], [-math.sin(lon), math.cos(lon), 0.0], atol=1e-12)


@pytest.mark.parametrize(("lat", "lon"), PLACES)
@pytest.mark.parametrize("reach", [0.0, 10.0, 6e3, 7e3, 4e5])
def test_tangent_is_the_derivative_of_position(lat, lon, reach):
    rng = np.random.default_rng(2)
    angle = rng.uniform(0.0, 2.0 * math.pi, 20)
    x, y, height = reach * np.cos(angle), reach * np.sin(angle), rng.uniform(0.0, 5000.0, 20)
    dx, dy = rng.standard_normal((2, 20))
    local = LocalMap.at(lat, lon)
    h = 10.0
    numeric = (local.position(x + h * dx, y + h * dy, height) - local.position(x - h * dx, y - h * dy, height)) / (
        2 * h
    )
    np.testing.assert_allclose(local.tangent(x, y, height, dx, dy), numeric, atol=2e-9)


def test_terrain_starts_level_with_the_origin_and_keeps_its_slope():
    terrain = Terrain.random(np.random.default_rng(3), 0.08)
    x, y = np.random.default_rng(4).uniform(-5000.0, 5000.0, (2, 2000))
    assert terrain.height(np.zeros(1), np.zeros(1))[0] == 0.0
    north, east = terrain.slope(x, y)
    h = 0.01
    np.testing.assert_allclose(north, (terrain.height(x + h, y) - terrain.height(x - h, y)) / (2 * h), atol=1e-8)
    np.testing.assert_allclose(east, (terrain.height(x, y + h) - terrain.height(x, y - h)) / (2 * h), atol=1e-8)
    assert 0.03 < np.hypot(north, east).max() <= 0.08
