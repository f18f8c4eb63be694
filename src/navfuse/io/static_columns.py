"""Columns of a record of a sensor at rest, in SI units: those of a native table, or those that a layout names."""

from __future__ import annotations

import os
import re
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal
from zipfile import BadZipFile

import numpy as np

from navfuse.errors import ConfigError, InputError
from navfuse.io.columns import match_columns
from navfuse.io.imu_table import INCREMENTS, RATES, TIME
from navfuse.io.tables import check_file, open_table
from navfuse.io.unit_text import parse_quantity
from navfuse.io.units import UNITS

Array = np.ndarray

TABLES = (".csv", ".parquet")
ARRAYS = (".npz", ".mat")
TEXTS = (".txt", ".dat", ".imu", ".asc", ".tsv")

_AXES = "xyz"
_QUANTITY = {"gyro": ("angular rate", "angle"), "accel": ("acceleration", "speed")}


@dataclass(frozen=True, slots=True)
class RecordLayout:
    """Where a file that is no native table keeps its data.

    Attributes
    ----------
    gyro, accel : str
        Name of an array of three columns, three names, or three column numbers counted from 1, separated by commas; ""
        for the names of the native table, or none.
    gyro_unit, accel_unit : str
        Unit, with a number before it for a scale; "" to take it from the name. A unit of angle or speed says that the
        values are increments.
    time : str
        Name or number of the column of seconds; "" for none or the native name.
    rate_hz : float or None
        Sampling rate, for a file without time.
    skip_rows : int
        Rows of numbers at the beginning of a text file that are not data.
    """

    gyro: str = ""
    accel: str = ""
    gyro_unit: str = ""
    accel_unit: str = ""
    time: str = ""
    rate_hz: float | None = None
    skip_rows: int = 0


@dataclass(slots=True)
class RawColumns:
    """Columns in SI units, rates or increments, before they are put on a grid of time.

    Attributes
    ----------
    values : dict
        "gyro x" to "accel z" -> (n,) array.
    kind : {"rates", "increments"}
    time : (n,) array or None [s]
    temperature : (n,) array or None [degree Celsius]
    file_rate : float or None [Hz]
        What the file says of its rate.
    names : dict
        "gyro x" to "accel z" -> its name in the file.
    unused : dict
        Name -> column that nobody asked for.
    """

    values: dict[str, Array]
    kind: Literal["rates", "increments"]
    time: Array | None
    temperature: Array | None
    file_rate: float | None
    names: dict[str, str]
    unused: dict[str, Array] = field(default_factory=dict)


def read_columns(path: str | os.PathLike[str], layout: RecordLayout) -> RawColumns:
    """Read the columns of a record.

    Parameters
    ----------
    path : path-like
    layout : RecordLayout

    Returns
    -------
    RawColumns

    Raises
    ------
    InputError
        If the file cannot be read or lacks what is asked for.
    ConfigError
        For a unit or a layout that makes no sense, or one that nothing is done with.
    """
    source = check_file(path, (*TABLES, *ARRAYS, *TEXTS))
    extension = source.suffix.lower()
    if layout.skip_rows and extension not in TEXTS:
        raise ConfigError(f"{source}: --skip-rows is for text without a header ({', '.join(TEXTS)}); leave it out")
    if extension in TABLES and not layout.gyro and not layout.accel:
        _refuse_unused(str(source), layout, ("gyro_unit", "accel_unit", "time"))
        return _native(source)
    columns = _columns(source, extension, layout.skip_rows)
    return _picked(str(source), columns, layout)


def _refuse_unused(source: str, layout: RecordLayout, options: tuple[str, ...]) -> None:
    """A unit that nothing is done with is a misunderstanding."""
    for name in options:
        if getattr(layout, name):
            option, sensor = name.replace("_", "-"), name.split("_")[0]
            wanted = f"--{sensor}" if name.endswith("unit") else "--gyro or --accel"
            raise ConfigError(
                f"{source}: --{option} {getattr(layout, name)!r} is for columns that are named with {wanted}; name "
                f"them too, or leave --{option} out"
            )


def _native(path: Path) -> RawColumns:
    table = open_table(path)
    match = match_columns(table.names, (TIME, *RATES, *INCREMENTS), table.source)
    both = [[f for f in group if f.base in match.column] for group in (RATES, INCREMENTS)]
    if both[0] and both[1]:
        raise InputError(f"{table.source}: the table holds rates and increments; keep one of the two")
    fields = both[0] or both[1]
    if not fields:
        raise InputError(
            f"{table.source}: no column of an inertial sensor, such as {RATES[0].name} or {INCREMENTS[0].name}; say "
            "which columns to take with --gyro and --accel, and their units"
        )
    warm = next((name for name in table.names if re.fullmatch(r"temp(erature)?_(c|degc)", name)), None)
    has_time = "time" in match.column
    read = table.read([match.column[f.base] for f in fields] + ([match.column["time"]] if has_time else []) +
                      ([warm] if warm else []))  # fmt: skip
    values, names = {}, {}
    for f in fields:
        sensor = "gyro" if f.base.startswith(("gyro", "dtheta")) else "accel"
        values[f"{sensor} {f.base[-1]}"] = (
            np.asarray(read[match.column[f.base]], dtype=np.float64) * match.factor[f.base]
        )
        names[f"{sensor} {f.base[-1]}"] = match.column[f.base]
    time = np.asarray(read[match.column["time"]], dtype=np.float64) * match.factor["time"] if has_time else None
    kind = "rates" if both[0] else "increments"
    return RawColumns(values, kind, time, read.get(warm) if warm else None, None, names)


def _columns(path: Path, extension: str, skip_rows: int) -> dict[str, Array]:
    """Every array of a file by name, or every column of a table or text by its name or number."""
    if extension in TABLES:
        table = open_table(path)
        return {name: np.asarray(column, dtype=np.float64) for name, column in table.read(table.names).items()}
    try:
        if extension == ".npz":
            with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
                return {name: archive[name] for name in archive.files}
        if extension == ".mat":
            from scipy.io import loadmat
            from scipy.io.matlab import MatReadError

            try:
                content = loadmat(path)
            except (MatReadError, IndexError, EOFError, OverflowError, MemoryError, struct.error, zlib.error) as error:
                raise ValueError(str(error) or type(error).__name__) from error
            return {name: np.asarray(value) for name, value in content.items() if not name.startswith("__")}
    except (OSError, ValueError, KeyError, NotImplementedError, TypeError, EOFError, BadZipFile, zlib.error) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise InputError(f"{path}: not a readable {extension} file: {reason}") from error
    import io

    import pandas as pd

    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        rows = [line for line in lines if line.strip() and not line.lstrip().startswith(("%", "#"))][skip_rows:]
        if not rows:
            raise InputError(f"{path}: no rows of numbers after {skip_rows} that are skipped")
        separator = r"\s*[,;]\s*|\s+"
        width = len(re.split(separator, rows[0].strip()))
        text = io.StringIO("\n".join(re.sub(r"[,;\t]", " ", row) for row in rows))
        table = pd.read_csv(text, sep=r"\s+", header=None, names=range(width), dtype=np.float64, engine="c")
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{path}: not a table of numbers ({str(error).splitlines()[0]}); skip rows of a header with --skip-rows"
        ) from error
    return {str(k + 1): table[k].to_numpy() for k in range(width)}


def _picked(source: str, columns: Mapping[str, Array], layout: RecordLayout) -> RawColumns:
    """The columns that the layout names, in SI units."""
    values, kinds, taken, labels = {}, {}, [], {}
    for sensor in ("gyro", "accel"):
        wanted = getattr(layout, sensor)
        names = [name.strip() for name in wanted.split(",")] if wanted else _guess(columns, sensor, layout)
        if not names:
            _refuse_unused(source, layout, (f"{sensor}_unit",))
            continue
        twice = next((name for k, name in enumerate(names) if name in [*names[:k], *taken]), None)
        if twice is not None:
            raise ConfigError(f"{source}: column {twice!r} is named twice with --gyro and --accel; an axis has its own")
        taken += names
        found = [(name, column) for name in names for column in _one(source, columns, name, sensor)]
        unit = getattr(layout, f"{sensor}_unit") or _unit_of_name(names[0], sensor)
        if not unit:
            raise ConfigError(f"{source}: the unit of {names[0]!r} is not known; give it with --{sensor}-unit")
        measure, quantity = parse_quantity(unit, *_QUANTITY[sensor], what=f"--{sensor}-unit")
        kinds[sensor] = "rates" if quantity == _QUANTITY[sensor][0] else "increments"
        if len(found) > 3:
            raise ConfigError(f"{source}: --{sensor} names {len(found)} columns; a sensor has at most three axes")
        for axis, (name, array) in zip(_AXES, found, strict=False):
            values[f"{sensor} {axis}"] = np.asarray(array, dtype=np.float64) * measure.value
            labels[f"{sensor} {axis}"] = name
    if not values:
        raise InputError(
            f"{source}: say which of its columns to take with --gyro and --accel; it has "
            f"{', '.join(list(columns)[:20])}"
        )
    if len(set(kinds.values())) > 1:
        raise ConfigError(
            f"{source}: the gyros are {kinds['gyro']} and the accelerometers {kinds['accel']} by their units; "
            f"give "
            "both as rates, or both as increments"
        )
    sizes = {name: array.size for name, array in values.items()}
    if len(set(sizes.values())) > 1:
        raise InputError(f"{source}: the columns have different lengths: {sizes}")
    time = None
    if layout.time:
        (time,) = _one(source, columns, layout.time, "time")
        time = np.asarray(time, dtype=np.float64)
    elif "time_s" in columns and columns["time_s"].ndim == 1:
        time = np.asarray(columns["time_s"], dtype=np.float64)
    rate = columns.get("rate_hz")
    file_rate = None if rate is None or np.size(rate) != 1 else float(np.ravel(rate)[0])
    spare = {
        name: column for name, column in columns.items()
        if name not in taken and np.ndim(column) == 1 and column.dtype.kind in "fiu"
    }  # fmt: skip
    return RawColumns(values, next(iter(kinds.values())), time, None, file_rate, labels, spare)


def _guess(columns: Mapping[str, Array], sensor: str, layout: RecordLayout) -> list[str]:
    """Arrays named like the sensor, if nothing was said about either."""
    if layout.gyro or layout.accel:
        return []
    known = [name for name in columns if name.startswith(sensor) and np.ndim(columns[name]) == 2]
    return known[:1]


def _unit_of_name(name: str, sensor: str) -> str:
    suffix = name.rsplit("_", 1)[-1]
    written = {"degps": "deg/s", "dps": "deg/s", "radps": "rad/s", "degph": "deg/h", "dph": "deg/h", "mps2": "m/s^2",
               "g": "g", "mg": "mg", "ug": "ug", "rad": "rad", "mps": "m/s"}  # fmt: skip
    return written.get(suffix, "") if any(suffix in UNITS[q] for q in _QUANTITY[sensor]) else ""


def _one(source: str, columns: Mapping[str, Array], name: str, what: str) -> list[Array]:
    """The columns that a name stands for: one, or those of a two-dimensional array."""
    if name not in columns:
        raise InputError(f"{source}: no column {name!r} for --{what}; there are {', '.join(list(columns)[:20])}")
    array = np.asarray(columns[name])
    if array.dtype.kind not in "fiu":
        raise InputError(f"{source}: {name!r} holds {array.dtype}, not numbers")
    array = np.squeeze(array)
    if array.ndim == 1:
        return [array]
    if array.ndim == 2 and min(array.shape) <= 3:
        return list(array.T if array.shape[0] > array.shape[1] else array)
    raise InputError(f"{source}: {name!r} has the shape {array.shape}; wanted is one column, or three")
