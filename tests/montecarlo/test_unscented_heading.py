"""A city car that begins with a heading known to 60 deg, with an unscented filter and an extended one beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from navfuse.analysis.nees import nees_of_groups
from navfuse.filters.event import split
from navfuse.filters.kinds import FILTERS
from navfuse.imu.gaps import gap_limit
from navfuse.imu.increments import to_increments
from navfuse.montecarlo.scenario_recipe import ScenarioRecipe
from navfuse.montecarlo.single import _errors
from navfuse.simulation.scenario import StartErrors
from navfuse.simulation.scenario_run import told_start

STANDING_S = 20.0
UNKNOWN = StartErrors(sd_attitude=np.radians([0.3, 0.3, 60.0]))


def runs(name, seeds, duration, sd_heading=60.0):
    """Times of the epochs, errors of heading [deg] and NEES of the whole state per degree of freedom, (runs, m)."""
    recipe = ScenarioRecipe("city-car", changes=(("motion", "duration_s", duration),))
    headings, nees = [], []
    for seed in seeds:
        case = recipe(seed)
        errors = replace(UNKNOWN, sd_attitude=np.radians([0.3, 0.3, sd_heading]))
        start = told_start(case.logs.motion, case.logs.imu.time[0], errors, seed)
        settings = replace(case.settings, checkpoints=True, output_period=-1.0)
        filter_ = FILTERS[name](start, case.model, case.sensors, settings)
        filter_.feed(to_increments(case.logs.imu, gap_limit(case.logs.imu.time)))
        kept = filter_.record.checkpoints
        time = np.array([c.time for c in kept])
        last = np.append(np.diff(time) > 1e-6, True)
        nav, s, _, P = split(np.array([c.carried for c in kept])[last])
        error, _ = _errors(case, filter_.layout, time[last], nav, s)
        headings.append(np.degrees(error[:, 8]))
        n = filter_.layout.size
        nees.append(nees_of_groups(error, P, {"all": np.arange(n)})["all"] / n)
    return time[last], np.array(headings), np.array(nees), n


def check(seeds, duration, share):
    time, heading, nees, n = runs("ukf", seeds, duration)
    at = np.searchsorted(time, STANDING_S + 40.0)
    assert np.mean(np.abs(heading[:, at]) < 3.0) >= share
    settled = nees[:, time > STANDING_S + 60.0]
    low, high = stats.chi2.ppf([5e-4, 1.0 - 5e-4], len(nees) * n) / (len(nees) * n)
    return settled.mean(axis=0), low, high


def test_a_heading_known_to_60_deg_is_found_within_a_minute_of_driving():
    check(range(5), 62.0, 1.0)


def test_a_heading_known_to_25_deg_is_not_learned_wrongly_at_rest():
    """Not held, and once narrowed to a third at rest with an error of 27 deg."""
    time, heading, nees, _ = runs("ukf", range(6), 62.0, 25.0)
    moving = time > STANDING_S + 20.0
    assert np.abs(heading[:, moving]).max() < 3.0
    assert nees[:, (time < STANDING_S) & (time > 5.0)].mean() < 2.0
    assert nees[:, moving].mean() < 1.5


@pytest.mark.slow
def test_of_200_runs_all_but_two_find_the_heading_and_are_consistent_afterwards():
    mean, low, high = check(range(200), 120.0, 0.99)
    # The bounds are those of independent normal errors; what is left of the start adds up to a twentieth.
    assert np.all(mean < 1.05 * high)
    assert np.all(mean > 0.95 * low)
    _, extended, _, _ = runs("ekf", range(40), 62.0)
    assert np.mean(np.abs(extended[:, -1]) < 3.0) < 0.9, "an extended filter finds fewer"
