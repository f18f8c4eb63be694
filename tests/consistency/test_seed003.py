"""The two filters of a student report on flights at one sample a second, against textbook twins and each other."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from navfuse.filters.ekf import ErrorStateFilter
from navfuse.filters.unscented import UnscentedFilter
from navfuse.imu.gaps import gap_limit
from navfuse.imu.increments import to_increments
from navfuse.montecarlo.scenario_recipe import ScenarioRecipe
from navfuse.montecarlo.single import run_case

FILE = Path(__file__).resolve().parents[2] / "benchmarks" / "seed003.py"
MEASURED = ("ukf-feedback-12", "textbook, 12 states", "ukf-feedforward-15", "textbook, 15 states")


@pytest.fixture(scope="module")
def benchmark():
    spec = importlib.util.spec_from_file_location("seed003_benchmark", FILE)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def short():
    return ScenarioRecipe("aircraft-1hz", changes=(("", "duration_s", 500.0),))


@pytest.fixture(scope="module")
def flown(benchmark, short):
    return {name: benchmark.measured(name, 1, short) for name in ("fixes", *MEASURED)}


def test_both_filters_are_better_than_the_fixes(benchmark, flown):
    noise = benchmark.rms(flown["fixes"])[:3]
    np.testing.assert_allclose(noise, [3.0, 3.0, 5.0], rtol=0.15)
    for name in MEASURED:
        assert np.all(benchmark.rms(flown[name])[:3] < 0.6 * noise)


def test_the_textbook_says_the_same_of_twelve_states(benchmark, flown):
    """Euler angles, another mechanization, no square root, and all the same one filter."""
    ours, twin = (flown[name][0] for name in ("ukf-feedback-12", "textbook, 12 states"))
    apart = (ours.error - twin.error) / ours.sd
    assert np.sqrt(np.mean(apart[:, :6] ** 2, axis=0)).max() < 0.1
    np.testing.assert_allclose(twin.sd[-1, :6], ours.sd[-1, :6], rtol=0.05)


def test_no_spikes(flown):
    """440 epochs of three components: a normal error is beyond 4.9 standard deviations in one such run of 800."""
    for name in ("ukf-feedback-12", "ukf-feedforward-15"):
        for flight in flown[name]:
            assert np.abs(flight.error[:, :3] / flight.sd[:, :3]).max() < 4.9


def test_what_the_two_differ_in_is_the_observations_and_the_biases(benchmark, short):
    """Without biases and with the same observations they are one filter."""
    case = benchmark.without_biases(short)(0)
    for one, other in (
        ("ukf-feedback-12", "ukf-feedforward-15, position only"),
        ("ukf-feedback-12, velocity too", "ukf-feedforward-15"),
    ):
        a, b = benchmark.FLIGHTS[one](case), benchmark.FLIGHTS[other](case)
        assert np.abs((a.error - b.error) / b.sd).max() < 0.05
        np.testing.assert_allclose(a.sd, b.sd, rtol=0.01)


def test_an_unscented_and_an_extended_filter_agree_at_one_sample_a_second(short):
    case = short(1)
    increments = to_increments(case.logs.imu, gap_limit(case.logs.imu.time))
    runs = []
    for kind in (UnscentedFilter, ErrorStateFilter):
        filter_ = kind(case.start, case.model, case.sensors, replace(case.settings, output_period=-1.0))
        filter_.feed(increments)
        runs.append(filter_)
    sd = np.sqrt(np.diagonal(runs[1].P))
    np.testing.assert_allclose(np.sqrt(np.diagonal(runs[0].P)), sd, rtol=0.02)
    a, b = (run.nav_state() for run in runs)
    np.testing.assert_allclose((a.v_n - b.v_n) / sd[3:6], 0.0, atol=0.05)
    np.testing.assert_allclose((a.r_e - b.r_e) / sd[:3].min(), 0.0, atol=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ukf-feedback-12", "ukf-feedforward-15"])
def test_consistent_over_flights(name):
    """Position NEES of six flights: bounds from the spread between the flights."""
    recipe = ScenarioRecipe("aircraft-1hz")
    mean = np.array([run_case(replace(recipe(s), estimator=name), s).nees["position"].mean() / 3.0 for s in range(6)])
    error = mean.std(ddof=1) / np.sqrt(mean.size)
    assert mean.mean() < 1.0 + 4.0 * error + 0.05
    assert mean.mean() > 0.6
