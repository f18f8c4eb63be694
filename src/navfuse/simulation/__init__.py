"""Simulation: a motion known exactly, what perfect sensors read along it, and what real ones make of that.

::

    car_drive, figure_eight_flight, circle_flight, static    -> Motion          (vehicles)
    Motion, stamps                                           -> perfect ImuLog  (perfect_imu)
    perfect ImuLog, ImuErrorModel                            -> ImuLog, errors  (sensors.add_imu_errors)
    Motion                                                   -> GnssLog         (sensors.gnss_fixes)
    all of it                                                -> SimulatedLogs   (simulate)
"""

from navfuse.simulation.logs import SimulatedLogs, simulate
from navfuse.simulation.motion import Motion, MotionState
from navfuse.simulation.perfect_imu import perfect_imu, sample_times
from navfuse.simulation.sensors import ImuErrorTruth, add_imu_errors, antenna_state, gauss_markov, gnss_fixes
from navfuse.simulation.vehicles import car_drive, circle_flight, figure_eight_flight, static

__all__ = [
    "ImuErrorTruth",
    "Motion",
    "MotionState",
    "SimulatedLogs",
    "add_imu_errors",
    "antenna_state",
    "car_drive",
    "circle_flight",
    "figure_eight_flight",
    "gauss_markov",
    "gnss_fixes",
    "perfect_imu",
    "sample_times",
    "simulate",
    "static",
]
