"""Few averaging times in a record: the distribution of an estimated variance, where chi-square is not close to it.

A mean of squares of Gaussian differences is distributed as ``sum(w_k z_k^2)`` with independent standard normal z and
the eigenvalues w of the covariance of the differences. Chi-square with the same mean and variance, the usual stand-in,
has lower tails that reach too far down when the edf come from one large and several small weights: of white noise with
3.9 averaging times in the record its 68.3 % interval of the overlapping Hadamard deviation covers 74 %, that of
95 % covers 97 %. Here the covariance is written out on a grid of 16 points per averaging time, on which only the
ratio of record and averaging time matters, and quantiles are taken from the weights.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from navfuse.analysis.allan.confidence import ORDER, OVERLAPPING, autocovariance
from navfuse.analysis.allan.noise_types import LEAST_ALPHA

Array = np.ndarray

FEWEST = 10.0
"""Equivalent degrees of freedom from which chi-square is taken; there a 68.3 % interval covers 70.2 % at most."""

_GRID = 16


def weights(kind: str, alpha: int, m: int, n: int) -> Array:
    """Weights of squared standard normal variables in an estimated variance, in units of its mean.

    Parameters
    ----------
    kind : str
        As for :func:`~navfuse.analysis.allan.confidence.degrees_of_freedom`.
    alpha : int
        Not phase noise for overlapping deviations but "mdev": its weights depend on the samples in an averaging time.
    m, n : int
        Averaging factor, and samples of the stretch.

    Returns
    -------
    (k,) array
        Positive, of sum 1; the edf are one over the sum of their squares.
    """
    d, grid = ORDER[kind], min(m, _GRID)
    alpha = max(alpha, LEAST_ALPHA[d])
    if kind == "totdev":
        size = max(round(n * grid / m), grid + 1)
    elif kind in OVERLAPPING:
        longer = d * m + (m - 1 if kind == "mdev" else 0)
        number = max(round((n - longer + 1) * grid / m), 1)
        size = d * grid + (grid - 1 if kind == "mdev" else 0) + number - 1
    else:
        size = n // m * grid
    return _weights(kind, alpha, grid, size)


@lru_cache(maxsize=1024)
def _weights(kind: str, alpha: int, m: int, n: int) -> Array:
    rows = differences(kind, m, n)
    lag = np.arange(n + 1)
    covariance = rows @ autocovariance(lag[:, None] - lag, alpha) @ rows.T
    found = np.linalg.eigvalsh(covariance)
    found = found[found > 1e-9 * found[-1]]
    return found / found.sum()


def differences(kind: str, m: int, n: int) -> Array:
    """Matrix that makes the differences of a deviation from n + 1 points of phase."""
    if kind == "totdev":
        mirrored = np.zeros((n + 1 + 2 * m, n + 1))
        inner, k = np.arange(n + 1), np.arange(1, m + 1)
        mirrored[m + inner, inner] = 1.0
        mirrored[m - k, k] -= 1.0
        mirrored[m - k, 0] += 2.0
        mirrored[m + n + k, n - k] -= 1.0
        mirrored[m + n + k, n] += 2.0
        return (mirrored[2 * m :] - 2.0 * mirrored[m:-m] + mirrored[: -2 * m])[1:-1]
    d = ORDER[kind]
    stencil = np.zeros(d * m + 1)
    stencil[::m] = [(-1.0) ** k * math.comb(d, k) for k in range(d + 1)]
    if kind == "mdev":
        stencil = np.convolve(stencil, np.ones(m))
    first = np.arange(0, n + 2 - stencil.size, 1 if kind in OVERLAPPING else m)
    rows = np.zeros((first.size, n + 1))
    rows[np.arange(first.size)[:, None], first[:, None] + np.arange(stencil.size)] = stencil
    return rows


def quantiles(parts: Array, probability: Array) -> Array:
    """Quantiles of ``sum(parts * z^2)`` with independent standard normal z.

    Parameters
    ----------
    parts : (k,) array
        Weights, > 0.
    probability : (p,) array
        Between 1e-6 and 1 - 1e-6.

    Notes
    -----
    Saddlepoint approximation of the distribution in the form of Barndorff-Nielsen, ``P = Phi(w + log(v / w) / w)``
    with ``w^2 / 2 = s x - K(s)``, ``v = s sqrt(K''(s))`` and ``K'(s) = x`` (Lugannani and Rice, Adv. Appl. Prob. 12,
    1980; Kuonen, Biometrika 86, 1999, for quadratic forms). It is evaluated along s, so that nothing has to be solved.
    It is off by up to 0.016 in probability, for one large weight beside many small ones; by 0.002 for equal weights but
    a single one, 0.006.
    """
    from scipy.special import ndtri

    y = np.linspace(-32.0, 32.0, 401)
    s = -np.expm1(-y) / (2.0 * parts.max())
    left = 1.0 - 2.0 * s[:, None] * parts
    x = np.sum(parts / left, axis=1)
    w = np.sign(s) * np.sqrt(np.maximum(2.0 * s * x + np.sum(np.log(left), axis=1), 0.0))
    v = s * np.sqrt(2.0 * np.sum((parts / left) ** 2, axis=1))
    clear = np.abs(w) > 0.02
    score = w[clear] + np.log(v[clear] / w[clear]) / w[clear]
    return np.exp(np.interp(ndtri(probability), score, np.log(x[clear])))
