"""A plan of manoeuvres, checked against the limits of a vehicle, and the route over the Earth that it makes.

Speed, turn rate and slope change by smooth steps only (:class:`~navfuse.simulation.paths.SmoothSteps`), so that a
route has continuous acceleration, and the attitude made from it continuous angular rate.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from navfuse.errors import ConfigError
from navfuse.simulation.bounds import require_rows
from navfuse.simulation.motion import Motion
from navfuse.simulation.paths import STEEPEST, LocalMap, SmoothSteps, Turning, integrate_path

Array = np.ndarray

_USUAL = 0.7
_SLACK = 1.0 + 1e-9


@dataclass(frozen=True, slots=True)
class Vehicle:
    """What a vehicle can do, and how it stands in its path.

    Attributes
    ----------
    name : str
        For messages: "a car".
    slowest, fastest : float [m/s]
        Horizontal speed; slowest > 0 for one that cannot stand.
    acceleration, braking : float [m/s^2]
        Largest along the path.
    lateral : float [m/s^2]
        Largest across the path, horizontally.
    turn_rate : float [rad/s]
    climb_rate : float [m/s]
        Up or down.
    slope : float [m/m]
        Steepest path, up or down.
    pivots : bool
        Whether it can turn on the spot.
    hovers : bool
        Whether it can climb on the spot.
    ramp : float [s]
        How long a change of turn rate or slope takes at least.
    move : callable
        Takes a :class:`Route` and gives the :class:`Motion` of the IMU.
    """

    name: str
    slowest: float
    fastest: float
    acceleration: float
    braking: float
    lateral: float
    turn_rate: float
    climb_rate: float
    slope: float
    pivots: bool
    hovers: bool
    ramp: float
    move: Callable[[Route], Motion]

    def __post_init__(self) -> None:
        limits = ("fastest", "acceleration", "braking", "lateral", "turn_rate", "climb_rate", "slope", "ramp")
        for key in limits:
            if not getattr(self, key) > 0.0:
                raise ConfigError(f"{self.name}: the limit {key} must be positive, not {getattr(self, key)!r}")
        if not 0.0 <= self.slowest < self.fastest:
            raise ConfigError(f"{self.name}: slowest must lie in 0 <= slowest < fastest, not {self.slowest!r}")


@dataclass(frozen=True, slots=True)
class RoutePoints:
    """A route at some times; all (n,) arrays.

    Attributes
    ----------
    time : [s]
    x, y : [m]
        North and east in the plane of the map.
    height : [m]
        Above the ellipsoid.
    speed, speed_rate : [m/s], [m/s^2]
        Horizontal.
    course, course_rate : [rad], [rad/s]
        Clockwise from the north of the map's origin, not wrapped.
    slope : [m/m]
        Rise per horizontal distance along the path.
    still : bool
        Neither moves nor turns.
    """

    time: Array
    x: Array
    y: Array
    height: Array
    speed: Array
    speed_rate: Array
    course: Array
    course_rate: Array
    slope: Array
    still: Array


@dataclass(frozen=True, slots=True)
class Route:
    """Where a vehicle goes, as functions of time.

    Attributes
    ----------
    local : LocalMap
    origin : (x, y) [m]
        Start in the plane of the map.
    duration : float [s]
    speed : SmoothSteps
        Over time.
    course : Turning
        Over time.
    profile : Turning
        Height over the horizontal distance from the start.
    lift : Turning
        Height gained over time on the spot, added to `profile`.
    """

    local: LocalMap
    origin: tuple[float, float]
    duration: float
    speed: SmoothSteps
    course: Turning
    profile: Turning
    lift: Turning

    def knots(self, spacing: float) -> Array:
        """Even times from 0 to the end, about `spacing` [s] apart; a ConfigError for too many."""
        require_rows(self.duration / spacing, f"the plan lasts {self.duration:g} s and with a knot every {spacing:g} s")
        return np.linspace(0.0, self.duration, max(round(self.duration / spacing), 5) + 1)

    def at(self, time: Array) -> RoutePoints:
        """The route at (n,) times that increase from 0; closer than a second, or the path is integrated coarsely."""
        x, y = integrate_path(time, self.speed, self.course)
        distance = self.speed.integral(time) - self.speed.integral(0.0)
        speed, course_rate = self.speed.value(time), self.course.rate(time)
        rate, lift = self.speed.rate(time), self.lift.rate(time)
        return RoutePoints(
            time,
            x + self.origin[0],
            y + self.origin[1],
            self.profile.value(distance) + self.lift.value(time),
            speed,
            rate,
            self.course.value(time),
            course_rate,
            self.profile.rate(distance),
            (np.abs(speed) < 1e-9) & (np.abs(rate) < 1e-9) & (course_rate == 0.0) & (lift == 0.0),
        )


class Plan:
    """Manoeuvres one after the other. Each method appends one, and refuses what the vehicle cannot do.

    Parameters
    ----------
    vehicle : Vehicle
    speed : float [m/s]
        At the start.
    course : float [rad]
        At the start.

    Notes
    -----
    The argument `where` of the methods begins their messages, e.g. "segment 3 (turn)". All raise
    :class:`~navfuse.errors.ConfigError`. Without an acceleration 0.7 of the vehicle's limit is used.
    """

    def __init__(self, vehicle: Vehicle, speed: float, course: float, where: str = "the start") -> None:
        self.vehicle = vehicle
        self.time = 0.0
        self.distance = 0.0
        self.speed = 0.0
        self.course = course
        self.check_speed(speed, where)
        self.speed = self._first_speed = speed
        self._first_course = course
        self._speeds: list[tuple[float, float, float]] = []
        self._turns: list[tuple[float, float, float]] = []
        self._slopes: list[tuple[float, float, float]] = []
        self._lifts: list[tuple[float, float, float]] = []

    def check_speed(self, speed: float, where: str) -> None:
        """Refuse a speed that the vehicle does not go at."""
        vehicle = self.vehicle
        if not vehicle.slowest <= speed <= vehicle.fastest:
            raise ConfigError(
                f"{where}: {vehicle.name} goes at {vehicle.slowest:g} to {vehicle.fastest:g} m/s, not at {speed:g} m/s"
            )

    def hold(self, duration: float, where: str) -> None:
        """Go on as it is for `duration` [s]."""
        if not 0.0 <= duration < math.inf:
            raise ConfigError(f"{where}: the duration must be finite and not negative, not {duration!r} s")
        self.time += duration
        self.distance += self.speed * duration

    def speed_change_time(self, change: float, acceleration: float) -> float:
        """How long [s] a smooth change of speed [m/s] takes whose peak is `acceleration` [m/s^2]."""
        return max(STEEPEST * abs(change) / acceleration, self.vehicle.ramp) if change else 0.0

    def change_speed(self, to: float, acceleration: float | None, where: str) -> None:
        """Go faster or slower, with at most `acceleration` [m/s^2] along the path."""
        self.check_speed(to, where)
        limit, verb = (
            (self.vehicle.acceleration, "accelerates") if to > self.speed else (self.vehicle.braking, "brakes")
        )
        chosen = _USUAL * limit if acceleration is None else acceleration
        if not 0.0 < chosen <= limit * _SLACK:
            raise ConfigError(
                f"{where}: {self.vehicle.name} {verb} by more than 0 and at most {limit:g}, not {chosen:g} m/s^2"
            )
        change = to - self.speed
        lasts = self.speed_change_time(change, chosen)
        if lasts:
            self._speeds.append((self.time, lasts, change))
        self.time += lasts
        self.distance += (self.speed + 0.5 * change) * lasts
        self.speed = to

    def turn_shape(
        self, angle: float, lateral: float | None, radius: float | None, where: str
    ) -> tuple[float, float, float]:
        """How a turn at the present speed is made.

        Parameters
        ----------
        angle : float [rad]
            Clockwise > 0; not 0.
        lateral : float [m/s^2] or None
            Acceleration across at the height of the turn.
        radius : float [m] or None
            There; instead of `lateral`.

        Returns
        -------
        rate : float [rad/s]
            At the height of the turn.
        ramp, hold : float [s]
            How long the rate grows, and falls again; and how long it stays between.
        """
        vehicle, v = self.vehicle, self.speed
        if not math.isfinite(angle):
            raise ConfigError(f"{where}: the angle of a turn must be finite, not {angle!r}")
        if v == 0.0:
            if not vehicle.pivots:
                raise ConfigError(f"{where}: {vehicle.name} cannot turn on the spot; give it a speed before the turn")
            rate = _USUAL * vehicle.turn_rate
        else:
            if radius is not None and not radius > 0.0:
                raise ConfigError(f"{where}: the radius of a turn must be positive, not {radius!r} m")
            if lateral is None:
                lateral = _USUAL * vehicle.lateral if radius is None else v * v / radius
            if not 0.0 < lateral <= vehicle.lateral * _SLACK:
                wider = f"; the limit allows a radius of {v * v / vehicle.lateral:.4g} m or more at {v:g} m/s"
                raise ConfigError(
                    f"{where}: the turn takes {lateral:.3g} m/s^2 across, {vehicle.name} has more than 0 and at most "
                    f"{vehicle.lateral:g} m/s^2{wider}"
                )
            rate = lateral / v
            if rate > vehicle.turn_rate * _SLACK:
                if radius is not None:
                    raise ConfigError(
                        f"{where}: the turn takes {math.degrees(rate):.3g} deg/s, {vehicle.name} turns by at most "
                        f"{math.degrees(vehicle.turn_rate):.3g} deg/s"
                    )
                rate = vehicle.turn_rate
        size = abs(angle)
        rate = min(rate, size / vehicle.ramp)
        return math.copysign(rate, angle), vehicle.ramp, size / rate - vehicle.ramp

    def turn(self, angle: float, lateral: float | None, radius: float | None, where: str) -> None:
        """Turn by `angle` [rad], clockwise > 0, at the present speed."""
        if angle == 0.0:
            return
        rate, ramp, hold = self.turn_shape(angle, lateral, radius, where)
        self._turns += [(self.time, ramp, rate), (self.time + ramp + hold, ramp, -rate)]
        lasts = 2.0 * ramp + hold
        self.time += lasts
        self.distance += self.speed * lasts
        self.course += angle

    def climb(self, change: float, rate: float | None, where: str) -> None:
        """Gain `change` [m] of height at up to `rate` [m/s], straight ahead or, where it can, on the spot."""
        vehicle = self.vehicle
        chosen = _USUAL * min(vehicle.climb_rate, vehicle.slope * (self.speed or math.inf)) if rate is None else rate
        if not math.isfinite(change) or not chosen > 0.0:
            raise ConfigError(
                f"{where}: a climb needs a finite height and a rate > 0, not {change!r} m at {chosen!r} m/s"
            )
        self._check_climb(chosen, chosen / self.speed if self.speed else 0.0, where)
        if change == 0.0:
            return
        chosen = min(chosen, abs(change) / vehicle.ramp)
        hold = abs(change) / chosen - vehicle.ramp
        signed = math.copysign(chosen, change)
        if self.speed == 0.0:
            if not vehicle.hovers:
                raise ConfigError(f"{where}: {vehicle.name} cannot climb on the spot; give it a speed before the climb")
            ramp = vehicle.ramp
            self._lifts += [(self.time, ramp, signed), (self.time + ramp + hold, ramp, -signed)]
        else:
            self._rise(self.distance, vehicle.ramp * self.speed, hold * self.speed, signed / self.speed)
        self.hold(2.0 * vehicle.ramp + hold, where)

    def rise(self, start: float, end: float, change: float, fastest: float, where: str) -> None:
        """Gain `change` [m] of height between two distances [m] that are passed at up to `fastest` [m/s]."""
        if change == 0.0:
            return
        third = (end - start) / 3.0
        slope = 0.5 * change / third
        self._check_climb(abs(slope) * fastest, abs(slope), where)
        self._rise(start, third, third, slope)

    def _rise(self, start: float, ramp: float, hold: float, slope: float) -> None:
        self._slopes += [(start, ramp, slope), (start + ramp + hold, ramp, -slope)]

    def _check_climb(self, rate: float, slope: float, where: str) -> None:
        vehicle = self.vehicle
        if rate > vehicle.climb_rate * _SLACK:
            raise ConfigError(
                f"{where}: the climb takes {rate:.3g} m/s, {vehicle.name} climbs at most at {vehicle.climb_rate:g} m/s"
            )
        if slope > vehicle.slope * _SLACK:
            raise ConfigError(
                f"{where}: the slope is {100.0 * slope:.3g} %, {vehicle.name} goes on at most {100 * vehicle.slope:g} %"
            )

    def route(self, local: LocalMap, height: float, origin: tuple[float, float] = (0.0, 0.0)) -> Route:
        """The whole as a route that starts at `origin` of the map and `height` [m]."""
        if not self.time > 0.0:
            raise ConfigError("the plan is empty: it lasts 0 s")
        return Route(
            local,
            origin,
            self.time,
            SmoothSteps(self._first_speed, self._speeds),
            Turning(self._first_course, SmoothSteps(0.0, self._turns)),
            Turning(height, SmoothSteps(0.0, self._slopes)),
            Turning(0.0, SmoothSteps(0.0, self._lifts)),
        )
