"""Which noise terms a record shows, how large they are, and how sure that is.

The likelihood is that of :mod:`navfuse.analysis.allan.likelihood`: each point of the spectrum enters with exactly the
confidence it has, and no correlation between averaging times is left out, which is what a least-squares fit to an Allan
curve cannot give. All subsets of the terms are fitted; each term has to earn :data:`PRICE` of twice the log-likelihood.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from navfuse.analysis.allan.deviations import DeviationCurve, curve_of_phases, phase_stretches
from navfuse.analysis.allan.likelihood import SINGLE, CosineSpectrum, Restricted, cosine_spectrum
from navfuse.analysis.allan.terms import (
    FLOOR,
    RANDOM_TERMS,
    TERMS,
    Flicker,
    allan_variance,
    flicker,
    gauss_markov_density,
    random_density,
)
from navfuse.errors import ConfigError, InputError

Array = np.ndarray

PRICE = 5.0
"""What a term has to add to twice the log-likelihood; by chance alone it does so in 1.3 % of the records."""

GM_PRICE = 14.0
"""The same of a Gauss-Markov process, which has two parameters and many correlation times to try."""

RAMP_PRICE = 12.0
"""The same of a ramp: 3.5 sigma, since at the lowest frequencies a few numbers decide, and a random walk does as well."""

WANTED = 0.25
"""Relative one sigma that the stated least length of a record is for."""

SHORTEST = 1000
"""Samples; shorter records are refused."""

_WIDE = 16
_TUKEY = 4.685
_FIRST_ERROR = 0.3
_REWEIGHTINGS = 25
_GOOD_ENOUGH = 0.2
_CONTRADICTED = 0.998
_TOLERANCE = 1.5
CEILED = (*RANDOM_TERMS, "R")



@dataclass(frozen=True, slots=True)
class Term:
    """One noise term of one axis, in SI units.

    Attributes
    ----------
    name : str
        One of :data:`~navfuse.analysis.allan.terms.TERMS`.
    present : bool
    value, sigma : float
        Coefficient and its standard deviation; NaN if absent. Of a Gauss-Markov process its standard deviation.
    limit : float
        If absent: what the coefficient stays below with 95 % confidence. NaN if present.
    extra, extra_sigma : float
        Correlation time [s] of a Gauss-Markov process, frequency [Hz] of a sinusoid; NaN otherwise.
    least_span : float [s]
        Length of record at which one sigma is a quarter of the value: shorter records do not give this term.
    gain : float
        What the term adds to twice the log-likelihood; for a ramp the square of value over sigma.
    contradicted : bool
        The spectrum would have had the term, but the measured Allan deviation falls below it, so that it is absent: the
        record holds something that no term describes. `limit` is then what the deviation allows (99.9 %).
    """

    name: str
    present: bool
    value: float = math.nan
    sigma: float = math.nan
    limit: float = math.nan
    extra: float = math.nan
    extra_sigma: float = math.nan
    least_span: float = math.nan
    gain: float = math.nan
    contradicted: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """Noise terms of one axis and how well they describe the record.

    Attributes
    ----------
    terms : tuple of Term
        Every term that was asked for, in the order of :data:`~navfuse.analysis.allan.terms.TERMS`.
    spectrum : CosineSpectrum
    density : (b,) array
        Fitted density at the frequencies of the spectrum.
    chi2, dof : float
        Sum of squared residuals of the bins, and what it should be.
    misfit : float
        Relative error of the model in each bin that explains what half of them are off by; 0 for a model that fits.
        The standard deviations include it.
    left_out : float
        Share of the bins that no term explains and that hardly count: lines, resonances, the edge of a filter.
    highest : float [Hz]
        Above it nothing is fitted, since no term explains it; inf for a fit to everything.
    correlation : (p, p) array
        Correlation of the logarithms of the coefficients, in the order of `parameters`.
    parameters : tuple of str
    flicker : Flicker
    span : float [s]
        Length of the stretch that was used.
    """

    terms: tuple[Term, ...]
    spectrum: CosineSpectrum
    density: Array
    chi2: float
    dof: float
    misfit: float
    left_out: float
    highest: float
    correlation: Array
    parameters: tuple[str, ...]
    flicker: Flicker
    span: float

    def term(self, name: str) -> Term:
        """The first term of this name."""
        return next(term for term in self.terms if term.name == name)

    def allan_variance(self, tau: Array, name: str | None = None) -> Array:
        """Allan variance of the fitted model, or of one of its terms (NaN if absent)."""
        parts = [term for term in self.terms if term.present and name in (None, term.name)]
        if not parts:
            return np.full(np.shape(tau), np.nan)
        total = np.zeros(np.shape(tau))
        for term in parts:
            values = {term.name: term.value, "GM_tau": term.extra, "sin_hz": term.extra}
            total += allan_variance(term.name, tau, values, self.flicker)
        return total


@dataclass(slots=True, eq=False)
class _Fit:
    """Logarithms of the squared coefficients, then of the correlation time, at the maximum of the likelihood."""

    names: tuple[str, ...]
    log: Array
    total: float
    density: Array
    slopes: Array
    """Derivatives of the log density by the parameters (p, b)."""


def identify(
    values: Array,
    rate: float,
    *,
    terms: tuple[str, ...] = ("Q", "N", "B", "K", "R"),
    flicker_band: tuple[float, float] = (0.1, 1e4),
) -> Identification:
    """Noise terms of a record of rates without gaps.

    Parameters
    ----------
    values : (n,) array
        Rates; for increments divide by the sampling interval.
    rate : float [Hz]
    terms : tuple of str
        Terms to look for, of :data:`~navfuse.analysis.allan.terms.TERMS`.
    flicker_band : (float, float) [s]
        Correlation times between which bias instability is flat.

    Returns
    -------
    Identification

    Raises
    ------
    InputError
        For a record of fewer than 1000 samples, with values that are not finite, or a constant one.
    ConfigError
        For an unknown term, none at all, or a band that is not at least a decade.
    """
    unknown = [name for name in terms if name not in TERMS]
    if unknown or not terms:
        raise ConfigError(f"noise terms {', '.join(unknown) or '(none)'}: known are {', '.join(TERMS)}")
    if not (0.0 < flicker_band[0] and 10.0 * flicker_band[0] <= flicker_band[1] < math.inf):
        raise ConfigError(
            f"flicker_band = {flicker_band} must be two correlation times in seconds, a decade or more apart"
        )
    values = np.asarray(values, dtype=np.float64)
    if values.ndim != 1 or values.size < SHORTEST:
        raise InputError(
            f"a record of {values.size} samples is too short to identify noise: at least {SHORTEST} are needed"
        )
    if not np.isfinite(values).all():
        raise InputError("the record has values that are not finite; identify one stretch between gaps at a time")
    if np.ptp(values) == 0.0:
        raise InputError("the record is constant: a channel without any noise is not connected, or stuck")
    dt = 1.0 / rate
    lines: list[Term] = []
    if "sin" in terms:
        from navfuse.analysis.allan.lines import take_lines_out

        values, lines = take_lines_out(values, rate)
    spectrum = cosine_spectrum(values, dt)
    model = _Model(spectrum, flicker(spectrum.span, *flicker_band))
    curve = curve_of_phases(phase_stretches(values, rate), rate, "oadev", grid=10, level=_CONTRADICTED)
    refused: set[str] = set()
    while True:
        found = _select(model, tuple(name for name in terms if name not in refused), lines)
        above = _contradicted(found, curve)
        refused |= above
        if not any(name in RANDOM_TERMS and name not in refused for name in terms):
            found = _nothing(found)
            above = set()
        if not above:
            return _with_ceilings(found, terms, refused, curve)


def _ceiling(name: str, found: Identification, curve: DeviationCurve) -> float:
    """Largest coefficient whose Allan deviation stays below the measured one, where the model is meant to hold.

    The smallest median of five neighbouring averaging times: single ones dip where a line has whole periods in them.
    """
    from scipy.ndimage import median_filter

    inside = curve.tau >= 0.5 / found.highest
    unit = np.sqrt(allan_variance(name, curve.tau, {name: 1.0}, found.flicker))
    ratio = (curve.high / unit)[inside]
    return float(np.min(median_filter(ratio, 5, mode="nearest"))) if ratio.size else math.inf


def _contradicted(found: Identification, curve: DeviationCurve) -> set[str]:
    """Terms that alone exceed the measured deviation by more than chance allows: it must hold each of them."""
    present = (term for term in found.terms if term.present and term.name in CEILED)
    return {term.name for term in present if abs(term.value) > _TOLERANCE * _ceiling(term.name, found, curve)}


def _with_ceilings(
    found: Identification, wanted: tuple[str, ...], refused: set[str], curve: DeviationCurve
) -> Identification:
    """Put back the terms that the Allan deviation contradicts, as absent, and lower limits that it does not allow."""
    terms = {term.name: term for term in found.terms if term.name != "sin"}
    for name in wanted:
        if name in CEILED and not (name in terms and terms[name].present):
            limits = [_ceiling(name, found, curve)]
            if name in terms and math.isfinite(terms[name].limit):
                limits.append(terms[name].limit)
            terms[name] = Term(name, False, limit=min(limits), contradicted=name in refused)
    lines = [term for term in found.terms if term.name == "sin"]
    return replace(found, terms=(*(terms[name] for name in TERMS if name in terms), *lines))


def _nothing(found: Identification) -> Identification:
    """No term at all describes the record."""
    terms = tuple(term for term in found.terms if not term.present)
    nothing = np.full_like(found.density, np.nan)
    return replace(found, terms=terms, density=nothing, parameters=(), correlation=np.empty((0, 0)))


class _Model:
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

    def fit(self, names: tuple[str, ...], likelihood: Restricted, begin: Array | None = None) -> _Fit:
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
        return _Fit(names, log, total, density, slopes)


def _best_subset(model: _Model, wanted: tuple[str, ...], likelihood: Restricted) -> _Fit:
    """The set of terms with the largest likelihood less the price of each term."""
    best: _Fit | None = None
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


def _with_gauss_markov(model: _Model, best: _Fit, random: list[str], likelihood: Restricted) -> _Fit:
    """Try a Gauss-Markov process beside every set of terms, from several correlation times."""
    s = model.spectrum
    starts = np.geomspace(10.0 * s.dt, 0.3 * s.span, 6)
    worth = 2.0 * best.total - PRICE * len(best.names)
    chosen = best
    for size in range(0, len(random) + 1):
        for others in itertools.combinations(random, size):
            names = (*others, "GM")
            top: _Fit | None = None
            for tau in starts:
                at = int(np.argmin(np.abs(s.frequency - 0.16 / tau)))
                level = float(np.median(model.raw[max(0, at - 5) : at + 6]))
                begin = np.array([*(model.start(n) for n in others), math.log(level / (2.0 * tau)), math.log(tau)])
                fit = model.fit(names, likelihood, begin)
                if top is None or fit.total > top.total:
                    top = fit
            if top is not None and 2.0 * top.total - PRICE * size - GM_PRICE > worth:
                chosen, worth = top, 2.0 * top.total - PRICE * size - GM_PRICE
    return chosen


def _select(model: _Model, wanted: tuple[str, ...], lines: list[Term]) -> Identification:
    spectrum, whole = model.spectrum, model
    best, likelihood, ramp = _choose(model, wanted, None)
    chi2, dof = _chi_square(Restricted(spectrum, ramp), best)
    misfit, left_out, highest = 0.0, 0.0, math.inf
    if chi2 > dof + 4.0 * math.sqrt(2.0 * dof + float(np.sum(12.0 / spectrum.dof))):
        model, weight, misfit, left_out, highest = _reduced(model, wanted)
        best, likelihood, ramp = _choose(model, wanted, weight)
    information = 0.5 * (best.slopes * likelihood.dof) @ best.slopes.T
    covariance = np.linalg.pinv(information)
    sigma = np.sqrt(np.diag(covariance))
    found = {}
    for k, name in enumerate(best.names):
        value = math.exp(0.5 * best.log[k])
        relative = float(0.5 * sigma[k])
        extra = math.exp(best.log[-1]) if name == "GM" else math.nan
        found[name] = Term(
            name,
            True,
            value,
            relative * value,
            extra=extra,
            extra_sigma=extra * float(sigma[-1]) if name == "GM" else math.nan,
            least_span=spectrum.span * (relative / WANTED) ** 2,
            gain=_gain(model, best, name, likelihood),
        )
    if "R" in wanted:
        slope, slope_sigma = Restricted(model.spectrum, True, likelihood.weight).ramp(best.density)
        if ramp:
            relative = slope_sigma / abs(slope)
            least = spectrum.span * (relative / WANTED) ** 0.5
            found["R"] = Term("R", True, slope, slope_sigma, gain=relative**-2, least_span=least)
        else:
            found["R"] = Term("R", False, limit=abs(slope) + 1.645 * slope_sigma)
    for name in wanted:
        if name not in found and name != "sin":
            limit = _limit(model, best, name, likelihood) if name in RANDOM_TERMS else math.nan
            found[name] = Term(name, False, limit=limit)
    ordered = [found[name] for name in TERMS if name in found]
    ordered += lines if lines else ([Term("sin", False)] if "sin" in wanted else [])
    names = best.names + (("GM_tau",) if "GM" in best.names else ())
    return Identification(
        tuple(ordered),
        spectrum,
        whole.density(best.names, best.log)[0],
        chi2,
        dof,
        misfit,
        left_out,
        highest,
        covariance / np.outer(sigma, sigma),
        names,
        model.flicker,
        spectrum.span,
    )


def _choose(model: _Model, wanted: tuple[str, ...], weight: Array | None) -> tuple[_Fit, Restricted, bool]:
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


def _chi_square(likelihood: Restricted, best: _Fit) -> tuple[float, float]:
    residual = likelihood.residuals(best.density)
    return float(residual @ residual), float(residual.size - best.log.size)


def _reduced(model: _Model, wanted: tuple[str, ...]) -> tuple[_Model, Array, float, float, float]:
    """Leave out bins, and if that does not help the upper octaves, until a sum of terms describes the others.

    What a filter integrates is at the low end; vibration and filters of the sensor are at the upper one.
    """
    spectrum = model.spectrum
    tried = []
    highest = math.inf
    while True:
        part = model if math.isinf(highest) else _Model(spectrum.below(highest), model.flicker)
        weight, misfit, left_out = _robust_weights(part, wanted)
        tried.append((part, weight, misfit, left_out, highest))
        highest = 0.5 * (highest if math.isfinite(highest) else float(spectrum.frequency[-1]))
        if misfit <= _GOOD_ENOUGH and left_out <= 0.5:
            return tried[-1]
        if spectrum.below(highest).dof.sum() < SINGLE:
            return min(tried, key=lambda one: one[2])


def _robust_weights(model: _Model, wanted: tuple[str, ...]) -> tuple[Array, float, float]:
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
    """
    spectrum = model.spectrum
    names = tuple(name for name in RANDOM_TERMS if name in wanted)
    wide = spectrum.dof >= _WIDE
    if np.count_nonzero(wide) < 20:
        wide = np.ones_like(wide)
    share, error, begin = np.ones_like(spectrum.dof), _FIRST_ERROR, None
    weight = 1.0 / (1.0 / spectrum.dof + 0.5 * error**2)
    for _ in range(_REWEIGHTINGS):
        fit = model.fit(names, Restricted(spectrum, False, np.maximum(weight * share, 1e-6)), begin)
        begin = fit.log
        residual = np.log(spectrum.power / spectrum.dof / fit.density)
        error = _common_error(residual[wide], spectrum.dof[wide])
        z = residual / (_TUKEY * np.sqrt(2.0 / spectrum.dof + error**2))
        share = np.where(wide, np.where(np.abs(z) < 1.0, (1.0 - np.minimum(z * z, 1.0)) ** 2, 0.0), 1.0)
        weight = 1.0 / (1.0 / spectrum.dof + 0.5 * error**2)
    return np.maximum(weight * share, 1e-6), error, float(np.mean(share[wide] < 0.5))


def _common_error(residual: Array, counts: Array) -> float:
    """Relative error with which the median of the normalised residuals is that of a normal distribution."""
    low, high = 0.0, 3.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        typical = float(np.median(np.abs(residual) / np.sqrt(2.0 / counts + middle**2)))
        low, high = (middle, high) if typical > 0.6745 else (low, middle)
    return high


def _gain(model: _Model, best: _Fit, name: str, likelihood: Restricted) -> float:
    others = tuple(other for other in best.names if other != name)
    if not others:
        return math.inf
    keep = [k for k, other in enumerate(best.names) if other != name]
    begin = best.log[keep]
    if "GM" in others:
        begin = np.append(begin, best.log[-1])
    return 2.0 * (best.total - model.fit(others, likelihood, begin).total)


def _limit(model: _Model, best: _Fit, name: str, likelihood: Restricted) -> float:
    """Largest coefficient that twice the log-likelihood misses the best by 2.71 for: a one-sided limit of 95 %."""
    from scipy.optimize import brentq

    base = model.shapes[name]

    def excess(log: float) -> float:
        density = best.density + math.exp(log) * base
        return 2.0 * (best.total - likelihood.value(density)[0]) - 2.71

    low = model.start(name) - 20.0
    high = model.start(name) + 12.0
    if excess(low) > 0.0 or excess(high) < 0.0:
        return math.nan
    return math.exp(0.5 * brentq(excess, low, high, xtol=1e-3))


def floor_of(coefficient: float) -> float:
    """Allan deviation of flicker noise of coefficient B, what most makers print as bias instability: 0.664 B."""
    return FLOOR * coefficient
