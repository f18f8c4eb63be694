"""A project file to begin with, every value with where it came from."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from navfuse.inspection.findings import FileReport, Finding, Inspection, Verdict

_DEFAULTS: Mapping[str, tuple[Any, str]] = {
    "imu.axes": ("FRD", "the default: the logs do not tell what x, y, z point to"),
    "imu.time_offset_s": (0.0, "the default: no offset was found, or none could be"),
    "imu.grade": ("industrial-mems", "the default: nothing is known of the sensor; take the grade of its data sheet"),
    "gnss.lever_arm_m": ([0.0, 0.0, 0.0], "not in any log: measure from the IMU to the antenna, forward, right, down"),
}
_SAID_BY = {
    "imu.axes": "axes",
    "imu.time_offset_s": "time offset",
    "imu.grade": "noise at rest",
}
_GUESSED = {"gnss.sd_scale"}


def draft_project(found: Inspection, folder: str | os.PathLike[str] = ".") -> str:
    """A project file for the logs of an inspection.

    Parameters
    ----------
    found : Inspection
    folder : path-like
        Where the file is going to be; logs are named relative to it where they can be.

    Returns
    -------
    str
        TOML. What is certainly wrong in the logs stands at its head: it has to be put right first.

    Raises
    ------
    KeyError
        If none of the files is an inertial log.
    """
    imu = found.of("imu")
    gnss = next((report for report in found.files if report.role == "gnss"), None)
    lines = ["# Draft of a project by navfuse inspect: check every value; `navfuse config --help-keys` lists all keys."]
    lines += [f"# WRONG, correct it first: {_comment(text)}" for text in found.wrong()]
    others = [report for report in found.files if report is not imu and report is not gnss]
    lines += [
        f"# also inspected, not used by a run yet: {_comment(_name(report, folder))} ({report.role})"
        for report in others
    ]
    values = _values(found)
    for section, report in (("imu", imu), ("gnss", gnss)):
        if report is None:
            continue
        lines += ["", f"[{section}]", f"# {_comment(report.format)}: {_comment(report.summary)}"]
        lines.append(f"file = {_toml(_name(report, folder))}")
        for key, (value, reason) in values.items():
            table, _, name = key.partition(".")
            if table == section:
                lines += [f"# {_comment(reason)}", f"{name} = {_toml(value)}"]
    return "\n".join(lines) + "\n"


def _values(found: Inspection) -> dict[str, tuple[Any, str]]:
    """Key -> value and reason: what the logs say, else a default."""
    values = {key: _default(key, default, found.findings) for key, default in _DEFAULTS.items()}
    for one in found.findings:
        for key, value in one.settings.items():
            if key not in _GUESSED:
                values[key] = (value, f"{_mark(one)}{one.message}")
    return values


def _default(key: str, default: tuple[Any, str], findings: tuple[Finding, ...]) -> tuple[Any, str]:
    """The default, with what the check said that might have found another value."""
    check = _SAID_BY.get(key)
    for one in findings:
        if one.check == check:
            return default[0], f"{default[1] if one.verdict is not Verdict.OK else 'found'}: {one.message}"
    return default


def _mark(one: Finding) -> str:
    return "" if one.verdict is Verdict.OK else f"{str(one.verdict).upper()}: "


def _name(report: FileReport, folder: str | os.PathLike[str]) -> str:
    """A path as it is written into a project in that folder."""
    path, base = Path(report.path).resolve(), Path(folder).resolve()
    return path.relative_to(base).as_posix() if path.is_relative_to(base) else path.as_posix()


def _toml(value: Any) -> str:
    """Texts, numbers and lists of them are written alike in TOML and JSON."""
    return json.dumps(value, ensure_ascii=False)


def _comment(text: str) -> str:
    """What may stand in a comment of TOML: one line, no control characters."""
    return re.sub(r"[\x00-\x1f\x7f\ud800-\udfff]+", " ", text)
