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
