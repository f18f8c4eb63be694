"""The filter as an object that is fed: any blocks, saved and restored anywhere, to the last bit."""

from __future__ import annotations

import copy
import io
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity
from navfuse.data.logs import GnssLog
from navfuse.errors import ConfigError, FilterError
from navfuse.filters.ekf import ErrorStateFilter, FilterSettings
from navfuse.imu.grades import grade
from navfuse.imu.increments import IncrementsBuilder, to_increments
from navfuse.simulation import car_drive, drawn_start, simulate
from reference.engine_runs import MEMS, assert_same_record, cut, run_filter, start_at

LEVER = (0.5, -0.3, -1.2)
LOGS = simulate(
    car_drive(12.0, seed=2, standing=1.0),
    MEMS,
    seed=1,
    imu_rate=50.0,
    gnss_rate=3.0,
    gnss_offset=0.107,
    lever_arm_b=LEVER,
)
INCREMENTS = to_increments(LOGS.imu)
START = start_at(LOGS.motion, 0.0, [1.0, 1.0, 2.0], [0.05] * 3, np.radians([0.5, 0.5, 2.0]))
SETTINGS = {
    "closed, n": FilterSettings(checkpoints=True),
    "open, n": FilterSettings(open_loop=True, checkpoints=True),
    "closed, e": FilterSettings(ecef=True, checkpoints=True),
    "open, e": FilterSettings(ecef=True, open_loop=True, checkpoints=True),
    "every stamp": FilterSettings(output_period=0.0, checkpoints=True),
    "odd rates": FilterSettings(output_period=0.077, covariance_period=0.031, checkpoints=True),
    "full covariance rate": FilterSettings(covariance_period=0.0, output_period=-1.0, checkpoints=True),
    "gaps": FilterSettings(gap_s=0.05, checkpoints=True),
}
ALL_SETTINGS = pytest.mark.parametrize("name", SETTINGS)


def gappy(increments):
    """The same increments with some joined to long ones."""
    keep = np.ones(len(increments) + 1, dtype=bool)
    keep[100:130] = False
    keep[400:404] = False
    starts = np.flatnonzero(keep)[:-1]
    theta = np.add.reduceat(increments.inc_theta_b, starts, axis=0)
    dv = np.add.reduceat(increments.inc_v_b, starts, axis=0)
    return type(increments)(increments.time[keep], theta, dv)


def increments_for(name):
    return gappy(INCREMENTS) if name == "gaps" else INCREMENTS


def sensors():
    return [GnssPosition(LOGS.gnss, LEVER, outages=((6.0, 8.0),)), GnssVelocity(LOGS.gnss, LEVER)]


def run(name, cuts=(), increments=None):
    increments = increments_for(name) if increments is None else increments
    return run_filter(START, MEMS, sensors(), increments, SETTINGS[name], cuts)


def assert_same_filter(a, b):
    assert a.time == b.time
    for name in ("nav", "s", "x", "P"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name


WHOLE = {}


def whole(name):
    if name not in WHOLE:
        WHOLE[name] = run(name)
    return WHOLE[name]


@ALL_SETTINGS
@pytest.mark.parametrize("block", [1, 7, 250])
def test_blocks_of_any_size_give_the_same_bits(name, block):
    pieces = run(name, range(block, len(increments_for(name)), block))
    assert_same_filter(pieces, whole(name))
    assert_same_record(pieces.record, whole(name).record)


@given(
    name=st.sampled_from(sorted(SETTINGS)),
    cuts=st.lists(st.integers(0, 560), max_size=12).map(sorted),
)
@settings(max_examples=60)
def test_any_cuts_give_the_same_bits(name, cuts):
    pieces = run(name, cuts)
    assert_same_filter(pieces, whole(name))
    assert_same_record(pieces.record, whole(name).record)


def through_savez(state):
    file = io.BytesIO()
    np.savez(file, **state)
    file.seek(0)
    return dict(np.load(file))


def through_pickle(state):
    return pickle.loads(pickle.dumps(state))


@ALL_SETTINGS
@pytest.mark.parametrize("through", [through_savez, through_pickle])
@pytest.mark.parametrize("at", [0, 1, 105, 333, 560])
def test_a_saved_filter_goes_on_as_if_nothing_had_happened(name, through, at):
    increments = increments_for(name)
    first = ErrorStateFilter(START, MEMS, sensors(), SETTINGS[name])
    first.feed(cut(increments, 0, at))
    head = first.record
    second = ErrorStateFilter(START, MEMS, sensors(), SETTINGS[name])
    second.restore(through(first.state()))
    second.feed(cut(increments, at))
    tail = second.record
    tail.checkpoints = [c._replace(index=c.index + at) for c in tail.checkpoints[1:]]
    assert_same_filter(second, whole(name))
    for field in (
        "time",
        "rows",
        "innovations",
        "checkpoints",
        "state_time",
        "states",
        "notes",
        "gaps",
    ):
        setattr(head, field, getattr(head, field) + getattr(tail, field))
    assert_same_record(head, whole(name).record)


def test_saving_takes_copies():
    filter_ = ErrorStateFilter(START, MEMS, sensors())
    saved = filter_.state()
    before = pickle.dumps(saved)
    filter_.feed(INCREMENTS)
    assert pickle.dumps(saved) == before


def test_restoring_takes_copies():
    filter_ = run("closed, n", increments=cut(INCREMENTS, 0, 300))
    saved = filter_.state()
    before = pickle.dumps(saved)
    again = ErrorStateFilter(START, MEMS, sensors())
    again.restore(saved)
    again.feed(cut(INCREMENTS, 300))
    assert pickle.dumps(saved) == before


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_a_live_run_from_raw_samples_equals_the_file_run(kind):
    logs = simulate(LOGS.motion, MEMS, seed=4, imu_rate=50.0, imu_kind=kind, gnss_rate=3.0, gnss_offset=0.107)
    file_run = run_filter(START, MEMS, [GnssPosition(logs.gnss)], to_increments(logs.imu))
    builder, live = IncrementsBuilder(kind), None
    for first in range(0, logs.imu.time.size, 13):
        rows = slice(first, first + 13)
        block = type(logs.imu)(logs.imu.time[rows], logs.imu.gyro[rows], logs.imu.accel[rows], kind)
        live = live or ErrorStateFilter(START, MEMS, [GnssPosition(logs.gnss)])
        live.feed(builder.feed(block))
    assert_same_filter(live, file_run)
    assert_same_record(live.record, file_run.record)


def rows_of(log, rows):
    return GnssLog(
        log.time[rows], log.lat[rows], log.lon[rows], log.height[rows], log.sd_position[rows], log.velocity_n[rows],
        log.sd_velocity[rows],
    )  # fmt: skip


def test_fixes_that_arrive_just_in_time_give_the_same_bits():
    live = ErrorStateFilter(START, MEMS, [GnssPosition(rows_of(LOGS.gnss, slice(0, 1)), LEVER)])
    known = 1
    for first in range(0, len(INCREMENTS), 10):
        block = cut(INCREMENTS, first, first + 10)
        until = int(np.searchsorted(LOGS.gnss.time, block.time[-1], side="right"))
        if until > known:
            live.sensors[0].extend(rows_of(LOGS.gnss, slice(known, until)))
            known = until
        live.feed(block)
    file_run = run_filter(START, MEMS, [GnssPosition(LOGS.gnss, LEVER)], INCREMENTS)
    assert_same_filter(live, file_run)
    assert_same_record(live.record, file_run.record)


@pytest.mark.parametrize("period", [0.1, 0.0])
def test_a_fix_that_arrives_late_is_recorded_and_not_used(period):
    options = FilterSettings(output_period=period)
    sensor = GnssPosition(rows_of(LOGS.gnss, slice(0, 5)), LEVER)
    filter_ = ErrorStateFilter(START, MEMS, [sensor], options)
    filter_.feed(cut(INCREMENTS, 0, 200))
    sensor.extend(rows_of(LOGS.gnss, slice(5, 6)))
    before = filter_.nav.copy(), filter_.P.copy()
    filter_.feed(cut(INCREMENTS, 200, 200))
    late = filter_.record.innovations[-1]
    assert (late.time, late.row, late.status) == (LOGS.gnss.time[5], 5, "late")
    assert np.isnan(late.nis)
    assert np.array_equal(filter_.nav, before[0])
    assert np.array_equal(filter_.P, before[1])
    filter_.feed(cut(INCREMENTS, 200))
    assert np.all(np.diff(np.concatenate(filter_.record.time)) > 0.0)


def test_increments_with_a_hole_between_blocks_are_refused():
    filter_ = ErrorStateFilter(START, MEMS, sensors())
    filter_.feed(cut(INCREMENTS, 0, 100))
    with pytest.raises(FilterError, match=r"begin at 2\.020000 s but the filter stands at 2\.000000 s"):
        filter_.feed(cut(INCREMENTS, 101))


def test_a_state_of_another_layout_is_refused():
    saved = ErrorStateFilter(START, MEMS.replace(gyro_scale_sd=0.0), sensors()).state()
    with pytest.raises(ConfigError, match="other states or sensors"):
        ErrorStateFilter(START, MEMS, sensors()).restore(saved)


def test_a_state_of_other_sensors_is_refused():
    saved = ErrorStateFilter(START, MEMS, sensors()).state()
    with pytest.raises(ConfigError, match="other states or sensors"):
        ErrorStateFilter(START, MEMS, sensors()[:1]).restore(saved)


def duplicates(estimator):
    yield copy.deepcopy(estimator)
    yield pickle.loads(pickle.dumps(estimator))


def test_a_copied_filter_goes_on_like_the_one_it_was_copied_from():
    logs = simulate(car_drive(40.0, seed=2), grade("tactical"), 3, imu_rate=50.0)
    increments = to_increments(logs.imu)
    sensors = [GnssPosition(logs.gnss, np.zeros(3)), GnssVelocity(logs.gnss, np.zeros(3))]
    motion = logs.motion
    start = drawn_start(motion, 0.0, [1.0] * 3, [0.1] * 3, [0.01] * 3, np.random.default_rng(4))
    for chosen in (FilterSettings(checkpoints=True), FilterSettings(ecef=True, open_loop=True)):
        estimator = ErrorStateFilter(start, grade("tactical"), sensors, chosen)
        estimator.feed(increments.piece(0, 1000))
        others = list(duplicates(estimator))
        estimator.feed(increments.piece(1000))
        for other in others:
            other.feed(increments.piece(1000))
            for name in ("nav", "s", "x", "P"):
                assert np.array_equal(getattr(other, name), getattr(estimator, name)), name


def test_what_is_assigned_is_what_the_filter_goes_on_with():
    logs = simulate(car_drive(20.0, seed=2), grade("tactical"), 3, imu_rate=50.0)
    start = drawn_start(logs.motion, 0.0, [1.0] * 3, [0.1] * 3, [0.01] * 3, np.random.default_rng(4))
    estimator = ErrorStateFilter(start, grade("tactical"), [GnssPosition(logs.gnss, np.zeros(3))])
    increments = to_increments(logs.imu)
    estimator.feed(increments.piece(0, 500))
    estimator.P = 4.0 * estimator.P
    estimator.nav = estimator.nav.copy()
    before = estimator.nav_state()
    height = before.height
    expected = estimator.P.copy()
    assert estimator.state()["P"] == pytest.approx(expected)
    estimator.feed(increments.piece(500))
    assert before.height == height
    assert 0.1 < np.sqrt(estimator.P[0, 0]) < 2.0
