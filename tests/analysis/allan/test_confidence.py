from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import chi2

from navfuse.analysis.allan import deviation
from navfuse.analysis.allan.confidence import degrees_of_freedom, interval
from navfuse.analysis.allan.noise_types import noise_exponents

STEP = {"adev": "m", "hdev": "m"}


def exact_edf(kind, alpha, m, n):
    """From the covariance of every difference, with the covariance of the samples written out."""
    order = 3 if "hdev" in kind else 2
    stencil = np.zeros(order * m + 1)
    stencil[::m] = [(-1.0) ** k * math.comb(order, k) for k in range(order + 1)]
    if kind == "mdev":
        stencil = np.convolve(stencil, np.ones(m))
    points = n + 1
    starts = np.arange(0, points - stencil.size + 1, m if kind in STEP else 1)
    rows = np.zeros((starts.size, points))
    for row, begin in enumerate(starts):
        rows[row, begin : begin + stencil.size] = stencil
    if alpha == 2:
        factor = rows
    else:
        summed = np.tril(np.ones((points, points)), -1)
        factor = rows @ (summed if alpha == 0 else summed @ np.tril(np.ones((points, points))))
    covariance = factor @ factor.T
    return float(np.trace(covariance) ** 2 / np.sum(covariance**2))


@pytest.mark.parametrize("kind", ["adev", "oadev", "mdev", "hdev", "ohdev"])
@pytest.mark.parametrize(("m", "n"), [(1, 60), (3, 80), (10, 90), (20, 130)])
def test_white_phase_against_the_covariance_written_out(kind, m, n):
    assert degrees_of_freedom(kind, 2, m, n) == pytest.approx(exact_edf(kind, 2, m, n), rel=1e-9)


@pytest.mark.parametrize("kind", ["adev", "oadev", "mdev", "hdev", "ohdev"])
@pytest.mark.parametrize("alpha", [0, -2])
@pytest.mark.parametrize(("m", "n", "bar"), [(1, 60, 0.25), (3, 80, 0.12), (10, 90, 0.09), (20, 130, 0.05)])
def test_rate_noise_is_close_to_the_covariance_written_out(kind, alpha, m, n, bar):
    """The formula has noise that goes on between the samples, and phase averaged over one; it matters for small m."""
    assert degrees_of_freedom(kind, alpha, m, n) == pytest.approx(exact_edf(kind, alpha, m, n), rel=bar)


@pytest.mark.parametrize("kind", ["oadev", "mdev", "ohdev"])
@pytest.mark.parametrize("alpha", [0, -1, -2])
def test_sampling_many_lags_more_coarsely_changes_nothing(kind, alpha, monkeypatch):
    fine = degrees_of_freedom(kind, alpha, 1200, 60_000)
    monkeypatch.setattr("navfuse.analysis.allan.confidence.MOST_LAGS", 400)
    assert degrees_of_freedom(kind, alpha, 1200, 60_000) == pytest.approx(fine, rel=0.01)


def test_flicker_phase_noise_is_on_the_safe_side_beyond_the_most_lags(monkeypatch):
    fine = degrees_of_freedom("oadev", 1, 1200, 60_000)
    monkeypatch.setattr("navfuse.analysis.allan.confidence.MOST_LAGS", 400)
    assert 0.5 * fine < degrees_of_freedom("oadev", 1, 1200, 60_000) < fine


def test_published_values_of_total_variance():
    """NIST SP 1065, table 7: 1.5 T/tau for white rate noise, 1.168 T/tau - 0.222 and 0.927 T/tau - 0.358."""
    assert degrees_of_freedom("totdev", 0, 10, 1000) == pytest.approx(150.0)
    assert degrees_of_freedom("totdev", -1, 10, 1000) == pytest.approx(116.578)
    assert degrees_of_freedom("totdev", -2, 10, 1000) == pytest.approx(92.342)
    assert degrees_of_freedom("totdev", 2, 10, 1000) == degrees_of_freedom("oadev", 2, 10, 1000)
    assert degrees_of_freedom("totdev", 2, 600, 1000) == 1.0


def test_a_record_that_is_too_short_has_none():
    assert degrees_of_freedom("ohdev", 0, 40, 100) == 0.0


def test_limits_are_quantiles_of_chi_square():
    low, high = interval(np.array([4.0, np.nan, 1.0]), np.array([10.0, 5.0, 0.0]), 0.9)
    assert low[0] == pytest.approx(40.0 / chi2.ppf(0.95, 10))
    assert high[0] == pytest.approx(40.0 / chi2.ppf(0.05, 10))
    assert np.isnan(low[1:]).all()
    assert np.isnan(high[1:]).all()


def test_intervals_cover_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(8)
    count, inside = 400, 0
    for _ in range(count):
        curve = deviation(rng.standard_normal(600), 1.0, grid=np.array([40]), alpha=0, level=0.8)
        inside += curve.low[0] < 40.0**-0.5 < curve.high[0]
    assert abs(inside / count - 0.8) < 3.0 * math.sqrt(0.16 / count)


@pytest.mark.parametrize(("order", "alpha"), [(0, 0), (1, -2), (-1, 2)], ids=["white", "random walk", "quantisation"])
def test_noise_types(order, alpha):
    values = np.random.default_rng(2).standard_normal(20_000)
    rates = np.cumsum(values) if order == 1 else np.diff(values, prepend=0.0) if order == -1 else values
    phase = np.concatenate([[0.0], np.cumsum(rates)])
    found = noise_exponents(phase, np.array([1, 4, 16, 64]))
    assert found.tolist() == [alpha] * 4
    assert noise_exponents(np.zeros(100), np.array([1, 50])).tolist() == [0, 0]
