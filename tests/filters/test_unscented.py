"""The unscented filter: what it shares with the extended one, what it refuses, and that it goes on to the last bit."""

from __future__ import annotations

import copy
import io
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfuse.aiding.base import AidingSensor
from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity
from navfuse.data.layout import Block
from navfuse.data.nav_state import boxplus_navigation
from navfuse.data.start import Start
from navfuse.errors import ConfigError, FilterError
from navfuse.filters.ekf import ErrorStateFilter, FilterSettings
from navfuse.filters.unscented import WIDEST, UnscentedFilter, cubature_filter
from navfuse.imu.grades import grade
from navfuse.imu.increments import to_increments
from navfuse.mechanization.error_dynamics import ACC_TIME
from navfuse.simulation import car_drive, simulate, static
from reference.engine_runs import MEMS, assert_same_record, cut, nav_at, start_at
from reference.navigation_algebra import error

LEVER = (0.5, -0.3, -1.2)
LOGS = simulate(
    car_drive(40.0, seed=2, standing=1.0),
    MEMS,
    seed=1,
    imu_rate=50.0,
    gnss_rate=3.0,
    gnss_offset=0.107,
    lever_arm_b=LEVER,
)
INCREMENTS = to_increments(LOGS.imu)
SD = ([1.0, 1.0, 2.0], [0.05] * 3)
START = start_at(LOGS.motion, 0.0, *SD, np.radians([0.5, 0.5, 1.0]))
UNKNOWN = start_at(LOGS.motion, 0.0, *SD, np.radians([0.5, 0.5, 60.0]))
CHECKED = FilterSettings(checkpoints=True)
FRAMES = pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])


def sensors(**arguments):
    return [GnssPosition(LOGS.gnss, LEVER, **arguments), GnssVelocity(LOGS.gnss, LEVER, **arguments)]


def run(kind=UnscentedFilter, options=None, start=START, aiding=None, increments=INCREMENTS, cuts=()):
    filter_ = kind(start, MEMS, sensors() if aiding is None else aiding, options)
    edges = [0, *cuts, len(increments)]
    for first, last in zip(edges[:-1], edges[1:], strict=True):  # noqa: RUF007 - edges may repeat
        filter_.feed(cut(increments, first, last))
    return filter_


@pytest.mark.parametrize("kind", [UnscentedFilter, cubature_filter])
@FRAMES
def test_small_errors_give_the_extended_filter(kind, ecef):
    """Over minutes: the state within a small share of its deviation, covariance and innovations within a hundredth."""
    motion = car_drive(240.0, seed=8, standing=5.0)
    logs = simulate(motion, MEMS, seed=4, imu_rate=50.0)
    increments = to_increments(logs.imu)
    start = start_at(motion, 0.0, [0.5, 0.5, 1.0], [0.02] * 3, np.radians([0.1, 0.1, 0.2]), np.random.default_rng(3))
    options = FilterSettings(ecef=ecef)
    aiding = [GnssPosition(logs.gnss), GnssVelocity(logs.gnss)]
    one, other = (
        run(ErrorStateFilter, options, start, aiding, increments),
        run(kind, options, start, aiding, increments),
    )
    sd = np.sqrt(np.diagonal(one.P))
    assert np.all(np.abs(np.sqrt(np.diagonal(other.P)) / sd - 1.0) < 0.01)
    assert np.all(np.abs(error(other.nav, one.nav, ecef)) < 0.02 * sd[:9])
    assert np.all(np.abs(other.s - one.s) < 0.02 * sd[9:])
    pairs = list(zip(one.record.innovations, other.record.innovations, strict=True))
    assert all(a.status == b.status == "used" for a, b in pairs)
    nis = np.array([[a.nis, b.nis] for a, b in pairs])
    assert nis[:, 1].sum() == pytest.approx(nis[:, 0].sum(), rel=0.01)
    assert np.max(np.abs(nis[:, 1] - nis[:, 0]) / (1.0 + nis[:, 0])) < 0.05


class EarthFixed(AidingSensor):
    """A position in e, which is linear in the error of an ECEF state."""

    name = "earth_fixed"

    def __init__(self, times, values, R):
        self.times, self.values, self.R = times, values, R

    def value(self, k):
        return self.values[k]

    def predict(self, nav, k):
        return nav.array[:3].copy()

    def noise(self, k):
        return self.R


def test_a_linear_measurement_is_used_as_by_the_kalman_filter_to_ten_digits():
    """From the same P; corrections of the attitude are made tiny, so that turning what is left does nothing."""
    filter_ = UnscentedFilter(
        START, MEMS, [EarthFixed(np.array([0.0]), np.zeros((1, 3)), np.eye(3))], FilterSettings(ecef=True)
    )
    n = filter_.layout.size
    rng = np.random.default_rng(1)
    A = rng.normal(size=(n, n)) * np.sqrt(np.diagonal(filter_.P))[:, None]
    A[6:9] = 1e-9 * rng.normal(size=(3, n))
    filter_.P = A @ A.T
    P, nav, s = filter_.P.copy(), filter_.nav.copy(), filter_.s.copy()
    filter_.sensors[0].values = nav[None, :3] + rng.normal(size=(1, 3))
    nis, d, _ = filter_._use(filter_.sensors[0], 0, lambda _: np.inf)
    H = np.eye(3, n)
    S = P[:3, :3] + np.eye(3)
    K = np.linalg.solve(S, H @ P).T
    z = filter_.sensors[0].values[0] - nav[:3]
    dx = K @ z
    sd = np.sqrt(np.diagonal(P))
    assert d == 3
    assert nis == pytest.approx(z @ np.linalg.solve(S, z), rel=1e-9)
    assert np.max(np.abs(filter_.P - (P - K @ S @ K.T)) / np.outer(sd, sd)) < 1e-10
    # A metre on top of 6.4e6 m is known to nine digits.
    assert np.max(np.abs(filter_.nav[:3] - nav[:3] - dx[:3]) / sd[:3]) < 3e-9
    assert np.max(np.abs(filter_.nav[3:6] - nav[3:6] - dx[3:6]) / sd[3:6]) < 1e-10
    assert np.max(np.abs(filter_.s - s - dx[9:]) / sd[9:]) < 1e-10


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (FilterSettings(open_loop=True), 'feedback = "closed"'),
        (FilterSettings(alpha=0.0), "alpha = 0"),
        (FilterSettings(alpha=float("nan")), "alpha = nan"),
        (FilterSettings(beta=-1.0), "beta"),
        (FilterSettings(kappa=-21.0), "greater than -21"),
        (FilterSettings(alpha=1.0, beta=0.0, kappa=-1.0), "positive definite"),
        (FilterSettings(iterations=0), "iterations = 0"),
    ],
)
def test_settings_out_of_range_are_refused(options, told):
    with pytest.raises(ConfigError, match=told):
        UnscentedFilter(START, MEMS, sensors(), options)


def test_points_beyond_half_a_turn_are_refused_at_the_start():
    with pytest.raises(ConfigError, match="reach 275 deg .* 60 deg: past half a turn"):
        cubature_filter(UNKNOWN, MEMS, sensors())
    with pytest.raises(ConfigError, match="alpha below 0.655"):
        UnscentedFilter(UNKNOWN, MEMS, sensors(), FilterSettings(alpha=1.0))
    UnscentedFilter(UNKNOWN, MEMS, sensors(), FilterSettings(alpha=0.65))


@FRAMES
def test_a_heading_of_which_nothing_is_known_is_taken_back_to_where_points_do_not_come_round(ecef):
    start = start_at(LOGS.motion, 0.0, *SD, [0.01, 0.01, np.pi / np.sqrt(3.0)])
    filter_ = UnscentedFilter(start, MEMS, sensors(), FilterSettings(ecef=ecef))
    widest = np.sqrt(np.linalg.eigvalsh(filter_.P[6:9, 6:9])[-1])
    assert np.sqrt(3.0) * widest == pytest.approx(WIDEST, rel=1e-6)
    assert np.sqrt(np.linalg.eigvalsh(filter_.P[6:9, 6:9])[:2]) == pytest.approx([0.01, 0.01], rel=1e-3)
    np.testing.assert_allclose(filter_.P, filter_.root @ filter_.root.T, atol=1e-12)
    filter_.feed(INCREMENTS)
    assert np.isfinite(filter_.P).all()


def test_a_start_covariance_that_is_none_is_refused():
    P = START.P.copy()
    P[0, 1] = P[1, 0] = 5.0
    with pytest.raises(ConfigError, match="not positive semi-definite"):
        UnscentedFilter(Start(START.time, START.nav, P), MEMS, sensors())


class Answers(AidingSensor):
    """Speed of the vehicle, spoilt in one way or another."""

    name = "speed"

    def __init__(self, way="", times=(2.0, 3.0)):
        self.way, self.times, self.first = way, np.array(times), {}

    def value(self, k):
        return np.array([np.nan if self.way == "value" else 0.0])

    def predict(self, nav, k):
        speed = np.linalg.norm(nav.v_n)
        if self.way == "estimate" and k == 1:
            return np.array([np.nan])
        if self.way == "point" and k == 1 and speed != self.first.setdefault(k, speed):
            return np.array([np.inf])
        return np.array([speed])

    def subtract(self, measured, predicted):
        return np.array([np.nan]) if self.way == "subtract" else measured - predicted

    def noise(self, k):
        return {
            "long": np.ones(2),
            "wide": np.eye(2),
            "negative": np.array([[-1.0]]),
            "nan": np.array([np.nan]),
            "none": np.array([0.0]),
        }.get(self.way, np.array([1.0]))


@pytest.mark.parametrize(
    ("way", "told"),
    [
        ("estimate", r"speed measurement 1 at 3.000 s: predict gives \[nan\] at the estimate"),
        ("point", r"speed measurement 1 at 3.000 s: predict gives \[inf\] at a sigma point, 1.73 standard deviations"),
        ("subtract", r"speed measurement 0 at 2.000 s: subtract gives no finite difference"),
        ("value", r"speed measurement 0 at 2.000 s cannot be used"),
        ("long", r"speed measurement 0 at 2.000 s: its noise must be 1 standard deviations .* got \[1.0, 1.0\]"),
        ("wide", r"speed measurement 0 at 2.000 s: its noise must be"),
        ("negative", r"speed measurement 0 at 2.000 s: its noise must be .* got \[\[-1.0\]\]"),
        ("nan", r"speed measurement 0 at 2.000 s: its noise must be .* got \[nan\]"),
    ],
)
@pytest.mark.parametrize("withheld", [False, True])
def test_a_sensor_that_answers_nonsense_is_named_with_its_measurement_and_time(way, told, withheld, monkeypatch):
    monkeypatch.setattr(Answers, "withheld", lambda self, k: withheld)
    with pytest.raises(FilterError, match=told):
        run(aiding=[Answers(way)])


def test_increments_that_are_not_numbers_are_noticed_at_the_next_fix():
    increments = copy.deepcopy(INCREMENTS)
    increments.inc_v_b[300] = np.nan
    with pytest.raises(FilterError, match="no longer finite at 6.107 s"):
        run(increments=increments)


def test_a_measurement_without_noise_is_used_as_long_as_something_is_unknown():
    filter_ = run(aiding=[Answers("none")], options=FilterSettings(gate_probability=1.0))
    assert [i.status for i in filter_.record.innovations] == ["used", "used"]
    assert np.isfinite(filter_.P).all()


def test_a_late_measurement_is_recorded_and_changes_nothing():
    late = Answers()
    filter_ = UnscentedFilter(START, MEMS, [*sensors(), late])
    late.times = np.array([7.5, 7.6])
    filter_.feed(cut(INCREMENTS, 0, 400))
    late.times = np.array([7.5, 7.6, 7.7])
    filter_.feed(cut(INCREMENTS, 400))
    found = [i.status for i in filter_.record.innovations if i.source == "speed"]
    assert found == ["used", "used", "late"]
    without = run(aiding=[*sensors(), Answers(times=(7.5, 7.6))], cuts=[400])
    assert np.array_equal(filter_.nav, without.nav)
    assert np.array_equal(filter_.P, without.P)


def test_withheld_measurements_are_recorded_and_change_nothing_but_where_the_points_are_drawn_anew():
    filter_ = run(aiding=sensors(outages=((20.0, 30.0),)))
    inside = [i for i in filter_.record.innovations if 20.0 <= i.time < 30.0]
    assert {i.status for i in inside} == {"withheld"}
    assert all(np.isfinite(i.nis) for i in inside)
    assert all(np.isfinite(i.sd).all() for i in inside)
    trajectory = filter_.record.trajectory()
    sd = trajectory.sd_position[(trajectory.time >= 20.0) & (trajectory.time < 30.0), 0]
    assert np.all(np.diff(sd) > 0.0)
    extended = run(ErrorStateFilter, aiding=sensors(outages=((20.0, 30.0),)))
    for a, b in zip(inside, [i for i in extended.record.innovations if 20.0 <= i.time < 30.0], strict=True):
        np.testing.assert_allclose(a.sd, b.sd, rtol=0.01)


def test_a_filter_that_rejects_everything_comes_round():
    """The covariance is enlarged in root form, sensor states no further than their start."""
    wrong = START.nav.copy()
    wrong[0] += 2e-4
    options = FilterSettings(reset_count=4, reset_s=1.0, checkpoints=True)
    start = Start(START.time, wrong, START.P)
    filter_ = run(options=options, start=start)
    status = [i.status for i in filter_.record.innovations if i.source == "gnss_position"]
    assert status[:4] == ["rejected", "rejected", "rejected", "reset"]
    assert set(status[5:]) == {"used"}
    (note,) = filter_.record.notes
    assert "4 measurements in a row" in note
    assert np.abs(error(nav_at(LOGS.motion, 40.0, False), filter_.nav, False)[:3]).max() < 5.0
    filter_._settle()
    np.testing.assert_allclose(filter_.P, filter_.root @ filter_.root.T, rtol=1e-12, atol=1e-30)
    extended = run(ErrorStateFilter, options, start)
    assert status == [i.status for i in extended.record.innovations if i.source == "gnss_position"]
    np.testing.assert_allclose(np.diagonal(filter_.P), np.diagonal(extended.P), rtol=0.05)


def test_what_a_reset_adds_is_what_the_extended_filter_adds():
    plain, root = run(ErrorStateFilter, increments=cut(INCREMENTS, 0, 300)), run(increments=cut(INCREMENTS, 0, 300))
    root._settle()

    def change(P):
        P[range(21), range(21)] *= 1.0 + np.arange(21)
        P[3, 0] += 0.01
        P[0, 3] += 0.01
        P[0, 0] += 0.1
        P[3, 3] += 0.1

    expected = root.P.copy()
    change(expected)
    root._enlarge(change)
    plain._enlarge(change)
    sd = np.sqrt(np.diagonal(expected))
    assert np.max(np.abs(root.P - expected) / np.outer(sd, sd)) < 1e-12
    assert np.all(np.diagonal(root.root) > 0.0)


@pytest.mark.parametrize("length", [0.5, 3.0, 30.0])
def test_a_gap_is_bridged_and_widens_no_state_but_those_of_the_motion(length):
    begin = 20.0
    stamps = np.ones(len(INCREMENTS) + 1, dtype=bool)
    stamps[(INCREMENTS.time > begin) & (INCREMENTS.time < min(begin + length, 39.0))] = False
    first = np.flatnonzero(stamps)[:-1]
    increments = type(INCREMENTS)(
        INCREMENTS.time[stamps],
        np.add.reduceat(INCREMENTS.inc_theta_b, first, axis=0),
        np.add.reduceat(INCREMENTS.inc_v_b, first, axis=0),
    )
    options = FilterSettings(gap_s=0.1, checkpoints=True)
    filter_, extended = (
        run(options=options, increments=increments),
        run(ErrorStateFilter, options, increments=increments),
    )
    assert len(filter_.record.gaps) == len(extended.record.gaps) == 1
    assert np.isfinite(filter_.P).all()
    for checkpoint in filter_.record.checkpoints:
        P = checkpoint.P
        assert np.all(np.diagonal(P) > 0.0)
        assert filter_._weights[0] * np.sqrt(np.linalg.eigvalsh(P[6:9, 6:9])[-1]) < np.pi
    inside = [np.sqrt(np.diagonal(c.P))[9:] for c in filter_.record.checkpoints]
    assert np.all(inside[-1] <= 1.05 * inside[0])
    if length <= 3.0:
        assert np.abs(error(nav_at(LOGS.motion, 40.0, False), filter_.nav, False)[:2]).max() < 8.0


class Compass(AidingSensor):
    """A heading with a bias of its own, close to where it jumps from pi to -pi."""

    name = "compass"
    states = (Block("bias", 1, 0.2),)

    def __init__(self, motion, bias, rng, turn):
        self.times = np.arange(1.0, 39.0)
        self.turn = turn
        true = motion.trajectory(self.times).attitude[:, 2]
        self.values = (true + turn + bias + 0.02 * rng.normal(size=true.size) + np.pi) % (2.0 * np.pi) - np.pi

    def value(self, k):
        return self.values[k : k + 1]

    def predict(self, nav, k):
        C = nav.C_nb
        heading = np.arctan2(C[1, 0], C[0, 0]) + self.turn + nav.state("compass.bias")[0]
        return np.array([(heading + np.pi) % (2.0 * np.pi) - np.pi])

    def subtract(self, measured, predicted):
        return (measured - predicted + np.pi) % (2.0 * np.pi) - np.pi

    def noise(self, k):
        return 0.02


def test_a_sensor_with_a_bias_and_an_angle_does_not_feel_where_the_angle_jumps():
    heading = LOGS.motion.trajectory(np.array([1.0])).attitude[0, 2]
    ends = []
    for turn in (0.0, np.pi - heading):
        compass = Compass(LOGS.motion, 0.1, np.random.default_rng(7), turn)
        ends.append(run(aiding=[*sensors(), compass]))
        statuses = [i.status for i in ends[-1].record.innovations if i.source == "compass"]
        assert set(statuses) == {"used"}
    one, other = ends
    assert one.layout.size == 22
    assert abs(one.s[-1] - 0.1) < 4.0 * np.sqrt(one.P[-1, -1])
    np.testing.assert_allclose(other.nav, one.nav, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(other.s, one.s, atol=1e-8)
    extended = run(ErrorStateFilter, aiding=[*sensors(), Compass(LOGS.motion, 0.1, np.random.default_rng(7), 0.0)])
    assert abs(extended.s[-1] - one.s[-1]) < 0.1 * np.sqrt(one.P[-1, -1])
    assert one.P[-1, -1] == pytest.approx(extended.P[-1, -1], rel=0.03)


# A filter that is saved and goes on.

SETTINGS = {
    "n": CHECKED,
    "e": replace(CHECKED, ecef=True),
    "held heading": CHECKED,
    "every stamp": replace(CHECKED, output_period=0.0),
    "odd rates": replace(CHECKED, output_period=0.077, covariance_period=0.031),
    "long steps": replace(CHECKED, covariance_period=1.0, output_period=-1.0),
    "close points": replace(CHECKED, alpha=1e-2),
}
SHORT = cut(INCREMENTS, 0, 600)
WHOLE = {}


def start_of(name):
    return UNKNOWN if name == "held heading" else START


def short(name, cuts=()):
    return run(options=SETTINGS[name], start=start_of(name), increments=SHORT, cuts=cuts)


def whole(name):
    if name not in WHOLE:
        WHOLE[name] = short(name)
    return WHOLE[name]


def assert_same_filter(a, b):
    assert a.time == b.time
    for name in ("nav", "s", "x", "P", "_acc"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name


@given(name=st.sampled_from(sorted(SETTINGS)), cuts=st.lists(st.integers(0, 600), max_size=12).map(sorted))
@settings(max_examples=30)
def test_any_cuts_give_the_same_bits(name, cuts):
    pieces = short(name, cuts)
    assert_same_filter(pieces, whole(name))
    assert_same_record(pieces.record, whole(name).record)


def through_savez(filter_, fresh):
    file = io.BytesIO()
    np.savez(file, **filter_.state())
    file.seek(0)
    fresh.restore(dict(np.load(file)))
    return fresh


WAYS = {
    "savez": through_savez,
    "state": lambda filter_, fresh: (fresh.restore(copy.deepcopy(filter_.state())), fresh)[1],
    "pickle": lambda filter_, fresh: pickle.loads(pickle.dumps(filter_)),
    "deepcopy": lambda filter_, fresh: copy.deepcopy(filter_),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", SETTINGS)
@pytest.mark.parametrize("at", [0, 3, 107, 333])
def test_a_saved_filter_goes_on_as_if_nothing_had_happened(name, way, at):
    first = UnscentedFilter(start_of(name), MEMS, sensors(), SETTINGS[name])
    first.feed(cut(SHORT, 0, at))
    if name == "n" and at == 3:
        assert first._acc[ACC_TIME] > 0.0, "in the middle of a covariance step"
    if name == "held heading":
        assert first._hold.direction.any() or at == 333
    second = WAYS[way](first, UnscentedFilter(start_of(name), MEMS, sensors(), SETTINGS[name]))
    second.feed(cut(SHORT, at))
    assert_same_filter(second, whole(name))
    # The one it was taken from has a life of its own.
    first.feed(cut(SHORT, at))
    assert_same_filter(first, whole(name))
    assert_same_record(first.record, whole(name).record)


def test_saving_takes_copies():
    filter_ = UnscentedFilter(START, MEMS, sensors())
    saved = filter_.state()
    before = pickle.dumps(saved)
    filter_.feed(INCREMENTS)
    assert pickle.dumps(saved) == before


@pytest.mark.parametrize(("one", "other"), [(UnscentedFilter, ErrorStateFilter), (ErrorStateFilter, UnscentedFilter)])
def test_the_state_of_another_kind_of_filter_is_refused(one, other):
    with pytest.raises(ConfigError, match="of another kind"):
        one(START, MEMS, sensors()).restore(other(START, MEMS, sensors()).state())


@pytest.mark.parametrize("at", [50, 53])
def test_a_covariance_that_is_assigned_is_that_from_then_on(at):
    """53 is in the middle of a covariance step, of which the points are dropped."""
    filter_ = UnscentedFilter(START, MEMS, [], FilterSettings(output_period=-1.0))
    filter_.feed(cut(INCREMENTS, 0, at))
    P = np.diag(np.square(np.repeat([3.0, 0.2, 0.01, 1e-4, 1e-2, 1e-3, 1e-3], 3)))
    filter_.P = P
    np.testing.assert_allclose(filter_.root @ filter_.root.T, P, rtol=1e-12, atol=1e-20)
    assert np.array_equal(filter_.P, P)
    fresh = UnscentedFilter(START, MEMS, [], FilterSettings(output_period=-1.0))
    fresh.feed(cut(INCREMENTS, 0, at))
    state = fresh.state()
    state["acc"][: -(43 * 22)] = 0.0
    fresh.restore(state)
    fresh.P = P
    for each in (filter_, fresh):
        each.feed(cut(INCREMENTS, at, at + 100))
    assert np.array_equal(filter_.P, fresh.P)
    extended = ErrorStateFilter(START, MEMS, [], FilterSettings(output_period=-1.0))
    extended.feed(cut(INCREMENTS, 0, 50))
    extended.P = P
    extended.feed(cut(INCREMENTS, 50, at + 100))
    assert np.max(np.abs(filter_.P / np.diagonal(extended.P) - extended.P / np.diagonal(extended.P))[:9]) < 0.3
    np.testing.assert_allclose(np.diagonal(filter_.P), np.diagonal(extended.P), rtol=0.1)
    with pytest.raises(ConfigError, match="not positive semi-definite"):
        filter_.P = -P


@FRAMES
@pytest.mark.parametrize("at", [50, 53])
def test_an_estimate_that_is_assigned_is_that_from_then_on(at, ecef):
    """In place too, and in the middle of a covariance step, where the points move along."""
    filters = [
        kind(START, MEMS, [], FilterSettings(ecef=ecef, output_period=-1.0))
        for kind in (UnscentedFilter, ErrorStateFilter)
    ]
    for filter_ in filters:
        filter_.feed(cut(INCREMENTS, 0, at))
        boxplus_navigation(filter_.nav, np.array([30.0, -20.0, 5.0, 0.3, 0.2, -0.1, 0.02, -0.01, 0.4]), ecef)
        filter_.s[:3] = [1e-3, -2e-3, 5e-4]
        filter_.feed(cut(INCREMENTS, at, at + 40))
    one, other = filters
    # The extended filter uses another bias at once or, in a step, from its end on: 60 ms of some 1e-3 rad/s.
    assert np.all(np.abs(error(one.nav, other.nav, ecef)) < np.repeat([1e-3, 2e-3, 2e-4], 3))
    np.testing.assert_allclose(one.s, other.s, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(np.diagonal(one.P), np.diagonal(other.P), rtol=0.01 if at == 50 else 0.1)


def test_it_says_that_the_heading_is_unknown_but_not_that_it_cannot_cope():
    notes = [run(kind, start=UNKNOWN).record.notes for kind in (UnscentedFilter, ErrorStateFilter)]
    assert all("a heading known to 60 deg only" in note[0] for note in notes)
    assert "not linear" in notes[1][0]
    assert "not linear" not in notes[0][0]


@FRAMES
def test_a_held_heading_keeps_its_deviation_and_has_no_correlations(ecef):
    filter_ = UnscentedFilter(UNKNOWN, MEMS, sensors(), FilterSettings(ecef=ecef, checkpoints=True))
    filter_.feed(cut(INCREMENTS, 0, 45))
    held = [c for c in filter_.record.checkpoints if c.held.any()]
    assert len(held) >= 2
    for checkpoint in held:
        down, P = checkpoint.held, checkpoint.P
        assert np.sqrt(down @ P[6:9, 6:9] @ down) == pytest.approx(np.radians(60.0), rel=1e-3)
    for checkpoint in held[1:]:
        sd = np.sqrt(np.diagonal(checkpoint.P))
        cross = checkpoint.held @ checkpoint.P[6:9] / sd / np.radians(60.0)
        cross[6:9] = 0.0
        assert np.abs(cross).max() < 1e-9


@pytest.mark.parametrize("sd", [5.0, 25.0])
@FRAMES
def test_half_a_minute_at_rest_teaches_no_more_of_the_heading_than_an_extended_filter_believes(sd, ecef):
    """Nothing does at rest; errors that are left in the coordinates of an arc once made 3 deg of 5 and 4 of 25."""
    found = []
    for kind in (UnscentedFilter, ErrorStateFilter):
        sd_after = []
        for seed in range(3):
            motion = static(30.0, heading=2.0)
            logs = simulate(motion, grade("industrial-mems"), seed, imu_rate=50.0)
            level, rng = np.radians(1.0), np.random.default_rng(seed)
            start = start_at(motion, 0.0, [2.0, 2.0, 4.0], [0.1] * 3, [level, level, np.radians(sd)], rng)
            aiding = [GnssPosition(logs.gnss), GnssVelocity(logs.gnss)]
            filter_ = kind(start, grade("industrial-mems"), aiding, FilterSettings(ecef=ecef, output_period=10.0))
            filter_.feed(to_increments(logs.imu))
            sd_after.append(filter_.record.trajectory().sd_attitude[-1, 2])
        found.append(np.degrees(np.mean(sd_after)))
    assert found[0] > 0.85 * found[1]
    assert found[0] > (0.9 * sd if sd < 10.0 else 8.0)
