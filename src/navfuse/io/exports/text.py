"""What the text formats share: markup made harmless, dates, rows of numbers."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from xml.sax.saxutils import escape

import numpy as np

from navfuse.data.export_track import ExportTrack
from navfuse.errors import NavfuseWarning
from navfuse.io.gps_time import utc_times

Array = np.ndarray

ROWS = 50_000
"""Rows that are made into text at a time."""

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Everything that XML 1.0 cannot hold, not even escaped (section 2.2)."""


def xml_text(text: str) -> str:
    """Text as content or quoted attribute of an XML element; what XML cannot hold becomes U+FFFD."""
    return escape(_NOT_XML.sub("\ufffd", text), {'"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})


def iso_stamps(track: ExportTrack, format_: str) -> Array | None:
    """UTC of every epoch as ``2026-03-04T05:06:07.890Z``, or None, with a warning, where the date is not known.

    Parameters
    ----------
    track : ExportTrack
    format_ : str
        Name of the format, for the warning.

    Returns
    -------
    (n,) array of str or None
        To the millisecond if all stamps are whole milliseconds, else to the microsecond.

    Warns
    -----
    NavfuseWarning
        If the track has no epoch.
    """
    if track.epoch is None:
        warnings.warn(
            f"{format_}: written without times, because nobody says to which date the times of the log belong; give "
            "gnss.epoch_week_s in the project, or --epoch WEEK,SECONDS",
            NavfuseWarning,
            stacklevel=3,
        )
        return None
    utc = utc_times(track.epoch, track.trajectory.time)
    whole = not np.any(utc.astype(np.int64) % 1000)
    return np.char.add(np.datetime_as_string(utc, unit="ms" if whole else "us"), "Z")


def rows(template: str, columns: Sequence[Array]) -> Iterator[str]:
    """Text of many rows, block by block.

    Parameters
    ----------
    template : str
        One row in ``%`` notation, line feed included; one place for each column.
    columns : sequence of (n,) arrays

    Yields
    ------
    str
        Up to :data:`ROWS` rows.
    """
    for start in range(0, columns[0].size, ROWS):
        block = zip(*(column[start : start + ROWS].tolist() for column in columns), strict=True)
        yield "".join(map(template.__mod__, block))
