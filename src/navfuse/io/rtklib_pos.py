"""RTKLIB solution files (``.pos``).

The line that starts with ``%`` and names the columns tells the format: latitude, longitude and height with degrees as
a decimal number or as degrees, minutes, seconds; or ECEF coordinates; times as date and time or as week and seconds of
week, in GPS time, UTC or JST; any separator; velocities or none. Columns are found by name, so that files of RTKLIB
2.4.2, 2.4.3, the demo5 branch and programs that imitate them read alike (RTKLIB manual 2.4.2, appendix B.1;
``solution.c``).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.logs import GnssLog
from navfuse.errors import InputError
from navfuse.io.gnss_rows import UNSTATED, GnssNames, GnssRows, StatedSigmas, gnss_log
from navfuse.io.gps_time import DAY, WEEK, days_since_epoch, leap_seconds

Array = np.ndarray

FIX_NAMES = {
    0: "none",
    1: "rtk-fixed",
    2: "rtk-float",
    3: "sbas",
    4: "dgps",
    5: "single",
    6: "ppp",
    7: "dead-reckoning",
}
"""RTKLIB quality code Q -> fix type (``SOLQ_...`` of ``rtklib.h``)."""

_JST_OFFSET = 32400.0
_DATE = re.compile(r"(\d{2,4})/(\d{1,2})/(\d{1,2})\s+(\d{1,2}):(\d{1,2}):(\d{1,2}(?:\.\d*)?)(.*)", re.DOTALL)
_NOT_A_NUMBER = re.compile(r"[-+]?(nan|1\.#(ind|qnan|inf)|inf)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class _Layout:
    """What the column line says; `field` gives the first field after the time of each column, `width` their number."""

    system: str
    separator: str
    is_ecef: bool
    position: tuple[str, str, str]
    field: dict[str, int]
    width: int
    sexagesimal: bool


def parse_rtklib_pos(
    path: Path,
    time_offset_s: float = 0.0,
    epoch: tuple[int, float] | None = None,
    stated: StatedSigmas = UNSTATED,
) -> GnssLog:
    """Read an RTKLIB solution file.

    Q becomes the fix type; rows with Q = 0 and those of dead reckoning, Q = 7, are left out. Velocities are used if
    the file has them; rows whose velocity and its standard deviations are all exactly zero have none. UTC and JST
    stamps are converted to GPS time with the leap seconds of their date.

    Parameters
    ----------
    path : Path
        An existing file.
    time_offset_s : float
        Added to the stamps [s].
    epoch : (week, seconds of week), optional
        GPS time that the stamps are counted from. Default: the start of the GPS week of the first row, so that stamps
        are seconds of week that go on across the week's end.

    Returns
    -------
    GnssLog
        See :func:`navfuse.io.gnss_rows.gnss_log`. ECEF standard deviations and velocities are turned to north, east,
        down.

    Raises
    ------
    InputError
        If the file cannot be used: no column line, a baseline file, a datum other than WGS 84, a line that cannot be
        read.
    ConfigError
        If the epoch is not a week number and seconds of week.
    """
    return _log(path, time_offset_s, epoch, lambda rows: (rows, stated))


def parse_rtklib_track(path: Path) -> GnssLog:
    """Read an RTKLIB solution file for where it was, as a trajectory and not as measurements.

    Unlike :func:`parse_rtklib_pos` it takes the rows of dead reckoning too, and does not look at the standard
    deviations, which may be zero: those of the log mean nothing.

    Parameters
    ----------
    path : Path
        An existing file.

    Returns
    -------
    GnssLog

    Raises
    ------
    InputError
        If the file cannot be used.
    """

    def unweighted(rows: GnssRows) -> tuple[GnssRows, StatedSigmas]:
        fix = None if rows.fix is None else np.where(rows.fix == "none", "none", "")
        one = np.ones(3)
        stated = StatedSigmas(one, None if rows.velocity_n is None else one)
        return replace(rows, fix=fix, sd_position=None, sd_velocity=None), stated

    return _log(path, 0.0, None, unweighted)


def _log(
    path: Path,
    time_offset_s: float,
    epoch: tuple[int, float] | None,
    used: Callable[[GnssRows], tuple[GnssRows, StatedSigmas]],
) -> GnssLog:
    source = str(path)
    notes: list[str] = []
    layout, days, seconds, lines, data = _read_lines(path, source, notes)
    week, tow = start = (
        GpsEpoch(int((days[0] * DAY + seconds[0]) // WEEK), 0.0) if epoch is None else GpsEpoch.of(*epoch)
    )
    rows, stated = used(_rows((days - 7 * week) * DAY + (seconds - tow) + time_offset_s, data, layout))
    ecef = layout.is_ecef
    names = GnssNames(
        "time",
        *layout.position,
        sd_position=("sdx", "sdy", "sdz") if ecef else ("sdn", "sde", "sdu"),
        velocity=("vx", "vy", "vz") if ecef else ("vn", "ve", "vu"),
        sd_velocity=("sdvx", "sdvy", "sdvz") if ecef else ("sdvn", "sdve", "sdvu"),
    )
    log = gnss_log(rows, names, source, lambda row: f"line {lines[row]}", notes, stated)
    return replace(log, epoch=start)


def _read_lines(path: Path, source: str, notes: list[str]) -> tuple[_Layout, Array, Array, list[int], Array]:
    """Layout, then of every row: GPS days since 1980-01-06, seconds of day, line number, fields after the time."""
    text = path.read_bytes().decode("utf-8-sig", errors="replace").split("\n")
    layout: _Layout | None = None
    days: list[int] = []
    seconds: list[float] = []
    numbers: list[int] = []
    rows: list[list[float]] = []
    for number, line in enumerate(text, start=1):
        if line.startswith("%"):
            found = _parse_header(line, source, notes)
            if found is not None and layout is not None and found != layout:
                raise InputError(f"{source}: line {number}: the columns change here; cut the file into two")
            layout = found or layout
            continue
        if not line.strip():
            continue
        if layout is None:
            raise InputError(
                f"{source}: line {number}: data before a line that starts with % and names the columns (latitude(deg)"
                " ...); is this an RTKLIB solution? Export it with field names"
            )
        try:
            day, second, row = _parse_row(line, layout)
        except ValueError as error:
            if number == len(text) and rows:
                notes.append(f"{source}: the last line is cut off, it was left out")
                break
            raise InputError(f"{source}: line {number}: {error}; correct or remove the line") from error
        days.append(day)
        seconds.append(second)
        numbers.append(number)
        rows.append(row)
    if layout is None or not rows:
        raise InputError(f"{source}: the file has no solution rows")
    return layout, np.array(days), np.array(seconds), numbers, np.array(rows)


def _parse_header(line: str, source: str, notes: list[str]) -> _Layout | None:
    """Layout if this is the line that names the columns; refuses what cannot be used."""
    if "e-baseline(m)" in line:
        raise InputError(
            f"{source}: holds baselines to a base station, not positions; export lat/lon/height or x/y/z-ecef instead"
        )
    if "=Tokyo" in line:
        raise InputError(f"{source}: the positions are in the Tokyo datum; export them in WGS84")
    if "WGS84/geodetic" in line:
        notes.append(
            f"{source}: heights are above the geoid, navfuse takes them for ellipsoidal heights; export ellipsoidal"
            " heights"
        )
    ecef, sexagesimal = "x-ecef(m)" in line, "latitude(d'\")" in line
    if not (ecef or sexagesimal or "latitude(deg)" in line):
        return None
    mark = "x-ecef(m)" if ecef else "latitude(d'\")" if sexagesimal else "latitude(deg)"
    after = line[line.index(mark) + len(mark) :]
    separator = next((sign for sign in (",", ";", "\t") if after.lstrip(" ").startswith(sign)), " ")
    system, *labels = line[1:].replace(separator, " ").split()
    if system not in ("GPST", "UTC", "JST"):
        raise InputError(f"{source}: the time system '{system}' is not known; export times as GPST or UTC")
    position = ("x-ecef", "y-ecef", "z-ecef") if ecef else ("latitude", "longitude", "height")
    field: dict[str, int] = {}
    width = 0
    for label in labels:
        name = label.split("(")[0]
        field[name] = width
        width += 3 if sexagesimal and name in ("latitude", "longitude") else 1
    missing = [name for name in position if name not in field]
    if missing:
        raise InputError(f"{source}: the column line lacks {', '.join(missing)}")
    return _Layout(system, separator, ecef, position, field, width, sexagesimal)


def _parse_row(line: str, layout: _Layout) -> tuple[int, float, list[float]]:
    """GPS days since 1980-01-06, seconds of day, fields after the time; raises ValueError with what is wrong."""
    date = _DATE.match(line.strip())
    if date:
        year, month, day, hour, minute = (int(part) for part in date.groups()[:5])
        year += 0 if year >= 100 else 2000 if year < 80 else 1900
        days, seconds = days_since_epoch(year, month, day), 3600.0 * hour + 60.0 * minute + float(date[6])
        rest = date[7].replace(layout.separator, " ").split()
    else:
        tokens = line.replace(layout.separator, " ").split()
        if len(tokens) < 2 or not re.fullmatch(r"[0-9]{1,5}", tokens[0]):
            raise ValueError(f"'{line.strip()[:30]}' does not start with a date and time or a week and seconds")
        tow, rest = float(tokens[1]), tokens[2:]
        if not 0.0 <= tow <= WEEK:
            raise ValueError(f"{tow:g} is outside the seconds of a week")
        days, seconds = int(tokens[0]) * 7 + int(tow // DAY), tow % DAY
    if len(rest) < layout.width:
        raise ValueError(f"has {len(rest)} values after the time, the column line names {layout.width}")
    offset = 0 if layout.system == "GPST" else _gps_minus_utc(days, seconds, layout.system)
    return days, seconds + offset, [_number(field) for field in rest[: layout.width]]


def _gps_minus_utc(days: int, seconds: float, system: str) -> float:
    """What takes a UTC or JST stamp to GPS time [s]; leap seconds are those of the UTC day."""
    if system == "JST":
        return leap_seconds(days if seconds >= _JST_OFFSET else days - 1) - _JST_OFFSET
    return leap_seconds(days)


def _number(field: str) -> float:
    try:
        return float(field)
    except ValueError:
        if _NOT_A_NUMBER.match(field):
            return np.nan
        raise ValueError(f"'{field[:30]}' is not a number") from None


def _rows(time: Array, data: Array, layout: _Layout) -> GnssRows:
    def column(name: str) -> Array | None:
        return data[:, layout.field[name]] if name in layout.field else None

    def triad(*names: str) -> Array | None:
        parts = [data[:, layout.field[name]] for name in names if name in layout.field]
        return np.column_stack(parts) if len(parts) == 3 else None

    quality, satellites = column("Q"), column("ns")
    fix = (
        None
        if quality is None
        else np.array([FIX_NAMES.get(int(q), "none") if np.isfinite(q) else "none" for q in quality])
    )
    if layout.is_ecef:
        lat, lon, height, sd, velocity, sd_velocity = _from_ecef(
            data[:, [layout.field[name] for name in layout.position]], triad
        )
    else:
        lat, lon = (_angles(data, layout, name) for name in ("latitude", "longitude"))
        height = data[:, layout.field["height"]]
        sd, velocity, sd_velocity = triad("sdn", "sde", "sdu"), triad("vn", "ve", "vu"), triad("sdvn", "sdve", "sdvu")
        if velocity is not None:
            velocity = velocity * (1.0, 1.0, -1.0)
    if velocity is not None and sd_velocity is not None:
        none = ~np.any(velocity, axis=1) & ~np.any(sd_velocity, axis=1)
        velocity = np.where(none[:, None], np.nan, velocity)
    return GnssRows(time, lat, lon, height, sd, velocity, sd_velocity, fix, satellites)


def _angles(data: Array, layout: _Layout, name: str) -> Array:
    first = layout.field[name]
    if not layout.sexagesimal:
        return np.radians(data[:, first])
    degrees, minutes, seconds = data[:, first : first + 3].T
    return np.radians(np.copysign(np.abs(degrees) + minutes / 60.0 + seconds / 3600.0, degrees))


def _from_ecef(
    position: Array, triad: Callable[..., Array | None]
) -> tuple[Array, Array, Array, Array | None, Array | None, Array | None]:
    """Geodetic position, and standard deviations and velocity turned to north, east, down."""
    from navfuse.core.earth import ecef_to_geodetic_batch

    usable = np.isfinite(position).all(axis=1) & (np.linalg.norm(position, axis=1) > 1e6)
    lat, lon, height = np.full((3, position.shape[0]), np.nan)
    lat[usable], lon[usable], height[usable] = ecef_to_geodetic_batch(position[usable])
    velocity = triad("vx", "vy", "vz")
    axes = _ned_axes(lat, lon)
    return (
        lat,
        lon,
        height,
        _turned_sigmas(axes, triad("sdx", "sdy", "sdz"), triad("sdxy", "sdyz", "sdzx")),
        None if velocity is None else np.einsum("nij,nj->ni", axes, velocity),
        _turned_sigmas(axes, triad("sdvx", "sdvy", "sdvz"), triad("sdvxy", "sdvyz", "sdvzx")),
    )


def _ned_axes(lat: Array, lon: Array) -> Array:
    """Rows of each (3, 3) matrix: north, east and down as ECEF vectors."""
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    north = (-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat)
    east = (-sin_lon, cos_lon, np.zeros_like(lat))
    down = (-cos_lat * cos_lon, -cos_lat * sin_lon, -sin_lat)
    return np.moveaxis(np.array([north, east, down]), -1, 0)


def _turned_sigmas(axes: Array, sd: Array | None, cross: Array | None) -> Array | None:
    """Standard deviations along `axes` [north, east, down]; RTKLIB writes a covariance c as sign(c) sqrt(|c|)."""
    if sd is None:
        return None
    x, y, z = (sd**2).T
    xy, yz, zx = np.copysign(cross**2, cross).T if cross is not None else np.zeros((3, sd.shape[0]))
    covariance = np.moveaxis(np.array([[x, xy, zx], [xy, y, yz], [zx, yz, z]]), -1, 0)
    variance = np.einsum("nij,njk,nik->ni", axes, covariance, axes)
    return np.sqrt(np.maximum(variance, 0.0))
