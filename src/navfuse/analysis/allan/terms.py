"""Noise terms of an inertial sensor: their Allan variance, their spectral density, their names and units.

Coefficients are those of IEEE Std 952-1997, annex C, in SI units of the rate (rad/s or m/s^2, written ``u``)::

    term  name                        unit      Allan variance          two-sided density of the rate
    Q     quantisation                u s       3 Q^2 / tau^2           4 Q^2 sin^2(pi f dt) / dt
    N     angle/velocity random walk  u sqrt(s) N^2 / tau               N^2
    B     bias instability            u         (2 ln 2 / pi) B^2       B^2 / (2 pi |f|)
    K     rate random walk            u/sqrt(s) K^2 tau / 3             K^2 / (2 pi f)^2
    R     rate ramp                   u/s       R^2 tau^2 / 2           (not random)
    GM    Gauss-Markov sigma, T       u, s      s. gauss_markov_allan   2 sigma^2 T / (1 + (2 pi f T)^2)
    sin   sinusoid amplitude, f       u, Hz     A^2 (sin^2 x / x)^2     lines at +-f;   x = pi f tau

**Two conventions for B.** The coefficient B is that of the density. The Allan deviation of this noise is flat at
0.664 B, the *floor*, and that is what most makers print as "bias instability". Both are given everywhere.

Flicker noise has a beginning and an end, or its variance would be infinite. It is taken here, as the simulator of this
package makes it, for a sum of Gauss-Markov processes, one per decade of correlation time from 0.1 s to 10 000 s
(further for longer records): flat within 2 % between, white-noise like above 1.6 Hz.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from navfuse.core.constants import ALLAN_FLOOR

Array = np.ndarray

FLOOR = ALLAN_FLOOR
"""Allan deviation of flicker noise over its coefficient B: 0.664."""

RANDOM_TERMS = ("Q", "N", "B", "K")
TERMS = ("Q", "N", "B", "K", "R", "GM", "sin")

NAMES = {
    "gyro": {
        "Q": "quantisation",
        "N": "angle random walk",
        "B": "bias instability",
        "K": "rate random walk",
        "R": "rate ramp",
        "GM": "Gauss-Markov process",
        "sin": "sinusoid",
    },
    "accel": {
        "Q": "quantisation",
        "N": "velocity random walk",
        "B": "bias instability",
        "K": "acceleration random walk",
        "R": "acceleration ramp",
        "GM": "Gauss-Markov process",
        "sin": "sinusoid",
    },
}


@dataclass(frozen=True, slots=True)
class Term:
    """One noise term of one axis, in SI units.

    Attributes
    ----------
    name : str
        One of :data:`TERMS`.
    present : bool
    value, sigma : float
        Coefficient and its standard deviation; NaN if absent. Of a Gauss-Markov process its standard deviation.
    limit : float
        If absent: what the coefficient stays below. NaN if present.
    limit_level : float
        With which one-sided confidence: 0.95 where the likelihood says so, 0.999 where the measured Allan deviation
        does. NaN where there is no limit.
    extra, extra_sigma : float
        Correlation time [s] of a Gauss-Markov process, frequency [Hz] of a sinusoid; NaN otherwise.
    least_span : float [s]
        Length of record at which one sigma is a quarter of the value: shorter records do not give this term.
    gain : float
        What the term adds to twice the log-likelihood; for a ramp the square of value over sigma.
    contradicted : bool
        The spectrum would have had the term, but the measured Allan deviation falls below it, so that it is absent: the
        record holds something that no term describes. `limit` is then what the deviation allows.
    """

    name: str
    present: bool
    value: float = math.nan
    sigma: float = math.nan
    limit: float = math.nan
    limit_level: float = math.nan
    extra: float = math.nan
    extra_sigma: float = math.nan
    least_span: float = math.nan
    gain: float = math.nan
    contradicted: bool = False


@dataclass(frozen=True, slots=True)
class Flicker:
    """Correlation times that stand for flicker noise.

    Attributes
    ----------
    tau : (m,) array [s]
    variance : float
        Of each process, for B = 1.
    """

    tau: Array
    variance: float


def flicker(span: float, shortest: float = 0.1, longest: float = 1e4) -> Flicker:
    """Processes that stand for flicker noise in a record.

    Parameters
    ----------
    span : float [s]
        Length of the record; `longest` is raised by whole decades until it is a quarter of that.
    shortest, longest : float [s]
        Correlation times, at least a decade apart.

    Notes
    -----
    The variance of each, ``ln(ratio) / pi`` for neighbours in that ratio, makes the sum of their densities
    ``B^2 / (2 pi f)`` on average over the logarithm of frequency; the ripple is 5.5 % of the density.
    """
    while longest < 0.25 * span:
        longest *= 10.0
    count = max(1, round(math.log10(longest / shortest)))
    ratio = (longest / shortest) ** (1.0 / count)
    return Flicker(shortest * ratio ** np.arange(count + 1), math.log(ratio) / math.pi)


def gauss_markov_allan(tau: Array, correlation: float) -> Array:
    """Allan variance of a first-order Gauss-Markov process of unit variance.

    Parameters
    ----------
    tau : array [s]
    correlation : float [s]

    Notes
    -----
    ``(2x - 3 + 4 exp(-x) - exp(-2x)) / x^2`` with x = tau / correlation (IEEE Std 952-1997, eq. C.18 in another
    form); below x = 0.01 a series is used, since the differences cancel.
    """
    x = np.asarray(tau, dtype=float) / correlation
    small = x < 1e-2
    safe = np.where(small, 1.0, x)
    full = (2.0 * safe - 3.0 + 4.0 * np.exp(-safe) - np.exp(-2.0 * safe)) / safe**2
    series = x * (2.0 / 3.0 - x * (0.5 - x * (7.0 / 30.0 - x / 12.0)))
    return np.where(small, series, full)


def allan_variance(term: str, tau: Array, values: dict[str, float], flicker_noise: Flicker | None = None) -> Array:
    """Allan variance of one term.

    Parameters
    ----------
    term : str
        One of :data:`TERMS`.
    tau : array [s]
    values : dict
        Coefficients in SI units: the term's own name, for GM also "GM_tau", for sin "sin" and "sin_hz".
    flicker_noise : Flicker, optional
        For B: the sum of processes instead of the flat floor.
    """
    tau = np.asarray(tau, dtype=float)
    size = values[term] ** 2
    if term == "Q":
        return 3.0 * size / tau**2
    if term == "N":
        return size / tau
    if term == "B":
        if flicker_noise is None:
            return np.full_like(tau, FLOOR**2 * size)
        return size * flicker_noise.variance * np.sum([gauss_markov_allan(tau, c) for c in flicker_noise.tau], axis=0)
    if term == "K":
        return size * tau / 3.0
    if term == "R":
        return size * tau**2 / 2.0
    if term == "GM":
        return size * gauss_markov_allan(tau, values["GM_tau"])
    x = math.pi * values["sin_hz"] * tau
    return size * (np.sin(x) ** 2 / x) ** 2


def random_density(term: str, frequency: Array, dt: float, span: float, flicker_noise: Flicker) -> Array:
    """Expected density of a sampled rate for a unit coefficient, at the frequencies of a cosine transform.

    Parameters
    ----------
    term : {"Q", "N", "B", "K"}
    frequency : (k,) array [Hz], > 0
        Multiples of ``1 / (2 span)``.
    dt, span : float [s]
        Sampling interval and length of the record.
    flicker_noise : Flicker

    Returns
    -------
    (k,) array
        Two-sided, unit of the coefficient squared per unit of the rate squared per hertz.
    """
    wave = 2.0 * np.sin(math.pi * frequency * dt) / dt
    if term == "Q":
        return wave**2 * dt
    if term == "N":
        return np.ones_like(frequency)
    if term == "K":
        return 1.0 / wave**2
    parts = [gauss_markov_density(frequency, dt, span, c) for c in flicker_noise.tau]
    return flicker_noise.variance * np.sum(parts, axis=0)


def gauss_markov_density(frequency: Array, dt: float, span: float, correlation: float) -> Array:
    """Expected square of the cosine transform of a sampled Gauss-Markov process of unit variance.

    Parameters
    ----------
    frequency : (k,) array [Hz], > 0
        Multiples k of ``1 / (2 span)``.
    dt, span, correlation : float [s]

    Notes
    -----
    The density of the sampled process, less what the two ends of the record lack. With a = 1 / correlation and
    b = 2 pi f the continuous integral is ``2a / (a^2 + b^2) - (4 a^2 / span) (1 - (-1)^k exp(-a span)) / (a^2 +
    b^2)^2``.
    """
    a, b = 1.0 / correlation, 2.0 * math.pi * frequency
    decay = math.exp(-dt * a)
    sampled = -dt * math.expm1(-2.0 * dt * a) / (math.expm1(-dt * a) ** 2 + 4.0 * decay * np.sin(0.5 * b * dt) ** 2)
    k = np.rint(2.0 * span * frequency)
    sign = np.where(k % 2 == 0, 1.0, -1.0)
    lacking = (4.0 * a * a / span) * (1.0 - sign * math.exp(-a * span)) / (a * a + b * b) ** 2
    return np.maximum(sampled - lacking, 1e-3 * sampled)
