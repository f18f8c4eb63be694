"""The GPS time from which the times of a log count."""

from __future__ import annotations

from typing import NamedTuple

from navfuse.errors import ConfigError

WEEK = 604800.0
_MOST_WEEKS = 100_000
"""Nineteen centuries: beyond that a week is not a week number but seconds."""


class GpsEpoch(NamedTuple):
    """GPS time at which the time of a log is zero.

    Attributes
    ----------
    week : int
        Weeks since 1980-01-06, without rollover.
    tow : float [s]
        Seconds of that week, 0 <= tow < 604800.
    """

    week: int
    tow: float

    @classmethod
    def of(cls, week: float, tow: float) -> GpsEpoch:
        """The epoch, checked.

        Raises
        ------
        ConfigError
            If this is not a week number and seconds of a week.
        """
        if not (0 <= week < _MOST_WEEKS and week == int(week) and 0.0 <= tow < WEEK):
            raise ConfigError(
                f"epoch = {(week, tow)} has to be a GPS week number and the seconds of the week, 0 to 604800"
            )
        return cls(int(week), float(tow))

    @property
    def seconds(self) -> float:
        """GPS time of the epoch, seconds since 1980-01-06 00:00:00; to 1e-6 s in double precision."""
        return self.week * WEEK + self.tow
