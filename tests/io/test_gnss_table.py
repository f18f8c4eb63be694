from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from navfuse.errors import ConfigError, InputError, NavfuseWarning
from navfuse.io.gnss_rows import DEFAULT_SD_POSITION, DEFAULT_SD_VELOCITY
from navfuse.io.gnss_table import read_gnss
from navfuse.io.tables import write_table

BOTH = pytest.mark.parametrize("name", ["gnss.csv", "gnss.parquet"])
SD_POSITION = ("sd_north_m", "sd_east_m", "sd_down_m")
VELOCITY = ("vn_mps", "ve_mps", "vd_mps")
SD_VELOCITY = ("sd_vn_mps", "sd_ve_mps", "sd_vd_mps")


def stack(columns, names):
    return np.column_stack([columns[name] for name in names])


def without(columns, *names):
    return {name: values for name, values in columns.items() if name not in names}


@BOTH
def test_every_column(write, gnss, name):
    gnss |= {"fix": np.array(["rtk-fixed", "single"] * 60), "n_satellites": np.arange(120)}
    path = write(gnss, name)
    log = read_gnss(path, time_offset_s=0.5)
    assert log.source == str(path)
    assert log.notes == ()
    np.testing.assert_array_equal(log.time, gnss["time_s"] + 0.5)
    np.testing.assert_allclose(log.lat, np.radians(gnss["lat_deg"]), rtol=0, atol=1e-15)
    np.testing.assert_allclose(log.lon, np.radians(gnss["lon_deg"]), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(log.height, gnss["height_m"])
    np.testing.assert_array_equal(log.sd_position, stack(gnss, SD_POSITION))
    np.testing.assert_array_equal(log.velocity_n, stack(gnss, VELOCITY))
    np.testing.assert_array_equal(log.sd_velocity, stack(gnss, SD_VELOCITY))
    assert log.fix.tolist() == gnss["fix"].tolist()
    assert log.n_satellites.tolist() == list(range(120))
    assert log.n_satellites.dtype == np.int64


def test_positions_only(write, gnss_positions):
    log = read_gnss(write(gnss_positions))
    assert log.velocity_n is None
    assert log.sd_velocity is None
    assert log.fix is None
    assert log.n_satellites is None


def test_other_units(write, gnss):
    columns = {
        "time_ms": 1000.0 * gnss["time_s"],
        "lat_rad": np.radians(gnss["lat_deg"]),
        "lon_rad": np.radians(gnss["lon_deg"]),
        "height_ft": gnss["height_m"] / 0.3048,
        **{name.replace("_m", "_cm"): 100.0 * gnss[name] for name in SD_POSITION},
        **{name.replace("mps", "kmph"): 3.6 * gnss[name] for name in (*VELOCITY, *SD_VELOCITY)},
    }
    log, native = read_gnss(write(columns, "a.parquet")), read_gnss(write(gnss, "b.parquet"))
    for attribute in ("time", "lat", "lon", "height", "sd_position", "velocity_n", "sd_velocity"):
        np.testing.assert_allclose(getattr(log, attribute), getattr(native, attribute), rtol=1e-14, atol=1e-15)


def test_missing_column(write, gnss):
    gnss["latitude"] = gnss.pop("lat_deg")
    with pytest.raises(InputError, match="'lat_deg' is missing, is the column 'latitude' meant to be it"):
        read_gnss(write(gnss))


def test_unknown_unit(write, gnss):
    gnss["height_yd"] = gnss.pop("height_m")
    with pytest.raises(InputError, match="'yd' is not a known unit of length; .*: m, km, cm, mm, ft"):
        read_gnss(write(gnss))


def test_unknown_column(write, gnss):
    with pytest.warns(NavfuseWarning, match="ignored columns .* 'hdop'") as caught:
        log = read_gnss(write(gnss | {"hdop": np.ones(120)}))
    assert caught[0].filename == __file__
    assert log.notes == (str(caught[0].message),)


def test_velocity_with_a_component_missing(write, gnss):
    with pytest.raises(InputError, match="a GNSS table with velocities needs more columns: 'vd_mps' is missing"):
        read_gnss(write(without(gnss, "vd_mps")))


@pytest.mark.parametrize("offset", [np.nan, -np.inf])
def test_time_offset_that_is_not_finite(write, gnss, offset):
    with pytest.raises(ConfigError, match="time_offset_s"):
        read_gnss(write(gnss), time_offset_s=offset)


def test_epoch_of_a_native_table(write, gnss):
    log = read_gnss(write(gnss), epoch=(2374, 7.0))
    assert log.epoch == (2374, 7.0)
    np.testing.assert_array_equal(log.time, read_gnss(write(gnss)).time)
    assert read_gnss(write(gnss)).epoch is None
    with pytest.raises(ConfigError, match=r"epoch = \(2374, -1\.0\)"):
        read_gnss(write(gnss), epoch=(2374, -1.0))


@BOTH
def test_rows_without_position_are_left_out(write, gnss, name):
    gnss["lat_deg"][[3, 4]] = np.nan
    gnss["height_m"][60] = np.inf
    gnss["height_m"][61] = 1e300
    gnss["lat_deg"][70] = gnss["lon_deg"][70] = 0.0
    gnss["sd_north_m"][80] = np.inf
    row = r"row 4 \(line 5\)" if name.endswith("csv") else "row 4"
    with pytest.warns(NavfuseWarning, match=f"6 of 120 rows hold no position .* the first is {row}: left out"):
        log = read_gnss(write(gnss, name))
    np.testing.assert_array_equal(log.time, np.delete(gnss["time_s"], [3, 4, 60, 61, 70, 80]))
    assert np.isfinite(log.lat).all()


def test_rows_whose_fix_is_none(write, gnss):
    fix = np.array(["single"] * 120)
    fix[[5, 6]] = ["No-Fix", "none"]
    with pytest.warns(NavfuseWarning, match="2 of 120 rows hold no position"):
        assert set(read_gnss(write(gnss | {"fix": fix})).fix) == {"single"}


def test_mostly_no_position(write, gnss):
    gnss["lat_deg"][10:80] = np.nan
    with pytest.raises(InputError, match=r"70 of 120 rows hold no position .* row 11 \(line 12\); more than half"):
        read_gnss(write(gnss))


def test_log_at_zero_zero_is_accepted(write, gnss):
    gnss["lat_deg"] = np.zeros(120)
    gnss["lon_deg"] = np.zeros(120)
    assert read_gnss(write(without(gnss, *VELOCITY, *SD_VELOCITY, "vd_mps"))).time.size == 120


def test_one_fix(write, gnss):
    with pytest.raises(InputError, match="the log has 1 usable fix; at least two are needed"):
        read_gnss(write({name: values[:1] for name, values in gnss.items()}))


def test_late_and_repeated_rows(write, gnss_positions):
    columns = {name: np.tile(values, 4) for name, values in gnss_positions.items()}
    columns["time_s"] = np.arange(480.0)
    for values in columns.values():
        values[[30, 31]] = values[[31, 30]]
    columns["time_s"][70] = columns["time_s"][69]
    columns["lat_deg"][10] = np.nan
    with pytest.warns(NavfuseWarning) as caught:
        log = read_gnss(write(columns))
    assert "1 rows are out of order and 1 rows repeat a time stamp of 479" in str(caught[1].message)
    assert "the first is row 32 (line 33): sorted by time, the first row of each stamp kept" in str(caught[1].message)
    assert (np.diff(log.time) > 0.0).all()
    assert log.lat[29] == pytest.approx(np.radians(gnss_positions["lat_deg"][30]), abs=1e-15)


def test_reversed_time(write, gnss):
    gnss["time_s"] = gnss["time_s"][::-1]
    with pytest.raises(InputError, match="column 'time_s' does not increase"):
        read_gnss(write(gnss))


@BOTH
def test_latitude_out_of_range(write, gnss, name):
    gnss["lat_deg"][7] = 91.5
    row = r"row 8 \(line 9\)" if name.endswith("csv") else "row 8"
    with pytest.raises(InputError, match=rf"{row}, column 'lat_deg': latitude 91\.5 deg is outside -90\.\.90\.$|exch"):
        read_gnss(write(gnss, name))


def test_latitude_and_longitude_exchanged(write, gnss):
    gnss["lat_deg"], gnss["lon_deg"] = gnss["lon_deg"] + 100.0, gnss["lat_deg"]
    with pytest.raises(InputError, match="Are latitude and longitude exchanged"):
        read_gnss(write(gnss))


def test_degrees_in_a_radian_column(write, gnss):
    gnss["lat_rad"] = gnss.pop("lat_deg")
    with pytest.raises(InputError, match="column 'lat_rad': .* Are these degrees"):
        read_gnss(write(gnss))


def test_absurd_latitude_in_radians(write, gnss):
    gnss["lat_rad"] = np.radians(gnss.pop("lat_deg"))
    gnss["lat_rad"][5] = 1e308
    with pytest.raises(InputError, match="latitude inf deg"):
        read_gnss(write(gnss))


@pytest.mark.parametrize("lon", [-180.1, 360.1])
def test_longitude_out_of_range(write, gnss, lon):
    gnss["lon_deg"][7] = lon
    with pytest.raises(InputError, match=rf"row 8 .*column 'lon_deg': longitude {lon} deg is outside -180\.\.360"):
        read_gnss(write(gnss))


def test_longitude_to_360(write, gnss):
    gnss["lon_deg"] += 180.0
    assert read_gnss(write(gnss)).lon[0] == pytest.approx(np.radians(11.5 - 180.0), abs=1e-14)


def test_date_line(write, gnss):
    gnss["lon_deg"] += 180.0 - 11.5
    gnss["lon_deg"] = np.where(gnss["lon_deg"] > 180.001, gnss["lon_deg"] - 360.0, gnss["lon_deg"])
    log = read_gnss(write(gnss))
    assert log.notes == ()
    assert np.abs(log.lon).max() <= np.pi


@pytest.mark.parametrize("value", [0.0, -0.5])
@pytest.mark.parametrize("column", ["sd_east_m", "sd_vd_mps"])
def test_sigma_that_is_not_positive(write, gnss, column, value):
    gnss[column][[11, 20]] = value
    with pytest.raises(InputError) as raised:
        read_gnss(write(gnss))
    message = str(raised.value)
    assert f"row 12 (line 13), column '{column}': a standard deviation of {value:g} m" in message
    assert "2 rows have such values" in message


def test_sigma_of_a_missing_velocity_may_be_zero(write, gnss):
    gnss["vn_mps"][11] = np.nan
    gnss["sd_vn_mps"][11] = 0.0
    log = read_gnss(write(gnss))
    assert np.isnan(log.velocity_n[11]).all()
    assert np.isfinite(log.velocity_n[10]).all()
    assert (log.sd_velocity > 0.0).all()
    assert log.notes == ()


def test_missing_sigmas_get_defaults(write, gnss):
    with pytest.warns(NavfuseWarning) as caught:
        log = read_gnss(write(without(gnss, *SD_POSITION, *SD_VELOCITY)))
    messages = [str(warning.message) for warning in caught]
    assert [message.split(": ", 1)[1] for message in messages] == [
        "'sd_north_m' is missing: assumed 5 m",
        "'sd_east_m' is missing: assumed 5 m",
        "'sd_down_m' is missing: assumed 10 m",
        "'sd_vn_mps' is missing: assumed 0.2 m/s",
        "'sd_ve_mps' is missing: assumed 0.2 m/s",
        "'sd_vd_mps' is missing: assumed 0.4 m/s",
    ]
    assert log.notes == tuple(messages)
    assert (log.sd_position == DEFAULT_SD_POSITION[""]).all()
    assert (log.sd_velocity == DEFAULT_SD_VELOCITY).all()


def test_missing_sigmas_by_fix_type(write, gnss_positions):
    kinds = ["rtk-fixed", "RTK-float", "ppp", "dgps", "sbas", "single", "mystery", ""]
    columns = without(gnss_positions, *SD_POSITION) | {"fix": np.array(kinds * 15)}
    with pytest.warns(NavfuseWarning) as caught:
        log = read_gnss(write(columns))
    assert str(caught[0].message).endswith("'sd_north_m' is missing: assumed 0.02 or 0.1 or 0.5 or 1.5 or 5 m")
    for row, kind in enumerate(kinds):
        assert tuple(log.sd_position[row]) == DEFAULT_SD_POSITION.get(kind.lower(), DEFAULT_SD_POSITION[""])


def test_empty_sigma_cells(write, gnss):
    gnss["sd_down_m"][[4, 5, 6]] = np.nan
    with pytest.warns(NavfuseWarning, match="'sd_down_m' is empty in 3 rows: assumed 10 m"):
        log = read_gnss(write(gnss))
    assert log.sd_position[4:7, 2].tolist() == [10.0, 10.0, 10.0]
    assert log.sd_position[3, 2] == 2.0


def test_one_sigma_column_missing(write, gnss):
    with pytest.warns(NavfuseWarning, match="'sd_down_m' is missing: assumed 10 m"):
        log = read_gnss(write(without(gnss, "sd_down_m")))
    assert log.sd_position[0].tolist() == [1.0, 1.5, 10.0]


def test_velocity_columns_without_values(write, gnss):
    for name in VELOCITY:
        gnss[name] = np.full(120, np.nan)
    with pytest.warns(NavfuseWarning, match="no row of vn_mps, ve_mps, vd_mps holds a velocity"):
        assert read_gnss(write(gnss)).velocity_n is None


def test_unknown_number_of_satellites(write, gnss):
    satellites = np.full(120, 7.0)
    satellites[3] = np.nan
    assert read_gnss(write(gnss | {"n_satellites": satellites})).n_satellites[:5].tolist() == [7, 7, 7, 0, 7]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow], max_examples=25)
@given(
    lat=st.floats(-90.0, 90.0),
    lon=st.floats(-180.0, 180.0),
    height=st.floats(-400.0, 9000.0),
    name=st.sampled_from(["g.csv", "g.parquet"]),
)
def test_write_and_read_back(tmp_path, lat, lon, height, name):
    assume((np.radians(lat), np.radians(lon)) != (0.0, 0.0))
    columns = {
        "time_s": np.array([0.0, 0.1]),
        "lat_deg": np.array([lat, lat]),
        "lon_deg": np.array([lon, lon + 8.0]) if lon < 170.0 else np.array([lon, lon - 8.0]),
        "height_m": np.array([height, height]),
        **{sd: np.ones(2) for sd in SD_POSITION},
    }
    write_table(tmp_path / name, columns)
    log = read_gnss(tmp_path / name)
    np.testing.assert_array_equal(log.time, columns["time_s"])
    np.testing.assert_allclose(np.degrees(log.lat), columns["lat_deg"], rtol=0, atol=1e-13)
    np.testing.assert_allclose(np.degrees(log.lon), columns["lon_deg"], rtol=0, atol=1e-13)
    np.testing.assert_array_equal(log.height, columns["height_m"])


def test_car_1h(shared_data):
    log = read_gnss(shared_data / "car-1h-200hz/gnss.csv")
    assert log.time.size == 3601
    assert log.notes == ()
    assert log.velocity_n is None
    assert (log.sd_position == (1.0, 1.0, 2.0)).all()


def test_stated_sigmas_stand_where_the_file_has_none(write, gnss, recwarn):
    columns = without(gnss, *SD_POSITION, *SD_VELOCITY)
    log = read_gnss(write(columns), sd_position_m=[3.0, 4.0, 5.0], sd_velocity_mps=(0.1, 0.2, 0.3))
    np.testing.assert_array_equal(log.sd_position, np.tile([3.0, 4.0, 5.0], (120, 1)))
    np.testing.assert_array_equal(log.sd_velocity, np.tile([0.1, 0.2, 0.3], (120, 1)))
    assert not recwarn.list


def test_stated_sigmas_fill_empty_cells_only(write, gnss, recwarn):
    gnss["sd_east_m"][7] = np.nan
    log = read_gnss(write(gnss), sd_position_m=[3.0, 4.0, 5.0])
    np.testing.assert_array_equal(log.sd_position[7], [1.0, 4.0, 2.0])
    np.testing.assert_array_equal(np.delete(log.sd_position, 7, axis=0), np.delete(stack(gnss, SD_POSITION), 7, axis=0))
    assert not recwarn.list


def test_stated_sigmas_come_before_those_of_the_kind_of_fix(write, gnss):
    columns = without(gnss, *SD_POSITION) | {"fix": np.full(120, "rtk-fixed")}
    log = read_gnss(write(columns), sd_position_m=[3.0, 4.0, 5.0])
    np.testing.assert_array_equal(log.sd_position[0], [3.0, 4.0, 5.0])


def test_stated_sigmas_without_effect_are_told(write, gnss, gnss_positions):
    with pytest.warns(NavfuseWarning, match="own standard deviations in every row, so that gnss.sd_position_m has no"):
        log = read_gnss(write(gnss), sd_position_m=[3.0, 4.0, 5.0])
    np.testing.assert_array_equal(log.sd_position, stack(gnss, SD_POSITION))
    with pytest.warns(NavfuseWarning, match="no velocities, so that gnss.sd_velocity_mps has no effect"):
        read_gnss(write(gnss_positions), sd_velocity_mps=[0.1, 0.1, 0.1])


@pytest.mark.parametrize("values", [[1.0, 2.0], [1.0, 0.0, 1.0], [1.0, -1.0, 1.0], [1.0, np.nan, 1.0], [1, np.inf, 1]])
def test_stated_sigmas_have_to_be_three_positive_numbers(write, gnss, values):
    path = write(gnss)
    with pytest.raises(ConfigError, match="sd_position_m = .* three positive numbers: north, east, down"):
        read_gnss(path, sd_position_m=values)
    with pytest.raises(ConfigError, match="sd_velocity_mps = .* three positive numbers: north, east, down"):
        read_gnss(path, sd_velocity_mps=values)
