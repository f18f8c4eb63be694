"""Dead reckoning in the plane: accelerations added up twice."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from navfuse.planar.checks import rows_of, times_of

Array = np.ndarray


def dead_reckon(
    time: ArrayLike, accel: ArrayLike, position: ArrayLike = (0.0, 0.0), velocity: ArrayLike = (0.0, 0.0)
) -> tuple[Array, Array]:
    """Positions and velocities from accelerations and a start.

    Parameters
    ----------
    time : (n,) array-like [s]
        Strictly increasing.
    accel : (n, 2) array-like [m/s^2]
        North and east, mean over the step that ends at `time`; row 0 is not used.
    position, velocity : (2,) array-like [m], [m/s]
        In row 0.

    Returns
    -------
    position, velocity : (n, 2) arrays
        Exact for accelerations that are constant over each step.

    Raises
    ------
    InputError
        If the arrays do not fit together.
    """
    t = times_of("time", time)
    a = rows_of("accel", accel, (2,), t.size)[1:]
    dt = np.diff(t)[:, None]
    v = np.vstack((np.zeros(2), np.cumsum(a * dt, axis=0))) + np.asarray(velocity, dtype=float)
    steps = v[:-1] * dt + 0.5 * a * dt**2
    return np.vstack((np.zeros(2), np.cumsum(steps, axis=0))) + np.asarray(position, dtype=float), v
