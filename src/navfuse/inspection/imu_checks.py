"""Inertial logs by themselves: kind, units, dead, stuck and clipped channels, the vertical, noise at rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from navfuse.data.logs import ImuLog
from navfuse.errors import InputError
from navfuse.inspection.channel_checks import check_channels
from navfuse.inspection.findings import Finding, Verdict
from navfuse.inspection.imu_unit_checks import Kind, accel_unit, exchanged_triads, gyro_unit
from navfuse.inspection.recognise import Recognised
from navfuse.inspection.time_checks import Stamps, check_stamps
from navfuse.io.imu_table import INCREMENTS, RATES
from navfuse.io.units import UNITS, scaled

Array = np.ndarray


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
    findings: list[Finding] = []
    triads = []
    for group in (wanted[:3], wanted[3:]):
        triad = np.full((time.size, 3), np.nan)
        for axis, one in enumerate(group):
            column = found.columns.get(one.base)
            if column is not None:
                factor = UNITS[one.quantity or ""].get(column.unit, 1.0)
                triad[:, axis] = scaled(values[column.name], factor)
        triads.append(triad)
    stamps = check_stamps(time, found.columns["time"].name, "imu", values=np.hstack(triads))
    triads = [triad[stamps.rows] for triad in triads]
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
    exchanged = exchanged_triads(gyro, accel, time, raw.kind)
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
    kind, accel_factor, finding = accel_unit(time, accel, raw.kind, raw.names, source, units)
    found.append(finding)
    gravity = finding.figures.get("gravity", 1.0) > 0.0
    gyro_factor, finding = gyro_unit(time, gyro, accel * accel_factor, kind, raw.names, source, units)
    if not gravity and finding.verdict is not Verdict.OK:
        text = "the accelerometers show no gravity that the gyros could be held against"
        finding = Finding("gyro unit", Verdict.UNKNOWN, text, figures=finding.figures)
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
