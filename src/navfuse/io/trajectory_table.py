"""Trajectories as native CSV and Parquet tables: solutions and truth; those of other programs are passed on."""

from __future__ import annotations

import os
import warnings
from math import degrees
from pathlib import Path

import numpy as np

from navfuse.data.trajectory import Trajectory, wrapped
from navfuse.errors import InputError, NavfuseWarning
from navfuse.io import sbet
from navfuse.io.columns import Field, Match, fields, match_columns, require, require_all_or_none
from navfuse.io.gnss_plausibility import check_position_units
from navfuse.io.nineteen_columns import TRUTH_PART, is_nineteen_columns, part_of
from navfuse.io.repair import time_order
from navfuse.io.rtklib_pos import parse_rtklib_track
from navfuse.io.tables import EXTENSIONS, CsvTable, ParquetTable, check_file, open_table, write_table
from navfuse.io.units import scaled

Array = np.ndarray

REQUIRED = (Field("time", "time", "s"), *fields("angle", "deg", "lat", "lon"), Field("height", "length", "m"))
_OF_EXPORTS = (
    Field("label", text=True),
    Field("utc", text=True),
    Field("fix", text=True),
    Field("n_satellites"),
    *fields("length", "m", "undulation", "above_geoid"),
)
"""What :mod:`navfuse.io.exports.csv` adds: known, so that no one is warned, and not used."""
_ABSURD = 1e15
GROUPS = {
    "velocity_n": fields("speed", "mps", "vn", "ve", "vd"),
    "attitude": fields("angle", "deg", "roll", "pitch", "heading"),
    "sd_position": fields("length", "m", "sd_north", "sd_east", "sd_down"),
    "sd_velocity": fields("speed", "mps", "sd_vn", "sd_ve", "sd_vd"),
    "sd_attitude": fields("angle", "deg", "sd_roll", "sd_pitch", "sd_heading"),
}


def read_trajectory(path: str | os.PathLike[str]) -> Trajectory:
    """Read a trajectory: a solution or a truth.

    The table has ``time_s, lat_deg, lon_deg, height_m`` and optionally the velocity, attitude and ``sd_*`` columns of
    the native format, each group whole; any unit of :mod:`navfuse.io.units` may stand in their names. The heading may
    run on beyond 360 or be negative, and the longitude may be counted to 360. Of a table of
    :mod:`navfuse.io.nineteen_columns` the truth is read.

    A POSPac SBET file is read by :func:`navfuse.io.sbet.read_sbet`. Of an RTKLIB solution the positions are taken, dead
    reckoning included, and the velocity if every row has one; not its standard deviations.

    Parameters
    ----------
    path : path-like
        A ``.csv`` or ``.parquet`` file, a ``.pos`` of RTKLIB, or a ``.sbet`` or ``.out`` of POSPac.

    Returns
    -------
    Trajectory
        Time increasing strictly, longitude in -180..180, heading in 0..360 (in radians).

    Raises
    ------
    InputError
        If the file cannot be used, or holds radians in columns of degrees; a NaN anywhere is named with its row, since
        no comparison could use it.

    Warns
    -----
    NavfuseWarning
        For ignored columns, and rows that are sorted or left out because of their stamp (under 1 %).
    """
    extension = Path(path).suffix.lower()
    if extension in sbet.EXTENSIONS:
        return sbet.read_sbet(path)
    if extension == ".pos":
        return _of_rtklib(check_file(path, (".pos",)))
    if extension not in EXTENSIONS:
        check_file(path, (*EXTENSIONS, ".pos", *sbet.EXTENSIONS))
    table = open_table(path)
    if is_nineteen_columns(table.names, table.source):
        match = part_of(table, TRUTH_PART)
    else:
        known = (*REQUIRED, *(field for group in GROUPS.values() for field in group), *_OF_EXPORTS)
        match = match_columns(table.names, known, table.source)
    require(match, REQUIRED, "a trajectory")
    present = [name for name, group in GROUPS.items() if require_all_or_none(match, group, "a trajectory")]
    columns = _columns(table, match)
    notes = [*table.notes, *match.note_unknown()]
    order = time_order(columns["time"], match.column["time"], table.source, table.where)
    if order is not None:
        columns = {base: values[order.order[order.first]] for base, values in columns.items()}
        notes.append(f"{order.note}: sorted by time, the first row of each stamp kept")
    triads = {name: np.column_stack([columns[field.base] for field in GROUPS[name]]) for name in present}
    time, lat, lon, height = (columns[field.base] for field in REQUIRED)
    if time.size > 1:
        names = tuple(match.column[field.base] for field in REQUIRED[1:])
        notes += check_position_units(time, lat, lon, height, triads.get("velocity_n"), names, table.source)
    for note in notes:
        warnings.warn(note, NavfuseWarning, stacklevel=2)
    if "attitude" in triads:
        triads["attitude"][:, 2] = wrapped(triads["attitude"][:, 2], 2.0 * np.pi)
    return Trajectory(
        time=time,
        lat=lat,
        lon=np.where(lon > np.pi, lon - 2.0 * np.pi, lon),
        height=height,
        **triads,
        source=table.source,
    )


def write_trajectory(path: str | os.PathLike[str], trajectory: Trajectory) -> None:
    """Write a trajectory as a native table; the file appears whole or not at all.

    Parameters
    ----------
    path : path-like
        A ``.csv`` or ``.parquet`` file, replaced if it exists.
    trajectory : Trajectory

    Raises
    ------
    OutputError
        If the extension is another one or the file cannot be written.
    """
    write_table(path, trajectory.to_columns())


def _of_rtklib(path: Path) -> Trajectory:
    log = parse_rtklib_track(path)
    for note in log.notes:
        warnings.warn(note, NavfuseWarning, stacklevel=3)
    velocity = log.velocity_n
    if velocity is not None and not np.isfinite(velocity).all():
        velocity = None
    return Trajectory(log.time, log.lat, log.lon, log.height, velocity_n=velocity, source=log.source)


def _columns(table: CsvTable | ParquetTable, match: Match) -> dict[str, Array]:
    """Every matched column in SI units by base name, finite and in range."""
    unused = {field.base for field in _OF_EXPORTS}
    wanted = {base: name for base, name in match.column.items() if base not in unused}
    values = table.read(list(wanted.values()))
    columns = {base: scaled(values[name], match.factor[base]) for base, name in wanted.items()}
    limits = {"lat": (-np.pi / 2.0, np.pi / 2.0, "-90..90"), "lon": (-np.pi, 2.0 * np.pi, "-180..360")}
    for base, column in columns.items():
        flawed = ~(np.abs(column) < _ABSURD)
        if flawed.any():
            raise InputError(
                f"{table.source}: {table.where(int(np.argmax(flawed)))}, column '{match.column[base]}': the value is"
                " empty, NaN, infinite or absurd; remove the row or the column"
            )
        if base in limits:
            low, high, text = limits[base]
            flawed = (column < low) | (column > high)
            if flawed.any():
                row = int(np.argmax(flawed))
                raise InputError(
                    f"{table.source}: {table.where(row)}, column '{match.column[base]}': {degrees(column[row]):.9g}"
                    f" deg is outside {text}"
                )
    return columns
