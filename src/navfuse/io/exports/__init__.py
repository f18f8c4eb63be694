"""Trajectories in the formats of other programs, one module each: ``write_NAME(path, track)``."""

from __future__ import annotations

import os
from importlib import import_module

from navfuse.data.export_track import ExportTrack
from navfuse.errors import ConfigError

EXTENSIONS = {
    "kml": ".kml",
    "gpx": ".gpx",
    "geojson": ".geojson",
    "csv": ".csv",
    "pos": ".pos",
    "nmea": ".nmea",
    "sbet": ".sbet",
    "smrmsg": ".smrmsg",
    "tum": ".tum",
    "kitti": ".kitti",
}
"""Format -> extension of its files."""


def known_formats(names: tuple[str, ...]) -> tuple[str, ...]:
    """The names of formats, each once.

    Raises
    ------
    ConfigError
        If there is none, or one that cannot be written.
    """
    from navfuse.core.nearest import nearest

    for name in names:
        if name not in EXTENSIONS:
            alike = nearest(name, list(EXTENSIONS), 0.5)
            meant = f' (is "{alike}" meant?)' if alike else ""
            raise ConfigError(f'there is no format "{name}"{meant}; known are {", ".join(EXTENSIONS)}')
    if not names:
        raise ConfigError(f"formats: name at least one of {', '.join(EXTENSIONS)}")
    return tuple(dict.fromkeys(names))


def write_track(format_: str, path: str | os.PathLike[str], track: ExportTrack) -> None:
    """Write a track in one of the formats of :data:`EXTENSIONS`; see the ``write_...`` of its module."""
    writer = getattr(import_module(f"navfuse.io.exports.{format_}"), f"write_{format_}")
    writer(path, track)
