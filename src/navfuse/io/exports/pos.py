"""RTKLIB solution files (``.pos``): latitude, longitude, height.

As RTKLIB 2.4.3 writes them (``outsolheads`` and ``outpos`` in its ``solution.c``; manual 2.4.2, appendix B.1), so that
RTKPLOT and whatever else reads ``.pos`` takes them, :func:`navfuse.read_gnss` too:

* times: date and time of day in GPS time (no leap seconds), milliseconds; microseconds where a stamp needs them;
* latitude and longitude in decimal degrees (nine decimals, 0.1 mm), height in metres, ellipsoidal or above the geoid
  as the header says;
* Q: 1 fixed, 2 float, 3 SBAS, 4 DGPS, 5 single, 6 PPP, and 7 dead reckoning where no fix was near; 5 where nobody said.
  :func:`navfuse.read_gnss` leaves out 7, since that is no fix. ns is 0 where unknown;
* sdn, sde, sdu in metres; sdne, sdeu, sdun would be sign(c) sqrt(abs(c)) of the covariance c of north and east, east
  and up, up and north. A trajectory holds no covariances: they are 0, as are standard deviations that it lacks,
  RTKLIB's own sign for unknown. One below the last decimal is written as that, for none to read as unknown;
* age and ratio: 0;
* with a velocity, vn, ve, vu in m/s (up is minus down) and their standard deviations likewise.

Attitude has no place in this format.
"""

from __future__ import annotations

import os

import numpy as np

from navfuse.data.export_track import ExportTrack
from navfuse.io.atomic import atomic_file
from navfuse.io.exports.parts import check_parts, fix_codes
from navfuse.io.exports.stamps import clocks, dates, gps_ticks
from navfuse.io.gps_time import DAY
from navfuse.io.rtklib_pos import FIX_NAMES

Array = np.ndarray

QUALITY = {name: code for code, name in FIX_NAMES.items() if code} | {"none": 7}
"""Fix type -> RTKLIB's Q; a track's "none" is dead reckoning."""
_SINGLE = 5

_POSITION = "%14.9f %14.9f %10.4f %3d %3d %8.4f %8.4f %8.4f   0.0000   0.0000   0.0000   0.00    0.0"
_POSITION_NAMES = (
    " latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)"
    "  ratio"
)
_VELOCITY = " %10.5f %10.5f %10.5f %9.5f %8.5f %8.5f  0.00000  0.00000  0.00000"
_VELOCITY_NAMES = "    vn(m/s)    ve(m/s)    vu(m/s)      sdvn     sdve     sdvu    sdvne    sdveu    sdvun"


def write_pos(path: str | os.PathLike[str], track: ExportTrack) -> None:
    """Write a track as an RTKLIB solution file; it appears whole or not at all.

    Parameters
    ----------
    path : path-like
        Replaced if it exists.
    track : ExportTrack
        With an epoch.

    Raises
    ------
    ConfigError
        If the track has no epoch.
    InputError
        If the track is empty or holds a value that is no number.
    OutputError
        If the file cannot be written.
    """
    from navfuse import __version__

    check_parts(track, "a .pos file")
    trajectory = track.trajectory
    ticks, decimals = gps_ticks(track, "a .pos file", 3)
    days, ticks_of_day = np.divmod(ticks, int(DAY) * 10**decimals)
    count = len(trajectory)
    satellites = np.zeros(count, dtype=int) if track.n_satellites is None else np.maximum(track.n_satellites, 0)
    columns = [
        np.degrees(trajectory.lat),
        np.degrees(trajectory.lon),
        track.heights(),
        fix_codes(track, QUALITY, _SINGLE),
        satellites,
        *_triad(trajectory.sd_position, count, 1e-4),
    ]
    template, names = _POSITION, _POSITION_NAMES
    if trajectory.velocity_n is not None:
        velocity = trajectory.velocity_n * (1.0, 1.0, -1.0) + 0.0
        columns += [*velocity.T, *_triad(trajectory.sd_velocity, count, 1e-5)]
        template, names = _POSITION + _VELOCITY, _POSITION_NAMES + _VELOCITY_NAMES
    stamps = [
        f"{day.replace('-', '/')} {clock} "
        for day, clock in zip(dates(days), clocks(ticks_of_day, decimals, ":"), strict=True)
    ]
    height = "geodetic" if track.height == "geoid" and track.undulation is not None else "ellipsoidal"
    lines = [
        f"% program   : navfuse {__version__}",
        f"% point     : {' '.join(track.point.split())}",
        "%",
        f"% (lat/lon/height=WGS84/{height},Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)",
        f"%  {'GPST':<{17 + decimals}} {names}",
    ]
    rows = zip(*(column.tolist() for column in columns), strict=True)
    lines += [stamp + template % row for stamp, row in zip(stamps, rows, strict=True)]
    with atomic_file(path) as part:
        part.write_bytes(("\n".join(lines) + "\n").encode())


def _triad(sd: Array | None, count: int, least: float) -> Array:
    return np.zeros((3, count)) if sd is None else np.where(sd > 0.0, np.maximum(sd, least), 0.0).T
