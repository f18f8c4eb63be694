"""Holes in the inertial data."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.imu.gaps import change_over, gap_limit, without_false_start
from navfuse.imu.increments import ImuIncrements


def increments(rate, dt=0.01, force=9.8):
    n = rate.size
    inc_theta, inc_v = np.zeros((n, 3)), np.zeros((n, 3))
    inc_theta[:, 2] = rate * dt
    inc_v[:, 2] = -force * dt
    return ImuIncrements(dt * np.arange(n + 1), inc_theta, inc_v)


def test_limit_is_one_and_a_half_usual_steps():
    assert gap_limit(np.array([0.0, 0.01, 0.02, 0.5, 0.51])) == pytest.approx(0.015)
    assert gap_limit(np.array([1.0])) == np.inf


def test_a_steady_log_says_the_least():
    assert change_over(increments(np.zeros(5000)), 1.0) == (np.radians(1.0), 0.2)


def test_a_swinging_rate_is_measured():
    """Mean minus chord of A sin(w t) over T: for windows at random phase the rms has a closed form."""
    A, w, T = 0.5, 2.0, 1.0
    t = 0.01 * np.arange(200_000)
    got, _ = change_over(increments(A * np.sin(w * t)), T)
    half = w * T / 2
    exact = 2.0 * A / np.sqrt(2.0) * abs(np.sin(half) / half - np.cos(half))
    assert got == pytest.approx(exact, rel=0.03)


def test_a_log_shorter_than_the_gap_says_the_most():
    assert change_over(increments(np.zeros(50)), 2.0) == (np.radians(10.0), 2.0)


def test_a_few_samples_before_a_gap_are_no_start():
    whole = increments(np.zeros(1000))
    time = whole.time.copy()
    time[3:] += 2.0
    got = without_false_start(ImuIncrements(time, whole.inc_theta_b, whole.inc_v_b))
    assert got.time[0] == time[3]
    assert without_false_start(whole) is whole
