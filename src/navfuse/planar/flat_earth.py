"""A flat Earth around a place: degrees to metres and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from navfuse.core.earth import radii
from navfuse.errors import InputError

Array = np.ndarray

REACH = 0.05
"""Distance [rad of latitude] from the place up to which it is taken for flat, about 300 km."""


def metres_per_degree(lat: float, height: float = 0.0) -> tuple[float, float]:
    """Length of a degree of latitude and of one of longitude on WGS 84 [m].

    Parameters
    ----------
    lat : float [rad]
    height : float [m]
        Above the ellipsoid.

    Notes
    -----
    (R_N + h) and (R_E + h) cos(lat) times pi / 180 with the radii of curvature of the meridian and across it.
    """
    R_N, R_E = radii(np.sin(lat))
    return float(np.radians(R_N + height)), float(np.radians((R_E + height) * np.cos(lat)))


@dataclass(frozen=True, slots=True)
class FlatEarth:
    """Metres north and east of a place.

    Attributes
    ----------
    lat, lon : float [rad]
    height : float [m]
        Of the place, above the ellipsoid.

    Notes
    -----
    The metres per radian are those of the place. At a distance d the error grows as d^2 tan(lat) / (2 R): 0.06 mm at
    30 m, 6 cm at 1 km at a latitude of 37 deg.
    """

    lat: float
    lon: float
    height: float = 0.0

    def to_metres(self, lat: ArrayLike, lon: ArrayLike) -> Array:
        """Metres north and east (n, 2) of positions [rad].

        Raises
        ------
        InputError
            If one is too far away for a flat Earth, as degrees for radians are.
        """
        dlat = np.asarray(lat, dtype=float) - self.lat
        dlon = np.asarray(lon, dtype=float) - self.lon
        dlon = dlon - 2.0 * np.pi * np.round(dlon / (2.0 * np.pi))
        away = np.nanmax(np.hypot(dlat, dlon * np.cos(self.lat)), initial=0.0)
        if away > REACH:
            raise InputError(
                f"a position is {np.degrees(away):.3g} deg from ({np.degrees(self.lat):.4f},"
                f" {np.degrees(self.lon):.4f}) deg: too far for a flat Earth. Are these degrees? Give radians"
            )
        return np.degrees(np.column_stack((dlat, dlon))) * metres_per_degree(self.lat, self.height)

    def to_geodetic(self, metres: ArrayLike) -> tuple[Array, Array]:
        """Latitude and longitude [rad] of metres north and east (n, 2)."""
        dlat, dlon = (np.asarray(metres, dtype=float) / metres_per_degree(self.lat, self.height)).T
        return self.lat + np.radians(dlat), self.lon + np.radians(dlon)
