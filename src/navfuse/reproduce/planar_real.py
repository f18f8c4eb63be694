"""The planar tutorial on real logs: a phone in a car, and a VN-100 driven in circles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from navfuse.errors import InputError
from navfuse.planar import ChannelNoise, planar_dcm, to_north_east
from navfuse.report.study_figures import Curve, Panel, Picture
from navfuse.reproduce.planar_drives import COMMA, VN100, Drive, phone_in_a_car, sensor_in_circles
from navfuse.reproduce.planar_runs import (
    DEG,
    WINDOW_S,
    Yaws,
    dead_reckoned,
    held,
    rms,
    rms_length,
    track,
    yaw_error,
    yaws,
)
from navfuse.reproduce.study import Table, Wishes

Array = np.ndarray

PHONE_SPARSE = 10
PHONE_NOISE = ChannelNoise(jerk=5.0, accel=1.5, position=3.0, velocity=0.3)
"""Of a phone that is not level: gravity leaks into its accelerations."""
REAL_NOTES = (
    f"{COMMA}: a straight road, so that iron cannot be found by a circle; the offset that is left after adding the"
    " declination is that of the field inside car and phone. The phone is not level: gravity leaks into its"
    " accelerations, which is most of what dead reckoning is off by: 'without mean error' takes it out with the help"
    " of the reference.",
    f"{VN100}: the reference is the sensor's own yaw, which it makes of the same field and gyro: agreement, not truth.",
)


def real_logs(wishes: Wishes) -> tuple[Table, dict[str, Picture], dict[str, dict[str, float]], list[str]]:
    """Table, pictures, figures and notes of both logs.

    Raises
    ------
    InputError
        If a file is missing or cannot be used.
    """
    phone, circles = phone_in_a_car(wishes), sensor_in_circles(wishes)
    found: dict[str, dict[str, float]] = {}
    drawn: dict[str, Picture] = {}
    notes: list[str] = [*REAL_NOTES]
    for name, drive, iron in (
        (COMMA, phone, False),
        (VN100, circles, False),
        (f"{VN100}, iron removed", circles, True),
    ):
        try:
            both = yaws(drive, iron=iron)
        except InputError as refused:
            notes.append(f"{name}, as it comes, is refused by the check of yaw against gyro: {refused}.")
            continue
        found[name] = _yaw_figures(both, drive)
        drawn["yaw-" + name.replace(", ", "-").replace(" ", "-")] = _yaw_picture(name, both, drive)
    figures, picture = _phone_positions(phone)
    found[COMMA] |= figures
    drawn[f"track-{COMMA}"] = picture
    rows = tuple(
        (name, key.replace("_", " "), f"{value:.2f}") for name, entry in found.items() for key, value in entry.items()
    )
    note = (
        "Scatter is about the mean. 'Aligned': a constant is added, found by the course of the receiver over the first"
        f" {WINDOW_S:g} s. 'Sparse': a fix a second. Position and velocity: rms, horizontal, against the reference."
    )
    return Table("Real logs", ("log", "what, unit last", "value"), rows, note), drawn, found, notes


def _yaw_figures(both: Yaws, drive: Drive) -> dict[str, float]:
    entry: dict[str, float] = {}
    for label, yaw in (("1", both.first), ("2", both.second)):
        error = yaw_error(yaw, drive)
        mean = float(np.angle(np.mean(np.exp(1j * error))))
        entry[f"yaw_{label}_mean_error_deg"] = mean * DEG
        entry[f"yaw_{label}_scatter_deg"] = rms(np.angle(np.exp(1j * (error - mean)))) * DEG
    return entry


def _yaw_picture(name: str, both: Yaws, drive: Drive) -> Picture:
    curves = tuple(
        Curve(label, drive.time - drive.time[0], np.unwrap(yaw) * DEG)
        for label, yaw in (("Algorithm 1", both.first), ("Algorithm 2", both.second), ("reference", drive.yaw))
    )
    return Picture(f"Yaw, {name}", (Panel("time [s]", "yaw, unwrapped [deg]", curves),), row_in=2.8)


def course_offset(yaw: Array, drive: Drive, duration: float = WINDOW_S, slowest: float = 3.0) -> float:
    """What a yaw lacks [rad] against the course of the receiver over the first seconds: a car drives where it points.

    Fixes slower than `slowest` [m/s] are left out.
    """
    early = (np.hypot(*drive.fix_velocity.T) > slowest) & (drive.fix_time < drive.time[0] + duration)
    course = np.arctan2(drive.fix_velocity[early, 1], drive.fix_velocity[early, 0])
    at = np.interp(drive.fix_time[early], drive.time, np.unwrap(yaw))
    return float(np.angle(np.mean(np.exp(1j * (course - at)))))


def _mean_error(drive: Drive) -> Array:
    """Mean error (2,) of the accelerations along body x and y [m/s^2], against the reference."""
    velocity = drive.velocity
    change = (velocity[-1] - velocity[0]) - np.sum(
        to_north_east(drive.accel_b[1:], drive.yaw[1:]) * np.diff(drive.time)[:, None], axis=0
    )
    # The heading of the drive hardly changes: its mean turns north and east back into forward and right.
    return -(planar_dcm(float(np.mean(drive.yaw))).T @ change) / (drive.time[-1] - drive.time[0])


def _phone_positions(drive: Drive) -> tuple[dict[str, float], Picture]:
    both = yaws(drive, iron=False)
    aligned = [yaw + course_offset(yaw, drive) for yaw in (both.first, both.second)]
    entry: dict[str, float] = {}
    for label, yaw in zip("12", aligned, strict=True):
        entry[f"yaw_{label}_aligned_rms_deg"] = rms(yaw_error(yaw, drive)) * DEG
        entry[f"position_{label}_dead_reckoned_m"] = rms_length(dead_reckoned(drive, yaw) - drive.position)
    level = replace(drive, accel_b=drive.accel_b - _mean_error(drive))
    entry["position_2_dead_reckoned_without_mean_error_m"] = rms_length(
        dead_reckoned(level, aligned[1]) - drive.position
    )
    full = track(drive, aligned[1], noise=PHONE_NOISE)
    sparse = track(drive, aligned[1], PHONE_SPARSE, PHONE_NOISE)
    entry |= {
        "position_3_m": rms_length(full.position - drive.position),
        "position_gps_held_m": rms_length(held(drive) - drive.position),
        "position_3_sparse_m": rms_length(sparse.position - drive.position),
        "position_gps_held_sparse_m": rms_length(held(drive, PHONE_SPARSE) - drive.position),
        "velocity_3_mps": rms_length(full.velocity - drive.velocity),
    }
    since = drive.time - drive.time[0], drive.fix_time - drive.time[0]
    panels = []
    for unit, fixes, values, reference in (
        ("m/s", drive.fix_velocity, full.velocity, drive.velocity),
        ("m", drive.fix_position, full.position, drive.position),
    ):
        for k, side in ((1, "east"), (0, "north")):
            curves = (
                Curve("GPS", since[1], fixes[:, k], "points"),
                Curve("filter", since[0], values[:, k]),
                Curve("reference", since[0], reference[:, k]),
            )
            panels.append(Panel("time [s]", f"{side} [{unit}]", curves))
    return entry, Picture(f"Velocity and position, {COMMA}", tuple(panels), columns=2, width_in=9.5)
