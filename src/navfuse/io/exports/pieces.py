"""A track as lines on a map: cut at gaps, and at the meridian of 180 degrees where a format asks for it."""

from __future__ import annotations

import numpy as np

from navfuse.data.export_track import ExportTrack

Array = np.ndarray

CLASSES = (
    ("below 0.1 m", 0.1, "1a9850"),
    ("0.1 to 0.5 m", 0.5, "91cf60"),
    ("0.5 to 2 m", 2.0, "fee08b"),
    ("2 to 10 m", 10.0, "fc8d59"),
    ("10 m and more", np.inf, "d73027"),
)
"""Expected horizontal error (1 sigma): in words, upper bound [m], colour as red, green, blue."""
UNKNOWN = ("expected error unknown", "4575b4")
"""Words and colour where a track has no standard deviations."""


def expected_error(track: ExportTrack) -> Array | None:
    """Horizontal standard deviation (n,) [m], north and east together; None where the track has none."""
    sd = track.trajectory.sd_position
    return None if sd is None else np.hypot(sd[:, 0], sd[:, 1])


def quality(track: ExportTrack) -> Array:
    """Index (n,) into :data:`CLASSES` of each epoch; one past their end where the expected error is not known."""
    error = expected_error(track)
    if error is None:
        return np.full(len(track.trajectory), len(CLASSES))
    return np.searchsorted([bound for _, bound, _ in CLASSES[:-1]], error, side="right")


def gapless(track: ExportTrack) -> list[slice]:
    """Stretches of a track without a gap: none where times are further apart than 1 s and than five usual steps."""
    time = track.trajectory.time
    if time.size < 2:
        return [slice(0, time.size)]
    step = np.diff(time)
    ends = np.flatnonzero(step > max(1.0, 5.0 * float(np.median(step)))) + 1
    return [slice(int(a), int(b)) for a, b in zip(np.append(0, ends), np.append(ends, time.size), strict=True)]


def cut_at_antimeridian(lon: Array, lat: Array, height: Array) -> list[Array]:
    """Lines that do not cross the meridian of 180 degrees.

    Parameters
    ----------
    lon, lat, height : (n,) arrays [deg, deg, m]
        Points of one line, longitude in -180..180. Two neighbours are joined the short way.

    Returns
    -------
    list of (k, 3) arrays
        Longitude, latitude, height. A cut adds a point on the meridian to either side, at +180 and at -180 degrees
        (RFC 7946, section 3.1.9), interpolated along the line. A line along a meridian over a pole is left whole.
    """
    points = np.column_stack((lon, lat, height))
    jump = np.diff(lon)
    pieces, start = [], 0
    head: list[Array] = []
    for k in np.flatnonzero(np.abs(jump) > 180.0).tolist():
        side = 180.0 if lon[k] > 0.0 else -180.0
        beyond = jump[k] + np.copysign(360.0, side)
        part = 0.0 if beyond == 0.0 else (side - lon[k]) / beyond
        crossing = points[k] + part * (points[k + 1] - points[k])
        crossing[0] = side
        pieces.append(np.vstack([*head, points[start : k + 1], crossing]))
        head, start = [crossing * [-1.0, 1.0, 1.0]], k + 1
    return [*pieces, np.vstack([*head, points[start:]])]
