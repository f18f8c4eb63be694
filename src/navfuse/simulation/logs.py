"""From a motion to the logs of one run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from navfuse.simulation.perfect_imu import perfect_imu, sample_times
from navfuse.simulation.sensors import ImuErrorTruth, add_imu_errors, gnss_fixes

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from navfuse.data.logs import GnssLog, ImuLog
    from navfuse.data.trajectory import Trajectory
    from navfuse.imu.error_model import ImuErrorModel
    from navfuse.simulation.motion import Motion


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedLogs:
    """Everything one simulated run gives.

    Attributes
    ----------
    imu : ImuLog
        With errors.
    gnss : GnssLog
        With errors, at the antenna.
    truth : Trajectory
        Of the IMU.
    imu_errors : ImuErrorTruth
        Biases, scale factors and cross-coupling that `imu` contains.
    motion : Motion
        The truth at any time.
    """

    imu: ImuLog
    gnss: GnssLog
    truth: Trajectory
    imu_errors: ImuErrorTruth
    motion: Motion


def simulate(
    motion: Motion,
    model: ImuErrorModel,
    seed: int = 0,
    *,
    imu_rate: float = 100.0,
    imu_kind: Literal["rates", "increments"] = "increments",
    gnss_rate: float = 1.0,
    gnss_offset: float = 0.0,
    sd_position: ArrayLike = (1.0, 1.0, 2.0),
    sd_velocity: ArrayLike | None = (0.05, 0.05, 0.1),
    lever_arm_b: ArrayLike = (0.0, 0.0, 0.0),
    truth_rate: float = 10.0,
) -> SimulatedLogs:
    """Simulate an IMU and a GNSS receiver along a motion.

    Parameters
    ----------
    motion : Motion
        E.g. from :func:`~navfuse.simulation.vehicles.car_drive`.
    model : ImuErrorModel
        E.g. from :func:`~navfuse.imu.grades.grade`.
    seed : int
        The same seed and arguments give the same numbers. IMU and GNSS errors come from independent streams: changing
        the settings of one leaves the other's draws alone.
    imu_rate, gnss_rate, truth_rate : float [Hz]
    imu_kind : {"rates", "increments"}
    gnss_offset : float [s]
        First fix this long after the start.
    sd_position, sd_velocity : (3,) arrays [m], [m/s], north, east, down
        Of the GNSS errors, and as stated in the log; ``sd_velocity=None`` for a receiver that gives no velocity.
    lever_arm_b : (3,) array [m]
        IMU to antenna, body forward-right-down.

    Returns
    -------
    SimulatedLogs

    Raises
    ------
    ConfigError, InputError
        As :func:`~navfuse.simulation.perfect_imu.perfect_imu` and :func:`~navfuse.simulation.sensors.gnss_fixes`.
    """
    imu_draws, gnss_draws = np.random.default_rng(seed).spawn(2)
    ideal = perfect_imu(motion, sample_times(motion.start, motion.end, imu_rate), imu_kind)
    imu, imu_errors = add_imu_errors(ideal, model, imu_draws)
    gnss = gnss_fixes(motion, gnss_rate, sd_position, sd_velocity, lever_arm_b, gnss_draws, gnss_offset)
    truth = motion.trajectory(sample_times(motion.start, motion.end, truth_rate))
    return SimulatedLogs(imu, gnss, truth, imu_errors, motion)
