from __future__ import annotations

import multiprocessing
from dataclasses import replace

import numpy as np
import pytest

from navfuse.errors import ConfigError, FilterError, InputError
from navfuse.montecarlo import assess, run_campaign
from navfuse.montecarlo.output import run_columns
from reference.montecarlo_recipes import (
    SHORT,
    EverySecondBreaks,
    ends_its_process,
    interrupted_at_five,
    longer_with_the_seed,
    refuses,
)


@pytest.fixture(scope="module")
def alone():
    return run_campaign(SHORT, 10, jobs=1)


def assert_same_runs(one, other):
    one, other = run_columns(one), run_columns(other)
    assert list(one) == list(other)
    for name in one:
        assert np.array_equal(one[name], other[name]), name


def test_runs_do_not_depend_on_the_number_of_processes(alone):
    told = []
    together = run_campaign(SHORT, 10, jobs=2, progress=lambda *step: told.append(step))
    assert_same_runs(alone, together)
    assert (alone.jobs, together.jobs) == (1, 2)
    assert [name for name, _ in told] == ["runs"] * len(told)
    assert [fraction for _, fraction in told] == sorted(fraction for _, fraction in told)
    assert told[-1] == ("runs", 1.0)
    assert together.throughput > 0.0


def test_seeds_follow_the_first(alone):
    later = run_campaign(SHORT, 4, jobs=1, first_seed=6)
    assert [run.seed for run in later.runs] == [6, 7, 8, 9]
    assert np.array_equal(later.runs[0].error, alone.runs[6].error)


def test_interruption_keeps_finished_runs(alone):
    campaign = run_campaign(interrupted_at_five, 10, jobs=1)
    assert campaign.interrupted
    assert [run.seed for run in campaign.runs] == [0, 1, 2, 3, 4]
    assert campaign.wanted == 10
    assert np.array_equal(campaign.runs[4].error, alone.runs[4].error)


def test_interruption_before_the_first_run_passes():
    with pytest.raises(KeyboardInterrupt):
        run_campaign(interrupted_at_five, 3, jobs=1, first_seed=5)


def test_interruption_of_several_processes_keeps_finished_runs(alone):
    def interrupt(stage, fraction):
        raise KeyboardInterrupt

    campaign = run_campaign(SHORT, 200, jobs=2, progress=interrupt)
    assert campaign.interrupted
    assert 1 <= len(campaign.runs) < 200
    assert multiprocessing.active_children() == []
    for run in campaign.runs:
        if run.seed < 10:
            assert np.array_equal(run.error, alone.runs[run.seed].error)


def test_failed_runs_are_counted_and_named():
    campaign = run_campaign(EverySecondBreaks(), 6, jobs=1)
    assert [run.seed for run in campaign.runs] == [0, 2, 4]
    assert list(campaign.failed) == [1, 3, 5]
    assert "increments begin at 0.000000 s but the filter stands at -100.000000 s" in campaign.failed[1]


def test_an_error_of_the_recipe_is_no_failed_run():
    with pytest.raises(InputError, match="the motion is not known here"):
        run_campaign(refuses, 3, jobs=1)


def test_all_runs_failed():
    with pytest.raises(FilterError, match="none of the 1 runs could be finished; seed 3: increments begin"):
        run_campaign(EverySecondBreaks(), 1, jobs=1, first_seed=3)


def test_a_process_that_dies_is_reported():
    with pytest.raises(FilterError, match="a process of the campaign ended after 0 runs: .*use fewer jobs"):
        run_campaign(ends_its_process, 4, jobs=2)


def test_a_recipe_that_cannot_travel():
    with pytest.raises(ConfigError, match="cannot be handed to other processes.*or use jobs = 1"):
        run_campaign(lambda seed: SHORT(seed), 4, jobs=2)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"runs": 0}, "runs must be at least 1, not 0"),
        ({"runs": 1, "jobs": 0}, "jobs must be at least 1, not 0"),
        ({"runs": 1, "first_seed": -1}, "first_seed must be at least 0, not -1"),
    ],
)
def test_bad_numbers_are_refused(arguments, message):
    with pytest.raises(ConfigError, match=message):
        run_campaign(SHORT, **arguments)


def test_runs_are_averaged_at_the_epochs_that_all_of_them_have():
    campaign = run_campaign(longer_with_the_seed, 2, jobs=1)
    short, long = campaign.runs
    assert short.time.size < long.time.size
    found = assess(campaign, settle_s=2.0)["filter"]
    assert np.array_equal(found.nees["position"].time, short.time)
    both = np.array([short.nees["position"], long.nees["position"][: short.time.size]])
    np.testing.assert_allclose(found.nees["position"].mean, both.mean(axis=0) / 3.0)


def test_runs_without_a_common_epoch_cannot_be_averaged(alone):
    moved = replace(alone.runs[1], time=alone.runs[1].time + 0.5)
    with pytest.raises(InputError, match="the runs have no epoch in common"):
        assess(replace(alone, runs=[alone.runs[0], moved]))


def test_nothing_left_to_judge(alone):
    with pytest.raises(ConfigError, match="the runs last 20 s, of which the first 30 s are not judged"):
        assess(alone, settle_s=30.0)
