"""Unit suffixes of column names, and the factors that take them to SI.

A column name is its quantity's base name, an underscore and a unit: ``gyro_x_degps`` holds ``gyro_x`` in degrees per
second. Inside navfuse everything is SI and radians, so each suffix stands for one multiplication.
"""

from __future__ import annotations

from math import pi

import numpy as np

from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.errors import InputError

_DEG = pi / 180.0
_FOOT = 0.3048
_NAUTICAL_MILE = 1852.0

UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "angle": {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "deg": _DEG, "arcmin": _DEG / 60.0, "arcsec": _DEG / 3600.0},
    "angular rate": {
        "radps": 1.0,
        "mradps": 1e-3,
        "degps": _DEG,
        "dps": _DEG,
        "degph": _DEG / 3600.0,
        "dph": _DEG / 3600.0,
        "rpm": 2.0 * pi / 60.0,
    },
    "acceleration": {
        "mps2": 1.0,
        "cmps2": 1e-2,
        "g": STANDARD_GRAVITY,
        "mg": 1e-3 * STANDARD_GRAVITY,
        "ug": 1e-6 * STANDARD_GRAVITY,
        "gal": 1e-2,
        "mgal": 1e-5,
        "ftps2": _FOOT,
    },
    "length": {"m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3, "ft": _FOOT},
    "speed": {
        "mps": 1.0,
        "cmps": 1e-2,
        "mmps": 1e-3,
        "kmph": 1.0 / 3.6,
        "kmh": 1.0 / 3.6,
        "kph": 1.0 / 3.6,
        "knots": _NAUTICAL_MILE / 3600.0,
        "kn": _NAUTICAL_MILE / 3600.0,
        "mph": 1609.344 / 3600.0,
        "ftps": _FOOT,
    },
    "carrier to noise density": {"dbhz": 1.0},
    "magnetic field": {"t": 1.0, "mt": 1e-3, "ut": 1e-6, "nt": 1e-9, "gauss": 1e-4, "mgauss": 1e-7},
    "pressure": {
        "pa": 1.0,
        "hpa": 100.0,
        "kpa": 1e3,
        "mbar": 100.0,
        "bar": 1e5,
        "mmhg": 133.322,
        "inhg": 3386.389,
        "psi": 6894.757,
    },
}
"""Quantity -> suffix -> factor to SI (radian, metre, second, tesla, pascal; dB-Hz stays). One g is 9.80665 m/s^2
(3rd CGPM, 1901)."""


def known_units(quantity: str) -> str:
    """List the suffixes of a quantity for a message.

    Parameters
    ----------
    quantity : str
        A key of :data:`UNITS`.

    Returns
    -------
    str
        Such as ``"s, ms, us, ns, min, h"``.
    """
    return ", ".join(UNITS[quantity])


def unit_factor(quantity: str, suffix: str, column: str = "", source: str = "") -> float:
    """Factor from a suffix to SI.

    Parameters
    ----------
    quantity : str
        A key of :data:`UNITS`.
    suffix : str
        Unit as it stands in a column name.
    column, source : str
        Column and file, for the message.

    Returns
    -------
    float
        Number that a value in this unit is multiplied with.

    Raises
    ------
    InputError
        If the suffix is not a known unit of the quantity.
    """
    factor = UNITS[quantity].get(suffix)
    if factor is None:
        place = f"{source}: column '{column}': " if source else ""
        raise InputError(
            f"{place}'{suffix}' is not a known unit of {quantity}; rename the column to end in one of:"
            f" {known_units(quantity)}"
        )
    return factor


def scaled(values: np.ndarray, factor: float) -> np.ndarray:
    """Values in SI units, as float64.

    Parameters
    ----------
    values : array
        In the unit of their column.
    factor : float
        From :func:`unit_factor`.

    Returns
    -------
    array
        Infinite where the product is too large for a float, which later checks find.
    """
    with np.errstate(over="ignore"):
        return np.asarray(values, dtype=np.float64) * factor
