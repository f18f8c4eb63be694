"""Logs for dead reckoning that cannot be right: other units, or not of one drive."""

from __future__ import annotations

import numpy as np

from navfuse.data.aiding_logs import HeadingLog, OdometerLog
from navfuse.data.logs import GnssLog
from navfuse.data.trajectory import Trajectory
from navfuse.dead_reckoning.odometry import metres_per_radian
from navfuse.errors import InputError

Array = np.ndarray

MOVING = 1.0
"""A GNSS speed above this [m/s] has a course."""
FEWEST = 10
"""Fixes in motion below which nothing is said."""
SPEED_UNITS = (("km/h", 3.6), ("mile/h", 2.236936), ("knots", 1.943844), ("cm/s", 100.0), ("mm/s", 1000.0))
TOLERANCE = 0.12
"""How near to the factor of a unit the ratio of speeds has to be."""
AGREES = np.radians(20.0)
"""Median difference of heading and course below which they belong together."""


def check_belongs_together(track: Trajectory, gnss: GnssLog) -> None:
    """Refuse a track and fixes that do not overlap.

    Raises
    ------
    InputError
        Names both spans.
    """
    if not len(track) or not gnss.time.size:
        raise InputError(f"{gnss.source if len(track) else track.source}: there is not a single row in it")
    if not ((gnss.time >= track.time[0]) & (gnss.time <= track.time[-1])).any():
        raise InputError(
            f"{track.source} covers {track.time[0]:.3f} .. {track.time[-1]:.3f} s and {gnss.source} "
            f"{gnss.time[0]:.3f} .. {gnss.time[-1]:.3f} s: no fix lies inside; are both on one time scale? "
            "A time offset can be added to either"
        )


def check_order(source: str, time: Array) -> None:
    """Refuse times that do not increase.

    Raises
    ------
    InputError
        Names the row.
    """
    back = np.flatnonzero(~(np.diff(time) > 0.0))
    if back.size:
        raise InputError(f"{source}: row {back[0] + 1} at {time[back[0] + 1]:.3f} s is not later than the one before")


def check_speed_unit(odometer: OdometerLog, gnss: GnssLog) -> None:
    """Refuse speeds that are those of GNSS in another unit.

    Raises
    ------
    InputError
        Names the factor and the unit.
    """
    time, velocity = _moving(gnss)
    inside = (time >= odometer.time[0]) & (time <= odometer.time[-1]) if odometer.time.size else np.zeros(0, bool)
    known = np.isfinite(odometer.speed)
    if np.count_nonzero(inside) < FEWEST or not known.any():
        return
    speed = np.abs(np.interp(time[inside], odometer.time[known], odometer.speed[known]))
    ratio = float(np.median(speed / np.hypot(*velocity[inside].T)))
    unit, factor = min(SPEED_UNITS, key=lambda known: abs(ratio / known[1] - 1.0))
    if abs(ratio / factor - 1.0) < TOLERANCE:
        raise InputError(
            f"{odometer.source}: speeds are {ratio:.3g} times those of {gnss.source}, as if they were in {unit}; "
            "convert them, or name the unit in the column (such as speed_kmph or speed_knots for speed_mps)"
        )


def check_heading_unit(heading: HeadingLog, gnss: GnssLog) -> None:
    """Refuse headings that are radians read as degrees, held against the course of GNSS.

    Raises
    ------
    InputError
        If all headings lie within two turns of radians taken for degrees, and times 180 / pi they are the course, as
        they stand they are not.
    """
    degrees = np.degrees(np.unwrap(heading.heading))
    if not degrees.size or np.ptp(degrees) > 4.0 * np.pi:
        return
    time, velocity = _moving(gnss)
    inside = (time >= heading.time[0]) & (time <= heading.time[-1])
    if np.count_nonzero(inside) < FEWEST:
        return
    course = np.arctan2(velocity[inside, 1], velocity[inside, 0])
    as_read = np.interp(time[inside], heading.time, np.unwrap(heading.heading))
    off = [float(np.median(np.abs(_wrapped(value - course)))) for value in (as_read, np.degrees(as_read))]
    if off[1] < AGREES and off[1] < 0.5 * off[0]:
        raise InputError(
            f"{heading.source}: headings are off the course of {gnss.source} by {np.degrees(off[0]):.0f} deg, and by "
            f"{np.degrees(off[1]):.0f} deg if they are radians; name the column heading_rad"
        )


def _moving(gnss: GnssLog) -> tuple[Array, Array]:
    """Times and horizontal velocities (n, 2) [m/s] of fixes in motion; from positions where the log has no velocity."""
    if gnss.velocity_n is not None:
        time, velocity = gnss.time, gnss.velocity_n[:, :2]
    elif gnss.time.size > 1:
        moved = np.column_stack((np.diff(gnss.lat), _wrapped(np.diff(gnss.lon))))
        moved *= metres_per_radian(gnss.lat[:-1], gnss.height[:-1])
        time = 0.5 * (gnss.time[1:] + gnss.time[:-1])
        velocity = moved / np.diff(gnss.time)[:, None]
    else:
        return np.empty(0), np.empty((0, 2))
    fast = np.hypot(*velocity.T) > MOVING
    return time[fast], velocity[fast]


def _wrapped(angle: Array) -> Array:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
