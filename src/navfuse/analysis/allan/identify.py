"""Which noise terms a record shows, how large they are, and how sure that is.

The likelihood is that of :mod:`navfuse.analysis.allan.likelihood`: each point of the spectrum enters with exactly the
confidence it has, and no correlation between averaging times is left out, which is what a least-squares fit to an Allan
curve cannot give. A term is reported if it earns its price, and if the measured Allan deviation
is not so far below the model, where this term makes most of it, that hardly any record of that model would be.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from navfuse.analysis.allan.agreement import probability_below, too_large_at
from navfuse.analysis.allan.deviations import DeviationCurve, curve_of_phases, phase_stretches
from navfuse.analysis.allan.fitting import GOOD_ENOUGH, Fit, Model, chi_square, choose, reduced
from navfuse.analysis.allan.gaps import MOST, SHORT, bridge_long, bridge_short, runs, simulator, usable
from navfuse.analysis.allan.likelihood import CosineSpectrum, Restricted, cosine_spectrum
from navfuse.analysis.allan.terms import RANDOM_TERMS, TERMS, Flicker, Term, allan_variance, flicker
from navfuse.errors import ConfigError, InputError

Array = np.ndarray

WANTED = 0.25
"""Relative one sigma that the stated least length of a record is for."""

SHORTEST = 1000
"""Samples; shorter records are refused."""

_CEILING = 0.998
_CEILING_LEVEL = 0.5 * (1.0 + _CEILING)
_LIKELIHOOD_LEVEL = 0.95
_ROUNDS = 2
CEILED = (*RANDOM_TERMS, "R")


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
        Length of the part that was used.
    begin : int
        Its first sample.
    filled : int
        Samples in it that are missing and were bridged.
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
    begin: int = 0
    filled: int = 0

    def coefficients(self) -> dict[str, float]:
        """Values of the random terms that are present, and "GM_tau"."""
        found = {term.name: term.value for term in self.terms if term.present and term.name in (*RANDOM_TERMS, "GM")}
        return found | ({"GM_tau": self.term("GM").extra} if "GM" in found else {})

    def term(self, name: str) -> Term:
        """The first term of this name."""
        return next(term for term in self.terms if term.name == name)

    def too_short(self, term: Term) -> bool:
        """Whether the record is shorter than a term needs to be known to a quarter of its value."""
        return term.present and term.least_span > self.span

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

    def relative_error(self, tau: Array) -> Array:
        """Relative one sigma of the Allan variance of the fitted model, from the standard deviations of its terms."""
        total = self.allan_variance(tau)
        slopes, order = np.zeros((len(self.parameters), np.size(tau))), list(self.parameters)
        for name in (name for name in order if name != "GM_tau"):
            term = self.term(name)
            slopes[order.index(name)] = 2.0 * term.sigma / term.value * self.allan_variance(tau, name) / total
        square = np.einsum("it,ij,jt->t", slopes, self.correlation, slopes)
        ramp = [term for term in self.terms if term.name == "R" and term.present]
        for term in ramp:
            square += (2.0 * term.sigma / term.value * self.allan_variance(tau, "R") / total) ** 2
        return np.sqrt(square)


def identify(
    values: Array,
    rate: float,
    *,
    terms: tuple[str, ...] = ("Q", "N", "B", "K", "R"),
    flicker_band: tuple[float, float] = (0.1, 1e4),
) -> Identification:
    """Noise terms of a record of rates.

    Parameters
    ----------
    values : (n,) array
        Rates; for increments divide by the sampling interval. NaN where samples are missing: gaps are bridged where
        they are short and few, see :func:`~navfuse.analysis.allan.gaps.usable`.
    rate : float [Hz]
    terms : tuple of str
        Terms to look for, of :data:`~navfuse.analysis.allan.terms.TERMS`.
    flicker_band : (float, float) [s]
        Correlation times between which bias instability is flat.

    Returns
    -------
    Identification
        Of the part of the record that could be used.

    Raises
    ------
    InputError
        For a record that is infinite somewhere, constant, or of which fewer than 1000 samples can be used.
    ConfigError
        For an unknown term, none at all, or a band that is not at least a decade.
    """
    return identify_and_bridge(values, rate, terms, flicker_band)[0]


def identify_and_bridge(
    values: Array, rate: float, terms: tuple[str, ...], flicker_band: tuple[float, float]
) -> tuple[Identification, Array]:
    """As :func:`identify`, also the part of the record that was used, without gaps."""
    unknown = [name for name in terms if name not in TERMS]
    if unknown or not terms:
        raise ConfigError(f"noise terms {', '.join(unknown) or '(none)'}: known are {', '.join(TERMS)}")
    if not (0.0 < flicker_band[0] and 10.0 * flicker_band[0] <= flicker_band[1] < math.inf):
        raise ConfigError(
            f"flicker_band = {flicker_band} must be two correlation times in seconds, a decade or more apart"
        )
    values = np.asarray(values, dtype=np.float64)
    if values.ndim != 1:
        raise InputError(f"a record of shape {values.shape}: identify one axis at a time")
    if np.isinf(values).any():
        raise InputError("the record has values that are infinite")
    part = usable(values)
    if part.stop - part.start < SHORTEST:
        raise InputError(_too_few(values, part.stop - part.start))
    values = values[part]
    missing = np.isnan(values)
    if np.nanmin(values) == np.nanmax(values):
        raise InputError("the record is constant: a channel without any noise is not connected, or stuck")
    share = float(np.mean(missing))
    if share == 0.0:
        return replace(_identified(values, rate, terms, flicker_band, 0.0), begin=part.start), values
    long = [(a, b) for a, b in runs(missing) if b - a > SHORT]
    values = values.copy()
    bridge_short(values)
    if long:
        clean = max(zip([0, *(b for _, b in long)], [*(a for a, _ in long), values.size], strict=True), key=_length)
        found = _identified(values[slice(*clean)], rate, terms, flicker_band, 0.0)
        for _ in range(_ROUNDS):
            bridge_long(values, long, _quietest(found), simulator(found.coefficients(), found.flicker, 1.0 / rate))
            found = _identified(values, rate, terms, flicker_band, share)
    else:
        found = _identified(values, rate, terms, flicker_band, share)
    return replace(found, begin=part.start, filled=int(np.count_nonzero(missing))), values


def _too_few(values: Array, size: int) -> str:
    gone = int(np.count_nonzero(np.isnan(values)))
    if values.size - gone < SHORTEST:
        return f"{values.size - gone} samples are too short a record to identify noise: at least {SHORTEST} are needed"
    return (
        f"{100.0 * gone / values.size:.3g} % of the samples are missing, so that no part of {SHORTEST} samples is left "
        f"to identify noise in with at most {100.0 * MOST:g} % missing (the longest has {size}); record anew, or cut "
        "out a part with --from-s and --until-s; deviations alone need no such part: navfuse.analysis.allan.deviation"
    )


def _quietest(found: Identification) -> int:
    """Averaging time, in samples, at which the Allan deviation of the model is lowest."""
    factor = 2 ** np.arange(int(math.log2(found.span / found.spectrum.dt)))
    return int(factor[np.argmin(np.nan_to_num(found.allan_variance(factor * found.spectrum.dt)))])


def _length(bounds: tuple[int, int]) -> int:
    return bounds[1] - bounds[0]


def _identified(
    values: Array, rate: float, terms: tuple[str, ...], flicker_band: tuple[float, float], share: float
) -> Identification:
    """Of a record without gaps, of which a share was filled."""
    dt = 1.0 / rate
    lines: list[Term] = []
    if "sin" in terms:
        from navfuse.analysis.allan.lines import take_lines_out

        values, lines = take_lines_out(values, rate)
    spectrum = cosine_spectrum(values, dt)
    model = Model(spectrum, flicker(spectrum.span, *flicker_band))
    curve = curve_of_phases(phase_stretches(values, rate), rate, "oadev", grid=10, level=_CEILING)
    refused: set[str] = set()
    while True:
        found = _select(model, tuple(name for name in terms if name not in refused), lines, share)
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

    inside = curve.tau >= 1.0 / found.highest
    unit = np.sqrt(allan_variance(name, curve.tau, {name: 1.0}, found.flicker))
    ratio = (curve.high / unit)[inside]
    return float(np.min(median_filter(ratio, 5, mode="nearest"))) if ratio.size else math.inf


def _contradicted(found: Identification, curve: DeviationCurve) -> set[str]:
    """The term that makes most of the model where the measured deviation is improbably far below it.

    A ramp is no part of the random model, but of the deviation: with one the measured curve is the higher.
    """
    random = [term.name for term in found.terms if term.present and term.name in (*RANDOM_TERMS, "GM")]
    parts = np.array([found.allan_variance(curve.tau, name) for name in random])
    below = probability_below(curve, parts.sum(axis=0), found.misfit)
    at = too_large_at(curve, below, 1.0 / found.highest)
    return set() if at is None else {random[int(np.argmax(parts[:, at]))]}


def _with_ceilings(
    found: Identification, wanted: tuple[str, ...], refused: set[str], curve: DeviationCurve
) -> Identification:
    """Put back the terms that the Allan deviation contradicts, as absent, and lower limits that it does not allow."""
    terms = {term.name: term for term in found.terms if term.name != "sin"}
    for name in wanted:
        if name in CEILED and not (name in terms and terms[name].present):
            limit, level = _ceiling(name, found, curve), _CEILING_LEVEL
            if name in terms and terms[name].limit <= limit:
                limit, level = terms[name].limit, terms[name].limit_level
            terms[name] = Term(name, False, limit=limit, limit_level=level, contradicted=name in refused)
    lines = [term for term in found.terms if term.name == "sin"]
    return replace(found, terms=(*(terms[name] for name in TERMS if name in terms), *lines))


def _nothing(found: Identification) -> Identification:
    """No term at all describes the record."""
    terms = tuple(term for term in found.terms if not term.present)
    nothing = np.full_like(found.density, np.nan)
    return replace(found, terms=terms, density=nothing, parameters=(), correlation=np.empty((0, 0)))


def _select(model: Model, wanted: tuple[str, ...], lines: list[Term], share: float) -> Identification:
    spectrum, whole = model.spectrum, model
    best, likelihood, ramp = choose(model, wanted, None)
    chi2, dof = chi_square(Restricted(spectrum, ramp), best)
    misfit, left_out, highest = 0.0, 0.0, math.inf
    if chi2 > dof + 6.0 * math.sqrt(2.0 * dof + float(np.sum(12.0 / spectrum.dof))):
        model, weight, misfit, left_out, highest = reduced(model, wanted, best)
        best, likelihood, ramp = choose(model, wanted, weight)
    information = 0.5 * (best.slopes * likelihood.dof) @ best.slopes.T
    covariance = np.linalg.pinv(information) / (1.0 - share)
    covariance += _common(misfit)
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
            least_span=math.inf if 0.25 * _common(misfit) > WANTED**2 else spectrum.span * (relative / WANTED) ** 2,
            gain=_gain(model, best, name, likelihood),
        )
    if "R" in wanted:
        slope, slope_sigma = Restricted(model.spectrum, True, likelihood.weight).ramp(best.density)
        if ramp:
            relative = slope_sigma / abs(slope)
            least = spectrum.span * (relative / WANTED) ** 0.5
            found["R"] = Term("R", True, slope, slope_sigma, gain=relative**-2, least_span=least)
        else:
            found["R"] = Term("R", False, limit=abs(slope) + 1.645 * slope_sigma, limit_level=_LIKELIHOOD_LEVEL)
    for name in wanted:
        if name not in found and name != "sin":
            limit = _limit(model, best, name, likelihood) if name in RANDOM_TERMS else math.nan
            level = math.nan if math.isnan(limit) else _LIKELIHOOD_LEVEL
            found[name] = Term(name, False, limit=limit, limit_level=level)
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


def _common(misfit: float) -> float:
    """Variance of the logarithm of a density that is added to every term where the model is too wrong to average over.

    Up to a fifth the errors of the bins are taken for independent; beyond it they may all be the same.
    """
    return misfit**2 if misfit > GOOD_ENOUGH else 0.0


def _gain(model: Model, best: Fit, name: str, likelihood: Restricted) -> float:
    others = tuple(other for other in best.names if other != name)
    if not others:
        return math.inf
    keep = [k for k, other in enumerate(best.names) if other != name]
    begin = best.log[keep]
    if "GM" in others:
        begin = np.append(begin, best.log[-1])
    return 2.0 * (best.total - model.fit(others, likelihood, begin).total)


def _limit(model: Model, best: Fit, name: str, likelihood: Restricted) -> float:
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
    return math.exp(0.5 * float(brentq(excess, low, high, xtol=1e-3)))  # type: ignore[arg-type]
