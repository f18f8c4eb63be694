"""A mission for every vehicle, which repeats laps of all it does until a time is over."""

from __future__ import annotations

import math

from navfuse.simulation import (
    Accelerate,
    Climb,
    FigureEight,
    Hold,
    Motion,
    Stop,
    STurns,
    TableMove,
    Turn,
    aircraft,
    boat,
    car,
    drive,
    drone,
    pedestrian,
    rotating_table,
)

MISSIONS = {
    "car": (
        lambda: car(hills=0.05, seed=1),
        [Accelerate(14.0), Turn(1.2), Hold(8.0), STurns(0.5), FigureEight(), Climb(5.0), Climb(-5.0), Stop(6.0)],
        60.0,
    ),
    "aircraft": (
        aircraft,
        [Accelerate(70.0), Turn(1.2), Hold(8.0), STurns(0.5), FigureEight(), Climb(60.0), Climb(-60.0)],
        210.0,
    ),
    "boat": (
        boat,
        [Accelerate(8.0), Turn(1.2), Hold(8.0), STurns(0.5), FigureEight(), Stop(6.0)],
        140.0,
    ),
    "drone": (
        drone,
        [
            Accelerate(10.0),
            Hold(20.0),
            Turn(1.2, lateral=1.5),
            STurns(0.3),
            Stop(4.0),
            Climb(20.0),
            Turn(-2.0),
            Climb(-20.0),
        ],
        90.0,
    ),
    "drone, hard": (
        drone,
        [
            Accelerate(10.0),
            Hold(20.0),
            Turn(1.2),
            STurns(0.5),
            Stop(4.0),
            Climb(20.0),
            Turn(-2.0),
            Climb(-20.0),
        ],
        90.0,
    ),
    "pedestrian": (pedestrian, [Accelerate(1.4), Hold(20.0), Turn(1.2), STurns(0.5), Stop(6.0)], 45.0),
}
"""Vehicle, one lap, and about how long it takes [s]. The two drones differ in the first turn and the S-turns alone."""


def mission(name: str, duration: float, **place: float) -> Motion:
    """A motion of at least `duration` [s] by one of :data:`MISSIONS` or the rotating table."""
    if name == "table":
        lap = [TableMove(axis, sign * 0.5 * math.pi, 4.0, 6.0) for axis in "xyz" for sign in (1.0, -1.0)]
        return rotating_table(lap * math.ceil(duration / 60.0), offset_b=(0.1, 0.2, 0.0), **place)
    vehicle, lap, lasts = MISSIONS[name]
    return drive(vehicle(), [Hold(10.0), *lap * math.ceil(duration / lasts), Hold(5.0)], **place)


NAMES = (*MISSIONS, "table")
