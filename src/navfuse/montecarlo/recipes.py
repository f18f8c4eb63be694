"""What a Monte Carlo run is made of: a recipe gives, for every seed, logs with their truth and the filter to be tested.

A recipe is any picklable callable ``seed -> Case``. :class:`SimulatedRecipe` is a quick one for motions of
:mod:`navfuse.simulation`; those of scenarios and projects are in :mod:`navfuse.montecarlo.scenario_recipe`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from navfuse.aiding.base import AidingSensor
from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity
from navfuse.core.nearest import nearest
from navfuse.data.logs import GnssLog, ImuLog
from navfuse.data.start import Start
from navfuse.data.trajectory import Trajectory
from navfuse.errors import ConfigError
from navfuse.filters.settings import FilterSettings
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.grades import grade as imu_grade
from navfuse.simulation import (
    Motion,
    SimulatedLogs,
    add_imu_errors,
    car_drive,
    circle_flight,
    figure_eight_flight,
    perfect_imu,
    sample_times,
    static,
)
from navfuse.simulation.drawn_start import true_start, wrong_start
from navfuse.simulation.sensors import antenna_of_fixes, fixes_of_antenna

Array = np.ndarray

_START_SDS = ("start_sd_position", "start_sd_velocity", "start_sd_attitude_deg")


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """One run, ready for the filter.

    Attributes
    ----------
    logs : SimulatedLogs
        With their truth.
    start : Start
        As the filter is told; its error should be a draw from its covariance.
    model : ImuErrorModel
        Of the filter.
    sensors : tuple of AidingSensor
    settings : FilterSettings
    smooth : bool
        Run the smoother too.
    estimator : str
        Key of :data:`navfuse.filters.kinds.FILTERS`.
    """

    logs: SimulatedLogs
    start: Start
    model: ImuErrorModel
    sensors: tuple[AidingSensor, ...]
    settings: FilterSettings
    smooth: bool = False
    estimator: str = "ekf"


Recipe = Callable[[int], Case]


@dataclass(frozen=True, slots=True)
class Tampering:
    """What the filter is told wrongly, to see it found out; the defaults tell the truth.

    Attributes
    ----------
    gnss_sd_factor : float
        The filter is told the sigmas of the fixes times this; sqrt(0.5) halves R.
    imu_noise_factor : float
        The filter is told the white noise and random walks of the IMU times this; 0.5 divides Q by four.

    Raises
    ------
    ConfigError
        On construction, for a factor that is not positive and finite.
    """

    gnss_sd_factor: float = 1.0
    imu_noise_factor: float = 1.0

    def __post_init__(self) -> None:
        for name in ("gnss_sd_factor", "imu_noise_factor"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ConfigError(f"{name} must be positive and finite, not {getattr(self, name)!r}")

    def gnss(self, log: GnssLog) -> GnssLog:
        """The fixes with the sigmas that the filter is told."""
        if self.gnss_sd_factor == 1.0:
            return log
        sd_velocity = None if log.sd_velocity is None else log.sd_velocity * self.gnss_sd_factor
        return replace(log, sd_position=log.sd_position * self.gnss_sd_factor, sd_velocity=sd_velocity)

    def imu(self, model: ImuErrorModel) -> ImuErrorModel:
        """The error model that the filter is told."""
        k = self.imu_noise_factor
        if k == 1.0:
            return model
        walks = {name: k * model.axes(name) for name in ("gyro_bias_walk", "accel_bias_walk")}
        return model.replace(arw=k * model.arw, vrw=k * model.vrw, **walks)


TRUTHFUL = Tampering()
"""Nothing told wrongly."""


@dataclass(frozen=True, slots=True)
class SimulatedRecipe:
    """An IMU and a GNSS receiver along a motion, the same for every seed; all errors are drawn anew.

    The start is wrong by a draw from its own covariance, so that a filter whose model is right has to be consistent
    from the first epoch on. The last two factors make the model of the *filter* wrong.

    Attributes
    ----------
    name : str
        Key of :data:`MOTIONS`.
    grade : str
        Key of :data:`navfuse.imu.grades.GRADES`.
    duration : float [s]
    imu_rate, gnss_rate : float [Hz]
    frame : str
        ``"ned"`` or ``"ecef"``: where the filter works.
    smooth : bool
    scale_states : bool
        False leaves scale factors out of both simulation and filter: 15 states.
    outages_s : tuple of (from, to) [s]
        Windows in which the fixes are withheld.
    sd_position, sd_velocity : 3 numbers [m], [m/s], north, east, down
        Of the fixes.
    lever_arm_b : 3 numbers [m]
    start_sd_position, start_sd_velocity, start_sd_attitude_deg : 3 numbers [m], [m/s], [deg]
        The last of roll, pitch, heading.
    gnss_sd_factor : float
        The filter is told the sigmas of the fixes times this; sqrt(0.5) halves R.
    imu_noise_factor : float
        The filter is told the white noise and random walks of the IMU times this; 0.5 divides Q by four.

    Raises
    ------
    ConfigError
        On construction, for an unknown name, grade or frame, or a number that cannot be.
    """

    name: str
    grade: str = "industrial-mems"
    duration: float = 120.0
    imu_rate: float = 100.0
    gnss_rate: float = 1.0
    frame: str = "ned"
    smooth: bool = False
    scale_states: bool = True
    outages_s: tuple[tuple[float, float], ...] = ()
    sd_position: tuple[float, float, float] = (1.0, 1.0, 2.0)
    sd_velocity: tuple[float, float, float] | None = (0.05, 0.05, 0.1)
    lever_arm_b: tuple[float, float, float] = (0.8, -0.5, -1.4)
    start_sd_position: tuple[float, float, float] = (1.0, 1.0, 2.0)
    start_sd_velocity: tuple[float, float, float] = (0.05, 0.05, 0.05)
    start_sd_attitude_deg: tuple[float, float, float] = (0.3, 0.3, 1.0)
    gnss_sd_factor: float = 1.0
    imu_noise_factor: float = 1.0

    def __post_init__(self) -> None:
        for name in ("sd_position", "sd_velocity", "lever_arm_b", *_START_SDS):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, tuple(np.asarray(value, dtype=float).tolist()))
        object.__setattr__(self, "outages_s", tuple((float(a), float(b)) for a, b in self.outages_s))
        if self.name not in MOTIONS:
            raise ConfigError(f"unknown motion {self.name!r}{_nearest(self.name)}")
        imu_grade(self.grade)
        if self.frame not in ("ned", "ecef"):
            raise ConfigError(f"frame must be 'ned' or 'ecef', not {self.frame!r}")
        for name in ("duration", "imu_rate", "gnss_rate", "gnss_sd_factor", "imu_noise_factor"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise ConfigError(f"{name} must be positive and finite, not {value!r}")
        if self.duration * self.gnss_rate < 1.0:
            raise ConfigError(
                f"in {self.duration:g} s a receiver of {self.gnss_rate:g} Hz gives one fix only; make duration longer"
            )

    def __call__(self, seed: int) -> Case:
        """The run of a seed: the same numbers whenever and wherever it is called."""
        shared = _shared(self)
        imu_draws, gnss_draws, start_draws = np.random.default_rng(seed).spawn(3)
        imu, imu_errors = add_imu_errors(shared.ideal, shared.model, imu_draws)
        gnss = fixes_of_antenna(*shared.antenna, gnss_draws)
        told = Tampering(self.gnss_sd_factor).gnss(gnss)
        lever = np.array(self.lever_arm_b)
        sensors: list[AidingSensor] = [GnssPosition(told, lever, self.outages_s)]
        if told.velocity_n is not None:
            sensors.append(GnssVelocity(told, lever, self.outages_s))
        logs = SimulatedLogs(imu, gnss, shared.truth, imu_errors, shared.motion)
        start = wrong_start(*shared.start, start_draws)
        return Case(logs, start, shared.told_model, tuple(sensors), shared.settings, self.smooth)


MOTIONS: Mapping[str, Callable[[float], Motion]] = MappingProxyType(
    {
        "car": lambda duration: car_drive(duration, seed=1),
        "circle-flight": circle_flight,
        "figure-eight": figure_eight_flight,
        "static": static,
    }
)
"""Name -> function of the duration [s]."""


def _nearest(name: str) -> str:
    close = nearest(name.lower(), MOTIONS)
    return (f": did you mean {close!r}?" if close else ":") + f" known: {', '.join(MOTIONS)}"


@dataclass(frozen=True, slots=True, eq=False)
class _Shared:
    """What all runs of a recipe have in common: model of the simulation and of the filter, and everything but draws."""

    motion: Motion
    ideal: ImuLog
    truth: Trajectory
    model: ImuErrorModel
    told_model: ImuErrorModel
    settings: FilterSettings
    antenna: tuple[Array, Array, Array, Array, Array | None]
    start: tuple[Start, Array]


@lru_cache(maxsize=8)
def _shared(recipe: SimulatedRecipe) -> _Shared:
    """Made once per process."""
    motion, ideal, truth = _ideal(recipe.name, recipe.duration, recipe.imu_rate, recipe.gnss_rate)
    model = imu_grade(recipe.grade)
    if not recipe.scale_states:
        model = model.replace(gyro_scale_sd=0.0, accel_scale_sd=0.0)
    sds = recipe.start_sd_position, recipe.start_sd_velocity, np.radians(recipe.start_sd_attitude_deg)
    return _Shared(
        motion,
        ideal,
        truth,
        model,
        Tampering(imu_noise_factor=recipe.imu_noise_factor).imu(model),
        FilterSettings(ecef=recipe.frame == "ecef", output_period=1.0 / recipe.gnss_rate, checkpoints=True),
        antenna_of_fixes(motion, recipe.gnss_rate, recipe.sd_position, recipe.sd_velocity, recipe.lever_arm_b),
        true_start(motion, motion.start, *sds),
    )


@lru_cache(maxsize=4)
def _ideal(name: str, duration: float, imu_rate: float, gnss_rate: float) -> tuple[Motion, ImuLog, Any]:
    """Motion, perfect IMU log and truth: what all runs of a recipe share, made once per process."""
    motion = MOTIONS[name](duration)
    ideal = perfect_imu(motion, sample_times(motion.start, motion.end, imu_rate))
    return motion, ideal, motion.trajectory(sample_times(motion.start, motion.end, gnss_rate))
