"""What the filter estimates, against a dense NumPy filter and against itself in other forms."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.aiding.base import AidingSensor
from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity
from navfuse.data.layout import Block
from navfuse.data.start import Start
from navfuse.errors import ConfigError, FilterError
from navfuse.filters.ekf import ErrorStateFilter, FilterSettings
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.grades import GRADES
from navfuse.imu.increments import ImuIncrements, to_increments
from navfuse.simulation import car_drive, circle_flight, figure_eight_flight, gnss_fixes, simulate, static
from reference.engine_runs import MEMS, cut, nav_at, perfect_increments, run_filter, start_at
from reference.linear_filter_twin import dense_filter, to_e
from reference.navigation_algebra import error

FRAMES = pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])
LEVER = np.array([1.0, 4.0, -1.5])
SD = ([1.0, 1.0, 2.0], [0.05] * 3, np.radians([0.5, 0.5, 2.0]))
SMALL_SD = ([0.5, 0.5, 1.0], [0.01] * 3, np.radians([0.01, 0.01, 0.03]))
NAVIGATION = GRADES["navigation"].replace(gyro_cross_sd=0.0, accel_cross_sd=0.0)


def deviations(filter_):
    return np.sqrt(np.diagonal(filter_.P))


@FRAMES
def test_a_linear_run_equals_a_dense_filter(ecef):
    """Ideal sensors, open loop: the inertial solution is the truth, and what remains is a linear Kalman filter."""
    motion = circle_flight(20.0, straight=2.0)
    log = gnss_fixes(motion, 1.0, (0.5, 0.6, 0.9), None, LEVER, np.random.default_rng(3), offset=0.5)
    start = start_at(motion, 0.0, *SMALL_SD)
    options = FilterSettings(ecef=ecef, open_loop=True, covariance_period=0.0, gate_probability=1.0)
    filter_ = run_filter(start, MEMS, [GnssPosition(log, LEVER)], perfect_increments(motion, 100.0), options)
    dense = dense_filter(motion, log, LEVER, start.P, MEMS, filter_.layout)
    turn = np.eye(21) if ecef else to_e(motion, 20.0, 21)
    expected = np.sqrt(np.diagonal(dense.P[-1]))
    assert np.abs((turn @ filter_.x - dense.x[-1]) / expected).max() < 2e-3
    assert np.abs((turn @ filter_.P @ turn.T - dense.P[-1]) / np.outer(expected, expected)).max() < 2e-3


def navigation_grade_runs(**options):
    """Open and closed loop on one set of logs."""
    logs = simulate(car_drive(60.0, seed=5, standing=2.0), NAVIGATION, seed=6)
    start = start_at(logs.motion, 0.0, *SMALL_SD, np.random.default_rng(1))
    increments = to_increments(logs.imu)
    sensors = [GnssPosition(logs.gnss), GnssVelocity(logs.gnss)]
    return [
        run_filter(start, NAVIGATION, sensors, increments, FilterSettings(open_loop=open_loop, **options))
        for open_loop in (False, True)
    ]


@FRAMES
def test_open_loop_plus_correction_equals_closed_loop(ecef):
    closed, opened = navigation_grade_runs(ecef=ecef)
    sd = deviations(closed)
    apart = error(opened.nav_state().array, closed.nav, ecef)
    assert np.abs(opened.x[:9] / sd[:9]).max() > 0.3
    assert np.abs(apart / sd[:9]).max() < 2e-3
    assert np.abs((opened.s + opened.x[9:] - closed.s) / sd[9:]).max() < 2e-3
    np.testing.assert_allclose(deviations(opened), sd, rtol=1e-3)
    a, b = opened.record.trajectory(), closed.record.trajectory()
    assert np.abs(a.height - b.height).max() < 2e-3
    assert np.abs(a.attitude - b.attitude).max() < np.radians(1e-3)


@pytest.mark.parametrize("open_loop", [False, True], ids=["closed", "open"])
def test_both_frames_give_one_result(open_loop):
    logs = simulate(car_drive(60.0, seed=7, standing=2.0), MEMS, seed=8, lever_arm_b=LEVER)
    start = start_at(logs.motion, 0.0, *SD, np.random.default_rng(2))
    increments = to_increments(logs.imu)
    sensors = [GnssPosition(logs.gnss, LEVER), GnssVelocity(logs.gnss, LEVER)]
    level, earth = (
        run_filter(start, MEMS, sensors, increments, FilterSettings(ecef=ecef, open_loop=open_loop))
        for ecef in (False, True)
    )
    a, b = level.record.trajectory(), earth.record.trajectory()
    limit = 1.0 if not open_loop else 30.0
    assert np.abs(a.lat - b.lat).max() * 6.4e6 < 1e-3 * limit
    assert np.abs(a.height - b.height).max() < 1e-3 * limit
    assert np.abs(a.velocity_n - b.velocity_n).max() < 1e-4 * limit
    apart = np.abs((a.attitude - b.attitude + np.pi) % (2.0 * np.pi) - np.pi)
    assert apart.max() < np.radians(1e-3) * limit
    np.testing.assert_allclose(a.sd_attitude, b.sd_attitude, rtol=2e-3 * limit)
    np.testing.assert_allclose(level.s, earth.s, atol=1e-3 * limit * deviations(level)[9:].max())


class Joint(AidingSensor):
    """Position and velocity of an antenna as one measurement of six values."""

    name = "joint"

    def __init__(self, position, velocity):
        self.parts = position, velocity
        self.times = position.times

    def linearize(self, nav, k):
        (z1, H1, R1), (z2, H2, R2) = (part.linearize(nav, k) for part in self.parts)
        R = np.zeros((6, 6))
        R[:3, :3], R[3:, 3:] = R1, R2
        return np.concatenate([z1, z2]), np.vstack([H1, H2]), R


@pytest.mark.parametrize("open_loop", [False, True], ids=["closed", "open"])
def test_measurements_of_one_moment_act_like_a_joint_one(open_loop):
    """A bias that the position corrects must show in the rate that the velocity behind it is predicted with."""
    motion = circle_flight(10.0, straight=0.0)
    model = ImuErrorModel(arw=1e-4, vrw=1e-3, gyro_bias_sd=2e-3, accel_bias_sd=1e-2)
    log = gnss_fixes(motion, 1.0, (0.01, 0.01, 0.01), (1e-3, 1e-3, 1e-3), LEVER, None, offset=4.5)
    log = type(log)(*(value[:1] for value in (log.time, log.lat, log.lon, log.height, log.sd_position)),
                    log.velocity_n[:1], log.sd_velocity[:1])  # fmt: skip
    increments = perfect_increments(motion, 100.0)
    increments = ImuIncrements(
        increments.time, increments.inc_theta_b + 0.01 * np.array([2e-3, -1e-3, 1e-3]), increments.inc_v_b
    )
    parts = GnssPosition(log, LEVER), GnssVelocity(log, LEVER)
    start = start_at(motion, 0.0, [0.1] * 3, [0.01] * 3, [1e-3] * 3)
    options = FilterSettings(open_loop=open_loop, gate_probability=1.0)
    apart, joint = (run_filter(start, model, s, increments, options) for s in (parts, [Joint(*parts)]))
    sd = deviations(joint)
    np.testing.assert_allclose(deviations(apart), sd, rtol=5e-3)
    assert np.abs((apart.s + apart.x[9:] - joint.s - joint.x[9:]) / sd[9:]).max() < 0.05
    d = error(apart.nav_state().array, joint.nav_state().array, ecef=False)
    assert np.abs(d / sd[:9]).max() < 0.05


@FRAMES
@pytest.mark.parametrize("open_loop", [False, True], ids=["closed", "open"])
def test_the_first_fix_is_predicted_with_the_rate_of_the_first_increment(open_loop, ecef):
    motion = circle_flight(20.0, straight=0.0)
    log = gnss_fixes(motion, 1.0, (1.0, 1.0, 2.0), (0.05, 0.05, 0.1), LEVER, None)
    start = start_at(motion, 10.0, *SMALL_SD)
    options = FilterSettings(ecef=ecef, open_loop=open_loop)
    filter_ = run_filter(start, MEMS, [GnssVelocity(log, LEVER)], cut(perfect_increments(motion, 100.0), 1000), options)
    first = filter_.record.innovations[0]
    assert first.time == 10.0
    assert np.abs(first.z).max() < 5e-3


def split_by_hand(increments, time):
    """Increments with further stamps at the given times, each part in proportion to its length."""
    stamps = np.union1d(increments.time, time)
    index = np.searchsorted(increments.time, stamps[1:]) - 1
    part = (np.diff(stamps) / increments.dt[index])[:, None]
    return ImuIncrements(stamps, part * increments.inc_theta_b[index], part * increments.inc_v_b[index])


@FRAMES
def test_an_increment_is_split_at_a_fix_inside_it(ecef):
    logs = simulate(car_drive(20.0, seed=9, standing=1.0), MEMS, seed=3, imu_rate=20.0, gnss_offset=0.333)
    start = start_at(logs.motion, 0.0, *SD)
    increments = to_increments(logs.imu)
    options = FilterSettings(ecef=ecef, covariance_period=0.0)
    sensors = [GnssPosition(logs.gnss)]
    inside = run_filter(start, MEMS, sensors, increments, options)
    by_hand = run_filter(start, MEMS, sensors, split_by_hand(increments, logs.gnss.time), options)
    assert np.abs(error(inside.nav, by_hand.nav, ecef)).max() < 1e-9
    np.testing.assert_allclose(inside.P, by_hand.P, rtol=1e-9, atol=1e-15)
    assert np.array_equal(inside.record.trajectory().time, by_hand.record.trajectory().time)


def test_an_ideal_log_gives_the_truth_between_the_stamps_too():
    motion = figure_eight_flight(30.0, straight=2.0, heading=1.0)
    log = gnss_fixes(motion, 4.0, (0.01, 0.01, 0.01), (0.01,) * 3, LEVER, None, offset=0.0037)
    sensors = [GnssPosition(log, LEVER), GnssVelocity(log, LEVER)]
    start = start_at(motion, 0.0, *SMALL_SD)
    options = FilterSettings(output_period=0.033)
    trajectory = run_filter(start, MEMS, sensors, perfect_increments(motion, 100.0), options).record.trajectory()
    truth = motion.trajectory(trajectory.time)
    assert np.abs(trajectory.height - truth.height).max() < 2e-3
    assert np.abs(trajectory.velocity_n - truth.velocity_n).max() < 2e-3
    assert np.abs(trajectory.attitude - truth.attitude).max() < 1e-4


@pytest.mark.parametrize(("period", "expected"), [(0.1, 201), (0.0, 401), (1.0, 21), (-1.0, 0), (0.03, 667)])
def test_output_comes_at_multiples_of_the_period(period, expected):
    motion = car_drive(20.0, seed=9, standing=1.0)
    log = gnss_fixes(motion, 1.0, (1.0, 1.0, 1.0), None)
    options = FilterSettings(output_period=period)
    start = start_at(motion, 0.0, *SD)
    filter_ = run_filter(start, MEMS, [GnssPosition(log)], perfect_increments(motion, 20.0), options)
    time = filter_.record.trajectory().time
    assert time.size == expected
    step = period or 0.05
    np.testing.assert_allclose(time, step * np.arange(expected), atol=1e-9)


def test_output_begins_at_the_first_multiple_after_the_start():
    motion = car_drive(20.0, seed=9, standing=1.0)
    start = start_at(motion, 5.05, *SD)
    filter_ = run_filter(start, MEMS, [], cut(perfect_increments(motion, 20.0), 101))
    np.testing.assert_allclose(filter_.record.trajectory().time, 5.1 + 0.1 * np.arange(150), atol=1e-9)


@FRAMES
def test_a_start_is_taken_over(ecef):
    motion = car_drive(10.0, seed=1)
    start = start_at(motion, 2.0, *SD)
    bias, sd = np.array([1e-4, 2e-4, 3e-4]), np.array([1e-6, 2e-6, 3e-6])
    start = Start(2.0, start.nav, start.P, {"gyro_bias": (bias, sd), "no_such_state": (bias, sd)})
    filter_ = ErrorStateFilter(start, MEMS, [], FilterSettings(ecef=ecef))
    where = filter_.layout.slice("gyro_bias")
    assert np.array_equal(filter_.nav_state().state("gyro_bias"), bias)
    np.testing.assert_allclose(np.diagonal(filter_.P)[where], sd**2)
    assert np.abs(error(nav_at(motion, 2.0, ecef), filter_.nav, ecef)).max() < 1e-8
    row = filter_.record.trajectory()
    np.testing.assert_allclose(row.sd_attitude[0], SD[2], rtol=1e-9)
    np.testing.assert_allclose(row.sd_position[0], SD[0], rtol=1e-9)


class Scale(AidingSensor):
    """A speedometer whose scale factor is a state of its own."""

    name = "speed"
    states = (Block("scale", 1, 0.1),)

    def __init__(self, motion, scale):
        self.times = np.arange(0.5, motion.end)
        self.speed = scale * np.linalg.norm(motion.v_e(self.times), axis=1)

    def value(self, k):
        return np.array([self.speed[k]])

    def predict(self, nav, k):
        return np.linalg.norm(nav.v_n, keepdims=True) * (1.0 + nav.state("speed.scale"))

    def noise(self, k):
        return 0.02


@pytest.mark.parametrize("open_loop", [False, True], ids=["closed", "open"])
def test_a_sensor_of_ones_own_has_its_states_estimated(open_loop):
    motion = figure_eight_flight(60.0, straight=5.0)
    log = gnss_fixes(motion, 1.0, (1.0, 1.0, 2.0), (0.05, 0.05, 0.1), rng=np.random.default_rng(0))
    start = start_at(motion, 0.0, *SMALL_SD)
    sensors = [GnssPosition(log), GnssVelocity(log), Scale(motion, 1.05)]
    options = FilterSettings(open_loop=open_loop)
    filter_ = run_filter(start, NAVIGATION, sensors, perfect_increments(motion, 100.0), options)
    at = filter_.layout.offset("speed.scale")
    sd = deviations(filter_)[at]
    assert sd < 1e-3
    assert abs(filter_.nav_state().state("speed.scale")[0] - 0.05) < 3.0 * sd
    assert filter_.record.states[-1][0, at - 9] == filter_.nav_state().state("speed.scale")[0]
    assert filter_.record.states[-1][1, at - 9] == pytest.approx(sd, rel=0.01)


def test_two_sensors_of_one_name_are_refused():
    log = gnss_fixes(static(10.0), 1.0, (1.0, 1.0, 1.0), None)
    with pytest.raises(ConfigError, match="different names"):
        ErrorStateFilter(start_at(static(10.0), 0.0, *SD), MEMS, [GnssPosition(log), GnssPosition(log)])


class Broken(AidingSensor):
    """Measures nothing known, with a noise that is no noise."""

    name = "broken"
    times = np.array([1.0])

    def linearize(self, nav, k):
        return np.array([0.0]), np.zeros((1, nav.layout.size)), np.array([[0.0]])


def test_a_measurement_without_noise_or_sense_is_named():
    motion = static(10.0)
    with pytest.raises(FilterError, match=r"broken measurement 0 at 1\.000 s"):
        run_filter(start_at(motion, 0.0, *SD), MEMS, [Broken()], perfect_increments(motion, 10.0))


def test_increments_that_are_not_numbers_are_noticed_at_the_next_fix():
    motion = static(10.0)
    increments = perfect_increments(motion, 10.0)
    increments.inc_v_b[35, 1] = np.nan
    log = gnss_fixes(motion, 1.0, (1.0, 1.0, 1.0), None)
    with pytest.raises(FilterError, match=r"4\.000 s"):
        run_filter(start_at(motion, 0.0, *SD), MEMS, [GnssPosition(log)], increments)


def test_north_and_east_are_refused_at_a_pole():
    motion = car_drive(20.0, seed=6, lat=0.5 * np.pi - 1e-5, standing=1.0)
    log = gnss_fixes(motion, 1.0, (1.0, 1.0, 1.0), None)
    increments = perfect_increments(motion, 20.0)
    start = start_at(motion, 0.0, *SD)
    with pytest.raises(FilterError, match='frame = "ecef"'):
        run_filter(start, MEMS, [GnssPosition(log)], increments)
    filter_ = run_filter(start, MEMS, [GnssPosition(log)], increments, FilterSettings(ecef=True))
    assert np.linalg.norm(filter_.nav[:3] - motion.r_e(20.0)) < 0.1


def test_an_open_loop_that_leaves_the_linear_range_says_so_once():
    logs = simulate(car_drive(120.0, seed=5, standing=2.0), GRADES["consumer"], seed=6)
    start = start_at(logs.motion, 0.0, *SD)
    options = FilterSettings(open_loop=True)
    increments = to_increments(logs.imu)
    sensors = [GnssPosition(logs.gnss), GnssVelocity(logs.gnss)]
    notes = run_filter(start, GRADES["consumer"], sensors, increments, options).record.notes
    assert len([note for note in notes if note.startswith("open loop: at ")]) == 1
    assert 'feedback = "closed"' in "".join(notes)
