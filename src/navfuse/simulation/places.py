"""Directions on the ellipsoid, and their coordinates in the plane of a map."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from navfuse.simulation.paths import LocalMap

Array = np.ndarray


def ellipsoid_normals(lat: ArrayLike, lon: ArrayLike) -> Array:
    """Unit vectors (n, 3) in e that point up at latitudes and longitudes [rad]."""
    lat, lon = np.asarray(lat, dtype=float), np.asarray(lon, dtype=float)
    return np.column_stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])


def ned_matrices(lat: Array, lon: Array) -> Array:
    """``C_en`` (n, 3, 3) of every place: columns north, east, down."""
    down = -ellipsoid_normals(lat, lon)
    north = np.column_stack([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
    return np.stack([north, np.cross(down, north), down], axis=2)


def middle_map(normals: Array, height: float) -> LocalMap | None:
    """Map around the mean direction of (n, 3) normals, or None if they are spread over half the Earth."""
    mean = normals.mean(axis=0)
    if np.linalg.norm(mean) < 0.5:
        return None
    lat, lon = math.atan2(mean[2], math.hypot(mean[0], mean[1])), math.atan2(mean[1], mean[0])
    return LocalMap.at(lat, lon, height)


def plane_coordinates(local: LocalMap, normals: Array) -> Array:
    """North and east (n, 2) [m] in the plane of a map: the inverse of :meth:`LocalMap.normal`."""
    north, east = normals @ local.north, normals @ local.east
    sine = np.hypot(north, east)
    small = sine < 1e-12
    stretch = np.where(small, 1.0, np.arctan2(sine, normals @ local.up) / np.where(small, 1.0, sine))
    return np.column_stack([stretch * north * local.radius_north, stretch * east * local.radius_east])
