"""A dense Kalman filter, smoother and batch estimate for a run whose inertial solution is the truth.

With ideal sensors and an exact start an uncorrected inertial solution stays on the true motion, and what an open-loop
filter estimates is linear in the measurements. Textbook matrices in e, NumPy only; see
:mod:`reference.error_dynamics_twin` for the transition and the process noise.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from reference.error_dynamics_twin import propagate_covariance
from reference.navigation_algebra import position_e, rotation_en

if TYPE_CHECKING:
    from navfuse.data.layout import Layout
    from navfuse.data.logs import GnssLog
    from navfuse.imu.error_model import ImuErrorModel
    from navfuse.simulation import Motion

Array = np.ndarray


@dataclass
class DenseRun:
    """Epochs of a dense filter: the start, every fix, and the end.

    Attributes
    ----------
    time : list of float [s]
    F : list of (n, n) arrays
        Transition that leads to each epoch from the one before; the first is the identity.
    Q : list of (n, n) arrays
        Process noise that comes with it.
    H, R, z : lists
        Measurement of each epoch, None where there is none.
    x_before, P_before, x, P : lists
        Before and after the measurement.
    """

    time: list = field(default_factory=list)
    F: list = field(default_factory=list)
    Q: list = field(default_factory=list)
    H: list = field(default_factory=list)
    R: list = field(default_factory=list)
    z: list = field(default_factory=list)
    x_before: list = field(default_factory=list)
    P_before: list = field(default_factory=list)
    x: list = field(default_factory=list)
    P: list = field(default_factory=list)


def to_e(motion: Motion, time: float, n: int) -> Array:
    """(n, n) rotation of an error from n to e at the true position; states after the ninth are left alone."""
    place = motion.trajectory(np.array([time]))
    turn = np.eye(n)
    turn[:9, :9] = np.kron(np.eye(3), rotation_en(place.lat[0], place.lon[0]))
    return turn


def dense_filter(
    motion: Motion, log: GnssLog, lever: Array, P0_n: Array, model: ImuErrorModel, layout: Layout
) -> DenseRun:
    """Filter the position fixes of a log; `P0_n` (9, 9) is the start covariance in n."""
    n = layout.size
    names = tuple(block.name for block in layout.blocks)
    sd, tau, walk = (layout.per_state(a) for a in ("sd", "tau", "walk"))
    run = DenseRun()

    def at(t):
        state = motion.at(t)
        return state.r_e[0], motion.C_eb(t), state.w_ib_b[0], state.f_b[0]

    P, x, now = np.zeros((n, n)), np.zeros(n), 0.0
    P[:9, :9] = P0_n
    P[range(9, n), range(9, n)] = sd**2
    P = to_e(motion, 0.0, n) @ P @ to_e(motion, 0.0, n).T
    epochs = [(0.0, None), *((t, k) for k, t in enumerate(log.time)), (motion.end, None)]
    for time, k in epochs:
        steps = np.linspace(now, time, round((time - now) / 0.02) + 1)
        Q, F = propagate_covariance(
            names, at, steps, np.zeros((n, n)), (model.arw**2, model.vrw**2), sd**2, walk**2, 1.0 / tau
        )
        x, P, now = F @ x, F @ P @ F.T + Q, time
        H = R = z = None
        run.x_before.append(x)
        run.P_before.append(P)
        if k is not None:
            l_e = motion.C_eb(time) @ lever
            C_en = to_e(motion, time, n)[:3, :3]
            H, R = np.zeros((3, n)), C_en @ np.diag(log.sd_position[k] ** 2) @ C_en.T
            H[:, :3], H[:, 6:9] = np.eye(3), -np.cross(np.eye(3), l_e)
            z = position_e(log.lat[k], log.lon[k], log.height[k]) - motion.r_e(time) - l_e
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            x = x + K @ (z - H @ x)
            A = np.eye(n) - K @ H
            P = A @ P @ A.T + K @ R @ K.T
        for name, value in (("time", time), ("F", F), ("Q", Q), ("H", H), ("R", R), ("z", z), ("x", x), ("P", P)):
            getattr(run, name).append(value)
    return run


def rauch_tung_striebel(run: DenseRun) -> tuple[list[Array], list[Array]]:
    """Smoothed estimates and covariances of every epoch (Rauch, Tung and Striebel 1965)."""
    x, P = [run.x[-1]], [run.P[-1]]
    for k in range(len(run.time) - 2, -1, -1):
        gain = np.linalg.solve(run.P_before[k + 1], run.F[k + 1] @ run.P[k]).T
        x.insert(0, run.x[k] + gain @ (x[0] - run.x_before[k + 1]))
        P.insert(0, run.P[k] + gain @ (P[0] - run.P_before[k + 1]) @ gain.T)
    return x, P


def batch(run: DenseRun) -> tuple[list[Array], list[Array]]:
    """The same from the joint prior of all epochs, conditioned on all measurements at once."""
    n, epochs = run.P[0].shape[0], len(run.time)
    prior = np.zeros((epochs * n, epochs * n))
    block = run.P_before[0]
    for i in range(epochs):
        block = block if i == 0 else run.F[i] @ block @ run.F[i].T + run.Q[i]
        across = block
        for j in range(i, epochs):
            across = across if j == i else run.F[j] @ across
            prior[j * n : (j + 1) * n, i * n : (i + 1) * n] = across
            prior[i * n : (i + 1) * n, j * n : (j + 1) * n] = across.T
    measured = [k for k in range(epochs) if run.z[k] is not None]
    H = np.zeros((3 * len(measured), epochs * n))
    S = np.zeros((3 * len(measured),) * 2)
    for row, k in enumerate(measured):
        H[3 * row : 3 * row + 3, k * n : (k + 1) * n] = run.H[k]
        S[3 * row : 3 * row + 3, 3 * row : 3 * row + 3] = run.R[k]
    S += H @ prior @ H.T
    gain = np.linalg.solve(S, H @ prior).T
    x = gain @ np.concatenate([run.z[k] for k in measured])
    P = prior - gain @ H @ prior
    return list(x.reshape(epochs, n)), [P[k * n : (k + 1) * n, k * n : (k + 1) * n] for k in range(epochs)]
