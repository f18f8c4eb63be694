"""Beginnings of logs that a start has to be found in: standing, moving, reversing, flying."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from navfuse.simulation import Motion, car_drive, figure_eight_flight
from navfuse.simulation.paths import LocalMap, SmoothSteps, integrate_path

LEVER = (1.0, -0.8, -1.5)


def level_drive(duration, speeds, courses=(), heading=0.6, speed=0.0):
    """A vehicle on a plane, pointing along its course whichever way it rolls; steps as in SmoothSteps."""
    time = np.linspace(0.0, duration, round(duration * 10) + 1)
    path, course = SmoothSteps(speed, list(speeds)), SmoothSteps(heading, list(courses))
    x, y = integrate_path(time, path, course)
    local, height, psi = LocalMap.at(0.8, 0.2, 100.0), np.full(time.size, 100.0), course.value(time)
    up = local.normal(x, y)
    forward = local.tangent(x, y, height, np.cos(psi), np.sin(psi))
    forward /= np.linalg.norm(forward, axis=1)[:, None]
    C_eb = np.stack([forward, np.cross(-up, forward), -up], axis=2)
    return Motion.from_knots(time, local.position(x, y, height), Rotation.from_matrix(C_eb).as_quat(scalar_first=True))


def reversing(seed):
    """Backs out of a parking space in a curve, then drives off."""
    back = 2.0 + 0.2 * (seed % 7)
    t = 8.0 + seed % 5
    speeds = [(t, 3.0, -back), (t + 8.0, 3.0, back), (t + 16.0, 5.0, 10.0), (t + 50.0, 4.0, -4.0)]
    return level_drive(90.0, speeds, [(t + 4.0, 4.0, -0.5), (t + 27.0, 4.0, 1.2)], heading=(1.1 * seed) % 6.28)


SCENES = {
    "standing, velocity": (lambda s: car_drive(60.0, seed=s, heading=0.37 * s, standing=20.0), 0.0, {}),
    "standing, positions": (
        lambda s: car_drive(90.0, seed=s, heading=0.37 * s, standing=20.0), 0.0, {"sd_velocity": None},
    ),
    "standing, lever arm": (
        lambda s: car_drive(60.0, seed=s, heading=0.37 * s, standing=20.0), 0.0, {"lever_arm_b": LEVER},
    ),
    "moving, velocity": (lambda s: car_drive(100.0, seed=s, heading=0.37 * s, standing=2.0), 33.0, {}),
    "moving, positions": (
        lambda s: car_drive(130.0, seed=s, heading=0.37 * s, standing=2.0), 33.0, {"sd_velocity": None},
    ),
    "moving, lever arm": (
        lambda s: car_drive(100.0, seed=s, heading=0.37 * s, standing=2.0), 33.0, {"lever_arm_b": LEVER},
    ),
    "reversing first, velocity": (reversing, 0.0, {}),
    "reversing first, positions": (reversing, 0.0, {"sd_velocity": None}),
    "flight, velocity": (lambda s: figure_eight_flight(100.0, heading=0.37 * s), 5.0, {}),
    "flight, positions": (lambda s: figure_eight_flight(100.0, heading=0.37 * s), 5.0, {"sd_velocity": None}),
}  # fmt: skip
"""Name -> (motion of a seed, where the inertial log begins [s], options of the simulated logs)."""
