"""Packets: a real packet's header, round trips of any layout, damaged streams, the data of a real VN-310."""

import csv
import warnings
from binascii import crc_hqx

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfuse.errors import ConfigError, InputError, NavfuseWarning
from navfuse.io.vectornav_ascii import sentence
from navfuse.io.vectornav_binary import (
    _layout,
    is_vectornav_binary,
    layout_of,
    packet,
    parse_packets,
    read_vectornav_binary,
)
from navfuse.io.vectornav_fields import GROUPS, fixed_type
from reference.vectornav_container import contained

PLACE = ("latitude [deg]", "longitude [deg]", "altitude [m]")
NAMES = [f"{group}.{field.name}" for group, fields in GROUPS.values() for field in fields.values()]


def drawn(layout, rng, rows=None):
    """Random contents, finite."""
    values = {}
    for name, field in layout.fields:
        value = _any(fixed_type(field), rng)
        if field.rows is None:
            values[name] = value
        else:
            count = int(rng.integers(0, 5)) if rows is None else rows
            value["count"] = count
            values[name] = value, np.array([_any(np.dtype(field.rows), rng) for _ in range(count)], field.rows)
    return values


def _any(kind, rng):
    if kind.names:
        value = np.zeros((), kind)
        for name in kind.names:
            value[name] = _any(kind[name], rng)
        return value
    if kind.base.kind == "f":
        return rng.normal(0.0, 100.0, kind.shape).astype(kind.base)
    limits = np.iinfo(kind.base)
    return rng.integers(limits.min, limits.max, kind.shape, dtype=kind.base, endpoint=True)


def assert_holds(messages, k, layout, values):
    for name, field in layout.fields:
        expected = values[name] if field.rows is None else values[name][0]
        assert np.array_equal(np.asarray(messages.values[name][k]), np.asarray(expected))
        if field.rows is not None:
            assert np.array_equal(messages.values[f"{name}.rows"][k], values[name][1])


def test_the_example_of_the_manual():
    """UM001, section on binary output: time since start, yaw pitch roll, gyro of the group common are FA 01 29 00."""
    layout = layout_of(["common.time_startup_ns", "common.ypr_deg", "common.gyro_radps"])
    assert layout.header == bytes.fromhex("012900")
    assert layout.dtype().itemsize == 8 + 12 + 12
    body = bytes.fromhex("012900") + (123456789).to_bytes(8, "little") + np.arange(6, dtype="<f4").tobytes()
    data = b"\xfa" + body + crc_hqx(body, 0).to_bytes(2, "big")
    (found,) = parse_packets(data, "log").messages.values()
    assert found.values["common.time_startup_ns"].tolist() == [123456789]
    assert found.values["common.ypr_deg"].tolist() == [[0.0, 1.0, 2.0]]
    assert found.values["common.gyro_radps"].tolist() == [[3.0, 4.0, 5.0]]


def test_header_published_with_its_length():
    """A VN-100 logger for waves in ice: groups IMU and attitude, header FA 14 3E 00 3A 00, 123 bytes behind the FA."""
    layout = _layout(bytes.fromhex("143e003a00"))
    assert [name for name, _ in layout.fields] == [
        "imu.uncomp_mag_gauss", "imu.uncomp_accel_mps2", "imu.uncomp_gyro_radps", "imu.temp_degc", "imu.pressure_kpa",
        "attitude.ypr_deg", "attitude.dcm", "attitude.mag_n_gauss", "attitude.accel_n_mps2",
    ]  # fmt: skip
    assert len(packet(layout, drawn(layout, np.random.default_rng(0)))) == 1 + 123


@settings(max_examples=60)
@given(names=st.sets(st.sampled_from(NAMES), min_size=1, max_size=12), seed=st.integers(0, 2**32 - 1))
def test_any_layout_comes_back(names, seed):
    rng = np.random.default_rng(seed)
    layout = layout_of(sorted(names))
    contents = [drawn(layout, rng) for _ in range(3)]
    log = parse_packets(b"".join(packet(layout, values) for values in contents), "log")
    assert not log.notes
    (found,) = log.messages.values()
    assert len(found) == 3
    for k, values in enumerate(contents):
        assert_holds(found, k, layout, values)


@settings(max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    cuts=st.lists(st.tuples(st.integers(0, 10_000), st.integers(1, 40), st.booleans()), min_size=1, max_size=4),
)
def test_damage_costs_only_the_packets_it_touches(seed, cuts):
    """Bytes lost or put in anywhere: every packet that is still whole in the file is found."""
    rng = np.random.default_rng(seed)
    layouts = [
        layout_of(["common.time_startup_ns", "imu.gyro_radps", "imu.accel_mps2"]),
        layout_of(["gnss1.tow_ns", "gnss1.raw", "gnss1.satellites"]),
    ]
    packets = [packet(layouts[k % 2], drawn(layouts[k % 2], rng)) for k in range(12)]
    data = b"".join(packets)
    for place, size, insert in cuts:
        at = place % len(data)
        data = data[:at] + (rng.bytes(size) + data[at:] if insert else data[at + size :])
    whole, at = 0, 0
    for one in packets:
        place = data.find(one, at)
        if place >= 0:
            whole, at = whole + 1, place + len(one)
    if not whole:
        return
    log = parse_packets(data, "log")
    assert sum(log.counts().values()) == whole
    lost = len(data) - sum(len(p) for p in packets if p in data)
    assert log.damage.skipped_bytes == lost
    assert bool(log.notes) == (lost > 0)


def test_a_flipped_bit_is_a_wrong_checksum_and_the_end_may_be_cut(tmp_path):
    layout = layout_of(["time.time_startup_ns", "imu.gyro_radps"])
    rng = np.random.default_rng(3)
    packets = [bytearray(packet(layout, drawn(layout, rng))) for _ in range(5)]
    packets[2][14] ^= 0x10
    path = tmp_path / "vn.bin"
    path.write_bytes(b"".join(packets)[:-3])
    with pytest.warns(
        NavfuseWarning, match=r"sound packets and were skipped, the first at byte \d+; 1 gaps .* wrong, 1"
    ):
        log = read_vectornav_binary(path)
    size = len(packets[0])
    assert log.damage.skipped_bytes == 2 * size - 3
    assert log.damage.first == f"at byte {2 * size}"
    assert (log.damage.checksum, log.damage.cut) == (1, 1)
    assert sum(log.counts().values()) == 3
    assert is_vectornav_binary(path)


def test_sentences_between_packets_are_read_too():
    layout = layout_of(["imu.gyro_radps"])
    one = packet(layout, {"imu.gyro_radps": [1.0, 2.0, 3.0]})
    text = (sentence("VNYPR", "1,2,3") + "\r\n").encode()
    log = parse_packets(one + text + one + text, "log")
    assert log.counts() == {"fa 04 00 04": 2, "VNYPR": 2}
    assert log.damage.skipped_bytes == 0
    assert not log.notes
    assert parse_packets(one + b"\r\n" + one, "log").damage.skipped_bytes == 2


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"no packets", r"no sound VectorNav packet in its 10 bytes \(0 bytes 0xFA"),
        (b"\xfa\x01\x29\x00" + bytes(40), r"1 of them before a known header"),
        (b"$VNYPR,1,2,3*00" + b"\xfa\x81\x01", r"use read_vectornav_ascii"),
        (b"\xfa\x80\x80\x80", r"0 of them"),
        (b"\xfa\x01\xff\xff\xff\xff", r"0 of them"),
        (b"\xfa\x00\x01\x00\xfa\x02\x00\x80\x00\x40" + bytes(9), r"0 of them"),
        (b"\xfa\x01", r"0 of them"),
        (b"\xfa", r"0 of them"),
    ],
)
def test_files_without_a_sound_packet(tmp_path, content, message):
    path = tmp_path / "vn.bin"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_vectornav_binary(path)
    assert not is_vectornav_binary(path)


def test_fields_nobody_knows():
    with pytest.raises(ConfigError, match=r"not imu\.gyro"):
        layout_of(["imu.gyro"])
    with pytest.raises(ConfigError, match="not nothing"):
        layout_of([])


@pytest.mark.parametrize("name", ["FixedSize/vn310-imu", "FixedSize/vn310-gnss", "DynamicSize/vn310-gnss"])
def test_contents_of_a_vn310_agree_with_the_table_beside_them(shared_data, name):
    path = shared_data / "instinct" / "VectorNav" / f"{name}.vnb"
    layout, contents = contained(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        log = parse_packets(b"".join(packet(layout, values) for values in contents), "log")
    (found,) = log.messages.values()
    rows = list(csv.DictReader(path.with_suffix(".csv").read_text().splitlines()))
    startup = found.values["time.time_startup_ns"].tolist()
    rows = {int(row["Time::TimeStartup [ns]"]): row for row in rows}
    both = [k for k, time in enumerate(startup) if time in rows]
    assert len(both) >= min(len(startup), len(rows)) - 1 > 9
    pairs = {
        "time.gps_tow_ns": ["Time::GpsTow [ns]"],
        "imu.uncomp_mag_gauss": [f"IMU::UncompMag::{a} [Gauss]" for a in "XYZ"],
        "imu.uncomp_accel_mps2": [f"IMU::UncompAccel::{a} [m/s^2]" for a in "XYZ"],
        "imu.uncomp_gyro_radps": [f"IMU::UncompGyro::{a} [rad/s]" for a in "XYZ"],
        "imu.temp_degc": ["IMU::Temp [Celsius]"],
        "imu.pressure_kpa": ["IMU::Pres [kPa]"],
        "imu.delta_time_s_theta_deg": ["IMU::DeltaTime [s]", *(f"IMU::DeltaTheta::{a} [deg]" for a in "XYZ")],
        "imu.delta_velocity_mps": [f"IMU::DeltaVel::{a} [m/s]" for a in "XYZ"],
        "imu.gyro_radps": [f"IMU::AngularRate::{a} [rad/s]" for a in "XYZ"],
        "attitude.ypr_deg": [f"Att::YawPitchRoll::{a} [deg]" for a in "YPR"],
        "attitude.quaternion_xyzw": [f"Att::Quaternion::{a}" for a in "xyzw"],
        "gnss1.tow_ns": ["GNSS1::Tow [ns]"],
        "gnss1.n_satellites": ["GNSS1::NumSats"],
        "gnss1.position_deg_deg_m": [f"GNSS1::PosLla::{a}" for a in PLACE],
        "gnss1.velocity_n_mps": [f"GNSS1::VelNed::{a} [m/s]" for a in "NED"],
        "gnss1.sd_position_n_m": [f"GNSS1::PosU::{a} [m]" for a in "NED"],
        "gnss2.n_satellites": ["GNSS2::NumSats"],
        "gnss2.fix": ["GNSS2::Fix"],
        "ins.position_deg_deg_m": [f"INS::PosLla::{a}" for a in PLACE],
        "ins.velocity_n_mps": [f"INS::VelNed::{a} [m/s]" for a in "NED"],
        "ins.sd_velocity_mps": ["INS::VelU [m/s]"],
    }  # fmt: skip
    compared = 0
    for field, columns in pairs.items():
        if field not in found.values:
            continue
        told = np.array([[float(rows[startup[k]][column]) for column in columns] for k in both])
        value = np.asarray(found.values[field], dtype=float)[both].reshape(len(both), -1)
        np.testing.assert_allclose(value, told, rtol=2e-7, err_msg=field)
        compared += 1
    assert compared >= 4
    for k in both if "gnss1.raw.rows" in found.values else []:
        row = rows[startup[k]]
        for receiver in (1, 2):
            assert found.values[f"gnss{receiver}.raw.rows"][k].size == int(row[f"GNSS{receiver}::RawMeas::NumSats"])
            ranges = found.values[f"gnss{receiver}.raw.rows"][k]["pseudorange_m"]
            assert ((ranges > 1.5e7) & (ranges < 1e8)).all()
