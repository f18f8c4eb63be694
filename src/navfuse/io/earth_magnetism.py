"""The magnetic field of the Earth by the World Magnetic Model, at a place and along a track.

The model (Chulliat et al., The US/UK World Magnetic Model for 2025-2030, 2025) is evaluated by the package pygeomag,
which brings the coefficients of 2010 to 2030. It agrees with the twelve published test values of 2025 to all their
digits (0.1 nT). The model itself has an error of 0.14 uT, one sigma, in the vertical and north components (ibid.), from
what the crust adds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit

from navfuse.core.earth import dcm_en, ecef_to_geodetic_batch
from navfuse.core.rotation import mat_vec
from navfuse.errors import ConfigError, InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Array = np.ndarray

FIRST_YEAR, LAST_YEAR = 2010.0, 2030.0
_LOWEST, _HIGHEST = -1e3, 850e3
_NANOTESLA = 1e-9
_CELL = 3000.0
_STEP = 1000.0


def magnetic_field_n(lat: ArrayLike, lon: ArrayLike, height: ArrayLike, year: float) -> Array:
    """Magnetic field of the Earth, evaluated point by point (0.1 ms each).

    Parameters
    ----------
    lat, lon, height : (n,) arrays [rad, rad, m]
        On WGS 84, -1 to 850 km high.
    year : float
        Decimal year, 2010 <= year < 2030.

    Returns
    -------
    (n, 3) array [T]
        North, east, down.

    Raises
    ------
    ConfigError
        For another year, or if the package pygeomag is not installed.
    InputError
        For a height outside the domain of the model.
    """
    model = _world_magnetic_model(year)
    lat, lon, height = np.broadcast_arrays(*(np.atleast_1d(np.asarray(x, dtype=float)) for x in (lat, lon, height)))
    outside = (height < _LOWEST) | (height > _HIGHEST)
    if outside.any():
        raise InputError(
            f"the World Magnetic Model holds from {_LOWEST / 1e3:g} to {_HIGHEST / 1e3:g} km above the ellipsoid, not "
            f"at {height[np.argmax(outside)] / 1e3:g} km; give the field itself, north, east and down"
        )
    places = zip(np.degrees(lat), np.degrees(lon), height / 1e3, strict=True)
    fields = [model.calculate(glat=a, glon=b, alt=c, time=year) for a, b, c in places]
    return _NANOTESLA * np.array([[field.x, field.y, field.z] for field in fields]).reshape(-1, 3)


def magnetic_field_along(r_e: Array, year: float) -> Array:
    """Magnetic field of the Earth along a track.

    Parameters
    ----------
    r_e : (n, 3) array [m]
        Positions in e, one after the other.
    year : float
        As in :func:`magnetic_field_n`.

    Returns
    -------
    (n, 3) array [T]
        Resolved in e.

    Raises
    ------
    ConfigError, InputError
        As :func:`magnetic_field_n`.

    Notes
    -----
    The field and its gradient, by central differences over 2 km, are evaluated where the track is 3 km from the last
    such point, and continued from there linearly. Within 0.1 nT of the evaluation at every point, near the surface and
    in the air, and so are the steps from one cell to the next.
    """
    node, cell = _cells(r_e, _CELL)
    centre = r_e[node]
    offsets = _STEP * np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])
    field = _field_e((centre[:, None, :] + offsets).reshape(-1, 3), year).reshape(-1, 7, 3)
    gradient = (field[:, 1:4] - field[:, 4:7]) / (2.0 * _STEP)
    return field[cell, 0] + np.einsum("ki,kij->kj", r_e - centre[cell], gradient[cell])


@njit(cache=True, error_model="numpy")
def _walk(r_e, reach, cell):
    """Number, for each point (n, 3), the cell of the track it is in; a cell ends `reach` from its first point."""
    first = 0
    for k in range(1, r_e.shape[0]):
        dx, dy, dz = r_e[k, 0] - r_e[first, 0], r_e[k, 1] - r_e[first, 1], r_e[k, 2] - r_e[first, 2]
        cell[k] = cell[k - 1]
        if dx * dx + dy * dy + dz * dz > reach * reach:
            first = k
            cell[k] += 1


def _cells(r_e: Array, reach: float) -> tuple[Array, Array]:
    """Rows at which cells begin, and the cell of every row."""
    cell = np.zeros(r_e.shape[0], dtype=np.int64)
    _walk(np.ascontiguousarray(r_e), reach, cell)
    return np.flatnonzero(np.diff(cell, prepend=-1)), cell


def _field_e(r_e: Array, year: float) -> Array:
    lat, lon, height = ecef_to_geodetic_batch(np.ascontiguousarray(r_e))
    field = magnetic_field_n(lat, lon, height, year)
    _turn_to_e(lat, lon, field)
    return field


@njit(cache=True, error_model="numpy")
def _turn_to_e(lat, lon, vectors):
    """Turn vectors (n, 3) from north-east-down of their places to e, in place."""
    for k in range(lat.size):
        vectors[k] = mat_vec(dcm_en(lat[k], lon[k]), vectors[k])


def _world_magnetic_model(year: float) -> Any:
    try:
        from pygeomag import GeoMag
    except ImportError as error:
        raise ConfigError(
            "the magnetic field of the Earth needs the package pygeomag: install navfuse[magnetic], or give the field "
            "itself (north, east, down), as field_ut does"
        ) from error
    if not FIRST_YEAR <= year < LAST_YEAR:
        raise ConfigError(
            f"the World Magnetic Model is there for the years {FIRST_YEAR:g} to {LAST_YEAR:g}, not for {year:g}; give "
            "the field itself (north, east, down), as field_ut does"
        )
    return GeoMag(base_year=int(year))  # pyright: ignore[reportArgumentType]  # an int is what it documents
