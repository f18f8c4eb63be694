"""Drives for the planar tutorial: a simulated model car, a car with a phone, a car with a VN-100."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from navfuse.core.earth import dcm_en, ecef_to_geodetic_batch
from navfuse.core.rotation import dcm_from_quat, euler_from_dcm
from navfuse.errors import InputError, NavfuseWarning
from navfuse.imu.increments import to_increments
from navfuse.io.earth_magnetism import magnetic_field_n
from navfuse.io.vectornav_ascii import read_vectornav_ascii
from navfuse.io.vectornav_logs import vectornav_attitude, vectornav_imu, vectornav_magnetometer
from navfuse.planar import FlatEarth, declination
from navfuse.reproduce.study import Wishes
from navfuse.simulation.scenario import Scenario, load_scenario
from navfuse.simulation.scenario_run import ScenarioTruth, run_scenario, scenario_truth

Array = np.ndarray

SCENARIO = "rc-car"
COMMA, VN100 = "comma2k19-example1", "vn100-circle"
COMMA_YEAR = 2018.57
"""Of the drive: GPS week 2012."""


@dataclass(frozen=True, eq=False)
class Drive:
    """What the three algorithms are given, and what they are compared with.

    Attributes
    ----------
    time : (n,) array [s]
    gyro_z : (n,) array [rad/s]
    accel_b : (n, 2) array [m/s^2]
        Mean over the step that ends at `time`, as `gyro_z`.
    field_b : (n, 2) array [T]
    declination : float [rad]
        0 if the reference is magnetic itself.
    yaw : (n,) array [rad]
        Reference, unwrapped.
    fix_time : (m,) array [s]
    fix_position, fix_velocity : (m, 2) arrays
        North and east, on a flat Earth around the start.
    position, velocity : (n, 2) arrays
        Reference; NaN where there is none.
    """

    time: Array
    gyro_z: Array
    accel_b: Array
    field_b: Array
    declination: float
    yaw: Array
    fix_time: Array
    fix_position: Array
    fix_velocity: Array
    position: Array
    velocity: Array


@lru_cache(maxsize=1)
def _scenario() -> tuple[Scenario, ScenarioTruth]:
    scenario = load_scenario(SCENARIO)
    return scenario, scenario_truth(scenario)


def model_car(seed: int) -> Drive:
    """The scenario, with errors of this seed."""
    scenario, truth = _scenario()
    logs = run_scenario(scenario, seed, truth=truth)
    imu, field, fixes = to_increments(logs.imu), logs.sensors["magnetometer"][0], logs.gnss
    assert fixes is not None
    assert fixes.velocity_n is not None
    time = imu.time[1:]
    true = truth.motion.trajectory(time)
    assert true.attitude is not None
    assert true.velocity_n is not None
    flat = FlatEarth(float(true.lat[0]), float(true.lon[0]), float(true.height[0]))
    field_b = np.column_stack([np.interp(time, field.time, field.field_b[:, k]) for k in range(2)])
    return Drive(
        time,
        imu.inc_theta_b[:, 2] / imu.dt,
        imu.inc_v_b[:, :2] / imu.dt[:, None],
        field_b,
        declination(np.array(scenario.sensors["magnetometer"][0].field)),
        np.unwrap(true.attitude[:, 2]),
        fixes.time,
        flat.to_metres(fixes.lat, fixes.lon),
        fixes.velocity_n[:, :2],
        flat.to_metres(true.lat, true.lon),
        true.velocity_n[:, :2],
    )


def phone_in_a_car(wishes: Wishes) -> Drive:
    """A minute of a car on a straight road, with a phone and the receiver of a dash camera (comma2k19).

    The reference is the pose of the camera, found afterwards from images and raw GNSS.

    Raises
    ------
    InputError
        If a file is missing or is no array of the expected shape.
    """

    def load(*parts: str, width: int = 0) -> Array:
        return _array(wishes.file(COMMA, *parts), width)

    log = ("processed_log", "IMU")
    time, gyro, accel = (load(*log, "gyro", "t"), load(*log, "gyro", "value", width=3),
                         load(*log, "accelerometer", "value", width=3))  # fmt: skip
    field_time, field = load(*log, "magnetometer", "t"), load(*log, "magnetometer", "value", width=3)
    live = ("processed_log", "GNSS", "live_gnss_ublox")
    fix_time, fix = load(*live, "t"), load(*live, "value", width=6)
    frame, place, speed, pose = (load("global_pose", "frame_times"), load("global_pose", "frame_positions", width=3),
                                 load("global_pose", "frame_velocities", width=3),
                                 load("global_pose", "frame_orientations", width=4))  # fmt: skip
    lat, lon, height = ecef_to_geodetic_batch(place)
    flat = FlatEarth(float(lat[0]), float(lon[0]), float(height[0]))
    C_en = np.array(dcm_en(flat.lat, flat.lon)).reshape(3, 3)
    yaw = [euler_from_dcm((C_en.T @ np.array(dcm_from_quat(q)).reshape(3, 3)).ravel())[2] for q in pose]
    bearing, knots = np.radians(fix[:, 5]), fix[:, 2]
    inside = (time >= max(field_time[0], frame[0])) & (time <= min(field_time[-1], frame[-1]))
    time, gyro, accel = time[inside], gyro[inside], accel[inside]

    def at(when: Array, values: Array) -> Array:
        return np.column_stack([np.interp(time, when, column) for column in values.T])

    true_field = magnetic_field_n(np.array([flat.lat]), np.array([flat.lon]), np.array([flat.height]), COMMA_YEAR)[0]
    return Drive(
        time,
        gyro[:, 2],
        accel[:, :2],
        1e-6 * at(field_time, field[:, :2]),
        declination(true_field),
        np.interp(time, frame, np.unwrap(yaw)),
        fix_time,
        flat.to_metres(np.radians(fix[:, 0]), np.radians(fix[:, 1])),
        np.column_stack((knots * np.cos(bearing), knots * np.sin(bearing))),
        at(frame, flat.to_metres(lat, lon)),
        at(frame, (speed @ C_en)[:, :2]),
    )


def sensor_in_circles(wishes: Wishes) -> Drive:
    """A car with a VN-100, driven in circles for a minute; the reference is the sensor's own yaw, without positions.

    Raises
    ------
    InputError
        If the file is missing or has no sentences.
    """
    log = read_vectornav_ascii(wishes.file(VN100, "circle_data_0_imu.csv"))
    with warnings.catch_warnings():
        # That the rates carry the sensor's own bias corrections is no fault here: its yaw is the reference.
        warnings.simplefilter("ignore", NavfuseWarning)
        imu, field, own = vectornav_imu(log), vectornav_magnetometer(log), vectornav_attitude(log)
    nothing = np.full((imu.time.size, 2), np.nan)
    return Drive(
        imu.time - imu.time[0], imu.gyro[:, 2], imu.accel[:, :2], field.field_b[:, :2], 0.0,
        np.unwrap(own.attitude[:, 2]), np.empty(0), np.empty((0, 2)), np.empty((0, 2)), nothing, nothing,
    )  # fmt: skip


def _array(path: Path, width: int) -> Array:
    try:
        found = np.load(path, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not an array as numpy saves it: {error}") from error
    shape_fits = found.ndim == (2 if width else 1) and (not width or found.shape[1] == width)
    if not shape_fits or not np.isfinite(found).all() or len(found) < 2:
        raise InputError(f"{path}: an array of shape {found.shape}, finite (n, {width or ''}) was expected")
    return found
