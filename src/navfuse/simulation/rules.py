"""Rules of vehicles: how a body stands in its path, and what the vehicle can do.

Each function gives a :class:`~navfuse.simulation.route.Vehicle` for :func:`~navfuse.simulation.segments.drive` and
:func:`~navfuse.simulation.waypoints.follow_waypoints`. The limits are those of ordinary specimens; take another with
:func:`dataclasses.replace`.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.errors import ConfigError
from navfuse.simulation.gait import foot_motion
from navfuse.simulation.motion import Motion, MotionState
from navfuse.simulation.paths import LocalMap, Terrain
from navfuse.simulation.pinned import pinned
from navfuse.simulation.route import Route, Vehicle

Array = np.ndarray

ROLL_PER_ACCELERATION = math.radians(4.0) / STANDARD_GRAVITY
"""Outward lean of a car [rad] per lateral acceleration [m/s^2]: 4 deg per g."""
PITCH_PER_ACCELERATION = math.radians(1.5) / STANDARD_GRAVITY
"""Squat of a car [rad] per longitudinal acceleration [m/s^2]: 1.5 deg per g."""

_UNTURNED = (1.0, 0.0, 0.0, 0.0)


def car(hills: float = 0.0, seed: int = 0) -> Vehicle:
    """A car: no side slip; roll and pitch from the road and from acceleration.

    The velocity lies along the body x axis in the road plane. The body leans outwards by 4 deg per g across and squats
    by 1.5 deg per g along, on top of the tilt of the road. While it stands, it stands exactly.

    Parameters
    ----------
    hills : float [m/m]
        Bound of the slope of random terrain under the planned heights; 0 for none.
    seed : int
        Of the terrain.

    Raises
    ------
    ConfigError
        For negative hills.
    """
    if not hills >= 0.0:
        raise ConfigError(f"hills must not be negative, not {hills!r}")
    terrain = Terrain.random(np.random.default_rng(seed), hills)
    return Vehicle(
        "a car", 0.0, 60.0, 4.0, 8.0, 5.0, 1.0, 10.0, 0.3, False, False, 1.5, partial(_car_motion, terrain=terrain)
    )


def aircraft() -> Vehicle:
    """A light aircraft: coordinated turns, nose along the velocity (no wind, no angle of attack).

    Turns are coordinated exactly: the specific force has no component along body y, Earth rotation and curvature
    included. The lateral limit of 10 m/s^2 is a bank of 45 deg.
    """
    return Vehicle("an aircraft", 25.0, 300.0, 4.0, 4.0, 10.0, 0.5, 20.0, 0.4, False, False, 4.0, _aircraft_motion)


def boat(roll: float = 0.05, pitch: float = 0.025, heave: float = 0.3, seed: int = 0) -> Vehicle:
    """A boat in waves: upright along its course on the average, rolling, pitching, yawing and heaving about that.

    Parameters
    ----------
    roll, pitch : float [rad]
        Root mean square about the level.
    heave : float [m]
        Root mean square of height.
    seed : int
        Of the waves: each of the four motions is a sum of six sinusoids with periods of 4 s to 12 s (pitch 3 s to 8 s).

    Raises
    ------
    ConfigError
        For a negative or an absurd (above 0.5 rad, 5 m) sea.
    """
    for name, value, most in (("roll", roll, 0.5), ("pitch", pitch, 0.5), ("heave", heave, 5.0)):
        if not 0.0 <= value <= most:
            raise ConfigError(f"the {name} of a boat must lie in 0 .. {most:g}, not {value!r}")
    streams = np.random.default_rng(seed).spawn(4)
    sizes = ((roll, 4.0, 12.0), (pitch, 3.0, 8.0), (0.25 * roll, 5.0, 12.0), (heave, 4.0, 12.0))
    waves = [_waves(rng, *size) for rng, size in zip(streams, sizes, strict=True)]
    return Vehicle(
        "a boat", 0.0, 25.0, 0.7, 0.7, 2.0, 0.35, 1.0, 0.02, False, False, 4.0, partial(_boat_motion, waves=waves)
    )


def drone(drag: float = 0.25) -> Vehicle:
    """A multicopter: the rotors push along body -z, the nose points along the course, hovering and pivoting allowed.

    Tilt follows from acceleration and from linear air drag: ``f_b + drag * v_b`` has no component along body x and y.

    Parameters
    ----------
    drag : float [1/s]
        Deceleration per speed; 0.25 gives 14 deg of tilt at 10 m/s.

    Raises
    ------
    ConfigError
        For a negative drag.
    """
    if not drag >= 0.0:
        raise ConfigError(f"the drag of a drone must not be negative, not {drag!r} 1/s")
    return Vehicle(
        "a drone", 0.0, 25.0, 5.0, 5.0, 4.0, 2.0, 6.0, math.inf, True, True, 3.0, partial(_drone_motion, drag=drag)
    )


def pedestrian(stride: float = 1.2, side: float = 0.08) -> Vehicle:
    """A walker with the IMU on one foot, which stands exactly still once a stride.

    Parameters
    ----------
    stride : float [s]
        From one stance of the foot to the next; a third of it is stance.
    side : float [m]
        The foot is this far to the right of the path; negative for the left foot.

    Raises
    ------
    ConfigError
        For a stride outside 0.6 .. 3 s.
    """
    if not 0.6 <= stride <= 3.0:
        raise ConfigError(f"the stride of a pedestrian must lie in 0.6 .. 3 s, not {stride!r}")
    move = partial(foot_motion, stride=stride, side=side)
    return Vehicle("a pedestrian", 0.0, 2.5, 1.0, 1.0, 2.0, 1.5, 1.0, 0.6, True, False, 1.0, move)


VEHICLES = {"car": car, "aircraft": aircraft, "boat": boat, "drone": drone, "pedestrian": pedestrian}
"""Name in scenarios -> vehicle."""


def level_axes(local: LocalMap, x: Array, y: Array, height: Array, course: Array) -> tuple[Array, Array, Array]:
    """Unit vectors (n, 3) in e: forward along a course in the plane of the map, right, and down; all level."""
    forward = unit(local.tangent(x, y, height, np.cos(course), np.sin(course)))
    down = -local.normal(x, y)
    return forward, np.cross(down, forward), down


def unit(v: Array) -> Array:
    """Rows of `v` at length one."""
    return v / np.linalg.norm(v, axis=1)[:, None]


def quaternions(C: Array) -> Array:
    """(n, 4) quaternions, scalar first, of (n, 3, 3) matrices."""
    return Rotation.from_matrix(C).as_quat(scalar_first=True)


def tilted(axes: tuple[Array, Array, Array], roll: Array, pitch: Array, yaw: Array | None = None) -> Array:
    """``C_eb`` (n, 3, 3) of a body turned by yaw, pitch and roll [rad] from forward, right and down."""
    angles = np.column_stack([np.zeros_like(roll) if yaw is None else yaw, pitch, roll])
    return np.stack(axes, axis=2) @ Rotation.from_euler("ZYX", angles).as_matrix()


def path_state(time: Array, r_e: Array) -> MotionState:
    """Velocity, acceleration and specific force in e (given as ``f_b``) of a path, whatever the attitude."""
    return Motion.from_knots(time, r_e, np.tile(_UNTURNED, (time.size, 1))).at(time)


def coordinated(state: MotionState) -> Array:
    """``C_eb`` (n, 3, 3) of a coordinated flight: x along the velocity, no specific force along y."""
    forward, lift = unit(state.v_e), state.f_b
    down = -unit(lift - forward * np.einsum("ij,ij->i", lift, forward)[:, None])
    return np.stack([forward, np.cross(down, forward), down], axis=2)


def thrust_up(state: MotionState, nose: Array, drag: float) -> Array:
    """``C_eb`` (n, 3, 3) of a multicopter: specific force and drag balance along z, x as near to `nose` as can be."""
    down = -unit(state.f_b + drag * state.v_e)
    forward = unit(nose - down * np.einsum("ij,ij->i", nose, down)[:, None])
    return np.stack([forward, np.cross(down, forward), down], axis=2)


def _car_motion(route: Route, terrain: Terrain) -> Motion:
    p = route.at(route.knots(0.05))
    height = p.height + terrain.height(p.x, p.y)
    north, east = terrain.slope(p.x, p.y)
    _, right, down = level_axes(route.local, p.x, p.y, height, p.course)
    stretched = route.local.tangent(p.x, p.y, height, np.cos(p.course), np.sin(p.course))
    along = p.slope + north * np.cos(p.course) + east * np.sin(p.course)
    across = east * np.cos(p.course) - north * np.sin(p.course)
    forward = unit(stretched - along[:, None] * down)
    below = unit(np.cross(forward, right - across[:, None] * down))
    road = forward, np.cross(below, forward), below
    roll = -ROLL_PER_ACCELERATION * p.speed * p.course_rate
    squat = PITCH_PER_ACCELERATION * p.speed_rate
    angles = Rotation.from_euler("XY", np.column_stack([roll, squat])).as_matrix()
    C_eb = np.stack(road, axis=2) @ angles
    return pinned(Motion.from_knots(p.time, route.local.position(p.x, p.y, height), quaternions(C_eb)), p.time, p.still)


def _aircraft_motion(route: Route) -> Motion:
    p = route.at(route.knots(0.1))
    r_e = route.local.position(p.x, p.y, p.height)
    return Motion.from_knots(p.time, r_e, quaternions(coordinated(path_state(p.time, r_e))))


def _drone_motion(route: Route, drag: float) -> Motion:
    p = route.at(route.knots(0.05))
    r_e = route.local.position(p.x, p.y, p.height)
    nose = level_axes(route.local, p.x, p.y, p.height, p.course)[0]
    C_eb = thrust_up(path_state(p.time, r_e), nose, drag)
    return Motion.from_knots(p.time, r_e, quaternions(C_eb))


def _boat_motion(route: Route, waves: list[tuple[Array, Array, Array]]) -> Motion:
    p = route.at(route.knots(0.1))
    roll, pitch, yaw, heave = (np.sin(np.outer(p.time, omega) + phase) @ size for omega, phase, size in waves)
    C_eb = tilted(level_axes(route.local, p.x, p.y, p.height, p.course), roll, pitch, yaw)
    return Motion.from_knots(p.time, route.local.position(p.x, p.y, p.height + heave), quaternions(C_eb))


def _waves(
    rng: np.random.Generator, sd: float, shortest: float, longest: float, count: int = 6
) -> tuple[Array, Array, Array]:
    """Angular frequencies [rad/s], phases [rad] and amplitudes of sinusoids; root mean square of the sum `sd`."""
    omega = 2.0 * np.pi / rng.uniform(shortest, longest, count)
    size = rng.uniform(0.5, 1.0, count)
    return omega, rng.uniform(0.0, 2.0 * np.pi, count), sd * size * math.sqrt(2.0 / np.sum(size**2))
