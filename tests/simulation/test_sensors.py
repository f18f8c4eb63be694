from __future__ import annotations

import math

import numpy as np
import pymap3d
import pytest
from scipy import stats

from navfuse.data.logs import ImuLog
from navfuse.errors import ConfigError, InputError
from navfuse.imu.error_model import ImuErrorModel
from navfuse.simulation import (
    add_imu_errors,
    antenna_state,
    car_drive,
    figure_eight_flight,
    gauss_markov,
    gnss_fixes,
    noisy_fixes,
    perfect_imu,
    sample_times,
    static,
)

LEVER_ARM = (1.5, -0.4, -1.2)


def within_chi_square(values, sd, axis=None):
    """Whether the mean square of independent normals of known sd lies in its 99.9 % interval."""
    values = np.asarray(values)
    n = values.size if axis is None else values.shape[axis]
    low, high = stats.chi2.ppf([0.0005, 0.9995], n) / n
    ratio = np.mean(values**2, axis=axis) / np.square(sd)
    return bool(np.all((low < ratio) & (ratio < high)))


def test_the_check_itself_notices_a_wrong_sd():
    draws = np.random.default_rng(0).standard_normal((10000, 3))
    assert within_chi_square(draws, 1.0, axis=0)
    assert not within_chi_square(1.08 * draws, 1.0, axis=0)


@pytest.fixture(name="drive", scope="module")
def _drive():
    return car_drive(60.0, seed=4, standing=2.0)


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("rate", [50.0, 200.0])
def test_white_noise_has_the_density_of_the_model_at_any_rate(drive, kind, rate):
    ideal = perfect_imu(drive, sample_times(0.0, 60.0, rate), kind)
    model = ImuErrorModel(arw=3e-4, vrw=2e-3)
    noisy, _ = add_imu_errors(ideal, model, np.random.default_rng(1))
    per_sample = rate**0.5 if kind == "rates" else rate**-0.5
    assert within_chi_square(noisy.gyro - ideal.gyro, 3e-4 * per_sample, axis=0)
    assert within_chi_square(noisy.accel - ideal.accel, 2e-3 * per_sample, axis=0)
    angle = np.sum(noisy.gyro[1:] - ideal.gyro[1:], axis=0) / (rate if kind == "rates" else 1.0)
    assert np.all(np.abs(angle) < 3.9 * 3e-4 * math.sqrt(60.0))


def test_white_noise_follows_irregular_intervals():
    dt = np.random.default_rng(2).choice([0.005, 0.02], 20000)
    time = np.cumsum(dt)
    ideal = ImuLog(time, np.zeros((20000, 3)), np.zeros((20000, 3)), "increments")
    noisy, _ = add_imu_errors(ideal, ImuErrorModel(arw=1.0), np.random.default_rng(3))
    for interval in (0.005, 0.02):
        assert within_chi_square(noisy.gyro[1:][np.isclose(np.diff(time), interval)], math.sqrt(interval), axis=0)


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_the_measurement_is_the_error_model_of_the_truth(drive, kind):
    ideal = perfect_imu(drive, sample_times(0.0, 60.0, 100.0), kind)
    model = ImuErrorModel(
        gyro_bias_sd=1e-3,
        gyro_bias_tau=50.0,
        accel_bias_sd=(0.1, 0.2, 0.3),
        accel_bias_walk=0.01,
        gyro_scale_sd=1e-3,
        gyro_scale_tau=20.0,
        accel_scale_sd=2e-3,
        gyro_cross_sd=1e-3,
        accel_cross_sd=2e-3,
    )
    noisy, errors = add_imu_errors(ideal, model, np.random.default_rng(4))
    gain = 1.0 if kind == "rates" else 0.01
    for measured, true, bias, scale, cross in (
        (noisy.gyro, ideal.gyro, errors.gyro_bias, errors.gyro_scale, errors.gyro_cross),
        (noisy.accel, ideal.accel, errors.accel_bias, errors.accel_scale, errors.accel_cross),
    ):
        assert np.all(np.diag(cross) == 0.0)
        assert np.all(cross[~np.eye(3, dtype=bool)] != 0.0)
        for k in range(0, 6001, 500):
            M = np.diag(scale[k]) + cross
            np.testing.assert_allclose(measured[k], (np.eye(3) + M) @ true[k] + bias[k] * gain, atol=1e-12)
    assert (noisy.kind, noisy.source) == (kind, ideal.source)
    np.testing.assert_array_equal(errors.time, ideal.time)


def test_a_perfect_model_changes_nothing(drive):
    ideal = perfect_imu(drive, sample_times(0.0, 60.0, 10.0))
    noisy, errors = add_imu_errors(ideal, ImuErrorModel(), np.random.default_rng(0))
    np.testing.assert_array_equal(noisy.gyro, ideal.gyro)
    np.testing.assert_array_equal(noisy.accel, ideal.accel)
    assert not errors.gyro_bias.any()


def test_errors_are_drawn_with_the_stated_deviations():
    ideal = ImuLog(np.array([0.0, 1.0]), np.zeros((2, 3)), np.zeros((2, 3)), "rates")
    model = ImuErrorModel(
        gyro_bias_sd=(1.0, 2.0, 3.0),
        accel_bias_sd=4.0,
        gyro_scale_sd=5.0,
        accel_scale_sd=6.0,
        gyro_cross_sd=7.0,
        accel_cross_sd=8.0,
    )
    draws = [add_imu_errors(ideal, model, np.random.default_rng(seed))[1] for seed in range(1500)]
    assert within_chi_square([d.gyro_bias[0] for d in draws], [1.0, 2.0, 3.0], axis=0)
    assert within_chi_square([d.accel_bias[0] for d in draws], 4.0, axis=0)
    assert within_chi_square([d.gyro_scale[0] for d in draws], 5.0, axis=0)
    assert within_chi_square([d.accel_scale[0] for d in draws], 6.0, axis=0)
    off = ~np.eye(3, dtype=bool)
    assert within_chi_square([d.gyro_cross[off] for d in draws], 7.0, axis=0)
    assert within_chi_square([d.accel_cross[off] for d in draws], 8.0, axis=0)
    np.testing.assert_array_equal(draws[0].gyro_bias[0], draws[0].gyro_bias[1])


def test_changing_one_parameter_leaves_the_other_draws_alone(drive):
    ideal = perfect_imu(drive, sample_times(0.0, 60.0, 10.0))
    model = ImuErrorModel(arw=1e-4, vrw=1e-3, gyro_bias_sd=1e-3, accel_bias_sd=0.01, accel_scale_sd=1e-3)
    one, errors = add_imu_errors(ideal, model, np.random.default_rng(5))
    other, other_errors = add_imu_errors(ideal, model.replace(gyro_bias_tau=10.0, arw=0.0), np.random.default_rng(5))
    np.testing.assert_array_equal(one.accel, other.accel)
    np.testing.assert_array_equal(errors.accel_scale, other_errors.accel_scale)
    np.testing.assert_array_equal(errors.gyro_bias[0], other_errors.gyro_bias[0])


def test_gauss_markov_is_stationary_and_forgets_at_its_rate():
    tau, dt, paths = 5.0, 0.5, 700
    time = np.arange(0.0, 30.0, dt)
    rng = np.random.default_rng(6)
    x = np.stack([gauss_markov(time, (1.0, 2.0, 3.0), tau, 0.0, rng) for _ in range(paths)])
    for k in (0, 1, 10, time.size - 1):
        assert within_chi_square(x[:, k], [1.0, 2.0, 3.0], axis=0)
    for lag in (1, 4, 10, 20):
        correlation = np.mean(x[:, lag:, :] * x[:, :-lag, :], axis=(0, 1)) / np.square([1.0, 2.0, 3.0])
        np.testing.assert_allclose(correlation, math.exp(-lag * dt / tau), atol=0.06)


def test_gauss_markov_innovations_fit_irregular_sampling():
    tau = 2.0
    time = np.cumsum(np.random.default_rng(7).uniform(0.01, 1.0, 30000))
    x = gauss_markov(time, 1.5, tau, 0.0, np.random.default_rng(8))
    decay = np.exp(-np.diff(time) / tau)[:, None]
    innovation = (x[1:] - decay * x[:-1]) / (1.5 * np.sqrt(1.0 - decay**2))
    assert within_chi_square(innovation, 1.0, axis=0)
    lagged = np.mean(innovation[1:] * innovation[:-1], axis=0)
    assert np.all(np.abs(lagged) < 4.0 / math.sqrt(30000))


def test_a_random_walk_grows_with_the_square_root_of_time():
    time = np.arange(0.0, 200.0, 0.1)
    x = gauss_markov(time, 0.0, math.inf, (0.1, 0.2, 0.3), np.random.default_rng(9))
    np.testing.assert_array_equal(x[0], 0.0)
    assert within_chi_square(np.diff(x, axis=0), np.array([0.1, 0.2, 0.3]) * math.sqrt(0.1), axis=0)


def test_a_constant_is_one_draw_and_a_walk_starts_from_it():
    time = np.arange(0.0, 100.0)
    constant = gauss_markov(time, 2.0, math.inf, 0.0, np.random.default_rng(10))
    assert np.ptp(constant, axis=0).max() == 0.0
    walking = gauss_markov(time, 2.0, math.inf, 0.01, np.random.default_rng(10))
    np.testing.assert_array_equal(walking[0], constant[0])
    assert np.ptp(walking, axis=0).min() > 0.0


@pytest.mark.parametrize("lat", [0.8, -0.1, math.pi / 2.0])
def test_antenna_velocity_is_the_rate_of_antenna_position(lat):
    for motion in (car_drive(60.0, seed=1, standing=2.0, lat=lat), figure_eight_flight(60.0, straight=3.0, lat=lat)):
        t, h = np.linspace(1.0, 59.0, 200), 1e-3
        ahead, behind = antenna_state(motion, t + h, LEVER_ARM)[0], antenna_state(motion, t - h, LEVER_ARM)[0]
        r_e, v_e = antenna_state(motion, t, LEVER_ARM)
        np.testing.assert_allclose(v_e, (ahead - behind) / (2.0 * h), atol=1e-5)
        np.testing.assert_allclose(np.linalg.norm(r_e - motion.r_e(t), axis=1), np.linalg.norm(LEVER_ARM), atol=1e-8)
        assert np.abs(v_e - motion.v_e(t)).max() > 0.1


def test_an_antenna_on_a_tripod_does_not_move():
    _, v_e = antenna_state(static(10.0, heading=1.0), np.linspace(0.0, 10.0, 5), LEVER_ARM)
    assert np.abs(v_e).max() < 1e-8


def test_fixes_without_errors_are_the_antenna():
    motion = car_drive(60.0, seed=1, standing=2.0)
    log = gnss_fixes(motion, 4.0, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3), LEVER_ARM, offset=0.013)
    np.testing.assert_allclose(log.time, 0.013 + np.arange(240) / 4.0)
    r_e, v_e = antenna_state(motion, log.time, LEVER_ARM)
    x = np.column_stack(pymap3d.geodetic2ecef(log.lat, log.lon, log.height, deg=False))
    np.testing.assert_allclose(x, r_e, atol=1e-8)
    v_n = np.column_stack(pymap3d.ecef2enuv(*v_e.T, log.lat, log.lon, deg=False))[:, [1, 0, 2]] * (1.0, 1.0, -1.0)
    np.testing.assert_allclose(log.velocity_n, v_n, atol=1e-9)
    np.testing.assert_array_equal(log.sd_position, np.tile([1.0, 2.0, 3.0], (240, 1)))
    np.testing.assert_array_equal(log.sd_velocity, np.tile([0.1, 0.2, 0.3], (240, 1)))


@pytest.mark.parametrize(("lat", "lon"), [(0.8, 0.2), (0.1, math.pi), (-1.56, 3.0)])
def test_errors_of_the_fixes_have_the_stated_deviations(lat, lon):
    motion = static(4000.0, lat, lon, 50.0, heading=1.0)
    log = gnss_fixes(motion, 1.0, (1.0, 2.0, 4.0), (0.1, 0.2, 0.4), LEVER_ARM, np.random.default_rng(11))
    exact = gnss_fixes(motion, 1.0, (1.0, 2.0, 4.0), (0.1, 0.2, 0.4), LEVER_ARM)
    east, north, up = pymap3d.geodetic2enu(
        log.lat, log.lon, log.height, exact.lat[0], exact.lon[0], exact.height[0], deg=False
    )
    assert within_chi_square(np.column_stack([north, east, -up]), [1.0, 2.0, 4.0], axis=0)
    assert within_chi_square(log.velocity_n, [0.1, 0.2, 0.4], axis=0)
    assert abs(np.corrcoef(north, log.velocity_n[:, 0])[0, 1]) < 0.07


def test_a_receiver_without_velocity_leaves_it_out():
    motion = static(10.0)
    log = gnss_fixes(motion, 1.0, 1.0, None, rng=np.random.default_rng(0))
    assert log.velocity_n is None
    assert log.sd_velocity is None
    both = gnss_fixes(motion, 1.0, 1.0, 0.1, rng=np.random.default_rng(0))
    np.testing.assert_array_equal(log.lat, both.lat)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"sd_position": (1.0, 0.0, 1.0)}, "sd_position must be three finite numbers > 0"),
        ({"sd_velocity": (0.1, -0.1, 0.1)}, "sd_velocity must be three finite numbers > 0"),
        ({"sd_position": math.nan}, "sd_position must be three finite numbers > 0"),
        ({"rate": 0.0}, "sampling rate must be positive"),
        ({"offset": -1.0}, "must not be negative, not -1.0"),
    ],
)
def test_impossible_receivers_are_refused(arguments, message):
    settings = {"rate": 1.0, "sd_position": 1.0, "sd_velocity": 0.1} | arguments
    with pytest.raises(ConfigError, match=message):
        gnss_fixes(static(10.0), **settings)


def test_a_motion_too_short_for_a_fix_is_refused():
    with pytest.raises(InputError, match="ends at 10 s, before the first GNSS fix at 12 s"):
        gnss_fixes(static(10.0), 1.0, 1.0, None, offset=12.0)


def test_noisy_fixes_have_the_times_and_sigmas_of_the_other_log():
    motion = car_drive(60.0, seed=3)
    like = gnss_fixes(motion, 10.0, [1.0, 2.0, 4.0], [0.1, 0.2, 0.3], LEVER_ARM)
    like = like.take(np.flatnonzero(like.time % 1.0 > 0.05))
    like.sd_position[:50] *= 5.0
    like.velocity_n[3] = np.nan
    log = noisy_fixes(motion, like, LEVER_ARM, np.random.default_rng(4))
    exact = noisy_fixes(motion, like.take(slice(0, 60)), LEVER_ARM, np.random.default_rng(4))
    assert np.array_equal(log.time, like.time)
    assert np.array_equal(log.sd_position, like.sd_position)
    assert np.isnan(log.velocity_n[3]).all()
    assert np.count_nonzero(np.isnan(log.velocity_n)) == 3
    assert exact.lat.size == 60
    truth = gnss_fixes(motion, 10.0, 1.0, 1.0, LEVER_ARM)
    row = np.searchsorted(truth.time, log.time - 1e-6)
    north = (log.lat - truth.lat[row]) * 6.37e6
    assert within_chi_square(north[:50] / 5.0, 1.0)
    assert within_chi_square(north[50:], 1.0)
    assert within_chi_square((log.velocity_n - truth.velocity_n[row])[10:], [0.1, 0.2, 0.3], axis=0)
    with pytest.raises(InputError, match="the motion is known from"):
        noisy_fixes(car_drive(10.0, seed=3), like, LEVER_ARM, np.random.default_rng(4))
