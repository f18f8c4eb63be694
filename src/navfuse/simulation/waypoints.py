"""A motion along waypoints, each with a speed: straight legs, corners rounded as tightly as the vehicle can."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from navfuse.core.earth import ecef_to_geodetic_batch
from navfuse.core.rotation import wrap_pi
from navfuse.errors import ConfigError
from navfuse.simulation.motion import Motion
from navfuse.simulation.paths import LocalMap, SmoothSteps, Turning, integrate_path
from navfuse.simulation.places import ellipsoid_normals, middle_map, plane_coordinates
from navfuse.simulation.route import Plan, Vehicle

Array = np.ndarray

_FARTHEST = 2.0e6
_SAME_PLACE = 1e-6
_CAREFUL = 0.7


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A place to pass.

    Attributes
    ----------
    lat, lon, height : float [rad, rad, m]
    speed : float [m/s]
        Horizontal, through the turn at the waypoint; 0 to stop there.
    pause : float [s]
        How long to stand there; only with a speed of 0.
    """

    lat: float
    lon: float
    height: float
    speed: float
    pause: float = 0.0


@dataclass(frozen=True, slots=True)
class _Corner:
    turn: float
    tangent: float
    length: float


def local_waypoints(lat: float, lon: float, height: float, rows: ArrayLike) -> list[Waypoint]:
    """Waypoints from local metres.

    Parameters
    ----------
    lat, lon, height : float [rad, rad, m]
        Origin; at a pole, north is the direction that the longitude names.
    rows : (n, 4) or (n, 5) array
        North, east and up of the origin [m], speed [m/s], and optionally the pause [s]. Up is ellipsoidal height.

    Raises
    ------
    ConfigError
        For another shape.
    """
    table = np.asarray(rows, dtype=float)
    if table.ndim != 2 or table.shape[1] not in (4, 5):
        raise ConfigError(f"local waypoints are rows of north, east, up, speed and perhaps pause, not {table.shape}")
    local = LocalMap.at(lat, lon, height)
    place = ecef_to_geodetic_batch(local.position(table[:, 0], table[:, 1], height + table[:, 2]))
    return [Waypoint(*map(float, row)) for row in np.column_stack([*place, table[:, 3:]])]


def follow_waypoints(vehicle: Vehicle, waypoints: Sequence[Waypoint]) -> Motion:
    """The motion of a vehicle that passes waypoints.

    Parameters
    ----------
    vehicle : Vehicle
        From :mod:`navfuse.simulation.rules`.
    waypoints : sequence of Waypoint
        At least two, anywhere on Earth, within 2000 km of their middle.

    Returns
    -------
    Motion
        From time 0 at the first waypoint to a pause at the last. Legs are straight in a plane laid onto the ellipsoid
        around the middle of the waypoints (:class:`~navfuse.simulation.paths.LocalMap`), where speeds are off by up to
        d^2 / 6 R^2: 4e-6 at 30 km, 0.4 % at 1000 km. First, last and stopping waypoints are reached; at the others the
        corner is cut by a turn at constant speed with the full lateral acceleration of the vehicle. The vehicle
        accelerates at once after a turn, and brakes as late as possible. Heights run between the waypoints with a level
        tangent at each.

    Raises
    ------
    ConfigError
        Naming the waypoint or leg, counted from 1, and the limit: a turn that does not fit its legs, a change of speed
        or a climb that does not fit its leg, a speed that the vehicle does not go at, a corner at a stop for a vehicle
        that cannot turn on the spot, two waypoints at the same place, a pause without a stop, too few waypoints.
    """
    if len(waypoints) < 2:
        raise ConfigError(f"a motion needs at least two waypoints, not {len(waypoints)}")
    for number, point in enumerate(waypoints, 1):
        _check_waypoint(number, point)
    normals = ellipsoid_normals([point.lat for point in waypoints], [point.lon for point in waypoints])
    local = _middle(normals, [point.height for point in waypoints])
    place = plane_coordinates(local, normals)
    legs = np.diff(place, axis=0)
    lengths = np.hypot(*legs.T)
    courses = np.arctan2(legs[:, 1], legs[:, 0])
    _check_vertical(vehicle, waypoints, lengths, courses)
    plan = Plan(vehicle, waypoints[0].speed, float(courses[0]), "waypoint 1")
    corners = _corners(vehicle, waypoints, courses)
    _check_turns(vehicle, waypoints, corners, lengths)

    speed_at = [point.speed for point in waypoints]
    plan.hold(waypoints[0].pause, "waypoint 1")
    passed = plan.distance
    for k, length in enumerate(lengths):
        here, there = corners[k], corners[k + 1]
        rise = waypoints[k + 1].height - waypoints[k].height
        leg = f"leg from waypoint {k + 1} to {k + 2}"
        if length < _SAME_PLACE:
            plan.climb(rise, None, leg)
        else:
            _straight(plan, length - here.tangent - there.tangent, speed_at[k + 1], leg)
            middle = plan.distance + 0.5 * there.length
            plan.rise(passed, middle, rise, max(speed_at[k], speed_at[k + 1]), leg)
            passed = middle
        where = f"waypoint {k + 2}"
        plan.hold(waypoints[k + 1].pause, where)
        plan.turn(there.turn, vehicle.lateral if speed_at[k + 1] else None, None, where)
    return vehicle.move(plan.route(local, waypoints[0].height, (float(place[0, 0]), float(place[0, 1]))))


def _check_waypoint(number: int, point: Waypoint) -> None:
    values = (point.lat, point.lon, point.height, point.speed, point.pause)
    if not all(map(math.isfinite, values)) or abs(point.lat) > 0.5 * math.pi + 1e-12:
        raise ConfigError(
            f"waypoint {number}: latitude (within +-pi/2), longitude, height, speed and pause must be finite"
        )
    if point.pause < 0.0 or (point.pause > 0.0 and point.speed > 0.0):
        raise ConfigError(
            f"waypoint {number}: a pause of {point.pause:g} s at {point.speed:g} m/s; pause >= 0, and only at speed 0"
        )


def _middle(normals: Array, heights: list[float]) -> LocalMap:
    """Map around the mean direction of the waypoints."""
    local = middle_map(normals, float(np.mean(heights)))
    if local is not None and np.linalg.norm(normals - local.up, axis=1).max() * local.radius_east < _FARTHEST:
        return local
    raise ConfigError(f"the waypoints lie more than {_FARTHEST / 1e3:.0f} km from their middle; divide the journey")


def _check_vertical(vehicle: Vehicle, waypoints: Sequence[Waypoint], lengths: Array, courses: Array) -> None:
    """Refuse two waypoints at one place but for a climb of one that hovers, whose course is that before or after."""
    for k in np.flatnonzero(lengths < _SAME_PLACE).tolist():
        one, two = waypoints[k], waypoints[k + 1]
        if not vehicle.hovers or one.height == two.height or one.speed or two.speed:
            raise ConfigError(
                f"waypoints {k + 1} and {k + 2} lie above one another or at the same place: {vehicle.name} "
                f"{'climbs there only with speed 0 at both' if vehicle.hovers else 'cannot go from one to the other'}"
            )
    moving = np.flatnonzero(lengths >= _SAME_PLACE)
    if moving.size:
        before = np.searchsorted(moving, np.arange(lengths.size), side="right") - 1
        courses[:] = courses[moving[np.maximum(before, 0)]]


def _corners(vehicle: Vehicle, waypoints: Sequence[Waypoint], courses: Array) -> list[_Corner]:
    """The turn at each waypoint, how far before it begins, and how long its path is."""
    corners = [_Corner(0.0, 0.0, 0.0)]
    for k in range(1, len(waypoints) - 1):
        angle, v, where = wrap_pi(float(courses[k] - courses[k - 1])), waypoints[k].speed, f"waypoint {k + 1}"
        if abs(angle) < 1e-9:
            angle = 0.0
        plan = Plan(vehicle, v, 0.0, where)
        rate, ramp, hold = (
            plan.turn_shape(angle, vehicle.lateral if v else None, None, where) if angle else (0.0, 0.0, 0.0)
        )
        if v == 0.0 or angle == 0.0:
            corners.append(_Corner(angle, 0.0, 0.0))
            continue
        time = np.linspace(0.0, 2.0 * ramp + hold, 129)
        course = Turning(0.0, SmoothSteps(0.0, [(0.0, ramp, rate), (ramp + hold, ramp, -rate)]))
        x, y = integrate_path(time, SmoothSteps(v, []), course)
        chord = x[-1] * math.cos(0.5 * angle) + y[-1] * math.sin(0.5 * angle)
        corners.append(_Corner(angle, chord / (2.0 * max(math.cos(0.5 * angle), 1e-12)), v * float(time[-1])))
    return [*corners, _Corner(0.0, 0.0, 0.0)]


def _check_turns(vehicle: Vehicle, waypoints: Sequence[Waypoint], corners: list[_Corner], lengths: Array) -> None:
    for k, length in enumerate(lengths):
        if corners[k].tangent + corners[k + 1].tangent > length:
            worst = k if corners[k].tangent > corners[k + 1].tangent else k + 1
            corner, v = corners[worst], waypoints[worst].speed
            raise ConfigError(
                f"waypoint {worst + 1}: a turn of {math.degrees(abs(corner.turn)):.0f} deg at {v:g} m/s is too tight: "
                f"with at most {vehicle.lateral:g} m/s^2 across and {math.degrees(vehicle.turn_rate):.0f} deg/s, "
                f"{vehicle.name} begins it {corner.tangent:.4g} m before, but the leg from waypoint {k + 1} to {k + 2} "
                f"of {length:.4g} m has to hold its turns at both ends; slow down or move the waypoints apart"
            )


def _straight(plan: Plan, length: float, to: float, where: str) -> None:
    """Cover `length` [m] and arrive at the speed `to` [m/s]."""
    at, vehicle = plan.speed, plan.vehicle
    plan.check_speed(to, where)
    if at == 0.0 and to == 0.0:
        raise ConfigError(f"{where}: the speed is 0 at both ends; put a waypoint with a speed between them")
    limit = vehicle.acceleration if to > at else vehicle.braking
    acceleration = _CAREFUL * limit
    if 0.5 * (at + to) * plan.speed_change_time(to - at, acceleration) > length:
        acceleration = limit
    needed = 0.5 * (at + to) * plan.speed_change_time(to - at, acceleration)
    if needed > length * (1.0 + 1e-9):
        raise ConfigError(
            f"{where}: from {at:g} to {to:g} m/s takes {vehicle.name} {needed:.4g} m at its limit of {limit:g} m/s^2, "
            f"and {length:.4g} m of the leg are straight"
        )
    cruise = max(length - needed, 0.0)
    if to > at:
        plan.change_speed(to, acceleration, where)
        plan.hold(cruise / to, where)
    else:
        plan.hold(cruise / at, where)
        plan.change_speed(to, acceleration, where)
