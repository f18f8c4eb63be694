"""Single-epoch positions without their outliers: the residual test."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from navfuse.errors import InputError
from navfuse.gnss.single_point import PointSolution, single_point_position

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Array = np.ndarray

THRESHOLD = 6.0
REDUNDANT = 5
"""With fewer satellites there is no residual, with as many an outlier shows but has no name."""


class Checked(NamedTuple):
    """A solution and which satellites are in it.

    Attributes
    ----------
    solution : PointSolution
        Residuals are those of the satellites used.
    used : (m,) bool array
    statistic : (m,) array [1]
        Residual over its standard deviation when the satellite was tested last, signed; NaN where it could not be.
    """

    solution: PointSolution
    used: Array
    statistic: Array


def position_without_outliers(
    pseudorange: ArrayLike,
    sat_r_e: ArrayLike,
    sd: ArrayLike = 1.0,
    start: ArrayLike = (0.0, 0.0, 0.0),
    threshold: float = THRESHOLD,
) -> Checked:
    """Position and clock from the pseudo-ranges of one epoch, the worst outlier left out again and again.

    Parameters
    ----------
    pseudorange, sat_r_e, sd, start
        As for :func:`navfuse.gnss.single_point.single_point_position`.
    threshold : float
        A residual of more than so many of its own standard deviations is an outlier.

    Returns
    -------
    Checked

    Raises
    ------
    InputError
        As :func:`single_point_position`, and for a threshold that is not positive.

    Notes
    -----
    The residuals v = z - H x of a least-squares solution have the covariance R - H (H^T R^-1 H)^-1 H^T (Groves 2013,
    section 17.4.1, v negated). The satellite with the largest ``|v_j| / sd(v_j)`` above the threshold is
    left out, and the solution made anew. With five satellites an outlier makes all five statistics alike: nothing is
    left out then unless one stands out by itself, and four have no residuals at all. No satellite comes back.
    """
    if not threshold > 0.0:
        raise InputError(f"threshold = {threshold} of the residual test must be positive")
    z, sat = np.asarray(pseudorange, dtype=float), np.asarray(sat_r_e, dtype=float)
    sds = np.broadcast_to(np.asarray(sd, dtype=float), z.shape)
    used = np.ones(z.shape, dtype=bool)
    statistic = np.full(z.shape, np.nan)
    while True:
        solution = single_point_position(z[used], sat[used], sds[used], start)
        rows = np.flatnonzero(used)
        if rows.size < REDUNDANT:
            return Checked(solution, used, statistic)
        statistic[rows] = _normalised(solution, sat[rows], sds[rows])
        worst = rows[np.nanargmax(np.abs(statistic[rows]))] if np.isfinite(statistic[rows]).any() else -1
        if worst < 0 or abs(statistic[worst]) <= threshold or rows.size == REDUNDANT:
            return Checked(solution, used, statistic)
        used[worst] = False


def _normalised(solution: PointSolution, sat: Array, sd: Array) -> Array:
    """Residuals over their standard deviations; NaN where a satellite is not checked by the others."""
    u = sat - solution.vector_e
    u /= np.linalg.norm(u, axis=1)[:, None]
    H = np.column_stack((-u, np.ones(len(u))))
    variance = sd**2 - np.einsum("ij,jk,ik->i", H, solution.covariance, H)
    checked = variance > 1e-9 * sd**2
    return np.where(checked, solution.residuals / np.sqrt(np.where(checked, variance, 1.0)), np.nan)
