"""Sentences: published checksums, every header, what stands around them, and what is broken."""

import csv
import io
import warnings

import numpy as np
import pytest

from navfuse.errors import InputError, NavfuseWarning
from navfuse.io.vectornav_ascii import (
    is_vectornav_ascii,
    parse_sentences,
    read_vectornav_ascii,
    sentence,
    without_sentences,
)
from navfuse.io.vectornav_fields import HEXADECIMAL, SENTENCES

# From the log of a VN-100 (vn100-circle), not made by the code under test.
REAL = (
    "$VNYMR,+066.172,+003.948,+002.132,+00.2653,-00.0791,+00.3577,+00.558,+00.250,-10.355,"
    "+00.037773,+00.029186,-00.272747*6E"
)
REAL_NEXT = (
    "$VNYMR,+065.775,+003.952,+002.173,+00.2630,-00.0802,+00.3563,+00.882,+00.186,-09.447,"
    "+00.042078,-00.003052,-00.280091*60"
)


def quiet(text):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return parse_sentences(text.encode(), "log")


def test_sentence_of_a_real_sensor():
    (found,) = quiet(REAL + "\r\n").messages.values()
    assert found.kind == "VNYMR"
    np.testing.assert_array_equal(found.values["attitude.ypr_deg"], [[66.172, 3.948, 2.132]])
    np.testing.assert_array_equal(found.values["imu.mag_gauss"], [[0.2653, -0.0791, 0.3577]])
    np.testing.assert_array_equal(found.values["imu.accel_mps2"], [[0.558, 0.25, -10.355]])
    np.testing.assert_array_equal(found.values["imu.gyro_radps"], [[0.037773, 0.029186, -0.272747]])
    assert np.isnan(found.stamp).all()


@pytest.mark.parametrize(
    ("line", "name", "value"),
    [
        (
            "$VNYMR,+104.977,+004.548,-001.276,-00.8012,-02.7376,+01.0070,+00.837,+00.235,-10.414,-00.002081,-00.001151,"
            "+00.002113*61",
            "imu.gyro_radps",
            [-0.002081, -0.001151, 0.002113],
        ),
        (
            "$VNGPS,342123.000168,1890,3,05,+34.61463270,-112.45087270,+01559.954,+000.450,+000.770,-001.290,+002.940,"
            "+005.374,+007.410,+001.672,2.10E-08*23",
            "gnss1.position_deg_deg_m",
            [34.61463270, -112.45087270, 1559.954],
        ),
        (
            "$VNGPS,342123.000168,1890,3,05,+34.61463270,-112.45087270,+01559.954,+000.450,+000.770,-001.290,+002.940,"
            "+005.374,+007.410,+001.672,2.10E-08*23",
            "gnss1.tow_ns",
            342123000168000,
        ),
        (
            "$VNINS,000241.350006,0000,8080,-051.757,+019.129,+047.031,+00.00000000,+000.00000000,+00000.000,+000.000,"
            "+000.000,+000.000,90.0,00.0,0.00*6F",
            "ins.status",
            0x8080,
        ),
    ],
)
def test_sentences_that_users_of_such_sensors_have_published(line, name, value):
    (found,) = quiet(line).messages.values()
    np.testing.assert_array_equal(found.values[name][0], value)


def test_checksums():
    assert sentence(REAL[1:6], REAL[7:-3]) == REAL
    # Check value of CRC-16 with polynomial 0x1021 and start 0 ("XMODEM"): 0x31C3 for 123456789.
    from binascii import crc_hqx

    assert crc_hqx(b"123456789", 0) == 0x31C3
    long = sentence(REAL[1:6], REAL[7:-3], crc=True)
    assert len(long) == len(REAL) + 2
    np.testing.assert_array_equal(
        quiet(long).messages["VNYMR"].values["imu.gyro_radps"], [[0.037773, 0.029186, -0.272747]]
    )
    assert parse_sentences((long[:-1] + "x" + "\n" + REAL).encode(), "log").damage.cut == 1


@pytest.mark.parametrize("header", sorted(SENTENCES))
def test_every_header_is_read_field_by_field(header):
    rng = np.random.default_rng(1)
    names = SENTENCES[header]
    numbers = rng.integers(1, 99, (2, sum(count for _, count in names)))
    lines, at = [], np.cumsum([0] + [count for _, count in names])
    for row in numbers:
        words = [
            format(value, "x" if names[k][0] in HEXADECIMAL else "d")
            for k in range(len(names))
            for value in row[at[k] : at[k + 1]]
        ]
        lines.append(sentence(header, ",".join(words)))
    found = quiet("\r\n".join(lines)).messages[header]
    for k, (name, count) in enumerate(names):
        expected = numbers[:, at[k] : at[k + 1]].astype(float)
        stored = name[:-1] + "ns" if name.endswith("tow_s") else name
        expected = expected * 1e9 if name.endswith("tow_s") else expected
        np.testing.assert_array_equal(found.values[stored].reshape(2, count), expected)


def test_broken_and_foreign_sentences_are_counted_and_reported_once(tmp_path):
    wrong = REAL.replace("+066", "+067")
    lines = [REAL, wrong, REAL[:40], sentence("VNRRG", "1,VN-100"), "$GPGGA,1*00", "noise", REAL_NEXT,
             sentence("VNYPR", "1,2"), sentence("VNYPR", "1,2,x"), sentence("VNYPR", "1,2,3,S0001,T12AB")]  # fmt: skip
    path = tmp_path / "vn.log"
    path.write_text("\n".join(lines))
    with pytest.warns(NavfuseWarning, match=r"1 sentences with a wrong checksum and 3 cut ones of 8 .* line 2 \(VNYMR"):
        log = read_vectornav_ascii(path)
    assert log.counts() == {"VNYMR": 2, "VNYPR": 1}
    assert (log.damage.checksum, log.damage.cut, log.damage.other) == (1, 3, 1)
    assert log.messages["VNYMR"].index.tolist() == [0, 3]
    assert len(log.notes) == 1


@pytest.mark.parametrize("value", ["nan", "inf", "1e300", "-1e9"])
def test_a_time_that_is_no_number_breaks_a_sentence(value):
    good = "1000,2200,3,9,48,9,300,0,0,0,1,1,1,0.1,1e-8"
    lines = [sentence("VNGPS", good), sentence("VNGPS", good.replace("1000", value, 1))]
    log = parse_sentences("\n".join(lines).encode(), "log")
    assert log.counts() == {"VNGPS": 1}
    assert log.damage.cut == 1


def test_a_sentence_that_a_later_one_cuts_off_costs_only_itself():
    log = parse_sentences((REAL[:30] + REAL_NEXT + "\n" + REAL).encode(), "log")
    assert log.counts() == {"VNYMR": 2}
    assert log.damage.cut == 1


@pytest.mark.parametrize(
    ("first", "factor"), [("t", 1.0), ("time_s", 1.0), ("Time_ms", 1e-3), ("timestamp_ns", 1e-9), ("stamp", 1.0)]
)
def test_time_column_of_a_table(first, factor):
    times = np.array([10.5, 10.525, 10.55]) / factor
    stream = io.StringIO()
    table = csv.writer(stream)
    table.writerow(["frame", first, "raw"])
    for time in times:
        table.writerow(["imu", repr(float(time)), REAL + "\n"])
    log = quiet(stream.getvalue())
    np.testing.assert_allclose(log.messages["VNYMR"].stamp, [10.5, 10.525, 10.55], rtol=1e-15)


@pytest.mark.parametrize("separator", [" ", ",", "\t", ": "])
def test_times_in_front_without_a_header(separator):
    text = "\n".join(f"{time}{separator}{REAL}" for time in (0.25, 0.5, 0.75))
    np.testing.assert_array_equal(quiet(text).messages["VNYMR"].stamp, [0.25, 0.5, 0.75])


def test_unit_of_a_time_since_1970_is_found_by_its_size():
    text = "\n".join(f"{1763590172000 + 25 * k} {REAL}" for k in range(3))
    log = parse_sentences(text.encode(), "log")
    np.testing.assert_allclose(log.messages["VNYMR"].stamp, 1763590172 + 0.025 * np.arange(3), rtol=1e-15)
    assert "count 1e+03 to the second" in log.notes[0]


def test_numbers_in_front_that_are_no_time_are_not_used():
    text = "\n".join(f"{k} {REAL}" for k in (5, 3, 8, 1))
    log = parse_sentences(text.encode(), "log")
    assert np.isnan(log.messages["VNYMR"].stamp).all()
    assert "not a time that increases" in log.notes[0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"hello\n", r"there is no VectorNav sentence"),
        (b"\xfa\x01\x08\x00\xfa", r"binary protocol: use read_vectornav_binary"),
        (REAL.replace("6E", "6F").encode(), r"all 1 VectorNav sentences are broken, the first is line 1"),
        (sentence("VNRRG", "1,2").encode(), r"none holds measurements"),
    ],
)
def test_files_without_a_usable_sentence(tmp_path, content, message):
    path = tmp_path / "vn.txt"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_vectornav_ascii(path)


def test_sniffing(tmp_path):
    path = tmp_path / "vn.txt"
    path.write_text("t,raw\n1," + REAL)
    assert is_vectornav_ascii(path)
    path.write_text("time_s,gyro_x_radps\n1,2")
    assert not is_vectornav_ascii(path)


def test_sound_sentences_are_cut_out_of_a_stream():
    wrong = REAL.replace("+066", "+067").encode()
    assert without_sentences(b"ab" + REAL.encode() + b"\r\ncd" + wrong) == b"abcd" + wrong


def test_drive_in_circles_is_read_completely(shared_data):
    path = shared_data / "vn100-circle" / "circle_data_0_imu.csv"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        log = read_vectornav_ascii(path)
    (found,) = log.messages.values()
    rows = list(csv.DictReader(io.StringIO(path.read_text(), newline="")))
    assert len(found) == len(rows) == 2530
    assert log.damage.checksum == log.damage.cut == log.damage.other == 0
    np.testing.assert_array_equal(found.stamp, [float(row["t"]) for row in rows])
    for name, columns, factor in (("gyro_radps", "gyro", 1.0), ("accel_mps2", "acc", 1.0), ("mag_gauss", "mag", 1e-4)):
        told = np.array([[float(row[f"{columns}_{axis}"]) for axis in "xyz"] for row in rows])
        np.testing.assert_allclose(found.values[f"imu.{name}"] * factor, told, rtol=1e-12, atol=1e-18)
