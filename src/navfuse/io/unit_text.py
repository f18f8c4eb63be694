"""Units as people write them: ``deg/sqrt(h)``, ``(deg/h)/rtHz``, ``0.1 arcsec``, ``m/s^2``, ``°/√h``, ``µg/Hz^0.5``.

A text is a number, if there is one, and units multiplied by ``*`` or a space and divided by ``/``, with powers
(``s^2``, ``s2``, ``h^0.5``, ``s⁻¹``), square roots (``sqrt(h)``, ``√h``, ``rt h``, ``root-h``) and parentheses. Without
parentheses every ``/`` divides by the next unit only. The result is one factor to SI and the dimension, by which a
quantity is recognised: an angle random walk is an angle per root of a time, whichever way a maker prints it.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction

from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.core.nearest import nearest
from navfuse.errors import ConfigError

_DEG = math.pi / 180.0
_G = STANDARD_GRAVITY

_ANGLE, _LENGTH, _TIME = (1, 0, 0), (0, 1, 0), (0, 0, 1)
_BASE: dict[str, tuple[float, tuple[int, int, int]]] = {
    "rad": (1.0, _ANGLE),
    "mrad": (1e-3, _ANGLE),
    "urad": (1e-6, _ANGLE),
    "nrad": (1e-9, _ANGLE),
    "rev": (2.0 * math.pi, _ANGLE),
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
    "ng": (1e-9 * _G, (0, 1, -2)),
    "gal": (1e-2, (0, 1, -2)),
    "mgal": (1e-5, (0, 1, -2)),
    "ugal": (1e-8, (0, 1, -2)),
    "dps": (_DEG, (1, 0, -1)),
    "mdps": (1e-3 * _DEG, (1, 0, -1)),
    "dph": (_DEG / 3600.0, (1, 0, -1)),
    "rpm": (2.0 * math.pi / 60.0, (1, 0, -1)),
}
_ALIASES = {
    "hr": "h", "hrs": "h", "hour": "h", "hours": "h", "sec": "s", "secs": "s", "second": "s", "seconds": "s",
    "minute": "min", "minutes": "min", "degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad",
    "as": "arcsec", "arcseconds": "arcsec", "arcminutes": "arcmin", "metre": "m", "metres": "m", "meter": "m",
    "meters": "m", "microg": "ug", "millig": "mg", "hz": "Hz", "khz": "kHz",
}  # fmt: skip
_ROOTED = {"rthz": "Hz", "rthr": "h", "rth": "h", "rts": "s"}
_ROOTS = ("sqrt", "rt", "root", "√")
_GLYPHS = {
    "°": "deg", "º": "deg", "˚": "deg", "µ": "u", "μ": "u", "·": "*", "⋅": "*", "×": "*", "″": "arcsec", "′": "arcmin",
    "−": "-", "½": "^0.5", "∕": "/", "⁄": "/", "micro-g": "ug", "milli-g": "mg", "arc-sec": "arcsec",
    "arc-min": "arcmin", "**": "^",
}  # fmt: skip
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?")
_NAME = re.compile(r"\s*([A-Za-z]+|√)")
_POWER = re.compile(r"\s*\^\s*(-?\d(?:\.\d+)?)(?![\d.])|\s*\^\s*\(\s*(-?\d)\s*/\s*([1-9])\s*\)|(-?\d)(?!\d)")
_LONGEST = 80

Powers = tuple[Fraction, Fraction, Fraction]


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
    dimension: Powers


_EXAMPLES = "write it like '0.2 deg/sqrt(h)', '120 ug/sqrt(Hz)', '7 deg/h', '0.04 mg' or '100 Hz'"


def parse_measure(text: str, what: str = "value", wanted: str = _EXAMPLES) -> Measure:
    """Read a number with its unit, or a unit alone.

    Parameters
    ----------
    text : str
        Such as "0.2 deg/sqrt(h)", "125 ug*s", "deg/s".
    what : str
        Name of the option or key, for messages.
    wanted : str
        What is accepted, for messages.

    Returns
    -------
    Measure

    Raises
    ------
    ConfigError
        If the text is not a number with known units; the message names the part that is not understood.
    """
    if len(text) > _LONGEST:
        raise ConfigError(f"{what}: a text of {len(text)} characters is no number with a unit; {wanted}")
    plain = text.strip().lstrip("±").lstrip()
    for glyph, name in _GLYPHS.items():
        plain = plain.replace(glyph, name)
    plain = re.sub("[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+", lambda raised: "^" + raised[0].translate(_RAISED), plain)
    head = _NUMBER.match(plain)
    number = float(head[0]) if head else 1.0
    unit = plain[head.end() :].strip() if head else plain
    if not math.isfinite(number):
        raise ConfigError(f"{what} = {text!r}: {head[0] if head else ''} is not a finite number")
    try:
        factor, dimension = _Reader(unit).whole()
    except _Unreadable as error:
        raise ConfigError(f"{what} = {text!r}: {error}{' ' if str(error).endswith('?') else '; '}{wanted}") from None
    return Measure(number * factor, number, unit, dimension)


class _Unreadable(Exception):
    """A part of a unit that is not understood; :func:`parse_measure` says of what."""


class _Reader:
    """Units by recursive descent: products of powers of names, roots and parentheses."""

    def __init__(self, text: str) -> None:
        self.text, self.at = text, 0

    def whole(self) -> tuple[float, Powers]:
        """The whole text."""
        found = self.product() if self.text else (1.0, (Fraction(0), Fraction(0), Fraction(0)))
        if self.at < len(self.text):
            raise self.refuse()
        return found

    def product(self) -> tuple[float, Powers]:
        factor, powers = self.power(Fraction(1))
        while (sign := self.next()) not in ("", ")"):
            if sign in ("*", "/"):
                self.at = self.text.index(sign, self.at) + 1
            size, more = self.power(Fraction(-1 if sign == "/" else 1))
            factor *= size
            powers = (powers[0] + more[0], powers[1] + more[1], powers[2] + more[2])
        return factor, powers

    def power(self, exponent: Fraction) -> tuple[float, Powers]:
        size, powers = self.one()
        found = _POWER.match(self.text, self.at)
        if found:
            exponent *= Fraction(found[1] or found[4] or f"{found[2]}/{found[3]}")
            self.at = found.end()
        return _raised(size, powers, exponent)

    def one(self) -> tuple[float, Powers]:
        if self.next() == "(":
            self.at = self.text.index("(", self.at) + 1
            found = self.product()
            if self.next() != ")":
                raise _Unreadable(f"a parenthesis of {self.text!r} is not closed")
            self.at = self.text.index(")", self.at) + 1
            return found
        part = _NAME.match(self.text, self.at)
        if part is None:
            raise self.refuse()
        self.at = part.end()
        if part[1] in _ROOTS:
            if self.next() == "-":
                self.at = self.text.index("-", self.at) + 1
            return _raised(*self.one(), Fraction(1, 2))
        if part[1].lower() in _ROOTED:
            return _raised(*_unit(_ROOTED[part[1].lower()]), Fraction(1, 2))
        return _unit(part[1])

    def next(self) -> str:
        """The next character that is no space, or nothing."""
        return self.text[self.at :].lstrip()[:1]

    def refuse(self) -> _Unreadable:
        rest = self.text[self.at :].strip()
        hint = " (decimals come after a point)" if re.match(r",\d", rest) else ""
        return _Unreadable(f"{rest!r} is not understood{hint}" if rest else f"{self.text!r} ends too early")


def _unit(name: str) -> tuple[float, Powers]:
    """Size and dimension of one name; capitals do not matter where they tell nothing apart."""
    for known in (name, _ALIASES.get(name, ""), name.lower(), _ALIASES.get(name.lower(), "")):
        if known in _BASE:
            size, (angle, length, time) = _BASE[known]
            return size, (Fraction(angle), Fraction(length), Fraction(time))
    close = nearest(name, [*_BASE, *_ALIASES], 0.6)
    raise _Unreadable(f"unknown unit {name!r}" + (f": is {close!r} meant?" if close else ""))


def _raised(size: float, powers: Powers, exponent: Fraction) -> tuple[float, Powers]:
    try:
        raised = size ** float(exponent)
    except OverflowError:
        raised = math.inf
    if not 0.0 < raised < math.inf:
        raise _Unreadable("the power of a unit is too large")
    return raised, (powers[0] * exponent, powers[1] * exponent, powers[2] * exponent)


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
    wanted = "; ".join(f"{name} in {QUANTITIES[name][1]}" for name in quantities)
    measure = parse_measure(text, what, f"wanted is {wanted}")
    for name in quantities:
        if tuple(measure.dimension) == tuple(Fraction(power) for power in QUANTITIES[name][0]):
            return measure, name
    is_now = next(
        (f"a unit of {name}" for name, (powers, _) in QUANTITIES.items() if tuple(measure.dimension) == powers),
        "a unit of something else" if measure.unit else "without a unit",
    )
    shown = f"{measure.unit!r} is {is_now}" if measure.unit else "the unit is missing"
    raise ConfigError(f"{what} = {text!r}: {shown}; wanted is {wanted}")
