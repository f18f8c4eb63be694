"""Holes in the inertial data: where they are, and what a vehicle may do in one."""

from __future__ import annotations

import numpy as np

from navfuse.imu.increments import MISSING_STEPS, ImuIncrements

Array = np.ndarray


def gap_limit(time: Array) -> float:
    """Step between inertial stamps from which samples are missing [s]: one and a half usual ones."""
    return MISSING_STEPS * float(np.median(np.diff(time))) if time.size > 1 else np.inf


def change_over(increments: ImuIncrements, length: float) -> tuple[float, float]:
    """How far the mean rate [rad/s] and specific force [m/s^2] over `length` [s] stray from those at its two ends.

    Root mean square over the log, the worst axis, doubled, and no less than 1 deg/s and 0.2 m/s^2: what is not known
    of the motion inside a gap of that length.
    """
    steps = max(2, round(length / float(np.median(increments.dt))))
    count = len(increments) // steps
    found = []
    for values, least in ((increments.inc_theta_b, np.radians(1.0)), (increments.inc_v_b, 0.2)):
        rate = values / increments.dt[:, None]
        windows = rate[: count * steps].reshape(count, steps, 3)
        stray = windows.mean(axis=1) - 0.5 * (windows[:, 0] + windows[:, -1])
        found.append(max(least, 2.0 * float(np.sqrt(np.mean(stray**2, axis=0)).max())) if count else 10.0 * least)
    return found[0], found[1]


def without_false_start(increments: ImuIncrements) -> ImuIncrements:
    """The increments behind a gap in the first second: a few samples before it are no start."""
    head = np.flatnonzero(increments.time[:-1] - increments.time[0] < 1.0)
    step = increments.dt[head]
    gaps = np.flatnonzero(step > max(0.5, 5.0 * float(np.median(increments.dt))))
    return increments.piece(int(gaps[-1]) + 1) if gaps.size and gaps[-1] + 2 < len(increments) else increments
