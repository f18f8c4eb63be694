"""Warnings: gaps make none that the record without them has not, and each says what to do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.analysis.allan import StudySettings, study
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
