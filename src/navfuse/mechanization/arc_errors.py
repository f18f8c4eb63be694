"""Errors in whose coordinates a filter with a wrong heading stays linear.

**What has been integrated since an event turns with the attitude.** With an attitude error psi that was there all the
time, the integral Du of the specific force since the last event, and its integral Dw, are exp(psi) Du and exp(psi) Dw:
a point whose heading is wrong by 60 deg goes off in another direction, on an arc that a straight error cannot follow.
The errors of the filter are therefore

    v = v_est + (exp(psi) - I) Du + xi_v        r = r_est + (exp(psi) - I) Dw + xi_r

and the attitude error is exp(y u) exp(t), a level tilt t in the frame of the estimate and then a heading y about down,
u. So an error of heading leaves alone what is known of the level relative to the sensor, and of its biases. This makes
the propagation all but linear for attitude errors of any size, and leaves the arc to the measurement, where
:class:`navfuse.filters.unscented.UnscentedFilter` iterates. To first order it is a linear change of coordinates, so
that in normal use nothing else changes; the covariance that is put out is that of the plain errors. The filter settles,
with Du = Dw = 0, after every event behind which the arc is as good as straight; their vertical parts, which a heading
leaves as they are, it drops at every event. See docs/decisions/0011.
"""

from __future__ import annotations

from math import atan2, pi

import numpy as np

from navfuse.core.earth import ellipsoid_normal
from navfuse.core.fused import fused
from navfuse.core.rotation import (
    cross,
    dcm_from_rotvec,
    left_jacobian,
    mat_mul,
    mat_vec,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    quat_normalize,
    rotvec_from_quat,
)
from navfuse.data.nav_state import boxplus_navigation

SMALL_TURN, SMALL_TILT = 0.3, 0.02
"""Heading, tilt [rad] up to which a series stands for the product of two rotations: off by 4e-8 rad at most."""


@fused
def down_axis(nav, ecef):
    """Unit vector down in the frame the errors are resolved in, a 3-tuple. No checks are made."""
    if not ecef:
        return 0.0, 0.0, 1.0
    p, c, s, _ = ellipsoid_normal(nav[0], nav[1], nav[2])
    k = c / p if p > 0.0 else 0.0
    return -k * nav[0], -k * nav[1], -s


@fused
def turned(d, u):
    """Rotation vector psi, exp(psi) = exp(y u) exp(t), of the attitude error t + y u, t level, in d (9+,); 3-tuple."""
    y = d[6] * u[0] + d[7] * u[1] + d[8] * u[2]
    t = (d[6] - y * u[0], d[7] - y * u[1], d[8] - y * u[2])
    if abs(y) < SMALL_TURN and max(abs(t[0]), abs(t[1]), abs(t[2])) < SMALL_TILT:
        c = cross(u, t)
        k = 1.0 - y * y / 12.0 * (1.0 + y * y / 60.0)
        z = y * (1.0 - (t[0] * t[0] + t[1] * t[1] + t[2] * t[2]) / 12.0)
        return (
            z * u[0] + k * t[0] + 0.5 * y * c[0],
            z * u[1] + k * t[1] + 0.5 * y * c[1],
            z * u[2] + k * t[2] + 0.5 * y * c[2],
        )
    return rotvec_from_quat(quat_multiply(quat_from_rotvec((y * u[0], y * u[1], y * u[2])), quat_from_rotvec(t)))


@fused
def untwist(d, u):
    """The reverse of :func:`turned`: replace a rotation vector in d (9+,) by t + y u, in place. No checks are made."""
    y = d[6] * u[0] + d[7] * u[1] + d[8] * u[2]
    p = (d[6] - y * u[0], d[7] - y * u[1], d[8] - y * u[2])
    if abs(y) < SMALL_TURN and max(abs(p[0]), abs(p[1]), abs(p[2])) < SMALL_TILT:
        c = cross(u, p)
        y *= 1.0 + (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) / (12.0 + y * y)
        a, b = 1.0 - y * y / 12.0 * (1.0 + y * y / 60.0), 0.5 * y
        k = 1.0 / (a * a + b * b)
        for i in range(3):
            d[6 + i] = y * u[i] + k * (a * p[i] - b * c[i])
        return
    q = quat_from_rotvec((d[6], d[7], d[8]))
    along = q[1] * u[0] + q[2] * u[1] + q[3] * u[2]
    twist = quat_normalize((q[0], along * u[0], along * u[1], along * u[2]))
    y = 2.0 * atan2(along, q[0])
    y -= 2.0 * pi * np.rint(y / (2.0 * pi))
    t = rotvec_from_quat(quat_multiply(quat_conjugate(twist), q))
    for i in range(3):
        d[6 + i] = t[i] + y * u[i]


@fused
def turn_gone(gone, psi, d, sign):
    """Add to d (9+,), or with sign = -1 take from it, what a rotation psi makes of Dw and Du in `gone` (6,)."""
    E = dcm_from_rotvec(psi)
    for part in range(0, 6, 3):
        x, y, z = gone[part], gone[part + 1], gone[part + 2]
        u = mat_vec(E, (x, y, z))
        d[part] += sign * (u[0] - x)
        d[part + 1] += sign * (u[1] - y)
        d[part + 2] += sign * (u[2] - z)


@fused
def retract(nav, gone, d, ecef):
    """Apply an error (9,) in the coordinates of the module to a navigation state, in place; d becomes a plain one."""
    if d[6] != 0.0 or d[7] != 0.0 or d[8] != 0.0:
        psi = turned(d, down_axis(nav, ecef))
        turn_gone(gone, psi, d, 1.0)
        d[6], d[7], d[8] = psi
    boxplus_navigation(nav, d, ecef)


@fused
def correction_turn(dx, u):
    """How a correction dx (9+,) turns the attitude error that is left, a 9-tuple.

    With dx = dt + dy u and e = et + ey u left, ``exp((dy + ey) u) exp(dt + et) = exp(ey u) exp(exp(dy u) J et) exp(dy
    u) exp(dt)``, J the left Jacobian of dt: to first order in et, and for a heading ey of any size, which stays what it
    is.
    """
    y = dx[6] * u[0] + dx[7] * u[1] + dx[8] * u[2]
    t = (dx[6] - y * u[0], dx[7] - y * u[1], dx[8] - y * u[2])
    M = mat_mul(dcm_from_rotvec((y * u[0], y * u[1], y * u[2])), left_jacobian(t))
    m = mat_vec(M, u)
    a, b, c = u[0] - m[0], u[1] - m[1], u[2] - m[2]
    return (
        M[0] + a * u[0], M[1] + a * u[1], M[2] + a * u[2],
        M[3] + b * u[0], M[4] + b * u[1], M[5] + b * u[2],
        M[6] + c * u[0], M[7] + c * u[1], M[8] + c * u[2],
    )  # fmt: skip


@fused
def plain_rows(gone, M):
    """Turn the rows of M (9+, m) from errors in the coordinates of the module to plain ones, to first order."""
    for c in range(M.shape[1]):
        psi = (M[6, c], M[7, c], M[8, c])
        for part in range(0, 6, 3):
            u = cross(psi, (gone[part], gone[part + 1], gone[part + 2]))
            for i in range(3):
                M[part + i, c] += u[i]


@fused
def plain_columns(gone, M):
    """Turn a matrix M (m, 9+) that multiplies errors in the coordinates of the module to one for plain ones."""
    for r in range(M.shape[0]):
        for part in range(0, 6, 3):
            u = cross((gone[part], gone[part + 1], gone[part + 2]), (M[r, part], M[r, part + 1], M[r, part + 2]))
            for i in range(3):
                M[r, 6 + i] -= u[i]


@fused
def draw_points(nav, s, gone, S, mean, distance, ecef, X):
    """Write the sigma points X (2 n + 1, n + 1): navigation state, then the states after the ninth.

    First the estimate corrected by `mean` (n,), then that plus every column of the root S (n, n) times `distance`, then
    minus, in the coordinates of the module. No checks are made.
    """
    n = S.shape[0]
    d = np.empty(9)
    moved = False
    for i in range(9):
        moved = moved or mean[i] != 0.0
    for p in range(2 * n + 1):
        j = (p - 1) % n
        c = 0.0 if p == 0 else (distance if p <= n else -distance)
        for i in range(10):
            X[p, i] = nav[i]
        for i in range(9, n):
            X[p, 1 + i] = s[i - 9] + mean[i] + c * S[i, j]
        if moved or (p > 0 and j < 9):
            for i in range(9):
                d[i] = mean[i] + c * S[i, j]
            retract(X[p, :10], gone, d, ecef)
