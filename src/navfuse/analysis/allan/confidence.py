"""How sure a deviation is: equivalent degrees of freedom by noise type, and intervals.

An estimated variance is a mean of squares of Gaussian differences. Times its equivalent degrees of freedom (edf),
divided by the true variance, it is close to a chi-square variable with edf degrees of freedom. One over the edf is the
mean squared correlation of the differences, which is evaluated as it stands from the covariance of the noise
(Greenhall and Riley, "Uncertainty of stability variances based on finite differences", 35th PTTI, 2003; NIST SP 1065,
section 5.4.1, has it with fitted tables). Where there are few averaging times in the record, chi-square is too wide,
and the distribution itself is taken: :mod:`~navfuse.analysis.allan.few`.

Noise types are exponents alpha of the density of the rate, ``S(f) ~ f^alpha``: 2 quantisation of the angle, 1 flicker
of the angle, 0 angle random walk, -1 bias instability, -2 rate random walk, -3 and -4 (Hadamard only) steeper ones.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from navfuse.analysis.allan.noise_types import LEAST_ALPHA

Array = np.ndarray

ONE_SIGMA = math.erf(math.sqrt(0.5))
"""Probability within one sigma of a normal distribution, 0.683."""

MOST_LAGS = 4000
"""Lags that the sum runs over at most."""

ORDER = {"adev": 2, "oadev": 2, "mdev": 2, "hdev": 3, "ohdev": 3, "totdev": 2}
OVERLAPPING = ("oadev", "mdev", "ohdev")
_TOTAL_EDF = {0: (1.500, 0.0), -1: (1.168, 0.222), -2: (0.927, 0.358)}
_TOTAL_BIAS = {2: 4.0 / 3.0, 1: 0.95, 0: 0.0, -1: -1.0 / (3.0 * math.log(2.0)), -2: -0.75}


def autocovariance(lag: Array, alpha: int) -> Array:
    """Generalised autocovariance of the phase of sampled noise, to a factor.

    Parameters
    ----------
    lag : array of whole numbers
        In samples.
    alpha : int

    Notes
    -----
    Of differences of an order that the noise allows it gives covariances (Greenhall and Riley, eq. 6). Rates are white
    or a random walk in steps from sample to sample for alpha = 0 and -2: exact. -1, -3 and -4 are noise that goes on
    between the samples, and 1 is phase that was averaged over one, without which flicker has no variance.
    """
    u = np.abs(np.asarray(lag, dtype=np.float64))
    if alpha == 2:
        return (u == 0.0).astype(np.float64)
    if alpha == 1:
        return 2.0 * _square_log(u) - _square_log(u - 1.0) - _square_log(u + 1.0)
    if alpha == 0:
        return -u
    if alpha == -1:
        return _square_log(u)
    if alpha == -2:
        return u**3 - u
    if alpha == -3:
        return -u * u * _square_log(u)
    return -(u**5)


def _square_log(u: Array) -> Array:
    return u * u * np.log(np.where(u == 0.0, 1.0, np.abs(u)))


def _correlations(kind: str, alpha: int, m: int) -> Array:
    """Correlation of two differences by the number of differences between them, from 0 until it has died away."""
    d, window, step = ORDER[kind], m if kind == "mdev" else 1, 1
    if kind in ("adev", "hdev"):
        step, m = m, 1
    last, reach = (d + 1) * m + window - 1, d * m
    side = reach + window - 1
    s = autocovariance(step * np.arange(-side, last + side + 1), alpha)
    if window > 1:
        for _ in range(2):
            summed = np.concatenate([[0.0], np.cumsum(s)])
            s = summed[window:] - summed[:-window]
    r = np.zeros(last + 1)
    for k in range(-d, d + 1):
        r += (-1.0) ** k * math.comb(2 * d, d + k) * s[reach + k * m : reach + k * m + last + 1]
    return r / r[0]


@lru_cache(maxsize=128)
def _sums_of_squares(kind: str, alpha: int, m: int) -> tuple[Array, Array]:
    """Sums of squared correlations up to each lag, and of these times the lag."""
    squares = _correlations(kind, alpha, m) ** 2
    squares[0] = 0.0
    return np.cumsum(squares), np.cumsum(np.arange(squares.size) * squares)


def degrees_of_freedom(kind: str, alpha: int, m: int, n: Array | int) -> Array:
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
    n : (s,) int array, or int
        Number of rate samples (phase points less one) in stretches without gaps.

    Returns
    -------
    (s,) array, or float
        0 where the record is too short.

    Notes
    -----
    Beyond :data:`MOST_LAGS` lags the sum has the lags of a smaller averaging factor, which is the limit of a continuous
    record. Of flicker phase noise (alpha = 1) the edf grows with the averaging factor itself; there it is that of the
    smaller one, so that the interval is too wide rather than too narrow.

    Total variance: the fits of NIST SP 1065, table 7, are for many samples in the averaging time and go to infinity for
    few; here they are times what sampling does to n - 1 differences of which none is mirrored: within 2 % of the
    covariance written out up to half the record. Of phase noise, for which there is no table, the mirrored ends repeat
    the noise of the first and the last point.
    """
    d = ORDER[kind]
    alpha = max(min(alpha, 2), LEAST_ALPHA[d])
    size = np.asarray(n, dtype=np.float64)
    if kind == "totdev":
        return np.maximum(_total(alpha, m, size), 1.0)
    spare = size - d * m + (1 - m if kind == "mdev" else 0)
    count = np.where(spare >= 0.0, (spare if kind in OVERLAPPING else spare // m) + 1.0, 0.0)
    return _stationary(kind, alpha, m, count)


def _total(alpha: int, m: int, size: Array) -> Array:
    """Edf of total variance, up to half the record.

    Of white phase noise of unit variance a difference has variance 6, and 10 with one mirrored point. Squared
    covariances of those within add to 70 for each, of mirrored ones to 120; and the m ones of each end share the end
    point twice, which is 16 for each pair. For flicker phase noise, the edf of the overlapping variance over
    ``1 + 1.2 m/n`` is a fit to covariances written out for n = 400 and 1000.
    """
    if alpha == 2:
        return (6.0 * size + 8.0 * m) ** 2 / (70.0 * (size - 2.0 * m) + 240.0 * m + 32.0 * m * m)
    if alpha == 1:
        return degrees_of_freedom("oadev", 1, m, size) / (1.0 + 1.2 * m / size)
    slope, less = _TOTAL_EDF[alpha]
    coarse = MOST_LAGS // 3
    sampled = _stationary("totdev", alpha, m, size - 1.0)
    continuous = _stationary("totdev", alpha, coarse, (size - 1.0) * coarse / m)
    return (slope * size / m - less) * sampled / continuous


def _stationary(kind: str, alpha: int, m: int, count: Array) -> Array:
    """Edf of the mean of the squares of neighbouring differences."""
    d = ORDER[kind]
    if alpha == 2 and kind in ("oadev", "ohdev"):
        return _white_phase(d, m, count)
    shrink = 1.0
    coarse = MOST_LAGS // (d + 1)
    if m > coarse and kind not in ("adev", "hdev"):
        shrink, m = coarse / m, coarse
    squares, lagged = _sums_of_squares(kind, alpha, m)
    number = count * shrink
    last = np.clip(np.ceil(number).astype(np.int64) - 1, 0, squares.size - 1)
    safe = np.maximum(number, 1e-300)
    mean = (1.0 + 2.0 * (squares[last] - lagged[last] / safe)) / safe
    return np.where(count > 0.0, np.maximum(1.0 / mean, 1.0), 0.0)


def _white_phase(d: int, m: int, count: Array) -> Array:
    """White phase noise, overlapping: differences share points only where they are whole averaging times apart."""
    signs = np.array([math.comb(d, k) * (-1.0) ** k for k in range(d + 1)])
    correlation = np.correlate(signs, signs, "full")[d:]
    lag = m * np.arange(1, d + 1)
    inside = np.maximum(1.0 - lag / np.maximum(count, 1.0)[..., None], 0.0)
    return count / (1.0 + 2.0 * np.sum(inside * (correlation[1:] / correlation[0]) ** 2, axis=-1))


def total_bias(alpha: int, m: int, n: Array | int) -> Array:
    """Expected total variance over the Allan variance: ``1 + a m/n``, a = 0, -0.481, -0.75 for alpha = 0, -1, -2.

    Notes
    -----
    Greenhall, Howe and Percival, "Total variance, an estimator of long-term frequency stability", IEEE Trans. UFFC 46
    (1999); NIST SP 1065, table 7. It holds within 0.007 until three quarters of the record, 0.03 until the whole. Of
    phase noise, which the table does not have, a mirrored end adds the noise of the end point: a = 4/3 for alpha = 2,
    where m - 1 differences at each end have variance 10 instead of 6, and 0.95 for alpha = 1, a fit to covariances
    written out.
    """
    return 1.0 + _TOTAL_BIAS[max(alpha, -2)] * m / np.asarray(n, dtype=np.float64)


def pooled(edf: Array, count: Array, times: Array) -> float:
    """Degrees of freedom of the mean of all squares of several stretches.

    Parameters
    ----------
    edf, count, times : (s,) arrays
        Of each size of a stretch: degrees of freedom and differences, > 0, and how many such stretches there are.

    Notes
    -----
    The stretches weigh by their differences and are taken for independent. The variance of the mean goes with the sum
    of ``count^2 / edf``; the sum of the edf themselves holds for equal stretches only and is too large for others.
    """
    return float((count @ times) ** 2 / ((count * (count / edf)) @ times))


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
