"""The phase of a record, the running sum of its samples, cut where samples are missing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from navfuse.analysis.allan.gaps import run_bounds
from navfuse.analysis.allan.kernels import integrate, mean_of_stretches
from navfuse.errors import ConfigError, InputError

Array = np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Phases:
    """Phase of the stretches without gaps, one behind the other.

    Attributes
    ----------
    points : (k,) array
        Unit of the rate times second.
    begin, size : (s,) int arrays
        Of each stretch: its first point, and its samples, which are one fewer than its points.
    """

    points: Array
    begin: Array
    size: Array

    def __iter__(self) -> Iterator[Array]:
        """The phase of one stretch after the other, as views."""
        for begin, size in zip(self.begin.tolist(), self.size.tolist(), strict=True):
            yield self.points[begin : begin + size + 1]

    def longest(self) -> Array:
        """The phase of the longest stretch."""
        k = int(np.argmax(self.size))
        return self.points[self.begin[k] : self.begin[k] + self.size[k] + 1]


def phase_stretches(values: Array, rate: float, data: str = "rates", gaps: str = "split", least: int = 2) -> Phases:
    """The phase of every stretch without gaps, the mean rate of them all removed.

    Parameters
    ----------
    values, rate, data, gaps
        As in :func:`~navfuse.analysis.allan.deviations.deviation`.
    least : int
        Shorter stretches, in samples, are left out.

    Returns
    -------
    Phases

    Raises
    ------
    InputError
        If the values are no vector of numbers, infinite, missing while `gaps` is "refuse", or too few.
    ConfigError
        If `data` or `gaps` is not one of its words.
    """
    if data not in ("rates", "increments", "phase"):
        raise ConfigError(f'data = {data!r} must be "rates", "increments" or "phase"')
    if gaps not in ("split", "refuse"):
        raise ConfigError(f'gaps = {gaps!r} must be "split" or "refuse"')
    values = np.asarray(values)
    if values.ndim != 1 or values.dtype.kind not in "fiu":
        raise InputError(f"a record must be a vector of numbers, not {values.dtype} of shape {values.shape}")
    if values.dtype not in (np.float64, np.float32):
        values = values.astype(np.float64)
    begin, end = _stretches(values, gaps)
    size = end - begin - (1 if data == "phase" else 0)
    begin, size = begin[size >= least], size[size >= least]
    if size.size == 0:
        raise InputError(f"the record has no stretch of {least} samples without a gap")
    if data == "phase":
        # Where points are missing they stay between the stretches, which saves moving the rest.
        return Phases(values.astype(np.float64), begin, size)
    points = np.empty(int(size.sum()) + size.size)
    mean = mean_of_stretches(values, begin, size)
    integrate(values, begin, size, mean, 1.0 / rate if data == "rates" else 1.0, points)
    return Phases(points, np.concatenate([[0], np.cumsum(size + 1)[:-1]]), size)


def _stretches(values: Array, gaps: str) -> tuple[Array, Array]:
    """Beginnings and ends of the stretches without NaN."""
    good = np.isfinite(values)
    if good.all():
        return np.array([0]), np.array([values.size])
    infinite = np.isinf(values)
    if infinite.any():
        raise InputError(f"the record has an infinite value, the first in sample {int(np.argmax(infinite)) + 1}")
    if gaps == "refuse":
        raise InputError(
            f"the record has {int(np.count_nonzero(~good))} missing samples (NaN), the first is sample "
            f'{int(np.argmin(good)) + 1}; gaps = "split" averages over the stretches between them'
        )
    bounds = run_bounds(good)
    return np.ascontiguousarray(bounds[:, 0]), np.ascontiguousarray(bounds[:, 1])
