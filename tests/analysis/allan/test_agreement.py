from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.analysis.allan import deviation, identify
from navfuse.analysis.allan.agreement import CONTRADICTED, disagreements, probability_below, too_large_at
from navfuse.analysis.allan.terms import allan_variance

DT = 1.0


def walks(count, n=4000, seed=0):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield rng.standard_normal(n) + 0.02 * np.cumsum(rng.standard_normal(n))


def model(tau):
    return allan_variance("N", tau, {"N": 1.0}) + allan_variance("K", tau, {"K": 0.02})


def test_the_probability_is_uniform_if_the_model_is_true():
    """Of 300 records at five averaging times: deciles of the probability, within four sigma of 300."""
    factors = np.array([1, 8, 64, 256, 1000])
    below = []
    for values in walks(300):
        curve = deviation(values, 1.0 / DT, grid=factors)
        below.append(probability_below(curve, model(curve.tau)))
    for share in (0.1, 0.5, 0.9):
        found = np.mean(np.array(below) < share, axis=0)
        assert np.all(np.abs(found - share) < 4.0 * math.sqrt(share * (1.0 - share) / 300) + 0.03)


def test_a_true_model_is_not_contradicted_and_a_bounded_process_is():
    kept = 0
    for values in walks(100, seed=1):
        curve = deviation(values, 1.0 / DT, grid=10)
        kept += too_large_at(curve, probability_below(curve, model(curve.tau)), 0.0) is None
    assert kept >= 99
    white = np.random.default_rng(2).standard_normal(4000)
    curve = deviation(white, 1.0 / DT, grid=10)
    below = probability_below(curve, model(curve.tau))
    at = too_large_at(curve, below, 0.0)
    assert at is not None
    assert curve.tau[at] > 50.0
    assert too_large_at(curve, below, 1e6) is None
    assert too_large_at(curve, below, float(curve.tau[-1])) is None or below[-1] < CONTRADICTED
    (one,) = disagreements(curve, model(curve.tau), below)
    assert one.ratio > 1.25
    assert one.probability < 0.01
    (other,) = disagreements(curve, 0.1 * model(curve.tau), probability_below(curve, 0.1 * model(curve.tau)))[:1]
    assert other.ratio < 0.8


def test_a_walk_that_is_bounded_is_reported_as_none():
    """A Gauss-Markov process of 100 s looks like a rate random walk above 2 mHz; in 20 000 s the deviation tells."""
    from scipy.signal import lfilter

    rng = np.random.default_rng(3)
    decay = math.exp(-0.01)
    slow = np.asarray(lfilter([1.0], [1.0, -decay], math.sqrt(1.0 - decay**2) * rng.standard_normal(20_000)))
    values = 1.0 * rng.standard_normal(20_000) + 0.5 * slow
    found = identify(values, 1.0, terms=("N", "K"))
    assert not found.term("K").present
    assert found.term("K").contradicted
    tau = np.array([30.0, 1000.0])
    assert found.term("K").limit < math.sqrt(0.25 / float(allan_variance("K", tau, {"K": 1.0})[1]))


@pytest.mark.parametrize("misfit", [0.0, 0.15, 0.9])
def test_a_misfit_widens_the_distribution_up_to_a_fifth(misfit):
    values = next(walks(1))
    curve = deviation(values, 1.0, grid=10)
    plain = probability_below(curve, 1.5 * model(curve.tau))
    wider = probability_below(curve, 1.5 * model(curve.tau), misfit)
    assert np.all(wider[:10] >= plain[:10])
    most = probability_below(curve, 1.5 * model(curve.tau), 0.2)
    assert np.all(wider[:10] <= most[:10] + 1e-15)
