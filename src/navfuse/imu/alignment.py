"""Finding the start of a run in its own data: position, velocity, level, heading.

1. The start time is the first moment with both inertial data and a GNSS fix near it.
2. While the sensor stands, the mean specific force gives roll and pitch, and the mean angular rate the gyro bias.
3. Heading comes from the first of these that is good enough: the Earth rate (if the gyroscopes are), the motion that
   follows
   (:mod:`navfuse.imu.heading`), the course over ground (if it moves fast without turning or accelerating). If the log
   never says, heading is left unknown.

The standard deviations handed to the filter are three times those of the fit, because the filter is going to use the
same fixes again: what is counted twice then weighs a tenth.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numba import njit

from navfuse.core.constants import EARTH_RATE, STANDARD_GRAVITY
from navfuse.core.rotation import (
    dcm_from_euler,
    dcm_from_rotvec,
    euler_from_dcm,
    mat_mul,
    quat_from_euler,
    quat_from_rotvec,
    quat_multiply,
    quat_normalize,
)
from navfuse.data.logs import GnssLog
from navfuse.data.start import Known, Start
from navfuse.errors import AlignmentError
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.first_fix import TWICE_USED, course, first_position, north_east
from navfuse.imu.heading import HeadingFit, earth_rate_heading, fit_heading
from navfuse.imu.increments import ImuIncrements
from navfuse.imu.standing import Level, check_gravity, gnss_standing_time, level, standing_time

Array = np.ndarray

UNKNOWN_HEADING_SD = np.pi / np.sqrt(3.0)
"""Standard deviation of a heading of which nothing is known [rad]."""
WINDOWS_S = (5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0, 120.0)
SEARCH_S = 1800.0
ANCHOR_STEP_S = 60.0
CLEAR_MODULUS_SD = 0.1
CLEAR_WINDOW_S = 30.0
CONTRADICTIONS = 6
GOOD_HEADING_SD = np.radians(1.5)
USABLE_HEADING_SD = np.radians(10.0)


@dataclass(frozen=True, slots=True)
class Alignment:
    """A start and how it was found.

    Attributes
    ----------
    start : Start
    level_source, heading_source : str
        "given", "standing", "moving"; "given", "earth rate", "motion", "course", "search", "unknown".
    standing_s : float [s]
        How long the sensor stood at the start.
    notes : tuple of str
    """

    start: Start
    level_source: str
    heading_source: str
    standing_s: float
    notes: tuple[str, ...] = field(default=())


def align(
    increments: ImuIncrements, gnss: GnssLog | None, model: ImuErrorModel, lever_b: Array, known: Known | None = None
) -> Alignment:
    """Find the start of a run.

    Parameters
    ----------
    increments : ImuIncrements
    gnss : GnssLog or None
        None is allowed if the start is given in full.
    model : ImuErrorModel
    lever_b : (3,) array [m]
        From the IMU to the antenna.
    known : Known
        What need not be found.

    Raises
    ------
    AlignmentError
        If the logs do not overlap, gravity points the wrong way, or a part that is not given cannot be found.
    """
    known = known or Known()
    time = _start_time(increments, gnss, known)
    first = int(np.searchsorted(increments.time, time - 1e-6))
    rest = increments.piece(min(first, len(increments)))
    if len(rest) < 2:
        raise AlignmentError(
            f"no inertial data are left after {time:.3f} s, the first moment with a usable fix; look at "
            "gnss.outages_s and at "
            "the spans of both logs"
        )
    time = float(rest.time[0])
    standing_s = standing_time(rest, gnss, model)
    notes: list[str] = []
    found_level = level(rest, standing_s, model)
    notes += found_level.notes
    if known.roll is None or known.pitch is None:
        check_gravity(found_level.force_b)
    _check_given_level(found_level, standing_s, known)
    roll = found_level.roll if known.roll is None else known.roll
    pitch = found_level.pitch if known.pitch is None else known.pitch
    sd_level, level_source, bias = found_level.sd, "standing" if standing_s > 0 else "moving", found_level.gyro_bias
    if known.roll is not None and known.pitch is not None:
        sd_level, level_source = np.radians(0.5), "given"
    latitude = known.position[0] if known.position is not None else gnss.lat[0] if gnss is not None else 0.0
    heading, sd_heading, heading_source, tilt = known.heading, np.radians(2.0), "given", None
    given_sd = 0.0 if known.sd_attitude is None else float(known.sd_attitude[2])
    found = _heading(rest, gnss, model, lever_b, roll, pitch, sd_level, found_level, standing_s, latitude)
    if heading is not None and given_sd <= 2 * USABLE_HEADING_SD:
        notes += _given_heading_contradicted(heading, given_sd, found)
    elif found.source != "unknown" or heading is None:
        heading, sd_heading, heading_source, tilt = found.heading, found.sd, found.source, found.fit
    if heading_source == "unknown":
        notes.append(
            "heading could not be found: the log shows no motion that tells it; it starts unknown (104 deg, 1 sigma). "
            "Give [start] heading_deg if you know it"
        )
    if tilt is not None and level_source == "moving":
        roll, pitch = _relevel(roll, pitch, heading, tilt)
        sd_level = max(TWICE_USED * tilt.sd_tilt, sd_level / TWICE_USED)
    sd_euler = np.array([sd_level, sd_level, sd_heading])
    if known.sd_attitude is not None:
        for i, given in enumerate((known.roll, known.pitch, known.heading if heading_source == "given" else None)):
            if given is not None:
                sd_euler[i] = known.sd_attitude[i] if i < 2 else min(known.sd_attitude[2], UNKNOWN_HEADING_SD)
    position, sd_position, velocity, sd_velocity = first_position(
        time, gnss, known, (roll, pitch, heading), lever_b, rest, standing_s
    )
    states = {} if bias is None else {"gyro_bias": bias}
    start = Start.from_parts(
        time, position, velocity, np.array([roll, pitch, heading]), sd_position, sd_velocity, sd_euler, states
    )
    return Alignment(start, level_source, heading_source, standing_s, tuple(notes))


def _check_given_level(found: Level, standing_s: float, known: Known) -> None:
    """Refuse a roll or pitch that the accelerometers at rest contradict."""
    if standing_s <= 0 or known.sd_attitude is None:
        return
    for k, name in enumerate(("roll", "pitch")):
        given = getattr(known, name)
        if given is None:
            continue
        apart = abs((given - getattr(found, name) + np.pi) % (2 * np.pi) - np.pi)
        if apart > np.radians(10.0) and apart > 5.0 * np.hypot(known.sd_attitude[k], found.sd):
            raise AlignmentError(
                f"[start] {name}_deg = {np.degrees(given):.1f} contradicts the accelerometers at rest, which say "
                f"{np.degrees(getattr(found, name)):.1f}; correct it or leave it out, or look at imu.axes"
            )


def _given_heading_contradicted(heading: float, sd: float, found: _Found) -> list[str]:
    if found.source not in ("motion", "earth rate"):
        return []
    apart = abs((heading - found.heading + np.pi) % (2 * np.pi) - np.pi)
    if apart < 4.0 * np.hypot(sd, found.sd):
        return []
    said = "motion" if found.source == "motion" else "Earth rate"
    return [
        f"[start] heading_deg = {np.degrees(heading) % 360:.1f} (sd {np.degrees(sd):.1f}) contradicts the {said}, "
        "which says "
        f"{np.degrees(found.heading):.1f} (sd {np.degrees(found.sd):.1f}); correct it, give a larger sd, or leave it "
        "out"
    ]


def _start_time(increments: ImuIncrements, gnss: GnssLog | None, known: Known) -> float:
    begin, end = float(increments.time[0]), float(increments.time[-1])
    if known.time is not None:
        if not begin - 1e-6 <= known.time < end:
            raise AlignmentError(
                f"[start] time_s = {known.time:.3f} lies outside the inertial data, which span {begin:.3f} to "
                f"{end:.3f} s"
            )
        return max(known.time, begin)
    if gnss is None:
        return begin
    inside = gnss.time[(gnss.time >= begin - 1e-6) & (gnss.time <= end)]
    if inside.size == 0:
        advice = "check that both use the same time scale and see time_offset_s"
        if gnss.source.lower().endswith(".pos"):
            advice = (
                "times of a .pos file count from its GPS week; set gnss.epoch_week_s to what the IMU times count from"
            )
        raise AlignmentError(
            f"inertial data ({begin:.3f} to {end:.3f} s) and GNSS fixes ({gnss.time[0]:.3f} to {gnss.time[-1]:.3f} "
            "s) do "
            f"not overlap; {advice}"
        )
    if known.position is not None:
        return begin
    spacing = float(np.median(np.diff(gnss.time))) if gnss.time.size > 1 else 1.0
    near = gnss.time[gnss.time <= begin]
    if near.size and begin - near[-1] <= 1.5 * spacing:
        return begin
    return float(inside[0])


@dataclass(frozen=True, slots=True)
class _Found:
    heading: float
    sd: float
    source: str
    fit: HeadingFit | None = None


def _heading(
    rest: ImuIncrements,
    gnss: GnssLog | None,
    model: ImuErrorModel,
    lever_b: Array,
    roll: float,
    pitch: float,
    sd_level: float,
    found_level: Level,
    standing_s: float,
    latitude: float,
) -> _Found:
    C_lb = np.array(dcm_from_euler(roll, pitch, 0.0)).reshape(3, 3)
    found = _Found(0.0, UNKNOWN_HEADING_SD, "unknown")
    bias = found_level.gyro_bias
    if standing_s > 10.0 and found_level.plausible_rate:
        last = int(np.searchsorted(rest.time, rest.time[0] + standing_s - 1.0))
        mean = rest.inc_theta_b[:last].sum(axis=0) / (rest.time[last] - rest.time[0])
        sd_rate = float(np.hypot(np.max(model.axes("gyro_bias_sd")), model.arw / np.sqrt(standing_s)))
        heading, sd = earth_rate_heading(mean, C_lb, latitude, sd_rate)
        if sd < USABLE_HEADING_SD:
            found = _Found(heading, max(sd, np.radians(0.05)), "earth rate")
    if gnss is None or found.sd < GOOD_HEADING_SD:
        return found
    fit = _motion_heading(rest, gnss, model, lever_b, roll, pitch, sd_level, bias)
    if fit is not None and TWICE_USED * fit.sd < found.sd and fit.sd < USABLE_HEADING_SD:
        return _Found(fit.heading, TWICE_USED * fit.sd + np.radians(0.3), "motion", fit)
    if found.source == "unknown":
        found_course = course(rest, gnss)
        if found_course is not None:
            return _Found(found_course[0], found_course[1], "course")
    return found


def _motion_heading(
    rest: ImuIncrements,
    gnss: GnssLog,
    model: ImuErrorModel,
    lever_b: Array,
    roll: float,
    pitch: float,
    sd_level: float,
    bias: tuple[Array, Array] | None,
) -> HeadingFit | None:
    """Heading at the start of `rest` from the first motion that tells it well, over the shortest window that does."""
    begin, end = float(rest.time[0]), float(rest.time[-1])
    standing = gnss_standing_time(gnss, begin)
    if not np.isfinite(standing):
        return None
    gyro_bias = bias[0] if bias is not None else np.zeros(3)
    rate_sd = float(np.max(bias[1] if bias is not None else model.axes("gyro_bias_sd"))) + EARTH_RATE
    sd_c1 = STANDARD_GRAVITY * sd_level + float(np.max(model.axes("accel_bias_sd"))) + 0.02
    best: HeadingFit | None = None
    contradictions: list[HeadingFit] = []
    for anchor in np.arange(max(begin, begin + standing - 3.0), min(end, begin + standing + SEARCH_S), ANCHOR_STEP_S):
        first = int(np.searchsorted(rest.time, anchor))
        q_lb = np.array(_carry(rest.inc_theta_b[:first], rest.dt[:first], quat_from_euler(roll, pitch, 0.0), gyro_bias))
        drift = rate_sd * float(anchor - begin)
        priors = (sd_c1 + STANDARD_GRAVITY * drift, STANDARD_GRAVITY * rate_sd)
        for window in WINDOWS_S:
            last = int(np.searchsorted(rest.time, anchor + window, side="right")) - 1
            if last <= first + 1:
                continue
            piece = rest.piece(first, last)
            time, values, sd, positions = _horizontal_fixes(gnss, float(piece.time[0]), float(piece.time[-1]))
            fit = fit_heading(piece, q_lb, gyro_bias, lever_b, time, values, sd, positions, *priors)
            if fit is None:
                continue
            if abs(fit.modulus - 1.0) > 0.5 + 4.0 * fit.sd_modulus:
                if fit.sd_modulus < CLEAR_MODULUS_SD and window <= CLEAR_WINDOW_S:
                    contradictions.append(fit)
                continue
            fit = replace(fit, sd=float(np.sqrt(fit.sd**2 + drift**2 + (0.5 * rate_sd * window) ** 2)))
            best = fit if best is None or fit.sd < best.sd else best
            if best.sd < GOOD_HEADING_SD:
                return best
        if best is not None and best.sd < USABLE_HEADING_SD:
            return best
    if best is None and len(contradictions) >= CONTRADICTIONS:
        modulus = float(np.median([fit.modulus for fit in contradictions]))
        raise AlignmentError(
            f"the motion seen by the inertial sensor is {modulus:.2f} times that seen by GNSS; check the units and "
            "axes of "
            "the inertial data and the time offset between the logs"
        )
    return best


def _horizontal_fixes(gnss: GnssLog, begin: float, end: float) -> tuple[Array, Array, Array, bool]:
    """Times, north and east velocities with standard deviations from `begin` to `end`; positions if few have a
    velocity.
    """
    inside = (gnss.time >= begin) & (gnss.time <= end)
    if gnss.velocity_n is not None and gnss.sd_velocity is not None:
        valid = np.isfinite(gnss.velocity_n).all(axis=1)
        if valid.mean() > 0.5:
            k = np.flatnonzero(inside & valid)
            return gnss.time[k], gnss.velocity_n[k, :2], np.hypot(np.max(gnss.sd_velocity[k, :2], axis=1), 0.02), False
    k = np.flatnonzero(inside)
    offsets = north_east(gnss, k)
    return gnss.time[k], offsets, np.hypot(np.max(gnss.sd_position[k, :2], axis=1), 0.02), True


@njit(cache=True)
def _carry(inc_theta_b, dt, q, bias):
    """Quaternion `q` (4-tuple) turned by a run of increments freed from a gyro bias (3,). No checks are made."""
    for k in range(dt.size):
        q = quat_multiply(
            q,
            quat_from_rotvec(
                (
                    inc_theta_b[k, 0] - bias[0] * dt[k],
                    inc_theta_b[k, 1] - bias[1] * dt[k],
                    inc_theta_b[k, 2] - bias[2] * dt[k],
                )
            ),
        )
    return quat_normalize(q)


def _relevel(roll: float, pitch: float, heading: float, fit: HeadingFit) -> tuple[float, float]:
    turn = dcm_from_rotvec((float(fit.tilt_n[0]), float(fit.tilt_n[1]), 0.0))
    roll, pitch, _ = euler_from_dcm(mat_mul(turn, dcm_from_euler(roll, pitch, heading)))
    return roll, pitch
