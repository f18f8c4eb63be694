"""Does a finished run agree with itself? What a user should hear of without reading a table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from navfuse.analysis.consistency import NisSummary, average_bounds, nis_summary
from navfuse.data.result import DOUBTFUL, Result

REJECTED_SHARE = 0.05
BY_CHANCE = 0.001
"""Probability of a drift through the outages that is warned about although the model is right."""
FEWEST = 10
"""Measurements below which nothing is concluded."""
STRANGE = 8.0
"""Multiple of its sigma beyond which a constant of the sensor is not believed."""
SILENT_S = 10.0
SIDEWAYS = np.radians(20.0)
FAST = 3.0
CONCENTRATED = 0.95


def run_warnings(result: Result, exclude: Sequence[tuple[float, float]] = ()) -> list[str]:
    """Warnings about a run that contradicts its own measurements.

    Parameters
    ----------
    result : Result
    exclude : sequence of (from, to) [s]
        Windows left out.

    Returns
    -------
    list of str
        Each says what is seen and what to look at, most likely cause first.
    """
    wrong, outliers = [], []
    consistency = nis_summary(result.innovations, exclude)
    for source, summary in consistency.items():
        if summary.n <= FEWEST:
            continue
        rejected = summary.counts.get("rejected", 0)
        share = rejected / (summary.n + rejected)
        factor = float(np.sqrt(summary.mean_nis_per_dof))
        if factor > DOUBTFUL:
            wrong.append(f"{source} {factor:.1f} times ({100.0 * share:.1f} % rejected)")
        elif share > REJECTED_SHARE:
            outliers.append(f"{100.0 * share:.1f} % of {source}")
    found = []
    if wrong:
        found.append(
            f"innovations are larger than claimed: {', '.join(wrong)}; the standard deviations of this run are too"
            " small. Check, in this order: the time offset between the logs (imu.time_offset_s), gnss.lever_arm_m,"
            " imu.axes, imu.grade, and the sigmas of the fixes (gnss.sd_scale, gnss.velocity_sd_scale)"
        )
    if outliers:
        found.append(
            f"{' and '.join(outliers)} rejected; what was used agrees with its standard deviations, so these were"
            " outliers of the receiver, or the run lost its way for a while: see the innovations"
        )
    found += _drift(result, consistency, exclude) + _strange_states(result)
    return found + _sideways(result)


def _drift(result: Result, consistency: dict[str, NisSummary], exclude: Sequence[tuple[float, float]]) -> list[str]:
    """Whether the filter drifted further through the outages than it said; each outage counts as one measurement."""
    too_far = []
    for source, summary in consistency.items():
        records = result.innovations.of(source)
        withheld = records.select(records.status == "withheld")
        windows = sum(bool(np.any((withheld.time >= start) & (withheld.time < end))) for start, end in exclude)
        if not windows:
            continue
        factor = float(np.sqrt(summary.mean_nis_per_dof_withheld))
        chance = average_bounds(windows * float(withheld.dof.mean()), 1.0 - 2.0 * BY_CHANCE)[1]
        if factor > max(DOUBTFUL, float(np.sqrt(chance))):
            too_far.append(f"{source} {factor:.1f} times")
    if not too_far:
        return []
    return [
        f"in the outages the solution drifted further than claimed: {', '.join(too_far)}; between fixes the standard "
        "deviations of this run are too small. The inertial sensor is worse than imu.grade says, or it is not rigidly "
        "mounted; see also the time offset between the logs (imu.time_offset_s)"
    ]


def _strange_states(result: Result) -> list[str]:
    """Scale factors and cross-couplings far outside what the error model allowed: something else went into them."""
    strange = []
    for name, history in result.states.items():
        if not name.endswith(("_scale", "_cross")) or not history.time.size:
            continue
        values, allowed = history.values[-1], history.sd[0]
        k = int(np.argmax(np.abs(values) / allowed))
        if abs(values[k]) > STRANGE * allowed[k]:
            strange.append(f"{name} {100.0 * values[k]:+.1f} % where {100.0 * allowed[k]:.2g} % is usual")
    if not strange:
        return []
    return [
        f"sensor states far outside the error model: {', '.join(strange)}; look at the time offset between the logs"
        " (imu.time_offset_s), imu.grade and the units of the inertial data"
    ]


def silence(result: Result, exclude: Sequence[tuple[float, float]] = ()) -> list[str]:
    """What to say of the longest stretch without any used measurement, unless it was asked for.

    No contradiction: the standard deviations tell what it costs. Parameters and return value as :func:`run_warnings`.
    """
    records, best = result.innovations, result.trajectory
    used = np.unique(records.time[np.isin(records.status, ("used", "reset"))])
    if not len(best) or (not len(records) and result.fixes is None):
        return []
    usual = float(np.median(np.diff(used))) if used.size > FEWEST else 0.0
    edges = np.concatenate([[best.time[0]], used[(used > best.time[0]) & (used < best.time[-1])], [best.time[-1]]])
    length = np.diff(edges)
    for start, end in exclude:
        length -= np.clip(np.minimum(edges[1:], end) - np.maximum(edges[:-1], start), 0.0, None)
    k = int(np.argmax(length))
    if length[k] < max(SILENT_S, 10.0 * usual):
        return []
    sd = ""
    if best.sd_position is not None:
        inside = (best.time >= edges[k]) & (best.time <= edges[k + 1])
        sd = f"; the standard deviation grows to {np.max(np.hypot(*best.sd_position[inside, :2].T)):.3g} m horizontally"
    return [f"no fix was used from {edges[k]:.1f} s to {edges[k + 1]:.1f} s: inertial navigation alone{sd}"]


def _sideways(result: Result) -> list[str]:
    """A vehicle that never moves along its forward axis has probably got its axes wrong, or is no wheeled vehicle."""
    best = result.trajectory
    if best.velocity_n is None or best.attitude is None:
        return []
    north, east = best.velocity_n[:, 0], best.velocity_n[:, 1]
    fast = np.hypot(north, east) > FAST
    if np.count_nonzero(fast) < 50:
        return []
    slip = np.exp(1j * (np.arctan2(east[fast], north[fast]) - best.attitude[fast, 2]))
    mean = slip.mean()
    if abs(mean) < CONCENTRATED or abs(np.angle(mean)) < SIDEWAYS:
        return []
    return [
        f"the vehicle moves {np.degrees(np.angle(mean)):.0f} deg off its forward axis all the time: if it drives, "
        "imu.axes or imu.rotation is turned about the vertical (position is right all the same, heading and lever "
        "arm are not)"
    ]
