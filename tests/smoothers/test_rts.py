from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity
from navfuse.errors import ConfigError
from navfuse.filters.ekf import ErrorStateFilter, FilterSettings
from navfuse.imu.increments import to_increments
from navfuse.simulation import car_drive, circle_flight, gnss_fixes, perfect_imu, sample_times, simulate
from navfuse.smoothers.rts import smooth
from reference.engine_runs import MEMS, cut, nav_at, perfect_increments, run_filter, start_at
from reference.linear_filter_twin import batch, dense_filter, rauch_tung_striebel, to_e
from reference.navigation_algebra import corrected, position_e, rotation_en

FRAMES = pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])
LEVER = np.array([1.0, 4.0, -1.5])
SD = ([1.0, 1.0, 2.0], [0.05] * 3, np.radians([0.5, 0.5, 2.0]))
SMALL_SD = ([0.5, 0.5, 1.0], [0.01] * 3, np.radians([0.01, 0.01, 0.03]))


@pytest.fixture(scope="module")
def linear():
    motion = circle_flight(20.0, straight=2.0)
    log = gnss_fixes(motion, 0.5, (0.5, 0.6, 0.9), None, LEVER, np.random.default_rng(3), offset=1.0)
    start = start_at(motion, 0.0, *SMALL_SD)
    layout = run_filter(start, MEMS, [], cut(perfect_increments(motion, 100.0), 0, 1)).layout
    return motion, log, start, dense_filter(motion, log, LEVER, start.P, MEMS, layout)


def test_the_twins_agree_with_each_other(linear):
    dense = linear[3]
    for a, b, P, Q in zip(*rauch_tung_striebel(dense), *batch(dense), strict=True):
        sd = np.sqrt(np.diagonal(Q))
        assert np.abs((a - P) / sd).max() < 1e-4
        assert np.abs((b - Q) / np.outer(sd, sd)).max() < 1e-4


@FRAMES
@pytest.mark.parametrize("open_loop", [False, True], ids=["closed", "open"])
def test_smoothing_a_linear_run_is_batch_least_squares(linear, open_loop, ecef):
    motion, log, start, dense = linear
    options = FilterSettings(
        ecef=ecef, open_loop=open_loop, covariance_period=0.0, output_period=1.0, gate_probability=1.0, checkpoints=True
    )
    increments = perfect_increments(motion, 100.0)
    filter_ = run_filter(start, MEMS, [GnssPosition(log, LEVER)], increments, options)
    smoothed = smooth(filter_, increments)
    limit = 2e-3 if open_loop else 1e-2
    trajectory = smoothed.trajectory
    for time, x, P in zip(dense.time, *batch(dense), strict=True):
        k = round(time)
        assert trajectory.time[k] == pytest.approx(time, abs=1e-9)
        sd = np.sqrt(np.diagonal(P))
        r, v, _ = corrected(nav_at(motion, time, ecef=True), x[:9], ecef=True)
        C_en = rotation_en(trajectory.lat[k], trajectory.lon[k])
        place = position_e(trajectory.lat[k], trajectory.lon[k], trajectory.height[k])
        assert np.abs((place - r) / sd[:3]).max() < limit
        assert np.abs((C_en @ trajectory.velocity_n[k] - v) / sd[3:6]).max() < limit
        in_n = np.sqrt(np.diagonal(to_e(motion, time, 21).T @ P @ to_e(motion, time, 21)))
        np.testing.assert_allclose(trajectory.sd_position[k], in_n[:3], rtol=limit)
        np.testing.assert_allclose(trajectory.sd_velocity[k], in_n[3:6], rtol=limit)
    fixes = [k for k, z in enumerate(dense.z) if z is not None]
    for row, k in enumerate(fixes):
        x, P = (values[k] for values in batch(dense))
        sd = np.sqrt(np.diagonal(P)[9:])
        assert np.abs((smoothed.state_value[row] - x[9:]) / sd).max() < limit
        np.testing.assert_allclose(smoothed.state_sd[row], sd, rtol=limit)


LOGS = simulate(car_drive(60.0, seed=5, standing=2.0), MEMS, seed=6, imu_rate=50.0, gnss_offset=0.0, lever_arm_b=LEVER)
INCREMENTS = to_increments(LOGS.imu)
FROM = {"from a fix": 250, "from between the outputs": 253}


def run(options, first=250, outages=((30.0, 40.0),), cuts=()):
    start = start_at(LOGS.motion, float(INCREMENTS.time[first]), *SD, np.random.default_rng(4))
    sensors = [GnssPosition(LOGS.gnss, LEVER, outages=outages), GnssVelocity(LOGS.gnss, LEVER, outages=outages)]
    increments = cut(INCREMENTS, first)
    filter_ = run_filter(start, MEMS, sensors, increments, options, cuts)
    return filter_, smooth(filter_, increments)


@pytest.mark.parametrize("first", FROM.values(), ids=FROM)
@pytest.mark.parametrize("period", [0.1, 0.0, 1.0, 0.033, 7.3])
@pytest.mark.parametrize("mode", [{}, {"ecef": True}, {"open_loop": True}], ids=["ned", "ecef", "open"])
def test_output_comes_at_the_times_of_the_filter(first, period, mode):
    filter_, smoothed = run(FilterSettings(output_period=period, checkpoints=True, **mode), first)
    forward = filter_.record.trajectory()
    assert np.array_equal(smoothed.trajectory.time, forward.time)
    assert np.all(np.diff(forward.time) > 0.0)
    assert forward.time.size > 5
    assert smoothed.trajectory.source == "smoothed"


def test_output_at_every_sample_means_every_sample():
    _, smoothed = run(FilterSettings(output_period=0.0, checkpoints=True))
    assert np.array_equal(smoothed.trajectory.time, INCREMENTS.time[250:])


def test_without_output_only_the_states_are_smoothed():
    filter_, smoothed = run(FilterSettings(output_period=-1.0, checkpoints=True))
    assert smoothed.trajectory.time.size == 0
    assert len(smoothed.state_time) == len(filter_.record.checkpoints)


MODES = pytest.mark.parametrize(
    "mode",
    [{}, {"ecef": True}, {"open_loop": True}, {"covariance_period": 0.0}, {"covariance_period": 0.5}],
    ids=["ned", "ecef", "open", "full rate", "low rate"],
)


@MODES
def test_smoothing_never_makes_the_covariance_larger(mode):
    filter_, smoothed = run(FilterSettings(checkpoints=True, **mode))
    forward, back = filter_.record.trajectory(), smoothed.trajectory
    for name in ("sd_position", "sd_velocity", "sd_attitude"):
        assert np.all(getattr(back, name) <= getattr(forward, name) * (1.0 + 1e-6))
        assert getattr(back, name).min() > 0.0
    first = np.sqrt(np.diagonal(filter_.record.checkpoints[0].P)[9:])
    assert np.all(smoothed.state_sd <= np.vstack([first, np.array(filter_.record.states)[:, 1]]) * (1.0 + 1e-6))


@MODES
def test_the_last_row_is_the_filter_s(mode):
    filter_, smoothed = run(FilterSettings(checkpoints=True, **mode))
    forward, back = filter_.record.trajectory(), smoothed.trajectory
    for name in ("lat", "lon", "height", "velocity_n", "attitude", "sd_position", "sd_velocity", "sd_attitude"):
        np.testing.assert_allclose(getattr(back, name)[-1], getattr(forward, name)[-1], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(smoothed.state_value[-1], filter_.record.states[-1][0], rtol=1e-9, atol=1e-15)


def horizontal_errors(trajectory):
    truth = LOGS.motion.trajectory(trajectory.time)
    return 6.37e6 * np.hypot(trajectory.lat - truth.lat, np.cos(truth.lat) * (trajectory.lon - truth.lon))


@MODES
def test_smoothing_bridges_an_outage(mode):
    filter_, smoothed = run(FilterSettings(checkpoints=True, **mode))
    outage = (smoothed.trajectory.time > 32.0) & (smoothed.trajectory.time < 40.0)
    forward = np.sqrt(np.mean(horizontal_errors(filter_.record.trajectory())[outage] ** 2))
    back = np.sqrt(np.mean(horizontal_errors(smoothed.trajectory)[outage] ** 2))
    assert back < 0.7 * forward
    assert back < 1.0


def test_both_frames_smooth_alike():
    a, b = (run(FilterSettings(ecef=ecef, checkpoints=True))[1].trajectory for ecef in (False, True))
    assert np.abs(a.lat - b.lat).max() * 6.4e6 < 2e-3
    assert np.abs(a.height - b.height).max() < 2e-3
    assert np.abs(a.velocity_n - b.velocity_n).max() < 5e-4
    np.testing.assert_allclose(a.sd_position, b.sd_position, rtol=2e-3)
    np.testing.assert_allclose(a.sd_attitude, b.sd_attitude, rtol=2e-3)


def test_blocks_make_no_difference():
    whole = run(FilterSettings(checkpoints=True))[1]
    pieces = run(FilterSettings(checkpoints=True), cuts=[1, 77, 78, 1000])[1]
    assert np.array_equal(whole.trajectory.lat, pieces.trajectory.lat)
    assert np.array_equal(whole.trajectory.sd_attitude, pieces.trajectory.sd_attitude)
    assert np.array_equal(whole.state_value, pieces.state_value)


def test_smoothed_values_do_not_depend_on_the_output_rate():
    """Rows between two fixes split the covariance steps, which costs no more than their truncation."""
    dense, sparse = (run(FilterSettings(output_period=p, checkpoints=True))[1].trajectory for p in (0.0, 1.0))
    common = np.searchsorted(dense.time, sparse.time - 1e-6)
    assert np.abs(dense.lat[common] - sparse.lat).max() * 6.4e6 < 1e-3
    np.testing.assert_allclose(dense.sd_position[common], sparse.sd_position, rtol=1e-3)


def test_one_checkpoint_is_kept_per_event():
    filter_, smoothed = run(FilterSettings(checkpoints=True))
    events = sorted({innovation.time for innovation in filter_.record.innovations})
    assert [c.time for c in filter_.record.checkpoints] == [5.0, *events]
    assert smoothed.state_time.tolist() == [5.0, *events]


def test_a_log_without_fixes_is_smoothed_into_itself():
    start = start_at(LOGS.motion, 0.0, *SD)
    options = FilterSettings(checkpoints=True)
    filter_ = run_filter(start, MEMS, [], INCREMENTS, options)
    back, forward = smooth(filter_, INCREMENTS).trajectory, filter_.record.trajectory()
    assert np.array_equal(back.time, forward.time)
    np.testing.assert_allclose(back.lat, forward.lat, rtol=1e-14)
    np.testing.assert_allclose(back.sd_position, forward.sd_position, rtol=1e-12)


def test_smoothed_attitude_is_near_the_truth():
    smoothed = run(FilterSettings(checkpoints=True))[1].trajectory
    truth = LOGS.motion.C_nb(smoothed.time)
    estimate = Rotation.from_euler("ZYX", smoothed.attitude[:, ::-1]).as_matrix()
    apart = Rotation.from_matrix(estimate @ truth.transpose(0, 2, 1)).magnitude()
    assert apart.max() < np.radians(2.0)
    assert apart[-1] < np.radians(0.5)


@pytest.mark.parametrize("at", [650, 653], ids=["saved after a step", "saved within a covariance step"])
def test_a_restored_filter_is_smoothed_back_to_where_it_was_saved(at):
    options = FilterSettings(checkpoints=True)
    whole = run(options)[1].trajectory
    increments = cut(INCREMENTS, 250)
    start = start_at(LOGS.motion, 5.0, *SD, np.random.default_rng(4))
    outages = ((30.0, 40.0),)
    sensors = [GnssPosition(LOGS.gnss, LEVER, outages=outages), GnssVelocity(LOGS.gnss, LEVER, outages=outages)]
    head = run_filter(start, MEMS, sensors, cut(increments, 0, at), options)
    tail = ErrorStateFilter(start, MEMS, sensors, options)
    tail.restore(head.state())
    tail.feed(cut(increments, at))
    back = smooth(tail, cut(increments, at)).trajectory
    common = np.searchsorted(whole.time, back.time - 1e-6)
    assert back.time[-1] == whole.time[-1]
    assert back.time[0] <= increments.time[at] + 0.1
    assert np.abs(whole.lat[common] - back.lat).max() * 6.4e6 < 1e-3
    assert np.abs(whole.velocity_n[common] - back.velocity_n).max() < 1e-4
    np.testing.assert_allclose(back.sd_position, whole.sd_position[common], rtol=2e-3)


def test_a_filter_without_checkpoints_cannot_be_smoothed():
    filter_ = run_filter(start_at(LOGS.motion, 0.0, *SD), MEMS, [], INCREMENTS)
    with pytest.raises(ConfigError, match="checkpoints=True"):
        smooth(filter_, INCREMENTS)


@pytest.mark.parametrize("events", [[2, 1], [1, 1], [-1], [99]])
def test_events_are_ascending_numbers_of_checkpoints(events):
    motion = car_drive(4.0, seed=1)
    increments = to_increments(perfect_imu(motion, sample_times(0.0, 4.0, 20.0)))
    start = start_at(motion, 0.0, [1.0] * 3, [0.1] * 3, [0.01] * 3)
    position = GnssPosition(gnss_fixes(motion, 1.0, 1.0, None), np.zeros(3))
    estimator = ErrorStateFilter(start, MEMS, [position], FilterSettings(checkpoints=True))
    estimator.feed(increments)
    with pytest.raises(ConfigError, match="events must be ascending numbers of the"):
        smooth(estimator, increments, events=events)
