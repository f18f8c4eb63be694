from __future__ import annotations

import numpy as np
import pytest

from navfuse.errors import ConfigError, InputError, NavfuseWarning
from navfuse.io.gnss_table import read_gnss
from navfuse.io.rtklib_pos import parse_rtklib_pos

LLH = (
    "%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns"
    "   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio"
)
VELOCITY = "    vn(m/s)    ve(m/s)    vu(m/s)      sdvn     sdve     sdvu    sdvne    sdveu    sdvun"
TAIL = " 1 12 0.0100 0.0200 0.0300 0.0010 -0.0020 0.0005 0.00 5.0"
FAST = " 1.0 2.0 0.5 0.1 0.2 0.3 0.0 0.0 0.0"


def file(*rows, header=LLH):
    return "\n".join(["% program   : RTKPOST", "%", header, *rows]) + "\n"


def rows(n=3, tail=TAIL, date="2023/07/11 06:04:{:06.3f}"):
    return [date.format(k) + f" 35.1653{k} 136.8814{k} 41.4{k}" + tail for k in range(n)]


def read(write, text, **options):
    return read_gnss(write(text, "fixes.pos"), **options)


def test_date_and_time(write):
    log = read(write, file(*rows()))
    assert log.time.tolist() == [194640.0, 194641.0, 194642.0]
    np.testing.assert_allclose(np.degrees(log.lat), [35.16530, 35.16531, 35.16532], rtol=0, atol=1e-13)
    np.testing.assert_allclose(np.degrees(log.lon), [136.88140, 136.88141, 136.88142], rtol=0, atol=1e-13)
    assert log.height.tolist() == [41.40, 41.41, 41.42]
    assert log.sd_position[0].tolist() == [0.01, 0.02, 0.03]
    assert log.fix.tolist() == ["rtk-fixed"] * 3
    assert log.n_satellites.tolist() == [12, 12, 12]
    assert log.velocity_n is None
    assert log.notes == ()


def test_velocity_points_down(write):
    log = read(write, file(*rows(tail=TAIL + FAST), header=LLH + VELOCITY))
    assert log.velocity_n[0].tolist() == [1.0, 2.0, -0.5]
    assert log.sd_velocity[0].tolist() == [0.1, 0.2, 0.3]


def test_velocity_of_zeros_is_none(write):
    still = " 0.0 0.0 0.0 0.1 0.1 0.1 0 0 0"
    none = " 0.0 0.0 0.0 0.0 0.0 0.0 0 0 0"
    text = file(
        *rows(2, TAIL + FAST),
        "2023/07/11 06:04:03 35 136 41" + TAIL + still,
        "2023/07/11 06:04:04 35 136 41" + TAIL + none,
    )
    log = read(write, text.replace(LLH, LLH + VELOCITY))
    assert log.velocity_n[2].tolist() == [0.0, 0.0, 0.0]
    assert np.isnan(log.velocity_n[3]).all()


def test_week_and_seconds(write):
    text = file("2270 194670.000 35.1653 136.8814 41.4" + TAIL, "2270 194670.200 35.1653 136.8814 41.4" + TAIL)
    assert read(write, text).time.tolist() == [194670.0, 194670.2]


@pytest.mark.parametrize("separator", [",", ";", "\t", " , "])
def test_separators(write, separator):
    text = file(*rows())
    lines = [
        line if line.startswith("%") and "GPST" not in line else separator.join(line.split())
        for line in text.split("\n")
    ]
    text = "\n".join(lines).replace(f"%{separator}GPST", "%  GPST").replace(f"2023/07/11{separator}", "2023/07/11 ")
    assert read(write, text).sd_position[2].tolist() == [0.01, 0.02, 0.03]


@pytest.mark.parametrize(
    ("q", "name"),
    [(1, "rtk-fixed"), (2, "rtk-float"), (3, "sbas"), (4, "dgps"), (5, "single"), (6, "ppp"), ("2.0", "rtk-float")],
)
def test_quality(write, q, name):
    assert set(read(write, file(*rows(tail=TAIL.replace(" 1 12", f" {q} 12")))).fix) == {name}


@pytest.mark.parametrize("q", [0, 9, "nan"])
def test_quality_that_means_no_fix(write, q):
    text = file(*rows(5), "2023/07/11 06:04:30 35.1 136.8 41" + TAIL.replace(" 1 12", f" {q} 12"))
    with pytest.warns(NavfuseWarning, match=r"1 of 6 rows hold no position .* the first is line 9: left out"):
        assert read(write, text).time.size == 5


def test_minimal_columns_get_default_sigmas(write):
    header = "%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns"
    with pytest.warns(NavfuseWarning) as caught:
        log = read(write, file(*rows(tail=" 2 8"), header=header))
    assert [str(warning.message).split(": ", 1)[1] for warning in caught] == [
        "'sdn' is missing: assumed 0.5 m",
        "'sde' is missing: assumed 0.5 m",
        "'sdu' is missing: assumed 1 m",
    ]
    assert log.sd_position[0].tolist() == [0.5, 0.5, 1.0]


def test_columns_may_be_missing_altogether(write):
    with pytest.warns(NavfuseWarning):
        log = read(write, file(*rows(tail=""), header="% GPST latitude(deg) longitude(deg) height(m)"))
    assert log.fix is None
    assert log.n_satellites is None
    assert log.sd_position[0].tolist() == [5.0, 5.0, 10.0]


def test_degrees_minutes_seconds(write):
    header = LLH.replace("latitude(deg)", "latitude(d'\")").replace("longitude(deg)", "longitude(d'\")")
    text = file(
        "2023/07/11 06:04:00  35 09 55.08000  -0 52 53.04000 41.4" + TAIL,
        "2023/07/11 06:04:01 -35 09 55.08000 -136 52 53.04000 41.4" + TAIL,
        header=header,
    )
    log = read(write, text)
    np.testing.assert_allclose(np.degrees(log.lat), [35.1653, -35.1653], rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.degrees(log.lon), [-0.8814, -136.8814], rtol=0, atol=1e-12)
    assert log.height.tolist() == [41.4, 41.4]


ECEF = (
    "%  GPST                      x-ecef(m)      y-ecef(m)      z-ecef(m)   Q  ns"
    "   sdx(m)   sdy(m)   sdz(m)  sdxy(m)  sdyz(m)  sdzx(m) age(s)  ratio"
    "    vx(m/s)    vy(m/s)    vz(m/s)      sdvx     sdvy     sdvz    sdvxy    sdvyz    sdvzx"
)


def signed_root(value):
    return np.sign(value) * np.sqrt(abs(value))


def ecef_row(second, lat_deg, lon_deg, height, sd_ned, correlation, v_ned):
    """A line with a position by pyproj and a covariance rotated with plain matrices."""
    import pyproj

    x, y, z = pyproj.Transformer.from_crs(4979, 4978).transform(lat_deg, lon_deg, height)
    lat, lon = np.radians([lat_deg, lon_deg])
    ned = np.array(
        [
            [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)],
            [-np.sin(lon), np.cos(lon), 0.0],
            [-np.cos(lat) * np.cos(lon), -np.cos(lat) * np.sin(lon), -np.sin(lat)],
        ]
    )
    covariance = ned.T @ (np.outer(sd_ned, sd_ned) * correlation) @ ned
    sd = [signed_root(covariance[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))]
    values = [x, y, z, 1, 9, *sd, 0.0, 3.0, *(ned.T @ v_ned), *sd]
    return f"2023/07/11 06:04:{second:02d} " + " ".join(f"{value:.9f}" for value in values)


@pytest.mark.parametrize(("lat", "lon"), [(35.1653, 136.8814), (-12.0, -77.0), (89.99, 20.0), (0.0, 180.0)])
def test_ecef(write, lat, lon):
    correlation = np.array([[1.0, 0.3, -0.2], [0.3, 1.0, 0.1], [-0.2, 0.1, 1.0]])
    sd, v = np.array([0.5, 0.3, 1.2]), np.array([3.0, -2.0, 0.5])
    log = read(write, file(*(ecef_row(k, lat, lon, 41.4, sd, correlation, v) for k in range(2)), header=ECEF))
    np.testing.assert_allclose(np.degrees(log.lat), lat, rtol=0, atol=1e-13)
    np.testing.assert_allclose(np.abs(np.degrees(log.lon)), abs(lon), rtol=0, atol=2e-10)
    np.testing.assert_allclose(log.height, 41.4, rtol=0, atol=1e-8)
    np.testing.assert_allclose(log.sd_position, [sd, sd], rtol=0, atol=1e-8)
    np.testing.assert_allclose(log.sd_velocity, [sd, sd], rtol=0, atol=1e-8)
    np.testing.assert_allclose(log.velocity_n, [v, v], rtol=0, atol=1e-8)


def test_ecef_without_position_or_sigmas(write):
    header = ECEF[: ECEF.index("   sdx(m)")]
    good = "2023/07/11 06:04:{:02d} -3810228.58 3567868.55 3652903.30 5 9"
    text = file(*(good.format(k) for k in range(4)), "2023/07/11 06:04:10 0.0 0.0 0.0 5 9", header=header)
    with pytest.warns(NavfuseWarning) as caught:
        log = read(write, text)
    assert "1 of 5 rows hold no position" in str(caught[0].message)
    assert "'sdx' is missing: assumed 5 m" in str(caught[1].message)
    assert log.time.size == 4
    assert np.degrees(log.lat[0]) == pytest.approx(35.1653611, abs=1e-6)


def test_ecef_sigmas_without_cross_terms(write):
    header = "% GPST x-ecef(m) y-ecef(m) z-ecef(m) Q ns sdx(m) sdy(m) sdz(m)"
    text = file(
        *(f"2023/07/11 06:04:0{k} -3810228.58 3567868.55 3652903.30 5 9 2 2 2" for k in range(2)), header=header
    )
    np.testing.assert_allclose(read(write, text).sd_position, 2.0, rtol=0, atol=1e-12)


def test_utc_gets_leap_seconds(write):
    header = LLH.replace("GPST", "UTC ")
    text = file(
        "2016/12/31 23:59:59.5 35 136 41" + TAIL,
        "2016/12/31 23:59:60.5 35 136 41" + TAIL,
        "2017/01/01 00:00:00.5 35 136 41" + TAIL,
        header=header,
    )
    midnight_tow = 0.0
    log = read(write, text, epoch=(1930, midnight_tow))
    assert log.time.tolist() == [16.5, 17.5, 18.5]


def test_jst_is_nine_hours_ahead_of_utc(write):
    text = file(
        "2017/01/01 08:59:59 35 136 41" + TAIL,
        "2017/01/01 09:00:00 35 136 41" + TAIL,
        header=LLH.replace("GPST", "JST "),
    )
    assert read(write, text, epoch=(1930, 0.0)).time.tolist() == [16.0, 18.0]


def test_utc_week_and_seconds(write):
    text = file("2270 100.0 35 136 41" + TAIL, "2270 101.0 35 136 41" + TAIL, header=LLH.replace("GPST", "UTC "))
    assert read(write, text).time.tolist() == [118.0, 119.0]


def test_time_goes_on_across_the_weeks_end(write):
    text = file("2270 604799.5 35 136 41" + TAIL, "2271 0.5 35 136 41" + TAIL, "2271 1.5 35 136 41" + TAIL)
    assert read(write, text).time.tolist() == [604799.5, 604800.5, 604801.5]
    assert read(write, text, epoch=(2271, 0.0), time_offset_s=0.25).time.tolist() == [-0.25, 0.75, 1.75]


@pytest.mark.parametrize("year", ["23", "2023"])
def test_years_of_two_digits(write, year):
    assert read(write, file(*rows(date=year + "/07/11 06:04:{:06.3f}")), epoch=(2270, 0.0)).time[0] == 194640.0


def test_year_of_the_last_century(write):
    assert read(write, file(*rows(date="99/08/22 00:00:{:06.3f}")), epoch=(1024, 0.0)).time[0] == 0.0


@pytest.mark.parametrize("epoch", [(-1, 0.0), (2.5, 0.0), (2374, 604800.0), (2374, -1.0), (2374, np.nan)])
def test_epoch_that_is_none(write, epoch):
    with pytest.raises(ConfigError, match="GPS week number and the seconds of the week"):
        read(write, file(*rows()), epoch=epoch)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("2023/07/11 06:04:20 35 136 41 1 12 x 1 1 0 0 0 0 0", "'x' is not a number"),
        ("2023/07/11 06:04:20 35 136", "has 2 values after the time, the column line names 13"),
        ("2023/13/11 06:04:20 35 136 41" + TAIL, "month must be in 1..12"),
        ("hello world", "'hello world' does not start with a date and time or a week and seconds"),
        ("x", "'x' does not start with a date"),
        ("2270 604801 35 136 41" + TAIL, "604801 is outside the seconds of a week"),
        ("2270 nan 35 136 41" + TAIL, "nan is outside the seconds of a week"),
        ("2270 x 35 136 41" + TAIL, "could not convert"),
    ],
)
def test_line_that_cannot_be_read(write, line, message):
    with pytest.raises(InputError, match=rf"fixes\.pos: line 6: {message}.*; correct or remove the line"):
        read(write, file(*rows(2), line, *rows(1)))


def test_cut_last_line(write):
    with pytest.warns(NavfuseWarning, match="the last line is cut off, it was left out"):
        log = read(write, file(*rows(3)) + "2023/07/11 06:04:20 35.1")
    assert log.time.size == 3


def test_single_cut_line(write):
    with pytest.raises(InputError, match="line 4: has 1 values"):
        read(write, file() + "2023/07/11 06:04:20 35.1")


@pytest.mark.parametrize("value", ["nan", "-nan", "NaN", "-1.#IND", "1.#QNAN00", "-nan(ind)"])
def test_values_that_are_not_numbers(write, value):
    bad = f"2023/07/11 06:04:20 {value} 136 41" + TAIL
    with pytest.warns(NavfuseWarning, match="1 of 5 rows hold no position"):
        assert read(write, file(*rows(4), bad)).time.size == 4


def test_no_column_line(write):
    with pytest.raises(InputError, match="line 1: data before a line that starts with % and names the columns"):
        read(write, "\n".join(rows()))


@pytest.mark.parametrize("text", [file(), "% nothing\n"])
def test_no_rows(write, text):
    with pytest.raises(InputError, match="the file has no solution rows"):
        read(write, text)


def test_baseline(write):
    header = "%  GPST   e-baseline(m)  n-baseline(m)  u-baseline(m)   Q  ns   sde(m)   sdn(m)   sdu(m)"
    with pytest.raises(InputError, match="holds baselines to a base station, not positions"):
        read(write, file(header=header))


def test_tokyo_datum(write):
    with pytest.raises(InputError, match="Tokyo datum"):
        read(write, file("% (lat/lon/height=Tokyo/ellipsoidal,Q=1:fix)"))


def test_geodetic_heights_are_noted(write):
    text = "% (lat/lon/height=WGS84/geodetic,Q=1:fix,2:float)\n" + file(*rows())
    with pytest.warns(NavfuseWarning, match="heights are above the geoid"):
        read(write, text)


def test_ellipsoidal_heights_are_not_noted(write):
    assert read(write, "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix)\n" + file(*rows())).notes == ()


def test_unknown_time_system(write):
    with pytest.raises(InputError, match="the time system 'GLONASST' is not known"):
        read(write, file(*rows(), header=LLH.replace("GPST", "GLONASST")))


def test_incomplete_column_line(write):
    with pytest.raises(InputError, match="the column line lacks height"):
        read(write, file(header="%  GPST  latitude(deg) longitude(deg) Q ns"))


def test_columns_that_change(write):
    with pytest.raises(InputError, match="line 6: the columns change here"):
        read(write, file(*rows(2), LLH + VELOCITY, *rows(1)))


def test_repeated_header_is_accepted(write):
    later = [row.replace("06:04", "06:05") for row in rows(2)]
    assert read(write, file(*rows(2), "%", LLH, *later)).time.tolist() == [194640.0, 194641.0, 194700.0, 194701.0]


def test_zero_sigma_names_the_line(write):
    with pytest.raises(InputError, match="line 4, column 'sdn': a standard deviation of 0 m"):
        read(write, file(*rows(tail=TAIL.replace("0.0100", "0.0000"))))


def test_binary_file(write):
    with pytest.raises(InputError, match="line 1: data before"):
        read(write, bytes(range(256)).replace(b"\n", b""))


def test_real_pair_agrees(shared_data):
    folder = shared_data / "rtklibexplorer-drive"
    table = read_gnss(folder / "gnss.csv")
    pos = read_gnss(folder / "gnss_1934_sf.pos", epoch=(2374, 243258.0))
    np.testing.assert_allclose(pos.time, table.time, rtol=0, atol=1e-9)
    for attribute in ("lat", "lon", "height", "sd_position", "velocity_n", "sd_velocity", "n_satellites"):
        np.testing.assert_array_equal(getattr(pos, attribute), getattr(table, attribute))
    assert (pos.fix == table.fix).all()
    assert pos.notes == ()


@pytest.mark.parametrize(
    ("name", "size", "first", "kinds"),
    [
        ("rover_rtk.pos", 301, 116400.0, {"rtk-fixed"}),
        ("kinematic/rover_rtk.pos", 5395, 194670.0, {"rtk-fixed", "rtk-float", "dgps", "single"}),
        ("kinematic/rover_1Hz_rtk.pos", 531, 194672.0, {"rtk-fixed", "rtk-float"}),
        ("kinematic/rover_1Hz_spp.pos", 550, 194670.0, {"single"}),
    ],
)
def test_real_files(shared_data, name, size, first, kinds):
    log = parse_rtklib_pos(shared_data / "taroz-matrtklib" / name)
    assert log.time.size == size
    assert log.time[0] == first
    assert set(log.fix) <= kinds
    assert log.notes == ()


def test_real_file_without_sigmas(shared_data):
    with pytest.raises(InputError, match="line 7, column 'sdn'"):
        read_gnss(shared_data / "taroz-matrtklib/kinematic/reference_1Hz.pos")
