"""Pseudo-ranges and range rates along a motion, every error of the model from its own stream of draws."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from navfuse.core.constants import TWO_PI
from navfuse.core.earth import ecef_to_geodetic_batch
from navfuse.data.raw_gnss import RawGnssLog
from navfuse.data.trajectory import wrapped
from navfuse.errors import InputError
from navfuse.gnss.atmosphere import ionosphere_obliquity, saastamoinen_zenith, troposphere_mapping
from navfuse.gnss.ranging import arriving_signals
from navfuse.simulation.bounds import require_rows
from navfuse.simulation.perfect_imu import sample_times
from navfuse.simulation.sensors import _local_axes, antenna_state, gauss_markov
from navfuse.simulation.sky import within
from navfuse.simulation.streams import Streams

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from navfuse.simulation.motion import Motion
    from navfuse.simulation.raw_gnss_errors import RawGnssModel

Array = np.ndarray

_STREAMS: tuple[str, ...] = (
    "clock_phase", "clock_frequency", "signal", "ionosphere", "troposphere", "code", "multipath", "outlier_times",
    "outlier_sizes", "range_rate", "cn0",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class RawGnssTruth:
    """What a raw GNSS log is made of.

    ``pseudorange = rho + clock_offset + signal + ionosphere + troposphere + code_noise + multipath + outlier`` and
    ``range_rate = rate + clock_drift + range_rate_noise``, the clock being that of the row's epoch.

    Attributes
    ----------
    epoch_time : (m,) array [s]
        When each epoch was measured, those that left no row included; stamps are later by the latency.
    clock_offset, clock_drift : (m,) arrays [m], [m/s]
    antenna_r_e, antenna_v_e : (m, 3) arrays [m], [m/s]
    epoch : (n,) int array
        Epoch of each row of the log.
    rho, rate : (n,) arrays [m], [m/s]
        Geometric range and its derivative.
    signal, ionosphere, troposphere, code_noise, multipath, outlier : (n,) arrays [m]
        The delays of the atmosphere are whole where the log is not corrected, residuals where it is.
    range_rate_noise : (n,) array [m/s]
    """

    epoch_time: Array
    clock_offset: Array
    clock_drift: Array
    antenna_r_e: Array
    antenna_v_e: Array
    epoch: Array
    rho: Array
    rate: Array
    signal: Array
    ionosphere: Array
    troposphere: Array
    code_noise: Array
    multipath: Array
    outlier: Array
    range_rate_noise: Array


def measure_raw_gnss(
    motion: Motion, model: RawGnssModel, rng: np.random.Generator, lever_arm_b: ArrayLike = (0.0, 0.0, 0.0)
) -> tuple[RawGnssLog, RawGnssTruth]:
    """Pseudo-ranges and range rates as a real receiver would have written them.

    Parameters
    ----------
    motion : Motion
        Of the IMU.
    model : RawGnssModel
    rng : numpy Generator
        Advanced only by spawning children, one per error. Draws are made for every satellite at every epoch, seen or
        not, so that neither another error nor another sky changes them.
    lever_arm_b : (3,) array [m]
        IMU to antenna, body forward-right-down.

    Returns
    -------
    log : RawGnssLog
        Rows by time, within an epoch in the order of the constellation.
    truth : RawGnssTruth

    Raises
    ------
    InputError
        When the motion is too short for one epoch, or nothing is left of the sky: the message says what hides it.
    """
    time = sample_times(motion.start, motion.end, model.rate, model.offset)
    if time.size == 0:
        raise InputError(
            f"the motion ends at {motion.end:g} s, before the first GNSS epoch at {motion.start + model.offset:g} s"
        )
    streams = Streams(rng, _STREAMS)
    r_e, v_e = antenna_state(motion, time, lever_arm_b)
    lat, lon, height = ecef_to_geodetic_batch(r_e)
    signals = arriving_signals(model.constellation, time + model.constellation_start, r_e, v_e)
    sat_r_e, sat_v_e, rho, rate, u_e = signals
    u_n = np.einsum("kji,kmj->kmi", _local_axes(lat, lon), u_e)
    elevation = np.arcsin(np.clip(-u_n[:, :, 2], -1.0, 1.0))
    azimuth = wrapped(np.arctan2(u_n[:, :, 1], u_n[:, :, 0]), TWO_PI)
    nose_n = np.einsum("kji,kj->ki", _local_axes(lat, lon), motion.C_eb(time)[:, :, 0])
    seen = _visible(model, time, elevation, azimuth, np.arctan2(nose_n[:, 1], nose_n[:, 0]))
    k, j = np.nonzero(seen)
    el = elevation[k, j]

    clock_offset, clock_drift = _clock(time, model, streams["clock_phase"], streams["clock_frequency"])
    satellites = len(model.constellation)

    def slow(name: str, count: int) -> Array:
        sd, tau = getattr(model, f"{name}_sd"), getattr(model, f"{name}_tau")
        return gauss_markov(time, sd, tau, 0.0, streams[name], count)

    def white(name: str) -> Array:
        return streams[name].standard_normal((time.size, satellites))[k, j]

    obliquity, mapping, weight = ionosphere_obliquity(el), troposphere_mapping(el), 1.0 / np.sin(el)
    sd_code = np.hypot(model.code_sd, model.code_elevation_sd * weight)
    sd_rate = np.hypot(model.range_rate_sd, model.range_rate_elevation_sd * weight)
    whole = 0.0 if model.corrected else sum(saastamoinen_zenith(lat, height))
    truth = RawGnssTruth(
        epoch_time=time,
        clock_offset=clock_offset,
        clock_drift=clock_drift,
        antenna_r_e=r_e,
        antenna_v_e=v_e,
        epoch=k,
        rho=rho[k, j],
        rate=rate[k, j],
        signal=slow("signal", satellites)[k, j],
        ionosphere=(slow("ionosphere", 1)[k, 0] + model.ionosphere_zenith) * obliquity,
        troposphere=(slow("troposphere", 1)[:, 0] + whole)[k] * mapping,
        code_noise=sd_code * white("code"),
        multipath=slow("multipath", satellites)[k, j],
        outlier=_outliers(time.size, satellites, model, streams["outlier_times"], streams["outlier_sizes"])[k, j],
        range_rate_noise=sd_rate * white("range_rate"),
    )
    delays = truth.signal + truth.ionosphere + truth.troposphere + truth.code_noise + truth.multipath + truth.outlier
    variance = model.signal_sd**2 + model.multipath_sd**2 + sd_code**2
    variance += (model.ionosphere_sd * obliquity) ** 2 + (model.troposphere_sd * mapping) ** 2
    cn0 = model.cn0_horizon + (model.cn0_zenith - model.cn0_horizon) * np.sin(el) + model.cn0_sd * white("cn0")
    log = RawGnssLog(
        time=time[k] + model.latency,
        satellite=np.array(model.constellation.satellites)[j],
        pseudorange=truth.rho + clock_offset[k] + delays,
        sd_pseudorange=np.maximum(model.stated_sigma_factor * np.sqrt(variance), model.stated_least_range),
        sat_r_e=sat_r_e[k, j],
        range_rate=truth.rate + clock_drift[k] + truth.range_rate_noise,
        sd_range_rate=np.maximum(model.stated_sigma_factor * sd_rate, model.stated_least_rate),
        sat_v_e=sat_v_e[k, j],
        elevation=el,
        azimuth=azimuth[k, j],
        cn0=cn0,
        corrected=model.corrected,
        source="simulation",
    )
    return log, truth


def _visible(model: RawGnssModel, time: Array, elevation: Array, azimuth: Array, heading: Array) -> Array:
    """(n, m) mask of the satellites received; says what hides all of them."""
    seen = (elevation >= model.elevation_mask) & (elevation > 0.0)
    count = f"all {time.size} epochs" if time.size > 1 else "the only epoch"
    if not seen.any():
        raise InputError(
            f"no satellite stands above the elevation mask of {math.degrees(model.elevation_mask):g} deg at {count}: "
            "lower the mask, or take more satellites"
        )
    for sector in model.sectors:
        seen &= ~sector.hides(time, elevation, azimuth, heading)
    if not seen.any():
        raise InputError(
            f"the sky sectors hide every satellite at {count}, so that no measurement is left: make one narrower or "
            "lower, or give it windows in time"
        )
    seen &= ~within(time, np.asarray(model.outages))[:, None]
    for outage in model.satellite_outages:
        row = model.constellation.index(outage.satellite)
        seen[:, row] &= ~((time >= outage.from_s) & (time < outage.to_s))
    if not seen.any():
        raise InputError(f"the outages hide every satellite that the sky leaves at {count}: shorten them")
    return seen


def _clock(
    time: Array, model: RawGnssModel, phase: np.random.Generator, frequency: np.random.Generator
) -> tuple[Array, Array]:
    """Offset and drift by the exact discrete form of the two-state model (Brown and Hwang, 1997, section 10.3)."""
    dt = np.diff(time)
    jump = math.sqrt(model.clock_frequency_psd) * np.sqrt(dt) * frequency.standard_normal(dt.size)
    walk = math.sqrt(model.clock_phase_psd) * np.sqrt(dt) * phase.standard_normal(dt.size)
    bend = math.sqrt(model.clock_frequency_psd / 12.0) * dt**1.5 * frequency.standard_normal(dt.size)
    drift = model.clock_drift + np.concatenate([[0.0], np.cumsum(jump)])
    steps = (drift[:-1] + 0.5 * jump) * dt + bend + walk
    return model.clock_offset + np.concatenate([[0.0], np.cumsum(steps)]), drift


def _outliers(
    epochs: int, satellites: int, model: RawGnssModel, when: np.random.Generator, size: np.random.Generator
) -> Array:
    """(n, m) outliers [m]; each row is one with the stated chance, however long they last."""
    require_rows(model.outlier_length * model.rate, f"outliers of {model.outlier_length:g} s")
    length = max(1, round(model.outlier_length * model.rate))
    begins = when.random((epochs + length - 1, satellites)) < -np.expm1(np.log1p(-model.outlier_share) / length)
    sizes = size.uniform(model.outlier_from, model.outlier_to, begins.shape)
    rows = np.arange(begins.shape[0])[:, None]
    last = np.maximum.accumulate(np.where(begins, rows, -length), axis=0)
    within_one = rows - last < length
    return np.where(within_one, np.take_along_axis(sizes, np.maximum(last, 0), axis=0), 0.0)[length - 1 :]
