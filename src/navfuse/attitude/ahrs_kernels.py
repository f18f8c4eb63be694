"""Kernels of the attitude and heading reference: the forward filter block by block, and the way back of the smoother.

A block is a few inertial intervals. Inside it the attitude follows the gyro sample by sample; at its end the covariance
is carried across and the measurements update it. See :mod:`navfuse.attitude.ahrs` for the model and its sources.

Error states, true - estimate, resolved in n unless a b stands behind them::

    0:3   velocity [m/s]          9:12  gyro bias b [rad/s]            18  horizontal reference field [uT]
    3:6   disturbance field [uT]  12:15 accelerometer bias b [m/s^2]   19  downward reference field [uT]
    6:9   attitude [rad]          15:18 magnetometer bias b [uT]       20  delay of the magnetometer [s]

n is level, its x axis along the horizontal reference field (magnetic north). Fields are in microtesla here, so that all
states are of order one to a thousandth.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from navfuse.core.kalman import reset_attitude
from navfuse.core.linear_kalman import propagate, smooth, update
from navfuse.core.rotation import (
    cross,
    dcm_from_quat,
    mat_vec,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    quat_normalize,
    quat_rotate,
    rotvec_from_quat,
    wrap_pi,
)
from navfuse.core.stochastic import gauss_markov_decay, gauss_markov_noise

V, D, PSI, BG, BA, BM, REF, LAG, N = 0, 3, 6, 9, 12, 15, 18, 20, 21
"""First index of each group of states, and their number."""
MEMORY = 10
"""Numbers that the filter remembers from block to block beside the states; see :func:`forward`."""
USED, REJECTED, RESET, ABSENT = 0.0, 1.0, 2.0, -1.0


@njit(cache=True, error_model="numpy")
def inject(q, x, dx):
    """Apply a correction (21,) to attitude (4,) and states (21,), in place. ``x[6:9]`` is not used: q holds it."""
    turned = quat_normalize(
        quat_multiply(quat_from_rotvec((dx[PSI], dx[PSI + 1], dx[PSI + 2])), (q[0], q[1], q[2], q[3]))
    )
    for i in range(4):
        q[i] = turned[i]
    for i in range(N):
        if i < PSI or i >= BG:
            x[i] += dx[i]


@njit(cache=True, error_model="numpy")
def _watch_rest(memory, w, f, dt, rest_rate, rest_force):
    """Follow rate and specific force with low-pass filters of 0.5 s; False if the body moves. Updates `memory[0:6]`."""
    gain = min(1.0, dt / 0.5)
    still = True
    rate = force = 0.0
    for i in range(3):
        memory[i] += gain * (w[i] - memory[i])
        memory[3 + i] += gain * (f[i] - memory[3 + i])
        rate += (w[i] - memory[i]) ** 2
        force += (f[i] - memory[3 + i]) ** 2
        still = still and abs(memory[i]) <= rest_rate
    return still and rate <= rest_rate * rest_rate and force <= rest_force * rest_force


@njit(cache=True, error_model="numpy")
def _turn_to_field(q, z, H, M, x):
    """Turn the attitude (4,) about the vertical until the measured field points where `M` does.

    Innovation and the columns of the magnetometer bias in `H` are turned with it, in place; returns the angle [rad]
    without sign. No checks are made.
    """
    seen = np.zeros(2)
    for i in range(2):
        seen[i] = z[i] + M[i] + x[LAG] * H[i, LAG]
    angle = wrap_pi(math.atan2(M[1], M[0]) - math.atan2(seen[1], seen[0]))
    turned = quat_normalize(quat_multiply(quat_from_rotvec((0.0, 0.0, angle)), (q[0], q[1], q[2], q[3])))
    for i in range(4):
        q[i] = turned[i]
    c, s = math.cos(angle), math.sin(angle)
    for j in range(BM, BM + 3):
        H[0, j], H[1, j] = c * H[0, j] - s * H[1, j], s * H[0, j] + c * H[1, j]
    # The slip of a delay, rate x M, is left as it is: the delay is short, and the rate is nearly vertical or unknown.
    z[0], z[1] = (
        c * seen[0] - s * seen[1] - M[0] - x[LAG] * H[0, LAG],
        s * seen[0] + c * seen[1] - M[1] - x[LAG] * H[1, LAG],
    )
    return abs(angle)


@njit(cache=True, error_model="numpy")
def forward(
    first, last, ends, inc_theta, inc_v, dt, mag, mag_from, mag_age, par, q, x, P, memory, out_q, x_pred, q_pred,
    x_post, q_post, P_pred, P_post, F_all, record
):  # fmt: skip
    """Filter blocks `first` until before `last`, in place on `q` (4,), `x` (21,), `P` (21, 21) and `memory` (10,).

    Parameters
    ----------
    ends : (b + 1,) int array
        Intervals of block k are ``ends[k]`` until before ``ends[k + 1]``.
    inc_theta, inc_v, dt : (k, 3), (k, 3), (k,) arrays
        As :class:`~navfuse.imu.increments.ImuIncrements` has them.
    mag, mag_from, mag_age : (m, 3) array [uT], (k + 1,) int array, (m,) array [s]
        Rows ``mag_from[k]`` until before ``mag_from[k + 1]`` belong to interval k; `mag_age` is how long before its end
        each was measured.
    par : tuple
        From :meth:`navfuse.attitude.ahrs_settings.AhrsSettings.numbers`.
    memory : (10,) array
        Low-passed rate and force of the rest detector, seconds at rest, low-passed square of the linear acceleration,
        seconds of rejections of the magnetometer, and how many there were.
    out_q : (k, 4) array
        Receives the attitude behind each interval.
    x_pred, q_pred, P_pred, x_post, q_post, P_post, F_all : arrays with a first axis of last - first
        Receive what the smoother needs: before and behind the measurements of each block, and the transition to it.
    record : (last - first, 3) array
        Receives NIS of the magnetometer (3 degrees of freedom), its fate, and 1 at rest.

    Notes
    -----
    No checks are made.
    """
    (
        gravity, arw, gyro_scale, gyro_walk, vrw, accel_scale, accel_walk, velocity_density, velocity_time,
        accel_memory, mag_noise, dist_sd, dist_tau, mag_bias_walk, field_walk, delay_walk, gate, patience, rest_rate,
        rest_force, rest_after, rest_velocity, rest_rate_noise, gap_s, gap_rate, gap_force,
    ) = par  # fmt: skip
    free_all, free_mag = np.ones(N), np.ones(N)
    for i in range(3):
        free_mag[V + i] = free_mag[BA + i] = 0.0
    free_mag[PSI] = free_mag[PSI + 1] = 0.0
    F, Q, H, R, S = np.zeros((N, N)), np.zeros((N, N)), np.zeros((3, N)), np.zeros((3, 3)), np.zeros((3, 3))
    z, dx = np.zeros(3), np.zeros(N)
    A, B = np.zeros((3, 3)), np.zeros((3, 3))
    force, mean_w, mean_m, mean_C = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros((3, 3))
    mean_wm = np.zeros(3)
    for block in range(first, last):
        row = block - first
        A[:] = 0.0
        B[:] = 0.0
        mean_C[:] = 0.0
        for i in range(3):
            force[i] = mean_w[i] = mean_m[i] = mean_wm[i] = 0.0
        duration = turn_square = accel_square = 0.0
        gap = 0.0
        count = 0
        still = True
        for k in range(ends[block], ends[block + 1]):
            h = dt[k]
            turn = (inc_theta[k, 0] - x[BG] * h, inc_theta[k, 1] - x[BG + 1] * h, inc_theta[k, 2] - x[BG + 2] * h)
            dv = (inc_v[k, 0] - x[BA] * h, inc_v[k, 1] - x[BA + 1] * h, inc_v[k, 2] - x[BA + 2] * h)
            q_mid = quat_multiply(
                (q[0], q[1], q[2], q[3]), quat_from_rotvec((0.5 * turn[0], 0.5 * turn[1], 0.5 * turn[2]))
            )
            C = dcm_from_quat(q_mid)
            dv_n = mat_vec(C, dv)
            for j in range(3):
                column = (A[0, j] + 0.5 * C[j] * h, A[1, j] + 0.5 * C[3 + j] * h, 0.0)
                c = cross(dv_n, column)
                for i in range(3):
                    B[i, j] += c[i]
            for i in range(3):
                x[V + i] += dv_n[i]
                force[i] += dv_n[i]
                mean_w[i] += inc_theta[k, i]
                for j in range(3):
                    A[i, j] += C[3 * i + j] * h
            x[V + 2] += gravity * h
            accel_square += (dv_n[0] ** 2 + dv_n[1] ** 2 + (dv_n[2] + gravity * h) ** 2) / h
            turn_square += (turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2) / h
            duration += h
            turned = quat_normalize(quat_multiply((q[0], q[1], q[2], q[3]), quat_from_rotvec(turn)))
            for i in range(4):
                q[i] = turned[i]
                out_q[k, i] = turned[i]
            if h > gap_s:
                gap += h * h
            w = (inc_theta[k, 0] / h, inc_theta[k, 1] / h, inc_theta[k, 2] / h)
            f = (inc_v[k, 0] / h, inc_v[k, 1] / h, inc_v[k, 2] / h)
            if not _watch_rest(memory, w, f, h, rest_rate, rest_force):
                still = False
            for m in range(mag_from[k], mag_from[k + 1]):
                share = -mag_age[m] / h
                back = quat_from_rotvec((share * turn[0], share * turn[1], share * turn[2]))
                C = dcm_from_quat(quat_multiply(turned, back))
                m_n = mat_vec(C, (mag[m, 0], mag[m, 1], mag[m, 2]))
                w_n = mat_vec(C, (turn[0] / h, turn[1] / h, turn[2] / h))
                count += 1
                for i in range(3):
                    mean_m[i] += m_n[i]
                    mean_wm[i] += w_n[i]
                    for j in range(3):
                        mean_C[i, j] += C[3 * i + j]
        memory[6] = memory[6] + duration if still else 0.0
        resting = memory[6] > rest_after
        memory[7] += (accel_square / duration - memory[7]) * min(1.0, duration / accel_memory)

        # Transition and process noise of the block. A disturbance that belongs to a place stays while the body rests.
        F[:] = 0.0
        for i in range(N):
            F[i, i] = 1.0
        Q[:] = 0.0
        decay = noise = 0.0
        if memory[6] > 0.5:
            decay = 1.0
        else:
            decay = gauss_markov_decay(duration, dist_tau)
            noise = gauss_markov_noise(dist_sd, duration, dist_tau)
        # The velocity is that in the level frame of the estimated heading, so that a heading error does not enter: its
        # being noise about zero says nothing of the heading, but would seem to.
        F[V, PSI + 1], F[V + 1, PSI] = force[2], -force[2]
        F[V + 2, PSI], F[V + 2, PSI + 1] = force[1], -force[0]
        for i in range(3):
            F[D + i, D + i] = decay
            x[D + i] *= decay
            for j in range(3):
                F[PSI + i, BG + j] = -A[i, j]
                F[V + i, BG + j] = B[i, j]
                F[V + i, BA + j] = -A[i, j]
            Q[PSI + i, PSI + i] = (
                arw * arw * duration + gyro_scale * gyro_scale * turn_square + gap_rate * gap_rate * gap
            )
            Q[V + i, V + i] = (
                vrw * vrw * duration + accel_scale * accel_scale * accel_square + gap_force * gap_force * gap
            )
            Q[D + i, D + i] = noise
            Q[BG + i, BG + i] = gyro_walk * gyro_walk * duration
            Q[BA + i, BA + i] = accel_walk * accel_walk * duration
            Q[BM + i, BM + i] = mag_bias_walk * mag_bias_walk * duration
        Q[REF, REF] = Q[REF + 1, REF + 1] = field_walk * field_walk * duration
        Q[LAG, LAG] = delay_walk * delay_walk * duration
        propagate(P, F, Q, P_pred[row])
        P[:] = P_pred[row]
        F_all[row] = F
        x_pred[row] = x
        q_pred[row] = q

        # The velocity of a body that stays where it is, is zero but for its motion.
        H[:] = 0.0
        R[:] = 0.0
        variance = (velocity_density**2 + velocity_time**2 * memory[7]) / duration
        if resting:
            variance = rest_velocity * rest_velocity
        for i in range(3):
            H[i, V + i] = 1.0
            z[i] = -x[V + i]
            R[i, i] = variance
        update(P, H, R, z, np.inf, free_all, S, dx)
        inject(q, x, dx)
        reset_attitude(P, dx[PSI:BG])
        if resting:
            H[:] = 0.0
            for i in range(3):
                H[i, BG + i] = 1.0
                z[i] = mean_w[i] / duration - x[BG + i]
                R[i, i] = rest_rate_noise * rest_rate_noise / duration
            if update(P, H, R, z, 16.0, free_all, S, dx) <= 16.0:
                inject(q, x, dx)
                reset_attitude(P, dx[PSI:BG])

        record[row, 0], record[row, 1], record[row, 2] = np.nan, ABSENT, 1.0 if resting else 0.0
        if count > 0 and not resting:
            turned = quat_multiply(
                (q[0], q[1], q[2], q[3]),
                quat_conjugate((q_pred[row, 0], q_pred[row, 1], q_pred[row, 2], q_pred[row, 3])),
            )
            m_n = quat_rotate(turned, (mean_m[0] / count, mean_m[1] / count, mean_m[2] / count))
            M = (x[REF] + x[D], x[D + 1], x[REF + 1] + x[D + 2])
            slip = cross((mean_wm[0] / count, mean_wm[1] / count, mean_wm[2] / count), M)
            H[:] = 0.0
            R[:] = 0.0
            for i in range(3):
                predicted = M[i] + x[LAG] * slip[i]
                for j in range(3):
                    H[i, BM + j] = mean_C[i, j] / count
                    predicted += H[i, BM + j] * x[BM + j]
                z[i] = m_n[i] - predicted
                H[i, D + i] = 1.0
                H[i, LAG] = slip[i]
                R[i, i] = mag_noise * mag_noise / count
            H[0, REF] = H[2, REF + 1] = 1.0
            # [m0 x], without the disturbance: estimated from these same measurements, its changes would tell a heading
            # error from a steady east field, which nothing does. To first order this resolves the error of the
            # disturbance in the level frame of the estimate.
            H[0, PSI + 1] = -x[REF + 1]
            H[1, PSI], H[1, PSI + 2] = x[REF + 1], -x[REF]
            H[2, PSI + 1] = x[REF]
            nis = update(P, H, R, z, gate, free_mag, S, dx)
            record[row, 0], record[row, 1] = nis, USED
            passed = nis <= gate
            if passed:
                memory[8] = memory[9] = 0.0
            else:
                record[row, 1] = REJECTED
                memory[8] += duration
                memory[9] += 1.0
                if memory[8] > patience and memory[9] >= 10.0:
                    # Either the field has changed for good or the heading is wrong: both are doubted, and it is used.
                    # The heading is first turned by the angle between the fields, for the update is of first order.
                    level = max(math.hypot(x[REF], x[D]), 1.0)
                    angle = _turn_to_field(q, z, H, M, x)
                    angle = max(angle, min(math.hypot(z[0], z[1]) / level, 1.5))
                    # It counts as noise of the block, so that the smoother does not carry the change back before it.
                    square = z[0] * z[0] + z[1] * z[1] + z[2] * z[2]
                    P[PSI + 2, PSI + 2] += angle * angle
                    P_pred[row, PSI + 2, PSI + 2] += angle * angle
                    for i in range(3):
                        P[D + i, D + i] += square
                        P_pred[row, D + i, D + i] += square
                    update(P, H, R, z, np.inf, free_mag, S, dx)
                    record[row, 1] = RESET
                    memory[8] = memory[9] = 0.0
                    passed = True
            if passed:
                inject(q, x, dx)
                reset_attitude(P, dx[PSI:BG])
        x_post[row] = x
        q_post[row] = q
        P_post[row] = P
        for i in range(4):
            out_q[ends[block + 1] - 1, i] = q[i]


@njit(cache=True, error_model="numpy")
def backward(x_pred, q_pred, x_post, q_post, P_pred, P_post, F_all, xs, qs, Ps, smoothed_x, smoothed_q, variance):
    """Smooth epochs back through one stretch, in place on the smoothed state behind it.

    Parameters
    ----------
    x_pred, q_pred, P_pred, F_all : arrays with a first axis of b
        Of the blocks of the stretch, as :func:`forward` leaves them.
    x_post, q_post, P_post : arrays with a first axis of b
        Of the epochs *before* each of these blocks.
    xs, qs, Ps : (21,), (4,), (21, 21) arrays
        Smoothed state of the epoch behind the last block; afterwards that of the epoch before the first.
    smoothed_x, smoothed_q, variance : (b, 21), (b, 4), (b, 21) arrays
        Receive smoothed states, attitudes and variances of the epochs before each block.

    Returns
    -------
    bool
        False if a covariance was not positive definite.

    Notes
    -----
    Differences of attitudes are rotation vectors in n. No checks are made.
    """
    e, dx, out = np.zeros(N), np.zeros(N), np.zeros((N, N))
    good = True
    for k in range(x_pred.shape[0] - 1, -1, -1):
        for i in range(N):
            e[i] = xs[i] - x_pred[k, i]
        r = rotvec_from_quat(
            quat_multiply(
                (qs[0], qs[1], qs[2], qs[3]), quat_conjugate((q_pred[k, 0], q_pred[k, 1], q_pred[k, 2], q_pred[k, 3]))
            )
        )
        for i in range(3):
            e[PSI + i] = r[i]
        good = smooth(P_post[k], F_all[k], P_pred[k], Ps, e, dx, out) and good
        Ps[:] = out
        for i in range(N):
            xs[i] = x_post[k, i]
        for i in range(4):
            qs[i] = q_post[k, i]
        inject(qs, xs, dx)
        for i in range(N):
            smoothed_x[k, i] = xs[i]
            variance[k, i] = Ps[i, i]
        for i in range(4):
            smoothed_q[k, i] = qs[i]
    return good


@njit(cache=True, error_model="numpy")
def spread(first, last, ends, time, out_q, q_pred, q_before, smoothed_q):
    """Turn the attitudes inside blocks by what the smoother turned their ends, in place on `out_q`.

    `q_before` (b, 4) are the filter's attitudes before each block, from which `out_q` was integrated, `q_pred` those at
    its end before the measurements; `smoothed_q` (b + 1, 4) the smoothed ones at the edges. Linear in between. No
    checks are made.
    """
    for block in range(first, last):
        row = block - first
        a = _between(smoothed_q[row], q_before[row])
        b = _between(smoothed_q[row + 1], q_pred[row])
        begin, end = time[ends[block]], time[ends[block + 1]]
        for k in range(ends[block], ends[block + 1]):
            s = (time[k + 1] - begin) / (end - begin)
            r = (a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2]))
            base = (out_q[k, 0], out_q[k, 1], out_q[k, 2], out_q[k, 3])
            if k == ends[block + 1] - 1:
                base = (q_pred[row, 0], q_pred[row, 1], q_pred[row, 2], q_pred[row, 3])
            turned = quat_normalize(quat_multiply(quat_from_rotvec(r), base))
            for i in range(4):
                out_q[k, i] = turned[i]


@njit(cache=True, error_model="numpy")
def _between(q, p):
    return rotvec_from_quat(quat_multiply((q[0], q[1], q[2], q[3]), quat_conjugate((p[0], p[1], p[2], p[3]))))
