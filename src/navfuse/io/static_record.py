"""Records of a sensor at rest, as raw as they are: nothing is repaired, so that what is wrong can be found.

Native IMU tables are read by their column names. Anything else can be read by saying which columns hold what: arrays of
``.npz`` and ``.mat`` files by name, columns of text files by number, each with its unit, which may carry a scale
(``0.1 arcsec`` for a count of 0.1 arc-seconds).
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from navfuse.errors import ConfigError, InputError
from navfuse.io.static_columns import RawColumns, RecordLayout, read_columns
from navfuse.io.static_plausibility import SAME_RATE, check_axes, check_force, check_rate

Array = np.ndarray

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
        raise ConfigError(f"--rate {layout.rate_hz:g} must be a finite number of samples per second, more than 0")
    return _on_grid(os.fspath(path), read_columns(path, layout), layout.rate_hz)


def _on_grid(source: str, raw: RawColumns, given: float | None) -> StaticRecord:
    """Put the samples where their stamps say, NaN between."""
    size = next(iter(raw.values.values())).size
    if size < 2:
        raise InputError(f"{source}: {size} samples are no record")
    notes = check_axes(source, raw)
    if raw.time is None:
        rate = given if given is not None else raw.file_rate
        if rate is None:
            raise InputError(f"{source}: there is no time in the file; give the sampling rate with --rate")
        if given is not None and raw.file_rate is not None and abs(given / raw.file_rate - 1.0) > SAME_RATE:
            raise InputError(f"{source}: --rate {given:g} Hz contradicts the file, which says {raw.file_rate:g} Hz")
        index, count, start = None, size, 0.0
    else:
        index, rate, start = _grid(source, raw.time, notes)
        if given is not None and abs(given / rate - 1.0) > SAME_RATE:
            raise InputError(
                f"{source}: --rate {given:g} Hz contradicts the time stamps, whose steps make {rate:.6g} Hz; leave "
                "--rate out, or correct the stamps"
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
    check_force(source, raw, rate)
    notes += check_rate(source, raw, rate)
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
        notes.append(f"{source}: {gaps} gap{'s' if gaps > 1 else ''} in time, the first after {time[row]:.6g} s")
    return index, 1.0 / usual, float(time[0])
