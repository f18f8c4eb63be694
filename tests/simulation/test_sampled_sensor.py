from __future__ import annotations

import numpy as np
import pytest

from navfuse.simulation.sampled_sensor import boxes, interval_means, rounded, stated_sd


def test_means_over_intervals_are_exact_for_smooth_functions():
    time = np.arange(0.0, 50.0, 0.7)
    means = interval_means(lambda t: np.column_stack([np.sin(t), np.cos(2.0 * t), t**3]), time, 0.7, 0.0)[1:]
    end, begin = time[1:], time[1:] - 0.7
    exact = np.column_stack([np.cos(begin) - np.cos(end), (np.sin(2 * end) - np.sin(2 * begin)) / 2,
                             (end**4 - begin**4) / 4]) / 0.7  # fmt: skip
    np.testing.assert_allclose(means, exact, rtol=1e-12, atol=1e-13)


def test_means_of_a_vibration_of_3_hz_are_good_to_a_millionth():
    time = np.arange(1.0, 20.0, 0.05)
    rate = 2.0 * np.pi * 3.0
    means = interval_means(lambda t: np.sin(rate * t)[:, None], time, 0.05, 0.0)[:, 0]
    exact = (np.cos(rate * (time - 0.05)) - np.cos(rate * time)) / (0.05 * rate)
    assert abs(means - exact).max() < 1e-6


@pytest.mark.parametrize("length", [0.01, 1.0, 25.0])
def test_long_logs_are_worked_off_in_blocks(monkeypatch, length):
    time = np.arange(0.0, 100.0, 0.5)
    whole = interval_means(lambda t: np.cos(t)[:, None], time, length, 0.0)
    monkeypatch.setattr("navfuse.simulation.sampled_sensor._AT_ONCE", 7)
    np.testing.assert_allclose(interval_means(lambda t: np.cos(t)[:, None], time, length, 0.0), whole, atol=1e-14)


def test_an_interval_before_the_start_is_cut_off():
    means = interval_means(lambda t: t[:, None], np.array([5.0, 5.5, 7.0]), 1.0, 5.0)[:, 0]
    np.testing.assert_allclose(means, [5.0, 5.25, 6.5])


def test_boxes_are_half_open_and_add_up():
    time = np.arange(6.0)
    found = boxes(time, np.array([[1.0, 3.0], [2.0, 4.0]]), np.array([[1.0, 0.0], [10.0, 5.0]]))
    np.testing.assert_array_equal(found, [[0, 0], [1, 0], [11, 5], [10, 5], [0, 0], [0, 0]])
    np.testing.assert_array_equal(boxes(time, np.empty((0, 2)), np.empty((0, 3))), np.zeros((6, 3)))


def test_rounding_leaves_no_negative_zero():
    assert not np.signbit(rounded(np.array([-0.01]), 0.1)).any()
    np.testing.assert_array_equal(rounded(np.array([0.123]), 0.0), [0.123])


def test_a_sigma_of_zero_is_not_stated():
    assert stated_sd(1.0, 0.0, (3,)) is None
    assert stated_sd(0.0, 1.0, (3,)) is None
    np.testing.assert_array_equal(stated_sd(2.0, 0.5, (3,)), np.ones(3))
