"""A slow twin of the covariance propagation: the linear error equations in e, and Van Loan's method in fine steps.

Order of the states: position, velocity, attitude error (true minus estimate, resolved in e), then per inertial sensor
block three biases, three scale factors or six cross-coupling terms, written from the measurement model
``measured = (I + M) true + b``. The gravity gradient is a central difference of the twin's own gravity.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import expm

from reference.mechanization_twin import OMEGA, gravity_e, skew

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

Array = np.ndarray

PAIRS = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))


def gravity_gradient(r_e: Array, step: float = 100.0) -> Array:
    """(3, 3) derivative of gravity [1/s^2]."""
    ahead = [gravity_e(r_e + step * axis) for axis in np.eye(3)]
    behind = [gravity_e(r_e - step * axis) for axis in np.eye(3)]
    return np.column_stack([(a - b) / (2.0 * step) for a, b in zip(ahead, behind, strict=True)])


def sensor_columns(name: str, true: Array) -> Array:
    """Effect (3, k) of the states of a block on what the sensor reads when it should read `true` (3,)."""
    if name.endswith("bias"):
        return np.eye(3)
    if name.endswith("scale"):
        return np.diag(true)
    columns = np.zeros((3, 6))
    for k, (row, column) in enumerate(PAIRS):
        columns[row, k] = true[column]
    return columns


def system_matrix(names: Sequence[str], r_e: Array, C_eb: Array, w_ib_b: Array, f_b: Array, rates: Array) -> Array:
    """Continuous-time matrix (n, n); `rates` (n - 9,) holds 1/tau of the sensor states [1/s]."""
    n = 9 + rates.size
    A = np.zeros((n, n))
    A[:3, 3:6] = np.eye(3)
    A[3:6, :3] = gravity_gradient(r_e)
    A[3:6, 3:6] = -2.0 * OMEGA
    A[3:6, 6:9] = -skew(C_eb @ f_b)
    A[6:9, 6:9] = -OMEGA
    at = 9
    for name in names:
        columns = sensor_columns(name, w_ib_b if name.startswith("gyro") else f_b)
        rows = slice(6, 9) if name.startswith("gyro") else slice(3, 6)
        A[rows, at : at + columns.shape[1]] = -C_eb @ columns
        at += columns.shape[1]
    A[range(9, n), range(9, n)] = -rates
    return A


def van_loan(A: Array, Q: Array, dt: float) -> tuple[Array, Array]:
    """Discrete transition and process noise of a constant system (Van Loan 1978)."""
    n = A.shape[0]
    block = np.block([[-A, Q], [np.zeros((n, n)), A.T]]) * dt
    e = expm(block)
    Phi = e[n:, n:].T
    return Phi, Phi @ e[:n, n:]


def propagate_covariance(
    names: Sequence[str],
    motion: Callable[[float], tuple[Array, Array, Array, Array]],
    time: Array,
    P: Array,
    noise: tuple[float, float],
    variance: Array,
    walk: Array,
    rates: Array,
) -> tuple[Array, Array]:
    """Covariance (n, n) and transition at the end of `time`, in e.

    Parameters
    ----------
    motion : function of time
        r_e, C_eb, w_ib_b, f_b.
    time : (k,) array [s]
        The system is held constant from one to the next, at its value in the middle.
    P : (n, n) array
        At the start.
    noise : (float, float)
        Densities of the angular [rad^2/s] and the velocity [m^2/s^3] random walk.
    variance, walk, rates : (n - 9,) arrays
        Steady-state variance of the Gauss-Markov states, random-walk density, 1/tau.
    """
    n = P.shape[0]
    density = np.zeros(n)
    density[3:6], density[6:9] = noise[1], noise[0]
    density[9:] = np.where(rates > 0.0, 2.0 * variance * rates, walk)
    total = np.eye(n)
    for t0, t1 in pairwise(time):
        A = system_matrix(names, *motion(0.5 * (t0 + t1)), rates)
        Phi, Q = van_loan(A, np.diag(density), t1 - t0)
        P = Phi @ P @ Phi.T + Q
        total = Phi @ total
    return P, total
