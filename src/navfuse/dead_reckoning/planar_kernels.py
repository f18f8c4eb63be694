"""The loops of the odometry filter: state latitude, longitude, height, heading, gyro bias, odometer scale.

Errors are north, east, down in metres, then those of the other states; true minus estimate.
"""

from __future__ import annotations

import numpy as np

from navfuse.core.earth import radii
from navfuse.core.fused import fused
from navfuse.core.linear import predict, smooth_step, update
from navfuse.dead_reckoning.kernels import FEWEST_REJECTED, REJECTED, RESET, USED, WITHHELD

STATES = 6
HEADING, BIAS, SCALE = 3, 4, 5


@fused
def run_forward(
    time, distance, turn, lever, noise, at, part, fix, variance, withheld, settings,
    x, P, Phi, P_before, correction, record,
):  # fmt: skip
    """The filter; row 0 of x and P holds the start. `correction` receives what the fixes of a row changed.

    Returns the row at which the covariance failed, or -1. No checks are made.
    """
    n = time.size
    gate, patience = settings
    state, cov = x[0].copy(), P[0].copy()
    before = state.copy()
    rejected, since, j = 0, 0.0, 0
    for k in range(n):
        if k:
            before[:] = state
            advance(state, cov, distance[k - 1], turn[k - 1], time[k] - time[k - 1], noise, Phi[k])
        P_before[k] = cov
        while j < at.size and at[j] == k:
            H, z, R = np.zeros((3, STATES)), np.empty(3), np.zeros((3, 3))
            there = state.copy()
            if part[j] < 1.0:
                # A fix inside a step: the position is that of the step so far, the errors are those at its end.
                for i in range(4):
                    there[i] = before[i] + part[j] * (state[i] - before[i])
            shift(there, lever, 1.0)
            meridian, transverse = radii(np.sin(there[0]))
            dlon = fix[j, 1] - there[1]
            dlon -= 2.0 * np.pi * np.round(dlon / (2.0 * np.pi))
            z[0] = (fix[j, 0] - there[0]) * (meridian + there[2])
            z[1] = dlon * (transverse + there[2]) * np.cos(there[0])
            z[2] = there[2] - fix[j, 2]
            c, s = np.cos(there[HEADING]), np.sin(there[HEADING])
            for i in range(3):
                H[i, i] = 1.0
                R[i, i] = variance[j, i]
            H[0, HEADING] = -s * lever[0] - c * lever[1]
            H[1, HEADING] = c * lever[0] - s * lever[1]
            for i in range(3):
                record[j, 2 + i] = z[i]
                S = R[i, i]
                for a in range(STATES):
                    for b in range(STATES):
                        S += H[i, a] * cov[a, b] * H[i, b]
                record[j, 5 + i] = S
            dx = np.zeros(STATES)
            if withheld[j]:
                record[j, 0] = WITHHELD
                record[j, 1] = update(dx, cov.copy(), z, H, R, np.inf)
            else:
                record[j, 0] = USED
                record[j, 1] = update(dx, cov, z, H, R, gate)
                if np.isnan(record[j, 1]):
                    return k
                if record[j, 1] <= gate:
                    rejected = 0
                else:
                    record[j, 0] = REJECTED
                    since = time[k] if rejected == 0 else since
                    rejected += 1
                    if rejected >= FEWEST_REJECTED and time[k] - since >= patience:
                        for i in range(2):
                            cov[i, i] += z[i] * z[i]
                        cov[HEADING, HEADING] += 1.0
                        P_before[k] = cov
                        for i in range(STATES):
                            correction[k, i] = 0.0
                        update(dx, cov, z, H, R, np.inf)
                        record[j, 0] = RESET
                        rejected = 0
            correct(state, dx)
            for i in range(STATES):
                correction[k, i] += dx[i]
            j += 1
        x[k] = state
        P[k] = cov
        for i in range(4):
            if not cov[i, i] > 0.0:
                return k
    return -1


@fused
def advance(x, P, distance, turn, dt, noise, Phi):
    """One step of state and covariance; the transition goes into `Phi` (6, 6). No checks are made."""
    along, across, walk, slip, height_walk, bias_walk, scale_walk = noise
    d = distance / (1.0 + x[SCALE])
    w = turn - x[BIAS] * dt
    half = 0.5 * w
    chord = d * np.sinc(half / np.pi)
    middle = x[HEADING] + half
    c, s = np.cos(middle), np.sin(middle)
    F = np.eye(STATES)
    F[0, HEADING], F[1, HEADING] = -chord * s, chord * c
    F[0, SCALE], F[1, SCALE] = -chord * c / (1.0 + x[SCALE]), -chord * s / (1.0 + x[SCALE])
    # d(sinc)/dw is left out: it is of second order in a turn that is small wherever the bias matters.
    F[0, BIAS], F[1, BIAS] = 0.5 * dt * chord * s, -0.5 * dt * chord * c
    F[HEADING, BIAS] = -dt
    far, turned = abs(d), walk * walk * dt + slip * slip * abs(w)
    Q = np.zeros((STATES, STATES))
    q, r = along * along * far, across * across * far + turned * chord * chord / 3.0
    Q[0, 0], Q[1, 1] = q * c * c + r * s * s, q * s * s + r * c * c
    Q[0, 1] = (q - r) * c * s
    Q[1, 0] = Q[0, 1]
    Q[0, HEADING], Q[1, HEADING] = -0.5 * turned * chord * s, 0.5 * turned * chord * c
    Q[HEADING, 0], Q[HEADING, 1] = Q[0, HEADING], Q[1, HEADING]
    Q[2, 2] = height_walk * height_walk * dt
    Q[HEADING, HEADING] = turned
    Q[BIAS, BIAS] = bias_walk * bias_walk * dt
    Q[SCALE, SCALE] = scale_walk * scale_walk * dt
    nothing = np.zeros(STATES)
    predict(nothing, P, F, Q)
    Phi[:, :] = F
    dx = np.zeros(STATES)
    dx[0], dx[1], dx[HEADING] = chord * c, chord * s, w
    meridian, _ = radii(np.sin(x[0]))
    move(x, dx, x[0] + 0.5 * dx[0] / (meridian + x[2]))


@fused
def correct(x, dx):
    """Add metres north, east, down, an angle, a bias and a scale to a state. No checks are made."""
    move(x, dx, x[0])


@fused
def move(x, dx, lat):
    """The same with the radii of curvature of a given latitude."""
    meridian, transverse = radii(np.sin(lat))
    x[1] += dx[1] / ((transverse + x[2]) * np.cos(lat))
    x[1] -= 2.0 * np.pi * np.floor((x[1] + np.pi) / (2.0 * np.pi))
    x[0] += dx[0] / (meridian + x[2])
    x[2] -= dx[2]
    for i in range(3, STATES):
        x[i] += dx[i]


@fused
def shift(x, lever, sign):
    """Move the position of a state by a lever arm forward, right. No checks are made."""
    dx = np.zeros(STATES)
    c, s = np.cos(x[HEADING]), np.sin(x[HEADING])
    dx[0], dx[1] = sign * (c * lever[0] - s * lever[1]), sign * (s * lever[0] + c * lever[1])
    move(x, dx, x[0])


@fused
def run_backward(dx, P, Phi, P_before, correction):
    """Smoothed minus filtered state into `dx` (zeros), smoothed covariances into P; the row that failed, or -1."""
    n, m = dx.shape
    nothing = np.zeros(m)
    for k in range(n - 2, -1, -1):
        # Smoothed minus predicted at the next row: what its fixes changed, and what all later ones did.
        later = correction[k + 1] + dx[k + 1]
        if not smooth_step(dx[k], P[k], Phi[k + 1], nothing, P_before[k + 1], later, P[k + 1]):
            return k
    return -1
