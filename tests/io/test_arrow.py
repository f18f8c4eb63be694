from __future__ import annotations

import subprocess
import sys

import numpy as np
import pyarrow
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfuse.io.arrow import arrow_table, numbers, words


@pytest.mark.parametrize(
    "kind", [pyarrow.int8(), pyarrow.uint16(), pyarrow.int64(), pyarrow.float32(), pyarrow.float64(), pyarrow.float16()]
)
def test_numbers_of_every_type(kind):
    values = [1, None, 3, 4, None, 6, 7, 8, 9, None]
    column = pyarrow.chunked_array([pyarrow.array(values[:4], kind), pyarrow.array(values[4:], kind)])
    expected = np.array([np.nan if value is None else value for value in values])
    np.testing.assert_array_equal(numbers(column), expected)
    np.testing.assert_array_equal(numbers(column.slice(3, 5)), expected[3:8])


def test_decimals_and_nulls():
    from decimal import Decimal

    np.testing.assert_array_equal(
        numbers(pyarrow.chunked_array([pyarrow.array([Decimal("1.25"), None])])), [1.25, np.nan]
    )
    np.testing.assert_array_equal(numbers(pyarrow.chunked_array([pyarrow.nulls(2)])), [np.nan, np.nan])


def test_no_chunks():
    assert numbers(pyarrow.chunked_array([], pyarrow.float64())).size == 0


def test_single_precision_is_kept():
    assert numbers(pyarrow.chunked_array([pyarrow.array([0.1], pyarrow.float32())])).dtype == np.float32


@pytest.mark.parametrize("column", [["a"], [True], [[1.0]]])
def test_not_numbers(column):
    assert numbers(pyarrow.chunked_array([pyarrow.array(column)])) is None


def test_words():
    column = pyarrow.chunked_array([pyarrow.array(["a", None, "b"]).dictionary_encode()])
    assert words(column).tolist() == ["a", "", "b"]


@given(
    st.lists(st.floats(allow_infinity=True) | st.just(np.nan), max_size=40), st.lists(st.text(max_size=8), max_size=10)
)
def test_to_arrow_and_back(values, texts):
    table = arrow_table({"a": np.array(values, dtype=np.float64)})
    table.validate(full=True)
    np.testing.assert_array_equal(numbers(table.column("a")), np.array(values))
    strings = np.array(texts, dtype=object)
    table = arrow_table({"s": strings})
    table.validate(full=True)
    assert table.column("s").to_pylist() == texts


def test_pandas_is_not_imported(tmp_path):
    program = f"""
import sys, numpy as np
from navfuse.io.tables import open_table, write_table
for name in ("t.csv", "t.parquet"):
    path = {str(tmp_path)!r} + "/" + name
    write_table(path, {{"a": np.array([1.0, np.nan]), "s": np.array(["x", "y"]), "b": np.array([True, False])}})
    open_table(path).read(["a"], ["s"])
assert "pandas" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", program], check=True)


def test_importing_the_readers_loads_neither_arrow_nor_pandas_nor_scipy():
    program = """
import sys, navfuse.io.imu_table, navfuse.io.gnss_table, navfuse.io.trajectory_table
assert not {"pandas", "pyarrow", "scipy", "numba"} & set(sys.modules), sorted(sys.modules)
"""
    subprocess.run([sys.executable, "-c", program], check=True)
