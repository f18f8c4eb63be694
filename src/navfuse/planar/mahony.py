"""Algorithm 2 in space: a complementary filter on the rotation group, and the attitude it follows."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from navfuse.core.rotation import dcm_from_rotvec, mat_mul
from navfuse.errors import ConfigError, InputError
from navfuse.planar.checks import rows_of, times_of
from navfuse.planar.complementary import check_gain

Array = np.ndarray

_MIN_CROSS = 1e-3


def measured_dcm(accel_b: ArrayLike, field_b: ArrayLike, declination: float = 0.0) -> Array:
    """Attitude of a body that stands or moves evenly, from gravity and the magnetic field.

    Parameters
    ----------
    accel_b, field_b : (n, 3) array-like
        Specific force (a level body at rest reads -g along z) and magnetic field, in any unit.
    declination : float [rad]
        Of the field, positive to the east.

    Returns
    -------
    (n, 3, 3) array
        ``C_nb``: down against the specific force, east at right angles to it and to the field (TRIAD; Black, 1964).

    Raises
    ------
    InputError
        For other shapes, or a row in which the two are parallel or zero.
    """
    accel = rows_of("accel_b", accel_b, (3,))
    field = rows_of("field_b", field_b, (3,), len(accel))
    lengths = np.linalg.norm(accel, axis=1), np.linalg.norm(field, axis=1)
    down = -accel / np.where(lengths[0] > 0.0, lengths[0], 1.0)[:, None]
    east = np.cross(down, field / np.where(lengths[1] > 0.0, lengths[1], 1.0)[:, None])
    size = np.linalg.norm(east, axis=1)
    if (size < _MIN_CROSS).any():
        raise InputError(
            f"row {int(np.argmax(size < _MIN_CROSS)) + 1}: specific force and field are parallel or zero; they have no"
            " heading"
        )
    east /= size[:, None]
    magnetic = np.stack((np.cross(east, down), east, down), axis=1)
    c, s = np.cos(declination), np.sin(declination)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ magnetic


def complementary_attitude(
    time: ArrayLike,
    gyro: ArrayLike,
    dcm: ArrayLike,
    gain: float = 1.0,
    bias_gain: float = 0.0,
    *,
    start: ArrayLike | None = None,
) -> tuple[Array, Array]:
    """Attitude that follows the gyros at once and a measured attitude in the long run.

    Parameters
    ----------
    time : (n,) array-like [s]
        Strictly increasing.
    gyro : (n, 3) array-like [rad/s]
        Angular rate, mean over the step that ends at `time`.
    dcm : (n, 3, 3) array-like
        Measured ``C_nb``; NaN in rows without one.
    gain : float [1/s]
        K_p.
    bias_gain : float [1/s^2]
        K_I: 0 leaves the bias at zero. Up to K_p^2 / 4 the two do not swing.
    start : (3, 3) array-like, optional
        Estimate in row 0; default the first measurement.

    Returns
    -------
    C_nb : (n, 3, 3) array
    bias : (n, 3) array [rad/s]
        Of the gyros: measured minus true.

    Raises
    ------
    InputError
        If the arrays do not fit together, or no attitude was ever measured.
    ConfigError
        If a gain is negative or too high for the steps.

    Notes
    -----
    The rotation that is missing is w = vee(C'^T C - C^T C') / 2; C' <- C' exp([gyro - b + K_p w] T) by Rodrigues'
    formula, b <- b - K_I w T (Mahony, Hamel and Pflimlin, 2008, eqs. 32, passive filter).
    """
    t = times_of("time", time)
    rate = rows_of("gyro", gyro, (3,), t.size)
    measured = np.asarray(dcm, dtype=float)
    if measured.shape != (t.size, 3, 3):
        raise InputError(f"dcm has shape {measured.shape}; it has to be ({t.size}, 3, 3)")
    check_gain("gain", gain, float(np.diff(t).max()))
    if not (np.isfinite(bias_gain) and 0.0 <= bias_gain <= gain * gain):
        raise ConfigError(f"bias_gain = {bias_gain} has to be 0 or more, and at most the square of gain")
    if not np.isfinite(rate[1:]).all():
        row = int(np.argmin(np.isfinite(rate[1:]).all(axis=1))) + 2
        raise InputError(f"gyro: row {row} is not finite; leave such rows out")
    known = np.array(np.isfinite(measured).all(axis=(1, 2)), dtype=bool)
    if start is None and not known.any():
        raise InputError("dcm: no row holds an attitude; give the start")
    first = measured[np.argmax(known)] if start is None else np.asarray(start, dtype=float)
    flat = np.where(known[:, None], measured.reshape(-1, 9), np.nan)
    out, bias = _filter(t, rate, flat, float(gain), float(bias_gain), np.ascontiguousarray(first).reshape(9))
    return out.reshape(-1, 3, 3), bias


@njit(cache=True, error_model="numpy")
def _filter(time, rate, measured, gain, bias_gain, start):
    """The recursion on matrices row by row. No checks are made."""
    n = time.size
    out, biases = np.empty((n, 9)), np.zeros((n, 3))
    C = (start[0], start[1], start[2], start[3], start[4], start[5], start[6], start[7], start[8])
    bx = by = bz = 0.0
    for i in range(9):
        out[0, i] = C[i]
    for k in range(1, n):
        dt = time[k] - time[k - 1]
        wx = wy = wz = 0.0
        M = measured[k - 1]
        if not np.isnan(M[0]):
            # vee of (C'^T M - M^T C') / 2: columns of C' against columns of M.
            for r in range(0, 9, 3):
                wx += 0.5 * (C[r + 2] * M[r + 1] - C[r + 1] * M[r + 2])
                wy += 0.5 * (C[r] * M[r + 2] - C[r + 2] * M[r])
                wz += 0.5 * (C[r + 1] * M[r] - C[r] * M[r + 1])
        step = dcm_from_rotvec(
            (
                (rate[k, 0] - bx + gain * wx) * dt,
                (rate[k, 1] - by + gain * wy) * dt,
                (rate[k, 2] - bz + gain * wz) * dt,
            )
        )
        C = mat_mul(C, step)
        bx -= bias_gain * wx * dt
        by -= bias_gain * wy * dt
        bz -= bias_gain * wz * dt
        biases[k, 0], biases[k, 1], biases[k, 2] = bx, by, bz
        for i in range(9):
            out[k, i] = C[i]
    return out, biases
