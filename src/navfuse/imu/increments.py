"""Rates or raw increments -> rotation and velocity increments, with coning and sculling.

Over one interval (t[k-1], t[k]] of length T the angular rate and the specific force are taken as linear in time:
through the two samples at its ends for a rate sensor, through the increments of this and the previous interval for an
increment sensor. To second order the rotation vector and the velocity increment in the body axes of t[k-1] are then::

    inc_theta = alpha + coning                        alpha = integral of w,  upsilon = integral of f
    inc_v     = upsilon + sculling                    (+ 1/2 inc_theta x inc_v, which the mechanization adds)

    rate sensor         coning   = T^2/12 w0 x w1
                        sculling = T^2/12 (w0 x f1 + f0 x w1)
    increment sensor    coning   = k alpha' x alpha                        k = T^2 / (6 T' (T' + T)), 1/12 when T' = T
                        sculling = k (alpha' x upsilon + upsilon' x alpha)

A prime marks the previous interval. Source: Savage (1998), "Strapdown inertial navigation integration algorithm
design", parts 1 and 2, for equal intervals. The factor k follows from the same linear model with unequal ones: for the
rate a + b t, with t = 0 between the two intervals, alpha' x alpha is T' T (T' + T) / 2 (a x b) and the coning is
T^3 / 12 (a x b). The half rotation of the velocity is left to the mechanization because it has to use increments freed
from the estimated biases.

Under linear rates the error of one interval is of order T^5 in rotation and in velocity. Under coning and sculling at a
fixed frequency the drift of an increment sensor falls with T^4 (with T^2 if the terms are left out); that of a rate
sensor with T^2, because the trapezoid shortens each increment: there the terms halve it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING, Literal

import numpy as np
from numba import njit

from navfuse.core.rotation import cross
from navfuse.errors import InputError

if TYPE_CHECKING:
    from navfuse.data.logs import ImuLog

Array = np.ndarray
_STATE_SIZE = 8
MISSING_STEPS = 1.5
"""An interval of more usual ones than this may hide rows that are missing."""


@dataclass(frozen=True, slots=True)
class ImuIncrements:
    """What the mechanization integrates: one rotation and one velocity increment per interval.

    Attributes
    ----------
    time : (n + 1,) array [s]
        Ends of the intervals; ``time[0]`` opens the first one. Row k of the increments covers (time[k], time[k + 1]].
    inc_theta_b : (n, 3) array [rad]
        Rotation vector from the body axes at the start of the interval to those at its end, relative to i, coning
        included.
    inc_v_b : (n, 3) array [m/s]
        Integrated specific force, sculling included, *without* the term 1/2 inc_theta x inc_v.
    """

    time: Array
    inc_theta_b: Array
    inc_v_b: Array

    @property
    def dt(self) -> Array:
        """Lengths (n,) of the intervals [s]."""
        return np.diff(self.time)

    def __len__(self) -> int:
        return self.inc_theta_b.shape[0]

    def piece(self, first: int, last: int | None = None) -> ImuIncrements:
        """Increments `first` until before `last` (default: to the end), as views."""
        last = len(self) if last is None else last
        return ImuIncrements(self.time[first : last + 1], self.inc_theta_b[first:last], self.inc_v_b[first:last])


@njit(cache=True, error_model="numpy")
def _from_rates(time, gyro, accel, gap_s, inc_theta, inc_v):
    for k in range(1, time.size):
        dt = time[k] - time[k - 1]
        half = 0.5 * dt
        scale = dt * dt / 12.0 if dt <= gap_s else 0.0
        coning = cross(gyro[k - 1], gyro[k])
        sculling_w = cross(gyro[k - 1], accel[k])
        sculling_f = cross(accel[k - 1], gyro[k])
        for i in range(3):
            inc_theta[k - 1, i] = half * (gyro[k - 1, i] + gyro[k, i]) + scale * coning[i]
            inc_v[k - 1, i] = half * (accel[k - 1, i] + accel[k, i]) + scale * (sculling_w[i] + sculling_f[i])


@njit(cache=True)
def _covers_usual_step(dv, k, dt, usual):
    """Whether the velocity increment of row k, |f| continuing, speaks for one usual step rather than for all of
    `dt`.
    """
    before = sqrt(dv[k - 1, 0] ** 2 + dv[k - 1, 1] ** 2 + dv[k - 1, 2] ** 2) / usual
    size = sqrt(dv[k, 0] ** 2 + dv[k, 1] ** 2 + dv[k, 2] ** 2)
    return abs(size / usual - before) < abs(size / dt - before)


@njit(cache=True, error_model="numpy")
def _from_increments(time, dtheta, dv, gap_s, previous_dt, inc_theta, inc_v):
    for k in range(1, time.size):
        dt = time[k] - time[k - 1]
        lost = 0.0
        if previous_dt > 0.0 and dt > MISSING_STEPS * previous_dt and _covers_usual_step(dv, k, dt, previous_dt):
            lost = 0.5 * (dt / previous_dt - 1.0)
        for i in range(3):
            inc_theta[k - 1, i] = dtheta[k, i]
            inc_v[k - 1, i] = dv[k, i]
            if lost > 0.0:
                inc_theta[k - 1, i] += lost * (dtheta[k - 1, i] + dtheta[k, i])
                inc_v[k - 1, i] += lost * (dv[k - 1, i] + dv[k, i])
        if lost > 0.0:
            continue
        if 0.0 < previous_dt <= gap_s and dt <= gap_s:
            scale = dt * dt / (6.0 * previous_dt * (previous_dt + dt))
            coning = cross(dtheta[k - 1], dtheta[k])
            sculling_w = cross(dtheta[k - 1], dv[k])
            sculling_f = cross(dv[k - 1], dtheta[k])
            for i in range(3):
                inc_theta[k - 1, i] += scale * coning[i]
                inc_v[k - 1, i] += scale * (sculling_w[i] + sculling_f[i])
        previous_dt = dt
    return previous_dt


def _after(kept: Array, block: Array) -> Array:
    block = np.ascontiguousarray(block, dtype=np.float64)
    return np.concatenate((kept, block)) if kept.size else block


class IncrementsBuilder:
    """Builds increments from a log that arrives piece by piece; any cut into blocks gives bit-identical increments.

    Parameters
    ----------
    kind : {"rates", "increments"}
        What the rows of the log hold. The first row ever fed only opens the first interval: a rate there is its start
        value, an increment there covers an unknown interval and is not used at all.
    gap_s : float [s]
        Over an interval longer than this, and for an increment sensor also in the interval after it, coning and
        sculling are left out: the linear model says nothing across a gap. What to do with a long interval is for the
        filter to decide.

    Notes
    -----
    Where rows of an increment log are missing, the row behind the hole covers its last step only. That is seen from
    the velocity increment, whose size over time is about that of gravity, and the motion in the hole is then taken as
    the mean of the rows around it. A row that does cover the whole of a longer interval is left as it is. Rates are
    interpolated by the trapezoid either way.
    """

    def __init__(self, kind: Literal["rates", "increments"], gap_s: float = np.inf) -> None:
        self.kind = kind
        self.gap_s = float(gap_s)
        self._time = np.empty(0)
        self._gyro = np.empty((0, 3))
        self._accel = np.empty((0, 3))
        self._dt = 0.0

    def feed(self, log: ImuLog) -> ImuIncrements:
        """Take further rows and return the increments of every interval that they close.

        Parameters
        ----------
        log : ImuLog
            Rows later than all fed before, of the kind this builder was made for. May be empty.

        Returns
        -------
        ImuIncrements
            One row per row of `log`, one fewer for the first block. Its ``time[0]`` is the last stamp of the block
            before.

        Raises
        ------
        InputError
            If the kind differs, or the stamps do not increase, within the block or from the block before.
        """
        if log.kind != self.kind:
            raise InputError(f"{log.source}: a block of {log.kind} in a log of {self.kind}; use one builder per log")
        time = _after(self._time, log.time)
        late = np.flatnonzero(~(np.diff(time) > 0.0))
        if late.size:
            row = int(late[0]) + 1 - self._time.size
            stamp = time[late[0] + 1]
            raise InputError(f"{log.source}: time does not increase at row {row} ({stamp} s); sort the log first")
        gyro, accel = _after(self._gyro, log.gyro), _after(self._accel, log.accel)
        n = max(time.size - 1, 0)
        inc_theta, inc_v = np.empty((n, 3)), np.empty((n, 3))
        if self.kind == "rates":
            _from_rates(time, gyro, accel, self.gap_s, inc_theta, inc_v)
        else:
            self._dt = _from_increments(time, gyro, accel, self.gap_s, self._dt, inc_theta, inc_v)
        self._time, self._gyro, self._accel = time[-1:].copy(), gyro[-1:].copy(), accel[-1:].copy()
        return ImuIncrements(time, inc_theta, inc_v)

    def state(self) -> Array:
        """Return what the builder remembers between blocks, for :meth:`restore`.

        Returns
        -------
        (0,) or (8,) array
            Empty before the first row; then the last row (time, gyro, accel) and the length of the last interval [s]
            (0: none).
        """
        if not self._time.size:
            return np.empty(0)
        return np.concatenate((self._time, self._gyro[0], self._accel[0], [self._dt]))

    def restore(self, state: Array) -> None:
        """Go on from the :meth:`state` of a builder of the same kind and `gap_s`.

        Raises
        ------
        InputError
            If `state` is not one.
        """
        state = np.array(state, dtype=np.float64)
        if state.shape not in {(0,), (_STATE_SIZE,)}:
            raise InputError(f"an increments builder is restored from 0 or {_STATE_SIZE} numbers, not {state.shape}")
        rows = 1 if state.size else 0
        self._time = state[:1]
        self._gyro = state[1:4].reshape(rows, 3)
        self._accel = state[4:7].reshape(rows, 3)
        self._dt = float(state[7]) if rows else 0.0


def to_increments(log: ImuLog, gap_s: float = np.inf) -> ImuIncrements:
    """Increments of a whole log; the same as :class:`IncrementsBuilder` fed once.

    Parameters
    ----------
    log : ImuLog
        At least one row; n rows give n - 1 increments.
    gap_s : float [s]
        See :class:`IncrementsBuilder`.
    """
    return IncrementsBuilder(log.kind, gap_s).feed(log)
