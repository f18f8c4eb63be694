"""Kernels behind :class:`navfuse.simulation.motion.Motion`: evaluate it, and integrate what an IMU senses.

A motion is kept as seven polynomials per interval between knots: three components of ``r_e - origin`` and four of an
unnormalised quaternion whose direction is ``q_eb``. Layout of the coefficients: (interval, power 5..0, component). No
checks are made in any of these functions.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from navfuse.core.constants import EARTH_RATE
from navfuse.core.earth import dcm_en, ecef_to_geodetic, gravity_e
from navfuse.core.rotation import dcm_from_quat, euler_from_dcm, mat_t_mul, mat_t_vec


@njit(cache=True, error_model="numpy")
def _value(c, i, j, u):
    """Component `j` of interval `i`, `u` seconds after its first knot."""
    return ((((c[i, 0, j] * u + c[i, 1, j]) * u + c[i, 2, j]) * u + c[i, 3, j]) * u + c[i, 4, j]) * u + c[i, 5, j]


@njit(cache=True, error_model="numpy")
def _first(c, i, j, u):
    """First derivative of :func:`_value`."""
    return (((5.0 * c[i, 0, j] * u + 4.0 * c[i, 1, j]) * u + 3.0 * c[i, 2, j]) * u + 2.0 * c[i, 3, j]) * u + c[i, 4, j]


@njit(cache=True, error_model="numpy")
def _second(c, i, j, u):
    """Second derivative of :func:`_value`."""
    return ((20.0 * c[i, 0, j] * u + 12.0 * c[i, 1, j]) * u + 6.0 * c[i, 2, j]) * u + 2.0 * c[i, 3, j]


@njit(cache=True, error_model="numpy")
def motion_at(c, origin, i, u):
    """Everything about a motion at one instant.

    Parameters
    ----------
    c : (m, 6, 7) array
        Coefficients.
    origin : (3,) indexable [m]
        Added to the position polynomials.
    i : int
        Interval.
    u : float [s]
        Time since the first knot of the interval.

    Returns
    -------
    r_e, v_e, a_e : 3-tuples [m], [m/s], [m/s^2]
        Position, velocity and acceleration relative to the rotating Earth.
    q_eb : 4-tuple
        Takes b to e.
    w_eb_b, w_ib_b : 3-tuples [rad/s]
        Angular rate of the body against the Earth and against inertial space: ``w_ib_b = w_eb_b + C_be w_ie_e``.
    f_b : 3-tuple [m/s^2]
        Specific force: ``C_be (a_e + 2 w_ie x v_e - g_e)``; Groves (2013), eq. 5.34 solved for f.
    """
    x = origin[0] + _value(c, i, 0, u)
    y = origin[1] + _value(c, i, 1, u)
    z = origin[2] + _value(c, i, 2, u)
    v = (_first(c, i, 0, u), _first(c, i, 1, u), _first(c, i, 2, u))
    a = (_second(c, i, 0, u), _second(c, i, 1, u), _second(c, i, 2, u))
    s0, s1, s2, s3 = _value(c, i, 3, u), _value(c, i, 4, u), _value(c, i, 5, u), _value(c, i, 6, u)
    d0, d1, d2, d3 = _first(c, i, 3, u), _first(c, i, 4, u), _first(c, i, 5, u), _first(c, i, 6, u)
    n2 = s0 * s0 + s1 * s1 + s2 * s2 + s3 * s3
    k = 2.0 / n2
    w_eb = (
        k * (s0 * d1 - s1 * d0 - s2 * d3 + s3 * d2),
        k * (s0 * d2 - s2 * d0 - s3 * d1 + s1 * d3),
        k * (s0 * d3 - s3 * d0 - s1 * d2 + s2 * d1),
    )
    n = 1.0 / math.sqrt(n2)
    q = (s0 * n, s1 * n, s2 * n, s3 * n)
    C = dcm_from_quat(q)
    w_ib = (w_eb[0] + C[6] * EARTH_RATE, w_eb[1] + C[7] * EARTH_RATE, w_eb[2] + C[8] * EARTH_RATE)
    g = gravity_e(x, y, z)
    f_e = (a[0] - 2.0 * EARTH_RATE * v[1] - g[0], a[1] + 2.0 * EARTH_RATE * v[0] - g[1], a[2] - g[2])
    return (x, y, z), v, a, q, w_eb, w_ib, mat_t_vec(C, f_e)


@njit(cache=True, error_model="numpy")
def motion_at_times(knots, c, origin, time, interval, out):
    """Fill `out` (n, 22) with r_e, v_e, a_e, q_eb, w_eb_b, w_ib_b, f_b at (n,) times within the given intervals."""
    for k in range(time.size):
        i = interval[k]
        r, v, a, q, w_eb, w_ib, f = motion_at(c, origin, i, time[k] - knots[i])
        for j in range(3):
            out[k, j] = r[j]
            out[k, 3 + j] = v[j]
            out[k, 6 + j] = a[j]
            out[k, 13 + j] = w_eb[j]
            out[k, 16 + j] = w_ib[j]
            out[k, 19 + j] = f[j]
        for j in range(4):
            out[k, 9 + j] = q[j]


@njit(cache=True, error_model="numpy")
def integrate_imu(knots, c, origin, time, nodes, weights, max_panel, inc_theta_b, inc_v_b):
    """Plain integrals of ``w_ib_b`` and ``f_b`` over each (time[k-1], time[k]], by Gauss-Legendre quadrature.

    Parameters
    ----------
    knots, c, origin
        The motion.
    time : (n,) array [s]
        Increasing, within the knots.
    nodes, weights : (p,) arrays
        Gauss-Legendre rule on (-1, 1).
    max_panel : float [s]
        Longer intervals are cut into equal panels no longer than this.
    inc_theta_b, inc_v_b : (n, 3) arrays [rad], [m/s]
        Filled; row 0 is left alone.
    """
    i = 0
    last = knots.size - 2
    for k in range(1, time.size):
        dt = time[k] - time[k - 1]
        panels = math.ceil(dt / max_panel - 1e-9)
        panels = max(panels, 1)
        half = 0.5 * dt / panels
        theta = np.zeros(3)
        dv = np.zeros(3)
        for panel in range(panels):
            middle = time[k - 1] + (2 * panel + 1) * half
            for p in range(nodes.size):
                t = middle + half * nodes[p]
                while i < last and t >= knots[i + 1]:
                    i += 1
                _, _, _, _, _, w_ib, f = motion_at(c, origin, i, t - knots[i])
                for j in range(3):
                    theta[j] += weights[p] * w_ib[j]
                    dv[j] += weights[p] * f[j]
        for j in range(3):
            inc_theta_b[k, j] = half * theta[j]
            inc_v_b[k, j] = half * dv[j]


@njit(cache=True, error_model="numpy")
def local_level(r_e, v_e, q_eb, out):
    """Earth-centred states in the terms of the place.

    Parameters
    ----------
    r_e, v_e : (n, 3) arrays [m], [m/s]
    q_eb : (n, 4) array
    out : (n, 18) array
        Filled with latitude and longitude [rad], height [m], velocity north-east-down [m/s], roll, pitch and heading
        [rad], and the nine elements of ``C_nb`` row by row.
    """
    for k in range(r_e.shape[0]):
        lat, lon, height = ecef_to_geodetic(r_e[k, 0], r_e[k, 1], r_e[k, 2])
        C_en = dcm_en(lat, lon)
        v_n = mat_t_vec(C_en, (v_e[k, 0], v_e[k, 1], v_e[k, 2]))
        C_nb = mat_t_mul(C_en, dcm_from_quat((q_eb[k, 0], q_eb[k, 1], q_eb[k, 2], q_eb[k, 3])))
        euler = euler_from_dcm(C_nb)
        out[k, 0], out[k, 1], out[k, 2] = lat, lon, height
        for j in range(3):
            out[k, 3 + j] = v_n[j]
            out[k, 6 + j] = euler[j]
        for j in range(9):
            out[k, 9 + j] = C_nb[j]
