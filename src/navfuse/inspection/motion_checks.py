"""Do the velocities of fixes tell the same motion as their positions?"""

from __future__ import annotations

import numpy as np

from navfuse.data.logs import GnssLog
from navfuse.errors import InputError
from navfuse.inspection.findings import Finding, Verdict
from navfuse.inspection.recognise import without_source
from navfuse.io.gnss_plausibility import check_velocity_units, vertical_motion
from navfuse.io.gnss_rows import GnssNames, GnssRows

Array = np.ndarray

_RADIUS = 6371e3
FROZEN_S, FROZEN_MPS = 10.0, 1.0
"""A position that does not change at all for so long at such a speed is an old one."""


def metres(rows: GnssRows | GnssLog) -> tuple[Array, Array]:
    """North and east [m] of the first row."""
    east = (rows.lon - rows.lon[0] + np.pi) % (2.0 * np.pi) - np.pi
    return (rows.lat - rows.lat[0]) * _RADIUS, east * _RADIUS * np.cos(rows.lat[0])


def check_velocity(rows: GnssRows, names: GnssNames, source: str) -> Finding:
    """Velocities against the motion of the positions, horizontally."""
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
    notes = [note for note in notes if "the heights move" not in note]
    if notes:
        if _minutes_fit(rows, names, source):
            fault = without_source(notes[0], source).partition("; is a unit")[0]
            message = (
                f"{fault}; they would agree if the digits behind the degrees were minutes, which never exceed 60: "
                "ddmm.mmmm of NMEA taken for degrees"
            )
            remedy = f"convert '{names.lat}' and '{names.lon}': degrees + minutes / 60"
            return Finding("velocity", Verdict.WRONG, message, remedy)
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


def check_vertical(rows: GnssRows, names: GnssNames) -> Finding:
    """Vertical velocities against heights: only where climbs stand out of the noise of both."""
    assert rows.velocity_n is not None
    check = "vertical velocity"
    motion = vertical_motion(rows.time, rows.height, rows.velocity_n[:, 2])
    if motion is None:
        return Finding(check, Verdict.UNKNOWN, "too few rows with height and vertical velocity, or they never change")
    figures = {"ratio": motion.ratio, "ratio_sd": motion.sd, "correlation": motion.correlation}
    if not motion.told:
        text = (
            f"over ten seconds heights change by {motion.moved:.2g} m, which does not stand out of the noise "
            f"of both (correlation {motion.correlation:.2f}): neither unit nor sign of '{names.velocity[2]}' show"
        )
        return Finding(check, Verdict.UNKNOWN, text, figures=figures)
    if motion.odd:
        verdict = Verdict.WRONG if motion.reversed else Verdict.LOOK
        remedy = (
            f"negate '{names.velocity[2]}'"
            if motion.reversed
            else (f"check unit and sign of '{names.velocity[2]}' and '{names.height}'")
        )
        return Finding(check, verdict, f"column '{names.velocity[2]}': {motion.fault}", remedy, figures=figures)
    text = f"the heights move {motion.ratio:.2f} times as fast, give or take {motion.sd:.2g}"
    return Finding(check, Verdict.OK, text, figures=figures)


def _minutes_fit(rows: GnssRows, names: GnssNames, source: str) -> bool:
    """Whether the positions agree with the velocities once the hundredths of degrees are read as minutes."""
    assert rows.velocity_n is not None
    read = []
    for angle in (rows.lat, rows.lon):
        degrees = np.abs(np.degrees(angle))
        whole = np.floor(degrees)
        if (degrees - whole).max() >= 0.6:
            return False
        read.append(np.sign(angle) * np.radians(whole + (degrees - whole) / 0.6))
    try:
        notes = check_velocity_units(rows.time, read[0], read[1], rows.height, rows.velocity_n, names.velocity, source)
    except InputError:
        return False
    return not [note for note in notes if "the heights move" not in note]


def check_frozen(rows: GnssRows) -> list[Finding]:
    """Positions that stay at the very same place while the vehicle goes on: a receiver that repeats its last fix.

    Velocities tell that it goes on. Without them it has to arrive at speed and to be far away in the row after.
    """
    same = (np.diff(rows.lat) == 0.0) & (np.diff(rows.lon) == 0.0)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], same, [False])).astype(np.int8)))
    north, east = metres(rows)
    speed = None if rows.velocity_n is None else np.linalg.norm(rows.velocity_n[:, :2], axis=1)
    frozen = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        seconds = float(rows.time[last] - rows.time[first])
        if seconds < FROZEN_S:
            continue
        if speed is not None and np.isfinite(inside := speed[first + 1 : last + 1]).mean() > 0.5:
            pace = float(np.nanmedian(inside))
            goes_on = pace > FROZEN_MPS
        else:
            before = int(np.searchsorted(rows.time, rows.time[first] - 3.0))
            if before == first or last + 1 == rows.time.size:
                continue
            span = float(rows.time[first] - rows.time[before])
            pace = float(np.hypot(north[first] - north[before], east[first] - east[before])) / span
            leap = float(np.hypot(north[last + 1] - north[last], east[last + 1] - east[last]))
            goes_on = pace > 3.0 * FROZEN_MPS and span < 10.0 and leap > max(10.0, 3.0 * pace * span)
        if goes_on:
            frozen.append((seconds, float(rows.time[first]), pace))
    if not frozen:
        return []
    seconds, begin, pace = max(frozen)
    more = f" (and {len(frozen) - 1} times more)" if len(frozen) > 1 else ""
    return [
        Finding(
            "frozen positions",
            Verdict.LOOK,
            f"the position does not change at all for {seconds:.4g} s from {begin:.6g} s on{more}, at {pace:.3g} m/s",
            "remove these rows: the receiver repeats its last position",
            figures={"frozen_s": seconds, "from_s": begin, "speed_mps": pace},
        )
    ]


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
