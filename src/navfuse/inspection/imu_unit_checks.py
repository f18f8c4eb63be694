"""Are the values of an inertial log in the unit, of the kind and in the order that its columns say?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.errors import InputError
from navfuse.inspection.channel_checks import SAMPLE
from navfuse.inspection.findings import Finding, Verdict
from navfuse.inspection.recognise import without_source
from navfuse.io.columns import Field
from navfuse.io.imu_plausibility import check_accel, check_gyro, gravity_coherence
from navfuse.io.imu_table import INCREMENTS, RATES
from navfuse.io.units import UNITS

Array = np.ndarray
Kind = Literal["rates", "increments"]

_G = STANDARD_GRAVITY
_GYRO_WORDS = {
    "deg/s": np.pi / 180.0, "mrad/s": 1e-3, "mdeg/s": 1e-3 * np.pi / 180.0, "deg/h": np.pi / 180.0 / 3600.0,
}  # fmt: skip
_GYRO_SUFFIX = {"deg/s": ("degps", 1.0), "mrad/s": ("mradps", 1.0), "mdeg/s": ("degps", 1e3), "deg/h": ("degps", 3.6e3)}
"""Suffix of a column for a unit of rates, and what to divide by before."""


def per_second(values: Array, time: Array, kind: str) -> Array:
    """Rates of some twenty thousand rows, spread over the log."""
    sample = slice(1, None, max(1, (time.size - 1) // SAMPLE))
    if kind == "rates":
        return values[sample]
    return values[sample] / np.diff(time)[:: sample.step, None]


def exchanged_triads(gyro: Array, accel: Array, time: Array, kind: str) -> str:
    """Why the two triads look exchanged: one of them is gravity, whatever the units; "" if they do not."""
    rates, forces = (np.linalg.norm(per_second(values, time, kind), axis=1) for values in (gyro, accel))
    rate, force = float(np.median(rates)), float(np.median(forces))
    steady_rate = float(np.median(np.abs(rates - rate))) < 0.2 * rate
    if steady_rate and 0.8 * _G < rate < 1.25 * _G and force < 0.5 * _G:
        return f"the gyros have a steady magnitude of {rate:.3g}, gravity in m/s^2, the accelerometers {force:.3g}"
    to_degrees = 180.0 / np.pi
    in_degrees = rate * to_degrees
    if steady_rate and 0.8 * _G < in_degrees < 1.25 * _G and force < 0.5 * _G:
        return (
            f"the gyros have a steady magnitude of {in_degrees:.3g} deg/s, which is gravity in m/s^2, the "
            f"accelerometers {force:.3g}"
        )
    return ""


def accel_unit(
    time: Array, accel: Array, kind: Kind, names: tuple[str, ...], source: str, units: Mapping[str, str]
) -> tuple[Kind, float, Finding]:
    """Kind and factor that make specific force about one g, and what to say about it."""
    step = float(np.median(np.diff(time)))

    def tried(kind: Kind, factor: float) -> list[str]:
        rows = accel[:: max(1, accel.shape[0] // SAMPLE)]
        force = factor * float(np.median(np.linalg.norm(rows, axis=1)))
        rate = factor * float(np.median(np.linalg.norm(per_second(accel, time, kind), axis=1)))
        return check_accel(force, rate, step, kind, names, source)

    def size(kind: Kind, factor: float) -> float:
        return factor * float(np.median(np.linalg.norm(per_second(accel, time, kind), axis=1)))

    missing = _without_gravity(time, accel, kind)
    if missing:
        force = size(kind, 1.0)
        message = (
            f"columns {', '.join(names[4:])}: the median specific force is {force:.3g} m/s^2 where gravity alone makes "
            f"9.8, and {missing}: gravity has been taken out, as from a 'linear acceleration' or by 9.81 subtracted "
            "from one axis"
        )
        remedy = "export the specific force that the sensor measures, gravity included; no factor brings it back"
        figures = {"force_mps2": force, "gravity": 0.0}
        return kind, 1.0, Finding("accelerometer unit", Verdict.WRONG, message, remedy, figures=figures)
    stated = _stated(units, names, RATES[3:] if kind == "rates" else INCREMENTS[3:])
    force = size(kind, 1.0)
    figures = {"force_mps2": force}
    try:
        notes = tried(kind, 1.0)
    except InputError as error:
        message = without_source(str(error), source)
        new_kind, factor, _ = _alternative(kind, size)
        fault, _, remedy = message.partition("; these ")
        remedy = remedy.partition(": ")[2] or f"check the unit of {names[4]}"
        what = f"; these {message.partition('; these ')[2].partition(': ')[0]}" if "; these " in message else ""
        return new_kind, factor, Finding("accelerometer unit", Verdict.WRONG, fault + what, remedy, figures=figures)
    if notes:
        new_kind, factor, words = _alternative(kind, size)
        remedy = f"only as {words} is it gravity: rename the columns" if words else "check unit and columns"
        if kind == "increments" and not words and force < _G:
            remedy += "; increments have to cover the whole time between rows: were rows left out?"
        verdict = Verdict.WRONG if words else Verdict.LOOK
        message = without_source(notes[0], source).removesuffix("; check the unit of these columns")
        if not stated and words:
            message, remedy = f"{message}, and the names carry no unit", f"the values look like {words}: {remedy}"
        return new_kind, factor, Finding("accelerometer unit", verdict, message, remedy, figures=figures)
    text = f"the median specific force is {force:.4g} m/s^2 ({force / _G:.4g} g)"
    if kind == "increments":
        text += f", from velocity increments over {step:.4g} s"
    return kind, 1.0, Finding("accelerometer unit", Verdict.OK, text, figures=figures)


def _without_gravity(time: Array, accel: Array, kind: str) -> str:
    """Why no unit makes these the specific force of a sensor that gravity acts upon; "" if one may.

    In whatever unit, means over a second keep the magnitude of gravity give or take manoeuvres. Without gravity what
    is left are the manoeuvres, which come and go.
    """
    step = np.diff(time, prepend=2.0 * time[0] - time[1])
    rates = accel / step[:, None] if kind == "increments" else accel
    edges = np.searchsorted(time, np.arange(time[0], time[-1], 1.0))
    counts = np.diff(edges)
    if counts.size < 20 or counts.min() < 1:
        return ""
    means = np.linalg.norm(np.add.reduceat(rates, edges[:-1], axis=0)[: counts.size] / counts[:, None], axis=1)
    low, middle, high = np.percentile(means, [10.0, 50.0, 90.0])
    if middle > 0.5 * _G or not (low < 0.75 * middle and high > 1.25 * middle):
        return ""
    return f"means over a second range from {low:.2g} to {high:.2g} m/s^2 (10 % and 90 %), where gravity is steady"


def _stated(units: Mapping[str, str], names: tuple[str, ...], group: Sequence[Field]) -> bool:
    return all(units.get(one.base, one.unit) for one in group)


_ACCEL_WORDS = {
    "g": _G, "mg": 1e-3 * _G, "cm/s^2": 1e-2, "ug": 1e-6 * _G, "ft/s^2": 0.3048, "m/s^2 in a column of g": 1.0 / _G,
}  # fmt: skip


def _alternative(kind: Kind, size) -> tuple[Kind, float, str]:
    """The first kind and unit with which the median specific force is within a tenth of g; none: as it was."""
    other: Kind = "increments" if kind == "rates" else "rates"
    trials: list[tuple[Kind, float, str]] = [(other, 1.0, f"{other} in m/s" + ("^2" if other == "rates" else ""))]
    for words, factor in _ACCEL_WORDS.items():
        trials.append((kind, factor, words))
    trials.append((other, _G, f"{other} in g"))
    for one, factor, words in trials:
        if abs(size(one, factor) / _G - 1.0) < 0.15:
            return one, factor, words
    return kind, 1.0, ""


def gyro_unit(
    time: Array,
    gyro: Array,
    accel: Array,
    kind: Kind,
    names: tuple[str, ...],
    source: str,
    units: Mapping[str, str],
) -> tuple[float, Finding]:
    """Factor that makes the rates turn with gravity, and what to say about it."""

    def tried(factor: float) -> list[str]:
        turn = np.linalg.norm(per_second(gyro * factor, time, kind), axis=1)
        return check_gyro(turn, time, gyro * factor, accel, kind, names, source)

    rates = np.linalg.norm(per_second(gyro, time, kind), axis=1)
    fast = float(np.percentile(rates, 99.0))
    figures = {"fastest_radps": fast}
    text = f"1 row in 100 turns faster than {fast:.3g} rad/s ({np.degrees(fast):.3g} deg/s)"
    try:
        notes = tried(1.0)
    except InputError as error:
        message = without_source(str(error), source)
        fault = message.partition(": rename to ")[0]
        order = _other_order(time, gyro, accel, kind)
        if order:
            message = (
                f"{fault.partition(', but only')[0]}; as they stand in the file they cannot be the rates of these axes"
            )
            finding = Finding(
                "gyro order", Verdict.WRONG, message, f"correct the gyro columns: {order}", figures=figures
            )
            return 1.0, finding
        fault = fault.partition("; are these degrees?")[0]
        group = RATES if kind == "rates" else INCREMENTS
        said = UNITS[group[0].quantity or ""].get(units.get(group[0].base, ""), 1.0)
        for unit, size in _GYRO_WORDS.items():
            factor = size / said
            try:
                fits = not tried(factor)
            except InputError:
                continue
            if fits:
                suffix, parts = _GYRO_SUFFIX[unit]
                name = f"gyro_x_{suffix}" if kind == "rates" else f"dtheta_x_{suffix.removesuffix('ps')}"
                remedy = f"rename to {name} ..." if parts == 1.0 else f"divide by {parts:g} and rename to {name} ..."
                message = fault if "if they are" in fault else f"{fault}; as {unit} they would be those of a vehicle"
                return factor, Finding("gyro unit", Verdict.WRONG, message, remedy, figures=figures)
        remedy = "check unit and columns of the gyros; no usual unit makes these the rates of a vehicle"
        return 1.0, Finding("gyro unit", Verdict.WRONG, fault, remedy, figures=figures)
    if notes:
        order = _other_order(time, gyro, accel, kind)
        if order:
            message = without_source(notes[0], source).partition("; check")[0]
            finding = Finding(
                "gyro order", Verdict.WRONG, message, f"correct the gyro columns: {order}", figures=figures
            )
            return 1.0, finding
        return 1.0, Finding("gyro unit", Verdict.LOOK, without_source(notes[0], source), figures=figures)
    return 1.0, Finding("gyro unit", Verdict.OK, text, figures=figures)


def _other_order(time: Array, gyro: Array, accel: Array, kind: str) -> str:
    """The order of the gyro columns with which gravity stays where it is, in words; "" if none does much better.

    Signs are left alone: turned the other way round about the vertical, gravity stays where it is as well.
    """
    bias = np.median(per_second(gyro, time, kind), axis=0)

    def deviation(order: tuple[int, ...]) -> float:
        columns = list(order)
        average = gravity_coherence(time, gyro[:, columns], accel, kind, 1.0, bias[columns])
        return float(np.median(np.abs(average - _G))) if average.size else np.inf

    as_is = deviation((0, 1, 2))
    trials = {order: deviation(order) for order in ((0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0))}
    best = min(trials, key=trials.__getitem__)
    if not trials[best] < min(0.25 * as_is, 0.1):
        return ""
    return "x, y, z stand in the columns " + ", ".join("xyz"[k] for k in best)
