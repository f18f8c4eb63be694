"""GNSS logs: native CSV and Parquet tables, and other formats by their extension."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.logs import GnssLog
from navfuse.errors import ConfigError, NavfuseWarning
from navfuse.io.columns import Field, Match, fields, match_columns, require, require_all_or_none
from navfuse.io.gnss_rows import GnssNames, GnssRows, StatedSigmas, gnss_log
from navfuse.io.nineteen_columns import GNSS_PART, is_nineteen_columns, part_of
from navfuse.io.rtklib_pos import parse_rtklib_pos
from navfuse.io.tables import EXTENSIONS, check_file, open_table
from navfuse.io.units import scaled

Array = np.ndarray

REQUIRED = (Field("time", "time", "s"), *fields("angle", "deg", "lat", "lon"), Field("height", "length", "m"))
SD_POSITION = fields("length", "m", "sd_north", "sd_east", "sd_down")
VELOCITY = fields("speed", "mps", "vn", "ve", "vd")
SD_VELOCITY = fields("speed", "mps", "sd_vn", "sd_ve", "sd_vd")
FIX = Field("fix", text=True)
N_SATELLITES = Field("n_satellites")


def read_gnss(
    path: str | os.PathLike[str],
    *,
    time_offset_s: float = 0.0,
    epoch: tuple[int, float] | None = None,
    sd_position_m: Sequence[float] | None = None,
    sd_velocity_mps: Sequence[float] | None = None,
) -> GnssLog:
    """Read a GNSS log.

    A native table has ``time_s, lat_deg, lon_deg, height_m`` and optionally ``sd_{north,east,down}_m``, ``vn_mps,
    ve_mps, vd_mps``, ``sd_{vn,ve,vd}_mps``, ``fix``, ``n_satellites``; any unit of :mod:`navfuse.io.units` may stand
    in place of these. A ``.pos`` file is read by :mod:`navfuse.io.rtklib_pos`. Checks, repairs and the defaults of
    missing standard deviations are those of :func:`navfuse.io.gnss_rows.gnss_log`. Of a table of
    :mod:`navfuse.io.nineteen_columns` the fixes are read.

    Parameters
    ----------
    path : path-like
        A ``.csv``, ``.parquet`` or RTKLIB ``.pos`` file.
    time_offset_s : float
        Added to the stamps [s].
    epoch : (week, seconds of week), optional
        GPS time that log times count from. Stamps of a ``.pos`` file are turned to it; default the start of the GPS
        week of its first row. Of a native table, whose stamps are relative already, it only tells the date.
    sd_position_m, sd_velocity_mps : 3 numbers [m], [m/s], optional
        Standard deviations north, east, down, used where the file has none.

    Returns
    -------
    GnssLog
        SI units, time increasing strictly. `notes` holds the text of every warning.

    Raises
    ------
    InputError
        If the file cannot be used; the message names row and column and what to do.
    ConfigError
        If `time_offset_s`, `epoch` or a standard deviation is not usable.

    Warns
    -----
    NavfuseWarning
        For every repair, every default and everything that looks odd without being certainly wrong.
    """
    if not np.isfinite(time_offset_s):
        raise ConfigError(f"time_offset_s = {time_offset_s} has to be a finite number of seconds")
    stated = StatedSigmas(_sigmas("sd_position_m", sd_position_m), _sigmas("sd_velocity_mps", sd_velocity_mps))
    path = check_file(path, (*EXTENSIONS, ".pos"))
    if path.suffix.lower() == ".pos":
        log = parse_rtklib_pos(path, time_offset_s, epoch, stated)
    else:
        log = _parse_table(path, time_offset_s, stated)
        log = log if epoch is None else replace(log, epoch=GpsEpoch.of(*epoch))
    for note in log.notes:
        warnings.warn(note, NavfuseWarning, stacklevel=2)
    return log


def _sigmas(name: str, values: Sequence[float] | None) -> Array | None:
    if values is None:
        return None
    sd = np.asarray(values, dtype=float)
    if sd.shape != (3,) or not (np.isfinite(sd).all() and (sd > 0.0).all()):
        raise ConfigError(f"{name} = {values} has to be three positive numbers: north, east, down")
    return sd


def _parse_table(path: Path, time_offset_s: float, stated: StatedSigmas) -> GnssLog:
    table = open_table(path)
    joint = is_nineteen_columns(table.names, table.source)
    known = (*REQUIRED, *SD_POSITION, *VELOCITY, *SD_VELOCITY, FIX, N_SATELLITES)
    match = part_of(table, GNSS_PART) if joint else match_columns(table.names, known, table.source)
    require(match, REQUIRED, "a GNSS table")
    has_velocity = require_all_or_none(match, VELOCITY, "a GNSS table with velocities")
    has_fix = match.has([FIX.base])
    text = [match.column[FIX.base]] if has_fix else []
    values = table.read([name for name in match.column.values() if name not in text], text)

    def column(field: Field) -> Array:
        if field.base not in match.column:
            return np.full(len(values[match.column["time"]]), np.nan)
        return scaled(values[match.column[field.base]], match.factor[field.base])

    def triad(group: tuple[Field, ...]) -> Array | None:
        if not any(field.base in match.column for field in group):
            return None
        return np.column_stack([column(field) for field in group])

    time, lat, lon, height = (column(field) for field in REQUIRED)
    rows = GnssRows(
        time=time + time_offset_s,
        lat=lat,
        lon=lon,
        height=height,
        sd_position=triad(SD_POSITION),
        velocity_n=triad(VELOCITY) if has_velocity else None,
        sd_velocity=triad(SD_VELOCITY) if has_velocity else None,
        fix=values[match.column[FIX.base]] if has_fix else None,
        n_satellites=column(N_SATELLITES) if match.has([N_SATELLITES.base]) else None,
    )
    notes = [*table.notes, *match.note_unknown()]
    return gnss_log(rows, _names(match), table.source, table.where, notes, stated, sparse=joint)


def _names(match: Match) -> GnssNames:
    def name(field: Field) -> str:
        return match.column.get(field.base, field.name)

    time, lat, lon, height = (name(field) for field in REQUIRED)
    return GnssNames(
        time,
        lat,
        lon,
        height,
        *(tuple(name(field) for field in group) for group in (SD_POSITION, VELOCITY, SD_VELOCITY)),
    )
