"""Allan, modified Allan, Hadamard and total deviations of rates, increments or phase, with confidence intervals.

Gaps: a record with gaps is a number of stretches. Differences are formed within each stretch only, and their squares
are averaged over all; so no difference spans a gap, nothing is invented, and there is no dead time. A sample that is
not a number is a gap of one sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from navfuse.analysis.allan.confidence import ONE_SIGMA, ORDER, degrees_of_freedom, interval, noise_exponents
from navfuse.analysis.allan.grids import averaging_factors
from navfuse.analysis.allan.kernels import ALLAN, HADAMARD, MODIFIED, TOTAL, integrate, sum_squares
from navfuse.errors import ConfigError, InputError

Array = np.ndarray

KINDS = {
    "adev": "Allan deviation",
    "oadev": "overlapping Allan deviation",
    "mdev": "modified Allan deviation",
    "hdev": "Hadamard deviation",
    "ohdev": "overlapping Hadamard deviation",
    "totdev": "total Allan deviation",
}
"""The estimators and their names."""

_KERNEL = {"adev": ALLAN, "oadev": ALLAN, "mdev": MODIFIED, "hdev": HADAMARD, "ohdev": HADAMARD, "totdev": TOTAL}
_LONGEST = {"adev": 2, "oadev": 2, "mdev": 3, "hdev": 3, "ohdev": 3, "totdev": 1}


@dataclass(frozen=True, slots=True, eq=False)
class DeviationCurve:
    """A deviation over averaging time.

    Attributes
    ----------
    kind : str
        A key of :data:`KINDS`.
    tau : (t,) array [s]
    factor : (t,) int array
        Averaging times in samples.
    deviation : (t,) array
        In the unit of the rate.
    low, high : (t,) arrays
        Limits of the confidence interval; NaN where there are no intervals.
    edf : (t,) array
        Equivalent degrees of freedom.
    alpha : (t,) int array
        Noise type that the edf is for.
    count : (t,) int array
        Differences that were averaged.
    level : float
        Probability of the interval.
    """

    kind: str
    tau: Array
    factor: Array
    deviation: Array
    low: Array
    high: Array
    edf: Array
    alpha: Array
    count: Array
    level: float


def deviation(
    values: Array,
    rate: float,
    kind: str = "oadev",
    *,
    data: Literal["rates", "increments", "phase"] = "rates",
    grid: str | int | Array = "octave",
    gaps: Literal["split", "refuse"] = "split",
    alpha: int | Literal["auto"] = "auto",
    level: float = ONE_SIGMA,
    longest_s: float | None = None,
) -> DeviationCurve:
    """A deviation of one record, with its confidence interval.

    Parameters
    ----------
    values : (n,) array
        Rates, increments over one sampling interval each, or phase (the running sum of increments). NaN marks what is
        missing.
    rate : float [Hz]
        Sampling rate.
    kind : str
        A key of :data:`KINDS`.
    data : {"rates", "increments", "phase"}
        What the values are. The deviation is that of the rate in each case.
    grid : str, int or array
        See :func:`~navfuse.analysis.allan.grids.averaging_factors`; or averaging factors themselves.
    gaps : {"split", "refuse"}
        What to do about NaN: average over the stretches between, or raise.
    alpha : int or "auto"
        Noise type for the degrees of freedom; "auto": found at each averaging time.
    level : float
        Probability of the confidence interval.
    longest_s : float [s], optional
        Longest averaging time; default as long as there are two differences (one for a total deviation: the length of
        the record).

    Returns
    -------
    DeviationCurve

    Raises
    ------
    InputError
        If the values are no vector of numbers, infinite, missing while `gaps` is "refuse", or too few.
    ConfigError
        For an unknown kind, grid, or setting out of range.

    Notes
    -----
    Sources: IEEE Std 952-1997, annex C; NIST SP 1065, section 5.2. With phase of n + 1 points x and m samples in tau::

        oadev^2  = sum (x[i+2m] - 2 x[i+m] + x[i])^2 / (2 tau^2 (n - 2m + 1))
        mdev^2   = sum (sum over m of these)^2 / (2 m^2 tau^2 (n - 3m + 2))
        ohdev^2  = sum (x[i+3m] - 3 x[i+2m] + 3 x[i+m] - x[i])^2 / (6 tau^2 (n - 3m + 1))
        totdev^2 = the first about every inner point, x mirrored in both ends, / (2 tau^2 (n - 1))

    adev and hdev take every m-th of these. Memory: one copy of the record, and vectors of the number of averaging
    times.
    """
    if kind not in KINDS:
        raise ConfigError(f"unknown deviation {kind!r}: known are {', '.join(KINDS)}")
    if not (np.isfinite(rate) and rate > 0.0):
        raise ConfigError(f"rate = {rate} must be a finite number of samples per second, > 0")
    if not 0.0 < level < 1.0:
        raise ConfigError(f"level = {level} must be a probability between 0 and 1")
    phases = phase_stretches(values, rate, data, gaps)
    return curve_of_phases(phases, rate, kind, grid=grid, alpha=alpha, level=level, longest_s=longest_s)


def curve_of_phases(
    phases: list[Array],
    rate: float,
    kind: str,
    *,
    grid: str | int | Array = "octave",
    alpha: int | Literal["auto"] = "auto",
    level: float = ONE_SIGMA,
    longest_s: float | None = None,
) -> DeviationCurve:
    """As :func:`deviation`, from the stretches of phase that :func:`phase_stretches` makes; they may be used again.

    Raises
    ------
    InputError
        If no stretch is long enough.
    ConfigError
        For an unknown grid.
    """
    longest = max(x.size - 1 for x in phases) // _LONGEST[kind]
    if kind in ("adev", "oadev", "hdev", "ohdev", "mdev") and longest_s is None:
        longest = max(1, longest)
    if longest_s is not None:
        longest = min(longest, int(np.floor(longest_s * rate * (1.0 + 1e-12))))
    if longest < 1:
        raise InputError(
            f"the record is too short for a {KINDS[kind]}: {max(x.size - 1 for x in phases)} samples in its longest "
            "stretch"
        )
    factors = (
        averaging_factors(grid, longest) if isinstance(grid, str | int) else np.unique(np.asarray(grid, dtype=np.int64))
    )
    if factors.size == 0 or factors[0] < 1:
        raise ConfigError("averaging factors must be whole numbers of samples, at least 1")
    count, total = np.zeros(factors.size, dtype=np.int64), np.zeros(factors.size)
    for x in phases:
        number, squares = sum_squares(x, _KERNEL[kind], factors, kind not in ("adev", "hdev"))
        count += number
        total += squares
    kept = count > 0
    factors, count, total = factors[kept], count[kept], total[kept]
    if factors.size == 0:
        raise InputError(f"the record is too short for a {KINDS[kind]} at the averaging times asked for")
    tau = factors / rate
    scale = (6.0 if ORDER[kind] == 3 else 2.0) * tau**2 * count * (factors**2.0 if kind == "mdev" else 1.0)
    variance = total / scale
    longest_stretch = max(phases, key=len)
    exponents = (
        noise_exponents(longest_stretch, factors, ORDER[kind]) if alpha == "auto" else np.full(factors.size, int(alpha))
    )
    edf = np.array(
        [sum(_edf(kind, int(a), int(m), x.size - 1) for x in phases) for a, m in zip(exponents, factors, strict=True)]
    )
    low, high = interval(variance, edf, level)
    return DeviationCurve(
        kind, tau, factors, np.sqrt(variance), np.sqrt(low), np.sqrt(high), edf, exponents, count, level
    )


def _edf(kind: str, alpha: int, m: int, n: int) -> float:
    return degrees_of_freedom(kind, alpha, m, n) if n >= _LONGEST[kind] * m else 0.0


def phase_stretches(
    values: Array, rate: float, data: str = "rates", gaps: str = "split", least: int = 2
) -> list[Array]:
    """The phase of every stretch without gaps, its mean rate removed.

    Parameters
    ----------
    values, rate, data, gaps
        As in :func:`deviation`.
    least : int
        Shorter stretches, in samples, are left out.

    Returns
    -------
    list of (k + 1,) arrays
        Unit of the rate times second.

    Raises
    ------
    InputError
        As in :func:`deviation`.
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
    if values.dtype.kind != "f":
        values = values.astype(np.float64)
    bounds = _stretches(values, gaps)
    if data == "phase":
        return [values[a:b].astype(np.float64) for a, b in bounds if b - a > least]
    kept = [(a, b) for a, b in bounds if b - a >= least]
    if not kept:
        raise InputError(f"the record has no stretch of {least} samples without a gap")
    scale = 1.0 / rate if data == "rates" else 1.0
    mean = sum(float(np.sum(values[a:b], dtype=np.float64)) for a, b in kept) / sum(b - a for a, b in kept)
    phases = []
    for a, b in kept:
        x = np.empty(b - a + 1)
        integrate(values[a:b], mean, scale, x)
        phases.append(x)
    return phases


def _stretches(values: Array, gaps: str) -> list[tuple[int, int]]:
    """Beginnings and ends of the stretches without NaN."""
    good = np.isfinite(values)
    if good.all():
        return [(0, values.size)]
    if np.isinf(values).any():
        raise InputError(
            f"the record has an infinite value, the first in sample {int(np.argmax(np.isinf(values))) + 1}"
        )
    if gaps == "refuse":
        raise InputError(
            f"the record has {int(np.count_nonzero(~good))} missing samples (NaN), the first is sample "
            f'{int(np.argmin(good)) + 1}; gaps = "split" averages over the stretches between them'
        )
    edge = np.diff(good.astype(np.int8), prepend=0, append=0)
    return list(zip(np.flatnonzero(edge == 1).tolist(), np.flatnonzero(edge == -1).tolist(), strict=True))
