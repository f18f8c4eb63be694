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
        ("3 (deg/h)/sqrt(Hz)", 3.0 * DEG / 3600.0, "angle random walk"),
        ("0.15 °/hr^0.5", 0.15 * DEG / 60.0, "angle random walk"),
        ("0.15 deg/hr^(1/2)", 0.15 * DEG / 60.0, "angle random walk"),
        ("0.15°/√hr", 0.15 * DEG / 60.0, "angle random walk"),
        ("0.15 deg/rt-hr", 0.15 * DEG / 60.0, "angle random walk"),
        ("0.15 deg/root hr", 0.15 * DEG / 60.0, "angle random walk"),
        ("2.8 mdps/√Hz", 2.8e-3 * DEG, "angle random walk"),
        ("0.0028 °/s/√Hz", 2.8e-3 * DEG, "angle random walk"),
        ("0.0028 deg/s/rtHz", 2.8e-3 * DEG, "angle random walk"),
        ("0.0028 º/s/√(Hz)", 2.8e-3 * DEG, "angle random walk"),
        ("70 \u00b5g/√Hz", 70e-6 * 9.80665, "velocity random walk"),
        ("70 \u03bcg/√Hz", 70e-6 * 9.80665, "velocity random walk"),
        ("70 ug/rt(Hz)", 70e-6 * 9.80665, "velocity random walk"),
        ("70 micro-g/rtHz", 70e-6 * 9.80665, "velocity random walk"),
        ("0.07 mg/√Hz", 70e-6 * 9.80665, "velocity random walk"),
        ("0.012 m/s/√hr", 2e-4, "velocity random walk"),
        ("± 10 deg/hr", 10.0 * DEG / 3600.0, "angular rate"),
        ("10°/h", 10.0 * DEG / 3600.0, "angular rate"),
        ("0.5 Deg/Sec", 0.5 * DEG, "angular rate"),
        ("10 mGal", 1e-4, "acceleration"),
        ("3 m s⁻²", 3.0, "acceleration"),
        ("3 m*s**-2", 3.0, "acceleration"),
        ("1 G", 9.80665, "acceleration"),
        ("60 deg/(h*sqrt(h))", DEG / 3600.0, "rate random walk"),
        ("60 deg/h^1.5", DEG / 3600.0, "rate random walk"),
        ("30 rpm", math.pi, "angular rate"),
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
        ("3 deg//s", "'/s' is not understood"),
        ("3 degs/s", "'degs': is 'deg' meant\\? write it like"),
        ("3 deg/", "'deg/' ends too early"),
        ("3 deg/√", "'deg/√' ends too early"),
        ("3 (deg/h", "a parenthesis of '\\(deg/h' is not closed"),
        ("3 deg/h)", "'\\)' is not understood"),
        ("3 s^99", "'\\^99' is not understood"),
        ("3 h^(1/0)", "'\\^\\(1/0\\)' is not understood"),
        ("((((km/m)^9)^9)^9)^9", "the power of a unit is too large"),
        ("0,2 deg/h", "',2 deg/h' is not understood \\(decimals come after a point\\)"),
        ("(" * 100, "a text of 100 characters is no number with a unit"),
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
        ("0.1 degg/s", "unknown unit 'degg': is 'deg' meant\\? wanted is angular rate in deg/h or deg/s$"),
        ("0.1 parsec", "unknown unit 'parsec'.*wanted is angular rate in deg/h or deg/s$"),
        ("0.1 m*s", "'m\\*s' is a unit of something else"),
        ("5", "--x = '5': the unit is missing; wanted is angular rate"),
    ],
)
def test_units_of_something_else(text, message):
    with pytest.raises(ConfigError, match=message):
        parse_quantity(text, "angular rate", what="--x")
