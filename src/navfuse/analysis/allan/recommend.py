"""From identified noise to what a filter can carry: white noise and one Gauss-Markov process or random walk per bias.

Bias instability has no finite state. Of a first-order Gauss-Markov process with standard deviation s and correlation
time T, the Allan deviation rises as ``s sqrt(2 tau / (3 T))``, peaks at 0.617 s for tau = 1.89 T, and falls as
``s sqrt(2 T / tau)``. Its s and T are chosen so that this curve follows that of the bias (B, K, a Gauss-Markov process,
R: everything that is not white) between where the bias emerges from the white noise and the horizon, by least squares
in the logarithm. Where a random walk follows as well or better, it is taken.

A walk without bounds is fitted beside it for a filter that starts from a bias at switch-on. The walk that drives the
process, ``s sqrt(2 / T)``, would be none: beyond T its Allan deviation is far above that of the bias. Over the same
averaging times the walk is as often too small (at the short ones) as too large, but never above the rate random walk
that the record allows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navfuse.analysis.allan.terms import gauss_markov_allan

Array = np.ndarray

HORIZON = 3600.0
"""Seconds over which a filter has to carry the bias."""

_POINTS = 60


@dataclass(frozen=True, slots=True)
class BiasModel:
    """A bias as a filter carries it.

    Attributes
    ----------
    sd : (3,) tuple [rad/s] or [m/s^2]
        In-run standard deviation of each axis: of the Gauss-Markov process, or what the walk reaches over the horizon.
    tau : float [s]
        Correlation time, common to the axes; inf for a random walk.
    walk : (3,) tuple [unit of sd per sqrt(s)]
        Density of the random walk; zero beside a finite `tau`.
    error : float
        Root mean square of the logarithm of modelled over found Allan deviation.
    span : (float, float) [s]
        Averaging times that were fitted.
    free_walk : (3,) tuple [unit of sd per sqrt(s)]
        Density of a random walk that stands for the bias alone, `walk` itself where `tau` is infinite.
    free_error : float
        Its root mean square of the logarithm of modelled over found Allan deviation.
    held : (3,) tuple of bool
        Whether it was lowered to what the record allows.
    """

    sd: tuple[float, ...]
    tau: float
    walk: tuple[float, ...]
    error: float
    span: tuple[float, float]
    free_walk: tuple[float, ...]
    free_error: float
    held: tuple[bool, ...]


def bias_model(
    slow: list[Array | None], white: list[float], tau: Array, horizon: float, most: list[float] | None = None
) -> BiasModel | None:
    """One Gauss-Markov process, or random walk, for each axis of a sensor.

    Parameters
    ----------
    slow : list of (t,) array or None
        Allan variance of all that is not white, one for each axis; None where there is nothing.
    white : list of float
        Coefficients N of the axes.
    tau : (t,) array [s]
        Averaging times of `slow`, spaced evenly in the logarithm.
    horizon : float [s]
        Longest averaging time to follow.
    most : list of float, optional
        Largest rate random walk K of each axis that the record allows, which no random walk exceeds; inf for no limit,
        which is the default.

    Returns
    -------
    BiasModel or None
        None where no axis shows any bias but a constant one.
    """
    known = [(k, values) for k, values in enumerate(slow) if values is not None]
    if not known:
        return None
    emerges = min(_emerges(values, white[k], tau, horizon) for k, values in known)
    inside = (tau >= emerges) & (tau <= max(horizon, 4.0 * emerges))
    logs = np.array([np.log(values[inside]) for _, values in known])
    where = tau[inside]
    tried = [*np.geomspace(0.3 * where[0], 3.0 * where[-1], _POINTS), math.inf]
    scores = []
    for correlation in tried:
        shape = np.log(where / 3.0 if math.isinf(correlation) else gauss_markov_allan(where, correlation))
        size = (logs - shape).mean(axis=1)
        scores.append((float(np.mean((logs - shape - size[:, None]) ** 2)), size))
    order = [score for score, _ in scores]
    best = int(np.argmin(order))
    if order[-1] <= 1.02 * order[best]:
        best = len(tried) - 1
    error, size = scores[best]
    index = [k for k, _ in known]
    found, walk = np.zeros(len(slow)), np.zeros(len(slow))
    found[index], walk[index] = np.exp(0.5 * size), np.exp(0.5 * scores[-1][1])
    limit = np.full(len(slow), math.inf) if most is None else np.array(most)
    held, walk = walk > limit, np.minimum(walk, limit)
    off = logs - np.log(where / 3.0) - 2.0 * np.log(walk[index])[:, None]
    free = (tuple(walk.tolist()), 0.5 * math.sqrt(float(np.mean(off**2))), tuple(held.tolist()))
    span = (float(where[0]), float(where[-1]))
    if math.isinf(tried[best]):
        return BiasModel(tuple((walk * math.sqrt(span[1])).tolist()), math.inf, free[0], free[1], span, *free)
    none = (0.0,) * len(slow)
    return BiasModel(tuple(found.tolist()), float(tried[best]), none, 0.5 * math.sqrt(error), span, *free)


def _emerges(slow: Array, white: float, tau: Array, horizon: float) -> float:
    """Averaging time from which the slow part exceeds the white one; a tenth of the horizon if it never does."""
    above = np.flatnonzero(slow >= white**2 / tau)
    return float(tau[above[0]]) if above.size and tau[above[0]] < 0.5 * horizon else 0.1 * horizon
