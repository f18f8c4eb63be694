"""Logs of aiding sensors other than GNSS in internal form: SI units and radians, body axes forward-right-down.

Every log has ``time`` [s], ``source`` and ``notes`` as :class:`~navfuse.data.logs.ImuLog` has them, and ``columns()``:
the native table as column name -> values.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfuse.data.trajectory import wrapped

Array = np.ndarray

_AXES = "xyz"


@dataclass(frozen=True, slots=True, eq=False)
class OdometerLog:
    """Speed of a vehicle along its forward axis.

    Attributes
    ----------
    time : (n,) array [s]
        Strictly increasing.
    speed : (n,) array [m/s]
        Negative in reverse.
    sd_speed : (n,) array [m/s] or None
        Standard deviation of the noise, all > 0.
    source, notes : see :class:`~navfuse.data.logs.ImuLog`.
    """

    time: Array
    speed: Array
    sd_speed: Array | None = None
    source: str = "odometer"
    notes: tuple[str, ...] = ()

    def columns(self) -> dict[str, Array]:
        """Native columns."""
        return _with_sd({"time_s": self.time, "speed_mps": self.speed}, "sd_speed_mps", self.sd_speed)


@dataclass(frozen=True, slots=True, eq=False)
class WheelSpeedLog:
    """Speeds of the wheels of a vehicle, each in its own rolling direction.

    Attributes
    ----------
    time : (n,) array [s]
        Strictly increasing.
    wheels : tuple of m str
        Names, as they stand in the columns ``wheel_<name>_mps``.
    speed : (n, m) array [m/s]
        Negative when rolling backwards; NaN where a wheel gave none.
    source, notes : see :class:`~navfuse.data.logs.ImuLog`.
    """

    time: Array
    wheels: tuple[str, ...]
    speed: Array
    source: str = "wheel speeds"
    notes: tuple[str, ...] = ()

    def columns(self) -> dict[str, Array]:
        """Native columns."""
        return {"time_s": self.time} | {f"wheel_{name}_mps": self.speed[:, k] for k, name in enumerate(self.wheels)}


@dataclass(frozen=True, slots=True, eq=False)
class MagnetometerLog:
    """Magnetic flux density in body axes.

    Attributes
    ----------
    time : (n,) array [s]
        Strictly increasing.
    field_b : (n, 3) array [T]
        Body x, y, z. Level and heading to magnetic north in the northern hemisphere, x and z are positive and y zero.
    source, notes : see :class:`~navfuse.data.logs.ImuLog`.
    """

    time: Array
    field_b: Array
    source: str = "magnetometer"
    notes: tuple[str, ...] = ()

    def columns(self) -> dict[str, Array]:
        """Native columns, in microtesla."""
        return {"time_s": self.time} | {f"mag_{axis}_ut": 1e6 * self.field_b[:, k] for k, axis in enumerate(_AXES)}


@dataclass(frozen=True, slots=True, eq=False)
class HeadingLog:
    """Heading of the body x axis.

    Attributes
    ----------
    time : (n,) array [s]
        Strictly increasing.
    heading : (n,) array [rad]
        From true north, clockwise, 0 <= heading < 2 pi.
    sd_heading : (n,) array [rad] or None
        Standard deviation, all > 0.
    source, notes : see :class:`~navfuse.data.logs.ImuLog`.
    """

    time: Array
    heading: Array
    sd_heading: Array | None = None
    source: str = "heading"
    notes: tuple[str, ...] = ()

    def columns(self) -> dict[str, Array]:
        """Native columns, in degrees, 0 <= heading < 360."""
        sd = None if self.sd_heading is None else np.degrees(self.sd_heading)
        columns = {"time_s": self.time, "heading_deg": wrapped(np.degrees(self.heading), 360.0)}
        return _with_sd(columns, "sd_heading_deg", sd)


@dataclass(frozen=True, slots=True, eq=False)
class BarometerLog:
    """Static pressure, or the height that a barometer made of it, or both.

    Attributes
    ----------
    time : (n,) array [s]
        Strictly increasing.
    pressure : (n,) array [Pa] or None
    height : (n,) array [m] or None
        As the instrument gives it: usually the height in the standard atmosphere above its reference pressure, that is
        about the height above *sea level*, not the ellipsoid.
    source, notes : see :class:`~navfuse.data.logs.ImuLog`.
    """

    time: Array
    pressure: Array | None = None
    height: Array | None = None
    source: str = "barometer"
    notes: tuple[str, ...] = ()

    def columns(self) -> dict[str, Array]:
        """Native columns, pressure in hectopascal."""
        columns = {"time_s": self.time}
        if self.pressure is not None:
            columns["pressure_hpa"] = self.pressure / 100.0
        if self.height is not None:
            columns["height_m"] = self.height
        return columns


@dataclass(frozen=True, slots=True, eq=False)
class BodyVelocityLog:
    """Velocity resolved in body axes, as Doppler radars and Doppler velocity logs give it.

    Attributes
    ----------
    time : (n,) array [s]
        Strictly increasing.
    velocity_b : (n, 3) array [m/s]
        Body x, y, z. NaN where an axis was not measured at that time; every row holds at least one number.
    sd_velocity : (n, 3) array [m/s] or None
        Standard deviation of the noise; NaN where the velocity is.
    source, notes : see :class:`~navfuse.data.logs.ImuLog`.
    """

    time: Array
    velocity_b: Array
    sd_velocity: Array | None = None
    source: str = "body velocity"
    notes: tuple[str, ...] = ()

    def columns(self) -> dict[str, Array]:
        """Native columns; axes that were never measured are left out."""
        measured = [k for k in range(3) if np.isfinite(self.velocity_b[:, k]).any()]
        columns = {"time_s": self.time} | {f"v_{_AXES[k]}_mps": self.velocity_b[:, k] for k in measured}
        if self.sd_velocity is not None:
            columns |= {f"sd_v_{_AXES[k]}_mps": self.sd_velocity[:, k] for k in measured}
        return columns


@dataclass(frozen=True, slots=True, eq=False)
class UwbAnchors:
    """Fixed radio anchors.

    Attributes
    ----------
    name : (m,) array of str
        All different.
    lat, lon, height : (m,) arrays [rad, rad, m]
        Geodetic position on WGS 84, ellipsoidal height.
    source, notes : see :class:`~navfuse.data.logs.ImuLog`.
    """

    name: Array
    lat: Array
    lon: Array
    height: Array
    source: str = "anchors"
    notes: tuple[str, ...] = ()

    def columns(self) -> dict[str, Array]:
        """Native columns, latitude and longitude in degrees."""
        return {
            "anchor": self.name,
            "lat_deg": np.degrees(self.lat),
            "lon_deg": np.degrees(self.lon),
            "height_m": self.height,
        }


@dataclass(frozen=True, slots=True, eq=False)
class UwbLog:
    """Ranges to radio anchors.

    Attributes
    ----------
    time : (n,) array [s]
        Never decreasing; equal stamps belong to different anchors.
    anchor : (n,) array of str
        Name of the anchor in :class:`UwbAnchors`.
    range : (n,) array [m]
        From the antenna on the body to the anchor, >= 0.
    sd_range : (n,) array [m] or None
        Standard deviation of the noise, all > 0.
    source, notes : see :class:`~navfuse.data.logs.ImuLog`.
    """

    time: Array
    anchor: Array
    range: Array
    sd_range: Array | None = None
    source: str = "uwb"
    notes: tuple[str, ...] = ()

    def columns(self) -> dict[str, Array]:
        """Native columns; the anchors are a table of their own."""
        columns = {"time_s": self.time, "anchor": self.anchor, "range_m": self.range}
        return _with_sd(columns, "sd_range_m", self.sd_range)


def _with_sd(columns: dict[str, Array], name: str, sd: Array | None) -> dict[str, Array]:
    return columns if sd is None else columns | {name: sd}
