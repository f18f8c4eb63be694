"""How a body moved and turned, from the epochs of a trajectory alone: any time, any point of the body, rates included.

Position between epochs is the cubic Hermite polynomial of :mod:`navfuse.analysis.interpolation`. Velocity and attitude
are cubic splines through their epochs: the velocity in ECEF axes, the attitude through the sum of the rotation vectors
from epoch to epoch, whose derivative is the angular rate but for half a commutator, dt^2 |w x w'| / 12. So attitude is
of third order in the interval and the rate of second with a small factor: with epochs at 10 Hz 0.0005 deg and 0.4 mm/s
at an arm of two metres in the sharpest manoeuvres of a car. Splines do not reach across gaps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfuse.analysis.interpolation import EarthStates, conjugate, interpolate, multiply
from navfuse.core.rotation import dcm_from_quat_batch

Array = np.ndarray


@dataclass(frozen=True, slots=True)
class BodyMotion:
    """A body at some times, everything in ECEF axes or body axes.

    Attributes
    ----------
    time : (n,) array [s]
    r_e : (n, 3) array [m]
    v_e, a_e : (n, 3) arrays [m/s], [m/s^2], or None
        Velocity and acceleration relative to the Earth. None without velocities.
    q_eb : (n, 4) array or None
        Body to Earth. None without attitude.
    w_eb_b, dw_eb_b : (n, 3) arrays [rad/s], [rad/s^2], or None
        Angular rate of the body against the Earth, in body axes, and its derivative.
    lone : (n,) bool array
        Times at an epoch that has no neighbour: rates and accelerations are zero there for want of anything better.
    """

    time: Array
    r_e: Array
    v_e: Array | None
    a_e: Array | None
    q_eb: Array | None
    w_eb_b: Array | None
    dw_eb_b: Array | None
    lone: Array

    def moved(self, lever_arm: Array) -> BodyMotion:
        """The motion of another point of the body; exact, as the body is rigid.

        Parameters
        ----------
        lever_arm : (3,) array [m]
            From here to there, body axes. Needs the attitude.
        """
        assert self.q_eb is not None
        assert self.w_eb_b is not None
        assert self.dw_eb_b is not None
        C_eb = dcm_from_quat_batch(self.q_eb)
        swept = np.cross(self.w_eb_b, lever_arm)
        pulled = np.cross(self.dw_eb_b, lever_arm) + np.cross(self.w_eb_b, swept)
        v_e = None if self.v_e is None else self.v_e + np.einsum("nij,nj->ni", C_eb, swept)
        a_e = None if self.a_e is None else self.a_e + np.einsum("nij,nj->ni", C_eb, pulled)
        r_e = self.r_e + C_eb @ lever_arm
        return BodyMotion(self.time, r_e, v_e, a_e, self.q_eb, self.w_eb_b, self.dw_eb_b, self.lone)


def body_motion(states: EarthStates, time: Array, max_gap_s: float) -> BodyMotion:
    """A body at times inside the span of its epochs and outside gaps.

    Parameters
    ----------
    states : EarthStates
        The epochs, time increasing.
    time : (n,) array [s]
        Any order; :func:`navfuse.analysis.interpolation.covered` tells which are allowed.
    max_gap_s : float [s]
        Splines end at longer intervals between epochs.
    """
    epochs = states.time
    left = np.clip(np.searchsorted(epochs, time, side="right") - 1, 0, epochs.size - 1)
    breaks = np.flatnonzero(np.diff(epochs) > max_gap_s) + 1
    starts, ends = np.append(0, breaks), np.append(breaks, epochs.size)
    # The end of a piece belongs to it, so a time just behind it, inside the gap, cannot come here.
    piece = np.searchsorted(breaks, left, side="right")
    lone = (ends - starts)[piece] == 1
    r_e = states.r_e[left] if epochs.size == 1 else _positions(states, time, left)
    steps = None if states.q_eb is None else _rotation_vectors(states.q_eb)
    v_e = a_e = q_eb = rate = acceleration = None
    if states.v_e is not None:
        v_e, a_e = states.v_e[left], np.zeros((time.size, 3))
    if states.q_eb is not None:
        q_eb, rate, acceleration = states.q_eb[left], np.zeros((time.size, 3)), np.zeros((time.size, 3))
    for k in np.unique(piece[~lone]):
        rows, span = np.flatnonzero(piece == k), slice(starts[k], ends[k])
        at = time[rows]
        if states.v_e is not None and v_e is not None and a_e is not None:
            curve = _spline(epochs[span], states.v_e[span])
            v_e[rows], a_e[rows] = curve(at), curve(at, 1)
        if steps is not None and q_eb is not None and rate is not None and acceleration is not None:
            angle = np.vstack((np.zeros(3), np.cumsum(steps[starts[k] : ends[k] - 1], axis=0)))
            curve = _spline(epochs[span], angle)
            turn = curve(at) - angle[left[rows] - starts[k]]
            q_eb[rows] = multiply(q_eb[rows], _quaternions(turn))
            rate[rows], acceleration[rows] = curve(at, 1), curve(at, 2)
    if q_eb is not None:
        q_eb = q_eb / np.linalg.norm(q_eb, axis=1, keepdims=True)
    return BodyMotion(time, r_e, v_e, a_e, q_eb, rate, acceleration, lone)


def _positions(states: EarthStates, time: Array, left: Array) -> Array:
    """Positions between epochs; those at epochs to the last digit."""
    r_e = interpolate(EarthStates(states.time, states.r_e, states.v_e), time).r_e
    return np.where((time == states.time[left])[:, np.newaxis], states.r_e[left], r_e)


def _spline(epochs: Array, values: Array):
    from scipy.interpolate import CubicSpline

    return CubicSpline(epochs, values)


def _rotation_vectors(q: Array) -> Array:
    """From each attitude (n, 4) to the next, in the axes of the body: (n - 1, 3) [rad]."""
    delta = multiply(conjugate(q[:-1]), q[1:])
    delta *= np.where(delta[:, :1] < 0.0, -1.0, 1.0)
    sine = np.linalg.norm(delta[:, 1:], axis=1, keepdims=True)
    half = np.arctan2(sine, delta[:, :1])
    return delta[:, 1:] * np.where(sine < 1e-12, 2.0, 2.0 * half / np.where(sine < 1e-12, 1.0, sine))


def _quaternions(turn: Array) -> Array:
    """Quaternions (n, 4) of rotation vectors (n, 3)."""
    half = 0.5 * np.linalg.norm(turn, axis=1, keepdims=True)
    return np.hstack((np.cos(half), 0.5 * np.sinc(half / np.pi) * turn))
