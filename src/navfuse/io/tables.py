"""CSV and Parquet files as columns of numbers, with messages that lead back to the line.

:func:`open_table` looks at a file and returns a :class:`CsvTable` or a :class:`ParquetTable`; both offer ``names``,
``read`` and ``where``. Whatever is wrong with a file ends in an :class:`~navfuse.errors.InputError`.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from navfuse.core.nearest import nearest
from navfuse.errors import InputError, OutputError
from navfuse.io.arrow import arrow_table, numbers, words
from navfuse.io.atomic import atomic_file
from navfuse.io.columns import refuse_repeated_names
from navfuse.io.csv_table import CsvTable

Array = np.ndarray
Where = Callable[[int], str]

EXTENSIONS = (".csv", ".parquet")


class ParquetTable:
    """A Parquet file.

    Parameters
    ----------
    path : Path
        An existing file.

    Attributes
    ----------
    source : str
        The path as given, for messages.
    names : tuple of str
        Column names.
    notes : list of str
        Repairs made while reading; always empty for Parquet.

    Raises
    ------
    InputError
        If the file is not Parquet, is truncated or damaged, or names two columns alike.
    """

    def __init__(self, path: Path) -> None:
        import pyarrow
        import pyarrow.parquet

        self.source = str(path)
        self.notes: list[str] = []
        try:
            self._file = pyarrow.parquet.ParquetFile(path)
        except (pyarrow.ArrowException, OSError, ValueError) as error:
            raise _damaged(self.source, error) from error
        self.names = tuple(self._file.schema_arrow.names)
        refuse_repeated_names(self.names, self.source)

    def read(self, numeric: Sequence[str], text: Sequence[str] = ()) -> dict[str, Array]:
        """Read some columns.

        Parameters
        ----------
        numeric, text : sequences of str
            Names of columns of numbers and of words.

        Returns
        -------
        dict of str to array
            Numbers as float64 or float32 with NaN for nulls, words as str with "" for nulls; equal lengths, at least
            one row.

        Raises
        ------
        InputError
            If the data are damaged, a column of numbers holds something else, or there are no rows.
        """
        if self._file.metadata.num_rows == 0:
            raise InputError(f"{self.source}: the table has columns but no rows")
        columns: dict[str, Array] = {name: words(self._column(name)) for name in text}
        for name in numeric:
            column = self._column(name)
            values = numbers(column)
            if values is None:
                raise InputError(
                    f"{self.source}: the column '{name}' holds values of type {column.type}, it has to hold numbers"
                )
            columns[name] = values.copy()
        return columns

    def _column(self, name: str) -> Any:
        """One column: read one at a time and copied, a long log is not in memory twice."""
        import pyarrow

        try:
            return self._file.read(columns=[name]).column(name)
        except (pyarrow.ArrowException, OSError, ValueError) as error:
            raise _damaged(self.source, error) from error

    def where(self, row: int) -> str:
        """Name a row, counted from 0, as a person counts: from 1."""
        return f"row {row + 1}"


def open_table(path: str | os.PathLike[str]) -> CsvTable | ParquetTable:
    """Open a table by its extension.

    Parameters
    ----------
    path : path-like
        A ``.csv`` or ``.parquet`` file.

    Returns
    -------
    CsvTable or ParquetTable

    Raises
    ------
    InputError
        If the file is missing, unreadable, empty, of another kind, or has no usable column names.
    """
    path = check_file(path, EXTENSIONS)
    return CsvTable(path) if path.suffix.lower() == ".csv" else ParquetTable(path)


def check_file(path: str | os.PathLike[str], extensions: Sequence[str]) -> Path:
    """Make sure that a path is a readable, non-empty file of a known kind.

    Parameters
    ----------
    path : path-like
        File to read.
    extensions : sequence of str
        Accepted extensions in lower case, with the dot.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        Otherwise.
    """
    path = Path(path)
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise InputError(f"{path}: is a folder; name a file in it")
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{path}: is not a regular file; copy the data into one")
        if path.suffix.lower() not in extensions:
            kind = f"'{path.suffix}'" if path.suffix else "no extension"
            raise InputError(f"{path}: cannot tell the format from {kind}; known are {', '.join(extensions)}")
        with path.open("rb") as stream:
            stream.read(1)
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file{_nearby(path)}") from error
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    if status.st_size == 0:
        raise InputError(f"{path}: the file is empty")
    return path


def write_table(path: str | os.PathLike[str], columns: Mapping[str, Array]) -> None:
    """Write columns as CSV or Parquet, told by the extension; the file appears whole or not at all.

    Parameters
    ----------
    path : path-like
        A ``.csv`` or ``.parquet`` file, replaced if it exists. CSV numbers are the shortest that read back
        bit-identical.
    columns : mapping of str to (n,) array
        Names and values; NaN is written as an empty cell in CSV.

    Raises
    ------
    OutputError
        If the extension is another one or the file cannot be written.
    """
    path = Path(path)
    extension = path.suffix.lower()
    if extension not in EXTENSIONS:
        raise OutputError(f"{path}: cannot write a table as '{path.suffix}'; known are {', '.join(EXTENSIONS)}")
    table = arrow_table(columns)
    with atomic_file(path) as part:
        if extension == ".csv":
            import pyarrow.csv

            options = pyarrow.csv.WriteOptions(include_header=False, quoting_style="needed")
            with part.open("wb") as stream:
                stream.write((",".join(columns) + "\n").encode())
                pyarrow.csv.write_csv(table, stream, options)
        else:
            import pyarrow.parquet

            pyarrow.parquet.write_table(table, part, compression="zstd")


def _damaged(source: str, error: Exception) -> InputError:
    reason = str(error).splitlines()[0] if str(error) else type(error).__name__
    return InputError(
        f"{source}: not a complete Parquet file, it is truncated or damaged ({reason}); write or copy it again"
    )


def _nearby(path: Path) -> str:
    if not path.parent.is_dir():
        return f" (nor a folder '{path.parent}')"
    alike = nearest(path.name, [entry.name for entry in path.parent.iterdir()], 0.6)
    return f"; is '{alike}' meant?" if alike else ""
