from __future__ import annotations

import numpy as np
import pytest

from navfuse.io.gps_time import days_since_epoch, leap_seconds, utc_of_gps


@pytest.mark.parametrize(
    ("day", "days"), [((1980, 1, 6), 0), ((1999, 8, 22), 7 * 1024), ((2025, 7, 8), 7 * 2374 + 2), ((2000, 3, 1), 7360)]
)
def test_days(day, days):
    assert days_since_epoch(*day) == days


def test_no_such_date():
    with pytest.raises(ValueError, match="day"):
        days_since_epoch(2023, 2, 29)


@pytest.mark.parametrize(
    ("day", "seconds"),
    [
        ((1980, 1, 6), 0),
        ((1981, 6, 30), 0),
        ((1981, 7, 1), 1),
        ((1999, 1, 1), 13),
        ((2005, 12, 31), 13),
        ((2006, 1, 1), 14),
        ((2015, 7, 1), 17),
        ((2016, 12, 31), 17),
        ((2017, 1, 1), 18),
        ((2026, 1, 1), 18),
    ],
)
def test_leap_seconds(day, seconds):
    assert leap_seconds(days_since_epoch(*day)) == seconds


def test_utc_of_every_leap_second():
    """A second that GPS time counts through is 23:59:60 in UTC, at each of the dates of the scalar function."""
    steps = [day for day in range(1, 365 * 40) if leap_seconds(day) != leap_seconds(day - 1)]
    assert len(steps) == 18
    for day in steps:
        before = leap_seconds(day - 1)
        start = day * 86400 + before
        days, clock = utc_of_gps(np.array([start - 1, start, start + 1, start + 2]))
        assert days.tolist() == [day - 1, day - 1, day, day]
        assert clock.tolist() == [86399, 86400, 0, 1]


def test_utc_by_the_scalar_function():
    ticks = np.concatenate([[0, 1], np.arange(3, 14_000, 7) * 8_640_011]) * 10
    days, clock = utc_of_gps(ticks, 100)
    offset = np.array([leap_seconds(int(day)) for day in days])
    np.testing.assert_array_equal(days * 8_640_000 + clock + 100 * offset, ticks)
    assert clock.min() >= 0
    assert clock.max() < 8_640_000


def test_utc_within_a_leap_second():
    """2016-12-31 23:59:60.25 UTC is 2017-01-01 00:00:17.25 in GPS time (IERS Bulletin C 52)."""
    midnight = days_since_epoch(2017, 1, 1) * 86400
    days, clock = utc_of_gps(np.array([(midnight + 17) * 100 + 25]), 100)
    assert days.tolist() == [days_since_epoch(2016, 12, 31)]
    assert clock.tolist() == [86400 * 100 + 25]


def test_utc_on_the_first_day():
    days, clock = utc_of_gps(np.array([0, 5, 86400]))
    assert days.tolist() == [0, 0, 1]
    assert clock.tolist() == [0, 5, 0]
