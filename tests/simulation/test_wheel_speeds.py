from __future__ import annotations

import csv
import math

import numpy as np
import pytest
from scipy.integrate import simpson

from navfuse.errors import ConfigError
from navfuse.simulation import Wheel, WheelSpeedModel, car_drive, measure_wheel_speeds, static
from reference.aiding_sensors import WHEELS, point_velocity_twin, sway, within_chi_square


def measure(motion, seed=0, wheels=WHEELS, **keys):
    return measure_wheel_speeds(
        motion, WheelSpeedModel.from_datasheet(wheels=wheels, **keys), np.random.default_rng(seed)
    )


def test_without_errors_each_wheel_rolls_at_its_point_of_contact():
    motion = sway()
    log, truth = measure(motion, rate_hz=2.0, offset_s=1.03, averaged=False)
    time = log.time[1:-1]
    steered = point_velocity_twin(motion, time, (1.3, -0.8, 0.5))
    plain = point_velocity_twin(motion, time, (-1.4, 0.7, 0.4))
    in_the_road = steered - steered * (0.0, 0.0, 1.0)
    assert log.wheels == ("front_left", "rear_right")
    np.testing.assert_allclose(log.speed[1:-1, 0], np.linalg.norm(in_the_road, axis=1), atol=1e-5)
    np.testing.assert_allclose(log.speed[1:-1, 1], plain[:, 0], atol=1e-5)
    np.testing.assert_array_equal(log.speed, truth.speed)
    assert np.ptp(log.speed[:, 0] - log.speed[:, 1]) > 0.1


def test_averages_are_over_the_interval_before():
    motion = sway()
    log, _ = measure(motion, rate_hz=1.0)
    for k in (2, 30, 150):
        at = np.linspace(k - 1.0, float(k), 401)
        v_b = point_velocity_twin(motion, at, (1.3, -0.8, 0.5))
        assert log.speed[k, 0] == pytest.approx(simpson(np.hypot(v_b[:, 0], v_b[:, 1]), x=at), abs=5e-6)


def test_a_turning_car_tells_its_wheels_apart():
    """Half the track width times the rate of turn separates left and right, whatever the speed."""
    motion = car_drive(300.0, seed=1, standing=2.0)
    pair = [{"name": "left", "right_m": -0.8}, {"name": "right", "right_m": 0.8}]
    log, truth = measure(motion, wheels=pair, averaged=False)
    rate = motion.w_eb_b(truth.true_time)[:, 2]
    np.testing.assert_allclose(log.speed[:, 0] - log.speed[:, 1], 1.6 * rate, atol=1e-12)
    assert abs(rate).max() > 0.05


def test_steered_wheels_roll_backwards_too():
    motion = car_drive(60.0, seed=1, standing=2.0)
    log, truth = measure(motion, wheels=[Wheel("a", 1.0, 0.5, 0.3, steered=True)], scale_percent=-200.0)
    assert log.speed.min() < -5.0
    assert truth.speed.max() > 5.0


def test_errors_have_the_stated_deviations():
    _, truth = measure(static(4000.0), rate_hz=1.0, speed_sd_mps=0.05)
    assert within_chi_square(truth.noise, 0.05)
    assert abs(np.corrcoef(truth.noise.T)[0, 1]) < 3.9 / math.sqrt(4000)
    short = static(2.0)
    scales = [measure(short, s, scale_percent=(1.0, 2.0), scale_sd_percent=(3.0, 0.5))[1].scale for s in range(500)]
    assert within_chi_square(np.array(scales) - (0.01, 0.02), (0.03, 0.005))


def test_the_log_is_made_of_the_stated_parts_and_rounded():
    motion = car_drive(120.0, seed=1, standing=2.0)
    log, truth = measure(motion, scale_sd_percent=3.0, speed_sd_mps=0.05, speed_lsb_mps=0.02)
    rest = log.speed - (1.0 + truth.scale) * truth.speed - truth.noise
    assert abs(rest).max() <= 0.01 + 1e-12
    np.testing.assert_allclose(log.speed / 0.02, np.rint(log.speed / 0.02), atol=1e-9)


def test_another_wheel_leaves_the_draws_of_the_first_ones_alone():
    motion = static(60.0)
    more = (*WHEELS, {"name": "spare"})
    one, other = (measure(motion, 3, w, speed_sd_mps=0.1, scale_sd_percent=1.0)[1] for w in (WHEELS, more))
    np.testing.assert_array_equal(one.noise, other.noise[:, :2])
    np.testing.assert_array_equal(one.scale, other.scale[:2])


def test_the_coursework_has_steps_and_columns_like_these(shared_data):
    """Four wheels, quantised to 0.02 m/s."""
    path = shared_data / "ucl-comp0130" / "cw1-A" / "Dead_reckoning.csv"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    with path.open() as stream:
        rows = np.array([[float(cell) for cell in row] for row in csv.reader(stream)])
    steps = rows[:, 1:5] / 0.02
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"wheels": ()}, "wheels must name at least one wheel"),
        ({"wheels": [{"name": "a"}, {"name": "a"}]}, "the wheel 'a' is there twice"),
        ({"wheels": [{"name": "a b"}]}, "a wheel needs a name of letters, digits and underscores, not 'a b'"),
        ({"wheels": [{"forward_m": 1.0}]}, "a wheel needs a name of letters, digits and underscores, not ''"),
        ({"wheels": [{"name": "a", "forwad_m": 1.0}]}, "unknown key or unit 'forwad_m': did you mean 'forward_m'"),
        ({"wheels": [{"name": "a", "right_m": np.nan}]}, "right_m of wheel 'a' must be a number and finite"),
        ({"wheels": [{"name": "a", "steered": "yes"}]}, "steered of wheel 'a' must be true or false"),
        ({"wheels": 4}, "wheels must be a list, not 4"),
        ({"wheels": {"name": "a"}}, "wheels must be a list, not {"),
        ({"wheels": ["front"]}, "wheels must hold Wheel or tables of its fields, not str"),
        ({"scale_percent": (1.0, 2.0, 3.0)}, "scale must be one number or one for each of the 2 wheels"),
        ({"averaged": "no"}, "averaged must be true or false"),
    ],
)
def test_settings_that_make_no_sense_are_refused(keys, message):
    with pytest.raises(ConfigError, match=message):
        WheelSpeedModel.from_datasheet(**({"wheels": WHEELS} | keys))
