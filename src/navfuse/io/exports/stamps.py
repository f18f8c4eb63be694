"""Times of a track as formats write them: counted in whole ticks, so that no clock shows 60 seconds by rounding."""

from __future__ import annotations

import numpy as np

from navfuse.data.export_track import ExportTrack
from navfuse.data.gps_epoch import GpsEpoch
from navfuse.errors import ConfigError
from navfuse.io.gps_time import DAY, WEEK

Array = np.ndarray

_RESOLVED = 1e-6
"""Seconds below which a stamp counts as whole: what the sum of an epoch and a time is good for."""


def needed_epoch(track: ExportTrack, format_name: str) -> GpsEpoch:
    """Epoch of a track that leaves in a format with dates.

    Raises
    ------
    ConfigError
        If the track has none.
    """
    if track.epoch is None:
        raise ConfigError(
            f"{format_name} holds GPS time, and nobody said from when the times of '{track.trajectory.source}' count:"
            " set gnss.epoch_week_s = [week, seconds] in the project, or give --epoch WEEK,SECONDS"
        )
    return track.epoch


def gps_ticks(track: ExportTrack, format_name: str, at_least: int) -> tuple[Array, int]:
    """GPS times of a track in whole fractions of a second.

    Parameters
    ----------
    track : ExportTrack
    format_name : str
        For the message.
    at_least : int
        Decimals of a second that the format usually has. Where a stamp is not whole in them, three and then six are
        taken: half a hundredth of a second is 15 cm at 30 m/s.

    Returns
    -------
    ticks : (n,) int64 array
        Since 1980-01-06.
    decimals : int

    Raises
    ------
    ConfigError
        If the track has no epoch, or begins before GPS time did.
    """
    epoch = needed_epoch(track, format_name)
    tow = epoch.tow + track.trajectory.time
    decimals = next((n for n in (at_least, 3) if _whole(tow * 10**n, _RESOLVED * 10**n)), 6)
    per_second = 10**decimals
    ticks = epoch.week * int(WEEK) * per_second + np.rint(tow * per_second).astype(np.int64)
    if ticks.size and ticks[0] < 0:
        raise ConfigError(
            f"the epoch, GPS week {epoch.week} and {epoch.tow:g} s, puts '{track.trajectory.source}' before 1980-01-06,"
            " where GPS time begins; is the week counted without rollover?"
        )
    return ticks, decimals


def dates(days: Array) -> list[str]:
    """Dates ``YYYY-MM-DD`` of days (n,) since 1980-01-06; a track has few, so that each is made once."""
    found, index = np.unique(days, return_inverse=True)
    text = (np.datetime64("1980-01-06", "D") + found).astype(str)
    return text[index].tolist()


def clocks(ticks_of_day: Array, decimals: int, separator: str) -> list[str]:
    """Times of day ``HH:MM:SS.sss`` of ticks (n,), 10**decimals to a second; 23:59:60 in a leap second."""
    per_second = 10**decimals
    seconds, fraction = np.divmod(ticks_of_day, per_second)
    leap = seconds >= int(DAY)
    seconds = seconds - leap
    minutes, seconds = np.divmod(seconds, 60)
    hours, minutes = np.divmod(minutes, 60)
    template = separator.join(("%02d", "%02d", f"%02d.%0{decimals}d"))
    columns = (hours, minutes, seconds + leap, fraction)
    return [template % row for row in zip(*(column.tolist() for column in columns), strict=True)]


def _whole(ticks: Array, tolerance: float) -> bool:
    return bool(np.all(np.abs(ticks - np.rint(ticks)) <= tolerance))
