"""GeoJSON (RFC 7946) for geographic information systems: the track as a line, and every epoch as a point.

Longitude before latitude, heights above the WGS 84 ellipsoid (section 4); a line across the meridian of 180 degrees is
cut there (section 3.1.9), and so is one at a gap.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator

import numpy as np

from navfuse.data.export_track import ExportTrack
from navfuse.io.exports.pieces import cut_at_antimeridian, expected_error, gapless
from navfuse.io.exports.text import rows, write_text

Array = np.ndarray


def write_geojson(path: str | os.PathLike[str], track: ExportTrack) -> None:
    """Write a track as GeoJSON; the file appears whole or not at all.

    Of events there are the points alone, with their names. Of a track without an epoch there is no ``utc``.
    See :func:`navfuse.io.exports.text.write_text`.
    """
    write_text(path, track, "GeoJSON", _document)


def _document(track: ExportTrack, stamps: list[str] | None) -> Iterator[str]:
    trajectory = track.trajectory
    lon, lat = np.degrees(trajectory.lon), np.degrees(trajectory.lat)
    yield '{"type": "FeatureCollection", "features": [\n'
    if track.labels is None:
        yield from _line(track, stamps, lon, lat)
    yield from _points(track, stamps, lon, lat)
    yield "]}\n"


def _line(track: ExportTrack, stamps: list[str] | None, lon: Array, lat: Array) -> Iterator[str]:
    height = track.trajectory.height
    lines = [
        line
        for piece in gapless(track)
        if piece.stop - piece.start > 1
        for line in cut_at_antimeridian(lon[piece], lat[piece], height[piece])
    ]
    if not lines:
        return
    time = track.trajectory.time
    properties = {"name": track.name, "point": track.point, "from_s": float(time[0]), "to_s": float(time[-1])}
    if stamps is not None:
        properties |= {"from_utc": stamps[0], "to_utc": stamps[-1]}
    many = len(lines) > 1
    yield f'{{"type": "Feature", "properties": {_text(properties)}, "geometry": '
    yield f'{{"type": "{"MultiLineString" if many else "LineString"}", "coordinates": [' + "[" * many
    for k, line in enumerate(lines):
        if k:
            yield "],\n["
        yield from _comma_separated("[%.9f, %.9f, %.4f],\n", list(line.T))
    yield "]" * many + "]}},\n"


def _points(track: ExportTrack, stamps: list[str] | None, lon: Array, lat: Array) -> Iterator[str]:
    trajectory = track.trajectory
    properties: dict[str, tuple[str, Array | list[str]]] = {"time_s": ("%.6f", trajectory.time)}
    for name, words in (("utc", stamps), ("label", track.labels), ("fix", track.fix)):
        if words is not None:
            properties[name] = ("%s", [_text(str(word)) for word in words])
    if track.n_satellites is not None:
        properties["n_satellites"] = ("%d", track.n_satellites)
    if track.undulation is not None:
        properties["above_geoid_m"] = ("%.4f", trajectory.height - track.undulation)
    error = expected_error(track)
    if error is not None:
        properties["sd_horizontal_m"] = ("%.4f", error)
    formats = {"deg": "%.5f", "m": "%.4f", "mps": "%.4f"}
    for name, column in list(trajectory.to_columns().items())[4:]:
        properties[name] = (formats[name.rpartition("_")[2]], column)
    inside = ", ".join(f'"{name}": {form}' for name, (form, _) in properties.items())
    template = (
        f'{{"type": "Feature", "properties": {{{inside}}}, '
        '"geometry": {"type": "Point", "coordinates": [%.9f, %.9f, %.4f]}},\n'
    )
    columns = [*(column for _, column in properties.values()), lon, lat, trajectory.height]
    yield from _comma_separated(template, columns)


def _comma_separated(template: str, columns: list[Array | list[str]]) -> Iterator[str]:
    """Rows that end in a comma and a line feed, the last one in the line feed alone."""
    held = ""
    for block in rows(template, columns):
        yield held
        held = block
    yield held.removesuffix(",\n") + "\n"


def _text(value: object) -> str:
    """JSON; what UTF-8 cannot hold, half a surrogate pair, stays escaped."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False)
    return text if text.isprintable() else json.dumps(value, allow_nan=False)
