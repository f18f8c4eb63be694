"""Propagation of the error covariance of an inertial navigation state.

The errors are those of the Earth-fixed position r, velocity v and attitude, resolved in the navigation frame m of the estimate
(m = n or e), true minus estimate, with the small rotation psi taking the estimated attitude to the true one:

    d(dr)/dt  = dv - w_em x dr
    d(dv)/dt  = psi x f_m + C_mb df - (2 w_ie + w_em) x dv + Gamma dr
    d(psi)/dt = C_mb dw - (w_ie + w_em) x psi
    dw = -db_g - diag(w) ds_g ...,   df = -db_a - diag(f) ds_a ...

with w_em zero in e, the transport rate in n, and Gamma = (g/R)(3 u u^T - I) the gravity gradient, u up. In this form one set of
equations serves both frames and has no singular place; docs/decisions/0001 gives the derivation.

Over a covariance step the integrals of C_mb, C_mb w, C_mb f and f_m are summed at every inertial sample; the step then applies

    psi' = psi - T w_im x psi + sum_j a_j s_j
    dv'  = dv  - T (2 w_ie + w_em) x dv + T Gamma dr + (psi + psi')/2 x Df + sum_j a_j s_j
    dr'  = dr  - T w_em x dr + T (dv + dv')/2

which is second order in the step and exact in the sample-to-sample variation of attitude and specific force. Process noise is
added half before and half after the step (trapezoidal rule).
"""

from __future__ import annotations

from math import exp

import numpy as np
from numba import njit

from navfuse.core.constants import EARTH_RATE, WGS84_A
from navfuse.core.earth import ecef_to_geodetic, normal_gravity, radii

GYRO, ACCEL = 0, 1
BIAS = -1

ACC_TIME, ACC_FORCE, ACC_DCM, ACC_STATES = 0, 1, 4, 13
"""Where the sums of one covariance step stand in the accumulator: time, f_m, C_mb, then three per scale or coupling state."""

TILE = 24
"""Columns that the transition is applied to at a time."""

_RATES = 19

CROSS_PAIRS = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
"""Row and column in the error matrix M of the six cross-coupling states, in order."""


def imu_state_map(names: tuple[str, ...]) -> np.ndarray:
    """Which inertial sensor each state belongs to, which axis it disturbs and what it multiplies.

    Parameters
    ----------
    names : tuple of str
        Names of the inertial sensor blocks in order: any of gyro_bias, accel_bias, gyro_scale, accel_scale, gyro_cross, accel_cross.

    Returns
    -------
    (m, 3) int array
        Per state: sensor (0 gyro, 1 accelerometer), disturbed axis (row of M), input axis (column of M, or -1 for a bias).
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


@njit(cache=True)
def frame_rates(nav, ecef, w):
    """Rates and gravity gradient at a navigation state, written into `w` (15,).

    `w` receives w_ie_m (0:3), w_em_m (3:6), then Gamma row by row (6:15). No checks are made.
    """
    for k in range(15):
        w[k] = 0.0
    if ecef:
        lat, lon, h = ecef_to_geodetic(nav[0], nav[1], nav[2])
        s, c = np.sin(lat), np.cos(lat)
        ratio = normal_gravity(s, h) / (WGS84_A + h)
        u = (c * np.cos(lon), c * np.sin(lon), s)
        w[2] = EARTH_RATE
        for i in range(3):
            for j in range(3):
                w[6 + 3 * i + j] = 3.0 * ratio * u[i] * u[j]
            w[6 + 4 * i] -= ratio
    else:
        s, c = np.sin(nav[0]), np.cos(nav[0])
        h = nav[2]
        rm, rt = radii(s)
        ratio = normal_gravity(s, h) / (WGS84_A + h)
        w[0] = EARTH_RATE * c
        w[2] = -EARTH_RATE * s
        w[3] = nav[4] / (rt + h)
        w[4] = -nav[3] / (rm + h)
        w[5] = -nav[4] * s / (c * (rt + h))
        w[6] = -ratio
        w[10] = -ratio
        w[14] = 2.0 * ratio


@njit(cache=True)
def _transition_rows(M, out, coefficients, kinds, m, count):
    """Navigation rows of the transition matrix times the first `count` columns of a tile.

    `M` is flat, n rows of TILE columns; `out` flat, nine rows of TILE columns. A constant stride and a count that is not constant
    are what lets the compiler use vector instructions. No checks are made.
    """
    k = coefficients
    ax, ay, az = k[0], k[1], k[2]
    cx, cy, cz = k[3], k[4], k[5]
    g00, g01, g02, g11, g12, g22 = k[9], k[10], k[11], k[12], k[13], k[14]
    for c in range(count):
        px, py, pz = M[6 * TILE + c], M[7 * TILE + c], M[8 * TILE + c]
        out[6 * TILE + c] = px - (ay * pz - az * py)
        out[7 * TILE + c] = py - (az * px - ax * pz)
        out[8 * TILE + c] = pz - (ax * py - ay * px)
    for c in range(count):
        rx, ry, rz = M[c], M[TILE + c], M[2 * TILE + c]
        vx, vy, vz = M[3 * TILE + c], M[4 * TILE + c], M[5 * TILE + c]
        out[3 * TILE + c] = vx - (cy * vz - cz * vy) + (g00 * rx + g01 * ry + g02 * rz)
        out[4 * TILE + c] = vy - (cz * vx - cx * vz) + (g01 * rx + g11 * ry + g12 * rz)
        out[5 * TILE + c] = vz - (cx * vy - cy * vx) + (g02 * rx + g12 * ry + g22 * rz)
    for j in range(m):
        b0, b1, b2 = k[_RATES + 3 * j], k[_RATES + 3 * j + 1], k[_RATES + 3 * j + 2]
        at = (9 + j) * TILE
        if kinds[j] == GYRO:
            for c in range(count):
                v = M[at + c]
                out[6 * TILE + c] -= b0 * v
                out[7 * TILE + c] -= b1 * v
                out[8 * TILE + c] -= b2 * v
        else:
            for c in range(count):
                v = M[at + c]
                out[3 * TILE + c] -= b0 * v
                out[4 * TILE + c] -= b1 * v
                out[5 * TILE + c] -= b2 * v
    ex, ey, ez = k[6], k[7], k[8]
    hx, hy, hz = k[15], k[16], k[17]
    half = k[18]
    for c in range(count):
        px = M[6 * TILE + c] + out[6 * TILE + c]
        py = M[7 * TILE + c] + out[7 * TILE + c]
        pz = M[8 * TILE + c] + out[8 * TILE + c]
        out[3 * TILE + c] += py * hz - pz * hy
        out[4 * TILE + c] += pz * hx - px * hz
        out[5 * TILE + c] += px * hy - py * hx
    for c in range(count):
        rx, ry, rz = M[c], M[TILE + c], M[2 * TILE + c]
        out[c] = rx - (ey * rz - ez * ry) + half * (M[3 * TILE + c] + out[3 * TILE + c])
        out[TILE + c] = ry - (ez * rx - ex * rz) + half * (M[4 * TILE + c] + out[4 * TILE + c])
        out[2 * TILE + c] = rz - (ex * ry - ey * rx) + half * (M[5 * TILE + c] + out[5 * TILE + c])


@njit(cache=True)
def _coefficients(acc, w, imu_map, k, kinds):
    """Everything :func:`_transition_rows` needs of one step, in one flat array. No checks are made."""
    T = acc[ACC_TIME]
    for i in range(3):
        k[i] = T * (w[i] + w[3 + i])
        k[3 + i] = T * (2.0 * w[i] + w[3 + i])
        k[6 + i] = T * w[3 + i]
        k[15 + i] = 0.5 * acc[ACC_FORCE + i]
    k[9], k[10], k[11] = T * w[6], T * w[7], T * w[8]
    k[12], k[13], k[14] = T * w[10], T * w[11], T * w[14]
    k[18] = 0.5 * T
    for j in range(imu_map.shape[0]):
        kinds[j] = imu_map[j, 0]
        for i in range(3):
            if imu_map[j, 2] == BIAS:
                k[_RATES + 3 * j + i] = acc[ACC_DCM + imu_map[j, 1] + 3 * i]
            else:
                k[_RATES + 3 * j + i] = acc[ACC_STATES + 3 * j + i]


@njit(cache=True)
def _half_noise(P, noise, stochastic, decay, T):
    n = P.shape[0]
    for i in range(3):
        P[3 + i, 3 + i] += 0.5 * noise[1] * T
        P[6 + i, 6 + i] += 0.5 * noise[0] * T
    for j in range(n - 9):
        if stochastic[j, 2] > 0.0:
            P[9 + j, 9 + j] += 0.5 * stochastic[j, 0] * (1.0 - decay[j] * decay[j])
        else:
            P[9 + j, 9 + j] += 0.5 * stochastic[j, 1] * T


@njit(cache=True)
def covariance_step(P, x, s, F, acc, w, imu_map, noise, stochastic, decay, work, track):
    """Carry covariance, error estimate and accumulated transition over the summed covariance step, in place.

    Parameters
    ----------
    P : (n, n) array
        Covariance.
    x : (n,) array
        Error estimate (all zero in a closed loop).
    s : (n - 9,) array
        Estimates of the states after the ninth; Gauss-Markov states decay towards zero.
    F : (10, n) array
        Accumulated transition since the last event: nine navigation rows, then the diagonal of the remaining states.
    acc : (13 + 3 m,) array
        Sums of this step; zeroed on return.
    w : (15,) array
        From :func:`frame_rates` at the end of the step.
    imu_map : (m, 3) int array
        From :func:`imu_state_map`.
    noise : (2,) array
        Densities of the angular [rad^2/s] and the velocity [m^2/s^3] random walk.
    stochastic : (n - 9, 3) array
        Per state: steady-state variance, random-walk density, 1/tau (0 = no decay).
    decay : (n - 8,) array
        Scratch kept between calls: decay factors for a step of length decay[-1].
    work : array
        From :func:`scratch`.
    track : bool
        Whether F is accumulated.

    Notes
    -----
    No checks are made.
    """
    n = P.shape[0]
    m = n - 9
    T = acc[ACC_TIME]
    if T != decay[m]:
        for j in range(m):
            decay[j] = exp(-T * stochastic[j, 2]) if stochastic[j, 2] > 0.0 else 1.0
        decay[m] = T
    mi = imu_map.shape[0]
    M = work[: TILE * n]
    out = work[TILE * n : TILE * n + 9 * TILE]
    W = work[TILE * (n + 9) : TILE * (n + 9) + 9 * n]
    k = work[TILE * (n + 9) + 9 * n : TILE * (n + 9) + 9 * n + _RATES + 3 * mi]
    kinds = work[TILE * (n + 9) + 9 * n + _RATES + 3 * mi :]
    _coefficients(acc, w, imu_map, k, kinds)
    _half_noise(P, noise, stochastic, decay, T)
    for c0 in range(0, n + 1, TILE):
        width = min(TILE, n - c0)
        for i in range(n):
            for c in range(width):
                M[i * TILE + c] = P[i, c0 + c]
        if width < TILE:
            for i in range(n):
                M[i * TILE + width] = x[i]
        _transition_rows(M, out, k, kinds, mi, min(TILE, (width + 4) // 4 * 4))
        for i in range(9):
            for c in range(width):
                W[i * n + c0 + c] = out[i * TILE + c]
        if width < TILE:
            for i in range(9):
                x[i] = out[i * TILE + width]
    for j in range(m):
        x[9 + j] *= decay[j]
    for i in range(9):
        for j in range(n):
            M[j * TILE + i] = W[i * n + j]
    _transition_rows(M, out, k, kinds, mi, 12)
    for i in range(9):
        for j in range(i + 1):
            v = 0.5 * (out[i * TILE + j] + out[j * TILE + i])
            P[i, j] = v
            P[j, i] = v
    for i in range(9):
        for j in range(m):
            v = W[i * n + 9 + j] * decay[j]
            P[i, 9 + j] = v
            P[9 + j, i] = v
    for j in range(m):
        d = decay[j]
        for c in range(m):
            P[9 + j, 9 + c] *= d * decay[c]
        s[j] *= d
    _half_noise(P, noise, stochastic, decay, T)

    if track:
        for c0 in range(0, n, TILE):
            width = min(TILE, n - c0)
            for i in range(9):
                for c in range(width):
                    M[i * TILE + c] = F[i, c0 + c]
            for j in range(m):
                for c in range(width):
                    M[(9 + j) * TILE + c] = 0.0
                if c0 <= 9 + j < c0 + width:
                    M[(9 + j) * TILE + 9 + j - c0] = F[9, 9 + j]
            _transition_rows(M, out, k, kinds, mi, (width + 3) // 4 * 4)
            for i in range(9):
                for c in range(width):
                    F[i, c0 + c] = out[i * TILE + c]
        for j in range(m):
            F[9, 9 + j] *= decay[j]
    for i in range(acc.size):
        acc[i] = 0.0


def scratch(n: int) -> np.ndarray:
    """Work space of :func:`covariance_step` for n states."""
    return np.zeros(TILE * (n + 9) + 9 * n + _RATES + 4 * n)
