"""Wrong stamps are not lost rows: one early, a late one, jitter, bursts; and lost rows are filled all the same."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.data.logs import ImuLog
from navfuse.imu.increments import IncrementsBuilder, to_increments

STEP, ROWS = 0.01, 2000
TURN, FORCE = np.array([0.02, -0.01, 0.3]), np.array([0.4, -0.3, -9.8])


def log_of(time):
    """Rows that each cover one step, whatever their stamps say."""
    size = (time.size, 3)
    return ImuLog(
        time, np.broadcast_to(TURN * STEP, size).copy(), np.broadcast_to(FORCE * STEP, size).copy(), "increments"
    )


def regular():
    return STEP * np.arange(ROWS)


def total(log):
    return to_increments(log).inc_v_b.sum(axis=0) / (FORCE * STEP)


def one_stamp(row, by):
    time = regular()
    time[row] += by
    return time


def jitter(share):
    return regular() + share * STEP * np.random.default_rng(3).uniform(-1.0, 1.0, ROWS)


def bursts(count):
    last = np.minimum(count * (np.arange(ROWS) // count + 1) - 1, ROWS - 1)
    return STEP * last + 1e-4 * (np.arange(ROWS) % count)


WRONG_STAMPS = {
    "4 ms": one_stamp(900, -0.006),
    "1 ms": one_stamp(900, -0.009),
    "10 us": one_stamp(900, -0.00999),
    "late": one_stamp(900, 0.006),
    "second": one_stamp(1, -0.008),
    "third": one_stamp(2, -0.008),
    "sixth": one_stamp(5, -0.008),
    "jitter 10 %": jitter(0.1),
    "jitter 30 %": jitter(0.3),
    "bursts of 2": bursts(2),
    "bursts of 4": bursts(4),
    "bursts of 10": bursts(10),
    "a backlog at the start": np.concatenate([1e-4 * np.arange(50), 1e-4 * 49 + STEP * np.arange(1, 1000)]),
}


@pytest.mark.parametrize("name", WRONG_STAMPS)
def test_wrong_stamps_add_and_lose_nothing(name):
    time = WRONG_STAMPS[name]
    assert total(log_of(time)) == pytest.approx(time.size - 1, rel=1e-9)


@pytest.mark.parametrize("lost", [1, 3, 100])
@pytest.mark.parametrize("glitch", [None, 890, 898])
def test_rows_that_are_lost_are_filled(lost, glitch):
    time = regular()
    if glitch is not None:
        time[glitch] -= 0.006
    time = np.delete(time, np.arange(900, 900 + lost))
    assert total(log_of(time)) == pytest.approx(ROWS - 1, abs=0.02 * lost + 0.01)


def test_a_row_that_covers_a_longer_interval_is_left_as_it_is():
    time = np.concatenate([regular()[:1000], regular()[1000] + 3.0 * STEP + regular()[:500]])
    log = log_of(time)
    log.accel[1000] *= 4.0
    log.gyro[1000] *= 4.0
    assert total(log) == pytest.approx(time.size - 1 + 3.0, rel=1e-9)


def test_a_new_rate_is_learnt():
    time = np.concatenate([STEP * np.arange(500), 5.01 + 2.0 * STEP * np.arange(500)])
    log = log_of(time)
    log.accel[500:] *= 2.0
    log.gyro[500:] *= 2.0
    assert total(log) == pytest.approx(499 + 1000, rel=1e-9)


def test_a_log_that_seems_to_lose_every_second_row_is_believed_in_the_end():
    """A new rate that begins with a wrong stamp: rows of two steps that look like one step and twice the force."""
    time = np.concatenate([STEP * np.arange(500), 5.0 + 2.0 * STEP * np.arange(500)])
    log = log_of(time)
    log.accel[500:] *= 2.0
    log.gyro[500:] *= 2.0
    assert total(log) == pytest.approx(499 + 1000, abs=25.0)


@pytest.mark.parametrize("name", ["1 ms", "jitter 30 %", "bursts of 4"])
def test_blocks_and_restarts_give_the_same_bits(name):
    log = log_of(WRONG_STAMPS[name])
    whole = to_increments(log)
    builder, parts = IncrementsBuilder("increments"), []
    for k in range(300):
        row = ImuLog(log.time[k : k + 1], log.gyro[k : k + 1], log.accel[k : k + 1], "increments")
        parts.append(builder.feed(row))
        again = IncrementsBuilder("increments")
        again.restore(builder.state())
        builder = again
    assert np.array_equal(np.concatenate([part.inc_v_b for part in parts]), whole.inc_v_b[:299])
