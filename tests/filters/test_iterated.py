"""The iterated filter against the extended one where nothing is nonlinear, and against nonlinear least squares."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from navfuse.aiding.base import AidingSensor
from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity
from navfuse.data.logs import GnssLog
from navfuse.data.nav_state import NavState, boxminus_navigation
from navfuse.data.start import Start
from navfuse.errors import ConfigError
from navfuse.filters.ekf import ErrorStateFilter
from navfuse.filters.event import parts
from navfuse.filters.iterated import IteratedFilter, error_derivative
from navfuse.filters.kinds import FILTERS
from navfuse.filters.settings import FilterSettings
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.increments import ImuIncrements, to_increments
from navfuse.simulation import car_drive, simulate
from navfuse.smoothers.rts import smooth
from reference.engine_runs import MEMS, assert_same_record, run_filter, start_at

FRAMES = pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])
BIASED = ImuErrorModel(arw=1e-4, vrw=1e-3, gyro_bias_sd=1e-4, accel_bias_sd=1e-2)


class Level(AidingSensor):
    """Velocity in the frame of the filter: linear in the errors, whatever they are."""

    name = "level"

    def __init__(self, times, values):
        self.times, self.values = np.asarray(times, dtype=float), values

    def value(self, k):
        return self.values[k]

    def predict(self, nav, k):
        return nav.array[3:6]

    def noise(self, k):
        return 0.1

    def jacobian(self, nav, k):
        H = np.zeros((3, nav.layout.size))
        H[:, 3:6] = np.eye(3)
        return H


class Ranges(AidingSensor):
    """Distances from the end of a lever arm to beacons."""

    name = "ranges"

    def __init__(self, beacons, lever, distances, sd):
        self.times, self.beacons, self.lever = np.array([0.5]), np.asarray(beacons), np.asarray(lever)
        self.distances, self.sd = np.asarray(distances), sd

    def value(self, k):
        return self.distances

    def predict(self, nav, k):
        return np.linalg.norm(nav.r_e + nav.C_eb @ self.lever - self.beacons, axis=1)

    def noise(self, k):
        return self.sd

    def jacobian(self, nav, k):
        lever = nav.C_eb @ self.lever
        to = nav.r_e + lever - self.beacons
        to = to @ (nav.C_eb @ nav.C_nb.T @ nav.C_nm) / np.linalg.norm(to, axis=1)[:, None]
        H = np.zeros((len(self.beacons), nav.layout.size))
        H[:, :3] = to
        H[:, 6:9] = np.cross((nav.C_nm.T @ nav.C_nb) @ self.lever, to)
        return H


def hardly_moves(seconds=1.0):
    time = np.linspace(0.0, seconds, round(seconds * 10) + 1)
    return ImuIncrements(time, np.zeros((time.size - 1, 3)), np.full((time.size - 1, 3), (0.0, 0.0, -0.981)))


def start_of(sd_position, sd_velocity, sd_attitude, heading=0.7):
    return Start.from_parts(0.0, (0.8, 0.2, 300.0), (1.0, 2.0, 0.1), (0.02, -0.03, heading), sd_position, sd_velocity,
                            sd_attitude)  # fmt: skip


def fed_to(time, filter_):
    increments = hardly_moves(time)
    filter_.feed(increments)
    return filter_


def most_probable(filter_, sensor):
    """Error that minimizes prior and measurement together: Levenberg and Marquardt, then Gauss and Newton.

    The first finds it from anywhere, but stops where the cost no longer changes in its last digit.
    """
    nav, n = filter_.nav_state(), filter_.layout.size
    root, sd = np.linalg.cholesky(filter_.P), np.broadcast_to(sensor.noise(0), sensor.value(0).shape)

    def residual(u):
        there = nav.boxplus(root @ u)
        return np.concatenate([u, sensor.subtract(sensor.value(0), sensor.predict(there, 0)) / sd])

    def slopes(u):
        near, far = (
            np.stack([(residual(u + h) - residual(u - h)) / (2.0 * step) for h in step * np.eye(n)], axis=1)
            for step in (5e-3, 1e-2)
        )
        return (4.0 * near - far) / 3.0

    found = least_squares(residual, np.zeros(n), slopes, method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    u = found.x
    for _ in range(30):
        u = u - np.linalg.lstsq(slopes(u), residual(u), rcond=None)[0]
    assert np.abs(u - found.x).max() < 1e-4
    return nav.boxplus(root @ u)


def apart(filter_, nav):
    """Difference of the filter from a state, in standard deviations of the filter."""
    d = np.empty(9)
    boxminus_navigation(nav.array, filter_.nav, nav.ecef, d)
    d = np.concatenate([d, nav.states - filter_.s])
    return np.abs(d) / np.sqrt(np.diagonal(filter_.P))


def near_beacons(ecef, seed=3):
    """Before the measurement, and a sensor with three beacons at some metres, off by what the start is uncertain."""
    start = start_of([4.0, 4.0, 2.0], [0.5] * 3, np.radians([1.0, 1.0, 5.0]))
    settings = FilterSettings(ecef=ecef, gate_probability=1.0, output_period=-1.0, iterations=50)
    before = fed_to(0.5, ErrorStateFilter(start, BIASED, [], settings))
    truth = before.nav_state().boxplus(np.linalg.cholesky(before.P) @ np.random.default_rng(seed).standard_normal(15))
    C = truth.C_en
    beacons = [truth.r_e + C @ np.array(d) for d in ((9.0, 3.0, -2.0), (-4.0, 8.0, 1.0), (2.0, -7.0, -6.0))]
    lever = np.array([1.0, 0.5, -1.5])
    sensor = Ranges(beacons, lever, np.linalg.norm(truth.r_e + truth.C_eb @ lever - beacons, axis=1), 0.05)
    return start, settings, before, sensor


@FRAMES
def test_a_linear_sensor_is_used_as_by_the_extended_filter_to_the_last_bit(ecef):
    start = start_of([1.0] * 3, [0.5] * 3, np.radians([1.0, 1.0, 5.0]))
    settings = FilterSettings(ecef=ecef, checkpoints=True)
    times, kinds = [0.25, 0.5, 0.9], (ErrorStateFilter, IteratedFilter)
    v = fed_to(0.5, ErrorStateFilter(start, BIASED, [], settings)).nav[3:6]
    values = v + np.random.default_rng(1).normal(0.0, 0.1, (3, 3))
    runs = [kind(start, BIASED, [Level(times, values)], settings) for kind in kinds]
    for run in runs:
        run.feed(hardly_moves())
    assert_same_record(runs[0].record, runs[1].record)
    assert np.array_equal(runs[0].P, runs[1].P)
    assert [i.status for i in runs[1].record.innovations] == ["used"] * 3


@FRAMES
@pytest.mark.parametrize("seed", range(4))
def test_ranges_to_near_beacons_give_the_most_probable_state(ecef, seed):
    start, settings, before, sensor = near_beacons(ecef, seed)
    best = most_probable(before, sensor)
    iterated = fed_to(0.5, IteratedFilter(start, BIASED, [sensor], settings))
    assert apart(iterated, best).max() < 1e-6
    extended = fed_to(0.5, ErrorStateFilter(start, BIASED, [sensor], settings))
    assert apart(extended, best).max() > 0.3


@FRAMES
def test_a_long_lever_arm_gives_a_heading_that_is_40_deg_off(ecef):
    """The extended filter shifts the antenna along a tangent where it goes around an arc."""
    off, lever = np.radians(40.0), np.array([30.0, 0.0, 0.0])
    start = start_of([0.05] * 3, [0.05] * 3, [np.radians(0.5), np.radians(0.5), off])
    settings = FilterSettings(ecef=ecef, gate_probability=1.0, output_period=-1.0, iterations=50)
    before = fed_to(0.5, ErrorStateFilter(start, BIASED, [], settings))
    turned = np.zeros(15)
    turned[6:9] = off * (before.nav_state().C_nm.T @ [0.0, 0.0, 1.0])
    truth = before.nav_state().boxplus(turned)
    empty = GnssPosition(GnssLog(np.array([0.5]), *np.zeros((3, 1)), np.ones((1, 3))), lever).predict(truth, 0)
    log = GnssLog(np.array([0.5]), *empty[:, None], np.full((1, 3), 0.02))
    sensor = GnssPosition(log, lever)
    best = most_probable(before, sensor)
    filters = [fed_to(0.5, kind(start, BIASED, [sensor], settings)) for kind in (IteratedFilter, ErrorStateFilter)]
    assert apart(filters[0], best).max() < 1e-6
    d = np.empty(9)
    heading = []
    for filter_ in filters:
        boxminus_navigation(truth.array, filter_.nav, ecef, d)
        heading.append(np.degrees(np.linalg.norm(d[6:])))
    sd = np.degrees(np.sqrt(np.diagonal(filters[0].P)[6:9]).max())
    assert heading[0] < 3.0 * sd
    assert heading[1] > 3.0
    assert np.degrees(np.sqrt(np.diagonal(filters[1].P)[6:9]).max()) < heading[1]


def test_the_first_linearization_is_what_the_gate_judges():
    start, settings, before, sensor = near_beacons(False)
    z, H, R = sensor.linearize(before.nav_state(), 0)
    nis = float(z @ np.linalg.solve(H @ before.P @ H.T + R, z))
    iterated = fed_to(0.5, IteratedFilter(start, BIASED, [sensor], settings))
    assert iterated.record.innovations[0].nis == pytest.approx(nis, rel=1e-9)
    sensor.gate = 0.5
    sensor.distances = sensor.distances + 30.0
    shut = fed_to(0.5, IteratedFilter(start, BIASED, [sensor], FilterSettings(gate_probability=1.0)))
    assert shut.record.innovations[0].status == "rejected"
    assert np.array_equal(shut.nav, fed_to(0.5, ErrorStateFilter(start, BIASED, [], FilterSettings())).nav)


def test_one_linearization_is_the_extended_filter():
    start, _, _, sensor = near_beacons(False)
    settings = FilterSettings(gate_probability=1.0, iterations=1)
    one, other = (fed_to(0.5, k(start, BIASED, [sensor], settings)) for k in (IteratedFilter, ErrorStateFilter))
    assert np.array_equal(one.nav, other.nav)
    assert one.record.notes == []


def test_what_has_not_settled_is_said_once():
    start, _, _, sensor = near_beacons(False)
    settings = FilterSettings(gate_probability=1.0, iterations=2)
    run = fed_to(0.5, IteratedFilter(start, BIASED, [sensor], settings))
    assert len(run.record.notes) == 1
    assert "has not settled after 2 linearizations" in run.record.notes[0]


@FRAMES
def test_derivative_of_the_error_against_differences(ecef):
    layout = ErrorStateFilter(start_of([1.0] * 3, [1.0] * 3, [0.1] * 3), ImuErrorModel(), []).layout
    nav = start_of([1.0] * 3, [1.0] * 3, [0.1] * 3).nav
    before = NavState(0.0, nav, False, np.empty(0), layout, np.zeros(3), np.zeros(3))
    if ecef:
        before = NavState(0.0, np.concatenate([before.r_e, before.v_e, _quaternion(before)]), True, np.empty(0), layout,
                          np.zeros(3), np.zeros(3))  # fmt: skip
    e = np.array([3e4, -2e4, 500.0, 3.0, -2.0, 1.0, 0.4, -0.9, 1.3])
    there = before.boxplus(e)
    found = error_derivative(before, there, e)
    for i, step in enumerate([1.0] * 3 + [1e-2] * 3 + [1e-5] * 3):
        d = np.zeros(9)
        d[i] = step
        ahead, behind = np.empty(9), np.empty(9)
        boxminus_navigation(before.boxplus(e + d).array, there.array, ecef, ahead)
        boxminus_navigation(before.boxplus(e - d).array, there.array, ecef, behind)
        np.testing.assert_allclose((ahead - behind) / (2 * step), found[:, i], atol=2e-5)


def _quaternion(nav):
    from navfuse.data.nav_state import to_ecef

    return to_ecef(nav.array)[6:]


def test_a_drive_and_its_smoother_agree_with_the_extended_filter():
    """In normal use there is little to iterate, and what a smoother gets is in the coordinates that it expects."""
    logs = simulate(car_drive(60.0, seed=7, standing=2.0), MEMS, seed=8)
    start = start_at(
        logs.motion, 0.0, [1.0, 1.0, 2.0], [0.05] * 3, np.radians([0.5, 0.5, 2.0]), np.random.default_rng(2)
    )
    increments, sensors = to_increments(logs.imu), [GnssPosition(logs.gnss), GnssVelocity(logs.gnss)]
    settings = FilterSettings(checkpoints=True)
    extended = run_filter(start, MEMS, sensors, increments, settings)
    iterated = FILTERS["iekf"](start, MEMS, sensors, settings)
    iterated.feed(increments)
    d = np.empty(9)
    boxminus_navigation(iterated.nav, extended.nav, False, d)
    assert np.abs(d / np.sqrt(np.diagonal(extended.P)[:9])).max() < 0.02
    a, b = smooth(extended, increments).trajectory, smooth(iterated, increments).trajectory
    assert np.abs(a.height - b.height).max() < 0.02
    assert np.abs(a.attitude - b.attitude).max() < np.radians(0.01)


def test_an_open_loop_is_refused():
    with pytest.raises(ConfigError, match='feedback = "closed"'):
        IteratedFilter(start_of([1.0] * 3, [1.0] * 3, [0.1] * 3), MEMS, [], FilterSettings(open_loop=True))


@pytest.mark.parametrize("kind", ["ekf", "iekf", "ukf"])
def test_after_a_reset_a_smoother_gets_the_numbers_of_the_update(kind):
    """The record tells by what the measurement was judged; what was used has to fit together."""
    start, _, _, sensor = near_beacons(False)
    sensor.distances = sensor.distances + 40.0
    settings = FilterSettings(gate_probability=0.99, reset_count=1, reset_s=0.0, checkpoints=True, iterations=30)
    run = fed_to(0.5, FILTERS[kind](start, BIASED, [sensor], settings))
    update = run.record.innovations[0]
    assert update.status == "reset"
    z, _, _, _, K, dx = parts(update.numbers, 3, 15)
    np.testing.assert_allclose(K @ z, dx, rtol=1e-6, atol=1e-9)
