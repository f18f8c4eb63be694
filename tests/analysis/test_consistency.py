from __future__ import annotations

import json

import numpy as np
import pytest
from scipy import stats

from navfuse.analysis.consistency import average_bounds, lag_one_correlation, nis_summary
from navfuse.data.result import Innovations


def innovations(z, sd, status=None, source="gnss_position", time=None):
    """Records of independent components (m, d)."""
    m, d = z.shape
    padded = np.full((2, m, 3), np.nan)
    padded[0, :, :d], padded[1, :, :d] = z, sd
    return Innovations(
        np.arange(float(m)) if time is None else time,
        np.full(m, source),
        np.full(m, "used") if status is None else np.asarray(status),
        ((z / sd) ** 2).sum(axis=1),
        np.full(m, d),
        padded[0],
        padded[1],
        np.arange(m),
    )


def scalar_filter(seed, claimed_variance, count=2000, variance=1.0, walk=0.1):
    """A random walk seen in white noise, estimated by a filter that is told `claimed_variance`."""
    rng = np.random.default_rng(seed)
    true, x, P = 0.0, 0.0, 1.0
    z, S = np.empty(count), np.empty(count)
    for k in range(count):
        true += np.sqrt(walk) * rng.standard_normal()
        P += walk
        S[k] = P + claimed_variance
        z[k] = true + np.sqrt(variance) * rng.standard_normal() - x
        x, P = x + P / S[k] * z[k], P * claimed_variance / S[k]
    return innovations(z[:, None], np.sqrt(S)[:, None])


@pytest.mark.parametrize("degrees", [1.0, 3.0, 100.0, 10800.0])
@pytest.mark.parametrize("probability", [0.95, 0.99])
def test_bounds_are_those_of_the_chi_square_distribution(degrees, probability):
    expected = np.array(stats.chi2.interval(probability, degrees)) / degrees
    np.testing.assert_allclose(average_bounds(degrees, probability), expected, rtol=1e-9)


def test_a_right_filter_is_inside_its_bounds_as_often_as_promised():
    """120 runs at 95 %: the number inside is binomial, and 99.99 % of such sets have at least 103."""
    runs, probability = 120, 0.95
    inside = 0
    for seed in range(runs):
        found = nis_summary(scalar_filter(seed, 1.0, count=300), probability=probability)["gnss_position"]
        inside += found.bounds[0] <= found.mean_nis_per_dof <= found.bounds[1]
    assert stats.binom.ppf(5e-5, runs, probability) <= inside <= runs


def test_half_the_noise_is_reported_as_overconfident():
    found = nis_summary(scalar_filter(5, 0.5))["gnss_position"]
    assert found.verdict.startswith("overconfident by factor 1.")
    assert found.factor == pytest.approx(np.sqrt(found.mean_nis_per_dof))
    assert 1.15 < found.factor < 1.45
    assert nis_summary(scalar_filter(5, 1.0))["gnss_position"].verdict == "consistent"


def test_twice_the_noise_is_reported_as_pessimistic():
    found = nis_summary(scalar_filter(5, 2.0))["gnss_position"]
    assert found.verdict.startswith("pessimistic by factor 1.")


def test_the_factor_is_that_of_the_standard_deviation():
    z = np.random.default_rng(2).standard_normal((4000, 3))
    z /= np.sqrt(np.mean(z**2))
    assert nis_summary(innovations(3.0 * z, np.ones_like(z)))["gnss_position"].verdict == "overconfident by factor 3.00"
    assert nis_summary(innovations(z / 2.0, np.ones_like(z)))["gnss_position"].verdict == "pessimistic by factor 2.00"
    nothing = nis_summary(innovations(0.0 * z, np.ones_like(z)))["gnss_position"]
    assert nothing.verdict.startswith("pessimistic by factor")
    assert nothing.lag_one == 0.0


def test_counts_and_what_is_tested():
    z = np.ones((10, 3))
    z[4] = 10.0
    status = ["used"] * 4 + ["rejected"] + ["withheld"] * 3 + ["late", "reset"]
    found = nis_summary(innovations(z, np.ones_like(z), status))["gnss_position"]
    assert found.counts == {"used": 4, "rejected": 1, "withheld": 3, "late": 1, "reset": 1}
    assert found.n == 4
    assert found.mean_nis_per_dof == pytest.approx(1.0)
    assert found.mean_nis_per_dof_with_rejected == pytest.approx((5 * 3 + 300) / 18)


def test_excluded_windows_are_half_open_and_only_leave_the_test():
    z = np.ones((10, 3))
    z[3:6] = 8.0
    found = nis_summary(innovations(z, np.ones_like(z)), exclude=[(3.0, 6.0)])["gnss_position"]
    assert (found.n, found.counts["used"]) == (7, 10)
    assert found.mean_nis_per_dof == pytest.approx(1.0)


def test_sources_are_judged_apart():
    z = np.random.default_rng(1).standard_normal((500, 3))
    both = [innovations(z, np.ones_like(z)), innovations(2.0 * z[:, :1], np.ones_like(z[:, :1]), source="odometer")]
    names = ("time", "source", "status", "nis", "dof", "z", "sd", "row")
    found = nis_summary(Innovations(*(np.concatenate([getattr(entry, name) for entry in both]) for name in names)))
    assert list(found) == ["gnss_position", "odometer"]
    assert found["gnss_position"].verdict == "consistent"
    assert found["odometer"].verdict.startswith("overconfident by factor")


def test_correlated_innovations_are_noticed_and_widen_the_bounds():
    rng = np.random.default_rng(4)
    rho, m = 0.8, 3000
    z = np.empty((m, 1))
    z[0] = rng.standard_normal()
    for k in range(1, m):
        z[k] = rho * z[k - 1] + np.sqrt(1.0 - rho**2) * rng.standard_normal()
    found = nis_summary(innovations(z, np.ones_like(z)))["gnss_position"]
    assert found.lag_one == pytest.approx(rho, abs=0.05)
    assert not found.white
    widening = (found.bounds[1] - found.bounds[0]) / np.subtract(*average_bounds(m)[::-1])
    assert widening == pytest.approx(np.sqrt((1.0 + rho**2) / (1.0 - rho**2)), rel=0.1)
    white = nis_summary(innovations(rng.standard_normal((m, 1)), np.ones((m, 1))))["gnss_position"]
    assert white.white
    assert abs(white.lag_one) < 0.05


def test_correlation_ignores_the_padding_and_needs_three_rows():
    alternating = innovations(np.array([[1.0], [-1.0], [1.0], [-1.0], [1.0]]), np.ones((5, 1)))
    assert lag_one_correlation(alternating) == pytest.approx(-1.0)
    assert np.isnan(lag_one_correlation(alternating.select(np.arange(2))))


def test_nothing_to_test_and_json_without_nan():
    z = np.ones((3, 3))
    found = nis_summary(innovations(z, np.ones_like(z), ["withheld"] * 3))["gnss_position"]
    assert found.verdict == "nothing to test"
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["mean_nis_per_dof"] is None
    assert nis_summary(Innovations.empty()) == {}
    good = nis_summary(innovations(z, np.ones_like(z)))["gnss_position"].to_dict()
    assert json.loads(json.dumps(good, allow_nan=False))["counts"]["used"] == 3
