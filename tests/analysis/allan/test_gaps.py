from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from navfuse.analysis.allan import identify
from navfuse.analysis.allan.gaps import (
    _SEED,
    _autocovariance,
    _conditional,
    bridge_long,
    bridge_short,
    runs,
    simulator,
    usable,
)
from navfuse.analysis.allan.terms import allan_variance, flicker

RATE = 50.0


def with_gaps(size, *gaps):
    values = np.random.default_rng(1).standard_normal(size)
    for a, b in gaps:
        values[a:b] = np.nan
    return values


@pytest.mark.parametrize(
    ("gaps", "begin", "end"),
    [
        ([], 0, 20_000),
        ([(0, 7), (19_000, 20_000)], 7, 19_000),
        ([(500, 516), (9000, 9100)], 0, 20_000),
        ([(9000, 9101)], 9101, 20_000),
        ([(k, k + 1) for k in range(5, 20_000, 21)], 0, 20_000),
        ([(k, k + 1) for k in range(10_000, 20_000, 9)], 0, 10_000),
        ([(0, 20_000)], 0, 0),
    ],
)
def test_what_can_be_used(gaps, begin, end):
    """Gaps of up to 100 of 20 000 samples, and 5 % in all."""
    assert usable(with_gaps(20_000, *gaps)) == slice(begin, end)


def test_a_conditional_draw_against_the_whole_covariance():
    """Weights and remaining covariance are blocks of the inverse covariance of all samples."""
    covariance = 0.8 ** np.arange(48.0) * np.cos(np.arange(48.0) / 3.0) + np.where(np.arange(48) == 0, 0.3, 0.0)
    place = np.concatenate([np.arange(16), np.arange(19, 35)])
    chosen = np.array([0, 3, 13, 14, 16, 19, 31])
    known, wanted = place[chosen], np.array([16, 17, 18])
    flags = np.isin(np.arange(32), chosen)
    weights, roots = _conditional(covariance, np.array([np.ones(32, dtype=bool), flags]), 3)
    assert not weights[1][:, ~flags].any()
    weight, root = weights[1][:, flags], roots[1]
    both = np.concatenate([wanted, known])
    inverse = np.linalg.inv(toeplitz(covariance)[np.ix_(both, both)])
    remaining = np.linalg.inv(inverse[:3, :3])
    assert weight == pytest.approx(-remaining @ inverse[:3, 3:], abs=1e-7)
    assert root @ root.T == pytest.approx(remaining, abs=1e-7)


@pytest.mark.parametrize("kind", ["white", "filtered", "quantised"])
def test_bridged_samples_are_as_correlated_as_the_others(kind):
    """Against the autocovariance of the complete record; 5 standard deviations of 4000 products, and no bias of 5 %."""
    rng = np.random.default_rng(2)
    noise = rng.standard_normal(200_001)
    values = {"white": noise, "filtered": np.asarray(lfilter([0.2], [1.0, -0.8], noise)), "quantised": np.diff(noise)}
    whole = 300.0 + values[kind][:200_000]
    filled = whole.copy()
    at = np.sort(rng.choice(np.arange(1000, 199_000, 3), 4000, replace=False))
    filled[at] = np.nan
    bridge_short(filled)
    assert np.isfinite(filled).all()
    kept = np.ones(whole.size, dtype=bool)
    kept[at] = False
    assert np.array_equal(filled[kept], whole[kept])
    variance = whole.var()
    for lag in range(4):
        found = np.mean((filled[at] - 300.0) * (filled[at + lag] - 300.0))
        expected = np.mean((whole[: 200_000 - lag] - 300.0) * (whole[lag:] - 300.0))
        assert abs(found - expected) < 5.0 * variance * math.sqrt(2.0 / 4000)


def test_a_long_gap_keeps_the_variance_of_a_walk_across_it():
    """Deviation from the straight line: of 400 walks the mean square in the middle against the measured one."""
    walk = simulator({"N": 0.1, "K": 1.0}, flicker(1e3), 0.02)
    before, after = [], []
    for _ in range(400):
        values = walk(900)
        kept = values.copy()
        bridge_long(values, [(300, 600)], 8, walk)
        for one, into in ((kept, before), (values, after)):
            line = 0.5 * (one[200:300].mean() + one[600:700].mean())
            into.append(one[425:475].mean() - line)
    assert np.mean(np.square(after)) == pytest.approx(np.mean(np.square(before)), rel=0.3)


def test_the_simulator_has_the_allan_variance_of_its_terms():
    terms, noise = {"Q": 0.01, "N": 0.1, "B": 0.2, "K": 0.05, "GM": 0.3, "GM_tau": 2.0}, flicker(100.0)
    draw = simulator(terms, noise, 0.02)
    found = [0.5 * np.mean(np.diff(draw(4000).reshape(-1, 50).mean(axis=1)) ** 2) for _ in range(200)]
    tau = np.array(1.0)
    expected = sum(float(allan_variance(name, tau, terms, noise)) for name in ("Q", "N", "B", "K", "GM"))
    assert np.mean(found) == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("gaps", ["single", "minutes"])
def test_terms_of_a_record_with_gaps(gaps):
    """N within 2 %, K within 20 % (medians), and sigmas that cover: of 40, 27.3 give or take 2.9, three allowed."""
    size, inside, ratios = 20_000, 0, {"N": [], "K": []}
    for seed in range(20):
        rng = np.random.default_rng(seed)
        values = 0.5 * math.sqrt(RATE) * rng.standard_normal(size)
        values += 0.3 / math.sqrt(RATE) * np.cumsum(rng.standard_normal(size))
        if gaps == "single":
            values[rng.choice(np.arange(1, size - 1), size // 100, replace=False)] = np.nan
        else:
            for k in range(8):
                values[1000 + 2200 * k : 1080 + 2200 * k] = np.nan
        missing = int(np.count_nonzero(np.isnan(values)))
        found = identify(values, RATE)
        assert (found.begin, found.filled, found.span) == (0, missing, size / RATE)
        for name, truth in (("N", 0.5), ("K", 0.3)):
            ratios[name].append(found.term(name).value / truth)
            inside += abs(found.term(name).value - truth) < found.term(name).sigma
    assert abs(np.median(ratios["N"]) - 1.0) < 0.02
    assert abs(np.median(ratios["K"]) - 1.0) < 0.20
    assert abs(inside - 0.683 * 40) < 3.0 * math.sqrt(0.683 * 0.317 * 40)


@pytest.mark.parametrize("share", [0.01, 0.04])
def test_gaps_are_filled_as_one_at_a_time(share):
    """The twin solves for one gap after the other from the samples around that are there, with the same draws."""
    rng = np.random.default_rng(11)
    values = np.convolve(rng.standard_normal(6000), [0.5, 0.3, 0.2], "same") + 1e-2 * np.cumsum(
        rng.standard_normal(6000)
    )
    values[rng.random(values.size) < share] = np.nan
    values[[0, -1]] = 0.0
    values[[1, 2, -2]] = np.nan
    values[300:316] = np.nan
    values[400:417] = np.nan
    covariance = _autocovariance(values, 48)
    drawn = np.random.default_rng(_SEED)
    wanted = values.copy()
    for a, b in runs(np.isnan(values)):
        if b - a > 16:
            continue
        begin, end = max(0, a - 16), min(values.size, b + 16)
        level = np.nanmean(values[max(0, a - 500) : b + 500])
        known = begin + np.flatnonzero(np.isfinite(values[begin:end]))
        seen = covariance[np.abs(np.subtract.outer(known, known))] + 1e-9 * covariance[0] * np.eye(known.size)
        cross = covariance[np.abs(np.subtract.outer(np.arange(a, b), known))]
        rest = covariance[np.abs(np.subtract.outer(np.arange(a, b), np.arange(a, b)))]
        size, vectors = np.linalg.eigh(rest - cross @ np.linalg.solve(seen, cross.T))
        expected = level + cross @ np.linalg.solve(seen, values[known] - level)
        wanted[a:b] = expected + (vectors * np.sqrt(np.maximum(size, 0.0))) @ vectors.T @ drawn.standard_normal(b - a)
    found = values.copy()
    bridge_short(found)
    assert np.count_nonzero(np.isnan(found)) == 17
    assert found == pytest.approx(wanted, abs=1e-9, nan_ok=True)


def test_runs():
    flags = np.array([True, True, False, True, False, False, True])
    assert runs(flags) == [(0, 2), (3, 4), (6, 7)]
    assert runs(~flags) == [(2, 3), (4, 6)]
    assert runs(np.zeros(4, dtype=bool)) == []
    assert runs(np.ones(4, dtype=bool)) == [(0, 4)]
