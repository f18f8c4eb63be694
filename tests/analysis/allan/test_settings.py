"""The random walk that ``[imu]`` gets without a turn-on bias does not contradict the record."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.analysis.allan.test_notes import noisy, one_axis

from navfuse.analysis.allan import StudySettings, study
from navfuse.analysis.allan.recommend import bias_model
from navfuse.analysis.allan.settings import filter_settings, remarks
from navfuse.analysis.allan.terms import FLOOR, Term


def test_the_walk_of_a_flat_floor_is_its_fit_in_the_logarithm():
    """The mean over evenly spaced logarithms of floor^2 / (tau / 3): the walk crosses the floor in their middle."""
    tau = np.geomspace(1.0, 7200.0, 200)
    found = bias_model([np.full(200, 4.0)], [1e-3], tau, 3600.0)
    assert found is not None
    begin, end = found.span
    middle = math.sqrt(begin * end)
    assert found.free_walk[0] == pytest.approx(2.0 * math.sqrt(3.0 / middle), rel=0.01)
    assert found.free_error == pytest.approx(0.5 * math.log(end / begin) / math.sqrt(12.0), rel=0.02)
    assert found.held == (False,)
    assert found.free_walk[0] < 0.4 * found.sd[0] * math.sqrt(2.0 / found.tau)
    low = bias_model([np.full(200, 4.0)], [1e-3], tau, 3600.0, [1e-3])
    assert low is not None
    assert low.free_walk == (1e-3,)
    assert low.held == (True,)
    assert low.free_error > found.free_error
    assert low.sd == found.sd


def test_a_random_walk_is_held_too():
    tau = np.geomspace(1.0, 7200.0, 200)
    found = bias_model([0.01 * tau / 3.0, 0.01 * tau / 3.0], [1.0, 1.0], tau, 3600.0, [0.05, math.inf])
    assert found is not None
    assert math.isinf(found.tau)
    assert found.walk == pytest.approx((0.05, 0.1))
    assert found.held == (True, False)


@pytest.mark.parametrize("size", [60_000, 360_000])
def test_the_walk_of_a_record_stays_below_its_own_limit(size):
    found = study(one_axis(noisy(77, size)), StudySettings(grid="octave", terms=("N", "B", "K")))
    model, fields = filter_settings(found)
    assert "gyro_bias_walk" in fields
    term = found.axes[0].identification.term("K")
    walk = float(np.max(model.axes("gyro_bias_walk")))
    assert 0.0 < walk <= (term.value + 1.645 * term.sigma if term.present else term.limit) * (1.0 + 1e-12)
    assert found.gyro is not None
    longest = found.gyro.span[1]
    assert walk * math.sqrt(longest / 3.0) < 3.0 * FLOOR * 2e-5
    (text,) = [text for text in remarks(found) if text.startswith("gyro_bias_walk")]
    assert f"off by {100.0 * math.expm1(found.gyro.free_error):.0f} % (root mean square)" in text


def test_an_axis_without_a_visible_bias_takes_no_walk_above_its_own_limit():
    one = study(one_axis(noisy(77)), StudySettings(grid="octave", terms=("N", "B", "K")))
    quiet = replace(
        one.axes[0],
        name="gyro y",
        identification=replace(one.axes[0].identification, terms=(Term("K", False, limit=1e-9),)),
    )
    assert one.gyro is not None
    none = replace(
        one.gyro,
        sd=(*one.gyro.sd, 0.0, 0.0),
        walk=(0.0,) * 3,
        free_walk=(*one.gyro.free_walk, 0.0, 0.0),
        held=(False,) * 3,
    )
    found = replace(one, axes=(one.axes[0], quiet, replace(quiet, name="gyro z")), gyro=none)
    walk = filter_settings(found)[0].axes("gyro_bias_walk")
    assert walk == pytest.approx([one.gyro.free_walk[0], 1e-9, 1e-9])
