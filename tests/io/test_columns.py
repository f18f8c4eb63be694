from __future__ import annotations

import pytest

from navfuse.errors import InputError
from navfuse.io.columns import Field, fields, match_columns, refuse_repeated_names, require, require_all_or_none

TIME = Field("time", "time", "s")
SPEEDS = fields("speed", "mps", "vn", "ve", "vd")
FIX = Field("fix", text=True)
KNOWN = (TIME, *SPEEDS, FIX)


def test_native_names():
    assert [field.name for field in KNOWN] == ["time_s", "vn_mps", "ve_mps", "vd_mps", "fix"]


def test_units_are_told_by_suffix():
    match = match_columns(["time_ms", "vn_mps", "ve_kmph", "fix"], KNOWN, "f")
    assert match.column == {"time": "time_ms", "vn": "vn_mps", "ve": "ve_kmph", "fix": "fix"}
    assert match.factor == {"time": 1e-3, "vn": 1.0, "ve": 1.0 / 3.6, "fix": 1.0}
    assert match.unknown == ()
    assert match.note_unknown() == []


def test_unknown_columns_are_noted():
    match = match_columns(["time_s", "temperature_degc", ""], KNOWN, "f.csv")
    assert match.unknown == ("temperature_degc", "")
    assert match.note_unknown() == ["f.csv: ignored columns that navfuse does not know: 'temperature_degc'"]


def test_unknown_unit():
    with pytest.raises(InputError, match=r"f\.csv: column 'vn_warp': 'warp' is not a known unit of speed; .*mps, cmps"):
        match_columns(["time_s", "vn_warp"], KNOWN, "f.csv")


def test_missing_unit():
    with pytest.raises(InputError, match=r"f\.csv: column 'vn' has no unit; rename it to 'vn_mps'.*kmph"):
        match_columns(["time_s", "vn"], KNOWN, "f.csv")


def test_longer_name_of_the_same_beginning_is_only_unknown():
    match = match_columns(["time_s", "time_utc", "vn_mps", "vn_std_mps"], KNOWN, "f")
    assert match.unknown == ("time_utc", "vn_std_mps")


def test_same_quantity_twice():
    with pytest.raises(InputError, match="'vn_mps' and 'vn_kmph' hold the same quantity"):
        match_columns(["vn_mps", "vn_kmph"], KNOWN, "f")


def test_missing_column_names_what_resembles_it():
    match = match_columns(["times", "ve_mps", "vd.mps"], KNOWN, "f.csv")
    with pytest.raises(InputError) as raised:
        require(match, (TIME, *SPEEDS), "a velocity table")
    message = str(raised.value)
    assert "f.csv: a velocity table needs more columns" in message
    assert "'time_s' is missing, is the column 'times' meant to be it?" in message
    assert "'vd_mps' is missing, is the column 'vd.mps' meant to be it?" in message
    assert "'vn_mps' is missing;" in message
    assert "'ve_mps' is missing" not in message


def test_resemblance_ignores_case():
    match = match_columns(["TIME_S"], KNOWN, "f.csv")
    with pytest.raises(InputError, match="'TIME_S' meant to be it"):
        require(match, (TIME,), "a table")


def test_nothing_present():
    with pytest.raises(InputError, match="columns present: none"):
        require(match_columns([], KNOWN, "f"), (TIME,), "a table")


def test_group_all_or_none():
    assert require_all_or_none(match_columns(["vn_mps", "ve_mps", "vd_mps"], KNOWN, "f"), SPEEDS, "a table")
    assert not require_all_or_none(match_columns(["time_s"], KNOWN, "f"), SPEEDS, "a table")
    with pytest.raises(InputError, match="'vd_mps' is missing"):
        require_all_or_none(match_columns(["vn_mps", "ve_mps"], KNOWN, "f"), SPEEDS, "a table")


def test_repeated_names():
    with pytest.raises(InputError, match="f: the column 'a' is there twice"):
        refuse_repeated_names(["a", "b", "a"], "f")
