"""A trajectory between its epochs, in the Earth frame: poles, date line and heading wrap need no special case."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfuse.core.earth import geodetic_to_ecef_batch
from navfuse.core.rotation import quat_from_euler_batch
from navfuse.data.trajectory import Trajectory
from navfuse.errors import InputError

Array = np.ndarray

SMALL_ANGLE = 1e-6


@dataclass(frozen=True, slots=True)
class EarthStates:
    """Positions, velocities and attitudes in ECEF axes at common times.

    Attributes
    ----------
    time : (n,) array [s]
    r_e : (n, 3) array [m]
    v_e : (n, 3) array [m/s] or None
        Velocity relative to the Earth.
    q_eb : (n, 4) array or None
        Body to Earth, Hamilton, scalar first.
    """

    time: Array
    r_e: Array
    v_e: Array | None = None
    q_eb: Array | None = None


def ned_axes(lat: Array, lon: Array) -> Array:
    """Direction cosines C_en (n, 3, 3): columns are north, east and down in ECEF; (n,) radians in."""
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    north = np.stack((-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat), axis=-1)
    east = np.stack((-sin_lon, cos_lon, np.zeros_like(lon)), axis=-1)
    down = np.stack((-cos_lat * cos_lon, -cos_lat * sin_lon, -sin_lat), axis=-1)
    return np.stack((north, east, down), axis=-1)


def ned_quaternion(lat: Array, lon: Array) -> Array:
    """Quaternion q_en (n, 4) of :func:`ned_axes`: turn by lon about z, then by -(lat + 90 deg) about y."""
    half_lon, half_tilt = 0.5 * lon, -0.5 * (lat + 0.5 * np.pi)
    cos_lon, sin_lon, cos_tilt, sin_tilt = np.cos(half_lon), np.sin(half_lon), np.cos(half_tilt), np.sin(half_tilt)
    return np.stack((cos_lon * cos_tilt, -sin_lon * sin_tilt, cos_lon * sin_tilt, sin_lon * cos_tilt), axis=-1)


def multiply(p: Array, q: Array) -> Array:
    """Hamilton products p[k] q[k] of scalar-first quaternions (n, 4)."""
    pw, px, py, pz = p.T
    qw, qx, qy, qz = q.T
    return np.stack(
        (
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ),
        axis=-1,
    )


def conjugate(q: Array) -> Array:
    """Inverse rotations of unit quaternions (n, 4)."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def earth_states(trajectory: Trajectory) -> EarthStates:
    """Position, velocity and attitude of a trajectory in ECEF axes, at its own epochs."""
    geodetic = (np.ascontiguousarray(array) for array in (trajectory.lat, trajectory.lon, trajectory.height))
    r_e = geodetic_to_ecef_batch(*geodetic)
    v_e = q_eb = None
    if trajectory.velocity_n is not None:
        v_e = np.einsum("nij,nj->ni", ned_axes(trajectory.lat, trajectory.lon), trajectory.velocity_n)
    if trajectory.attitude is not None:
        q_nb = quat_from_euler_batch(np.ascontiguousarray(trajectory.attitude))
        q_eb = multiply(ned_quaternion(trajectory.lat, trajectory.lon), q_nb)
    return EarthStates(trajectory.time, r_e, v_e, q_eb)


def covered(epochs: Array, time: Array, max_gap_s: float | None = None) -> Array:
    """Which times can be interpolated from the epochs: inside their span and not inside a gap.

    Parameters
    ----------
    epochs : (m,) array [s]
        Strictly increasing.
    time : (n,) array [s]
    max_gap_s : float [s], optional
        Longest interval between epochs that is bridged; default the larger of 1 s and five median intervals.

    Returns
    -------
    (n,) bool array
        True where interpolation is meaningful; an epoch itself always is.
    """
    intervals = np.diff(epochs)
    limit = longest_bridged(epochs) if max_gap_s is None else max_gap_s
    left = _left(epochs, time)
    at_epoch = (time == epochs[left]) | (time == epochs[left + 1])
    return (time >= epochs[0]) & (time <= epochs[-1]) & (at_epoch | (intervals[left] <= limit))


def longest_bridged(epochs: Array) -> float:
    """Longest interval [s] between epochs (m,) that is no gap: the larger of 1 s and five median intervals."""
    return max(1.0, 5.0 * float(np.median(np.diff(epochs))))


def interpolate(states: EarthStates, time: Array) -> EarthStates:
    """States at other times within the span of their epochs.

    Position is a cubic Hermite polynomial when there are velocities, else a straight line; velocity is linear;
    attitude turns at a constant rate between epochs (slerp). The Hermite error is below a dt^4 / 384, with a the
    second derivative of the acceleration: micrometres for a car at 10 Hz.

    Parameters
    ----------
    states : EarthStates
        At least two epochs.
    time : (n,) array [s]
        Inside the span; :func:`covered` tells.
    """
    left = _left(states.time, time)
    right = left + 1
    step = states.time[right] - states.time[left]
    s = ((time - states.time[left]) / step)[:, np.newaxis]
    if states.v_e is None:
        r_e = states.r_e[left] + s * (states.r_e[right] - states.r_e[left])
        v_e = None
    else:
        r_e = _hermite(states.r_e[left], states.r_e[right], states.v_e[left], states.v_e[right], s, step[:, np.newaxis])
        v_e = states.v_e[left] + s * (states.v_e[right] - states.v_e[left])
    q_eb = None if states.q_eb is None else _slerp(states.q_eb[left], states.q_eb[right], s)
    return EarthStates(time, r_e, v_e, q_eb)


def interpolate_linear(epochs: Array, values: Array, time: Array) -> Array:
    """Columns of (m, k) values, linearly at other times inside the span of the epochs."""
    left = _left(epochs, time)
    s = ((time - epochs[left]) / (epochs[left + 1] - epochs[left]))[:, np.newaxis]
    return values[left] + s * (values[left + 1] - values[left])


def check_epochs(trajectory: Trajectory) -> None:
    """Refuse a trajectory that cannot be interpolated: fewer than two epochs, or time that does not increase."""
    if len(trajectory) < 2:
        raise InputError(f"{trajectory.source}: {len(trajectory)} epochs; a comparison needs at least two")
    back = np.flatnonzero(~(np.diff(trajectory.time) > 0.0))
    if back.size:
        row = int(back[0]) + 1
        raise InputError(
            f"{trajectory.source}: time does not increase at row {row} "
            f"({trajectory.time[row - 1]:.6f} -> {trajectory.time[row]:.6f} s); sort it and drop duplicates"
        )


def _left(epochs: Array, time: Array) -> Array:
    return np.clip(np.searchsorted(epochs, time, side="right") - 1, 0, epochs.size - 2)


def _hermite(r0: Array, r1: Array, v0: Array, v1: Array, s: Array, step: Array) -> Array:
    chord = r1 - r0
    a = step * v0 - chord
    b = chord - step * v1
    return r0 + s * chord + s * (1.0 - s) * (a * (1.0 - s) + b * s)


def _slerp(q0: Array, q1: Array, s: Array) -> Array:
    delta = multiply(conjugate(q0), q1)
    delta *= np.where(delta[:, :1] < 0.0, -1.0, 1.0)
    sine = np.linalg.norm(delta[:, 1:], axis=1, keepdims=True)
    half = np.arctan2(sine, delta[:, :1])
    small = half < SMALL_ANGLE
    gain = np.where(small, s, np.sin(s * half) / np.where(small, 1.0, sine))
    q = multiply(q0, np.hstack((np.cos(s * half), gain * delta[:, 1:])))
    return q / np.linalg.norm(q, axis=1, keepdims=True)
