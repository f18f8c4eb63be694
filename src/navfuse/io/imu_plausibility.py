"""Is an IMU log in the units its column names claim?

Three facts settle it on ordinary logs. An accelerometer near the Earth reads about one g, whatever it is mounted on.
Gyros stop at a few thousand degrees per second. And specific force, rotated into a non-rotating frame with the log's
own angular rates and averaged over a time T, is gravity reversed plus (change of velocity) / T: over half a minute 9.8
m/s^2 give or take little, in curves, climbs and orbits alike. Rates in a wrong unit scatter it instead. On six real
and simulated logs (cars, aircraft, a static sensor) the median deviation from g is 0.01 to 0.4 m/s^2 as recorded, and
0.97 to 7 with degrees taken for radians.

A contradiction that nothing but a wrong unit explains is an error; the rest is a note.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.errors import InputError

Array = np.ndarray

_G = STANDARD_GRAVITY
_GYRO_LIMIT = 35.0
_GYRO_FAST = 8.0
_SUSPECT = 0.5
_ODD = 3.0
_WINDOW = 30.0
_STEP = 0.1
_GAP = 0.5
_MAX_WINDOWS = 20


def check_imu_units(
    time: Array, gyro: Array, accel: Array, kind: str, columns: Sequence[str], source: str
) -> list[str]:
    """Check the units of an IMU log by its values.

    Parameters
    ----------
    time : (n,) array [s]
        Strictly increasing, n >= 2.
    gyro, accel : (n, 3) arrays
        Rates [rad/s, m/s^2] or increments [rad, m/s], by their column names.
    kind : {"rates", "increments"}
        What they hold.
    columns : sequence of 7 str
        Column names: time, then gyro, then accelerometer.
    source : str
        File, for messages.

    Returns
    -------
    list of str
        Notes on what looks odd.

    Raises
    ------
    InputError
        If the values contradict the unit or the kind.
    """
    sample = slice(1, None, max(1, (time.size - 1) // 20000))
    steps = np.diff(time)[:: sample.step]
    step = float(np.median(steps))
    notes = check_step(step, columns[0], source)
    interval = steps[:, None] if kind == "increments" else 1.0
    force = float(np.median(np.linalg.norm(accel[sample], axis=1)))
    force_rate = float(np.median(np.linalg.norm(accel[sample] / interval, axis=1)))
    turn = np.linalg.norm(gyro[sample] / interval, axis=1)
    notes += check_accel(force, force_rate, step, kind, columns, source)
    notes += check_gyro(turn, time, gyro, accel, kind, columns, source)
    return notes


def gravity_coherence(
    time: Array, gyro: Array, accel: Array, kind: str, factor: float = 1.0, bias: Array | float = 0.0
) -> Array:
    """Magnitude of specific force averaged in a non-rotating frame, over up to twenty windows of 30 s.

    Parameters
    ----------
    time, gyro, accel, kind
        As in :func:`check_imu_units`.
    factor : float
        What the rates are multiplied with.
    bias : (3,) array [rad/s]
        What is subtracted from the rates before that.

    Returns
    -------
    (w,) array [m/s^2]
        One value per window without a gap, about 9.8 each if the units are right; empty if the log is shorter than
        10 s or slower than 10 Hz.
    """
    span = time[-1] - time[0]
    if span < 10.0 or (time.size - 1) / span < 1.0 / _STEP:
        return np.empty(0)
    length = min(_WINDOW, span)
    count = min(_MAX_WINDOWS, int(span // length))
    steps = int(round(length / _STEP))
    starts = [start for start in np.linspace(time[0], time[-1] - length, count) if _whole(time, start, start + length)]
    rotations = np.empty((len(starts), steps, 3))
    velocities = np.empty((len(starts), steps, 3))
    for window, start in enumerate(starts):
        edges = np.searchsorted(time, start + np.linspace(0.0, length, steps + 1)).clip(0, time.size - 1)
        rows = slice(edges[0] + 1, edges[-1] + 1)
        weight = 1.0 if kind == "increments" else np.diff(time[edges[0] : edges[-1] + 1])[:, None]
        rotations[window] = (_sums(gyro[rows] * weight, edges) - bias * length / steps) * factor
        velocities[window] = _sums(accel[rows] * weight, edges)
    turns = _rotation_matrices(rotations)
    attitude = np.broadcast_to(np.eye(3), (len(starts), 3, 3))
    total = np.zeros((len(starts), 3))
    for k in range(steps):
        total += (attitude @ velocities[:, k, :, None])[..., 0]
        attitude = attitude @ turns[:, k]
    return np.linalg.norm(total, axis=1) / length


def _whole(time: Array, start: float, end: float) -> bool:
    """Whether no gap interrupts the rows from `start` to `end`."""
    first, last = np.searchsorted(time, [start, end])
    return bool(np.diff(time[max(first - 1, 0) : last + 1]).max(initial=0.0) <= _GAP)


def _gravity_deviation(time: Array, gyro: Array, accel: Array, kind: str, factor: float, maybe_biased: bool) -> float:
    """Median over the windows of |coherent average - g| [m/s^2], NaN if the log is too short.

    If it is suspect and the sensor `maybe_biased`, the smaller of the values with and without the median rate, which is
    the bias of a raw sensor. Without that, gravity stays where it is under any rotation about the vertical, at 57 times
    the rate too; so rates that only acrobats reach are judged as they are.
    """
    deviation = _median_deviation(gravity_coherence(time, gyro, accel, kind, factor))
    if deviation > _SUSPECT and maybe_biased:
        sample = slice(1, None, max(1, (time.size - 1) // 20000))
        interval = np.diff(time)[:: sample.step][:, None] if kind == "increments" else 1.0
        bias = np.median(gyro[sample] / interval, axis=0)
        deviation = min(deviation, _median_deviation(gravity_coherence(time, gyro, accel, kind, factor, bias)))
    return deviation


def _median_deviation(average: Array) -> float:
    return float(np.median(np.abs(average - _G))) if average.size else np.nan


def _sums(increments: Array, edges: Array) -> Array:
    total = np.concatenate((np.zeros((1, 3)), np.cumsum(increments, axis=0)))
    return np.diff(total[edges - edges[0]], axis=0)


def _rotation_matrices(vectors: Array) -> Array:
    """Rotation matrices of rotation vectors (Rodrigues), over leading axes."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    skew = np.stack((zero, -z, y, z, zero, -x, -y, x, zero), axis=-1).reshape(*vectors.shape, 3)
    half_sinc = np.sinc(angle / (2.0 * np.pi))
    return np.eye(3) + np.sinc(angle / np.pi) * skew + 0.5 * half_sinc**2 * (skew @ skew)


def check_step(step: float, column: str, source: str) -> list[str]:
    """Judge the median `step` [s] between the stamps of an inertial log; as :func:`check_imu_units`."""
    if 1e-5 <= step <= 0.5:
        return []
    advice = f"is '{column}' in the unit its name says (_s, _ms, _us, _ns)?"
    if step < 1e-5 or step > 2.0:
        raise InputError(
            f"{source}: the IMU rows are {step:.3g} s apart (median), which no inertial sensor does; {advice}"
        )
    return [f"{source}: the IMU rows are {step:.3g} s apart (median), which is slow for an inertial sensor; {advice}"]


def check_accel(
    force: float, force_rate: float, step: float, kind: str, columns: Sequence[str], source: str
) -> list[str]:
    """Judge the unit of the accelerometers; as :func:`check_imu_units`.

    Parameters
    ----------
    force, force_rate : float
        Median magnitude of the rows [m/s^2] or [m/s], and of what they are per second [m/s^2].
    step : float [s]
        Median step of the stamps.
    kind, columns, source
        As in :func:`check_imu_units`.
    """
    names = ", ".join(columns[4:])
    base = columns[4].split("_")[0]
    if 0.5 * _G <= force_rate <= 2.0 * _G:
        return []
    if kind == "increments" and 0.7 * _G < force < 1.4 * _G:
        raise InputError(
            f"{source}: columns {names}: the median magnitude is {force:.3g} m/s, gravity over the {step:.3g} s between"
            f" rows is {_G * step:.3g} m/s; these are accelerations, not increments: rename to accel_x_mps2 ... and"
            " gyro_x_radps ..."
        )
    fault = (
        f"{source}: columns {names}: the median specific force is {force_rate:.3g} m/s^2 where gravity alone makes 9.8"
    )
    if kind == "rates" and 0.7 < force / (_G * step) < 1.4 and not 0.05 < step < 0.2:
        raise InputError(
            f"{fault}; these are velocity increments over {step:.3g} s, not accelerations: rename to dvel_x_mps ... and"
            " dtheta_x_rad ..."
        )
    if 0.5 <= force_rate <= 2.0:
        remedy = f"rename to {base}_x_g ..." if kind == "rates" else f"multiply the columns by {STANDARD_GRAVITY}"
        if kind == "rates" and 0.7 < force / (_G * step) < 1.4:
            remedy += f" (or, at {step:.3g} s between rows, velocity increments: rename to dvel_x_mps ...)"
        raise InputError(f"{fault}; these look like values in g: {remedy}")
    if 5.0 * _G < force_rate < 20.0 * _G:
        raise InputError(f"{fault}; these look like values in m/s^2 in a column of g: rename to {base}_x_mps2 ...")
    if 50.0 * _G < force_rate < 200.0 * _G:
        raise InputError(
            f"{fault}; these look like values in milli-g or cm/s^2: rename to {base}_x_mg ... or {base}_x_cmps2 ..."
        )
    return [f"{fault}; check the unit of these columns"]


def check_gyro(
    turn: Array, time: Array, gyro: Array, accel: Array, kind: str, columns: Sequence[str], source: str
) -> list[str]:
    """Judge the unit of the gyros; as :func:`check_imu_units`.

    Parameters
    ----------
    turn : (m,) array [rad/s]
        Magnitude of the rate in some of the rows.
    time, gyro, accel, kind, columns, source
        As in :func:`check_imu_units`.
    """
    names = ", ".join(columns[1:4])
    base = columns[1].split("_")[0]
    degrees = "degps" if kind == "rates" else "deg"
    fast = float(np.percentile(turn, 99.0))
    if fast > _GYRO_LIMIT:
        raise InputError(
            f"{source}: columns {names}: one row in a hundred turns faster than {fast:.3g} rad/s, more than the 2000"
            f" deg/s of a fast gyro; are these degrees? Then rename to {base}_x_{degrees} ..."
        )
    deviation = _gravity_deviation(time, gyro, accel, kind, 1.0, fast < _GYRO_FAST)
    if deviation > _SUSPECT:
        other = _gravity_deviation(time, gyro, accel, kind, np.pi / 180.0, fast < _GYRO_FAST)
        fault = (
            f"{source}: columns {names}: when specific force is rotated with these rates and averaged over half a"
            f" minute, what remains is {deviation:.2g} m/s^2 away from gravity (median)"
        )
        if other < 0.25 * deviation:
            raise InputError(f"{fault}, but only {other:.2g} if they are degrees: rename to {base}_x_{degrees} ...")
        if deviation > _ODD:
            return [f"{fault}; check the units, signs and order of the gyro and accelerometer columns"]
    if np.isnan(deviation) and float(np.median(turn)) > 1.5:
        return [
            f"{source}: columns {names}: the median rate is {np.median(turn):.3g} rad/s, unusually fast; are these"
            f" degrees? Then rename to {base}_x_{degrees} ..."
        ]
    return []
