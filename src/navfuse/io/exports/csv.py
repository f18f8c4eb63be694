"""The native CSV table of a trajectory, with what an export adds: names, dates, heights above the geoid, fixes.

``height_m`` stays the ellipsoidal height, whatever is asked for, so that navfuse can read the table; the height above
the geoid stands beside it.
"""

from __future__ import annotations

import os

from navfuse.data.export_track import ExportTrack
from navfuse.io.exports.parts import check_parts
from navfuse.io.exports.text import iso_stamps
from navfuse.io.tables import write_table


def write_csv(path: str | os.PathLike[str], track: ExportTrack) -> None:
    """Write a track as CSV; the file appears whole or not at all.

    Parameters
    ----------
    path : path-like
        Ends in ``.csv``; replaced if it exists.
    track : ExportTrack
        With an epoch for the column ``utc``, which is left out otherwise.

    Raises
    ------
    InputError
        If the track is empty or holds a value that is no number.
    OutputError
        If the file cannot be written.
    """
    check_parts(track, "CSV")
    columns = track.trajectory.to_columns()
    if track.undulation is not None:
        columns |= {"undulation_m": track.undulation, "above_geoid_m": track.trajectory.height - track.undulation}
    stamps = None if track.epoch is None else iso_stamps(track, "CSV")
    extra = {"label": track.labels, "utc": stamps, "fix": track.fix, "n_satellites": track.n_satellites}
    write_table(path, columns | {name: values for name, values in extra.items() if values is not None})
