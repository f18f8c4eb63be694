from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from navfuse.errors import ConfigError, InputError, NavfuseWarning
from navfuse.io.imu_table import body_from_file, read_imu
from navfuse.io.tables import write_table

GYRO = [f"gyro_{axis}_radps" for axis in "xyz"]
ACCEL = [f"accel_{axis}_mps2" for axis in "xyz"]
DTHETA = [f"dtheta_{axis}_rad" for axis in "xyz"]
DVEL = [f"dvel_{axis}_mps" for axis in "xyz"]
BOTH = pytest.mark.parametrize("name", ["imu.csv", "imu.parquet"])


def stack(columns, names):
    return np.column_stack([columns[name] for name in names])


@BOTH
def test_rates(write, rates, name):
    path = write(rates, name)
    log = read_imu(path)
    assert log.kind == "rates"
    assert log.source == str(path)
    assert log.notes == ()
    np.testing.assert_array_equal(log.time, rates["time_s"])
    np.testing.assert_array_equal(log.gyro, stack(rates, GYRO))
    np.testing.assert_array_equal(log.accel, stack(rates, ACCEL))
    for array in (log.time, log.gyro, log.accel):
        assert array.flags.c_contiguous
        assert array.flags.writeable
        assert array.dtype == np.float64


@BOTH
def test_increments(write, increments, name):
    log = read_imu(write(increments, name))
    assert log.kind == "increments"
    np.testing.assert_array_equal(log.gyro, stack(increments, DTHETA))
    np.testing.assert_array_equal(log.accel, stack(increments, DVEL))


def test_other_units(write, rates):
    columns = {"time_us": np.round(rates["time_s"] * 1e6).astype(np.int64)}
    columns |= {name.replace("radps", "degps"): np.degrees(rates[name]) for name in GYRO}
    columns |= {name.replace("mps2", "g"): rates[name] / 9.80665 for name in ACCEL}
    log = read_imu(write(columns, "imu.parquet"))
    np.testing.assert_allclose(log.time, rates["time_s"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(log.gyro, stack(rates, GYRO), rtol=0, atol=1e-16)
    np.testing.assert_allclose(log.accel, stack(rates, ACCEL), rtol=0, atol=1e-14)


def test_time_offset(write, rates):
    np.testing.assert_array_equal(read_imu(write(rates), time_offset_s=-0.25).time, rates["time_s"] - 0.25)


@pytest.mark.parametrize("offset", [np.nan, np.inf])
def test_time_offset_that_is_not_finite(write, rates, offset):
    with pytest.raises(ConfigError, match="time_offset_s"):
        read_imu(write(rates), time_offset_s=offset)


RIGHT_HANDED = {
    "FRD": (1, 2, 3), "FLU": (1, -2, -3), "RFU": (2, 1, -3), "BRU": (-1, 2, -3), "BLD": (-1, -2, 3), "DRB": (-3, 2, 1),
}  # fmt: skip


@pytest.mark.parametrize("axes", RIGHT_HANDED)
def test_axes(write, rates, axes):
    log = read_imu(write(rates), axes=axes.lower())
    for row, code in enumerate(RIGHT_HANDED[axes]):
        np.testing.assert_array_equal(log.gyro[:, row], np.sign(code) * rates[GYRO[abs(code) - 1]])
        np.testing.assert_array_equal(log.accel[:, row], np.sign(code) * rates[ACCEL[abs(code) - 1]])


def test_there_are_24_right_handed_axes():
    accepted, left = [], []
    for letters in itertools.product("FBRLDU", repeat=3):
        try:
            matrix = body_from_file("".join(letters))
        except ConfigError as error:
            left.append("left-handed" in str(error))
            continue
        accepted.append(letters)
        np.testing.assert_array_equal(matrix @ matrix.T, np.eye(3))
        assert np.linalg.det(matrix) == pytest.approx(1.0)
    assert len(accepted) == 24
    assert sum(left) == 24


def test_left_handed_axes_name_the_right_handed_ones():
    with pytest.raises(ConfigError, match='axes = "FRU" is left-handed; if x and y are right it is "FRD"'):
        body_from_file("FRU")


@pytest.mark.parametrize("axes", ["FBD", "FFF", "RLU", "UDF"])
def test_axes_with_one_direction_twice(axes):
    with pytest.raises(ConfigError, match="uses one direction twice"):
        body_from_file(axes)


@pytest.mark.parametrize("axes", ["", "FR", "FRDU", "XYZ", "NED"])
def test_axes_that_are_none(axes):
    with pytest.raises(ConfigError, match="three letters"):
        body_from_file(axes)


def test_rotation(write, rates):
    angle = 0.3
    matrix = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    log = read_imu(write(rates), rotation=matrix.tolist())
    np.testing.assert_allclose(log.gyro, stack(rates, GYRO) @ matrix.T, rtol=0, atol=1e-15)
    np.testing.assert_allclose(log.accel, stack(rates, ACCEL) @ matrix.T, rtol=0, atol=1e-14)


def test_rotation_equals_axes(write, rates):
    path = write(rates)
    by_rotation = read_imu(path, rotation=[[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    np.testing.assert_array_equal(by_rotation.accel, read_imu(path, axes="RFU").accel)


@pytest.mark.parametrize(
    ("rotation", "message"),
    [
        ("abc", "3 x 3 matrix of numbers"),
        ([[1.0, 0.0], [0.0, 1.0]], "its shape is"),
        ([[1.0, 0.0, 0.0], [0.0, np.nan, 0.0], [0.0, 0.0, 1.0]], "finite"),
        ([[1.0, 0.0, 0.0], [0.0, 1.001, 0.0], [0.0, 0.0, 1.0]], "not orthonormal"),
        ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]], "determinant -1"),
    ],
)
def test_rotation_that_is_none(rotation, message):
    with pytest.raises(ConfigError, match=message):
        body_from_file("FRD", rotation)


def test_axes_and_rotation():
    with pytest.raises(ConfigError, match="both given"):
        body_from_file("FLU", np.eye(3))


def test_unknown_column_is_ignored_with_a_warning(write, rates):
    with pytest.warns(NavfuseWarning, match="ignored columns that navfuse does not know: 'temperature_degc'") as caught:
        log = read_imu(write(rates | {"temperature_degc": np.full(1000, 20.0)}))
    assert caught[0].filename == __file__
    assert log.notes == (str(caught[0].message),)


def test_misspelt_column(write, rates):
    rates["gyrox_radps"] = rates.pop("gyro_x_radps")
    with pytest.raises(InputError, match="'gyro_x_radps' is missing, is the column 'gyrox_radps' meant to be it"):
        read_imu(write(rates))


def test_missing_time(write, rates):
    del rates["time_s"]
    with pytest.raises(InputError, match="an IMU table needs more columns: 'time_s' is missing"):
        read_imu(write(rates))


def test_missing_increment_column(write, increments):
    del increments["dvel_z_mps"]
    with pytest.raises(InputError, match="an IMU table of increments needs more columns: 'dvel_z_mps' is missing"):
        read_imu(write(increments))


def test_missing_columns_of_increments_by_their_unknown_names(write):
    with pytest.raises(InputError, match="an IMU table of increments"):
        read_imu(write("time_s,dtheta1,dtheta2\n0,0,0\n"))


def test_unknown_unit(write, rates):
    rates["accel_x_furlong"] = rates.pop("accel_x_mps2")
    with pytest.raises(InputError, match="'furlong' is not a known unit of acceleration; .* mps2, cmps2, g, mg"):
        read_imu(write(rates))


def test_rates_and_increments(write, rates, increments):
    with pytest.raises(InputError, match="holds rates and increments"):
        read_imu(write(rates | increments))


def test_mixture_of_rates_and_increments(write, rates, increments):
    columns = {"time_s": rates["time_s"]} | {n: rates[n] for n in GYRO} | {n: increments[n] for n in DVEL}
    with pytest.raises(InputError, match="this one mixes them: .*gyro_x_radps.*dvel_x_mps"):
        read_imu(write(columns))


def test_single_row(write, rates):
    with pytest.raises(InputError, match="has 1 usable row; at least two are needed"):
        read_imu(write({name: values[:1] for name, values in rates.items()}))


@BOTH
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_isolated_bad_rates_are_left_out(write, rates, name, value):
    rates["gyro_y_radps"][400] = value
    rates["accel_x_mps2"][402] = value
    row = "row 401 \\(line 402\\)" if name.endswith("csv") else "row 401"
    with pytest.warns(
        NavfuseWarning, match=f"2 rows with NaN, infinite or absurd values were left out, the first is {row}"
    ):
        log = read_imu(write(rates, name))
    np.testing.assert_array_equal(log.time, np.delete(rates["time_s"], [400, 402]))
    assert np.isfinite(log.gyro).all()
    assert np.isfinite(log.accel).all()


def test_bad_stamp_of_a_rate(write, rates):
    rates["time_s"][10] = np.nan
    with pytest.warns(NavfuseWarning, match="1 row with NaN"):
        assert read_imu(write(rates)).time.size == 999


def test_too_many_bad_rows(write, rates):
    rates["gyro_y_radps"][::100] = np.nan
    with pytest.raises(
        InputError, match=r"NaN, infinite or absurd values .* in 10 of 1000 rows, the first is row 1 \(line 2\)"
    ):
        read_imu(write(rates))


def test_too_long_a_run_of_bad_rows(write, rates):
    rates["accel_z_mps2"][100:106] = np.nan
    with pytest.raises(InputError, match=r"in 6 rows in succession from row 101 \(line 102\) on"):
        read_imu(write(rates))


def test_bad_increments_are_interpolated(write, increments):
    """The motion over the gap is kept: rates are linear here, so interpolation is exact."""
    time = increments["time_s"]
    step = np.diff(time, prepend=-0.01)
    for k, name in enumerate(DTHETA + DVEL):
        increments[name] = ((-9.81 if name == "dvel_z_mps" else 0.1) + 0.001 * k * time) * step
    exact = stack(increments, DTHETA + DVEL)
    increments["time_s"] = time.copy()
    increments["time_s"][300] = np.nan
    increments["dvel_z_mps"][[500, 501]] = np.nan
    increments["dtheta_x_rad"][700] = np.inf
    with pytest.warns(NavfuseWarning, match="4 rows with NaN, infinite or absurd values were interpolated"):
        log = read_imu(write(increments))
    np.testing.assert_allclose(log.time, time, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.hstack((log.gyro, log.accel)), exact, rtol=0, atol=1e-12)


def test_bad_increments_at_the_ends(write, increments):
    increments["time_s"] = increments["time_s"].copy()
    increments["time_s"][[0, -1]] = np.nan
    increments["dtheta_x_rad"][1] = np.nan
    with pytest.warns(NavfuseWarning, match="3 rows"):
        log = read_imu(write(increments))
    assert log.time.size == 998
    assert np.isfinite(log.gyro).all()


def test_bad_increment_amid_late_rows(write, increments):
    increments["dvel_x_mps"][500] = np.nan
    increments = {name: values.copy() for name, values in increments.items()}
    for values in increments.values():
        values[[500, 501]] = values[[501, 500]]
    with pytest.warns(NavfuseWarning) as caught:
        log = read_imu(write(increments))
    assert len(caught) == 2
    assert (np.diff(log.time) > 0.0).all()
    assert np.isfinite(log.accel).all()


def test_late_rows_are_sorted(write, rates):
    shuffled = {name: values.copy() for name, values in rates.items()}
    for values in shuffled.values():
        values[[200, 203]] = values[[203, 200]]
    with pytest.warns(NavfuseWarning, match="3 rows are out of order of 1000, .*: sorted by time"):
        log = read_imu(write(shuffled))
    np.testing.assert_array_equal(log.time, rates["time_s"])
    np.testing.assert_array_equal(log.gyro, stack(rates, GYRO))


def test_row_names_after_bad_rows_are_those_of_the_file(write, rates):
    rates["gyro_x_radps"][10] = np.nan
    rates["time_s"] = rates["time_s"].copy()
    rates["time_s"][500] = rates["time_s"][499]
    with pytest.warns(NavfuseWarning) as caught:
        read_imu(write(rates))
    assert "the first is row 501 (line 502): sorted by time, the first row" in str(caught[1].message)


def test_repeated_rates_keep_the_first(write, rates):
    rates["time_s"] = rates["time_s"].copy()
    rates["time_s"][500] = rates["time_s"][499]
    with pytest.warns(NavfuseWarning, match="1 rows repeat a time stamp"):
        log = read_imu(write(rates))
    np.testing.assert_array_equal(log.gyro, np.delete(stack(rates, GYRO), 500, axis=0))


def test_repeated_increments(write, increments):
    """An equal row is a copy and counts once; a different one holds motion of its own and is added."""
    columns = {name: values.copy() for name, values in increments.items()}
    columns["time_s"][500] = columns["time_s"][499]
    for values in columns.values():
        values[700] = values[699]
    with pytest.warns(NavfuseWarning, match="2 rows repeat a time stamp .* kept once and different ones added up"):
        log = read_imu(write(columns))
    exact = stack(increments, DTHETA)
    assert log.time.size == 998
    np.testing.assert_array_equal(log.gyro[499], exact[499] + exact[500])
    np.testing.assert_array_equal(log.gyro[698], exact[699])
    np.testing.assert_array_equal(log.gyro[699], exact[701])


def test_time_that_wraps(write, rates):
    rates["time_s"] = (rates["time_s"] + 604795.0) % 604800.0
    with pytest.raises(InputError, match=r"column 'time_s' does not increase: 500 rows are out of order.*clock wrap"):
        read_imu(write(rates))


def test_reversed_time_with_a_bad_row(write, rates, increments):
    for columns in (rates, increments):
        columns["time_s"] = columns["time_s"][::-1].copy()
        columns[next(name for name in columns if name.endswith(("x_radps", "x_rad")))][7] = np.nan
        with pytest.raises(InputError, match="does not increase"):
            read_imu(write(columns))


def test_absurd_values_count_as_bad(write, rates):
    rates["gyro_x_radps"][:2] = 1.7e308
    rates["accel_x_mps2"][500] = -1e7
    with pytest.warns(NavfuseWarning, match="3 rows with NaN, infinite or absurd values were left out"):
        assert read_imu(write(rates)).time.size == 997


def test_value_that_overflows_in_si_units(write, rates):
    rates = {
        name.replace("mps2", "g"): values / 9.80665 if "accel" in name else values for name, values in rates.items()
    }
    rates["accel_x_g"][5] = 1.7e308
    with pytest.warns(NavfuseWarning, match="1 row with NaN, infinite or absurd values were left out"):
        assert read_imu(write(rates)).time.size == 999


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow], max_examples=25)
@given(noise=arrays(np.float64, (40, 6), elements=st.floats(-0.2, 0.2)), name=st.sampled_from(["i.csv", "i.parquet"]))
def test_write_and_read_back(tmp_path, noise, name):
    time = 0.01 * np.arange(40) + 1e5
    data = noise + np.array([0.0, 0.0, 0.0, 0.0, 0.0, -9.8])
    write_table(tmp_path / name, {"time_s": time} | dict(zip(GYRO + ACCEL, data.T, strict=True)))
    log = read_imu(tmp_path / name)
    np.testing.assert_array_equal(log.time, time)
    np.testing.assert_array_equal(np.hstack((log.gyro, log.accel)), data)


def test_car_1h(shared_data):
    log = read_imu(shared_data / "car-1h-200hz/imu.parquet")
    assert log.kind == "increments"
    assert log.time.shape == (720001,)
    assert log.gyro.shape == log.accel.shape == (720001, 3)
    assert log.notes == ()
    assert log.accel[:, 2].mean() * 200.0 == pytest.approx(-9.79, abs=0.05)


def test_real_drive(shared_data):
    log = read_imu(shared_data / "rtklibexplorer-drive/imu.parquet", axes="BRU", time_offset_s=-0.2)
    assert log.kind == "rates"
    assert log.notes == ()
    assert log.time[0] == pytest.approx(3.654)
    standing = log.accel[log.time < 25.0].mean(axis=0)
    np.testing.assert_allclose(standing, [-1.15, 0.2, -9.86], atol=0.15)
