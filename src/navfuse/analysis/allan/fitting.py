"""Fits of sums of noise terms to a spectrum: which terms, how large, and what to leave out where nothing fits.

All subsets of the terms are fitted by maximum likelihood; each term has to earn :data:`PRICE` of twice the
log-likelihood.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from navfuse.analysis.allan.likelihood import SINGLE, CosineSpectrum, Restricted
from navfuse.analysis.allan.terms import RANDOM_TERMS, Flicker, gauss_markov_density, random_density
from navfuse.errors import ConfigError

Array = np.ndarray

PRICE = 5.0
"""What a term has to add to twice the log-likelihood; by chance alone it does so in 1.3 % of the records."""

GM_PRICE = 14.0
"""The same of a Gauss-Markov process, which has two parameters and many correlation times to try."""

RAMP_PRICE = 12.0
"""The same of a ramp: 3.5 sigma, since at the lowest frequencies a few numbers decide, and a random walk does "
"as well."""

_SLACK = 0.5
"""What a fit may have missed the maximum of the log-likelihood by, when sets of terms are skipped for it."""

_WIDE = 16
_TUKEY = 4.685
_FIRST_ERROR = 0.3
_REWEIGHTINGS = 25
GOOD_ENOUGH = 0.2
"""Relative error of a model, in half of the bins, with which it may be called a description."""


@dataclass(slots=True, eq=False)
class Fit:
    """Logarithms of the squared coefficients, then of the correlation time, at the maximum of the likelihood."""

    names: tuple[str, ...]
    log: Array
    total: float
    density: Array
    slopes: Array
    """Derivatives of the log density by the parameters (p, b)."""


class Model:
    """Densities of the terms for one spectrum, and fits of sets of terms to it."""

    def __init__(self, spectrum: CosineSpectrum, noise: Flicker) -> None:
        self.spectrum, self.flicker = spectrum, noise
        f, dt, span = spectrum.frequency, spectrum.dt, spectrum.span
        self.shapes = {name: random_density(name, f, dt, span, noise) for name in RANDOM_TERMS}
        self.raw = np.maximum(spectrum.power / spectrum.dof, 1e-300)

    def log_densities(self, names: tuple[str, ...], log: Array) -> Array:
        """Logarithms of the densities of the terms (p, b); the correlation time of GM stands last in `log`."""
        rows = []
        for name, size in zip(names, log, strict=False):
            if name == "GM":
                tau = math.exp(log[-1])
                shape = gauss_markov_density(self.spectrum.frequency, self.spectrum.dt, self.spectrum.span, tau)
            else:
                shape = self.shapes[name]
            rows.append(size + np.log(shape))
        return np.array(rows)

    def density(self, names: tuple[str, ...], log: Array) -> tuple[Array, Array]:
        """Density (b,) and the derivatives of its logarithm by the parameters (p, b)."""
        parts = self.log_densities(names, log)
        top = parts.max(axis=0)
        whole = np.exp(parts - top).sum(axis=0)
        slopes = np.exp(parts - top) / whole
        density = np.exp(top) * whole
        if "GM" in names:
            step = 1e-4
            up, down = log.copy(), log.copy()
            up[-1] += step
            down[-1] -= step
            k = names.index("GM")
            change = (self.log_densities(names, up)[k] - self.log_densities(names, down)[k]) / (2.0 * step)
            slopes = np.vstack([slopes, slopes[k] * change])
        return density, slopes

    def start(self, name: str) -> float:
        """Where the term alone would stay below the spectrum: a tenth of its tangent, as logarithm of its square."""
        f = self.spectrum.frequency
        width = max(5, f.size // 40)
        smooth = np.convolve(self.raw, np.full(width, 1.0 / width), "valid")
        shape = np.convolve(self.shapes[name], np.full(width, 1.0 / width), "valid")
        return math.log(float(np.min(smooth / shape)))

    def fit(self, names: tuple[str, ...], likelihood: Restricted, begin: Array | None = None) -> Fit:
        """Maximise the likelihood over the logarithms by Fisher scoring with a Levenberg damping."""
        log = np.array([self.start(name) for name in names]) if begin is None else np.array(begin, dtype=float)
        least = np.array([self.start(name) - 30.0 if name in RANDOM_TERMS else -np.inf for name in names])
        most = np.full(least.size, np.inf)
        if "GM" in names:
            least = np.append(least, math.log(2.0 * self.spectrum.dt))
            most = np.append(most, math.log(self.spectrum.span))
        density, slopes = self.density(names, log)
        total, slope = likelihood.value(density)
        damping = 1e-3
        for _ in range(200):
            gradient = slopes @ slope
            information = 0.5 * (slopes * likelihood.dof) @ slopes.T
            step = np.linalg.solve(information + np.diag(damping * np.diag(information) + 1e-6), gradient)
            trial = np.clip(log + np.clip(step, -2.0, 2.0), least, most)
            new_density, new_slopes = self.density(names, trial)
            new_total, new_slope = likelihood.value(new_density)
            if new_total >= total:
                gain = new_total - total
                log, density, slopes, total, slope = trial, new_density, new_slopes, new_total, new_slope
                damping = max(1e-12, 0.1 * damping)
                if gain < 1e-9:
                    break
            elif damping > 1e6:
                break
            else:
                damping *= 10.0
        return Fit(names, log, total, density, slopes)


def _best_subset(model: Model, wanted: tuple[str, ...], likelihood: Restricted) -> Fit:
    """The set of terms with the largest likelihood less the price of each term."""
    best: Fit | None = None
    random = [name for name in RANDOM_TERMS if name in wanted]
    for size in range(1, len(random) + 1):
        for names in itertools.combinations(random, size):
            fit = model.fit(names, likelihood)
            if best is None or 2.0 * fit.total - PRICE * size > 2.0 * best.total - PRICE * len(best.names):
                best = fit
    if best is None:
        raise ConfigError("of the terms Q, N, B and K at least one must be looked for")
    if "GM" in wanted:
        best = _with_gauss_markov(model, best, random, likelihood)
    return best


def _with_gauss_markov(model: Model, best: Fit, random: list[str], likelihood: Restricted) -> Fit:
    """Try a Gauss-Markov process beside every set of terms, from several correlation times.

    No set is likelier than one that contains it: a set whose superset would not pay even at the lower price is skipped.
    """
    s = model.spectrum
    starts = np.geomspace(10.0 * s.dt, 0.3 * s.span, 6)
    worth = 2.0 * best.total - PRICE * len(best.names)
    chosen = best
    known: dict[frozenset[str], float] = {}
    for size in range(len(random), -1, -1):
        for others in itertools.combinations(random, size):
            bound = min((total for larger, total in known.items() if larger.issuperset(others)), default=math.inf)
            known[frozenset(others)] = bound
            if 2.0 * bound - PRICE * size - GM_PRICE <= worth:
                continue
            names = (*others, "GM")
            top: Fit | None = None
            for tau in starts:
                at = int(np.argmin(np.abs(s.frequency - 0.16 / tau)))
                level = float(np.median(model.raw[max(0, at - 5) : at + 6]))
                begin = np.array([*(model.start(n) for n in others), math.log(level / (2.0 * tau)), math.log(tau)])
                fit = model.fit(names, likelihood, begin)
                if top is None or fit.total > top.total:
                    top = fit
            if top is None:
                continue
            known[frozenset(others)] = top.total + _SLACK
            if 2.0 * top.total - PRICE * size - GM_PRICE > worth:
                chosen, worth = top, 2.0 * top.total - PRICE * size - GM_PRICE
    return chosen


def choose(model: Model, wanted: tuple[str, ...], weight: Array | None) -> tuple[Fit, Restricted, bool]:
    """The best set of terms, with a ramp if that is worth its price against every set without one."""
    plain = Restricted(model.spectrum, False, weight)
    best = _best_subset(model, wanted, plain)
    if "R" not in wanted:
        return best, plain, False
    inclined = Restricted(model.spectrum, True, weight)
    other = _best_subset(model, wanted, inclined)
    worth = 2.0 * (other.total + inclined.price_of_ramp(other.density)) - PRICE * len(other.log) - RAMP_PRICE
    if worth > 2.0 * best.total - PRICE * len(best.log):
        return other, inclined, True
    return best, plain, False


def chi_square(likelihood: Restricted, best: Fit) -> tuple[float, float]:
    """Sum of squared residuals of the bins, and what it should be."""
    residual = likelihood.residuals(best.density)
    return float(residual @ residual), float(residual.size - best.log.size)


def reduced(model: Model, wanted: tuple[str, ...], first: Fit) -> tuple[Model, Array, float, float, float]:
    """Leave out bins, and if that does not help the upper octaves, until a sum of terms describes the others.

    What a filter integrates is at the low end; vibration and filters of the sensor are at the upper one.
    """
    spectrum = model.spectrum
    tried = []
    highest = math.inf
    while True:
        part = model if math.isinf(highest) else Model(spectrum.below(highest), model.flicker)
        weight, misfit, left_out, edge = _robust_weights(part, wanted, first)
        tried.append((part, weight, misfit, left_out, min(highest, edge)))
        highest = 0.5 * (highest if math.isfinite(highest) else float(spectrum.frequency[-1]))
        if misfit <= GOOD_ENOUGH and left_out <= 0.5:
            return tried[-1]
        if spectrum.below(highest).dof.sum() < SINGLE:
            return min(tried, key=lambda one: one[2])


def _robust_weights(model: Model, wanted: tuple[str, ...], first: Fit) -> tuple[Array, float, float, float]:
    """Degrees of freedom to count each bin for where no sum of terms fits the whole spectrum.

    A relative error common to all bins is what half of the wide bins stay within; bins far beyond it (a line, the
    resonance of a mount, the edge of a filter) count for little or nothing (Tukey's biweight).

    Returns
    -------
    weight : (b,) array
    error : float
        Relative error of the model in a bin.
    left_out : float
        Share of the wide bins that count for less than half.
    edge : float [Hz]
        Above which all bins count for less than half; inf if the last one counts.
    """
    spectrum = model.spectrum
    names = tuple(name for name in RANDOM_TERMS if name in wanted)
    wide = spectrum.dof >= _WIDE
    if np.count_nonzero(wide) < 20:
        wide = np.ones_like(wide)
    share, error = np.ones_like(spectrum.dof), _FIRST_ERROR
    known = dict(zip(first.names, first.log, strict=False))
    begin = np.array([known.get(name, model.start(name) - 5.0) for name in names])
    weight = 1.0 / (1.0 / spectrum.dof + 0.5 * error**2)
    for _ in range(_REWEIGHTINGS):
        likelihood = Restricted(spectrum, False, np.maximum(weight * share, 1e-6))
        fit = model.fit(names, likelihood, begin)
        begin = fit.log
        residual = np.log(likelihood.remaining(fit.density) / fit.density)
        error = _common_error(residual[wide], spectrum.dof[wide])
        z = residual / (_TUKEY * np.sqrt(2.0 / spectrum.dof + error**2))
        share = np.where(wide, np.where(np.abs(z) < 1.0, (1.0 - np.minimum(z * z, 1.0)) ** 2, 0.0), 1.0)
        weight = 1.0 / (1.0 / spectrum.dof + 0.5 * error**2)
    last = int(np.flatnonzero(share >= 0.5)[-1]) if (share >= 0.5).any() else 0
    edge = math.inf if last == share.size - 1 else float(spectrum.frequency[last])
    return np.maximum(weight * share, 1e-6), error, float(np.mean(share[wide] < 0.5)), edge


def _common_error(residual: Array, counts: Array) -> float:
    """Relative error with which the median of the normalised residuals is that of a normal distribution."""
    low, high = 0.0, 3.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        typical = float(np.median(np.abs(residual) / np.sqrt(2.0 / counts + middle**2)))
        low, high = (middle, high) if typical > 0.6745 else (low, middle)
    return high
