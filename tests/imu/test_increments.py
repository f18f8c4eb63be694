from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from scipy.special import j1

from navfuse.data.logs import ImuLog
from navfuse.errors import InputError
from navfuse.imu.increments import (
    EQUAL,
    LONGEST_RATIO,
    ImuIncrements,
    IncrementsBuilder,
    correction_factors,
    to_increments,
)

W0, W_SLOPE = np.array([0.9, -0.5, 0.3]), np.array([-2.0, 4.0, 3.0])
F0, F_SLOPE = np.array([2.0, -7.0, -9.0]), np.array([20.0, 10.0, -30.0])


def linear_rate(t):
    return W0 + W_SLOPE * t


def linear_force(t):
    return F0 + F_SLOPE * t


def linear_log(kind, time):
    """Exact samples or increments of a rate and a specific force that are linear in time."""
    if kind == "rates":
        return ImuLog(time, linear_rate(time[:, None]), linear_force(time[:, None]), kind)
    before = np.concatenate(([2.0 * time[0] - time[1]], time[:-1]))
    dt, mean = (time - before)[:, None], (0.5 * (time + before))[:, None]
    return ImuLog(time, linear_rate(mean) * dt, linear_force(mean) * dt, kind)


def random_log(kind, n, seed, gap_at=None):
    rng = np.random.default_rng(seed)
    dt = rng.uniform(0.004, 0.006, n)
    if gap_at is not None:
        dt[gap_at] = 0.5
    return ImuLog(100.0 + np.cumsum(dt), rng.normal(size=(n, 3)), 10.0 * rng.normal(size=(n, 3)), kind)


def rows(log, start, stop):
    return ImuLog(log.time[start:stop], log.gyro[start:stop], log.accel[start:stop], log.kind, log.source)


def integrated(start, stop):
    """Rotation vector and velocity in the starting axes by Runge-Kutta of order 8, without a series in the angle."""

    def slope(t, state):
        C = state[:9].reshape(3, 3)
        w = linear_rate(t)
        skew = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
        return np.concatenate(((C @ skew).ravel(), C @ linear_force(t)))

    first = np.concatenate((np.eye(3).ravel(), np.zeros(3)))
    last = solve_ivp(slope, (start, stop), first, method="DOP853", rtol=1e-13, atol=1e-16).y[:, -1]
    return Rotation.from_matrix(last[:9].reshape(3, 3)).as_rotvec(), last[9:]


def turned(theta, v):
    """Velocity increment seen from the starting axes if rate and specific force were constant over the interval."""
    n2 = theta @ theta
    if n2 < 1e-12:
        return v + 0.5 * np.cross(theta, v)
    n = math.sqrt(n2)
    once, twice = (1.0 - math.cos(n)) / n2, (1.0 - math.sin(n) / n) / n2
    return v + once * np.cross(theta, v) + twice * np.cross(theta, np.cross(theta, v))


def chained(increments):
    """Attitude and velocity at the end, resolved in the axes of the start, without gravity and Earth rotation."""
    attitude, velocity = Rotation.identity(), np.zeros(3)
    for theta, v in zip(increments.inc_theta_b, increments.inc_v_b, strict=True):
        velocity = velocity + attitude.apply(turned(theta, v))
        attitude = attitude * Rotation.from_rotvec(theta)
    return attitude, velocity


def order(errors):
    """Exponent of dt, from errors at steps halved each time."""
    return np.diff(np.log2(errors)) * -1.0


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("previous", [1.0, 0.4, 2.5])
def test_one_interval_of_linear_rates_against_numerical_integration(kind, previous):
    theta_errors, v_errors, no_coning, no_sculling = [], [], [], []
    for T in (0.1, 0.05, 0.025):
        time = np.array([0.3 - previous * T, 0.3, 0.3 + T])
        log = linear_log(kind, time)
        got = to_increments(log)
        theta, v = got.inc_theta_b[-1], got.inc_v_b[-1]
        exact_theta, exact_v = integrated(0.3, 0.3 + T)
        alpha, upsilon = T * linear_rate(0.3 + T / 2), T * linear_force(0.3 + T / 2)
        theta_errors.append(np.linalg.norm(theta - exact_theta))
        v_errors.append(np.linalg.norm(turned(theta, v) - exact_v))
        no_coning.append(np.linalg.norm(alpha - exact_theta))
        no_sculling.append(np.linalg.norm(turned(theta, upsilon) - exact_v))
    assert np.min(order(theta_errors)) > 4.7
    assert np.min(order(v_errors)) > 4.7
    assert np.max(order(no_coning)) < 3.2
    assert np.max(order(no_sculling)) < 3.2
    assert theta_errors[0] < no_coning[0] / 300.0
    assert v_errors[0] < no_sculling[0] / 300.0


def coning_log(kind, beta, half_cone, time):
    """Attitude q = (cos c, sin c cos bt, sin c sin bt, 0): a turn by 2 c about an axis circling at the rate beta."""
    sine, drift = math.sin(2.0 * half_cone), -beta * (1.0 - math.cos(2.0 * half_cone))
    if kind == "rates":
        gyro = np.stack(
            [-beta * sine * np.sin(beta * time), beta * sine * np.cos(beta * time), 0.0 * time + drift], axis=1
        )
    else:
        before = np.concatenate(([2.0 * time[0] - time[1]], time[:-1]))
        gyro = np.stack(
            [
                sine * (np.cos(beta * time) - np.cos(beta * before)),
                sine * (np.sin(beta * time) - np.sin(beta * before)),
                drift * (time - before),
            ],
            axis=1,
        )
    return ImuLog(time, gyro, np.zeros((time.size, 3)), kind)


def coning_attitude(beta, half_cone, t):
    s = math.sin(half_cone)
    return Rotation.from_quat(
        [math.cos(half_cone), s * math.cos(beta * t), s * math.sin(beta * t), 0.0], scalar_first=True
    )


def coning_drift(kind, steps, coning=True, uneven=False):
    """Attitude error [rad] after five turns of the cone."""
    beta, half_cone = 2.0 * math.pi * 10.0, math.radians(0.5)
    time = np.arange(-2, 5 * steps + 1) * (2.0 * math.pi / beta / steps)
    if uneven:
        time[1:-1:2] += 0.3 * (time[1] - time[0])
    log = coning_log(kind, beta, half_cone, time)
    increments = to_increments(log, gap_s=np.inf if coning else 0.0)
    attitude, _ = chained(ImuIncrements(time[2:], increments.inc_theta_b[2:], increments.inc_v_b[2:]))
    expected = coning_attitude(beta, half_cone, time[2]).inv() * coning_attitude(beta, half_cone, time[-1])
    return np.linalg.norm((expected.inv() * attitude).as_rotvec())


def test_coning_drift_of_an_increment_sensor_falls_with_the_sixth_power():
    with_it = [coning_drift("increments", n) for n in (10, 20, 40)]
    without = [coning_drift("increments", n, coning=False) for n in (10, 20, 40)]
    assert order(with_it) == pytest.approx([6.0, 6.0], abs=0.25)
    assert order(without) == pytest.approx([2.0, 2.0], abs=0.25)
    assert with_it[1] < without[1] / 1000.0


def test_coning_drift_with_uneven_sampling_falls_with_the_sixth_power():
    with_it = [coning_drift("increments", n, uneven=True) for n in (10, 20, 40)]
    assert order(with_it) == pytest.approx([6.0, 6.0], abs=0.3)
    assert with_it[2] < coning_drift("increments", 40, coning=False, uneven=True) / 1000.0


def test_coning_drift_of_a_rate_sensor_is_half_as_large_and_falls_with_the_second_power():
    with_it = [coning_drift("rates", n) for n in (20, 40, 80)]
    assert order(with_it) == pytest.approx([2.0, 2.0], abs=0.1)
    assert with_it[2] / coning_drift("rates", 80, coning=False) == pytest.approx(0.5, abs=0.01)


def sculling_log(kind, beta, swing, force, time):
    """Rotation about x by swing sin(bt) with a specific force along y of force sin(bt)."""
    zero = np.zeros_like(time)
    if kind == "rates":
        angle, push = swing * beta * np.cos(beta * time), force * np.sin(beta * time)
    else:
        before = np.concatenate(([2.0 * time[0] - time[1]], time[:-1]))
        angle = swing * (np.sin(beta * time) - np.sin(beta * before))
        push = -force / beta * (np.cos(beta * time) - np.cos(beta * before))
    return ImuLog(time, np.stack([angle, zero, zero], axis=1), np.stack([zero, push, zero], axis=1), kind)


def sculling_drift(kind, steps, sculling=True):
    """Velocity error [m/s] after five swings; the exact velocity along z grows by force J1(swing) per second."""
    beta, swing, force = 2.0 * math.pi * 10.0, math.radians(2.0), 20.0
    time = np.arange(-2, 5 * steps + 1) * (2.0 * math.pi / beta / steps)
    increments = to_increments(sculling_log(kind, beta, swing, force, time), gap_s=np.inf if sculling else 0.0)
    _, velocity = chained(ImuIncrements(time[2:], increments.inc_theta_b[2:], increments.inc_v_b[2:]))
    return np.linalg.norm(velocity - [0.0, 0.0, force * j1(swing) * (time[-1] - time[2])])


def test_sculling_drift_of_an_increment_sensor_falls_with_the_sixth_power():
    with_it = [sculling_drift("increments", n) for n in (10, 20, 40)]
    without = [sculling_drift("increments", n, sculling=False) for n in (10, 20, 40)]
    assert order(with_it) == pytest.approx([6.0, 6.0], abs=0.3)
    assert order(without) == pytest.approx([2.0, 2.0], abs=0.25)
    assert with_it[1] < without[1] / 1000.0


RATE = np.array([[0.9, -0.5, 0.3], [-2.0, 4.0, 3.0], [6.0, -4.0, 2.0], [-3.0, 5.0, -6.0]])
FORCE = np.array([[2.0, -7.0, -9.0], [20.0, 10.0, -30.0], [20.0, -9.0, 30.0], [-30.0, 40.0, 10.0]])


def cubic_log(time):
    """Exact increments of a rate and a specific force that are cubic in time."""
    powers = np.arange(1.0, 5.0)
    moments = np.diff(time[:, None] ** powers / powers, axis=0, prepend=np.nan)
    moments[0] = 0.0
    return ImuLog(time, moments @ RATE, moments @ FORCE, "increments")


def reached(time):
    """Attitude and velocity at the end of the cubic motion by Runge-Kutta of order 8, in the axes of ``time[2]``."""

    def slope(t, state):
        C = state[:9].reshape(3, 3)
        w = t ** np.arange(4.0) @ RATE
        skew = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
        return np.concatenate(((C @ skew).ravel(), C @ (t ** np.arange(4.0) @ FORCE)))

    first = np.concatenate((np.eye(3).ravel(), np.zeros(3)))
    last = solve_ivp(slope, (time[2], time[-1]), first, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    return Rotation.from_matrix(last[:9].reshape(3, 3)), last[9:]


@pytest.mark.parametrize("uneven", [0.0, 0.35])
def test_errors_along_a_smooth_motion_fall_with_the_fourth_power_with_two_previous_increments(uneven):
    turned_by, velocity_by, turned_by_two = [], [], []
    for n in (20, 40, 80):
        time = np.linspace(-2.0 / n, 1.0, n + 3)
        time[1::2] += uneven / n
        log = cubic_log(time)
        increments = to_increments(log)
        attitude, velocity = chained(ImuIncrements(time[2:], increments.inc_theta_b[2:], increments.inc_v_b[2:]))
        true_attitude, true_velocity = reached(time)
        turned_by.append((true_attitude.inv() * attitude).magnitude())
        velocity_by.append(np.linalg.norm(velocity - true_velocity))
        two = np.array([to_increments(rows(log, k - 2, k + 1)).inc_theta_b[-1] for k in range(3, time.size)])
        attitude, _ = chained(ImuIncrements(time[2:], two, increments.inc_v_b[2:]))
        turned_by_two.append((true_attitude.inv() * attitude).magnitude())
    assert order(turned_by) == pytest.approx([4.0, 4.0], abs=0.4)
    assert order(velocity_by) == pytest.approx([4.0, 4.0], abs=0.4)
    assert order(turned_by_two) == pytest.approx([3.0, 3.0], abs=0.3)
    assert turned_by[-1] < turned_by_two[-1] / 10.0


def test_factors_for_equal_intervals_and_for_a_start():
    assert np.allclose(correction_factors(0.01, 0.01, 0.01, 1.0), np.array([17.0, -2.0, -3.0]) / 120.0, atol=1e-15)
    nearly = correction_factors(0.01, 0.01 * (1.0 + 2.0 * EQUAL), 0.01, 1.0)
    assert np.allclose(nearly, np.array([17.0, -2.0, -3.0]) / 120.0, atol=1e-6)
    assert nearly[2] != -3.0 / 120.0
    assert correction_factors(0.01, 0.01, 0.0, 1.0) == pytest.approx((1.0 / 12.0, 0.0, 0.0))
    assert correction_factors(0.01, 0.0, 0.0, 1.0) == (0.0, 0.0, 0.0)


def test_far_longer_intervals_are_not_extrapolated_to():
    assert correction_factors(0.99 * LONGEST_RATIO, 1.0, 1.0, np.inf)[1] != 0.0
    for before in ((1.0, 2.0), (2.0, 1.0)):
        k1, k2, k3 = correction_factors(1.01 * LONGEST_RATIO, *before, np.inf)
        assert k1 > 0.0
        assert k2 == k3 == 0.0


@pytest.mark.parametrize("steps", [(1.0, 1.0, 1.0), (3.0, 1.0, 1.0), (0.3, 1.0, 1.0), (1.0, 3.0, 0.4)])
def test_noise_is_not_amplified(steps):
    """The corrections add less than 1 % of the noise of an increment of 0.1 rad, in variance."""
    dt, dt1, dt2 = steps
    k1, k2, k3 = correction_factors(dt, dt1, dt2, np.inf)
    turn = 0.1 / dt
    share = [turn * (k1 * dt1 + k2 * dt2), turn * (k1 * dt - k3 * dt2), turn * (k2 * dt + k3 * dt1)]
    assert np.square(share) @ [dt, dt1, dt2] / dt < 0.01


def test_sculling_drift_of_a_rate_sensor_is_half_as_large_and_falls_with_the_second_power():
    with_it = [sculling_drift("rates", n) for n in (20, 40, 80)]
    assert order(with_it) == pytest.approx([2.0, 2.0], abs=0.1)
    assert with_it[2] / sculling_drift("rates", 80, sculling=False) == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_shapes_and_stamps(kind):
    log = random_log(kind, 7, seed=1)
    got = to_increments(log)
    assert len(got) == 6
    assert got.inc_theta_b.shape == got.inc_v_b.shape == (6, 3)
    assert np.array_equal(got.time, log.time)
    assert np.array_equal(got.dt, np.diff(log.time))


def test_rates_at_rest_give_the_mean_times_the_interval():
    time = np.array([0.0, 0.01, 0.03])
    log = ImuLog(time, np.zeros((3, 3)), np.tile([0.0, 0.0, -9.81], (3, 1)))
    got = to_increments(log)
    assert np.array_equal(got.inc_theta_b, np.zeros((2, 3)))
    assert got.inc_v_b[:, 2] == pytest.approx([-0.0981, -0.1962], abs=1e-16)


def test_the_first_increment_of_a_log_is_not_used():
    log = random_log("increments", 5, seed=2)
    spoilt = ImuLog(log.time, log.gyro.copy(), log.accel.copy(), log.kind)
    spoilt.gyro[0] = spoilt.accel[0] = np.nan
    got, other = to_increments(log), to_increments(spoilt)
    assert np.array_equal(got.inc_theta_b, other.inc_theta_b)
    assert np.array_equal(got.inc_v_b, other.inc_v_b)
    assert np.array_equal(got.inc_theta_b[0], log.gyro[1])


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("n", [0, 1])
def test_a_log_without_an_interval_gives_no_increments(kind, n):
    got = to_increments(random_log(kind, n, seed=3))
    assert len(got) == got.dt.size == 0
    assert got.time.size == n


def test_float32_logs_are_taken():
    log = random_log("increments", 5, seed=4)
    got = to_increments(ImuLog(log.time, log.gyro.astype(np.float32), log.accel.astype(np.float32), log.kind))
    assert got.inc_theta_b.dtype == got.inc_v_b.dtype == np.float64
    assert np.array_equal(got.inc_v_b[0], log.accel[1].astype(np.float32))


def test_across_a_gap_rates_are_joined_by_the_trapezoid_alone():
    log = random_log("rates", 10, seed=5, gap_at=4)
    got, plain = to_increments(log, gap_s=0.1), to_increments(log)
    half = 0.5 * got.dt[:, None]
    assert np.array_equal(got.inc_theta_b[3], (half * (log.gyro[:-1] + log.gyro[1:]))[3])
    assert np.array_equal(got.inc_v_b[3], (half * (log.accel[:-1] + log.accel[1:]))[3])
    assert not np.array_equal(plain.inc_theta_b[3], got.inc_theta_b[3])
    others = np.delete(np.arange(9), 3)
    assert np.array_equal(plain.inc_theta_b[others], got.inc_theta_b[others])


def test_across_a_gap_and_after_it_increments_stand_alone():
    log = random_log("increments", 10, seed=6, gap_at=4)
    log.accel[:] = log.accel / np.linalg.norm(log.accel, axis=1)[:, None] * np.diff(log.time, prepend=99.995)[:, None]
    got, plain = to_increments(log, gap_s=0.1), to_increments(log)
    assert np.array_equal(got.inc_theta_b[3:5], log.gyro[4:6])
    assert np.array_equal(got.inc_v_b[3:5], log.accel[4:6])
    second = to_increments(rows(log, 4, 7))
    assert np.array_equal(got.inc_theta_b[5], second.inc_theta_b[1])
    others = np.delete(np.arange(9), [3, 4, 5])
    assert np.array_equal(plain.inc_theta_b[others], got.inc_theta_b[others])
    assert not np.array_equal(plain.inc_v_b[4], got.inc_v_b[4])


def steady(lost: bool, whole: bool) -> ImuLog:
    """Nine steps of 10 ms of a sensor that turns steadily at 1 g, five rows missing in the middle; the row behind them
    covers its own step or the whole hole."""
    time = np.delete(0.01 * np.arange(15), [6, 7, 8, 9, 10] if lost else [])
    dt = np.diff(time, prepend=-0.01) if whole else np.full(time.size, 0.01)
    return ImuLog(time, dt[:, None] * [0.1, -0.2, 0.3], dt[:, None] * [0.5, 0.0, -9.8], "increments")


@pytest.mark.parametrize("whole", [False, True])
def test_rows_that_are_missing_are_bridged_and_long_rows_are_left_alone(whole):
    got, full = to_increments(steady(True, whole)), to_increments(steady(False, False))
    assert np.abs(got.inc_v_b.sum(axis=0) - full.inc_v_b.sum(axis=0)).max() < 1e-6
    assert np.abs(got.inc_theta_b.sum(axis=0) - full.inc_theta_b.sum(axis=0)).max() < 1e-9
    assert got.inc_v_b[5, 2] == pytest.approx(-9.8 * 0.06, abs=1e-6)


@given(
    kind=st.sampled_from(["rates", "increments"]),
    cuts=st.lists(st.integers(0, 40), max_size=12),
    restart=st.integers(0, 12),
)
def test_any_cut_into_blocks_gives_the_same_bits(kind, cuts, restart):
    log = random_log(kind, 40, seed=7, gap_at=20)
    whole = to_increments(log, gap_s=0.1)
    builder = IncrementsBuilder(kind, gap_s=0.1)
    edges = [0, *sorted(cuts), 40]
    blocks = []
    for k, (start, stop) in enumerate(pairwise(edges)):
        if k == restart:
            saved = builder.state()
            builder = IncrementsBuilder(kind, gap_s=0.1)
            builder.restore(saved)
        blocks.append(builder.feed(rows(log, start, stop)))
    assert np.array_equal(np.concatenate([b.inc_theta_b for b in blocks]), whole.inc_theta_b)
    assert np.array_equal(np.concatenate([b.inc_v_b for b in blocks]), whole.inc_v_b)
    assert np.array_equal(np.concatenate([b.time[1:] for b in blocks]), whole.time[1:])


def test_a_saved_state_does_not_follow_the_builder():
    log = random_log("increments", 10, seed=8)
    builder = IncrementsBuilder("increments")
    builder.feed(rows(log, 0, 5))
    saved = builder.state()
    kept = saved.copy()
    first = builder.feed(rows(log, 5, 10))
    assert np.array_equal(saved, kept)
    builder.restore(saved)
    saved[:] = 0.0
    second = builder.feed(rows(log, 5, 10))
    assert np.array_equal(first.inc_theta_b, second.inc_theta_b)
    builder.restore(np.empty(0))
    assert len(builder.feed(rows(log, 0, 5))) == 4


def test_a_block_of_the_other_kind_is_refused():
    builder = IncrementsBuilder("rates")
    with pytest.raises(InputError, match="a block of increments in a log of rates"):
        builder.feed(random_log("increments", 3, seed=9))


@pytest.mark.parametrize("bad", [100.0, 0.0, np.nan])
def test_time_that_does_not_increase_is_refused_with_its_row(bad):
    log = random_log("rates", 6, seed=10)
    log.time[3] = bad
    with pytest.raises(InputError, match="imu: time does not increase at row 3"):
        to_increments(log)


def test_a_block_that_does_not_follow_the_last_is_refused_and_changes_nothing():
    log = random_log("increments", 6, seed=11)
    builder = IncrementsBuilder("increments")
    builder.feed(rows(log, 0, 4))
    with pytest.raises(InputError, match="at row 0"):
        builder.feed(rows(log, 3, 6))
    assert np.array_equal(builder.feed(rows(log, 4, 6)).inc_v_b, to_increments(log).inc_v_b[3:])


@pytest.mark.parametrize("state", [np.zeros(7), np.zeros((1, 9)), 0.0, np.zeros(16)])
def test_a_state_of_the_wrong_shape_is_refused(state):
    with pytest.raises(InputError, match="from rates is restored from 0 or 14 numbers"):
        IncrementsBuilder("rates").restore(state)


def test_a_builder_of_increments_says_which_states_it_takes():
    with pytest.raises(InputError, match=r"from increments is restored from 0 or 14 or 21 numbers, not \(8,\)"):
        IncrementsBuilder("increments").restore(np.zeros(8))
