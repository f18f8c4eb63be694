"""The Kalman filter and smoother of a linear system with a few states, for the small systems beside the engine.

All arrays are changed in place; nothing is known of what the states mean. Sources: Kalman (1960); Joseph form, Bucy and
Joseph (1968); Rauch, Tung and Striebel (1965). The engine has kernels of its own, which know its blocks.
"""

from __future__ import annotations

import numpy as np

from navfuse.core.fused import fused
from navfuse.core.linear_kalman import innovation, propagate, smooth


@fused
def predict(x, P, Phi, Q):
    """Carry a state and its covariance over a step: x' = Phi x, P' = Phi P Phi^T + Q.

    Parameters
    ----------
    x : (n,) array
    P : (n, n) array
        Symmetric.
    Phi, Q : (n, n) arrays

    Notes
    -----
    No checks are made.
    """
    n = x.size
    moved, carried = np.zeros(n), np.empty((n, n))
    propagate(P, Phi, Q, carried)
    for i in range(n):
        for k in range(n):
            moved[i] += Phi[i, k] * x[k]
    for i in range(n):
        x[i] = moved[i]
        for j in range(n):
            P[i, j] = carried[i, j]


@fused
def update(x, P, z, H, R, gate):
    """Use a measurement if its normalised innovation squared passes a gate.

    Parameters
    ----------
    x : (n,) array
        Corrected by K z: for a filter of errors the error, for one of whole states the state.
    P : (n, n) array
    z : (d,) array
        Innovation, measured minus predicted.
    H, R : (d, n), (d, d) arrays
    gate : float
        Largest normalised innovation squared that passes; inf for none.

    Returns
    -------
    float
        z^T S^-1 z with S = H P H^T + R; NaN if S is not positive definite. Where it does not pass nothing is changed.

    Notes
    -----
    Joseph form as products, P' = (I - K H) P (I - K H)^T + K R K^T: positive semi-definite by construction, where
    :func:`navfuse.core.linear_kalman.update` has the same with differences, which is faster. No checks are made.
    """
    n, d = x.size, z.size
    HP, S, inverse = np.zeros((d, n)), np.empty((d, d)), np.empty((d, d))
    nis = innovation(P, H, R, z, HP, S, inverse)
    if not nis <= gate:
        return nis
    K = np.zeros((n, d))
    for i in range(n):
        for b in range(d):
            for a in range(d):
                K[i, b] += HP[a, i] * inverse[a, b]
        for a in range(d):
            x[i] += K[i, a] * z[a]
    A = np.zeros((n, n))
    for i in range(n):
        A[i, i] = 1.0
        for a in range(d):
            for j in range(n):
                A[i, j] -= K[i, a] * H[a, j]
    AP = np.zeros((n, n))
    for i in range(n):
        for k in range(n):
            for j in range(n):
                AP[i, j] += A[i, k] * P[k, j]
    for i in range(n):
        for j in range(i + 1):
            v = 0.0
            for k in range(n):
                v += AP[i, k] * A[j, k]
            for a in range(d):
                for b in range(d):
                    v += K[i, a] * R[a, b] * K[j, b]
            P[i, j] = v
            P[j, i] = v
    return nis


@fused
def smooth_step(x, P, Phi, x_predicted, P_predicted, x_next, P_next):
    """One step back of the smoother of Rauch, Tung and Striebel, in place.

    Parameters
    ----------
    x, P : (n,), (n, n) arrays
        Filtered at an epoch; receive the smoothed.
    Phi : (n, n) array
        Leads from there to the next epoch.
    x_predicted, P_predicted : (n,), (n, n) arrays
        Of the next epoch, before its measurements.
    x_next, P_next : (n,), (n, n) arrays
        Smoothed at the next epoch.

    Returns
    -------
    bool
        False if the predicted covariance is not positive definite: then nothing is changed.

    Notes
    -----
    G = P Phi^T P_predicted^-1, x += G (x_next - x_predicted), P += G (P_next - P_predicted) G^T. No checks are made.
    """
    n = x.size
    ahead, dx, out = np.empty(n), np.empty(n), np.empty((n, n))
    for i in range(n):
        ahead[i] = x_next[i] - x_predicted[i]
    if not smooth(P, Phi, P_predicted, P_next, ahead, dx, out):
        return False
    for i in range(n):
        x[i] += dx[i]
        for j in range(n):
            P[i, j] = out[i, j]
    return True
