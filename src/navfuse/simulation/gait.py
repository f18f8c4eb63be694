"""The foot of a walker: still in stance, swung to the next footprint between."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from navfuse.simulation.bounds import require_rows
from navfuse.simulation.motion import Motion
from navfuse.simulation.pinned import pinned
from navfuse.simulation.route import Route

Array = np.ndarray

_SPACING = 0.02
_STANCE = 1.0 / 3.0
_CLEARANCE = 0.12
_NOSE_DOWN, _ROLL_OVER = 0.25, 0.9
_FULL_STEP = 0.6
_STEP = np.polynomial.Polynomial([0, 0, 0, 0, 35, -84, 70, -20])


def foot_motion(route: Route, stride: float, side: float) -> Motion:
    """Motion of an IMU on a foot whose owner walks along a route.

    Parameters
    ----------
    route : Route
        Of the walker.
    stride : float [s]
        From stance to stance; a third of it the foot stands.
    side : float [m]
        The foot is this far to the right of the route.

    Returns
    -------
    Motion
        Zero velocity and angular rate in every stance, exactly. Knots every 20 ms.

    Notes
    -----
    The stances are centred at the multiples of `stride`, at footprints beside the route at that time, the foot level
    and along the course. In the swing the foot goes straight to the next footprint, is lifted by up to 12 cm and
    pitches toes-down by up to 0.46 rad after heel-off, then toes-up by 0.14 rad before it lands; short steps in
    proportion, and none where the walker stands. A real foot rolls over heel and toe; this one lands and leaves flat.
    """
    require_rows(route.duration / _SPACING, f"a walk of {route.duration:g} s with a knot every {_SPACING:g} s")
    time = _SPACING * np.arange(np.ceil(max(route.duration / _SPACING, 5.0) - 1e-9) + 1.0)
    prints = np.minimum(stride * np.arange(np.floor(route.duration / stride) + 2.0), route.duration)
    fine = np.union1d(np.minimum(np.arange(0.0, route.duration + 0.5, 0.5), route.duration), prints)
    points = route.at(fine)
    at = np.searchsorted(fine, prints)
    course = points.course[at]
    x = points.x[at] - side * np.sin(course)
    y = points.y[at] + side * np.cos(course)
    placed = np.column_stack([x, y, points.height[at], course])
    steps = np.diff(placed, axis=0)
    scale = np.minimum((np.linalg.norm(steps[:, :3], axis=1) + 0.3 * np.abs(steps[:, 3])) / _FULL_STEP, 1.0)
    scale[scale < 1e-9] = 0.0

    k = np.minimum((time / stride).astype(int), len(steps) - 1)
    u = np.clip(((time / stride - k) - 0.5 * _STANCE) / (1.0 - _STANCE), 0.0, 1.0)
    x, y, height, course = (placed[k] + _STEP(u)[:, None] * steps[k]).T
    swing = (4.0 * u * (1.0 - u)) ** 4
    height = height + _CLEARANCE * scale[k] * swing
    pitch = -scale[k] * swing * (_NOSE_DOWN + _ROLL_OVER * np.cos(np.pi * u))
    still = (u == 0.0) | (u == 1.0) | (scale[k] == 0.0)

    forward = route.local.tangent(x, y, height, np.cos(course), np.sin(course))
    forward /= np.linalg.norm(forward, axis=1)[:, None]
    down = -route.local.normal(x, y)
    C_eb = (
        np.stack([forward, np.cross(down, forward), down], axis=2)
        @ Rotation.from_euler("Y", pitch[:, None]).as_matrix()
    )
    q_eb = Rotation.from_matrix(C_eb).as_quat(scalar_first=True)
    return pinned(Motion.from_knots(time, route.local.position(x, y, height), q_eb), time, still)
