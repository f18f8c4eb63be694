from __future__ import annotations

import numpy as np
import pytest

from navfuse.errors import InputError
from navfuse.io.units import UNITS, known_units, unit_factor


@pytest.mark.parametrize(
    ("quantity", "suffix", "value", "si"),
    [
        ("angular rate", "degps", 180.0, np.pi),
        ("angular rate", "dps", 180.0, np.pi),
        ("angular rate", "dph", 3600.0 * 180.0, np.pi),
        ("angular rate", "rpm", 60.0, 2.0 * np.pi),
        ("acceleration", "g", 2.0, 19.6133),
        ("acceleration", "mg", 1000.0, 9.80665),
        ("acceleration", "mgal", 1e5, 1.0),
        ("angle", "arcsec", 3600.0, np.pi / 180.0),
        ("angle", "arcmin", 60.0, np.pi / 180.0),
        ("time", "us", 1e6, 1.0),
        ("time", "min", 1.0, 60.0),
        ("length", "ft", 1.0, 0.3048),
        ("speed", "kmph", 3.6, 1.0),
        ("speed", "knots", 3600.0, 1852.0),
        ("speed", "mph", 3600.0, 1609.344),
    ],
)
def test_factor_takes_unit_to_si(quantity, suffix, value, si):
    assert value * unit_factor(quantity, suffix) == pytest.approx(si, rel=1e-15)


def test_every_quantity_has_exactly_one_si_unit_spelled_first():
    for suffixes in UNITS.values():
        assert next(iter(suffixes.values())) == 1.0
        assert list(suffixes.values()).count(1.0) == 1


def test_unknown_unit_names_file_column_and_known_units():
    with pytest.raises(InputError) as raised:
        unit_factor("speed", "furlongs", "vn_furlongs", "log.csv")
    message = str(raised.value)
    assert "log.csv: column 'vn_furlongs'" in message
    assert known_units("speed") in message


def test_unknown_unit_without_place():
    with pytest.raises(InputError, match="^'x' is not a known unit of time"):
        unit_factor("time", "x")
