"""What the page and the figures show beside the solution itself: residuals, gates, realised sigmas, CDF.

Pure functions of a result; nothing here draws. The windows are counted in measurements, not in seconds, so that the
chi-square bounds that belong to them depend on the window alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from navfuse.analysis.consistency import PROBABILITY, average_bounds
from navfuse.analysis.metrics import ErrorSeries
from navfuse.data.result import Innovations, Result
from navfuse.filters.gate import Gate
from navfuse.filters.settings import FilterSettings

Array = np.ndarray

WINDOW = 50
"""Measurements in a window: the bounds of a mean NIS of three components are then 0.73 and 1.32 at 99 %."""
FEWEST = 5
"""Measurements below which no scatter is told."""
REACH = 5.0
BINS = 40
TAKEN = ("used", "reset")
STATED = {"gnss_position": "sd_position", "gnss_velocity": "sd_velocity"}


class Histogram(NamedTuple):
    """Normalised residuals in equal bins, beside the standard normal distribution.

    Attributes
    ----------
    edges : (b + 1,) array [1]
        From -5 to 5.
    density : (b,) array [1]
        Share of all residuals in each bin over its width; what lies outside the edges is in no bin.
    expected : (b,) array [1]
        The same of the standard normal distribution.
    n : int
    mean, sd : float [1]
        Of all residuals; 0 and 1 when the model is right.
    beyond_3 : float [1]
        Share outside +-3; 0.0027 when the model is right.
    outside : int
        How many lie outside the edges.
    """

    edges: Array
    density: Array
    expected: Array
    n: int
    mean: float
    sd: float
    beyond_3: float
    outside: int


class RunningNis(NamedTuple):
    """Mean NIS per component over a window that moves by one measurement.

    Attributes
    ----------
    time : (m,) array [s]
        Mean time of the measurements in the window.
    mean, low, high : (m,) arrays [1]
        The mean, and the bounds that hold it with the probability asked for, were the model right and the innovations
        white.
    window : int
        Measurements in a window.
    """

    time: Array
    mean: Array
    low: Array
    high: Array
    window: int

    @property
    def inside(self) -> float:
        """Share of the windows inside their bounds; NaN without any."""
        return float(np.mean((self.mean >= self.low) & (self.mean <= self.high))) if self.time.size else float("nan")


class RealisedSigma(NamedTuple):
    """Standard deviations of a sensor as stated and as its innovations show them, in consecutive windows.

    Attributes
    ----------
    time : (m,) array [s]
        Mean time of each window.
    stated : (m, d) array
        Root mean square of what was claimed, unit of the measurement.
    realised : (m, d) array
        What the innovations show; 0 where the uncertainty of the prediction alone explains them.
    low, high : (m, d) arrays
        Interval of `realised` with the probability asked for, were the innovations white and normal.
    window : int
        Measurements in a window, the last ones may hold one less.
    """

    time: Array
    stated: Array
    realised: Array
    low: Array
    high: Array
    window: int


class Percentiles(NamedTuple):
    """Radii [m] that hold half, and 95 %, of the position errors.

    Attributes
    ----------
    cep50, cep95 : float [m]
        Horizontal: circular error probable and its 95 % twin, about the truth.
    le50, le95 : float [m]
        Vertical, of the magnitude.
    n : int
        Epochs.
    """

    cep50: float
    cep95: float
    le50: float
    le95: float
    n: int


def normalised(innovations: Innovations) -> Array:
    """Innovations over their standard deviations (m, 3); NaN where there is no component."""
    sd = np.where(innovations.sd > 0.0, innovations.sd, np.nan)
    return innovations.z / sd


def residual_histogram(ratios: Array) -> Histogram:
    """Histogram of normalised residuals of any shape; what is not finite is left out."""
    from scipy.special import ndtr

    values = np.asarray(ratios, dtype=float).ravel()
    values = values[np.isfinite(values)]
    edges = np.linspace(-REACH, REACH, BINS + 1)
    width = edges[1] - edges[0]
    counts, _ = np.histogram(values, edges)
    n = values.size
    nan = float("nan")
    return Histogram(
        edges=edges,
        density=counts / (max(n, 1) * width),
        expected=np.diff(ndtr(edges)) / width,
        n=n,
        mean=float(values.mean()) if n else nan,
        sd=float(values.std()) if n else nan,
        beyond_3=float(np.mean(np.abs(values) > 3.0)) if n else nan,
        outside=n - int(counts.sum()),
    )


def gate_limits(innovations: Innovations, probability: float | None = None) -> Array:
    """Largest NIS that the gate let pass at each measurement of one source, replayed from the record.

    The gate widens with the scatter it has seen (:class:`navfuse.filters.gate.Gate`), so it differs from measurement
    to measurement.

    Parameters
    ----------
    innovations : Innovations
        Of one source, in the order they were handled.
    probability : float, optional
        Of the gate; default that of the filter.

    Returns
    -------
    (m,) array [1]
        NaN where no innovation was formed; infinite for an open gate. One component alone is at the gate at
        sqrt(limit) of its standard deviations.
    """
    gate = Gate(probability, FilterSettings())
    limits = np.full(len(innovations), np.nan)
    rows = zip(
        innovations.dof.tolist(),
        innovations.nis.tolist(),
        innovations.time.tolist(),
        (innovations.status == "withheld").tolist(),
        strict=True,
    )
    for k, (dof, nis, time, withheld) in enumerate(rows):
        if dof > 0 and np.isfinite(nis):
            limits[k] = gate.limit(dof)
            if not withheld:
                gate.watch(nis / dof, time)
    return limits


def running_nis(innovations: Innovations, window: int = WINDOW, probability: float = PROBABILITY) -> RunningNis:
    """Running mean of the NIS per component of one source, of the measurements that were used.

    Parameters
    ----------
    innovations : Innovations
        Of one source.
    window : int
        Measurements; all of them where there are fewer.
    probability : float
        Of the bounds.
    """
    used = _taken(innovations)
    n = len(used)
    width = min(window, n)
    if n == 0:
        nothing = np.empty(0)
        return RunningNis(nothing, nothing, nothing, nothing, window)

    def moving(values: Array) -> Array:
        total = np.concatenate(([0.0], np.cumsum(values, dtype=float)))
        return total[width:] - total[:-width]

    start = float(used.time[0])
    degrees, which = np.unique(np.rint(moving(used.dof)), return_inverse=True)
    low, high = np.array([average_bounds(float(d), probability) for d in degrees]).T[:, which]
    return RunningNis(
        time=start + moving(used.time - start) / width,
        mean=np.maximum(moving(used.nis), 0.0) / degrees[which],
        low=low,
        high=high,
        window=width,
    )


def realised_sigma(
    innovations: Innovations, stated: Array, window: int = WINDOW, probability: float = PROBABILITY
) -> RealisedSigma:
    """Standard deviations of a sensor as its innovations show them, beside those it states.

    An innovation has the covariance S = H P H' + R, so that R = E[z z'] - H P H' (R. K. Mehra, *IEEE Trans. Autom.
    Control* 15 (1970), 175-184; here its diagonal, with the mean over a window for the expectation and S less the
    stated R for H P H'). It presumes that the filter's own P is right: what the filter does not know of itself counts
    for the sensor.

    Parameters
    ----------
    innovations : Innovations
        Of one source; only the used ones count.
    stated : (m, 3) array
        Standard deviations the sensor states for each of them, unit of the measurement.
    window : int
        Measurements in a window; with fewer than two windows' worth there is one window.
    probability : float
        Of the interval.
    """
    from scipy.special import chdtri

    size = min(int(innovations.dof.max(initial=0)), innovations.z.shape[1])
    formed = np.isfinite(innovations.z[:, :size]).all(axis=1) & np.isfinite(innovations.sd[:, :size]).all(axis=1)
    chosen = _taken_rows(innovations) & formed & np.isfinite(stated).all(axis=1)
    used, stated = innovations.select(chosen), stated[chosen]
    n = len(used)
    if n < FEWEST:
        block = np.empty((0, stated.shape[1]))
        return RealisedSigma(np.empty(0), block, block, block, block, window)
    edges = np.linspace(0, n, max(n // window, 1) + 1).astype(np.int64)
    counts = np.diff(edges)[:, np.newaxis].astype(float)

    def mean(values: Array) -> Array:
        return np.add.reduceat(values, edges[:-1], axis=0) / (counts if values.ndim == 2 else counts[:, 0])

    power, claimed = mean(used.z**2), mean(stated**2)
    prediction = mean(used.sd**2) - claimed
    tail = 0.5 * (1.0 - probability)
    low, high = counts / chdtri(counts, tail), counts / chdtri(counts, 1.0 - tail)

    def sigma(factor: Array | float) -> Array:
        return np.sqrt(np.maximum(power * factor - prediction, 0.0))

    start = float(used.time[0])
    time = start + mean(used.time - start)
    return RealisedSigma(time, np.sqrt(claimed), sigma(1.0), sigma(low), sigma(high), int(counts.max()))


def gnss_sigmas(result: Result, source: str, window: int = WINDOW) -> RealisedSigma | None:
    """:func:`realised_sigma` of ``gnss_position`` or ``gnss_velocity``; None where the fixes state no such sigma."""
    records = result.innovations.of(source)
    stated = None if result.fixes is None else getattr(result.fixes, STATED[source])
    if stated is None or not len(records) or records.row.min() < 0 or records.row.max() >= stated.shape[0]:
        return None
    return realised_sigma(records, stated[records.row], window)


def error_cdf(values: Array) -> tuple[Array, Array]:
    """Magnitudes (n,) of errors in increasing order, and the share (n,) of errors that are not larger than each."""
    magnitude = np.abs(values[np.isfinite(values)])
    magnitude.sort()
    return magnitude, np.arange(1, magnitude.size + 1) / max(magnitude.size, 1)


def position_percentiles(series: ErrorSeries) -> Percentiles:
    """CEP and vertical percentiles of the position errors; NaN without any."""
    finite = series.position[np.isfinite(series.position).all(axis=1)]
    if not finite.size:
        nan = float("nan")
        return Percentiles(nan, nan, nan, nan, 0)
    cep50, cep95 = np.percentile(np.hypot(finite[:, 0], finite[:, 1]), (50.0, 95.0))
    le50, le95 = np.percentile(np.abs(finite[:, 2]), (50.0, 95.0))
    return Percentiles(float(cep50), float(cep95), float(le50), float(le95), finite.shape[0])


def _taken_rows(innovations: Innovations) -> Array:
    return np.isin(innovations.status, TAKEN) & (innovations.dof > 0) & np.isfinite(innovations.nis)


def _taken(innovations: Innovations) -> Innovations:
    return innovations.select(_taken_rows(innovations))
