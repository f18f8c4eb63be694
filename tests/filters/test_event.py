"""One compiled call for a measurement: the same numbers as its parts, and as a sensor in plain Python gives."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.aiding.base import AidingSensor
from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity
from navfuse.core.kalman import update
from navfuse.data.nav_state import apply_correction
from navfuse.errors import FilterError
from navfuse.filters.ekf import ErrorStateFilter
from navfuse.filters.event import carrier, note, parts, room, split, take
from navfuse.filters.record import USED
from navfuse.filters.settings import FilterSettings
from navfuse.imu.grades import grade
from navfuse.imu.increments import to_increments
from navfuse.simulation import car_drive, perfect_imu, sample_times, simulate, static
from navfuse.smoothers.rts import smooth
from reference.engine_runs import MEMS, assert_same_record, cut, run_filter, start_at

N = 15
OFFSETS = np.array([9, -1, -1, 12, -1, -1])
NED = np.array([0.8, 0.2, 100.0, 10.0, -3.0, 0.5, 1.0, 0.0, 0.0, 0.0])
ECEF = np.array([4.2e6, 9.0e5, 4.7e6, 5.0, 8.0, -4.0, 0.6, 0.0, 0.8, 0.0])


def carried(ecef, seed=0):
    rng = np.random.default_rng(seed)
    whole = carrier(N)
    nav, s, x, P = split(whole)
    root = rng.standard_normal((N, N)) * np.repeat([1.0, 0.1, 1e-3, 1e-5, 1e-3], 3)[:, None]
    nav[:], s[:], x[:], P[:] = ECEF if ecef else NED, 1e-4 * rng.standard_normal(N - 9), 0.0, root @ root.T
    return whole


def measurement(d, seed=1):
    rng = np.random.default_rng(seed)
    return 0.1 * rng.standard_normal(d), rng.standard_normal((d, N)), np.diag(rng.uniform(0.5, 2.0, d))


@pytest.mark.parametrize("ecef", [False, True])
@pytest.mark.parametrize("open_loop", [False, True])
@pytest.mark.parametrize("d", [1, 3, 5])
def test_taking_a_measurement_is_the_update_and_then_the_correction(d, open_loop, ecef):
    z, H, R = measurement(d)
    held = np.array([0.0, 0.6, 0.8])
    whole, rates, numbers = carried(ecef), np.arange(1.0, 7.0), np.full(room(d, N), np.nan)
    nis = take(whole, rates, OFFSETS, ecef, open_loop, z, H, R, np.inf, held, numbers)

    expected, turned = carried(ecef), np.arange(1.0, 7.0)
    nav, s, x, P = split(expected)
    K, S, Sinv, dx = np.empty((N, d)), np.empty((d, d)), np.empty((d, d)), np.empty(N)
    assert nis == update(P, H, R, z, np.inf, held, K, S, Sinv, dx)
    if open_loop:
        x += dx
    else:
        apply_correction(nav, s, turned, P, dx, OFFSETS, ecef)
    assert np.array_equal(whole, expected)
    assert np.array_equal(rates, turned)
    for kept, part in zip(parts(numbers, d, N), (z, S, Sinv, H, K, dx), strict=True):
        assert np.array_equal(kept, part)
    assert not np.isnan(numbers).any()


@pytest.mark.parametrize("limit", [-1.0, 1e-9])
def test_a_measurement_that_does_not_pass_changes_nothing_but_its_record(limit):
    z, H, R = measurement(2)
    whole, rates, numbers = carried(False), np.ones(6), np.empty(room(2, N))
    nis = take(whole, rates, OFFSETS, False, False, z, H, R, limit, np.zeros(3), numbers)
    assert np.array_equal(whole, carried(False))
    assert np.array_equal(rates, np.ones(6))
    kept_z, S, *_ = parts(numbers, 2, N)
    np.testing.assert_allclose(S, H @ split(whole)[3] @ H.T + R, rtol=1e-12)
    assert nis == pytest.approx(kept_z @ np.linalg.solve(S, z))


def test_an_innovation_covariance_that_is_not_positive_definite_changes_nothing():
    z, H, R = measurement(1)
    whole = carried(False)
    nis = take(whole, np.ones(6), OFFSETS, False, False, z, H, -1e9 * R, np.inf, np.zeros(3), np.empty(room(1, N)))
    assert np.isnan(nis)
    assert np.array_equal(whole, carried(False))


def test_what_is_carried_is_split_into_views_and_many_rows_at_once():
    whole = carried(False)
    P = split(whole)[3]
    P[0, 0] = 7.0
    assert whole[2 * N + 1] == 7.0
    several = np.stack([whole, carried(True, 3)])
    for together, first, second in zip(split(several), split(several[0]), split(several[1]), strict=True):
        assert np.array_equal(together, np.stack([first, second]))


@pytest.mark.parametrize("row", [-1, 2])
def test_noting_an_event_fills_states_and_one_row_of_output(row):
    whole = carried(False)
    nav, s, x, P = split(whole)
    x[:] = np.arange(N)
    states = np.empty((2, N - 9))
    out = np.zeros(3), np.zeros((3, 10)), np.zeros((3, N)), np.zeros((3, 9, N))
    assert note(whole, states, 5.0, row, *out) == pytest.approx(nav.sum())
    np.testing.assert_array_equal(states, [s + x[9:], np.sqrt(np.diagonal(P)[9:])])
    for filled, part in zip(out, (5.0, nav, x, P[:9]), strict=True):
        if row >= 0:
            np.testing.assert_array_equal(filled[row], part)
            filled[row] = 0.0
        assert not filled.any()
    nav[4] = np.nan
    assert not np.isfinite(note(whole, states, 5.0, -1, *out))


class Plain(AidingSensor):
    """Another sensor's innovations and derivatives, by way of what every sensor in plain Python says."""

    def __init__(self, sensor):
        self.sensor, self.name, self.times = sensor, sensor.name, sensor.times

    def value(self, k):
        return np.zeros(3)

    def predict(self, nav, k):
        return -self.sensor.linearize(nav, k)[0]

    def noise(self, k):
        return self.sensor.noise(k)

    def jacobian(self, nav, k):
        return np.asfortranarray(self.sensor.jacobian(nav, k))


@pytest.mark.parametrize("options", [{}, {"ecef": True}, {"open_loop": True}], ids=["n", "e", "open"])
def test_a_sensor_in_plain_python_gives_the_bits_of_a_compiled_one(options):
    lever = (0.5, -0.3, -1.2)
    logs = simulate(car_drive(40.0, seed=2, standing=1.0), MEMS, 1, imu_rate=50.0, lever_arm_b=lever)
    increments = to_increments(logs.imu)
    start = start_at(logs.motion, 0.0, [1.0, 1.0, 2.0], [0.05] * 3, np.radians([0.3, 0.3, 1.0]))
    sensors = [GnssPosition(logs.gnss, lever), GnssVelocity(logs.gnss, lever)]
    settings = FilterSettings(checkpoints=True, **options)
    compiled = run_filter(start, MEMS, sensors, increments, settings)
    plain = run_filter(start, MEMS, [Plain(sensor) for sensor in sensors], increments, settings)
    for name in ("nav", "s", "x", "P"):
        assert np.array_equal(getattr(plain, name), getattr(compiled, name)), name
    assert_same_record(plain.record, compiled.record)
    a, b = (smooth(filter_, increments).trajectory for filter_ in (compiled, plain))
    assert np.array_equal(a.attitude, b.attitude)
    assert np.array_equal(a.sd_position, b.sd_position)


def test_without_checkpoints_a_record_keeps_no_more_than_innovations():
    logs = simulate(car_drive(12.0, seed=2, standing=1.0), MEMS, 1, imu_rate=50.0)
    start = start_at(logs.motion, 0.0, [1.0, 1.0, 2.0], [0.05] * 3, np.radians([0.3, 0.3, 1.0]))
    increments = to_increments(logs.imu)
    kept, bare = (
        ErrorStateFilter(start, MEMS, [GnssPosition(logs.gnss)], FilterSettings(checkpoints=checkpoints))
        for checkpoints in (True, False)
    )
    for filter_ in (kept, bare):
        filter_.feed(cut(increments, 0))
    assert not bare.record.checkpoints
    for one, other in zip(kept.record.innovations, bare.record.innovations, strict=True):
        assert one.status == USED
        assert one[:6] == other[:6]
        assert np.array_equal(one.z, other.z)
        assert np.array_equal(one.S, other.S)
        assert (one.numbers.size, other.numbers.size) == (room(3, kept.layout.size), 12)
        assert other.numbers.base is None


def standing(sensor):
    """A filter at rest with one sensor, and increments of some seconds."""
    start = start_at(static(3.0), 0.0, [1.0] * 3, [0.1] * 3, [0.01] * 3)
    increments = to_increments(perfect_imu(static(3.0), sample_times(0.0, 3.0, 20.0)))
    return ErrorStateFilter(start, grade("tactical"), [sensor]), increments


class Misshapen(AidingSensor):
    """Says what it is told to say."""

    name = "misshapen"

    def __init__(self, *answer):
        self.times = np.array([1.0])
        self.answer = answer

    def value(self, k):
        return np.zeros(1)

    def predict(self, nav, k):
        return np.zeros(1)

    def noise(self, k):
        return np.ones(1)

    def linearize(self, nav, k):
        return self.answer


@pytest.mark.parametrize(
    "answer",
    [
        (np.zeros(3), np.zeros((1, 21)), np.eye(3)),
        (np.zeros(3), np.zeros((3, 9)), np.eye(3)),
        (np.zeros(3), np.zeros((3, 21)), np.eye(1)),
        (np.zeros(1), np.zeros(21), np.eye(1)),
        (np.zeros((3, 1)), np.zeros((3, 21)), np.eye(3)),
    ],
)
def test_a_measurement_of_the_wrong_shape_is_refused_by_name(answer):
    estimator, increments = standing(Misshapen(*answer))
    with pytest.raises(
        FilterError, match=r"misshapen measurement 0 at 1.000 s: linearize gives z, H and R of the shapes"
    ):
        estimator.feed(increments)


def test_an_infinite_innovation_changes_nothing():
    n = 21
    answer = np.full(1, np.inf), np.eye(1, n), np.eye(1)
    estimator, increments = standing(Misshapen(*answer))
    with pytest.raises(FilterError, match="misshapen measurement 0 at 1.000 s cannot be used"):
        estimator.feed(increments)
    assert np.isfinite(estimator.nav).all()
