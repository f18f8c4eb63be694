"""SMRMSG, the accuracy file beside an SBET; the format is described in :mod:`navfuse.io.sbet`, which reads it."""

from __future__ import annotations

import os

import numpy as np

from navfuse.data.export_track import ExportTrack
from navfuse.io.exports.parts import check_parts
from navfuse.io.exports.sbet import seconds_of_week, write_records
from navfuse.io.sbet import ARCMIN


def write_smrmsg(path: str | os.PathLike[str], track: ExportTrack) -> None:
    """Write the standard deviations of a track as an SMRMSG file; it appears whole or not at all.

    Parameters
    ----------
    path : path-like
        Replaced if it exists.
    track : ExportTrack
        With an epoch and all standard deviations.

    Raises
    ------
    ConfigError
        If the track has no epoch.
    InputError
        If the track is empty, lacks standard deviations, or holds a value that is no number.
    OutputError
        If the file cannot be written.
    """
    check_parts(track, "SMRMSG", ("sd_position", "sd_velocity", "sd_attitude"))
    trajectory = track.trajectory
    assert trajectory.sd_position is not None
    assert trajectory.sd_velocity is not None
    assert trajectory.sd_attitude is not None
    sd = (trajectory.sd_position, trajectory.sd_velocity, trajectory.sd_attitude / ARCMIN)
    write_records(path, (seconds_of_week(track, "SMRMSG"), *np.hstack(sd).T))
