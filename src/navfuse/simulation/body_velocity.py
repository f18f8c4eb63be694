"""Velocity in body axes: Doppler radar of one or two axes, and Doppler velocity log of three axes or four beams."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from navfuse.core.printed_keys import shown
from navfuse.core.rotation import dcm_from_rotvec
from navfuse.data.aiding_logs import BodyVelocityLog
from navfuse.errors import ConfigError, InputError
from navfuse.simulation.printed_fields import (
    any_number,
    one_number,
    one_or_several,
    three_numbers,
    three_sizes,
    windows,
)
from navfuse.simulation.sampled_sensor import (
    SAMPLING_UNITS,
    SampledSensor,
    boxes,
    level_to_body,
    point_velocity_b,
    rounded,
)
from navfuse.simulation.streams import Streams

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from navfuse.simulation.motion import Motion

Array = np.ndarray

_DEGREE = np.pi / 180.0
_AXES = ("x", "xy", "xyz")
_BEAMS = 4
_FEWEST_BEAMS = 3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BodyVelocityModel(SampledSensor):
    """Errors of a sensor of velocity in body axes, SI units; zero means absent.

    Fields marked *axes* take a number or three: sensor x, y, z, which are nearly those of the body.

    Attributes
    ----------
    rate, offset, latency : see :class:`~navfuse.simulation.sampled_sensor.SampledSensor`.
    axes : {"x", "xy", "xyz"}
        What is measured: forward speed, or forward and right, or all three.
    lever_arm : (3,) array [m]
        IMU to the sensor, body forward-right-down.
    current : (3,) array [m/s]
        Velocity of the water against the ground, north, east, down, for a log that tracks the water: the velocity is
        then that against it.
    scale, scale_sd : axes [1]
        Given part of the scale error, and standard deviation of the part drawn once per run. Typical: 0.1 to 1 % of
        Doppler velocity logs (long-term accuracy of the two versions of the Water Linked A50).
    misalignment, misalignment_sd : (3,) array [rad], axes [rad]
        Rotation vector from sensor to body axes, and standard deviation of what is drawn on each of its components.
        Typical: 0.5 deg (our estimate).
    velocity_sd : axes [m/s]
        White noise, without beams. Typical: 0.01 m/s of a Doppler velocity log, 0.05 m/s of a ground radar (our
        estimate).
    velocity_lsb : float [m/s]
        Step of rounding. Typical: 0.001 m/s, one millimetre per second (our estimate).
    beam_angle, beam_azimuth : float [rad]
        Angle of four beams from the z axis (0: not by beams), and of the first one from x towards y; the others follow
        at right angles. Typical: 30 and 45 deg (Teledyne RD Instruments, Workhorse Navigator).
    beam_sd : float [m/s]
        White noise along each beam.
    beam_dropped : float [1]
        Chance that a beam finds no echo. Three give a velocity still, two do not.
    dropped : float [1]
        Chance that a row is lost.
    outages : (m, 2) array [s]
        Windows [from, to) of motion time without rows.
    stated_sigma_factor : float
        Stated sigma over the true one of noise and rounding together; 0 leaves the columns out.

    Raises
    ------
    ConfigError
        On construction, for a value that is negative, not finite or of the wrong shape, or one that lacks another.
    """

    WHAT: ClassVar[str] = "body velocity"
    UNITS: ClassVar[dict[str, tuple[str, float]]] = SAMPLING_UNITS | {
        "lever_arm_m": ("lever_arm", 1.0),
        "current_mps": ("current", 1.0),
        "scale_percent": ("scale", 1e-2),
        "scale_sd_percent": ("scale_sd", 1e-2),
        "misalignment_deg": ("misalignment", _DEGREE),
        "misalignment_sd_deg": ("misalignment_sd", _DEGREE),
        "velocity_sd_mps": ("velocity_sd", 1.0),
        "velocity_sd_mmps": ("velocity_sd", 1e-3),
        "velocity_lsb_mps": ("velocity_lsb", 1.0),
        "velocity_lsb_mmps": ("velocity_lsb", 1e-3),
        "beam_angle_deg": ("beam_angle", _DEGREE),
        "beam_azimuth_deg": ("beam_azimuth", _DEGREE),
        "beam_sd_mps": ("beam_sd", 1.0),
        "beam_sd_mmps": ("beam_sd", 1e-3),
        "beam_dropped_percent": ("beam_dropped", 1e-2),
        "dropped_percent": ("dropped", 1e-2),
        "outages_s": ("outages", 1.0),
        "stated_sigma_factor": ("stated_sigma_factor", 1.0),
    }
    WORDS: ClassVar[tuple[str, ...]] = ("axes",)

    rate: float = 5.0
    axes: str = "xyz"
    lever_arm: ArrayLike = (0.0, 0.0, 0.0)
    current: ArrayLike = (0.0, 0.0, 0.0)
    scale: ArrayLike = 0.0
    scale_sd: ArrayLike = 0.0
    misalignment: ArrayLike = (0.0, 0.0, 0.0)
    misalignment_sd: ArrayLike = 0.0
    velocity_sd: ArrayLike = 0.0
    velocity_lsb: float = 0.0
    beam_angle: float = 0.0
    beam_azimuth: float = np.pi / 4.0
    beam_sd: float = 0.0
    beam_dropped: float = 0.0
    dropped: float = 0.0
    outages: ArrayLike = ()
    stated_sigma_factor: float = 1.0

    def __post_init__(self) -> None:
        self._settle(**dict.fromkeys(("lever_arm", "current", "misalignment"), three_numbers), outages=windows)
        self._settle(**dict.fromkeys(("scale_sd", "misalignment_sd", "velocity_sd"), three_sizes))
        sizes = ("velocity_lsb", "beam_angle", "beam_sd", "beam_dropped", "dropped", "stated_sigma_factor")
        self._settle(
            **dict.fromkeys(sizes, one_number),
            scale=partial(one_or_several, count=3, what="axes"),
            beam_azimuth=any_number,
        )
        if self.axes not in _AXES:
            raise ConfigError(f"axes must be one of {', '.join(_AXES)}, not {shown(self.axes)}")
        for name in ("beam_dropped", "dropped"):
            if getattr(self, name) >= 1.0:
                raise ConfigError(f"{name} must be a chance below 1 (100 %), not {getattr(self, name):g}")
        if self.beam_angle == 0.0 and (self.beam_sd > 0.0 or self.beam_dropped > 0.0):
            raise ConfigError("beam_sd and beam_dropped need beam_angle > 0")
        if self.beam_angle >= np.pi / 2.0:
            raise ConfigError(f"beam_angle must be below 90 deg, not {math.degrees(self.beam_angle):g} deg")
        if self.beam_angle > 0.0 and (self.axes != "xyz" or np.any(self.velocity_sd)):
            raise ConfigError(
                "four beams give all three axes: with beam_angle leave axes at 'xyz', and give beam_sd, not velocity_sd"
            )

    @property
    def beams_b(self) -> Array:
        """Unit vectors of the four beams, (4, 3), forward-right-down."""
        azimuth = self.beam_azimuth + 0.5 * np.pi * np.arange(_BEAMS)
        sine = math.sin(self.beam_angle)
        down = np.full(_BEAMS, math.cos(self.beam_angle))
        return np.column_stack([sine * np.cos(azimuth), sine * np.sin(azimuth), down])


@dataclass(frozen=True, slots=True, eq=False)
class BodyVelocityTruth:
    """What was added: before rounding, the log is ``(1 + scale) C_sb velocity + noise`` on the measured axes.

    Attributes
    ----------
    true_time : (n,) array [s]
        When each row was measured; its stamp is later by the latency.
    velocity_b : (n, 3) array [m/s]
        Of the sensor against ground or water, in body axes.
    scale : (3,) array [1]
    misalignment : (3,) array [rad]
        Rotation vector from sensor (s) to body axes.
    noise : (n, 3) array [m/s]
        With beams, what their noise makes of the velocity.
    beams : (n, 4) bool array
        Which found an echo; all True without beams.
    """

    true_time: Array
    velocity_b: Array
    scale: Array
    misalignment: Array
    noise: Array
    beams: Array


def measure_body_velocity(
    motion: Motion, model: BodyVelocityModel, rng: np.random.Generator
) -> tuple[BodyVelocityLog, BodyVelocityTruth]:
    """Velocities in body axes as a real sensor would have written them.

    Parameters
    ----------
    motion : Motion
        Of the IMU.
    model : BodyVelocityModel
    rng : numpy Generator
        Advanced only by spawning children, one per error.

    Returns
    -------
    log : BodyVelocityLog
        NaN on axes that are not measured. Times at which nothing is measured (lost rows, outages, fewer than three
        beams) have no row.
    truth : BodyVelocityTruth

    Raises
    ------
    InputError
        When the motion ends before the first sample, or no row survives.
    """
    draws = Streams(rng, ("scale", "misalignment", "noise", "beam_noise", "beam_dropped", "dropped"))
    time = model.sample_times(motion)
    scale = model.values("scale") + model.values("scale_sd") * draws["scale"].standard_normal(3)
    rotation = model.values("misalignment") + model.values("misalignment_sd") * draws["misalignment"].standard_normal(3)
    velocity_b = point_velocity_b(motion, time, model.lever_arm) - level_to_body(motion, time, model.current)
    beams = draws["beam_dropped"].uniform(size=(time.size, _BEAMS)) >= model.beam_dropped
    if model.beam_angle > 0.0:
        along = model.beam_sd * draws["beam_noise"].standard_normal((time.size, _BEAMS))
        noise, sd = _from_beams(along, beams, model)
    else:
        noise = model.values("velocity_sd") * draws["noise"].standard_normal((time.size, 3))
        sd = np.broadcast_to(model.values("velocity_sd"), noise.shape)
    kept = draws["dropped"].uniform(size=time.size) >= model.dropped
    hidden = boxes(time, model.values("outages"), np.ones((len(model.values("outages")), 1)))[:, 0]
    kept &= (hidden == 0.0) & np.isfinite(noise).all(axis=1)
    if not kept.any():
        raise InputError(f"none of the {time.size} rows of the {model.WHAT} survives outages and losses")
    time, velocity_b, noise, beams, sd = time[kept], velocity_b[kept], noise[kept], beams[kept], sd[kept]
    C_bs = np.reshape(dcm_from_rotvec(rotation), (3, 3))
    measured = rounded((1.0 + scale) * (velocity_b @ C_bs) + noise, model.velocity_lsb)
    measured[:, len(model.axes) :] = np.nan
    sd = np.where(np.isfinite(measured), model.stated_sigma_factor * np.hypot(sd, model.velocity_lsb / 12**0.5), np.nan)
    log = BodyVelocityLog(time + model.latency, measured, None if np.any(sd == 0.0) else sd, source="simulation")
    return log, BodyVelocityTruth(time, velocity_b, scale, rotation, noise, beams)


def _from_beams(along: Array, valid: Array, model: BodyVelocityModel) -> tuple[Array, Array]:
    """Errors of the velocity, and their deviations, from those along the beams by least squares; NaN below three."""
    noise, sd = np.full((along.shape[0], 3), np.nan), np.full((along.shape[0], 3), np.nan)
    pattern = valid @ (1 << np.arange(_BEAMS))
    for code in np.unique(pattern):
        used = (code >> np.arange(_BEAMS) & 1).astype(bool)
        if np.count_nonzero(used) < _FEWEST_BEAMS:
            continue
        rows = pattern == code
        solve = np.linalg.pinv(model.beams_b[used])
        noise[rows] = along[np.ix_(rows, used)] @ solve.T
        sd[rows] = model.beam_sd * np.sqrt(np.einsum("ij,ij->i", solve, solve))
    return noise, sd
