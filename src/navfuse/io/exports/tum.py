"""TUM trajectories: ``timestamp tx ty tz qx qy qz qw`` in each line, as evo and the TUM RGB-D benchmark read them.

By default the world is east, north, up of the first position, in metres, and the body forward, left, up: what ROS calls
``map`` and ``base_link`` (REP 103, REP 105), so that the unit quaternion is a level body that looks east, and a turn to
the left is positive about z. A comment at the head of the file says which frames and which time it holds. The
quaternion (Hamilton, scalar last) takes vectors of the body to the world; its sign is chosen so that consecutive ones
do not jump, qw >= 0 at first.

The time is a column of seconds that evo matches with those of another file. By default it is the time of the log as it
stands, which needs no epoch and fits other files of the same log; "gps" counts from 1980-01-06 without leap seconds,
"unix" is POSIX time, as in ROS messages, where a leap second has the stamps of the second after it again.

Source: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats.
"""

from __future__ import annotations

import os
from typing import Literal

import numpy as np

from navfuse.data.export_track import ExportTrack
from navfuse.io.atomic import atomic_file
from navfuse.io.exports.local_poses import Body, World, local_poses
from navfuse.io.exports.parts import check_parts
from navfuse.io.exports.stamps import gps_ticks
from navfuse.io.gps_time import DAY, utc_of_gps

Array = np.ndarray

_UNIX_DAYS = 3657
"""Days from 1970-01-01 to 1980-01-06."""


def write_tum(
    path: str | os.PathLike[str],
    track: ExportTrack,
    *,
    world: World = "enu",
    body: Body = "flu",
    time: Literal["log", "gps", "unix"] = "log",
) -> None:
    """Write a track as a TUM trajectory; the file appears whole or not at all.

    Parameters
    ----------
    path : path-like
        Replaced if it exists.
    track : ExportTrack
        With an attitude, and with an epoch unless the time is that of the log.
    world, body : str
        Frames, see :func:`navfuse.io.exports.local_poses.local_poses`.
    time : {"log", "gps", "unix"}
        What the first column counts.

    Raises
    ------
    ConfigError
        If the track has no epoch and the time asks for one.
    InputError
        If the track is empty, lacks an attitude, or holds a value that is no number.
    OutputError
        If the file cannot be written.
    """
    check_parts(track, "TUM", ("attitude",))
    stamps = _stamps(track, time)
    position, orientation = local_poses(track, world, body)
    rows = np.column_stack([position, continuous(orientation.as_quat())]) + 0.0
    lines = [
        f"# world {world}, body {body}, time {time}, point: {' '.join(track.point.split())}",
        "# timestamp tx ty tz qx qy qz qw",
    ]
    template = "%s %.6f %.6f %.6f %.9f %.9f %.9f %.9f"
    lines += [template % (stamp, *row) for stamp, row in zip(stamps, rows.tolist(), strict=True)]
    with atomic_file(path) as part:
        part.write_bytes(("\n".join(lines) + "\n").encode())


def continuous(quaternions: Array) -> Array:
    """Quaternions (n, 4), scalar last, with signs that do not jump; the first has a scalar part >= 0."""
    dot = np.sum(quaternions[1:] * quaternions[:-1], axis=1)
    first = -1.0 if quaternions[0, 3] < 0.0 else 1.0
    return quaternions * np.cumprod(np.concatenate([[first], np.where(dot < 0.0, -1.0, 1.0)]))[:, None]


def _stamps(track: ExportTrack, time: str) -> list[str]:
    if time == "log":
        return [f"{value:.6f}" for value in track.trajectory.time.tolist()]
    ticks, _ = gps_ticks(track, f"a TUM file with time {time}", 6)
    if time == "unix":
        days, ticks_of_day = utc_of_gps(ticks, 10**6)
        ticks = (days + _UNIX_DAYS) * int(DAY) * 10**6 + ticks_of_day
    return [f"{tick // 10**6}.{tick % 10**6:06d}" for tick in ticks.tolist()]
