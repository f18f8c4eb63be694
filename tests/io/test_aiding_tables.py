from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from navfuse.data.aiding_logs import (
    BarometerLog,
    BodyVelocityLog,
    HeadingLog,
    MagnetometerLog,
    OdometerLog,
    UwbAnchors,
    UwbLog,
    WheelSpeedLog,
)
from navfuse.errors import ConfigError, InputError, NavfuseWarning, OutputError
from navfuse.io.aiding_tables import (
    read_barometer,
    read_body_velocity,
    read_heading,
    read_magnetometer,
    read_odometer,
    read_uwb,
    read_uwb_anchors,
    read_wheel_speeds,
    write_aiding,
)

N = 400
TIME = 0.1 * np.arange(N)
SWING = np.sin(TIME)
NAN_AT_7 = np.where(np.arange(N) == 7, np.nan, 1.0)
TRIAD = np.column_stack([SWING, 2.0 * SWING, 3.0 + SWING])

LOGS = {
    "odometer": (OdometerLog(TIME, 10.0 * SWING, np.full(N, 0.05)), read_odometer),
    "odometer without sigma": (OdometerLog(TIME, 10.0 * SWING), read_odometer),
    "wheel speeds": (
        WheelSpeedLog(TIME, ("fl", "rear_right", "kmh"), 10.0 + TRIAD * NAN_AT_7[:, None] ** np.arange(3)),
        read_wheel_speeds,
    ),
    "heading": (HeadingLog(TIME, (1.0 + TIME) % (2.0 * np.pi), np.full(N, 0.02)), read_heading),
    "magnetometer": (MagnetometerLog(TIME, 1e-6 * (TRIAD * 10.0)), read_magnetometer),
    "pressure": (BarometerLog(TIME, 1e5 + SWING), read_barometer),
    "barometric height": (BarometerLog(TIME, None, 100.0 + SWING), read_barometer),
    "both of a barometer": (BarometerLog(TIME, 1e5 + SWING, 100.0 + SWING), read_barometer),
    "body velocity": (
        BodyVelocityLog(TIME, TRIAD * NAN_AT_7[:, None] ** np.arange(3), 0.01 * NAN_AT_7[:, None] ** np.arange(3)),
        read_body_velocity,
    ),
    "forward velocity": (
        BodyVelocityLog(TIME, np.column_stack([SWING, np.full((N, 2), np.nan)])),
        read_body_velocity,
    ),
    "uwb": (
        UwbLog(TIME, np.array(["mast", "roof"] * (N // 2)), 20.0 + SWING, np.full(N, 0.1)),
        read_uwb,
    ),
}
READERS = pytest.mark.parametrize("name", LOGS)


def rows_of(log):
    return [name for name in ("time", *type(log).__slots__[1:]) if isinstance(getattr(log, name), np.ndarray)]


def columns_of(name):
    return {column: np.array(values) for column, values in LOGS[name][0].columns().items()}


@READERS
@pytest.mark.parametrize("extension", ["csv", "parquet"])
def test_what_was_written_is_read(tmp_path, name, extension):
    log, read = LOGS[name]
    path = tmp_path / f"log.{extension}"
    write_aiding(path, log)
    back = read(path)
    assert type(back) is type(log)
    assert back.source == str(path)
    assert back.notes == ()
    for row in rows_of(log):
        if getattr(log, row).dtype.kind == "f":
            np.testing.assert_allclose(getattr(back, row), getattr(log, row), rtol=5e-16, atol=1e-300)
        else:
            np.testing.assert_array_equal(getattr(back, row), getattr(log, row))
    assert {field for field in type(log).__slots__ if getattr(log, field) is None} == {
        field for field in type(log).__slots__ if getattr(back, field) is None
    }
    if name == "wheel speeds":
        assert back.wheels == log.wheels


@READERS
def test_stamps_are_shifted(write, name):
    path = write(columns_of(name))
    np.testing.assert_allclose(LOGS[name][1](path, time_offset_s=100.0).time, TIME + 100.0)
    with pytest.raises(ConfigError, match="time_offset_s = nan has to be a finite number of seconds"):
        LOGS[name][1](path, time_offset_s=float("nan"))


@READERS
def test_an_unknown_column_is_ignored_with_a_warning(write, name):
    columns = columns_of(name) | {"humidity": TIME}
    with pytest.warns(NavfuseWarning, match="ignored columns that navfuse does not know: 'humidity'"):
        log = LOGS[name][1](write(columns))
    assert len(log.notes) == 1


@READERS
def test_rows_without_measurement_are_left_out(write, name):
    columns = columns_of(name)
    for column, values in columns.items():
        if values.dtype.kind == "f" and column != "time_s":
            values[[3, 50, 51]] = [np.nan, np.inf, 1e300]
    with pytest.warns(NavfuseWarning, match=r"3 of 400 rows hold no measurement .* first is row 4 \(line 5\): left"):
        log = LOGS[name][1](write(columns))
    np.testing.assert_allclose(log.time, np.delete(TIME, [3, 50, 51]))


@READERS
def test_more_than_half_without_measurement_is_refused(write, name):
    columns = columns_of(name)
    for column, values in columns.items():
        if values.dtype.kind == "f" and column != "time_s":
            values[:250] = np.nan
    with pytest.raises(InputError, match=r"25\d of 400 rows hold no measurement .* more than half is not accepted"):
        LOGS[name][1](write(columns))


@READERS
def test_rows_out_of_order_are_sorted(write, name):
    order = np.arange(N)
    order[[100, 101]] = [101, 100]
    columns = {column: values[order] for column, values in columns_of(name).items()}
    with pytest.warns(NavfuseWarning, match=r"out of order.*sorted by time"):
        log = LOGS[name][1](write(columns))
    np.testing.assert_allclose(log.time, TIME)
    plain = LOGS[name][1](write(columns_of(name)))
    for row in rows_of(plain):
        np.testing.assert_array_equal(getattr(log, row), getattr(plain, row))


@READERS
def test_a_log_out_of_order_is_refused(write, name):
    columns = {column: np.concatenate([values[200:], values[:200]]) for column, values in columns_of(name).items()}
    with pytest.raises(InputError, match="1 % or more is not repaired"):
        LOGS[name][1](write(columns))


@READERS
def test_a_missing_column_is_named(write, name):
    columns = columns_of(name)
    for column in list(columns)[1:]:
        if not column.startswith("sd_"):
            columns[column[:1] + column] = columns.pop(column)
    with pytest.raises(InputError, match="needs more columns: '.*' is missing"):
        LOGS[name][1](write(columns))


@READERS
def test_the_time_is_needed(write, name):
    columns = columns_of(name)
    del columns["time_s"]
    with pytest.raises(InputError, match="needs more columns: 'time_s' is missing"):
        LOGS[name][1](write(columns))


@pytest.mark.parametrize(
    ("read", "columns", "row", "si"),
    [
        (read_odometer, {"speed_kmph": 36.0, "sd_speed_kmph": 3.6}, "speed", 10.0),
        (read_wheel_speeds, {"wheel_fl_kmh": 36.0}, "speed", 10.0),
        (read_heading, {"heading_rad": 7.0}, "heading", 7.0 - 2.0 * np.pi),
        (read_heading, {"heading_deg": -90.0}, "heading", 1.5 * np.pi),
        (read_magnetometer, {f"mag_{axis}_gauss": 0.3 for axis in "xyz"}, "field_b", 3e-5),
        (read_magnetometer, {f"mag_{axis}_nt": 30000.0 for axis in "xyz"}, "field_b", 3e-5),
        (read_magnetometer, {f"mag_{axis}_mgauss": 300.0 for axis in "xyz"}, "field_b", 3e-5),
        (read_barometer, {"pressure_pa": 1e5}, "pressure", 1e5),
        (read_barometer, {"pressure_mbar": 1000.0}, "pressure", 1e5),
        (read_barometer, {"pressure_kpa": 100.0}, "pressure", 1e5),
        (read_barometer, {"pressure_inhg": 29.92}, "pressure", 101320.8),
        (read_barometer, {"pressure_mmhg": 760.0}, "pressure", 101324.7),
        (read_barometer, {"pressure_psi": 14.6959}, "pressure", 101324.66),
        (read_barometer, {"height_ft": 1000.0}, "height", 304.8),
        (read_body_velocity, {"v_x_knots": 3600.0 / 1852.0}, "velocity_b", 1.0),
        (read_uwb, {"anchor": "a", "range_cm": 250.0}, "range", 2.5),
    ],
)
def test_other_units_are_converted(write, read, columns, row, si):
    table = {"time_ms": 1e3 * TIME} | {name: np.full(N, value) for name, value in columns.items()}
    log = read(write(table))
    values = np.atleast_2d(getattr(log, row).T)[0]
    np.testing.assert_allclose(values, si, rtol=1e-6)
    np.testing.assert_allclose(log.time, TIME, atol=1e-12)


@pytest.mark.parametrize(
    ("read", "column", "message"),
    [
        (read_odometer, "speed_furlongs", "'furlongs' is not a known unit of speed"),
        (read_wheel_speeds, "wheel_fl_furlongs", "'furlongs' is not a known unit of speed"),
        (read_wheel_speeds, "wheel_fl", "column 'wheel_fl' has no unit; rename it to 'wheel_fl_mps'"),
        (read_heading, "heading", "column 'heading' has no unit; rename it to 'heading_deg'"),
        (read_magnetometer, "mag_x_tesla", "'tesla' is not a known unit of magnetic field"),
        (read_barometer, "pressure_atm", "'atm' is not a known unit of pressure"),
        (read_body_velocity, "v_x", "column 'v_x' has no unit; rename it to 'v_x_mps'"),
        (read_uwb, "range_mps", "'mps' is not a known unit of length"),
    ],
)
def test_an_unknown_unit_is_refused(write, read, column, message):
    with pytest.raises(InputError, match=message):
        read(write({"time_s": TIME, column: SWING}))


SIGMAS = ("odometer", "heading", "body velocity", "uwb")


@pytest.mark.parametrize("name", SIGMAS)
@pytest.mark.parametrize("flaw", [0.0, -1.0, np.nan])
def test_a_sigma_that_is_none_is_refused(write, name, flaw):
    columns = columns_of(name)
    sigma = next(column for column in columns if column.startswith("sd_"))
    columns[sigma][20] = flaw
    with pytest.raises(
        InputError, match=rf"row 21 \(line 22\), column '{sigma}': .* is no standard deviation, it has to be more"
    ):
        LOGS[name][1](write(columns))


@pytest.mark.parametrize("name", SIGMAS)
def test_sigmas_are_optional(write, name):
    columns = {column: values for column, values in columns_of(name).items() if not column.startswith("sd_")}
    log = LOGS[name][1](write(columns))
    assert next(getattr(log, field) for field in type(log).__slots__ if field.startswith("sd_")) is None


def test_sigmas_of_some_axes_only_are_refused(write):
    columns = columns_of("body velocity")
    del columns["sd_v_y_mps"]
    with pytest.raises(InputError, match="with standard deviations needs more columns: 'sd_v_y_mps' is missing"):
        read_body_velocity(write(columns))


def test_a_column_of_degrees_that_holds_radians_is_warned_about(write):
    turning = np.linspace(0.0, 2.0 * np.pi - 0.01, N)
    with pytest.warns(NavfuseWarning, match=r"no heading is beyond 6.27 deg. Are these radians\?"):
        read_heading(write({"time_s": TIME, "heading_deg": turning}))
    assert read_heading(write({"time_s": TIME, "heading_deg": 1.0 + SWING * 0.9})).notes == ()
    assert read_heading(write({"time_s": TIME, "heading_rad": turning})).notes == ()


@pytest.mark.parametrize("factor", [1e3, 1e-3])
def test_a_field_that_is_not_that_of_the_earth_is_refused(write, factor):
    columns = columns_of("magnetometer")
    table = {name: values * (1.0 if name == "time_s" else factor) for name, values in columns.items()}
    with pytest.raises(InputError, match=r"column 'mag_x_ut': the values are about .* uT, which no field of the"):
        read_magnetometer(write(table))


@pytest.mark.parametrize("factor", [100.0, 1e-3])
def test_a_pressure_that_is_not_that_of_air_is_refused(write, factor):
    with pytest.raises(InputError, match=r"hPa, which no pressure of air is \(5 to 1200 hPa\)"):
        read_barometer(write({"time_s": TIME, "pressure_hpa": np.full(N, 1000.0 * factor)}))


def test_a_single_negative_pressure_is_refused(write):
    pressure = np.where(np.arange(N) == 5, -1.0, 1000.0)
    with pytest.raises(InputError, match=r"row 6 \(line 7\), column 'pressure_hpa': -1 is no pressure"):
        read_barometer(write({"time_s": TIME, "pressure_hpa": pressure}))


def test_a_negative_range_is_refused(write):
    columns = columns_of("uwb")
    columns["range_m"][9] = -0.5
    with pytest.raises(InputError, match=r"row 10 \(line 11\), column 'range_m': -0.5 is a negative range"):
        read_uwb(write(columns | {"anchor": np.array(["a", "b"] * (N // 2))}))


@pytest.mark.parametrize("extension", ["csv", "parquet"])
def test_a_range_without_anchor_is_refused(tmp_path, extension):
    columns = columns_of("uwb")
    columns["anchor"][4] = " "
    path = tmp_path / f"uwb.{extension}"
    write_aiding(path, UwbLog(TIME, columns["anchor"], columns["range_m"]))
    with pytest.raises(InputError, match=r"row 5( \(line 6\))?, column 'anchor': the name of the anchor is missing"):
        read_uwb(path)


def test_anchors_may_share_a_stamp_but_not_repeat_it(write):
    time = np.repeat(TIME, 2)
    columns = {"time_s": time, "anchor": np.array(["a", "b"] * N), "range_m": 5.0 + np.arange(2.0 * N)}
    log = read_uwb(write(columns))
    np.testing.assert_array_equal(log.time, time)
    assert log.notes == ()
    again = {name: np.insert(values, 11, values[10]) for name, values in columns.items()}
    again["range_m"][11] = 1.0
    with pytest.warns(NavfuseWarning, match="0 rows out of order and 1 row that repeat stamp and anchor"):
        mended = read_uwb(write(again))
    np.testing.assert_array_equal(mended.range, log.range)
    np.testing.assert_array_equal(mended.anchor, log.anchor)


ANCHORS = UwbAnchors(
    np.array(["mast", "roof"]), np.radians([45.0, -12.5]), np.radians([11.0, -170.0]), np.array([100.0, -3.0])
)


@pytest.mark.parametrize("extension", ["csv", "parquet"])
def test_anchors_that_were_written_are_read(tmp_path, extension):
    path = tmp_path / f"anchors.{extension}"
    write_aiding(path, ANCHORS)
    back = read_uwb_anchors(path)
    np.testing.assert_array_equal(back.name, ANCHORS.name)
    for row in ("lat", "lon", "height"):
        np.testing.assert_allclose(getattr(back, row), getattr(ANCHORS, row), rtol=5e-16)
    assert back.source == str(path)


def test_names_of_anchors_may_hold_commas(tmp_path):
    path = tmp_path / "uwb.csv"
    log = UwbLog(TIME, np.array(["roof, east", "roof, west"] * (N // 2)), 20.0 + SWING)
    write_aiding(path, log)
    np.testing.assert_array_equal(read_uwb(path).anchor, log.anchor)


def test_longitudes_of_anchors_may_be_counted_to_360(write):
    columns = ANCHORS.columns() | {"lon_deg": np.array([11.0, 190.0])}
    np.testing.assert_allclose(read_uwb_anchors(write(columns)).lon, ANCHORS.lon)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"anchor": np.array(["mast", "mast"])}, r"row 2 \(line 3\): the anchor 'mast' is there twice"),
        ({"anchor": np.array(["mast", ""])}, r"row 2 \(line 3\), column 'anchor': the name of the anchor is missing"),
        (
            {"lat_deg": np.array([1.0, 91.0])},
            r"row 2 \(line 3\), column 'lat_deg': 91 is no position.* \+-90 deg",
        ),
        ({"lon_deg": np.array([np.nan, 9.0])}, r"row 1 \(line 2\), column 'lon_deg': nan is no position"),
        ({"height_m": np.array([1e7, 9.0])}, r"row 1 \(line 2\), column 'height_m': 10000000 is no position"),
    ],
)
def test_anchors_that_make_no_sense_are_refused(write, changed, message):
    with pytest.raises(InputError, match=message):
        read_uwb_anchors(write(ANCHORS.columns() | changed))


def test_anchors_need_their_columns(write):
    columns = ANCHORS.columns()
    del columns["height_m"]
    with pytest.raises(InputError, match="a table of anchors needs more columns: 'height_m' is missing"):
        read_uwb_anchors(write(columns))


def test_only_tables_are_written(tmp_path):
    with pytest.raises(OutputError, match=r"cannot write a table as '.txt'"):
        write_aiding(tmp_path / "log.txt", LOGS["odometer"][0])


def test_a_wheel_in_two_units_is_refused(write):
    with pytest.raises(InputError, match="'wheel_fl_mps' and 'wheel_fl_kmh' hold the same quantity"):
        read_wheel_speeds(write({"time_s": TIME, "wheel_fl_mps": SWING, "wheel_fl_kmh": 3.6 * SWING}))


@given(
    st.lists(st.floats(-1e4, 1e4, allow_subnormal=False), min_size=1, max_size=30),
    st.sampled_from(["csv", "parquet"]),
)
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_heading_comes_back_within_a_turn(tmp_path, degrees, extension):
    time = np.arange(float(len(degrees)))
    path = tmp_path / f"heading.{extension}"
    write_aiding(path, HeadingLog(time, np.radians(degrees)))
    with warnings.catch_warnings(record=True):
        warnings.simplefilter("always")
        back = read_heading(path)
    assert np.all((back.heading >= 0.0) & (back.heading < 2.0 * np.pi))
    turned = np.exp(1j * back.heading) / np.exp(1j * np.radians(degrees))
    np.testing.assert_allclose(turned, 1.0, atol=1e-11)
    np.testing.assert_array_equal(back.time, time)


def test_rows_are_named_as_in_the_file_though_others_were_left_out(write):
    speed, sd = np.where(np.arange(N) == 3, np.nan, SWING), np.where(np.arange(N) == 20, 0.0, 0.1)
    with pytest.raises(InputError, match=r"row 21 \(line 22\), column 'sd_speed_mps': 0 is no standard deviation"):
        read_odometer(write({"time_s": TIME, "speed_mps": speed, "sd_speed_mps": sd}))
