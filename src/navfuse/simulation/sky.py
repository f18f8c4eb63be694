"""What stands between an antenna and the satellites: sectors of sky that houses, trees or a roof hide."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from navfuse.core.constants import TWO_PI
from navfuse.core.printed_keys import naming_keys, shown
from navfuse.errors import ConfigError
from navfuse.simulation.printed_fields import one_number, to_fields, unknown_key, windows

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Array = np.ndarray

_DEG = math.pi / 180.0

SECTOR_UNITS: dict[str, tuple[str, float]] = {
    "azimuth_from_deg": ("azimuth_from", _DEG),
    "azimuth_to_deg": ("azimuth_to", _DEG),
    "elevation_below_deg": ("elevation_below", _DEG),
    "windows_s": ("windows", 1.0),
}
"""Key with its printed unit -> (field of :class:`SkySector`, factor to SI); ``relative_to`` stands beside them."""


@dataclass(frozen=True, slots=True, eq=False)
class SkySector:
    """A piece of sky that is hidden, always or for some time.

    Attributes
    ----------
    azimuth_from, azimuth_to : float [rad]
        The sector runs clockwise from one to the other, through north where the second is the smaller: 350 deg to 10
        deg is 20 deg wide, 0 to 360 deg is all round. Both in -2 pi .. 2 pi; the first edge is inside, the second is
        not.
    elevation_below : float [rad]
        Satellites lower than this are hidden, 0 < elevation_below <= pi / 2; pi / 2 hides the zenith too.
    relative_to : {"north", "vehicle"}
        What azimuths count from: true north, or the nose of the body, clockwise seen from above.
    windows : (m, 2) array [s]
        Times [from, to) of the motion in which the sector hides; empty for always. A tunnel is a sector of 0 to 360 deg
        below 90 deg with a window.

    Raises
    ------
    ConfigError
        On construction, for numbers out of these ranges, a sector without width, or one wider than all round.
    """

    azimuth_from: float
    azimuth_to: float
    elevation_below: float
    relative_to: str = "north"
    windows: ArrayLike = ()

    def __post_init__(self) -> None:
        for name in ("azimuth_from", "azimuth_to"):
            value = one_number(f"{name} of a sky sector", getattr(self, name), least=-math.inf)
            if abs(value) > TWO_PI * (1.0 + 1e-12):
                raise ConfigError(
                    f"{name} of a sky sector must lie in -360 .. 360 deg, not {math.degrees(value):g} deg"
                )
            object.__setattr__(self, name, value)
        low = one_number("elevation_below of a sky sector", self.elevation_below, above=True)
        if low > 0.5 * math.pi * (1.0 + 1e-12):
            raise ConfigError(f"elevation_below of a sky sector must be at most 90 deg, not {math.degrees(low):g} deg")
        object.__setattr__(self, "elevation_below", low)
        turn = self.azimuth_to - self.azimuth_from
        if turn == 0.0 or abs(turn) > TWO_PI * (1.0 + 1e-12):
            raise ConfigError(
                f"a sky sector from {math.degrees(self.azimuth_from):g} to {math.degrees(self.azimuth_to):g} deg is "
                f"{'empty' if turn == 0.0 else 'wider than all round'}; all round is 0 to 360"
            )
        if self.relative_to not in ("north", "vehicle"):
            raise ConfigError(
                f"relative_to of a sky sector must be 'north' or 'vehicle', not {shown(self.relative_to)}"
            )
        object.__setattr__(self, "windows", windows("windows of a sky sector", self.windows))

    @classmethod
    def from_datasheet(cls, /, relative_to: str = "north", **printed: Any) -> SkySector:
        """A sector from keys that end in their unit, :data:`SECTOR_UNITS`.

        Raises
        ------
        ConfigError
            For an unknown or missing key (the nearest is named), or a value that the sector refuses.
        """
        given = to_fields("sky sector", printed, SECTOR_UNITS)
        for key, (name, _) in SECTOR_UNITS.items():
            if name not in given and name != "windows":
                raise ConfigError(f"a sky sector needs {key!r}")
        with naming_keys(printed, SECTOR_UNITS):
            return cls(relative_to=relative_to, **given)  # pyright: ignore[reportArgumentType]

    @property
    def width(self) -> float:
        """Angle from the first edge clockwise to the second [rad], up to 2 pi."""
        turn = self.azimuth_to - self.azimuth_from
        return turn if turn > 0.0 else turn + TWO_PI if turn > -TWO_PI else TWO_PI

    def hides(self, time: Array, elevation: Array, azimuth: Array, heading: Array) -> Array:
        """Which satellites are hidden.

        Parameters
        ----------
        time, heading : (n,) arrays [s], [rad]
        elevation, azimuth : (n, m) arrays [rad]
            Azimuth from true north.

        Returns
        -------
        (n, m) array of bool
        """
        turned = azimuth - heading[:, None] if self.relative_to == "vehicle" else azimuth
        inside = np.mod(turned - self.azimuth_from, TWO_PI) < self.width
        if self.width >= TWO_PI:
            inside[:] = True
        hidden = inside & ((elevation < self.elevation_below) | (self.elevation_below >= 0.5 * math.pi))
        spans = np.asarray(self.windows)
        if spans.size:
            hidden &= within(time, spans)[:, None]
        return hidden


@dataclass(frozen=True, slots=True)
class SatelliteOutage:
    """A satellite that is not received for some time.

    Attributes
    ----------
    satellite : str
    from_s, to_s : float [s]
        Times [from, to) of the motion.

    Raises
    ------
    ConfigError
        For times that are not in order.
    """

    satellite: str
    from_s: float = -math.inf
    to_s: float = math.inf

    def __post_init__(self) -> None:
        for name in ("from_s", "to_s"):
            value = one_number(f"{name} of a satellite outage", getattr(self, name), least=-math.inf, infinite=True)
            object.__setattr__(self, name, value)
        if not self.from_s < self.to_s:
            raise ConfigError(f"the outage of satellite {self.satellite!r} must have from_s < to_s")


def sector_of(given: SkySector | Mapping[str, Any]) -> SkySector:
    """A sector as it is, or from a mapping of the keys of :meth:`SkySector.from_datasheet`."""
    return given if isinstance(given, SkySector) else SkySector.from_datasheet(**_mapping("sectors", given))


def outage_of(given: SatelliteOutage | Mapping[str, Any]) -> SatelliteOutage:
    """An outage as it is, or from a mapping of its fields."""
    if isinstance(given, SatelliteOutage):
        return given
    known = [entry.name for entry in dataclasses.fields(SatelliteOutage)]
    for key in _mapping("satellite_outages", given):
        if key not in known:
            raise unknown_key("satellite outage", key, known)
    if "satellite" not in given:
        raise ConfigError("a satellite outage needs 'satellite'")
    return SatelliteOutage(**given)


def _mapping(name: str, given: Any) -> Mapping[str, Any]:
    if not isinstance(given, Mapping):
        raise ConfigError(f"{name} must hold tables of keys and values, not {shown(given)}")
    return given


def within(time: Array, spans: Array) -> Array:
    """Which times lie in any of the windows [from, to)."""
    inside = np.zeros(time.size, dtype=bool)
    for begin, end in spans:
        inside |= (time >= begin) & (time < end)
    return inside
