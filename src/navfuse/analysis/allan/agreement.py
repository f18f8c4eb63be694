"""Does a fitted model agree with the measured Allan deviation, and where not?

The distribution is that of the model: if it is true, the measured variance times the degrees of freedom of noise of the
model's own slope, over the variance of the model, is a chi-square variable. The interval drawn about a measured curve
cannot answer this: it takes the noise type from the data, and so believes a curve that is low, and flat, by chance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navfuse.analysis.allan.deviations import DeviationCurve
from navfuse.analysis.allan.fitting import GOOD_ENOUGH

Array = np.ndarray

ALLAN_KINDS = ("adev", "oadev", "totdev")
"""Deviations that the Allan variance of a model can be held against."""

CONTRADICTED = 1e-4
"""Probability, at one averaging time, of a measured deviation as low as it is, below which a term is dropped. A record
has about ten averaging times that do not depend on each other."""

UNLIKELY = 0.01
"""Probability of either tail from which on a difference is told."""

WORTH_TELLING = 1.25
"""Factor between model and measured deviation below which nothing is told."""


@dataclass(frozen=True, slots=True)
class Disagreement:
    """Averaging times at which the fitted model and the measured deviation differ.

    Attributes
    ----------
    begin, end : float [s]
    ratio : float
        Model over measured deviation, the farthest from 1 between them.
    probability : float
        The smallest, of the tail of the distribution in which the measured deviation is.
    """

    begin: float
    end: float
    ratio: float
    probability: float


def probability_below(curve: DeviationCurve, model: Array, misfit: float = 0.0, error: Array | float = 0.0) -> Array:
    """Probability that a record of the model has an Allan deviation below the measured one.

    Parameters
    ----------
    curve : DeviationCurve
        One of :data:`ALLAN_KINDS`.
    model : (t,) array
        Allan variance of the model at the averaging times of the curve.
    misfit : float
        Relative error of the density of the model. It is allowed for as if it were the same at all frequencies, but
        not beyond :data:`~navfuse.analysis.allan.fitting.GOOD_ENOUGH`: a worse model has no claim to the benefit of
        the doubt.
    error : (t,) array or float
        Relative one sigma of the model, where it was fitted to another part of the record than the curve is of.

    Returns
    -------
    (t,) array

    Notes
    -----
    The degrees of freedom are those of the stretches that the curve was averaged over. A record with gaps has fewer
    than one as long without, at long averaging times by far.
    """
    from scipy.special import gammainc

    slope = np.gradient(np.log(model), np.log(curve.tau))
    alpha = np.clip(np.rint(-1.0 - slope), -2, 2).astype(int)
    edf = curve.degrees_of_freedom(alpha)
    half = 0.5 / (1.0 / np.maximum(edf, 1.0) + 0.5 * (min(misfit, GOOD_ENOUGH) ** 2 + np.square(error)))
    return gammainc(half, half * curve.deviation**2 / model)


def too_large_at(curve: DeviationCurve, below: Array, shortest: float) -> int | None:
    """Index of the averaging time where the measured deviation contradicts the model as too large; None if nowhere.

    Parameters
    ----------
    curve : DeviationCurve
    below : (t,) array
        Of :func:`probability_below`.
    shortest : float [s]
        Below it the model does not hold.

    Notes
    -----
    Medians of five neighbours are taken: single averaging times dip where a line has whole periods in them.
    """
    from scipy.ndimage import median_filter

    where = np.flatnonzero(curve.tau >= shortest)
    if where.size == 0:
        return None
    smooth = median_filter(below[where], min(5, where.size), mode="nearest")
    at = int(np.argmin(smooth))
    return int(where[at]) if smooth[at] < CONTRADICTED else None


def disagreements(curve: DeviationCurve, model: Array, below: Array, shortest: float = 0.0) -> list[Disagreement]:
    """Runs of three or more averaging times that are improbable, and differ from the model by a quarter.

    Parameters
    ----------
    curve : DeviationCurve
    model : (t,) array
        Allan variance of the model.
    below : (t,) array
        Of :func:`probability_below`.
    shortest : float [s]
        Below it the model is not meant to hold.
    """
    measured = np.log(curve.deviation**2 / model)
    told = []
    for sign, tail in ((-1.0, below), (1.0, 1.0 - below)):
        outside = (tail < UNLIKELY) & (sign * measured > 2.0 * math.log(WORTH_TELLING)) & (curve.tau >= shortest)
        edge = np.flatnonzero(np.diff(outside.astype(np.int8), prepend=0, append=0))
        for begin, end in edge.reshape(-1, 2):
            if end - begin >= 3:
                worst = begin + int(np.argmax(sign * measured[begin:end]))
                told.append(
                    Disagreement(
                        float(curve.tau[begin]),
                        float(curve.tau[end - 1]),
                        math.exp(-0.5 * float(measured[worst])),
                        float(tail[begin:end].min()),
                    )
                )
    return sorted(told, key=lambda one: one.begin)
