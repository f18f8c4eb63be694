"""How sure a deviation is: equivalent degrees of freedom by noise type, and chi-square intervals.

An estimated variance times its equivalent degrees of freedom (edf), divided by the true variance, is close to a
chi-square variable with edf degrees of freedom. The edf of Allan, modified Allan and Hadamard variances, overlapping or
not, are those of Greenhall and Riley, "Uncertainty of stability variances based on finite differences" (35th PTTI,
2003; NIST SP 1065, section 5.4.1): the sum over the squared correlations of the differences. It is evaluated as it
stands, without the fitted tables of that paper, except that beyond :data:`MOST_LAGS` lags the correlations are sampled
more coarsely, which is the limit of a continuous record. Those of the total variance are the fits of NIST SP 1065,
table 7.

Noise types are exponents alpha of the density of the rate, ``S(f) ~ f^alpha``: 2 quantisation of the angle, 1 flicker
of the angle, 0 angle random walk, -1 bias instability, -2 rate random walk, -3 and -4 (Hadamard only) steeper ones.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

Array = np.ndarray

ONE_SIGMA = math.erf(math.sqrt(0.5))
"""Probability within one sigma of a normal distribution, 0.683."""

MOST_LAGS = 4000
"""Lags that the sum runs over at most."""

ORDER = {"adev": 2, "oadev": 2, "mdev": 2, "hdev": 3, "ohdev": 3, "totdev": 2}
LEAST_ALPHA = {2: -2, 3: -4}
_TOTAL_EDF = {0: (1.500, 0.0), -1: (1.168, 0.222), -2: (0.927, 0.358)}
_SHORTEST_ACF = 30
_LONGEST_ACF = 1 << 15


@njit(cache=True, error_model="numpy")
def _sw(t, alpha):
    """Generalised autocovariance of phase with exponent alpha, to a factor (Greenhall and Riley, eq. 6)."""
    t = abs(t)
    if t == 0.0:
        return 0.0
    if alpha == 2:
        return -t
    if alpha == 1:
        return t * t * math.log(t)
    if alpha == 0:
        return t**3
    if alpha == -1:
        return -(t**4) * math.log(t)
    if alpha == -2:
        return -(t**5)
    if alpha == -3:
        return t**6 * math.log(t)
    return t**7


@njit(cache=True, error_model="numpy")
def _sx(t, f, alpha):
    """The same of phase averaged over 1/f; f = 0 stands for no averaging at all."""
    if f == 0.0:
        return _sw(t, alpha + 2)
    return f * f * (2.0 * _sw(t, alpha) - _sw(t - 1.0 / f, alpha) - _sw(t + 1.0 / f, alpha))


@njit(cache=True, error_model="numpy")
def _sz(t, f, alpha, d):
    """Of the differences of order d of that phase."""
    if d == 2:
        near = _sx(t - 1.0, f, alpha) + _sx(t + 1.0, f, alpha)
        return 6.0 * _sx(t, f, alpha) - 4.0 * near + _sx(t - 2.0, f, alpha) + _sx(t + 2.0, f, alpha)
    near = _sx(t - 1.0, f, alpha) + _sx(t + 1.0, f, alpha)
    middle = _sx(t - 2.0, f, alpha) + _sx(t + 2.0, f, alpha)
    far = _sx(t - 3.0, f, alpha) + _sx(t + 3.0, f, alpha)
    return 20.0 * _sx(t, f, alpha) - 15.0 * near + 6.0 * middle - far


@njit(cache=True, error_model="numpy")
def _inverse_edf(lags, count, stride, f, alpha, d):
    """Mean squared correlation of `count` differences, `stride` of them per averaging time."""
    first = _sz(0.0, f, alpha, d) ** 2
    total = first
    for j in range(1, lags + 1):
        weight = 1.0 if j == lags else 2.0
        total += weight * (1.0 - j / count) * _sz(j / stride, f, alpha, d) ** 2
    return total / (first * count)


def degrees_of_freedom(kind: str, alpha: int, m: int, n: int) -> float:
    """Equivalent degrees of freedom of a variance.

    Parameters
    ----------
    kind : str
        "adev", "oadev", "mdev", "hdev", "ohdev" or "totdev".
    alpha : int
        Noise type, 2 to -2 (to -4 for the Hadamard variances); steeper ones are taken for the steepest that the
        variance converges for.
    m : int
        Averaging factor.
    n : int
        Number of rate samples (phase points less one) in one stretch without gaps.

    Returns
    -------
    float
        0 where the record is too short.

    Notes
    -----
    The source takes noise to go on between the samples, and phase as averaged over one: against the covariance of
    sampled noise the edf is up to 23 % off at m = 1, 11 % at m = 3 and 5 % at m = 20. Of flicker phase noise (alpha =
    1) the edf grows with the averaging factor itself; beyond a third of :data:`MOST_LAGS` it is that of a smaller one,
    so that the interval is too wide rather than too narrow.
    """
    d = ORDER[kind]
    alpha = max(min(alpha, 2), LEAST_ALPHA[d])
    if kind == "totdev":
        if alpha > 0 or 2 * m > n:
            return degrees_of_freedom("oadev", alpha, m, n) if 2 * m <= n else 1.0
        slope, less = _TOTAL_EDF[alpha]
        return max(slope * n / m - less, 1.0)
    modified, overlapping = kind == "mdev", kind in ("oadev", "mdev", "ohdev")
    reach = m * d + (m if modified else 1)
    points = n + 1
    if points < reach:
        return 0.0
    stride = m if overlapping else 1
    count = 1 + (stride * (points - reach)) // m
    f = 1.0 if modified else float(m)
    if not modified and alpha == 2 and overlapping:
        return _white_phase(d, m, count)
    lags = min(count, (d + 1) * stride)
    exact_count = float(count)
    if lags > MOST_LAGS:
        shrink = MOST_LAGS / lags
        exact_count = count * shrink
        stride = stride * shrink
        lags = MOST_LAGS
        if not modified and alpha == 1:
            f = f * shrink
    if not modified and alpha <= 0 and m > 50:
        f = 0.0
    return 1.0 / _inverse_edf(lags, exact_count, float(stride), f, alpha, d)


def _white_phase(d: int, m: int, count: int) -> float:
    """White phase noise, overlapping: differences share points only where they are whole averaging times apart."""
    signs = np.array([math.comb(d, k) * (-1.0) ** k for k in range(d + 1)])
    correlation = np.correlate(signs, signs, "full")[d:]
    lag = m * np.arange(1, d + 1)
    inside = np.maximum(1.0 - lag / count, 0.0)
    return count / (1.0 + 2.0 * float(np.sum(inside * (correlation[1:] / correlation[0]) ** 2)))


def interval(variance: Array, edf: Array, level: float) -> tuple[Array, Array]:
    """Limits between which the true variance lies with a probability.

    Parameters
    ----------
    variance, edf : (t,) arrays
        NaN or edf = 0 give NaN.
    level : float
        Probability, between 0 and 1; as much is left out above as below.

    Returns
    -------
    low, high : (t,) arrays
    """
    from scipy.special import gammaincinv

    low, high = np.full(variance.size, np.nan), np.full(variance.size, np.nan)
    good = (edf > 0.0) & np.isfinite(variance)
    half = edf[good] / 2.0
    low[good] = variance[good] * half / gammaincinv(half, 0.5 + level / 2.0)
    high[good] = variance[good] * half / gammaincinv(half, 0.5 - level / 2.0)
    return low, high


def noise_exponents(phase: Array, factors: Array, order: int = 2) -> Array:
    """Noise type at each averaging time, from the lag-1 autocorrelation of the averaged data.

    The phase is taken every m samples, a parabola removed, and differenced until it is stationary; the lag-1
    autocorrelation of what remains tells the exponent (Riley and Greenhall, "Power law noise identification using the
    lag 1 autocorrelation", 18th EFTF, 2004; NIST SP 1065, section 5.5.2). With fewer than 30 points left the type of
    the averaging time before is kept; of a long record the first 32 768 points are enough.

    Parameters
    ----------
    phase : (n + 1,) array
    factors : (t,) int array
        Increasing.
    order : {2, 3}
        Order of difference of the variance: Hadamard variances tell steeper noise.

    Returns
    -------
    (t,) int array
        alpha, 2 to -2, or to -4.
    """
    found = np.zeros(factors.size, dtype=np.int64)
    previous = 0
    for k, m in enumerate(factors):
        sampled = phase[: m * _LONGEST_ACF : m]
        if sampled.size >= _SHORTEST_ACF:
            previous = _exponent(sampled, order)
        found[k] = previous
    return np.clip(found, LEAST_ALPHA[order], 2)


def _exponent(phase: Array, order: int) -> int:
    where = np.linspace(-1.0, 1.0, phase.size)
    z = phase - np.polynomial.polynomial.polyval(where, np.polynomial.polynomial.polyfit(where, phase, 2))
    for d in range(order + 1):
        z = z - z.mean()
        power = float(z @ z)
        if power == 0.0:
            return 0
        r = float(z[1:] @ z[:-1]) / power
        delta = r / (1.0 + r)
        if delta < 0.25 or d == order:
            return round(2.0 - 2.0 * (delta + d))
        z = np.diff(z)
    raise AssertionError
