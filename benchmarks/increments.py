"""Perfect increments along one motion: ours, and those that python-ins synthesizes from a table of it.

The measure is a quadrature of the same motion, 16 Gauss-Legendre nodes between any two stamps or knots. python-ins
knows the motion at the stamps only and draws cubic splines through them; its gravity lacks the flattening in the
reduction for height, which the last column but one leaves out.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from navfuse.core.earth import normal_gravity
from navfuse.simulation import (
    Accelerate,
    Hold,
    Motion,
    Stop,
    STurns,
    Turn,
    car_drive,
    drive,
    figure_eight_flight,
    pedestrian,
    perfect_imu,
    sample_times,
)

REPEATS = 3
SECONDS = 600.0
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)


def main() -> None:
    """Measure and print."""
    console = Console(width=None if sys.stdout.isatty() else 120)
    walk = [Accelerate(1.4), Hold(20.0), Turn(1.2), STurns(0.5), Stop(6.0)]
    motions = {
        "car": car_drive(SECONDS, seed=1),
        "flight": figure_eight_flight(SECONDS, speed=100.0),
        "foot": drive(pedestrian(), [Hold(10.0), *walk * math.ceil(SECONDS / 40.0), Hold(5.0)]),
    }
    table = Table(
        title=f"Increments along {SECONDS:.0f} s: rms of the difference from a quadrature / rms of the signal"
    )
    for name in ("motion", "Hz", "tool", "gyro", "accel", "accel, one gravity", f"s (best of {REPEATS})"):
        table.add_column(name, justify="left" if name in ("motion", "tool") else "right")
    for name, motion in motions.items():
        for rate in (50.0, 100.0):
            _add_rows(table, name, motion, rate)
    console.print(table)


def _add_rows(table: Table, name: str, motion: Motion, rate: float) -> None:
    from importlib.metadata import version

    stamps = sample_times(0.0, SECONDS, rate)
    expected = quadrature(motion, stamps)
    state, rows = motion.at(stamps), motion.trajectory(stamps)
    lla = np.column_stack([np.degrees(rows.lat), np.degrees(rows.lon), rows.height])
    rph, velocity = np.degrees(rows.attitude), rows.velocity_n
    gravity = gravity_difference(motion, stamps)
    none = np.zeros_like(gravity)
    peer = f"python-ins {version('python-ins')}"
    tools: dict[str, tuple[Callable[[], Any], np.ndarray]] = {
        "navfuse": (lambda: _ours(motion, stamps), none),
        "navfuse, motion through the table": (
            lambda: _ours(Motion.from_knots(stamps, state.r_e, state.q_eb), stamps),
            none,
        ),
        peer: (lambda: _theirs(stamps, lla, rph, velocity), gravity),
        f"{peer}, without velocities": (lambda: _theirs(stamps, lla, rph, None), gravity),
    }
    best = dict.fromkeys(tools, math.inf)
    found = {}
    for _ in range(REPEATS):
        for tool, (call, _) in tools.items():
            begin = time.perf_counter()
            found[tool] = call()
            best[tool] = min(best[tool], time.perf_counter() - begin)
    for tool, (_, offset) in tools.items():
        gyro, accel = found[tool]
        columns = [(gyro, expected[0]), (accel, expected[1]), (accel + offset, expected[1])]
        figures = [f"{_relative(got, wanted):.1e}" for got, wanted in columns]
        table.add_row(name, f"{rate:.0f}", tool, *figures, f"{best[tool]:.3f}")


def _ours(motion: Motion, stamps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    log = perfect_imu(motion, stamps)
    return log.gyro[1:], log.accel[1:]


def _theirs(stamps: np.ndarray, lla: np.ndarray, rph: np.ndarray, velocity: np.ndarray | None) -> Any:
    from pyins import sim

    imu = sim.generate_imu(stamps, lla, rph, velocity, "increment")[1].to_numpy()[1:]
    return imu[:, :3], imu[:, 3:]


def _relative(got: np.ndarray, wanted: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(got - wanted)) / np.mean(np.square(wanted))))


def quadrature(motion: Motion, stamps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Integrals of rate and specific force between the stamps, on panels that no knot of the motion cuts."""
    inside = (motion.knots > stamps[0]) & (motion.knots < stamps[-1])
    edges = np.union1d(stamps, motion.knots[inside])
    half = 0.5 * np.diff(edges)
    interval = np.searchsorted(stamps, edges[:-1], side="right") - 1
    gyro, accel = np.zeros((stamps.size - 1, 3)), np.zeros((stamps.size - 1, 3))
    for node, weight in zip(NODES, WEIGHTS, strict=True):
        state = motion.at(edges[:-1] + half * (1.0 + node))
        np.add.at(gyro, interval, (weight * half)[:, None] * state.w_ib_b)
        np.add.at(accel, interval, (weight * half)[:, None] * state.f_b)
    return gyro, accel


def gravity_difference(motion: Motion, stamps: np.ndarray) -> np.ndarray:
    """What python-ins would have to add to its velocity increments [m/s] if its gravity were ours."""
    from pyins import earth

    middle = 0.5 * (stamps[1:] + stamps[:-1])
    rows = motion.trajectory(middle)
    ours = np.array([normal_gravity(math.sin(lat), h) for lat, h in zip(rows.lat, rows.height, strict=True)])
    more = ours - earth.gravity(np.degrees(rows.lat), rows.height)
    return -(more * np.diff(stamps))[:, None] * motion.C_nb(middle)[:, 2, :]


if __name__ == "__main__":
    main()
