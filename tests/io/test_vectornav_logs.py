"""From messages to logs: units, times, axes, fixes sent once, and what cannot be done."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfuse.core.earth import geodetic_to_ecef
from navfuse.core.rotation import quat_from_euler
from navfuse.data.gps_epoch import GpsEpoch
from navfuse.errors import ConfigError, InputError, NavfuseWarning
from navfuse.io.vectornav_ascii import parse_sentences, read_vectornav_ascii, sentence
from navfuse.io.vectornav_binary import layout_of, packet, parse_packets
from navfuse.io.vectornav_fields import GROUPS, fixed_type
from navfuse.io.vectornav_logs import (
    read_vectornav,
    vectornav_attitude,
    vectornav_gnss,
    vectornav_imu,
    vectornav_magnetometer,
    vectornav_trajectory,
)
from reference.vectornav_container import real_packets

FIXED = [f"{group}.{f.name}" for group, fields in GROUPS.values() for f in fields.values() if f.rows is None]
WEEK_NS = 604_800_000_000_000
LEVEL = "0.01,-0.02,-9.8"


def sentences(lines):
    return parse_sentences("\r\n".join(lines).encode(), "log")


def packets(names, rows):
    layout = layout_of(names)
    return parse_packets(b"".join(packet(layout, dict(zip(names, row, strict=True))) for row in rows), "log")


def ymr(k, gyro="0.1,0.2,0.3"):
    return sentence("VNYMR", f"{10 + k},2,1,0.25,0.02,0.41,{LEVEL},{gyro}")


def test_rate_counts_sentences_that_were_broken():
    lines = [ymr(k) for k in range(6)]
    lines[2] = lines[2].replace("+", "").replace("VNYMR,12", "VNYMR,13")
    log = sentences(lines)
    with pytest.warns(NavfuseWarning):
        imu = vectornav_imu(log, rate_hz=40.0)
    np.testing.assert_allclose(imu.time, np.array([0, 1, 3, 4, 5]) / 40.0)
    assert imu.kind == "rates"
    np.testing.assert_array_equal(imu.gyro[0], [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(imu.accel[0], [0.01, -0.02, -9.8])
    assert any("stated 40 Hz" in note for note in imu.notes)
    assert any("own bias corrections" in note for note in imu.notes)


def test_without_a_time_a_rate_is_asked_for():
    log = sentences([ymr(k) for k in range(3)])
    with pytest.raises(InputError, match=r"VNYMR has no time.*give its rate with rate_hz"):
        vectornav_imu(log)
    with pytest.raises(ConfigError, match=r"rate_hz = 0"):
        vectornav_imu(log, rate_hz=0.0)
    with pytest.raises(InputError, match=r"no time of the clock 'gps'"):
        vectornav_imu(log, clock="gps")
    with pytest.raises(ConfigError, match=r"clock = 'utc'"):
        vectornav_imu(log, clock="utc")


def test_magnetometer_in_tesla_and_attitude_in_radians():
    log = sentences([f"{0.025 * k} {ymr(k)}" for k in range(4)])
    mag, attitude = vectornav_magnetometer(log), vectornav_attitude(log)
    np.testing.assert_allclose(mag.field_b[0], [25e-6, 2e-6, 41e-6])
    np.testing.assert_allclose(np.degrees(attitude.attitude[3]), [1.0, 2.0, 13.0])
    np.testing.assert_allclose(attitude.time, [0.0, 0.025, 0.05, 0.075])
    assert list(attitude.columns()) == ["time_s", "roll_deg", "pitch_deg", "heading_deg"]


def test_mounting_turns_rates_accelerations_and_field():
    log = sentences([f"{0.025 * k} {ymr(k).replace(LEVEL, LEVEL)}" for k in range(4)])
    with pytest.warns(NavfuseWarning):
        imu = vectornav_imu(log, axes="RBD")
    np.testing.assert_allclose(imu.gyro[0], [-0.2, 0.1, 0.3])
    np.testing.assert_allclose(vectornav_magnetometer(log, axes="RBD").field_b[0], [-2e-6, 25e-6, 41e-6])


def test_quaternion_is_the_same_attitude_as_yaw_pitch_roll(shared_data):
    log = real_packets(shared_data, "FixedSize/vn310-imu")
    from_angles = vectornav_attitude(log).attitude
    (messages,) = log.messages.values()
    without = {name: value for name, value in messages.values.items() if name != "attitude.ypr_deg"}
    from_quaternion = vectornav_attitude(replace(log, messages={messages.kind: replace(messages, values=without)}))
    difference = np.angle(np.exp(1j * (from_quaternion.attitude - from_angles)))
    assert np.abs(np.degrees(difference)).max() < 2e-3


def test_quaternion_vector_first():
    w, x, y, z = quat_from_euler(0.1, -0.2, 2.0)
    text = ",".join(f"{v:.9f}" for v in (x, y, z, w))
    log = sentences([f"{k} {sentence('VNQTN', text)}" for k in range(2)])
    np.testing.assert_allclose(vectornav_attitude(log).attitude[0], [0.1, -0.2, 2.0], atol=1e-8)


def test_increments_and_uncorrected_rates_of_packets():
    names = ["time.time_startup_ns", "imu.uncomp_accel_mps2", "imu.uncomp_gyro_radps", "imu.delta_time_s_theta_deg",
             "imu.delta_velocity_mps", "imu.accel_mps2", "imu.gyro_radps"]  # fmt: skip
    rows = [(10**7 * k, [0, 0, -9.81], [0.01, 0, 0], [0.01, 0.5, 0, 0.25], [0, 0, -0.0981], [0, 0, -9.8], [1, 0, 0])
            for k in range(5)]  # fmt: skip
    log = packets(names, rows)
    imu = vectornav_imu(log)
    np.testing.assert_allclose(imu.time, 0.01 * np.arange(5), atol=1e-12)
    np.testing.assert_allclose(imu.gyro[0], [0.01, 0, 0], rtol=1e-7)
    assert imu.notes == ()
    steps = vectornav_imu(log, increments=True)
    assert steps.kind == "increments"
    np.testing.assert_allclose(steps.gyro[1], np.radians([0.5, 0.0, 0.25]), rtol=1e-7)
    np.testing.assert_allclose(steps.accel[1], [0, 0, -0.0981], rtol=1e-7)


def test_joint_fields_of_the_group_common():
    names = ["common.time_gps_ns", "common.uncomp_accel_mps2_gyro_radps", "common.mag_gauss_temp_degc_pressure_kpa",
             "common.delta_time_s_theta_deg_velocity_mps"]  # fmt: skip
    rows = [(2200 * WEEK_NS + 10**7 * k, [0, 0, -9.8, 0.1, 0.2, 0.3], [0.25, 0, 0.4, 20, 101],
             [0.01, 0.1, 0.2, 0.3, 0, 0, -0.098]) for k in range(4)]  # fmt: skip
    log = packets(names, rows)
    imu = vectornav_imu(log)
    np.testing.assert_allclose(imu.time, 0.01 * np.arange(4), atol=1e-9)
    np.testing.assert_allclose(imu.gyro[0], [0.1, 0.2, 0.3], rtol=1e-6)
    np.testing.assert_allclose(vectornav_imu(log, increments=True).accel[0], [0, 0, -0.098], rtol=1e-6)
    np.testing.assert_allclose(vectornav_magnetometer(log).field_b[0], [25e-6, 0, 40e-6], rtol=1e-6)


FIX = ["time.gps_tow_ns", "time.gps_week", "gnss1.tow_ns", "gnss1.week", "gnss1.fix",
       "gnss1.n_satellites", "gnss1.position_deg_deg_m", "gnss1.velocity_n_mps", "gnss1.sd_position_n_m",
       "gnss1.sd_velocity_mps"]  # fmt: skip


def fixes():
    """At 10 Hz, of a receiver at 5 Hz, over the end of a week; the first three before the receiver knew the time."""
    rows = []
    for k in range(20):
        tow = (WEEK_NS - 10**9 + 10**8 * k) % WEEK_NS
        week = 0 if k < 3 else 2200 + (k >= 10)
        seen = k // 2 * 2
        fix_tow = (WEEK_NS - 10**9 + 10**8 * seen - 4 * 10**7) % WEEK_NS
        fix_week = 0 if k < 3 else 2200 + (10**8 * seen - 4 * 10**7 >= 10**9)
        rows.append((tow, week, fix_tow, fix_week, 3 if k >= 3 else 0, 9, [48.0 + 1e-6 * seen, 9.0, 300.0],
                     [0.5, 0.1, 0.0], [1.0, 2.0, 3.0], 0.1))  # fmt: skip
    return rows


def test_fixes_are_given_once_at_the_time_of_their_measurement():
    log = packets(FIX, fixes())
    with pytest.warns(NavfuseWarning, match="had no time yet"):
        gnss = vectornav_gnss(log)
    assert gnss.epoch == GpsEpoch(2200, 0.0)
    expected = 604800.0 - 1.0 + 0.1 * np.array([2, 4, 6, 8, 10, 12, 14, 16, 18]) - 0.04
    np.testing.assert_allclose(gnss.time, expected, atol=1e-9)
    np.testing.assert_array_equal(gnss.sd_position[0], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(gnss.sd_velocity, 0.1, rtol=1e-6)
    np.testing.assert_allclose(np.degrees(gnss.lat), 48.0 + 1e-6 * np.arange(2, 20, 2), atol=1e-12)
    assert set(gnss.fix) == {"single"}
    assert set(gnss.n_satellites) == {9}


def test_sentences_of_fixes_and_of_the_filter_in_degrees_and_in_ecef():
    place = geodetic_to_ecef(np.radians(48.0), np.radians(9.0), 300.0)
    tail = "0.5,0.1,0.2,1.0,2.0,3.0,0.1,2e-8"
    geodetic = [sentence("VNGPS", f"{1000 + k},2200,3,9,48.0,9.0,300.0,{tail}") for k in range(3)]
    ecef = [sentence("VNGPE", f"{1000 + k},2200,3,9,{place[0]},{place[1]},{place[2]},{tail}") for k in range(3)]
    a = vectornav_gnss(sentences(geodetic))
    with pytest.warns(NavfuseWarning, match="missing"):
        b = vectornav_gnss(sentences(ecef))
    np.testing.assert_allclose(a.time, [1000.0, 1001.0, 1002.0])
    np.testing.assert_allclose((b.lat, b.lon, b.height), (a.lat, a.lon, a.height), rtol=1e-9)
    np.testing.assert_allclose(a.velocity_n[0], [0.5, 0.1, 0.2])
    ins = [sentence("VNINS", f"{1000 + k},2200,00A2,90,1,2,48.0,9.0,300.0,0.5,0.1,0.2,1,2,3") for k in range(3)]
    track = vectornav_trajectory(sentences(ins))
    np.testing.assert_allclose(np.degrees(track.attitude[0]), [2.0, 1.0, 90.0])
    np.testing.assert_allclose(np.degrees(track.lat), 48.0)
    np.testing.assert_allclose(track.velocity_n[0], [0.5, 0.1, 0.2])
    zero = [line.replace("48.0,9.0,300.0", "0,0,0") for line in ins]
    zero = [sentence("VNINS", line[7:-3]) for line in zero]
    with pytest.raises(InputError, match="no position in it"):
        vectornav_trajectory(sentences(zero))
    with pytest.warns(NavfuseWarning, match="1 rows without a position"):
        assert len(vectornav_trajectory(sentences([zero[0], ins[1], ins[2]]))) == 2


def test_what_a_file_does_not_hold():
    log = sentences([sentence("VNYBA", "1,2,3,0.1,0.2,0.3,0.01,0.02,0.03")] * 3)
    with pytest.raises(InputError, match=r"no message holds angular rate and acceleration; there are VNYBA \(3\)"):
        vectornav_imu(log, rate_hz=10.0)
    with pytest.raises(InputError, match="increments"):
        vectornav_imu(log, rate_hz=10.0, increments=True)
    with pytest.raises(InputError, match="position of receiver 2"):
        vectornav_gnss(log, receiver=2)
    late = fixes()[2:4]
    with pytest.raises(InputError, match=r"1 of 2 fa .* can be used; at least two"):
        vectornav_gnss(packets(FIX, late))


def test_not_a_number_is_left_out_if_it_is_rare():
    lines = [f"{0.01 * k:.2f} {ymr(k)}" for k in range(300)]
    lines[7] = f"0.07 {ymr(7, 'nan,0.2,0.3')}"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NavfuseWarning)
        imu = vectornav_imu(sentences(lines))
    assert any("1 rows with NaN" in note for note in imu.notes)
    assert imu.time.size == 299
    lines[:20] = [f"{0.01 * k:.2f} {ymr(k, 'nan,0.2,0.3')}" for k in range(20)]
    with pytest.raises(InputError, match="NaN or infinite values in 20 rows in succession from VNYMR number 1"):
        vectornav_imu(sentences(lines))
    steps = [f"{k} {sentence('VNDTV', f'1,0,0,{value},0,0,-9.8')}" for k, value in enumerate((0, "inf", 0))]
    with pytest.raises(InputError, match="VNDTV number 2 holds NaN or infinite increments"):
        vectornav_imu(sentences(steps), increments=True)


@settings(max_examples=150)
@given(
    names=st.sets(st.sampled_from(FIXED), min_size=3, max_size=20),
    rows=st.integers(1, 7),
    noise=st.floats(0.0, 1.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_packets_of_any_content_give_a_log_or_a_message(names, rows, noise, seed):
    """Every bit pattern behind a right checksum: NaN, infinite and absurd numbers, weeks that cannot be, zeros."""
    rng = np.random.default_rng(seed)
    layout = layout_of(sorted(names))
    data = b""
    for _ in range(rows):
        values = {}
        for name, field in layout.fields:
            kind = fixed_type(field)
            content = rng.bytes(kind.itemsize) if rng.random() < noise else bytes(kind.itemsize)
            values[name] = np.frombuffer(content, kind.base, field.count).reshape(kind.shape)
        data += packet(layout, values)
    log = parse_packets(data, "log")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NavfuseWarning)
        for read in (vectornav_imu, vectornav_magnetometer, vectornav_attitude, vectornav_trajectory, vectornav_gnss):
            try:
                found = read(log)
            except InputError:
                continue
            assert (np.diff(found.time) > 0.0).all()
            if read in (vectornav_imu, vectornav_attitude):
                assert np.isfinite(found.gyro if read is vectornav_imu else found.attitude).all()


def test_a_filter_that_was_not_initialised_has_no_attitude():
    rows = [(10**7 * k, [0, 0, 0, 0] if k < 2 else [0, 0, 0.6, 0.8]) for k in range(300)]
    log = packets(["time.time_startup_ns", "attitude.quaternion_xyzw"], rows)
    with pytest.warns(NavfuseWarning, match="2 rows with NaN"):
        attitude = vectornav_attitude(log)
    np.testing.assert_allclose(attitude.attitude[:, 2], 2.0 * np.arctan2(0.6, 0.8), rtol=1e-6)


def test_either_protocol_by_its_content(tmp_path):
    path = tmp_path / "vn.log"
    path.write_text(ymr(0))
    assert read_vectornav(path).counts() == {"VNYMR": 1}
    layout = layout_of(["imu.gyro_radps"])
    path.write_bytes(packet(layout, {"imu.gyro_radps": [1, 2, 3]}))
    assert read_vectornav(path).counts() == {"fa 04 00 04": 1}
    late = tmp_path / "vn.txt"
    late.write_bytes(b"\x00\xfa" * 10_000 + path.read_bytes())
    with pytest.warns(NavfuseWarning, match="skipped"):
        log = read_vectornav(late)
    assert log.counts() == {"fa 04 00 04": 1}
    other = path.rename(tmp_path / "vn.xyz")
    with pytest.raises(InputError, match="cannot tell the format"):
        read_vectornav(other)


def test_drive_in_circles(shared_data):
    log = read_vectornav_ascii(shared_data / "vn100-circle" / "circle_data_0_imu.csv")
    with pytest.warns(NavfuseWarning, match="own bias corrections"):
        imu = vectornav_imu(log)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mag, attitude = vectornav_magnetometer(log), vectornav_attitude(log)
    assert imu.time.size == mag.time.size == attitude.time.size == 2530
    assert -10.2 < np.median(imu.accel[:, 2]) < -9.4
    assert 20e-6 < np.median(np.linalg.norm(mag.field_b, axis=1)) < 80e-6
    # The sensor's yaw turns with its gyro: the sense of both agrees with forward-right-down.
    turned = np.sum(imu.gyro[1:, 2] * np.diff(imu.time))
    yaw = np.unwrap(attitude.attitude[:, 2])
    assert abs(np.degrees(turned - (yaw[-1] - yaw[0]))) < 15.0


def test_fixed_size_packets_of_a_vn310(shared_data):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NavfuseWarning)
        imu = vectornav_imu(real_packets(shared_data, "FixedSize/vn310-imu"))
        log = real_packets(shared_data, "FixedSize/vn310-gnss")
        gnss, own = vectornav_gnss(log), vectornav_trajectory(log)
    np.testing.assert_allclose(np.diff(imu.time), 0.01, atol=0.0021)
    assert gnss.epoch == GpsEpoch(2165, 0.0)
    assert 200632.0 < gnss.time[0] < 200633.0
    nearest = np.abs(own.time[:, None] - gnss.time).argmin(axis=0)
    metres = 6.37e6 * np.hypot(gnss.lat - own.lat[nearest], (gnss.lon - own.lon[nearest]) * np.cos(gnss.lat))
    assert metres.max() < 10.0
