"""The two unscented filters of a student report as a textbook would have them: slow, plain, independent of the package.

The report (INS-GNSS integration using UKF, WPI RBE-595) propagates latitude, longitude, height, Euler angles and
velocity with one IMU sample a second. What was wrong in print is put right here: the third component of the transport
rate is ``-v_E tan L / (R_E + h)``, Earth and transport rate are resolved in n, the height falls with a velocity down,
and the latitude goes with the meridian radius. Sigma points are the 2 n + 1 of the scaled transform with alpha = 1,
beta = 2, kappa = 0, so that no weight is negative; the covariance is a weighted sum, Q and R are added. No covariance
is patched and no exception is caught: the Cholesky factor is taken of what comes out. Only e, known exactly once it has
been fed back, is given a micrometre, since the factor wants a positive variance.

States: L, lambda [rad], h [m], roll, pitch, heading [rad], v_N, v_E, v_D [m/s], then e north, east, down [m] or biases
b_a [m/s^2], b_g [rad/s]. In the covariance, latitude and longitude are counted in metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray

A, F = 6378137.0, 1.0 / 298.257223563
E2 = F * (2.0 - F)
B = A * (1.0 - F)
RATE, GM = 7.2921151467e-5, 3.986004418e14
GRAVITY_EQUATOR, GRAVITY_K = 9.7803253359, 0.001931853
RATIO = RATE**2 * A**2 * B / GM


def radii(lat: Array) -> tuple[Array, Array]:
    """Meridian and transverse radius of curvature [m]."""
    w = 1.0 - E2 * np.sin(lat) ** 2
    return A * (1.0 - E2) / w**1.5, A / np.sqrt(w)


def gravity(lat: Array, h: Array) -> Array:
    """Normal gravity [m/s^2] down, by Somigliana with the height to second order."""
    s2 = np.sin(lat) ** 2
    surface = GRAVITY_EQUATOR * (1.0 + GRAVITY_K * s2) / np.sqrt(1.0 - E2 * s2)
    return surface * (1.0 - 2.0 / A * (1.0 + F * (1.0 - 2.0 * s2) + RATIO) * h + 3.0 / A**2 * h**2)


def skew(w: Array) -> Array:
    """Cross-product matrices (..., 3, 3)."""
    x, y, z = np.moveaxis(w, -1, 0)
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)


def dcm(euler: Array) -> Array:
    """Body to n (..., 3, 3)."""
    (sr, sp, sy), (cr, cp, cy) = np.moveaxis(np.sin(euler), -1, 0), np.moveaxis(np.cos(euler), -1, 0)
    rows = [
        cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy,
        cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy,
        -sp, sr * cp, cr * cp,
    ]  # fmt: skip
    return np.stack(rows, axis=-1).reshape(*euler.shape[:-1], 3, 3)


def euler_of(C: Array) -> Array:
    """Roll, pitch, heading (..., 3); C need not be quite orthogonal, as it comes out of a first-order step."""
    angles = np.arctan2(C[..., 2, 1], C[..., 2, 2]), -np.arcsin(np.clip(C[..., 2, 0], -1.0, 1.0))
    return np.stack([*angles, np.arctan2(C[..., 1, 0], C[..., 0, 0])], axis=-1)


def propagate(X: Array, gyro: Array, accel: Array, dt: float, exact: bool) -> Array:
    """Equations (9) to (14) of the report, for many states (m, 9) with rates (m, 3) and specific forces (m, 3).

    `exact` replaces the first-order rotation of (9) by the exponential.
    """
    lat, _, h = X[:, 0], X[:, 1], X[:, 2]
    v = X[:, 6:9]
    M, N = radii(lat)
    w_en = np.stack([v[:, 1] / (N + h), -v[:, 0] / (M + h), -v[:, 1] * np.tan(lat) / (N + h)], axis=1)
    w_ie = RATE * np.stack([np.cos(lat), np.zeros_like(lat), -np.sin(lat)], axis=1)
    C0 = dcm(X[:, 3:6])
    step = skew(gyro * dt)
    if exact:
        angle = np.maximum(np.linalg.norm(gyro * dt, axis=1), 1e-12)[:, None, None]
        turn = np.eye(3) + np.sin(angle) / angle * step + (1.0 - np.cos(angle)) / angle**2 * step @ step
    else:
        turn = np.eye(3) + step
    C1 = C0 @ turn - skew(w_ie + w_en) @ C0 * dt
    f = np.einsum("mij,mj->mi", 0.5 * (C0 + C1), accel)
    f[:, 2] += gravity(lat, h)
    v1 = v + dt * (f - np.cross(w_en + 2.0 * w_ie, v))
    out = X.copy()
    out[:, 2] = h - 0.5 * dt * (v[:, 2] + v1[:, 2])
    out[:, 0] = lat + 0.5 * dt * (v[:, 0] / (M + h) + v1[:, 0] / (M + out[:, 2]))
    out[:, 1] += 0.5 * dt * (v[:, 1] / ((N + h) * np.cos(lat)) + v1[:, 1] / ((N + out[:, 2]) * np.cos(out[:, 0])))
    out[:, 3:6] = euler_of(C1)
    out[:, 6:9] = v1
    return out


@dataclass
class Tuning:
    """Standard deviations of the noise that is added in a second: attitude [rad], velocity [m/s], e [m]; of the biases
    it is what keeps them from being frozen.
    """

    attitude: float
    velocity: float
    position: float = 0.0
    accel_bias: float = 0.0
    gyro_bias: float = 0.0


class TextbookFilter:
    """One of the two filters.

    Parameters
    ----------
    x : (9,) array
        Start.
    sd : (9,) array
        Its standard deviations, positions in metres.
    tuning : Tuning
    biases : tuple or None
        Standard deviations of accelerometer and gyro biases, for the filter of fifteen states; None for that of twelve.
    exact : bool
        See :func:`propagate`.
    """

    def __init__(self, x, sd, tuning, biases=None, exact=False):
        self.feedback = biases is None
        extra = np.zeros(3) if biases is None else np.repeat(biases, 3)
        self.x = np.concatenate([x, np.zeros(extra.size)])
        n = self.x.size
        self.P = np.diag(np.concatenate([sd, np.where(extra > 0.0, extra, 1e-6)]) ** 2)
        t = tuning
        tail = [t.position] * 3 if self.feedback else [t.accel_bias] * 3 + [t.gyro_bias] * 3
        self.q = np.array([0.0] * 3 + [t.attitude] * 3 + [t.velocity] * 3 + tail) ** 2
        self.exact = exact
        self.w = np.full(2 * n + 1, 0.5 / n)
        self.w[0] = 0.0
        self.wc = self.w.copy()
        self.wc[0] = 2.0

    def metres(self) -> Array:
        """What a radian of latitude and longitude is in metres."""
        M, N = radii(self.x[0])
        scale = np.ones(self.x.size)
        scale[0], scale[1] = M + self.x[2], (N + self.x[2]) * np.cos(self.x[0])
        return scale

    def points(self) -> Array:
        """The 2 n + 1 sigma points."""
        n = self.x.size
        L = np.linalg.cholesky(self.P) * np.sqrt(n)
        d = np.vstack([np.zeros(n), L.T, -L.T]) / self.metres()
        return self.x + d

    def collect(self, X: Array) -> Array:
        """Mean of points into the state, with angles counted from the first; their deviations [m, rad, ...]."""
        d = X - X[0]
        d[:, 3:6] = (d[:, 3:6] + np.pi) % (2.0 * np.pi) - np.pi
        mean = self.w @ d
        self.x = X[0] + mean
        self.x[3:6] = (self.x[3:6] + np.pi) % (2.0 * np.pi) - np.pi
        return (d - mean) * self.metres()

    def predict(self, gyro: Array, accel: Array, dt: float) -> None:
        """Carry points and covariance through a step."""
        X = self.points()
        m = X.shape[0]
        w, f = np.tile(gyro, (m, 1)), np.tile(accel, (m, 1))
        if not self.feedback:
            f -= X[:, 9:12]
            w -= X[:, 12:15]
        X[:, :9] = propagate(X[:, :9], w, f, dt, self.exact)
        d = self.collect(X)
        self.P = (d.T * self.wc) @ d + np.diag(self.q) * dt

    def update(self, fix: Array, sd: Array) -> None:
        """Use latitude, longitude, height and, if six values are given, velocity; feed e back."""
        X = self.points()
        k = fix.size
        Z = X[:, [0, 1, 2, 6, 7, 8][:k]].copy()
        if self.feedback:
            Z[:, :3] -= X[:, 9:12] / self.metres()[:3] * [1.0, 1.0, -1.0]
        scale = np.concatenate([self.metres()[:3], np.ones(3)])[:k]
        reference = self.x.copy()
        d = self.collect(X)
        zd = (Z - Z[0]) * scale
        mean = self.w @ zd
        S = ((zd - mean).T * self.wc) @ (zd - mean) + np.diag(sd**2)
        K = np.linalg.solve(S, ((zd - mean).T * self.wc) @ d).T
        self.x = reference + K @ ((fix - Z[0]) * scale - mean) / self.metres()
        self.P = self.P - K @ S @ K.T
        self.P = 0.5 * (self.P + self.P.T)
        if self.feedback:
            e = self.x[9:12] * [1.0, 1.0, -1.0]
            M = np.eye(12)
            M[:3, 9:12] = -np.diag([1.0, 1.0, -1.0])
            M[9:12] = 0.0
            self.x[:3] -= e / self.metres()[:3]
            self.x[9:12] = 0.0
            self.P = M @ self.P @ M.T
            self.P[range(9, 12), range(9, 12)] += 1e-6**2


def run(filter_: TextbookFilter, time: Array, gyro: Array, accel: Array, fixes: dict[float, tuple[Array, Array]]):
    """States (m, n) and covariances (m, n, n) after every sample; an IMU sample stands for the second before it."""
    states, covariances = [], []
    for k in range(1, time.size):
        filter_.predict(0.5 * (gyro[k - 1] + gyro[k]), 0.5 * (accel[k - 1] + accel[k]), time[k] - time[k - 1])
        at = round(float(time[k]), 6)
        if at in fixes:
            filter_.update(*fixes[at])
        states.append(filter_.x.copy())
        covariances.append(filter_.P.copy())
    return np.array(states), np.array(covariances)
