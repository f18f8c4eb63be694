from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from navfuse.errors import InputError, OutputError
from navfuse.io.tables import check_file, open_table, write_table

BOTH = pytest.mark.parametrize("name", ["t.csv", "t.parquet"])


@BOTH
def test_read_columns(write, name):
    table = open_table(write({"a": np.array([1.0, 2.5]), "n": np.array([3, 4]), "s": np.array(["x", "y z"])}, name))
    assert table.names == ("a", "n", "s")
    columns = table.read(["n", "a"], ["s"])
    np.testing.assert_array_equal(columns["a"], [1.0, 2.5])
    np.testing.assert_array_equal(columns["n"], [3.0, 4.0])
    assert columns["n"].dtype == np.float64
    assert columns["s"].tolist() == ["x", "y z"]
    assert table.notes == []


def test_missing_path(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.csv: there is no such file$"):
        open_table(tmp_path / "nowhere.csv")


def test_missing_path_names_a_neighbour(tmp_path):
    (tmp_path / "gnss.csv").write_text("time_s\n")
    with pytest.raises(InputError, match=r"there is no such file; is 'gnss\.csv' meant\?"):
        open_table(tmp_path / "gns.csv")


def test_missing_folder(tmp_path):
    with pytest.raises(InputError, match="nor a folder"):
        open_table(tmp_path / "no" / "gnss.csv")


def test_folder(tmp_path):
    with pytest.raises(InputError, match="is a folder; name a file in it"):
        open_table(tmp_path)


def test_not_a_regular_file(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(InputError, match="is not a regular file"):
        open_table(tmp_path / "pipe.csv")


@pytest.mark.parametrize(("name", "kind"), [("log.xlsx", "'.xlsx'"), ("log", "no extension")])
def test_wrong_extension(write, name, kind):
    with pytest.raises(InputError, match=rf"cannot tell the format from {kind}; known are \.csv, \.parquet"):
        open_table(write("a\n1\n", name))


def test_extension_in_capitals(write):
    assert open_table(write("a\n1\n", "LOG.CSV")).read(["a"])["a"].tolist() == [1.0]


@BOTH
def test_empty_file(write, name):
    with pytest.raises(InputError, match="the file is empty"):
        open_table(write(b"", name))


def test_unreadable_file(write, monkeypatch):
    path = write("a\n1\n")

    def refuse(*args, **kwargs):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(InputError, match=r"log\.csv: cannot be read: Permission denied"):
        check_file(path, (".csv",))


def test_impossible_path():
    with pytest.raises(InputError, match="cannot be read: embedded null"):
        open_table("a\0b.csv")


def test_header_only_csv(write):
    for text in ("a,b\n", "a,b", "a,b\n\n\n"):
        with pytest.raises(InputError, match="has a header but no rows"):
            open_table(write(text)).read(["a"])


def test_no_rows_parquet(write):
    with pytest.raises(InputError, match="has columns but no rows"):
        open_table(write({"a": np.empty(0)}, "t.parquet")).read(["a"])


def test_blank_csv(write):
    with pytest.raises(InputError, match="the file is blank"):
        open_table(write("\n \n"))
    with pytest.raises(InputError, match="no column names in the first 1000 lines"):
        open_table(write("\n" * 1500))


def test_csv_that_is_not_text(write):
    with pytest.raises(InputError, match="line 1 is not UTF-8 text"):
        open_table(write("a,b\n1,2\n".encode("utf-16")))


def test_csv_with_carriage_returns_alone(write):
    with pytest.raises(InputError, match="the lines end in carriage returns alone"):
        open_table(write("a,b\r1,2\r"))


def test_csv_without_header(write):
    with pytest.raises(InputError, match=r"line 1 holds numbers \('0\.5'\) where the column names have to stand"):
        open_table(write("0.5,1\n0.6,2\n"))


def test_csv_byte_order_mark_blank_lines_and_blanks(write):
    table = open_table(write("\ufeff\r\n time_s , a \r\n 1 , 2 \r\n\r\n3,4\r\n"))
    assert table.names == ("time_s", "a")
    np.testing.assert_array_equal(table.read(["a"])["a"], [2.0, 4.0])
    assert table.where(1) == "row 2 (line 5)"


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a;b\n1,5;2\n", 1.5),
        ("a;b\n1.5;2\n", 1.5),
        ("a\tb\n1,5\t2\n", 1.5),
        ('"a","b"\n"1.5","2"\n', 1.5),
        ("a\n1.5\n", 1.5),
    ],
)
def test_csv_dialects(write, text, value):
    assert open_table(write(text)).read(["a"])["a"].tolist() == [value]


def test_csv_missing_and_infinite_values(write):
    text = "a,s\n,x\nnan,\nNaN,x\nNULL,x\nN/A,x\n-1.#IND,x\ninf,x\n-Infinity,x\n1e3,x\n"
    columns = open_table(write(text)).read(["a"], ["s"])
    assert np.isnan(columns["a"][:6]).all()
    assert columns["a"][6:].tolist() == [np.inf, -np.inf, 1000.0]
    assert columns["s"][:3].tolist() == ["x", "", "x"]


@pytest.mark.parametrize("cell", ["abc", "1_000", "0x10", "1d3", "--", "12:30", "1.5.2"])
def test_csv_cell_that_is_no_number(write, cell):
    with pytest.raises(InputError, match=rf"log\.csv: line 5, column 'b': '{cell}' is not a number"):
        open_table(write(f"a,b\n1,\n\nNaN, 4\n5,{cell}\n6,7\n")).read(["a", "b"])


def test_csv_point_amid_decimal_commas(write):
    with pytest.raises(InputError, match=r"line 60003, column 'a': '3\.5' is not a number"):
        open_table(write("a;b\n" + "1,5;2\n" * 60001 + "3.5;2\n")).read(["a"])


def test_csv_line_with_wrong_number_of_cells(write):
    with pytest.raises(InputError, match="line 3: has 1 cells, the header has 2"):
        open_table(write("a,b\n1,2\n3\n4,5\n")).read(["a"])
    with pytest.raises(InputError, match="line 4: has 3 cells, the header has 2"):
        open_table(write("a,b\n1,2\n3,4\n4,5,6\n")).read(["a"])


def test_csv_bad_cell_before_a_cut_last_line(write):
    with pytest.raises(InputError, match="line 2, column 'a': 'x' is not a number"):
        open_table(write("a,b\nx,2\n3,4\n5")).read(["a"])


def test_csv_cut_last_line_is_left_out_with_a_note(write):
    table = open_table(write("a,b,c\n1,2,3\n4,5"))
    assert table.read(["a"])["a"].tolist() == [1.0]
    assert table.notes == [f"{table.source}: the last line is cut off (2 of 3 cells), it was left out"]


def long_csv(last):
    return "t,v\n" + "".join(f"{k}.0,{k * k / 7.0:.4f}\n" for k in range(60)) + last


@pytest.mark.parametrize("last", ["60.0,514.2", "60.0,5", "60.0,"])
def test_csv_line_cut_in_its_last_number_is_left_out_with_a_note(write, last):
    table = open_table(write(long_csv(last)))
    assert table.read(["t"])["t"][-1] == 59.0
    assert table.notes == [f"{table.source}: the last line seems to be cut off in its last cell, it was left out"]


@pytest.mark.parametrize("last", ["60.0,514.2857", "60.0,514.2857\n", "60.0,5\n", "60.0,5\r\n"])
def test_csv_whole_last_line_is_kept(write, last):
    table = open_table(write(long_csv(last)))
    assert table.read(["t"])["t"][-1] == 60.0
    assert table.notes == []


def test_csv_last_line_of_whole_numbers_is_kept(write):
    table = open_table(write("t,n\n" + "".join(f"{k}.5,{k + 10}\n" for k in range(60)) + "60.5,9"))
    assert table.read(["t"])["t"][-1] == 60.5
    assert table.notes == []


def test_csv_only_a_cut_line(write):
    with pytest.raises(InputError, match="line 2: has 2 cells, the header has 3"):
        open_table(write("a,b,c\n4,5")).read(["a"])


def test_csv_words_that_are_not_text(write):
    with pytest.raises(InputError, match="cannot be read as CSV: .*UTF8"):
        open_table(write(b"a,s\n1,\xff\xfe\n")).read(["a"], ["s"])


def test_csv_cell_too_large_for_the_second_pass(write):
    with pytest.raises(InputError, match=r"line 2: field larger than field limit"):
        open_table(write("a,b\n" + "x" * 200000 + ",1\n")).read(["a", "b"])


def test_repeated_names_csv(write):
    with pytest.raises(InputError, match="the column 'a' is there twice"):
        open_table(write("a,a\n1,2\n"))


def test_repeated_names_parquet(tmp_path):
    import pyarrow
    import pyarrow.parquet

    table = pyarrow.Table.from_arrays([pyarrow.array([1.0]), pyarrow.array([2.0])], names=["a", "a"])
    pyarrow.parquet.write_table(table, tmp_path / "t.parquet")
    with pytest.raises(InputError, match="the column 'a' is there twice"):
        open_table(tmp_path / "t.parquet")


@pytest.mark.parametrize("keep", [0.02, 0.5, 0.99])
def test_truncated_parquet(write, keep):
    path = write({"a": np.arange(1000.0)}, "t.parquet")
    content = path.read_bytes()
    path.write_bytes(content[: int(keep * len(content))])
    with pytest.raises(InputError, match=r"t\.parquet: not a complete Parquet file, it is truncated or damaged"):
        open_table(path)


def test_parquet_with_damaged_data(write):
    path = write({"a": np.arange(100000.0)}, "t.parquet")
    content = bytearray(path.read_bytes())
    content[8:4000] = bytes(3992)
    path.write_bytes(bytes(content))
    with pytest.raises(InputError, match="truncated or damaged"):
        open_table(path).read(["a"])


@pytest.mark.parametrize("values", [np.array(["1", "2"]), np.array([True, False])])
def test_parquet_column_that_holds_no_numbers(write, values):
    table = open_table(write({"a": values}, "t.parquet"))
    with pytest.raises(InputError, match="the column 'a' holds values of type (string|bool), it has to hold numbers"):
        table.read(["a"])


def test_parquet_row_names(write):
    assert open_table(write({"a": np.arange(3.0)}, "t.parquet")).where(1) == "row 2"


@BOTH
def test_write_and_read_back(tmp_path, name):
    columns = {
        "a": np.array([0.1, np.nan, 1e-300, -3.0]),
        "single": np.array([0.1, 0.2, 0.3, 0.4], dtype=np.float32),
        "n": np.array([1, 2, 3, 4]),
        "big": np.array([1.0, 2.0, 3.0, 4.0], dtype=">f8"),
        "flag": np.array([True, False, True, True]),
        "s": np.array(["x", "", "a,b", 'say "yes"']),
    }
    write_table(tmp_path / name, columns)
    table = open_table(tmp_path / name)
    assert table.names == tuple(columns)
    back = table.read(["a", "single", "n", "big"], ["flag", "s"])
    for column in ("a", "n", "big"):
        np.testing.assert_array_equal(back[column], columns[column])
    np.testing.assert_array_equal(back["single"].astype(np.float32), columns["single"])
    assert [value.lower() for value in back["flag"]] == ["true", "false", "true", "true"]
    assert back["s"].tolist() == columns["s"].tolist()
    assert [entry.name for entry in tmp_path.iterdir()] == [name]


def test_written_csv_has_a_plain_header(tmp_path):
    write_table(tmp_path / "t.csv", {"time_s": np.array([0.5]), "a": np.array([np.nan])})
    assert (tmp_path / "t.csv").read_text() == "time_s,a\n0.5,\n"


def test_write_with_another_extension(tmp_path):
    with pytest.raises(OutputError, match=r"cannot write a table as '\.xlsx'"):
        write_table(tmp_path / "t.xlsx", {"a": np.zeros(1)})


def test_write_into_missing_folder(tmp_path):
    with pytest.raises(OutputError, match="has to exist"):
        write_table(tmp_path / "no" / "t.csv", {"a": np.zeros(1)})
