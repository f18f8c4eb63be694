"""A heading sensor: compass, gyrocompass or two antennas, with bias, wander and noise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from navfuse.core.constants import TWO_PI
from navfuse.data.aiding_logs import HeadingLog
from navfuse.data.trajectory import wrapped
from navfuse.simulation.printed_fields import any_number, one_number, tau
from navfuse.simulation.sampled_sensor import (
    SAMPLING_UNITS,
    SampledSensor,
    need_tau,
    rounded,
    stated_sd,
    wander,
)
from navfuse.simulation.streams import Streams

if TYPE_CHECKING:
    from navfuse.simulation.motion import Motion

Array = np.ndarray

_DEGREE = np.pi / 180.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class HeadingModel(SampledSensor):
    """Errors of a heading sensor, SI units; zero means absent.

    Attributes
    ----------
    rate, offset, latency : see :class:`~navfuse.simulation.sampled_sensor.SampledSensor`.
    heading_sd : float [rad]
        White noise. Typical: 4 deg of a compass (coursework of UCL COMP0130).
    bias, bias_sd : float [rad]
        Given constant (mounting, unknown declination), and standard deviation of the part drawn once per run. Typical:
        1 deg of mounting (our estimate).
    correlated_sd, correlated_tau : float [rad], [s]
        Stationary first-order Gauss-Markov error, correlation time > 0 (inf: constant). Typical: 2 deg over 60 s of a
        compass in a car (our estimate).
    heading_lsb : float [rad]
        Step of rounding. Typical: 0.1 deg, one decimal of an NMEA sentence.
    stated_sigma_factor : float
        Stated sigma over the true one of noise, wander and rounding together; 0 leaves the column out. The bias is not
        in it.

    Raises
    ------
    ConfigError
        On construction, for a value that is negative, not finite or of the wrong shape, or one that lacks another.
    """

    WHAT: ClassVar[str] = "heading sensor"
    UNITS: ClassVar[dict[str, tuple[str, float]]] = SAMPLING_UNITS | {
        "heading_sd_deg": ("heading_sd", _DEGREE),
        "heading_sd_rad": ("heading_sd", 1.0),
        "bias_deg": ("bias", _DEGREE),
        "bias_rad": ("bias", 1.0),
        "bias_sd_deg": ("bias_sd", _DEGREE),
        "bias_sd_rad": ("bias_sd", 1.0),
        "correlated_sd_deg": ("correlated_sd", _DEGREE),
        "correlated_sd_rad": ("correlated_sd", 1.0),
        "correlated_tau_s": ("correlated_tau", 1.0),
        "heading_lsb_deg": ("heading_lsb", _DEGREE),
        "stated_sigma_factor": ("stated_sigma_factor", 1.0),
    }

    heading_sd: float = 0.0
    bias: float = 0.0
    bias_sd: float = 0.0
    correlated_sd: float = 0.0
    correlated_tau: float = 0.0
    heading_lsb: float = 0.0
    stated_sigma_factor: float = 1.0

    def __post_init__(self) -> None:
        sizes = ("heading_sd", "bias_sd", "correlated_sd", "heading_lsb", "stated_sigma_factor")
        self._settle(**dict.fromkeys(sizes, one_number), bias=any_number, correlated_tau=tau)
        need_tau("correlated_sd", self.correlated_sd, "correlated_tau", self.correlated_tau)

    @property
    def total_sd(self) -> float:
        """Noise, wander and rounding together [rad]."""
        return math.sqrt(self.heading_sd**2 + self.correlated_sd**2 + self.heading_lsb**2 / 12.0)


@dataclass(frozen=True, slots=True, eq=False)
class HeadingTruth:
    """What was added: before rounding and wrapping, the log is ``heading + bias + correlated + noise``.

    Attributes
    ----------
    true_time : (n,) array [s]
        When each row was measured; its stamp is later by the latency.
    heading : (n,) array [rad]
        Without errors, 0 <= heading < 2 pi.
    bias : float [rad]
    correlated, noise : (n,) arrays [rad]
    """

    true_time: Array
    heading: Array
    bias: float
    correlated: Array
    noise: Array


def measure_heading(motion: Motion, model: HeadingModel, rng: np.random.Generator) -> tuple[HeadingLog, HeadingTruth]:
    """Headings as a real sensor would have written them.

    Parameters
    ----------
    motion : Motion
        Of the IMU.
    model : HeadingModel
    rng : numpy Generator
        Advanced only by spawning children, one per error.

    Returns
    -------
    log : HeadingLog
        Heading of the body x axis from true north.
    truth : HeadingTruth

    Raises
    ------
    InputError
        When the motion ends before the first sample.
    """
    draws = Streams(rng, ("bias", "correlated", "noise"))
    time = model.sample_times(motion)
    forward_n = motion.C_nb(time)[:, :, 0]
    heading = wrapped(np.arctan2(forward_n[:, 1], forward_n[:, 0]), TWO_PI)
    bias = model.bias + model.bias_sd * float(draws["bias"].standard_normal())
    correlated = wander(time, model.correlated_sd, model.correlated_tau, 0.0, draws["correlated"])
    noise = model.heading_sd * draws["noise"].standard_normal(time.size)
    measured = wrapped(rounded(heading + bias + correlated + noise, model.heading_lsb), TWO_PI)
    sd = stated_sd(model.stated_sigma_factor, model.total_sd, time.shape)
    log = HeadingLog(time + model.latency, measured, sd, source="simulation")
    return log, HeadingTruth(time, heading, bias, correlated, noise)
