"""The clock of a run: UTC of its log times, where its GPS epoch is known."""

from __future__ import annotations

from datetime import date, timedelta

from navfuse.data.gps_epoch import WEEK, GpsEpoch
from navfuse.io.gps_time import DAY, leap_seconds

_FIRST = date(1980, 1, 6)
_UNIX_OF_GPS = 315964800


def leap_at(gps_seconds: float) -> int:
    """GPS time minus UTC [s] at a GPS time [s since 1980-01-06]; during a leap second still the old value."""
    day = int((gps_seconds - leap_seconds(int(gps_seconds // DAY))) // DAY)
    return leap_seconds(day)


def utc_text(epoch: GpsEpoch, time: float) -> str:
    """UTC of a log time to the second, ``2025-07-09 19:34:26``; a leap second is 23:59:60."""
    gps = epoch.seconds + time
    leap = leap_at(gps)
    day = int((gps - leap) // DAY)
    if leap_seconds(day) > leap:
        day -= 1
    second = int(gps - leap - day * DAY)
    minute = min(second // 60, 1439)
    return f"{_FIRST + timedelta(days=day)} {minute // 60:02d}:{minute % 60:02d}:{second - 60 * minute:02d}"


def utc_clock(epoch: GpsEpoch | None, time: float) -> str:
    """`` (19:34:26 UTC)`` to follow a log time in a sentence; nothing where the epoch is not known."""
    return "" if epoch is None else f" ({utc_text(epoch, time)[11:]} UTC)"


def clock_of(epoch: GpsEpoch | None, start: float, end: float) -> dict[str, object] | None:
    """What the page's script needs to write a clock: week at the start, its second at log time zero, and Unix time.

    Past the end of that week the seconds count on. ``unix`` lists (from log time [s], Unix time of log time zero [s]):
    two of them where a leap second falls into the run.
    """
    if epoch is None:
        return None
    first, last = leap_at(epoch.seconds + start), leap_at(epoch.seconds + end)
    unix: list[tuple[float, float]] = [(start, epoch.seconds + _UNIX_OF_GPS - first)]
    if last != first:
        day = int((epoch.seconds + end - last) // DAY)
        unix.append((day * DAY + last - epoch.seconds, epoch.seconds + _UNIX_OF_GPS - last))
    weeks = int((epoch.tow + start) // WEEK)
    return {"week": epoch.week + weeks, "tow": epoch.tow - weeks * WEEK, "unix": unix}
