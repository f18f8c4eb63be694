from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import simpson

from navfuse.errors import ConfigError
from navfuse.simulation import OdometerModel, car_drive, measure_odometer, static
from reference.aiding_sensors import point_velocity_twin, sway, within_chi_square

ARM = (-1.4, 0.6, 0.9)


@pytest.fixture(name="tripod", scope="module")
def _tripod():
    return static(4000.0, 0.8, 0.2, 50.0)


def measure(motion, seed=0, **keys):
    return measure_odometer(motion, OdometerModel.from_datasheet(**keys), np.random.default_rng(seed))


def test_without_errors_it_is_the_forward_speed_of_its_point():
    motion = sway()
    log, truth = measure(motion, rate_hz=2.0, offset_s=1.03, lever_arm_m=ARM)
    inside = slice(1, -1)
    twin = point_velocity_twin(motion, log.time[inside], ARM)[:, 0]
    np.testing.assert_allclose(log.speed[inside], twin, atol=1e-5)
    np.testing.assert_array_equal(log.speed, truth.speed)
    assert np.ptp(log.speed - measure(motion, rate_hz=2.0, offset_s=1.03)[0].speed) > 0.05
    assert log.sd_speed is None


def test_an_averaging_one_gives_the_mean_over_the_interval_before():
    motion = sway()
    log, _ = measure(motion, rate_hz=0.5, lever_arm_m=ARM, averaged=True)
    for k in (2, 20, 77, 149):
        at = np.linspace(2.0 * k - 2.0, 2.0 * k, 401)
        mean = simpson(point_velocity_twin(motion, at, ARM)[:, 0], x=at) / 2.0
        assert log.speed[k] == pytest.approx(mean, abs=5e-6)
    assert log.speed[0] == pytest.approx(measure(motion, lever_arm_m=ARM)[0].speed[0], abs=1e-12)


def test_the_log_is_made_of_the_stated_parts():
    motion = car_drive(300.0, seed=1, standing=2.0)
    keys = {
        "scale_percent": 2.0,
        "scale_sd_percent": 1.0,
        "speed_sd_mps": 0.05,
        "slips_s": [[50.0, 60.0], [55.0, 70.0]],
    }
    log, truth = measure(motion, slip_percent=(10.0, -30.0), **keys)
    np.testing.assert_allclose(
        log.speed, (1.0 + truth.scale) * (1.0 + truth.slip) * truth.speed + truth.noise, atol=1e-12
    )
    for at, slip in ((49.9, 0.0), (50.0, 0.1), (56.0, -0.2), (60.0, -0.3), (70.0, 0.0)):
        assert truth.slip[np.argmin(abs(truth.true_time - at))] == pytest.approx(slip)


def test_a_car_in_reverse_has_negative_speed():
    motion = car_drive(60.0, seed=1, standing=2.0)
    backwards, _ = measure(motion, scale_percent=-200.0)
    assert backwards.speed.min() < -5.0


def test_noise_and_scale_have_the_stated_deviations(tripod):
    _, truth = measure(tripod, rate_hz=1.0, speed_sd_mps=0.05)
    assert within_chi_square(truth.noise[:, None], 0.05)
    short = static(2.0)
    scales = [measure(short, seed, scale_percent=1.0, scale_sd_percent=3.0)[1].scale for seed in range(500)]
    assert within_chi_square(np.array(scales)[:, None] - 0.01, 0.03)


def test_rounding_is_to_the_nearest_step_and_stated(tripod):
    log, truth = measure(tripod, rate_hz=1.0, speed_sd_mps=0.05, speed_lsb_mps=0.02)
    np.testing.assert_allclose(log.speed / 0.02, np.rint(log.speed / 0.02), atol=1e-9)
    rest = log.speed - truth.noise - truth.speed
    assert abs(rest).max() <= 0.01 + 1e-12
    assert np.std(rest) == pytest.approx(0.02 / math.sqrt(12.0), rel=0.05)
    np.testing.assert_allclose(log.sd_speed, math.sqrt(0.05**2 + 0.02**2 / 12.0))
    assert not np.signbit(log.speed[log.speed == 0.0]).any()
    assert measure(tripod, speed_sd_mps=0.05, stated_sigma_factor=0.0)[0].sd_speed is None
    np.testing.assert_allclose(measure(tripod, speed_sd_mps=0.05, stated_sigma_factor=0.5)[0].sd_speed, 0.025)


def test_counted_pulses_never_lose_distance():
    motion = car_drive(300.0, seed=1, standing=2.0)
    log, truth = measure(motion, averaged=True, pulses_per_m=25.0)
    pulses = log.speed / 10.0 * 25.0
    np.testing.assert_allclose(pulses, np.rint(pulses), atol=1e-9)
    gone = np.cumsum(log.speed - truth.speed) / 10.0
    assert abs(gone).max() <= 0.5 / 25.0 + 1e-9
    moving = truth.speed > 2.0
    error = (log.speed - truth.speed)[moving]
    assert np.std(error) == pytest.approx(log.sd_speed[0], rel=0.1)


def test_random_slips_come_as_often_and_as_large_as_stated():
    keys = {"slips_per_h": 9.0, "slip_mean_s": 60.0, "slip_sd_percent": 20.0}
    _, truth = measure(static(400_000.0), rate_hz=1.0, **keys)
    on = truth.slip != 0.0
    begins = np.flatnonzero(on[1:] & ~on[:-1]) + 1
    assert within_chi_square(truth.slip[begins][:, None], 0.2)
    busy = 1.0 - math.exp(-9.0 / 3600.0 * 60.0)
    assert on.mean() == pytest.approx(busy, rel=3.5 * math.sqrt(2.0 / 1000.0))


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"lever_arm_m": 1.0}, "lever_arm must be three finite numbers"),
        ({"scale_percent": np.nan}, "scale must be a number and finite"),
        ({"averaged": 1}, "averaged must be true or false, not 1"),
        ({"pulses_per_m": 25.0}, "pulses_per_metre needs averaged = true"),
        ({"pulses_per_m": 25.0, "averaged": True, "speed_lsb_mps": 0.1}, "takes the place of speed_lsb"),
        ({"slips_s": [[2.0, 1.0]], "slip_percent": 1.0}, r"slips must be windows \[from, to\] with from < to"),
        ({"slips_s": [[1.0, 2.0]]}, "slips and slip need each other"),
        ({"slip_percent": 10.0}, "slips and slip need each other"),
        ({"slips_s": [[1.0, 2.0]], "slip_percent": (1.0, 2.0)}, "one for each of the 1 windows of slips"),
        ({"slips_s": [[1.0, 2.0]], "slip_percent": np.inf}, "slip must be finite"),
        ({"slips_per_h": 5.0}, "random slips need slip_frequency and slip_mean and slip_sd > 0"),
    ],
)
def test_settings_that_make_no_sense_are_refused(keys, message):
    with pytest.raises(ConfigError, match=message):
        OdometerModel.from_datasheet(**keys)
