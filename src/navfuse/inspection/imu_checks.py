"""Inertial logs by themselves: kind, units, dead, stuck and clipped channels, the vertical, noise at rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.data.logs import ImuLog
from navfuse.errors import InputError
from navfuse.inspection.findings import Finding, Verdict
from navfuse.inspection.recognise import Recognised, without_source
from navfuse.inspection.time_checks import Stamps, check_stamps
from navfuse.io.columns import Field
from navfuse.io.imu_plausibility import check_accel, check_gyro, gravity_coherence
from navfuse.io.imu_table import INCREMENTS, RATES
from navfuse.io.units import UNITS, scaled

Array = np.ndarray
Kind = Literal["rates", "increments"]

_G = STANDARD_GRAVITY
SAMPLE = 20000
STUCK_S, STUCK_ROWS = 1.0, 50
"""A channel that holds one value for so long while others of its sensor move is stuck."""
CLIPPED_RUN, CLIPPED_ROWS = 3, 12
_GYRO_SCALES = (125.0, 250.0, 300.0, 450.0, 500.0, 1000.0, 2000.0, 4000.0)
_ACCEL_SCALES = (2.0, 4.0, 5.0, 6.0, 8.0, 10.0, 16.0, 18.0, 30.0, 32.0)


@dataclass(frozen=True, slots=True)
class RawImu:
    """An inertial log as it stands in the file: its axes, its flaws, SI units by the names of the columns.

    Attributes
    ----------
    stamps : Stamps
    gyro, accel : (m, 3) arrays
        At the rows of `stamps`; may hold NaN.
    kind : {"rates", "increments"}
    names : tuple of 7 str
        Columns: time, gyros, accelerometers.
    findings : tuple of Finding
    """

    stamps: Stamps
    gyro: Array
    accel: Array
    kind: Kind
    names: tuple[str, ...]
    findings: tuple[Finding, ...]


def read_raw_imu(found: Recognised) -> RawImu:
    """The columns of an inertial log, nothing repaired or refused.

    Raises
    ------
    InputError
        If a column cannot be read as numbers, or none of time, gyros and accelerometers is there.
    """
    table = found.table
    assert table is not None
    kind: Kind = "rates" if sum(one.base in found.columns for one in RATES) >= 3 else "increments"
    wanted = RATES if kind == "rates" else INCREMENTS
    missing = [one.name for one in wanted if one.base not in found.columns]
    if "time" not in found.columns:
        raise InputError(f"{table.source}: no column of time was recognised; name it 'time_s'")
    names = [found.columns[base].name for base in ("time", *(one.base for one in wanted)) if base in found.columns]
    values = table.read(names)
    time = scaled(values[found.columns["time"].name], UNITS["time"].get(found.columns["time"].unit, 1.0))
    stamps = check_stamps(time, found.columns["time"].name, "imu")
    findings: list[Finding] = []
    triads = []
    for group in (wanted[:3], wanted[3:]):
        triad = np.full((time.size, 3), np.nan)
        for axis, one in enumerate(group):
            column = found.columns.get(one.base)
            if column is not None:
                factor = UNITS[one.quantity or ""].get(column.unit, 1.0)
                triad[:, axis] = scaled(values[column.name], factor)
        triads.append(triad[stamps.rows])
    if missing:
        findings.append(
            Finding("columns", Verdict.WRONG, f"these columns are missing: {', '.join(missing)}", "export them too")
        )
    told = tuple(found.columns[one.base].name if one.base in found.columns else one.name for one in wanted)
    return RawImu(stamps, triads[0], triads[1], kind, (found.columns["time"].name, *told), tuple(findings))


@dataclass(frozen=True, slots=True)
class ImuReport:
    """What the checks found, and the log as the findings say it ought to be read.

    Attributes
    ----------
    findings : tuple of Finding
    log : ImuLog or None
        File axes, units and kind put right where they were wrong; None if nothing sensible is left.
    units : dict of str to str
        Base name -> suffix that the values speak for.
    """

    findings: tuple[Finding, ...]
    log: ImuLog | None
    units: dict[str, str]


def check_imu(raw: RawImu, source: str, units: Mapping[str, str]) -> ImuReport:
    """All checks that need the inertial log alone.

    Parameters
    ----------
    raw : RawImu
    source : str
        File.
    units : mapping
        Base name -> unit that its column states, "" if none.
    """
    found = [*raw.findings, *raw.stamps.findings]
    found += _missing_values(raw)
    whole = np.isfinite(raw.gyro).all(axis=1) & np.isfinite(raw.accel).all(axis=1)
    if np.count_nonzero(whole) < 10 or not np.isfinite(raw.stamps.step):
        few = int(np.count_nonzero(whole))
        found.append(Finding("values", Verdict.UNKNOWN, f"{few} rows with all six values: too few to judge"))
        return ImuReport(tuple(found), None, {})
    time, gyro, accel = raw.stamps.time[whole], raw.gyro[whole], raw.accel[whole]
    found += check_channels(time, gyro, accel, raw.names)
    exchanged = _exchanged(gyro, accel, time, raw.kind)
    if exchanged:
        found.append(
            Finding(
                "columns",
                Verdict.WRONG,
                f"{exchanged}: the gyro and accelerometer columns are exchanged",
                "exchange the names of the gyro and accelerometer columns",
            )
        )
        gyro, accel = accel, gyro
    kind, accel_factor, finding = _accel_unit(time, accel, raw.kind, raw.names, source, units)
    found.append(finding)
    gyro_factor, finding = _gyro_unit(time, gyro, accel * accel_factor, kind, raw.names, source, units)
    found.append(finding)
    log = ImuLog(time, gyro * gyro_factor, accel * accel_factor, kind, source)
    return ImuReport(tuple(found), log, _suffixes(raw.kind, kind, gyro_factor, accel_factor))


def _suffixes(said: Kind, kind: Kind, gyro_factor: float, accel_factor: float) -> dict[str, str]:
    """Base name -> unit that the values speak for, for columns whose names carry none."""
    if said != kind:
        return {}
    gyro = "degps" if gyro_factor != 1.0 else "radps"
    accel = next(
        (unit for unit, size in UNITS["acceleration"].items() if abs(size / accel_factor - 1.0) < 1e-9), "mps2"
    )
    if kind == "increments":
        return {f"dtheta_{axis}": "deg" if gyro_factor != 1.0 else "rad" for axis in "xyz"}
    return {f"{base}_{axis}": unit for base, unit in (("gyro", gyro), ("accel", accel)) for axis in "xyz"}


def _missing_values(raw: RawImu) -> list[Finding]:
    found = []
    values = np.hstack((raw.gyro, raw.accel))
    flawed = ~(np.abs(values) < 1e6)
    for k, name in enumerate(raw.names[1:]):
        count = int(np.count_nonzero(flawed[:, k]))
        if count == values.shape[0] and count:
            found.append(
                Finding("values", Verdict.WRONG, f"column '{name}' holds no number in any of its {count} rows",
                        "export the log again, with this column")
            )  # fmt: skip
        elif count:
            share = count / values.shape[0]
            first = int(raw.stamps.rows[int(np.argmax(flawed[:, k]))]) + 1
            found.append(
                Finding(
                    "values",
                    Verdict.WRONG if share >= 0.01 else Verdict.LOOK,
                    f"column '{name}': {count} of {values.shape[0]} rows ({100 * share:.2g} %) are empty, NaN, "
                    f"infinite or beyond 1e6, the first is row {first}",
                    "single rows are repaired; where it is 1 % or more, correct the file",
                )
            )
    if not found:
        found.append(Finding("values", Verdict.OK, f"{values.shape[0]} rows, all six columns hold numbers"))
    return found


def check_channels(time: Array, gyro: Array, accel: Array, names: Sequence[str]) -> list[Finding]:
    """Channels that are dead, stuck or clipped, or that repeat another.

    Parameters
    ----------
    time : (n,) array [s]
    gyro, accel : (n, 3) arrays
        Finite, rates or increments.
    names : sequence of 7 str
        Columns: time, gyros, accelerometers.
    """
    found = []
    step = float(np.median(np.diff(time)))
    least = max(STUCK_ROWS, round(STUCK_S / step))
    for triad, sensor, first in ((gyro, "gyros", 1), (accel, "accelerometers", 4)):
        same = triad[1:] == triad[:-1]
        alive = np.array([is_noisy(triad[:, k]) for k in range(3)])
        for k in range(3):
            others = [j for j in range(3) if j != k]
            name = names[first + k]
            if not alive[others].any():
                continue
            start, length = longest_run(same[:, k])
            if length == time.size:
                found.append(
                    Finding(
                        "stuck channel",
                        Verdict.WRONG,
                        f"column '{name}' is {triad[0, k]:.6g} in all {length} rows while the other {sensor} change: "
                        "the axis is dead or stuck",
                        "check the sensor and the export; the log cannot be used without this axis",
                        figures={"stuck_s": float(time[-1] - time[0])},
                    )
                )
                continue
            if length < least:
                continue
            moving = ~same[start : start + length - 1][:, others]
            if not (moving.mean(axis=0) > 0.5).any() or _coarse(same[:, k], length):
                continue
            seconds = float(time[start + length - 1] - time[start])
            found.append(
                Finding(
                    "stuck channel",
                    Verdict.WRONG if seconds > 5.0 * STUCK_S else Verdict.LOOK,
                    f"column '{name}' stays at {triad[start, k]:.6g} for {seconds:.4g} s ({length} rows) from "
                    f"{time[start]:.6g} s on while the other {sensor} change: the axis is stuck there",
                    "cut the log there, or check the sensor and the export",
                    figures={"stuck_s": seconds, "from_s": float(time[start])},
                )
            )
        found += _clipped(triad, step, names[first : first + 3], "gyro" if first == 1 else "accel")
    found += _copies(np.hstack((gyro, accel)), names[1:])
    if not found:
        found.append(Finding("channels", Verdict.OK, "six channels, none stuck, clipped or there twice"))
    return found


def is_noisy(values: Array) -> bool:
    """Whether a channel has the noise of a sensor; ideal simulated ones have none, and may well be constant."""
    head = values[: min(values.size, SAMPLE)]
    bend = np.abs(np.diff(head, 2))
    return bool(bend.size and np.mean(bend > 0.0) > 0.3 and np.mean(bend) > 1e-3 * np.std(head))


def longest_run(same: Array) -> tuple[int, int]:
    """First row and number of rows of the longest run of equal values."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], same, [False])).astype(np.int8)))
    if not edges.size:
        return 0, 1
    lengths = edges[1::2] - edges[::2]
    k = int(np.argmax(lengths))
    return int(edges[2 * k]), int(lengths[k]) + 1


def _coarse(same: Array, length: int) -> bool:
    """Whether runs nearly as long are usual, as with a coarse converter at rest."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], same, [False])).astype(np.int8)))
    lengths = np.sort(edges[1::2] - edges[::2])[::-1]
    return lengths.size > 3 and bool(lengths[3] > 0.3 * length)


def _clipped(triad: Array, step: float, names: Sequence[str], sensor: str) -> list[Finding]:
    """Values that pile up at the largest of a channel, several in succession."""
    found = []
    for k, name in enumerate(names):
        values = triad[:, k]
        spread = float(np.std(values))
        for limit in (float(values.max()), float(values.min())):
            at = values == limit
            count = int(np.count_nonzero(at))
            if count < CLIPPED_ROWS or spread == 0.0 or abs(limit - float(np.median(values))) < spread:
                continue
            _, run = longest_run(at[1:] & at[:-1])
            if run < CLIPPED_RUN or count < 5 * _usual_count(values, limit):
                continue
            scale = _full_scale(abs(limit), sensor)
            found.append(
                Finding(
                    "saturation",
                    Verdict.LOOK,
                    f"column '{name}': {count} rows sit at exactly {limit:.6g}, up to {run} in succession "
                    f"({run * step:.3g} s): the channel is clipped at its range{scale}",
                    "the motion beyond it is lost; use a sensor or a setting with a wider range",
                    figures={"limit": limit, "rows": float(count)},
                )
            )
    return found


def _usual_count(values: Array, limit: float) -> int:
    """How often the ten values next to the limit occur, the most frequent of them."""
    beside = values[np.abs(values - limit) < 0.1 * abs(limit)]
    levels, counts = np.unique(beside[beside != limit], return_counts=True)
    nearest = np.argsort(np.abs(levels - limit))[:10]
    return int(counts[nearest].max(initial=1))


def _full_scale(limit: float, sensor: str) -> str:
    size, ranges, unit = (np.pi / 180.0, _GYRO_SCALES, "deg/s") if sensor == "gyro" else (_G, _ACCEL_SCALES, "g")
    for full in ranges:
        if abs(limit / (full * size) - 1.0) < 0.03:
            return f", about {full:g} {unit}"
    return ""


def _copies(values: Array, names: Sequence[str]) -> list[Finding]:
    found = []
    for k in range(1, values.shape[1]):
        for j in range(k):
            if np.ptp(values[:, k]) > 0.0 and np.array_equal(values[:, j], values[:, k]):
                message = f"column '{names[k]}' is a copy of '{names[j]}'"
                remedy = "export the log again; noise never comes twice"
                found += [Finding("columns", Verdict.WRONG, message, remedy)]
    return found


def per_second(values: Array, time: Array, kind: str) -> Array:
    """Rates of some twenty thousand rows, spread over the log."""
    sample = slice(1, None, max(1, (time.size - 1) // SAMPLE))
    if kind == "rates":
        return values[sample]
    return values[sample] / np.diff(time)[:: sample.step, None]


def _exchanged(gyro: Array, accel: Array, time: Array, kind: str) -> str:
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


def _accel_unit(
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


def _gyro_unit(
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
        fault, _, remedy = message.partition(": rename to ")
        remedy = f"rename to {remedy}" if remedy else "check the unit of the gyro columns"
        order = _other_order(time, gyro, accel, kind)
        if order:
            message = (
                f"{fault.partition(', but only')[0]}; as they stand in the file they cannot be the rates of these axes"
            )
            finding = Finding(
                "gyro order", Verdict.WRONG, message, f"correct the gyro columns: {order}", figures=figures
            )
            return 1.0, finding
        factor = np.pi / 180.0
        try:
            tried(factor)
        except InputError:
            factor = 1.0
        return factor, Finding("gyro unit", Verdict.WRONG, fault, remedy, figures=figures)
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
