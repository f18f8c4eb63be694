"""Channels of an inertial log that are dead, stuck or clipped, or that repeat another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.inspection.findings import Finding, Verdict

Array = np.ndarray

_G = STANDARD_GRAVITY
SAMPLE = 20000
STUCK_S, STUCK_ROWS = 1.0, 50
"""A channel that holds one value for so long while others of its sensor move is stuck."""
CLIPPED_RUN, CLIPPED_ROWS = 3, 12
_GYRO_SCALES = (125.0, 250.0, 300.0, 450.0, 500.0, 1000.0, 2000.0, 4000.0)
_ACCEL_SCALES = (2.0, 4.0, 5.0, 6.0, 8.0, 10.0, 16.0, 18.0, 30.0, 32.0)


def check_channels(time: Array, gyro: Array, accel: Array, names: Sequence[str]) -> list[Finding]:
    """Channels that are dead, stuck or clipped, or that repeat another.

    Parameters
    ----------
    time : (n,) array [s]
    gyro, accel : (n, 3) arrays
        Finite, rates or increments.
    names : sequence of 7 str
        Columns: time, gyros, accelerometers.
    """
    found = []
    step = float(np.median(np.diff(time)))
    least = max(STUCK_ROWS, round(STUCK_S / step))
    for triad, sensor, first in ((gyro, "gyros", 1), (accel, "accelerometers", 4)):
        same = triad[1:] == triad[:-1]
        alive = np.array([is_noisy(triad[:, k]) for k in range(3)])
        for k in range(3):
            others = [j for j in range(3) if j != k]
            name = names[first + k]
            if not alive[others].any():
                continue
            start, length = longest_run(same[:, k])
            if length == time.size:
                found.append(
                    Finding(
                        "stuck channel",
                        Verdict.WRONG,
                        f"column '{name}' is {triad[0, k]:.6g} in all {length} rows while the other {sensor} change: "
                        "the axis is dead or stuck",
                        "check the sensor and the export; the log cannot be used without this axis",
                        figures={"stuck_s": float(time[-1] - time[0])},
                    )
                )
                continue
            if length < least:
                continue
            moving = ~same[start : start + length - 1][:, others]
            if not (moving.mean(axis=0) > 0.5).any() or _coarse(same[:, k], length):
                continue
            seconds = float(time[start + length - 1] - time[start])
            found.append(
                Finding(
                    "stuck channel",
                    Verdict.WRONG if seconds > 5.0 * STUCK_S else Verdict.LOOK,
                    f"column '{name}' stays at {triad[start, k]:.6g} for {seconds:.4g} s ({length} rows) from "
                    f"{time[start]:.6g} s on while the other {sensor} change: the axis is stuck there",
                    "cut the log there, or check the sensor and the export",
                    figures={"stuck_s": seconds, "from_s": float(time[start])},
                )
            )
        found += _clipped(triad, step, names[first : first + 3], "gyro" if first == 1 else "accel")
    found += _copies(np.hstack((gyro, accel)), names[1:])
    if not found:
        found.append(Finding("channels", Verdict.OK, "six channels, none stuck, clipped or there twice"))
    return found


def is_noisy(values: Array) -> bool:
    """Whether a channel has the noise of a sensor; ideal simulated ones have none, and may well be constant."""
    head = values[: min(values.size, SAMPLE)]
    bend = np.abs(np.diff(head, 2))
    return bool(bend.size and np.mean(bend > 0.0) > 0.3 and np.mean(bend) > 1e-3 * np.std(head))


def longest_run(same: Array) -> tuple[int, int]:
    """First row and number of rows of the longest run of equal values."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], same, [False])).astype(np.int8)))
    if not edges.size:
        return 0, 1
    lengths = edges[1::2] - edges[::2]
    k = int(np.argmax(lengths))
    return int(edges[2 * k]), int(lengths[k]) + 1


def _coarse(same: Array, length: int) -> bool:
    """Whether runs nearly as long are usual, as with a coarse converter at rest."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], same, [False])).astype(np.int8)))
    lengths = np.sort(edges[1::2] - edges[::2])[::-1]
    return lengths.size > 3 and bool(lengths[3] > 0.3 * length)


def _clipped(triad: Array, step: float, names: Sequence[str], sensor: str) -> list[Finding]:
    """Values that pile up at the largest of a channel, several in succession."""
    found = []
    for k, name in enumerate(names):
        values = triad[:, k]
        spread = float(np.std(values))
        for limit in (float(values.max()), float(values.min())):
            at = values == limit
            count = int(np.count_nonzero(at))
            if count < CLIPPED_ROWS or spread == 0.0 or abs(limit - float(np.median(values))) < spread:
                continue
            _, run = longest_run(at[1:] & at[:-1])
            if run < CLIPPED_RUN or count < 5 * _usual_count(values, limit):
                continue
            scale = _full_scale(abs(limit), sensor)
            found.append(
                Finding(
                    "saturation",
                    Verdict.LOOK,
                    f"column '{name}': {count} rows sit at exactly {limit:.6g}, up to {run} in succession "
                    f"({run * step:.3g} s): the channel is clipped at its range{scale}",
                    "the motion beyond it is lost; use a sensor or a setting with a wider range",
                    figures={"limit": limit, "rows": float(count)},
                )
            )
    return found


def _usual_count(values: Array, limit: float) -> int:
    """How often the ten values next to the limit occur, the most frequent of them."""
    beside = values[np.abs(values - limit) < 0.1 * abs(limit)]
    levels, counts = np.unique(beside[beside != limit], return_counts=True)
    nearest = np.argsort(np.abs(levels - limit))[:10]
    return int(counts[nearest].max(initial=1))


def _full_scale(limit: float, sensor: str) -> str:
    size, ranges, unit = (np.pi / 180.0, _GYRO_SCALES, "deg/s") if sensor == "gyro" else (_G, _ACCEL_SCALES, "g")
    for full in ranges:
        if abs(limit / (full * size) - 1.0) < 0.03:
            return f", about {full:g} {unit}"
    return ""


def _copies(values: Array, names: Sequence[str]) -> list[Finding]:
    found = []
    for k in range(1, values.shape[1]):
        for j in range(k):
            if np.ptp(values[:, k]) > 0.0 and np.array_equal(values[:, j], values[:, k]):
                message = f"column '{names[k]}' is a copy of '{names[j]}'"
                remedy = "export the log again; noise never comes twice"
                found += [Finding("columns", Verdict.WRONG, message, remedy)]
    return found
