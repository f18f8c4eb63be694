"""Track files: native tables, GPX, and the motion profiles of Groves (2013) without a header."""

from __future__ import annotations

import os
import warnings
from datetime import UTC, datetime
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from navfuse.data.trajectory import Trajectory, wrapped
from navfuse.errors import InputError, NavfuseWarning
from navfuse.io.trajectory_table import read_trajectory

Array = np.ndarray

_PROFILE_COLUMNS = 10


def read_track(path: str | os.PathLike[str]) -> Trajectory:
    """Read positions, and attitudes where there are any, to make a motion of.

    Parameters
    ----------
    path : path-like
        ``.gpx``: the track points of all tracks in their order. A ``.csv`` file whose first line holds ten numbers: a
        motion profile of Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems" (2013):
        time [s], latitude, longitude [deg], height [m], velocity north, east, down [m/s], roll, pitch, heading [deg].
        Everything else: a native trajectory table, by :func:`~navfuse.io.trajectory_table.read_trajectory`.

    Returns
    -------
    Trajectory
        The time of a GPX track is counted from its first point.

    Raises
    ------
    InputError
        For a file that cannot be read, or a track point without position or time, which is named by its number.

    Warns
    -----
    NavfuseWarning
        For a GPX track without elevations; they are taken as 0. Elevations are used as they stand, though most
        are above the geoid.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    if path.suffix.lower() == ".gpx":
        return _read_gpx(path)
    if path.suffix.lower() == ".csv":
        with path.open(encoding="utf-8-sig", errors="replace") as lines:
            if _is_profile(lines.readline()):
                return _read_profile(path)
    return read_trajectory(path)


def _is_profile(line: str) -> bool:
    cells = line.split(",")
    return len(cells) == _PROFILE_COLUMNS and all(_number(cell) is not None for cell in cells)


def _number(text: str | None) -> float | None:
    try:
        return float(text or "")
    except ValueError:
        return None


def _read_profile(path: Path) -> Trajectory:
    rows = []
    for number, line in enumerate(path.read_text(encoding="utf-8-sig").splitlines(), 1):
        if not line.strip():
            continue
        row = [_number(cell) for cell in line.split(",")]
        if len(row) != _PROFILE_COLUMNS or None in row:
            raise InputError(f"{path}, row {number}: a motion profile has {_PROFILE_COLUMNS} numbers a row")
        rows.append(row)
    table = np.array(rows, dtype=float)
    lat, lon = np.radians(table[:, 1:3]).T
    attitude = np.radians(table[:, 7:10])
    attitude[:, 2] = wrapped(attitude[:, 2], 2.0 * np.pi)
    return Trajectory(
        table[:, 0].copy(), lat, lon, table[:, 3].copy(), table[:, 4:7].copy(), attitude, source=str(path)
    )


def _read_gpx(path: Path) -> Trajectory:
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise InputError(f"{path}: this is no GPX file: {error}") from error
    points = [node for node in root.iter() if _tag(node) == "trkpt"]
    if not points:
        raise InputError(f"{path}: the file has no track points (trkpt)")
    rows = [_track_point(f"{path}, track point {number}", node) for number, node in enumerate(points, 1)]
    if all(row[3] is None for row in rows):
        warnings.warn(f"{path}: the track has no elevations; heights are taken as 0", NavfuseWarning, stacklevel=3)
        rows = [(*row[:3], 0.0) for row in rows]
    for number, row in enumerate(rows, 1):
        if row[3] is None:
            raise InputError(f"{path}, track point {number}: the elevation (ele) is missing; others have one")
    stamps = [row[0] for row in rows]
    time = np.array([(stamp - stamps[0]).total_seconds() for stamp in stamps])
    lat, lon, height = np.array([row[1:] for row in rows], dtype=float).T
    return Trajectory(time, np.radians(lat), np.radians(lon), height.copy(), source=str(path))


def _tag(node: ElementTree.Element) -> str:
    return node.tag.rpartition("}")[2]


def _track_point(where: str, node: ElementTree.Element) -> tuple[datetime, float, float, float | None]:
    """Time, latitude and longitude [deg], elevation [m] or None."""
    texts = {_tag(child): (child.text or "").strip() for child in node}
    lat, lon = _number(node.get("lat")), _number(node.get("lon"))
    if lat is None or lon is None or not (abs(lat) <= 90.0 and abs(lon) <= 360.0):
        raise InputError(f"{where}: latitude and longitude must be numbers of degrees")
    try:
        stamp = datetime.fromisoformat(texts.get("time", ""))
    except ValueError:
        raise InputError(
            f"{where}: the time must be like 2024-05-01T12:00:00Z, not {texts.get('time', '')!r}"
        ) from None
    height = _number(texts.get("ele"))
    if height is None and texts.get("ele"):
        raise InputError(f"{where}: the elevation must be a number of metres, not {texts['ele']!r}")
    return stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC), lat, lon, height
