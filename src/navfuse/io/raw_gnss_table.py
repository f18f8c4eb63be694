"""Raw GNSS logs: native CSV and Parquet tables, one row per satellite and epoch."""

from __future__ import annotations

import os
import warnings
from typing import TYPE_CHECKING

import numpy as np

from navfuse.core.constants import WGS84_A
from navfuse.data.raw_gnss import RawGnssLog
from navfuse.data.trajectory import wrapped
from navfuse.errors import ConfigError, InputError, NavfuseWarning
from navfuse.io.columns import Field, Match, fields, match_columns, require, require_all_or_none
from navfuse.io.repair import MAX_SHARE
from navfuse.io.tables import EXTENSIONS, check_file, open_table, write_table
from navfuse.io.units import scaled

if TYPE_CHECKING:
    from navfuse.io.csv_table import CsvTable
    from navfuse.io.tables import ParquetTable

Array = np.ndarray

TIME = Field("time", "time", "s")
SATELLITE = Field("satellite", text=True)
PSEUDORANGE = Field("pseudorange", "length", "m")
SAT_POSITION = fields("length", "m", "sat_x", "sat_y", "sat_z")
SD_PSEUDORANGE = Field("sd_pseudorange", "length", "m")
RANGE_RATE = Field("range_rate", "speed", "mps")
SD_RANGE_RATE = Field("sd_range_rate", "speed", "mps")
SAT_VELOCITY = fields("speed", "mps", "sat_vx", "sat_vy", "sat_vz")
SKY = (*fields("angle", "deg", "elevation", "azimuth"), Field("cn0", "carrier to noise density", "dbhz"))
CORRECTED = Field("corrected")
REQUIRED = (TIME, SATELLITE, PSEUDORANGE, *SAT_POSITION)
RATES = (RANGE_RATE, *SAT_VELOCITY)

DEFAULT_SD = {"sd_pseudorange": 5.0, "sd_range_rate": 0.2}
"""Standard deviations [m], [m/s] where a file gives none."""
_MAX_EMPTY_SHARE = 0.5
_ABSURD = 1e9
_HIGHEST = 1e8


def read_raw_gnss(path: str | os.PathLike[str], *, time_offset_s: float = 0.0) -> RawGnssLog:
    """Read a raw GNSS log.

    A table has ``time_s, satellite, pseudorange_m, sat_{x,y,z}_m`` and optionally ``sd_pseudorange_m``,
    ``range_rate_mps`` with ``sat_v{x,y,z}_mps``, ``sd_range_rate_mps``, ``elevation_deg``, ``azimuth_deg``,
    ``cn0_dbhz``, and ``corrected`` (1 or 0, the same throughout). Satellites are those at transmission in the axes of
    that time, see :class:`~navfuse.data.raw_gnss.RawGnssLog`. Any unit of :mod:`navfuse.io.units` may stand in place of
    these.

    * Rows without a pseudo-range, a satellite position or a satellite's name are left out with a note; refused if they
      are more than half of the file. A range rate may be missing by itself.
    * Rows out of order are sorted, of rows with the same stamp and satellite the first is kept; refused from 1 % on.
    * A standard deviation that is missing gets a default with a note; one that is zero or negative is refused.

    Parameters
    ----------
    path : path-like
        A ``.csv`` or ``.parquet`` file.
    time_offset_s : float
        Added to the stamps [s].

    Returns
    -------
    RawGnssLog
        SI units. `notes` holds the text of every warning.

    Raises
    ------
    InputError
        If the file cannot be used; the message names row and column and what to do.
    ConfigError
        If `time_offset_s` is not finite.

    Warns
    -----
    NavfuseWarning
        For every repair and default.
    """
    if not np.isfinite(time_offset_s):
        raise ConfigError(f"time_offset_s = {time_offset_s} has to be a finite number of seconds")
    table = open_table(check_file(path, EXTENSIONS))
    known = (*REQUIRED, SD_PSEUDORANGE, *RATES, SD_RANGE_RATE, *SKY, CORRECTED)
    match = match_columns(table.names, known, table.source)
    require(match, REQUIRED, "a table of pseudo-ranges")
    has_rates = require_all_or_none(match, RATES, "a table of pseudo-ranges with range rates")
    columns = _columns(table, match)
    notes = [*table.notes, *match.note_unknown()]
    corrected = _corrected(columns, table, notes)
    index = _usable_rows(columns, table, match, notes)
    columns = {name: values[index] for name, values in columns.items()}
    _check_satellites(columns, table, match, index)
    for sd, measured in (("sd_pseudorange", "pseudorange"), *((("sd_range_rate", "range_rate"),) if has_rates else ())):
        columns[sd] = _sigmas(columns, sd, measured, table, match, index, notes)

    def triad(group: tuple[Field, ...]) -> Array:
        return np.column_stack([columns[field.base] for field in group])

    azimuth = columns.get("azimuth")
    log = RawGnssLog(
        time=columns["time"] + time_offset_s,
        satellite=columns["satellite"],
        pseudorange=columns["pseudorange"],
        sd_pseudorange=columns["sd_pseudorange"],
        sat_r_e=triad(SAT_POSITION),
        range_rate=columns["range_rate"] if has_rates else None,
        sd_range_rate=columns["sd_range_rate"] if has_rates else None,
        sat_v_e=triad(SAT_VELOCITY) if has_rates else None,
        elevation=columns.get("elevation"),
        azimuth=None if azimuth is None else wrapped(azimuth, 2.0 * np.pi),
        cn0=columns.get("cn0"),
        corrected=corrected,
        source=table.source,
        notes=tuple(notes),
    )
    for note in notes:
        warnings.warn(note, NavfuseWarning, stacklevel=2)
    return log


def write_raw_gnss(path: str | os.PathLike[str], log: RawGnssLog) -> None:
    """Write a raw GNSS log as a native table; the file appears whole or not at all.

    Parameters
    ----------
    path : path-like
        A ``.csv`` or ``.parquet`` file, replaced if it exists.
    log : RawGnssLog

    Raises
    ------
    OutputError
        If the extension is another one or the file cannot be written.
    """
    write_table(path, log.columns())


def _columns(table: CsvTable | ParquetTable, match: Match) -> dict[str, Array]:
    text = match.column[SATELLITE.base]
    values = table.read([name for name in match.column.values() if name != text], [text])
    columns = {
        base: scaled(values[name], match.factor[base]) for base, name in match.column.items() if base != "satellite"
    }
    return columns | {"satellite": np.char.strip(values[text])}


def _corrected(columns: dict[str, Array], table: CsvTable | ParquetTable, notes: list[str]) -> bool:
    values = columns.pop("corrected", None)
    if values is None:
        notes.append(
            f"{table.source}: there is no column 'corrected' (1 or 0): assumed that the delays of ionosphere and "
            "troposphere are taken out of the pseudo-ranges"
        )
        return True
    flawed = (values != values[0]) | ~np.isin(values, (0.0, 1.0))
    if flawed.any():
        row = int(np.argmax(flawed))
        raise InputError(
            f"{table.source}: {table.where(row)}, column 'corrected': {values[row]:g}; it has to be 1 in all rows "
            "(delays of the atmosphere taken out) or 0 in all rows"
        )
    return bool(values[0])


def _usable_rows(columns: dict[str, Array], table: CsvTable | ParquetTable, match: Match, notes: list[str]) -> Array:
    """Rows to keep, in the order of time."""
    usable = np.isfinite(columns["time"]) & (columns["satellite"] != "")
    for base in ("pseudorange", *(field.base for field in SAT_POSITION)):
        usable &= np.abs(columns[base]) < _ABSURD
    empty = int(np.count_nonzero(~usable))
    if empty:
        found = (
            f"{table.source}: {empty} of {usable.size} rows lack a stamp, a satellite, a pseudo-range or a satellite "
            f"position, the first is {table.where(int(np.argmin(usable)))}"
        )
        if empty > _MAX_EMPTY_SHARE * usable.size:
            raise InputError(f"{found}; more than half is not accepted, check how the file was made")
        notes.append(f"{found}: left out")
    index = np.flatnonzero(usable)
    time, names = columns["time"][index], columns["satellite"][index]
    late = time < np.maximum.accumulate(time)
    order = np.argsort(time, kind="stable")
    _, number = np.unique(names, return_inverse=True)
    _, first = np.unique(np.column_stack([time, number]), axis=0, return_index=True)
    again = np.ones(index.size, dtype=bool)
    again[first] = False
    if late.any() or again.any():
        count_late, count_again = int(np.count_nonzero(late)), int(np.count_nonzero(again))
        row = int(np.argmax(late | again))
        found = (
            f"{table.source}: column '{match.column['time']}': {count_late} rows are out of order and {count_again} "
            f"repeat stamp and satellite, of {index.size}; the first is {table.where(int(index[row]))} with satellite "
            f"'{names[row]}' at {time[row]:.9g} s"
        )
        if count_late + count_again >= MAX_SHARE * index.size:
            raise InputError(f"{found}. 1 % or more is not repaired: does the clock wrap, or are two logs joined?")
        notes.append(f"{found}: sorted by time, the first of equal rows kept")
    return index[order[~again[order]]]


def _check_satellites(columns: dict[str, Array], table: CsvTable | ParquetTable, match: Match, index: Array) -> None:
    """Refuse satellites that do not stand where satellites do."""
    radius = np.sqrt(sum(columns[field.base] ** 2 for field in SAT_POSITION))
    flawed = (radius < WGS84_A) | (radius > _HIGHEST)
    if flawed.any():
        row = int(np.argmax(flawed))
        names = ", ".join(f"'{match.column[field.base]}'" for field in SAT_POSITION)
        raise InputError(
            f"{table.source}: {table.where(int(index[row]))}, columns {names}: satellite '{columns['satellite'][row]}' "
            f"is {radius[row] / 1e3:.6g} km from the centre of the Earth; are these Earth-centred coordinates in the "
            "unit of their names?"
        )


def _sigmas(
    columns: dict[str, Array],
    sd: str,
    measured: str,
    table: CsvTable | ParquetTable,
    match: Match,
    index: Array,
    notes: list[str],
) -> Array:
    """Standard deviations with a default where they are missing; refuses what is not positive beside a measurement."""
    needed = np.isfinite(columns[measured])
    given = columns.get(sd, np.full(needed.size, np.nan))
    flawed = needed & (given <= 0.0)
    if flawed.any():
        row = int(np.argmax(flawed))
        raise InputError(
            f"{table.source}: {table.where(int(index[row]))}, column '{match.column[sd]}': a standard deviation of "
            f"{given[row]:g} would mean a perfect measurement; {np.count_nonzero(flawed)} rows have such values. Give "
            "the true ones, or remove the column to get defaults"
        )
    missing = ~((given > 0.0) & (given < _ABSURD))
    count = int(np.count_nonzero(missing & needed))
    if count:
        extent = "is missing" if sd not in columns else f"is empty in {count} rows"
        unit = "m" if sd == "sd_pseudorange" else "m/s"
        name = match.column.get(sd, f"{sd}_{'m' if unit == 'm' else 'mps'}")
        notes.append(f"{table.source}: '{name}' {extent}: assumed {DEFAULT_SD[sd]:g} {unit}")
    return np.where(missing, DEFAULT_SD[sd], given)
