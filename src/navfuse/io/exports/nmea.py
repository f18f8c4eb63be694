"""NMEA 0183 sentences, one file: RMC, VTG, GGA, HDT, GST and ZDA of every epoch, talker GN.

What is written follows NMEA 0183 version 4.10 as receivers document it (u-blox, Interface Description of the ZED-F9P,
"NMEA messages"; Trimble, "NMEA-0183 messages"):

* times are UTC, the leap seconds of their date taken off; a leap second is 23:59:60. Hundredths of a second;
  milliseconds or microseconds where a stamp needs them, which the standard's variable-length fraction allows;
* latitude and longitude in degrees and minutes, seven decimals (0.2 mm), like high-precision receivers do, whose
  GGA is then longer than the 82 characters of the standard, too;
* GGA: the height is that above the geoid and the field after it the undulation, so that their sum is the ellipsoidal
  height. Without an undulation both fields are empty, and a warning says so. HDOP, which an integrated solution has
  none of, age and station are empty; satellites are, where unknown;
* quality of GGA, and mode of RMC and VTG: :data:`QUALITY` and :data:`MODE`. Dead reckoning (no fix within the last
  seconds) is 6 and E, and RMC calls it valid (A) as receivers with inertial sensors do;
* RMC and VTG: speed in knots (and km/h) and course over ground, degrees true, by the velocity; the course is empty at
  a speed that prints as zero. Without a velocity VTG is left out and the fields of RMC are empty. Magnetic variation is
  empty, the navigational status V (not given);
* HDT: heading of the body, degrees true; left out without an attitude;
* GST: standard deviations [m] of latitude, longitude and height; the fields of the error ellipse, for which a
  trajectory holds no covariances, are empty. Left out without standard deviations;
* ZDA: date and time; local time zone 00,00.

Fields that are empty are what the standard calls null fields. Roll and pitch have no standard sentence.
"""

from __future__ import annotations

import os
import warnings

import numpy as np

from navfuse.data.export_track import ExportTrack
from navfuse.data.trajectory import wrapped
from navfuse.errors import NavfuseWarning
from navfuse.io.atomic import atomic_file
from navfuse.io.exports.parts import check_parts, fix_codes
from navfuse.io.exports.stamps import clocks, dates, gps_ticks
from navfuse.io.gps_time import utc_of_gps

Array = np.ndarray

QUALITY = {"single": 1, "sbas": 2, "dgps": 2, "rtk-fixed": 4, "rtk-float": 5, "ppp": 5, "none": 6, "dead-reckoning": 6}
"""Fix type -> quality indicator of GGA. PPP shares 5 as in Trimble's receivers (RTX); 1 where nobody said."""
MODE = {1: "A", 2: "D", 4: "R", 5: "F", 6: "E"}
"""Quality indicator -> mode indicator of RMC and VTG."""

_KNOT = 1852.0 / 3600.0
_KMH = 1.0 / 3.6
_STILL = 0.0005
"""Speed [knots] below which it prints as zero."""
_PER_MINUTE = 10**7


def write_nmea(path: str | os.PathLike[str], track: ExportTrack) -> None:
    """Write a track as NMEA 0183 sentences; the file appears whole or not at all.

    Parameters
    ----------
    path : path-like
        Replaced if it exists.
    track : ExportTrack
        With an epoch, and an undulation for heights.

    Raises
    ------
    ConfigError
        If the track has no epoch.
    InputError
        If the track is empty or holds a value that is no number.
    OutputError
        If the file cannot be written.

    Warns
    -----
    NavfuseWarning
        If there is no undulation, so that the heights are left empty.
    """
    check_parts(track, "NMEA 0183")
    ticks, decimals = gps_ticks(track, "NMEA 0183", 2)
    if track.undulation is None:
        warnings.warn(
            f"{track.trajectory.source}: GGA of NMEA 0183 has heights above the geoid, and without the undulation they"
            " are left empty; ask for the geoid, or take a format with ellipsoidal heights",
            NavfuseWarning,
            stacklevel=2,
        )
    days, ticks_of_day = utc_of_gps(ticks, 10**decimals)
    clock = clocks(ticks_of_day, decimals, "")
    ymd = [date.split("-") for date in dates(days)]
    quality = fix_codes(track, QUALITY, 1)
    mode = [MODE[code] for code in quality.tolist()]
    where = _positions(track)
    groups = [_rmc(track, clock, where, ymd, mode), _gga(track, clock, where, quality)]
    if track.trajectory.velocity_n is not None:
        groups.insert(1, _vtg(track, mode))
    if track.trajectory.attitude is not None:
        heading = _angle(track.trajectory.attitude[:, 2])
        groups.append([f"GNHDT,{text},T" for text in heading])
    if track.trajectory.sd_position is not None:
        groups.append(
            [
                f"GNGST,{stamp},,,,,{north:.3f},{east:.3f},{down:.3f}"
                for stamp, (north, east, down) in zip(clock, _rows(*track.trajectory.sd_position.T), strict=True)
            ]
        )
    groups.append([f"GNZDA,{stamp},{d},{m},{y},00,00" for stamp, (y, m, d) in zip(clock, ymd, strict=True)])
    sentences = [sentence for epoch in zip(*groups, strict=True) for sentence in epoch]
    with atomic_file(path) as part:
        part.write_bytes(framed(sentences))


def framed(sentences: list[str]) -> bytes:
    """Sentences with ``$``, checksum (exclusive or of all characters between ``$`` and ``*``) and line end.

    Parameters
    ----------
    sentences : list of str
        ASCII, none of them empty.
    """
    characters = np.frombuffer("".join(sentences).encode("ascii"), dtype=np.uint8)
    starts = np.zeros(len(sentences), dtype=np.int64)
    np.cumsum([len(sentence) for sentence in sentences[:-1]], out=starts[1:])
    sums = np.bitwise_xor.reduceat(characters, starts).tolist()
    text = "".join([f"${sentence}*{check:02X}\r\n" for sentence, check in zip(sentences, sums, strict=True)])
    return text.encode("ascii")


def _rmc(track: ExportTrack, clock: list[str], where: list[str], ymd: list[list[str]], mode: list[str]) -> list[str]:
    if track.trajectory.velocity_n is None:
        motion = [","] * len(clock)
    else:
        motion = [f"{speed},{course}" for course, speed, _ in _motion(track.trajectory.velocity_n)]
    return [
        f"GNRMC,{stamp},A,{place},{moving},{d}{m}{y[2:]},,,{letter},V"
        for stamp, place, moving, (y, m, d), letter in zip(clock, where, motion, ymd, mode, strict=True)
    ]


def _vtg(track: ExportTrack, mode: list[str]) -> list[str]:
    assert track.trajectory.velocity_n is not None
    return [
        f"GNVTG,{course},T,,M,{knots},N,{kmh},K,{letter}"
        for (course, knots, kmh), letter in zip(_motion(track.trajectory.velocity_n), mode, strict=True)
    ]


def _gga(track: ExportTrack, clock: list[str], where: list[str], quality: Array) -> list[str]:
    count = len(clock)
    satellites = [""] * count
    if track.n_satellites is not None:
        satellites = [f"{number:02d}" for number in np.clip(track.n_satellites, 0, 99).tolist()]
    heights = [",M,,M"] * count
    if track.undulation is not None:
        # With the undulation as printed, the sum of the two fields is the ellipsoidal height to half a millimetre.
        undulation = np.round(track.undulation, 3)
        orthometric = track.trajectory.height - undulation
        heights = [f"{above:.3f},M,{geoid:.3f},M" for above, geoid in _rows(orthometric, undulation)]
    return [
        f"GNGGA,{stamp},{place},{code},{number},,{height},,"
        for stamp, place, code, number, height in zip(clock, where, quality.tolist(), satellites, heights, strict=True)
    ]


def _motion(velocity_n: Array) -> list[tuple[str, str, str]]:
    """Course [deg true], speed [knots] and speed [km/h] as text."""
    speed = np.hypot(velocity_n[:, 0], velocity_n[:, 1])
    course = _angle(np.arctan2(velocity_n[:, 1], velocity_n[:, 0]))
    rows = zip(course, *((speed / unit).tolist() for unit in (_KNOT, _KMH)), strict=True)
    return [(angle if knots >= _STILL else "", f"{knots:.3f}", f"{kmh:.3f}") for angle, knots, kmh in rows]


def _angle(angle: Array) -> list[str]:
    """Degrees 0.0000 to 359.9999 as text."""
    ticks = np.rint(np.degrees(wrapped(angle, 2.0 * np.pi)) * 1e4).astype(np.int64) % 3600000
    return [f"{whole}.{fraction:04d}" for whole, fraction in _rows(*np.divmod(ticks, 10000))]


def _positions(track: ExportTrack) -> list[str]:
    """``ddmm.mmmmmmm,N,dddmm.mmmmmmm,E``: counted in ticks of a minute, so that no minute shows as 60."""
    parts = []
    for angle, letters in ((track.trajectory.lat, "NS"), (track.trajectory.lon, "EW")):
        ticks = np.rint(np.degrees(angle) * (60 * _PER_MINUTE)).astype(np.int64)
        minutes, fraction = np.divmod(np.abs(ticks), _PER_MINUTE)
        degrees, minutes = np.divmod(minutes, 60)
        parts += [degrees, minutes, fraction, np.array(list(letters))[(ticks < 0).astype(int)]]
    return [
        f"{lat:02d}{lat_min:02d}.{lat_part:07d},{north},{lon:03d}{lon_min:02d}.{lon_part:07d},{east}"
        for lat, lat_min, lat_part, north, lon, lon_min, lon_part, east in _rows(*parts)
    ]


def _rows(*columns: Array) -> list[tuple]:
    return list(zip(*(column.tolist() for column in columns), strict=True))
