"""What may be repaired in a log, and from where on it is refused.

Real logs have isolated flaws: a row of NaN after a bus error, a stamp written twice, a packet that came late. Below
one per cent of the rows they are repaired and counted in a note; above, something is wrong that a program should not
paper over.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfuse.errors import InputError
from navfuse.io.tables import Where

Array = np.ndarray

MAX_SHARE = 0.01
STUCK_ROWS = 10
STUCK_SHARE = 0.2
MAX_RUN = 5


@dataclass(frozen=True, slots=True)
class TimeOrder:
    """How to bring a log into the order of its stamps.

    Attributes
    ----------
    order : (m,) int array
        Rows in increasing order of time, among rows of equal time as they stood.
    first : (m,) bool array
        Over `order`: False for a row whose stamp the row before it has too.
    note : str
        What was found, with counts; names no remedy.
    """

    order: Array
    first: Array
    note: str


def count_rows(number: int) -> str:
    """The number with its noun, singular or plural."""
    return f"{number} row" if number == 1 else f"{number} rows"


def check_isolated(bad: Array, source: str, where: Where, fault: str) -> None:
    """Refuse flawed rows that are too many, or too many in a row, to be repaired.

    Parameters
    ----------
    bad : (n,) bool array
        True at flawed rows.
    source : str
        File, for the message.
    where : callable
        Row index -> its name for a person.
    fault : str
        What is wrong with them: "NaN or infinite values".

    Raises
    ------
    InputError
        If 1 % or more of the rows are flawed, or more than five in succession.
    """
    flawed = np.flatnonzero(bad)
    if flawed.size == 0:
        return
    edges = np.flatnonzero(np.diff(np.concatenate(([False], bad, [False])).astype(np.int8)))
    starts, lengths = edges[::2], np.diff(edges)[::2]
    longest = int(np.argmax(lengths))
    if lengths[longest] > MAX_RUN:
        raise InputError(
            f"{source}: {fault} in {lengths[longest]} rows in succession from {where(int(starts[longest]))} on; more"
            f" than {MAX_RUN} are not repaired, correct the file or cut it into two logs there"
        )
    if flawed.size >= MAX_SHARE * bad.size:
        raise InputError(
            f"{source}: {fault} in {flawed.size} of {bad.size} rows, the first is {where(int(flawed[0]))}; 1 % or more"
            " is not repaired, correct the file"
        )


def silent_rows(gyro: Array, accel: Array) -> Array:
    """Rows in which an inertial sensor was silent: all six values zero, or stuck at those of the rows before.

    Parameters
    ----------
    gyro, accel : (n, 3) arrays

    Returns
    -------
    (n,) array of bool
        A repeated row counts from the tenth in succession on, all of its run but the first. A log of which a fifth or
        more would count is a coarse or an ideal sensor at rest, and keeps its repeated rows.
    """
    zero = ~(gyro.any(axis=1) | accel.any(axis=1))
    same = np.zeros(zero.size, dtype=bool)
    same[1:] = np.all(gyro[1:] == gyro[:-1], axis=1) & np.all(accel[1:] == accel[:-1], axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], same, [False])).astype(np.int8)))
    stuck = np.zeros(zero.size, dtype=bool)
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        if end - start >= STUCK_ROWS:
            stuck[start:end] = True
    if np.count_nonzero(stuck & ~zero) >= STUCK_SHARE * stuck.size:
        stuck[:] = False
    if zero.mean() >= 0.5:
        zero = np.zeros_like(stuck)
    return zero | stuck


def time_order(time: Array, column: str, source: str, where: Where) -> TimeOrder | None:
    """Find rows that are out of order in time, and stamps that are there more than once.

    A row is out of order if an earlier row has a later stamp.

    Parameters
    ----------
    time : (n,) array [s]
        Finite stamps.
    column : str
        Name of the time column, for messages.
    source : str
        File, for messages.
    where : callable
        Row index -> its name for a person.

    Returns
    -------
    TimeOrder or None
        None if time increases strictly.

    Raises
    ------
    InputError
        If 1 % or more of the rows are out of order or repeat a stamp.
    """
    step = np.diff(time)
    if (step > 0.0).all():
        return None
    late = time < np.maximum.accumulate(time)
    order = np.argsort(time, kind="stable")
    first = np.concatenate(([True], np.diff(time[order]) > 0.0))
    n_late, n_repeated = int(np.count_nonzero(late)), int(np.count_nonzero(~first))
    flaw = int(np.argmin(step > 0.0)) + 1
    counts = [f"{n_late} rows are out of order"] * (n_late > 0) + [f"{n_repeated} rows repeat a time stamp"] * (
        n_repeated > 0
    )
    if n_late + n_repeated >= MAX_SHARE * time.size:
        cause = "Does the clock wrap at midnight or at the week's end, or are two logs joined?"
        if n_late == 0:
            cause = (
                f"Stamps in steps of {step[step > 0.0].min():.3g} s are too coarse; write them with more digits (64-bit"
                " numbers in Parquet)"
                if (step > 0.0).any()
                else "The clock stands still"
            )
        raise InputError(
            f"{source}: column '{column}' does not increase: {' and '.join(counts)} of {time.size}, the first is"
            f" {where(flaw)} with {time[flaw]:.9g} s after {time[flaw - 1]:.9g} s; 1 % or more is not repaired. {cause}"
        )
    return TimeOrder(order, first, f"{source}: {' and '.join(counts)} of {time.size}, the first is {where(flaw)}")
