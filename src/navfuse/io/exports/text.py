"""What the text formats share: markup made harmless, dates, rows of numbers."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from xml.sax.saxutils import escape

import numpy as np

from navfuse.data.export_track import ExportTrack
from navfuse.errors import NavfuseWarning
from navfuse.io.atomic import atomic_file
from navfuse.io.exports.parts import check_parts
from navfuse.io.exports.stamps import clocks, dates, gps_ticks
from navfuse.io.gps_time import DAY, utc_of_gps

Array = np.ndarray

ROWS = 50_000
"""Rows that are made into text at a time."""

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Everything that XML 1.0 cannot hold, not even escaped (section 2.2)."""


Document = Callable[[ExportTrack, list[str] | None], Iterator[str]]


def write_text(path: str | os.PathLike[str], track: ExportTrack, format_name: str, document: Document) -> None:
    """Write the pieces of text that `document` makes of a track and its dates; the file appears whole or not at all.

    Parameters
    ----------
    path : path-like
        Replaced if it exists.
    track : ExportTrack
    format_name : str
        For the messages.
    document : callable
        Of the track and of its dates, which are None for a track without an epoch.

    Raises
    ------
    InputError
        If the track is empty or holds a value that is no number.
    OutputError
        If the file cannot be written.

    Warns
    -----
    NavfuseWarning
        If the track has no epoch.
    """
    check_parts(track, format_name)
    stamps = iso_stamps(track, format_name)
    with atomic_file(path) as part, part.open("w", encoding="utf-8", newline="\n") as stream:
        stream.writelines(document(track, stamps))


def xml_text(text: str) -> str:
    """Text as content or quoted attribute of an XML element; what XML cannot hold becomes U+FFFD."""
    return escape(_NOT_XML.sub("\ufffd", text), {'"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})


def above_geoid(track: ExportTrack) -> tuple[Array, str]:
    """Heights (n,) [m] for formats that want them above the geoid, and above what they are, in words."""
    if track.undulation is None:
        return track.trajectory.height, "above the WGS 84 ellipsoid"
    return track.trajectory.height - track.undulation, "above the geoid"


def iso_stamps(track: ExportTrack, format_name: str) -> list[str] | None:
    """UTC of every epoch as ``2026-03-04T05:06:07.890Z``, or None, with a warning, where the date is not known.

    Parameters
    ----------
    track : ExportTrack
    format_name : str
        For the warning.

    Returns
    -------
    list of str or None
        To the millisecond if all stamps are whole milliseconds, else to the microsecond. A leap second, which an XML
        ``dateTime`` cannot hold, shows as the first second of the next day, which then comes twice.

    Raises
    ------
    ConfigError
        If the epoch puts the track before GPS time began.

    Warns
    -----
    NavfuseWarning
        If the track has no epoch.
    """
    if track.epoch is None:
        warnings.warn(
            f"{format_name} is written without times, because nobody said to which date those of "
            f"'{track.trajectory.source}' belong: set gnss.epoch_week_s = [week, seconds] in the project, or give "
            "--epoch WEEK,SECONDS",
            NavfuseWarning,
            stacklevel=3,
        )
        return None
    ticks, decimals = gps_ticks(track, format_name, 3)
    days, ticks_of_day = utc_of_gps(ticks, 10**decimals)
    spill, ticks_of_day = np.divmod(ticks_of_day, int(DAY) * 10**decimals)
    times = zip(dates(days + spill), clocks(ticks_of_day, decimals, ":"), strict=True)
    return [f"{date}T{clock}Z" for date, clock in times]


def rows(template: str, columns: Sequence[Array | list[str]]) -> Iterator[str]:
    """Text of many rows, block by block.

    Parameters
    ----------
    template : str
        One row in ``%`` notation, line feed included; one place for each column.
    columns : sequence of (n,) arrays or lists

    Yields
    ------
    str
        Up to :data:`ROWS` rows.
    """
    for start in range(0, len(columns[0]), ROWS):
        pieces = [column[start : start + ROWS] for column in columns]
        block = zip(*(piece.tolist() if isinstance(piece, np.ndarray) else piece for piece in pieces), strict=True)
        yield "".join(map(template.__mod__, block))
