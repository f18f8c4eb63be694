"""Delays of satellite signals in the atmosphere: zenith values, and how they grow towards the horizon."""

from __future__ import annotations

import numpy as np

Array = np.ndarray

IONOSPHERE_HEIGHT = 350e3
"""Height of the thin layer that stands for the ionosphere [m] (IS-GPS-200 uses the same)."""
_MEAN_RADIUS = 6371e3
_TROPOPAUSE_TEMPERATURE = 216.65


def ionosphere_obliquity(elevation: Array) -> Array:
    """Slant over zenith delay of the ionosphere.

    Parameters
    ----------
    elevation : array [rad]

    Returns
    -------
    array
        1 at the zenith, about 3.2 at the horizon.

    Notes
    -----
    Thin layer: one over the cosine of the zenith angle where the ray pierces it. Source: Groves (2013), section 9.3.2,
    with a layer at 350 km above a sphere of 6371 km.
    """
    pierce = _MEAN_RADIUS / (_MEAN_RADIUS + IONOSPHERE_HEIGHT) * np.cos(elevation)
    return 1.0 / np.sqrt(1.0 - pierce**2)


def troposphere_mapping(elevation: Array) -> Array:
    """Slant over zenith delay of the troposphere.

    Parameters
    ----------
    elevation : array [rad]

    Returns
    -------
    array
        1 at the zenith, 2 at 30 deg, 10.2 at 5 deg.

    Notes
    -----
    Source: Black and Eisner (1984), as in RTCA DO-229, A.4.2.4: ``1.001 / sqrt(0.002001 + sin(el)^2)``; meant for
    elevations above 4 deg.
    """
    return 1.001 / np.sqrt(0.002001 + np.sin(elevation) ** 2)


def saastamoinen_zenith(lat: Array, height: Array, humidity: float = 0.7) -> tuple[Array, Array]:
    """Zenith delay of the troposphere in the standard atmosphere.

    Parameters
    ----------
    lat : array [rad]
    height : array [m]
        Taken as above sea level.
    humidity : float
        Relative, 0 to 1.

    Returns
    -------
    dry, wet : arrays [m]
        2.307 m and 0.12 m at 45 deg and sea level.

    Notes
    -----
    Saastamoinen (1972): ``0.0022768 p / (1 - 0.00266 cos(2 lat) - 0.00028 h / km)`` and ``0.002277 (1255 / T + 0.05)
    e``, with pressure and temperature of the 1976 standard atmosphere up to the tropopause and the vapour pressure of
    the RTKLIB 2.4.2 manual, eqs. E.5.1 to E.5.3. Above 11 km the pressure falls exponentially; below -500 m the formula
    is extrapolated.
    """
    lat, height = np.asarray(lat, dtype=float), np.asarray(height, dtype=float)
    low = np.minimum(height, 11_000.0)
    pressure = 1013.25 * (1.0 - 2.25577e-5 * low) ** 5.2568
    temperature = np.maximum(288.15 - 0.0065 * height, _TROPOPAUSE_TEMPERATURE)
    pressure = pressure * np.exp(-(height - low) / 6341.6)
    vapour = 6.108 * humidity * np.exp((17.15 * temperature - 4684.0) / (temperature - 38.45))
    vapour = np.where(height > 11_000.0, 0.0, vapour)
    dry = 0.0022768 * pressure / (1.0 - 0.00266 * np.cos(2.0 * lat) - 0.00028e-3 * low)
    return dry, 0.002277 * (1255.0 / temperature + 0.05) * vapour
