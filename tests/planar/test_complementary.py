"""Algorithm 2: closed form of its convergence, order of the Euler step, wrap, gaps, its twin written as matrices."""

import numpy as np
import pytest
from scipy.linalg import expm

from navfuse.errors import ConfigError, InputError
from navfuse.planar import complementary_yaw, planar_dcm


def twin(time, rate, yaw, gain, exact):
    """The tutorial's lines as they stand, with matrices."""
    estimate, out = planar_dcm(yaw[0]), [yaw[0]]
    for k in range(1, time.size):
        T, C = time[k] - time[k - 1], planar_dcm(yaw[k - 1])
        pi = 0.5 * (estimate.T @ C - C.T @ estimate)
        Omega = rate[k] * np.array([[0.0, -1.0], [1.0, 0.0]]) + gain * pi
        if exact:
            estimate = estimate @ expm(Omega * T)
        else:
            estimate = estimate @ (np.eye(2) + Omega * T)
            estimate /= np.sqrt(np.linalg.det(estimate))
        out.append(np.arctan2(estimate[1, 0], estimate[0, 0]))
    return np.array(out)


@pytest.mark.parametrize("method", ["exact", "euler"])
@pytest.mark.parametrize("gain", [1.0, 4.0])
def test_agrees_with_the_matrices_of_the_tutorial(method, gain):
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.uniform(0.005, 0.05, 400))
    rate = 2.0 * np.sin(time) + rng.normal(0.0, 0.1, 400)
    yaw = np.angle(np.exp(1j * (rng.normal(0.0, 0.3, 400) + 5.0 * time)))
    found = complementary_yaw(time, rate, yaw, gain, method=method)
    difference = np.angle(np.exp(1j * (found - twin(time, rate, yaw, gain, method == "exact"))))
    assert np.abs(difference).max() < 1e-12


@pytest.mark.parametrize("gain", [1.0, 3.0])
@pytest.mark.parametrize("error", [0.1, 2.0, -3.0])
def test_converges_as_the_differential_equation_says(gain, error):
    """e' = -K sin e has tan(e / 2) = tan(e0 / 2) exp(-K t); with K_p = 1 an error is 1/e after a second."""
    time = np.linspace(0.0, 5.0, 50_001)  # the feedback is held over steps of 1e-4 s: of first order in K T
    found = complementary_yaw(time, np.zeros_like(time), np.full_like(time, 0.7), gain, start=0.7 + error)
    expected = 2.0 * np.arctan(np.tan(0.5 * error) * np.exp(-gain * time))
    assert np.abs(np.angle(np.exp(1j * (found - 0.7))) - expected).max() < gain * 1e-4


def test_follows_a_true_gyro_exactly_through_the_wrap():
    time = np.linspace(0.0, 60.0, 3001)
    rate = 0.8 * np.sin(0.2 * time) + 0.5
    turned = np.concatenate(([0.0], np.cumsum(rate[1:] * np.diff(time))))
    yaw = np.angle(np.exp(1j * (2.0 + turned)))
    found = complementary_yaw(time, rate, yaw)
    assert np.abs(np.angle(np.exp(1j * (found - 2.0 - turned)))).max() < 1e-11
    assert found.min() < -3.0
    assert found.max() > 3.0
    assert np.abs(np.diff(np.unwrap(found))).max() < 0.03


def test_euler_step_is_of_second_order_in_the_angle():
    """One step turns by atan(w T) for w T, w^3 T^3 / 3 too little: over a fixed time w^3 T^2 / 3 per second."""
    rate, duration = 3.0, 2.0
    lost = []
    for steps in (100, 200, 400):
        time = np.linspace(0.0, duration, steps + 1)
        found = complementary_yaw(time, np.full_like(time, rate), np.full_like(time, np.nan), method="euler", start=0.0)
        lost.append(rate * duration - np.unwrap(found)[-1])
        assert lost[-1] == pytest.approx(rate**3 * (duration / steps) ** 2 / 3.0 * duration, rel=0.01)
    np.testing.assert_allclose(np.divide(lost[:-1], lost[1:]), 4.0, rtol=0.01)


def test_without_a_measurement_the_gyro_alone_is_followed():
    time = np.linspace(0.0, 10.0, 1001)
    yaw = np.where(time < 5.0, 0.0, np.nan)
    found = complementary_yaw(time, np.full_like(time, 0.1), yaw, 2.0)
    assert found[499] == pytest.approx(np.arcsin(0.1 / 2.0), abs=1e-3)
    assert found[-1] - found[500] == pytest.approx(0.5, abs=1e-3)


def test_noise_of_the_measurement_is_reduced():
    rng = np.random.default_rng(5)
    time = np.arange(20_000) * 0.02
    noise = rng.normal(0.0, 0.05, time.size)
    found = complementary_yaw(time, np.zeros_like(time), noise, 1.0)
    # A first-order low-pass of white noise: variance K T / (2 - K T) of it.
    assert found[500:].std() == pytest.approx(0.05 * np.sqrt(0.02 / 1.98), rel=0.1)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"gain": 0.0}, ConfigError, "gain = 0.0 has to be positive"),
        ({"gain": np.nan}, ConfigError, "has to be positive"),
        ({"gain": 30.0}, ConfigError, "would swing up"),
        ({"method": "rk4"}, ConfigError, "'exact' or 'euler'"),
        ({"time": [0.0, 0.1, 0.1]}, InputError, r"time: row 3 \(0.1 s\) is not later"),
        ({"time": [0.0, np.nan, 0.1]}, InputError, "two finite times"),
        ({"gyro_z": [0.0, 0.0]}, InputError, r"gyro_z has shape \(2,\)"),
        ({"gyro_z": [0.0, 0.0, np.nan]}, InputError, "gyro_z: row 3 is not finite"),
        ({"yaw": np.full(3, np.nan)}, InputError, "no row holds a measurement"),
        ({"yaw": np.zeros((3, 2))}, InputError, "yaw has shape"),
    ],
)
def test_what_cannot_be(changes, error, message):
    given = {"time": [0.0, 0.1, 0.2], "gyro_z": np.zeros(3), "yaw": np.zeros(3)} | changes
    with pytest.raises(error, match=message):
        complementary_yaw(**given)
