"""Rates or raw increments -> rotation and velocity increments, with coning and sculling.

Over one interval (t[k-1], t[k]] of length T the angular rate and the specific force are taken as smooth in time. To
second order the rotation vector and the velocity increment in the body axes of t[k-1] are then::

    inc_theta = alpha + coning                        alpha = integral of w,  upsilon = integral of f
    inc_v     = upsilon + sculling                    (turned to the axes of t[k-1] by the mechanization)

    rate sensor         coning   = T^2/12 w0 x w1
                        sculling = T^2/12 (w0 x f1 + f0 x w1)
    increment sensor    coning   = k1 (a1 x a0) + k2 (a2 x a0) + k3 (a2 x a1)
                        sculling = the same sum of (ai x uj + ui x aj)

with the samples at both ends of the interval for a rate sensor, and for an increment sensor the increments ``a0, u0``
of this interval, ``a1, u1`` of the one before and ``a2, u2`` of the one before that. For equal intervals
``k1, k2, k3 = 17/120, -2/120, -3/120``; with one previous increment only, ``1/12, 0, 0`` (Savage 1998, "Strapdown
inertial navigation integration algorithm design", parts 1 and 2). :func:`correction_factors` has them for unequal ones.

``inc_theta`` and ``inc_v`` are the two parts of one Magnus series (that of the rigid motions), of which this is the
second term. So velocity needs no formulas of its own: its factors are those of the rotation, and the step from inc_v to
the velocity is the left Jacobian of the rotation, which is left to the mechanization because it has to use
increments freed from the estimated biases.

Errors of an increment sensor fall with T^4 for any smooth motion, with T^6 for coning and sculling at a fixed
frequency; with one previous increment with T^3 and T^4. Those of a rate sensor fall with T^2, because the trapezoid
shortens each increment: there the terms halve them.
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
_ROW = 7
_HEAD = 7
NO_INTERVAL = (0.0, 0.0)
NO_STEPS = (0.0, 0.0, 0.0, 0.0, 0.0)
MISSING_STEPS = 1.5
"""An interval of more usual ones than this may hide rows that are missing."""
FILL_STEPS = 1.7
"""Usual steps above which an interval may have lost rows; below, stamps jitter."""
FEWEST_STEPS = 4.0
"""Intervals that it takes to know the usual step."""
MEMORY_STEPS = 16.0
"""Intervals over which the usual step is a mean."""
MOST_SCATTER = 0.5
"""Mean deviation of the intervals from the usual one, in usual steps, above which stamps do not tell of lost rows."""
MOST_FORCE = 60.0
"""Specific force [m/s^2] above which a row is not taken for one usual step."""
LONGEST_RATIO = 3.0
"""Two previous increments tell nothing reliable about an interval longer than this many of the shorter of theirs."""
EQUAL = 1e-6
"""Intervals that differ by less than this fraction count as equal, which is faster and changes nothing measurable."""


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
        Integrated specific force, sculling included, *not* turned: without the term 1/2 inc_theta x inc_v and its
        followers.
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


@njit(cache=True, error_model="numpy")
def correction_factors(dt, dt1, dt2, gap_s):
    """Factors of coning and sculling of an increment sensor.

    Parameters
    ----------
    dt, dt1, dt2 : float [s]
        Lengths of the interval, of the one before, and of the one before that; 0 where there is none or it does not
        adjoin.
    gap_s : float [s]
        Longer intervals are gaps: nothing is corrected in one and in the interval after it.

    Returns
    -------
    k1, k2, k3 : float
        Of the products 1 x 0, 2 x 0 and 2 x 1, the numbers counting back from the present interval.

    Notes
    -----
    With w and its derivatives in the middle of the interval, the increment of an interval of length T whose middle is
    m away is ``T (w + m w' + q w'' + c w''')``, ``q = m^2/2 + T^2/24``, ``c = m^3/6 + m T^2/24``. Three conditions
    give the factors: the sum of the products has ``dt^3/12 w x w'`` as the coning has, no ``w x w''``, and of
    ``w x w'''`` and ``w' x w''`` what makes coning at a fixed frequency, ``w'' = -W^2 w``, right: ``-dt^5/240``. With
    two increments there is the first condition only. No checks are made.
    """
    if not (0.0 < dt1 <= gap_s and dt <= gap_s):
        return 0.0, 0.0, 0.0
    if not (0.0 < dt2 <= gap_s and dt <= LONGEST_RATIO * min(dt1, dt2)):
        return dt * dt / (6.0 * dt1 * (dt1 + dt)), 0.0, 0.0
    if abs(dt - dt1) + abs(dt - dt2) < EQUAL * dt:
        return 17.0 / 120.0, -2.0 / 120.0, -3.0 / 120.0
    m1 = -0.5 * (dt + dt1)
    m2 = m1 - 0.5 * (dt1 + dt2)
    s0, s1, s2 = dt * dt * (1.0 / 24.0), dt1 * dt1 * (1.0 / 24.0), dt2 * dt2 * (1.0 / 24.0)
    far1 = 0.5 * m1 * m1 + s1 - s0
    far2 = 0.5 * m2 * m2 + s2 - s0
    determinant = m1 * far2 - m2 * far1
    inverse = 1.0 / (determinant * dt * dt1 * dt2)
    scale = inverse * dt * dt1 * dt2
    a = -2.0 * dt * s0 * far2 * scale
    b = 2.0 * dt * s0 * far1 * scale
    r1 = m1 * (m1 * m1 * (1.0 / 6.0) + s1 + s0)
    r2 = m2 * (m2 * m2 * (1.0 / 6.0) + s2 + s0)
    y = (2.4 * dt * s0 * s0 + r1 * a + r2 * b) * scale
    inverse *= determinant
    return (a + y) * dt2 * inverse, (b - y) * dt1 * inverse, y * dt * inverse


@njit(cache=True, error_model="numpy")
def steps_missing(size, dt, steps):
    """Usual steps that are missing before a row of an increment log; 0 if the row covers all of its interval.

    Parameters
    ----------
    size : float [m/s]
        Length of the velocity increment of the row.
    dt : float [s]
        From the stamp before to that of the row.
    steps : tuple
        From :func:`next_steps`.

    Notes
    -----
    Rows are missing if the interval, less what stamps before it came early, is longer than FILL_STEPS usual steps, and
    the velocity increment speaks for one usual step rather than for all of it: |f| continuing, and not of an absurd
    size, which would mean that the step is not the usual one. Stamps that scatter by more than MOST_SCATTER say
    nothing.
    """
    usual, count, early, scatter, force = steps
    length = dt - early
    if count < FEWEST_STEPS or scatter > MOST_SCATTER or length <= FILL_STEPS * usual or size > MOST_FORCE * usual:
        return 0.0
    return length / usual - 1.0 if abs(size / usual - force) < abs(size / length - force) else 0.0


@njit(cache=True, error_model="numpy")
def next_steps(size, dt, steps, missing):
    """What is known of the steps of an increment log behind a row; arguments as of :func:`steps_missing`.

    Returns
    -------
    usual : float [s]
        Running mean over MEMORY_STEPS intervals, so that neither a wrong stamp nor rows that arrive in bursts become
        the measure of those that follow; an interval in which rows are missing does not count.
    count : float
        Of intervals in it.
    early : float [s]
        How much the last stamp came early.
    scatter : float
        Mean deviation from the usual step, in usual steps; missing rows count as at most two, so that a log that seems
        to lose rows all the time is believed in the end.
    force : float [m/s^2]
        |f| in the row.
    """
    usual, count, early, scatter, _ = steps
    if missing > 0.0:
        return usual, count, 0.0, scatter + (min(missing, 2.0) - scatter) / count, size / usual
    count = min(count + 1.0, MEMORY_STEPS)
    usual += (dt - usual) / count
    scatter += (abs(dt - usual) / usual - scatter) / count
    return usual, count, min(max(early + usual - dt, 0.0), usual), scatter, size / max(dt - early, usual)


@njit(cache=True, error_model="numpy")
def corrected(k1, k2, k3, a0, u0, a1, u1, a2, u2):
    """Rotation and velocity increment of an interval from the increments (3-tuples) of it and the two before.

    :func:`correction_factors` gives k1, k2, k3. No checks are made.
    """
    p = (k1 * a1[0] + k2 * a2[0], k1 * a1[1] + k2 * a2[1], k1 * a1[2] + k2 * a2[2])
    s = (k1 * u1[0] + k2 * u2[0], k1 * u1[1] + k2 * u2[1], k1 * u1[2] + k2 * u2[2])
    pa, pu, sa = cross(p, a0), cross(p, u0), cross(s, a0)
    aa, au, ua = cross(a2, a1), cross(a2, u1), cross(u2, a1)
    return (
        (a0[0] + pa[0] + k3 * aa[0], a0[1] + pa[1] + k3 * aa[1], a0[2] + pa[2] + k3 * aa[2]),
        (
            u0[0] + pu[0] + sa[0] + k3 * (au[0] + ua[0]),
            u0[1] + pu[1] + sa[1] + k3 * (au[1] + ua[1]),
            u0[2] + pu[2] + sa[2] + k3 * (au[2] + ua[2]),
        ),
    )


@njit(cache=True, error_model="numpy")
def _row(values, k):
    return values[k, 0], values[k, 1], values[k, 2]


@njit(cache=True, error_model="numpy")
def _length(values, k):
    return sqrt(values[k, 0] ** 2 + values[k, 1] ** 2 + values[k, 2] ** 2)


@njit(cache=True, error_model="numpy")
def _from_increments(time, dtheta, dv, first, gap_s, dt1, dt2, steps, inc_theta, inc_v):
    for k in range(first, time.size):
        row = k - first
        dt, size = time[k] - time[k - 1], _length(dv, k)
        missing = steps_missing(size, dt, steps)
        steps = next_steps(size, dt, steps, missing)
        if missing > 0.0:
            half = 0.5 * missing
            for i in range(3):
                inc_theta[row, i] = dtheta[k, i] + half * (dtheta[k - 1, i] + dtheta[k, i])
                inc_v[row, i] = dv[k, i] + half * (dv[k - 1, i] + dv[k, i])
            dt2 = 0.0
            continue
        k1, k2, k3 = correction_factors(dt, dt1, dt2, gap_s)
        a1 = u1 = a2 = u2 = (0.0, 0.0, 0.0)
        if dt1 > 0.0:
            a1, u1 = _row(dtheta, k - 1), _row(dv, k - 1)
        if dt2 > 0.0:
            a2, u2 = _row(dtheta, k - 2), _row(dv, k - 2)
        theta, v = corrected(k1, k2, k3, _row(dtheta, k), _row(dv, k), a1, u1, a2, u2)
        for i in range(3):
            inc_theta[row, i] = theta[i]
            inc_v[row, i] = v[i]
        dt2 = dt1
        dt1 = dt
    return dt1, dt2, steps


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
        sculling are left out: no smooth model reaches across a gap. What to do with a long interval is for the
        filter to decide.

    Notes
    -----
    Where rows of an increment log are missing, the row behind the hole covers its last step only. That is seen from
    the velocity increment, whose size over time is about that of gravity, and the motion in the hole is then taken as
    the mean of the rows around it. A row that does cover the whole of a longer interval is left as it is, and so is one
    behind a stamp that came early, alone or in a burst (:func:`steps_missing`). Rates are interpolated by the trapezoid
    either way.
    """

    def __init__(self, kind: Literal["rates", "increments"], gap_s: float = np.inf) -> None:
        self.kind = kind
        self.gap_s = float(gap_s)
        self._time = np.empty(0)
        self._gyro = np.empty((0, 3))
        self._accel = np.empty((0, 3))
        self._dt: tuple[float, float] = NO_INTERVAL
        self._steps: tuple[float, ...] = NO_STEPS
        self._memory = 1 if kind == "rates" else 2

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
        kept = self._time.size
        time = _after(self._time, log.time)
        late = np.flatnonzero(~(np.diff(time) > 0.0))
        if late.size:
            row = int(late[0]) + 1 - kept
            stamp = time[late[0] + 1]
            raise InputError(f"{log.source}: time does not increase at row {row} ({stamp} s); sort the log first")
        gyro, accel = _after(self._gyro, log.gyro), _after(self._accel, log.accel)
        first = max(kept, 1)
        n = max(time.size - first, 0)
        inc_theta, inc_v = np.empty((n, 3)), np.empty((n, 3))
        if self.kind == "rates":
            _from_rates(time, gyro, accel, self.gap_s, inc_theta, inc_v)
        else:
            found = _from_increments(time, gyro, accel, first, self.gap_s, *self._dt, self._steps, inc_theta, inc_v)
            self._dt, self._steps = (found[0], found[1]), found[2]
        self._time, self._gyro, self._accel = (x[-self._memory :].copy() for x in (time, gyro, accel))
        return ImuIncrements(time[first - 1 :], inc_theta, inc_v)

    def state(self) -> Array:
        """Return what the builder remembers between blocks, for :meth:`restore`.

        Returns
        -------
        (0,), (14,) or (21,) array
            Empty before the first row; then the lengths of the last interval and the one before [s] (0: none), the
            usual step and what belongs to it (:func:`next_steps`), and the last row or, of increments, the last two
            rows (time, gyro, accel).
        """
        if not self._time.size:
            return np.empty(0)
        return np.concatenate((self._dt, self._steps, np.column_stack((self._time, self._gyro, self._accel)).ravel()))

    def restore(self, state: Array) -> None:
        """Go on from the :meth:`state` of a builder of the same kind and `gap_s`.

        Raises
        ------
        InputError
            If `state` is not one.
        """
        state = np.array(state, dtype=np.float64)
        sizes = [0, *(_HEAD + _ROW * rows for rows in range(1, self._memory + 1))]
        if state.ndim != 1 or state.size not in sizes:
            raise InputError(
                f"a builder of increments from {self.kind} is restored from {' or '.join(map(str, sizes))} numbers, "
                f"not {state.shape}"
            )
        rows = state[_HEAD:].reshape(-1, _ROW)
        self._time, self._gyro, self._accel = rows[:, 0].copy(), rows[:, 1:4].copy(), rows[:, 4:].copy()
        head = tuple(state[:_HEAD].tolist()) if state.size else (*NO_INTERVAL, *NO_STEPS)
        self._dt, self._steps = (head[0], head[1]), head[2:]


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
