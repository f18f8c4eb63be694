"""Sensor logs in internal form: frozen, checked once at the edge, SI units and radians."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from navfuse.data.gps_epoch import GpsEpoch

Array = np.ndarray


@dataclass(frozen=True, slots=True)
class ImuLog:
    """Inertial measurements in body axes (forward, right, down).

    Attributes
    ----------
    time : (n,) array [s]
        Strictly increasing stamps. For increments, the *end* of the interval each row covers.
    gyro : (n, 3) array
        Angular rate [rad/s] about body x, y, z, or angle increments [rad].
    accel : (n, 3) array
        Specific force [m/s^2] along body x, y, z (a level sensor at rest reads -g on z), or velocity increments [m/s].
    kind : {"rates", "increments"}
        What the rows hold. Increments cover (time[k-1], time[k]]; the interval of row 0 is unknown, so row 0 is never
        integrated.
    source : str
        Where the log came from, for messages.
    notes : tuple of str
        What was repaired or suspicious while reading (also emitted as warnings).
    """

    time: Array
    gyro: Array
    accel: Array
    kind: Literal["rates", "increments"] = "rates"
    source: str = "imu"
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class GnssLog:
    """GNSS fixes of the antenna.

    Attributes
    ----------
    time : (n,) array [s]
        Strictly increasing stamps, same scale as the IMU.
    lat, lon, height : (n,) arrays [rad, rad, m]
        Geodetic position on WGS 84, ellipsoidal height.
    sd_position : (n, 3) array [m]
        Standard deviations north, east, down; all > 0.
    velocity_n : (n, 3) array [m/s] or None
        North, east, down. Rows may be NaN where a fix has no velocity.
    sd_velocity : (n, 3) array [m/s] or None
    fix : (n,) array of str or None
        Fix type as the file names it, e.g. "rtk-fixed".
    n_satellites : (n,) int array or None
    epoch : GpsEpoch or None
        GPS time from which `time` counts, where the file or its reader says so.
    source, notes : see :class:`ImuLog`.
    """

    time: Array
    lat: Array
    lon: Array
    height: Array
    sd_position: Array
    velocity_n: Array | None = None
    sd_velocity: Array | None = None
    fix: Array | None = None
    n_satellites: Array | None = None
    epoch: GpsEpoch | None = None
    source: str = "gnss"
    notes: tuple[str, ...] = ()

    def take(self, index: Array | slice) -> GnssLog:
        """Rows picked by a mask, an index array or a slice."""
        rows = {name: None if (values := getattr(self, name)) is None else values[index] for name in _GNSS_ROWS}
        return replace(self, **rows)

    def joined(self, later: GnssLog) -> GnssLog:
        """The log with a later block of the same receiver behind it; what one of them lacks is left out."""
        pairs = {name: (getattr(self, name), getattr(later, name)) for name in _GNSS_ROWS}
        rows = {name: None if a is None or b is None else np.concatenate([a, b]) for name, (a, b) in pairs.items()}
        return replace(self, **rows)


_GNSS_ROWS = ("time", "lat", "lon", "height", "sd_position", "velocity_n", "sd_velocity", "fix", "n_satellites")
