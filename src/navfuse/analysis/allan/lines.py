"""Sinusoids in a record: vibration, mains, dither. Found above the noise around them, fitted and taken out."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from navfuse.analysis.allan.terms import Term

Array = np.ndarray

MOST = 5
FALSE_ALARM = 1e-3
"""Probability that white noise alone shows a line anywhere."""


def take_lines_out(values: Array, rate: float, most: int = MOST) -> tuple[Array, list[Term]]:
    """Remove the sinusoids that stand out of the noise.

    Parameters
    ----------
    values : (n,) array
        Rates without gaps.
    rate : float [Hz]
    most : int
        Lines to take out at most.

    Returns
    -------
    rest : (n,) array
    lines : list of Term
        Amplitude and frequency [Hz] of each, with standard deviations, the strongest first.

    Notes
    -----
    A line is a bin of the Hann periodogram that exceeds the median around it by more than white noise does once in a
    thousand records. Its frequency is refined by least squares. Standard deviations in noise of two-sided density S:
    amplitude ``sqrt(2 S / T)``, frequency ``sqrt(6 S / T) / (pi A T)`` (Rife and Boorstyn 1974, the bounds).
    """
    from scipy.fft import next_fast_len

    rest = np.asarray(values, dtype=np.float64) - np.mean(values)
    n = rest.size
    window = np.hanning(n)
    size = int(next_fast_len(n, real=True) or n)
    found: list[Term] = []
    for _ in range(most):
        power = np.abs(np.fft.rfft(rest * window, size)) ** 2 / (rate * float(window @ window))
        around = _background(power)
        ratio = power / around
        least = max(8, size // n * 8)
        ratio[:least] = 0.0
        peak = int(np.argmax(ratio))
        if ratio[peak] < math.log(power.size / FALSE_ALARM):
            break
        frequency = _refine(rest, rate, peak * rate / size, rate / n)
        amplitude, wave = _fit(rest, rate, frequency)
        density, span = float(around[peak]), n / rate
        amplitude_sigma = math.sqrt(2.0 * density / span)
        frequency_sigma = math.sqrt(6.0 * density / span) / (math.pi * amplitude * span)
        rest = rest - wave
        gain = 2.0 * float(ratio[peak])
        found.append(
            Term("sin", True, amplitude, amplitude_sigma, extra=frequency, extra_sigma=frequency_sigma, gain=gain)
        )
    return rest, sorted(found, key=lambda term: -term.value)


def _background(power: Array) -> Array:
    """Mean level of exponential noise around each bin, from medians of blocks that grow with frequency."""
    edges = np.unique(
        np.concatenate([np.arange(0, 64, 16), np.rint(np.geomspace(64, power.size, 120))]).astype(np.int64)
    )
    level = np.empty(power.size)
    for a, b in itertools.pairwise(edges):
        level[a:b] = np.median(power[a:b]) / math.log(2.0)
    return np.maximum(level, 1e-300)


def _fit(values: Array, rate: float, frequency: float) -> tuple[float, Array]:
    """Amplitude and samples of the sinusoid of a frequency that fits best."""
    phase = 2.0 * math.pi * frequency / rate * np.arange(values.size)
    columns = np.column_stack([np.cos(phase), np.sin(phase)])
    part = np.linalg.solve(columns.T @ columns, columns.T @ values)
    return float(np.hypot(*part)), columns @ part


def _refine(values: Array, rate: float, frequency: float, width: float) -> float:
    """Frequency at which the fitted sinusoid is largest, within a bin of the peak."""
    from scipy.optimize import minimize_scalar

    found: Any = minimize_scalar(
        lambda f: -_fit(values, rate, f)[0],
        bounds=(frequency - width, frequency + width),
        method="bounded",
        options={"xatol": 1e-4 * width},
    )
    return float(found.x)
