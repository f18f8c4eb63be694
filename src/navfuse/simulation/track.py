"""A motion from a table: positions, and perhaps attitudes, at any rate."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

import numpy as np
from scipy.interpolate import make_lsq_spline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from navfuse.core.earth import geodetic_to_ecef_batch
from navfuse.data.trajectory import Trajectory
from navfuse.errors import ConfigError, InputError
from navfuse.simulation.motion import Motion, MotionState
from navfuse.simulation.places import ellipsoid_normals, middle_map, ned_matrices, plane_coordinates
from navfuse.simulation.rules import (
    PITCH_PER_ACCELERATION,
    ROLL_PER_ACCELERATION,
    coordinated,
    level_axes,
    path_state,
    quaternions,
    thrust_up,
)

Array = np.ndarray
Rule = Literal["car", "aircraft", "drone"]

_DEGREE = 5
_CLOSEST = 0.1
_FINE = 0.1
_SLOW, _FAST = 0.5, 1.5
_USUAL_GAPS = 5.0
_JUMP, _JUMP_ACCELERATION = 3.0, 30.0
_FEWEST = 6
_LARGEST_TURN = 0.5 * math.pi


def follow_track(
    track: Trajectory,
    rule: Rule | None = None,
    *,
    spacing: float | None = None,
    max_gap: float | None = None,
) -> Motion:
    """The smooth motion along a table of positions.

    Parameters
    ----------
    track : Trajectory
        From :func:`~navfuse.simulation.track_files.read_track`; velocities and standard deviations are not used.
    rule : {"car", "aircraft", "drone"} or None
        How the body stands in its path, where the track has no attitude (and instead of it where it has one). None
        takes the attitude of the track.
    spacing : float [s] or None
        Between the knots of the motion. None for 0.1 s or the median interval of the track, whichever is longer.
        Where it holds several rows, the motion is their least-squares fit, which smooths the rounding or the noise
        of the positions; where it holds one, the motion passes through every row. 3 s or more suit GPS fixes.
    max_gap : float [s] or None
        Longest interval between rows that is bridged; None for five times the median.

    Returns
    -------
    Motion
        Over the time of the track; position and attitude four times continuously differentiable, so acceleration and
        angular rate are continuous. :func:`track_residuals` tells how far it is from the rows.

    Raises
    ------
    InputError
        Naming the row from 1: values that are not finite, times that do not increase, a time gap, a jump (a row more
        than 3 m + 30 m/s^2 dt^2 from where the two before lead), a turn of 90 deg or more between rows; fewer than
        six rows; no attitude and no rule; a car, aircraft or drone that hardly moves.
    ConfigError
        For an unknown rule, or a spacing or gap that is not positive.

    Notes
    -----
    Rule "car": along the velocity in pitch and heading, leaning and squatting as :func:`~navfuse.simulation.rules.car`;
    below 1.5 m/s the heading blends into that before and after, and below 0.5 m/s is that alone. Rule "aircraft":
    coordinated. Rule "drone": thrust up, nose along the course as for a car.
    """
    if rule not in (None, "car", "aircraft", "drone"):
        raise ConfigError(f"the rule is 'car', 'aircraft', 'drone' or None, not {rule!r}")
    for name, value in (("spacing", spacing), ("max_gap", max_gap)):
        if value is not None and not 0.0 < value < math.inf:
            raise ConfigError(f"{name} must be positive and finite, not {value!r} s")
    r_e = _checked_positions(track, max_gap)
    time = np.asarray(track.time, dtype=float)
    stride = max(round((spacing or _CLOSEST) / float(np.median(np.diff(time)))), 1)
    if rule is not None:
        return _ruled(_fit(time, r_e, np.tile((1.0, 0.0, 0.0, 0.0), (time.size, 1)), stride), rule, track.source)
    if track.attitude is None:
        raise InputError(f"{track.source}: the track has no attitude; name a rule for it, e.g. 'car'")
    C_nb = Rotation.from_euler("ZYX", np.asarray(track.attitude)[:, ::-1]).as_matrix()
    q_eb = quaternions(ned_matrices(track.lat, track.lon) @ C_nb)
    turn = 2.0 * np.arccos(np.clip(np.abs(np.einsum("ij,ij->i", q_eb[1:], q_eb[:-1])), 0.0, 1.0))
    _refuse(
        turn >= _LARGEST_TURN,
        track,
        lambda k: f"the attitude turns by {math.degrees(turn[k]):.0f} deg from the row before",
    )
    return _fit(time, r_e, q_eb, stride)


def track_residuals(motion: Motion, track: Trajectory) -> Array:
    """Distances (n,) [m] between the rows of a track and the motion made from it."""
    return np.linalg.norm(motion.r_e(track.time) - geodetic_to_ecef_batch(track.lat, track.lon, track.height), axis=1)


def _checked_positions(track: Trajectory, max_gap: float | None) -> Array:
    """Positions in e of a track without gaps and jumps."""
    time, source = np.asarray(track.time, dtype=float), track.source
    if time.size < _FEWEST:
        raise InputError(f"{source}: a motion needs at least {_FEWEST} rows, not {time.size}")
    columns = [time, track.lat, track.lon, track.height, *(() if track.attitude is None else track.attitude.T)]
    bad = np.flatnonzero(~np.isfinite(np.column_stack(columns)).all(axis=1))
    if bad.size:
        raise InputError(f"{source}, row {bad[0] + 1}: time, position and attitude must be finite")
    dt = np.diff(time)
    _refuse(dt <= 0.0, track, lambda k: "the time does not increase; sort the rows, or leave the repeated one out")
    longest = _USUAL_GAPS * float(np.median(dt)) if max_gap is None else max_gap
    _refuse(
        dt > longest * (1.0 + 1e-9),
        track,
        lambda k: (
            f"{dt[k]:.6g} s after the row before, and gaps above {longest:.6g} s are not bridged; cut the track "
            "there, or allow a longer max_gap"
        ),
    )
    r_e = geodetic_to_ecef_batch(track.lat, track.lon, track.height)
    step = np.diff(r_e, axis=0)
    velocity = step / dt[:, None]
    before = np.vstack([velocity[1:2], velocity[:-1]])
    off = np.linalg.norm(step - before * dt[:, None], axis=1)
    _refuse(
        off > _JUMP + _JUMP_ACCELERATION * np.maximum(dt, np.concatenate([dt[1:2], dt[:-1]])) ** 2,
        track,
        lambda k: f"the position jumps: it lies {off[k]:.4g} m from where the rows before lead; leave the row out",
    )
    return r_e


def _refuse(wrong: Array, track: Trajectory, why: Callable[[int], str]) -> None:
    """Refuse the first row k + 1 (from 0) that is `wrong`, an array over the steps from row k."""
    first = np.flatnonzero(wrong)
    if first.size:
        k = int(first[0])
        raise InputError(f"{track.source}, row {k + 2} at {track.time[k + 1]:.9g} s: {why(k)}")


def _fit(time: Array, r_e: Array, q_eb: Array, stride: int) -> Motion:
    """Least-squares quintic spline with a knot at every `stride`-th row; through every row for a stride of 1."""
    intervals = time.size - 1
    if stride == 1 or intervals // stride < 2:
        return Motion.from_knots(time, r_e, q_eb)
    sign = np.where(np.einsum("ij,ij->i", q_eb[1:], q_eb[:-1]) < 0.0, -1.0, 1.0)
    q_eb = q_eb * np.cumprod(np.concatenate([[1.0], sign]))[:, None]
    origin = r_e[0].copy()
    inner = time[np.arange(1, intervals // stride) * stride]
    knots = np.concatenate([[time[0]], inner, [time[-1]]])
    padded = np.concatenate([np.full(_DEGREE, time[0]), knots, np.full(_DEGREE, time[-1])])
    spline = make_lsq_spline(time, np.column_stack([r_e - origin, q_eb]), padded, k=_DEGREE)
    powers = [spline(knots[:-1], nu=power) / math.factorial(power) for power in range(_DEGREE, -1, -1)]
    return Motion(knots, np.ascontiguousarray(np.stack(powers, axis=1)), origin)


def _ruled(path: Motion, rule: Rule, source: str) -> Motion:
    """The path with an attitude by a rule."""
    count = max(math.ceil((path.end - path.start) / _FINE), 5)
    time = np.linspace(path.start, path.end, count + 1)
    state = path_state(time, path.r_e(time))
    trajectory = path.trajectory(time)
    normals = ellipsoid_normals(trajectory.lat, trajectory.lon)
    local = middle_map(normals, float(trajectory.height.mean()))
    if local is None:
        raise InputError(f"{source}: the track spreads over half the Earth; cut it into parts")
    x, y = plane_coordinates(local, normals).T
    north, east, down = level_axes(local, x, y, trajectory.height, np.zeros_like(x))
    v_n, v_e = (np.einsum("ij,ij->i", state.v_e, axis) for axis in (north, east))
    speed = np.hypot(v_n, v_e)
    if rule == "aircraft" and speed.min() < _FAST:
        raise InputError(f"{source}: an aircraft does not fly at {speed.min():.3g} m/s; take another rule")
    if not np.any(speed > _FAST):
        raise InputError(f"{source}: the track is never faster than {_FAST:g} m/s, which leaves its heading open")
    if rule == "aircraft":
        return Motion.from_knots(time, state.r_e, quaternions(coordinated(state)))
    course, trust = _course(np.arctan2(v_e, v_n), speed)
    forward = np.cos(course)[:, None] * north + np.sin(course)[:, None] * east
    if rule == "drone":
        C_eb = thrust_up(state, forward, 0.0)
    else:
        C_eb = _road(state, forward, down, trust, speed)
    return Motion.from_knots(time, state.r_e, quaternions(C_eb))


def _course(direction: Array, speed: Array) -> tuple[Array, Array]:
    """Course [rad], the direction of motion where fast and a blend across slow stretches; and the weight of that."""
    moving = speed > _SLOW
    rows = np.arange(speed.size)
    held = np.interp(rows, rows[moving], np.unwrap(direction[moving]))
    held = gaussian_filter1d(held, 10.0, mode="nearest")
    s = np.clip((speed - _SLOW) / (_FAST - _SLOW), 0.0, 1.0)
    trust = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    difference = np.remainder(direction - held + np.pi, 2.0 * np.pi) - np.pi
    return held + trust * difference, trust


def _road(state: MotionState, forward: Array, down: Array, trust: Array, speed: Array) -> Array:
    """``C_eb`` of a car whose nose points along `forward` and, where trusted, up and down the road."""
    right = np.cross(down, forward)
    sink = np.einsum("ij,ij->i", state.v_e, down)
    climb = -trust * np.arctan2(sink, np.maximum(speed, _SLOW))
    along, across = (np.einsum("ij,ij->i", state.a_e, axis) for axis in (forward, right))
    road = Rotation.from_matrix(np.stack([forward, right, down], axis=2)) * Rotation.from_euler("Y", climb[:, None])
    lean = np.column_stack([-ROLL_PER_ACCELERATION * across, PITCH_PER_ACCELERATION * along])
    return (road * Rotation.from_euler("XY", lean)).as_matrix()
