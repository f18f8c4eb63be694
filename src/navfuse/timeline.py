"""Logs to one ordered list of events."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

Array = np.ndarray


def merge_events(times: Sequence[Array]) -> tuple[Array, Array, Array]:
    """Order the measurements of several sensors in time.

    Parameters
    ----------
    times : sequence of (m_i,) arrays [s]
        Stamps of each sensor, each not decreasing.

    Returns
    -------
    time : (m,) array [s]
    sensor : (m,) int array
        Index into `times`. Measurements of equal time stand in the order of the sensors.
    row : (m,) int array
        Number of the measurement within its sensor.
    """
    if not len(times):
        return np.empty(0), np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    time = np.concatenate([np.asarray(t, dtype=float) for t in times])
    sensor = np.concatenate([np.full(len(t), i, dtype=np.int64) for i, t in enumerate(times)])
    row = np.concatenate([np.arange(len(t), dtype=np.int64) for t in times])
    order = np.lexsort((sensor, time))
    return time[order], sensor[order], row[order]


def group_events(time: Sequence[float], tolerance: float) -> Iterator[tuple[int, int]]:
    """First event and the one after the last of every group, of events sorted by time [s].

    A group reaches no further than `tolerance` behind its first event.
    """
    first = 0
    for k in range(1, len(time)):
        if time[k] - time[first] > tolerance:
            yield first, k
            first = k
    if len(time):
        yield first, len(time)
