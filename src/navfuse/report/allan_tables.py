"""Results of a static record as JSON, as columns and as rows for the terminal."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from navfuse.analysis.allan.identify import Identification
from navfuse.analysis.allan.recommend import BiasModel
from navfuse.analysis.allan.spectra import Autocorrelation
from navfuse.analysis.allan.study import AllanStudy, AxisStudy
from navfuse.analysis.allan.terms import FLOOR, NAMES, Term
from navfuse.report.allan_figures import ALLAN_KINDS, duration
from navfuse.report.allan_units import RATE_UNITS, TERM_UNITS, amount, significant, with_sigma

FLOOR_NOTE = (
    "B is the coefficient of IEEE Std 952; the flat part of the Allan deviation, which makers print, is 0.664 B"
)


def to_dict(study: AllanStudy, imu: dict[str, Any] | None = None) -> dict[str, Any]:
    """Every value with its interval; the key of each number ends in its unit.

    Parameters
    ----------
    study : AllanStudy
    imu : dict, optional
        Keys of ``[imu]`` as they are recommended, to be told with the rest.
    """
    return {
        "source": study.source,
        "holds": study.kind,
        "rate_hz": study.rate,
        "start_s": study.start,
        "span_s": study.span,
        "at_rest_s": [study.rest.begin / study.rate, study.rest.end / study.rate],
        "moving_share": study.rest.moving,
        "confidence": study.settings.level,
        "bias_instability": FLOOR_NOTE,
        "warnings": list(study.warnings),
        "bias_models": {
            sensor: bias_dict(model, sensor) for sensor, model in (("gyro", study.gyro), ("accel", study.accel))
        },
        **({} if imu is None else {"imu": imu}),
        "axes": {axis.name.replace(" ", "_"): axis_dict(axis) for axis in study.axes},
    }


def bias_dict(model: BiasModel | None, sensor: str) -> dict[str, Any] | None:
    """The recommended model of a bias, the axes of the sensor in their order; None where no bias is seen."""
    if model is None:
        return None
    _, unit, factor = RATE_UNITS[sensor]
    _, walk_unit, walk_factor = TERM_UNITS[sensor]["K"][0]
    walk = math.isinf(model.tau)
    return {
        "shape": "random walk" if walk else "Gauss-Markov process",
        f"sd_{unit}": [value / factor for value in model.sd],
        "tau_s": None if walk else model.tau,
        "relative_error": math.expm1(model.error),
        "fitted_s": list(model.span),
        "random_walk": {
            f"walk_{walk_unit}": [value / walk_factor for value in model.free_walk],
            "relative_error": math.expm1(model.free_error),
            "held_below_k": list(model.held),
        },
    }


def axis_dict(axis: AxisStudy) -> dict[str, Any]:
    """One axis."""
    _, unit, factor = RATE_UNITS[axis.sensor]
    found = axis.identification
    terms: dict[str, Any] = {}
    for term in found.terms:
        entry = term_dict(term, axis.sensor)
        if term.name == "sin" and term.present:
            terms.setdefault("sin", []).append(entry)
        else:
            terms[term.name] = entry
    return {
        f"mean_{unit}": axis.mean / factor,
        f"sd_{unit}": axis.sd / factor,
        f"resolution_{unit}": axis.check.step / factor if axis.check.step else None,
        "missing_samples": axis.missing,
        "saturated_samples": axis.check.saturated,
        "stuck_samples": axis.check.stuck,
        "used_for_imu": not axis.check.clipped,
        f"trend_{unit}": axis.check.trend / factor,
        "terms": terms,
        "fit": {
            "chi2": found.chi2,
            "degrees_of_freedom": found.dof,
            "relative_error_per_bin": found.misfit,
            "share_of_bins_left_out": found.left_out,
            "fitted_below_hz": found.highest,
            "span_s": found.span,
            "parameters": list(found.parameters),
            "correlation": found.correlation,
        },
        "deviations": {
            kind: {
                "tau_s": curve.tau,
                f"deviation_{unit}": curve.deviation / factor,
                f"low_{unit}": curve.low / factor,
                f"high_{unit}": curve.high / factor,
                "edf": curve.edf,
                "alpha": curve.alpha,
                "count": curve.count,
                **({f"model_{unit}": np.sqrt(found.allan_variance(curve.tau)) / factor} if kind in ALLAN_KINDS else {}),
            }
            for kind, curve in axis.curves.items()
        },
        "spectrum": {
            "frequency_hz": axis.spectrum.frequency,
            f"density_{unit}2_per_hz": axis.spectrum.density / factor**2,
            f"low_{unit}2_per_hz": axis.spectrum.low / factor**2,
            f"high_{unit}2_per_hz": axis.spectrum.high / factor**2,
        },
        "autocorrelation": _correlation(axis.autocorrelation, unit, factor),
    }


def _correlation(found: Autocorrelation, unit: str, factor: float) -> dict[str, Any]:
    return {
        "lag_s": found.lag,
        "correlation": found.correlation,
        f"variance_{unit}2": found.variance / factor**2,
        "averaged_over_s": found.average,
        "white_95_percent": found.bound,
    }


def term_dict(term: Term, sensor: str) -> dict[str, Any]:
    """One noise term in all its units; one that is absent with its limit, and the one-sided probability of that."""
    entry: dict[str, Any] = {"name": NAMES[sensor][term.name], "present": term.present}
    for _, key, factor in TERM_UNITS[sensor][term.name]:
        if term.present:
            entry[f"value_{key}"] = term.value / factor
            entry[f"sigma_{key}"] = term.sigma / factor
            if term.name == "B":
                entry[f"floor_{key}"] = FLOOR * term.value / factor
                entry[f"floor_sigma_{key}"] = FLOOR * term.sigma / factor
        elif math.isfinite(term.limit):
            entry[f"below_{key}"] = term.limit / factor
    if not term.present:
        entry["contradicted"] = term.contradicted
        if math.isfinite(term.limit):
            entry["below_probability"] = term.limit_level
    if term.present:
        if term.name == "GM":
            entry |= {"tau_s": term.extra, "tau_sigma_s": term.extra_sigma}
        if term.name == "sin":
            entry |= {"frequency_hz": term.extra, "frequency_sigma_hz": term.extra_sigma}
        entry |= {"gain_in_2_log_likelihood": term.gain, "least_record_s": term.least_span}
    return entry


def curve_columns(study: AllanStudy, kind: str) -> dict[str, Any]:
    """One deviation of all axes as columns of a table."""
    longest = max((axis.curves[kind].tau for axis in study.axes), key=len)
    columns: dict[str, Any] = {"tau_s": longest}
    for axis in study.axes:
        _, unit, factor = RATE_UNITS[axis.sensor]
        curve = axis.curves[kind]
        name = axis.name.replace(" ", "_")
        for part in ("deviation", "low", "high"):
            values = np.full(longest.size, np.nan)
            values[: curve.tau.size] = getattr(curve, part) / factor
            columns[f"{name}_{part}_{unit}"] = values
        edf = np.full(longest.size, np.nan)
        edf[: curve.tau.size] = curve.edf
        columns[f"{name}_edf"] = edf
    return columns


def term_rows(study: AllanStudy) -> list[tuple[str, str, str, str, str]]:
    """Rows of axis, term, value with sigma and unit, the same in another unit, remark."""
    rows = []
    for axis in study.axes:
        for term in axis.identification.terms:
            units = TERM_UNITS[axis.sensor][term.name]
            label = f"{term.name}  {NAMES[axis.sensor][term.name]}"
            if not term.present:
                name, _, factor = units[0]
                bound = ""
                if math.isfinite(term.limit):
                    bound = f"below {significant(term.limit / factor, 2)} {name} ({100.0 * term.limit_level:g} %)"
                rows.append((axis.name, label, "not seen", "", bound))
                continue
            shown = [f"{with_sigma(term.value / f, term.sigma / f)} {name}" for name, _, f in units]
            rows.append((axis.name, label, shown[0], shown[1] if len(shown) > 1 else "", _remark(term, axis.sensor)))
    return rows


def _remark(term: Term, sensor: str) -> str:
    name, _, factor = TERM_UNITS[sensor][term.name][0]
    if term.name == "B":
        return f"floor 0.664 B = {with_sigma(FLOOR * term.value / factor, FLOOR * term.sigma / factor)} {name}"
    if term.name == "GM":
        return f"tau {with_sigma(term.extra, term.extra_sigma)} s"
    if term.name == "sin":
        return f"at {with_sigma(term.extra, term.extra_sigma)} Hz"
    return ""


def axis_rows(study: AllanStudy) -> list[tuple[str, str, str, str, str]]:
    """Rows of axis, mean, standard deviation and resolution with their units, and how well the model fits."""
    return [
        (
            axis.name,
            amount(axis.mean, axis.sensor),
            amount(axis.sd, axis.sensor),
            amount(axis.check.step, axis.sensor, 3) if axis.check.step else "",
            _fit_words(axis.identification),
        )
        for axis in study.axes
    ]


def summary_lines(study: AllanStudy) -> list[str]:
    """What the record is, and how well the model fits each axis."""
    begin, end = study.rest.begin / study.rate, study.rest.end / study.rate
    lines = [
        f"{study.source}: {study.kind}, {study.rate:.6g} Hz, at rest from {begin:.6g} to {end:.6g} s "
        f"({duration(study.span)})"
    ]
    for name, mean, sd, step, fit in axis_rows(study):
        resolution = f", resolution {step}" if step else ""
        lines.append(f"{name}: mean {mean}, standard deviation {sd}{resolution}; the model {fit}")
    return lines


def notices(study: AllanStudy, source: str = "") -> list[str]:
    """The warnings of a study under another name of the record, or none where its name stands above them."""
    given = f"{study.source}: "
    shown = f"{source}: " if source else ""
    return [shown + text.removeprefix(given) for text in study.warnings]


def _fit_words(found: Identification) -> str:
    if not any(term.present for term in found.terms):
        return "finds no term that describes it"
    if found.misfit == 0.0 and found.left_out == 0.0:
        return f"fits (chi2 {found.chi2:.0f} for {found.dof:.0f})"
    below = "" if math.isinf(found.highest) else f" below {found.highest:.3g} Hz"
    return f"fits {100.0 * (1.0 - found.left_out):.0f} % of the spectrum{below} to {100.0 * found.misfit:.1f} %"
