"""Two other views of the same record: power spectral density and autocorrelation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray

PER_DECADE = 40


@dataclass(frozen=True, slots=True, eq=False)
class PowerSpectrum:
    """One-sided power spectral density of a rate, as data sheets print it.

    Attributes
    ----------
    frequency : (f,) array [Hz]
    density : (f,) array
        Unit of the rate squared per hertz, one-sided: white noise of coefficient N stands at ``2 N^2``.
    low, high : (f,) arrays
        68.3 % interval.
    """

    frequency: Array
    density: Array
    low: Array
    high: Array


def power_spectrum(values: Array, rate: float, segments: int = 8) -> PowerSpectrum:
    """Welch's estimate with a Hann window, averaged further in 40 bins per decade.

    Parameters
    ----------
    values : (n,) array
        Rates without gaps.
    rate : float [Hz]
    segments : int
        Parts that the record is cut into, half overlapping.
    """
    from scipy.fft import prev_fast_len, rfft

    from navfuse.analysis.allan.confidence import ONE_SIGMA, interval

    length = int(prev_fast_len(max(8, 2 * values.size // (segments + 1)), real=True) or 8)
    window = np.hanning(length + 1)[:-1]
    where = np.linspace(-1.0, 1.0, length)
    total, averaged = np.zeros(length // 2 + 1), 0
    for begin in range(0, values.size - length + 1, length - length // 2):
        part = values[begin : begin + length] - np.mean(values[begin : begin + length])
        part -= float(where @ part) / float(where @ where) * where
        part *= window
        power = np.abs(np.asarray(rfft(part, overwrite_x=True)))
        total += np.square(power, out=power)
        averaged += 1
    total *= 2.0 / (averaged * rate * float(window @ window))
    if length % 2 == 0:
        total[-1] *= 0.5
    frequency, density = np.fft.rfftfreq(length, 1.0 / rate)[1:], total[1:]
    bins = np.floor(PER_DECADE * np.log10(frequency / frequency[0])).astype(np.int64)
    edge = np.flatnonzero(np.diff(bins, prepend=-1))
    number = np.diff(np.append(edge, frequency.size))
    density = np.add.reduceat(density, edge) / number
    frequency = np.add.reduceat(frequency, edge) / number
    averages = averaged * 36.0 / 51.0 * 2.0
    dof = averages * np.maximum(1.0, number / 1.5)
    low, high = interval(density, dof, ONE_SIGMA)
    return PowerSpectrum(frequency, density, low, high)


@dataclass(frozen=True, slots=True, eq=False)
class Autocorrelation:
    """Autocorrelation of a rate, averaged over windows first so that slow parts show beside white noise.

    Attributes
    ----------
    lag : (l,) array [s]
    correlation : (l,) array
        1 at lag 0.
    variance : float
        Of the averages, unit of the rate squared.
    average : float [s]
        Length of the windows.
    bound : float
        Within which 95 % of the correlations of white noise lie.
    """

    lag: Array
    correlation: Array
    variance: float
    average: float
    bound: float


def autocorrelation(values: Array, rate: float, average: float = 0.0, points: int = 400) -> Autocorrelation:
    """Autocorrelation by the fast Fourier transform, biased estimate, mean removed.

    Parameters
    ----------
    values : (n,) array
        Rates without gaps.
    rate : float [Hz]
    average : float [s]
        Windows that are averaged first; 0 for none.
    points : int
        Most lags that are returned, from 0 to half the record.
    """
    from scipy.signal import correlate

    width = max(1, round(average * rate))
    count = values.size // width
    mean = values[: count * width].reshape(count, width).mean(axis=1)
    mean -= mean.mean()
    full = correlate(mean, mean, mode="full", method="fft")[count - 1 : count - 1 + max(2, count // 2)]
    variance = float(full[0] / count)
    pick = np.unique(np.rint(np.linspace(0, full.size - 1, points)).astype(np.int64))
    correlation = full[pick] / full[0] if full[0] > 0.0 else np.zeros(pick.size)
    return Autocorrelation(pick * width / rate, correlation, variance, width / rate, 1.96 / float(np.sqrt(count)))
