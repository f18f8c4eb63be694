from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from navfuse.analysis.nees import navigation_errors, nees
from navfuse.errors import ConfigError
from navfuse.montecarlo import SimulatedRecipe
from navfuse.montecarlo.recipes import MOTIONS
from navfuse.simulation import car_drive, drawn_start, simulate

SHORT = {"duration": 20.0, "imu_rate": 20.0}


def test_the_same_seed_gives_the_same_run():
    one, again, other = (SimulatedRecipe("car", **SHORT)(seed) for seed in (7, 7, 8))
    for name in ("gyro", "accel"):
        assert np.array_equal(getattr(one.logs.imu, name), getattr(again.logs.imu, name))
        assert not np.array_equal(getattr(one.logs.imu, name), getattr(other.logs.imu, name))
    assert np.array_equal(one.start.nav, again.start.nav)
    assert not np.array_equal(one.start.nav, other.start.nav)
    assert not np.array_equal(one.logs.gnss.height, other.logs.gnss.height)


def test_logs_are_those_of_simulate():
    case = SimulatedRecipe("car", **SHORT)(3)
    logs = simulate(car_drive(20.0, seed=1), case.model, 3, imu_rate=20.0, lever_arm_b=(0.8, -0.5, -1.4))
    assert np.array_equal(case.logs.imu.gyro, logs.imu.gyro)
    assert np.array_equal(case.logs.gnss.lat, logs.gnss.lat)
    assert np.array_equal(case.logs.imu_errors.accel_scale, logs.imu_errors.accel_scale)


def test_the_start_error_is_a_draw_from_its_covariance():
    motion, rng, count = car_drive(20.0, seed=1), np.random.default_rng(1), 400
    sds = ([1.0, 2.0, 3.0], [0.1, 0.2, 0.3], np.radians([0.2, 0.4, 1.0]))
    starts = [drawn_start(motion, 2.0, *sds, rng) for _ in range(count)]
    truth = motion.at(np.full(count, 2.0))
    error, _ = navigation_errors(truth.r_e, truth.v_e, truth.q_eb, np.array([start.nav for start in starts]), False)
    low, high = chi2.ppf([0.0005, 0.9995], 9 * count) / (9 * count)
    assert low < np.mean(nees(error, np.array([start.P for start in starts]))) / 9.0 < high
    np.testing.assert_allclose(np.std(error[:, :6], axis=0), np.hstack(sds[:2]), rtol=0.15)


def test_factors_change_what_the_filter_is_told_and_nothing_else():
    plain = SimulatedRecipe("car", **SHORT)(1)
    wrong = SimulatedRecipe("car", gnss_sd_factor=0.5, imu_noise_factor=0.25, **SHORT)(1)
    assert np.array_equal(plain.logs.imu.gyro, wrong.logs.imu.gyro)
    assert np.array_equal(plain.logs.gnss.velocity_n, wrong.logs.gnss.velocity_n)
    assert np.array_equal(plain.start.nav, wrong.start.nav)
    for plain_sensor, wrong_sensor in zip(plain.sensors, wrong.sensors, strict=True):
        np.testing.assert_allclose(wrong_sensor.noise(3), 0.5 * plain_sensor.noise(3))
        assert np.array_equal(wrong_sensor.value(3), plain_sensor.value(3))
    assert wrong.model.arw == 0.25 * plain.model.arw
    assert wrong.model.vrw == 0.25 * plain.model.vrw
    np.testing.assert_allclose(wrong.model.gyro_bias_walk, 0.25 * plain.model.axes("gyro_bias_walk"))
    np.testing.assert_allclose(wrong.model.gyro_bias_sd, plain.model.gyro_bias_sd)


def test_settings_reach_the_filter():
    case = SimulatedRecipe("static", frame="ecef", scale_states=False, sd_velocity=None, smooth=True, **SHORT)(0)
    assert case.settings.ecef
    assert case.smooth
    assert [sensor.name for sensor in case.sensors] == ["gnss_position"]
    assert not np.any(case.logs.imu_errors.gyro_scale)
    withheld = SimulatedRecipe("car", outages_s=((5.0, 10.0),), **SHORT)(0)
    assert [withheld.sensors[0].withheld(k) for k in (4, 5, 9, 10)] == [False, True, True, False]


@pytest.mark.parametrize("name", MOTIONS)
def test_every_offered_motion_can_be_run(name):
    case = SimulatedRecipe(name, **SHORT)(0)
    assert case.logs.imu.time[-1] == pytest.approx(20.0)
    assert case.logs.gnss.time.size == 21


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"name": "carr"}, "unknown motion 'carr': did you mean 'car'? known: car, circle-flight"),
        ({"name": "xyzzy"}, "unknown motion 'xyzzy': known: car"),
        ({"name": "car", "grade": "tacticle"}, "unknown IMU grade 'tacticle'"),
        ({"name": "car", "frame": "enu"}, "frame must be 'ned' or 'ecef', not 'enu'"),
        ({"name": "car", "duration": 0.0}, "duration must be positive and finite, not 0.0"),
        ({"name": "car", "imu_rate": float("nan")}, "imu_rate must be positive and finite, not nan"),
        ({"name": "car", "imu_noise_factor": -1.0}, "imu_noise_factor must be positive"),
        ({"name": "car", "gnss_rate": 0.01, "duration": 50.0}, "gives one fix only; make duration longer"),
    ],
)
def test_bad_settings_are_refused(settings, message):
    with pytest.raises(ConfigError) as caught:
        SimulatedRecipe(**settings)
    assert message in str(caught.value)


def test_a_motion_that_is_not_there():
    with pytest.raises(ConfigError, match="unknown motion 'figure-8': did you mean 'figure-eight'"):
        SimulatedRecipe("figure-8")
