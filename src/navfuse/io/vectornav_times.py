"""When the messages of a VectorNav sensor were measured: which clock, which rows have a time, what was left out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from navfuse.data.gps_epoch import GpsEpoch
from navfuse.errors import ConfigError, InputError
from navfuse.io.gps_time import WEEK
from navfuse.io.repair import check_isolated, time_order
from navfuse.io.vectornav_messages import Messages, VectorNavLog

Array = np.ndarray
Clock = Literal["auto", "gps", "file", "startup"]

_NS = 1e-9
_ABSURD = 1e12
_LAST_WEEK = 10000
_WEEK_NS = round(WEEK / _NS)


def timed_rows(
    log: VectorNavLog, messages: Messages, group: str, clock: Clock, rate_hz: float | None
) -> tuple[Array, Array, list[str]]:
    """Increasing times of messages.

    Parameters
    ----------
    log : VectorNavLog
    messages : Messages
        Of the log.
    group : str
        Of the fields with GPS time: "time", or a receiver's, whose fixes are kept once each.
    clock, rate_hz
        As :func:`navfuse.io.vectornav_logs.vectornav_imu` has them.

    Returns
    -------
    time : (m,) array [s]
    rows : (m,) int array
        Which of the messages they are.
    notes : list of str
        What was left out.

    Raises
    ------
    InputError
        If there is no such time, or fewer than two messages have it.
    ConfigError
        For an unusable `clock` or `rate_hz`.
    """
    notes: list[str] = []
    chosen = clock_of(log, messages, group, clock, rate_hz)
    if chosen == "rate":
        if rate_hz is None:
            raise InputError(
                f"{log.source}: {messages.kind} has no time, neither in the message nor in front of it; give its rate"
                " with rate_hz"
            )
        if not (np.isfinite(rate_hz) and rate_hz > 0.0):
            raise ConfigError(f"rate_hz = {rate_hz} has to be a positive number of messages per second")
        notes.append(
            f"{log.source}: the times of {messages.kind} are counted with the stated {rate_hz:g} Hz from 0; messages"
            " that left no trace shift all that follow"
        )
        keep = np.arange(len(messages))
        _check_number(log, messages, keep)
        return messages.index / rate_hz, keep, notes
    time = {
        "file": lambda: messages.stamp,
        "startup": lambda: _startup(messages),
        "gps": lambda: _gps(log, messages, group),
    }
    stamps = time[chosen]()
    keep = np.flatnonzero(np.isfinite(stamps))
    if keep.size < len(messages):
        notes.append(f"{log.source}: {len(messages) - keep.size} of {len(messages)} {messages.kind} had no time yet")
    if group != "time" and keep.size:
        # A receiver's fix is sent again with every packet until the next one.
        new = _first_sent(messages, group, stamps, keep)
        keep = keep[new]
    order = time_order(stamps[keep], "time", log.source, row_names(messages, keep)) if keep.size else None
    if order is not None:
        keep = keep[order.order[order.first]]
        notes.append(f"{order.note}: sorted by time, the first row of each stamp kept")
    _check_number(log, messages, keep)
    return stamps[keep], keep, notes


def numbers(values: Array) -> Array:
    """Values as float64, NaN where they are beyond 1e12, which is no measurement."""
    with np.errstate(invalid="ignore"):
        floats = np.asarray(values).astype(float)
    return np.where(np.abs(floats) < _ABSURD, floats, np.nan)


def finite_rows(
    log: VectorNavLog,
    messages: Messages,
    values: Array,
    time: Array,
    keep: Array,
    notes: list[str],
    whole: bool = False,
) -> tuple[Array, Array]:
    """Times and rows without those that are NaN or infinite; none may be if the log has to be `whole`."""
    bad = np.logical_not(np.all(np.isfinite(values[keep]), axis=1))
    if not bad.any():
        return time, keep
    tell = row_names(messages, keep)
    if whole:
        raise InputError(
            f"{log.source}: {tell(int(np.argmax(bad)))} holds NaN or infinite increments, whose motion is lost; read"
            " the rates instead"
        )
    check_isolated(bad, log.source, tell, "NaN or infinite values")
    notes.append(f"{log.source}: {np.count_nonzero(bad)} rows with NaN or infinite values were left out")
    _check_number(log, messages, keep[~bad])
    return time[~bad], keep[~bad]


def _check_number(log: VectorNavLog, messages: Messages, keep: Array) -> None:
    if keep.size < 2:
        raise InputError(
            f"{log.source}: {keep.size} of {len(messages)} {messages.kind} can be used; at least two are needed"
        )


def clock_of(log: VectorNavLog, messages: Messages, group: str, clock: Clock, rate_hz: float | None = None) -> str:
    """The clock that is taken: "file", "gps", "startup" or "rate"."""
    there = {
        "file": bool(np.isfinite(messages.stamp).any()),
        "gps": _gps_ns(messages, group) is not None,
        "startup": any(name.endswith("time_startup_ns") for name in messages.values),
    }
    if clock == "auto":
        return "rate" if rate_hz is not None else next((name for name, has in there.items() if has), "rate")
    if clock not in there:
        raise ConfigError(f"clock = {clock!r} has to be 'auto', {', '.join(map(repr, there))}")
    if not there[clock]:
        raise InputError(f"{log.source}: {messages.kind} has no time of the clock {clock!r}; leave it to 'auto'")
    return clock


def _startup(messages: Messages) -> Array:
    name = next(name for name in messages.values if name.endswith("time_startup_ns"))
    return np.asarray(messages.values[name]) * _NS


def _gps_ns(messages: Messages, group: str) -> tuple[Array, Array] | None:
    """GPS week and nanoseconds of the week, week 0 where they are unknown or cannot be; None if no message has them."""
    values = messages.values
    pairs: list[tuple[Array, Array]] = []
    for place, tow, week in ((group, "tow_ns", "week"), ("time", "gps_tow_ns", "gps_week")):
        names = f"{place}.{week}", f"{place}.{tow}"
        if all(name in values for name in names):
            pairs.append((_integers(values[names[0]]), _integers(values[names[1]])))
    whole = [name for name in ("time.time_gps_ns", "common.time_gps_ns") if name in values]
    pairs += [np.divmod(_integers(values[name]), _WEEK_NS) for name in whole]
    for weeks, rest in pairs:
        known = (weeks > 0) & (weeks < _LAST_WEEK) & (rest >= 0) & (rest < _WEEK_NS)
        if known.any():
            return np.where(known, weeks, 0), rest
    return None


def _integers(values: Array) -> Array:
    return np.asarray(values).astype(np.int64)


def _gps(log: VectorNavLog, messages: Messages, group: str) -> Array:
    found = _gps_ns(messages, group)
    assert found is not None
    weeks, rest = found
    return np.where(weeks > 0, (weeks - epoch_of(log).week) * WEEK + rest * _NS, np.nan)


def epoch_of(log: VectorNavLog) -> GpsEpoch:
    """Start of the first GPS week that any message tells: one for all logs of a file."""
    weeks = [
        found[0][found[0] > 0].min()
        for messages in log.messages.values()
        for group in ("time", "gnss1", "gnss2")
        if (found := _gps_ns(messages, group)) is not None
    ]
    return GpsEpoch.of(int(min(weeks)), 0.0)


def _first_sent(messages: Messages, group: str, stamps: Array, keep: Array) -> Array:
    """Rows of `keep` whose fix was not in the row before."""
    tow = messages.values.get(f"{group}.tow_ns")
    same = stamps if tow is None else np.asarray(tow)
    return np.concatenate(([True], np.diff(same[keep].astype(float)) != 0.0))


def row_names(messages: Messages, keep: Array) -> Callable[[int], str]:
    """Names rows of those kept for a person."""
    return lambda row: f"{messages.kind} number {int(messages.index[keep[row]]) + 1}"
