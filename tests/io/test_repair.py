from __future__ import annotations

import numpy as np
import pytest

from navfuse.errors import InputError
from navfuse.io.repair import check_isolated, time_order


def where(row):
    return f"row {row + 1}"


def flags(n, *rows):
    mask = np.zeros(n, dtype=bool)
    mask[list(rows)] = True
    return mask


def test_isolated_rows_pass():
    check_isolated(flags(1000, 0, 10, 11, 12, 13, 14, 999), "f", where, "NaN")
    check_isolated(flags(10), "f", where, "NaN")


def test_long_run_is_refused():
    with pytest.raises(InputError, match="f: NaN in 6 rows in succession from row 11 on"):
        check_isolated(flags(1000, 3, *range(10, 16)), "f", where, "NaN")


def test_run_at_the_end_is_refused():
    with pytest.raises(InputError, match="in 6 rows in succession from row 995 on"):
        check_isolated(flags(1000, *range(994, 1000)), "f", where, "NaN")


def test_one_per_cent_is_refused():
    check_isolated(flags(1000, *range(0, 990, 110)), "f", where, "NaN")
    with pytest.raises(InputError, match="NaN in 10 of 1000 rows, the first is row 1;"):
        check_isolated(flags(1000, *range(0, 1000, 100)), "f", where, "NaN")


def test_increasing_time_needs_nothing():
    assert time_order(np.arange(10.0), "time_s", "f", where) is None
    assert time_order(np.zeros(1), "time_s", "f", where) is None


def test_late_and_repeated_rows():
    time = np.arange(1000.0)
    time[[500, 501]] = time[[501, 500]]
    time[700] = 699.0
    order = time_order(time, "time_s", "f", where)
    assert order.note == "f: 1 rows are out of order and 1 rows repeat a time stamp of 1000, the first is row 502"
    sorted_time = time[order.order]
    assert (np.diff(sorted_time[order.first]) > 0.0).all()
    assert order.order[order.first].size == 999
    assert 699 in order.order[order.first]
    assert 700 not in order.order[order.first]


def test_reversed_time_is_refused():
    with pytest.raises(InputError) as raised:
        time_order(np.arange(1000.0)[::-1], "time_s", "f.csv", where)
    message = str(raised.value)
    assert message.startswith("f.csv: column 'time_s' does not increase: 999 rows are out of order of 1000")
    assert "the first is row 2 with 998 s after 999 s" in message
    assert "clock wrap" in message


def test_one_per_cent_of_repeated_stamps_is_refused():
    time = np.arange(1000.0)
    time[10:1000:100] = time[9:1000:100]
    with pytest.raises(InputError, match="10 rows repeat a time stamp of 1000, the first is row 11"):
        time_order(time, "time_s", "f", where)
