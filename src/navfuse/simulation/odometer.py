"""A speed sensor on the drive train, with the errors of real ones: scale, slip, noise, pulses, latency."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from navfuse.data.aiding_logs import OdometerLog
from navfuse.errors import ConfigError
from navfuse.simulation.printed_fields import (
    any_number,
    numbers,
    one_number,
    one_or_several,
    three_numbers,
    windows,
    yes_or_no,
)
from navfuse.simulation.sampled_sensor import (
    SAMPLING_UNITS,
    SampledSensor,
    boxes,
    interval_means,
    need_each_other,
    point_velocity_b,
    random_boxes,
    rounded,
    stated_sd,
)
from navfuse.simulation.streams import Streams

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from navfuse.simulation.motion import Motion

Array = np.ndarray


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class OdometerModel(SampledSensor):
    """Errors of an odometer or other speed sensor along the forward axis, SI units; zero means absent.

    Attributes
    ----------
    rate, offset, latency : see :class:`~navfuse.simulation.sampled_sensor.SampledSensor`.
    lever_arm : (3,) array [m]
        IMU to the point whose forward speed is measured (middle of the rear axle), body forward-right-down.
    averaged : bool
        Whether a row is the mean over the interval 1/rate before it (pulses counted) instead of the speed at its time.
    scale, scale_sd : float [1]
        Given part of the scale error, and standard deviation of the part drawn once per run. Typical: 1 to 3 % from
        wear, pressure and load of the tyres (3 % in the coursework of UCL COMP0130).
    speed_sd : float [m/s]
        White noise. Typical: 0.05 m/s (UCL COMP0130).
    speed_lsb : float [m/s]
        Step of rounding. Typical: 0.02 m/s (UCL COMP0130).
    pulses_per_metre : float [1/m]
        Counter of pulses instead: whole pulses are counted, the rest is carried on; needs `averaged`. Typical: 25, that
        is 48 teeth on a wheel of 1.9 m circumference (our estimate).
    slips, slip : (m, 2) array [s], number or (m,) array [1]
        Windows [from, to) of motion time in which the wheels slip, and how much more they turn than they roll (negative
        when braking; -1 is a locked wheel).
    slip_frequency, slip_mean, slip_sd : float [1/s], [s], [1]
        Random slip besides: mean number per time (Poisson), mean length (exponential), standard deviation.
    stated_sigma_factor : float
        Stated sigma over the true one of noise and rounding together; 0 leaves the column out. Scale and slip are not
        in it.

    Raises
    ------
    ConfigError
        On construction, for a value that is negative, not finite or of the wrong shape, or one that lacks another.
    """

    WHAT: ClassVar[str] = "odometer"
    UNITS: ClassVar[dict[str, tuple[str, float]]] = SAMPLING_UNITS | {
        "lever_arm_m": ("lever_arm", 1.0),
        "scale_percent": ("scale", 1e-2),
        "scale_ppm": ("scale", 1e-6),
        "scale_sd_percent": ("scale_sd", 1e-2),
        "scale_sd_ppm": ("scale_sd", 1e-6),
        "speed_sd_mps": ("speed_sd", 1.0),
        "speed_sd_cmps": ("speed_sd", 1e-2),
        "speed_lsb_mps": ("speed_lsb", 1.0),
        "speed_lsb_cmps": ("speed_lsb", 1e-2),
        "pulses_per_m": ("pulses_per_metre", 1.0),
        "slips_s": ("slips", 1.0),
        "slip_percent": ("slip", 1e-2),
        "slips_per_h": ("slip_frequency", 1.0 / 3600.0),
        "slip_mean_s": ("slip_mean", 1.0),
        "slip_sd_percent": ("slip_sd", 1e-2),
        "stated_sigma_factor": ("stated_sigma_factor", 1.0),
    }
    WORDS: ClassVar[tuple[str, ...]] = ("averaged",)

    rate: float = 10.0
    lever_arm: ArrayLike = (0.0, 0.0, 0.0)
    averaged: bool = False
    scale: float = 0.0
    scale_sd: float = 0.0
    speed_sd: float = 0.0
    speed_lsb: float = 0.0
    pulses_per_metre: float = 0.0
    slips: ArrayLike = ()
    slip: ArrayLike = 0.0
    slip_frequency: float = 0.0
    slip_mean: float = 0.0
    slip_sd: float = 0.0
    stated_sigma_factor: float = 1.0

    def __post_init__(self) -> None:
        sizes = ("scale_sd", "speed_sd", "speed_lsb", "pulses_per_metre", "slip_frequency", "slip_mean", "slip_sd")
        self._settle(lever_arm=three_numbers, averaged=yes_or_no, scale=any_number, slips=windows)
        self._settle(**dict.fromkeys((*sizes, "stated_sigma_factor"), one_number))
        count = len(self.values("slips"))
        if numbers("slip", self.slip).any() != (count > 0):
            raise ConfigError("slips and slip need each other: windows of time, and how large the slip is in them")
        self._settle(slip=partial(one_or_several, count=count, what="windows of slips"))
        need_each_other(
            "random slips", slip_frequency=self.slip_frequency, slip_mean=self.slip_mean, slip_sd=self.slip_sd
        )
        if self.pulses_per_metre > 0.0 and (self.speed_lsb > 0.0 or not self.averaged):
            raise ConfigError("pulses_per_metre needs averaged = true, and takes the place of speed_lsb")

    @property
    def white_sd(self) -> float:
        """Noise and rounding together [m/s]; a count of pulses has the rounding error of both its ends."""
        pulse = self.rate / self.pulses_per_metre if self.pulses_per_metre > 0.0 else 0.0
        return math.sqrt(self.speed_sd**2 + self.speed_lsb**2 / 12.0 + pulse**2 / 6.0)


@dataclass(frozen=True, slots=True, eq=False)
class OdometerTruth:
    """What was added: before rounding, the log is ``(1 + scale) (1 + slip) speed + noise``.

    Attributes
    ----------
    true_time : (n,) array [s]
        When each row was measured; its stamp is later by the latency.
    speed : (n,) array [m/s]
        Without errors.
    scale : float [1]
    slip : (n,) array [1]
        At the time of the row, also where it is a mean over an interval.
    noise : (n,) array [m/s]
    """

    true_time: Array
    speed: Array
    scale: float
    slip: Array
    noise: Array


def measure_odometer(
    motion: Motion, model: OdometerModel, rng: np.random.Generator
) -> tuple[OdometerLog, OdometerTruth]:
    """Speeds as a real odometer would have written them.

    Parameters
    ----------
    motion : Motion
        Of the IMU.
    model : OdometerModel
    rng : numpy Generator
        Advanced only by spawning children, one per error.

    Returns
    -------
    log : OdometerLog
    truth : OdometerTruth

    Raises
    ------
    InputError
        When the motion ends before the first sample.
    """
    draws = Streams(rng, ("scale", "noise", "slip_times", "slip"))
    time = model.sample_times(motion)

    def forward(at: Array) -> Array:
        return point_velocity_b(motion, at, model.lever_arm)[:, :1]

    speed = interval_means(forward, time, 1.0 / model.rate, motion.start) if model.averaged else forward(time)
    speed = speed[:, 0]
    scale = model.scale + model.scale_sd * float(draws["scale"].standard_normal())
    slip = random_boxes(
        time, model.slip_frequency, model.slip_mean, np.array([model.slip_sd]), draws["slip_times"], draws["slip"]
    )
    slip = (slip + boxes(time, model.values("slips"), model.values("slip").reshape(-1, 1)))[:, 0]
    noise = model.speed_sd * draws["noise"].standard_normal(time.size)
    measured = (1.0 + scale) * (1.0 + slip) * speed + noise
    if model.pulses_per_metre > 0.0:
        counter = np.floor(np.cumsum(measured) / model.rate * model.pulses_per_metre + 0.5)
        measured = np.diff(counter, prepend=0.0) / model.pulses_per_metre * model.rate
    measured = rounded(measured, model.speed_lsb)
    sd = stated_sd(model.stated_sigma_factor, model.white_sd, time.shape)
    log = OdometerLog(time + model.latency, measured, sd, source="simulation")
    return log, OdometerTruth(time, speed, scale, slip, noise)
