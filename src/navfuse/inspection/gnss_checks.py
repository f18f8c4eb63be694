"""Fixes by themselves: positions, units, velocities, and whether the standard deviations can be true."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np

from navfuse.data.logs import GnssLog
from navfuse.errors import InputError
from navfuse.inspection.findings import Finding, Verdict
from navfuse.inspection.motion_checks import check_frozen, check_velocity, check_vertical, metres
from navfuse.inspection.recognise import PLACE, Recognised, without_source
from navfuse.inspection.sigma_checks import check_sigmas
from navfuse.inspection.time_checks import Stamps, check_stamps
from navfuse.io.columns import Field
from navfuse.io.gnss_plausibility import check_position_units
from navfuse.io.gnss_rows import NO_FIX, GnssNames, GnssRows, check_range
from navfuse.io.gnss_table import N_SATELLITES, SD_POSITION, SD_VELOCITY, VELOCITY
from navfuse.io.rtklib_pos import rtklib_rows
from navfuse.io.tables import Where
from navfuse.io.units import UNITS, scaled

Array = np.ndarray

OUTLIER_M, OUTLIER_TIMES = 30.0, 15.0
DEEPEST, HIGHEST = -500.0, 20000.0


@dataclass(frozen=True, slots=True)
class RawGnss:
    """Fixes as they stand in the file, SI units by the names of the columns.

    Attributes
    ----------
    rows : GnssRows
        At the rows of `stamps`.
    names : GnssNames
    stamps : Stamps
    where : callable
        Row of the file -> its name for a person.
    """

    rows: GnssRows
    names: GnssNames
    stamps: Stamps
    where: Where


@dataclass(frozen=True, slots=True)
class GnssReport:
    """What the checks found, and the fixes as the findings say they ought to be read; None if nothing is left."""

    findings: tuple[Finding, ...]
    log: GnssLog | None


def read_raw_gnss(found: Recognised, epoch: tuple[int, float] | None = None) -> RawGnss:
    """The fixes of a table or of an RTKLIB solution, nothing repaired or refused.

    Raises
    ------
    InputError
        If the file cannot be read, or lacks time, latitude or longitude.
    """
    if found.role == "rtklib pos":
        rows, names, where = rtklib_rows(found.path, [], epoch=epoch)
        return _at_stamps(rows, names, where)
    table, columns = found.table, found.columns
    assert table is not None
    missing = [base for base in ("time", "lat", "lon") if base not in columns]
    if missing:
        raise InputError(f"{table.source}: no column of {' and '.join(missing)} was recognised")
    text = [columns["fix"].name] if "fix" in columns else []
    values = table.read([one.name for base, one in columns.items() if base != "fix"], text)
    size = values[columns["time"].name].size

    def column(one: Field) -> Array:
        if one.base not in columns:
            return np.full(size, np.nan)
        unit = columns[one.base].unit or one.unit
        return scaled(values[columns[one.base].name], UNITS[one.quantity or ""].get(unit, 1.0) if one.quantity else 1.0)

    def triad(group: tuple[Field, ...]) -> Array | None:
        if not any(one.base in columns for one in group):
            return None
        return np.column_stack([column(one) for one in group])

    def called(group: tuple[Field, ...]) -> tuple[str, ...]:
        return tuple(columns[one.base].name if one.base in columns else one.name for one in group)

    time = Field("time", "time", "s")
    lat, lon, height = (column(one) for one in PLACE)
    rows = GnssRows(
        time=column(time),
        lat=lat,
        lon=lon,
        height=height if "height" in columns else np.zeros(size),
        sd_position=triad(SD_POSITION),
        velocity_n=triad(VELOCITY),
        sd_velocity=triad(SD_VELOCITY),
        fix=values[text[0]] if text else None,
        n_satellites=column(N_SATELLITES) if N_SATELLITES.base in columns else None,
    )
    names = GnssNames(
        columns["time"].name,
        *called(PLACE)[:3],
        sd_position=called(SD_POSITION),
        velocity=called(VELOCITY),
        sd_velocity=called(SD_VELOCITY),
    )
    return _at_stamps(rows, names, table.where)


def _at_stamps(rows: GnssRows, names: GnssNames, where: Where) -> RawGnss:
    values = np.column_stack((rows.lat, rows.lon, rows.height))
    stamps = check_stamps(rows.time, names.time, "gnss", _pace(rows), values)
    return RawGnss(replace(rows.take(stamps.rows), time=stamps.time), names, stamps, where)


def _pace(rows: GnssRows) -> float:
    """How fast the fixes move by their stamps [m/s], the ninetieth percentile; NaN if they stay within 100 m."""
    rows = rows.take(np.isfinite(rows.time) & np.isfinite(rows.lat) & np.isfinite(rows.lon))
    if rows.time.size < 10:
        return np.nan
    north, east = metres(rows)
    span = np.diff(rows.time)
    moved = np.hypot(np.diff(north), np.diff(east))[span > 0.0]
    far = np.percentile(np.hypot(north - np.median(north), east - np.median(east)), 90.0)
    return float(np.percentile(moved / span[span > 0.0], 90.0)) if moved.size and far > 100.0 else np.nan


def check_gnss(raw: RawGnss, source: str) -> GnssReport:
    """All checks that need the fixes alone."""
    found = list(raw.stamps.findings)
    rows = raw.rows
    if rows.time.size < 2:
        return GnssReport(tuple(found), None)
    index = np.flatnonzero(_usable(rows))
    found.append(_fixes(rows, index.size))
    rows = rows.take(index)
    if rows.time.size < 2:
        return GnssReport(tuple(found), None)

    def where(row: int) -> str:
        return raw.where(int(raw.stamps.rows[index[row]]))

    rows, finding = _position(rows, raw.names, source, where)
    found.append(finding)
    found.append(_height(rows, raw.names))
    found += [_outliers(rows), *check_frozen(rows)]
    if rows.velocity_n is not None:
        velocity = check_velocity(rows, raw.names, source)
        found += [velocity, check_vertical(rows, raw.names)]
        if velocity.verdict is Verdict.WRONG and not re.search("latitude|longitude|_rad|minutes", velocity.text):
            # The checks against the inertial log go by what is left in order.
            rows = replace(rows, velocity_n=None, sd_velocity=None)
    found += check_sigmas(_log(rows, source), rows.sd_position, raw.names.sd_position)
    return GnssReport(tuple(found), _log(rows, source))


def _usable(rows: GnssRows) -> Array:
    usable = np.isfinite(rows.lat) & np.isfinite(rows.lon) & (np.abs(rows.height) < 1e9)
    origin = (rows.lat == 0.0) & (rows.lon == 0.0)
    if not origin[usable].all():
        usable &= ~origin
    if rows.fix is not None:
        usable &= ~np.isin(np.char.lower(rows.fix.astype(str)), list(NO_FIX))
    return usable


def _fixes(rows: GnssRows, usable: int) -> Finding:
    total = rows.time.size
    kinds = ""
    if rows.fix is not None:
        names, counts = np.unique(rows.fix.astype(str), return_counts=True)
        kinds = ": " + ", ".join(
            f"{name or 'none'} {100.0 * count / total:.3g} %" for name, count in zip(names, counts, strict=True)
        )
    text = f"{usable} of {total} rows hold a position{kinds}"
    if usable < 2:
        return Finding("fixes", Verdict.WRONG, text, "export the positions too")
    if usable < 0.5 * total:
        return Finding("fixes", Verdict.WRONG, text, "more than half is missing; check how the file was made")
    return Finding("fixes", Verdict.OK if usable > 0.9 * total else Verdict.LOOK, text)


def _position(rows: GnssRows, names: GnssNames, source: str, where: Where) -> tuple[GnssRows, Finding]:
    """Range and unit of the positions; the rows as they ought to be."""
    try:
        check_range(rows, names, source, where)
    except InputError as error:
        fault = without_source(str(error), source).removesuffix(" Are latitude and longitude exchanged?")
        fault = fault.removesuffix(" Are these degrees?")
        half = np.pi / 2.0
        if np.abs(rows.lat).max() > 4.0 * np.pi and names.lat.endswith("rad"):
            remedy = f"these look like degrees: rename '{names.lat}', '{names.lon}' to 'lat_deg', 'lon_deg'"
            rows = replace(rows, lat=np.radians(rows.lat), lon=np.radians(rows.lon))
        elif (np.abs(rows.lon) <= half).all() and (np.abs(rows.lat) <= 2.0 * np.pi).all():
            fault += "; latitude and longitude are exchanged"
            remedy = f"exchange the names '{names.lat}' and '{names.lon}'"
            rows = replace(rows, lat=rows.lon, lon=rows.lat)
        else:
            remedy = "check the columns and their unit"
            rows = rows.take((np.abs(rows.lat) <= half) & (np.abs(rows.lon) <= 2.0 * np.pi))
        return rows, Finding("position", Verdict.WRONG, fault, remedy)
    triple = (names.lat, names.lon, names.height)
    try:
        notes = check_position_units(rows.time, rows.lat, rows.lon, rows.height, rows.velocity_n, triple, source)
    except InputError as error:
        fault, _, remedy = without_source(str(error), source).partition(": rename ")
        rows = replace(rows, lat=rows.lat * 180.0 / np.pi, lon=rows.lon * 180.0 / np.pi)
        return rows, Finding("position", Verdict.WRONG, fault, f"rename {remedy}" if remedy else "")
    if notes:
        return rows, Finding("position", Verdict.LOOK, "; ".join(without_source(note, source) for note in notes))
    north, east = metres(rows)
    size = float(np.hypot(np.ptp(north), np.ptp(east)))
    text = (
        f"around {np.degrees(np.median(rows.lat)):.4f} deg N, {np.degrees(np.median(rows.lon)):.4f} deg E, within "
        f"{size:.4g} m"
    )
    return rows, Finding("position", Verdict.OK, text, figures={"extent_m": size})


def _height(rows: GnssRows, names: GnssNames) -> Finding:
    middle = float(np.median(rows.height))
    text = f"{rows.height.min():.1f} to {rows.height.max():.1f} m"
    if not DEEPEST < middle < HIGHEST:
        return Finding(
            "height",
            Verdict.LOOK,
            f"{text}: not a height of a vehicle in metres",
            f"check '{names.height}' and its unit",
        )
    if not rows.height.any():
        return Finding("height", Verdict.LOOK, "all heights are 0 m", "export the ellipsoidal height too")
    return Finding("height", Verdict.OK, f"{text}; ellipsoid or geoid, metres or feet: nothing here tells",
                   figures={"median_m": middle})  # fmt: skip


def _outliers(rows: GnssRows) -> Finding:
    """Single fixes far from the path of those around them."""
    if rows.time.size < 7:
        return Finding("outliers", Verdict.UNKNOWN, f"{rows.time.size} fixes are too few to tell")
    north, east = metres(rows)
    apart = np.hypot(_off_path(rows.time, north), _off_path(rows.time, east))
    usual = float(np.median(apart))
    far = np.flatnonzero(apart > max(OUTLIER_M, OUTLIER_TIMES * usual))
    far = far[np.diff(rows.time)[far + 1] < 3.0 * np.median(np.diff(rows.time))]
    if far.size:
        worst = int(far[np.argmax(apart[far])])
        return Finding(
            "outliers",
            Verdict.LOOK,
            f"{far.size} fixes are {OUTLIER_M:g} m or more off the line through their neighbours, the worst "
            f"{apart[worst]:.3g} m at "
            f"{rows.time[worst + 2]:.6g} s",
            "the filter's gate leaves such fixes out; many of them mean a bad sky or a bad export",
            figures={"outliers": float(far.size), "worst_m": float(apart[worst])},
        )
    return Finding("outliers", Verdict.OK, f"none; the median fix is {usual:.3g} m off the line through its neighbours")


def _off_path(time: Array, values: Array) -> Array:
    """How far rows 2 to -3 are from the middle of what the pairs around them say by straight lines."""
    near = values[1:-3] + (values[3:-1] - values[1:-3]) * (time[2:-2] - time[1:-3]) / (time[3:-1] - time[1:-3])
    wide = values[:-4] + (values[4:] - values[:-4]) * (time[2:-2] - time[:-4]) / (time[4:] - time[:-4])
    a, b = np.abs(values[2:-2] - near), np.abs(values[2:-2] - wide)
    return np.minimum(a, b)


def _log(rows: GnssRows, source: str) -> GnssLog:
    """A log of the rows for the checks that follow, standard deviations of a metre where there are none."""
    sd = np.full((rows.time.size, 3), 1.0) if rows.sd_position is None else rows.sd_position
    velocity = rows.velocity_n
    if velocity is not None and not np.isfinite(velocity).all(axis=1).any():
        velocity = None
    sd_velocity = None
    if velocity is not None:
        given = np.full(velocity.shape, 0.2) if rows.sd_velocity is None else rows.sd_velocity
        sd_velocity = np.where(given > 0.0, given, 0.2)
    return GnssLog(
        time=rows.time,
        lat=rows.lat,
        lon=rows.lon,
        height=rows.height,
        sd_position=np.where(sd > 0.0, sd, 1.0),
        velocity_n=velocity,
        sd_velocity=sd_velocity,
        fix=rows.fix,
        source=source,
    )
