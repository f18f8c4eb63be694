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
    whole = np.asarray(dct(np.asarray(values, dtype=np.float64) - np.mean(values), type=2, norm="ortho"))
    c = math.sqrt(dt) * whole[1:]
    k = np.arange(1, n)
    edge = _edges(n)
    half = 0.5 * math.pi * k / n
    end = math.sqrt(2.0 / n * dt) * np.cos(half)
    ramp = np.where(k % 2 == 1, -math.sqrt(2.0 / n * dt) * dt * np.cos(half) / (2.0 * np.sin(half) ** 2), 0.0)
    sign = np.where(k % 2 == 1, -1.0, 1.0)
    columns = (end, sign * end, ramp)
    dof = np.diff(np.append(edge, n - 1)).astype(float)
    design = np.array([np.add.reduceat(x * c, edge) for x in columns])
    gram = np.array([[np.add.reduceat(x * y, edge) for y in columns] for x in columns])
    centre = np.add.reduceat(np.log(k), edge) / dof
    return CosineSpectrum(np.exp(centre) / (2.0 * n * dt), dof, np.add.reduceat(c * c, edge), design, gram, dt, n * dt)


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
