"""The filters of 12 and 15 states: what feeding the position error back is, and what it is not."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from navfuse.aiding.base import AidingSensor
from navfuse.aiding.check import check
from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity
from navfuse.core.earth import radii
from navfuse.core.unscented import triangularize
from navfuse.data.logs import GnssLog
from navfuse.data.nav_state import boxminus_navigation
from navfuse.errors import ConfigError
from navfuse.filters.feedback import DriftingPosition, FeedbackFilter, tuning
from navfuse.filters.feedforward import feedforward_filter
from navfuse.filters.kinds import FILTERS
from navfuse.filters.settings import FilterSettings
from navfuse.filters.unscented import UnscentedFilter
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.increments import to_increments
from navfuse.mechanization.sigma_points import covariance_of_root
from navfuse.simulation import car_drive, simulate
from navfuse.smoothers.rts import smooth
from reference.engine_runs import MEMS, assert_same_record, cut, perfect_increments, start_at

FRAMES = pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])
LEVER = np.array([0.8, -0.5, -1.4])
WALK = 0.2
SD = (np.array([1.0, 1.0, 2.0]), np.full(3, 0.05), np.radians([0.5, 0.5, 2.0]))


class NineStates(UnscentedFilter):
    """Wanders in position as fast as the position error of a feedback filter, and gets the noise of that at the fix."""

    def __init__(self, *arguments):
        self.noise_until = None
        super().__init__(*arguments)

    def _use(self, sensor, k, limit):
        since = self.time - (0.0 if self.noise_until is None else self.noise_until)
        self.noise_until = self.time

        columns = np.zeros((9, 12))
        columns[:, :9] = self.root
        columns[:3, 9:] = WALK * np.sqrt(since) * np.eye(3)
        triangularize(columns, 12, self.root)
        covariance_of_root(self._acc, self.P)
        return super()._use(sensor, k, limit)


@pytest.fixture(scope="module")
def drive():
    logs = simulate(car_drive(60.0, seed=7, standing=2.0), MEMS, seed=8, lever_arm_b=LEVER)
    start = start_at(logs.motion, 0.0, *SD, np.random.default_rng(2))
    return logs, start, to_increments(logs.imu)


def both(drive, ecef, model=MEMS):
    logs, start, increments = drive
    settings = FilterSettings(ecef=ecef, checkpoints=True, gate_probability=1.0)
    position = GnssPosition(logs.gnss, LEVER)
    fed = FeedbackFilter(start, model, [position, GnssVelocity(logs.gnss, LEVER)], settings, WALK)
    nine = NineStates(start, tuning(model, position)[0], [position], settings)
    for filter_ in (fed, nine):
        filter_.feed(increments)
    return fed, nine


@FRAMES
def certain_drive(drive):
    """The same drive with an ideal sensor and next to nothing uncertain but the fixes."""
    logs = drive[0]
    start = start_at(logs.motion, 0.0, *(1e-3 * sd for sd in SD))
    return logs, start, perfect_increments(logs.motion, 100.0)


@FRAMES
@pytest.mark.parametrize(("certain", "close"), [(False, 5e-3), (True, 1e-6)], ids=["drive", "certain"])
def test_feeding_back_is_a_position_that_wanders(drive, ecef, certain, close):
    """The same filter as one of nine states with that process noise, and so is its smoother.

    The weights of sigma points depend on the number of states in the second order, which goes with the square of what
    is uncertain.
    """
    run = certain_drive(drive) if certain else drive
    fed, nine = both(run, ecef, ImuErrorModel(1e-6, 1e-4) if certain else MEMS)
    sd, d = np.sqrt(np.diagonal(nine.P)), np.empty(9)
    boxminus_navigation(fed.nav, nine.nav, ecef, d)
    assert np.abs(d / sd).max() < close
    assert np.abs((fed.P[:9, :9] - nine.P) / np.outer(sd, sd)).max() < close
    assert not fed.P[9:].any()
    assert not fed.s.any()
    a, b = (smooth(filter_, run[2]) for filter_ in (fed, nine))
    sd = b.trajectory.sd_position, b.trajectory.sd_attitude
    assert np.abs((a.trajectory.height - b.trajectory.height) / sd[0][:, 2]).max() < 3 * close
    assert np.abs((a.trajectory.attitude - b.trajectory.attitude) / sd[1]).max() < 10 * close
    np.testing.assert_allclose(a.trajectory.sd_position, sd[0], rtol=3 * close)


def test_feeding_back_is_exact_where_all_is_linear():
    """A point on a line, known by positions and driven by noisy accelerations: with an error that is fed back, and
    with a position that wanders."""
    rng = np.random.default_rng(5)
    q_v, walk, r, T = 0.03, 0.4, 9.0, 0.7
    F = np.array([[1.0, T], [0.0, 1.0]])
    Q = q_v * np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]])
    x, P = np.zeros(2), np.diag([25.0, 1.0])
    X, C = np.zeros(3), np.zeros((3, 3))
    C[:2, :2] = P
    M = np.array([[1.0, 0.0, -1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    for z in rng.normal(0.0, 5.0, 200):
        x, P = F @ x, F @ P @ F.T + Q
        P[0, 0] += walk**2 * T
        K = P[:, 0] / (P[0, 0] + r)
        x, P = x + K * (z - x[0]), P - np.outer(K, P[0])
        X[:2], C[:2] = F @ X[:2], F @ C[:2]
        C[:, :2] = C[:, :2] @ F.T
        C[:2, :2] += Q
        C[2, 2] += walk**2 * T
        H = np.array([1.0, 0.0, -1.0])
        K = C @ H / (H @ C @ H + r)
        X, C = X + K * (z - H @ X), C - np.outer(K, H @ C)
        X, C = M @ X, M @ C @ M.T
        np.testing.assert_allclose(X[:2], x, atol=1e-9)
        np.testing.assert_allclose(C[:2, :2], P, atol=1e-9)


@FRAMES
def test_what_is_fed_back_is_told_in_metres_and_in_radians(drive, ecef):
    fed, _ = both(drive, ecef)
    told = fed.position_errors()
    nav = fed.nav_state()
    assert len(told.time) == sum(i.status == "used" for i in fed.record.innovations) > 50
    M, N = radii(np.sin(nav.lat))
    expected = told.error * [1 / (M + nav.height), 1 / ((N + nav.height) * np.cos(nav.lat)), -1.0]
    np.testing.assert_allclose(told.angles, expected, rtol=1e-4)
    assert 0.02 < np.sqrt(np.mean(told.error**2)) < 1.0
    assert told.time[0] == 0.0
    assert not told.sd[0].any()
    assert np.all((told.sd[1:] > 0.9 * WALK) & (told.sd[1:] < WALK))
    at = fed.layout.slice("gnss_position.error").start - 9
    states = np.array(fed.record.states)
    np.testing.assert_array_equal(states[:, 0, at : at + 3], told.error)
    np.testing.assert_array_equal(states[:, 1, at : at + 3], told.sd)


def test_a_rejected_fix_feeds_nothing_back(drive):
    logs, start, increments = drive
    gnss = logs.gnss
    height = gnss.height.copy()
    height[30] += 500.0
    log = GnssLog(gnss.time, gnss.lat, gnss.lon, height, gnss.sd_position)
    outages = ((10.2, 15.2),)
    fed = FeedbackFilter(start, MEMS, [GnssPosition(log, LEVER, outages)], None, WALK)
    fed.feed(increments)
    told = fed.position_errors()
    assert gnss.time[30] not in told.time
    gap = np.flatnonzero((gnss.time >= 10.2) & (gnss.time < 15.2))
    assert not np.isin(gnss.time[gap], told.time).any()
    after = np.flatnonzero(told.time == gnss.time[gap[-1] + 1])[0]
    assert told.sd[after].min() > 1.5 * told.sd[after - 1].max()


def test_pieces_give_the_same_bits(drive):
    logs, start, increments = drive
    runs = []
    for cuts in ([], [33, 1004, 2000]):
        filter_ = FeedbackFilter(start, MEMS, [GnssPosition(logs.gnss, LEVER)])
        edges = [0, *cuts, len(increments)]
        for first, last in pairwise(edges):
            filter_.feed(cut(increments, first, last))
        runs.append(filter_.record)
    assert_same_record(*runs)


def test_states_and_sensors_are_those_of_the_report(drive):
    logs, start, _ = drive
    sensors = [GnssPosition(logs.gnss, LEVER), GnssVelocity(logs.gnss, LEVER), Speed()]
    twelve = FILTERS["ukf-feedback-12"](start, MEMS, sensors, FilterSettings())
    fifteen = FILTERS["ukf-feedforward-15"](start, MEMS, sensors, FilterSettings())
    assert twelve.layout.names == ("position", "velocity", "attitude", "gnss_position.error")
    assert fifteen.layout.names == ("position", "velocity", "attitude", "gyro_bias", "accel_bias")
    assert (twelve.layout.size, fifteen.layout.size) == (12, 15)
    assert [s.name for s in twelve.sensors] == ["gnss_position"]
    assert [s.name for s in fifteen.sensors] == ["gnss_position", "gnss_velocity"]


class Speed(AidingSensor):
    name, times = "speed", np.array([0.5])


@FRAMES
def test_the_sensor_with_an_error_is_a_good_sensor(drive, ecef):
    logs, start, increments = drive
    filter_ = FeedbackFilter(start, MEMS, [GnssPosition(logs.gnss, LEVER)], FilterSettings(ecef=ecef), WALK)
    filter_.feed(cut(increments, 0, 50))
    nav = filter_.nav_state()
    nav.states[:] = [3.0, -4.0, 5.0]
    sensor = filter_.sensors[0]
    check(sensor, nav)
    assert sensor.gate is None
    plain = GnssPosition(logs.gnss, LEVER)
    np.testing.assert_allclose(
        plain.subtract(sensor.predict(nav, 0), plain.predict(nav, 0)), [-3.0, 4.0, -5.0], atol=1e-5
    )


def test_the_tuning_covers_what_is_not_estimated(drive):
    logs = drive[0]
    position = GnssPosition(logs.gnss, LEVER)
    same, walk = tuning(ImuErrorModel(arw=1e-4, vrw=1e-3), position)
    assert (same.arw, same.vrw, walk) == (1e-4, 1e-3, 0.0)
    model, walk = tuning(ImuErrorModel(accel_bias_sd=0.01), position)
    assert walk == pytest.approx(0.005)
    assert model.vrw**2 == pytest.approx((4.0 * np.sqrt(2.0) / 3.0 * 1e-4) ** 0.8 * 2.0**0.2)
    more, _ = tuning(ImuErrorModel(accel_bias_sd=0.01, gyro_bias_sd=1e-4), position)
    assert more.vrw == model.vrw
    assert more.arw > model.arw > 0.0
    scaled, _ = tuning(ImuErrorModel(accel_scale_sd=0.01 / 9.80665), position)
    assert scaled.vrw == pytest.approx(model.vrw)


def test_a_filter_with_this_tuning_has_the_variance_that_the_tuning_is_made_for():
    """The closed forms behind it, against a Riccati equation solved by iteration."""
    r, b, dt = 9.0, 0.01, 0.02
    q = (4.0 * np.sqrt(2.0) / 3.0 * b**2) ** 0.8 * r**0.2
    F, Q = np.array([[1.0, dt], [0.0, 1.0]]), q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    P, e, noise = np.diag([9.0, 1.0]), np.zeros(2), np.zeros((2, 2))
    for _ in range(20000):
        P = F @ P @ F.T + Q
        K = P[:, 0] / (P[0, 0] + r / dt)
        P = P - np.outer(K, P[0])
        G = np.eye(2) - np.outer(K, [1.0, 0.0])
        e = G @ (F @ e + b * np.array([dt**2 / 2, dt]))
        noise = G @ F @ noise @ F.T @ G.T + np.outer(K, K) * r / dt
    assert P[1, 1] == pytest.approx(np.sqrt(2.0) * r**0.25 * q**0.75, rel=0.01)
    assert noise[1, 1] + e[1] ** 2 == pytest.approx(P[1, 1], rel=0.01)


def test_too_few_fixes_count_as_one_a_second():
    log = GnssLog(np.array([1.0]), *np.zeros((3, 1)), np.full((1, 3), 2.0))
    _, walk = tuning(ImuErrorModel(accel_bias_sd=0.01), GnssPosition(log))
    assert walk == pytest.approx(0.005)
    nothing = GnssPosition(GnssLog(np.empty(0), *np.empty((3, 0)), np.empty((0, 3))))
    assert tuning(ImuErrorModel(accel_bias_sd=0.01), nothing)[1] == pytest.approx(0.005)


@pytest.mark.parametrize("name", ["ukf-feedback-12", "ukf-feedforward-15"])
def test_without_a_position_sensor_there_is_no_filter(drive, name):
    logs, start, _ = drive
    with pytest.raises(ConfigError, match=f'"{name}" needs gnss_position; the sensors given: gnss_velocity'):
        FILTERS[name](start, MEMS, [GnssVelocity(logs.gnss)], FilterSettings())
    with pytest.raises(ConfigError, match="the sensors given: none"):
        FILTERS[name](start, MEMS, [], FilterSettings())


@pytest.mark.parametrize("walk", [-0.1, np.nan, np.inf])
def test_a_walk_that_is_none_is_refused(drive, walk):
    logs, start, _ = drive
    with pytest.raises(ConfigError, match="the walk of the position error must be finite"):
        FeedbackFilter(start, MEMS, [GnssPosition(logs.gnss)], None, walk)


@pytest.mark.parametrize("sensor", ["gyro", "accel"])
def test_a_sensor_without_bias_is_no_full_state(drive, sensor):
    logs, start, _ = drive
    with pytest.raises(ConfigError, match=f"but {sensor}_bias_sd is 0"):
        feedforward_filter(start, MEMS.replace(**{f"{sensor}_bias_sd": 0.0}), [GnssPosition(logs.gnss)])


def test_the_accelerometer_that_points_down_may_be_biased_by_its_scale_factor(drive):
    logs, start, _ = drive
    filter_ = feedforward_filter(start, MEMS, [GnssPosition(logs.gnss)])
    bias, scale = MEMS.axes("accel_bias_sd"), MEMS.axes("accel_scale_sd")
    expected = [bias[0], bias[1], np.hypot(bias[2], 9.80665 * scale[2])]
    np.testing.assert_allclose(np.sqrt(np.diagonal(filter_.P)[filter_.layout.slice("accel_bias")]), expected)


def test_a_drifting_position_tells_what_the_sensor_inside_tells(drive):
    logs = drive[0]
    inside = GnssPosition(logs.gnss, LEVER, ((3.0, 4.0),), gate=0.9)
    sensor = DriftingPosition(inside, 0.1)
    assert sensor.gate == 0.9
    assert np.array_equal(sensor.times, inside.times)
    withheld = [sensor.withheld(k) for k in range(6)]
    assert withheld == [inside.withheld(k) for k in range(6)]
    assert any(withheld)
    assert sensor.log_row(2) == inside.log_row(2)
