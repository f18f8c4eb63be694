"""Loosely coupled open-loop INS/GNSS integration in e with 15 states, as the lecture lists it, in plain NumPy.

States in the order of the lecture: attitude, velocity, position error (true minus estimate, in e), accelerometer bias,
gyro bias. The transition is that of its system matrix with three refinements, without which no two programs agree to
nine digits: the specific force and the attitude are integrated over the interval instead of taken at its start;
products of two sub-steps are kept (trapezoidal rule instead of I + F tau); and the gravity gradient has its horizontal
part too, (g/R)(3 u u' - I) instead of 2 (g/R) u u'. :func:`first_order` is the matrix as it is printed, but for the
gradient: what the print leaves out changes the sigmas by 1 % within a minute, at any rate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from reference.mechanization_twin import E2, OMEGA, W_IE, gravity_e, skew
from reference.mechanization_twin import A as EQUATOR

Array = np.ndarray

PSI, V, R, BA, BG = (slice(3 * k, 3 * k + 3) for k in range(5))
I3 = np.eye(3)


@dataclass
class OpenLoop:
    """An inertial solution that nobody corrects, and what the filter believes of its errors."""

    r: Array
    v: Array
    C: Array
    x: Array
    P: Array

    def advance(self, dt: float, theta: Array, u: Array, noise: Array, second: bool = True) -> None:
        """One inertial sample; `noise` (4,) holds the densities of gyro, accelerometer and their biases."""
        start, force = self.C, rotated(theta, u)
        half_turn = Rotation.from_rotvec([0.0, 0.0, -0.5 * W_IE * dt]).as_matrix()
        f = half_turn @ (start @ force)
        self.r, self.v, self.C = mechanized(self.r, self.v, self.C, dt, theta, force)
        if second:
            Phi = second_order(dt, f, 0.5 * (start + self.C) * dt, gradient(self.r))
        else:
            Phi = first_order(dt, start, u / dt, self.r)
        Q = np.diag(np.repeat([noise[0], noise[1], 0.0, noise[3], noise[2]], 3)) * dt
        self.x = Phi @ self.x
        self.P = Phi @ (self.P + 0.5 * Q) @ Phi.T + 0.5 * Q

    def measure(self, what: slice, value: Array, sd: float) -> None:
        """A position (`what` = R) or velocity (V) in e. H is the lecture's with our sign: of true minus estimate."""
        H = np.zeros((3, 15))
        H[:, what] = I3
        z = value - (self.r if what == R else self.v)
        K = self.P @ H.T @ np.linalg.inv(H @ self.P @ H.T + sd**2 * I3)
        self.x = self.x + K @ (z - H @ self.x)
        A = np.eye(15) - K @ H
        self.P = A @ self.P @ A.T + sd**2 * K @ K.T


def first_order(dt: float, C: Array, f_b: Array, r: Array) -> Array:
    """Transition matrix as printed, I + F tau, with the whole gradient; biases are measured minus true."""
    Phi = np.eye(15)
    Phi[PSI, PSI] -= OMEGA * dt
    Phi[PSI, BG] = -C * dt
    Phi[V, PSI] = -skew(C @ f_b) * dt
    Phi[V, V] -= 2.0 * OMEGA * dt
    Phi[V, R] = gradient(r) * dt
    Phi[V, BA] = -C * dt
    Phi[R, V] = I3 * dt
    return Phi


def second_order(dt: float, f: Array, C_dt: Array, gradient_: Array) -> Array:
    """The same with the attitude in the middle of its change, and the velocity in the middle of its."""
    Phi = np.eye(15)
    Phi[PSI, PSI] -= OMEGA * dt
    Phi[PSI, BG] = -C_dt
    Phi[V, V] -= 2.0 * OMEGA * dt
    Phi[V, R] = gradient_ * dt
    Phi[V, BA] = -C_dt
    before = np.zeros((3, 15))
    before[:, PSI] = I3
    Phi[V] -= 0.5 * skew(f) @ (before + Phi[PSI])
    before = np.zeros((3, 15))
    before[:, V] = I3
    Phi[R] += 0.5 * dt * (before + Phi[V])
    return Phi


def radial(r: Array) -> tuple[Array, float]:
    """Up, and gravity over the distance from the centre that goes with its gradient."""
    g = gravity_e(r)
    strength = np.linalg.norm(g)
    up = -g / strength
    return up, float(strength / (EQUATOR + height(r, up)))


def gradient(r: Array) -> Array:
    """Gradient of gravity of a spherical Earth (3, 3) [1/s^2]."""
    up, ratio = radial(r)
    return ratio * (3.0 * np.outer(up, up) - I3)


def height(r: Array, up: Array) -> float:
    """Height above the ellipsoid [m] of a point with the ellipsoid's normal `up` there."""
    s2 = up[2] ** 2
    transverse = EQUATOR / np.sqrt(1.0 - E2 * s2)
    return float(np.hypot(r[0], r[1]) * np.sqrt(1.0 - s2) + r[2] * up[2] - EQUATOR**2 / transverse)


def rotated(theta: Array, u: Array) -> Array:
    """Velocity increment in the axes of the start of its interval, for a constant rate and force."""
    a = np.linalg.norm(theta)
    b, c = (0.5, 1.0 / 6.0) if a < 1e-6 else ((1.0 - np.cos(a)) / a**2, (a - np.sin(a)) / a**3)
    across = np.cross(theta, u)
    return u + b * across + c * np.cross(theta, across)


def mechanized(r: Array, v: Array, C: Array, dt: float, theta: Array, force: Array) -> tuple[Array, Array, Array]:
    """Position, velocity and attitude in e after a sample: gravity and Coriolis in the middle of the interval."""
    turn = Rotation.from_rotvec([0.0, 0.0, -W_IE * dt]).as_matrix()
    f = C @ force
    g = gravity_e(r + 0.5 * dt * v) * dt
    middle = v + 0.5 * (f + g) - OMEGA @ v * dt
    v1 = v + f - 0.5 * dt * OMEGA @ f + g - 2.0 * dt * OMEGA @ middle
    return r + 0.5 * dt * (v + v1), v1, turn @ C @ Rotation.from_rotvec(theta).as_matrix()
