"""Noise terms in the units that data sheets print."""

from __future__ import annotations

import math

from navfuse.core.constants import STANDARD_GRAVITY

_DEG = math.pi / 180.0
_DPH = _DEG / 3600.0
_UG = 1e-6 * STANDARD_GRAVITY

RATE_UNITS = {"gyro": ("deg/h", "dph", _DPH), "accel": ("ug", "ug", _UG)}
"""Sensor -> unit of its deviation for people, in key names, and in SI."""

_AMOUNTS = {
    "gyro": (("deg/h", _DPH, 100.0 * _DPH), ("deg/s", _DEG, math.inf)),
    "accel": (("ug", _UG, 1e3 * _UG), ("mg", 1e3 * _UG, 100e3 * _UG), ("g", STANDARD_GRAVITY, math.inf)),
}
"""Sensor -> unit for people, its size, and up to where it reads well."""

TERM_UNITS: dict[str, dict[str, tuple[tuple[str, str, float], ...]]] = {
    "gyro": {
        "Q": (("arcsec", "arcsec", _DPH), ("urad", "urad", 1e-6)),
        "N": (("deg/sqrt(h)", "deg_per_sqrt_h", _DEG / 60.0), ("deg/s/sqrt(Hz)", "degps_per_sqrt_hz", _DEG)),
        "B": (("deg/h", "dph", _DPH), ("deg/s", "degps", _DEG)),
        "K": (("deg/h/sqrt(h)", "dph_per_sqrt_h", _DPH / 60.0), ("deg/s/sqrt(s)", "degps_per_sqrt_s", _DEG)),
        "R": (("deg/h/h", "dph_per_h", _DPH / 3600.0),),
        "GM": (("deg/h", "dph", _DPH), ("deg/s", "degps", _DEG)),
        "sin": (("deg/h", "dph", _DPH), ("deg/s", "degps", _DEG)),
    },
    "accel": {
        "Q": (("mm/s", "mmps", 1e-3),),
        "N": (("m/s/sqrt(h)", "mps_per_sqrt_h", 1.0 / 60.0), ("ug/sqrt(Hz)", "ug_per_sqrt_hz", _UG)),
        "B": (("ug", "ug", _UG), ("mg", "mg", 1e3 * _UG)),
        "K": (("ug/sqrt(h)", "ug_per_sqrt_h", _UG / 60.0),),
        "R": (("ug/h", "ug_per_h", _UG / 3600.0),),
        "GM": (("ug", "ug", _UG), ("mg", "mg", 1e3 * _UG)),
        "sin": (("ug", "ug", _UG), ("mg", "mg", 1e3 * _UG)),
    },
}
"""Sensor -> term -> units: for people, in key names, and in SI. The first is the usual one."""


def significant(value: float, digits: int = 4) -> str:
    """A number with so many digits, without an exponent where it reads well without."""
    if not math.isfinite(value):
        return "-"
    if value != 0.0 and not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{digits - 1}e}"
    places = digits - 1 - (math.floor(math.log10(abs(value))) if value else 0)
    return f"{value:.{max(0, places)}f}"


def amount(value: float, sensor: str, digits: int = 4) -> str:
    """A rate or acceleration in SI units with the unit that suits its size."""
    unit, factor, _ = next(entry for entry in _AMOUNTS[sensor] if not abs(value) >= entry[2])
    return f"{significant(value / factor, digits)} {unit}"


def with_sigma(value: float, sigma: float) -> str:
    """A value with its standard deviation, to two digits of the latter."""
    if not (math.isfinite(value) and math.isfinite(sigma)) or sigma <= 0.0:
        return significant(value)
    places = max(0, 1 - math.floor(math.log10(sigma)))
    if places > 8 or abs(value) >= 1e7:
        return f"{value:.4g} ± {sigma:.2g}"
    return f"{value:.{places}f} ± {sigma:.{places}f}"
