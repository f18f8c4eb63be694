"""Calendar dates of files as seconds of GPS time.

GPS time runs without leap seconds since 1980-01-06 00:00:00 UTC (IS-GPS-200, 3.3.4). UTC gets a leap second now and
then, announced by the IERS in Bulletin C; the table here holds all of them since GPS time began, the last at the end
of 2016. None was announced up to December 2025 (Bulletin C 70).
"""

from __future__ import annotations

from datetime import date

import numpy as np

from navfuse.data.gps_epoch import GpsEpoch

Array = np.ndarray

WEEK = 604800.0
DAY = 86400.0

_EPOCH = date(1980, 1, 6).toordinal()

_LEAP_DATES = (
    (1981, 7, 1), (1982, 7, 1), (1983, 7, 1), (1985, 7, 1), (1988, 1, 1), (1990, 1, 1),
    (1991, 1, 1), (1992, 7, 1), (1993, 7, 1), (1994, 7, 1), (1996, 1, 1), (1997, 7, 1),
    (1999, 1, 1), (2006, 1, 1), (2009, 1, 1), (2012, 7, 1), (2015, 7, 1), (2017, 1, 1),
)  # fmt: skip
_LEAP_DAYS = tuple(date(*day).toordinal() - _EPOCH for day in _LEAP_DATES)


def days_since_epoch(year: int, month: int, day: int) -> int:
    """Days from 1980-01-06 to a date of the Gregorian calendar.

    Parameters
    ----------
    year, month, day : int
        Date.

    Returns
    -------
    int

    Raises
    ------
    ValueError
        If there is no such date.
    """
    return date(year, month, day).toordinal() - _EPOCH


def leap_seconds(days: int) -> int:
    """GPS time minus UTC [s] during a UTC day.

    Parameters
    ----------
    days : int
        UTC days since 1980-01-06. During the leap second that ends a day the value is still that of the day.

    Returns
    -------
    int
        0 to 18; the last value is kept for days after the table.
    """
    return sum(days >= leap for leap in _LEAP_DAYS)


def utc_of_gps(ticks: Array, per_second: int = 1) -> tuple[Array, Array]:
    """UTC day and time of day of GPS times.

    Parameters
    ----------
    ticks : (n,) int64 array
        GPS time since 1980-01-06, in fractions of a second so that nothing is rounded here.
    per_second : int
        Ticks of a second.

    Returns
    -------
    days : (n,) int64 array
        UTC days since 1980-01-06.
    ticks_of_day : (n,) int64 array
        0 up to ``86400 * per_second``; beyond that, by less than a second, in the leap second that ends a day: it is
        23:59:60.
    """
    day = int(DAY) * per_second
    leaps = np.array([leap * day + before * per_second for before, leap in enumerate(_LEAP_DAYS)], dtype=np.int64)
    before = np.searchsorted(leaps, ticks, side="right")
    in_leap = (before > 0) & (ticks < leaps[before - 1] + per_second)
    utc = ticks - np.where(in_leap, before - 1, before) * per_second
    days, ticks_of_day = np.divmod(utc, day)
    return days - in_leap, ticks_of_day + in_leap * day


def log_times(epoch: GpsEpoch, utc: Array) -> Array:
    """Log times of UTC stamps.

    Parameters
    ----------
    epoch : GpsEpoch
        GPS time from which log times count.
    utc : (n,) array of datetime64[us]
        Never inside a leap second, which this type does not have.

    Returns
    -------
    (n,) array [s]
    """
    microseconds = (utc - np.datetime64("1980-01-06", "us")).astype(np.int64)
    leaps = np.searchsorted(np.array(_LEAP_DAYS) * int(DAY) * 1_000_000, microseconds, side="right")
    since = microseconds + (leaps - epoch.week * int(WEEK)) * 1_000_000
    start = round(epoch.tow * 1e6)
    return (since - start) / 1e6 - (epoch.tow - start / 1e6)
