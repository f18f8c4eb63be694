"""KML 2.2 for Google Earth and its like: a track with a time slider, lines in the colour of their quality, points.

Heights are above the geoid EGM96, as ``altitudeMode`` absolute wants them (OGC 07-147r2, section 9.20.3.1.1). The
moving track is a ``gx:Track``, Google's extension, and is there only where the date is known.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from navfuse.data.export_track import ExportTrack
from navfuse.io.exports.pieces import CLASSES, UNKNOWN, cut_at_antimeridian, expected_error, gapless, quality
from navfuse.io.exports.text import above_geoid, rows, write_text, xml_text

Array = np.ndarray

MOST_POINTS = 1000
"""Points that stand for an ordinary track, evenly spread; of events every one is there."""

_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">
<Document>
<name>{name}</name>
<open>1</open>
<description>{description}</description>
<Style id="track"><LineStyle><color>80ffffff</color><width>1</width></LineStyle></Style>
"""
_STYLE = (
    '<Style id="q{index}"><IconStyle><color>ff{bgr}</color><scale>0.5</scale></IconStyle>'
    "<LabelStyle><scale>{label}</scale></LabelStyle>"
    "<LineStyle><color>ff{bgr}</color><width>3</width></LineStyle></Style>\n"
)


def write_kml(path: str | os.PathLike[str], track: ExportTrack) -> None:
    """Write a track as KML; the file appears whole or not at all.

    Of events there are the points alone, with their names. Of a track without an epoch there are no times.
    See :func:`navfuse.io.exports.text.write_text`.
    """
    write_text(path, track, "KML", _document)


def _document(track: ExportTrack, stamps: list[str] | None) -> Iterator[str]:
    height, datum = above_geoid(track)
    trajectory = track.trajectory
    lon, lat = np.degrees(trajectory.lon), np.degrees(trajectory.lat)
    kind = quality(track)
    yield _HEAD.format(name=xml_text(track.name), description=xml_text(f"Point: {track.point}. Heights: {datum}."))
    events = track.labels is not None
    colours = [colour for _, _, colour in CLASSES] + [UNKNOWN[1]]
    for index in np.unique(kind).tolist():
        red, green, blue = (colours[index][k : k + 2] for k in (0, 2, 4))
        yield _STYLE.format(index=index, bgr=blue + green + red, label="0.8" if events else "0")
    if not events:
        if stamps is not None:
            yield from _moving(track, stamps, lon, lat, height)
        yield from _lines(track, kind, lon, lat, height)
    yield from _points(track, stamps, kind, lon, lat, height)
    yield "</Document>\n</kml>\n"


def _moving(track: ExportTrack, stamps: list[str], lon: Array, lat: Array, height: Array) -> Iterator[str]:
    yield "<Folder>\n<name>In time</name>\n"
    for piece in gapless(track):
        yield "<Placemark>\n<name>" + xml_text(track.name) + "</name>\n<styleUrl>#track</styleUrl>\n"
        yield "<gx:Track>\n<altitudeMode>absolute</altitudeMode>\n"
        yield from rows("<when>%s</when>\n", [stamps[piece]])
        yield from rows("<gx:coord>%.9f %.9f %.4f</gx:coord>\n", [lon[piece], lat[piece], height[piece]])
        if track.trajectory.attitude is not None:
            # The heading alone: what Google calls positive tilt and roll is not said so that one could rely on it.
            yield from rows("<gx:angles>%.4f 0 0</gx:angles>\n", [np.degrees(track.trajectory.attitude[piece, 2])])
        yield "</gx:Track>\n</Placemark>\n"
    yield "</Folder>\n"


def _lines(track: ExportTrack, kind: Array, lon: Array, lat: Array, height: Array) -> Iterator[str]:
    """One placemark for each class of quality, of all its stretches; a stretch reaches to where the next begins."""
    stretches: dict[int, list[Array]] = {}
    for piece in gapless(track):
        change = np.flatnonzero(np.diff(kind[piece])) + 1
        bounds = [piece.start, *(piece.start + change).tolist(), piece.stop]
        for start, stop in pairwise(bounds):
            end = min(stop + 1, piece.stop)
            if end - start > 1:
                line = cut_at_antimeridian(lon[start:end], lat[start:end], height[start:end])
                stretches.setdefault(int(kind[start]), []).extend(line)
    yield "<Folder>\n<name>Expected horizontal error (1 sigma)</name>\n"
    for index, lines in sorted(stretches.items()):
        words = CLASSES[index][0] if index < len(CLASSES) else UNKNOWN[0]
        yield f"<Placemark>\n<name>{words}</name>\n<styleUrl>#q{index}</styleUrl>\n<MultiGeometry>\n"
        for line in lines:
            yield "<LineString><altitudeMode>absolute</altitudeMode><coordinates>\n"
            yield from rows("%.9f,%.9f,%.4f\n", list(line.T))
            yield "</coordinates></LineString>\n"
        yield "</MultiGeometry>\n</Placemark>\n"
    yield "</Folder>\n"


def _points(
    track: ExportTrack, stamps: list[str] | None, kind: Array, lon: Array, lat: Array, height: Array
) -> Iterator[str]:
    trajectory, labels = track.trajectory, track.labels
    step = 1 if labels is not None else max(1, -(-len(trajectory) // MOST_POINTS))
    error = expected_error(track)
    yield f"<Folder>\n<name>{'Events' if labels is not None else 'Points'}</name>\n"
    for k in range(0, len(trajectory), step):
        name = f"{trajectory.time[k]:.3f} s" if labels is None else str(labels[k])
        data = {"time_s": f"{trajectory.time[k]:.6f}"}
        if error is not None:
            data["sd_horizontal_m"] = f"{error[k]:.4f}"
        if track.fix is not None:
            data["fix"] = str(track.fix[k])
        if track.n_satellites is not None:
            data["n_satellites"] = str(track.n_satellites[k])
        if trajectory.velocity_n is not None:
            data["speed_mps"] = f"{np.linalg.norm(trajectory.velocity_n[k]):.3f}"
        if trajectory.attitude is not None:
            roll, pitch, heading = np.degrees(trajectory.attitude[k])
            data |= {"roll_deg": f"{roll:.4f}", "pitch_deg": f"{pitch:.4f}", "heading_deg": f"{heading:.4f}"}
        yield f"<Placemark>\n<name>{xml_text(name)}</name>\n<visibility>{int(labels is not None)}</visibility>\n"
        if stamps is not None:
            yield f"<TimeStamp><when>{stamps[k]}</when></TimeStamp>\n"
        yield f"<styleUrl>#q{kind[k]}</styleUrl>\n<ExtendedData>\n"
        yield from (f'<Data name="{key}"><value>{xml_text(value)}</value></Data>\n' for key, value in data.items())
        yield "</ExtendedData>\n<Point><altitudeMode>absolute</altitudeMode>"
        yield f"<coordinates>{lon[k]:.9f},{lat[k]:.9f},{height[k]:.4f}</coordinates></Point>\n</Placemark>\n"
    yield "</Folder>\n"
