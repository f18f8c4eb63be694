"""Logs of aiding sensors other than GNSS as native CSV and Parquet tables.

Columns (any unit of :mod:`navfuse.io.units` may stand in place of these):

============= =========================================================================================
odometer      ``time_s, speed_mps``, optional ``sd_speed_mps``
wheel speeds  ``time_s, wheel_<name>_mps`` for every wheel
heading       ``time_s, heading_deg``, optional ``sd_heading_deg``
magnetometer  ``time_s, mag_{x,y,z}_ut``
barometer     ``time_s`` and ``pressure_hpa`` or ``height_m`` or both
body velocity ``time_s, v_{x,y,z}_mps``, at least one of them, optional ``sd_v_{x,y,z}_mps``
uwb           ``time_s, anchor, range_m``, optional ``sd_range_m``; several anchors may share a stamp
anchors       ``anchor, lat_deg, lon_deg, height_m``
============= =========================================================================================

All readers take ``path`` and ``time_offset_s``, which is added to the stamps, and treat bad rows alike: those without a
measurement (empty, NaN, infinite, absurd) are left out, and refused if they are more than half; those out of order are
sorted, and of equal stamps the first row is kept, and refused from 1 % on. What was repaired is warned about and stands
in the ``notes`` of the log. They raise :class:`~navfuse.errors.InputError` for a file that cannot be used, naming row
and column, and :class:`~navfuse.errors.ConfigError` for a ``time_offset_s`` that is not finite.
"""

from __future__ import annotations

import os
import warnings
from typing import Protocol, TypeVar

import numpy as np

from navfuse.core.constants import TWO_PI
from navfuse.data.aiding_logs import (
    BarometerLog,
    BodyVelocityLog,
    HeadingLog,
    MagnetometerLog,
    OdometerLog,
    UwbAnchors,
    UwbLog,
    WheelSpeedLog,
)
from navfuse.data.trajectory import wrapped
from navfuse.errors import InputError, NavfuseWarning
from navfuse.io.aiding_rows import (
    TIME,
    AidingRows,
    ordered_rows,
    ordered_rows_of_several,
    read_rows,
    standard_deviation,
    usable_rows,
)
from navfuse.io.columns import Field, Match, fields, match_columns, require
from navfuse.io.tables import CsvTable, ParquetTable, open_table, write_table
from navfuse.io.units import scaled

Array = np.ndarray
Path = str | os.PathLike[str]

_SPEED, _SD_SPEED = fields("speed", "mps", "speed", "sd_speed")
_HEADING, _SD_HEADING = fields("angle", "deg", "heading", "sd_heading")
_MAG = fields("magnetic field", "ut", "mag_x", "mag_y", "mag_z")
_PRESSURE, _HEIGHT = Field("pressure", "pressure", "hpa"), Field("height", "length", "m")
_V = fields("speed", "mps", "v_x", "v_y", "v_z")
_SD_V = fields("speed", "mps", "sd_v_x", "sd_v_y", "sd_v_z")
_ANCHOR = Field("anchor", text=True)
_RANGE, _SD_RANGE = fields("length", "m", "range", "sd_range")
_PLACE = (*fields("angle", "deg", "lat", "lon"), _HEIGHT)

_EARTH_FIELD = (5e-6, 2e-4)
_AIR_PRESSURE = (500.0, 120e3)


class _Columns(Protocol):
    @property
    def notes(self) -> tuple[str, ...]: ...

    def columns(self) -> dict[str, Array]: ...


LogT = TypeVar("LogT", bound=_Columns)


def write_aiding(path: Path, log: _Columns) -> None:
    """Write any log of :mod:`navfuse.data.aiding_logs`, or its anchors, as a native table.

    Parameters
    ----------
    path : path-like
        A ``.csv`` or ``.parquet`` file, replaced if it exists; it appears whole or not at all.
    log : OdometerLog, WheelSpeedLog, MagnetometerLog, HeadingLog, BarometerLog, BodyVelocityLog, UwbLog or UwbAnchors

    Raises
    ------
    OutputError
        If the extension is another one or the file cannot be written.
    """
    write_table(path, log.columns())


def read_odometer(path: Path, *, time_offset_s: float = 0.0) -> OdometerLog:
    """Read speeds along the forward axis; see the module for columns, checks and errors."""
    rows = _read(path, (TIME, _SPEED), (_SD_SPEED,), "an odometer table", time_offset_s)
    rows = ordered_rows(usable_rows(rows, ["speed"]))
    log = OdometerLog(rows.time, rows.values["speed"], standard_deviation(rows, "sd_speed"), *_provenance(rows))
    return _warned(log)


def read_wheel_speeds(path: Path, *, time_offset_s: float = 0.0) -> WheelSpeedLog:
    """Read speeds of wheels; a wheel may be NaN in some rows. See the module for columns, checks and errors."""
    table = open_table(path)
    wheels = tuple(Field(_wheel_base(name), "speed", "mps") for name in table.names if name.startswith("wheel_"))
    match = match_columns(table.names, (TIME, *wheels), table.source)
    require(match, (TIME,), "a table of wheel speeds")
    if not wheels:
        require(match, (Field("wheel_<name>", "speed", "mps"),), "a table of wheel speeds")
    bases = [wheel.base for wheel in wheels]
    rows = ordered_rows(usable_rows(read_rows(table, match, time_offset_s), bases, every=False))
    names = tuple(base.removeprefix("wheel_") for base in bases)
    return _warned(WheelSpeedLog(rows.time, names, rows.side_by_side(bases), *_provenance(rows)))


def read_heading(path: Path, *, time_offset_s: float = 0.0) -> HeadingLog:
    """Read headings, which may run on beyond 360 deg or be negative; see the module for columns, checks and errors.

    A column of degrees that holds nothing but radians is warned about.
    """
    rows = _read(path, (TIME, _HEADING), (_SD_HEADING,), "a heading table", time_offset_s)
    rows = ordered_rows(usable_rows(rows, ["heading"]))
    heading = rows.values["heading"]
    degrees = np.degrees(heading)
    if rows.named("heading").endswith("deg") and np.abs(degrees).max() <= TWO_PI and np.ptp(degrees) > 2.0:
        rows.notes.append(
            f"{rows.match.source}: column '{rows.named('heading')}': no heading is beyond {np.abs(degrees).max():.3g} "
            "deg. Are these radians? Then name the column 'heading_rad'"
        )
    sd = standard_deviation(rows, "sd_heading")
    return _warned(HeadingLog(rows.time, wrapped(heading, TWO_PI), sd, *_provenance(rows)))


def read_magnetometer(path: Path, *, time_offset_s: float = 0.0) -> MagnetometerLog:
    """Read the magnetic field in body axes; see the module for columns, checks and errors.

    Refused besides if its magnitude cannot be that of the Earth's field in the stated unit (median outside 5..200 uT).
    """
    rows = _read(path, (TIME, *_MAG), (), "a magnetometer table", time_offset_s)
    bases = [field.base for field in _MAG]
    rows = ordered_rows(usable_rows(rows, bases))
    field_b = rows.side_by_side(bases)
    _check_median(rows, np.linalg.norm(field_b, axis=1), "mag_x", _EARTH_FIELD, 1e6, "uT", "field of the Earth")
    return _warned(MagnetometerLog(rows.time, field_b, *_provenance(rows)))


def read_barometer(path: Path, *, time_offset_s: float = 0.0) -> BarometerLog:
    """Read pressures or barometric heights or both; see the module for columns, checks and errors.

    Refused besides if the pressure cannot be that of air in the stated unit (median outside 5..1200 hPa).
    """
    table = open_table(path)
    match = match_columns(table.names, (TIME, _PRESSURE, _HEIGHT), table.source)
    require(match, (TIME,), "a barometer table")
    measured = [field.base for field in (_PRESSURE, _HEIGHT) if match.has([field.base])]
    if not measured:
        require(match, (_PRESSURE,), "a barometer table without 'height_m'")
    rows = ordered_rows(usable_rows(read_rows(table, match, time_offset_s), measured))
    if "pressure" in measured:
        _check_median(rows, rows.values["pressure"], "pressure", _AIR_PRESSURE, 1e-2, "hPa", "pressure of air")
        rows.refuse(rows.values["pressure"] <= 0.0, "pressure", "is no pressure; correct the row or remove it")
    pressure, height = rows.values.get("pressure"), rows.values.get("height")
    return _warned(BarometerLog(rows.time, pressure, height, *_provenance(rows)))


def read_body_velocity(path: Path, *, time_offset_s: float = 0.0) -> BodyVelocityLog:
    """Read velocities in body axes; see the module for columns, checks and errors.

    An axis that has no column, or is empty in a row, was not measured and is NaN in the log.
    """
    table = open_table(path)
    match = match_columns(table.names, (TIME, *_V, *_SD_V), table.source)
    require(match, (TIME,), "a table of body velocities")
    measured = [field.base for field in _V if match.has([field.base])]
    if not measured:
        require(match, _V[:1], "a table of body velocities")
    rows = ordered_rows(usable_rows(read_rows(table, match, time_offset_s), measured, every=False))
    velocity_b = rows.side_by_side([field.base for field in _V])
    sd = None
    if any(match.has([field.base]) for field in _SD_V):
        wanted = [field for field in _SD_V if field.base.removeprefix("sd_") in measured]
        require(match, wanted, "a table of body velocities with standard deviations")
        given = np.isfinite(velocity_b)
        for k, field in enumerate(_SD_V):
            standard_deviation(rows, field.base, given[:, k])
        sd = np.where(given, rows.side_by_side([field.base for field in _SD_V]), np.nan)
    return _warned(BodyVelocityLog(rows.time, velocity_b, sd, *_provenance(rows)))


def read_uwb(path: Path, *, time_offset_s: float = 0.0) -> UwbLog:
    """Read ranges to radio anchors; see the module for columns, checks and errors.

    A row without the name of its anchor, or with a negative range, is refused.
    """
    rows = _read(path, (TIME, _ANCHOR, _RANGE), (_SD_RANGE,), "a table of UWB ranges", time_offset_s, ("anchor",))
    rows = usable_rows(rows, ["range"])
    _require_names(rows)
    rows = ordered_rows_of_several(rows, "anchor")
    rows.refuse(rows.values["range"] < 0.0, "range", "is a negative range; correct the row or remove it")
    sd = standard_deviation(rows, "sd_range")
    return _warned(UwbLog(rows.time, rows.values["anchor"], rows.values["range"], sd, *_provenance(rows)))


def read_uwb_anchors(path: Path) -> UwbAnchors:
    """Read positions of radio anchors.

    Parameters
    ----------
    path : path-like
        A ``.csv`` or ``.parquet`` file with ``anchor, lat_deg, lon_deg, height_m``.

    Raises
    ------
    InputError
        If the file cannot be used, a name is missing or there twice, or a position is missing or not on Earth.

    Warns
    -----
    NavfuseWarning
        For ignored columns.
    """
    table, match = _matched(path, (_ANCHOR, *_PLACE), (), "a table of anchors")
    raw = table.read([match.column[field.base] for field in _PLACE], [match.column["anchor"]])
    values = {base: scaled(raw[match.column[base]], match.factor[base]) for base in ("lat", "lon", "height")}
    values["anchor"] = raw[match.column["anchor"]]
    rows = AidingRows(values, match, table.where, [*table.notes, *match.note_unknown()])
    _require_names(rows)
    names, first = np.unique(rows.values["anchor"], return_index=True)
    if names.size < rows.values["anchor"].size:
        row = int(np.setdiff1d(np.arange(rows.values["anchor"].size), first)[0])
        raise InputError(
            f"{table.source}: {table.where(row)}: the anchor '{rows.values['anchor'][row]}' is there twice; remove or "
            "rename one of them"
        )
    for base, limit, text in (("lat", np.pi / 2.0, "90 deg"), ("lon", TWO_PI, "360 deg"), ("height", 1e6, "1000 km")):
        rows.refuse(~(np.abs(values[base]) <= limit), base, f"is no position, it has to be a number within +-{text}")
    lon = np.where(values["lon"] > np.pi, values["lon"] - TWO_PI, values["lon"])
    return _warned(UwbAnchors(values["anchor"], values["lat"], lon, values["height"], *_provenance(rows)))


def _matched(
    path: Path, needed: tuple[Field, ...], optional: tuple[Field, ...], what: str
) -> tuple[CsvTable | ParquetTable, Match]:
    table = open_table(path)
    match = match_columns(table.names, (*needed, *optional), table.source)
    require(match, needed, what)
    return table, match


def _read(
    path: Path,
    needed: tuple[Field, ...],
    optional: tuple[Field, ...],
    what: str,
    time_offset_s: float,
    text: tuple[str, ...] = (),
) -> AidingRows:
    table, match = _matched(path, needed, optional, what)
    return read_rows(table, match, time_offset_s, text)


def _wheel_base(name: str) -> str:
    """Column name without its unit; the whole name if there is none."""
    base, _, _ = name.rpartition("_")
    return name if base == "wheel" else base


def _require_names(rows: AidingRows) -> None:
    unnamed = np.char.strip(rows.values["anchor"].astype(str)) == ""
    if unnamed.any():
        raise InputError(
            f"{rows.match.source}: {rows.where(int(np.argmax(unnamed)))}, column '{rows.named('anchor')}': the name of "
            "the anchor is missing; correct the row or remove it"
        )


def _check_median(
    rows: AidingRows, size: Array, base: str, bounds: tuple[float, float], factor: float, unit: str, what: str
) -> None:
    median = float(np.median(size))
    if not bounds[0] <= median <= bounds[1]:
        raise InputError(
            f"{rows.match.source}: column '{rows.named(base)}': the values are about {median * factor:.3g} {unit}, "
            f"which no {what} is ({bounds[0] * factor:g} to {bounds[1] * factor:g} {unit}). Is the unit in the column "
            "name another one than that of the values?"
        )


def _provenance(rows: AidingRows) -> tuple[str, tuple[str, ...]]:
    return rows.match.source, tuple(rows.notes)


def _warned(log: LogT) -> LogT:
    for note in log.notes:
        warnings.warn(note, NavfuseWarning, stacklevel=3)
    return log
