"""Increments that the engine's own steps turn back into a motion: the mechanization solved for its input.

Every formula between the raw increments of an interval and the new velocity and attitude is linear in one unknown when
the ones before are known, so each step is undone in closed form:

1. The new attitude gives the rotation vector of the interval.
2. The new velocity gives the specific-force increment in e: across the Earth's axis two equations in two unknowns,
   because of the Coriolis term.
3. Turning it into the body's axes undoes :func:`navfuse.mechanization.ned.rotate_increment`.
4. Coning and sculling, :func:`navfuse.imu.increments.corrected`, are of the form ``(I + [p x]) a = b`` in the newest
   increment.

The step is then taken with the increments found, so that what rounding leaves is made up for in the next interval.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit

from navfuse.core.constants import EARTH_RATE
from navfuse.core.earth import gravity_e
from navfuse.core.rotation import (
    cross,
    dcm_from_quat,
    mat_t_vec,
    quat_conjugate,
    quat_multiply,
    rotvec_from_quat,
)
from navfuse.imu.increments import NO_STEPS, corrected, correction_factors, next_steps, steps_missing
from navfuse.mechanization.ecef import step_ecef
from navfuse.simulation.motion_kernels import motion_at


@njit(cache=True, error_model="numpy")
def invert_mechanization(knots, c, origin, time, inc_theta_b, inc_v_b):
    """Fill the increments of every interval but the first row's.

    Parameters
    ----------
    knots, c, origin
        The motion, as in :func:`navfuse.simulation.motion_kernels.integrate_imu`.
    time : (n,) array [s]
        Increasing, within the knots.
    inc_theta_b, inc_v_b : (n, 3) arrays [rad], [m/s]
        Filled; row 0 is left alone.

    Returns
    -------
    int
        Row whose increment the engine would take for one behind missing rows; 0 if there is none. Rows from there on
        are not filled.

    Notes
    -----
    No checks are made.
    """
    nav = np.empty(10)
    i, last = 0, knots.size - 2
    dt1 = dt2 = 0.0
    steps = NO_STEPS
    a1 = u1 = a2 = u2 = (0.0, 0.0, 0.0)
    for k in range(time.size):
        while i < last and time[k] >= knots[i + 1]:
            i += 1
        r, v, _, q, _, _, _ = motion_at(c, origin, i, time[k] - knots[i])
        if k == 0:
            for j in range(3):
                nav[j], nav[3 + j], nav[6 + j] = r[j], v[j], q[j]
            nav[9] = q[3]
            continue
        dt = time[k] - time[k - 1]
        theta, u = _undo_step(nav, dt, v, q)
        k1, k2, k3 = correction_factors(dt, dt1, dt2, np.inf)
        a0, u0 = _undo_corrections(k1, k2, k3, theta, u, a1, u1, a2, u2)
        for j in range(3):
            inc_theta_b[k, j], inc_v_b[k, j] = a0[j], u0[j]
        size = sqrt(u0[0] ** 2 + u0[1] ** 2 + u0[2] ** 2)
        if steps_missing(size, dt, steps) > 0.0:
            return k
        steps = next_steps(size, dt, steps, 0.0)
        theta, u = corrected(k1, k2, k3, a0, u0, a1, u1, a2, u2)
        step_ecef(nav, dt, theta[0], theta[1], theta[2], u[0], u[1], u[2])
        a1, u1, a2, u2 = a0, u0, a1, u1
        dt1, dt2 = dt, dt1
    return 0


@njit(cache=True, error_model="numpy")
def _undo_step(nav, dt, v, q):
    """Rotation vector and velocity increment with which `step_ecef` reaches velocity `v` and attitude `q`."""
    zeta = EARTH_RATE * dt
    before = (nav[6], nav[7], nav[8], nav[9])
    earth = (1.0 - 0.125 * zeta * zeta, 0.0, 0.0, -0.5 * zeta)
    theta = rotvec_from_quat(quat_multiply(quat_conjugate(quat_multiply(earth, before)), q))

    half = 0.5 * dt
    g = gravity_e(nav[0] + half * nav[3], nav[1] + half * nav[4], nav[2] + half * nav[5])
    gx, gy = g[0] * dt, g[1] * dt
    x = v[0] - nav[3] - gx - 2.0 * zeta * (nav[4] + 0.5 * gy - zeta * nav[3])
    y = v[1] - nav[4] - gy + 2.0 * zeta * (nav[3] + 0.5 * gx + zeta * nav[4])
    m = 1.5 * zeta
    n = 1.0 / (1.0 + m * m)
    f_e = ((x - m * y) * n, (y + m * x) * n, v[2] - nav[5] - g[2] * dt)
    return theta, _undo_turn(theta, mat_t_vec(dcm_from_quat(before), f_e))


@njit(cache=True, error_model="numpy")
def _undo_turn(t, w):
    """Solve ``w = u + B t x u + C t x (t x u)`` for u, with the factors of `rotate_increment`.

    Across t, the map is multiplication by the complex number ``1 - C t^2 + i B |t|``; along t, the identity.
    """
    t2 = t[0] * t[0] + t[1] * t[1] + t[2] * t[2]
    b = 0.5 - (1.0 / 24.0) * t2
    c = 1.0 / 6.0 - (1.0 / 120.0) * t2
    re = 1.0 - c * t2
    n = 1.0 / (re * re + b * b * t2)
    along = (b * b - c + c * c * t2) * n * (t[0] * w[0] + t[1] * w[1] + t[2] * w[2])
    tw = cross(t, w)
    return (
        re * n * w[0] - b * n * tw[0] + along * t[0],
        re * n * w[1] - b * n * tw[1] + along * t[1],
        re * n * w[2] - b * n * tw[2] + along * t[2],
    )


@njit(cache=True, error_model="numpy")
def _undo_corrections(k1, k2, k3, theta, u, a1, u1, a2, u2):
    """The newest increments of which :func:`navfuse.imu.increments.corrected` makes `theta` and `u`."""
    p = (k1 * a1[0] + k2 * a2[0], k1 * a1[1] + k2 * a2[1], k1 * a1[2] + k2 * a2[2])
    s = (k1 * u1[0] + k2 * u2[0], k1 * u1[1] + k2 * u2[1], k1 * u1[2] + k2 * u2[2])
    aa, au, ua = cross(a2, a1), cross(a2, u1), cross(u2, a1)
    a0 = _undo_cross(p, (theta[0] - k3 * aa[0], theta[1] - k3 * aa[1], theta[2] - k3 * aa[2]))
    sa = cross(s, a0)
    return a0, _undo_cross(
        p,
        (
            u[0] - sa[0] - k3 * (au[0] + ua[0]),
            u[1] - sa[1] - k3 * (au[1] + ua[1]),
            u[2] - sa[2] - k3 * (au[2] + ua[2]),
        ),
    )


@njit(cache=True, error_model="numpy")
def _undo_cross(p, b):
    """Solve ``a + p x a = b`` for a."""
    dot = p[0] * b[0] + p[1] * b[1] + p[2] * b[2]
    n = 1.0 / (1.0 + p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
    pb = cross(p, b)
    return (b[0] - pb[0] + p[0] * dot) * n, (b[1] - pb[1] + p[1] * dot) * n, (b[2] - pb[2] + p[2] * dot) * n
