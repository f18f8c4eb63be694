"""Records of a sensor at rest, as raw as they are: nothing is repaired, so that what is wrong can be found.

Native IMU tables are read by their column names. Anything else can be read by saying which columns hold what: arrays of
``.npz`` and ``.mat`` files by name, columns of text files by number, each with its unit, which may carry a scale
(``0.1 arcsec`` for a count of 0.1 arc-seconds).
"""

from __future__ import annotations

import os
import re
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
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
_SAME_RATE = 0.01
_RATES = (1e-4, 1e8)


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """One axis of one sensor.

    Attributes
    ----------
    name : str
        "gyro x" to "accel z".
    sensor : {"gyro", "accel"}
    values : (n,) array
        Rates [rad/s] or [m/s^2], on a regular grid of time; NaN where a sample is missing. Increments are divided by
        the sampling interval.
    """

    name: str
    sensor: Literal["gyro", "accel"]
    values: Array


@dataclass(frozen=True, slots=True, eq=False)
class StaticRecord:
    """What a sensor at rest put out.

    Attributes
    ----------
    channels : tuple of Channel
    rate : float [Hz]
    start : float [s]
        Stamp of the first sample.
    kind : {"rates", "increments"}
        What the file held.
    temperature : (n,) array [degree Celsius] or None
    source : str
    notes : tuple of str
        What was missing.
    """

    channels: tuple[Channel, ...]
    rate: float
    start: float
    kind: Literal["rates", "increments"]
    temperature: Array | None
    source: str
    notes: tuple[str, ...] = ()

    def between(self, begin: int, end: int) -> StaticRecord:
        """Samples `begin` to `end` (not included)."""
        channels = tuple(replace(channel, values=channel.values[begin:end]) for channel in self.channels)
        temperature = None if self.temperature is None else self.temperature[begin:end]
        return replace(self, channels=channels, temperature=temperature, start=self.start + begin / self.rate)


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


def read_static(path: str | os.PathLike[str], layout: RecordLayout | None = None) -> StaticRecord:
    """Read the record of a sensor at rest, without repairing anything.

    Parameters
    ----------
    path : path-like
        ``.csv`` or ``.parquet`` (native columns, or those that `layout` names), ``.npz`` or ``.mat`` (arrays by name),
        or text: ``.txt``, ``.dat``, ``.imu``, ``.asc``, ``.tsv``, with ``%`` or ``#`` before comments.
    layout : RecordLayout, optional

    Returns
    -------
    StaticRecord

    Raises
    ------
    InputError
        If the file cannot be read, lacks what is asked for, holds no regular samples, contradicts the given rate, or
        holds rates that look like increments or the other way round.
    ConfigError
        For a unit or a layout that makes no sense.
    """
    layout = layout or RecordLayout()
    if layout.rate_hz is not None and not (np.isfinite(layout.rate_hz) and layout.rate_hz > 0.0):
        raise ConfigError(f"rate = {layout.rate_hz} must be a finite number of samples per second, > 0")
    source = check_file(path, (*TABLES, *ARRAYS, *TEXTS))
    extension = source.suffix.lower()
    if extension in TABLES and not layout.gyro and not layout.accel:
        found = _native(source)
    else:
        columns = _columns(source, extension, layout.skip_rows)
        found = _picked(str(source), columns, layout)
    return _on_grid(str(source), found, layout.rate_hz)


@dataclass(slots=True)
class _Raw:
    """Columns in SI units, rates or increments, before they are put on a grid of time."""

    values: dict[str, Array]
    kind: Literal["rates", "increments"]
    time: Array | None
    temperature: Array | None
    file_rate: float | None


def _native(path: Path) -> _Raw:
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
    values = {}
    for f in fields:
        sensor = "gyro" if f.base.startswith(("gyro", "dtheta")) else "accel"
        values[f"{sensor} {f.base[-1]}"] = (
            np.asarray(read[match.column[f.base]], dtype=np.float64) * match.factor[f.base]
        )
    time = np.asarray(read[match.column["time"]], dtype=np.float64) * match.factor["time"] if has_time else None
    return _Raw(values, "rates" if both[0] else "increments", time, read.get(warm) if warm else None, None)


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


def _picked(source: str, columns: Mapping[str, Array], layout: RecordLayout) -> _Raw:
    """The columns that the layout names, in SI units."""
    values, kinds = {}, {}
    for sensor in ("gyro", "accel"):
        wanted = getattr(layout, sensor)
        names = [name.strip() for name in wanted.split(",")] if wanted else _guess(columns, sensor, layout)
        if not names:
            continue
        arrays = [column for name in names for column in _one(source, columns, name, sensor)]
        unit = getattr(layout, f"{sensor}_unit") or _unit_of_name(names[0], sensor)
        if not unit:
            raise ConfigError(f"{source}: the unit of {names[0]!r} is not known; give it with --{sensor}-unit")
        measure, quantity = parse_quantity(unit, *_QUANTITY[sensor], what=f"--{sensor}-unit")
        kinds[sensor] = "rates" if quantity == _QUANTITY[sensor][0] else "increments"
        if len(arrays) > 3:
            raise ConfigError(f"{source}: --{sensor} names {len(arrays)} columns; a sensor has at most three axes")
        for axis, array in zip(_AXES, arrays, strict=False):
            values[f"{sensor} {axis}"] = np.asarray(array, dtype=np.float64) * measure.value
    if not values:
        raise InputError(
            f"{source}: say which of its columns to take with --gyro and --accel; it has "
            f"{', '.join(list(columns)[:20])}"
        )
    if len(set(kinds.values())) > 1:
        raise ConfigError(
            f"{source}: the gyros are {kinds['gyro']} and the accelerometers {kinds['accel']} by their units; "
            f"give both "
            "as rates, or both as increments"
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
    return _Raw(values, next(iter(kinds.values())), time, None, file_rate)


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


def _on_grid(source: str, raw: _Raw, given: float | None) -> StaticRecord:
    """Put the samples where their stamps say, NaN between."""
    size = next(iter(raw.values.values())).size
    if size < 2:
        raise InputError(f"{source}: {size} samples are no record")
    notes: list[str] = []
    if raw.time is None:
        rate = given if given is not None else raw.file_rate
        if rate is None:
            raise InputError(f"{source}: there is no time in the file; give the sampling rate with --rate")
        if given is not None and raw.file_rate is not None and abs(given / raw.file_rate - 1.0) > _SAME_RATE:
            raise InputError(f"{source}: --rate {given:g} Hz contradicts the file, which says {raw.file_rate:g} Hz")
        index, count, start = None, size, 0.0
    else:
        index, rate, start = _grid(source, raw.time, notes)
        if given is not None and abs(given / rate - 1.0) > _SAME_RATE:
            raise InputError(
                f"{source}: --rate {given:g} Hz contradicts the time stamps, which are {rate:.6g} Hz apart; leave "
                "--rate out"
            )
        count = int(index[-1]) + 1
        if count == size:
            index = None
    if not _RATES[0] <= rate <= _RATES[1]:
        raise InputError(
            f"{source}: a sampling rate of {rate:g} Hz is none of a sensor ({_RATES[0]:g} to {_RATES[1]:g} Hz); check "
            "--rate, or the unit of the time stamps"
        )
    scale = rate if raw.kind == "increments" else 1.0
    _check_force(source, raw, rate)
    channels = []
    for name, values in raw.values.items():
        placed = values if index is None else np.full(count, np.nan)
        if index is not None:
            placed[index] = values
        if scale != 1.0:
            placed = placed * scale
        placed = np.where(np.isinf(placed), np.nan, placed) if np.isinf(placed).any() else placed
        channels.append(Channel(name, "gyro" if name.startswith("gyro") else "accel", placed))
    missing = count - size
    if missing:
        notes.append(f"{source}: {missing} of {count} samples are missing by the time stamps")
    warm = raw.temperature
    if warm is not None and index is not None:
        placed = np.full(count, np.nan)
        placed[index] = warm
        warm = placed
    return StaticRecord(tuple(channels), rate, start, raw.kind, warm, source, tuple(notes))


def _grid(source: str, time: Array, notes: list[str]) -> tuple[Array, float, float]:
    """Number of each sample on a regular grid, the rate, and the first stamp."""
    if not np.isfinite(time).all():
        row = int(np.argmin(np.isfinite(time)))
        raise InputError(f"{source}: the time of row {row + 1} is not a number; remove the row")
    step = np.diff(time)
    if (step <= 0.0).any():
        row = int(np.argmax(step <= 0.0)) + 1
        raise InputError(
            f"{source}: time does not increase at row {row + 1} ({time[row - 1]:.6f} to {time[row]:.6f} s); sort the "
            "rows and remove repeated ones"
        )
    usual = float(np.median(step))
    whole = np.rint(step / usual)
    regular = whole == 1.0
    if np.count_nonzero(np.abs(step - usual) > 0.3 * usual) > 0.1 * step.size:
        raise InputError(
            f"{source}: the samples are not regular: more than a tenth of the steps differ from {usual:.6g} s by more "
            "than 30 %; Allan variance needs a fixed rate"
        )
    usual = float(np.mean(step[regular]))
    whole = np.maximum(np.rint(step / usual), 1.0)
    index = np.concatenate([[0], np.cumsum(whole)]).astype(np.int64)
    if index[-1] > 20 * time.size:
        raise InputError(f"{source}: gaps make up more than 95 % of the record; cut it at the longest of them")
    gaps = int(np.count_nonzero(whole > 1.0))
    if gaps:
        row = int(np.argmax(whole > 1.0))
        notes.append(f"{source}: {gaps} gaps in time, the first after {time[row]:.6g} s")
    return index, 1.0 / usual, float(time[0])


def _check_force(source: str, raw: _Raw, rate: float) -> None:
    """A sensor at rest feels one g, which tells increments from rates, and a wrong rate, where there are three axes."""
    axes = [raw.values[name] for name in ("accel x", "accel y", "accel z") if name in raw.values]
    if len(axes) < 3:
        return
    sample = slice(None, None, max(1, axes[0].size // 10000))
    force = float(np.nanmedian(np.sqrt(sum(axis[sample] ** 2 for axis in axes))))
    shown = force * rate if raw.kind == "increments" else force
    if 0.7 < shown / 9.80665 < 1.4:
        return
    if raw.kind == "rates" and 0.7 < force * rate / 9.80665 < 1.4:
        raise InputError(
            f"{source}: |acceleration| is {force:.4g} m/s^2, one g times the sampling interval: these are increments; "
            "give units of angle and speed, or name the columns dtheta_*_rad and dvel_*_mps"
        )
    if raw.kind == "increments" and 0.7 < force / 9.80665 < 1.4:
        raise InputError(
            f"{source}: |velocity increment| is {force:.4g} m/s, which is one g without a sampling interval: these are "
            "rates; give units of rate and acceleration, or name the columns gyro_*_radps and accel_*_mps2"
        )
    told = "the unit" if raw.kind == "rates" else "the unit or the sampling rate"
    raise InputError(
        f"{source}: the specific force is {shown / 9.80665:.4g} g, at rest it has to be about 1 g: {told} is wrong"
    )
