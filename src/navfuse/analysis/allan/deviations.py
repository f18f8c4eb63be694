"""Allan, modified Allan, Hadamard and total deviations of rates, increments or phase, with confidence intervals.

Gaps: a record with gaps is a number of stretches. Differences are formed within each stretch only, and their squares
are averaged over all; so no difference spans a gap, nothing is invented, and there is no dead time. A sample that is
not a number is a gap of one sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from navfuse.analysis.allan.confidence import ONE_SIGMA, ORDER, degrees_of_freedom, interval, pooled, total_bias
from navfuse.analysis.allan.few import FEWEST, quantiles, weights
from navfuse.analysis.allan.grids import averaging_factors
from navfuse.analysis.allan.kernels import ALLAN, HADAMARD, MODIFIED, TOTAL, difference_counts, sum_squares
from navfuse.analysis.allan.noise_types import LEAST_ALPHA, NoiseTypes, noise_exponents
from navfuse.analysis.allan.phase import Phases, phase_stretches
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
        Limits of the confidence interval of the true deviation.
    edf : (t,) array
        Equivalent degrees of freedom.
    alpha : (t,) int array
        Noise type that the edf is for.
    count : (t,) int array
        Differences that were averaged.
    level : float
        Probability of the interval.
    bias : (t,) array
        What the squared deviation is expected to be, over the true one: 1 but for total deviations, which are low at
        long averaging times. `deviation` is as defined, without a correction; `low` and `high` are for the true one.
    size, times : (s,) int arrays
        Samples of the stretches without gaps, each size once, and how many stretches have it.
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
    bias: Array
    size: Array
    times: Array

    def degrees_of_freedom(self, alpha: Array) -> Array:
        """Equivalent degrees of freedom of the stretches together, for other noise types (t,) than those found."""
        found = np.empty(self.factor.size)
        for k, (m, a) in enumerate(zip(self.factor.tolist(), alpha.tolist(), strict=True)):
            factors = self.factor[k : k + 1]
            count = difference_counts(_KERNEL[self.kind], self.size, factors, self.kind not in ("adev", "hdev"))[0]
            used = count > 0
            edf = degrees_of_freedom(self.kind, a, m, self.size[used])
            found[k] = pooled(edf, count[used], self.times[used])
        return found


def deviation(
    values: Array,
    rate: float,
    kind: str = "oadev",
    *,
    data: Literal["rates", "increments", "phase"] = "rates",
    grid: str | int | Array = "octave",
    gaps: Literal["split", "refuse"] = "split",
    alpha: int | NoiseTypes | Literal["auto"] = "auto",
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
    alpha : int, callable or "auto"
        Noise type for the degrees of freedom: one for all, or a function of averaging times [s], or found at each of
        them, which is done too where the function gives NaN. Best is what a fit to the record says
        (:func:`~navfuse.analysis.allan.noise_types.types_of_model`), since the longest averaging times do not show it.
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
    phases: Phases,
    rate: float,
    kind: str,
    *,
    grid: str | int | Array = "octave",
    alpha: int | NoiseTypes | Literal["auto"] = "auto",
    level: float = ONE_SIGMA,
    longest_s: float | None = None,
) -> DeviationCurve:
    """As :func:`deviation`, from stretches of phase, which may be used again.

    Raises
    ------
    InputError
        If no stretch is long enough.
    ConfigError
        For an unknown grid, or an `alpha` that is none.
    """
    longest = int(phases.size.max()) // _LONGEST[kind]
    if kind in ("adev", "oadev", "hdev", "ohdev", "mdev") and longest_s is None:
        longest = max(1, longest)
    if longest_s is not None:
        longest = min(longest, int(np.floor(longest_s * rate * (1.0 + 1e-12))))
    if longest < 1:
        raise InputError(
            f"the record is too short for a {KINDS[kind]}: {phases.size.max()} samples in its longest stretch"
        )
    factors = (
        averaging_factors(grid, longest) if isinstance(grid, str | int) else np.unique(np.asarray(grid, dtype=np.int64))
    )
    if factors.size == 0 or factors[0] < 1:
        raise ConfigError("averaging factors must be whole numbers of samples, at least 1")
    overlapping = kind not in ("adev", "hdev")
    size, times = np.unique(phases.size, return_counts=True)
    factors = factors[difference_counts(_KERNEL[kind], size[-1:], factors, overlapping)[:, 0] > 0]
    if factors.size == 0:
        raise InputError(f"the record is too short for a {KINDS[kind]} at the averaging times asked for")
    total = sum_squares(phases.points, phases.begin, phases.size, _KERNEL[kind], factors, overlapping)

    def counts(k: int) -> Array:  # of all averaging times at once they might take more memory than the record
        return difference_counts(_KERNEL[kind], size, factors[k : k + 1], overlapping)[0]

    count = np.array([counts(k) @ times for k in range(factors.size)])
    tau = factors / rate
    scale = (6.0 if ORDER[kind] == 3 else 2.0) * tau**2 * count * (factors**2.0 if kind == "mdev" else 1.0)
    variance = total / scale
    exponents = _exponents(alpha, phases, factors, tau, kind, variance)
    edf, bias = np.empty(factors.size), np.ones(factors.size)
    low, high = np.empty(factors.size), np.empty(factors.size)
    for k, (m, a) in enumerate(zip(factors.tolist(), exponents.tolist(), strict=True)):
        edf[k], bias[k], low[k], high[k] = _spread(kind, a, m, size, times, counts(k), level)
    return DeviationCurve(
        kind, tau, factors, np.sqrt(variance), np.sqrt(variance / bias * low), np.sqrt(variance / bias * high),
        edf, exponents, count, level, bias, size, times,
    )  # fmt: skip


def _exponents(
    alpha: int | NoiseTypes | Literal["auto"], phases: Phases, factors: Array, tau: Array, kind: str, variance: Array
) -> Array:
    if isinstance(alpha, int | np.integer):
        given = np.full(factors.size, float(alpha))
    elif callable(alpha):
        given = np.asarray(alpha(tau), dtype=float)
    elif alpha == "auto":
        given = np.full(factors.size, np.nan)
    else:
        raise ConfigError(f'alpha = {alpha!r} must be a whole number, "auto", or a function of averaging times')
    known = np.isfinite(given)
    if not known.all():
        given = np.where(known, given, noise_exponents(phases.longest(), factors, kind, variance))
    return np.clip(np.rint(given), LEAST_ALPHA[ORDER[kind]], 2).astype(np.int64)


def _spread(
    kind: str, alpha: int, m: int, size: Array, times: Array, count: Array, level: float
) -> tuple[float, float, float, float]:
    """Degrees of freedom, bias, and limits in units of the estimate without bias, of `times` stretches of each size."""
    used = count > 0
    size, times, count = size[used], times[used], count[used]
    share = count / (count @ times)
    bias = float((share * times) @ total_bias(alpha, m, size)) if kind == "totdev" else 1.0
    edf = pooled(degrees_of_freedom(kind, alpha, m, size), count, times)
    if edf >= FEWEST or (alpha > 0 and kind in ("oadev", "ohdev")):  # of those the edf go with the samples in tau
        low, high = interval(np.ones(1), np.array([edf]), level)
        return edf, bias, float(low[0]), float(high[0])
    parts = np.concatenate([np.tile(share[k] * weights(kind, alpha, m, int(n)), times[k]) for k, n in enumerate(size)])
    few, many = quantiles(parts, np.array([0.5 - level / 2.0, 0.5 + level / 2.0]))
    return 1.0 / float(parts @ parts), bias, 1.0 / float(many), 1.0 / float(few)
