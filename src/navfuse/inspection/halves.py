"""Does what was found of two logs hold from begin to end? A drifting clock, and axes that change midway.

Both halves of the common time are judged by the same rules as the whole, and compared.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from navfuse.data.logs import GnssLog, ImuLog
from navfuse.imu.mounting import FoundAxes, find_axes
from navfuse.imu.time_offset import estimate_time_offset
from navfuse.inspection.findings import Finding, Verdict

Array = np.ndarray
Half = tuple[ImuLog, GnssLog]

SHORTEST_S = 60.0
"""Halves below this length are not judged."""
DRIFT_SIGMAS, DRIFT_S = 5.0, 0.06
SURE = 0.6
"""Confidence in the axes of both halves, for another heading of the mount to be told."""
_IMU_ROWS = ("time", "gyro", "accel")


def halves(imu: ImuLog, gnss: GnssLog) -> tuple[Half, Half] | None:
    """Two logs cut in the middle of what they share; None if that is too short."""
    begin, end = max(imu.time[0], gnss.time[0]), min(imu.time[-1], gnss.time[-1])
    if end - begin < 2.0 * SHORTEST_S:
        return None
    middle = 0.5 * (begin + end)
    parts = []
    for first, last in ((begin, middle), (middle, end)):
        rows = slice(*np.searchsorted(imu.time, [first, last]))
        fixes = (gnss.time >= first) & (gnss.time < last)
        if rows.stop - rows.start < 100 or np.count_nonzero(fixes) < 20:
            return None
        part = replace(imu, **{name: getattr(imu, name)[rows] for name in _IMU_ROWS})
        parts.append((part, gnss.take(fixes)))
    return parts[0], parts[1]


def check_drift(parts: tuple[Half, Half], positions_only: bool) -> Finding | None:
    """Another offset of the clocks in the second half than in the first; None if there is none to be told.

    Parameters
    ----------
    parts : pair of halves
    positions_only : bool
        Whether velocities are left aside because they tell another offset than the positions.
    """
    told = []
    for imu, gnss in parts:
        if positions_only:
            gnss = replace(gnss, velocity_n=None, sd_velocity=None)
        found = estimate_time_offset(imu, gnss)
        if found.offset is None or found.sd is None:
            return None
        told.append((found.offset, found.sd, found.used.rpartition(" ")[2], float(np.mean(imu.time[[0, -1]]))))
    (first, first_sd, by, begin), (second, second_sd, by_second, end) = told
    change, sd = second - first, float(np.hypot(first_sd, second_sd))
    if by != by_second or abs(change) < max(DRIFT_S, DRIFT_SIGMAS * sd):
        return None
    rate = change / (end - begin)
    return Finding(
        "clock drift",
        Verdict.LOOK,
        f"besides the offset of the whole, {first:+.3f} s are to be added to the inertial stamps in the first half and "
        f"{second:+.3f} s in the second, by {by}, give or take {sd:.2g} s between them: the clocks drift apart by "
        f"{1e6 * abs(rate):.3g} ppm ({3600.0 * abs(rate):.3g} s/h), or one of them jumps",
        f"no single imu.time_offset_s fits; stretch the inertial stamps by a factor of {1.0 + rate:.7g}, or use stamps "
        "of one clock",
        figures={"drift_ppm": 1e6 * rate, "change_s": change, "change_sd_s": sd},
    )


def check_change(parts: tuple[Half, Half]) -> Finding | None:
    """Axes that point elsewhere in the second half than in the first; None if none are seen to."""
    first, second = (find_axes(*part) for part in parts)
    if first.up is None or second.up is None:
        return None
    if first.up != second.up:
        what = f"up is {first.up} in the first half and {second.up} in the second"
    elif first.left_handed is not None and second.left_handed is not None and first.left_handed != second.left_handed:
        hand = {True: "left-handed", False: "right-handed"}
        what = (
            f"the accelerometers are {hand[first.left_handed]} in the first half and {hand[second.left_handed]} in the "
            "second: the sign of one of them changes"
        )
    elif first.axes != second.axes and min(_sure(first), _sure(second)) > SURE:
        what = f"the axes point {first.axes} in the first half and {second.axes} in the second"
    else:
        return None
    return Finding(
        "axes change", Verdict.WRONG, what, "cut the log where sensor, driver or export changed, and use one part"
    )


def _sure(found: FoundAxes) -> float:
    return found.confidence if found.axes is not None else 0.0
