"""Warnings of an analysis: what is odd about a record, and what its noise terms do not say."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from navfuse.analysis.allan.agreement import ALLAN_KINDS, Disagreement, disagreements, probability_below
from navfuse.analysis.allan.results import AxisStudy
from navfuse.io.static_record import StaticRecord

TURNS = math.radians(5.0)
"""Mean rate [rad/s] beyond which a record is asked whether it turns."""


def of_axis(source: str, name: str, axis: AxisStudy, record: StaticRecord) -> list[str]:
    """What is odd about one axis."""
    notes, check = [], axis.check
    if axis.missing:
        many = "1 sample is" if axis.missing == 1 else f"{axis.missing} samples are"
        notes.append(f"{source}: {name}: {many} missing; {_of_gaps(axis, record)}")
    if check.stuck is not None:
        begin, end = check.stuck
        notes.append(
            f"{source}: {name} repeats one value {end - begin + 1} times, from {begin / record.rate:.6g} s: it "
            f"was stuck there{_of_held(axis)}"
        )
    if check.saturated:
        kept = "; its noise is larger than what is seen of it, and is not used for [imu]" if check.clipped else ""
        notes.append(
            f"{source}: {name}: {check.saturated} samples stand at the end of the range: it is saturated{kept}"
        )
    found = axis.identification
    for term in (term for term in found.terms if found.too_short(term)):
        why = f"the record of {found.span:.6g} s is shorter than the {term.least_span:.3g} s that it needs"
        if math.isinf(term.least_span):
            why = "no sum of the terms comes close to the spectrum"
        notes.append(
            f"{source}: {name}: {term.name} is uncertain by more than a quarter: {why}; it is not used for [imu]"
        )
    if found.misfit > 0.0:
        above = "" if math.isinf(found.highest) else f" above {found.highest:.3g} Hz and"
        notes.append(
            f"{source}: {name}: no sum of the terms fits the whole spectrum; what is{above} in "
            f"{100.0 * found.left_out:.0f} % of "
            f"the other bins is left out (vibration, lines, the edge of a filter); the rest {_how_good(found.misfit)}"
        )
    return notes + _of_curve(source, name, axis, record)


def _of_held(axis: AxisStudy) -> str:
    held = axis.check.held
    if not held:
        return ", or its resolution is too coarse to tell"
    others = "" if len(held) == 1 else f", and {len(held) - 1} times more"
    return f"{others}; repeated samples count as missing"


def _of_gaps(axis: AxisStudy, record: StaticRecord) -> str:
    found = axis.identification
    told = "the deviations average over the stretches between, the noise terms come from "
    if found.filled == axis.missing:
        return f"{told}all of the record, what is missing replaced by noise like that around it"
    begin = found.begin / record.rate
    told += f"{begin:.6g} to {begin + found.span:.6g} s"
    if found.filled:
        told += ", the longest part with short gaps only:"
        return f"{told} {found.filled} samples are replaced by noise like that around"
    return f"{told}, the longest stretch without a gap: more is missing than can be replaced"


def _of_curve(source: str, name: str, axis: AxisStudy, record: StaticRecord) -> list[str]:
    """Where the fitted model is not what was measured."""
    found = axis.identification
    kind, curve = next(iter(axis.curves.items()))
    if kind not in ALLAN_KINDS or curve.tau.size < 3 or not any(term.present for term in found.terms):
        return []
    model = found.allan_variance(curve.tau)
    # A model of the whole record follows its curve; one of a part of it may be off by what its terms are uncertain of.
    part = found.span * record.rate < record.channels[0].values.size - 0.5
    below = probability_below(curve, model, found.misfit, found.relative_error(curve.tau) if part else 0.0)
    return [
        f"{source}: {name}: the fitted model is {one.ratio:.2f} times the measured deviation between {one.begin:.4g} "
        f"and {one.end:.4g} s; chance does that in {_percent(one.probability)} of records with these noise terms, so "
        f"that something else is likely to be there{_bounded(axis, one)}"
        for one in disagreements(curve, model, below, 1.0 / found.highest)
    ]


def _bounded(axis: AxisStudy, where: Disagreement) -> str:
    """What to try where a walk or ramp makes most of a model that is above the curve: its process may be bounded."""
    found = axis.identification
    names = [term.name for term in found.terms if term.present and term.name != "sin"]
    if where.ratio <= 1.0 or not names or any(term.name == "GM" for term in found.terms):
        return ""
    tau = np.array([math.sqrt(where.begin * where.end)])
    most = max(names, key=lambda name: float(found.allan_variance(tau, name)[0]))
    if most not in ("K", "R"):
        return ""
    return f", such as a bias that is bounded, for which {most} stands here: try --terms Q,N,B,K,R,GM"


def _percent(probability: float) -> str:
    return "less than 0.01 %" if probability < 1e-4 else f"{100.0 * probability:.2g} %"


def _how_good(misfit: float) -> str:
    if misfit < 5e-4:
        return "fits as it should"
    return f"agrees with the terms to {100.0 * misfit:.2g} %" if misfit < 0.5 else "is hardly described by any of them"


def of_turning(axes: Sequence[AxisStudy], source: str) -> list[str]:
    """Whether the gyros show a rate that few have as a bias."""
    turn = math.hypot(*(axis.mean for axis in axes if axis.sensor == "gyro"))
    if turn <= TURNS:
        return []
    return [
        f"{source}: the gyros show {math.degrees(turn):.3g} deg/s on average: does it turn steadily, or is the unit "
        "wrong? Few sensors have such a bias"
    ]


def of_drift(record: StaticRecord, axes: Sequence[AxisStudy]) -> list[str]:
    """Temperature and straight lines along the record."""
    notes = []
    warm = record.temperature
    if warm is not None and np.isfinite(warm).any():
        span = float(np.nanmax(warm) - np.nanmin(warm))
        if span > 1.0:
            notes.append(
                f"{record.source}: the temperature changes by {span:.3g} K along the record; what follows it is "
                f"drift, not noise"
            )
    drifting = [axis.name for axis in axes if axis.check.drifts]
    if drifting:
        notes.append(
            f"{record.source}: {', '.join(drifting)}: a straight line explains most of the slow change, as in "
            f"warm-up; K, R and "
            "long averaging times tell of that more than of noise: let the sensor warm up, or cut the beginning"
        )
    return notes
