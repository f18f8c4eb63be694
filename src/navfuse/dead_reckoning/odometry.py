"""A track by dead reckoning: positions summed up from what a vehicle travelled, exactly on the ellipsoid.

Speeds and headings come as samples (valid at their stamp) or as what was travelled and turned over the interval that
ends at the stamp, as encoders and integrating gyros count it. Samples are integrated by the trapezoidal rule, intervals
as arcs of circles; both are of second order in the interval.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from navfuse.core.constants import TWO_PI
from navfuse.core.earth import radii
from navfuse.core.fused import fused
from navfuse.data.aiding_logs import BodyVelocityLog, HeadingLog, OdometerLog
from navfuse.data.trajectory import Trajectory, wrapped
from navfuse.errors import InputError

Array = np.ndarray


@dataclass(frozen=True, slots=True)
class StartPoint:
    """Where a dead-reckoned track begins.

    Attributes
    ----------
    lat, lon, height : float [rad, rad, m]
        Geodetic position on WGS 84.
    heading : float [rad]
        Needed where only turns are measured; clockwise from true north.
    """

    lat: float
    lon: float
    height: float
    heading: float = 0.0

    def __post_init__(self) -> None:
        values = np.array([self.lat, self.lon, self.height, self.heading])
        if not np.isfinite(values).all() or abs(self.lat) >= 0.5 * np.pi:
            raise InputError(
                f"a track cannot start at latitude {np.degrees(self.lat):g} deg, longitude {np.degrees(self.lon):g} "
                f"deg, height {self.height:g} m, heading {np.degrees(self.heading):g} deg"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """What a vehicle travelled and turned between epochs.

    Attributes
    ----------
    time : (n + 1,) array [s]
        Strictly increasing; step k leads from ``time[k]`` to ``time[k + 1]``.
    distance : (n,) array [m]
        Along the vehicle's own axis, negative in reverse.
    turn : (n,) array [rad]
        Clockwise from above.
    source : str
    """

    time: Array
    distance: Array
    turn: Array
    source: str = "steps"

    def __post_init__(self) -> None:
        n = self.time.size - 1
        if n < 1 or self.distance.shape != (n,) or self.turn.shape != (n,):
            raise InputError(
                f"{self.source}: {self.time.size} times need one distance and one turn less, at least one; there are "
                f"{self.distance.size} and {self.turn.size}"
            )
        bad = ~(np.isfinite(self.distance) & np.isfinite(self.turn) & (np.diff(self.time) > 0.0))
        if bad.any():
            k = int(np.flatnonzero(bad)[0])
            raise InputError(
                f"{self.source}: step {k + 1}, at {self.time[k + 1]:.3f} s, is not finite or not later than the last"
            )


def from_speed_and_heading(odometer: OdometerLog, heading: HeadingLog, start: StartPoint) -> Trajectory:
    """Track of a vehicle that moves where it heads, from samples of speed and heading.

    Parameters
    ----------
    odometer : OdometerLog
    heading : HeadingLog
        Interpolated to the times of the odometer. Headings against true north.
    start : StartPoint
        At the first speed inside the heading log; its heading is not used.

    Returns
    -------
    Trajectory
        At the speeds that lie inside the heading log; level.

    Raises
    ------
    InputError
        If fewer than two do.
    """
    time, psi, inside = _headings_at(odometer.time, heading, odometer.source)
    speed = odometer.speed[inside]
    velocity = np.column_stack((speed * np.cos(psi), speed * np.sin(psi), np.zeros(psi.size)))
    track = from_velocity(time, velocity, start, source=f"{odometer.source} and {heading.source}")
    return replace(track, attitude=_level(psi))


def from_body_velocity(log: BodyVelocityLog, heading: HeadingLog, start: StartPoint) -> Trajectory:
    """Track from the velocity in body axes, such as a Doppler radar's or sonar's, and headings; the body is level.

    Parameters and errors as :func:`from_speed_and_heading`. An axis that the log never measured counts as zero.

    Raises
    ------
    InputError
        Also if the forward velocity is missing, or an axis is measured in some rows only.
    """
    time, psi, inside = _headings_at(log.time, heading, log.source)
    v = log.velocity_b[inside]
    known = np.isfinite(v)
    for k, axis in enumerate("xyz"):
        if known[:, k].any() != known[:, k].all() or (k == 0 and not known[:, 0].all()):
            row = int(np.flatnonzero(~known[:, k])[0])
            raise InputError(
                f"{log.source}: no v_{axis} at {time[row]:.3f} s; dead reckoning needs it in every row"
                + ("" if k == 0 else " or in none")
            )
    v = np.where(known, v, 0.0)
    c, s = np.cos(psi), np.sin(psi)
    velocity = np.column_stack((c * v[:, 0] - s * v[:, 1], s * v[:, 0] + c * v[:, 1], v[:, 2]))
    track = from_velocity(time, velocity, start, source=f"{log.source} and {heading.source}")
    return replace(track, attitude=_level(psi))


def from_velocity(time: Array, velocity_n: Array, start: StartPoint, source: str = "velocity") -> Trajectory:
    """Track from samples of velocity north, east, down, by the trapezoidal rule.

    Parameters
    ----------
    time : (n,) array [s]
    velocity_n : (n, 3) array [m/s]
    start : StartPoint
        At the first time.
    source : str

    Raises
    ------
    InputError
        For fewer than two times, or velocities that are not finite.
    """
    if time.size < 2 or velocity_n.shape != (time.size, 3) or not np.isfinite(velocity_n).all():
        raise InputError(f"{source}: dead reckoning needs at least two epochs of finite velocities north, east, down")
    moved = 0.5 * (velocity_n[1:] + velocity_n[:-1]) * np.diff(time)[:, None]
    lat, lon, height = summed(moved, start.lat, start.lon, start.height)
    return Trajectory(time, lat, lon, height, velocity_n, source=source)


def from_steps(steps: Steps, start: StartPoint, lever: tuple[float, float] = (0.0, 0.0)) -> Trajectory:
    """Track from distances and turns, each step an arc of a circle.

    Parameters
    ----------
    steps : Steps
    start : StartPoint
        Position of the antenna, and heading, at the first time.
    lever : (forward, right) [m]
        From the point that the distances are of, which must not slip sideways (the middle of an axle that does not
        steer), to the antenna.

    Returns
    -------
    Trajectory
        Of the antenna; velocity from the mean speed of the step that ends there, the first from the step that begins.
    """
    psi = start.heading + np.concatenate(([0.0], np.cumsum(steps.turn)))
    north, east = chords(steps.distance, psi[:-1], steps.turn)
    offset = _turned(psi, lever)
    moved = np.column_stack((north, east, np.zeros(north.size)))
    moved[:, :2] += np.diff(offset, axis=0)
    lat, lon, height = summed(moved, start.lat, start.lon, start.height)
    dt = np.diff(steps.time)
    speed, rate = (values / dt for values in (steps.distance, steps.turn))
    speed, rate = np.concatenate((speed[:1], speed)), np.concatenate((rate[:1], rate))
    velocity = np.column_stack((speed * np.cos(psi), speed * np.sin(psi), np.zeros(psi.size)))
    velocity[:, :2] += rate[:, None] * np.column_stack((-offset[:, 1], offset[:, 0]))
    return Trajectory(steps.time, lat, lon, height, velocity, _level(psi), source=steps.source)


def chords(distance: Array, heading: Array, turn: Array) -> tuple[Array, Array]:
    """North and east components of arcs of given length, heading at their begin, and turn."""
    chord = distance * np.sinc(turn / TWO_PI)
    return chord * np.cos(heading + 0.5 * turn), chord * np.sin(heading + 0.5 * turn)


@fused
def summed(moved, lat0, lon0, height0):
    """Sum displacements up on the ellipsoid.

    Parameters
    ----------
    moved : (n, 3) array [m]
        North, east, down, at the middle of each step.
    lat0, lon0, height0 : float [rad, rad, m]

    Returns
    -------
    lat, lon, height : (n + 1,) arrays [rad, rad, m]

    Notes
    -----
    Radii of curvature and cos(latitude) are taken at the middle of the step, which leaves errors of third order in its
    length: 1e-6 m for steps of 100 m. Longitude stays in [-pi, pi). Not at the poles. No checks are made.
    """
    n = moved.shape[0]
    lat, lon, height = np.empty(n + 1), np.empty(n + 1), np.empty(n + 1)
    lat[0], lon[0], height[0] = lat0, lon0, height0
    for k in range(n):
        h = height[k] - 0.5 * moved[k, 2]
        meridian, _ = radii(np.sin(lat[k]))
        middle = lat[k] + 0.5 * moved[k, 0] / (meridian + h)
        meridian, transverse = radii(np.sin(middle))
        lat[k + 1] = lat[k] + moved[k, 0] / (meridian + h)
        east = lon[k] + moved[k, 1] / ((transverse + h) * np.cos(middle))
        lon[k + 1] = east - 2.0 * np.pi * np.floor((east + np.pi) / (2.0 * np.pi))
        height[k + 1] = height[k] - moved[k, 2]
    return lat, lon, height


@fused
def metres_per_radian(lat, height):
    """North and east lengths (n, 2) [m] of a radian of latitude and of longitude at places (n,). No checks are made."""
    found = np.empty((lat.size, 2))
    for k in range(lat.size):
        meridian, transverse = radii(np.sin(lat[k]))
        found[k, 0] = meridian + height[k]
        found[k, 1] = (transverse + height[k]) * np.cos(lat[k])
    return found


def _headings_at(time: Array, heading: HeadingLog, source: str) -> tuple[Array, Array, Array]:
    inside = (time >= heading.time[0]) & (time <= heading.time[-1]) if heading.time.size else np.zeros(time.size, bool)
    if np.count_nonzero(inside) < 2:
        raise InputError(
            f"{source} and {heading.source} have fewer than two epochs in common; are both on one time scale?"
        )
    return time[inside], np.interp(time[inside], heading.time, np.unwrap(heading.heading)), inside


def _level(psi: Array) -> Array:
    return np.column_stack((np.zeros(psi.size), np.zeros(psi.size), wrapped(psi, TWO_PI)))


def _turned(psi: Array, lever: tuple[float, float]) -> Array:
    c, s = np.cos(psi), np.sin(psi)
    return np.column_stack((c * lever[0] - s * lever[1], s * lever[0] + c * lever[1]))
