"""SBET files; the format is described in :mod:`navfuse.io.sbet`, which reads them.

The wander angle is written as zero: the wander frame is then north, west, up, and the platform heading the true
heading, so that programs which ignore the angle read the same. Seconds are those of the GPS week of the first epoch
and go on beyond 604800 at its end, so that they always increase. Acceleration and angular rate are zero where the
track has none.
"""

from __future__ import annotations

import os

import numpy as np

from navfuse.data.export_track import ExportTrack
from navfuse.data.trajectory import wrapped
from navfuse.io.atomic import atomic_file
from navfuse.io.exports.parts import check_parts
from navfuse.io.exports.stamps import needed_epoch
from navfuse.io.gps_time import WEEK

Array = np.ndarray


def write_sbet(path: str | os.PathLike[str], track: ExportTrack) -> None:
    """Write a track as an SBET file; it appears whole or not at all.

    Parameters
    ----------
    path : path-like
        Replaced if it exists.
    track : ExportTrack
        With an epoch, velocity and attitude. The altitude is :meth:`ExportTrack.heights`.

    Raises
    ------
    ConfigError
        If the track has no epoch.
    InputError
        If the track is empty, lacks velocity or attitude, or holds a value that is no number.
    OutputError
        If the file cannot be written.
    """
    check_parts(track, "SBET", ("velocity_n", "attitude"))
    trajectory = track.trajectory
    assert trajectory.velocity_n is not None
    assert trajectory.attitude is not None
    north, east, down = trajectory.velocity_n.T
    roll, pitch, heading = trajectory.attitude.T
    nothing = np.zeros((len(trajectory), 3))
    columns = (
        seconds_of_week(track, "SBET"),
        trajectory.lat,
        trajectory.lon,
        track.heights(),
        north,
        -east,
        -down,
        roll,
        pitch,
        wrapped(heading, 2.0 * np.pi),
        nothing[:, 0],
        *(nothing if track.a_eb_b is None else track.a_eb_b).T,
        *(nothing if track.w_nb_b is None else track.w_nb_b).T,
    )
    write_records(path, columns)


def seconds_of_week(track: ExportTrack, format_name: str) -> Array:
    """GPS seconds (n,) of the week in which the track begins, going on beyond its end.

    Raises
    ------
    ConfigError
        If the track has no epoch.
    """
    seconds = needed_epoch(track, format_name).tow + track.trajectory.time
    return seconds - WEEK * np.floor(seconds[0] / WEEK)


def write_records(path: str | os.PathLike[str], columns: tuple[Array, ...]) -> None:
    """Write columns (n,) as records of doubles; the file appears whole or not at all."""
    with atomic_file(path) as part:
        np.column_stack(columns).astype("<f8").tofile(part)
