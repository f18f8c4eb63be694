"""ASCII sentences of VectorNav sensors: ``$VNYMR,...*6E`` and the others, in any text around them.

A sentence begins with ``$VN`` and ends with ``*`` and the checksum: two hexadecimal digits of the exclusive or of the
bytes between ``$`` and ``*``, or four of their CRC-16 (polynomial 0x1021, start 0). What a logger wrote around it does
not matter: a time in front, a table whose last column it is, line ends inside quotation marks.
"""

from __future__ import annotations

import os
import re
import warnings
from binascii import crc_hqx
from collections import defaultdict
from dataclasses import dataclass, field
from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np

from navfuse.errors import InputError, NavfuseWarning
from navfuse.io.tables import check_file
from navfuse.io.vectornav_fields import HEXADECIMAL, SENTENCES
from navfuse.io.vectornav_messages import Damage, Messages, VectorNavLog

Array = np.ndarray

EXTENSIONS = (".txt", ".log", ".csv", ".asc", ".ascii", ".vn", ".dat", ".nmea")

_START = re.compile(rb"\$VN[A-Z0-9]{3}")
SENTENCE = re.compile(rb"\$(VN[A-Z0-9]{3})([^$*\r\n]*)\*([0-9A-Fa-f]{4}|[0-9A-Fa-f]{2})(?![0-9A-Fa-f])")
_APPENDED = re.compile(rb"[CTSP][0-9A-Fa-f]+")
_TIME_NAMES = {"t", "time", "timestamp", "stamp", "secs", "seconds"}
_TIME_UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_UNIX = 1e9
_ABSURD = 1e9
_MIN_SHARE = 0.99


def xor_checksum(data: bytes) -> int:
    """Exclusive or of all bytes."""
    return reduce(xor, data, 0)


def sentence(header: str, fields: str, *, crc: bool = False) -> str:
    """A sentence with its checksum, without line end.

    Parameters
    ----------
    header : str
        "VNYMR".
    fields : str
        What follows, without the first comma.
    crc : bool
        16-bit checksum instead of the 8-bit one.
    """
    body = f"{header},{fields}"
    check = f"{crc_hqx(body.encode(), 0):04X}" if crc else f"{xor_checksum(body.encode()):02X}"
    return f"${body}*{check}"


@dataclass(slots=True)
class _Found:
    rows: list[list[float]] = field(default_factory=list)
    stamps: list[float] = field(default_factory=list)
    index: list[int] = field(default_factory=list)
    seen: int = 0


def read_vectornav_ascii(path: str | os.PathLike[str]) -> VectorNavLog:
    """Read every sentence of a text file.

    Sentences with a wrong checksum and cut ones are left out, counted and warned about once. If the file has a first
    line with a column named ``t``, ``time`` or ``timestamp`` (with or without a unit: ``time_ns``), or every line
    begins with a number that never decreases, that is the time of the sentences of the line: in the unit that the
    column names, else that in which it is a plausible time since 1970, else seconds.

    Parameters
    ----------
    path : path-like
        A text file.

    Returns
    -------
    VectorNavLog

    Raises
    ------
    InputError
        If the file cannot be read or has no sound sentence with measurements.

    Warns
    -----
    NavfuseWarning
        For broken sentences, and for a time whose unit had to be guessed.
    """
    file = check_file(path, EXTENSIONS)
    data = file.read_bytes()
    log = parse_sentences(data, str(file))
    for note in log.notes:
        warnings.warn(note, NavfuseWarning, stacklevel=2)
    return log


def parse_sentences(data: bytes, source: str) -> VectorNavLog:
    """The sentences of a file's bytes; see :func:`read_vectornav_ascii`."""
    column, unit = _time_column(data)
    found: dict[str, _Found] = defaultdict(_Found)
    checksum = cut = other = 0
    first = ""
    for start in _START.finditer(data):
        at = start.start()
        header = data[at + 1 : at + 6].decode()
        group = found[header]
        group.seen += 1
        match = SENTENCE.match(data, at)
        fault = ""
        if match is None:
            cut += 1
            fault = "is cut off"
        elif not _sound(match):
            checksum += 1
            fault = f"has checksum {match[3].decode()}, which does not belong to it"
        elif header not in SENTENCES:
            other += 1
        else:
            row = _numbers(header, match[2])
            if row is None:
                cut += 1
                fault = "has other fields than its header promises"
            else:
                group.rows.append(row)
                group.stamps.append(_stamp(data, at, column))
                group.index.append(group.seen - 1)
        if fault and not first:
            line = 1 + data.count(b"\n", 0, at)
            first = f"line {line} ({header} {fault})"
    messages = {header: _messages(header, group) for header, group in found.items() if group.rows}
    damage = Damage(checksum, cut, other, 0, first)
    if not messages:
        raise InputError(_nothing(data, source, damage))
    notes = []
    if checksum + cut:
        whole = sum(len(m) for m in messages.values()) + other + checksum + cut
        notes.append(
            f"{source}: {checksum} sentences with a wrong checksum and {cut} cut ones of {whole} were left out, the"
            f" first is {first}; check the cable and the rate of the serial line if they are many"
        )
    messages = _timed(messages, unit, source, notes)
    return VectorNavLog(messages, damage, source, tuple(notes))


def without_sentences(data: bytes) -> bytes:
    """Data without its sound sentences, and without the line ends behind them."""
    return re.sub(SENTENCE.pattern + rb"(?:\r?\n)?", lambda match: b"" if _sound(match) else match[0], data)


def _sound(match: re.Match[bytes]) -> bool:
    body = match[1] + match[2]
    told = int(match[3], 16)
    return told == (crc_hqx(body, 0) if len(match[3]) == 4 else xor_checksum(body))


def _numbers(header: str, text: bytes) -> list[float] | None:
    """The numbers of a sentence in order, None if they are not those of its header."""
    parts = text.split(b",")[1:]
    while parts and _APPENDED.fullmatch(parts[-1].strip()):
        parts.pop()
    names = SENTENCES[header]
    if len(parts) != sum(count for _, count in names):
        return None
    row: list[float] = []
    at = 0
    try:
        for name, count in names:
            row += [float(int(part, 16)) if name in HEXADECIMAL else float(part) for part in parts[at : at + count]]
            at += count
            # Times, weeks and counts have to be numbers; of a vector the logs leave out what is not.
            if count == 1 and not abs(row[-1]) < _ABSURD:
                return None
    except ValueError:
        return None
    return row


def _messages(header: str, group: _Found) -> Messages:
    table = np.array(group.rows)
    values: dict[str, Array] = {}
    at = 0
    for name, count in SENTENCES[header]:
        part = table[:, at] if count == 1 else table[:, at : at + count]
        if name.endswith("tow_s"):
            name, part = name[:-1] + "ns", np.rint(part * 1e9).astype(np.int64)
        values[name] = part
        at += count
    return Messages(header, values, np.array(group.stamps), np.array(group.index))


def _time_column(data: bytes) -> tuple[int, float | None]:
    """Which field of a line is its time, and its unit [s], None if that is not told."""
    line = data[: data.find(b"\n") if b"\n" in data else len(data)].decode("utf-8", "replace")
    if "$" in line:
        return 0, None
    for k, name in enumerate(_split(line)):
        stem, _, unit = name.strip("\"' \ufeff").lower().rpartition("_")
        if unit in _TIME_UNITS and stem in _TIME_NAMES:
            return k, _TIME_UNITS[unit]
        if (f"{stem}_{unit}" if stem else unit) in _TIME_NAMES:
            return k, None
    return (-1, None) if line.strip() and not _is_number(_split(line)[0]) else (0, None)


def _stamp(data: bytes, at: int, column: int) -> float:
    """The time in front of a sentence in its line, NaN without one."""
    if column < 0:
        return np.nan
    before = data[data.rfind(b"\n", 0, at) + 1 : at].decode("ascii", "replace")
    parts = _split(before)
    if column >= len(parts) or not _is_number(parts[column]):
        return np.nan
    return float(parts[column].strip("\"' []():"))


def _split(line: str) -> list[str]:
    return re.split(r"[,;\t]|(?<=\S) +(?=\S)", line.strip())


def _is_number(text: str) -> bool:
    try:
        return bool(np.isfinite(float(text.strip("\"' []():"))))
    except ValueError:
        return False


def _timed(messages: dict[str, Messages], unit: float | None, source: str, notes: list[str]) -> dict[str, Messages]:
    """The messages with their stamps in seconds; without, if what stands in front of them is no time."""
    stamps = np.concatenate([m.stamp for m in messages.values()])
    given = np.isfinite(stamps)
    if not given.any():
        return messages
    ordered = all((np.diff(m.stamp[np.isfinite(m.stamp)]) >= 0.0).mean() >= _MIN_SHARE for m in messages.values()
                  if np.isfinite(m.stamp).sum() > 1)  # fmt: skip
    if given.mean() < _MIN_SHARE or not ordered or np.ptp(stamps[given]) == 0.0:
        notes.append(
            f"{source}: the numbers in front of the sentences are not a time that increases line by line; not used"
        )
        return {kind: Messages(kind, m.values, np.full(len(m), np.nan), m.index) for kind, m in messages.items()}
    if unit is None:
        size = float(np.median(stamps[given])) / _UNIX
        unit = next((u for u in (1e-9, 1e-6, 1e-3) if 1.0 <= size * u < 10.0), 1.0)
        if unit != 1.0:
            notes.append(
                f"{source}: the times in front of the sentences count {1.0 / unit:.0e} to the second since 1970, by"
                " their size; name the unit in the first line to be sure"
            )
    return {kind: Messages(kind, m.values, m.stamp * unit, m.index) for kind, m in messages.items()}


def _nothing(data: bytes, source: str, damage: Damage) -> str:
    if damage.checksum or damage.cut:
        return (
            f"{source}: all {damage.checksum + damage.cut} VectorNav sentences are broken, the first is {damage.first};"
            " log the serial line again, without changing what it sends"
        )
    if damage.other:
        return (
            f"{source}: of the {damage.other} VectorNav sentences none holds measurements; known are"
            f" {', '.join(SENTENCES)}"
        )
    binary = " It looks like the binary protocol: use read_vectornav_binary" if data.count(b"\xfa") > 1 else ""
    return f"{source}: there is no VectorNav sentence ($VN...) in it.{binary}"


def is_vectornav_ascii(path: Path) -> bool:
    """Whether one of the first lines of a file holds a sentence."""
    with path.open("rb") as stream:
        return _START.search(stream.read(4096)) is not None
