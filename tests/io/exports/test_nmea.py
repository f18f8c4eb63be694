from __future__ import annotations

from functools import reduce
from operator import xor
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pynmea2
import pytest
from hypothesis import given

from navfuse.data.gps_epoch import GpsEpoch
from navfuse.errors import NavfuseWarning
from navfuse.io.exports.nmea import MODE, write_nmea
from reference.export_tracks import (
    LEAP_SECOND,
    UTC_MIDNIGHT,
    export_track,
    gps_of_utc,
    gps_seconds,
    metres_apart,
    tracks,
)

KINDS = ["RMC", "VTG", "GGA", "HDT", "GST", "ZDA"]


def parse(path: Path) -> dict[str, list[pynmea2.TalkerSentence]]:
    """Sentences by kind; pynmea2 refuses a wrong checksum."""
    data = path.read_bytes()
    assert data.endswith(b"\r\n")
    lines = data.decode("ascii").split("\r\n")[:-1]
    found: dict[str, list[pynmea2.TalkerSentence]] = {}
    for line in lines:
        message = pynmea2.parse(line, check=True)
        assert message.talker == "GN"
        found.setdefault(message.sentence_type, []).append(message)
    return found


def written(track, **expected) -> dict[str, list[pynmea2.TalkerSentence]]:
    with TemporaryDirectory() as folder:
        write_nmea(Path(folder) / "t.nmea", track)
        return parse(Path(folder) / "t.nmea")


def numbers(messages: list[pynmea2.TalkerSentence], *fields: str) -> np.ndarray:
    return np.array([[float(getattr(message, field)) for field in fields] for message in messages])


def angle_apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.abs((one - other + 180.0) % 360.0 - 180.0)


@given(tracks())
def test_read_back_by_pynmea2(track):
    found = written(track)
    trajectory = track.trajectory
    assert list(found) == KINDS
    assert {len(messages) for messages in found.values()} == {len(trajectory)}
    for kind in ("GGA", "RMC"):
        lat, lon = numbers(found[kind], "latitude", "longitude").T
        assert (metres_apart(lat, lon, track) < 1e-3).all()
        for message in found[kind]:
            assert len(message.lat) == 12
            assert len(message.lon) == 13
            assert float(message.lat[2:]) < 60.0
            assert float(message.lon[3:]) < 60.0
            assert float(message.lat) or message.lat_dir == "N"
            assert float(message.lon) or message.lon_dir == "E"
    altitude, separation = numbers(found["GGA"], "altitude", "geo_sep").T
    np.testing.assert_allclose(altitude + separation, trajectory.height, rtol=0, atol=5.1e-4)
    np.testing.assert_allclose(separation, track.undulation, rtol=0, atol=5.1e-4)
    headings = numbers(found["HDT"], "heading")[:, 0]
    assert (angle_apart(headings, np.degrees(trajectory.attitude[:, 2])) < 5.1e-5).all()
    assert (headings < 360.0).all()
    knots, kmh = numbers(found["VTG"], "spd_over_grnd_kts", "spd_over_grnd_kmph").T
    speed = np.hypot(*trajectory.velocity_n[:, :2].T)
    np.testing.assert_allclose(knots * 1852.0 / 3600.0, speed, rtol=0, atol=2.7e-4)
    np.testing.assert_allclose(kmh / 3.6, speed, rtol=0, atol=1.5e-4)
    for rmc, vtg, knot, velocity in zip(found["RMC"], found["VTG"], knots, trajectory.velocity_n, strict=True):
        assert rmc.data[6] == vtg.data[4]
        assert rmc.data[7] == vtg.data[0]
        assert (rmc.data[7] == "") == (knot == 0.0)
        if knot:
            course = np.degrees(np.arctan2(velocity[1], velocity[0]))
            assert angle_apart(float(rmc.data[7]), course) < 5.1e-5
            assert float(rmc.data[7]) < 360.0


@given(tracks())
def test_times_are_utc(track):
    found = written(track)
    expected = gps_seconds(track)
    for second, rmc, gga, gst, zda in zip(
        expected, *(found[kind] for kind in ("RMC", "GGA", "GST", "ZDA")), strict=True
    ):
        clock = rmc.data[0]
        assert clock == gga.data[0] == gst.data[0] == zda.data[0]
        day, month, year = (int(part) for part in zda.data[1:4])
        assert rmc.data[8] == f"{day:02d}{month:02d}{year % 100:02d}"
        assert abs(gps_of_utc((year, month, day), clock) - second) < 1e-5
        assert clock[:6] <= "235960"


def test_known_sentences(tmp_path):
    """Two epochs by hand: RFC-like arithmetic of 48 deg 7.038' N, 11 deg 31' E, and a checksum by its definition."""
    track = export_track(
        2,
        epoch=GpsEpoch(2300, 18.0),
        time=np.array([0.0, 0.5]),
        lat=np.radians([48.0 + 7.038 / 60.0, -48.0 - 7.038 / 60.0]),
        lon=np.radians([11.0 + 31.0 / 60.0, -11.0 - 31.0 / 60.0]),
        height=np.array([592.3, -10.0]),
        undulation=np.array([46.9, -1.25]),
        velocity_n=np.array([[0.0, 10.0, 0.0], [0.0, 0.0, 3.0]]),
        attitude=np.radians([[1.0, 2.0, 359.99999], [0.0, 0.0, 90.0]]),
        fix=np.array(["rtk-fixed", "none"]),
        n_satellites=np.array([7, 0]),
    )
    write_nmea(tmp_path / "t.nmea", track)
    bodies = [line[1:-3] for line in (tmp_path / "t.nmea").read_text().splitlines()]
    assert bodies == [
        "GNRMC,000000.00,A,4807.0380000,N,01131.0000000,E,19.438,90.0000,040224,,,R,V",
        "GNVTG,90.0000,T,,M,19.438,N,36.000,K,R",
        "GNGGA,000000.00,4807.0380000,N,01131.0000000,E,4,07,,545.400,M,46.900,M,,",
        "GNHDT,0.0000,T",
        "GNGST,000000.00,,,,,0.010,0.020,0.030",
        "GNZDA,000000.00,04,02,2024,00,00",
        "GNRMC,000000.50,A,4807.0380000,S,01131.0000000,W,0.000,,040224,,,E,V",
        "GNVTG,,T,,M,0.000,N,0.000,K,E",
        "GNGGA,000000.50,4807.0380000,S,01131.0000000,W,6,00,,-8.750,M,-1.250,M,,",
        "GNHDT,90.0000,T",
        "GNGST,000000.50,,,,,0.010,0.020,0.030",
        "GNZDA,000000.50,04,02,2024,00,00",
    ]
    for line, body in zip((tmp_path / "t.nmea").read_text().splitlines(), bodies, strict=True):
        assert line == f"${body}*{reduce(xor, body.encode()):02X}"


def test_the_clock_through_a_leap_second(tmp_path):
    """GPS week 1930 + 15 s is 2016-12-31 23:59:58 UTC, two seconds before the last leap second up to now."""
    write_nmea(tmp_path / "t.nmea", export_track(5, rate=1.0, epoch=LEAP_SECOND))
    found = [message.data[:4] for message in parse(tmp_path / "t.nmea")["ZDA"]]
    assert found == [
        ["235958.00", "31", "12", "2016"],
        ["235959.00", "31", "12", "2016"],
        ["235960.00", "31", "12", "2016"],
        ["000000.00", "01", "01", "2017"],
        ["000001.00", "01", "01", "2017"],
    ]


def test_the_clock_through_midnight(tmp_path):
    write_nmea(tmp_path / "t.nmea", export_track(100, epoch=UTC_MIDNIGHT))
    zda = parse(tmp_path / "t.nmea")["ZDA"]
    assert zda[49].data[:4] == ["235959.90", "04", "02", "2024"]
    assert zda[50].data[:4] == ["000000.00", "05", "02", "2024"]


def test_no_undulation(tmp_path):
    with pytest.warns(NavfuseWarning, match="heights above the geoid, and without the undulation"):
        write_nmea(tmp_path / "t.nmea", export_track(5, undulation=None))
    gga = parse(tmp_path / "t.nmea")["GGA"][0]
    assert gga.data[8:12] == ["", "M", "", "M"]
    assert gga.altitude is None


def test_positions_only(tmp_path):
    nothing = dict.fromkeys(
        ("velocity_n", "attitude", "sd_position", "sd_velocity", "sd_attitude", "n_satellites", "fix")
    )
    write_nmea(tmp_path / "t.nmea", export_track(5, **nothing))
    found = parse(tmp_path / "t.nmea")
    assert list(found) == ["RMC", "GGA", "ZDA"]
    assert found["RMC"][0].data[6:8] == ["", ""]
    assert found["GGA"][0].data[5:8] == ["1", "", ""]


@pytest.mark.parametrize(
    ("fix", "code"),
    [
        ("single", 1), ("sbas", 2), ("dgps", 2), ("rtk-fixed", 4), ("rtk-float", 5), ("ppp", 5), ("none", 6),
        ("no such type", 1),
    ],
)  # fmt: skip
def test_quality(fix, code, tmp_path):
    write_nmea(tmp_path / "t.nmea", export_track(3, fix=np.full(3, fix)))
    found = parse(tmp_path / "t.nmea")
    assert {message.gps_qual for message in found["GGA"]} == {code}
    assert {message.mode_indicator for message in found["RMC"]} == {MODE[code]}
    assert {message.faa_mode for message in found["VTG"]} == {MODE[code]}


def test_stamps_between_hundredths(tmp_path):
    track = export_track(100, rate=200.0)
    write_nmea(tmp_path / "t.nmea", track)
    clocks = [message.data[0] for message in parse(tmp_path / "t.nmea")["GGA"]]
    assert clocks[:3] == ["235937.000", "235937.005", "235937.010"]


def test_fields_are_those_of_a_receiver(shared_data, tmp_path):
    """Every sentence has as many fields as that of a u-blox or Trimble receiver (RMC, VTG, GGA; GST, ZDA)."""
    write_nmea(tmp_path / "t.nmea", export_track(2))
    ours = {kind: len(messages[0].data) for kind, messages in parse(tmp_path / "t.nmea").items()}
    files = [
        *(shared_data / "google-nmea-f9k-span").glob("*F9K*.nmea"),
        shared_data / "formats" / "nmea" / "putty_nmea_netr9.log",
    ]
    theirs: dict[str, set[int]] = {}
    for file in files:
        for line in file.read_text(errors="replace").splitlines()[1:400]:
            kind = line[3:6]
            if line.startswith("$") and kind in ours:
                theirs.setdefault(kind, set()).add(line.count(","))
    assert set(theirs) >= {"RMC", "VTG", "GGA", "GST", "ZDA"}
    assert theirs == {kind: {ours[kind]} for kind in theirs}
