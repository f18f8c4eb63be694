"""A trajectory: position, velocity and attitude over time, with standard deviations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from navfuse.errors import InputError

if TYPE_CHECKING:
    import pandas

Array = np.ndarray

POSITION_COLUMNS = ("time_s", "lat_deg", "lon_deg", "height_m")
"""Native columns that every trajectory has."""
GROUP_COLUMNS = {
    "velocity_n": ("vn_mps", "ve_mps", "vd_mps"),
    "attitude": ("roll_deg", "pitch_deg", "heading_deg"),
    "sd_position": ("sd_north_m", "sd_east_m", "sd_down_m"),
    "sd_velocity": ("sd_vn_mps", "sd_ve_mps", "sd_vd_mps"),
    "sd_attitude": ("sd_roll_deg", "sd_pitch_deg", "sd_heading_deg"),
}
"""Attribute of :class:`Trajectory` -> its native columns, in the order of the native table."""


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Position, velocity and attitude of the IMU over time.

    Attributes
    ----------
    time : (n,) array [s]
        Strictly increasing.
    lat, lon, height : (n,) arrays [rad, rad, m]
        Geodetic position on WGS 84, ellipsoidal height.
    velocity_n : (n, 3) array [m/s] or None
        Velocity relative to the Earth: north, east, down.
    attitude : (n, 3) array [rad] or None
        Roll, pitch, heading (0 = true north, clockwise), of body forward-right-down against north-east-down.
    sd_position : (n, 3) array [m] or None
        North, east, down.
    sd_velocity : (n, 3) array [m/s] or None
        North, east, down.
    sd_attitude : (n, 3) array [rad] or None
        Of roll, pitch, heading.
    source : str
        Where it came from, for messages.
    """

    time: Array
    lat: Array
    lon: Array
    height: Array
    velocity_n: Array | None = None
    attitude: Array | None = None
    sd_position: Array | None = None
    sd_velocity: Array | None = None
    sd_attitude: Array | None = None
    source: str = "trajectory"

    def __len__(self) -> int:
        return self.time.size

    @classmethod
    def from_columns(cls, columns: Mapping[str, Array], source: str = "trajectory") -> Trajectory:
        """Make a trajectory of native columns, such as a data frame's.

        Parameters
        ----------
        columns : mapping of str to (n,) array-like
            ``time_s, lat_deg, lon_deg, height_m`` and any of the groups of :data:`GROUP_COLUMNS`, each group whole.
            Other columns are left alone. Values are taken as they are;
            :func:`navfuse.io.trajectory_table.read_trajectory` checks and repairs.
        source : str
            Where they came from, for messages.

        Returns
        -------
        Trajectory
            Heading wrapped to 0 <= heading < 2 pi.

        Raises
        ------
        InputError
            If a column is missing or has another length than the time.
        """
        groups = {name: names for name, names in GROUP_COLUMNS.items() if any(column in columns for column in names)}
        wanted = [*POSITION_COLUMNS, *(column for names in groups.values() for column in names)]
        missing = [column for column in wanted if column not in columns]
        if missing:
            raise InputError(f"{source}: a trajectory needs the columns {', '.join(missing)} too")
        values = {column: np.array(columns[column], dtype=np.float64) for column in wanted}
        length = values["time_s"].shape
        for column, value in values.items():
            if value.ndim != 1 or value.shape != length:
                raise InputError(
                    f"{source}: column '{column}' has shape {value.shape}, time_s has {length}; all have to be alike"
                )
        triads = {
            name: np.column_stack([_to_si(column, values[column]) for column in names])
            for name, names in groups.items()
        }
        if "attitude" in triads:
            triads["attitude"][:, 2] = wrapped(triads["attitude"][:, 2], 2.0 * np.pi)
        time, lat, lon, height = (_to_si(column, values[column]) for column in POSITION_COLUMNS)
        return cls(time, lat, lon, height, **triads, source=source)

    def take(self, index: Array | slice) -> Trajectory:
        """Epochs picked by a mask, an index array or a slice."""
        picked = {
            entry.name: values[index]
            for entry in fields(self)
            if isinstance(values := getattr(self, entry.name), np.ndarray)
        }
        return replace(self, **picked)

    def to_columns(self) -> dict[str, Array]:
        """Native columns in their order.

        Returns
        -------
        dict of str to (n,) array
            Degrees, metres, m/s; heading in 0 <= heading < 360. Groups that the trajectory lacks are left out.
        """
        columns = {
            "time_s": self.time.copy(),
            "lat_deg": np.degrees(self.lat),
            "lon_deg": np.degrees(self.lon),
            "height_m": self.height.copy(),
        }
        for name, names in GROUP_COLUMNS.items():
            triad = getattr(self, name)
            if triad is not None:
                columns.update({column: _from_si(column, triad[:, axis]) for axis, column in enumerate(names)})
        if "heading_deg" in columns:
            columns["heading_deg"] = wrapped(columns["heading_deg"], 360.0)
        return columns

    def to_pandas(self) -> pandas.DataFrame:
        """The native columns as a data frame, indexed 0, 1, 2, ...

        Returns
        -------
        pandas.DataFrame
        """
        import pandas

        return pandas.DataFrame(self.to_columns())


def wrapped(angle: Array, turn: float) -> Array:
    """Angle in 0 <= angle < turn.

    Parameters
    ----------
    angle : array
        In the unit of `turn`.
    turn : float
        A full turn, 2 pi or 360.

    Returns
    -------
    array
        Never `turn` itself, which a plain modulo returns for tiny negative angles.
    """
    angle = np.mod(angle, turn)
    return np.where(angle >= turn, 0.0, angle)


def _to_si(column: str, values: Array) -> Array:
    return np.radians(values) if column.endswith("_deg") else values


def _from_si(column: str, values: Array) -> Array:
    return np.degrees(values) if column.endswith("_deg") else values.copy()
