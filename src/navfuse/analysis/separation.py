"""Filter against smoother: what their difference says of the model, without any truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from navfuse.analysis.metrics import ErrorSeries, errors
from navfuse.data.trajectory import Trajectory

BLOCKS = ("position", "velocity", "attitude")
LONG_ENOUGH_S = 300.0
"""Shorter runs hold too few independent differences of filter and smoother to conclude from."""


def separation(forward: Trajectory, smoothed: Trajectory) -> ErrorSeries:
    """Filter minus smoother, with the standard deviation that this difference has when both are optimal.

    The error of an optimal smoother is uncorrelated with everything that can be computed of the measurements, the
    difference among it, so that P_f = P_s + cov(x_f - x_s): the difference has the covariance P_f - P_s (Gelb (ed.),
    *Applied Optimal Estimation* (1974), section 5.4, uses it to tell which states smoothing can improve). A difference
    far outside three of these standard deviations shows a wrong model without any truth.

    Parameters
    ----------
    forward, smoothed : Trajectory

    Returns
    -------
    ErrorSeries
        At the smoother's times. ``sd_position`` and the others are sqrt(sd_f^2 - sd_s^2), 0 where the smoother
        claims no more than the filter.

    Raises
    ------
    InputError
        When one of them has fewer than two epochs, or they have no time in common.
    """
    found = errors(forward, replace(smoothed, sd_position=None, sd_velocity=None, sd_attitude=None))
    keep = np.searchsorted(smoothed.time, found.time)
    change = {}
    for name in (f"sd_{block}" for block in BLOCKS):
        sd, late = getattr(found, name), getattr(smoothed, name)
        if sd is None or late is None:
            change[name] = None
        else:
            change[name] = np.sqrt(np.maximum(sd**2 - late[keep] ** 2, 0.0))
    return replace(found, **change)


def separation_factors(apart: ErrorSeries) -> dict[str, float]:
    """How many times further filter and smoother lie apart than they claim, by block; 1 when the model is right.

    Root of the sum of squares of the differences over that of their standard deviations. Empty for a run shorter
    than :data:`LONG_ENOUGH_S`, and without standard deviations.
    """
    factors: dict[str, float] = {}
    if apart.time[-1] - apart.time[0] < LONG_ENOUGH_S:
        return factors
    for block in BLOCKS:
        values, sd = getattr(apart, block), getattr(apart, f"sd_{block}")
        if values is None or sd is None:
            continue
        known = np.isfinite(values) & np.isfinite(sd)
        power = float(np.sum(sd[known] ** 2))
        if power > 0.0:
            factors[block] = float(np.sqrt(np.sum(values[known] ** 2) / power))
    return factors
