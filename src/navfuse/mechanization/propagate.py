"""The hot loop: one compiled call from one event to the next."""

from __future__ import annotations

import numpy as np
from numba import njit

from navfuse.core.rotation import mat_vec
from navfuse.data.layout import NAVIGATION_STATES
from navfuse.mechanization.ecef import step_ecef
from navfuse.mechanization.error_dynamics import (
    ACC_DCM,
    ACC_FORCE,
    ACC_STATES,
    ACC_TIME,
    ACCEL,
    BIAS,
    GYRO,
    covariance_step,
    frame_rates,
    scratch,
)
from navfuse.mechanization.ned import step_ned

TIME_TOLERANCE = 1e-6
"""Stamps closer than this [s] count as equal, so that no increment is split into a sliver."""


@njit(cache=True)
def inverse_error_matrix(s, imu_map, sensor):
    """Inverse of I + M for one inertial sensor, as a 9-tuple, and its bias as a 3-tuple.

    `s` (n - 9,) holds the estimates, `imu_map` (m, 3) what they mean, `sensor` is GYRO or ACCEL. No checks are made.
    """
    a = np.zeros(12)
    a[0] = 1.0
    a[4] = 1.0
    a[8] = 1.0
    for j in range(imu_map.shape[0]):
        if imu_map[j, 0] == sensor:
            if imu_map[j, 2] == BIAS:
                a[9 + imu_map[j, 1]] += s[j]
            else:
                a[3 * imu_map[j, 1] + imu_map[j, 2]] += s[j]
    c0 = a[4] * a[8] - a[5] * a[7]
    c1 = a[5] * a[6] - a[3] * a[8]
    c2 = a[3] * a[7] - a[4] * a[6]
    d = 1.0 / (a[0] * c0 + a[1] * c1 + a[2] * c2)
    inverse = (
        c0 * d,
        (a[2] * a[7] - a[1] * a[8]) * d,
        (a[1] * a[5] - a[2] * a[4]) * d,
        c1 * d,
        (a[0] * a[8] - a[2] * a[6]) * d,
        (a[2] * a[3] - a[0] * a[5]) * d,
        c2 * d,
        (a[1] * a[6] - a[0] * a[7]) * d,
        (a[0] * a[4] - a[1] * a[3]) * d,
    )
    return inverse, (a[9], a[10], a[11])


@njit(cache=True)
def propagate(
    times,
    inc_theta_b,
    inc_v_b,
    i,
    t,
    t_end,
    nav,
    s,
    x,
    P,
    F,
    acc,
    ecef,
    imu_map,
    noise,
    stochastic,
    decay,
    work,
    cov_period,
    track,
    out_period,
    out_next,
    out_time,
    out_nav,
    out_x,
    out_P,
    out_F,
    out_s,
    last,
):
    """Mechanize every increment up to `t_end` and carry the covariance along.

    Parameters
    ----------
    times : (k + 1,) array [s]
        Stamps; increment j covers (times[j], times[j + 1]].
    inc_theta_b, inc_v_b : (k, 3) arrays
        Increments as :mod:`navfuse.imu.increments` makes them.
    i, t : int, float
        Where the state stands: inside increment i, at time t.
    t_end : float
        Event to stop at; an increment that holds it is split in proportion to time. If the increments end earlier, so does the call, and
        an unfinished covariance step stays in `acc` for the next call.
    nav : (10,) array
        Navigation state, NED or ECEF.
    s, x, P, F, acc, imu_map, noise, stochastic, decay, work, track
        As in :func:`navfuse.mechanization.error_dynamics.covariance_step`.
    ecef : bool
    cov_period : float [s]
        Shortest covariance step; 0 = one step per increment.
    out_period, out_next : float, int
        States are put out at the multiples of out_period (0 = at every stamp), beginning with number out_next. A state due at `t_end`
        itself is left to the caller, who may have a measurement to apply first.
    out_time (r,), out_nav (r, 10), out_x (r, n), out_P (r, 9, n), out_F (r, 10, n), out_s (r, n - 9) : arrays
        Filled from row 0; with r = 0 there is no output. out_P takes the navigation rows of P; out_F, if it has rows, takes F, which is
        then reset so that each F leads from the output before.
    last : (6,) array
        Receives the corrected mean rate w_ib_b and specific force f_b of the last increment touched.

    Returns
    -------
    i, t, out_next, rows : int, float, int, int
        Where the state stands now, the next output number and the rows filled. With `rows` equal to r > 0 the call returned early, to be
        called again with empty buffers.

    Notes
    -----
    No checks are made.
    """
    k = inc_theta_b.shape[0]
    n = P.shape[0]
    rows = 0
    capacity = out_time.shape[0]
    m = imu_map.shape[0]
    Tg, bg = inverse_error_matrix(s, imu_map, GYRO)
    Ta, ba = inverse_error_matrix(s, imu_map, ACCEL)
    w = np.empty(15)
    while i < k and t < t_end - TIME_TOLERANCE:
        t_next = times[i + 1]
        stop = t_next
        if stop > t_end - TIME_TOLERANCE:
            stop = t_end
        put = False
        if capacity > 0:
            if out_period > 0.0:
                t_out = out_next * out_period
                if t_out < t_end - TIME_TOLERANCE and stop > t_out - TIME_TOLERANCE:
                    if stop > t_out + TIME_TOLERANCE:
                        stop = t_out
                    put = True
            else:
                put = stop >= t_next - TIME_TOLERANCE and stop < t_end - TIME_TOLERANCE
        whole = stop >= t_next - TIME_TOLERANCE
        span = t_next - times[i]
        if whole and t <= times[i] + TIME_TOLERANCE:
            dt = t_next - t
            part = 1.0
        else:
            dt = stop - t
            part = dt / span

        tx = part * inc_theta_b[i, 0] - bg[0] * dt
        ty = part * inc_theta_b[i, 1] - bg[1] * dt
        tz = part * inc_theta_b[i, 2] - bg[2] * dt
        tx, ty, tz = mat_vec(Tg, (tx, ty, tz))
        ux = part * inc_v_b[i, 0] - ba[0] * dt
        uy = part * inc_v_b[i, 1] - ba[1] * dt
        uz = part * inc_v_b[i, 2] - ba[2] * dt
        ux, uy, uz = mat_vec(Ta, (ux, uy, uz))

        q0, q1, q2, q3 = nav[6], nav[7], nav[8], nav[9]
        c0, c1, c2 = 1.0 - 2.0 * (q2 * q2 + q3 * q3), 2.0 * (q1 * q2 - q0 * q3), 2.0 * (q1 * q3 + q0 * q2)
        c3, c4, c5 = 2.0 * (q1 * q2 + q0 * q3), 1.0 - 2.0 * (q1 * q1 + q3 * q3), 2.0 * (q2 * q3 - q0 * q1)
        c6, c7, c8 = 2.0 * (q1 * q3 - q0 * q2), 2.0 * (q2 * q3 + q0 * q1), 1.0 - 2.0 * (q1 * q1 + q2 * q2)
        if ecef:
            fx, fy, fz = step_ecef(nav, dt, tx, ty, tz, ux, uy, uz)
        else:
            fx, fy, fz = step_ned(nav, dt, tx, ty, tz, ux, uy, uz)
        q0, q1, q2, q3 = nav[6], nav[7], nav[8], nav[9]
        c0 = 0.5 * (c0 + 1.0) - (q2 * q2 + q3 * q3)
        c1 = 0.5 * c1 + (q1 * q2 - q0 * q3)
        c2 = 0.5 * c2 + (q1 * q3 + q0 * q2)
        c3 = 0.5 * c3 + (q1 * q2 + q0 * q3)
        c4 = 0.5 * (c4 + 1.0) - (q1 * q1 + q3 * q3)
        c5 = 0.5 * c5 + (q2 * q3 - q0 * q1)
        c6 = 0.5 * c6 + (q1 * q3 - q0 * q2)
        c7 = 0.5 * c7 + (q2 * q3 + q0 * q1)
        c8 = 0.5 * (c8 + 1.0) - (q1 * q1 + q2 * q2)

        acc[ACC_TIME] += dt
        acc[ACC_FORCE] += fx
        acc[ACC_FORCE + 1] += fy
        acc[ACC_FORCE + 2] += fz
        acc[ACC_DCM] += c0 * dt
        acc[ACC_DCM + 1] += c1 * dt
        acc[ACC_DCM + 2] += c2 * dt
        acc[ACC_DCM + 3] += c3 * dt
        acc[ACC_DCM + 4] += c4 * dt
        acc[ACC_DCM + 5] += c5 * dt
        acc[ACC_DCM + 6] += c6 * dt
        acc[ACC_DCM + 7] += c7 * dt
        acc[ACC_DCM + 8] += c8 * dt
        for j in range(m):
            column = imu_map[j, 2]
            if column == BIAS:
                continue
            if imu_map[j, 0] == GYRO:
                u = tx if column == 0 else (ty if column == 1 else tz)
            else:
                u = ux if column == 0 else (uy if column == 1 else uz)
            at = ACC_STATES + 3 * j
            row = imu_map[j, 1]
            if row == 0:
                acc[at] += c0 * u
                acc[at + 1] += c3 * u
                acc[at + 2] += c6 * u
            elif row == 1:
                acc[at] += c1 * u
                acc[at + 1] += c4 * u
                acc[at + 2] += c7 * u
            else:
                acc[at] += c2 * u
                acc[at + 1] += c5 * u
                acc[at + 2] += c8 * u

        if dt > 0.0:
            last[0], last[1], last[2] = tx / dt, ty / dt, tz / dt
            last[3], last[4], last[5] = ux / dt, uy / dt, uz / dt
        t = t_next if whole else stop
        if whole:
            i += 1
        if put or acc[ACC_TIME] >= cov_period - TIME_TOLERANCE or t >= t_end - TIME_TOLERANCE:
            frame_rates(nav, ecef, w)
            covariance_step(P, x, s, F, acc, w, imu_map, noise, stochastic, decay, work, track)
            Tg, bg = inverse_error_matrix(s, imu_map, GYRO)
            Ta, ba = inverse_error_matrix(s, imu_map, ACCEL)
        if put:
            out_time[rows] = t if out_period <= 0.0 else out_next * out_period
            for c in range(10):
                out_nav[rows, c] = nav[c]
            for c in range(n):
                out_x[rows, c] = x[c]
                for r in range(9):
                    out_P[rows, r, c] = P[r, c]
            for c in range(n - 9):
                out_s[rows, c] = s[c]
            if out_F.shape[0] > 0:
                for r in range(10):
                    for c in range(n):
                        out_F[rows, r, c] = F[r, c]
                        F[r, c] = 1.0 if (r == 9 or r == c) else 0.0
            rows += 1
            out_next += 1
            if rows == capacity:
                break
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
        self.imu_map = imu_map
        self.noise = noise
        self.stochastic = stochastic
        self.ecef = ecef
        self.covariance_period = covariance_period
        self.output_period = output_period
        self.size = NAVIGATION_STATES + stochastic.shape[0]
        self._decay = np.zeros(stochastic.shape[0] + 1)
        self._work = scratch(self.size)

    def accumulator(self) -> np.ndarray:
        """An empty accumulator for one covariance step."""
        return np.zeros(ACC_STATES + 3 * self.imu_map.shape[0])

    def buffers(self, rows: int, transitions: bool) -> tuple[np.ndarray, ...]:
        """Empty output buffers of :func:`propagate`: time, nav, x, P, F (without rows unless `transitions`), s."""
        n = self.size
        return (
            np.empty(rows),
            np.empty((rows, 10)),
            np.empty((rows, n)),
            np.empty((rows, 9, n)),
            np.empty((rows if transitions else 0, 10, n)),
            np.empty((rows, n - NAVIGATION_STATES)),
        )

    def advance(self, increments, i, t, t_end, nav, s, x, P, F, acc, out_next, out, last):
        """Call :func:`propagate`; `out` comes from :meth:`buffers`, and F is tracked if it has a place for F."""
        return propagate(
            increments.time,
            increments.inc_theta_b,
            increments.inc_v_b,
            i,
            t,
            t_end,
            nav,
            s,
            x,
            P,
            F,
            acc,
            self.ecef,
            self.imu_map,
            self.noise,
            self.stochastic,
            self._decay,
            self._work,
            self.covariance_period,
            F.shape[0] > 0,
            self.output_period,
            out_next,
            *out,
            last,
        )


def identity_transition(n: int) -> np.ndarray:
    """The (10, n) form of an identity transition: nine navigation rows, then the diagonal of the remaining states."""
    F = np.zeros((10, n))
    F[:9, :9] = np.eye(9)
    F[9] = 1.0
    return F
