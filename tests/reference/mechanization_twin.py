"""A slow twin of the strapdown mechanization: the differential equations themselves, by a high-order integrator.

Written from Groves (2013), eqs. 5.27, 5.36 and 5.39, with NumPy and SciPy only and sharing nothing with navfuse, its
gravity included.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import solve_ivp

if TYPE_CHECKING:
    from collections.abc import Callable

Array = np.ndarray

A = 6378137.0
F = 1.0 / 298.257223563
B = A * (1.0 - F)
E2 = F * (2.0 - F)
W_IE = 7.292115e-5
GM = 3.986004418e14
GAMMA_E = 9.7803253359
GAMMA_P = 9.8321849379
OMEGA = np.array([[0.0, -W_IE, 0.0], [W_IE, 0.0, 0.0], [0.0, 0.0, 0.0]])


def gravity_e(r_e: Array) -> Array:
    """Normal gravity [m/s^2] in e: Somigliana, second order in height, along the inward ellipsoid normal."""
    p = np.hypot(r_e[0], r_e[1])
    lat = np.arctan2(r_e[2], p * (1.0 - E2))
    for _ in range(8):
        transverse = A / np.sqrt(1.0 - E2 * np.sin(lat) ** 2)
        lat = np.arctan2(r_e[2] + E2 * transverse * np.sin(lat), p)
    s2 = np.sin(lat) ** 2
    transverse = A / np.sqrt(1.0 - E2 * s2)
    height = p * np.cos(lat) + r_e[2] * np.sin(lat) - A * A / transverse
    k = B * GAMMA_P / (A * GAMMA_E) - 1.0
    m = W_IE**2 * A**2 * B / GM
    g = GAMMA_E * (1.0 + k * s2) / np.sqrt(1.0 - E2 * s2)
    g *= 1.0 - 2.0 / A * (1.0 + F + m - 2.0 * F * s2) * height + 3.0 / A**2 * height**2
    lon = np.arctan2(r_e[1], r_e[0])
    return -g * np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])


def skew(v: Array) -> Array:
    """Matrix of the cross product."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def integrate_ecef(
    w_ib_b: Callable[[float], Array],
    f_b: Callable[[float], Array],
    time: Array,
    r_e: Array,
    v_e: Array,
    C_eb: Array,
    *,
    max_step: float = 0.1,
    tolerance: float = 1e-13,
) -> tuple[Array, Array, Array]:
    """Position, velocity and attitude at the given times, from those at the first.

    Parameters
    ----------
    w_ib_b, f_b : functions of one time [s]
        Angular rate [rad/s] and specific force [m/s^2], (3,) arrays.
    time : (n,) array [s]
        Increasing.
    r_e, v_e, C_eb : (3,), (3,), (3, 3) arrays [m], [m/s]
        At ``time[0]``.
    max_step : float [s]
        Of the integrator; about the spacing of any knots in the functions.
    tolerance : float
        Relative (and absolute, in metres, m/s and radians) tolerance per step of the eighth-order method.

    Returns
    -------
    r_e (n, 3), v_e (n, 3), C_eb (n, 3, 3)

    Notes
    -----
    The attitude is integrated as a matrix and position as the displacement from the start, so that rounding stays below
    a nanometre and a nanoradian over minutes.
    """

    def derivative(t: float, state: Array) -> Array:
        v, C = state[3:6], state[6:].reshape(3, 3)
        dv = C @ f_b(t) + gravity_e(r_e + state[:3]) - 2.0 * OMEGA @ v
        dC = C @ skew(w_ib_b(t)) - OMEGA @ C
        return np.concatenate([v, dv, dC.ravel()])

    start = np.concatenate([np.zeros(3), v_e, np.ravel(C_eb)])
    solution = solve_ivp(
        derivative,
        (time[0], time[-1]),
        start,
        method="DOP853",
        t_eval=time,
        max_step=max_step,
        rtol=tolerance,
        atol=tolerance,
    )
    assert solution.success, solution.message
    y = solution.y.T
    return r_e + y[:, :3], y[:, 3:6], y[:, 6:].reshape(-1, 3, 3)
