"""Warnings: gaps make none that the record without them has not, and each says what to do."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from navfuse.analysis.allan import StudySettings, deviation, study
from navfuse.analysis.allan.notes import of_axis
from navfuse.analysis.allan.terms import Term
from navfuse.errors import InputError
from navfuse.io.static_record import Channel, StaticRecord

RATE = 100.0


def noisy(seed, n=60_000):
    """White noise with flicker of 0.1 s to 10 000 s, as the identification takes it."""
    from scipy.signal import lfilter

    rng = np.random.default_rng(seed)
    values = 3e-5 * math.sqrt(RATE) * rng.standard_normal(n)
    for tau in 10.0 ** np.arange(-1, 5):
        decay, sd = math.exp(-1.0 / RATE / tau), 2e-5 * math.sqrt(math.log(10.0) / math.pi)
        drive = sd * math.sqrt(1.0 - decay**2) * rng.standard_normal(n)
        drive[0] = sd * rng.standard_normal()
        values += np.asarray(lfilter([1.0], [1.0, -decay], drive))
    return values


def one_axis(values, rate=RATE):
    return StaticRecord((Channel("gyro x", "gyro", values),), rate, 0.0, "rates", None, "log.csv")


def scattered(values, rng):
    values[rng.random(values.size) < 0.01] = np.nan


def ten_gaps(values, rng):
    for k in range(10):
        begin = 3000 + k * 5500
        values[begin : begin + rng.integers(50, 800)] = np.nan


@pytest.mark.parametrize("spoil", [scattered, ten_gaps])
def test_gaps_make_no_disagreement_of_model_and_curve(spoil):
    told = {True: 0, False: 0}
    for seed in range(6):
        for gaps in told:
            values = noisy(100 + seed)
            if gaps:
                spoil(values, np.random.default_rng(seed))
            texts = study(one_axis(values), StudySettings(terms=("N", "B", "K"))).warnings
            told[gaps] += any("the fitted model is" in text for text in texts)
    assert told[True] <= told[False]


def bounded(seed, seconds=600.0, tau=100.0):
    """White noise and a Gauss-Markov process."""
    from scipy.signal import lfilter

    rng = np.random.default_rng(seed)
    n, decay = round(seconds * RATE), math.exp(-1.0 / RATE / tau)
    drive = 3e-5 * math.sqrt(1.0 - decay**2) * rng.standard_normal(n)
    return 3e-4 * rng.standard_normal(n) + np.asarray(lfilter([1.0], [1.0, -decay], drive))


def test_a_walk_above_the_curve_asks_for_a_bounded_process():
    found = study(one_axis(bounded(1, 3600.0)), StudySettings())
    axis = found.axes[0]
    curve = axis.curves["oadev"]
    walk = replace(axis.identification, terms=(Term("N", True, 3e-5, 3e-7), Term("K", True, 2e-5, 2e-6)))
    texts = of_axis("log.csv", "gyro x", replace(axis, identification=walk), one_axis(bounded(1, 3600.0)))
    long = [text for text in texts if "the fitted model is" in text]
    assert long
    assert all(text.endswith("for which K stands here: try --terms Q,N,B,K,R,GM") for text in long)
    asked = replace(walk, terms=(*walk.terms, Term("GM", False)))
    texts = of_axis("log.csv", "gyro x", replace(axis, identification=asked), one_axis(bounded(1, 3600.0)))
    assert not any("--terms" in text for text in texts)
    white = replace(walk, terms=(Term("N", True, 3e-4, 3e-6),))
    texts = of_axis("log.csv", "gyro x", replace(axis, identification=white), one_axis(bounded(1, 3600.0)))
    assert any("the fitted model is" in text for text in texts)
    assert not any("--terms" in text for text in texts)
    assert curve.tau[-1] > 1000.0


def test_too_many_missing_samples_are_told_with_their_share():
    values = noisy(3, 20_000)
    values[np.random.default_rng(3).random(values.size) < 0.1] = np.nan
    with pytest.raises(InputError, match=r"gyro x: (9\.\d+|10.*) % of the samples are missing.* at most 5 % missing"):
        study(one_axis(values))
    assert np.isfinite(deviation(values, RATE).deviation).all()
