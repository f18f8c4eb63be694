"""GPX 1.1 for handhelds and track viewers: a track of segments without gaps, or waypoints where there are events.

Heights are above the geoid, times are UTC (GPX 1.1 schema documentation, ``ele`` and ``time``).
"""

from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np

from navfuse.data.export_track import ExportTrack
from navfuse.io.exports.pieces import gapless
from navfuse.io.exports.text import above_geoid, rows, write_text, xml_text

Array = np.ndarray

_FIX = {"none": "none", "single": "3d", "dgnss": "dgps", "dgps": "dgps", "sbas": "dgps", "rtk-float": "dgps"}
_FIX |= {"rtk-fixed": "dgps", "ppp": "dgps"}
"""Fix type -> one of the few words of GPX (``fixType``); others are left out."""

_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<gpx xmlns="http://www.topografix.com/GPX/1/1" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
 xsi:schemaLocation="http://www.topografix.com/GPX/1/1 http://www.topografix.com/GPX/1/1/gpx.xsd"
 version="1.1" creator="navfuse">
<metadata><name>{name}</name><desc>{description}</desc></metadata>
"""


def write_gpx(path: str | os.PathLike[str], track: ExportTrack) -> None:
    """Write a track as GPX; the file appears whole or not at all.

    Of a track without an epoch there are no times. See :func:`navfuse.io.exports.text.write_text`.
    """
    write_text(path, track, "GPX", _document)


def _document(track: ExportTrack, stamps: list[str] | None) -> Iterator[str]:
    height, datum = above_geoid(track)
    name, description = xml_text(track.name), xml_text(f"Point: {track.point}. Heights: {datum}.")
    yield _HEAD.format(name=name, description=description)
    element = "trkpt" if track.labels is None else "wpt"
    template, columns = _points(track, stamps, height, element)
    if track.labels is not None:
        yield from rows(template, columns)
    else:
        yield f"<trk><name>{name}</name>\n"
        for piece in gapless(track):
            yield "<trkseg>\n"
            yield from rows(template, [column[piece] for column in columns])
            yield "</trkseg>\n"
        yield "</trk>\n"
    yield "</gpx>\n"


def _points(
    track: ExportTrack, stamps: list[str] | None, height: Array, element: str
) -> tuple[str, list[Array | list[str]]]:
    """Template and columns of the points, children in the order of the schema (``wptType``)."""
    lon = np.round(np.degrees(track.trajectory.lon), 9)
    lon = np.where(lon >= 180.0, lon - 360.0, lon)
    columns: list[Array | list[str]] = [np.degrees(track.trajectory.lat), lon, height]
    template = f'<{element} lat="%.9f" lon="%.9f"><ele>%.4f</ele>'
    if stamps is not None:
        template += "<time>%s</time>"
        columns.append(stamps)
    if track.undulation is not None:
        template += "<geoidheight>%.3f</geoidheight>"
        columns.append(track.undulation)
    if track.labels is not None:
        template += "<name>%s</name>"
        columns.append([xml_text(str(label)) for label in track.labels.tolist()])
    if track.fix is not None:
        words = [_FIX.get(str(fix).lower(), "") for fix in track.fix.tolist()]
        template += "%s"
        columns.append([f"<fix>{word}</fix>" if word else "" for word in words])
    if track.n_satellites is not None:
        template += "<sat>%d</sat>"
        columns.append(np.maximum(track.n_satellites, 0))
    return template + f"</{element}>\n", columns
