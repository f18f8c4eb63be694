"""What the x, y, z of an inertial log point to in the vehicle, and how it is tilted in its mount.

Up is where the mean specific force points. Forward is where the vehicle goes: with inertial data levelled and turned
to north (:mod:`navfuse.imu.level_match`), every velocity of GNSS is a direction in the axes of the sensor, and over
curves, hills and winds their mean is the nose of a land vehicle, aircraft or boat. What strays about that mean says how
far it is one. Where gyroscopes and accelerometers do not go together, accelerations along and across the track tell,
for a land vehicle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.stats import norm

from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.core.rotation import euler_from_dcm
from navfuse.data.logs import GnssLog, ImuLog
from navfuse.imu.axes_reading import LEAST_CORRELATION, TURNS_ALIKE, Compared, best_reading, vertical_axes
from navfuse.imu.increments import ImuIncrements
from navfuse.imu.level_match import stretch_phases
from navfuse.imu.seen_motion import Array, coarse_increments, has_velocity, stretches, usable_gnss
from navfuse.io.imu_table import body_from_file

LEAST_SPEED = 2.0
"""Slower velocities do not tell a course."""
LEAST_CONCENTRATION = 0.8
"""Mean resultant length of the directions of travel, below which it does not point along its course."""
TILTED = np.radians(35.0)
"""Beyond it the nearest axis is no more the axis that points up or forward."""
LEAST_YAW_SD = np.radians(2.0)
REPAIRED = 0.5
"""Factor on the confidence if the gyroscopes had to be reversed: all three, or one that is not known."""
STANDS_OUT = 25.0
LETTERS = (("B", "F"), ("L", "R"), ("U", "D"))


@dataclass(frozen=True, slots=True)
class FoundAxes:
    """Where the axes of an inertial log point. A land vehicle, aircraft or boat whose nose goes along its course.

    Attributes
    ----------
    axes : str or None
        As ``imu.axes`` takes them, e.g. "BRU", by the accelerometers; None if the log does not tell, or no such word
        would do, see `reason`.
    confidence : float
        0..1; 0 where there are no `axes`.
    second : str or None
        The next best candidate.
    score, second_score : float
        -1..1: how well accelerations along and across the track agree with the axes, and with the next best.
    up : str or None
        Axis of the file that points up, e.g. "+z" or "-y".
    tilt : float [rad] or None
        Between that axis and the vertical.
    forward : str or None
        Axis of the file that points along the course, e.g. "-x".
    roll, pitch, yaw : float [rad] or None
        Angles of the sensor in the vehicle that remain once `axes` are applied: the attitude it would show in a level
        vehicle that heads north. `yaw` needs motion.
    gyro_sense : int or None
        1 if the gyroscopes turn about the vertical as the course does, -1 if the other way round (then their signs,
        or the handedness of the axes, are wrong); None if it does not turn enough to tell.
    gyro_up : str or None
        Axis of the gyroscopes that turns with the course, with the sign that points up; another than `up` means that
        gyroscopes and accelerometers are in different order.
    left_handed : bool or None
        Whether the axes of the accelerometers are left-handed, or all their signs inverted.
    reason : str or None
        Why `axes` is None.
    notes : tuple of str
        Findings for people, e.g. that the gyroscopes turn the other way.
    """

    axes: str | None
    confidence: float
    second: str | None
    score: float
    second_score: float
    up: str | None
    tilt: float | None
    forward: str | None
    roll: float | None
    pitch: float | None
    yaw: float | None
    gyro_sense: int | None
    gyro_up: str | None
    left_handed: bool | None
    reason: str | None
    notes: tuple[str, ...] = ()


class Nose(NamedTuple):
    """Direction of travel in the axes of the file.

    Attributes
    ----------
    direction : (3,) array
        Unit vector.
    concentration : float
        0..1, mean resultant length of the directions.
    sd : float [rad]
        From the scatter between stretches.
    """

    direction: Array
    concentration: float
    sd: float


def find_axes(imu: ImuLog, gnss: GnssLog | None, offset_s: float = 0.0) -> FoundAxes:
    """Find what the axes of a file point to.

    Parameters
    ----------
    imu : ImuLog
        In the axes of the file, as they stand there (read with ``axes = "FRD"``).
    gnss : GnssLog or None
        Without it, only the vertical is found.
    offset_s : float [s]
        Added to the inertial stamps; see :func:`navfuse.imu.time_offset.estimate_time_offset`.

    Returns
    -------
    FoundAxes
    """
    increments, holes = coarse_increments(replace(imu, time=imu.time + offset_s))
    force = increments.inc_v_b.sum(axis=0) / max(float(increments.dt.sum()), 1e-9) if len(increments) else np.zeros(3)
    size = float(np.linalg.norm(force))
    if not 0.5 < size / STANDARD_GRAVITY < 2.0:
        return _unknown(f"the mean specific force is {size:.2f} m/s^2, where gravity alone makes 9.8")
    up = force / size
    k = int(np.argmax(np.abs(up)))
    tilt = float(np.arccos(min(1.0, abs(up[k]))))
    found = replace(_unknown(""), up=_name(k, up[k]), tilt=tilt)
    if gnss is None:
        return replace(found, reason="without GNSS only the vertical is known")
    gnss = usable_gnss(gnss)
    found = _with_turns(found, increments, gnss)
    if tilt > TILTED:
        return replace(
            found,
            reason=f"no axis is near the vertical, {np.degrees(tilt):.0f} deg off: it takes imu.rotation, not imu.axes",
        )
    seen = _seen(increments, holes, gnss)
    if seen is None:
        return replace(found, reason="it does not accelerate enough, or is too short, to tell which way is forward")
    return _with_nose(found, seen, up)


def _unknown(reason: str) -> FoundAxes:
    return FoundAxes(
        axes=None, confidence=0.0, second=None, score=0.0, second_score=0.0, up=None, tilt=None, forward=None,
        roll=None, pitch=None, yaw=None, gyro_sense=None, gyro_up=None, left_handed=None, reason=reason,
    )  # fmt: skip


def _name(axis: int, sign: float) -> str:
    return ("-" if sign < 0.0 else "+") + "xyz"[axis]


def _with_turns(found: FoundAxes, increments: ImuIncrements, gnss: GnssLog) -> FoundAxes:
    """Add which gyroscope turns with the course, and which way."""
    axes = vertical_axes(increments, gnss, np.zeros(1))
    if axes is None:
        return found
    found = replace(found, gyro_up=_name(axes.gyro, -axes.gyro_down))
    if axes.gyro != axes.force:
        note = (
            f"gyroscope {'xyz'[axes.gyro]} turns with the course, but accelerometer {'xyz'[axes.force]} feels gravity:"
            " gyroscopes and accelerometers are in different order"
        )
        return replace(found, notes=(*found.notes, note))
    if abs(axes.sense) < TURNS_ALIKE:
        return found
    if axes.sense > 0.0:
        return replace(found, gyro_sense=1)
    note = (
        "the gyroscopes turn left where the course turns right: their signs, or those of the accelerometers, are"
        " reversed"
    )
    return replace(found, gyro_sense=-1, notes=(*found.notes, note))


def _seen(increments: ImuIncrements, holes: Array, gnss: GnssLog) -> Compared | None:
    """Accelerations in the reading that agrees; None if none does."""
    rows = stretches(gnss, increments.time[0], increments.time[-1], holes, not has_velocity(gnss))
    if not rows.time.shape[0]:
        return None
    seen = best_reading(increments, holes, gnss, rows, np.zeros(1))
    return seen if seen.correlation > LEAST_CORRELATION and -seen.deviance > STANDS_OUT else None


def _with_nose(found: FoundAxes, seen: Compared, up: Array) -> FoundAxes:
    """Add which axis is forward, and what follows from it."""
    reading = seen.reading
    nose = _nose(seen)
    if nose is None or nose.concentration < LEAST_CONCENTRATION:
        strays = "" if nose is None else f" (mean resultant length {nose.concentration:.2f} of 1)"
        return replace(found, reason=f"it does not point along its course{strays}, or hardly moves")
    mirror = reading.mirrored
    reversed_force = mirror and found.gyro_sense == -1
    if reversed_force:
        up, mirror, nose = -up, False, nose._replace(direction=-nose.direction)
    down = -up
    forward = nose.direction - (nose.direction @ down) * down
    forward /= np.linalg.norm(forward)
    right = np.cross(down, forward) * (-1.0 if mirror else 1.0)
    vehicle = np.stack([forward, right, down])
    scores = _scores(vehicle, mirror)
    (axes, score), (second, second_score) = scores[:2]
    yaw = _yaw(vehicle, axes)
    sure = max(0.0, 2.0 * float(norm.cdf((np.pi / 4.0 - abs(yaw)) / max(nose.sd, LEAST_YAW_SD))) - 1.0)
    k = int(np.argmax(np.abs(forward)))
    found = replace(
        found, second=second,
        score=score * nose.concentration, second_score=second_score * nose.concentration,
        up=_name(int(np.argmax(np.abs(up))), up[np.argmax(np.abs(up))]),
        forward=_name(k, forward[k]), left_handed=reading.mirrored,
    )  # fmt: skip
    if mirror:
        reason = f"the axes are left-handed: x, y, z point {axes}; reverse one of them, for both sensors"
        return replace(found, reason=reason)
    if reversed_force:
        other = _scores(np.stack([-forward, -right, down]), False)[0][0]
        reason = (
            "the signs of the accelerometers contradict those of the gyroscopes. If all three are reversed (+9.8 along"
            f' what points down at rest), the axes are "{axes}" once they are put right; if only the one along the'
            f' vertical is, "{other}"'
        )
        return replace(found, reason=reason)
    if abs(yaw) > TILTED:
        reason = f"no axis is near the course, {np.degrees(abs(yaw)):.0f} deg off: imu.rotation is needed, not imu.axes"
        return replace(found, reason=reason)
    doubt = REPAIRED if reading.sense < 0.0 else 1.0
    roll, pitch, heading = euler_from_dcm(tuple((vehicle @ body_from_file(axes).T).ravel()))
    return replace(
        found, axes=axes, reason=None,
        confidence=sure * nose.concentration * doubt, roll=float(roll), pitch=float(pitch),
        yaw=float((heading + np.pi) % (2.0 * np.pi) - np.pi),
    )  # fmt: skip


def _nose(seen: Compared) -> Nose | None:
    """Mean direction of travel in the axes of the file, over all rows that move."""
    match = seen.match
    phase, coherence = stretch_phases(match, 0.0)
    course = _courses(seen)
    moving = np.abs(course) >= (LEAST_SPEED if seen.reading.sense else 0.0)
    weight = np.where(moving & (match.rows.weight > 0.0), np.abs(course), 0.0) * coherence[:, None]
    unit = course / np.maximum(np.abs(course), 1e-9) / phase[:, None]
    in_l = unit.real[..., None] * match.basis[:, None, 0] + unit.imag[..., None] * match.basis[:, None, 1]
    at = match.rows.time
    time = match.motion.time
    in_file = np.stack(
        [
            sum(np.interp(at, time, axis[:, k]) * in_l[..., k] for k in range(3))
            for axis in match.motion.axes_l
        ],
        axis=-1,
    )  # fmt: skip
    sums, shares = np.einsum("wm,wmk->wk", weight, in_file), weight.sum(axis=1)
    if not shares.any():
        return None
    total = sums.sum(axis=0)
    length = float(np.linalg.norm(total))
    direction = total / length
    stray = sums - (sums @ direction)[:, None] * direction
    return Nose(direction, length / float(shares.sum()), float(np.sqrt(np.sum(stray**2)) / length))


def _courses(seen: Compared) -> Array:
    """Velocity (w, m) as complex numbers; of a comparison along the track, 1 m/s ahead."""
    rows = seen.match.rows
    if not seen.reading.sense:
        return np.ones_like(rows.seen)
    if not rows.positions:
        return rows.seen
    ahead = np.zeros_like(rows.seen)
    ahead[:, 1:-1] = (rows.seen[:, 2:] - rows.seen[:, :-2]) / np.maximum(rows.time[:, 2:] - rows.time[:, :-2], 1e-9)
    whole = (rows.weight[:, 2:] > 0.0) & (rows.weight[:, :-2] > 0.0)
    ahead[:, 1:-1] *= whole
    return ahead


def _scores(vehicle: Array, mirror: bool) -> list[tuple[str, float]]:
    """Candidates for the axes with the right vertical, the best first; the cosine of their yaw each."""
    up = int(np.argmax(np.abs(vehicle[2])))
    level = [axis for axis in range(3) if axis != up]
    found = []
    for ahead in level:
        for sign in (1.0, -1.0):
            forward, down = np.zeros(3), np.zeros(3)
            forward[ahead], down[up] = sign, np.sign(vehicle[2, up])
            right = np.cross(down, forward) * (-1.0 if mirror else 1.0)
            matrix = np.stack([forward, right, down])
            letters = "".join(LETTERS[row][int(matrix[row, axis] > 0.0)]
                              for axis in range(3) for row in range(3) if matrix[row, axis])  # fmt: skip
            found.append((letters, float(forward @ vehicle[0])))
    return sorted(found, key=lambda one: -one[1])


def _yaw(vehicle: Array, axes: str) -> float:
    """Angle of the best candidate from the course [rad], in the plane of the two level axes."""
    level = np.flatnonzero([letter in "FBRL" for letter in axes])
    ahead = max(level, key=lambda axis: axes[axis] in "FB")
    side = next(axis for axis in level if axis != ahead)
    return float(np.arctan2(vehicle[0, side], abs(vehicle[0, ahead])))
