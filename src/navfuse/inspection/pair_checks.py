"""Logs against each other: the same turns, the axes, the lever arm, other sensors against the fixes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from navfuse.data.logs import GnssLog, ImuLog
from navfuse.data.trajectory import Trajectory
from navfuse.imu.lever_arm import LeverArm, fit_lever_arm
from navfuse.imu.lever_arm import check_lever_arm as contradictions
from navfuse.imu.mounting import FoundAxes, find_axes
from navfuse.imu.turning import FEWEST, LEAST_TURN, changes_of_course
from navfuse.inspection.clock_checks import SURE_SIGMAS, Clocks, check_offset, check_overlap
from navfuse.inspection.declared import Declared
from navfuse.inspection.findings import Finding, Verdict
from navfuse.inspection.halves import check_change, check_drift, halves
from navfuse.inspection.sign_checks import check_signs, inverted_accelerometer
from navfuse.inspection.turn_checks import check_turns
from navfuse.io.imu_table import body_from_file

Array = np.ndarray

TILTED = np.radians(30.0)
SURE = 0.6
OTHER_TURNS, OTHER_ACCELERATIONS = 0.5, 0.7
"""Correlations below which both have to be for logs to be of different drives."""
ARM_CORRELATION = 0.99
"""Below it (a boat in waves) the arm that the turns show is not to be trusted."""
SURE_ARM_SD_M, SURELY_M = 0.3, 1.5
"""A stated arm is wrong, rather than odd, if a part known so well is further away, and by SURE_SIGMAS."""
LONG_ARM_M, ABSURD_ARM_M = 5.0, 50.0
_RADIUS = 6371e3


def check_pair(imu: ImuLog, gnss: GnssLog, declared: Declared) -> list[Finding]:
    """Inertial log and fixes.

    Parameters
    ----------
    imu : ImuLog
        File axes; units and stamps as the checks of the file alone left them.
    gnss : GnssLog
    declared : Declared
    """
    imu = replace(imu, time=imu.time + declared.imu_time_offset)
    gnss = replace(gnss, time=gnss.time + declared.gnss_time_offset)
    overlap = check_overlap(imu, gnss, declared)
    if not overlap.met:
        return [overlap.finding, *_check_axes_alone(imu, declared)]
    moved = replace(imu, time=imu.time + overlap.shift) if overlap.shift else imu
    turns, lag = check_turns(moved, gnss)
    clocks = check_offset(imu, gnss, overlap.shift, lag, declared)
    found = [overlap.finding, turns, clocks.finding]
    found += _check_same_drive(moved, gnss, turns, clocks)
    placed = replace(imu, time=imu.time + clocks.offset)
    axes = find_axes(placed, gnss)
    found += check_axes(axes, declared, with_gnss=True, inverted=lambda: inverted_accelerometer(placed, gnss))
    parts = halves(placed, gnss)
    if parts is not None:
        drift = check_drift(parts, clocks.contradicted)
        change = check_change(parts) if axes.axes is None or clocks.correlation is None else None
        found += [one for one in (drift, change) if one is not None]
    if clocks.correlation is not None:
        found += check_signs(placed, gnss, axes, clocks.correlation)
    body = axes.axes or declared.axes
    matrix = body_from_file(body, declared.rotation if body == "FRD" else None)
    fitted = None
    if clocks.correlation is not None and clocks.correlation > ARM_CORRELATION and axes.axes is not None:
        fitted = fit_lever_arm(replace(placed, gyro=placed.gyro @ matrix.T, accel=placed.accel @ matrix.T), gnss)
    found.append(check_lever_arm(declared, fitted))
    return found


def _check_same_drive(imu: ImuLog, gnss: GnssLog, turns: Finding, clocks: Clocks) -> list[Finding]:
    """Ask, where neither turns nor accelerations of a vehicle that turns agree."""
    if clocks.best is None:
        return []
    alike = turns.figures.get("correlation")
    if alike is None:
        course = changes_of_course(gnss, float(imu.time[0]), float(imu.time[-1]))[2]
        if course.size < FEWEST or float(np.std(course)) < LEAST_TURN:
            return []
        said = "the turns fit at several shifts or at none"
    else:
        said = f"the turns do not agree (correlation {alike:.2f})"
    if abs(alike or 0.0) > OTHER_TURNS or clocks.best > OTHER_ACCELERATIONS:
        return []
    return [
        Finding(
            "same drive",
            Verdict.LOOK,
            f"the vehicle of the fixes moves and turns, but {said} and neither do the accelerations (correlation "
            f"{clocks.best:.2f})",
            "are these of one drive? If they are, their clocks are further apart than was searched",
            figures={"accelerations": clocks.best},
        )
    ]


def _check_axes_alone(imu: ImuLog, declared: Declared) -> list[Finding]:
    return check_axes(find_axes(imu, None), declared, with_gnss=False)


def check_imu_axes(imu: ImuLog, declared: Declared) -> list[Finding]:
    """The vertical of an inertial log without fixes; parameters as for :func:`check_pair`."""
    return _check_axes_alone(imu, declared)


def check_axes(
    found: FoundAxes, declared: Declared, with_gnss: bool, inverted: Callable[[], str] | None = None
) -> list[Finding]:
    """What x, y, z point to, against what the project says or would assume.

    `inverted` finds out which accelerometers have the wrong sign, should the axes be left-handed.
    """
    findings = []
    figures = {"confidence": found.confidence}
    if found.tilt is not None:
        figures["tilt_deg"] = float(np.degrees(found.tilt))
    matrix = body_from_file(declared.axes, declared.rotation)
    said = "rotation" if declared.rotation is not None else f'axes = "{declared.axes}"'
    by = "the project" if declared.stated else "the default"
    findings += _handedness(found, inverted)
    if found.up is None or found.tilt is None:
        findings.append(Finding("axes", Verdict.UNKNOWN, found.reason or "the vertical was not found", figures=figures))
        return findings
    tilt = f"up is {found.up} of the file, {np.degrees(found.tilt):.2g} deg off the vertical"
    up_b = matrix @ _unit(found.up)
    upright = up_b[2] < -0.8
    if found.axes is not None and not findings:
        fits = np.abs(body_from_file(found.axes) - matrix).max() < 0.5 if declared.rotation is None else upright
        text = f"the axes point {found.axes} (confidence {found.confidence:.2f}; next best {found.second}): {tilt}"
        remains = _remains(found)
        if fits:
            findings.append(
                Finding("axes", Verdict.OK, f"{text}{remains}", settings={"imu.axes": found.axes}, figures=figures)
            )
            return findings
        verdict = Verdict.WRONG if declared.stated and found.confidence > SURE else Verdict.LOOK
        message = f"{text}{remains}; {by} says {said}"
        findings.append(
            Finding("axes", verdict, message, f'set imu.axes = "{found.axes}"', {"imu.axes": found.axes}, figures)
        )
        return findings
    reason = (
        f"; {found.reason}" if found.reason and with_gnss else "" if with_gnss else "; where forward is needs fixes"
    )
    if found.tilt > TILTED:
        findings.append(Finding("axes", Verdict.LOOK, f"{tilt}: the sensor is mounted askew{reason}",
                                "set imu.rotation to the matrix from file to vehicle", figures=figures))  # fmt: skip
        return findings
    if upright:
        findings.append(Finding("axes", Verdict.OK, f"{tilt}, as {by} says ({said}){reason}", figures=figures))
        return findings
    guess = _GUESS[found.up]
    verdict = Verdict.WRONG if declared.stated else Verdict.LOOK
    findings.append(
        Finding(
            "axes",
            verdict,
            f"{tilt}; by {said}, which {by} says, it would point {_points(up_b)}{reason}",
            f"set imu.axes to what x, y, z point to, {guess[1]}",
            {"imu.axes": guess[0]},
            figures,
        )
    )
    return findings


_GUESS = {
    "+z": ("FLU", 'such as "FLU" (x forward, y left, z up)'),
    "-z": ("FRD", 'such as "FRD" (x forward, y right, z down)'),
    "+y": ("RUB", 'such as "RUB" (x right, y up, z back)'),
    "-y": ("RDF", 'such as "RDF" (x right, y down, z forward)'),
    "+x": ("URF", 'such as "URF" (x up, y right, z forward)'),
    "-x": ("DRB", 'such as "DRB" (x down, y right, z back)'),
}
"""Usual axes with one of them up."""


def _remains(found: FoundAxes) -> str:
    if found.roll is None or found.pitch is None:
        return ""
    yaw = "" if found.yaw is None else f", yaw {np.degrees(found.yaw):.2g}"
    return f", mounted at roll {np.degrees(found.roll):.2g}, pitch {np.degrees(found.pitch):.2g}{yaw} deg"


def _points(up_b: Array) -> str:
    k = int(np.argmax(np.abs(up_b)))
    return (("backward", "forward"), ("left", "right"), ("up", "down"))[k][int(up_b[k] > 0.0)]


def _unit(axis: str) -> Array:
    """Vector of "+z" and the like."""
    vector = np.zeros(3)
    vector["xyz".index(axis[-1])] = -1.0 if axis.startswith("-") else 1.0
    return vector


def _handedness(found: FoundAxes, inverted: Callable[[], str] | None) -> list[Finding]:
    if found.gyro_up is not None and found.up is not None and found.gyro_up[-1] != found.up[-1]:
        return [
            Finding(
                "handedness",
                Verdict.WRONG,
                f"the gyros turn with the course about {found.gyro_up[-1]} while the accelerometers find the vertical "
                f"on {found.up[-1]}: gyros and accelerometers are in different order",
                "correct the order of the columns",
            )
        ]
    if found.left_handed:
        culprit = inverted() if inverted is not None else ""
        who = f"{culprit} turned round would put it right" if culprit else "one of them is negated, or all three are"
        return [
            Finding(
                "handedness",
                Verdict.WRONG,
                f"the accelerometers are left-handed: up is {found.up}, forward {found.forward}, and the third axis "
                f"points the other way than x, y, z of a right-handed frame: {who}",
                f"negate {culprit}" if culprit else "correct the sign of that column",
            )
        ]
    if found.gyro_sense == -1:
        return [
            Finding(
                "handedness",
                Verdict.WRONG,
                "the gyros turn the other way about the vertical than the course does, while the accelerometers agree "
                "with it: the sign of a gyro column is wrong",
                f"negate the gyro column of {found.up[-1] if found.up else 'the vertical axis'}",
            )
        ]
    return []


def check_lever_arm(declared: Declared, fitted: LeverArm | None = None) -> Finding:
    """Whether the lever arm of a project can be one, and the one by which the antenna moves in turns."""
    if declared.lever_arm is None:
        return Finding(
            "lever arm",
            Verdict.UNKNOWN,
            "not stated; 0 0 0 is assumed",
            "measure from the IMU to the antenna: gnss.lever_arm_m = [forward, right, down]",
        )
    arm = np.asarray(declared.lever_arm, dtype=float)
    length = float(np.linalg.norm(arm))
    text = f"{length:.3g} m from the IMU to the antenna"
    figures = {"length_m": length}
    odd = contradictions(arm, fitted)
    if odd:
        sure = length > ABSURD_ARM_M or (fitted is not None and _surely_apart(arm, fitted))
        verdict = Verdict.WRONG if sure and "gnss.lever_arm_m" in declared.explicit else Verdict.LOOK
        return Finding("lever arm", verdict, odd[0], "measure gnss.lever_arm_m again", figures=figures)
    if length > LONG_ARM_M:
        verdict = Verdict.WRONG if length > 20.0 * ABSURD_ARM_M else Verdict.LOOK
        return Finding("lever arm", verdict, f"{text}: long for a vehicle",
                       "gnss.lever_arm_m is in metres, forward, right, down", figures=figures)  # fmt: skip
    if arm[2] > 1.0:
        return Finding("lever arm", Verdict.LOOK, f"{text}, {arm[2]:.3g} m of it down: the antenna below the IMU",
                       "up is negative in gnss.lever_arm_m", figures=figures)  # fmt: skip
    return Finding("lever arm", Verdict.OK, text, figures=figures)


def _surely_apart(arm: Array, fitted: LeverArm) -> bool:
    """Whether a part that the turns show well is another one beyond doubt, by the metre or more."""
    known = fitted.sd < SURE_ARM_SD_M
    return bool(np.any(known & (np.abs(arm - fitted.lever) > np.maximum(SURELY_M, SURE_SIGMAS * fitted.sd))))


def check_truth(truth: Trajectory, gnss: GnssLog) -> Finding:
    """Do a reference and the fixes describe the same drive?"""
    inside = (gnss.time >= truth.time[0]) & (gnss.time <= truth.time[-1])
    if np.count_nonzero(inside) < 5:
        return Finding("truth", Verdict.LOOK, "reference and fixes share less than five fixes in time",
                       "bring both to one scale of time")  # fmt: skip
    at = gnss.time[inside]
    north = (gnss.lat[inside] - np.interp(at, truth.time, truth.lat)) * _RADIUS
    east = gnss.lon[inside] - np.interp(at, truth.time, np.unwrap(truth.lon))
    east = ((east + np.pi) % (2.0 * np.pi) - np.pi) * _RADIUS * np.cos(gnss.lat[inside])
    up = gnss.height[inside] - np.interp(at, truth.time, truth.height)
    across, above = float(np.median(np.hypot(north, east))), float(np.median(up))
    figures = {"horizontal_m": across, "height_m": above}
    text = f"fixes and reference are {across:.3g} m apart (median), in height {above:+.3g} m"
    ratio = float(np.median(gnss.height[inside])) / max(abs(float(np.median(truth.height))), 1e-9)
    if across > 1000.0:
        return Finding("truth", Verdict.WRONG, f"{text}: not the same drive", "check the files", figures=figures)
    if abs(above) > 50.0 and (0.95 < abs(ratio) * 0.3048 < 1.05 or 0.95 < abs(ratio) / 0.3048 < 1.05):
        return Finding(
            "truth", Verdict.WRONG, f"{text}: one of the heights is in feet", "name it height_ft", figures=figures
        )
    if across > 30.0 or abs(above) > 30.0:
        hint = "one height above the geoid, the other above the ellipsoid?" if across < 30.0 else "check time and datum"
        return Finding("truth", Verdict.LOOK, text, hint, figures=figures)
    return Finding("truth", Verdict.OK, text, figures=figures)


_SPEED_WORDS = {"km/h": 3.6, "mph": 2.2369, "knots": 1.9438, "ft/s": 3.2808, "cm/s": 100.0, "mm/s": 1000.0}


def check_speed(time: Array, speed: Array, gnss: GnssLog) -> Finding:
    """Speeds of an odometer (n,) [m/s] against those of the fixes."""
    every = max(1, round(4.0 / float(np.median(np.diff(gnss.time))))) if gnss.time.size > 1 else 1
    if gnss.velocity_n is not None:
        known = np.isfinite(gnss.velocity_n).all(axis=1)
        at, seen = gnss.time[known], np.linalg.norm(gnss.velocity_n[known][:, :2], axis=1)
    else:
        north = (gnss.lat - gnss.lat[0]) * _RADIUS
        east = (gnss.lon - gnss.lon[0]) * _RADIUS * np.cos(gnss.lat[0])
        span = gnss.time[every:] - gnss.time[:-every]
        at = 0.5 * (gnss.time[every:] + gnss.time[:-every])
        seen = np.hypot(north[every:] - north[:-every], east[every:] - east[:-every]) / span
    use = (at > time[0]) & (at < time[-1]) & (seen > 3.0)
    if np.count_nonzero(use) < 10:
        return Finding("odometer speed", Verdict.UNKNOWN, "too few fixes at speed to compare with")
    measured = np.interp(at[use], time, speed)
    ratio = float(np.median(measured / seen[use]))
    figures = {"ratio": ratio}
    text = f"the odometer shows {ratio:.3g} times the speed of the fixes"
    if 0.85 < ratio < 1.15:
        return Finding("odometer speed", Verdict.OK, text, figures=figures)
    if ratio < 0.0:
        return Finding("odometer speed", Verdict.LOOK, text, "forward is positive: negate it", figures=figures)
    for words, factor in _SPEED_WORDS.items():
        if abs(ratio / factor - 1.0) < 0.06:
            return Finding("odometer speed", Verdict.WRONG, f"{text}: the values are {words}",
                           "put that unit into the name of the column", figures=figures)  # fmt: skip
        if abs(ratio * factor - 1.0) < 0.06:
            return Finding("odometer speed", Verdict.WRONG, f"{text}: m/s in a column of {words}", "name it speed_mps",
                           figures=figures)  # fmt: skip
    return Finding("odometer speed", Verdict.LOOK, text, "check unit and scale", figures=figures)
