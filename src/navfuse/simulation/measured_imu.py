"""What a real inertial sensor makes of a perfect log: every error of its model, each from its own stream of draws.

In this order, because the errors act on one another::

    true rate and force -> + vibration -> scale, cross-coupling, bias, white noise of the base model
        -> + asymmetry, g-sensitivity, instability, rate walk, temperature -> range -> rounding -> stamps -> losses
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from navfuse.data.logs import ImuLog
from navfuse.errors import ConfigError, InputError
from navfuse.simulation.bounds import require_rows
from navfuse.simulation.imu_error_kernels import (
    add_band_noise,
    add_gauss_markov,
    add_sinusoid,
    in_order,
    quantise_increments,
)
from navfuse.simulation.sensors import ImuErrorTruth, add_imu_errors, gauss_markov
from navfuse.simulation.streams import Streams

if TYPE_CHECKING:
    from navfuse.simulation.imu_errors import ImuSensorModel

Array = np.ndarray

_SHORTEST_STEP = 1e-6
_STREAMS: tuple[str, ...] = (
    "base", "gyro_instability", "accel_instability", "gyro_walk", "accel_walk", "gyro_asymmetry", "accel_asymmetry",
    "g_sensitivity", "gyro_temperature", "accel_temperature", "gyro_sinusoids", "accel_sinusoids", "gyro_band",
    "accel_band", "jitter", "losses", "dropouts",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class ImuSensorTruth:
    """What was added to a log, row by row of the measured log; read-only where constant or absent.

    Attributes
    ----------
    row : (n,) int array
        Row of the perfect log that each row came from; the missing ones were lost.
    true_time : (n,) array [s]
        When it was measured; the stamps are in ``states.time``.
    states : ImuErrorTruth
        Whole bias (constant, in-run, instability, rate walk, temperature), scale factors and cross-coupling: what a
        filter estimates.
    gyro_instability, accel_instability, gyro_walk, accel_walk : (n, 3) arrays [rad/s], [m/s^2]
        Parts of the bias.
    temperature : (n,) array [K]
        Above that of the first sample.
    gyro_temperature, accel_temperature : (3,) arrays [rad/s/K], [m/s^2/K]
    gyro_asymmetry, accel_asymmetry : (3,) arrays [1]
    g_sensitivity : (3, 3) array [rad/s per m/s^2]
        Row: gyro axis; column: axis of specific force.
    gyro_vibration, accel_vibration : (n, 3) arrays [rad/s], [m/s^2]
        At the stamps of rates, mean over the interval of increments. It reaches the sensor, not the trajectory.
    gyro_clipped, accel_clipped : (n, 3) bool arrays
        Where the range was exceeded.
    """

    row: Array
    true_time: Array
    states: ImuErrorTruth
    gyro_instability: Array
    accel_instability: Array
    gyro_walk: Array
    accel_walk: Array
    temperature: Array
    gyro_temperature: Array
    accel_temperature: Array
    gyro_asymmetry: Array
    accel_asymmetry: Array
    g_sensitivity: Array
    gyro_vibration: Array
    accel_vibration: Array
    gyro_clipped: Array
    accel_clipped: Array


def measure_imu(log: ImuLog, model: ImuSensorModel, rng: np.random.Generator) -> tuple[ImuLog, ImuSensorTruth]:
    """A log as a real sensor and its recorder would have written it.

    Parameters
    ----------
    log : ImuLog
        Perfect, rates or increments, any spacing.
    model : ImuSensorModel
    rng : numpy Generator
        Advanced only by spawning children, one per error, so that switching one error on leaves the draws of the others
        alone.

    Returns
    -------
    measured : ImuLog
    truth : ImuSensorTruth

    Raises
    ------
    ConfigError
        When the model gives steps of rounding for increments only and the log holds rates, or the other way round.
    InputError
        For a log of fewer than two rows, or if fewer than two survive the losses.
    """
    if log.time.size < 2:
        raise InputError(f"{log.source}: an IMU log needs at least two rows to be given errors, not {log.time.size}")
    lsb = {sensor: _lsb(model, sensor, log.kind) for sensor in ("gyro", "accel")}
    streams = Streams(rng, _STREAMS)
    dt = np.diff(log.time, prepend=log.time[0])
    dt[0] = dt[1]
    gain = (np.ones_like(dt) if log.kind == "rates" else dt)[:, None]
    drawn: dict[str, Array] = {}
    for sensor in ("gyro", "accel"):
        drawn[f"{sensor}_vibration"] = _vibration(log, dt, model, sensor, streams)
    shaken = {sensor: getattr(log, sensor) for sensor in ("gyro", "accel")}
    for sensor, values in shaken.items():
        if drawn[f"{sensor}_vibration"].strides[0]:
            shaken[sensor] = values + drawn[f"{sensor}_vibration"] * gain
    felt = ImuLog(log.time, shaken["gyro"], shaken["accel"], log.kind, log.source, log.notes)
    noisy, base = add_imu_errors(felt, model.base, streams["base"])
    drawn["temperature"] = _temperature(log.time - log.time[0], model)
    g_sensitivity = streams.normal("g_sensitivity", np.tile(model.axes("gyro_g_sensitivity_sd")[:, None], (1, 3)))
    if g_sensitivity.any():
        noisy.gyro[...] += felt.accel @ g_sensitivity.T
    biases, fixed = {}, {"g_sensitivity": g_sensitivity}
    for sensor in ("gyro", "accel"):
        out: Array = getattr(noisy, sensor)
        asymmetry = streams.normal(f"{sensor}_asymmetry", model.axes(f"{sensor}_scale_asymmetry_sd"))
        per_kelvin = streams.normal(f"{sensor}_temperature", model.axes(f"{sensor}_temperature_sd"))
        fixed |= {f"{sensor}_asymmetry": asymmetry, f"{sensor}_temperature": per_kelvin}
        if asymmetry.any():
            out += asymmetry * np.abs(getattr(felt, sensor))
        parts = [
            _flicker(dt, model, sensor, streams[f"{sensor}_instability"]),
            gauss_markov(log.time, 0.0, math.inf, model.axes(f"{sensor}_rate_walk"), streams[f"{sensor}_walk"]),
        ]
        drawn |= {f"{sensor}_instability": parts[0], f"{sensor}_walk": parts[1]}
        if per_kelvin.any() and drawn["temperature"].strides[0]:
            parts.append(drawn["temperature"][:, None] * per_kelvin)
        bias = getattr(base, f"{sensor}_bias")
        for part in parts:
            if part.strides[0]:
                out += part * gain
                bias = bias + part
        biases[sensor] = bias
        drawn[f"{sensor}_clipped"] = _clip(out, getattr(model, f"{sensor}_range"), lsb[sensor], gain, log.kind)
        _round(out, lsb[sensor], log.kind)
    stamps = log.time + model.stamp_latency
    if model.stamp_jitter_sd > 0.0:
        stamps += model.stamp_jitter_sd * streams["jitter"].standard_normal(stamps.size)
        in_order(_SHORTEST_STEP, stamps)
    row = _survivors(log, model, streams)
    scales = {f"{sensor}_scale": _rows(getattr(base, f"{sensor}_scale"), row) for sensor in ("gyro", "accel")}
    time = _rows(stamps, row)
    states = ImuErrorTruth(
        time,
        _rows(biases["gyro"], row),
        _rows(biases["accel"], row),
        gyro_cross=base.gyro_cross,
        accel_cross=base.accel_cross,
        **scales,
    )
    measured = ImuLog(time, _rows(noisy.gyro, row), _rows(noisy.accel, row), log.kind, log.source, log.notes)
    by_row = {name: _rows(values, row) for name, values in drawn.items()}
    return measured, ImuSensorTruth(row, _rows(log.time, row), states, **by_row, **fixed)


def flicker_taus(shortest: float, longest: float) -> tuple[Array, float]:
    """Correlation times, one per decade, whose Gauss-Markov processes add up to flicker noise, and their variance.

    Parameters
    ----------
    shortest, longest : float [s]
        At least a decade apart.

    Returns
    -------
    tau : (m,) array [s]
    variance : float
        Of each process, for a bias instability coefficient of 1.

    Notes
    -----
    The two-sided density of a process, ``2 s^2 tau / (1 + (2 pi f tau)^2)``, integrated over ln tau is ``s^2 / (2 f)``
    per unit of ln tau; flicker noise has ``B^2 / (2 pi f)`` (IEEE Std 952-1997, annex C), hence
    ``s^2 = B^2 ln(ratio) / pi`` for neighbours that stand in that ratio.
    """
    count = max(1, round(math.log10(longest / shortest)))
    ratio = (longest / shortest) ** (1.0 / count)
    return shortest * ratio ** np.arange(count + 1), math.log(ratio) / math.pi


def _flicker(dt: Array, model: ImuSensorModel, sensor: str, stream: np.random.Generator) -> Array:
    size = model.axes(f"{sensor}_bias_instability")
    if not size.any():
        return np.broadcast_to(np.zeros(3), (dt.size, 3))
    taus, variance = flicker_taus(*model.axes("bias_instability_tau"))
    out = np.zeros((dt.size, 3))
    normals = np.empty((dt.size, 3))
    for tau, draws in zip(taus, stream.spawn(taus.size), strict=True):
        draws.standard_normal(out=normals)
        add_gauss_markov(dt, tau, math.sqrt(variance) * size, normals, out)
    return out


def _temperature(since: Array, model: ImuSensorModel) -> Array:
    if model.temperature_ramp == 0.0 and model.warm_up == 0.0:
        return np.broadcast_to(0.0, since.shape)
    warm = -model.warm_up * np.expm1(-since / model.warm_up_tau) if model.warm_up else 0.0
    return model.temperature_ramp * since + warm


def _vibration(log: ImuLog, dt: Array, model: ImuSensorModel, sensor: str, streams: Streams) -> Array:
    amplitudes, noise = model.axes(f"{sensor}_vibration"), model.axes(f"{sensor}_vibration_noise")
    if not amplitudes.any() and not noise.any():
        return np.broadcast_to(np.zeros(3), (dt.size, 3))
    out, mean = np.zeros((dt.size, 3)), log.kind == "increments"
    phases = streams[f"{sensor}_sinusoids"].uniform(0.0, 2.0 * math.pi, amplitudes.shape)
    for frequency, amplitude, phase in zip(model.axes("vibration_frequency"), amplitudes, phases, strict=True):
        if amplitude.any():
            add_sinusoid(log.time, dt, mean, frequency, amplitude, phase, out)
    if noise.any():
        normals = streams[f"{sensor}_band"].standard_normal((dt.size + 1, 3, 3))
        centre, width = model.vibration_noise_frequency, model.vibration_noise_width
        add_band_noise(dt, mean, centre, width, noise, normals, out)
    return out


def _lsb(model: ImuSensorModel, sensor: str, kind: str) -> float:
    of_rates, of_increments = ("rate", "angle") if sensor == "gyro" else ("force", "velocity")
    used, other = (of_rates, of_increments) if kind == "rates" else (of_increments, of_rates)
    lsb = getattr(model, f"{sensor}_{used}_lsb")
    if lsb == 0.0 and getattr(model, f"{sensor}_{other}_lsb") > 0.0:
        raise ConfigError(f"the log holds {kind}: give {sensor}_{used}_lsb, not {sensor}_{other}_lsb alone")
    return lsb


def _clip(out: Array, limit: float, lsb: float, gain: Array, kind: str) -> Array:
    if not math.isfinite(limit):
        return np.broadcast_to(False, out.shape)
    if kind == "rates" and lsb > 0.0:
        limit = lsb * math.floor(limit / lsb * (1.0 + 1e-12))
    bound = limit * gain
    clipped = np.abs(out) > bound
    np.clip(out, -bound, bound, out=out)
    return clipped


def _round(out: Array, lsb: float, kind: str) -> None:
    if lsb > 0.0 and kind == "rates":
        np.rint(out / lsb, out=out)
        out *= lsb
    elif lsb > 0.0:
        quantise_increments(lsb, out)


def _survivors(log: ImuLog, model: ImuSensorModel, streams: Streams) -> Array:
    """Rows that are not lost, the first one always among them."""
    kept = np.ones(log.time.size, dtype=bool)
    if model.dropped_fraction > 0.0:
        kept &= streams["losses"].uniform(size=kept.size) >= model.dropped_fraction
    if model.dropout_frequency > 0.0:
        span = log.time[-1] - log.time[0]
        require_rows(model.dropout_frequency * span, f"{3600.0 * model.dropout_frequency:g} dropouts per hour")
        count = streams["dropouts"].poisson(model.dropout_frequency * span)
        for begin in np.sort(streams["dropouts"].uniform(log.time[0], log.time[-1], count)):
            kept[np.searchsorted(log.time, begin) : np.searchsorted(log.time, begin + model.dropout_length)] = False
    kept[0] = True
    row = np.flatnonzero(kept)
    if row.size < 2:
        raise InputError(f"{log.source}: of {kept.size} rows, only one survives the losses of the sensor model")
    return row


def _rows(values: Array, row: Array) -> Array:
    """Picked rows; all of them without a copy, constants as a view."""
    if row.size == values.shape[0]:
        return values
    if values.strides[0] == 0:
        return np.broadcast_to(values[0], (row.size, *values.shape[1:]))
    return values.take(row, axis=0)
