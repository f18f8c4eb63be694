"""From the columns of an aiding sensor's table to rows that can be trusted.

Shared by the readers of :mod:`navfuse.io.aiding_tables`: values are converted to SI units, rows without a measurement
are left out, time is put in order, and standard deviations are checked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from navfuse.errors import ConfigError, InputError
from navfuse.io.columns import Field, Match
from navfuse.io.repair import MAX_SHARE, count_rows, time_order
from navfuse.io.tables import CsvTable, ParquetTable, Where
from navfuse.io.units import scaled

Array = np.ndarray

TIME = Field("time", "time", "s")
MAX_EMPTY_SHARE = 0.5
ABSURD = 1e9
"""Values beyond this, in SI units, are taken for missing."""


@dataclass(frozen=True, slots=True)
class AidingRows:
    """Rows of a table, by base name of their column.

    Attributes
    ----------
    values : dict of str to (n,) array
        SI units, "time" among them; words as they stand.
    match : Match
    where : callable
        Row index -> its name for a person, in the file.
    notes : list of str
    """

    values: dict[str, Array]
    match: Match
    where: Where
    notes: list[str]

    @property
    def time(self) -> Array:
        """Stamps [s]."""
        return self.values["time"]

    def named(self, base: str) -> str:
        """Column name in the file."""
        return self.match.column[base]

    def side_by_side(self, bases: Sequence[str]) -> Array:
        """Columns side by side, NaN where the file has none."""
        absent = np.full(self.time.size, np.nan)
        return np.column_stack([self.values.get(base, absent) for base in bases])

    def take(self, rows: Array) -> AidingRows:
        """The rows at these indices, or where this mask is True."""
        index = np.flatnonzero(rows) if rows.dtype == bool else rows
        where = self.where
        return replace(
            self,
            values={base: values[index] for base, values in self.values.items()},
            where=lambda row: where(int(index[row])),
        )

    def refuse(self, flawed: Array, base: str, fault: str) -> None:
        """Refuse the first row where `flawed` is True.

        Raises
        ------
        InputError
            Naming row, column and value, then `fault`.
        """
        if flawed.any():
            row = int(np.argmax(flawed))
            value = self.values[base][row] / self.match.factor[base]
            raise InputError(
                f"{self.match.source}: {self.where(row)}, column '{self.named(base)}': {value:.9g} {fault}"
            )


def read_rows(
    table: CsvTable | ParquetTable, match: Match, time_offset_s: float, text: Sequence[str] = ()
) -> AidingRows:
    """Read every matched column.

    Parameters
    ----------
    table : CsvTable or ParquetTable
    match : Match
        Columns found; the required ones among them.
    time_offset_s : float
        Added to the stamps [s].
    text : sequence of str
        Base names of columns of words.

    Returns
    -------
    AidingRows
        Values that are infinite or absurd are NaN.

    Raises
    ------
    InputError
        If a cell is not a number, or there are no rows.
    ConfigError
        If `time_offset_s` is not finite.
    """
    if not np.isfinite(time_offset_s):
        raise ConfigError(f"time_offset_s = {time_offset_s} has to be a finite number of seconds")
    words = [match.column[base] for base in text if base in match.column]
    raw = table.read([name for name in match.column.values() if name not in words], words)
    values: dict[str, Array] = {}
    for base, name in match.column.items():
        if name in words:
            values[base] = raw[name]
            continue
        column = scaled(raw[name], match.factor[base])
        values[base] = np.where(np.abs(column) < ABSURD, column, np.nan)
    values["time"] = values["time"] + time_offset_s
    return AidingRows(values, match, table.where, [*table.notes, *match.note_unknown()])


def usable_rows(rows: AidingRows, measured: Sequence[str], *, every: bool = True) -> AidingRows:
    """Leave out rows that hold no measurement.

    Parameters
    ----------
    rows : AidingRows
    measured : sequence of str
        Base names that hold the measurement.
    every : bool
        Whether a row needs all of them instead of one.

    Raises
    ------
    InputError
        If more than half of the rows would be left out.
    """
    given = np.isfinite(np.column_stack([rows.values[base] for base in measured]))
    empty = ~(np.isfinite(rows.time) & (given.all(axis=1) if every else given.any(axis=1)))
    count = int(np.count_nonzero(empty))
    if count == 0:
        return rows
    names = ", ".join(f"'{rows.named(base)}'" for base in ("time", *measured))
    found = f"{rows.match.source}: {count} of {empty.size} rows hold no measurement (empty, NaN, infinite or absurd)"
    first = f"in {names}, the first is {rows.where(int(np.argmax(empty)))}"
    if count > MAX_EMPTY_SHARE * empty.size:
        raise InputError(f"{found} {first}; more than half is not accepted, check how the file was made")
    rows.notes.append(f"{found} {first}: left out")
    return rows.take(~empty)


def ordered_rows(rows: AidingRows) -> AidingRows:
    """Sort by time, and keep the first of rows with one stamp.

    Raises
    ------
    InputError
        If 1 % or more of the rows are out of order or repeat a stamp.
    """
    order = time_order(rows.time, rows.named("time"), rows.match.source, rows.where)
    if order is None:
        return rows
    rows.notes.append(f"{order.note}: sorted by time, the first row of each stamp kept")
    return rows.take(order.order[order.first])


def ordered_rows_of_several(rows: AidingRows, base: str) -> AidingRows:
    """Sort by time where several things may share a stamp, and keep the first of rows equal in both.

    Parameters
    ----------
    rows : AidingRows
    base : str
        Base name of the column that tells the things apart.

    Raises
    ------
    InputError
        If 1 % or more of the rows are out of order, or repeat stamp and thing.
    """
    time, name = rows.time, rows.values[base]
    late = int(np.count_nonzero(time < np.maximum.accumulate(time)))
    order = np.lexsort((np.arange(time.size), name, time))
    again = np.zeros(time.size, dtype=bool)
    again[order[1:]] = (np.diff(time[order]) == 0.0) & (name[order[1:]] == name[order[:-1]])
    repeated = int(np.count_nonzero(again))
    if late + repeated == 0:
        return rows
    found = (
        f"{rows.match.source}: {count_rows(late)} out of order and {count_rows(repeated)} that repeat stamp and "
        f"{base}, of {time.size}"
    )
    if late + repeated >= MAX_SHARE * time.size:
        raise InputError(f"{found}; 1 % or more is not repaired, check how the file was made")
    rows.notes.append(f"{found}: sorted by time, the first one of equal rows kept")
    kept = np.argsort(time, kind="stable")
    return rows.take(kept[~again[kept]])


def standard_deviation(rows: AidingRows, base: str, needed: Array | None = None) -> Array | None:
    """A column of standard deviations, None if the file has none.

    Parameters
    ----------
    rows : AidingRows
    base : str
    needed : (n,) bool array, optional
        Where the measurement is; all rows by default.

    Raises
    ------
    InputError
        For a value that is empty, zero or negative in a needed row.
    """
    if base not in rows.values:
        return None
    values = rows.values[base]
    flawed = ~(values > 0.0) if needed is None else ~(values > 0.0) & needed
    rows.refuse(
        flawed,
        base,
        "is no standard deviation, it has to be more than zero in every row with a measurement; correct it, or remove "
        "the column",
    )
    return values
