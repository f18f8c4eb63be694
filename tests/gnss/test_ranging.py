"""Range and range rate against light cones in inertial axes and against derivatives."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from navfuse.core.constants import EARTH_RATE, LIGHT_SPEED
from navfuse.core.earth import geodetic_to_ecef_batch
from navfuse.gnss.orbits import Constellation, gps_constellation
from navfuse.gnss.ranging import arriving_signals, line_of_sight, range_and_rate

PLACES = [(0.9, 0.2, 100.0), (0.0, math.pi, 10_000.0), (math.pi / 2.0, 0.0, 0.0), (-math.pi / 2.0, 1.0, 3000.0)]


def place(lat, lon, height):
    return geodetic_to_ecef_batch(np.array([lat]), np.array([lon]), np.array([height]))[0]


def oval():
    """Eccentric orbits: the range rate does not vanish anywhere in a hurry."""
    spread = np.linspace(0.0, 6.0, 8)
    return Constellation(
        tuple("ABCDEFGH"), *(np.asarray(x) for x in (3e7, 0.3, 1.0, spread, -8e-9, 2.0 * spread, 3.0 * spread, 50.0))
    )


@pytest.mark.parametrize("where", PLACES)
@pytest.mark.parametrize("constellation", [gps_constellation(), oval()], ids=["gps", "oval"])
def test_a_signal_travels_at_the_speed_of_light_among_the_stars(constellation, where):
    """In inertial axes nothing rotates: from where it was sent to where it arrives, it is c times the flight."""
    time, r_a = 700.0, place(*where)

    def to_stars(t):
        return Rotation.from_rotvec([0.0, 0.0, EARTH_RATE * t]).as_matrix()

    def satellite(t, j):
        return to_stars(t) @ constellation.at(t)[0][0, j]

    arrived = to_stars(time) @ r_a
    sat_r_e, _, rho, _, u_e = arriving_signals(constellation, [time], [r_a], np.zeros((1, 3)))
    for j in range(len(constellation)):
        flight = brentq(
            lambda tau, j=j: np.linalg.norm(satellite(time - tau, j) - arrived) - LIGHT_SPEED * tau,
            0.0,
            0.3,
            xtol=1e-16,
        )
        assert rho[0, j] == pytest.approx(LIGHT_SPEED * flight, abs=2e-7)
        direction = (satellite(time - flight, j) - arrived) / (LIGHT_SPEED * flight)
        np.testing.assert_allclose(to_stars(time) @ u_e[0, j], direction, rtol=0, atol=1e-13)
        np.testing.assert_allclose(sat_r_e[0, j], constellation.at(time - flight)[0][0, j], rtol=0, atol=1e-6)


@pytest.mark.parametrize("where", PLACES)
@pytest.mark.parametrize("constellation", [gps_constellation(), oval()], ids=["gps", "oval"])
def test_the_range_rate_is_the_derivative_of_the_range(constellation, where):
    """To 1e-6 m/s, for a receiver at 300 m/s; without the divisor 1 + u.v/c the error would be mm/s."""
    r_a, v_a, h = place(*where), np.array([200.0, -200.0, 100.0]), 2.0
    time = np.array([100.0, 5000.0])

    def ranges(t):
        return arriving_signals(constellation, t, r_a + np.outer(t - 100.0, v_a), np.tile(v_a, (2, 1)))

    rho = {k: ranges(time + k * h)[2] for k in (-3, -2, -1, 1, 2, 3)}
    slope = (45.0 * (rho[1] - rho[-1]) - 9.0 * (rho[2] - rho[-2]) + (rho[3] - rho[-3])) / (60.0 * h)
    sat_r_e, sat_v_e, _, rate, u_e = ranges(time)
    np.testing.assert_allclose(rate, slope, rtol=0, atol=1e-6)
    r_now = r_a + np.outer(time - 100.0, v_a)
    plain = np.empty_like(rate)
    for k, j in np.ndindex(*rate.shape):
        _, _, _, _, c, s = line_of_sight(*sat_r_e[k, j], *r_now[k])
        turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        plain[k, j] = u_e[k, j] @ (turned @ sat_v_e[k, j] - v_a)
    assert 1e-4 < np.abs(plain - slope).max() < 2e-2


def test_the_rotation_closes_and_the_unit_vector_has_length_one():
    r_a = place(0.9, 0.2, 100.0)
    rho, ux, uy, uz, c, s = line_of_sight(1.5e7, -1.2e7, 1.8e7, *r_a)
    assert math.atan2(s, c) == pytest.approx(EARTH_RATE * rho / LIGHT_SPEED, rel=1e-14)
    turned = np.array([c * 1.5e7 + s * -1.2e7, c * -1.2e7 - s * 1.5e7, 1.8e7])
    assert rho == pytest.approx(np.linalg.norm(turned - r_a), abs=1e-8)
    assert math.hypot(ux, uy, uz) == pytest.approx(1.0, abs=1e-15)


def test_derivatives_by_the_antenna_are_the_line_of_sight():
    sat = np.array([1.5e7, -1.2e7, 1.8e7, 1500.0, 2500.0, 300.0])
    r, v = place(0.9, 0.2, 100.0), np.array([10.0, 20.0, -5.0])
    _, rate, ux, uy, uz, shrink = range_and_rate(*sat, *r, *v)
    for axis, u in enumerate((ux, uy, uz)):
        step = np.eye(3)[axis]
        slope = (
            line_of_sight(*sat[:3], *(r + 50.0 * step))[0] - line_of_sight(*sat[:3], *(r - 50.0 * step))[0]
        ) / 100.0
        assert slope == pytest.approx(-u, abs=1e-5)
        assert range_and_rate(*sat, *r, *(v + step))[1] - rate == pytest.approx(-shrink * u, abs=1e-10)
