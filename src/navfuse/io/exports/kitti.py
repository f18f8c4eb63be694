"""KITTI odometry poses: twelve numbers in each line, the upper three rows of a 4 x 4 matrix, row by row.

The benchmark's poses take points of the left camera (x right, y down, z forward) to that camera at the first image; its
evaluation draws x and z as the plane of the road. By default a file is made the same way: axes right, down, forward
of the exported point, against those of the first epoch, so that the first line is the identity. It is the pose of the
exported point, not of a camera: where the camera sits and looks in the body is for who uses the file. evo reads either.

The file has no times; lines are the epochs in their order. Ten significant digits keep 0.1 mm up to 100 km.

Source: readme of the KITTI odometry development kit (Geiger, Lenz, Urtasun 2012).
"""

from __future__ import annotations

import os

import numpy as np

from navfuse.data.export_track import ExportTrack
from navfuse.io.atomic import atomic_file
from navfuse.io.exports.local_poses import Body, World, local_poses
from navfuse.io.exports.parts import check_parts


def write_kitti(
    path: str | os.PathLike[str], track: ExportTrack, *, world: World = "first", body: Body = "rdf"
) -> None:
    """Write a track as KITTI odometry poses; the file appears whole or not at all.

    Parameters
    ----------
    path : path-like
        Replaced if it exists.
    track : ExportTrack
        With an attitude.
    world, body : str
        Frames, see :func:`navfuse.io.exports.local_poses.local_poses`.

    Raises
    ------
    InputError
        If the track is empty, lacks an attitude, or holds a value that is no number.
    OutputError
        If the file cannot be written.
    """
    check_parts(track, "KITTI poses", ("attitude",))
    position, orientation = local_poses(track, world, body)
    poses = np.concatenate([orientation.as_matrix(), position[:, :, None]], axis=2).reshape(-1, 12) + 0.0
    template = " ".join(["%.9e"] * 12)
    lines = [template % tuple(row) for row in poses.tolist()]
    with atomic_file(path) as part:
        part.write_bytes(("\n".join(lines) + "\n").encode("ascii"))
