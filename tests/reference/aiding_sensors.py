"""What the tests of the simulated aiding sensors share: motions that turn, twins by finite differences, bounds."""

from __future__ import annotations

import numpy as np
from scipy import stats
from scipy.spatial.transform import Rotation

from navfuse.simulation import (
    BarometerModel,
    BodyVelocityModel,
    HeadingModel,
    MagnetometerModel,
    OdometerModel,
    UwbModel,
    WheelSpeedModel,
    figure_eight_flight,
    measure_barometer,
    measure_body_velocity,
    measure_heading,
    measure_magnetometer,
    measure_odometer,
    measure_uwb,
    measure_wheel_speeds,
)

FIELD_UT = (20.0, 1.5, 43.0)
WHEELS = (
    {"name": "front_left", "forward_m": 1.3, "right_m": -0.8, "down_m": 0.5, "steered": True},
    {"name": "rear_right", "forward_m": -1.4, "right_m": 0.7, "down_m": 0.4},
)
ANCHORS = (
    {"name": "mast", "lat_deg": 45.84, "lon_deg": 11.46, "height_m": 300.0},
    {"name": "roof", "lat_deg": 45.83, "lon_deg": 11.47, "height_m": 120.0},
    {"name": "gate", "lat_deg": 45.85, "lon_deg": 11.45, "height_m": 80.0},
)

SENSORS = {
    "odometer": (OdometerModel, measure_odometer, {"rate_hz": 4.0}),
    "wheel_speeds": (WheelSpeedModel, measure_wheel_speeds, {"rate_hz": 4.0, "wheels": WHEELS}),
    "magnetometer": (MagnetometerModel, measure_magnetometer, {"rate_hz": 4.0, "field_ut": FIELD_UT}),
    "heading": (HeadingModel, measure_heading, {"rate_hz": 4.0}),
    "barometer": (BarometerModel, measure_barometer, {"rate_hz": 4.0, "output": "both"}),
    "body_velocity": (BodyVelocityModel, measure_body_velocity, {"rate_hz": 4.0}),
    "uwb": (UwbModel, measure_uwb, {"rate_hz": 4.0, "anchors": ANCHORS}),
}
"""Section name -> model, measuring function, keys without which it does not work here."""

ERRORS = {
    "odometer": {
        "scale": {"scale_percent": 1.0, "scale_sd_percent": 3.0},
        "noise": {"speed_sd_mps": 0.05},
        "slip": {"slips_per_h": 120.0, "slip_mean_s": 5.0, "slip_sd_percent": 20.0},
    },
    "wheel_speeds": {
        "scale": {"scale_percent": (1.0, 2.0), "scale_sd_percent": 3.0},
        "noise": {"speed_sd_mps": 0.05},
    },
    "magnetometer": {
        "hard_iron": {"hard_iron_ut": (5.0, -3.0, 8.0), "hard_iron_sd_ut": 5.0},
        "soft_iron": {"soft_iron_sd_percent": 3.0},
        "sensor": {"scale_sd_percent": 1.0, "misalignment_sd_deg": 1.0},
        "noise": {"field_sd_nt": 50.0},
        "disturbance_b": {
            "correlated_sd_ut": 1.0,
            "correlated_tau_s": 10.0,
            "disturbances_per_h": 120.0,
            "disturbance_mean_s": 5.0,
            "disturbance_sd_ut": 10.0,
        },
    },
    "heading": {
        "bias": {"bias_deg": 1.0, "bias_sd_deg": 2.0},
        "correlated": {"correlated_sd_deg": 2.0, "correlated_tau_s": 30.0},
        "noise": {"heading_sd_deg": 4.0},
    },
    "barometer": {
        "weather": {"weather_sd_hpa": 5.0, "weather_tau_h": 12.0},
        "walk": {"pressure_walk_pa_per_sqrt_s": 1.0},
        "bias": {"bias_pa": 20.0, "bias_sd_pa": 50.0},
        "noise": {"pressure_sd_pa": 3.0},
    },
    "body_velocity": {
        "scale": {"scale_percent": 0.5, "scale_sd_percent": 0.5},
        "misalignment": {"misalignment_deg": (0.1, 0.2, -0.3), "misalignment_sd_deg": 0.5},
        "noise": {"velocity_sd_mps": 0.01},
    },
    "uwb": {
        "bias": {"bias_m": 0.1, "bias_sd_m": (0.1, 0.2, 0.3)},
        "nlos": {"nlos_percent": 20.0, "nlos_mean_m": 2.0},
        "noise": {"range_sd_cm": 10.0},
    },
}
"""Section name -> attribute of the truth -> keys that switch this error on."""


def sway():
    """A flight of figures of eight: banked, climbing, with all three rates."""
    return figure_eight_flight()


def attitude_b(motion, time):
    """Rotations that take body vectors to north-east-down, from roll, pitch and heading of the trajectory."""
    return Rotation.from_euler("ZYX", motion.trajectory(time).attitude[:, ::-1])


def point_velocity_twin(motion, time, lever_arm, step=2e-3):
    """Velocity of a point in body axes, by differences of its positions (fourth order, about 2e-6 m/s)."""

    def place(at):
        return motion.r_e(at) + motion.C_eb(at) @ np.asarray(lever_arm)

    near, far = place(time + step) - place(time - step), place(time + 2 * step) - place(time - 2 * step)
    return np.einsum("kji,kj->ki", motion.C_eb(time), (8.0 * near - far) / (12.0 * step))


def within_chi_square(values, sd):
    """Whether the mean square of independent normals lies in its 99.9 % interval, for every column."""
    low, high = stats.chi2.ppf([0.0005, 0.9995], len(values)) / len(values)
    ratio = np.mean(np.square(values), axis=0) / np.square(sd)
    return bool(np.all((low < ratio) & (ratio < high)))
