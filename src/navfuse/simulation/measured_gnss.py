"""What a real GNSS receiver reports along a motion: every error of its model, each from its own stream of draws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from navfuse.core.earth import ecef_to_geodetic_batch
from navfuse.data.logs import GnssLog
from navfuse.errors import InputError
from navfuse.simulation.bounds import require_rows
from navfuse.simulation.perfect_imu import sample_times
from navfuse.simulation.sampled_sensor import random_boxes
from navfuse.simulation.sensors import _from_local, _local_axes, antenna_state, gauss_markov
from navfuse.simulation.streams import Streams

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from navfuse.simulation.gnss_errors import GnssReceiverModel
    from navfuse.simulation.motion import Motion

Array = np.ndarray

_STREAMS: tuple[str, ...] = (
    "position", "position_correlated", "velocity", "velocity_correlated", "fix", "multipath_times", "multipath",
    "outages",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class GnssTruth:
    """What was added to the fixes of a log, row by row; north, east, down.

    Attributes
    ----------
    true_time : (n,) array [s]
        When each fix was measured; its stamp is later by the latency.
    position_white, position_correlated, multipath, drift : (n, 3) arrays [m]
        Parts of the error of position, which is their sum.
    velocity_white, velocity_correlated : (n, 3) arrays [m/s]
        Parts of the error of velocity; the velocity of the drift adds to them. Zero if the log has no velocity.
    sd_factor : (n,) array
        Of the type of each fix.
    """

    true_time: Array
    position_white: Array
    position_correlated: Array
    multipath: Array
    drift: Array
    velocity_white: Array
    velocity_correlated: Array
    sd_factor: Array


def measuring_times(motion: Motion, model: GnssReceiverModel) -> Array:
    """When a receiver measures along a motion, outages not yet taken out, (n,) [s], n >= 1.

    Raises
    ------
    InputError
        When the motion is too short for one fix.
    """
    time = sample_times(motion.start, motion.end, model.rate, model.offset)
    if time.size == 0:
        raise InputError(
            f"the motion ends at {motion.end:g} s, before the first GNSS fix at {motion.start + model.offset:g} s"
        )
    return time


def measure_gnss(
    motion: Motion,
    model: GnssReceiverModel,
    rng: np.random.Generator,
    lever_arm_b: ArrayLike = (0.0, 0.0, 0.0),
    antenna: tuple[Array, Array] | None = None,
) -> tuple[GnssLog, GnssTruth]:
    """Fixes as a real receiver would have written them.

    Parameters
    ----------
    motion : Motion
        Of the IMU.
    model : GnssReceiverModel
    rng : numpy Generator
        Advanced only by spawning children, one per error, so that switching one error on leaves the draws of the others
        alone.
    lever_arm_b : (3,) array [m]
        IMU to antenna, body forward-right-down.
    antenna : (r_e, v_e), optional
        Position and velocity (n, 3) of the antenna at all :func:`measuring_times`, if they are known already.

    Returns
    -------
    log : GnssLog
        Velocity is resolved in north-east-down of the *reported* position, as a receiver does.
    truth : GnssTruth

    Raises
    ------
    InputError
        When the motion is too short for one fix, or outages hide all of them.

    Notes
    -----
    Errors of position are laid off in the tangent plane of the true place: one of 1 km raises the height by 8 cm.
    """
    time = measuring_times(motion, model)
    r_e, v_e = antenna_state(motion, time, lever_arm_b) if antenna is None else antenna
    streams = Streams(rng, _STREAMS)
    kind = _fix_types(time, model, streams["fix"])
    factor = np.array([entry.sd_factor for entry in model.fix_types])[kind] if model.fix_types else np.ones(time.size)
    errors = {}
    for name in ("position", "velocity"):
        errors[f"{name}_white"] = streams[name].standard_normal((time.size, 3))
        errors[f"{name}_white"] *= model.axes(f"{name}_sd") * factor[:, None]
        tau = getattr(model, f"{name}_correlated_tau")
        path = gauss_markov(time, model.axes(f"{name}_correlated_sd"), tau, 0.0, streams[f"{name}_correlated"])
        errors[f"{name}_correlated"] = path * factor[:, None]
    errors["multipath"] = random_boxes(
        time, model.multipath_frequency, model.multipath_mean, model.axes("multipath_sd"), streams["multipath_times"],
        streams["multipath"],
    )  # fmt: skip
    pulled = np.clip(time, model.drift_from, model.drift_to) - model.drift_from
    errors["drift"] = pulled[:, None] * model.axes("drift_velocity")
    kept = _outside_outages(time, model, streams["outages"])
    if not kept.any():
        raise InputError(f"the outages hide all {time.size} GNSS fixes of the motion")
    time, kind, factor = time[kept], kind[kept], factor[kept]
    errors = {name: values[kept] for name, values in errors.items()}
    r_e, v_e = r_e[kept], v_e[kept]
    lat, lon, _ = ecef_to_geodetic_batch(r_e)
    error_n = errors["position_white"] + errors["position_correlated"] + errors["multipath"] + errors["drift"]
    lat, lon, height = ecef_to_geodetic_batch(r_e + _from_local(lat, lon, error_n))
    sd_position = model.stated_sigma_factor * model.total_sd("position") * factor[:, None]
    velocity_n = sd_velocity = None
    if model.total_sd("velocity").any():
        pulling = (time >= model.drift_from) & (time < model.drift_to)
        velocity_n = np.einsum("kji,kj->ki", _local_axes(lat, lon), v_e)
        velocity_n += errors["velocity_white"] + errors["velocity_correlated"]
        velocity_n += pulling[:, None] * model.axes("drift_velocity")
        sd_velocity = model.stated_sigma_factor * model.total_sd("velocity") * factor[:, None]
    log = GnssLog(
        time + model.latency,
        lat,
        lon,
        height,
        sd_position,
        velocity_n,
        sd_velocity,
        np.array([entry.name for entry in model.fix_types])[kind] if model.fix_types else None,
        source="simulation",
    )
    return log, GnssTruth(time, sd_factor=factor, **errors)


def _fix_types(time: Array, model: GnssReceiverModel, stream: np.random.Generator) -> Array:
    """Index into the fix types for every fix."""
    kind = np.zeros(time.size, dtype=np.int64)
    now, current = float(time[0]), 0
    while len(model.fix_types) > 1 and now <= time[-1]:
        stay = model.fix_types[current].mean_s * stream.standard_exponential()
        kind[np.searchsorted(time, now) :] = current
        now += stay
        current = (current + int(stream.integers(1, len(model.fix_types)))) % len(model.fix_types)
    return kind


def _outside_outages(time: Array, model: GnssReceiverModel, stream: np.random.Generator) -> Array:
    require_rows(model.outage_frequency * (time[-1] - time[0]), f"{3600.0 * model.outage_frequency:g} outages per hour")
    count = stream.poisson(model.outage_frequency * (time[-1] - time[0])) if model.outage_frequency else 0
    begin = stream.uniform(time[0], time[-1], count)
    windows = np.vstack([model.axes("outages"), np.column_stack([begin, begin + model.outage_length])])
    kept = np.ones(time.size, dtype=bool)
    for begin, end in windows:
        kept[np.searchsorted(time, begin) : np.searchsorted(time, end)] = False
    return kept
