"""Tracks to export, ordinary and at the edges, and small independent conversions to hold the files against."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
from hypothesis import strategies as st

from navfuse.data.export_track import ExportTrack
from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.trajectory import Trajectory

MIDNIGHT = GpsEpoch(2300, 2 * 86400.0 - 5.0)
WEEK_END = GpsEpoch(2300, 604800.0 - 5.0)
LEAP_SECOND = GpsEpoch(1930, 15.0)
"""GPS week 1930 begins at 2017-01-01 00:00:00 GPS time, 17 s before the leap second at the end of 2016 is over."""
UTC_MIDNIGHT = GpsEpoch(2300, 86400.0 + 18.0 - 5.0)


def export_track(n: int = 100, rate: float = 10.0, epoch: GpsEpoch | None = MIDNIGHT, **changes) -> ExportTrack:
    """A car that goes round near Munich, with everything a track may hold."""
    time = np.arange(n) / rate
    heading = np.mod(6.2 + 0.1 * time, 2.0 * np.pi)
    speed = 12.0
    north = speed / 0.1 * (np.sin(heading) - np.sin(6.2))
    east = -speed / 0.1 * (np.cos(heading) - np.cos(6.2))
    parts = {
        "time": time,
        "lat": np.radians(48.0) + north / 6371e3,
        "lon": np.radians(11.5) + east / 6371e3 / np.cos(np.radians(48.0)),
        "height": 500.0 + 0.5 * time,
        "velocity_n": np.column_stack([speed * np.cos(heading), speed * np.sin(heading), np.full(n, -0.5)]),
        "attitude": np.column_stack([0.05 * np.sin(time), 0.02 * np.cos(time), heading]),
        "sd_position": np.full((n, 3), (0.01, 0.02, 0.03)),
        "sd_velocity": np.full((n, 3), (0.011, 0.012, 0.013)),
        "sd_attitude": np.radians(np.full((n, 3), (0.01, 0.02, 0.1))),
    }
    rest = {
        "undulation": np.full(n, 46.1234),
        "fix": np.full(n, "rtk-fixed"),
        "n_satellites": np.full(n, 14),
        "a_eb_b": np.column_stack([np.zeros(n), np.full(n, 1.2), np.full(n, -0.1)]),
        "w_nb_b": np.column_stack([0.05 * np.cos(time), np.zeros(n), np.full(n, 0.1)]),
    }
    parts |= {name: value for name, value in changes.items() if name in parts or name == "source"}
    rest |= {name: value for name, value in changes.items() if name not in parts}
    return ExportTrack(Trajectory(**parts), epoch=epoch, **rest)


def _edge(*special: float, low: float, high: float) -> st.SearchStrategy[float]:
    return st.one_of(st.sampled_from(special), st.floats(low, high))


_HALF = 0.5 * np.pi


@st.composite
def tracks(draw: st.DrawFn) -> ExportTrack:
    """A few epochs anywhere: poles, date line, equator, below the ellipsoid, headings beside north, odd epochs."""
    n = draw(st.integers(1, 4))

    def column(*special: float, low: float, high: float) -> np.ndarray:
        return np.array(draw(st.lists(_edge(*special, low=low, high=high), min_size=n, max_size=n)))

    tiny = 1e-12
    lat = column(0.0, -tiny, tiny, _HALF, -_HALF, _HALF - tiny, np.radians(59.9999999999), low=-_HALF, high=_HALF)
    lon = column(
        0.0, -tiny, np.pi, -np.pi, np.pi - tiny, -np.pi + tiny, np.radians(9.99999999999), low=-np.pi, high=np.pi
    )
    heading = column(0.0, tiny, 2.0 * np.pi - tiny, 2.0 * np.pi - 1e-7, np.pi, low=0.0, high=6.2831)
    roll = column(0.0, np.pi, -np.pi, low=-np.pi, high=np.pi)
    pitch = column(0.0, 1.5, -1.5, low=-1.5, high=1.5)
    start = draw(st.integers(0, 60))
    steps = np.array(draw(st.lists(st.integers(1, 40), min_size=n, max_size=n)))
    return export_track(
        n,
        epoch=draw(
            st.sampled_from([MIDNIGHT, WEEK_END, LEAP_SECOND, UTC_MIDNIGHT, GpsEpoch(0, 0.0), GpsEpoch(2400, 0.5)])
        ),
        time=(start + np.cumsum(steps)) / 10.0,
        lat=lat,
        lon=lon,
        height=column(-430.0, 0.0, -0.0004, low=-500.0, high=20000.0),
        velocity_n=np.column_stack([column(0.0, -tiny, low=-300.0, high=300.0) for _ in range(3)]),
        attitude=np.column_stack([roll, pitch, heading]),
        undulation=column(-106.0, 0.0, 85.0, low=-106.0, high=85.0),
    )


def metres_apart(lat_deg: np.ndarray, lon_deg: np.ndarray, track: ExportTrack) -> np.ndarray:
    """Horizontal distance (n,) [m] of positions in degrees from those of the track."""
    lat, lon = np.degrees(track.trajectory.lat), np.degrees(track.trajectory.lon)
    east = (np.asarray(lon_deg) - lon + 180.0) % 360.0 - 180.0
    metres = 111320.0
    return np.hypot((np.asarray(lat_deg) - lat) * metres, east * metres * np.cos(np.radians(lat)))


def gps_seconds(track: ExportTrack) -> np.ndarray:
    """Seconds (n,) since 1980-01-06 in GPS time."""
    assert track.epoch is not None
    return track.epoch.week * 604800.0 + track.epoch.tow + track.trajectory.time


def gps_of_utc(date: tuple[int, int, int], clock: str) -> float:
    """Seconds since 1980-01-06 in GPS time of a UTC date and ``HHMMSS.ss``, for dates of 1980, and from 2015-07 on."""
    year, month, day = date
    midnight = datetime(year, month, day)
    leap = 0 if midnight.year == 1980 else 17 if midnight < datetime(2017, 1, 1) else 18
    seconds = 3600 * int(clock[:2]) + 60 * int(clock[2:4]) + float(clock[4:])
    return (midnight - datetime(1980, 1, 6)) / timedelta(seconds=1) + seconds + leap
