from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from navfuse.analysis.metrics import errors
from navfuse.data.layout import Block, Layout
from navfuse.errors import ConfigError
from navfuse.filters.ekf import ErrorStateFilter
from navfuse.imu.increments import to_increments
from navfuse.montecarlo import SimulatedRecipe, assess, run_campaign, run_case, single
from navfuse.montecarlo.single import sensor_truth
from navfuse.smoothers.rts import smooth
from reference.engine_runs import cut, nav_at
from reference.navigation_algebra import error as error_twin

RECIPE = SimulatedRecipe("car", duration=30.0, imu_rate=50.0)


@pytest.mark.parametrize("frame", ["ned", "ecef"])
def test_nees_is_that_of_a_filter_stopped_at_the_epoch(frame):
    case = replace(RECIPE, frame=frame)(4)
    record = run_case(case, 4)
    increments = to_increments(case.logs.imu)
    estimator = ErrorStateFilter(case.start, case.model, case.sensors, case.settings)
    for first, last, epoch in ((0, 500, 10), (500, 1500, 30)):
        estimator.feed(cut(increments, first, last))
        k = int(np.searchsorted(record.time, epoch - 1e-6))
        truth = case.logs.imu_errors
        row = np.searchsorted(truth.time, epoch - 1e-9)
        states = np.concatenate(
            [getattr(truth, name)[row] for name in ("gyro_bias", "accel_bias", "gyro_scale", "accel_scale")]
        )
        navigation = error_twin(nav_at(case.logs.motion, epoch, frame == "ecef"), estimator.nav, frame == "ecef")
        d = np.concatenate([navigation, states - estimator.s])
        assert record.nees["whole state"][k] == pytest.approx(d @ np.linalg.solve(estimator.P, d), rel=1e-3)
        attitude = d[6:9] @ np.linalg.solve(estimator.P[6:9, 6:9], d[6:9])
        assert record.nees["attitude"][k] == pytest.approx(attitude, rel=1e-3)
        np.testing.assert_allclose(record.error[k, 9:], d[9:], rtol=1e-12)
    assert record.dof == {
        "position": 3,
        "velocity": 3,
        "attitude": 3,
        "gyro_bias": 3,
        "accel_bias": 3,
        "gyro_scale": 3,
        "accel_scale": 3,
        "whole state": 21,
    }


def test_errors_and_sigmas_are_those_of_the_output():
    """The filter's first output stands before the fix of that moment, the epoch behind it.

    The smoother's covariance is turned with the attitude that it corrects, its output's is not: 1e-3 apart.
    """
    case = replace(RECIPE, smooth=True)(5)
    record = run_case(case, 5)
    increments = to_increments(case.logs.imu)
    estimator = ErrorStateFilter(case.start, case.model, case.sensors, case.settings)
    estimator.feed(increments)
    truth = case.logs.motion.trajectory(record.time)
    back = smooth(estimator, increments)
    forward = estimator.record.trajectory()
    for trajectory, error, sd, rtol in (
        (forward.take(slice(1, None)), record.error[1:], record.sd[1:], 1e-7),
        (back.trajectory, record.smoothed_error, record.smoothed_sd, 1e-3),
    ):
        series = errors(trajectory, truth)
        stated = np.hstack([series.sd_position, series.sd_velocity, series.sd_attitude])
        np.testing.assert_allclose(sd[:, :9], stated, rtol=rtol)
        for block, where in (("position", slice(0, 3)), ("velocity", slice(3, 6)), ("attitude", slice(6, 9))):
            size = np.abs(getattr(series, block))
            np.testing.assert_allclose(np.abs(error[:, where]), size, atol=5e-3 * size.max())
    np.testing.assert_allclose(record.smoothed_sd[-1], record.sd[-1], rtol=1e-6)
    assert np.all(record.smoothed_sd[5] <= record.sd[5] * (1.0 + 1e-9))


def test_an_open_loop_is_judged_by_its_corrected_solution():
    case = SimulatedRecipe("car", grade="tactical", duration=30.0, imu_rate=50.0)(6)
    closed = run_case(case, 6)
    opened = run_case(replace(case, settings=replace(case.settings, open_loop=True)), 6)
    np.testing.assert_allclose(opened.error[:, :6], closed.error[:, :6], atol=0.02)
    np.testing.assert_allclose(opened.nees["position"], closed.nees["position"], rtol=0.1, atol=0.05)


def test_fixes_from_an_outage_are_epochs_too():
    record = run_case(replace(RECIPE, outages_s=((10.0, 20.0),))(7), 7)
    np.testing.assert_allclose(record.time, np.arange(31.0), atol=1e-9)
    during = record.innovations.status == "withheld"
    assert np.count_nonzero(during) == 20
    assert np.all(np.diff(record.sd[10:20, 0]) > 0.0)


def test_truth_of_sensor_states_belongs_to_the_interval():
    case = RECIPE(8)
    truth = case.logs.imu_errors
    layout = Layout.join([Block("gyro_bias", 3, 1.0), Block("gyro_cross", 6, 1.0)], [Block("odometer.scale", 1, 1.0)])
    crossed = replace(truth, gyro_cross=np.arange(9.0).reshape(3, 3))
    found = sensor_truth(layout, crossed, np.array([truth.time[10], truth.time[10] + 0.001, truth.time[-1]]))
    assert np.array_equal(found[:, :3], truth.gyro_bias[[10, 11, -1]])
    assert np.array_equal(found[:, 3:9], np.tile([1.0, 2.0, 3.0, 5.0, 6.0, 7.0], (3, 1)))
    assert np.isnan(found[:, 9]).all()


def test_a_run_without_checkpoints_is_refused():
    case = RECIPE(0)
    with pytest.raises(ConfigError, match="needs FilterSettings"):
        run_case(replace(case, settings=replace(case.settings, checkpoints=False)))


def test_a_run_without_measurements_is_refused():
    with pytest.raises(ConfigError, match="took in no measurement"):
        run_case(replace(RECIPE(0), sensors=()))


def test_a_smoother_without_output_is_judged_all_the_same():
    case = replace(RECIPE, smooth=True)(9)
    with_output = run_case(case, 9)
    without = run_case(replace(case, settings=replace(case.settings, output_period=-1.0)), 9)
    np.testing.assert_allclose(without.smoothed_error, with_output.smoothed_error, rtol=1e-6, atol=1e-9)
    assert set(without.smoothed_nees) == set(without.nees)


def test_nees_of_the_smoother_is_that_of_its_whole_covariance():
    """Against the fixed-interval smoother as one batch: P_s = P - P Lam P is in no table, so it is made by hand."""
    case = replace(RECIPE, smooth=True, frame="ecef")(11)
    record = run_case(case, 11)
    increments = to_increments(case.logs.imu)
    estimator = ErrorStateFilter(case.start, case.model, case.sensors, case.settings)
    estimator.feed(increments)
    back = smooth(estimator, increments, events=[3, 12])
    kept = [np.flatnonzero(np.abs(record.time - estimator.record.checkpoints[k].time) < 1e-6)[0] for k in (3, 12)]
    for row, k, event in zip((0, 1), kept, (3, 12), strict=True):
        P = back.P[row]
        np.testing.assert_allclose(P, P.T, atol=1e-9 * np.abs(P).max())
        assert np.linalg.eigvalsh(P[3:6, 3:6]).min() > 0.0
        before = estimator.record.checkpoints[event].P
        assert np.all(np.diagonal(P) <= np.diagonal(before) * (1.0 + 1e-9))
        velocity = record.smoothed_error[k, 3:6]
        assert record.smoothed_nees["velocity"][k] > 0.0
        assert np.linalg.norm(velocity) < 5.0 * np.sqrt(np.trace(P[3:6, 3:6]))


def test_long_runs_are_judged_at_some_of_their_epochs(monkeypatch):
    case = replace(RECIPE, smooth=True)(12)
    every = run_case(case, 12)
    monkeypatch.setattr(single, "MOST_EPOCHS", 11)
    third = run_case(case, 12)
    assert third.time.size == 11
    np.testing.assert_array_equal(third.time, every.time[::3])
    np.testing.assert_array_equal(third.error, every.error[::3])
    np.testing.assert_array_equal(third.nees["whole state"], every.nees["whole state"][::3])
    np.testing.assert_allclose(third.smoothed_nees["whole state"], every.smoothed_nees["whole state"][::3])
    for source in ("gnss_position", "gnss_velocity"):
        assert len(third.innovations.of(source)) == 11
        assert len(every.innovations.of(source)) == 31


def test_a_held_heading_leaves_the_smoother_unjudged_and_the_filter_judged():
    recipe = SimulatedRecipe("car", duration=60.0, imu_rate=20.0, smooth=True, start_sd_attitude_deg=(1.0, 1.0, 60.0))
    record = run_case(recipe(0), 0)
    held = np.isnan(record.smoothed_nees["position"])
    assert 5 < np.count_nonzero(held) < held.size
    assert not held[-1]
    assert np.isfinite(record.nees["whole state"]).all()
    still = SimulatedRecipe("static", duration=30.0, imu_rate=20.0, smooth=True, start_sd_attitude_deg=(1.0, 1.0, 60.0))
    found = assess(run_campaign(still, 4, jobs=1))
    assert found["smoother"].nees == {}
    assert found["filter"].nees
