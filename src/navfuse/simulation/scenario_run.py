"""From a scenario and a seed to logs. Every sensor draws from a stream of its own, which the seed and its name give."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from navfuse.data.logs import GnssLog, ImuLog
from navfuse.data.start import Start
from navfuse.data.trajectory import Trajectory
from navfuse.errors import ConfigError, InputError
from navfuse.simulation.drawn_start import drawn_start
from navfuse.simulation.measured_gnss import GnssTruth, measure_gnss, measuring_times
from navfuse.simulation.measured_imu import ImuSensorTruth, measure_imu
from navfuse.simulation.motion import Motion
from navfuse.simulation.perfect_imu import perfect_imu, sample_times
from navfuse.simulation.scenario import SENSORS, Scenario, StartErrors
from navfuse.simulation.sensors import antenna_state

Array = np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class ScenarioTruth:
    """What all runs of a scenario share.

    Attributes
    ----------
    motion : Motion
    ideal_imu : ImuLog
        Without errors.
    trajectory : Trajectory
        Of the IMU.
    antenna : (r_e, v_e) or None
        Position and velocity (n, 3) of the GNSS antenna whenever the receiver measures.
    """

    motion: Motion
    ideal_imu: ImuLog
    trajectory: Trajectory
    antenna: tuple[Array, Array] | None


@dataclass(frozen=True, slots=True, eq=False)
class ScenarioLogs:
    """One run of a scenario.

    Attributes
    ----------
    scenario : Scenario
    seed : int
    truth : ScenarioTruth
    imu : ImuLog
    imu_truth : ImuSensorTruth
    gnss : GnssLog or None
    gnss_truth : GnssTruth or None
    sensors : mapping of str to (log, truth)
        The other aiding sensors, by section.
    start : Start or None
        As the filter is told, if the scenario tells it.
    """

    scenario: Scenario
    seed: int
    truth: ScenarioTruth
    imu: ImuLog
    imu_truth: ImuSensorTruth
    gnss: GnssLog | None
    gnss_truth: GnssTruth | None
    sensors: Mapping[str, tuple[Any, Any]]
    start: Start | None


def scenario_truth(scenario: Scenario) -> ScenarioTruth:
    """Motion, perfect IMU log and true trajectory of a scenario.

    Raises
    ------
    ConfigError, InputError
        As :attr:`Scenario.motion`, and for a motion too short for two IMU samples.
    """
    motion = scenario.motion
    stamps = _named(scenario, "imu", sample_times, motion.start, motion.end, scenario.imu_rate)
    if stamps.size < 2:
        raise ConfigError(
            f"{scenario.name}: the motion lasts {motion.end - motion.start:g} s, too short for two IMU samples at "
            f"{scenario.imu_rate:g} Hz"
        )
    truth_stamps = _named(scenario, "motion", sample_times, motion.start, motion.end, scenario.truth_rate)
    truth = motion.trajectory(truth_stamps)
    antenna = None
    if scenario.gnss is not None:
        times = _named(scenario, "gnss", measuring_times, motion, scenario.gnss)
        antenna = antenna_state(motion, times, scenario.gnss_lever_arm_b)
    return ScenarioTruth(motion, perfect_imu(motion, stamps, scenario.imu_kind), truth, antenna)


def run_scenario(
    scenario: Scenario, seed: int | None = None, *, truth: ScenarioTruth | None = None, aiding: bool = True
) -> ScenarioLogs:
    """Simulate the sensors of a scenario.

    Parameters
    ----------
    scenario : Scenario
    seed : int, optional
        Default the scenario's own. The same seed gives the same bytes, on any number of cores; leaving a sensor out
        does not change the others.
    truth : ScenarioTruth, optional
        From :func:`scenario_truth`, to save making it anew.
    aiding : bool
        False leaves out the sensors beside IMU and GNSS.

    Raises
    ------
    ConfigError
        As :func:`scenario_truth`, and for a negative seed.
    InputError
        When a sensor finds nothing to measure; the section is named.
    """
    seed = scenario.seed if seed is None else seed
    if seed < 0:
        raise ConfigError(f"a seed must be at least 0, not {seed}")
    truth = scenario_truth(scenario) if truth is None else truth
    motion = truth.motion
    imu, imu_truth = _named(scenario, "imu", measure_imu, truth.ideal_imu, scenario.imu, section_stream(seed, "imu"))
    gnss = gnss_truth = None
    if scenario.gnss is not None:
        draws = section_stream(seed, "gnss")
        lever_arm = scenario.gnss_lever_arm_b
        gnss, gnss_truth = _named(
            scenario, "gnss", measure_gnss, motion, scenario.gnss, draws, lever_arm, truth.antenna
        )
    sensors = {}
    for section, (model, *lever) in scenario.sensors.items() if aiding else ():
        draws, lever_arm = section_stream(seed, section), [arm for arm in lever if arm]
        sensors[section] = _named(scenario, section, SENSORS[section].measure, motion, model, draws, *lever_arm)
    start = None
    if scenario.start is not None:
        start = told_start(motion, imu.time[0] - scenario.imu.stamp_latency, scenario.start, seed)
    return ScenarioLogs(scenario, seed, truth, imu, imu_truth, gnss, gnss_truth, sensors, start)


def told_start(motion: Motion, time: float, errors: StartErrors, seed: int) -> Start:
    """The start of a motion at the first stamp [s] of its IMU log, wrong by a draw that the seed gives.

    A jittering stamp may lie a little outside the motion; the state is then that of its edge.
    """
    draws, inside = section_stream(seed, "start"), min(max(time, motion.start), motion.end)
    start = drawn_start(motion, inside, errors.sd_position, errors.sd_velocity, errors.sd_attitude, draws)
    return replace(start, time=float(time))


def section_stream(seed: int, section: str) -> np.random.Generator:
    """The stream of random numbers of a section of a scenario."""
    return np.random.default_rng(np.random.SeedSequence([seed, zlib.crc32(section.encode())]))


def _named(scenario: Scenario, section: str, measure: Any, *arguments: Any) -> Any:
    try:
        return measure(*arguments)
    except (ConfigError, InputError) as error:
        raise type(error)(f"{scenario.name}: [{section}]: {error}") from error
