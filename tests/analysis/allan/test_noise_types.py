from __future__ import annotations

import numpy as np
import pytest

from navfuse.analysis.allan import StudySettings, deviation, study
from navfuse.analysis.allan.noise_types import noise_exponents, types_of_model
from navfuse.io.static_record import Channel, StaticRecord

OCTAVES = 2 ** np.arange(11)


def phase_of(rates):
    return np.concatenate([[0.0], np.cumsum(rates)])


@pytest.mark.parametrize(("order", "alpha"), [(0, 0), (1, -2), (-1, 2)], ids=["white", "random walk", "quantisation"])
def test_noise_types(order, alpha):
    values = np.random.default_rng(2).standard_normal(20_000)
    rates = np.cumsum(values) if order == 1 else np.diff(values, prepend=0.0) if order == -1 else values
    found = noise_exponents(phase_of(rates), np.array([1, 4, 16, 64]))
    assert found.tolist() == [alpha] * 4
    assert noise_exponents(np.zeros(100), np.array([1, 50])).tolist() == [0, 0]


def test_white_noise_is_not_taken_for_phase_noise_at_long_times():
    """With 30 points left the nearest type is wrong in every fourth record, and phase noise as a rule."""
    rng = np.random.default_rng(6)
    wrong = [np.any(noise_exponents(phase_of(rng.standard_normal(4000)), OCTAVES) != 0) for _ in range(200)]
    assert np.mean(wrong) < 0.05


def test_a_type_does_not_hang_on_the_other_averaging_times():
    """Long ones alone are asked for: the shorter ones are looked at all the same."""
    rng = np.random.default_rng(6)
    long = np.array([128, 1024])
    wrong = [np.any(noise_exponents(phase_of(rng.standard_normal(4000)), long) != 0) for _ in range(200)]
    assert np.mean(wrong) < 0.05


def test_steeper_noise_is_followed_down_to_few_points():
    rng = np.random.default_rng(7)
    ends = [
        noise_exponents(phase_of(rng.standard_normal(8192) + 0.1 * np.cumsum(rng.standard_normal(8192))), OCTAVES)
        for _ in range(30)
    ]
    assert all(found[0] == 0 for found in ends)
    assert np.mean([found[-1] == -2 for found in ends]) > 0.8


@pytest.mark.parametrize("kind", ["oadev", "mdev", "ohdev"])
def test_phase_noise_stays_until_something_else_emerges(kind):
    rng = np.random.default_rng(8)
    grid = 2 ** np.arange(9)
    rounding = 100.0 * np.diff(rng.standard_normal(2001))
    pure = deviation(rounding, 1.0, kind, grid=grid)
    assert pure.alpha.tolist() == [2] * pure.tau.size
    mixed = deviation(rounding + 20.0 * rng.standard_normal(2000), 1.0, kind, grid=grid)
    assert mixed.alpha[0] == 2
    assert mixed.alpha[-1] == 0
    assert noise_exponents(phase_of(rounding), grid)[-1] == 0, "nothing is known of the variance"


def test_types_of_a_model():
    def variance(tau):
        return np.where(tau < 0.1, np.nan, 1e-4 / tau**2 + 1.0 / tau + 3e-3 + 1e-6 * tau)

    found = types_of_model(variance)(np.array([0.01, 0.5, 3.0, 1e4, 1e6]))
    assert np.isnan(found[0])
    assert found[1:].tolist() == [0.0, 0.0, -2.0, -2.0]
    assert types_of_model(lambda tau: 3.0 / tau**2)(np.array([5.0])).tolist() == [2.0]
    assert types_of_model(lambda tau: 0.0 * tau + 2.0)(np.array([5.0])).tolist() == [-1.0]


def test_types_that_are_given_are_used_and_others_found():
    rates = np.random.default_rng(1).standard_normal(4000)
    grid = np.array([1, 10, 1000])
    found = deviation(rates, 1.0, grid=grid, alpha=lambda tau: np.where(tau > 100.0, -7.0, np.nan))
    assert found.alpha.tolist() == [0, 0, -2]
    assert found.edf[2] < deviation(rates, 1.0, grid=grid, alpha=0).edf[2]


def test_a_study_takes_the_types_from_the_fit():
    """The random walk emerges at 58 s: at the longest times 30 points are no more left to see it by."""
    rng = np.random.default_rng(5)
    values = rng.standard_normal(30_000) + 0.03 * np.cumsum(rng.standard_normal(30_000))
    record = StaticRecord((Channel("gyro x", "gyro", values),), 1.0, 0.0, "rates", None, "log.csv")
    axis = study(record, StudySettings(grid="octave", motion="ignore")).axes[0]
    curve = axis.curves["oadev"]
    assert axis.identification.term("K").present
    assert curve.alpha[:3].tolist() == [0, 0, 0]
    assert set(curve.alpha[curve.tau > 500.0].tolist()) == {-2}
