"""Arrow columns to NumPy and back without importing pandas.

Arrow's own conversions import pandas wherever it is installed, 0.3 s that a command-line run has no use for. Numbers
are therefore taken from and put into Arrow's buffers here (Arrow columnar format: one validity bit per value, least
significant first, then the values).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pyarrow

Array = np.ndarray

_NUMPY_NAME = {"double": "float64", "float": "float32"}


def numbers(column: pyarrow.ChunkedArray) -> Array | None:
    """Values of a column of numbers.

    Parameters
    ----------
    column : pyarrow.ChunkedArray

    Returns
    -------
    (n,) array or None
        float32 if the column is, otherwise float64; NaN for nulls. None if the column does not hold numbers. May be
        read-only.
    """
    import pyarrow

    kind = column.type
    types = pyarrow.types
    if types.is_null(kind):
        return np.full(len(column), np.nan)
    if types.is_decimal(kind) or types.is_float16(kind):
        column = column.cast(pyarrow.float64())
    elif not (types.is_integer(kind) or types.is_floating(kind)):
        return None
    pieces = [_piece(chunk) for chunk in column.chunks]
    return pieces[0] if len(pieces) == 1 else np.concatenate([np.empty(0), *pieces])


def words(column: pyarrow.ChunkedArray) -> Array:
    """Values of a column as str, "" for nulls.

    Parameters
    ----------
    column : pyarrow.ChunkedArray

    Returns
    -------
    (n,) array of str
    """
    return np.array(["" if value is None else str(value) for value in column.to_pylist()], dtype=str)


def arrow_table(columns: Mapping[str, Array]) -> pyarrow.Table:
    """Arrow table of NumPy columns.

    Parameters
    ----------
    columns : mapping of str to (n,) array
        Numbers, booleans or words; NaN becomes null.

    Returns
    -------
    pyarrow.Table
    """
    import pyarrow

    return pyarrow.Table.from_arrays(
        [_arrow_array(np.asarray(values)) for values in columns.values()], names=list(columns)
    )


def _piece(chunk: pyarrow.Array) -> Array:
    validity, data = chunk.buffers()
    dtype = np.dtype(_NUMPY_NAME.get(str(chunk.type), str(chunk.type)))
    values = (
        np.frombuffer(data, dtype)[chunk.offset : chunk.offset + len(chunk)] if data is not None else np.empty(0, dtype)
    )
    if values.dtype.kind != "f":
        values = values.astype(np.float64)
    if chunk.null_count and validity is not None:
        valid = np.unpackbits(np.frombuffer(validity, np.uint8), bitorder="little")[
            chunk.offset : chunk.offset + len(chunk)
        ]
        values = np.where(valid, values, values.dtype.type(np.nan))
    return values


def _arrow_array(values: Array) -> pyarrow.Array:
    import pyarrow

    if values.dtype.kind == "b":
        bits = pyarrow.py_buffer(np.packbits(values, bitorder="little"))
        return pyarrow.Array.from_buffers(pyarrow.bool_(), values.size, [None, bits])
    if values.dtype.kind not in "fiu":
        encoded = [str(value).encode() for value in values.tolist()]
        ends = np.cumsum([0, *map(len, encoded)], dtype=np.int32)
        buffers = [None, pyarrow.py_buffer(ends), pyarrow.py_buffer(b"".join(encoded))]
        return pyarrow.Array.from_buffers(pyarrow.string(), values.size, buffers)
    values = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("="))
    missing = np.isnan(values)
    validity = pyarrow.py_buffer(np.packbits(~missing, bitorder="little")) if missing.any() else None
    kind = {"f": "float", "i": "int", "u": "uint"}[values.dtype.kind] + str(8 * values.dtype.itemsize)
    return pyarrow.Array.from_buffers(getattr(pyarrow, kind)(), values.size, [validity, pyarrow.py_buffer(values)])
