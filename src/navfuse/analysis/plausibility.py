"""Does a finished run agree with itself? What a user should hear of without reading a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from navfuse.analysis.consistency import NisSummary, average_bounds, nis_summary
from navfuse.analysis.metrics import ErrorSeries
from navfuse.analysis.separation import separation, separation_factors
from navfuse.data.result import DOUBTFUL, Innovations, Result
from navfuse.errors import InputError

REJECTED_SHARE = 0.05
REJECTED_BADLY = 0.30
IN_A_ROW = 5
"""Rejected fixes in a row that are told."""
LOST_IN_A_ROW = 20
LOST_FIXED_IN_A_ROW = 10
"""Rejected fixes in a row, and of these with fixed ambiguities, that speak against the filter and not the receiver."""
LOST_S = 2.0
APART, FAR_APART = 3.0, 6.0
"""Multiples of the claim by which filter and smoother may differ before it is told, and before it is serious."""
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


ADVICE = (
    "check, in this order: the time offset between the logs (imu.time_offset_s), gnss.lever_arm_m, imu.axes,"
    " imu.grade, and the sigmas of the fixes (gnss.sd_scale, gnss.velocity_sd_scale)"
)
"""What to look at when the innovations and the claims do not agree: the most frequent cause first."""


_WITHOUT_INERTIAL = {
    ADVICE: (
        "check, in this order: the time offset between the logs (dead_reckoning.time_offset_s), the unit of the speeds,"
        " dead_reckoning.wheel_places_m, the headings (dead_reckoning.heading_offset_deg), the errors allowed the track"
        " (dead_reckoning.velocity_psd_m2ps3, dead_reckoning.heading_noise_deg), and the sigmas of the fixes"
        " (gnss.sd_scale, gnss.velocity_sd_scale)"
    ),
    "the inertial sensor is worse than imu.grade says, or it is not rigidly mounted": (
        "the track is worse than dead_reckoning.velocity_psd_m2ps3 and dead_reckoning.heading_noise_deg say"
    ),
    "noise is probably too small for this sensor (imu.grade)": (
        "noise is probably too small for this track (dead_reckoning.velocity_psd_m2ps3)"
    ),
    "imu.axes or imu.rotation is turned about the vertical (position is right all the same, heading and lever arm are"
    " not)": "the headings are off (dead_reckoning.heading_offset_deg)",
    "imu.time_offset_s": "dead_reckoning.time_offset_s",
    "inertial navigation alone": "dead reckoning alone",
}
"""What is said of a dead-reckoned track in the place of what is said of an inertial one."""


def in_words_of(result: Result, text: str) -> str:
    """A sentence on a run in the words and keys of its kind: those of an inertial run, or of a dead-reckoned track."""
    if "dr_position_error" in result.states:
        for inertial, other in _WITHOUT_INERTIAL.items():
            text = text.replace(inertial, other).replace(_capital(inertial), _capital(other))
    return text


def _capital(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}"


class Finding(NamedTuple):
    """Something a run says against itself.

    Attributes
    ----------
    level : {"check", "bad"}
        ``"bad"``: the standard deviations are not to be relied on.
    text : str
        What is seen and what to look at.
    """

    level: str
    text: str


def run_findings(
    result: Result, exclude: Sequence[tuple[float, float]] = (), apart: ErrorSeries | None = None
) -> list[Finding]:
    """What a run says against itself: the one judgement that warnings, summary and report page share.

    Parameters
    ----------
    result : Result
    exclude : sequence of (from, to) [s]
        Windows left out.
    apart : ErrorSeries, optional
        Filter minus smoother, from :func:`navfuse.analysis.separation.separation`; worked out where it is not given.

    Returns
    -------
    list of Finding
    """
    consistency = nis_summary(result.innovations, exclude)
    if apart is None and result.smoothed is not None and len(result.forward) > 1 and len(result.smoothed) > 1:
        try:
            apart = separation(result.forward, result.smoothed)
        except InputError:
            apart = None
    found = [
        *_unheld(consistency),
        *_innovations(consistency),
        *_in_a_row(result),
        *_drift(result, consistency, exclude),
        *_apart(apart),
        *_strange_states(result),
        *_sideways(result),
    ]
    return [Finding(one.level, in_words_of(result, one.text)) for one in found]


def run_warnings(result: Result, exclude: Sequence[tuple[float, float]] = ()) -> list[str]:
    """The texts of :func:`run_findings`; parameters as there."""
    return [finding.text for finding in run_findings(result, exclude)]


def worst_factor(consistency: dict[str, NisSummary]) -> float | None:
    """Largest factor by which the innovations of a source exceed their claim; None where none has enough of them."""
    return max((one.factor for one in consistency.values() if one.n > FEWEST), default=None)


def _innovations(consistency: dict[str, NisSummary]) -> list[Finding]:
    """Innovations larger than claimed, and outliers."""
    wrong, outliers, found = [], [], []
    most = 0.0
    for source, summary in consistency.items():
        if summary.n <= FEWEST:
            continue
        rejected = summary.counts.get("rejected", 0)
        share = rejected / (summary.n + rejected)
        if summary.factor > DOUBTFUL:
            wrong.append(f"{source} {summary.factor:.1f} times ({100.0 * share:.1f} % rejected)")
        elif share > REJECTED_SHARE:
            outliers.append(f"{100.0 * share:.1f} % of {source}")
            most = max(most, share)
    if wrong:
        text = (
            f"innovations are larger than claimed: {', '.join(wrong)}; the standard deviations of this run are too"
            f" small. {_capital(ADVICE)}"
        )
        found.append(Finding("bad", text))
    if outliers:
        text = (
            f"{' and '.join(outliers)} rejected; what was used agrees with its standard deviations, so these were"
            " outliers of the receiver, or the run lost its way for a while: see the innovations"
        )
        found.append(Finding("bad" if most > REJECTED_BADLY else "check", text))
    return found


def _unheld(consistency: dict[str, NisSummary]) -> list[Finding]:
    """Position fixes that were offered, and none of them used."""
    position = consistency.get("gnss_position")
    if position is None or position.counts["used"] + position.counts.get("reset", 0):
        return []
    fate = ", ".join(f"{number} {status}" for status, number in position.counts.items() if number)
    text = (
        f"no GNSS position was used ({fate}), so nothing holds the position and its error grows without limit; check "
        "that the logs overlap (imu.time_offset_s) and the withheld windows (gnss.outages_s)"
    )
    return [Finding("bad", text)]


def longest_rejected(records: Innovations) -> tuple[int, int]:
    """First row and number of the longest run of rejected measurements among those of one source."""
    turns = np.diff(np.concatenate(([0], (records.status == "rejected").astype(np.int8), [0])))
    starts, ends = np.flatnonzero(turns == 1), np.flatnonzero(turns == -1)
    if not starts.size:
        return 0, 0
    k = int(np.argmax(ends - starts))
    return int(starts[k]), int(ends[k] - starts[k])


def _in_a_row(result: Result) -> list[Finding]:
    """Position fixes rejected one after the other: few receivers err that long, a filter that lost its way does."""
    records = result.innovations.of("gnss_position")
    records = records.select(records.status != "late")
    first, number = longest_rejected(records)
    if number < IN_A_ROW:
        return []
    row = records.row[first : first + number]
    start, end = records.time[first], records.time[first + number - 1]
    kinds = None if result.fixes is None else result.fixes.fix
    known = kinds is not None and row.min() >= 0 and row.max() < kinds.size
    fixed = int(np.count_nonzero(kinds[row] == "rtk-fixed")) if kinds is not None and known else 0
    lost = end - start >= LOST_S and (number >= LOST_IN_A_ROW or fixed >= LOST_FIXED_IN_A_ROW)
    kind = f", {fixed} of them rtk-fixed," if fixed else ""
    text = f"fixes were offered and refused: {number} in a row{kind} from {start:.1f} s to {end:.1f} s; "
    if lost or fixed > number // 2:
        text += f"the filter, not the fixes, is probably wrong here; {ADVICE}"
    else:
        text += "either the receiver was wrong for a while (trees, houses), or the filter had lost its way: see the map"
    return [Finding("bad" if lost else "check", text)]


def _apart(apart: ErrorSeries | None) -> list[Finding]:
    """Filter and smoother further apart than both claim: no truth is needed to see it."""
    factors = {} if apart is None else separation_factors(apart)
    large = {block: factor for block, factor in factors.items() if factor > APART}
    if not large:
        return []
    listed = ", ".join(f"{block} {factor:.1f} times" for block, factor in large.items())
    text = (
        f"filter and smoother lie further apart than their standard deviations allow: {listed}; the standard"
        f" deviations of the filter are too small, or something moves the solution that no state stands for; {ADVICE}"
    )
    return [Finding("bad" if max(large.values()) > FAR_APART else "check", text)]


def _drift(result: Result, consistency: dict[str, NisSummary], exclude: Sequence[tuple[float, float]]) -> list[Finding]:
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
    text = (
        f"in the outages the solution drifted further than claimed: {', '.join(too_far)}; between fixes the standard "
        "deviations of this run are too small. See the time offset between the logs (imu.time_offset_s); else the "
        "inertial sensor is worse than imu.grade says, or it is not rigidly mounted"
    )
    return [Finding("bad", text)]


def _strange_states(result: Result) -> list[Finding]:
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
    text = (
        f"sensor states far outside the error model: {', '.join(strange)}; look at the time offset between the logs"
        " (imu.time_offset_s), imu.grade and the units of the inertial data"
    )
    return [Finding("bad", text)]


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
    text = f"no fix was used from {edges[k]:.1f} s to {edges[k + 1]:.1f} s: inertial navigation alone{sd}"
    return [in_words_of(result, text)]


def _sideways(result: Result) -> list[Finding]:
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
    text = (
        f"the vehicle moves {np.degrees(np.angle(mean)):.0f} deg off its forward axis all the time: if it drives, "
        "imu.axes or imu.rotation is turned about the vertical (position is right all the same, heading and lever "
        "arm are not)"
    )
    return [Finding("check", text)]
