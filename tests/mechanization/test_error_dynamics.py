"""Transition and covariance of the propagator against differences of the mechanization and against Van Loan."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.mechanization.error_dynamics import imu_state_map
from navfuse.mechanization.propagate import Propagator, identity_transition
from reference.engine_runs import nav_at, perfect_increments
from reference.error_runs import (
    BIASES,
    MOTIONS,
    NAMES,
    NOISE,
    RATES,
    SENSOR_ERRORS,
    SIZES,
    VARIANCE,
    WALK,
    N,
    by_van_loan,
    differences,
    effects,
    in_sigmas,
    propagate,
    start_covariance,
)

FRAMES = pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])
ON_MOTIONS = pytest.mark.parametrize("name", MOTIONS)


@FRAMES
@ON_MOTIONS
def test_transition_is_the_derivative_of_the_mechanization(name, ecef):
    motion = MOTIONS[name]
    increments = perfect_increments(motion, 100.0, 10.0, 11.0)
    nav = nav_at(motion, 10.0, ecef)
    F = propagate(increments, nav, BIASES, ecef)[2][:9]
    worst = effects(F, differences(increments, nav, BIASES, ecef))
    assert np.all(worst < [5e-7, 1e-6, 2e-7])


@FRAMES
@ON_MOTIONS
def test_transition_with_estimated_scale_and_coupling_is_off_by_no_more_than_these(name, ecef):
    motion = MOTIONS[name]
    increments = perfect_increments(motion, 100.0, 10.0, 11.0)
    nav = nav_at(motion, 10.0, ecef)
    F = propagate(increments, nav, SENSOR_ERRORS, ecef)[2][:9]
    reference = differences(increments, nav, SENSOR_ERRORS, ecef)
    relative = effects(F, reference) / effects(np.zeros_like(F), reference)
    assert np.all(relative < 3.0 * np.abs(SENSOR_ERRORS[6:]).max())


@FRAMES
def test_transition_of_a_low_covariance_rate_is_second_order(ecef):
    motion = MOTIONS["steep turns at 150 m/s"]
    increments = perfect_increments(motion, 100.0, 10.0, 12.0)
    nav = nav_at(motion, 10.0, ecef)
    full = propagate(increments, nav, BIASES, ecef, period=0.0)[2][:9]
    tenth = propagate(increments, nav, BIASES, ecef, period=0.1)[2][:9]
    fifth = propagate(increments, nav, BIASES, ecef, period=0.2)[2][:9]
    assert np.all(effects(tenth, full) < [5e-5, 5e-6, 2e-7])
    assert effects(fifth, full)[0] > 3.5 * effects(tenth, full)[0]


@FRAMES
@pytest.mark.parametrize("name", ["car", "steep turns at 150 m/s", "steep turns at 86 degrees"])
@pytest.mark.parametrize("start", [3.0, 0.0], ids=["from large errors", "from none"])
def test_covariance_follows_the_linear_error_equations(name, start, ecef):
    motion = MOTIONS[name]
    P0 = start_covariance(start * SIZES) if start else np.zeros((N, N))
    reference = by_van_loan(motion, 10.0, 14.0, P0, ecef)
    stochastic = np.column_stack([VARIANCE, WALK, RATES])
    increments = perfect_increments(motion, 100.0, 10.0, 14.0)
    for period, bound in ((0.0, 2e-4), (0.1, 5e-4)):
        P = propagate(increments, nav_at(motion, 10.0, ecef), np.zeros(N - 9), ecef, period, P0, NOISE, stochastic)[1]
        assert in_sigmas(P, reference) < bound


@FRAMES
def test_covariance_stays_symmetric_and_positive_definite(ecef):
    motion = MOTIONS["steep turns at 150 m/s"]
    stochastic = np.column_stack([VARIANCE, WALK, RATES])
    increments = perfect_increments(motion, 100.0)
    for period in (0.0, 0.1, 1.0):
        P = propagate(
            increments, nav_at(motion, 0.0, ecef), np.zeros(N - 9), ecef, period, 1e-6 * np.eye(N), NOISE, stochastic
        )[1]
        assert np.array_equal(P, P.T)
        sd = np.sqrt(np.diagonal(P))
        assert np.linalg.eigvalsh(P / np.outer(sd, sd)).min() > 0.0


@FRAMES
def test_gauss_markov_states_keep_their_steady_state(ecef):
    motion = MOTIONS["car"]
    stochastic = np.column_stack([VARIANCE, np.zeros(N - 9), np.full(N - 9, 0.5)])
    P0 = np.zeros((N, N))
    P0[range(9, N), range(9, N)] = VARIANCE
    nav = nav_at(motion, 0.0, ecef)
    P = propagate(perfect_increments(motion, 100.0), nav, np.zeros(N - 9), ecef, 0.1, P0, NOISE, stochastic)[1]
    np.testing.assert_allclose(np.diagonal(P)[9:], VARIANCE, rtol=1e-12)


def test_estimates_of_gauss_markov_states_fade():
    motion = MOTIONS["car"]
    increments = perfect_increments(motion, 100.0)
    stochastic = np.column_stack([VARIANCE, WALK, RATES])
    propagator = Propagator(imu_state_map(NAMES), np.zeros(2), stochastic, False, 0.1, -1.0)
    s, x, P, F = SENSOR_ERRORS.copy(), np.concatenate([np.zeros(9), SENSOR_ERRORS]), np.zeros((N, N)), np.empty((0, N))
    out, acc, last = propagator.buffers(0, transitions=False), propagator.accumulator(), np.zeros(6)
    nav = nav_at(motion, 0.0, ecef=False)
    propagator.advance(increments, 0, 0.0, 30.0, nav, s, x, P, F, acc, 0, out, last)
    expected = SENSOR_ERRORS * np.exp(-30.0 * RATES)
    np.testing.assert_allclose(s, expected, rtol=1e-12)
    np.testing.assert_allclose(x[9:], expected, rtol=1e-12)


@FRAMES
def test_an_error_estimate_is_carried_by_the_transition(ecef):
    motion = MOTIONS["steep turns at 150 m/s"]
    increments = perfect_increments(motion, 100.0, 10.0, 12.0)
    propagator = Propagator(imu_state_map(NAMES), np.zeros(2), np.zeros((N - 9, 3)), ecef, 0.1, -1.0)
    x, F = SIZES * np.cos(np.arange(N)), identity_transition(N)
    before = x.copy()
    out, acc, last = propagator.buffers(0, transitions=False), propagator.accumulator(), np.zeros(6)
    nav, P = nav_at(motion, 10.0, ecef), np.zeros((N, N))
    propagator.advance(increments, 0, 10.0, 12.0, nav, BIASES.copy(), x, P, F, acc, 0, out, last)
    np.testing.assert_allclose(x[:9], F[:9] @ before, rtol=1e-12, atol=1e-15)
    assert np.array_equal(x[9:], before[9:])
