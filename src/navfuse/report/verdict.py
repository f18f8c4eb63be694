"""Whether to trust a run, in plain words: a headline, the few numbers that matter, and what to do about the rest."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from navfuse.analysis.consistency import NisSummary
from navfuse.analysis.metrics import ErrorMetrics, ErrorSeries
from navfuse.analysis.plausibility import ADVICE, in_words_of, run_findings
from navfuse.analysis.plausibility import APART as PLAINLY_APART
from navfuse.analysis.separation import separation_factors
from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.result import DOUBTFUL, Result
from navfuse.report.clock import utc_clock, utc_text
from navfuse.report.series import POSITION_SOURCE, Window, distance, excluded_windows, gaps, withheld_windows

OVERCONFIDENT = 1.25
PESSIMISTIC = 1.5
CORRELATED = 0.3
INSIDE = 0.95
INSIDE_BADLY = 0.80
LONG_GAP_S = 10.0
APART = 1.5
SILENT = "no fix was used from "
"""Beginning of the warning of :func:`navfuse.analysis.plausibility.silence`."""

HEADLINES = {
    "good": "This run looks sound",
    "check": "Usable, but look at the points below",
    "bad": "Do not rely on this run before the points below are settled",
    "compared": "A trajectory and its errors; nothing here speaks against it",
}


class Point(NamedTuple):
    """Something to know: level ``"info"``, ``"check"`` or ``"bad"``, and a sentence with what to do."""

    level: str
    text: str


class Card(NamedTuple):
    """One number of the page's head: what it is, the number with its unit, and a line of detail."""

    label: str
    value: str
    detail: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """Outcome of the checks.

    Attributes
    ----------
    level : {"good", "check", "bad"}
        The worst of the points; info points do not count.
    points : tuple of Point
        Worst first.
    cards : tuple of Card
    bare : bool
        Of a trajectory alone, not of a run.
    """

    level: str
    points: tuple[Point, ...]
    cards: tuple[Card, ...]
    bare: bool = False

    @property
    def headline(self) -> str:
        """The level as a sentence."""
        return HEADLINES["compared" if self.bare and self.level == "good" else self.level]


def judge(
    result: Result,
    consistency: dict[str, NisSummary],
    metrics: dict[str, ErrorMetrics],
    apart: ErrorSeries | None = None,
    *,
    bare: bool = False,
) -> Verdict:
    """Verdict on a run.

    Parameters
    ----------
    result : Result
    consistency : dict of str to NisSummary
        By aiding source, from :func:`navfuse.analysis.consistency.nis_summary`.
    metrics : dict of str to ErrorMetrics
        By name of the solution ("filter", "smoother") against a truth; empty without one.
    apart : ErrorSeries, optional
        Filter minus smoother, from :func:`navfuse.report.quality.separation`.
    bare : bool
        The result is a trajectory alone: that it has no measurements is no fault.
    """
    findings = [] if bare else run_findings(result, excluded_windows(result.innovations), apart)
    points = [Point(one.level, readable(one.text)) for one in findings]
    points += [] if bare else _measurement_points(result, consistency)
    points += [*_truth_points(metrics), *_separation_points(apart)]
    told = {_head(one.text) for one in findings}
    points += [Point("check", readable(text)) for text in result.warnings if _head(text) not in told]
    order = {"bad": 0, "check": 1, "info": 2}
    points.sort(key=lambda point: order[point.level])
    points = [Point(one.level, in_words_of(result, one.text)) for one in points]
    points = _advice_once(points, in_words_of(result, ADVICE))
    level = points[0].level if points else "good"
    cards = _cards(result, consistency, metrics, bare=bare, doubtful=level == "bad")
    return Verdict("good" if level == "info" else level, tuple(points), tuple(cards), bare)


def length(seconds: float) -> str:
    """A duration for people: ``12.3 s``, ``2 min 05 s``, ``1 h 02 min``."""
    if seconds < 100.0:
        return f"{seconds:.1f} s"
    total = round(seconds)
    if total < 3600:
        return f"{total // 60} min" + (f" {total % 60:02d} s" if total % 60 else "")
    return f"{total // 3600} h {total % 3600 // 60:02d} min"


def metres(value: float) -> str:
    """A length for people, with the digits that mean something: ``4.2 cm``, ``0.52 m``, ``12 m``, ``3.4 km``."""
    if not np.isfinite(value):
        return "unknown"
    for limit, unit, scale, digits in ((0.1, "cm", 100.0, 1), (10.0, "m", 1.0, 2), (1000.0, "m", 1.0, 0)):
        if value < limit:
            return f"{value * scale:.{digits}f} {unit}"
    return f"{value / 1000.0:.{1 if value < 1e5 else 0}f} km"


def moment(time: float, epoch: GpsEpoch | None) -> str:
    """A log time for people, with the UTC clock where it is known: ``1059.0 s (19:34:26 UTC)``."""
    return f"{time:.1f} s{utc_clock(epoch, time)}"


def readable(text: str) -> str:
    """A warning as a sentence of the page: sources by their names, and a capital where it begins with a plain word."""
    text = re.sub(r"\bgnss_(position|velocity)\b", r"GNSS \1", text)
    return text[:1].upper() + text[1:] if re.match(r"[a-z]+ ", text) else text


def _advice_once(points: list[Point], advice: str) -> list[Point]:
    """The same advice stands at the first point that gives it; the others refer to it."""
    told, found = False, []
    for level, text in points:
        if told:
            text = text.replace(f"; {advice}", "; check the same as above, in the same order")
        told = told or advice[1:] in text
        found.append(Point(level, text))
    return found


def _head(text: str) -> str:
    """What a warning is about: its beginning, without numbers, which may be rounded otherwise."""
    return re.sub(r"[-+]?\d+(\.\d+)?", "#", re.split("[:;]", text)[0])


def _measurement_points(result: Result, consistency: dict[str, NisSummary]) -> list[Point]:
    points = []
    position = consistency.get(POSITION_SOURCE)
    if position is None:
        text = (
            "No GNSS position was offered, so nothing holds the position and its error grows without limit, unless "
            "another sensor does. Check gnss.file, gnss.use and that the logs overlap (imu.time_offset_s)."
        )
        points.append(Point("check" if any(one.n for one in consistency.values()) else "bad", text))
    for source, summary in consistency.items():
        points += _source_points(readable(source).replace("_", " "), summary)
    longest = gaps(result)[:1]
    silent = any(text.startswith(SILENT) for text in result.warnings)
    if position is not None and not silent and longest and longest[0].end - longest[0].start > LONG_GAP_S:
        gap = longest[0]
        span = f"{moment(gap.start, result.epoch)} to {moment(gap.end, result.epoch)}"
        text = (
            f"Longest stretch without a used position: {length(gap.end - gap.start)}, from {span} "
            f"({_cause(result, gap)}). Within it the error grows as the standard deviations show."
        )
        points.append(Point("info", text))
    return points


def _source_points(name: str, summary: NisSummary) -> list[Point]:
    points = []
    if summary.verdict.startswith("overconfident") and OVERCONFIDENT < summary.factor <= DOUBTFUL:
        text = (
            f"The {name} innovations are {summary.factor:.2f} times as large as claimed, so the errors are probably "
            f"larger than the standard deviations by about as much; {ADVICE}."
        )
        points.append(Point("check", text))
    elif summary.verdict.startswith("pessimistic") and summary.factor < 1.0 / PESSIMISTIC:
        text = (
            f"The {name} innovations are {1.0 / summary.factor:.1f} times smaller than claimed: the stated sigmas are "
            "cautious. Smaller ones would weigh these measurements better."
        )
        points.append(Point("info", text))
    if not summary.white and abs(summary.lag_one) > CORRELATED:
        text = (
            f"Neighbouring {name} innovations are alike (correlation {summary.lag_one:.2f}): the measurement errors "
            "drift slowly, or the IMU noise is set too small. The standard deviations do not know of it and are too "
            "small where it lasts."
        )
        points.append(Point("check", text))
    if summary.counts.get("late"):
        text = (
            f"{summary.counts['late']} {name} measurements came too late and were ignored. "
            "Check the order of the logs and time_offset_s."
        )
        points.append(Point("check", text))
    return points


def _truth_points(metrics: dict[str, ErrorMetrics]) -> list[Point]:
    points = []
    for solution, metric in metrics.items():
        for block, value in metric.consistency.items():
            if value.n and value.inside_3_sigma < INSIDE:
                text = (
                    f"Only {value.inside_3_sigma:.0%} of the {block} errors of the {solution} are inside three "
                    f"standard deviations (99.7 % would be right): they are about {np.sqrt(value.nees_per_dof):.1f} "
                    "times what is claimed."
                )
                points.append(Point("bad" if value.inside_3_sigma < INSIDE_BADLY else "check", text))
    return points


def _separation_points(apart: ErrorSeries | None) -> list[Point]:
    """A difference of filter and smoother that is no finding of the run yet."""
    factors = {} if apart is None else separation_factors(apart)
    if any(factor > PLAINLY_APART for factor in factors.values()):
        return []
    large = [f"{block} {factor:.1f} times" for block, factor in factors.items() if factor > APART]
    if not large:
        return []
    text = (
        f"Filter and smoother lie somewhat further apart than their standard deviations allow: "
        f"{', '.join(large)}. The process "
        "noise is probably too small for this sensor (imu.grade), or something moves the solution that no state stands "
        "for; the filter's standard deviations are then too small."
    )
    return [Point("info", text)]


def _cards(
    result: Result, consistency: dict[str, NisSummary], metrics: dict[str, ErrorMetrics], *, bare: bool, doubtful: bool
) -> list[Card]:
    best, epoch = result.trajectory, result.epoch
    duration = float(best.time[-1] - best.time[0])
    rate = (len(best) - 1) / duration if duration > 0.0 else 0.0
    since = f"log time {best.time[0]:.1f} to {best.time[-1]:.1f} s, {rate:.4g} Hz"
    if epoch is not None:
        since += f"; from {utc_text(epoch, float(best.time[0]))} UTC"
    cards = [Card("Duration", length(duration), since), Card("Distance", metres(distance(best)), "along the path")]
    if not bare:
        cards += _gnss_cards(result, consistency)
    kind = "solution" if bare else "filter" if result.smoothed is None else "smoother"
    cards += _accuracy_cards(result, kind, ": not to be relied on, see above" if doubtful else "")
    for solution, metric in metrics.items():
        horizontal, vertical = metric.statistics["position_horizontal"], metric.statistics["position_down"]
        detail = (
            f"RMS horizontal, CEP50 {metres(horizontal.p50)}, CEP95 {metres(horizontal.p95)}, worst "
            f"{metres(horizontal.max)}; vertical RMS {metres(vertical.rms)}"
        )
        cards.append(Card(f"True error of the {solution}", metres(horizontal.rms), detail))
    return cards


def _accuracy_cards(result: Result, kind: str, doubt: str) -> list[Card]:
    best = result.trajectory
    if best.sd_position is None:
        return [Card("Expected error", "unknown", "the trajectory has no standard deviations")]
    sd = np.hypot(best.sd_position[:, 0], best.sd_position[:, 1])
    if not np.isfinite(sd).any():
        return [Card("Expected error", "unknown", "the standard deviations are no numbers")]
    worst = int(np.nanargmax(sd))
    vertical = metres(best.sd_position[-1, 2])
    end = f"horizontal, 1 sigma, {kind}; vertical {vertical}{doubt}"
    at = f"horizontal, 1 sigma, at {moment(float(best.time[worst]), result.epoch)}{doubt}"
    return [
        Card("Expected error at the end", metres(sd[-1]), end),
        Card("Expected error at worst", metres(sd[worst]), at),
    ]


def _gnss_cards(result: Result, consistency: dict[str, NisSummary]) -> list[Card]:
    position = consistency.get(POSITION_SOURCE)
    if position is None:
        return [Card("GNSS positions", "none", "nothing holds the position")]
    others = [f"{number} {status}" for status, number in position.counts.items() if status != "used"]
    cards = [Card("GNSS positions used", str(position.counts["used"]), ", ".join(others))]
    longest = gaps(result)[:1]
    if longest:
        gap = longest[0]
        span = f"{_cause(result, gap)}; from {moment(gap.start, result.epoch)} to {moment(gap.end, result.epoch)}"
        cards.append(Card("Longest without a used fix", length(gap.end - gap.start), span))
    drift = [window.largest_m for window in withheld_windows(result.innovations) if np.isfinite(window.largest_m)]
    if drift:
        detail = (
            f"rms of the largest horizontal difference in {len(drift)} window{'s' if len(drift) > 1 else ''}, filter"
        )
        cards.append(Card("Off from withheld fixes", metres(float(np.sqrt(np.mean(np.square(drift))))), detail))
    tested = {source: one for source, one in consistency.items() if one.n}
    if tested:
        source = max(tested, key=lambda name: tested[name].factor)
        if POSITION_SOURCE in tested and tested[source].factor < OVERCONFIDENT:
            source = POSITION_SOURCE
        worst = tested[source]
        low, high = worst.bounds
        mean = f"mean NIS {worst.mean_nis_per_dof:.2f} per component; right is {low:.2f} to {high:.2f}"
        near = 1.0 / OVERCONFIDENT < worst.factor < OVERCONFIDENT and worst.verdict != "consistent"
        detail = f"{readable(source).replace('_', ' ')}: {mean}"
        cards.append(Card("Consistency", "nearly consistent" if near else worst.verdict, detail))
    return cards


def _cause(result: Result, gap: Window) -> str:
    """Why no position fix was used in a gap: withheld, rejected, too late, or none there; the most frequent first."""
    records = result.innovations.of(POSITION_SOURCE)
    inside = records.status[(records.time > gap.start) & (records.time < gap.end)]
    words = {"withheld": "withheld", "rejected": "rejected by the filter", "late": "too late"}
    counts = {word: int(np.count_nonzero(inside == status)) for status, word in words.items()}
    told = [f"{number} {word}" for word, number in sorted(counts.items(), key=lambda one: -one[1]) if number]
    return f"fixes were there: {', '.join(told)}" if told else "no fixes"
