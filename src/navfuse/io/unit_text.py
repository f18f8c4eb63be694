"""Units as people write them: ``deg/sqrt(h)``, ``ug/sqrt(Hz)``, ``0.1 arcsec``, ``m/s^2``, ``°/√h``.

A text is a number, if there is one, and units multiplied by ``*`` or a space and divided by ``/``, with whole powers
(``s^2``, ``s2``) and square roots. The result is one factor to SI and the dimension, by which a quantity is recognised:
an angle random walk is an angle per root of a time, whichever way a maker prints it.
"""

from __future__ import annotations

import difflib
import math
import re
from dataclasses import dataclass
from fractions import Fraction

from navfuse.errors import ConfigError

_DEG = math.pi / 180.0
_G = 9.80665

_ANGLE, _LENGTH, _TIME = (1, 0, 0), (0, 1, 0), (0, 0, 1)
_BASE: dict[str, tuple[float, tuple[int, int, int]]] = {
    "rad": (1.0, _ANGLE),
    "mrad": (1e-3, _ANGLE),
    "urad": (1e-6, _ANGLE),
    "deg": (_DEG, _ANGLE),
    "mdeg": (1e-3 * _DEG, _ANGLE),
    "arcmin": (_DEG / 60.0, _ANGLE),
    "arcsec": (_DEG / 3600.0, _ANGLE),
    "m": (1.0, _LENGTH),
    "mm": (1e-3, _LENGTH),
    "cm": (1e-2, _LENGTH),
    "um": (1e-6, _LENGTH),
    "km": (1e3, _LENGTH),
    "ft": (0.3048, _LENGTH),
    "s": (1.0, _TIME),
    "ms": (1e-3, _TIME),
    "us": (1e-6, _TIME),
    "min": (60.0, _TIME),
    "h": (3600.0, _TIME),
    "Hz": (1.0, (0, 0, -1)),
    "kHz": (1e3, (0, 0, -1)),
    "g": (_G, (0, 1, -2)),
    "mg": (1e-3 * _G, (0, 1, -2)),
    "ug": (1e-6 * _G, (0, 1, -2)),
    "gal": (1e-2, (0, 1, -2)),
    "mgal": (1e-5, (0, 1, -2)),
    "dps": (_DEG, (1, 0, -1)),
    "mdps": (1e-3 * _DEG, (1, 0, -1)),
    "dph": (_DEG / 3600.0, (1, 0, -1)),
}
_ALIASES = {
    "hr": "h", "hour": "h", "hours": "h", "sec": "s", "second": "s", "seconds": "s", "degree": "deg", "degrees": "deg",
    "hz": "Hz", "rthz": "sqrt(Hz)", "rtHz": "sqrt(Hz)", "rthr": "sqrt(h)", "rth": "sqrt(h)", "as": "arcsec",
    "radian": "rad", "radians": "rad", "metre": "m", "metres": "m", "micro-g": "ug", "milli-g": "mg", "minute": "min",
}  # fmt: skip
_GLYPHS = {"°": "deg", "µ": "u", "μ": "u", "·": "*", "⋅": "*", "×": "*", "²": "^2", "³": "^3", "″": "arcsec"}
_NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?")
_FACTOR = re.compile(r"\s*([*/]?)\s*(sqrt\(([A-Za-z]+)\)|([A-Za-z]+))(?:\^?(-?\d))?")


@dataclass(frozen=True, slots=True)
class Measure:
    """A number with a unit.

    Attributes
    ----------
    value : float
        In SI units and radians.
    number : float
        As it was written; 1 where there was only a unit.
    unit : str
        The unit as it was written.
    dimension : (3,) tuple of Fraction
        Powers of angle, length and time.
    """

    value: float
    number: float
    unit: str
    dimension: tuple[Fraction, Fraction, Fraction]


def parse_measure(text: str, what: str = "value") -> Measure:
    """Read a number with its unit, or a unit alone.

    Parameters
    ----------
    text : str
        Such as "0.2 deg/sqrt(h)", "125 ug*s", "deg/s".
    what : str
        Name of the option or key, for messages.

    Returns
    -------
    Measure

    Raises
    ------
    ConfigError
        If the text is not a number with known units; the message names the part that is not understood.
    """
    plain = text.strip()
    for glyph, name in _GLYPHS.items():
        plain = plain.replace(glyph, name)
    plain = re.sub(r"√\s*\(?\s*([A-Za-z]+)\s*\)?", r"sqrt(\1)", plain).replace("sqrt (", "sqrt(")
    head = _NUMBER.match(plain)
    number = float(head[0]) if head else 1.0
    unit = plain[head.end() :].strip() if head else plain
    if not math.isfinite(number):
        raise ConfigError(f"{what} = {text!r}: {head[0] if head else ''} is not a finite number")
    factor, dimension, at = 1.0, [Fraction(0)] * 3, 0
    while at < len(unit):
        part = _FACTOR.match(unit, at)
        if part is None:
            raise ConfigError(f"{what} = {text!r}: {unit[at:].strip()!r} is not understood; {_EXAMPLES}")
        sign = -1 if part[1] == "/" else 1
        name, power = part[3] or part[4], Fraction(int(part[5] or 1), 2 if part[3] else 1)
        alias = _ALIASES.get(name, _ALIASES.get(name.lower(), name))
        if alias.startswith("sqrt("):
            alias, power = alias[5:-1], power / 2
        if alias not in _BASE:
            close = difflib.get_close_matches(name, [*_BASE, *_ALIASES], n=1, cutoff=0.6)
            hint = f"is {close[0]!r} meant? " if close else ""
            raise ConfigError(f"{what} = {text!r}: unknown unit {name!r}: {hint}{_EXAMPLES}")
        size, powers = _BASE[alias]
        factor *= size ** float(sign * power)
        dimension = [total + sign * power * one for total, one in zip(dimension, powers, strict=True)]
        at = part.end()
    return Measure(number * factor, number, unit, (dimension[0], dimension[1], dimension[2]))


_EXAMPLES = "write it like '0.2 deg/sqrt(h)', '120 ug/sqrt(Hz)', '7 deg/h', '0.04 mg' or '100 Hz'"

_HALF = Fraction(1, 2)
QUANTITIES: dict[str, tuple[tuple[Fraction | int, ...], str]] = {
    "angular rate": ((1, 0, -1), "deg/h or deg/s"),
    "acceleration": ((0, 1, -2), "mg, ug or m/s^2"),
    "angle": ((1, 0, 0), "arcsec, deg or rad"),
    "speed": ((0, 1, -1), "m/s or ug*s"),
    "angle random walk": ((1, 0, -_HALF), "deg/sqrt(h) or deg/s/sqrt(Hz)"),
    "velocity random walk": ((0, 1, -3 * _HALF), "m/s/sqrt(h) or ug/sqrt(Hz)"),
    "rate random walk": ((1, 0, -3 * _HALF), "deg/h/sqrt(h) or deg/s/sqrt(s)"),
    "acceleration random walk": ((0, 1, -5 * _HALF), "ug/sqrt(h) or m/s^2/sqrt(s)"),
    "time": ((0, 0, 1), "s, min or h"),
    "frequency": ((0, 0, -1), "Hz"),
}
"""Quantity -> (powers of angle, length and time, units for people)."""


def parse_quantity(text: str, *quantities: str, what: str = "value") -> tuple[Measure, str]:
    """Read a number with a unit of one of some quantities.

    Parameters
    ----------
    text : str
    *quantities : str
        Keys of :data:`QUANTITIES`.
    what : str
        Name of the option or key, for messages.

    Returns
    -------
    Measure
    str
        The quantity it is of.

    Raises
    ------
    ConfigError
        As :func:`parse_measure`, and for a unit of another quantity or none.
    """
    measure = parse_measure(text, what)
    for name in quantities:
        if tuple(measure.dimension) == tuple(Fraction(power) for power in QUANTITIES[name][0]):
            return measure, name
    wanted = "; ".join(f"{name} in {QUANTITIES[name][1]}" for name in quantities)
    is_now = next(
        (f"a unit of {name}" for name, (powers, _) in QUANTITIES.items() if tuple(measure.dimension) == powers),
        "a unit of something else" if measure.unit else "without a unit",
    )
    shown = f"{measure.unit!r} is {is_now}" if measure.unit else "the unit is missing"
    raise ConfigError(f"{what} = {text!r}: {shown}; wanted is {wanted}")
