from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from navfuse.errors import ConfigError
from navfuse.simulation import HeadingModel, Motion, measure_heading, static
from reference.aiding_sensors import sway, within_chi_square


def measure(motion, seed=0, **keys):
    return measure_heading(motion, HeadingModel.from_datasheet(**keys), np.random.default_rng(seed))


def wrapped_difference(one, other):
    return np.angle(np.exp(1j * (np.asarray(one) - other)))


def test_without_errors_it_is_the_heading_of_the_trajectory():
    motion = sway()
    log, truth = measure(motion, rate_hz=2.0, offset_s=0.3)
    twin = motion.trajectory(log.time).attitude[:, 2]
    np.testing.assert_allclose(wrapped_difference(log.heading, twin), 0.0, atol=1e-12)
    np.testing.assert_array_equal(log.heading, truth.heading)
    assert log.sd_heading is None
    assert np.ptp(log.heading) > 6.0


def test_it_stays_within_a_turn_whatever_is_added():
    motion = sway()
    log, truth = measure(motion, rate_hz=10.0, bias_deg=300.0, heading_sd_deg=100.0, correlated_sd_deg=10.0,
                         correlated_tau_s=np.inf)  # fmt: skip
    assert np.all((log.heading >= 0.0) & (log.heading < 2.0 * math.pi))
    degrees = log.columns()["heading_deg"]
    assert np.all((degrees >= 0.0) & (degrees < 360.0))
    total = truth.heading + truth.bias + truth.correlated + truth.noise
    np.testing.assert_allclose(wrapped_difference(log.heading, total), 0.0, atol=1e-12)


def test_rounding_to_a_full_turn_is_zero():
    motion = static(2.0, 0.8, 0.2, 100.0)
    heading = measure(motion)[1].heading[0]
    log, _ = measure(motion, bias_rad=-heading - math.radians(0.01), heading_lsb_deg=0.1)
    np.testing.assert_array_equal(log.heading, 0.0)
    step, _ = measure(motion, bias_rad=-heading + math.radians(0.26), heading_lsb_deg=0.1)
    np.testing.assert_allclose(np.degrees(step.heading), 0.3, atol=1e-12)


def test_errors_have_the_stated_deviations():
    tripod = static(4000.0)
    _, truth = measure(tripod, heading_sd_deg=4.0, correlated_sd_deg=2.0, correlated_tau_s=20.0)
    assert within_chi_square(truth.noise[:, None], math.radians(4.0))
    decay = math.exp(-1.0 / 20.0)
    drive = truth.correlated[1:] - decay * truth.correlated[:-1]
    assert within_chi_square(drive[:, None], math.radians(2.0) * math.sqrt(1.0 - decay**2))
    short = static(2.0)
    truths = [
        measure(short, seed, bias_deg=1.0, bias_sd_deg=3.0, correlated_sd_deg=2.0, correlated_tau_s=20.0)[1]
        for seed in range(500)
    ]
    drawn = np.degrees([[t.bias, t.correlated[0]] for t in truths])
    assert within_chi_square(drawn - (1.0, 0.0), (3.0, 2.0))


def test_sigmas_are_stated_for_what_is_not_constant():
    motion = static(5.0)
    keys = {"heading_sd_deg": 4.0, "correlated_sd_deg": 3.0, "correlated_tau_s": 9.0, "bias_sd_deg": 50.0}
    np.testing.assert_allclose(np.degrees(measure(motion, **keys)[0].sd_heading), 5.0)
    np.testing.assert_allclose(np.degrees(measure(motion, stated_sigma_factor=0.5, **keys)[0].sd_heading), 2.5)
    assert measure(motion, stated_sigma_factor=0.0, **keys)[0].sd_heading is None
    coarse, _ = measure(motion, heading_lsb_deg=1.2)
    np.testing.assert_allclose(np.degrees(coarse.sd_heading), 1.2 / math.sqrt(12.0))


def test_a_correlated_error_needs_its_time():
    with pytest.raises(ConfigError, match="correlated_sd needs correlated_tau > 0"):
        HeadingModel.from_datasheet(correlated_sd_deg=1.0)
    with pytest.raises(ConfigError, match="correlated_tau must be at least 0"):
        HeadingModel.from_datasheet(correlated_sd_deg=1.0, correlated_tau_s=-1.0)
    with pytest.raises(ConfigError, match="bias must be a number and finite"):
        HeadingModel.from_datasheet(bias_deg=np.nan)


def test_an_inverted_body_has_the_heading_of_its_nose():
    still = static(10.0, 0.8, 0.2, 100.0)
    time = np.arange(11.0)
    C_en = still.C_eb(time) @ np.swapaxes(still.C_nb(time), 1, 2)
    C_eb = C_en @ Rotation.from_euler("ZYX", [200.0, 60.0, 170.0], degrees=True).as_matrix()
    q_eb = Rotation.from_matrix(C_eb).as_quat(scalar_first=True)
    log, _ = measure(Motion.from_knots(time, still.r_e(time), q_eb))
    np.testing.assert_allclose(np.degrees(log.heading), 200.0, atol=1e-9)
