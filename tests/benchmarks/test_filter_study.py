"""The study of the manual, on a few short runs: what it simulates, what it says, and that it can be drawn."""

from __future__ import annotations

import importlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from navfuse.aiding.base import AidingSensor
from navfuse.data.nav_state import boxminus_navigation
from navfuse.filters.kinds import FILTERS
from navfuse.simulation.scenario import StartErrors
from navfuse.simulation.scenario_run import told_start

ROOT = Path(__file__).resolve().parents[2]
EXACT = StartErrors((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def cases():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT))
        yield importlib.import_module("benchmarks.filter_cases")


@pytest.fixture(scope="module")
def study(cases):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT))
        yield importlib.import_module("benchmarks.filter_study")


def heading_off(case) -> float:
    """Error of the heading [deg], true minus told, at the start."""
    d = np.empty(9)
    boxminus_navigation(told_start(case.logs.motion, case.start.time, EXACT, 0).nav, case.start.nav, False, d)
    return float(np.degrees(d[8]))


def test_a_heading_that_is_off_by_so_much(cases):
    recipe = cases.StudyRecipe(cases.CASES["heading-off-150"], "ukf")
    found = [heading_off(recipe(seed)) for seed in range(6)]
    np.testing.assert_allclose(np.abs(found), 150.0, atol=1.5)
    assert {np.sign(value) for value in found} == {-1.0, 1.0}
    assert np.degrees(np.sqrt(recipe(0).start.P[8, 8])) == pytest.approx(60.0, rel=1e-3)


def test_a_heading_that_may_be_anywhere(cases):
    recipe = cases.StudyRecipe(cases.CASES["heading-unknown"], "ukf")
    found = np.array([heading_off(recipe(seed)) for seed in range(60)])
    assert np.all(np.histogram(found, 4, (-180.0, 180.0))[0] >= 5)


def test_all_estimators_see_the_same(cases):
    first, second = (cases.StudyRecipe(cases.CASES["heading-60"], name)(3) for name in ("ekf", "ukf"))
    np.testing.assert_array_equal(first.start.nav, second.start.nav)
    np.testing.assert_array_equal(first.logs.imu.gyro, second.logs.imu.gyro)
    assert (first.estimator, second.estimator) == ("ekf", "ukf")


@pytest.mark.parametrize("ecef", [False, True])
def test_the_ranges_are_those_to_the_anchors(cases, ecef):
    case = cases.StudyRecipe(cases.CASES["ranges"], "ekf")(0)
    (sensor,) = case.sensors
    estimator = FILTERS["ekf"](case.start, case.model, case.sensors, replace(case.settings, ecef=ecef))
    nav = estimator.nav_state()
    assert sensor.value(5).shape == (4,)
    step = 1e-3
    for i in range(3):
        d = np.zeros(nav.layout.size)
        d[i] = step
        slope = (sensor.predict(nav.boxplus(d), 5) - sensor.predict(nav.boxplus(-d), 5)) / (2.0 * step)
        np.testing.assert_allclose(sensor.jacobian(nav, 5)[:, i], slope, atol=1e-6)
    assert not sensor.jacobian(nav, 5)[:, 3:].any()
    assert isinstance(sensor, AidingSensor)
    truth = case.logs.motion.at(sensor.times).r_e
    off = sensor.ranges - np.linalg.norm(sensor.anchors_e - truth[:, None], axis=2)
    assert np.std(off) == pytest.approx(cases.RANGE_SD, rel=0.1)


def test_ranges_polled_one_after_the_other(cases):
    (sensor,) = cases.StudyRecipe(cases.CASES["ranges-polled"], "ekf")(0).sensors
    assert sensor.ranges.shape == (sensor.times.size, 1)
    np.testing.assert_array_equal(sensor.anchors_e[0], sensor.anchors_e[4])
    assert np.linalg.norm(sensor.anchors_e[0] - sensor.anchors_e[1]) > 10.0


def test_the_fixes_of_an_outage_are_withheld(cases):
    case = cases.StudyRecipe(cases.CASES["outage-60"], "ekf")(0)
    for sensor in case.sensors:
        hidden = [float(sensor.times[k]) for k in range(sensor.times.size) if sensor.withheld(k)]
        assert (min(hidden), max(hidden)) == (300.0, 359.0)


def test_a_few_runs_from_beginning_to_end(study, tmp_path, capsys):
    saved = tmp_path / "study.json"
    given = ["--case", "heading-60", "--estimators", "ekf,ukf,ckf", "--save", str(saved)]
    study.main([*given, "--runs", "2"])
    found = json.loads(saved.read_text(encoding="utf-8"))["heading-60"]
    assert found["ckf"]["runs"] == 0
    assert "half a turn" in found["ckf"]["refused"]
    assert found["ukf"]["found"] == 2
    assert found["ukf"]["nees"]["whole state"]["mean"] < 2.0 < found["ekf"]["nees"]["whole state"]["mean"]
    assert found["ukf"]["nees"]["whole state"]["bounds"] == pytest.approx([0.54, 1.65], abs=0.02)
    assert found["ukf"]["microseconds_per_sample"] > 0.0
    assert "heading within 3 deg 60 s after driving begins in 2 of 2 runs" in capsys.readouterr().out
    study.main(["--runs", "0", "--save", str(saved), "--figure", str(tmp_path)])
    drawn = sorted(path.name for path in tmp_path.glob("*.png"))
    assert drawn == ["when-ukf-heading.png", "when-ukf-overview.png"]


def test_when_a_heading_counts_as_found(study):
    since = np.arange(0.0, 141.0)
    off = np.where(since < 50.0, 40.0, 1.0) * np.ones((3, 1))
    off[1, 100] = 5.0
    off[2, -1] = 5.0
    found = study._heading(since, off)
    assert found["found"] == 3
    assert (found["median_s"], found["slowest_s"]) == (81.0, None)
    assert found["share_found"][0] == 0.0
