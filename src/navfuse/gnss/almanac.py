"""GPS almanac files, YUMA and SEM, as constellations."""

from __future__ import annotations

import math
import os
import re
from pathlib import Path

import numpy as np

from navfuse.errors import ConfigError, InputError
from navfuse.gnss.orbits import Constellation
from navfuse.io.tables import check_file

_YUMA = {
    "id": "prn",
    "health": "health",
    "eccentricity": "eccentricity",
    "time of applicability": "toa",
    "orbital inclination": "inclination",
    "rate of right ascen": "node_rate",
    "sqrt(a)": "root",
    "right ascen at week": "node",
    "argument of perigee": "perigee",
    "mean anom": "mean_anomaly",
    "af0": "af0",
    "af1": "af1",
    "week": "week",
}
"""Beginning of a line in small letters -> what it holds; angles in radians."""
_ELEMENTS = ("eccentricity", "inclination", "node", "node_rate", "perigee", "mean_anomaly", "toa")
_NEEDED = ("prn", "health", "root", *_ELEMENTS)
_SEM_RECORD = (
    "prn", "svn", "ura", "eccentricity", "inclination", "node_rate", "root", "node", "perigee", "mean_anomaly",
    "af0", "af1", "health", "configuration",
)  # fmt: skip
_SEM_SEMICIRCLES = ("inclination", "node_rate", "node", "perigee", "mean_anomaly")
_SEM_INCLINATION = 0.30

Record = dict[str, float]


def read_almanac(path: str | os.PathLike[str], *, healthy_only: bool = True) -> Constellation:
    """Read a GPS almanac.

    Parameters
    ----------
    path : path-like
        YUMA (``.alm``, ``.txt``) or SEM (``.al3``).
    healthy_only : bool
        Leave out satellites whose health is not 0.

    Returns
    -------
    Constellation
        Satellites "G01" ... by number. Time zero is the beginning of the almanac's week.

    Raises
    ------
    InputError
        If the file is missing, of another kind, incomplete, or holds no healthy satellite; the message names the line.

    Notes
    -----
    The clocks of the satellites (af0, af1) are not used. Sources: IS-GPS-200, 20.3.3.5.2 and, for SEM (semicircles,
    inclination as offset from 0.30), ICD-GPS-240, table 30-III.
    """
    path = check_file(path, (".alm", ".txt", ".yuma", ".al3", ".sem"))
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: holds characters that an almanac does not have; is it a YUMA or SEM file?"
        ) from error
    records = _sem(lines, path) if path.suffix.lower() in (".al3", ".sem") else _yuma(lines, path)
    if not records:
        raise InputError(f"{path}: holds no satellite; a YUMA record begins with a line 'ID: ...'")
    records = [record for record in records if record["health"] == 0.0 or not healthy_only]
    if not records:
        raise InputError(
            f"{path}: no satellite of the almanac is healthy; healthy_only = false takes them all the same"
        )
    records.sort(key=lambda record: record["prn"])
    columns = {name: np.array([record[name] for record in records]) for name in _NEEDED}
    try:
        return Constellation(
            tuple(f"G{int(number):02d}" for number in columns["prn"]),
            semi_major=columns["root"] ** 2,
            **{name: columns[name] for name in _ELEMENTS},
        )
    except ConfigError as error:
        raise InputError(f"{path}: {error}") from error


def _yuma(lines: list[str], path: Path) -> list[Record]:
    records: list[Record] = []
    begun: list[int] = []
    for number, line in enumerate(lines, 1):
        label, colon, text = line.partition(":")
        known = next((name for name in _YUMA if label.strip().lower().startswith(name)), None)
        if not colon or known is None:
            continue
        if known == "id":
            records.append({})
            begun.append(number)
        if not records:
            raise InputError(f"{path}: line {number}: '{label.strip()}' stands before the first 'ID' of a satellite")
        records[-1][_YUMA[known]] = _number(text, path, number)
    for record, number in zip(records, begun, strict=True):
        missing = [name for name in _NEEDED if name not in record]
        if missing:
            raise InputError(f"{path}: the record from line {number} on lacks {', '.join(missing)}; is it cut off?")
    return records


def _sem(lines: list[str], path: Path) -> list[Record]:
    words = [(word, number) for number, line in enumerate(lines[1:], 2) for word in line.split()]
    header = re.match(r"\s*(\d+)\b", lines[0])
    if header is None or len(words) < 2:
        raise InputError(f"{path}: line 1 has to begin with the number of records, line 2 to hold week and time")
    values = [_number(word, path, number) for word, number in words]
    count, length = int(header[1]), len(_SEM_RECORD)
    if len(values) != 2 + count * length:
        raise InputError(
            f"{path}: {count} records of {length} numbers are announced, {len(values) - 2} are there; is it cut off?"
        )
    records = []
    for k in range(count):
        record = dict(zip(_SEM_RECORD, values[2 + k * length : 2 + (k + 1) * length], strict=True))
        record["inclination"] += _SEM_INCLINATION
        records.append(record | {name: record[name] * math.pi for name in _SEM_SEMICIRCLES} | {"toa": values[1]})
    return records


def _number(text: str, path: Path, line: int) -> float:
    try:
        number = float(text)
    except ValueError as error:
        raise InputError(f"{path}: line {line}: {text.strip()!r} is not a number") from error
    if not math.isfinite(number):
        raise InputError(f"{path}: line {line}: {text.strip()!r} is not a finite number")
    return number
