from __future__ import annotations

from datetime import UTC, datetime

import pytest

from navfuse.data.gps_epoch import GpsEpoch
from navfuse.report.clock import clock_of, leap_at, utc_clock, utc_text

LEAP_2017 = 1930 * 7 * 86400.0 + 17.0
"""GPS time at which the leap second at the end of 2016 begins: 2017-01-01 was the Sunday of week 1930."""


def test_utc_of_a_known_log():
    """Week 2374 began on Sunday, 2025-07-06; GPS time has been 18 s ahead since 2017."""
    epoch = GpsEpoch(2374, 3 * 86400.0 + 19 * 3600.0 + 34 * 60.0)
    assert utc_text(epoch, 18.0) == "2025-07-09 19:34:00"
    assert utc_text(epoch, 17.99) == "2025-07-09 19:33:59"
    assert utc_clock(epoch, 18.0) == " (19:34:00 UTC)"
    assert utc_clock(None, 18.0) == ""


def test_the_first_second_of_gps_time():
    assert utc_text(GpsEpoch(0, 0.0), 0.0) == "1980-01-06 00:00:00"


@pytest.mark.parametrize(
    ("since", "text", "leap"),
    [
        (-1.0, "2016-12-31 23:59:59", 17),
        (0.0, "2016-12-31 23:59:60", 17),
        (0.9, "2016-12-31 23:59:60", 17),
        (1.0, "2017-01-01 00:00:00", 18),
    ],
)
def test_a_leap_second(since, text, leap):
    epoch = GpsEpoch(1929, 0.0)
    time = LEAP_2017 + since - epoch.seconds
    assert utc_text(epoch, time) == text
    assert leap_at(LEAP_2017 + since) == leap


def test_what_the_script_adds_to_log_times_is_unix_time():
    epoch = GpsEpoch(2374, 243258.0)
    found = clock_of(epoch, 10.0, 500.0)
    assert found is not None
    assert (found["week"], found["tow"]) == (2374, 243258.0)
    ((start, unix),) = found["unix"]
    assert start == 10.0
    assert datetime.fromtimestamp(unix + 10.0, UTC).strftime("%Y-%m-%d %H:%M:%S") == utc_text(epoch, 10.0)
    assert clock_of(None, 0.0, 1.0) is None


def test_a_leap_second_within_the_run():
    epoch = GpsEpoch(1929, 0.0)
    start = LEAP_2017 - epoch.seconds - 100.0
    found = clock_of(epoch, start, start + 200.0)
    assert found is not None
    (_, before), (change, after) = found["unix"]
    assert change == pytest.approx(start + 101.0)
    assert after == before - 1.0
    assert datetime.fromtimestamp(after + change, UTC) == datetime(2017, 1, 1, tzinfo=UTC)


def test_a_log_that_begins_in_a_later_week_than_its_epoch():
    found = clock_of(GpsEpoch(1929, 604700.0), 150.0, 700_000.0)
    assert found is not None
    assert (found["week"], found["tow"]) == (1930, -100.0)
    before = clock_of(GpsEpoch(1929, 100.0), -150.0, 700.0)
    assert before is not None
    assert (before["week"], before["tow"]) == (1928, 604900.0)
