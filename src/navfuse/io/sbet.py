"""SBET: the smoothed best estimate of trajectory of Applanix POSPac, and its accuracy file SMRMSG.

A file is nothing but records of little-endian doubles, without a header: 17 in an SBET (:data:`SBET`), 10 in an SMRMSG
(:data:`SMRMSG`), in the order of Applanix's POSPac Land quick start guide, table 4.

* Time: seconds of the GPS week in which the file begins; which week it was is not in the file. At the week's end they
  go on beyond 604800, or begin anew at zero: files of both kinds are met, and both are read.
* Latitude, longitude [rad], altitude [m] above the ellipsoid.
* Velocity [m/s] in the wander frame: level, z up, x at the azimuth minus the wander angle, y to the left of x. With the
  wander angle a: north = x cos a - y sin a, east = -x sin a - y cos a, down = -z.
* Roll, pitch, platform heading, wander angle [rad]: heading (true) = platform heading - wander angle. Roll, pitch and
  heading turn north-east-down to forward-right-down, as here.
* Acceleration [m/s^2] and angular rate [rad/s] of the body, forward-right-down; gravity and the turning of the Earth
  are taken out.

The signs are those of Applanix's text on its "standard navigation record", as programs that read it quote it, and they
hold on a real file of POSPac (two records of which PDAL's unit test of its SBET reader lists): the positions move with
the velocity decoded this way, and the attitude turns with the angular rates. Other programs write north, east, down or
east, north, up into the three velocities, and nothing in a file tells; a comparison with a truth does.

SMRMSG: time as above, standard deviations of position [m] and velocity [m/s] north, east, down, of roll, pitch and
heading in arc minutes.
"""

from __future__ import annotations

import os
import warnings

import numpy as np

from navfuse.data.trajectory import Trajectory, wrapped
from navfuse.errors import InputError, NavfuseWarning
from navfuse.io.gps_time import WEEK
from navfuse.io.tables import check_file

Array = np.ndarray

SBET = np.dtype(
    [
        (name, "<f8")
        for name in (
            "time", "lat", "lon", "height", "vx", "vy", "vz", "roll", "pitch", "platform_heading", "wander",
            "ax", "ay", "az", "wx", "wy", "wz",
        )
    ]
)  # fmt: skip
"""A record of an SBET file."""
SMRMSG = np.dtype(
    [
        (name, "<f8")
        for name in (
            "time", "sd_north", "sd_east", "sd_down", "sd_vn", "sd_ve", "sd_vd", "sd_roll", "sd_pitch", "sd_heading",
        )
    ]
)  # fmt: skip
"""A record of an SMRMSG file."""
ARCMIN = np.pi / 10800.0
EXTENSIONS = (".sbet", ".out")
"""Of files that are taken for SBET; POSPac's own are ``sbet_*.out``."""

_RANGES = {"lat": 0.5 * np.pi, "lon": 2.0 * np.pi, "height": 1e7, "roll": np.pi, "pitch": 0.5 * np.pi}
_RANGES |= {"vx": 2e4, "vy": 2e4, "vz": 2e4, "platform_heading": 4.0 * np.pi, "wander": 4.0 * np.pi}
_SLACK = 1e-9
_LONGEST, _SHORTEST = 1e8, 1e-100
"""Seconds that no time of a file is beyond or, unless it is zero, below; doubles with their bytes reversed are."""


def read_sbet(path: str | os.PathLike[str], smrmsg: str | os.PathLike[str] | None = None) -> Trajectory:
    """Read an SBET file as a trajectory.

    Parameters
    ----------
    path : path-like
        A ``.sbet`` or ``.out`` file.
    smrmsg : path-like, optional
        Its accuracy file, for the standard deviations. It has fewer records; they are interpolated to the times of the
        SBET, and held before its first and after its last.

    Returns
    -------
    Trajectory
        Times are GPS seconds of the week in which the file begins. Longitude in -pi..pi, heading in 0..2 pi.

    Raises
    ------
    InputError
        If a file is not one of whole records, or holds what cannot be: it is then not SBET, or damaged.

    Warns
    -----
    NavfuseWarning
        If the times begin anew at the week's end instead of going on; a week is then added.
    """
    path = check_file(path, EXTENSIONS)
    source = str(path)
    records = _records(path, SBET, "SBET")
    time = _times(records["time"], source)
    for name, limit in _RANGES.items():
        flawed = np.abs(records[name]) > limit + _SLACK
        if flawed.any():
            row = int(np.argmax(flawed))
            raise InputError(
                f"{source}: record {row + 1}: {name} = {records[name][row]:g} cannot be (radians, metres, m/s);"
                " is this a POSPac SBET file?"
            )
    sin, cos = np.sin(records["wander"]), np.cos(records["wander"])
    x, y = records["vx"], records["vy"]
    lon = wrapped(records["lon"] + np.pi, 2.0 * np.pi) - np.pi
    sd = {} if smrmsg is None else _accuracies(smrmsg, time)
    return Trajectory(
        time=time,
        lat=np.clip(records["lat"], -0.5 * np.pi, 0.5 * np.pi),
        lon=np.where(np.abs(records["lon"]) <= np.pi, records["lon"], lon),
        height=records["height"].copy(),
        velocity_n=np.column_stack([x * cos - y * sin, -x * sin - y * cos, -records["vz"]]),
        attitude=np.column_stack(
            [
                records["roll"],
                records["pitch"],
                wrapped(records["platform_heading"] - records["wander"], 2.0 * np.pi),
            ]
        ),
        **sd,
        source=source,
    )


def _accuracies(path: str | os.PathLike[str], time: Array) -> dict[str, Array]:
    """Standard deviations of an SMRMSG file at the times of the SBET, by attribute of a trajectory."""
    path = check_file(path, (*EXTENSIONS, ".smrmsg"))
    records = _records(path, SMRMSG, "SMRMSG")
    known = _times(records["time"], str(path))
    if known[-1] < time[0] or known[0] > time[-1]:
        raise InputError(
            f"{path}: holds {known[0]:.3f} to {known[-1]:.3f} s, and the SBET {time[0]:.3f} to {time[-1]:.3f} s; they"
            " do not belong together"
        )
    names = SMRMSG.names or ()
    values = {name: np.interp(time, known, records[name]) for name in names[1:]}
    for name, column in values.items():
        if (column < 0.0).any():
            raise InputError(f"{path}: {name} is negative; is this a POSPac SMRMSG file?")
    columns = list(values.values())
    return {
        "sd_position": np.column_stack(columns[:3]),
        "sd_velocity": np.column_stack(columns[3:6]),
        "sd_attitude": np.column_stack(columns[6:]) * ARCMIN,
    }


def _records(path: os.PathLike[str], record: np.dtype, kind: str) -> Array:
    size = os.stat(path).st_size
    if size % record.itemsize:
        raise InputError(
            f"{path}: {size} bytes are not whole {kind} records of {record.itemsize} bytes; is it another format,"
            " or cut off?"
        )
    records = np.fromfile(path, dtype=record)
    values = records.view("<f8").reshape(records.size, -1)
    flawed = ~np.isfinite(values).all(axis=1)
    if flawed.any():
        row = int(np.argmax(flawed))
        raise InputError(
            f"{path}: record {row + 1} holds a value that is no number, {np.count_nonzero(flawed)} records do; is this"
            f" a {kind} file, little-endian?"
        )
    return records


def _times(time: Array, source: str) -> Array:
    """Times that go on across the week's end, increasing strictly; they tell best whether the bytes are in order."""
    flawed = (np.abs(time) > _LONGEST) | ((time != 0.0) & (np.abs(time) < _SHORTEST))
    if flawed.any():
        row = int(np.argmax(flawed))
        raise InputError(
            f"{source}: record {row + 1}: the time {time[row]:g} s cannot be; is this a POSPac file of little-endian"
            " doubles?"
        )
    step = np.diff(time)
    anew = (step < -0.5 * WEEK) & (step > -1.5 * WEEK)
    if anew.any():
        warnings.warn(
            f"{source}: the seconds of week begin anew at record {int(np.argmax(anew)) + 2}; a week was added from"
            " there",
            NavfuseWarning,
            stacklevel=4,
        )
    time = time + WEEK * np.concatenate([[0], np.cumsum(anew)])
    back = np.flatnonzero(~(np.diff(time) > 0.0))
    if back.size:
        row = int(back[0]) + 1
        raise InputError(
            f"{source}: record {row + 1}: the time {time[row]:.6f} s does not follow {time[row - 1]:.6f} s,"
            f" {back.size} records are so; sort them, or is this another format?"
        )
    return time
