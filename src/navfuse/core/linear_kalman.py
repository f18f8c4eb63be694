"""Kalman filter and fixed-interval smoother on small dense state vectors, one step at a time.

:mod:`navfuse.core.kalman` updates the covariance of a navigation filter, whose attitude has its place among the states.
These kernels know of no layout: they serve filters of a few states, and filters whose gain is withheld from some of
them. Together they are the filter of Kalman (1960) and the smoother of Rauch, Tung and Striebel (1965).
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from navfuse.core.fused import fused
from navfuse.core.kalman import invert


@fused
def propagate(P, F, Q, out):
    """Covariance behind a transition, ``F P F^T + Q``, into `out`.

    Parameters
    ----------
    P, F, Q : (n, n) arrays
        Covariance, transition matrix and process noise covariance. Zeros of F cost nothing.
    out : (n, n) array
        Receives the result, symmetric; may not be P.

    Notes
    -----
    Groves 2013, eq. 3.46 (there phi and Q of the interval before). No checks are made.
    """
    n = P.shape[0]
    T = np.zeros((n, n))
    for i in range(n):
        for k in range(n):
            f = F[i, k]
            if f != 0.0:
                for j in range(n):
                    T[i, j] += f * P[k, j]
    for i in range(n):
        for j in range(n):
            out[i, j] = Q[i, j]
    for j in range(n):
        for k in range(n):
            f = F[j, k]
            if f != 0.0:
                for i in range(n):
                    out[i, j] += T[i, k] * f
    _symmetrize(out)


@fused
def innovation(P, H, R, z, G, S, Sinv):
    """Covariance of an innovation, and its normalised square.

    Parameters
    ----------
    P : (n, n), H : (d, n), R : (d, d), z : (d,) arrays
        See :func:`update`.
    G : (d, n), S : (d, d), Sinv : (d, d) arrays
        Receive H P, for which G has to hold zeros, ``S = H P H^T + R`` and its inverse.

    Returns
    -------
    float
        ``z^T S^-1 z``; NaN if S is not positive definite.

    Notes
    -----
    No checks are made.
    """
    n, d = P.shape[0], z.size
    for a in range(d):
        for j in range(n):
            h = H[a, j]
            if h != 0.0:
                for i in range(n):
                    G[a, i] += h * P[j, i]
    for a in range(d):
        for b in range(a + 1):
            v = R[a, b]
            for j in range(n):
                v += G[a, j] * H[b, j]
            S[a, b] = v
            S[b, a] = v
    if not invert(S, Sinv):
        return np.nan
    nis = 0.0
    for a in range(d):
        for b in range(d):
            nis += z[a] * Sinv[a, b] * z[b]
    return nis


@fused
def update(P, H, R, z, gate, free, S, dx):
    """Gate a measurement and, if it passes, update the covariance in place.

    Parameters
    ----------
    P : (n, n) array
        Covariance, symmetric; updated only if the measurement passes.
    H : (d, n), R : (d, d), z : (d,) arrays
        Measurement matrix, noise covariance and innovation (measured minus predicted).
    gate : float
        Largest normalised innovation squared that passes; inf = no gate.
    free : (n,) array
        Factor on the gain of each state: 1, or 0 for a state that the measurement must not move although its
        uncertainty counts in S (Schmidt's consider state, Bierman 1977, section VIII.2).
    S : (d, d), dx : (n,) arrays
        Receive the innovation covariance and the correction; dx is left alone by a rejected measurement.

    Returns
    -------
    float
        ``z^T S^-1 z``; NaN if S is not positive definite, in which case nothing is updated.

    Notes
    -----
    ``P+ = (I - K H) P (I - K H)^T + K R K^T``, valid for any gain (Groves 2013, eq. 3.58). No checks are made.
    """
    n, d = P.shape[0], z.size
    G, Sinv = np.zeros((d, n)), np.empty((d, d))
    nis = innovation(P, H, R, z, G, S, Sinv)
    if not nis <= gate:
        return nis
    K = np.zeros((n, d))
    for i in range(n):
        v = 0.0
        for a in range(d):
            k = 0.0
            for b in range(d):
                k += Sinv[a, b] * G[b, i]
            K[i, a] = free[i] * k
            v += K[i, a] * z[a]
        dx[i] = v
    # With A = K H P the Joseph form is P - A - A^T + K S K^T.
    for i in range(n):
        for j in range(i + 1):
            v = P[i, j]
            for a in range(d):
                k = 0.0
                for b in range(d):
                    k += S[a, b] * K[j, b]
                v += K[i, a] * (k - G[a, j]) - K[j, a] * G[a, i]
            P[i, j] = v
            P[j, i] = v
    return nis


@fused
def smooth(P, F, P_before, P_next, e, dx, out):
    """One step back of the smoother of Rauch, Tung and Striebel.

    Parameters
    ----------
    P : (n, n) array
        Filtered covariance of this epoch, its measurements included.
    F : (n, n) array
        Transition to the next epoch.
    P_before : (n, n) array
        Covariance of the next epoch before its measurements, ``F P F^T + Q``; positive definite.
    P_next : (n, n) array
        Smoothed covariance of the next epoch.
    e : (n,) array
        Smoothed less predicted state of the next epoch.
    dx : (n,), out : (n, n) arrays
        Receive the smoothed less filtered state of this epoch, and its smoothed covariance.

    Returns
    -------
    bool
        False if `P_before` is not positive definite, in which case nothing is written.

    Notes
    -----
    ``G = P F^T P_before^-1``, ``dx = G e``, ``P_s = P + G (P_next - P_before) G^T`` (Rauch, Tung and Striebel 1965,
    eqs. 3.29-3.31). The square root of `P_before` is taken, it is not inverted. No checks are made.
    """
    n = P.shape[0]
    L = np.zeros((n, n))
    for a in range(n):
        for b in range(a + 1):
            v = P_before[a, b]
            for c in range(b):
                v -= L[a, c] * L[b, c]
            if a == b:
                if not v > 0.0:
                    return False
                L[a, a] = sqrt(v)
            else:
                L[a, b] = v / L[b, b]
    # Row i of G solves P_before g = (F P)[:, i]; G is kept transposed so that the loops run along rows.
    Gt = np.zeros((n, n))
    for a in range(n):
        for k in range(n):
            f = F[a, k]
            if f != 0.0:
                for i in range(n):
                    Gt[a, i] += f * P[k, i]
    for a in range(n):
        for b in range(a):
            l = L[a, b]
            for i in range(n):
                Gt[a, i] -= l * Gt[b, i]
        for i in range(n):
            Gt[a, i] /= L[a, a]
    for a in range(n - 1, -1, -1):
        for b in range(a + 1, n):
            l = L[b, a]
            for i in range(n):
                Gt[a, i] -= l * Gt[b, i]
        for i in range(n):
            Gt[a, i] /= L[a, a]
    T = np.zeros((n, n))
    for a in range(n):
        for b in range(n):
            d = P_next[a, b] - P_before[a, b]
            for i in range(n):
                T[a, i] += d * Gt[b, i]
    for i in range(n):
        v = 0.0
        for a in range(n):
            v += Gt[a, i] * e[a]
        dx[i] = v
        for j in range(n):
            out[i, j] = P[i, j]
    for a in range(n):
        for i in range(n):
            g = Gt[a, i]
            for j in range(n):
                out[i, j] += g * T[a, j]
    _symmetrize(out)
    return True


@fused
def _symmetrize(A):
    for i in range(A.shape[0]):
        for j in range(i):
            v = 0.5 * (A[i, j] + A[j, i])
            A[i, j] = v
            A[j, i] = v
