"""Whether the sensor stands at the start, and what it says then: level and gyro bias."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from navfuse.core.constants import EARTH_RATE, STANDARD_GRAVITY
from navfuse.data.logs import GnssLog
from navfuse.errors import AlignmentError
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.first_fix import moves_steadily, north_east
from navfuse.imu.increments import ImuIncrements

Array = np.ndarray


def standing_time(increments: ImuIncrements, gnss: GnssLog | None, model: ImuErrorModel) -> float:
    """Length of the stand at the start [s], 0 if it moves or the first second is not quiet."""
    window = 1.0
    t = increments.time
    edges = np.searchsorted(t, np.arange(t[0], min(t[-1], t[0] + 600.0) + 1e-9, window))
    edges = np.unique(edges[edges < t.size])
    if edges.size < 3:
        return 0.0
    sums = np.add.reduceat(np.hstack([increments.inc_theta_b, increments.inc_v_b]), edges[:-1], axis=0)[:-1]
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
        standing = min(standing, gnss_standing_time(gnss, float(t[0])))
    return standing if standing >= 1.0 else 0.0


def gnss_standing_time(gnss: GnssLog, begin: float) -> float:
    """How long the fixes after `begin` allow the antenna to stand [s]; infinite if there are none soon."""
    k = np.flatnonzero(gnss.time >= begin - 1e-6)
    if k.size == 0:
        return np.inf
    moving = np.zeros(k.size, dtype=bool)
    if gnss.velocity_n is not None and gnss.sd_velocity is not None:
        speed = np.linalg.norm(gnss.velocity_n[k, :2], axis=1)
        moving |= speed > 0.15 + 3.5 * np.max(gnss.sd_velocity[k, :2], axis=1)
    elif moves_steadily(gnss, k):
        return 0.0
    offsets = north_east(gnss, k)
    away = np.linalg.norm(offsets - np.median(offsets[:5], axis=0), axis=1)
    sd = np.max(gnss.sd_position[k, :2], axis=1)
    moving |= away > 0.3 + 3.5 * np.hypot(sd, sd[0])
    if k.size > 1:
        moving[:-1] &= moving[1:]
    return float(gnss.time[k[np.argmax(moving)]] - begin) if moving.any() else np.inf


class Level(NamedTuple):
    """Levelling of the sensor at the start.

    Attributes
    ----------
    roll, pitch, sd : float [rad]
    force_b : (3,) array [m/s^2]
        Mean specific force that it came from.
    gyro_bias : (value, sd) or None
        Mean angular rate at rest (3,) [rad/s] and its standard deviation, where that says more than the error model.
    plausible_rate : bool
        Whether the mean rate at rest is no more than the Earth rate and the biases of the error model.
    notes : tuple of str
        Where the sensor at rest contradicts its error model.
    """

    roll: float
    pitch: float
    sd: float
    force_b: Array
    gyro_bias: tuple[Array, Array] | None
    plausible_rate: bool
    notes: tuple[str, ...]


def level(rest: ImuIncrements, standing_s: float, model: ImuErrorModel) -> Level:
    """Level a sensor by its mean specific force over the stand, or over the first five seconds if it moves.

    Parameters
    ----------
    rest : ImuIncrements
        From the start on.
    standing_s : float [s]
        From :func:`standing_time`; its last second at the most is left out, in case the vehicle is already about to
        move.
    model : ImuErrorModel

    Notes
    -----
    Roll = atan2(-f_y, -f_z), pitch = atan2(f_x, sqrt(f_y^2 + f_z^2)) (Groves 2013, eq. 5.101). A moving sensor
    is level only as far as its acceleration is small: 5 deg plus what the size of the specific force lacks of
    gravity.
    """
    span = standing_s if standing_s > 0 else 5.0
    if standing_s > 2.0:
        span = standing_s - min(1.0, 0.25 * standing_s)
    last = max(int(np.searchsorted(rest.time, rest.time[0] + span)), 1)
    head = rest.piece(0, min(last, len(rest)))
    length = float(head.time[-1] - head.time[0])
    f = head.inc_v_b.sum(axis=0) / length
    if standing_s > 0:
        bias_sd = float(np.max(model.axes("accel_bias_sd")))
        sd = float(np.hypot(bias_sd, model.vrw / np.sqrt(length)) / STANDARD_GRAVITY + np.radians(0.1))
    else:
        sd = float(np.radians(5.0) + abs(np.linalg.norm(f) - STANDARD_GRAVITY) / STANDARD_GRAVITY)
    roll, pitch = float(np.arctan2(-f[1], -f[2])), float(np.arctan2(f[0], np.hypot(f[1], f[2])))
    if standing_s <= 2.0:
        return Level(roll, pitch, sd, f, None, True, ())
    prior = model.axes("gyro_bias_sd")
    rate = head.inc_theta_b.sum(axis=0) / length
    noise = model.arw / np.sqrt(length)
    sd_rate = np.full(3, np.hypot(noise, EARTH_RATE))
    plausible = bool(np.all(np.abs(rate) < EARTH_RATE + 5.0 * np.hypot(prior, noise)))
    notes = []
    if not plausible:
        notes.append(
            f"at rest the gyroscopes read up to {np.degrees(np.max(np.abs(rate))) * 3600:.0f} deg/h; the error model "
            "says "
            f"biases of {np.degrees(np.max(prior)) * 3600:.3g} deg/h: choose the imu.grade of your sensor"
        )
    force_sd = np.max(model.axes("accel_bias_sd")) + STANDARD_GRAVITY * np.max(model.axes("accel_scale_sd"))
    excess = float(np.linalg.norm(f)) - STANDARD_GRAVITY
    if abs(excess) > 0.06 + 5.0 * force_sd:
        notes.append(
            f"at rest the specific force is {excess:+.3f} m/s^2 off gravity; the error model says {force_sd:.2g}: "
            "choose the "
            "imu.grade of your sensor"
        )
    bias = (rate, sd_rate) if np.all(sd_rate < prior) or (not plausible and np.any(prior > 0)) else None
    return Level(roll, pitch, sd, f, bias, plausible, tuple(notes))


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
            f"the mean specific force is {size:.3f} m/s^2, not about 9.8; check the unit of the accelerometer "
            "columns (m/s^2 or g, rates or increments)"
        )
    if f_b[2] > -0.5 * size:
        axis = "xyz"[int(np.argmax(np.abs(f_b)))]
        sign = "+" if f_b["xyz".index(axis)] > 0 else "-"
        raise AlignmentError(
            f"gravity points the wrong way: with the axes as set, the mean specific force is ({f_b[0]:.2f}, "
            f"{f_b[1]:.2f}, {f_b[2]:.2f}) m/s^2 in "
            "forward-right-down, where a level sensor reads (0, 0, -9.8). The upward axis is "
            f"{sign}{axis} of what is called forward-right-down now; set [imu] axes to what x, y, z of the file "
            "point to"
        )
