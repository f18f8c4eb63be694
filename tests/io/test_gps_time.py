from __future__ import annotations

import pytest

from navfuse.io.gps_time import days_since_epoch, leap_seconds


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
