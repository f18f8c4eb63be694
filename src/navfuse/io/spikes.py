"""Single rows of an inertial log that no motion explains.

A bit that flips on the way from the sensor leaves one row far away from those around it, and those as if nothing had
happened. To a filter it is a turn that no covariance knows of. A real shock is not like that: the structure rings, and
the rows beside it show it.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

Array = np.ndarray

GYRO_FLOOR = 5.0
ACCEL_FLOOR = 100.0
"""Deviations [rad/s], [m/s^2] from the rows around that are never taken for an error."""
BEYOND = 10.0
USUAL_SHARE = 0.999
QUIET_SHARE = 0.1
FEWEST_ROWS = 20


def spikes(time: Array, gyro: Array, accel: Array, kind: Literal["rates", "increments"]) -> Array:
    """Rows that stand alone.

    Parameters
    ----------
    time : (n,) array [s]
        As in the file; may hold NaN.
    gyro, accel : (n, 3) arrays
        Rates or increments; may hold NaN.
    kind : {"rates", "increments"}

    Returns
    -------
    (m,) int array
        Rows of which a rate deviates from the middle of the two rows before and after by more than ten times what
        999 of 1000 rows do, and more than GYRO_FLOOR or ACCEL_FLOOR, while neither neighbour deviates by a tenth of
        it.
    """
    if time.size < FEWEST_ROWS:
        return np.empty(0, dtype=np.int64)
    step = np.diff(time)
    step = step[step > 0.0]
    dt = float(np.median(step)) if kind == "increments" and step.size else 1.0
    found = []
    for values, floor in ((gyro, GYRO_FLOOR), (accel, ACCEL_FLOOR)):
        if not _jumps(values, floor * dt):
            continue
        deviation = _deviations(values) / dt
        usual = float(np.quantile(deviation, USUAL_SHARE))
        rows = np.flatnonzero(deviation > max(floor, BEYOND * usual))
        beside = np.maximum(deviation[rows - 1], deviation[rows + 1])
        found.append(rows[beside < QUIET_SHARE * deviation[rows]])
    return np.unique(np.concatenate(found)) if found else np.empty(0, dtype=np.int64)


def _jumps(values: Array, least: float) -> bool:
    """Whether any value is more than `least` away from the one before; quick, and false for nearly every log."""
    return any(bool(np.any(np.abs(np.diff(values[:, k])) > least)) for k in range(3))


def _deviations(values: Array) -> Array:
    """Largest deviation of a component from the mean of the middle two of its four neighbours, (n,).

    Zero for the two rows at either end, and where there is a NaN around.
    """
    deviation = np.zeros(values.shape[0])
    for k in range(3):
        x = values[:, k]
        around = np.sort(np.stack([x[:-4], x[1:-3], x[3:-1], x[4:]]), axis=0)
        apart = np.abs(x[2:-2] - 0.5 * (around[1] + around[2]))
        deviation[2:-2] = np.fmax(deviation[2:-2], apart)
    return deviation
