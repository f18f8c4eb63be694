from __future__ import annotations

import math

import pytest

from navfuse.core.stochastic import gauss_markov_decay, gauss_markov_noise, random_walk_noise


@pytest.mark.parametrize("tau", [math.inf, 0.0, -1.0])
def test_without_correlation_time_a_state_keeps_its_value_and_needs_no_noise(tau):
    assert gauss_markov_decay(0.5, tau) == 1.0
    assert gauss_markov_noise(3.0, 0.5, tau) == 0.0


def test_decay_after_one_correlation_time():
    assert gauss_markov_decay(3600.0, 3600.0) == pytest.approx(1.0 / math.e, abs=1e-16)


@pytest.mark.parametrize("dt", [0.005, 1.0, 400.0, 1e5])
def test_variance_stays_stationary(dt):
    sigma, tau = 0.7, 300.0
    decay = gauss_markov_decay(dt, tau)
    assert decay**2 * sigma**2 + gauss_markov_noise(sigma, dt, tau) == pytest.approx(sigma**2, abs=2e-16)


def test_two_steps_are_one_step():
    first, second, tau, sigma = 0.3, 1.1, 2.0, 1.5
    decay = gauss_markov_decay(second, tau)
    variance = decay**2 * gauss_markov_noise(sigma, first, tau) + gauss_markov_noise(sigma, second, tau)
    assert gauss_markov_decay(first, tau) * decay == pytest.approx(gauss_markov_decay(first + second, tau), abs=1e-16)
    assert variance == pytest.approx(gauss_markov_noise(sigma, first + second, tau), abs=1e-15)


def test_short_steps_do_not_cancel():
    dt, tau = 1e-12, 3600.0
    x = 2.0 * dt / tau
    assert gauss_markov_noise(1.0, dt, tau) == pytest.approx(x - x * x / 2.0, rel=4e-16)


def test_random_walk_grows_with_time():
    assert random_walk_noise(0.25, 0.5) + random_walk_noise(0.25, 1.5) == random_walk_noise(0.25, 2.0) == 0.5
