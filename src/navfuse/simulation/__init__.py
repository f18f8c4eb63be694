"""Simulation: a motion known exactly, what perfect sensors read along it, and what real ones make of that.

::

    car_drive, figure_eight_flight, circle_flight, static    -> Motion          (vehicles)
    Vehicle, segments such as Accelerate and Turn            -> Motion          (rules, segments.drive)
    Vehicle, waypoints                                       -> Motion          (waypoints.follow_waypoints)
    table of positions and perhaps attitudes                 -> Motion          (track_files, track.follow_track)
    moves of a rotating table                                -> Motion          (table.rotating_table)
    Motion, stamps                                           -> perfect ImuLog  (perfect_imu)
    perfect ImuLog, ImuErrorModel                            -> ImuLog, errors  (sensors.add_imu_errors)
    Motion                                                   -> GnssLog         (sensors.gnss_fixes)
    perfect ImuLog, ImuSensorModel                           -> ImuLog, errors  (measured_imu.measure_imu)
    Motion, GnssReceiverModel                                -> GnssLog, errors (measured_gnss.measure_gnss)
    Motion, RawGnssModel                                     -> RawGnssLog, errors (measured_raw_gnss.measure_raw_gnss)
    Motion, model of another aiding sensor                   -> log, errors     (odometer, wheel_speeds, magnetometer,
                                                     heading_sensor, barometer, body_velocity, uwb: measure_*)
    all of it                                                -> SimulatedLogs   (simulate)
    scenario file, seed                                      -> ScenarioLogs    (scenario, scenario_run)
"""

from navfuse.simulation.barometer import BarometerModel, BarometerTruth, measure_barometer
from navfuse.simulation.body_velocity import BodyVelocityModel, BodyVelocityTruth, measure_body_velocity
from navfuse.simulation.drawn_start import drawn_start
from navfuse.simulation.gnss_errors import FixType, GnssReceiverModel
from navfuse.simulation.heading_sensor import HeadingModel, HeadingTruth, measure_heading
from navfuse.simulation.imu_errors import ImuSensorModel
from navfuse.simulation.logs import SimulatedLogs, simulate
from navfuse.simulation.magnetometer import MagnetometerModel, MagnetometerTruth, measure_magnetometer
from navfuse.simulation.measured_gnss import GnssTruth, measure_gnss
from navfuse.simulation.measured_imu import ImuSensorTruth, measure_imu
from navfuse.simulation.measured_raw_gnss import RawGnssTruth, measure_raw_gnss
from navfuse.simulation.motion import Motion, MotionState
from navfuse.simulation.odometer import OdometerModel, OdometerTruth, measure_odometer
from navfuse.simulation.perfect_imu import perfect_imu, sample_times
from navfuse.simulation.raw_gnss_errors import RawGnssModel
from navfuse.simulation.route import Vehicle
from navfuse.simulation.rules import VEHICLES, aircraft, boat, car, drone, pedestrian
from navfuse.simulation.segments import (
    Accelerate,
    Climb,
    FigureEight,
    Hold,
    Stop,
    STurns,
    Turn,
    drive,
    segments_from_tables,
)
from navfuse.simulation.sensors import (
    ImuErrorTruth,
    add_imu_errors,
    antenna_state,
    gauss_markov,
    gnss_fixes,
    noisy_fixes,
)
from navfuse.simulation.sky import SatelliteOutage, SkySector
from navfuse.simulation.table import TableMove, rotating_table
from navfuse.simulation.track import follow_track, track_residuals
from navfuse.simulation.track_files import read_track
from navfuse.simulation.uwb import UwbAnchor, UwbModel, UwbTruth, measure_uwb
from navfuse.simulation.vehicles import car_drive, circle_flight, figure_eight_flight, static
from navfuse.simulation.waypoints import Waypoint, follow_waypoints, local_waypoints
from navfuse.simulation.wheel_speeds import Wheel, WheelSpeedModel, WheelSpeedTruth, measure_wheel_speeds

__all__ = [
    "VEHICLES",
    "Accelerate",
    "BarometerModel",
    "BarometerTruth",
    "BodyVelocityModel",
    "BodyVelocityTruth",
    "Climb",
    "FigureEight",
    "FixType",
    "GnssReceiverModel",
    "GnssTruth",
    "HeadingModel",
    "HeadingTruth",
    "Hold",
    "ImuErrorTruth",
    "ImuSensorModel",
    "ImuSensorTruth",
    "MagnetometerModel",
    "MagnetometerTruth",
    "Motion",
    "MotionState",
    "OdometerModel",
    "OdometerTruth",
    "RawGnssModel",
    "RawGnssTruth",
    "STurns",
    "SatelliteOutage",
    "SimulatedLogs",
    "SkySector",
    "Stop",
    "TableMove",
    "Turn",
    "UwbAnchor",
    "UwbModel",
    "UwbTruth",
    "Vehicle",
    "Waypoint",
    "Wheel",
    "WheelSpeedModel",
    "WheelSpeedTruth",
    "add_imu_errors",
    "aircraft",
    "antenna_state",
    "boat",
    "car",
    "car_drive",
    "circle_flight",
    "drawn_start",
    "drive",
    "drone",
    "figure_eight_flight",
    "follow_track",
    "follow_waypoints",
    "gauss_markov",
    "gnss_fixes",
    "local_waypoints",
    "measure_barometer",
    "measure_body_velocity",
    "measure_gnss",
    "measure_heading",
    "measure_imu",
    "measure_magnetometer",
    "measure_odometer",
    "measure_raw_gnss",
    "measure_uwb",
    "measure_wheel_speeds",
    "noisy_fixes",
    "pedestrian",
    "perfect_imu",
    "read_track",
    "rotating_table",
    "sample_times",
    "segments_from_tables",
    "simulate",
    "static",
    "track_residuals",
]
