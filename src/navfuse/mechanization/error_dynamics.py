"""Error dynamics of an inertial navigation state.

The errors are those of the Earth-fixed position r, velocity v and attitude, resolved in the navigation frame m of the
estimate (m = n or e), true minus estimate, with the small rotation psi taking the estimated attitude to the true one:

    d(dr)/dt  = dv - w_em x dr
    d(dv)/dt  = psi x f_m + C_mb df - (2 w_ie + w_em) x dv + Gamma dr
    d(psi)/dt = C_mb dw - (w_ie + w_em) x psi
    dw = -db_g - diag(w) ds_g ...,   df = -db_a - diag(f) ds_a ...

with w_em zero in e, the transport rate in n, and Gamma = (g/R)(3 u u^T - I) the gravity gradient, u up. In this form
one set of equations serves both frames and has no singular place; docs/decisions/0002 gives the derivation.

Over a covariance step the integrals of C_mb, C_mb w, C_mb f and f_m are summed at every inertial sample
(:func:`accumulate`); the step then applies

    psi' = psi - T w_im x psi - sum_j g_j s_j
    dv'  = dv  - T (2 w_ie + w_em) x dv + T Gamma dr + (psi + psi')/2 x Df - sum_j a_j s_j
    dr'  = dr  - T w_em x dr + T (dv + dv')/2

which is second order in the step and exact in the sample-to-sample variation of attitude and specific force.

The s_j stand in the sequence of :func:`imu_places`: by sixes, three of the gyro and then three of the accelerometer.
The g_j and a_j of a three are the columns of a 3 x 3 matrix: the integral of C_mb for both biases, and one matrix for
each other three.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from navfuse.core.constants import EARTH_RATE, WGS84_A, WGS84_E2
from navfuse.core.earth import ellipsoid_normal, normal_gravity
from navfuse.core.fused import fused

GYRO, ACCEL = 0, 1
BIAS = -1

PAIR = 12
"""Places of the biases and scale factors of both sensors; the cross-couplings have as many more."""

ACC_TIME, ACC_FORCE, ACC_DCM, ACC_SCALE, ACC_CROSS, ACC_SIZE = 0, 1, 4, 13, 31, 67
"""Where the sums of one covariance step stand in the accumulator: time, f_m, C_mb, then a 3 x 3 matrix, row by row, for
each three places after the biases."""

CROSS_PAIRS = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
"""Row and column in the error matrix M of the six cross-coupling states, in order."""


def imu_state_map(names: tuple[str, ...]) -> np.ndarray:
    """Which inertial sensor each state belongs to, which axis it disturbs and what it multiplies.

    Parameters
    ----------
    names : tuple of str
        Names of the inertial sensor blocks in order: any of gyro_bias, accel_bias, gyro_scale, accel_scale, gyro_cross,
        accel_cross.

    Returns
    -------
    (m, 3) int array
        Per state: sensor (0 gyro, 1 accelerometer), disturbed axis (row of M), input axis (column of M, or -1 for a
        bias).
    """
    rows = []
    for name in names:
        sensor = GYRO if name.startswith("gyro") else ACCEL
        if name.endswith("bias"):
            rows += [(sensor, i, BIAS) for i in range(3)]
        elif name.endswith("scale"):
            rows += [(sensor, i, i) for i in range(3)]
        else:
            rows += [(sensor, i, k) for i, k in CROSS_PAIRS]
    return np.array(rows, dtype=np.int64).reshape(-1, 3)


def imu_places(imu_map: np.ndarray) -> np.ndarray:
    """Place of each state of :func:`imu_state_map`, (m,) int array.

    The sequence is gyro biases, accelerometer biases, gyro scale factors, accelerometer scale factors, then by threes
    the cross-couplings of gyro and accelerometer in turn.
    """
    places = []
    for sensor, row, column in imu_map.tolist():
        if column == BIAS:
            place = row
        elif column == row:
            place = 6 + row
        else:
            three, within = divmod(CROSS_PAIRS.index((row, column)), 3)
            place = PAIR + 6 * three + within
        places.append(place + 3 * sensor)
    return np.array(places, dtype=np.int64)


@fused
def frame_rates(nav, sin_lat, cos_lat, ecef, w):
    """Rates and gravity gradient at a navigation state, written into `w` (12,).

    `sin_lat` and `cos_lat` are those of the latitude of an NED state; an ECEF state does without.
    `w` receives w_ie_m (0:3), w_em_m (3:6), then Gamma's elements 00, 01, 02, 11, 12, 22. No checks are made.
    """
    if ecef:
        p, c, s, h = ellipsoid_normal(nav[0], nav[1], nav[2])
        ratio = normal_gravity(s, h) / (WGS84_A + h)
        k = c / p if p > 0.0 else 0.0
        ux, uy, uz = k * nav[0], k * nav[1], s
        for i in range(6):
            w[i] = 0.0
        w[2] = EARTH_RATE
        triple = 3.0 * ratio
        w[6] = triple * ux * ux - ratio
        w[7] = triple * ux * uy
        w[8] = triple * ux * uz
        w[9] = triple * uy * uy - ratio
        w[10] = triple * uy * uz
        w[11] = triple * uz * uz - ratio
    else:
        h = nav[2]
        x = 1.0 - WGS84_E2 * sin_lat * sin_lat
        root = sqrt(x)
        ratio = normal_gravity(sin_lat, h) / (WGS84_A + h)
        east = nav[4] * root / (WGS84_A + h * root)
        w[0] = EARTH_RATE * cos_lat
        w[1] = 0.0
        w[2] = -EARTH_RATE * sin_lat
        w[3] = east
        w[4] = -nav[3] * x * root / (WGS84_A * (1.0 - WGS84_E2) + h * x * root)
        w[5] = -east * sin_lat / cos_lat
        w[6] = -ratio
        w[7] = 0.0
        w[8] = 0.0
        w[9] = -ratio
        w[10] = 0.0
        w[11] = 2.0 * ratio


@fused
def accumulate(acc, cross, dt, before, after, t, u, f):
    """Add one inertial increment to the sums of a covariance step.

    Parameters
    ----------
    acc : array
        Sums; see ACC_TIME and its neighbours.
    cross : bool
        Whether there are cross-couplings.
    dt : float [s]
    before, after : 9-tuples
        C_mb at the two ends of the increment.
    t, u : 3-tuples [rad], [m/s]
        Corrected increments of angle and velocity, resolved in b.
    f : 3-tuple [m/s]
        Velocity increment resolved in m.

    Notes
    -----
    A scale factor of axis k moves the increment by C_mb[:, k] times the increment of axis k, a cross-coupling (i, k) by
    C_mb[:, i] times the increment of axis k. No checks are made.
    """
    acc[ACC_TIME] += dt
    for i in range(3):
        acc[ACC_FORCE + i] += f[i]
        x = 0.5 * (before[3 * i] + after[3 * i])
        y = 0.5 * (before[3 * i + 1] + after[3 * i + 1])
        z = 0.5 * (before[3 * i + 2] + after[3 * i + 2])
        at = ACC_DCM + 3 * i
        acc[at] += x * dt
        acc[at + 1] += y * dt
        acc[at + 2] += z * dt
        at = ACC_SCALE + 3 * i
        acc[at] += x * t[0]
        acc[at + 1] += y * t[1]
        acc[at + 2] += z * t[2]
        acc[at + 9] += x * u[0]
        acc[at + 10] += y * u[1]
        acc[at + 11] += z * u[2]
        if cross:
            acc[at + 18] += x * t[1]
            acc[at + 19] += x * t[2]
            acc[at + 20] += y * t[0]
            acc[at + 27] += x * u[1]
            acc[at + 28] += x * u[2]
            acc[at + 29] += y * u[0]
            acc[at + 36] += y * t[2]
            acc[at + 37] += z * t[0]
            acc[at + 38] += z * t[1]
            acc[at + 45] += y * u[2]
            acc[at + 46] += z * u[0]
            acc[at + 47] += z * u[1]


@fused
def corrections(s, stride, sensor, cross):
    """Inverse of I + M of one inertial sensor and its bias, as one 12-tuple.

    `s` holds the estimates in the sequence of places, every `stride` numbers; `sensor` is GYRO or ACCEL, `cross`
    whether there are cross-couplings. No checks are made.
    """
    k = 3 * sensor
    b = (s[k * stride], s[(k + 1) * stride], s[(k + 2) * stride])
    xx, yy, zz = 1.0 + s[(k + 6) * stride], 1.0 + s[(k + 7) * stride], 1.0 + s[(k + 8) * stride]
    if not cross:
        return 1.0 / xx, 0.0, 0.0, 0.0, 1.0 / yy, 0.0, 0.0, 0.0, 1.0 / zz, b[0], b[1], b[2]
    xy, xz, yx = s[(k + 12) * stride], s[(k + 13) * stride], s[(k + 14) * stride]
    yz, zx, zy = s[(k + 18) * stride], s[(k + 19) * stride], s[(k + 20) * stride]
    c0 = yy * zz - yz * zy
    c1 = yz * zx - yx * zz
    c2 = yx * zy - yy * zx
    d = 1.0 / (xx * c0 + xy * c1 + xz * c2)
    return (
        c0 * d, (xz * zy - xy * zz) * d, (xy * yz - xz * yy) * d,
        c1 * d, (xx * zz - xz * zx) * d, (xz * yx - xx * yz) * d,
        c2 * d, (xy * zx - xx * zy) * d, (xx * yy - xy * yx) * d,
        b[0], b[1], b[2],
    )  # fmt: skip
