"""Finding the start of a run in its own data: position, velocity, level, heading.

1. The start time is the first moment with both inertial data and a GNSS fix near it.
2. While the sensor stands, the mean specific force gives roll and pitch, and the mean angular rate the gyro bias.
3. Heading comes from the first of these that is good enough: the Earth rate (if the gyroscopes are), the motion that follows
   (:mod:`navfuse.imu.heading`), the course over ground (if it moves fast without turning or accelerating). If the log never says, heading
   is left unknown.

The standard deviations handed to the filter are three times those of the fit, because the filter is going to use the same fixes again: what
is counted twice then weighs a tenth.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit

from navfuse.core.constants import EARTH_RATE, STANDARD_GRAVITY
from navfuse.core.earth import dcm_en, ecef_to_geodetic, geodetic_to_ecef_batch
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
from navfuse.data.start import Start
from navfuse.errors import AlignmentError
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.heading import HeadingFit, earth_rate_heading, fit_heading
from navfuse.imu.increments import ImuIncrements

Array = np.ndarray

UNKNOWN_HEADING_SD = np.pi / np.sqrt(3.0)
"""Standard deviation of a heading of which nothing is known [rad]."""
TWICE_USED = 3.0
"""Factor on the standard deviations of quantities found from fixes that the filter uses again."""
WINDOWS_S = (5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0, 120.0)
GOOD_HEADING_SD = np.radians(1.5)
USABLE_HEADING_SD = np.radians(10.0)
COURSE_SPEED = 4.0
COURSE_SD = np.radians(10.0)


@dataclass(frozen=True, slots=True)
class Known:
    """What a user states about the start; None where it is to be found.

    Attributes
    ----------
    time : float or None [s]
    position : (3,) array or None
        Latitude, longitude [rad], height [m] of the IMU.
    velocity_n : (3,) array or None [m/s]
    roll, pitch, heading : float or None [rad]
    sd_position, sd_velocity, sd_attitude : (3,) array or None
        [m], [m/s], [rad] (roll, pitch, heading).
    """

    time: float | None = None
    position: Array | None = None
    velocity_n: Array | None = None
    roll: float | None = None
    pitch: float | None = None
    heading: float | None = None
    sd_position: Array | None = None
    sd_velocity: Array | None = None
    sd_attitude: Array | None = None


@dataclass(frozen=True, slots=True)
class Alignment:
    """A start and how it was found.

    Attributes
    ----------
    start : Start
    level_source, heading_source : str
        "given", "standing", "moving"; "given", "earth rate", "motion", "course", "unknown".
    standing_s : float [s]
        How long the sensor stood at the start.
    notes : tuple of str
    """

    start: Start
    level_source: str
    heading_source: str
    standing_s: float
    notes: tuple[str, ...] = field(default=())


def align(increments: ImuIncrements, gnss: GnssLog | None, model: ImuErrorModel, lever_b: Array, known: Known = Known()) -> Alignment:
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
    time = _start_time(increments, gnss, known)
    first = int(np.searchsorted(increments.time, time - 1e-6))
    rest = _from(increments, first)
    time = float(rest.time[0])
    standing_s = _standing(rest, gnss, model)
    notes: list[str] = []
    roll, pitch, sd_level, level_source, bias = _level(rest, standing_s, model, known)
    heading, sd_heading, heading_source = known.heading, None, "given"
    given_sd = None if known.sd_attitude is None else known.sd_attitude[2]
    tilt: HeadingFit | None = None
    if heading is None or (given_sd is not None and given_sd > 2 * USABLE_HEADING_SD):
        latitude = known.position[0] if known.position is not None else gnss.lat[0] if gnss is not None else 0.0
        found = _heading(rest, gnss, model, lever_b, roll, pitch, sd_level, bias, standing_s, latitude)
        if found.source == "unknown" and heading is not None:
            sd_heading = min(given_sd, UNKNOWN_HEADING_SD)
        else:
            heading, sd_heading, heading_source, tilt = found.heading, found.sd, found.source, found.fit
        if heading_source == "unknown":
            notes.append(
                "heading could not be found: the log shows no motion that tells it; it starts unknown (104 deg, 1 sigma). Give [start] heading_deg "
                "if you know it"
            )
    if tilt is not None and level_source == "moving":
        roll, pitch = _relevel(roll, pitch, heading, tilt)
        sd_level = max(TWICE_USED * tilt.sd_tilt, sd_level / TWICE_USED)
    sd_euler = np.array([sd_level, sd_level, sd_heading if sd_heading is not None else np.radians(2.0)])
    if known.sd_attitude is not None:
        for i, given in enumerate((known.roll, known.pitch, known.heading if heading_source == "given" else None)):
            if given is not None:
                sd_euler[i] = known.sd_attitude[i] if i < 2 else min(known.sd_attitude[2], UNKNOWN_HEADING_SD)
    position, sd_position, velocity, sd_velocity = _position(time, gnss, known, (roll, pitch, heading), lever_b, rest, standing_s)
    states = {} if bias is None else {"gyro_bias": bias}
    start = Start.from_parts(time, position, velocity, np.array([roll, pitch, heading]), sd_position, sd_velocity, sd_euler, states)
    return Alignment(start, level_source, heading_source, standing_s, tuple(notes))


def _from(increments: ImuIncrements, first: int, last: int | None = None) -> ImuIncrements:
    stop = None if last is None else last + 1
    return ImuIncrements(increments.time[first:stop], increments.inc_theta_b[first:last], increments.inc_v_b[first:last])


def _start_time(increments: ImuIncrements, gnss: GnssLog | None, known: Known) -> float:
    begin, end = float(increments.time[0]), float(increments.time[-1])
    if known.time is not None:
        if not begin - 1e-6 <= known.time < end:
            raise AlignmentError(f"[start] time_s = {known.time:.3f} lies outside the inertial data, which span {begin:.3f} to {end:.3f} s")
        return max(known.time, begin)
    if gnss is None:
        return begin
    inside = gnss.time[(gnss.time >= begin - 1e-6) & (gnss.time <= end)]
    if inside.size == 0:
        raise AlignmentError(
            f"inertial data ({begin:.3f} to {end:.3f} s) and GNSS fixes ({gnss.time[0]:.3f} to {gnss.time[-1]:.3f} s) do not overlap; "
            "check that both use the same time scale and see time_offset_s"
        )
    if known.position is not None:
        return begin
    spacing = float(np.median(np.diff(gnss.time))) if gnss.time.size > 1 else 1.0
    near = gnss.time[gnss.time <= begin]
    if near.size and begin - near[-1] <= 1.5 * spacing:
        return begin
    return float(inside[0])


def _standing(increments: ImuIncrements, gnss: GnssLog | None, model: ImuErrorModel) -> float:
    """Length of the stand at the start [s], 0 if it moves or the first second is not quiet."""
    window = 1.0
    t = increments.time
    edges = np.searchsorted(t, np.arange(t[0], min(t[-1], t[0] + 600.0) + 1e-9, window))
    edges = np.unique(edges[edges < t.size])
    if edges.size < 2:
        return 0.0
    sums = np.add.reduceat(np.hstack([increments.inc_theta_b, increments.inc_v_b]), edges[:-1], axis=0)[:-1] if edges.size > 2 else None
    if sums is None:
        return 0.0
    span = np.diff(t[edges])[: sums.shape[0], None]
    mean = sums / span
    rate, force = mean[:, :3], mean[:, 3:]
    noise_rate = 5.0 * model.arw / np.sqrt(window) + np.radians(0.3)
    noise_force = 5.0 * model.vrw / np.sqrt(window) + 0.08
    quiet_rate = np.linalg.norm(rate - rate[0], axis=1) < noise_rate
    turning = np.linalg.norm(rate, axis=1) < np.radians(1.0) + 3.0 * np.max(model.axes("gyro_bias_sd")) + noise_rate
    quiet_force = np.linalg.norm(force - np.median(force[:3], axis=0), axis=1) < noise_force
    still = quiet_rate & quiet_force & turning
    length = int(np.argmin(still)) if not still.all() else still.size
    standing = float(t[edges[length]] - t[0])
    if gnss is not None:
        standing = min(standing, _gnss_standing(gnss, float(t[0])))
    return standing if standing >= 1.0 else 0.0


def _gnss_standing(gnss: GnssLog, begin: float) -> float:
    """How long the fixes after `begin` allow the antenna to stand [s]; infinite if there are none soon."""
    k = np.flatnonzero(gnss.time >= begin - 1e-6)
    if k.size == 0:
        return np.inf
    moving = np.zeros(k.size, dtype=bool)
    if gnss.velocity_n is not None and gnss.sd_velocity is not None:
        speed = np.linalg.norm(gnss.velocity_n[k, :2], axis=1)
        moving |= speed > 0.15 + 3.5 * np.max(gnss.sd_velocity[k, :2], axis=1)
    r = geodetic_to_ecef_batch(gnss.lat[k], gnss.lon[k], gnss.height[k])
    C_en = np.array(dcm_en(gnss.lat[k[0]], gnss.lon[k[0]])).reshape(3, 3)
    away = np.linalg.norm(((r - r[0]) @ C_en)[:, :2], axis=1)
    sd = np.max(gnss.sd_position[k, :2], axis=1)
    moving |= away > 0.3 + 3.5 * np.hypot(sd, sd[0])
    return float(gnss.time[k[np.argmax(moving)]] - begin) if moving.any() else np.inf


def _level(
    rest: ImuIncrements, standing_s: float, model: ImuErrorModel, known: Known
) -> tuple[float, float, float, str, tuple[Array, Array] | None]:
    span = standing_s if standing_s > 0 else 5.0
    if standing_s > 2.0:
        span = standing_s - min(1.0, 0.25 * standing_s)
    last = max(int(np.searchsorted(rest.time, rest.time[0] + span)), 1)
    head = _from(rest, 0, min(last, len(rest)))
    length = head.time[-1] - head.time[0]
    f = head.inc_v_b.sum(axis=0) / length
    size = float(np.linalg.norm(f))
    if known.roll is None or known.pitch is None:
        check_gravity(f)
    roll = float(np.arctan2(-f[1], -f[2]))
    pitch = float(np.arctan2(f[0], np.hypot(f[1], f[2])))
    bias_sd = float(np.max(model.axes("accel_bias_sd")))
    if standing_s > 0:
        source = "standing"
        sd = np.hypot(bias_sd / STANDARD_GRAVITY, model.vrw / np.sqrt(length) / STANDARD_GRAVITY) + np.radians(0.1)
    else:
        source = "moving"
        sd = np.radians(5.0) + abs(size - STANDARD_GRAVITY) / STANDARD_GRAVITY
    bias = None
    if standing_s > 2.0 and np.any(model.axes("gyro_bias_sd") > 0):
        rate = head.inc_theta_b.sum(axis=0) / length
        sd_rate = np.sqrt(model.arw**2 / length + EARTH_RATE**2) * np.ones(3)
        prior = model.axes("gyro_bias_sd")
        if np.all(sd_rate < prior):
            bias = (rate, sd_rate)
    if known.roll is not None:
        roll = known.roll
    if known.pitch is not None:
        pitch = known.pitch
    if known.roll is not None and known.pitch is not None:
        source, sd = "given", np.radians(0.5)
    return roll, pitch, float(sd), source, bias


def check_gravity(f_b: Array) -> None:
    """Refuse a mean specific force (3,) [m/s^2] that cannot be that of a forward-right-down sensor on Earth.

    Raises
    ------
    AlignmentError
        If it points the wrong way or its size is far from gravity.
    """
    size = float(np.linalg.norm(f_b))
    if not 0.7 * STANDARD_GRAVITY < size < 1.3 * STANDARD_GRAVITY:
        raise AlignmentError(
            f"the mean specific force is {size:.3f} m/s^2, not about 9.8; check the unit of the accelerometer columns (m/s^2 or g, rates or increments)"
        )
    if f_b[2] > -0.5 * size:
        axis = "xyz"[int(np.argmax(np.abs(f_b)))]
        sign = "+" if f_b["xyz".index(axis)] > 0 else "-"
        raise AlignmentError(
            f"gravity points the wrong way: with the axes as set, the mean specific force is ({f_b[0]:.2f}, {f_b[1]:.2f}, {f_b[2]:.2f}) m/s^2 in "
            "forward-right-down, where a level sensor reads (0, 0, -9.8). The upward axis is "
            f"{sign}{axis} of what is called forward-right-down now; set [imu] axes to what x, y, z of the file point to"
        )


@dataclass(frozen=True, slots=True)
class _Found:
    heading: float
    sd: float
    source: str
    fit: HeadingFit | None = None


def _heading(rest, gnss, model, lever_b, roll, pitch, sd_level, bias, standing_s, latitude) -> _Found:
    C_lb = np.array(dcm_from_euler(roll, pitch, 0.0)).reshape(3, 3)
    found = _Found(0.0, UNKNOWN_HEADING_SD, "unknown")
    if standing_s > 10.0:
        last = int(np.searchsorted(rest.time, rest.time[0] + standing_s - 1.0))
        mean = rest.inc_theta_b[:last].sum(axis=0) / (rest.time[last] - rest.time[0])
        sd_rate = float(np.hypot(np.max(model.axes("gyro_bias_sd")), model.arw / np.sqrt(standing_s)))
        heading, sd = earth_rate_heading(mean, C_lb, latitude, sd_rate)
        if sd < USABLE_HEADING_SD:
            found = _Found(heading, max(sd, np.radians(0.05)), "earth rate")
    if gnss is None or found.sd < GOOD_HEADING_SD:
        return found
    fit = _motion_heading(rest, gnss, model, lever_b, roll, pitch, sd_level, bias, standing_s)
    if fit is not None and abs(fit.modulus - 1.0) > 0.35 + 4.0 * fit.sd_modulus:
        raise AlignmentError(
            f"the motion seen by the inertial sensor is {fit.modulus:.2f} times that seen by GNSS; check the units and axes of the inertial data and "
            "the time offset between the logs"
        )
    if fit is not None and TWICE_USED * fit.sd < found.sd and fit.sd < USABLE_HEADING_SD:
        return _Found(fit.heading, TWICE_USED * fit.sd + np.radians(0.3), "motion", fit)
    if found.source == "unknown":
        course = _course(rest, gnss)
        if course is not None:
            return _Found(course[0], course[1], "course")
    return found


def _motion_heading(rest, gnss, model, lever_b, roll, pitch, sd_level, bias, standing_s) -> HeadingFit | None:
    """Heading at the start of `rest` from the motion that follows, over the shortest window that tells it well."""
    moving_from = _first_motion(gnss, float(rest.time[0]), standing_s)
    if moving_from is None:
        return None
    anchor = max(float(rest.time[0]), moving_from - 3.0)
    first = int(np.searchsorted(rest.time, anchor))
    gyro_bias = bias[0] if bias is not None else np.zeros(3)
    q_lb = np.array(_carry(rest.inc_theta_b[:first], rest.dt[:first], quat_from_euler(roll, pitch, 0.0), gyro_bias))
    best: HeadingFit | None = None
    velocity = gnss.velocity_n is not None and gnss.sd_velocity is not None and np.isfinite(gnss.velocity_n).all(axis=1).mean() > 0.5
    rate_sd = float(np.max(bias[1] if bias is not None else model.axes("gyro_bias_sd"))) + EARTH_RATE
    sd_c1 = STANDARD_GRAVITY * sd_level + float(np.max(model.axes("accel_bias_sd"))) + 0.02
    drift = rate_sd * (anchor - float(rest.time[0]))
    for window in WINDOWS_S:
        last = int(np.searchsorted(rest.time, anchor + window, side="right")) - 1
        if last <= first + 1:
            continue
        piece = _from(rest, first, last)
        inside = (gnss.time >= piece.time[0]) & (gnss.time <= piece.time[-1])
        if velocity:
            inside &= np.isfinite(gnss.velocity_n).all(axis=1)
        k = np.flatnonzero(inside)
        if k.size < 6:
            continue
        if velocity:
            values, sd = gnss.velocity_n[k, :2], np.max(gnss.sd_velocity[k, :2], axis=1)
        else:
            r = geodetic_to_ecef_batch(gnss.lat[k], gnss.lon[k], gnss.height[k])
            C_en = np.array(dcm_en(gnss.lat[k[0]], gnss.lon[k[0]])).reshape(3, 3)
            values, sd = ((r - r[0]) @ C_en)[:, :2], np.max(gnss.sd_position[k, :2], axis=1)
        sd = np.hypot(sd, 0.02)
        fit = fit_heading(
            piece, q_lb, gyro_bias, lever_b, gnss.time[k], values, sd, not velocity, sd_c1 + STANDARD_GRAVITY * drift, STANDARD_GRAVITY * rate_sd
        )
        if fit is None:
            continue
        sd_total = float(np.sqrt(fit.sd**2 + drift**2 + (0.5 * rate_sd * window) ** 2))
        fit = HeadingFit(fit.heading, sd_total, fit.modulus, fit.sd_modulus, fit.tilt_n, fit.sd_tilt)
        if best is None or fit.sd < best.sd:
            best = fit
        if best.sd < GOOD_HEADING_SD:
            break
    return best


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


def _first_motion(gnss: GnssLog, begin: float, standing_s: float) -> float | None:
    free = _gnss_standing(gnss, begin)
    if standing_s <= 0:
        return begin
    return None if not np.isfinite(free) else begin + free


def _course(rest: ImuIncrements, gnss: GnssLog) -> tuple[float, float] | None:
    """Course over ground near the start, taken for the heading, if it moves fast."""
    k = np.flatnonzero((gnss.time >= rest.time[0]) & (gnss.time <= rest.time[0] + 10.0))
    if k.size < 2:
        return None
    r = geodetic_to_ecef_batch(gnss.lat[k], gnss.lon[k], gnss.height[k])
    C_en = np.array(dcm_en(gnss.lat[k[0]], gnss.lon[k[0]])).reshape(3, 3)
    way = ((r[-1] - r[0]) @ C_en)[:2]
    span = gnss.time[k[-1]] - gnss.time[k[0]]
    distance = float(np.hypot(*way))
    sd = float(np.max(gnss.sd_position[k, :2]))
    if distance < max(COURSE_SPEED * span, 10.0 * sd):
        return None
    last = int(np.searchsorted(rest.time, gnss.time[k[-1]]))
    turned = float(np.linalg.norm(rest.inc_theta_b[:last].sum(axis=0)))
    return float(np.arctan2(way[1], way[0]) % (2 * np.pi)), float(np.sqrt(COURSE_SD**2 + (2.0 * sd / distance) ** 2 + turned**2))


def _relevel(roll: float, pitch: float, heading: float, fit: HeadingFit) -> tuple[float, float]:
    turn = dcm_from_rotvec((float(fit.tilt_n[0]), float(fit.tilt_n[1]), 0.0))
    roll, pitch, _ = euler_from_dcm(mat_mul(turn, dcm_from_euler(roll, pitch, heading)))
    return roll, pitch


def _position(time, gnss, known, euler, lever_b, rest, standing_s):
    """Position and velocity of the IMU at `time`, with standard deviations."""
    sd_position = known.sd_position
    sd_velocity = known.sd_velocity
    position, velocity = known.position, known.velocity_n
    if position is None or velocity is None:
        if gnss is None:
            raise AlignmentError("without GNSS the start must be given in full: lat_deg, lon_deg, height_m, velocity_mps, roll_deg, pitch_deg, heading_deg")
        k = int(np.argmin(np.abs(gnss.time - time)))
        away = abs(float(gnss.time[k] - time))
        r = geodetic_to_ecef_batch(gnss.lat, gnss.lon, gnss.height)
        C_en = np.array(dcm_en(gnss.lat[k], gnss.lon[k])).reshape(3, 3)
        fix_velocity, fix_sd = _fix_velocity(gnss, r, C_en, k, time, standing_s)
        if velocity is None:
            velocity = fix_velocity
            turning = np.linalg.norm(rest.inc_theta_b[:20].sum(axis=0)) / max(rest.time[min(20, len(rest))] - rest.time[0], 1e-6)
            sd_velocity = fix_sd + float(np.linalg.norm(lever_b)) * turning if sd_velocity is None else sd_velocity
        if position is None:
            C_nb = np.array(dcm_from_euler(*euler)).reshape(3, 3)
            r0 = r[k] + C_en @ (fix_velocity * (time - gnss.time[k]) - C_nb @ lever_b)
            position = np.array(ecef_to_geodetic(r0[0], r0[1], r0[2]))
            if sd_position is None:
                sd_position = TWICE_USED * gnss.sd_position[k] + away * (fix_sd + 1.0 * away) + 2.0 * np.linalg.norm(lever_b) * 0.1
    if sd_position is None:
        sd_position = np.array([1.0, 1.0, 2.0])
    if sd_velocity is None:
        sd_velocity = np.full(3, 0.1)
    return np.asarray(position, dtype=float), sd_position, np.asarray(velocity, dtype=float), sd_velocity


def _fix_velocity(gnss: GnssLog, r: Array, C_en: Array, k: int, time: float, standing_s: float) -> tuple[Array, Array]:
    """Velocity [m/s] of the antenna at fix `k` in n, and its standard deviation."""
    if standing_s > 0:
        return np.zeros(3), np.full(3, 0.1)
    if gnss.velocity_n is not None and gnss.sd_velocity is not None and np.isfinite(gnss.velocity_n[k]).all():
        return gnss.velocity_n[k].copy(), TWICE_USED * gnss.sd_velocity[k] + 2.0 * abs(gnss.time[k] - time)
    near = np.flatnonzero(np.abs(gnss.time - gnss.time[k]) <= 2.0)
    if near.size < 2:
        near = np.arange(max(k - 1, 0), min(k + 2, gnss.time.size))
    if near.size < 2:
        raise AlignmentError("the velocity at the start cannot be found from a single fix; give [start] velocity_mps")
    t = gnss.time[near] - time
    offsets = (r[near] - r[k]) @ C_en
    spread = t - t.mean()
    slope = spread @ offsets / (spread @ spread)
    sd = np.max(gnss.sd_position[near], axis=0) / np.sqrt(spread @ spread)
    return slope, TWICE_USED * sd + 0.5 * float(np.ptp(t)) + 0.1
