"""The import doctor: files in, findings out."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from navfuse.data.logs import GnssLog, ImuLog
from navfuse.data.trajectory import Trajectory
from navfuse.errors import ConfigError, InputError, NavfuseError
from navfuse.inspection.declared import NOTHING, Declared
from navfuse.inspection.findings import FileReport, Finding, Inspection, Verdict
from navfuse.inspection.gnss_checks import check_gnss, read_raw_gnss
from navfuse.inspection.imu_checks import check_imu, read_raw_imu
from navfuse.inspection.pair_checks import check_imu_axes, check_pair, check_speed, check_truth
from navfuse.inspection.recognise import GNSS, TRUTH, Recognised, part_columns, recognise, without_source
from navfuse.inspection.rest import check_rest
from navfuse.inspection.time_checks import check_stamps
from navfuse.io import aiding_tables
from navfuse.io.gnss_table import read_gnss
from navfuse.io.imu_table import INCREMENTS, RATES, TIME, read_imu
from navfuse.io.raw_gnss_table import read_raw_gnss as read_pseudoranges
from navfuse.io.static_record import StaticRecord, read_static
from navfuse.io.trajectory_table import read_trajectory

Array = np.ndarray

_AIDING: dict[str, Callable[..., Any]] = {
    "odometer": aiding_tables.read_odometer,
    "wheel speeds": aiding_tables.read_wheel_speeds,
    "heading": aiding_tables.read_heading,
    "magnetometer": aiding_tables.read_magnetometer,
    "barometer": aiding_tables.read_barometer,
    "body velocity": aiding_tables.read_body_velocity,
    "uwb": aiding_tables.read_uwb,
    "anchors": aiding_tables.read_uwb_anchors,
    "raw gnss": read_pseudoranges,
}


_ADVICE = re.compile(r"; these |; are these |: rename |\. Stamps in steps |\. Does the clock |; only as ")
"""Where the guess at a cause begins in what readers say."""
_EXPLAINED = ("columns", "accelerometer unit", "gyro unit", "gyro order", "stamps", "position", "velocity")
"""Checks that see more than the readers: where one is certain, the guess of a reader is left out."""
_SPOILING = ("stuck channel", "columns", "gyro order")
"""Faults of single channels, after which signs and handedness cannot be told."""


@dataclass(slots=True)
class _Logs:
    """What was read, for the checks between files: the first of each role."""

    imu: tuple[int, ImuLog] | None = None
    gnss: GnssLog | None = None
    truth: Trajectory | None = None
    odometer: Any = None


def inspect(
    files: str | os.PathLike[str] | Iterable[str | os.PathLike[str]], *, declared: Declared = NOTHING
) -> Inspection:
    """Find out what files are, and whether they can be what they say.

    Parameters
    ----------
    files : path-like or iterable of them
        Logs of one drive: inertial, GNSS, reference, other sensors. What each is, is found out.
    declared : Declared
        What a project says about them.

    Returns
    -------
    Inspection
        A finding for every check; nothing is raised for what is wrong in a file.

    Raises
    ------
    InputError
        If there is no file to inspect.
    """
    paths = [files] if isinstance(files, str | os.PathLike) else list(files)
    if not paths:
        raise InputError("no file to inspect; name one or more logs")
    logs = _Logs()
    reports = []
    for path in paths:
        reports += _inspect_file(Path(path), declared, logs, len(reports))
    between = _between(reports, logs, declared)
    return Inspection(tuple(reports), tuple(between))


def _inspect_file(path: Path, declared: Declared, logs: _Logs, at: int) -> list[FileReport]:
    found = recognise(path)
    if found.fault:
        verdict = Verdict.UNKNOWN if found.fault.startswith(("this is ", "cannot tell the format")) else Verdict.WRONG
        remedy = "convert it into a native table first" if verdict is Verdict.UNKNOWN else ""
        return [FileReport(str(path), "unknown", found.format, "", (Finding("file", verdict, found.fault, remedy),))]
    if found.role == "nineteen columns":
        parts = [
            _report(part_columns(found, part), declared, logs, at + k)
            for k, part in enumerate(("imu", "gnss", "truth"))
        ]
        return parts
    return [_report(found, declared, logs, at)]


def _report(found: Recognised, declared: Declared, logs: _Logs, at: int) -> FileReport:
    source = str(found.path)
    role = {"rtklib pos": "gnss"}.get(found.role, found.role)
    try:
        if role == "imu":
            findings, summary = _imu(found, declared, logs, at)
        elif role == "gnss":
            findings, summary = _gnss(found, declared, logs)
        elif role == "truth":
            findings, summary = _truth(found, logs)
        elif role == "static":
            findings, summary = _static(found, declared, logs, at)
            role = "imu" if logs.imu is not None and logs.imu[0] == at else "unknown"
        else:
            findings, summary = _aiding(found, role, logs)
    except NavfuseError as error:
        findings = [Finding("file", Verdict.WRONG, without_source(str(error), source))]
        summary = ""
    return FileReport(source, role, found.format, summary, tuple(findings))


def _imu(found: Recognised, declared: Declared, logs: _Logs, at: int) -> tuple[list[Finding], str]:
    source = str(found.path)
    raw = read_raw_imu(found)
    units = {base: column.unit for base, column in found.columns.items()}
    report = check_imu(raw, source, units)
    wanted = (TIME, *(RATES if raw.kind == "rates" else INCREMENTS))
    findings = [*report.findings, *_names(found, wanted, report.units)]
    if report.log is not None and logs.imu is None:
        logs.imu = (at, report.log)
    findings += _read(lambda: read_imu(source, axes="FRD", time_offset_s=0.0), source, findings)
    return findings, _summary(raw.stamps.time, raw.kind)


def _gnss(found: Recognised, declared: Declared, logs: _Logs) -> tuple[list[Finding], str]:
    source = str(found.path)
    raw = read_raw_gnss(found, declared.epoch)
    report = check_gnss(raw, source)
    findings = [*report.findings, *_names(found, GNSS, {})]
    if report.log is not None and logs.gnss is None:
        logs.gnss = report.log
    findings += _read(lambda: read_gnss(source), source, findings)
    return findings, _summary(raw.stamps.time, "fixes")


def _truth(found: Recognised, logs: _Logs) -> tuple[list[Finding], str]:
    source = str(found.path)
    kept: list[Trajectory] = []
    findings = _read(lambda: kept.append(read_trajectory(source)), source, [])
    if not kept:
        return _names(found, TRUTH, {}) or findings, ""
    truth = kept[0]
    logs.truth = logs.truth or truth
    stamps = check_stamps(truth.time, "time", "truth")
    parts = [name for name in ("velocity_n", "attitude") if getattr(truth, name) is not None]
    held = "position" + "".join(f", {name.split('_')[0]}" for name in parts)
    findings = [*stamps.findings, Finding("values", Verdict.OK, f"holds {held}"), *findings]
    return findings, _summary(truth.time, "trajectory")


def _aiding(found: Recognised, role: str, logs: _Logs) -> tuple[list[Finding], str]:
    source = str(found.path)
    kept: list[Any] = []
    findings = _read(lambda: kept.append(_AIDING[role](source)), source, [])
    if not kept:
        return findings, ""
    if role == "odometer":
        logs.odometer = logs.odometer or kept[0]
    time = getattr(kept[0], "time", None)
    if time is None or time.size < 2:
        return findings, ""
    time = np.unique(time)
    return [*check_stamps(time, "time", role).findings, *findings], _summary(time, role)


def _static(found: Recognised, declared: Declared, logs: _Logs, at: int) -> tuple[list[Finding], str]:
    source = str(found.path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            record = read_static(source)
    except ConfigError as error:
        return [_not_said(str(error), source)], ""
    except InputError as error:
        if "--gyro" in str(error) or "--rate" in str(error):
            return [_not_said(str(error), source)], ""
        raise
    return _static_record(record, source, logs, at)


def _not_said(text: str, source: str) -> Finding:
    return Finding(
        "columns",
        Verdict.UNKNOWN,
        without_source(text, source),
        "`navfuse allan` reads such files with these options; a run needs a table with native columns",
    )


def _static_record(record: StaticRecord, source: str, logs: _Logs, at: int) -> tuple[list[Finding], str]:
    by_name = {channel.name: channel.values for channel in record.channels}
    if len(by_name) < 6:
        return [Finding("columns", Verdict.UNKNOWN, f"{len(by_name)} of six channels: {', '.join(by_name)}")], ""
    gyro, accel = (np.column_stack([by_name[f"{sensor} {axis}"] for axis in "xyz"]) for sensor in ("gyro", "accel"))
    time = record.start + np.arange(gyro.shape[0]) / record.rate
    whole = np.isfinite(gyro).all(axis=1) & np.isfinite(accel).all(axis=1)
    from navfuse.inspection.imu_checks import RawImu

    stamps = check_stamps(time[whole], "time", "imu")
    names = ("time", *(f"{sensor} {axis}" for sensor in ("gyro", "accel") for axis in "xyz"))
    raw = RawImu(stamps, gyro[whole], accel[whole], "rates", names, ())
    report = check_imu(raw, source, {})
    if logs.imu is None and report.log is not None:
        logs.imu = (at, report.log)
    notes = [Finding("reader", Verdict.LOOK, without_source(note, source)) for note in record.notes]
    return [*report.findings, *notes], _summary(time, record.kind)


def _names(found: Recognised, wanted: Sequence[Any], units: dict[str, str]) -> list[Finding]:
    renames = found.renames(wanted, units)
    if not renames:
        return []
    return [
        Finding(
            "column names",
            Verdict.WRONG,
            f"{len(renames)} columns are not named as navfuse reads them",
            f"rename {', '.join(renames)}",
        )
    ]


def _read(reader: Callable[[], object], source: str, findings: Sequence[Finding]) -> list[Finding]:
    """What the reader of a run says to the file, as far as nobody else said it."""
    told = " ".join(one.message for one in findings)
    named = any(one.check == "column names" for one in findings)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            reader()
        except NavfuseError as error:
            text = without_source(str(error), source)
            if any(one.verdict is Verdict.WRONG and one.check in _EXPLAINED for one in findings):
                text = _ADVICE.split(text)[0]
            if named or text[:50] in told:
                return []
            return [Finding("reader", Verdict.WRONG, f"navfuse refuses the file: {text}")]
    notes = [without_source(str(one.message), source) for one in caught]
    found = []
    for note in dict.fromkeys(notes):
        if note[:50] in told or note.rpartition(": ")[2][:50] in told:
            continue
        if note.startswith("the IMU rows are") and "slow for an inertial log" in told:
            continue
        harmless = note.startswith("ignored columns") or ": assumed " in note
        found.append(Finding("reader", Verdict.OK if harmless else Verdict.LOOK, note))
    return found or [Finding("reader", Verdict.OK, "navfuse reads it without a remark")]


def _summary(time: Array, what: str) -> str:
    if time.size < 2:
        return f"{what}, {time.size} rows"
    step = float(np.median(np.diff(time)))
    rate = f"{1.0 / step:.4g} Hz" if step > 0.0 else "no rate"
    return f"{what}, {time.size} rows, {rate}, {time[-1] - time[0]:.6g} s"


def _is_wrong(reports: Sequence[FileReport], role: str, checks: Sequence[str]) -> bool:
    return any(
        one.verdict is Verdict.WRONG and one.check in checks
        for report in reports
        if report.role == role
        for one in report.findings
    )


def _between(reports: list[FileReport], logs: _Logs, declared: Declared) -> list[Finding]:
    """Checks between the logs; those of the axes and the noise, which fixes help, go to the file of the IMU."""
    between: list[Finding] = []
    if logs.imu is not None:
        at, imu = logs.imu
        own: list[Finding] = [check_rest(imu, logs.gnss)]
        if logs.gnss is not None and imu.time.size > 10:
            pair = check_pair(imu, logs.gnss, declared)
            if any(one.check in _SPOILING and one.verdict is Verdict.WRONG for one in reports[at].findings):
                pair = [one for one in pair if one.check not in ("handedness", "signs", "same drive", "axes change")]
            if _is_wrong(reports, "gnss", ("velocity",)):
                # Course and accelerations of fixes that contradict themselves accuse the inertial sensor falsely.
                faults = ("handedness", "signs", "turns", "same drive", "axes change", "clock drift")
                pair = [one for one in pair if one.check not in faults or one.verdict is Verdict.OK]
            if _is_wrong(reports, "imu", ("accelerometer unit", "gyro unit")):
                pair = [one for one in pair if one.check not in ("same drive", "axes change")]
            mine = ("axes", "axes change", "handedness", "signs")
            own += [one for one in pair if one.check in mine]
            between += [one for one in pair if one.check not in mine]
        else:
            own += check_imu_axes(imu, declared)
        report = reports[at]
        reports[at] = FileReport(report.path, report.role, report.format, report.summary, (*report.findings, *own))
    if logs.truth is not None and logs.gnss is not None:
        between.append(check_truth(logs.truth, logs.gnss))
    if logs.odometer is not None and logs.gnss is not None:
        between.append(check_speed(logs.odometer.time, logs.odometer.speed, logs.gnss))
    return between
