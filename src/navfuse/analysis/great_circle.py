"""Distance over the ground on a sphere: the haversine formula."""

from __future__ import annotations

import numpy as np

Array = np.ndarray

MEAN_RADIUS = 6371008.7714
"""Mean radius of the WGS 84 ellipsoid [m], (2 a + b) / 3."""


def haversine(lat_1: Array, lon_1: Array, lat_2: Array, lon_2: Array) -> Array:
    """Great-circle distance between points on a sphere of the Earth's mean radius.

    Parameters
    ----------
    lat_1, lon_1, lat_2, lon_2 : arrays or floats [rad]

    Returns
    -------
    array or float [m]

    Notes
    -----
    ``d = 2 R atan2(sqrt(a), sqrt(1 - a))`` with ``a = sin^2(dlat / 2) + cos(lat_1) cos(lat_2) sin^2(dlon / 2)``
    (Sinnott 1984, *Virtues of the haversine*). Unlike the law of cosines, whose arc cosine cannot tell one from
    1 - 1e-16, it loses nothing over small distances: what limits a millimetre is the rounding of the angles, some
    nanometres.

    It is no measure of a navigation error by itself. It takes the Earth for a sphere, which is wrong by up to 0.56 %
    of the distance (a short way along the meridian at the equator is 0.56 % longer than on the ellipsoid, 0.45 %
    shorter at the poles), and it knows nothing of height. The straight distance in three dimensions has neither fault.
    """
    a = np.sin(0.5 * (lat_2 - lat_1)) ** 2 + np.cos(lat_1) * np.cos(lat_2) * np.sin(0.5 * (lon_2 - lon_1)) ** 2
    return 2.0 * MEAN_RADIUS * np.arctan2(np.sqrt(a), np.sqrt(np.maximum(1.0 - a, 0.0)))
