"""Poses in a local metric frame, as TUM and KITTI files hold them.

A pose is the matrix that takes coordinates of the body to the frame of the file. The local frame is a plane at the
first epoch, not a map: positions are ECEF differences from the first one turned to its east, north, up, so that
distances and angles stay true over any length; a level body 10 km away leans by 0.09 deg against it, as it does on the
Earth.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from navfuse.data.export_track import ExportTrack

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Array = np.ndarray
World = Literal["enu", "ned", "first"]
Body = Literal["flu", "frd", "rdf"]

NED_TO_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
BODY_AXES = {
    "frd": np.eye(3),
    "flu": np.diag([1.0, -1.0, -1.0]),
    "rdf": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
}
"""Matrix whose columns are the axes of the name, in forward, right, down."""


def local_poses(track: ExportTrack, world: World, body: Body) -> tuple[Array, Rotation]:
    """Positions and orientations against the first epoch.

    Parameters
    ----------
    track : ExportTrack
        With an attitude. Heights are ellipsoidal whatever :attr:`ExportTrack.height` says: a local frame has no geoid.
    world : {"enu", "ned", "first"}
        East, north, up or north, east, down of the first position; or the body axes of the first epoch, which makes the
        first pose the identity.
    body : {"flu", "frd", "rdf"}
        Axes of the body: forward, left, up (as in ROS, REP 103); forward, right, down (as everywhere else here); right,
        down, forward (those of a camera that looks ahead).

    Returns
    -------
    position : (n, 3) array [m]
        In the world frame; the first is zero.
    orientation : Rotation of length n
        Takes vectors of the body axes to the world frame.
    """
    from scipy.spatial.transform import Rotation

    from navfuse.core.earth import geodetic_to_ecef_batch

    trajectory = track.trajectory
    assert trajectory.attitude is not None
    lat, lon, attitude = trajectory.lat, trajectory.lon, trajectory.attitude
    r_e = geodetic_to_ecef_batch(*(np.ascontiguousarray(part) for part in (lat, lon, trajectory.height)))
    C_en = Rotation.from_euler("ZY", np.column_stack([lon, -lat - 0.5 * np.pi]))
    C_nb = Rotation.from_euler("ZYX", attitude[:, ::-1])
    C_eb = C_en * C_nb * Rotation.from_matrix(BODY_AXES[body])
    if world == "first":
        to_world = C_eb[0].inv()
    else:
        to_world = Rotation.from_matrix(NED_TO_ENU if world == "enu" else np.eye(3)) * C_en[0].inv()
    return to_world.apply(r_e - r_e[0]), to_world * C_eb
