from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from navfuse.core.atmosphere import (
    CEILING,
    GAS_CONSTANT,
    air_density,
    air_pressure,
    air_temperature,
    geopotential_height,
    pressure_height,
)


@pytest.mark.parametrize(
    ("height", "pressure", "temperature", "density"),
    [
        (0.0, 101325.0, 288.15, 1.225),
        (1000.0, 89874.6, 281.65, 1.11164),
        (5000.0, 54019.9, 255.65, 0.736116),
        (11000.0, 22632.0, 216.65, 0.363918),
        (20000.0, 5474.88, 216.65, 0.0880349),
    ],
)
def test_the_printed_table(height, pressure, temperature, density):
    """ICAO Doc 7488, table 1, geopotential heights."""
    assert air_pressure(height) == pytest.approx(pressure, rel=2e-6)
    assert air_temperature(height) == pytest.approx(temperature)
    assert air_density(air_pressure(height), air_temperature(height)) == pytest.approx(density, rel=3e-6)


@pytest.mark.parametrize(("pressure", "warmer"), [(101325.0, 0.0), (98000.0, 25.0), (103000.0, -40.0)])
def test_it_carries_the_weight_of_the_air_above(pressure, warmer):
    """Integration of dp = -density g dh over true height, with gravity that falls off with the square of distance."""
    radius = 6356766.0

    def fall(height, p):
        geopotential = height * radius / (radius + height)
        temperature = 288.15 + warmer - 0.0065 * min(geopotential, 11000.0)
        return -p / (GAS_CONSTANT * temperature) * 9.80665 * (radius / (radius + height)) ** 2

    heights = np.array([0.0, 500.0, 3000.0, 11019.0, 15000.0, 20000.0])
    found = solve_ivp(fall, (0.0, 20000.0), [pressure], t_eval=heights, rtol=1e-11, atol=1e-6, max_step=50.0)
    computed = air_pressure(geopotential_height(heights), pressure, 288.15 + warmer)
    np.testing.assert_allclose(computed, found.y[0], rtol=1e-8)


@pytest.mark.parametrize(("pressure", "warmer"), [(101325.0, 0.0), (98000.0, 25.0)])
def test_heights_come_back(pressure, warmer):
    heights = np.linspace(-5000.0, CEILING, 501)
    back = pressure_height(air_pressure(heights, pressure, 288.15 + warmer), pressure, 288.15 + warmer)
    np.testing.assert_allclose(back, heights, atol=1e-7)
