"""A motion that stands truly still: the spline's ringing beside a standstill is taken out."""

from __future__ import annotations

import numpy as np

from navfuse.simulation.motion import Motion

Array = np.ndarray

_FIRST = np.array([5.0, 4.0, 3.0, 2.0, 1.0])
_SECOND = np.array([20.0, 12.0, 6.0, 2.0])
_HERMITE = np.array(
    [
        [-6.0, 6.0, -3.0, -3.0, -0.5, 0.5],
        [15.0, -15.0, 8.0, 7.0, 1.5, -1.0],
        [-10.0, 10.0, -6.0, -4.0, -1.5, 0.5],
        [0.0, 0.0, 0.0, 0.0, 0.5, 0.0],
        [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    ]
)
"""Powers 5..0 on the unit interval of the quintic with given value, slope and curvature at both ends."""


def runs_of(still: Array) -> list[tuple[int, int]]:
    """First and last index of every run of at least two True values.

    Parameters
    ----------
    still : (n,) bool array

    Returns
    -------
    list of (first, last)
        Both inside the run.
    """
    edges = np.diff(np.concatenate([[0], np.asarray(still, dtype=np.int8), [0]]))
    first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return [(int(a), int(b)) for a, b in zip(first, last, strict=True) if b > a]


def pinned(motion: Motion, time: Array, still: Array) -> Motion:
    """The same motion, with exactly zero velocity and angular rate against the Earth between still knots.

    Parameters
    ----------
    motion : Motion
        From knots that repeat the same position and attitude while the body stands.
    time : (n,) array [s]
        The times that the motion was made from; its knots are some of them (the second and third, and the last but
        one and but two, are none).
    still : (n,) bool array
        At which of them it stands. A run of one knot alone is left as it is.

    Returns
    -------
    Motion
        Position and attitude are twice continuously differentiable at the ends of a standstill, and as smooth as
        before elsewhere: outside, a spline piece is the quintic that its end values and derivatives determine.

    Notes
    -----
    An interpolating spline through a standstill keeps moving by a part of its interpolation error, which decays by
    about 0.43 a knot. Here value, velocity and acceleration of the standing knots are set, and quintic Hermite pieces
    drawn through all.
    """
    runs = runs_of(still[np.searchsorted(time, motion.knots)])
    if not runs:
        return motion
    c, dt = motion.coefficients, np.diff(motion.knots)[:, None]
    last = c[-1] * (dt[-1] ** np.arange(5, -1, -1))[:, None]
    value = np.vstack([c[:, 5], last.sum(axis=0)])
    slope = np.vstack([c[:, 4], (_FIRST @ last[:5]) / dt[-1]])
    curve = np.vstack([2.0 * c[:, 3], (_SECOND @ last[:4]) / dt[-1] ** 2])
    for a, b in runs:
        value[a : b + 1] = value[a]
        slope[a : b + 1] = 0.0
        curve[a : b + 1] = 0.0
    ends = [value[:-1], value[1:], dt * slope[:-1], dt * slope[1:], dt**2 * curve[:-1], dt**2 * curve[1:]]
    pieces = np.einsum("ph,hij->ipj", _HERMITE, np.stack(ends))
    pieces /= dt[:, :, None] ** np.arange(5, -1, -1)[:, None]
    for a, b in runs:
        pieces[a:b, :5] = 0.0
    return Motion(motion.knots, pieces, motion.origin)
