from __future__ import annotations

import math

import numpy as np
import pymap3d
import pytest
from scipy.integrate import solve_ivp

from navfuse.errors import ConfigError, InputError
from navfuse.simulation import BarometerModel, figure_eight_flight, measure_barometer, static
from reference.aiding_sensors import attitude_b, point_velocity_twin, sway, within_chi_square

ARM = (3.0, -4.0, 2.0)


def measure(motion, seed=0, **keys):
    model = BarometerModel.from_datasheet(**({"output": "both"} | keys))
    return measure_barometer(motion, model, np.random.default_rng(seed))


def port_height(motion, time, undulation=0.0):
    r_e = motion.r_e(time) + motion.C_eb(time) @ np.array(ARM)
    return pymap3d.ecef2geodetic(*r_e.T)[2] - undulation


def test_without_errors_it_is_the_weight_of_the_air_above_the_port():
    """Against integration of the hydrostatic equation over the height above sea level of the port."""
    motion = sway()
    log, truth = measure(motion, rate_hz=1.0, lever_arm_m=ARM, undulation_m=48.0, sea_level_pressure_hpa=1003.25,
                         temperature_deviation_k=12.0)  # fmt: skip
    height = port_height(motion, log.time, 48.0)
    np.testing.assert_allclose(truth.height, height, atol=1e-6)
    assert np.ptp(height) > 90.0

    def fall(h, p):
        temperature = 288.15 + 12.0 - 0.0065 * h * 6356766.0 / (6356766.0 + h)
        return -p / (287.05287 * temperature) * 9.80665 * (6356766.0 / (6356766.0 + h)) ** 2

    order = np.argsort(height)
    found = solve_ivp(fall, (0.0, height.max() + 1.0), [100325.0], t_eval=height[order], rtol=1e-11, atol=1e-7)
    np.testing.assert_allclose(log.pressure[order], found.y[0], rtol=1e-8)
    np.testing.assert_array_equal(log.pressure, truth.pressure)


def test_in_the_standard_atmosphere_it_shows_the_height_above_sea_level():
    motion = sway()
    log, truth = measure(motion, rate_hz=1.0, undulation_m=48.0)
    geopotential = truth.height * 6356766.0 / (6356766.0 + truth.height)
    np.testing.assert_allclose(log.height, geopotential, atol=1e-6)
    assert abs(log.height - truth.height).max() < 0.25


def test_a_wrong_setting_and_warm_air_make_the_errors_of_an_altimeter():
    """27 ft per hectopascal near sea level; heights shown too low by the ratio of temperatures in warm air."""
    motion = static(2.0, 0.8, 0.2, 0.0)
    low, _ = measure(motion, sea_level_pressure_hpa=1003.25)
    assert low.height[0] == pytest.approx(10.0 * 8.32, rel=0.01)
    right, _ = measure(motion, sea_level_pressure_hpa=1003.25, altimeter_setting_hpa=1003.25)
    assert right.height[0] == pytest.approx(0.0, abs=1e-6)
    high = figure_eight_flight(height=3000.0, climb=0.0)
    warm, truth = measure(high, temperature_deviation_k=20.0)
    indicated, geopotential = warm.height[0], truth.height[0] * 6356766.0 / (6356766.0 + truth.height[0])
    mean_standard, mean_warm = 288.15 - 0.0065 * indicated / 2.0, 308.15 - 0.0065 * geopotential / 2.0
    assert indicated / geopotential == pytest.approx(mean_standard / mean_warm, rel=1e-4)
    assert indicated < 0.94 * geopotential


def test_airspeed_adds_its_share_of_dynamic_pressure():
    motion = sway()
    wind = (8.0, -5.0, 0.5)
    log, truth = measure(
        motion, rate_hz=1.0, offset_s=1.0, lever_arm_m=ARM, dynamic_pressure_percent=-4.0, wind_mps=wind
    )
    inside = slice(0, -2)
    time = log.time[inside]
    air = point_velocity_twin(motion, time, ARM) - attitude_b(motion, time).apply(
        np.tile(wind, (time.size, 1)), inverse=True
    )
    temperature = 288.15 - 0.0065 * truth.height[inside]
    density = truth.pressure[inside] / (287.05287 * temperature)
    twin = -0.04 * 0.5 * density * np.sum(air**2, axis=1)
    np.testing.assert_allclose(truth.dynamic[inside], twin, rtol=1e-5)
    np.testing.assert_allclose(log.pressure, truth.pressure + truth.dynamic, rtol=1e-14)


def test_the_log_is_made_of_the_stated_parts_and_rounded():
    keys = {"weather_sd_hpa": 5.0, "weather_tau_h": 12.0, "pressure_walk_pa_per_sqrt_s": 1.0, "bias_sd_pa": 50.0,
            "pressure_sd_pa": 3.0, "dynamic_pressure_percent": 3.0}  # fmt: skip
    log, truth = measure(sway(), **keys)
    total = truth.pressure + truth.weather + truth.walk + truth.dynamic + truth.bias + truth.noise
    np.testing.assert_allclose(log.pressure, total, rtol=1e-14)
    coarse, _ = measure(sway(), pressure_lsb_pa=4.0, height_lsb_m=0.5, **keys)
    np.testing.assert_array_equal(coarse.pressure, np.rint(total / 4.0) * 4.0)
    np.testing.assert_array_equal(coarse.height * 2.0, np.rint(coarse.height * 2.0))
    assert abs(coarse.height - log.height).max() < 0.5


def test_what_is_not_asked_for_is_not_there():
    motion = static(2.0)
    assert measure(motion, output="pressure")[0].height is None
    assert measure(motion, output="height")[0].pressure is None
    assert list(measure(motion)[0].columns()) == ["time_s", "pressure_hpa", "height_m"]


def test_errors_have_the_stated_deviations():
    _, truth = measure(static(4000.0), rate_hz=1.0, pressure_sd_pa=3.0, pressure_walk_pa_per_sqrt_s=2.0,
                       weather_sd_pa=50.0, weather_tau_s=20.0)  # fmt: skip
    assert within_chi_square(truth.noise[:, None], 3.0)
    assert truth.walk[0] == 0.0
    assert within_chi_square(np.diff(truth.walk)[:, None], 2.0)
    decay = math.exp(-1.0 / 20.0)
    drive = truth.weather[1:] - decay * truth.weather[:-1]
    assert within_chi_square(drive[:, None], 50.0 * math.sqrt(1.0 - decay**2))
    short = static(2.0)
    biases = [measure(short, seed, bias_hpa=1.0, bias_sd_hpa=0.5)[1].bias for seed in range(500)]
    assert within_chi_square(np.array(biases)[:, None] - 100.0, 50.0)


@pytest.mark.parametrize("height", [21_000.0, -6000.0])
def test_heights_outside_the_atmosphere_are_refused(height):
    with pytest.raises(InputError, match=r"holds from -5 to 20 km above sea level, the motion is at"):
        measure(static(2.0, 0.8, 0.2, height))


def test_a_pressure_below_zero_is_refused():
    with pytest.raises(InputError, match="the errors of the barometer make a pressure of -"):
        measure(static(2.0), bias_hpa=-2000.0)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"output": "depth"}, "output must be one of pressure, height, both, not 'depth'"),
        ({"sea_level_pressure_hpa": 101325.0}, "sea_level_pressure must be within 85000 to 110000 Pa"),
        ({"altimeter_setting_hpa": 29.92}, "altimeter_setting must be within 85000 to 110000 Pa, not 2992"),
        ({"temperature_deviation_k": 288.15}, "temperature_deviation must be within -80 to 80 K"),
        ({"weather_sd_pa": 1.0}, "weather_sd needs weather_tau > 0"),
        ({"wind_mps": 5.0}, "wind must be three finite numbers"),
        ({"undulation_m": np.nan}, "undulation must be a number and finite"),
    ],
)
def test_settings_that_make_no_sense_are_refused(keys, message):
    with pytest.raises(ConfigError, match=message):
        BarometerModel.from_datasheet(**keys)
