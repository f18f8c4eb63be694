"""The standard atmosphere up to 20 km: pressure, temperature and density over height, with other values at sea level.

Source: ICAO Doc 7488 (1993), the same as ISO 2533:1975 and the U.S. Standard Atmosphere 1976 up to this height. Every
function takes floats or arrays and makes no checks.
"""

from __future__ import annotations

import numpy as np

from navfuse.core.constants import STANDARD_GRAVITY

SEA_LEVEL_PRESSURE = 101325.0
"""[Pa]."""

SEA_LEVEL_TEMPERATURE = 288.15
"""[K]."""

LAPSE_RATE = 0.0065
"""Fall of temperature with geopotential height below the tropopause [K/m]."""

TROPOPAUSE = 11000.0
"""Geopotential height [m] above which the temperature is constant."""

CEILING = 20000.0
"""Geopotential height [m] up to which this holds."""

GAS_CONSTANT = 287.05287
"""Of dry air [J/(kg K)]."""

_EARTH_RADIUS = 6356766.0
_EXPONENT = STANDARD_GRAVITY / (GAS_CONSTANT * LAPSE_RATE)


def geopotential_height(height):
    """Geopotential height [m] of a height above sea level [m]; ICAO Doc 7488, eq. 9."""
    return _EARTH_RADIUS * height / (_EARTH_RADIUS + height)


def air_temperature(geopotential, sea_level_temperature=SEA_LEVEL_TEMPERATURE):
    """Temperature [K] at a geopotential height [m]."""
    return sea_level_temperature - LAPSE_RATE * np.minimum(geopotential, TROPOPAUSE)


def air_pressure(geopotential, sea_level_pressure=SEA_LEVEL_PRESSURE, sea_level_temperature=SEA_LEVEL_TEMPERATURE):
    """Static pressure at a geopotential height.

    Parameters
    ----------
    geopotential : float or array [m]
        At most :data:`CEILING`.
    sea_level_pressure, sea_level_temperature : float [Pa], [K]

    Returns
    -------
    float or array [Pa]
    """
    temperature = air_temperature(geopotential, sea_level_temperature)
    pressure = sea_level_pressure * (temperature / sea_level_temperature) ** _EXPONENT
    above = np.maximum(geopotential - TROPOPAUSE, 0.0)
    return pressure * np.exp(-STANDARD_GRAVITY * above / (GAS_CONSTANT * temperature))


def pressure_height(pressure, sea_level_pressure=SEA_LEVEL_PRESSURE, sea_level_temperature=SEA_LEVEL_TEMPERATURE):
    """Geopotential height [m] at which a pressure [Pa] is found; inverse of :func:`air_pressure`."""
    tropopause_temperature = sea_level_temperature - LAPSE_RATE * TROPOPAUSE
    at_tropopause = sea_level_pressure * (tropopause_temperature / sea_level_temperature) ** _EXPONENT
    below = np.maximum(pressure, at_tropopause)
    height = sea_level_temperature / LAPSE_RATE * (1.0 - (below / sea_level_pressure) ** (1.0 / _EXPONENT))
    ratio = np.minimum(pressure / at_tropopause, 1.0)
    return height - GAS_CONSTANT * tropopause_temperature / STANDARD_GRAVITY * np.log(ratio)


def air_density(pressure, temperature):
    """Density [kg/m^3] of dry air of a pressure [Pa] and temperature [K]."""
    return pressure / (GAS_CONSTANT * temperature)
