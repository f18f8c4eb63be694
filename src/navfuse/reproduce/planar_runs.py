"""The three algorithms of the planar tutorial on a drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfuse.planar import (
    ChannelNoise,
    check_yaw_against_gyro,
    complementary_yaw,
    dead_reckon,
    filter_positions,
    hard_iron,
    magnetic_yaw,
    to_north_east,
)
from navfuse.planar.position_filter import PlanarTrack
from navfuse.reproduce.planar_drives import Drive

Array = np.ndarray

GAIN = 1.0
WINDOW_S = 10.0
SPARSE = 5
NOISE = ChannelNoise(jerk=5.0, accel=0.5, position=0.9, velocity=0.05)
DEG = 180.0 / np.pi


@dataclass(frozen=True, eq=False)
class Yaws:
    """Algorithms 1 and 2 of a drive, (n,) arrays [rad]."""

    first: Array
    second: Array


def yaws(drive: Drive, *, north: bool = True, iron: bool = True, gain: float = GAIN) -> Yaws:
    """Run Algorithms 1 and 2.

    Parameters
    ----------
    drive : Drive
    north : bool
        Add the declination.
    iron : bool
        Subtract the centre of the circle that the readings draw.
    gain : float [1/s]
    """
    field = drive.field_b - hard_iron(drive.field_b) if iron else drive.field_b
    first = magnetic_yaw(field) + (drive.declination if north else 0.0)
    check_yaw_against_gyro(drive.time, drive.gyro_z, first)
    return Yaws(first, complementary_yaw(drive.time, drive.gyro_z, first, gain))


def track(drive: Drive, yaw: Array | None, every: int = 1, noise: ChannelNoise = NOISE) -> PlanarTrack:
    """Run Algorithm 3 with accelerations turned by a yaw (none without), and every so many of the fixes."""
    accel = np.full((drive.time.size, 2), np.nan) if yaw is None else to_north_east(drive.accel_b, yaw)
    fixes = slice(None, None, every)
    return filter_positions(
        drive.time, accel, drive.fix_time[fixes], drive.fix_position[fixes], drive.fix_velocity[fixes], noise
    )


def dead_reckoned(drive: Drive, yaw: Array, window: float = WINDOW_S) -> Array:
    """Positions (n, 2) from accelerations alone, begun anew from a fix in every window [s]; NaN before the first."""
    accel = to_north_east(drive.accel_b, yaw)
    out = np.full_like(accel, np.nan)
    edges = np.arange(drive.time[0], drive.time[-1], window)
    for begin, end in zip(edges, edges + window, strict=True):
        fix = int(np.searchsorted(drive.fix_time, begin - 1e-6))
        if fix == drive.fix_time.size or drive.fix_time[fix] >= end:
            continue
        rows = np.flatnonzero((drive.time >= drive.fix_time[fix] - 1e-6) & (drive.time < end - 1e-6))
        if rows.size > 1:
            out[rows] = dead_reckon(drive.time[rows], accel[rows], drive.fix_position[fix], drive.fix_velocity[fix])[0]
    return out


def held(drive: Drive, every: int = 1) -> Array:
    """The last fix (n, 2) at every time: GPS alone."""
    row = np.searchsorted(drive.fix_time[::every], drive.time + 1e-6, side="right") - 1
    return np.where((row >= 0)[:, None], drive.fix_position[::every][np.maximum(row, 0)], np.nan)


def yaw_error(found: Array, drive: Drive) -> Array:
    """Found minus reference [rad], -pi..pi."""
    return np.angle(np.exp(1j * (found - drive.yaw)))


def rms(values: Array) -> float:
    """Root mean square, NaN left out."""
    return float(np.sqrt(np.nanmean(np.square(values))))


def rms_length(vectors: Array) -> float:
    """Root mean square length of vectors (n, d), NaN left out."""
    return float(np.sqrt(np.nanmean(np.sum(np.square(vectors), axis=1))))
