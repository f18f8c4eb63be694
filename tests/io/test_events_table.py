from __future__ import annotations

import numpy as np
import pytest

from navfuse.data.gps_epoch import GpsEpoch
from navfuse.errors import InputError, NavfuseWarning
from navfuse.io.events_table import read_events
from navfuse.io.gps_time import log_times
from navfuse.io.tables import write_table

EPOCH = GpsEpoch(2374, 243258.5)


def table(tmp_path, text):
    path = tmp_path / "events.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_log_times_in_any_unit_and_names(tmp_path):
    events = read_events(table(tmp_path, 'time_ms,label\n1500.25,"a, b"\n200,ü\n'))
    np.testing.assert_array_equal(events.time, [1.50025, 0.2])
    assert events.labels.tolist() == ["a, b", "ü"]


def test_rows_without_names_are_numbered(tmp_path):
    path = tmp_path / "events.parquet"
    write_table(path, {"time_s": np.array([5.0, 1.0, 3.0])})
    events = read_events(path)
    np.testing.assert_array_equal(events.time, [5.0, 1.0, 3.0])
    assert events.labels.tolist() == ["1", "2", "3"]


def test_gps_week_and_seconds(tmp_path):
    events = read_events(table(tmp_path, "gps_week,gps_tow_s\n2374,243260.75\n2375,0.25\n"), EPOCH)
    np.testing.assert_array_equal(events.time, [2.25, 604800.0 - 243258.5 + 0.25])


def test_utc(tmp_path):
    """GPS week 2374, 243258.5 s is Tuesday 2025-07-08 19:34:18.5 GPS time, 18 s less in UTC."""
    text = "utc\n2025-07-08T19:34:00.5Z\n2025-07-08T21:34:01.500001+02:00\n2025-07-08 19:35:00.5\n"
    np.testing.assert_array_equal(read_events(table(tmp_path, text), EPOCH).time, [0.0, 1.000001, 60.0])


def test_utc_across_a_leap_second():
    before = GpsEpoch(1930, 0.0)  # 2017-01-01 00:00:00 GPS time, 17 s before the leap second
    utc = np.array(["2016-12-31T23:59:59", "2017-01-01T00:00:00", "2017-01-01T00:00:01"], dtype="datetime64[us]")
    np.testing.assert_array_equal(log_times(before, utc), [16.0, 18.0, 19.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("label\na\n", "needs one kind of time: time_s, or gps_week and gps_tow_s, or utc; its columns are label"),
        ("time_s,utc\n1,2025-07-08T19:34:00Z\n", "needs one kind of time"),
        ("gps_week\n2374\n", "needs one kind of time: time_s, or gps_week and gps_tow_s, or utc$"),
        ("time\n1\n", "'time' has no unit"),
        ("time_s\n1\n\nnan\n", r"row 2 \(line 4\), column 'time_s': the value is empty or not a number"),
        ("time_s\n1\nx\n", "line 3"),
        ("time_s\n", "no rows"),
        ("gps_week,gps_tow_s\n2374.5,1\n", "column 'gps_week': has to be a whole week"),
        ("gps_week,gps_tow_s\n2374,\n", "column 'gps_tow_s': the value is empty"),
        ("utc\nyesterday\n", r"row 1 \(line 2\), column 'utc': 'yesterday' is no time of ISO 8601"),
        ("utc\n2016-12-31T23:59:60Z\n", "is no time of ISO 8601"),
    ],
)
def test_tables_that_are_of_no_use(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read_events(table(tmp_path, text), EPOCH)


@pytest.mark.parametrize("text", ["utc\n2025-07-08T19:34:00Z\n", "gps_week,gps_tow_s\n2374,1\n"])
def test_dates_need_an_epoch(tmp_path, text):
    with pytest.raises(InputError, match="gnss.epoch_week_s.*--epoch"):
        read_events(table(tmp_path, text))


def test_ignored_columns_are_named(tmp_path):
    with pytest.warns(NavfuseWarning, match="'shutter'"):
        read_events(table(tmp_path, "time_s,shutter\n1,2\n"))


def test_no_file(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        read_events(tmp_path / "events.csv")
