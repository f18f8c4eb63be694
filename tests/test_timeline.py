from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from navfuse.timeline import group_events, merge_events


def test_measurements_of_equal_time_stand_in_the_order_of_the_sensors():
    time, sensor, row = merge_events([np.array([1.0, 2.0, 2.0, 5.0]), np.array([2.0, 4.0]), np.array([0.5, 2.0])])
    assert time.tolist() == [0.5, 1.0, 2.0, 2.0, 2.0, 2.0, 4.0, 5.0]
    assert sensor.tolist() == [2, 0, 0, 0, 1, 2, 1, 0]
    assert row.tolist() == [0, 0, 1, 2, 0, 1, 1, 3]


def test_nothing_to_merge():
    for times in ([], [np.empty(0), np.empty(0)]):
        for part in merge_events(times):
            assert part.size == 0


stamps = st.lists(st.floats(0.0, 10.0).map(lambda t: round(t, 1)), max_size=20).map(sorted)


@given(st.lists(stamps, min_size=1, max_size=4))
def test_every_measurement_appears_once_in_order(logs):
    time, sensor, row = merge_events([np.array(log) for log in logs])
    keys = list(zip(time, sensor, row, strict=True))
    assert keys == sorted(keys)
    assert len(set(keys)) == sum(len(log) for log in logs)
    assert all(logs[s][r] == t for t, s, r in keys)


def test_a_group_reaches_no_further_than_the_tolerance_behind_its_first_event():
    assert list(group_events([1.0, 1.0, 1.4, 1.8, 2.3, 2.7], 0.5)) == [(0, 3), (3, 5), (5, 6)]
    assert list(group_events([3.0], 0.5)) == [(0, 1)]
    assert list(group_events([], 0.5)) == []
