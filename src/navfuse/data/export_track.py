"""A trajectory as it leaves for another program: of a point of the vehicle, at chosen times, with what formats ask."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.trajectory import Trajectory

Array = np.ndarray


@dataclass(frozen=True, slots=True)
class ExportTrack:
    """What an exporter writes.

    Attributes
    ----------
    trajectory : Trajectory
        Of the exported point, at the exported times; velocity that of the point, attitude that of the body.
    name : str
        Of the track, for formats that show one; text, never markup.
    point : str
        Which point of the vehicle, in words, e.g. "IMU" or "antenna".
    epoch : GpsEpoch or None
        GPS time from which ``trajectory.time`` counts; None where nobody said.
    undulation : (n,) array [m] or None
        Geoid above the ellipsoid; None where it was not asked for. Ellipsoidal minus undulation is the height above
        the geoid.
    height : {"ellipsoid", "geoid"}
        Which height the formats write that have room for one only.
    fix : (n,) array of str or None
        Fix type of the GNSS used last at each epoch, "none" where there was none within the last seconds.
    n_satellites : (n,) int array or None
    labels : (n,) array of str or None
        Name of each epoch where the times are events, e.g. a camera's picture.
    a_eb_b : (n, 3) array [m/s^2] or None
        Acceleration of the vehicle relative to the Earth, body axes, for formats that carry it.
    w_nb_b : (n, 3) array [rad/s] or None
        Angular rate of the body against the local level axes, body axes.
    """

    trajectory: Trajectory
    name: str = "navfuse"
    point: str = "IMU"
    epoch: GpsEpoch | None = None
    undulation: Array | None = None
    height: str = "ellipsoid"
    fix: Array | None = None
    n_satellites: Array | None = None
    labels: Array | None = None
    a_eb_b: Array | None = None
    w_nb_b: Array | None = None

    def heights(self) -> Array:
        """Heights (n,) [m] above what :attr:`height` says."""
        if self.height == "geoid" and self.undulation is not None:
            return self.trajectory.height - self.undulation
        return self.trajectory.height
