"""From perfect measurements to realistic ones: IMU errors by the error model of the engine, and GNSS fixes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from navfuse.core.earth import ecef_to_geodetic_batch
from navfuse.core.rotation import dcm_from_quat_batch
from navfuse.core.stochastic import gauss_markov_decay, gauss_markov_noise, random_walk_noise
from navfuse.data.logs import GnssLog, ImuLog
from navfuse.errors import ConfigError, InputError
from navfuse.simulation.imu_error_kernels import SAME_STEP
from navfuse.simulation.perfect_imu import sample_times

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from navfuse.imu.error_model import ImuErrorModel
    from navfuse.simulation.motion import Motion

Array = np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class ImuErrorTruth:
    """The errors that were put into an IMU log: ``measured = (I + M) true + bias + noise``.

    Attributes
    ----------
    time : (n,) array [s]
        Stamps of the log.
    gyro_bias, accel_bias : (n, 3) arrays [rad/s], [m/s^2]
        Held constant over the interval that ends at the stamp.
    gyro_scale, accel_scale : (n, 3) arrays [1]
        Diagonal of M; read-only and constant along n where the model says so.
    gyro_cross, accel_cross : (3, 3) arrays [rad]
        Off-diagonal part of M, zero diagonal.
    """

    time: Array
    gyro_bias: Array
    accel_bias: Array
    gyro_scale: Array
    accel_scale: Array
    gyro_cross: Array
    accel_cross: Array


@njit(cache=True, error_model="numpy")
def _wander(dt, tau, sigma, walk, out):
    """Turn unit normals `out` (n, m) into Gauss-Markov or walking paths in place; they start with deviation `sigma`."""
    count = out.shape[1]
    step, decay, drive = -1.0, 1.0, np.zeros(count)
    for j in range(count):
        out[0, j] *= sigma[j]
    for k in range(1, dt.size):
        if abs(dt[k] - step) > SAME_STEP * dt[k]:
            step = dt[k]
            decay = gauss_markov_decay(step, tau)
            for j in range(count):
                noise = gauss_markov_noise(sigma[j], step, tau) + random_walk_noise(walk[j] * walk[j], step)
                drive[j] = math.sqrt(noise)
        for j in range(count):
            out[k, j] = decay * out[k - 1, j] + drive[j] * out[k, j]


@njit(cache=True, error_model="numpy")
def _add_to_truth(values, bias, scale, cross, gain, white, out):
    """Turn unit normals `out` (n, 3) into ``values + (scale + cross) values + bias gain + white out``, in place.

    `bias` and `scale` have a row for each sample or one for all. No checks are made.
    """
    for k in range(values.shape[0]):
        x, y, z = values[k, 0], values[k, 1], values[k, 2]
        b = bias[k if bias.shape[0] > 1 else 0]
        s = scale[k if scale.shape[0] > 1 else 0]
        for i in range(3):
            coupled = cross[i, 0] * x + cross[i, 1] * y + cross[i, 2] * z
            out[k, i] = white[k] * out[k, i] + values[k, i] + s[i] * values[k, i] + coupled + b[i] * gain[k]


def gauss_markov(
    time: ArrayLike, sd: ArrayLike, tau: float, walk: ArrayLike, rng: np.random.Generator, count: int = 3
) -> Array:
    """Random paths of a slowly changing sensor error, on three axes or as many as there are.

    Parameters
    ----------
    time : (n,) array [s]
        Increasing, any spacing.
    sd, walk : number or (count,) array
        As in :class:`~navfuse.imu.error_model.ImuErrorModel`.
    tau : float [s]
        Correlation time; inf for a constant plus random walk.
    rng : numpy Generator
    count : int
        Number of paths.

    Returns
    -------
    (n, count) array
        In the unit of `sd`. With finite tau the process is stationary from the first sample on; without tau and walk,
        one draw is repeated (a read-only view), and without any of the three there is none: zeros.
    """
    time = np.asarray(time, dtype=float)
    sds, walks = (np.broadcast_to(np.asarray(x, dtype=float), (count,)).copy() for x in (sd, walk))
    if not sds.any() and not walks.any():
        return np.broadcast_to(np.zeros(count), (time.size, count))
    if not math.isfinite(tau) and not walks.any():
        return np.broadcast_to(rng.standard_normal(count) * sds, (time.size, count))
    path = rng.standard_normal((time.size, count))
    _wander(np.diff(time, prepend=time[0]), tau, sds, walks, path)
    return path


def add_imu_errors(log: ImuLog, model: ImuErrorModel, rng: np.random.Generator) -> tuple[ImuLog, ImuErrorTruth]:
    """A log as a real sensor would have written it.

    Parameters
    ----------
    log : ImuLog
        Perfect, rates or increments, any spacing.
    model : ImuErrorModel
    rng : numpy Generator
        Advanced only by spawning children, one per error, so that changing one parameter leaves the draws of the others
        alone.

    Returns
    -------
    measured : ImuLog
    truth : ImuErrorTruth

    Notes
    -----
    White noise has the standard deviation ``arw * sqrt(dt)`` per increment, or ``arw / sqrt(dt)`` per rate
    sample, with dt the interval that ends at the sample (for the first one, the next). Biases and scale factors are
    exact discrete Gauss-Markov processes.
    """
    streams = rng.spawn(8)
    dt = np.diff(log.time, prepend=log.time[0])
    dt[0] = dt[1] if dt.size > 1 else 0.0
    gain = np.ones_like(dt) if log.kind == "rates" else dt
    per_noise = np.sqrt(dt) if log.kind == "increments" else 1.0 / np.sqrt(np.where(dt > 0.0, dt, np.inf))
    measured, drawn = {}, {}
    for offset, sensor, values, white in ((0, "gyro", log.gyro, model.arw), (4, "accel", log.accel, model.vrw)):
        bias = gauss_markov(
            log.time,
            model.axes(f"{sensor}_bias_sd"),
            getattr(model, f"{sensor}_bias_tau"),
            model.axes(f"{sensor}_bias_walk"),
            streams[offset],
        )
        scale = gauss_markov(
            log.time, model.axes(f"{sensor}_scale_sd"), getattr(model, f"{sensor}_scale_tau"), 0.0, streams[offset + 1]
        )
        cross = getattr(model, f"{sensor}_cross_sd") * streams[offset + 2].standard_normal((3, 3))
        np.fill_diagonal(cross, 0.0)
        out = streams[offset + 3].standard_normal(values.shape)
        parts = _rows(bias), _rows(scale), cross
        _add_to_truth(np.ascontiguousarray(values), *parts, gain, white * per_noise, out)
        measured[sensor] = out
        drawn |= {f"{sensor}_bias": bias, f"{sensor}_scale": scale, f"{sensor}_cross": cross}
    noisy = ImuLog(log.time, measured["gyro"], measured["accel"], log.kind, log.source, log.notes)
    return noisy, ImuErrorTruth(log.time, **drawn)


def _rows(path: Array) -> Array:
    """A path, or the one row that it repeats, contiguous and writable."""
    return path if path.strides[0] else path[:1].copy()


def antenna_state(motion: Motion, time: ArrayLike, lever_arm_b: ArrayLike) -> tuple[Array, Array]:
    """Position and velocity of a point fixed to the body.

    Parameters
    ----------
    motion : Motion
        Of the IMU.
    time : (n,) array [s]
    lever_arm_b : (3,) array [m]
        From the IMU to the point, in b.

    Returns
    -------
    r_e, v_e : (n, 3) arrays [m], [m/s]
        ``r + C_eb l`` and ``v + C_eb (w_eb_b x l)``: the rate is that against the Earth, as the velocity is.
    """
    state = motion.at(time)
    arm = np.asarray(lever_arm_b, dtype=float)
    C_eb = dcm_from_quat_batch(state.q_eb)
    return state.r_e + C_eb @ arm, state.v_e + np.einsum("kij,kj->ki", C_eb, np.cross(state.w_eb_b, arm))


def gnss_fixes(
    motion: Motion,
    rate: float,
    sd_position: ArrayLike,
    sd_velocity: ArrayLike | None,
    lever_arm_b: ArrayLike = (0.0, 0.0, 0.0),
    rng: np.random.Generator | None = None,
    offset: float = 0.0,
) -> GnssLog:
    """GNSS fixes with white errors, whose sigmas are honest.

    Parameters
    ----------
    motion : Motion
        Of the IMU.
    rate : float [Hz]
    sd_position : (3,) array [m]
        North, east, down; all > 0.
    sd_velocity : (3,) array [m/s] or None
        North, east, down, all > 0; None leaves the velocity out.
    lever_arm_b : (3,) array [m]
        IMU to antenna, in b.
    rng : numpy Generator or None
        None for fixes without errors (the sigmas are stated all the same).
    offset : float [s], >= 0
        First fix this long after the start of the motion, to put fixes between IMU samples.

    Returns
    -------
    GnssLog
        Velocity is resolved in north-east-down of the *reported* position, as a receiver does.

    Raises
    ------
    ConfigError
        For a rate or sigma that is not positive, or a negative offset.
    InputError
        When the motion is too short for one fix.
    """
    return fixes_of_antenna(*antenna_of_fixes(motion, rate, sd_position, sd_velocity, lever_arm_b, offset), rng)


def antenna_of_fixes(
    motion: Motion,
    rate: float,
    sd_position: ArrayLike,
    sd_velocity: ArrayLike | None,
    lever_arm_b: ArrayLike,
    offset: float = 0.0,
) -> tuple[Array, Array, Array, Array, Array | None]:
    """The part of :func:`gnss_fixes` that no draw changes, checked: times, positions and velocities of the antenna in
    e, and both deviations (3,).
    """
    sd_r = _positive("sd_position", sd_position)
    sd_v = None if sd_velocity is None else _positive("sd_velocity", sd_velocity)
    if not offset >= 0.0:
        raise ConfigError(f"the offset of the GNSS fixes must not be negative, not {offset!r}")
    time = sample_times(motion.start, motion.end, rate, offset)
    if time.size == 0:
        raise InputError(
            f"the motion ends at {motion.end:g} s, before the first GNSS fix at {motion.start + offset:g} s"
        )
    return time, *antenna_state(motion, time, lever_arm_b), sd_r, sd_v


def noisy_fixes(motion: Motion, like: GnssLog, lever_arm_b: ArrayLike, rng: np.random.Generator) -> GnssLog:
    """Fixes along a motion at the times and with the sigmas of another log, their errors white.

    Parameters
    ----------
    motion : Motion
        Of the IMU.
    like : GnssLog
        Within the time of the motion. A row without velocity stays without.
    lever_arm_b : (3,) array [m]
        IMU to antenna, in b.
    rng : numpy Generator

    Raises
    ------
    InputError
        For a fix outside the time of the motion.
    """
    log = fixes_of_antenna(
        like.time, *antenna_state(motion, like.time, lever_arm_b), like.sd_position, like.sd_velocity, rng
    )
    if log.velocity_n is not None and like.velocity_n is not None:
        log.velocity_n[np.isnan(like.velocity_n).any(axis=1)] = np.nan
    return log


def fixes_of_antenna(
    time: Array, r_e: Array, v_e: Array, sd_r: Array, sd_v: Array | None, rng: np.random.Generator | None
) -> GnssLog:
    """The part of :func:`gnss_fixes` that is drawn, for an antenna at `r_e` (n, 3) [m] with velocity `v_e` (n, 3)
    [m/s]; `sd_r` and `sd_v` are (3,) or (n, 3). No checks are made.
    """
    position_draws, velocity_draws = rng.spawn(2) if rng is not None else (None, None)
    if position_draws is not None:
        lat, lon, _ = ecef_to_geodetic_batch(r_e)
        r_e = r_e + _from_local(lat, lon, sd_r * position_draws.standard_normal((time.size, 3)))
    lat, lon, height = ecef_to_geodetic_batch(r_e)
    velocity_n = None
    if sd_v is not None:
        velocity_n = np.einsum("kji,kj->ki", _local_axes(lat, lon), v_e)
        if velocity_draws is not None:
            velocity_n = velocity_n + sd_v * velocity_draws.standard_normal((time.size, 3))
    each = (time.size, 3)
    return GnssLog(
        time,
        lat,
        lon,
        height,
        np.broadcast_to(sd_r, each).copy(),
        velocity_n,
        None if sd_v is None else np.broadcast_to(sd_v, each).copy(),
        source="simulation",
    )


def _positive(name: str, value: ArrayLike) -> Array:
    sd = np.broadcast_to(np.asarray(value, dtype=float), (3,)).copy()
    if not np.all(np.isfinite(sd)) or np.any(sd <= 0.0):
        raise ConfigError(f"{name} must be three finite numbers > 0, not {value!r}")
    return sd


def _local_axes(lat: Array, lon: Array) -> Array:
    """``C_en`` (n, 3, 3) of every place: columns north, east, down."""
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    zero = np.zeros_like(lat)
    rows = [
        [-sin_lat * cos_lon, -sin_lon, -cos_lat * cos_lon],
        [-sin_lat * sin_lon, cos_lon, -cos_lat * sin_lon],
        [cos_lat, zero, -sin_lat],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _from_local(lat: Array, lon: Array, v_n: Array) -> Array:
    return np.einsum("kij,kj->ki", _local_axes(lat, lon), v_n)
