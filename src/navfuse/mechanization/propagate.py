"""The hot loop: one compiled call from one event to the next."""

from __future__ import annotations

from functools import partial

import numpy as np

from navfuse.core.fused import fused
from navfuse.core.rotation import dcm_from_quat, mat_vec
from navfuse.data.layout import NAVIGATION_STATES
from navfuse.mechanization.covariance import covariance_step
from navfuse.mechanization.ecef import step_ecef
from navfuse.mechanization.error_dynamics import (
    ACC_CROSS,
    ACC_SIZE,
    ACC_TIME,
    ACCEL,
    GYRO,
    PAIR,
    accumulate,
    corrections,
)
from navfuse.mechanization.ned import step_ned
from navfuse.mechanization.tiles import (
    ESTIMATE,
    PLACES,
    TILE,
    Workspace,
    pack,
    reset_transition,
    unpack,
    unpack_navigation,
    unpack_transition,
)

TIME_TOLERANCE = 1e-6
"""Stamps closer than this [s] count as equal, so that no increment is split into a sliver."""


@fused(inline="always")
def next_stop(times, i, t, t_end, wanted, out_period, out_next):
    """How far the increment `i` is carried from time `t` on, before an event at `t_end` or an output, if `wanted`, cuts
    it.

    Returns
    -------
    stop : float [s]
        Where the state stands then; at the end of an increment its very stamp.
    put, whole : bool
        Whether an output is due there, and whether the increment ends there.
    dt, part : float [s], float
        Length of the piece, and its part of the increment.

    Notes
    -----
    No checks are made.
    """
    t_next = times[i + 1]
    stop = t_next
    if stop > t_end - TIME_TOLERANCE:
        stop = t_end
    put = False
    if wanted:
        if out_period > 0.0:
            t_out = out_next * out_period
            if t_out < t_end - TIME_TOLERANCE and stop > t_out - TIME_TOLERANCE:
                if stop > t_out + TIME_TOLERANCE:
                    stop = t_out
                put = True
        else:
            put = stop >= t_next - TIME_TOLERANCE and stop < t_end - TIME_TOLERANCE
    whole = stop >= t_next - TIME_TOLERANCE
    if whole and t <= times[i] + TIME_TOLERANCE:
        dt = t_next - t
        part = 1.0
    else:
        dt = stop - t
        part = dt / (t_next - times[i])
    return t_next if whole else stop, put, whole, dt, part


@fused
def propagate(
    times,
    inc_theta_b,
    inc_v_b,
    nav,
    s,
    x,
    P,
    F,
    acc,
    last,
    ecef,
    inertial,
    places,
    place,
    work,
    cov_period,
    out_period,
    out_time,
    out_nav,
    out_x,
    out_P,
    out_F,
    i,
    t,
    t_end,
    out_next,
    rows,
):
    """Mechanize every increment up to `t_end` and carry the covariance along.

    Parameters
    ----------
    times : (k + 1,) array [s]
        Stamps; increment j covers (times[j], times[j + 1]].
    inc_theta_b, inc_v_b : (k, 3) arrays
        Increments as :mod:`navfuse.imu.increments` makes them.
    nav : (10,) array
        Navigation state, NED or ECEF.
    s : (n - 9,) array
        Estimates of the states after the ninth; Gauss-Markov states decay towards zero.
    x : (n,) array
        Error estimate (all zero in a closed loop).
    P : (n, n) array
        Covariance.
    F : (10, n) array
        Accumulated transition, as :func:`identity_transition` makes it; without rows it is not accumulated.
    acc : array
        Sums of the covariance step that is under way.
    last : (6,) array
        Receives the corrected mean rate w_ib_b and specific force f_b of the last increment touched.
    ecef : bool
    inertial, places, place, work
        Attributes of :class:`navfuse.mechanization.tiles.Workspace`.
    cov_period : float [s]
        Shortest covariance step; 0 = one step per increment.
    out_period : float
        States are put out at its multiples (0 = at every stamp). A state due at `t_end` itself is left to the caller,
        who may have a measurement to apply first.
    out_time (r,), out_nav (r, 10), out_x (r, n), out_P (r, 9, n), out_F (r, 10, n) : arrays
        Receive the output; with r = 0 there is none. out_P takes the navigation rows of P; out_F, if it has rows, takes
        F, which is then reset so that each F leads from the output before.
    i, t : int, float
        Where the state stands: inside increment i, at time t.
    t_end : float
        Event to stop at; an increment that holds it is split in proportion to time. If the increments end earlier, so
        does the call, and an unfinished covariance step stays in `acc` for the next call.
    out_next : int
        Number of the multiple of `out_period` at which the output goes on.
    rows : int
        Rows of the output arrays that are filled already, fewer than r.

    Returns
    -------
    i, t, out_next, rows : int, float, int, int
        Where the state stands now, the next output number and the rows filled in all. With `rows` equal to r > 0 the
        call returned early, to be called again with empty buffers.

    Notes
    -----
    No checks are made.
    """
    k = inc_theta_b.shape[0]
    capacity = out_time.shape[0]
    track = F.shape[0] > 0
    cross = inertial > PAIR
    pack(work, places, place, s, x, P, F)
    estimates = work[PLACES + ESTIMATE :]
    gyro = corrections(estimates, TILE, GYRO, cross)
    accel = corrections(estimates, TILE, ACCEL, cross)
    C = dcm_from_quat((nav[6], nav[7], nav[8], nav[9]))
    sin_lat = cos_lat = dt = 0.0
    theta = (0.0, 0.0, 0.0)
    dv = (0.0, 0.0, 0.0)
    while i < k and t < t_end - TIME_TOLERANCE:
        stop, put, whole, dt, part = next_stop(times, i, t, t_end, capacity > 0, out_period, out_next)

        theta = (
            part * inc_theta_b[i, 0] - gyro[9] * dt,
            part * inc_theta_b[i, 1] - gyro[10] * dt,
            part * inc_theta_b[i, 2] - gyro[11] * dt,
        )
        dv = (
            part * inc_v_b[i, 0] - accel[9] * dt,
            part * inc_v_b[i, 1] - accel[10] * dt,
            part * inc_v_b[i, 2] - accel[11] * dt,
        )
        theta = mat_vec(gyro, theta)
        dv = mat_vec(accel, dv)
        if ecef:
            f = step_ecef(nav, dt, theta[0], theta[1], theta[2], dv[0], dv[1], dv[2])
        else:
            f, sin_lat, cos_lat = step_ned(nav, dt, theta[0], theta[1], theta[2], dv[0], dv[1], dv[2])
        before = C
        C = dcm_from_quat((nav[6], nav[7], nav[8], nav[9]))
        accumulate(acc, cross, dt, before, C, theta, dv, f)
        t = stop
        if whole:
            i += 1
        if put or acc[ACC_TIME] >= cov_period - TIME_TOLERANCE or t >= t_end - TIME_TOLERANCE:
            covariance_step(work, places, inertial, acc, nav, sin_lat, cos_lat, ecef, track)
            gyro = corrections(estimates, TILE, GYRO, cross)
            accel = corrections(estimates, TILE, ACCEL, cross)
        if put:
            out_time[rows] = t if out_period <= 0.0 else out_next * out_period
            for c in range(10):
                out_nav[rows, c] = nav[c]
            unpack_navigation(work, places, place, out_x[rows], out_P[rows])
            if out_F.shape[0] > 0:
                unpack_transition(work, places, place, out_F[rows])
                reset_transition(work, places)
            rows += 1
            out_next += 1
            if rows == capacity:
                break
    unpack(work, places, place, s, x, P, F)
    if dt > 0.0:
        for c in range(3):
            last[c] = theta[c] / dt
            last[3 + c] = dv[c] / dt
    return i, t, out_next, rows


class Propagator:
    """The hot loop with everything that stays the same during a run.

    Parameters
    ----------
    imu_map : (m, 3) int array
        From :func:`navfuse.mechanization.error_dynamics.imu_state_map`.
    noise : (2,) array
        Densities of the angular [rad^2/s] and the velocity [m^2/s^3] random walk.
    stochastic : (n - 9, 3) array
        Per state after the ninth: steady-state variance, random-walk density, 1/tau (0 = no decay).
    ecef : bool
    covariance_period, output_period : float [s]
        See :func:`propagate`; a negative output period means no output.
    """

    def __init__(self, imu_map, noise, stochastic, ecef: bool, covariance_period: float, output_period: float):
        self.ecef = ecef
        self.covariance_period = covariance_period
        self.output_period = output_period
        self.size = NAVIGATION_STATES + stochastic.shape[0]
        self._space = Workspace(imu_map, noise, stochastic)

    def accumulator(self) -> np.ndarray:
        """An empty accumulator for one covariance step."""
        return np.zeros(ACC_SIZE if self._space.inertial > PAIR else ACC_CROSS)

    def keep(self, acc: np.ndarray) -> np.ndarray | None:
        """What of an accumulator a checkpoint has to keep: nothing between two covariance steps."""
        return acc.copy() if acc[ACC_TIME] > 0.0 else None

    def resume(self, kept: np.ndarray | None) -> np.ndarray:
        """An accumulator from what :meth:`keep` kept."""
        return self.accumulator() if kept is None else kept.copy()

    def buffers(self, rows: int, transitions: bool) -> tuple[np.ndarray, ...]:
        """Empty output buffers of :func:`propagate`: time, nav, x, P and F (without rows unless `transitions`)."""
        n = self.size
        return (
            np.empty(rows),
            np.empty((rows, 10)),
            np.empty((rows, n)),
            np.empty((rows, 9, n)),
            np.empty((rows if transitions else 0, 10, n)),
        )

    def stepper(self, increments, nav, s, x, P, F, acc, last, out) -> partial[tuple[int, float, int, int]]:
        """:func:`propagate` with all that stays the same from event to event: a function of i, t, t_end, out_next and
        rows. `out` comes from :meth:`buffers`; F is tracked if it has rows.
        """
        space = self._space
        return partial(
            propagate,
            increments.time,
            increments.inc_theta_b,
            increments.inc_v_b,
            nav,
            s,
            x,
            P,
            F,
            acc,
            last,
            self.ecef,
            space.inertial,
            space.places,
            space.place,
            space.work,
            self.covariance_period,
            self.output_period,
            *out,
        )

    def advance(self, increments, i, t, t_end, nav, s, x, P, F, acc, out_next, out, last, rows=0):
        """Call :func:`propagate` once; see :meth:`stepper`."""
        return self.stepper(increments, nav, s, x, P, F, acc, last, out)(i, t, t_end, out_next, rows)


def identity_transition(n: int) -> np.ndarray:
    """The (10, n) form of an identity transition: nine navigation rows, then the diagonal of the remaining states."""
    F = np.zeros((10, n))
    F.flat[: 9 * n : n + 1] = 1.0
    F[9] = 1.0
    return F
