"""Which power law the noise follows at each averaging time, on which the confidence of a deviation depends.

A type is the exponent alpha of the density of the rate, ``S(f) ~ f^alpha``; see
:mod:`~navfuse.analysis.allan.confidence`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Array = np.ndarray

NoiseTypes = Callable[[Array], Array]
"""Exponents at averaging times [s]; NaN where it does not know."""

LEAST_ALPHA = {2: -2, 3: -4}
"""Steepest noise for which a variance from differences of this order converges."""

_SHORTEST_ACF = 30
_CERTAIN_ACF = 64
_LONGEST_ACF = 1 << 15
_DOUBT = 2.0
"""Standard deviations that a type has to differ by from the one before."""


def types_of_model(variance: Callable[[Array], Array]) -> NoiseTypes:
    """Noise types from a model of the Allan variance: its local slope mu tells ``alpha = -1 - mu``.

    Parameters
    ----------
    variance : callable
        Allan variance at averaging times [s]; NaN or 0 where there is no model.

    Notes
    -----
    NIST SP 1065, section 5.5: tau^-2 stands for both phase noises and is taken for quantisation (alpha = 2), tau^-1
    for white noise, tau^0 for flicker noise and tau^1 for a random walk. The slope is that between 0.9 and 1.1 tau.
    """

    def types(tau: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = np.log(variance(1.1 * tau)) - np.log(variance(0.9 * tau))
        slope = steps / np.log(1.1 / 0.9)
        return np.where(slope < -1.5, 2.0, np.rint(-1.0 - slope))

    return types


def noise_exponents(phase: Array, factors: Array, kind: str = "oadev", variance: Array | None = None) -> Array:
    """Noise type at each averaging time, from the lag-1 autocorrelation of the averaged data.

    The phase is taken every m samples, a parabola removed, and differenced until it is stationary; the lag-1
    autocorrelation of what remains tells the exponent (Riley and Greenhall, "Power law noise identification using the
    lag 1 autocorrelation", 18th EFTF, 2004; NIST SP 1065, section 5.5.2). Of a long record the first 32 768 points are
    enough.

    Parameters
    ----------
    phase : (n + 1,) array
    factors : (t,) int array
        Increasing.
    kind : str
        Deviation that the types are for; Hadamard variances tell steeper noise.
    variance : (t,) array, optional
        Its square as estimated.

    Returns
    -------
    (t,) int array
        alpha, 2 to -2, or to -4.

    Notes
    -----
    The source takes the nearest type down to 30 points and keeps that one from there on. But with 30 points the
    exponent has a standard deviation of 0.4 to 0.7: of white noise every fourth record is taken for something else, for
    flicker phase noise as a rule, whose edf are so many that 95 % intervals cover 80 % at all longer times. Here, in
    steps of an octave at most, the type of the averaging time before is kept unless the exponent differs from it by
    more than two standard deviations, and then the nearest one within these is taken; with fewer than 64 points, whose
    exponents are too large on average, steeper ones only. Beyond the last 30 points the last type is kept, with two
    exceptions for phase noise, whose edf are many. White phase noise is kept for as long as the variance falls as it
    should: where it is twice as large, noise of the rate has emerged. Flicker phase noise is not kept; it is mostly
    white noise about to emerge.
    """
    order = 3 if kind in ("hdev", "ohdev") else 2
    wanted = {int(m): k for k, m in enumerate(factors)}
    octaves = 1 << np.arange(int(factors[-1]).bit_length())
    found = np.zeros(factors.size, dtype=np.int64)
    previous: int | None = None
    last: int | None = None
    for m in np.union1d(octaves, factors).tolist():
        k = wanted.get(m)
        sampled = phase[: m * _LONGEST_ACF : m]
        if sampled.size >= _SHORTEST_ACF:
            exponent, sd = _exponent(sampled, order)
            if previous is None:
                previous = round(exponent)
            elif abs(exponent - previous) > 0.5:
                near = round(float(np.clip(previous, exponent - _DOUBT * sd, exponent + _DOUBT * sd)))
                previous = near if sampled.size >= _CERTAIN_ACF else min(near, previous)
            last = last if k is None else k
        elif previous is None:
            previous = 0
        elif previous > 0 and k is not None:
            power = 3.0 if kind == "mdev" else 2.0
            falls = False
            if variance is not None and last is not None:
                falls = bool(variance[k] < 2.0 * variance[last] * (factors[last] / m) ** power)
            previous = 2 if previous == 2 and falls else 0
        if k is not None:
            found[k] = previous
    return np.clip(found, LEAST_ALPHA[order], 2)


def _exponent(phase: Array, order: int) -> tuple[float, float]:
    """Exponent and its standard deviation, that of a correlation coefficient near 0."""
    line = np.linspace(-1.0, 1.0, phase.size)
    z = phase - phase.mean()
    for shape in (line, line**2 - np.mean(line**2)):  # orthogonal, so that one goes after the other
        z -= _dot(z, shape) / _dot(shape, shape) * shape
    for d in range(order + 1):
        z = z - z.mean()
        power = _dot(z, z)
        if power == 0.0:
            return 0.0, 0.0
        r = _dot(z[1:], z[:-1]) / power
        delta = r / (1.0 + r)
        if delta < 0.25 or d == order:
            return 2.0 - 2.0 * (delta + d), 2.0 / ((1.0 + r) ** 2 * np.sqrt(z.size))
        z = np.diff(z)
    raise AssertionError


def _dot(a: Array, b: Array) -> float:
    """Without a linear algebra library, whose threads take longer to start than this sum."""
    return float(np.einsum("i,i", a, b))
