"""Slow twins: differences of phase and their covariances, written out from the definitions."""

from __future__ import annotations

import math

import numpy as np

OVERLAPPING = ("oadev", "mdev", "ohdev", "totdev")


def stencil(kind, m):
    order = 3 if "hdev" in kind else 2
    found = np.zeros(order * m + 1)
    found[::m] = [(-1.0) ** k * math.comb(order, k) for k in range(order + 1)]
    return np.convolve(found, np.ones(m)) if kind == "mdev" else found


def difference_rows(kind, m, n):
    """Every difference of n + 1 points of phase, as a row of coefficients."""
    points = n + 1
    if kind == "totdev":
        rows = np.zeros((n - 1, points))
        for row, i in enumerate(range(1, n)):
            rows[row, i] = -2.0
            for k in (i - m, i + m):
                if k < 0:
                    rows[row, 0] += 2.0
                    rows[row, -k] -= 1.0
                elif k > n:
                    rows[row, n] += 2.0
                    rows[row, 2 * n - k] -= 1.0
                else:
                    rows[row, k] += 1.0
        return rows
    one = stencil(kind, m)
    starts = np.arange(0, points - one.size + 1, 1 if kind in OVERLAPPING else m)
    rows = np.zeros((starts.size, points))
    for row, begin in enumerate(starts):
        rows[row, begin : begin + one.size] = one
    return rows


def phase_factor(alpha, points):
    """Phase of sampled noise is this matrix times independent numbers: white phase, white rates, a walk of them."""
    summed = np.tril(np.ones((points, points)), -1)
    return {2: np.eye(points), 0: summed, -2: summed @ np.tril(np.ones((points, points)))}[alpha]


def flicker_generalised(alpha, points):
    """Of noise that goes on between samples: t^2 log t and -t^4 log t, which differences turn into covariances."""
    lag = np.abs(np.subtract.outer(np.arange(points), np.arange(points))).astype(float)
    logarithm = np.log(np.where(lag > 0.0, lag, 1.0))
    return {-1: lag**2 * logarithm, -3: -(lag**4) * logarithm}[alpha]


def covariance(kind, alpha, m, n):
    rows = difference_rows(kind, m, n)
    if alpha in (-1, -3):
        return rows @ flicker_generalised(alpha, n + 1) @ rows.T
    factor = rows @ phase_factor(alpha, n + 1)
    return factor @ factor.T


def exact_edf(kind, alpha, m, n):
    found = covariance(kind, alpha, m, n)
    return float(np.trace(found) ** 2 / np.sum(found**2))


def exact_bias(alpha, m, n):
    """Expected total variance over the Allan variance."""
    allan = covariance("oadev", alpha, m, 2 * m)[0, 0]
    return float(np.trace(covariance("totdev", alpha, m, n)) / (n - 1) / allan)


def noise_rates(alpha, runs, n, rng):
    """Rates of `runs` records of noise."""
    white = rng.standard_normal((runs, n))
    if alpha == 0:
        return white
    if alpha == -2:
        return np.cumsum(white, axis=1)
    size = 1 << math.ceil(math.log2(16 * n))
    frequency = np.fft.rfftfreq(size)
    gain = np.zeros(frequency.size)
    gain[1:] = (2.0 * np.sin(np.pi * frequency[1:])) ** (alpha / 2.0)
    return np.stack([np.fft.irfft(gain * np.fft.rfft(rng.standard_normal(size)), size)[:n] for _ in range(runs)])
