"""A motion that is known exactly: position and attitude as smooth functions of time, with all their derivatives.

The truth of a simulation. It is held in Earth-centred axes as interpolating quintic splines of position and of the
attitude quaternion, so that no place on Earth (poles, date line) and no attitude (straight up, inverted) is special.
The spline *is* the truth: velocity, acceleration, angular rate and specific force are its exact derivatives, whatever
it was made from.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import make_interp_spline

from navfuse.core.rotation import dcm_from_quat_batch
from navfuse.data.trajectory import Trajectory
from navfuse.errors import InputError
from navfuse.simulation.motion_kernels import local_level, motion_at_times

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Array = np.ndarray

_DEGREE = 5
_FEWEST_KNOTS = _DEGREE + 1


@dataclass(frozen=True, slots=True)
class MotionState:
    """A motion at some times.

    Attributes
    ----------
    time : (n,) array [s]
    r_e, v_e, a_e : (n, 3) arrays [m], [m/s], [m/s^2]
        Position, velocity and acceleration relative to the Earth, resolved in e.
    q_eb : (n, 4) array
        Attitude quaternion that takes b to e, scalar first.
    w_eb_b, w_ib_b : (n, 3) arrays [rad/s]
        Angular rate of the body against the Earth, and against inertial space (what an ideal gyro reads).
    f_b : (n, 3) array [m/s^2]
        Specific force (what an ideal accelerometer reads).
    """

    time: Array
    r_e: Array
    v_e: Array
    a_e: Array
    q_eb: Array
    w_eb_b: Array
    w_ib_b: Array
    f_b: Array


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Position and attitude of a body as functions of time; made by :meth:`from_knots` or a vehicle of this package.

    All methods take one time or an (n,) array of times [s] within [start, end], in any order, and raise
    :class:`~navfuse.errors.InputError` for a time outside. One time gives one vector, n times an array of n.

    Attributes
    ----------
    knots : (m + 1,) array [s]
        Where the polynomial pieces join, four times continuously differentiable.
    coefficients : (m, 6, 7) array
        Powers 5..0 of the time since the knot, of ``r_e - origin`` [m] and of the unnormalised ``q_eb``.
    origin : (3,) array [m]
        A point of the motion in e; subtracting it keeps the polynomials free of the rounding of 6.4e6 m.
    """

    knots: Array
    coefficients: Array
    origin: Array

    @classmethod
    def from_knots(cls, time: ArrayLike, r_e: ArrayLike, q_eb: ArrayLike) -> Motion:
        """The smooth motion through given positions and attitudes.

        Parameters
        ----------
        time : (n,) array [s]
            Strictly increasing, n >= 6. Even spacing interpolates best.
        r_e : (n, 3) array [m]
            Positions in e.
        q_eb : (n, 4) array
            Attitude quaternions that take b to e; either sign. Neighbours must be less than half a turn apart, and for
            a good interpolation a few degrees.

        Raises
        ------
        InputError
            For wrong shapes, too few knots, times that do not increase, or values that are not finite.

        Notes
        -----
        The interpolation error of a smooth motion falls with the sixth power of the spacing. Rounding of
        the knots by eps makes the acceleration rough by 4 eps / spacing^2 (rms), and the returned position has that
        roughness too.
        """
        time = np.ascontiguousarray(time, dtype=float)
        r_e = np.asarray(r_e, dtype=float)
        q_eb = np.asarray(q_eb, dtype=float)
        if time.ndim != 1 or r_e.shape != (time.size, 3) or q_eb.shape != (time.size, 4):
            raise InputError(
                f"a motion needs time (n,), r_e (n, 3) and q_eb (n, 4), not {time.shape}, {r_e.shape}, {q_eb.shape}"
            )
        if time.size < _FEWEST_KNOTS:
            raise InputError(f"a motion needs at least {_FEWEST_KNOTS} knots, not {time.size}")
        if not (np.isfinite(time).all() and np.isfinite(r_e).all() and np.isfinite(q_eb).all()):
            raise InputError("the knots of a motion must be finite")
        if np.any(np.diff(time) <= 0.0):
            raise InputError("the times of a motion's knots must increase")
        turn = np.ones(time.size)
        turn[1:] = np.where(np.einsum("ij,ij->i", q_eb[1:], q_eb[:-1]) < 0.0, -1.0, 1.0)
        q_eb = q_eb * np.cumprod(turn)[:, None]
        origin = r_e[0].copy()
        spline = make_interp_spline(time, np.column_stack([r_e - origin, q_eb]), k=_DEGREE)
        knots = np.ascontiguousarray(spline.t[_DEGREE:-_DEGREE])
        powers = [spline(knots[:-1], nu=power) / math.factorial(power) for power in range(_DEGREE, -1, -1)]
        return cls(knots, np.stack(powers, axis=1), origin)

    @property
    def start(self) -> float:
        """First time [s]."""
        return float(self.knots[0])

    @property
    def end(self) -> float:
        """Last time [s]."""
        return float(self.knots[-1])

    def until(self, end: float) -> Motion:
        """The motion up to `end` [s]; the same object where it ends before."""
        if end >= self.end:
            return self
        if not end > self.start:
            raise InputError(f"nothing is left of the motion, which begins at {self.start:g} s, until {end:g} s")
        last = int(np.searchsorted(self.knots, end))
        return Motion(np.append(self.knots[:last], end), self.coefficients[:last], self.origin)

    def at(self, time: ArrayLike) -> MotionState:
        """Everything at once, for (n,) times."""
        time = np.ascontiguousarray(np.atleast_1d(np.asarray(time, dtype=float)))
        self.require(time)
        interval = np.clip(np.searchsorted(self.knots, time, side="right") - 1, 0, self.knots.size - 2)
        out = np.empty((time.size, 22))
        motion_at_times(self.knots, self.coefficients, self.origin, time, interval, out)
        columns = np.split(out, [3, 6, 9, 13, 16, 19], axis=1)
        return MotionState(time, *(np.ascontiguousarray(column) for column in columns))

    def require(self, time: Array) -> None:
        """Refuse times outside [start, end].

        Raises
        ------
        InputError
        """
        if time.size and not (time.min() >= self.start and time.max() <= self.end):
            raise InputError(
                f"the motion is known from {self.start:g} s to {self.end:g} s, "
                f"not from {time.min():g} s to {time.max():g} s"
            )

    def r_e(self, time: ArrayLike) -> Array:
        """Position [m] in e."""
        return _like(time, self.at(time).r_e)

    def v_e(self, time: ArrayLike) -> Array:
        """Velocity relative to the Earth [m/s], resolved in e."""
        return _like(time, self.at(time).v_e)

    def a_e(self, time: ArrayLike) -> Array:
        """Acceleration relative to the rotating Earth [m/s^2], resolved in e."""
        return _like(time, self.at(time).a_e)

    def q_eb(self, time: ArrayLike) -> Array:
        """Attitude quaternion that takes b to e, scalar first."""
        return _like(time, self.at(time).q_eb)

    def C_eb(self, time: ArrayLike) -> Array:
        """Attitude matrix that takes b to e."""
        return _like(time, dcm_from_quat_batch(self.at(time).q_eb))

    def C_nb(self, time: ArrayLike) -> Array:
        """Attitude matrix that takes b to north-east-down of the place (at a pole, of its ``atan2`` longitude)."""
        return _like(time, _local(self.at(time))[:, 9:].reshape(-1, 3, 3))

    def w_eb_b(self, time: ArrayLike) -> Array:
        """Angular rate of the body against the Earth [rad/s], in b."""
        return _like(time, self.at(time).w_eb_b)

    def w_ib_b(self, time: ArrayLike) -> Array:
        """Angular rate of the body against inertial space [rad/s], in b."""
        return _like(time, self.at(time).w_ib_b)

    def f_b(self, time: ArrayLike) -> Array:
        """Specific force [m/s^2], in b."""
        return _like(time, self.at(time).f_b)

    def trajectory(self, time: ArrayLike, source: str = "truth") -> Trajectory:
        """The motion as a trajectory: geodetic position, velocity north-east-down, roll, pitch and heading."""
        state = self.at(time)
        local = _local(state)
        return Trajectory(
            state.time,
            local[:, 0].copy(),
            local[:, 1].copy(),
            local[:, 2].copy(),
            local[:, 3:6].copy(),
            local[:, 6:9].copy(),
            source=source,
        )


def _like(time: ArrayLike, values: Array) -> Array:
    return values[0] if np.ndim(time) == 0 else values


def _local(state: MotionState) -> Array:
    """Latitude, longitude, height, velocity, Euler angles and C_nb of every row; see :func:`local_level`."""
    out = np.empty((state.time.size, 18))
    local_level(state.r_e, state.v_e, state.q_eb, out)
    return out
