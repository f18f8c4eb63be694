"""Can the stated standard deviations of positions be true?"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from navfuse.data.logs import GnssLog
from navfuse.inspection.findings import Finding, Verdict
from navfuse.inspection.motion_checks import metres
from navfuse.io.gnss_rows import DEFAULT_SD_POSITION

Array = np.ndarray

WINDOW = 8
FEWEST_WINDOWS = 4
TOO_LARGE, FAR_TOO_LARGE, TOO_SMALL = 40.0, 150.0, 1.0 / 8.0
COARSE_M = 20.0
"""Stated standard deviation over scatter from row to row, beyond which it is told. Receivers smooth: their errors are
much alike from row to row, so that a ratio above TOO_LARGE counts only with more than COARSE_M stated.
"""
IDEAL_M = 1e-4
ROOT_FITS = 5.0
"""Factor within which another reading of the stated values, or another kind of fix, explains them."""
BY_KIND = 20.0
"""Stated standard deviation against what is usual for the kind of fix."""


def check_sigmas(log: GnssLog, stated: Array | None, names: tuple[str, ...]) -> list[Finding]:
    """Stated standard deviations against the scatter of the fixes about a smooth local path.

    Parameters
    ----------
    log : GnssLog
    stated : (n, 3) array [m] or None
        As the file has them: may hold NaN and what is not positive.
    names : tuple of 3 str
        Their columns.
    """
    if stated is None or not np.isfinite(stated).any():
        return [
            Finding(
                "position sigmas",
                Verdict.LOOK,
                "the file states no standard deviations of the positions; cautious defaults are used",
                "add them, or set gnss.sd_position_m to what the receiver reaches",
            )
        ]
    flawed = int(np.count_nonzero((stated <= 0.0).any(axis=1)))
    if flawed:
        return [
            Finding(
                "position sigmas",
                Verdict.WRONG,
                f"{flawed} of {stated.shape[0]} rows state a standard deviation that is zero or negative, which would "
                "be a perfect measurement",
                f"give the true ones, or remove {', '.join(names)} to get defaults",
                figures={"rows": float(flawed)},
            )
        ]
    kind, rows = _usual_kind(log)
    sd = float(np.nanmedian(np.hypot(stated[rows, 0], stated[rows, 1])) / np.sqrt(2.0))
    scatter = local_scatter(log)
    figures = {"stated_m": sd}
    said = f"stated {sd:.3g} m (median, per horizontal axis)"
    if kind:
        usual = DEFAULT_SD_POSITION[kind][0]
        if not usual / BY_KIND <= sd <= usual * BY_KIND:
            size = "large" if sd > usual else "small"
            text = f"{said} for fixes called {kind}, which reach {usual:g} m as a rule"
            if _are_variances(sd, usual, scatter):
                return [_variances(text, sd, usual, figures)]
            better = _fitting_kind(sd, scatter)
            if better:
                return [
                    Finding(
                        "position sigmas",
                        Verdict.LOOK,
                        f"{text}; they scatter by {scatter:.3g} m, as {better} ones with such sigmas do",
                        f"correct the fix label, if these are {better}; otherwise the sigmas",
                        figures=dict(figures) | {"scatter_m": scatter or 0.0},
                    )
                ]
            return [_sigma_finding(text, size, sd / usual, figures)]
    if scatter is None:
        message = f"{said}; too few fixes in a row to see their scatter"
        return [Finding("position sigmas", Verdict.UNKNOWN, message, figures=figures)]
    if scatter < IDEAL_M:
        message = f"{said}; the fixes do not scatter at all, as simulated ones without noise do"
        return [Finding("position sigmas", Verdict.UNKNOWN, message, figures=figures)]
    ratio = sd / scatter
    figures |= {"scatter_m": scatter, "ratio": ratio}
    text = f"{said}; from row to row the fixes scatter by {scatter:.3g} m about a smooth path where it is calmest"
    if not kind and (ratio > FAR_TOO_LARGE or (ratio > TOO_LARGE and sd > COARSE_M)):
        return [_sigma_finding(text, "large", ratio, figures)]
    if ratio < TOO_SMALL and scatter > 0.005:
        if not kind and _are_variances(sd, scatter, scatter):
            return [_variances(text, sd, scatter, figures)]
        return [_sigma_finding(text, "small", ratio, figures)]
    return [Finding("position sigmas", Verdict.OK, text, figures=figures)]


def _are_variances(sd: float, usual: float, scatter: float | None) -> bool:
    """Whether the root of what is stated fits, and no power of ten that a unit would make fits clearly better."""
    root = np.sqrt(sd)

    def misfit(value: float) -> float:
        return abs(np.log(value / usual))

    by_unit = min(misfit(sd * factor) for factor in (1.0, 1e-3, 1e-2, 1e2, 1e3))
    near = misfit(root) < np.log(ROOT_FITS) and misfit(root) < by_unit + np.log(2.0)
    return bool(near and (scatter is None or scatter < IDEAL_M or root > TOO_SMALL * scatter))


def _variances(text: str, sd: float, usual: float, figures: Mapping[str, float]) -> Finding:
    times = max(sd / usual, usual / sd)
    return Finding(
        "position sigmas",
        Verdict.LOOK,
        f"{text}: they look too {'large' if sd > usual else 'small'}, about {times:.2g} times, as variances in m^2 "
        f"do, whose roots are {np.sqrt(sd):.2g} m",
        "write the square roots of these columns; or correct their unit, if they are no variances",
        figures=dict(figures) | {"root_m": float(np.sqrt(sd))},
    )


def _fitting_kind(sd: float, scatter: float | None) -> str:
    """The kind of fix that goes with the stated standard deviation and the measured scatter, "" if none does."""
    if scatter is None or scatter < IDEAL_M or not TOO_SMALL <= sd / scatter <= TOO_LARGE:
        return ""
    kinds = {name: abs(np.log(sd / usual[0])) for name, usual in DEFAULT_SD_POSITION.items() if name}
    best = min(kinds, key=kinds.__getitem__)
    return best if kinds[best] < np.log(ROOT_FITS) else ""


def _sigma_finding(text: str, size: str, ratio: float, figures: Mapping[str, float]) -> Finding:
    times = ratio if ratio > 1.0 else 1.0 / ratio
    cause = "is the unit right (m, cm, mm; variances)?" if size == "large" else "is the unit right (m, km; mm in m)?"
    scale = float(f"{1.0 / ratio:.1g}")
    return Finding(
        "position sigmas",
        Verdict.LOOK,
        f"{text}: they look too {size}, about {times:.2g} times; {cause}",
        f"correct the columns, or scale them with gnss.sd_scale = {scale:g}",
        figures=dict(figures) | {"ratio": ratio},
    )


def _usual_kind(log: GnssLog) -> tuple[str, Array]:
    """The kind of most fixes if it is one with a usual accuracy, and which rows are of it; "" and all otherwise."""
    every = np.ones(log.time.size, dtype=bool)
    if log.fix is None:
        return "", every
    kinds = np.char.lower(log.fix.astype(str))
    names, counts = np.unique(kinds, return_counts=True)
    name = str(names[int(np.argmax(counts))])
    return (name, kinds == name) if name in DEFAULT_SD_POSITION and name else ("", every)


def local_scatter(log: GnssLog) -> float | None:
    """White part of the errors of horizontal positions [m], None if there are too few fixes in a row.

    Third differences, free of any motion of constant acceleration, over windows of eight; of the windows the quarter
    with the least is taken, where the vehicle stands or goes straight on.
    """
    step = np.diff(log.time)
    usual = float(np.median(step))
    north, east = metres(log)
    even = np.abs(step - usual) < 0.3 * usual
    whole = even[:-2] & even[1:-1] & even[2:]
    bends = [np.where(whole, np.diff(values, 3) ** 2, np.nan) for values in (north, east)]
    count = bends[0].size // WINDOW
    if count < FEWEST_WINDOWS:
        return None
    north, east = (part[: count * WINDOW].reshape(count, WINDOW) for part in bends)
    square = (north + east) / (2.0 * 20.0)
    mean = np.array([row.mean() for row in square if np.isfinite(row).all()])
    if mean.size < FEWEST_WINDOWS:
        return None
    return float(np.sqrt(np.percentile(mean, 25.0)) * 1.2)
