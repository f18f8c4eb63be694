from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from navfuse.analysis.allan.few import differences, quantiles, weights
from reference.allan_twin import covariance, difference_rows

KINDS = ("adev", "oadev", "mdev", "hdev", "ohdev", "totdev")
LEVELS = np.array([0.025, 0.1587, 0.5, 0.8413, 0.975])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("m", "n"), [(4, 13), (4, 30), (7, 21)])
def test_the_matrix_is_the_definition(kind, m, n):
    assert differences(kind, m, n).tolist() == difference_rows(kind, m, n).tolist()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("alpha", [0, -1, -2])
@pytest.mark.parametrize("times", [4.0, 5.3, 7.5])
def test_sixteen_points_in_an_averaging_time_stand_for_many(kind, alpha, times):
    """Limits of a deviation within 2.5 %."""
    m = 80
    n = round(m * times)
    exact = np.linalg.eigvalsh(covariance(kind, alpha, m, n))[::-1]
    exact /= exact.sum()
    found = weights(kind, alpha, m, n)[::-1]
    assert found.sum() == pytest.approx(1.0)
    shared = min(4, found.size)
    assert found[:shared] == pytest.approx(exact[:shared], abs=0.015)
    assert np.sqrt(quantiles(found, LEVELS)) == pytest.approx(
        np.sqrt(quantiles(exact[exact > 1e-9], LEVELS)), rel=0.025
    )


@pytest.mark.parametrize("k", [1, 2, 3, 8])
def test_equal_weights_are_chi_square(k):
    found = quantiles(np.full(k, 1.0 / k), LEVELS)
    assert chi2.cdf(found * k, k) == pytest.approx(LEVELS, abs=0.007 if k == 1 else 0.002)


@pytest.mark.parametrize("parts", [(0.8, 0.15, 0.05), (0.4, 0.35, 0.1, 0.1, 0.05), (0.5, *([0.02] * 25))], ids=len)
def test_unequal_weights_against_drawn_numbers(parts):
    rng = np.random.default_rng(4)
    drawn = rng.standard_normal((200_000, len(parts))) ** 2 @ np.array(parts)
    share = [np.mean(drawn < x) for x in quantiles(np.array(parts), LEVELS)]
    assert share == pytest.approx(LEVELS, abs=0.018)
