"""Likelihood of the noise terms: a cosine transform turns a record into independent numbers.

The transform (DCT-II) of a record with quantisation, white noise and a random walk has *exactly* independent Gaussian
coefficients: it diagonalises the difference operator of a record whose ends are free, so that neither the trend of a
random walk nor the unknown value it starts from leaks. For Gauss-Markov processes, and so for flicker noise, this
holds up to what the two ends lack, which the expected squares account for. The coefficients are worth one degree of
freedom each, at twice the frequency resolution of a periodogram.

Beyond the first :data:`SINGLE` they are summed in bins of 2 % of their frequency, which loses nothing that a smooth
density can tell. A ramp, and the two unknown quantisation errors at the ends of the record, are regressors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

Array = np.ndarray

SINGLE = 256
WIDTH = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class CosineSpectrum:
    """Squares of the cosine transform of a record, in bins of frequency.

    Attributes
    ----------
    frequency : (b,) array [Hz]
    dof : (b,) array
        Coefficients in each bin.
    power : (b,) array
        Their sum of squares as two-sided density, unit of the rate squared per hertz, times `dof`.
    design : (3, b) array
        Their sums of products with the regressors: first sample, last sample, ramp.
    gram : (3, 3, b) array
        Sums of products of the regressors.
    dt, span : float [s]
    """

    frequency: Array
    dof: Array
    power: Array
    design: Array
    gram: Array
    dt: float
    span: float

    def below(self, highest: float) -> CosineSpectrum:
        """The bins up to a frequency [Hz]."""
        kept = int(np.searchsorted(self.frequency, highest, "right"))
        parts = {name: getattr(self, name)[..., :kept] for name in ("frequency", "dof", "power", "design", "gram")}
        return CosineSpectrum(**parts, dt=self.dt, span=self.span)


def cosine_spectrum(values: Array, dt: float) -> CosineSpectrum:
    """Transform a record without gaps.

    Parameters
    ----------
    values : (n,) array
        Rates.
    dt : float [s]
    """
    from scipy.fft import dct

    n = values.size
    copy = np.array(values, dtype=np.float64)
    copy -= np.mean(copy)
    whole = np.asarray(dct(copy, type=2, norm="ortho", overwrite_x=True))
    edge = _edges(n)
    sums = np.empty((10, edge.size))
    bin_sums(whole, dt, np.append(edge, n - 1) + 1, sums)
    dof = np.diff(np.append(edge, n - 1)).astype(float)
    gram = sums[[[4, 5, 6], [5, 4, 7], [6, 7, 8]]]
    return CosineSpectrum(np.exp(sums[9] / dof) / (2.0 * n * dt), dof, sums[0], sums[1:4], gram, dt, n * dt)


@njit(cache=True, error_model="numpy")
def bin_sums(transform, dt, edge, out):
    """Sums over each bin of the squares of a cosine transform and of the products with its regressors.

    Nothing of the length of the record is stored. No checks are made.

    Parameters
    ----------
    transform : (n,) array
        Orthonormal cosine transform (DCT-II) of the samples.
    dt : float [s]
    edge : (b + 1,) int array
        Coefficients ``edge[j]`` to ``edge[j + 1] - 1`` are in bin j; the first is 1.
    out : (10, b) array
        Of squares; of products with first sample, last sample, ramp; products of the regressors: first with first,
        first with last, first with ramp, last with ramp, ramp with ramp; logarithms of the number of the coefficient.
    """
    n = transform.size
    root = math.sqrt(2.0 / n * dt)
    for j in range(edge.size - 1):
        power = first_c = last_c = ramp_c = 0.0
        first2 = first_last = first_ramp = ramp2 = logs = 0.0
        product, many = 1.0, 0
        for k in range(edge[j], edge[j + 1]):
            c = math.sqrt(dt) * transform[k]
            half = 0.5 * math.pi * k / n
            cosine = math.cos(half)
            first = root * cosine
            power += c * c
            first_c += first * c
            first2 += first * first
            if k % 2 == 1:
                ramp = -root * dt * cosine / (2.0 * math.sin(half) ** 2)
                last_c -= first * c
                ramp_c += ramp * c
                first_last -= first * first
                first_ramp += first * ramp
                ramp2 += ramp * ramp
            else:
                last_c += first * c
                first_last += first * first
            product *= k
            many += 1
            if many == 16:
                logs += math.log(product)
                product, many = 1.0, 0
        logs += math.log(product)
        out[0, j], out[1, j], out[2, j], out[3, j] = power, first_c, last_c, ramp_c
        out[4, j], out[5, j], out[6, j], out[7, j], out[8, j] = first2, first_last, first_ramp, -first_ramp, ramp2
        out[9, j] = logs


def _edges(n: int) -> Array:
    """First index of each bin among the coefficients 1 to n - 1."""
    last = n - 1
    if last <= SINGLE:
        return np.arange(last)
    count = max(1, math.ceil(math.log(last / SINGLE) / WIDTH))
    wide = np.unique(np.rint(SINGLE * (last / SINGLE) ** (np.arange(count) / count)).astype(np.int64))
    return np.concatenate([np.arange(SINGLE), wide[wide >= SINGLE]])


class Restricted:
    """Restricted log-likelihood of a model of the density, with its gradient; regressors are integrated out.

    The regressors are scaled to unit length first: a ramp and the ends of a long record differ by twenty decades.

    Parameters
    ----------
    spectrum : CosineSpectrum
    ramp : bool
        Whether a ramp is among the regressors.
    weight : (b,) array, optional
        Degrees of freedom to count each bin for, instead of those it has.
    """

    def __init__(self, spectrum: CosineSpectrum, ramp: bool, weight: Array | None = None) -> None:
        use = [0, 1, 2] if ramp else [0, 1]
        self.spectrum, self.weight = spectrum, weight
        share = np.ones_like(spectrum.dof) if weight is None else weight / spectrum.dof
        self.dof = spectrum.dof * share
        self._power = spectrum.power * share
        scale = 1.0 / np.sqrt(np.array([spectrum.gram[k, k].sum() for k in use]))
        self._ramp_scale = float(scale[-1])
        self._design = spectrum.design[use] * share * scale[:, None]
        self._gram = spectrum.gram[np.ix_(use, use)] * share * np.outer(scale, scale)[:, :, None]

    def value(self, density: Array) -> tuple[float, Array]:
        """Log-likelihood, and its derivative by the logarithm of the density in each bin."""
        inverse = 1.0 / density
        gram = self._gram @ inverse
        score = self._design @ inverse
        covariance = np.linalg.inv(gram)
        solution = covariance @ score
        log_det = np.linalg.slogdet(gram)[1]
        fit = float(score @ solution)
        total = -0.5 * float(self.dof @ np.log(density) + self._power @ inverse + log_det - fit)
        hidden = np.einsum("ij,ijb->b", covariance + np.outer(solution, solution), self._gram)
        explained = 2.0 * solution @ self._design
        slope = 0.5 * (self._power - explained + hidden) * inverse - 0.5 * self.dof
        return total, slope

    def remaining(self, density: Array) -> Array:
        """Power of each bin without what the regressors explain, over its degrees of freedom: a density (b,)."""
        inverse = 1.0 / density
        solution = np.linalg.solve(self._gram @ inverse, self._design @ inverse)
        explained = 2.0 * solution @ self._design - np.einsum("i,j,ijb->b", solution, solution, self._gram)
        return np.maximum(self._power - explained, 1e-12 * self._power) / self.dof

    def ramp(self, density: Array) -> tuple[float, float]:
        """The ramp and its standard deviation, unit of the rate per second."""
        inverse = 1.0 / density
        covariance = np.linalg.inv(self._gram @ inverse)
        slope = float((covariance @ (self._design @ inverse))[-1])
        return self._ramp_scale * slope, self._ramp_scale * math.sqrt(covariance[-1, -1])

    def price_of_ramp(self, density: Array) -> float:
        """What to add to the restricted likelihood to compare it with one that has no ramp."""
        gram = self._gram @ (1.0 / density)
        return 0.5 * float(np.linalg.slogdet(gram)[1] - np.linalg.slogdet(gram[:-1, :-1])[1])

    def residuals(self, density: Array) -> Array:
        """Excess of each bin over its expectation, in standard deviations."""
        _, slope = self.value(density)
        return slope * np.sqrt(2.0 / self.dof)
