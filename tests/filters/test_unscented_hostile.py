"""The unscented filter keeps a covariance with hostile tuning, long outages and a million steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfuse.aiding.base import AidingSensor
from navfuse.data.start import Start
from navfuse.filters.ekf import FilterSettings
from navfuse.filters.unscented import UnscentedFilter
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.increments import ImuIncrements
from navfuse.simulation import car_drive
from reference.engine_runs import nav_at, perfect_increments

MOTION = car_drive(100.0, seed=2, standing=2.0)
INCREMENTS = perfect_increments(MOTION, 100.0, 0.0, 100.0)
MODEL = ImuErrorModel(
    arw=1e-6, vrw=1e-5, gyro_bias_sd=1e-3, gyro_bias_tau=100.0, accel_bias_sd=0.1, accel_bias_walk=1e-6
)


STEADY = replace(MODEL, gyro_bias_sd=1e-5, accel_bias_sd=1e-3)
"""A sensor with which an attitude is still known after an hour, as no filter can do without."""


class Position(AidingSensor):
    """The true position in e once a second, as good as told, with an hour without."""

    name = "position"

    def __init__(self, sd, times):
        self.sd, self.times = sd, times
        self.values = MOTION.r_e(times % 100.0)

    def value(self, k):
        return self.values[k]

    def predict(self, nav, k):
        return nav.r_e

    def noise(self, k):
        return self.sd


def start(rng, decades):
    """Standard deviations over half as many decades, hence variances over all."""
    size = 10.0 ** rng.uniform(-decades / 2.0, 0.0, 9)
    sd = size * np.repeat([100.0, 10.0, 0.3], 3)
    A = rng.normal(size=(9, 9)) + 3.0 * np.eye(9)
    P = A @ A.T
    scale = sd / np.sqrt(np.diagonal(P))
    return Start(0.0, nav_at(MOTION, 0.0, False), P * np.outer(scale, scale))


def check(filter_):
    root, P = filter_.root, filter_.P
    assert np.isfinite(root).all()
    assert np.isfinite(filter_.nav).all()
    assert np.all(np.diagonal(root) > 0.0)
    assert np.array_equal(P, P.T)
    assert np.all(np.diagonal(P) >= 0.0)


def feed(filter_, laps, step):
    """The same lap again and again, the state set back to its beginning; `step` increments between two checks."""
    steps = 0
    for lap in range(laps):
        if lap:
            filter_.nav = nav_at(MOTION, 0.0, filter_.settings.ecef)
        times = 100.0 * lap + INCREMENTS.time
        for first in range(0, len(INCREMENTS), step):
            part = slice(first, first + step)
            filter_.feed(
                ImuIncrements(times[first : first + step + 1], INCREMENTS.inc_theta_b[part], INCREMENTS.inc_v_b[part])
            )
            check(filter_)
            steps += step
    return steps


@settings(max_examples=8)
@given(
    seed=st.integers(0, 2**32 - 1),
    decades=st.floats(0.0, 12.0),
    noise=st.floats(-12.0, 2.0),
    ecef=st.booleans(),
    alpha=st.sampled_from([None, 1e-3, 0.5]),
)
def test_hostile_tuning_leaves_a_root(seed, decades, noise, ecef, alpha):
    """Variances over twelve decades, variances of measurements down to 1e-12 m^2, a step at every sample."""
    rng = np.random.default_rng(seed)
    options = FilterSettings(ecef=ecef, covariance_period=0.0, output_period=-1.0, gate_probability=1.0, alpha=alpha)
    times = np.concatenate([np.arange(1.0, 30.0), np.arange(70.0, 100.0)])
    filter_ = UnscentedFilter(start(rng, decades), MODEL, [Position(10.0 ** (noise / 2.0), times)], options)
    assert feed(filter_, 1, 2500) == 10000


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "noise", "ecef"), [(0, -12.0, True), (1, 0.0, False)])
def test_a_million_steps_with_an_outage_of_an_hour(seed, noise, ecef):
    rng = np.random.default_rng(seed)
    options = FilterSettings(ecef=ecef, covariance_period=0.0, output_period=-1.0, gate_probability=1.0)
    times = np.arange(1.0, 10000.0)
    times = times[((times < 3000.0) | (times > 6600.0)) & (times % 100.0 > 0.0)]
    filter_ = UnscentedFilter(start(rng, 12.0), STEADY, [Position(10.0 ** (noise / 2.0), times)], options)
    assert feed(filter_, 100, 2000) == 1000000
    assert np.sqrt(np.diagonal(filter_.P)[:3]).max() < 10.0
