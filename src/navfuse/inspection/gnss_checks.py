"""Fixes by themselves: positions, units, velocities, and whether the standard deviations can be true."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from navfuse.data.logs import GnssLog
from navfuse.errors import InputError
from navfuse.inspection.findings import Finding, Verdict
from navfuse.inspection.recognise import PLACE, Recognised, without_source
from navfuse.inspection.time_checks import Stamps, check_stamps
from navfuse.io.columns import Field
from navfuse.io.gnss_plausibility import check_position_units, check_velocity_units
from navfuse.io.gnss_rows import DEFAULT_SD_POSITION, NO_FIX, GnssNames, GnssRows, check_range
from navfuse.io.gnss_table import N_SATELLITES, SD_POSITION, SD_VELOCITY, VELOCITY
from navfuse.io.rtklib_pos import rtklib_rows
from navfuse.io.tables import Where
from navfuse.io.units import UNITS, scaled

Array = np.ndarray

_RADIUS = 6371e3
WINDOW = 8
FEWEST_WINDOWS = 4
TOO_LARGE, FAR_TOO_LARGE, TOO_SMALL = 40.0, 150.0, 1.0 / 8.0
COARSE_M = 20.0
"""Stated standard deviation over scatter from row to row, beyond which it is told. Receivers smooth: their errors are
much alike from row to row, so that a ratio above TOO_LARGE counts only with more than COARSE_M stated.
"""
IDEAL_M = 1e-4
BY_KIND = 20.0
"""Stated standard deviation against what is usual for the kind of fix."""
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
    stamps = check_stamps(rows.time, names.time, "gnss", _pace(rows))
    return RawGnss(replace(rows.take(stamps.rows), time=stamps.time), names, stamps, where)


def _pace(rows: GnssRows) -> float:
    """How fast the fixes move by their stamps [m/s], the ninetieth percentile; NaN if they stay within 100 m."""
    rows = rows.take(np.isfinite(rows.time) & np.isfinite(rows.lat) & np.isfinite(rows.lon))
    if rows.time.size < 10:
        return np.nan
    north, east = _metres(rows)
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
    found.append(_outliers(rows))
    if rows.velocity_n is not None:
        found.append(_velocity(rows, raw.names, source))
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
    north, east = _metres(rows)
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
    north, east = _metres(rows)
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


def _velocity(rows: GnssRows, names: GnssNames, source: str) -> Finding:
    velocity = rows.velocity_n
    assert velocity is not None
    given = np.isfinite(velocity).all(axis=1)
    if np.count_nonzero(given) < 3:
        return Finding("velocity", Verdict.LOOK, "the columns of velocity are empty", "leave them out, or export them")
    try:
        notes = check_velocity_units(rows.time, rows.lat, rows.lon, rows.height, velocity, names.velocity, source)
    except InputError as error:
        fault, _, remedy = without_source(str(error), source).rpartition("; ")
        return Finding("velocity", Verdict.WRONG, fault or remedy, remedy if fault else "correct the columns")
    speed = np.linalg.norm(velocity[given][:, :2], axis=1)
    if notes:
        radian = _angle_in_radians(rows, names, source)
        if radian:
            fault = without_source(notes[0], source).partition("; are columns")[0]
            message = f"{fault}; they would agree if '{radian}' held radians"
            return Finding("velocity", Verdict.WRONG, message, f"rename '{radian}' to end in _rad")
        return Finding("velocity", Verdict.LOOK, "; ".join(without_source(note, source) for note in notes),
                       "check units and signs of these columns")  # fmt: skip
    fast = float(np.percentile(speed, 99.0))
    text = f"1 row in 100 is faster than {fast:.4g} m/s, as the positions move"
    return Finding("velocity", Verdict.OK, text, figures={"fastest_mps": fast})


def _angle_in_radians(rows: GnssRows, names: GnssNames, source: str) -> str:
    """The one column of latitude and longitude that agrees with the velocities as radians, "" if none does."""
    assert rows.velocity_n is not None
    to_degrees = 180.0 / np.pi
    trials = ((names.lat, rows.lat * to_degrees, rows.lon), (names.lon, rows.lat, rows.lon * to_degrees))
    for name, lat, lon in trials:
        if np.abs(lat).max() > np.pi / 2.0 or np.abs(lon).max() > 2.0 * np.pi:
            continue
        try:
            if not check_velocity_units(rows.time, lat, lon, rows.height, rows.velocity_n, names.velocity, source):
                return name
        except InputError:
            continue
    return ""


def check_sigmas(log: GnssLog, stated: Array | None, names: tuple[str, ...]) -> list[Finding]:
    """Stated standard deviations against the scatter of the fixes about a smooth local path.

    Parameters
    ----------
    log : GnssLog
    stated : (n, 3) array [m] or None
        As the file has them: may hold NaN and what is not positive.
    names : tuple of 3 str
        Their columns.
    """
    if stated is None or not np.isfinite(stated).any():
        return [
            Finding(
                "position sigmas",
                Verdict.LOOK,
                "the file states no standard deviations of the positions; cautious defaults are used",
                "add them, or set gnss.sd_position_m to what the receiver reaches",
            )
        ]
    flawed = int(np.count_nonzero((stated <= 0.0).any(axis=1)))
    if flawed:
        return [
            Finding(
                "position sigmas",
                Verdict.WRONG,
                f"{flawed} of {stated.shape[0]} rows state a standard deviation that is zero or negative, which would "
                "be a perfect measurement",
                f"give the true ones, or remove {', '.join(names)} to get defaults",
                figures={"rows": float(flawed)},
            )
        ]
    kind, rows = _usual_kind(log)
    sd = float(np.nanmedian(np.hypot(stated[rows, 0], stated[rows, 1])) / np.sqrt(2.0))
    scatter = local_scatter(log)
    figures = {"stated_m": sd}
    said = f"stated {sd:.3g} m (median, per horizontal axis)"
    if kind:
        usual = DEFAULT_SD_POSITION[kind][0]
        if not usual / BY_KIND <= sd <= usual * BY_KIND:
            size = "large" if sd > usual else "small"
            text = f"{said} for fixes called {kind}, which reach {usual:g} m as a rule"
            return [_sigma_finding(text, size, sd / usual, figures)]
    if scatter is None:
        message = f"{said}; too few fixes in a row to see their scatter"
        return [Finding("position sigmas", Verdict.UNKNOWN, message, figures=figures)]
    if scatter < IDEAL_M:
        message = f"{said}; the fixes do not scatter at all, as simulated ones without noise do"
        return [Finding("position sigmas", Verdict.UNKNOWN, message, figures=figures)]
    ratio = sd / scatter
    figures |= {"scatter_m": scatter, "ratio": ratio}
    text = f"{said}; from row to row the fixes scatter by {scatter:.3g} m about a smooth path where it is calmest"
    if not kind and (ratio > FAR_TOO_LARGE or (ratio > TOO_LARGE and sd > COARSE_M)):
        return [_sigma_finding(text, "large", ratio, figures)]
    if ratio < TOO_SMALL and scatter > 0.005:
        return [_sigma_finding(text, "small", ratio, figures)]
    return [Finding("position sigmas", Verdict.OK, text, figures=figures)]


def _sigma_finding(text: str, size: str, ratio: float, figures: Mapping[str, float]) -> Finding:
    times = ratio if ratio > 1.0 else 1.0 / ratio
    cause = "is the unit right (m, cm, mm; variances)?" if size == "large" else "is the unit right (m, km; mm in m)?"
    scale = float(f"{1.0 / ratio:.1g}")
    return Finding(
        "position sigmas",
        Verdict.LOOK,
        f"{text}: they look too {size}, about {times:.2g} times; {cause}",
        f"correct the columns, or scale them with gnss.sd_scale = {scale:g}",
        figures=dict(figures) | {"ratio": ratio},
    )


def _usual_kind(log: GnssLog) -> tuple[str, Array]:
    """The kind of most fixes if it is one with a usual accuracy, and which rows are of it; "" and all otherwise."""
    every = np.ones(log.time.size, dtype=bool)
    if log.fix is None:
        return "", every
    kinds = np.char.lower(log.fix.astype(str))
    names, counts = np.unique(kinds, return_counts=True)
    name = str(names[int(np.argmax(counts))])
    return (name, kinds == name) if name in DEFAULT_SD_POSITION and name else ("", every)


def local_scatter(log: GnssLog) -> float | None:
    """White part of the errors of horizontal positions [m], None if there are too few fixes in a row.

    Third differences, free of any motion of constant acceleration, over windows of eight; of the windows the quarter
    with the least is taken, where the vehicle stands or goes straight on.
    """
    step = np.diff(log.time)
    usual = float(np.median(step))
    north, east = _metres(log)
    even = np.abs(step - usual) < 0.3 * usual
    whole = even[:-2] & even[1:-1] & even[2:]
    bends = [np.where(whole, np.diff(values, 3) ** 2, np.nan) for values in (north, east)]
    count = bends[0].size // WINDOW
    if count < FEWEST_WINDOWS:
        return None
    north, east = (part[: count * WINDOW].reshape(count, WINDOW) for part in bends)
    square = (north + east) / (2.0 * 20.0)
    mean = np.array([row.mean() for row in square if np.isfinite(row).all()])
    if mean.size < FEWEST_WINDOWS:
        return None
    return float(np.sqrt(np.percentile(mean, 25.0)) * 1.2)


def _metres(rows: GnssRows | GnssLog) -> tuple[Array, Array]:
    """North and east [m] of the first row."""
    east = (rows.lon - rows.lon[0] + np.pi) % (2.0 * np.pi) - np.pi
    return (rows.lat - rows.lat[0]) * _RADIUS, east * _RADIUS * np.cos(rows.lat[0])


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
