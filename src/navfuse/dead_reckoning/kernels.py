"""The loops of the DR/GNSS filter and smoother."""

from __future__ import annotations

import numpy as np

from navfuse.core.earth import dcm_en, ecef_to_geodetic, radii
from navfuse.core.fused import fused
from navfuse.core.linear import predict, smooth_step, update

VELOCITY, POSITION = slice(0, 3), slice(3, 6)
NOTHING, USED, REJECTED, WITHHELD, RESET = -1, 0, 1, 2, 3
FEWEST_REJECTED = 5
"""Rejections in a row, over the patience at least, after which the filter is taken to be wrong and not the fixes."""


@fused
def scales(ecef, place):
    """Where a filter stands: the rotation C (3, 3) from n to its frame, and what turns metres into its position states.

    Returns
    -------
    C : (3, 3) array
        C_en of an ECEF position, the identity for latitude, longitude, height.
    per_metre : (3,) array
        Position states per metre along the axes of the frame: 1, or 1 / (R_N + h), 1 / ((R_E + h) cos L), -1.
    """
    C, per_metre = np.eye(3), np.ones(3)
    if ecef:
        lat, lon, _ = ecef_to_geodetic(place[0], place[1], place[2])
        c = dcm_en(lat, lon)
        for i in range(3):
            for j in range(3):
                C[i, j] = c[3 * i + j]
    else:
        meridian, transverse = radii(np.sin(place[0]))
        per_metre[0] = 1.0 / (meridian + place[2])
        per_metre[1] = 1.0 / ((transverse + place[2]) * np.cos(place[0]))
        per_metre[2] = -1.0
    return C, per_metre


@fused
def run_forward(
    ecef, closed, time, dr_v, dr_p, psd, slow_at, slow_sd, slow_tau, fix_p, fix_v, var_p, var_v,
    use_p, use_v, settings, x, P, Phi, x_before, P_before, record,
):  # fmt: skip
    """Filter the errors of a dead-reckoned track; errors are true minus estimate.

    Parameters
    ----------
    ecef, closed : bool
        Frame of the states; whether the geometry is that of the corrected track.
    time : (n,) array [s]
    dr_v, dr_p : (n, 3) arrays
        Velocity and position of the track, in the frame of the filter.
    psd : (n, 3) array [m^2/s^3]
        Of the random walk of the velocity error north, east, down, over the step that ends at a row.
    slow_at : int
        Place of the first of three slow errors of the fixes in x; -1 without.
    slow_sd, slow_tau : (3,) array [m], float [s]
        Of the slow errors north, east, down: standard deviation, correlation time.
    fix_p, fix_v : (n, 3) arrays
        GNSS position and velocity in the frame of the filter.
    var_p, var_v : (n, 3) arrays
        Their variances north, east, down, in metres and m/s.
    use_p, use_v : (n,) int arrays
        NOTHING, USED (offered) or WITHHELD.
    settings : (gate, patience [s])
    x, P, Phi, x_before, P_before : (n, m), (n, m, m), ... arrays
        Row 0 of x and P holds the start. Receive the filtered, the transitions, and the predicted.
    record : (n, 2, 8) array
        Of position and velocity: status, NIS, innovation and its variance, north, east, down in metres.

    Returns
    -------
    int
        Row at which a covariance was not positive definite any more; -1 if none.

    Notes
    -----
    No checks are made.
    """
    n, m = x.shape
    gate, patience = settings
    at, cov = x[0].copy(), P[0].copy()
    rejected, since = np.zeros(2, dtype=np.int64), np.zeros(2)
    place = np.empty(3)
    for k in range(n):
        if k:
            for i in range(3):
                place[i] = dr_p[k - 1, i] + (at[3 + i] if closed else 0.0)
            C, per_metre = scales(ecef, place)
            F, Q = _step(C, per_metre, time[k] - time[k - 1], psd[k], m)
            if slow_at >= 0:
                kept = np.exp(-(time[k] - time[k - 1]) / slow_tau)
                for i in range(slow_at, slow_at + 3):
                    F[i, i] = kept
                    Q[i, i] = slow_sd[i - slow_at] ** 2 * (1.0 - kept * kept)
            predict(at, cov, F, Q)
            Phi[k] = F
        x_before[k] = at
        P_before[k] = cov
        for what in range(2):
            state = use_p[k] if what == 0 else use_v[k]
            record[k, what, 0] = state
            if state == NOTHING:
                continue
            for i in range(3):
                place[i] = fix_p[k, i] if what == 0 else dr_p[k, i] + (at[3 + i] if closed else 0.0)
            C, per_metre = scales(ecef, place)
            z, H, R = np.empty(3), np.zeros((3, m)), np.zeros((3, 3))
            for i in range(3):
                unit = per_metre[i] if what == 0 else 1.0
                for j in range(3):
                    for a in range(3):
                        R[i, j] += C[i, a] * C[j, a] * (var_p[k, a] if what == 0 else var_v[k, a])
                    R[i, j] *= unit * (per_metre[j] if what == 0 else 1.0)
                H[i, 3 + i if what == 0 else i] = 1.0
                z[i] = fix_p[k, i] - dr_p[k, i] if what == 0 else fix_v[k, i] - dr_v[k, i]
            if what == 0 and slow_at >= 0:
                for i in range(3):
                    for a in range(3):
                        H[i, slow_at + a] = C[i, a] * per_metre[i]
            if what == 0 and not ecef:
                z[1] -= 2.0 * np.pi * np.round(z[1] / (2.0 * np.pi))
            for i in range(3):
                for j in range(m):
                    z[i] -= H[i, j] * at[j]
            _note(z, H, R, cov, C, per_metre, what == 0, record[k, what])
            limit = gate
            to, spread = at, cov
            if state == WITHHELD:
                limit = np.inf
                to, spread = at.copy(), cov.copy()
            for attempt in range(2):
                nis = update(to, spread, z, H, R, limit)
                if attempt == 1:
                    break
                record[k, what, 1] = nis
                if np.isnan(nis):
                    return k
                if nis <= gate or state == WITHHELD:
                    rejected[what] = rejected[what] if state == WITHHELD else 0
                    break
                record[k, what, 0] = REJECTED
                if rejected[what] == 0:
                    since[what] = time[k]
                rejected[what] += 1
                if rejected[what] < FEWEST_REJECTED or time[k] - since[what] < patience:
                    break
                _doubt(cov, z, 3 if what == 0 else 0)
                # What is added here counts as noise of the step that led here, so that the smoother knows of it. It is
                # exact for a velocity behind a position of the same row too, whose gain these variances do not enter.
                _doubt(P_before[k], z, 3 if what == 0 else 0)
                record[k, what, 0] = RESET
                rejected[what] = 0
                limit = np.inf
        x[k] = at
        P[k] = cov
        for i in range(m):
            if not cov[i, i] > 0.0:
                return k
    return -1


@fused
def _doubt(cov, z, first):
    """Enlarge the variances of three states from `first` on by squared innovations. No checks are made."""
    for i in range(3):
        cov[first + i, first + i] += z[i] * z[i]


@fused
def run_backward(x, P, Phi, x_before, P_before):
    """Smooth what :func:`run_forward` left, in place; the row that failed, or -1. No checks are made."""
    for k in range(x.shape[0] - 2, -1, -1):
        if not smooth_step(x[k], P[k], Phi[k + 1], x_before[k + 1], P_before[k + 1], x[k + 1], P[k + 1]):
            return k
    return -1


@fused
def _step(C, per_metre, dt, psd, m):
    """Transition and noise of velocity and position errors over a step, exact for constant geometry."""
    F, Q = np.eye(m), np.zeros((m, m))
    for i in range(3):
        F[3 + i, i] = per_metre[i] * dt
        for j in range(3):
            s = 0.0
            for a in range(3):
                s += C[i, a] * psd[a] * C[j, a]
            Q[i, j] = s * dt
            Q[3 + i, j] = 0.5 * s * dt * dt * per_metre[i]
            Q[i, 3 + j] = 0.5 * s * dt * dt * per_metre[j]
            Q[3 + i, 3 + j] = s * dt**3 / 3.0 * per_metre[i] * per_metre[j]
    return F, Q


@fused
def _note(z, H, R, cov, C, per_metre, position, row):
    """Innovation and its variance, north, east, down, into a row of the record."""
    m = cov.shape[0]
    S = R.copy()
    for i in range(3):
        for j in range(3):
            for a in range(m):
                if H[i, a] != 0.0:
                    for b in range(m):
                        S[i, j] += H[i, a] * cov[a, b] * H[j, b]
    for a in range(3):
        row[2 + a] = 0.0
        row[5 + a] = 0.0
        for i in range(3):
            u = C[i, a] / (per_metre[i] if position else 1.0)
            row[2 + a] += u * z[i]
            for j in range(3):
                row[5 + a] += u * S[i, j] * C[j, a] / (per_metre[j] if position else 1.0)
