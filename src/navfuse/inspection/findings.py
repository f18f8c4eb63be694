"""What an inspection says: verdicts with their evidence, per file and between files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any


class Verdict(StrEnum):
    """How a check came out, from good to bad."""

    OK = "ok"
    UNKNOWN = "cannot tell"
    LOOK = "look"
    WRONG = "wrong"

    @property
    def rank(self) -> int:
        """0 for what is fine, 3 for what is wrong."""
        return list(Verdict).index(self)


@dataclass(frozen=True, slots=True)
class Finding:
    """The outcome of one check.

    Attributes
    ----------
    check : str
        What was looked at, in two or three words; the same for every file of a kind.
    verdict : Verdict
    message : str
        The evidence: what was found, with a number and its unit, and what it means.
    remedy : str
        What to do; empty where there is nothing to do.
    settings : mapping
        Keys of a project file with values, as ``{"imu.axes": "BRU"}``: what follows for a run.
    figures : mapping
        The numbers behind the message, their unit in the name.
    """

    check: str
    verdict: Verdict
    message: str
    remedy: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    figures: Mapping[str, float] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """Message and remedy as one sentence."""
        return f"{self.message}; {self.remedy}" if self.remedy else self.message


@dataclass(frozen=True, slots=True)
class FileReport:
    """What one file is, and what was found in it.

    Attributes
    ----------
    path : str
        As it was given.
    role : str
        "imu", "gnss", "truth", "odometer", ...; "unknown" if it could not be told.
    format : str
        In words.
    summary : str
        Rows, rate and length.
    findings : tuple of Finding
    """

    path: str
    role: str
    format: str
    summary: str
    findings: tuple[Finding, ...]

    def finding(self, check: str) -> Finding:
        """The outcome of a check by its name.

        Raises
        ------
        KeyError
            If it was not made.
        """
        return _by_name(self.findings, check)


@dataclass(frozen=True, slots=True)
class Inspection:
    """All that was found.

    Attributes
    ----------
    files : tuple of FileReport
        In the order given.
    between : tuple of Finding
        Logs against each other.
    """

    files: tuple[FileReport, ...]
    between: tuple[Finding, ...] = ()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Of all files, then those between them."""
        return (*(one for report in self.files for one in report.findings), *self.between)

    @property
    def verdict(self) -> Verdict:
        """The worst of all."""
        return max((one.verdict for one in self.findings), key=lambda verdict: verdict.rank, default=Verdict.OK)

    @property
    def settings(self) -> dict[str, Any]:
        """Keys of a project file that follow from the logs; of several values for one key the last."""
        return {key: value for one in self.findings for key, value in one.settings.items()}

    def of(self, role: str) -> FileReport:
        """The first file of a role.

        Raises
        ------
        KeyError
            If there is none.
        """
        for report in self.files:
            if report.role == role:
                return report
        raise KeyError(role)

    def pair(self, check: str) -> Finding:
        """The outcome of a check between files.

        Raises
        ------
        KeyError
            If it was not made.
        """
        return _by_name(self.between, check)

    def wrong(self) -> list[str]:
        """One sentence for everything that is certainly wrong, with the name of its file."""
        told = [
            f"{report.path}: {one.text}" for report in self.files for one in report.findings if _is_wrong(one)
        ]  # fmt: skip
        return told + [one.text for one in self.between if _is_wrong(one)]

    def to_dict(self) -> dict[str, Any]:
        """Everything, for programs."""
        return {
            "verdict": str(self.verdict),
            "files": [
                {
                    "path": report.path,
                    "role": report.role,
                    "format": report.format,
                    "summary": report.summary,
                    "findings": [_plain(one) for one in report.findings],
                }
                for report in self.files
            ],
            "between": [_plain(one) for one in self.between],
            "settings": self.settings,
        }


def _is_wrong(finding: Finding) -> bool:
    return finding.verdict is Verdict.WRONG


def _by_name(findings: Iterable[Finding], check: str) -> Finding:
    for one in findings:
        if one.check == check:
            return one
    raise KeyError(check)


def _plain(finding: Finding) -> dict[str, Any]:
    return {
        "check": finding.check,
        "verdict": str(finding.verdict),
        "message": finding.message,
        "remedy": finding.remedy,
        "settings": dict(finding.settings),
        "figures": {name: float(value) for name, value in finding.figures.items()},
    }
