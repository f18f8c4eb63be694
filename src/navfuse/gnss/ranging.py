"""From a satellite to an antenna: flight time, range, range rate and line of sight, with the Earth turning meanwhile.

Satellite states are those at the time of transmission, in the Earth-fixed axes *of that time*, as orbits and broadcast
messages give them; the antenna's are those at reception, in the axes of that time. Between the two the Earth turns by
``theta = w_ie rho / c``, and ``C(theta)``, a rotation about z, takes the former axes to the latter:

    rho = |C(theta) r_s - r_a|,    theta = w_ie rho / c

No checks are made in any of the kernels.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from navfuse.core.constants import EARTH_RATE, LIGHT_SPEED
from navfuse.gnss.orbits import orbit_state

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from navfuse.gnss.orbits import Constellation

Array = np.ndarray


@njit(cache=True, error_model="numpy")
def line_of_sight(sx, sy, sz, rx, ry, rz):
    """Range and direction of a satellite whose signal arrives now.

    Parameters
    ----------
    sx, sy, sz : float [m]
        Satellite at transmission, axes of that time.
    rx, ry, rz : float [m]
        Antenna at reception.

    Returns
    -------
    rho : float [m]
    ux, uy, uz : float
        Unit vector from the antenna to the satellite, axes of reception. The derivative of `rho` by the antenna's
        position is its negative, but for a part in 1e6 (the rotation depends on the range).
    cos_theta, sin_theta : float
        Of the turn of the Earth during the flight.

    Notes
    -----
    No checks are made. Each iteration shrinks the error by ``w_ie |r_s| / c`` < 1e-5, so that three from the range
    without rotation leave less than rounding. Source: Groves (2013), section 8.5.3.
    """
    dx, dy, dz = sx - rx, sy - ry, sz - rz
    rho = math.sqrt(dx * dx + dy * dy + dz * dz)
    cos_theta, sin_theta = 1.0, 0.0
    for _ in range(3):
        theta = EARTH_RATE / LIGHT_SPEED * rho
        cos_theta, sin_theta = math.cos(theta), math.sin(theta)
        dx = cos_theta * sx + sin_theta * sy - rx
        dy = cos_theta * sy - sin_theta * sx - ry
        rho = math.sqrt(dx * dx + dy * dy + dz * dz)
    return rho, dx / rho, dy / rho, dz / rho, cos_theta, sin_theta


@njit(cache=True, error_model="numpy")
def range_and_rate(sx, sy, sz, svx, svy, svz, rx, ry, rz, vx, vy, vz):
    """Range, range rate and direction.

    Parameters
    ----------
    sx, sy, sz, svx, svy, svz : float [m], [m/s]
        Satellite at transmission, axes of that time, velocity relative to the rotating Earth.
    rx, ry, rz, vx, vy, vz : float [m], [m/s]
        Antenna at reception.

    Returns
    -------
    rho : float [m]
    rate : float [m/s]
        Exact derivative of `rho` by the time of reception.
    ux, uy, uz : float
        As :func:`line_of_sight`.
    shrink : float
        ``d(transmission time) / d(reception time)`` as seen from an antenna at rest among the stars, about 1 - 3e-6 to
        1 + 3e-6: the derivative of `rate` by the antenna's velocity is ``-shrink * u``.

    Notes
    -----
    No checks are made. In inertial axes, ``rho(t) = |r_s(t - rho / c) - r_a(t)|`` gives ``rate = u . (v_s - v_a) / (1 +
    u . v_s / c)``; the rates of the Earth in ``v_s - v_a`` cancel along `u`, since satellite and antenna are both
    resolved in the axes of reception. Texts leave the divisor out, Groves (2013), section 8.5.3, among them: up to 2
    mm/s.
    """
    rho, ux, uy, uz, c, s = line_of_sight(sx, sy, sz, rx, ry, rz)
    px, py = c * sx + s * sy, c * sy - s * sx
    wx, wy = c * svx + s * svy, c * svy - s * svx
    inertial = ux * (wx - EARTH_RATE * py) + uy * (wy + EARTH_RATE * px) + uz * svz
    shrink = 1.0 / (1.0 + inertial / LIGHT_SPEED)
    rate = shrink * (ux * (wx - vx) + uy * (wy - vy) + uz * (svz - vz))
    return rho, rate, ux, uy, uz, shrink


@njit(cache=True, error_model="numpy")
def _arriving(time, elements, r_e, v_e, sat_r_e, sat_v_e, rho, rate, u_e):
    for k in range(time.size):
        rx, ry, rz = r_e[k, 0], r_e[k, 1], r_e[k, 2]
        for j in range(elements.shape[0]):
            flight = 0.08
            sx, sy, sz, svx, svy, svz = orbit_state(time[k] - flight, elements[j])
            for _ in range(4):
                flight = line_of_sight(sx, sy, sz, rx, ry, rz)[0] / LIGHT_SPEED
                sx, sy, sz, svx, svy, svz = orbit_state(time[k] - flight, elements[j])
            rho[k, j], rate[k, j], u_e[k, j, 0], u_e[k, j, 1], u_e[k, j, 2], _shrink = range_and_rate(
                sx, sy, sz, svx, svy, svz, rx, ry, rz, v_e[k, 0], v_e[k, 1], v_e[k, 2]
            )
            sat_r_e[k, j, 0], sat_r_e[k, j, 1], sat_r_e[k, j, 2] = sx, sy, sz
            sat_v_e[k, j, 0], sat_v_e[k, j, 1], sat_v_e[k, j, 2] = svx, svy, svz


def arriving_signals(
    constellation: Constellation, time: ArrayLike, r_e: ArrayLike, v_e: ArrayLike
) -> tuple[Array, Array, Array, Array, Array]:
    """What arrives at an antenna from every satellite, the Earth being transparent.

    Parameters
    ----------
    constellation : Constellation
        Of m satellites.
    time : (n,) array [s]
        Of reception, on the scale of the constellation.
    r_e, v_e : (n, 3) arrays [m], [m/s]
        Of the antenna.

    Returns
    -------
    sat_r_e, sat_v_e : (n, m, 3) arrays [m], [m/s]
        Of the satellites at transmission, axes of that time.
    rho, rate : (n, m) arrays [m], [m/s]
        Geometric range and its derivative by the time of reception.
    u_e : (n, m, 3) array
        Unit vectors from the antenna to the satellites, axes of reception.

    Notes
    -----
    The flight time is iterated to rounding: each round shrinks its error by ``rate / c`` < 1e-4. The time of
    transmission is a float of its own, so that at 6e5 s it carries a rounding of 6e-11 s, in which a satellite moves by
    2e-7 m; range and position agree all the same, since the former is computed from the latter.
    """
    time = np.ascontiguousarray(time, dtype=float)
    r_e, v_e = (np.ascontiguousarray(values, dtype=float) for values in (r_e, v_e))
    n, m = time.size, len(constellation)
    sat_r_e, sat_v_e, u_e = np.empty((n, m, 3)), np.empty((n, m, 3)), np.empty((n, m, 3))
    rho, rate = np.empty((n, m)), np.empty((n, m))
    _arriving(time, constellation.elements, r_e, v_e, sat_r_e, sat_v_e, rho, rate, u_e)
    return sat_r_e, sat_v_e, rho, rate, u_e
