"""A motion as a list of segments: hold, accelerate, turn, climb, weave, fly an eight, stop.

::

    drive(car(), [Accelerate(14.0), Hold(20.0), Turn(math.pi / 2), STurns(0.4), Stop(5.0)])

or, from a table with units in its keys, ``segments_from_tables([{"do": "accelerate", "speed_mps": 14.0}, ...])``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any

from navfuse.core.printed_keys import LARGEST, shown
from navfuse.errors import ConfigError
from navfuse.simulation.motion import Motion
from navfuse.simulation.paths import LocalMap
from navfuse.simulation.route import Plan, Vehicle
from navfuse.simulation.scenario_table import nearest

MOST_REPEATS = 10_000


@dataclass(frozen=True, slots=True)
class Hold:
    """Go on, or stand, for `duration` [s]."""

    duration: float

    def plan(self, plan: Plan, where: str) -> None:
        """Append it to a plan."""
        plan.hold(self.duration, where)


@dataclass(frozen=True, slots=True)
class Accelerate:
    """Change to `speed` [m/s], faster or slower, with a peak of `acceleration` [m/s^2]."""

    speed: float
    acceleration: float | None = None

    def plan(self, plan: Plan, where: str) -> None:
        """Append it to a plan."""
        plan.change_speed(self.speed, self.acceleration, where)


@dataclass(frozen=True, slots=True)
class Turn:
    """Turn by `angle` [rad], clockwise > 0, several times round if it is larger than a turn.

    The tightness is that of `lateral` acceleration [m/s^2] or of a `radius` [m], at most one of them.
    """

    angle: float
    lateral: float | None = None
    radius: float | None = None

    def plan(self, plan: Plan, where: str) -> None:
        """Append it to a plan."""
        if self.lateral is not None and self.radius is not None:
            raise ConfigError(f"{where}: give the lateral acceleration or the radius of a turn, not both")
        plan.turn(self.angle, self.lateral, self.radius, where)


@dataclass(frozen=True, slots=True)
class Climb:
    """Gain `height` [m], or lose it if < 0, at up to `rate` [m/s]."""

    height: float
    rate: float | None = None

    def plan(self, plan: Plan, where: str) -> None:
        """Append it to a plan."""
        plan.climb(self.height, self.rate, where)


@dataclass(frozen=True, slots=True)
class STurns:
    """Weave: `count` turns by `angle` [rad] to one side and back, the first to the right if `angle` > 0."""

    angle: float
    count: int = 2
    lateral: float | None = None

    def plan(self, plan: Plan, where: str) -> None:
        """Append it to a plan."""
        if not 1 <= self.count <= MOST_REPEATS:
            raise ConfigError(f"{where}: the count of turns must be in 1 .. {MOST_REPEATS}, not {self.count!r}")
        for number in range(self.count):
            side = -1.0 if number % 2 else 1.0
            plan.turn(side * self.angle, self.lateral, None, where)
            plan.turn(-side * self.angle, self.lateral, None, where)


@dataclass(frozen=True, slots=True)
class FigureEight:
    """A full circle to the right, then one to the left; tightness as for :class:`Turn`."""

    lateral: float | None = None
    radius: float | None = None

    def plan(self, plan: Plan, where: str) -> None:
        """Append it to a plan."""
        Turn(2.0 * math.pi, self.lateral, self.radius).plan(plan, where)
        Turn(-2.0 * math.pi, self.lateral, self.radius).plan(plan, where)


@dataclass(frozen=True, slots=True)
class Stop:
    """Brake to a stand with a peak of `braking` [m/s^2], and stand for `duration` [s]."""

    duration: float = 0.0
    braking: float | None = None

    def plan(self, plan: Plan, where: str) -> None:
        """Append it to a plan."""
        plan.change_speed(0.0, self.braking, where)
        plan.hold(self.duration, where)


Segment = Hold | Accelerate | Turn | Climb | STurns | FigureEight | Stop

_KINDS: dict[str, type] = {
    "hold": Hold,
    "accelerate": Accelerate,
    "turn": Turn,
    "climb": Climb,
    "s_turns": STurns,
    "figure_eight": FigureEight,
    "stop": Stop,
}
REPEAT = "repeat"

_KEYS = {
    "duration": ("duration_s", 1.0),
    "speed": ("speed_mps", 1.0),
    "acceleration": ("acceleration_mps2", 1.0),
    "braking": ("braking_mps2", 1.0),
    "lateral": ("lateral_mps2", 1.0),
    "angle": ("angle_deg", math.pi / 180.0),
    "radius": ("radius_m", 1.0),
    "height": ("height_m", 1.0),
    "rate": ("rate_mps", 1.0),
    "count": ("count", 1),
}


def drive(
    vehicle: Vehicle,
    segments: Iterable[Segment],
    *,
    lat: float = 0.8,
    lon: float = 0.2,
    height: float = 100.0,
    heading: float = 0.0,
    speed: float | None = None,
) -> Motion:
    """The motion of a vehicle through a list of segments.

    Parameters
    ----------
    vehicle : Vehicle
        From :mod:`navfuse.simulation.rules`.
    segments : iterable of Segment
    lat, lon, height : float [rad, rad, m]
        Start; any place, poles included.
    heading : float [rad]
        Course at the start.
    speed : float [m/s] or None
        At the start; None for the slowest that the vehicle goes at, 0 for most.

    Returns
    -------
    Motion
        From time 0. Plane distances are laid onto the ellipsoid (:class:`~navfuse.simulation.paths.LocalMap`): the
        speed at a distance of d from the start is off by about d^2 / 6 R^2, 0.4 % at 1000 km.

    Raises
    ------
    ConfigError
        For what the vehicle cannot do, naming the segment by its number from 1 and the limit, and for a plan that
        lasts no time.
    """
    plan = Plan(vehicle, vehicle.slowest if speed is None else speed, heading)
    names = {kind: name for name, kind in _KINDS.items()}
    for number, segment in enumerate(segments, 1):
        segment.plan(plan, f"segment {number} ({names[type(segment)]})")
    return vehicle.move(plan.route(LocalMap.at(lat, lon, height), height))


def segments_from_tables(tables: Iterable[Mapping[str, Any]]) -> list[Segment]:
    """Segments from tables such as a TOML file holds.

    Parameters
    ----------
    tables : iterable of mappings
        Each with ``do``, one of hold, accelerate, turn, climb, s_turns, figure_eight, stop, and the fields of that
        segment with their unit: ``duration_s, speed_mps, acceleration_mps2, braking_mps2, lateral_mps2, angle_deg,
        radius_m, height_m, rate_mps, count``. Or with ``do = "repeat"``, ``times`` and ``segments``: a list of such
        tables that is gone through several times.

    Raises
    ------
    ConfigError
        For an unknown segment or key (naming the nearest), a missing key, or a value that is no number.
    """
    found: list[Segment] = []
    for number, table in enumerate(tables, 1):
        if not isinstance(table, Mapping):
            raise ConfigError(f"segment {number} must be a table of keys, not {table!r}")
        found += _repeated(number, table) if table.get("do") == REPEAT else [_segment(str(number), dict(table))]
    return found


def _repeated(number: int, table: Mapping[str, Any]) -> list[Segment]:
    where = f"segment {number} ({REPEAT})"
    for key in table:
        if key not in ("do", "times", "segments"):
            raise ConfigError(f"{where}: there is no key '{key}', only times, segments")
    times, inner = table.get("times"), table.get("segments")
    if isinstance(times, bool) or not isinstance(times, int) or not 1 <= times <= MOST_REPEATS:
        raise ConfigError(f"{where}: times must be a whole number in 1 .. {MOST_REPEATS}, not {times!r}")
    if not isinstance(inner, list) or not inner or not all(isinstance(entry, Mapping) for entry in inner):
        raise ConfigError(f"{where}: segments must be a list of tables, not {inner!r}")
    if any(entry.get("do") == REPEAT for entry in inner):
        raise ConfigError(f"{where}: a repeat inside a repeat is not possible; write the inner one out")
    once = [_segment(f"{number}.{k}", dict(entry)) for k, entry in enumerate(inner, 1)]
    return once * times


def _segment(number: str, table: dict[str, Any]) -> Segment:
    name = table.pop("do", None)
    if not isinstance(name, str) or name not in _KINDS:
        raise ConfigError(f"segment {number}: do = {name!r} is none of {', '.join(_KINDS)}{nearest(name, _KINDS)}")
    known = {_KEYS[field.name][0]: field for field in fields(_KINDS[name])}
    values = {}
    for key, value in table.items():
        if key not in known:
            raise ConfigError(
                f"segment {number} ({name}): there is no key '{key}', only {', '.join(known)}{nearest(key, known)}"
            )
        wanted = (int,) if key == "count" else (int, float)
        if isinstance(value, bool) or not isinstance(value, wanted):
            kind = "a whole number" if key == "count" else "a number"
            raise ConfigError(f"segment {number} ({name}): {key} must be {kind}, not {value!r}")
        field = known[key].name
        if not abs(value) <= LARGEST:
            raise ConfigError(
                f"segment {number} ({name}): {key} must be finite and at most {LARGEST:g} in size, not {shown(value)}"
            )
        values[field] = value * _KEYS[field][1]
    missing = [key for key, field in known.items() if field.default is MISSING and field.name not in values]
    if missing:
        raise ConfigError(f"segment {number} ({name}) needs {' and '.join(missing)}")
    return _KINDS[name](**values)
