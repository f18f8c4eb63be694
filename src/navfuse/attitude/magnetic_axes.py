"""Do the axes of a magnetometer belong to those of the gyro beside it?"""

from __future__ import annotations

from itertools import permutations, product
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from navfuse.core.rotation import quat_from_rotvec, quat_multiply, quat_normalize
from navfuse.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from navfuse.data.aiding_logs import MagnetometerLog
    from navfuse.imu.increments import ImuIncrements

Array = np.ndarray

_LEAST_TURN, _MOST_TURN = np.radians(20.0), np.radians(120.0)
_FEWEST, _TELLING = 10, 2.0
_AXES = "xyz"


@njit(cache=True, error_model="numpy")
def _integrate(inc_theta, q):
    """Attitude (k + 1, 4) of the body against its first axes. No checks are made."""
    q[0, 0], q[0, 1], q[0, 2], q[0, 3] = 1.0, 0.0, 0.0, 0.0
    for k in range(inc_theta.shape[0]):
        turned = quat_multiply(
            (q[k, 0], q[k, 1], q[k, 2], q[k, 3]),
            quat_from_rotvec((inc_theta[k, 0], inc_theta[k, 1], inc_theta[k, 2])),
        )
        turned = quat_normalize(turned)
        for i in range(4):
            q[k + 1, i] = turned[i]


def check_magnetic_axes(
    increments: ImuIncrements, magnetometer: MagnetometerLog, field_n: ArrayLike | None = None
) -> float | None:
    """Hold the turns of the magnetic field in body axes against those of the gyro.

    Parameters
    ----------
    increments : ImuIncrements
    magnetometer : MagnetometerLog
        In the same body axes, if all is well.
    field_n : (3,) array-like, optional
        Field of the Earth, north, east, down, in any unit. With it the sign of all three axes together is checked too.

    Returns
    -------
    float or None
        Residual as a fraction of the field; None if the body turned too little to tell.

    Raises
    ------
    InputError
        If the field turns much better with axes swapped or inverted, naming them, or if the vertical part of the field
        has the wrong sign.

    Notes
    -----
    Over pairs of samples between which the gyro turned by 20 to 120 deg, the later field is predicted from the earlier
    one with each of the 24 ways to name the axes (up to the sign of all, which no turn tells). One of them has to leave
    half the residual (RMS) of the axes as they are.
    """
    inside = (magnetometer.time > increments.time[0]) & (magnetometer.time <= increments.time[-1])
    q = np.empty((len(increments) + 1, 4))
    _integrate(increments.inc_theta_b, q)
    rows = np.flatnonzero(inside)
    at = np.clip(np.searchsorted(increments.time, magnetometer.time[rows]), 0, q.shape[0] - 1)
    first, last = _pairs(q[at], increments.time[at])
    if first.size < _FEWEST:
        return _check_sign(increments, magnetometer, rows, at, field_n)
    field = magnetometer.field_b[rows]
    C = np.array([_matrix(a) for a in q[at[first]]]), np.array([_matrix(a) for a in q[at[last]]])
    turn = np.einsum("kji,kjl->kil", C[1], C[0])
    size = float(np.sqrt(np.mean(np.sum(field**2, axis=1))))

    def residual(A: Array) -> float:
        predicted = np.einsum("kij,kj->ki", turn, field[first] @ A.T)
        return float(np.sqrt(np.mean(np.sum((field[last] @ A.T - predicted) ** 2, axis=1)))) / size

    claimed = residual(np.eye(3))
    best = min(_namings(), key=residual)
    if residual(best) * _TELLING < claimed:
        names = ", ".join(_named(best, i) for i in range(3))
        raise InputError(
            f"{magnetometer.source}: the field does not turn as the gyro does: {100.0 * claimed:.0f} % of it is left "
            f"over, but {100.0 * residual(best):.0f} % with (x, y, z) = ({names}), or all three with the other sign; "
            "correct the axes of the magnetometer (or of the gyro), body axes are forward-right-down"
        )
    _check_sign(increments, magnetometer, rows, at, field_n)
    return claimed


def _check_sign(
    increments: ImuIncrements, magnetometer: MagnetometerLog, rows: Array, at: Array, field_n: ArrayLike | None
) -> None:
    if field_n is None:
        return
    down = float(np.asarray(field_n, dtype=float)[2])
    if abs(down) < 0.3 * float(np.linalg.norm(np.asarray(field_n, dtype=float))):
        return
    force = increments.inc_v_b[np.clip(at - 1, 0, len(increments) - 1)]
    vertical = float(np.mean(-np.sum(force * magnetometer.field_b[rows], axis=1) / np.linalg.norm(force, axis=1)))
    size = float(np.mean(np.linalg.norm(magnetometer.field_b[rows], axis=1)))
    if vertical * np.sign(down) < -0.15 * size:
        raise InputError(
            f"{magnetometer.source}: the field points {'up' if down > 0.0 else 'down'}, against the field of the Earth "
            "there: all axes of the magnetometer, or of the accelerometer, have the wrong sign"
        )


def _matrix(q: Array) -> Array:
    w, x, y, z = q
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def _pairs(q: Array, time: Array) -> tuple[Array, Array]:
    """Samples within 2 s of each other between which the body turned by 20 to 120 deg."""
    pairs: list[tuple[int, int]] = []
    first = 0
    for k in range(1, q.shape[0]):
        angle = 2.0 * np.arccos(min(1.0, abs(float(q[k] @ q[first]))))
        if angle > _MOST_TURN or time[k] - time[first] > 2.0:
            first = k
        elif angle >= _LEAST_TURN:
            pairs.append((first, k))
            first = k
    picked = np.array(pairs, dtype=int).reshape(-1, 2)
    return picked[:, 0], picked[:, 1]


def _namings() -> list[Array]:
    """The 24 signed permutations up to the sign of all."""
    return [
        np.diag(signs) @ np.eye(3)[list(order)]
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
        if signs[0] > 0.0
    ]


def _named(A: Array, row: int) -> str:
    column = int(np.argmax(np.abs(A[row])))
    return ("-" if A[row, column] < 0.0 else "") + _AXES[column]
