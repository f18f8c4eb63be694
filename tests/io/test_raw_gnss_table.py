from __future__ import annotations

import warnings

import numpy as np
import pytest

from navfuse.errors import ConfigError, InputError, NavfuseWarning, OutputError
from navfuse.gnss.single_point import single_point_position
from navfuse.io.raw_gnss_table import DEFAULT_SD, read_raw_gnss, write_raw_gnss
from navfuse.simulation import RawGnssModel, car_drive, measure_raw_gnss

BOTH = pytest.mark.parametrize("name", ["pseudoranges.csv", "pseudoranges.parquet"])
EXACT = (
    "time",
    "satellite",
    "pseudorange",
    "sd_pseudorange",
    "range_rate",
    "sd_range_rate",
    "sat_r_e",
    "sat_v_e",
    "cn0",
)


@pytest.fixture(name="log", scope="module")
def _log():
    model = RawGnssModel.from_datasheet(code_sd_m=2.0, range_rate_sd_mps=0.02, clock_offset_m=1e5, cn0_sd_db=1.0)
    return measure_raw_gnss(car_drive(60.0, seed=1), model, np.random.default_rng(0))[0]


@pytest.fixture(name="columns")
def _columns(log):
    return {name: values.copy() for name, values in log.columns().items()}


def quietly(path, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NavfuseWarning)
        return read_raw_gnss(path, **options)


@BOTH
@pytest.mark.parametrize("corrected", [True, False])
def test_what_is_written_is_read(tmp_path, log, name, corrected):
    path = tmp_path / name
    write_raw_gnss(path, type(log)(**{k: getattr(log, k) for k in type(log).__slots__} | {"corrected": corrected}))
    back = read_raw_gnss(path)
    for field in EXACT:
        np.testing.assert_array_equal(getattr(back, field), getattr(log, field))
    for field in ("elevation", "azimuth"):
        np.testing.assert_allclose(getattr(back, field), getattr(log, field), rtol=0, atol=2e-15)
    assert back.corrected is corrected
    assert back.notes == ()
    assert back.source == str(path)


def test_other_units_an_offset_and_satellites_by_number(write, columns, log):
    columns["pseudorange_km"] = columns.pop("pseudorange_m") / 1e3
    columns["elevation_rad"] = np.radians(columns.pop("elevation_deg"))
    columns["satellite"] = np.array([name[1:].lstrip("0") for name in columns["satellite"]])
    back = read_raw_gnss(write(columns), time_offset_s=-0.5)
    np.testing.assert_array_equal(back.time, log.time - 0.5)
    np.testing.assert_allclose(back.pseudorange, log.pseudorange, rtol=1e-15)
    np.testing.assert_allclose(back.elevation, log.elevation, rtol=1e-15)
    assert back.satellite[0] == log.satellite[0][1:].lstrip("0")


def test_the_least_that_is_needed(write, columns):
    least = {name: columns[name] for name in ("time_s", "satellite", "pseudorange_m", "sat_x_m", "sat_y_m", "sat_z_m")}
    with pytest.warns(NavfuseWarning) as caught:
        back = read_raw_gnss(write(least))
    assert sorted(str(entry.message).split(": ", 1)[1][:30] for entry in caught) == [
        "'sd_pseudorange_m' is missing:",
        "there is no column 'corrected'",
    ]
    assert len(back.notes) == 2
    assert back.corrected
    np.testing.assert_array_equal(back.sd_pseudorange, DEFAULT_SD["sd_pseudorange"])
    assert back.range_rate is back.sat_v_e is back.elevation is back.cn0 is None
    _, first = back.epochs()
    rows = slice(first[3], first[4])
    fix = single_point_position(back.pseudorange[rows], back.sat_r_e[rows], back.sd_pseudorange[rows])
    assert 6.3e6 < np.linalg.norm(fix.vector_e) < 6.4e6


def test_rows_without_a_measurement_are_left_out_and_a_rate_may_be_missing(write, columns, log):
    columns["pseudorange_m"][5] = np.nan
    columns["sat_y_m"][7] = np.inf
    columns["satellite"][9] = ""
    columns["range_rate_mps"][11] = np.nan
    columns["sd_range_rate_mps"][11] = np.nan
    columns["sd_pseudorange_m"][12] = np.nan
    with pytest.warns(NavfuseWarning) as caught:
        back = read_raw_gnss(write(columns))
    messages = [str(entry.message) for entry in caught]
    assert f"3 of {len(log)} rows lack a stamp" in messages[0]
    assert "line 7" in messages[0]
    assert "'sd_pseudorange_m' is empty in 1 rows: assumed 5 m" in messages[1]
    assert len(messages) == 2
    kept = np.delete(np.arange(len(log)), [5, 7, 9])
    np.testing.assert_array_equal(back.pseudorange, log.pseudorange[kept])
    assert np.isnan(back.range_rate).sum() == 1
    assert np.all(back.sd_range_rate > 0.0)


def test_a_late_row_and_a_repeated_one_are_repaired(write, columns, log):
    later = int(np.searchsorted(log.time, log.time[20], side="right")) + 2
    order = np.r_[0:20, 21:later, 20, later : len(log)]
    order = np.r_[order[:100], order[99], order[100:]]
    with pytest.warns(NavfuseWarning, match=r"1 rows are out of order and 1 repeat stamp and satellite") as caught:
        back = read_raw_gnss(write({name: values[order] for name, values in columns.items()}))
    assert len(caught) == 1
    assert sorted(zip(back.time, back.satellite, strict=True)) == sorted(zip(log.time, log.satellite, strict=True))
    assert np.all(np.diff(back.time) >= 0.0)


def change(name, row, value):
    def apply(columns):
        columns[name] = columns[name].astype(float) if columns[name].dtype.kind != "U" else columns[name]
        columns[name][row] = value

    return apply


def drop(*names):
    return lambda columns: [columns.pop(name) for name in names]


def rename(old, new):
    return lambda columns: columns.update({new: columns.pop(old)})


def half_empty(columns):
    columns["pseudorange_m"][: columns["pseudorange_m"].size // 2 + 1] = np.nan


def reverse(columns):
    columns["time_s"] = columns["time_s"][::-1].copy()


def in_kilometres(columns):
    for axis in "xyz":
        columns[f"sat_{axis}_m"] /= 1e3


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (drop("pseudorange_m"), "a table of pseudo-ranges needs more columns: 'pseudorange_m' is missing"),
        (rename("satellite", "sattelite"), "'satellite' is missing, is the column 'sattelite' meant to be it"),
        (drop("sat_vx_mps"), "with range rates needs more columns: 'sat_vx_mps' is missing"),
        (rename("pseudorange_m", "pseudorange"), "'pseudorange' has no unit; rename it to 'pseudorange_m'"),
        (rename("cn0_dbhz", "cn0_db"), "'db' is not a known unit of carrier to noise density"),
        (
            change("sd_pseudorange_m", 3, 0.0),
            r"line 5\), column 'sd_pseudorange_m': a standard deviation of 0 would",
        ),
        (change("sd_range_rate_mps", 4, -1.0), r"line 6\), column 'sd_range_rate_mps': a standard deviation of -1"),
        (change("corrected", 6, 0.0), r"line 8\), column 'corrected': 0; it has to be 1 in all rows"),
        (change("corrected", 0, 2.0), r"line 2\), column 'corrected': 2; it has to be"),
        (half_empty, r"the first is row 1 \(line 2\); more than half is not accepted"),
        (reverse, "rows are out of order and 0 repeat .* 1 % or more is not repaired"),
        (
            in_kilometres,
            r"line 2\), columns 'sat_x_m', 'sat_y_m', 'sat_z_m': satellite 'G.*' is 26.* km from",
        ),
    ],
)
def test_what_is_refused(write, columns, spoil, message):
    spoil(columns)
    with pytest.raises(InputError, match=message):
        quietly(write(columns))


def test_an_unknown_column_is_named(write, columns):
    columns["snr"] = columns["cn0_dbhz"]
    with pytest.warns(NavfuseWarning, match="ignored columns that navfuse does not know: 'snr'"):
        read_raw_gnss(write(columns))


def test_options_and_paths(tmp_path, write, columns, log):
    with pytest.raises(ConfigError, match="time_offset_s = nan has to be a finite number"):
        read_raw_gnss(write(columns), time_offset_s=np.nan)
    with pytest.raises(InputError, match="there is no such file"):
        read_raw_gnss(tmp_path / "no.csv")
    with pytest.raises(OutputError, match=r"cannot write a table as '.txt'"):
        write_raw_gnss(tmp_path / "log.txt", log)
