"""Linear Kalman measurement update in Joseph form."""

from __future__ import annotations

from math import sqrt

import numpy as np

from navfuse.core.fused import fused
from navfuse.core.rotation import left_jacobian, mat_vec


@fused
def update(P, H, R, z, gate, held, K, S, Sinv, dx):
    """Gate a measurement by its normalised innovation squared and, if it passes, update the covariance in place.

    Parameters
    ----------
    P : (n, n) array
        Covariance, symmetric; updated only if the measurement passes.
    H : (d, n) array
        Measurement matrix.
    R : (d, d) array
        Measurement noise covariance.
    z : (d,) array
        Innovation, measured minus predicted.
    gate : float
        Largest normalised innovation squared that passes; inf = no gate.
    held : (3,) array
        Direction (unit vector, or zero for none) of the attitude error that gets no gain: what is known of it stays
        (Schmidt's consider state).
    K : (n, d), S : (d, d), Sinv : (d, d), dx : (n,) arrays
        Receive the gain, the innovation covariance, its inverse and the correction K z. K and dx are left alone by a
        rejected measurement.

    Returns
    -------
    float
        z^T S^-1 z; NaN if S is not positive definite, in which case nothing is updated.

    Notes
    -----
    P+ = (I - K H) P (I - K H)^T + K R K^T (Joseph), symmetric by construction and positive semi-definite for any gain
    (Groves 2013, eq. 3.58). Cost of order n^2 d. No checks are made.
    """
    n = P.shape[0]
    d = z.size
    G = np.zeros((d, n))
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
    if not nis <= gate:
        return nis

    Kt = np.zeros((d, n))
    for a in range(d):
        for b in range(d):
            g = Sinv[a, b]
            for i in range(n):
                Kt[a, i] += g * G[b, i]
        g = held[0] * Kt[a, 6] + held[1] * Kt[a, 7] + held[2] * Kt[a, 8]
        for i in range(3):
            Kt[a, 6 + i] -= held[i] * g
    for i in range(n):
        v = 0.0
        for a in range(d):
            K[i, a] = Kt[a, i]
            v += Kt[a, i] * z[a]
        dx[i] = v
    for i in range(n):
        for a in range(d):
            g = K[i, a]
            for j in range(n):
                P[i, j] -= g * G[a, j]
    for a in range(d):
        for i in range(n):
            G[a, i] = 0.0
        for b in range(d):
            r = R[b, a]
            for i in range(n):
                G[a, i] -= r * Kt[b, i]
        for j in range(n):
            h = H[a, j]
            if h != 0.0:
                for i in range(n):
                    G[a, i] += h * P[i, j]
    for i in range(n):
        for a in range(d):
            g = G[a, i]
            for j in range(n):
                P[i, j] -= g * Kt[a, j]
    for i in range(n):
        for j in range(i):
            v = 0.5 * (P[i, j] + P[j, i])
            P[i, j] = v
            P[j, i] = v
    return nis


@fused
def invert(S, Sinv):
    """Inverse of a symmetric matrix S (d, d) into `Sinv`; False if S is not positive definite. No checks are made."""
    d = S.shape[0]
    L = np.zeros((d, d))
    for a in range(d):
        for b in range(a + 1):
            v = S[a, b]
            for c in range(b):
                v -= L[a, c] * L[b, c]
            if a == b:
                if not v > 0.0:
                    return False
                L[a, a] = sqrt(v)
            else:
                L[a, b] = v / L[b, b]
    for c in range(d):
        for a in range(d):
            v = 1.0 if a == c else 0.0
            for b in range(a):
                v -= L[a, b] * Sinv[b, c]
            Sinv[a, c] = v / L[a, a]
        for a in range(d - 1, -1, -1):
            v = Sinv[a, c]
            for b in range(a + 1, d):
                v -= L[b, a] * Sinv[b, c]
            Sinv[a, c] = v / L[a, a]
    return True


@fused
def reset_attitude(P, dpsi):
    """Covariance of the attitude error after the estimate was turned by `dpsi` (3,) [rad], in place.

    The new error is log(exp(psi) exp(-dpsi)); about psi = dpsi it is :func:`navfuse.core.rotation.left_jacobian` times
    the change of the old one (Groves 2013, section 14.2.5 neglects it; see also Markley 2003). No checks are made.
    """
    n = P.shape[0]
    J = left_jacobian((dpsi[0], dpsi[1], dpsi[2]))
    for c in range(n):
        P[6, c], P[7, c], P[8, c] = mat_vec(J, (P[6, c], P[7, c], P[8, c]))
    for c in range(n):
        P[c, 6], P[c, 7], P[c, 8] = mat_vec(J, (P[c, 6], P[c, 7], P[c, 8]))
    for i in range(6, 9):
        for j in range(6, i):
            v = 0.5 * (P[i, j] + P[j, i])
            P[i, j] = v
            P[j, i] = v
