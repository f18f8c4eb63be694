"""Times of events, such as a camera's pictures, as a CSV or Parquet table."""

from __future__ import annotations

import os
import warnings
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from navfuse.data.gps_epoch import GpsEpoch
from navfuse.errors import InputError, NavfuseWarning
from navfuse.io.columns import Field, match_columns
from navfuse.io.gps_time import WEEK, log_times
from navfuse.io.tables import CsvTable, ParquetTable, open_table

Array = np.ndarray

_TIME = Field("time", "time", "s")
_WEEK, _TOW = Field("gps_week"), Field("gps_tow", "time", "s")
_UTC, _LABEL = Field("utc", text=True), Field("label", text=True)


class Events(NamedTuple):
    """Named times.

    Attributes
    ----------
    time : (n,) array [s]
        Log time, in the order of the table.
    labels : (n,) array of str
        The numbers of the rows, from 1, where the table has no names.
    """

    time: Array
    labels: Array


def read_events(path: str | os.PathLike[str], epoch: GpsEpoch | None = None) -> Events:
    """Read a table of events.

    Parameters
    ----------
    path : path-like
        A ``.csv`` or ``.parquet`` table with the time as ``time_s`` (log time; any other unit of time may stand in the
        name), or as ``gps_week`` (without rollover) and ``gps_tow_s``, or as ``utc``, ISO 8601 such as
        ``2026-03-04T05:06:07.890Z``; and optionally ``label``. A UTC stamp without a zone is taken as UTC.
    epoch : GpsEpoch, optional
        GPS time from which log times count; needed for all but ``time_s``.

    Returns
    -------
    Events

    Raises
    ------
    InputError
        If the file cannot be used, has none or more than one of the three kinds of time, or a time that is none; or if
        its times are dates and nobody says from when the log counts.

    Warns
    -----
    NavfuseWarning
        For ignored columns and a last line that is cut off.
    """
    table = open_table(path)
    match = match_columns(table.names, (_TIME, _WEEK, _TOW, _UTC, _LABEL), table.source)
    kinds = [kind for kind, bases in _KINDS.items() if any(base in match.column for base in bases)]
    if len(kinds) != 1 or not match.has(_KINDS[kinds[0]]):
        found = f"; its columns are {', '.join(table.names)}" if not kinds else ""
        raise InputError(f"{table.source}: a table of events needs one kind of time: {', or '.join(_KINDS)}{found}")
    bases = _KINDS[kinds[0]]
    if "time" not in bases and epoch is None:
        raise InputError(
            f"{table.source}: the events have dates, and nobody said from when the times of the log count: set "
            "gnss.epoch_week_s = [week, seconds] in the project, or give --epoch WEEK,SECONDS"
        )
    numeric = [match.column[base] for base in bases if base != "utc"]
    text = [match.column[base] for base in ("utc", "label") if base in match.column]
    columns = table.read(numeric, text)
    for note in (*table.notes, *match.note_unknown()):
        warnings.warn(note, NavfuseWarning, stacklevel=2)
    for name in numeric:
        _refuse(~np.isfinite(columns[name]), table, name, "the value is empty or not a number")
    if epoch is None or "time" in bases:
        time = columns[match.column["time"]] * match.factor["time"]
    elif "utc" in bases:
        time = log_times(epoch, _utc(columns[match.column["utc"]], table))
    else:
        week = columns[match.column["gps_week"]]
        _refuse((week < 0) | (week != np.floor(week)), table, match.column["gps_week"], "has to be a whole week")
        time = (week - epoch.week) * WEEK + (columns[match.column["gps_tow"]] * match.factor["gps_tow"] - epoch.tow)
    labels = columns[match.column["label"]] if "label" in match.column else np.arange(1, time.size + 1).astype(np.str_)
    return Events(time, labels)


_KINDS = {"time_s": ("time",), "gps_week and gps_tow_s": ("gps_week", "gps_tow"), "utc": ("utc",)}


def _utc(words: Array, table: CsvTable | ParquetTable) -> Array:
    stamps = []
    for row, word in enumerate(words.tolist()):
        try:
            stamp = datetime.fromisoformat(word.strip())
        except ValueError as error:
            raise InputError(
                f"{table.source}: {table.where(row)}, column 'utc': {word!r} is no time of ISO 8601, such as "
                "2026-03-04T05:06:07.890Z"
            ) from error
        stamps.append(stamp if stamp.tzinfo is None else stamp.astimezone(UTC).replace(tzinfo=None))
    return np.array(stamps, dtype="datetime64[us]")


def _refuse(flawed: Array, table: CsvTable | ParquetTable, column: str, why: str) -> None:
    if flawed.any():
        raise InputError(f"{table.source}: {table.where(int(np.argmax(flawed)))}, column '{column}': {why}")
