"""The ``[motion]`` table of a scenario: a vehicle and what it does, or a table of where it was."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from navfuse.errors import ConfigError, InputError
from navfuse.simulation.motion import Motion
from navfuse.simulation.route import Vehicle
from navfuse.simulation.rules import VEHICLES
from navfuse.simulation.scenario_table import ScenarioTable
from navfuse.simulation.segments import drive, segments_from_tables
from navfuse.simulation.table import TableMove, rotating_table
from navfuse.simulation.track import follow_track
from navfuse.simulation.track_files import read_track
from navfuse.simulation.vehicles import car_drive, static
from navfuse.simulation.waypoints import Waypoint, follow_waypoints, local_waypoints

_DEG = math.pi / 180.0

_TRAITS: dict[str, dict[str, tuple[str, float]]] = {
    "car": {"hills": ("hills", 1.0), "hills_seed": ("seed", 1)},
    "aircraft": {},
    "boat": {
        "roll_rms_deg": ("roll", _DEG),
        "pitch_rms_deg": ("pitch", _DEG),
        "heave_rms_m": ("heave", 1.0),
        "waves_seed": ("seed", 1),
    },
    "drone": {"drag_per_s": ("drag", 1.0)},
    "pedestrian": {"stride_s": ("stride", 1.0), "side_m": ("side", 1.0)},
}
_LIMITS = {
    "slowest_mps": ("slowest", 1.0),
    "fastest_mps": ("fastest", 1.0),
    "acceleration_mps2": ("acceleration", 1.0),
    "braking_mps2": ("braking", 1.0),
    "lateral_mps2": ("lateral", 1.0),
    "turn_rate_degps": ("turn_rate", _DEG),
    "climb_rate_mps": ("climb_rate", 1.0),
    "slope": ("slope", 1.0),
    "ramp_s": ("ramp", 1.0),
}
KINDS = (*VEHICLES, "city-car", "static", "rotating-table", "track")


def read_motion(table: Mapping[str, Any], folder: Path, source: str) -> Callable[[], Motion]:
    """A function that makes the motion; what can be checked before that is checked now.

    Parameters
    ----------
    table : mapping
        The ``[motion]`` table. ``vehicle`` is one of :data:`KINDS`; the place is ``lat_deg, lon_deg, height_m,
        heading_deg``.

        * car, aircraft, boat, drone, pedestrian: ``segments`` (and ``speed_mps`` at the start) as
          :func:`~navfuse.simulation.segments.segments_from_tables` takes them, or ``waypoints``, each with ``lat_deg,
          lon_deg, height_m`` or ``north_m, east_m, up_m`` (from the place), ``speed_mps`` and ``pause_s``; traits of
          the vehicle and a table ``limits``.
        * city-car: ``duration_s, standing_s, hills, seed``: a random drive through a town.
        * static: ``duration_s, roll_deg, pitch_deg``.
        * rotating-table: ``moves``, each with ``axis, angle_deg, duration_s, pause_s, ramp_s``; ``rest_s, offset_m,
          roll_deg, pitch_deg``.
        * track: ``file`` (relative to the scenario), ``rule``, ``spacing_s``, ``max_gap_s``.
    folder : Path
        Of the scenario file.
    source : str
        Name of the scenario, for messages.

    Raises
    ------
    ConfigError
        For an unknown vehicle or key, a value that cannot be, or (when the motion is made) what the vehicle cannot do.
    InputError
        When the motion is made: for a track that cannot be followed.
    """
    keys = ScenarioTable(f"{source}: [motion]", table)
    kind = keys.text("vehicle", known=KINDS)
    make = _FORMS.get(kind, _driven)(keys, kind, folder)
    keys.finish()

    def motion() -> Motion:
        try:
            return make()
        except ConfigError as error:
            raise ConfigError(f"{source}: [motion]: {error}") from error
        except InputError as error:
            raise InputError(f"{source}: [motion]: {error}") from error

    return motion


def _place(keys: ScenarioTable) -> dict[str, float]:
    lat = keys.number("lat_deg", 48.0)
    if abs(lat) > 90.0:
        raise ConfigError(f"{keys.where}: lat_deg must lie in -90 .. 90, not {lat!r}")
    lon, height = keys.number("lon_deg", 11.5), keys.number("height_m", 500.0)
    if not -180.0 <= lon <= 360.0:
        raise ConfigError(f"{keys.where}: lon_deg must lie in -180 .. 360, not {lon!r}")
    if not -12e3 <= height <= 1e6:
        raise ConfigError(f"{keys.where}: height_m must lie in -12000 .. 1e6, not {height!r}")
    return {
        "lat": lat * _DEG,
        "lon": lon * _DEG,
        "height": height,
        "heading": keys.number("heading_deg", 0.0, _DEG),
    }


def _driven(keys: ScenarioTable, kind: str, folder: Path) -> Callable[[], Motion]:
    place = _place(keys)
    traits: dict[str, Any] = {}
    for key, (name, factor) in _TRAITS[kind].items():
        if key in keys:
            traits[name] = keys.whole(key, 0) if name == "seed" else keys.number(key, factor=factor)
    limits = ScenarioTable(f"{keys.where[:-1]}.limits]", keys.get("limits", {}))
    changed: dict[str, Any] = {
        name: limits.number(key, factor=factor) for key, (name, factor) in _LIMITS.items() if key in limits
    }
    if "pivots" in limits:
        changed["pivots"] = limits.yes("pivots")
    limits.finish()
    if ("segments" in keys) == ("waypoints" in keys):
        raise ConfigError(f"{keys.where}: a {kind} needs either segments or waypoints")

    def vehicle() -> Vehicle:
        return dataclasses.replace(VEHICLES[kind](**traits), **changed)

    if "segments" in keys:
        try:
            segments = segments_from_tables(keys.tables("segments"))
        except ConfigError as error:
            raise ConfigError(f"{keys.where}: {error}" if keys.where not in str(error) else str(error)) from error
        speed = keys.number("speed_mps") if "speed_mps" in keys else None
        return lambda: drive(vehicle(), segments, **place, speed=speed)
    waypoints = _waypoints(keys, place)
    return lambda: follow_waypoints(vehicle(), waypoints)


def _waypoints(keys: ScenarioTable, place: dict[str, float]) -> list[Waypoint]:
    found: list[Waypoint] = []
    for number, entry in enumerate(keys.tables("waypoints"), 1):
        point = ScenarioTable(f"{keys.where}, waypoint {number}", entry)
        speed, pause = point.number("speed_mps"), point.number("pause_s", 0.0)
        local = "north_m" in point or "east_m" in point
        if local and ("lat_deg" in point or "lon_deg" in point):
            raise ConfigError(f"{point.where}: give lat_deg and lon_deg, or north_m and east_m, not both")
        if local:
            row = [point.number("north_m"), point.number("east_m"), point.number("up_m", 0.0), speed, pause]
            found += local_waypoints(place["lat"], place["lon"], place["height"], [row])
        else:
            lat, lon = point.number("lat_deg", factor=_DEG), point.number("lon_deg", factor=_DEG)
            height = point.number("height_m") if "height_m" in point else place["height"]
            found.append(Waypoint(lat, lon, height, speed, pause))
        point.finish()
    return found


def _city(keys: ScenarioTable, kind: str, folder: Path) -> Callable[[], Motion]:
    place = _place(keys)
    duration, standing = keys.number("duration_s", 600.0, above=0.0), keys.number("standing_s", 20.0)
    hills, seed = keys.number("hills", 0.05), keys.whole("seed", 1)
    return lambda: car_drive(duration, seed, **place, standing=standing, hills=hills)


def _static(keys: ScenarioTable, kind: str, folder: Path) -> Callable[[], Motion]:
    place, duration = _place(keys), keys.number("duration_s", above=0.0)
    roll, pitch = keys.number("roll_deg", 0.0, _DEG), keys.number("pitch_deg", 0.0, _DEG)
    return lambda: static(duration, **place, roll=roll, pitch=pitch)


def _table(keys: ScenarioTable, kind: str, folder: Path) -> Callable[[], Motion]:
    place, rest, offset = _place(keys), keys.number("rest_s", 10.0), keys.three("offset_m", (0.0, 0.0, 0.0))
    roll, pitch = keys.number("roll_deg", 0.0, _DEG), keys.number("pitch_deg", 0.0, _DEG)
    moves = []
    for number, entry in enumerate(keys.tables("moves"), 1):
        move = ScenarioTable(f"{keys.where}, move {number}", entry)
        axis: Any = move.text("axis", known=("x", "y", "z"))
        angle, duration = move.number("angle_deg", factor=_DEG), move.number("duration_s", above=0.0)
        ramp = move.number("ramp_s") if "ramp_s" in move else None
        moves.append(TableMove(axis, angle, duration, move.number("pause_s", 10.0), ramp))
        move.finish()
    return lambda: rotating_table(moves, **place, roll=roll, pitch=pitch, rest=rest, offset_b=offset)


def _track(keys: ScenarioTable, kind: str, folder: Path) -> Callable[[], Motion]:
    path = folder / Path(keys.text("file")).expanduser()
    rule: Any = keys.text("rule", known=("car", "aircraft", "drone")) if "rule" in keys else None
    spacing = keys.number("spacing_s", above=0.0) if "spacing_s" in keys else None
    max_gap = keys.number("max_gap_s", above=0.0) if "max_gap_s" in keys else None
    return lambda: follow_track(read_track(path), rule, spacing=spacing, max_gap=max_gap)


_FORMS: dict[str, Callable[[ScenarioTable, str, Path], Callable[[], Motion]]] = {
    "city-car": _city,
    "static": _static,
    "rotating-table": _table,
    "track": _track,
}
