from __future__ import annotations

import math

import pytest

from navfuse.errors import ConfigError
from navfuse.io.unit_text import QUANTITIES, parse_measure, parse_quantity

DEG = math.pi / 180.0


@pytest.mark.parametrize(
    ("text", "value", "quantity"),
    [
        ("0.2 deg/sqrt(h)", 0.2 * DEG / 60.0, "angle random walk"),
        ("0.2°/√h", 0.2 * DEG / 60.0, "angle random walk"),
        ("0.2 deg/√(hr)", 0.2 * DEG / 60.0, "angle random walk"),
        ("0.007 deg/s/sqrt(Hz)", 0.007 * DEG, "angle random walk"),
        ("0.007 dps/rtHz", 0.007 * DEG, "angle random walk"),
        ("120 µg/√Hz", 120e-6 * 9.80665, "velocity random walk"),
        ("0.06 m/s/sqrt(h)", 1e-3, "velocity random walk"),
        ("7 deg/h", 7.0 * DEG / 3600.0, "angular rate"),
        ("7 dph", 7.0 * DEG / 3600.0, "angular rate"),
        ("0.04 mg", 0.04e-3 * 9.80665, "acceleration"),
        ("9.8 m/s^2", 9.8, "acceleration"),
        ("9.8 m/s²", 9.8, "acceleration"),
        ("0.1 arcsec", 0.1 * DEG / 3600.0, "angle"),
        ("125 ug*s", 125e-6 * 9.80665, "speed"),
        ("125 µg·s", 125e-6 * 9.80665, "speed"),
        ("1e1 Hz", 10.0, "frequency"),
        ("2 min", 120.0, "time"),
        ("60 deg/h/sqrt(h)", DEG / 3600.0, "rate random walk"),
        ("60 ug/sqrt(h)", 9.80665e-6, "acceleration random walk"),
        ("deg/s", DEG, "angular rate"),
        ("-3 g", -3.0 * 9.80665, "acceleration"),
    ],
)
def test_units_as_people_write_them(text, value, quantity):
    measure, found = parse_quantity(text, *QUANTITIES)
    assert found == quantity
    assert measure.value == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("3 furlongs", "unknown unit 'furlongs'"),
        ("3 degs/s", "unknown unit 'degs': is 'deg' meant"),
        ("3 deg//s", "'//s' is not understood"),
        ("1e999 deg", "1e999 is not a finite number"),
    ],
)
def test_what_is_not_a_unit(text, message):
    with pytest.raises(ConfigError, match=message):
        parse_measure(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0.1 m/s", "'m/s' is a unit of speed; wanted is angular rate in deg/h or deg/s"),
        ("0.1 m*s", "'m\\*s' is a unit of something else"),
        ("5", "--x = '5': the unit is missing; wanted is angular rate"),
    ],
)
def test_units_of_something_else(text, message):
    with pytest.raises(ConfigError, match=message):
        parse_quantity(text, "angular rate", what="--x")
