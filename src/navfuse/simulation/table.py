"""A rotating table: the motion of a calibration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from navfuse.core.earth import geodetic_to_ecef
from navfuse.core.rotation import dcm_from_euler
from navfuse.errors import ConfigError
from navfuse.simulation.bounds import require_rows
from navfuse.simulation.motion import Motion
from navfuse.simulation.paths import LocalMap, SmoothSteps, Turning
from navfuse.simulation.pinned import pinned
from navfuse.simulation.rules import quaternions

_SPACING = 0.02
_FASTEST = 20.0


@dataclass(frozen=True, slots=True)
class TableMove:
    """One move of a rotating table, and the rest after it.

    Attributes
    ----------
    axis : {"x", "y", "z"}
        Body axis it turns about.
    angle : float [rad]
        Signed, any number of turns.
    duration : float [s]
        Of the move. The rate grows smoothly in its first and falls in its last `ramp`, and is constant between.
    pause : float [s]
        Rest after the move.
    ramp : float [s] or None
        None for a fifth of the duration.
    """

    axis: Literal["x", "y", "z"]
    angle: float
    duration: float
    pause: float = 10.0
    ramp: float | None = None


def rotating_table(
    moves: Sequence[TableMove],
    *,
    lat: float = 0.8,
    lon: float = 0.2,
    height: float = 100.0,
    roll: float = 0.0,
    pitch: float = 0.0,
    heading: float = 0.0,
    rest: float = 10.0,
    offset_b: ArrayLike = (0.0, 0.0, 0.0),
) -> Motion:
    """An IMU on a table that turns it about its own axes, one after the other.

    Parameters
    ----------
    moves : sequence of TableMove
    lat, lon, height : float [rad, rad, m]
        Of the point that stays where it is.
    roll, pitch, heading : float [rad]
        At the start.
    rest : float [s]
        Before the first move.
    offset_b : (3,) array [m]
        From the fixed point to the IMU, in b.

    Returns
    -------
    Motion
        Knots every 20 ms; in the rests velocity and angular rate against the Earth are exactly zero.

    Raises
    ------
    ConfigError
        For no moves, an unknown axis, times that are not finite and positive (rests may be 0), ramps longer than half
        the move, or more than 20 rad/s; names the move by its number from 1.
    """
    if not moves:
        raise ConfigError("a rotating table needs at least one move")
    if not 0.0 <= rest < math.inf:
        raise ConfigError(f"the rest before the first move must be finite and not negative, not {rest!r} s")
    steps: dict[str, list[tuple[float, float, float]]] = {"x": [], "y": [], "z": []}
    starts, names, t = [], [], rest
    spans = [(0.0, rest)]
    for number, move in enumerate(moves, 1):
        ramp = 0.2 * move.duration if move.ramp is None else move.ramp
        rate = _checked_rate(number, move, ramp)
        steps[move.axis] += [(t, ramp, rate), (t + move.duration - ramp, ramp, -rate)]
        starts.append(t)
        names.append(move.axis)
        t += move.duration
        spans.append((t, t + move.pause))
        t += move.pause

    require_rows(t / _SPACING, f"the moves last {t:g} s and with a knot every {_SPACING:g} s")
    time = np.linspace(0.0, t, max(round(t / _SPACING), 5) + 1)
    turned = {axis: Turning(0.0, SmoothSteps(0.0, list_)).value(time) for axis, list_ in steps.items()}
    current = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, None)
    attitude = np.empty((time.size, 3, 3))
    base = np.array(dcm_from_euler(roll, pitch, heading)).reshape(3, 3)
    done = dict.fromkeys("xyz", 0.0)
    for number, (axis, move) in enumerate(zip(names, moves, strict=True)):
        rows = current == number
        angle = turned[axis][rows] - done[axis]
        attitude[rows] = base @ Rotation.from_euler(axis.upper(), angle[:, None]).as_matrix()
        base = base @ Rotation.from_euler(axis.upper(), move.angle).as_matrix()
        done[axis] += move.angle

    local = LocalMap.at(lat, lon)
    C_eb = np.column_stack([local.north, local.east, -local.up]) @ attitude
    r_e = np.array(geodetic_to_ecef(lat, lon, height)) + C_eb @ np.asarray(offset_b, dtype=float)
    still = np.zeros(time.size, dtype=bool)
    for first, last in spans:
        still |= (time >= first) & (time <= last)
    return pinned(Motion.from_knots(time, r_e, quaternions(C_eb)), time, still)


def _checked_rate(number: int, move: TableMove, ramp: float) -> float:
    """Constant rate [rad/s] of a move."""
    if move.axis not in ("x", "y", "z"):
        raise ConfigError(f"move {number}: the axis is 'x', 'y' or 'z', not {move.axis!r}")
    if not (0.0 < move.duration < math.inf and 0.0 <= move.pause < math.inf and math.isfinite(move.angle)):
        raise ConfigError(
            f"move {number}: angle, duration > 0 and pause >= 0 must be finite, not {move.angle!r} rad, "
            f"{move.duration!r} s and {move.pause!r} s"
        )
    if not 0.0 < ramp <= 0.5 * move.duration:
        raise ConfigError(f"move {number}: the ramp must lie in (0, duration / 2], not {ramp!r} s")
    rate = move.angle / (move.duration - ramp)
    if abs(rate) > _FASTEST:
        raise ConfigError(
            f"move {number}: {math.degrees(abs(rate)):.0f} deg/s is too fast, the limit is "
            f"{math.degrees(_FASTEST):.0f} deg/s"
        )
    return rate
