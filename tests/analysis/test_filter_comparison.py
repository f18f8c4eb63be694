"""What a comparison of estimators computes: NEES from full covariances, running RMSE, the great circle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from navfuse.analysis import event_nees
from navfuse.analysis.event_nees import (
    NAVIGATION,
    NeesSummary,
    events_to_smooth,
    events_within,
    nees_at_events,
    smoothed_nees_at_events,
)
from navfuse.analysis.filter_comparison import WINDOW_S, compare_solution, running_rms
from navfuse.analysis.great_circle import haversine
from navfuse.analysis.interpolation import earth_states, ned_axes
from navfuse.core.earth import geodetic_to_ecef
from navfuse.data.trajectory import Trajectory
from navfuse.errors import InputError
from navfuse.filters.ekf import ErrorStateFilter
from navfuse.imu.increments import to_increments
from navfuse.montecarlo.recipes import SimulatedRecipe
from navfuse.montecarlo.single import run_case
from navfuse.smoothers.rts import smooth


def case_of(open_loop=False, **changes):
    options = {"duration": 40.0, "imu_rate": 50.0, "grade": "tactical", **changes}
    case = SimulatedRecipe("car", **options)(3)
    return replace(case, settings=replace(case.settings, open_loop=open_loop))


def filtered(case):
    run = ErrorStateFilter(case.start, case.model, case.sensors, case.settings)
    run.feed(to_increments(case.logs.imu))
    return run


def truth_of(case, rate=1.0):
    return case.logs.motion.trajectory(np.arange(0.0, 40.0 + 0.5 / rate, 1.0 / rate))


@pytest.mark.parametrize(("frame", "open_loop"), [("ned", False), ("ecef", False), ("ned", True)])
def test_nees_is_that_of_a_campaign(frame, open_loop):
    case = case_of(open_loop, frame=frame)
    expected = run_case(case)
    found = nees_at_events([filtered(case).record], truth_of(case), frame == "ecef", open_loop)
    for group in ("position", "velocity", "attitude"):
        np.testing.assert_allclose(found[group].time, expected.time)
        np.testing.assert_allclose(found[group].values, expected.nees[group], rtol=1e-5)
        assert found[group].dof == 3
    assert found[NAVIGATION].dof == 9


@pytest.mark.parametrize(("frame", "open_loop"), [("ned", False), ("ecef", False), ("ned", True)])
def test_smoothed_nees_is_that_of_a_campaign(frame, open_loop):
    case = replace(case_of(open_loop, frame=frame), smooth=True)
    expected, run, truth = run_case(case), filtered(case), truth_of(case)
    events = events_to_smooth(run.record, truth)
    back = smooth(run, to_increments(case.logs.imu), events=events.tolist())
    found = smoothed_nees_at_events([run.record], [back], truth, frame == "ecef")
    for group in ("position", "velocity", "attitude"):
        free = np.isin(expected.time, found[group].time)
        np.testing.assert_allclose(found[group].values, expected.smoothed_nees[group][free], rtol=1e-5)
        assert np.isnan(expected.smoothed_nees[group][~free]).all()
        assert free.sum() == found[group].time.size > 20
    assert found[NAVIGATION].dof == 9


def test_the_events_to_smooth_are_spread_evenly_and_begin_behind_a_held_heading(monkeypatch):
    case = case_of()
    record, truth = filtered(case).record, truth_of(case)
    whole = events_within(record, truth)
    monkeypatch.setattr(event_nees, "MOST_SMOOTHED", 5)
    some = events_to_smooth(record, truth)
    assert some.size == 5
    assert some[-1] == whole[-1]
    middle = int(whole[20])
    record.checkpoints[middle] = record.checkpoints[middle]._replace(held=np.array([0.0, 0.0, 1.0]))
    assert events_to_smooth(record, truth)[0] > middle
    record.checkpoints[-1] = record.checkpoints[-1]._replace(held=np.array([0.0, 0.0, 1.0]))
    assert events_to_smooth(record, truth).size == 0
    assert smoothed_nees_at_events([record], [None], truth, False) == {}


def test_nees_of_all_nine_states_by_inverse_matrices():
    case = case_of()
    run, truth = filtered(case), truth_of(case)
    found = nees_at_events([run.record], truth, False, False)[NAVIGATION]
    reference = earth_states(truth)
    last = {round(checkpoint.time, 6): checkpoint for checkpoint in run.record.checkpoints}
    assert found.time.size == len(last) == 41
    for row, (time, value) in enumerate(zip(found.time, found.values, strict=True)):
        nav, _, _, P = last[round(float(time), 6)].parts
        C_en = ned_axes(nav[:1], nav[1:2])[0]
        q = Rotation.from_quat(nav[[7, 8, 9, 6]])
        true = Rotation.from_matrix(C_en.T) * Rotation.from_quat(reference.q_eb[row, [1, 2, 3, 0]])
        error = np.concatenate(
            [
                C_en.T @ (reference.r_e[row] - geodetic_to_ecef(*nav[:3])),
                C_en.T @ reference.v_e[row] - nav[3:6],
                (true * q.inv()).as_rotvec(),
            ]
        )
        assert value == pytest.approx(error @ np.linalg.inv(P[:9, :9]) @ error, rel=1e-5)


def test_a_sigma_told_too_small_shows_in_nees():
    honest, flattered = (
        nees_at_events([filtered(case).record], truth_of(case), False, False)["position"]
        for case in (case_of(), case_of(gnss_sd_factor=0.25))
    )
    assert flattered.mean_per_dof > 3.0 * honest.mean_per_dof
    assert flattered.share_inside < honest.share_inside - 0.2


def test_a_truth_of_positions_only_has_nees_of_positions_only():
    case = case_of()
    truth = replace(truth_of(case), velocity_n=None, attitude=None)
    assert list(nees_at_events([filtered(case).record], truth, False, False)) == ["position"]


def test_moments_outside_the_truth_are_left_out():
    case = case_of()
    run, truth = filtered(case), truth_of(case)
    late = nees_at_events([run.record], truth.take(truth.time >= 20.0), False, False)["position"]
    whole = nees_at_events([run.record], truth, False, False)["position"]
    assert late.time[0] == 20.0
    np.testing.assert_allclose(late.values, whole.values[whole.time >= 20.0], rtol=1e-9)
    assert nees_at_events([run.record], replace(truth, time=truth.time + 1e4), False, False) == {}


def test_records_follow_each_other():
    case = case_of()
    record = filtered(case).record
    once = nees_at_events([record], truth_of(case), False, False)["velocity"]
    twice = nees_at_events([record, record], truth_of(case), False, False)["velocity"]
    np.testing.assert_array_equal(twice.values, np.tile(once.values, 2))


def test_share_below_the_bound():
    values = np.random.default_rng(4).chisquare(9, 20000)
    found = NeesSummary(9, np.arange(20000.0), values)
    assert found.bound == pytest.approx(chi2.ppf(0.95, 9))
    assert found.share_inside == pytest.approx(0.95, abs=5.0 * np.sqrt(0.95 * 0.05 / 20000))
    assert found.mean_per_dof == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / 9.0 / 20000))
    assert found.to_dict() == {
        "epochs": 20000,
        "epochs_not_positive_definite": 0,
        "dof": 9,
        "mean_per_dof": found.mean_per_dof,
        "bound_95": found.bound,
        "share_inside_95": found.share_inside,
    }


def test_a_covariance_that_is_not_positive_definite_counts_as_outside_and_is_told():
    case = case_of()
    record, truth = filtered(case).record, truth_of(case)
    spoilt = int(events_within(record, truth)[10])
    record.checkpoints[spoilt] = record.checkpoints[spoilt]._replace(carried=record.checkpoints[spoilt].carried.copy())
    record.checkpoints[spoilt].P[4, 4] *= -1.0
    whole = nees_at_events([filtered(case).record], truth, False, False)
    found = nees_at_events([record], truth, False, False)
    assert [found[name].not_definite for name in found] == [0, 1, 0, 1]
    assert np.flatnonzero(np.isnan(found["velocity"].values)).tolist() == [10]
    good = np.arange(41) != 10
    assert found["velocity"].mean_per_dof == pytest.approx(whole["velocity"].values[good].mean() / 3.0)
    inside = whole["velocity"].values <= whole["velocity"].bound
    assert found["velocity"].share_inside == pytest.approx(np.count_nonzero(inside[good]) / 41.0)
    assert np.isnan(NeesSummary(3, np.zeros(1), np.array([np.nan])).mean_per_dof)


def slow_running_rms(time, values, window):
    return [np.sqrt(np.mean(values[(time > t - window) & (time <= t)] ** 2)) for t in time]


@pytest.mark.parametrize("window", [0.5, 7.3, 60.0, 1e4])
def test_running_rms_against_the_plain_sums(window):
    rng = np.random.default_rng(5)
    step = rng.choice([0.1, 1.0, 20.0, 300.0], 700, p=[0.5, 0.4, 0.08, 0.02])
    time, values = np.cumsum(step), rng.normal(size=700)
    np.testing.assert_allclose(running_rms(time, values, window), slow_running_rms(time, values, window), rtol=1e-12)


def test_running_rms_forgets_a_large_error_without_a_trace():
    time = np.arange(1000.0)
    values = np.where(time < 10.0, 1e9, 1e-3)
    np.testing.assert_allclose(running_rms(time, values)[int(WINDOW_S) + 10 :], 1e-3, rtol=1e-12)


def test_running_rms_of_one_value():
    assert running_rms(np.array([3.0]), np.array([-2.0])).tolist() == [2.0]


def test_distances_of_a_solution():
    time = np.arange(20.0)
    truth = Trajectory(time, np.full(20, 0.8), np.linspace(0.2, 0.2001, 20), np.full(20, 100.0), source="truth")
    solution = replace(truth, lat=truth.lat + 1e-6, height=truth.height + 40.0, source="solution")
    found = compare_solution(solution, truth)
    expected = haversine(0.8, 0.2, 0.8 + 1e-6, 0.2)
    np.testing.assert_allclose(found.great_circle, expected, rtol=1e-6)
    np.testing.assert_allclose(found.distance, np.hypot(found.errors.position[:, 0], 40.0), rtol=1e-5)
    assert found.figures()["MAE 3-D position"] == pytest.approx(found.distance.mean())
    assert found.figures()["RMSE vertical"] == pytest.approx(40.0, abs=1e-4)
    assert set(found.figures()) == {
        "RMSE horizontal", "RMSE vertical", "RMSE 3-D position", "MAE 3-D position", "maximum 3-D position",
    }  # fmt: skip
    with pytest.raises(InputError, match="have no time in common"):
        compare_solution(solution, replace(truth, time=time + 100.0))
