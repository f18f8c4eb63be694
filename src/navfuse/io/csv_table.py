"""A CSV file as columns of numbers.

The separator is the one the header line uses: comma, semicolon or tab; after a semicolon or tab a decimal comma is
understood. Blank lines are skipped. The work is Arrow's; when Arrow gives up, a slow second pass finds the line and
column to blame.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from navfuse.errors import InputError
from navfuse.io.arrow import numbers, words
from navfuse.io.columns import refuse_repeated_names

if TYPE_CHECKING:
    import pyarrow

Array = np.ndarray

_HEADER_LIMIT = 1 << 16
_TAIL_LIMIT, _TAIL_ROWS = 1 << 14, 20
_NOT_AVAILABLE = frozenset(
    ("", "nan", "-nan", "na", "n/a", "null", "none", "#n/a", "#na", "-1.#ind", "1.#qnan", "nan(ind)", "-nan(ind)")
)
_MISSING_FORMS = sorted(
    {form for word in _NOT_AVAILABLE for form in (word, word.upper(), word.capitalize(), word.replace("nan", "NaN"))}
)


class CsvTable:
    """A CSV file.

    Parameters
    ----------
    path : Path
        An existing, non-empty file.

    Attributes
    ----------
    source : str
        The path as given, for messages.
    names : tuple of str
        Column names, surrounding blanks removed.
    notes : list of str
        Repairs made while reading: a last line that was cut off is left out.

    Raises
    ------
    InputError
        If the file is not text or its first line holds no column names, or one name twice.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.source = str(path)
        self.notes: list[str] = []
        self._header_lines, header = self._read_header()
        self._delimiter = max(",;\t", key=header.count)
        self.names = tuple(name.strip() for name in next(csv.reader([header], delimiter=self._delimiter)))
        self._check_names()
        self._decimal = self._find_decimal_point()

    def read(self, numeric: Sequence[str], text: Sequence[str] = ()) -> dict[str, Array]:
        """Read some columns.

        Parameters
        ----------
        numeric, text : sequences of str
            Names of columns of numbers and of words.

        Returns
        -------
        dict of str to array
            Numbers as float64 with NaN for empty cells, words as str; equal lengths, at least one row.

        Raises
        ------
        InputError
            If a cell is not a number, a line has too few or too many cells, or there are no rows.
        """
        import pyarrow

        try:
            short = self._without_short_end()
            table = self._parse(self._path if short is None else pyarrow.BufferReader(short), numeric, text)
        except (pyarrow.ArrowException, OSError, ValueError) as error:
            whole = self._without_cut_line()
            if whole is None:
                raise self._blame(numeric, error) from error
            try:
                table = self._parse(pyarrow.BufferReader(whole), numeric, text)
            except (pyarrow.ArrowException, OSError, ValueError) as cause:
                raise self._blame(numeric, cause) from cause
        if table.num_rows == 0:
            raise self._no_rows()
        columns: dict[str, Array] = {name: words(table.column(name)) for name in text}
        columns.update({name: np.asarray(numbers(table.column(name))) for name in numeric})
        return columns

    def _parse(self, source: Path | pyarrow.BufferReader, numeric: Sequence[str], text: Sequence[str]) -> pyarrow.Table:
        import pyarrow
        import pyarrow.csv

        types = {name: pyarrow.float64() for name in numeric} | {name: pyarrow.string() for name in text}
        return pyarrow.csv.read_csv(
            source,
            pyarrow.csv.ReadOptions(column_names=list(self.names), skip_rows=self._header_lines),
            pyarrow.csv.ParseOptions(delimiter=self._delimiter),
            pyarrow.csv.ConvertOptions(
                column_types=types,
                include_columns=[*numeric, *text],
                decimal_point=self._decimal,
                null_values=_MISSING_FORMS,
            ),
        )

    def where(self, row: int) -> str:
        """Name a row, counted from 0, by its number from 1 and by its line in the file."""
        with self._path.open("rb") as stream:
            lines = (
                number
                for number, line in enumerate(stream, start=1)
                if number > self._header_lines and line.strip(b"\r\n")
            )
            line = next((number for count, number in enumerate(lines) if count == row), None)
        return f"row {row + 1} (line {line})"

    def _read_header(self) -> tuple[int, str]:
        """Number of lines up to and with the header, and its text."""
        with self._path.open("rb") as stream:
            for number in range(1, 1000):
                raw = stream.readline(_HEADER_LIMIT)
                if not raw:
                    raise InputError(f"{self.source}: the file is blank")
                try:
                    line = raw.decode("utf-8-sig")
                except UnicodeDecodeError as error:
                    raise InputError(
                        f"{self.source}: line {number} is not UTF-8 text; is this a CSV file? Save it as UTF-8"
                    ) from error
                line = line.strip("\r\n")
                if "\r" in line:
                    raise InputError(
                        f"{self.source}: the lines end in carriage returns alone; save the file with line feeds"
                    )
                if line.strip():
                    return number, line
        raise InputError(f"{self.source}: no column names in the first 1000 lines")

    def _check_names(self) -> None:
        numbers = [name for name in self.names if _is_number(name, ".")]
        if numbers:
            raise InputError(
                f"{self.source}: line {self._header_lines} holds numbers ('{numbers[0]}') where the column names have"
                " to stand; add a first line with the names, each with its unit, e.g. time_s"
            )
        refuse_repeated_names([name for name in self.names if name], self.source)

    def _find_decimal_point(self) -> str:
        if self._delimiter == ",":
            return "."
        with self._path.open("rb") as stream:
            sample = b"".join(stream.readlines(_HEADER_LIMIT)[self._header_lines :])
        return "," if b"," in sample and b"." not in sample else "."

    def _no_rows(self) -> InputError:
        return InputError(f"{self.source}: the file has a header but no rows")

    def _without_cut_line(self) -> bytes | None:
        """The file without a last line that has too few cells, as an interrupted recording leaves it; None if whole."""
        content = self._path.read_bytes()
        kept, _, last = content.rstrip(b"\r\n").rpartition(b"\n")
        cells = last.count(self._delimiter.encode()) + 1
        if cells >= len(self.names) or not any(kept.split(b"\n")[self._header_lines :]):
            return None
        self.notes.append(
            f"{self.source}: the last line is cut off ({cells} of {len(self.names)} cells), it was left out"
        )
        return kept

    def _without_short_end(self) -> bytes | None:
        """The file without a last line that ends, without a line feed, in a cell shorter than in all rows just before:
        so ends a line that was cut off in its last number. None for a file that shows no such thing.
        """
        with self._path.open("rb") as stream:
            stream.seek(0, os.SEEK_END)
            stream.seek(max(0, stream.tell() - _TAIL_LIMIT))
            tail = stream.read()
        lines = tail.split(b"\n")[1:]
        if tail.endswith((b"\n", b"\r")) or len(lines) <= _TAIL_ROWS:
            return None
        delimiter = self._delimiter.encode()
        if lines[-1].count(delimiter) + 1 < len(self.names):
            return None
        *before, last = (line.rstrip(b"\r").rpartition(delimiter)[2] for line in lines[-_TAIL_ROWS - 1 :])
        if any(self._decimal.encode() not in cell or len(cell) <= len(last) for cell in before):
            return None
        self.notes.append(f"{self.source}: the last line seems to be cut off in its last cell, it was left out")
        return self._path.read_bytes().rpartition(b"\n")[0]

    def _blame(self, numeric: Sequence[str], error: Exception) -> InputError:
        """Error about the first line that cannot be used; Arrow's own words if this pass finds none."""
        positions = [(self.names.index(name), name) for name in numeric]
        rows = 0
        with self._path.open(encoding="utf-8-sig", errors="replace", newline="") as stream:
            for _ in range(self._header_lines):
                stream.readline()
            reader = csv.reader(stream, delimiter=self._delimiter)
            try:
                for cells in filter(None, reader):
                    rows += 1
                    fault = self._fault(cells, positions)
                    if fault:
                        return InputError(f"{self.source}: line {reader.line_num + self._header_lines}{fault}")
            except csv.Error as broken:
                return InputError(f"{self.source}: line {reader.line_num + self._header_lines}: {broken}")
        if not rows:
            return self._no_rows()
        return InputError(f"{self.source}: cannot be read as CSV: {error}")

    def _fault(self, cells: Sequence[str], positions: Sequence[tuple[int, str]]) -> str:
        if len(cells) != len(self.names):
            return f": has {len(cells)} cells, the header has {len(self.names)}; complete or remove the line"
        for position, name in positions:
            cell = cells[position].strip()
            if cell.lower() not in _NOT_AVAILABLE and not _is_number(cell, self._decimal):
                return f", column '{name}': '{cell[:40]}' is not a number; correct the cell or leave it empty"
        return ""


def _is_number(cell: str, decimal: str) -> bool:
    if "_" in cell or (decimal == "," and "." in cell):
        return False
    try:
        float(cell.replace(decimal, "."))
    except ValueError:
        return False
    return True
