"""Sigma points and square roots: the linear algebra of unscented and cubature filters.

A covariance P is carried as its lower triangular root S, P = S S^T. The points are the estimate and, along every column
of S, two more at a distance of c standard deviations. Moments are put together from *columns* whose outer products add
up to the covariance, and a triangularization by Householder reflections makes the next root of them. Nothing is ever
subtracted, so that the covariance is positive semi-definite by construction and no step of it can fail; the Cholesky
downdate of the usual square-root form (van der Merwe and Wan 2001) does not appear.

**Weights without a negative one.** The scaled unscented transform (Julier 2002) with alpha, beta and kappa has the
distance ``c = alpha sqrt(n + kappa)``, outer weights ``w = 1 / (2 c^2)``, a centre weight ``1 - 2 n w`` of the mean and
``2 - 2 n w - alpha^2 + beta`` of the covariance; for a small alpha both are hugely negative. With d_i the deviations of
the propagated points from their weighted mean and d_0 that of the centre, the same covariance is

    sum_i w (d_i - a d_0)(d_i - a d_0)^T + g d_0 d_0^T        a = 1 - c^2 / n      g = beta + alpha^2 kappa / n

since ``sum_i w d_i = (2 n w - 1) d_0``. All weights are positive whenever g is, which is the one condition asked for.
The cubature rule (Arasaratnam and Haykin 2009) is alpha = 1, beta = kappa = 0: a = g = 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from navfuse.core.fused import fused
from navfuse.errors import ConfigError

Array = np.ndarray


LEAST_DISTANCE = 2e-3
"""Standard deviations. Points much nearer to the centre than this drown in the rounding of a position."""


@dataclass(frozen=True, slots=True)
class SigmaSpread:
    """Where the sigma points lie and what they weigh.

    Parameters
    ----------
    size : int
        Number of states.
    alpha : float or None
        Scale of the distance; None places the points at sqrt(3) standard deviations whatever the number of states, as
        the fourth moment of a normal distribution wants it.
    beta : float
        Weight of the centre in the covariance; 2 suits a normal distribution.
    kappa : float

    Raises
    ------
    ConfigError
        For an alpha that is not positive, points nearer than :data:`LEAST_DISTANCE`, ``size + kappa <= 0``, or ``beta +
        alpha^2 kappa / size < 0``, with which a covariance need not be positive definite.
    """

    size: int
    alpha: float | None = None
    beta: float = 2.0
    kappa: float = 0.0

    def __post_init__(self) -> None:
        for name, value in (("alpha", self.scale), ("beta", self.beta), ("kappa", self.kappa)):
            if not math.isfinite(value):
                raise ConfigError(f"sigma points: {name} = {value} must be a finite number")
        if self.alpha is not None and not self.alpha > 0.0:
            raise ConfigError(f"sigma points: alpha = {self.alpha:g} must be greater than 0")
        if not self.size + self.kappa > 0.0:
            raise ConfigError(
                f"sigma points: kappa = {self.kappa:g} must be greater than -{self.size}, the number of states"
            )
        if self.distance < LEAST_DISTANCE:
            raise ConfigError(
                f"sigma points: with alpha = {self.scale:g}, kappa = {self.kappa:g} and {self.size} states they lie "
                f"{self.distance:.2g} standard deviations from the estimate: rounding takes the place of the model; "
                f"let alpha be {LEAST_DISTANCE / math.sqrt(self.size + self.kappa):.2g} or more"
            )
        if self.centre < 0.0:
            raise ConfigError(
                f"sigma points: beta + alpha^2 kappa / n = {self.centre:.3g} with beta = {self.beta:g}, alpha = "
                f"{self.scale:g}, kappa = {self.kappa:g}, {self.size} states must not be negative, or the covariance "
                "need not stay positive definite; raise beta or kappa"
            )

    @classmethod
    def cubature(cls, size: int) -> SigmaSpread:
        """Points of the third-degree cubature rule."""
        return cls(size, 1.0, 0.0, 0.0)

    @property
    def scale(self) -> float:
        """Alpha."""
        if self.alpha is not None:
            return self.alpha
        return math.sqrt(3.0 / (self.size + self.kappa)) if self.size + self.kappa > 0.0 else 1.0

    @property
    def distance(self) -> float:
        """Standard deviations from the centre to the outer points, c."""
        return self.scale * math.sqrt(self.size + self.kappa)

    @property
    def centre(self) -> float:
        """Weight g of the centre in the covariance."""
        return self.beta + self.scale**2 * self.kappa / self.size

    def weights(self) -> Array:
        """c, w, a and g of the module, (4,)."""
        c = self.distance
        return np.array([c, 0.5 / c**2, 1.0 - c**2 / self.size, self.centre])


@fused
def _dot(a, b, begin, end):
    """Sum of a[k] b[k] in four partial sums. No checks are made."""
    p = q = r = s = 0.0
    k = begin
    while k + 4 <= end:
        p += a[k] * b[k]
        q += a[k + 1] * b[k + 1]
        r += a[k + 2] * b[k + 2]
        s += a[k + 3] * b[k + 3]
        k += 4
    while k < end:
        p += a[k] * b[k]
        k += 1
    return (p + q) + (r + s)


@fused
def triangularize(A, columns, S):
    """Lower triangular root S (n, n) of the covariance that the first columns of A (n, m) add up to, S S^T = A A^T.

    Householder reflections from the right. The diagonal of S is not negative. A is used up; `columns` may be fewer than
    n. No checks are made.
    """
    n = A.shape[0]
    for i in range(n):
        for j in range(n):
            S[i, j] = 0.0
    for j in range(min(n, columns)):
        row = A[j]
        largest = 0.0
        for k in range(j, columns):
            largest = max(largest, abs(row[k]))
        if largest == 0.0:
            for i in range(j, n):
                S[i, j] = A[i, j]
            continue
        scale = 1.0 / largest
        for k in range(j, columns):
            row[k] *= scale
        norm = np.sqrt(_dot(row, row, j, columns))
        first = row[j]
        sign = 1.0 if first < 0.0 else -1.0
        row[j] = first - sign * norm
        factor = 1.0 / (norm * (norm + abs(first)))
        S[j, j] = norm * largest
        for i in range(j + 1, n):
            other = A[i]
            share = factor * _dot(row, other, j, columns)
            for k in range(j, columns):
                other[k] -= share * row[k]
            S[i, j] = sign * other[j]


@fused
def root_of_points(A, size, columns, weights, S):
    """Root S of the covariance of propagated points and of noise.

    Parameters
    ----------
    A : (n, m) array
        Columns 0 to 2 n - 1 are the deviations of the outer points from the mean, column 2 n that of the centre, then
        `columns` - 2 n - 1 columns of noise. Used up.
    size : int
        Number of states the points were drawn for, which may differ from n: 2 size + 1 points.
    columns : int
    weights : (4,) array
        From :meth:`SigmaSpread.weights`.
    S : (n, n) array

    Notes
    -----
    No checks are made.
    """
    root, a, g = np.sqrt(weights[1]), weights[2], np.sqrt(weights[3])
    for i in range(A.shape[0]):
        centre = A[i, 2 * size]
        for p in range(2 * size):
            A[i, p] = root * (A[i, p] - a * centre)
        A[i, 2 * size] = g * centre
    triangularize(A, columns, S)


@fused
def regress(W, S):
    """Overwrite W (m, n) with the matrix X for which X S = W; a state without variance gets a zero. No checks."""
    m, n = W.shape
    for i in range(m):
        for j in range(n - 1, -1, -1):
            v = W[i, j]
            for k in range(j + 1, n):
                v -= W[i, k] * S[k, j]
            W[i, j] = v / S[j, j] if S[j, j] > 0.0 else 0.0


@fused
def semidefinite_root(R, L):
    """Lower triangular root L of a positive semi-definite matrix R (d, d); False if it is not one. No checks."""
    d = R.shape[0]
    for i in range(d):
        for j in range(d):
            L[i, j] = 0.0
    for j in range(d):
        v = R[j, j]
        for k in range(j):
            v -= L[j, k] * L[j, k]
        if v < -1e-12 * abs(R[j, j]) or not np.isfinite(v):
            return False
        root = np.sqrt(max(v, 0.0))
        L[j, j] = root
        for i in range(j + 1, d):
            v = R[i, j]
            for k in range(j):
                v -= L[i, k] * L[j, k]
            if root > 0.0:
                L[i, j] = v / root
    return True


@fused
def regression(S, delta, weights, H, m, residual):
    """Linear regression of a prediction on the state, from its values at sigma points.

    Parameters
    ----------
    S : (n, n) array
        Root of the covariance that the points were drawn from.
    delta : (2 n, d) array
        Predictions at the outer points less that at the centre: at plus each column of S, then at minus each.
    weights : (4,) array
    H, m, residual : (d, n), (d,), (d, m) arrays
        Receive the matrix, the mean of the predictions less that at the centre, and in the first 2 n + 1 columns of
        `residual` a root of the covariance of what the matrix does not explain.

    Notes
    -----
    No checks are made.
    """
    n, d = S.shape[0], m.size
    c, root, g = weights[0], np.sqrt(weights[1]), np.sqrt(weights[3])
    for e in range(d):
        total = 0.0
        for p in range(2 * n):
            total += delta[p, e]
        m[e] = weights[1] * total
        mean = (1.0 - weights[2]) * m[e]
        for j in range(n):
            slope = 0.5 * (delta[j, e] - delta[n + j, e])
            H[e, j] = slope / c
            residual[e, j] = root * (delta[j, e] - mean - slope)
            residual[e, n + j] = root * (delta[n + j, e] - mean + slope)
        residual[e, 2 * n] = g * m[e]
    regress(H, S)


@fused
def linear_update(S, H, extra, columns, nu, held, K, Szz, Sinv, dx, A):
    """Gain and correction of a measurement, and the columns of the covariance behind it, from roots.

    Parameters
    ----------
    S : (n, n) array
        Root of the covariance.
    H : (d, n) array
    extra : (d, m) array
        Its first columns are a root of the covariance of all that H does not explain, noise included.
    columns : int
    nu : (d,) array
        Innovation.
    held : (3,) array
        Direction of the attitude error that gets no gain, see :func:`navfuse.core.kalman.update`.
    K, Szz, Sinv, dx : (n, d), (d, d), (d, d), (n,) arrays
        Receive the gain, the covariance of the innovation, its inverse, and the correction.
    A : (n, n + columns) array
        Receives columns whose outer products add up to (I - K H) P (I - K H)^T + K E E^T K^T (Joseph): positive
        semi-definite for any gain.

    Returns
    -------
    float
        nu^T Szz^-1 nu; NaN if Szz is not positive definite: then the rest is not to be used.

    Notes
    -----
    No checks are made.
    """
    n, d = S.shape[0], nu.size
    V = np.zeros((d, n))
    work = np.empty((d, n + columns))
    for e in range(d):
        for k in range(n):
            h = H[e, k]
            if h != 0.0:
                for j in range(k + 1):
                    V[e, j] += h * S[k, j]
        for j in range(n):
            work[e, j] = V[e, j]
        for j in range(columns):
            work[e, n + j] = extra[e, j]
    L = np.empty((d, d))
    triangularize(work, n + columns, L)
    for e in range(d):
        if not L[e, e] > 0.0:
            return np.nan
        for f in range(e + 1):
            v = 0.0
            for k in range(f + 1):
                v += L[e, k] * L[f, k]
            Szz[e, f] = v
            Szz[f, e] = v
    inverse = np.zeros((d, d))
    for column in range(d):
        for e in range(column, d):
            v = 1.0 if e == column else 0.0
            for k in range(column, e):
                v -= L[e, k] * inverse[k, column]
            inverse[e, column] = v / L[e, e]
    nis = 0.0
    for e in range(d):
        v = 0.0
        for k in range(e + 1):
            v += inverse[e, k] * nu[k]
        nis += v * v
        for f in range(e + 1):
            v = 0.0
            for k in range(e, d):
                v += inverse[k, e] * inverse[k, f]
            Sinv[e, f] = v
            Sinv[f, e] = v
    cross = np.empty(d)
    for i in range(n):
        for e in range(d):
            cross[e] = 0.0
            for k in range(i + 1):
                cross[e] += S[i, k] * V[e, k]
        for e in range(d):
            K[i, e] = 0.0
            for f in range(d):
                K[i, e] += cross[f] * Sinv[f, e]
    if n >= 9 and (held[0] != 0.0 or held[1] != 0.0 or held[2] != 0.0):
        for e in range(d):
            v = held[0] * K[6, e] + held[1] * K[7, e] + held[2] * K[8, e]
            for i in range(3):
                K[6 + i, e] -= held[i] * v
    for i in range(n):
        v = 0.0
        for e in range(d):
            v += K[i, e] * nu[e]
        dx[i] = v
        for j in range(n):
            A[i, j] = S[i, j]
        for j in range(columns):
            A[i, n + j] = 0.0
        for e in range(d):
            k = K[i, e]
            for j in range(n):
                A[i, j] -= k * V[e, j]
            for j in range(columns):
                A[i, n + j] += k * extra[e, j]
    return nis


def draw(x: Array, S: Array, spread: SigmaSpread) -> Array:
    """Sigma points (2 n + 1, n) of a vector state: the estimate, plus and then minus every column of the root."""
    c = spread.distance
    return np.vstack([x, x + c * S.T, x - c * S.T])


def unscented_predict(
    x: Array, S: Array, f: Callable[[Array], Array], noise_root: Array, spread: SigmaSpread
) -> tuple[Array, Array]:
    """Carry a vector state through ``x' = f(x) + w``.

    Parameters
    ----------
    x : (n,) array
    S : (n, n) array
        Lower triangular root of the covariance.
    f : callable
        Takes and gives (n,) arrays.
    noise_root : (n, q) array
        Any root of the covariance of w.
    spread : SigmaSpread

    Returns
    -------
    x, S : (n,), (n, n) arrays
    """
    n = x.size
    points = np.array([f(point) for point in draw(x, S, spread)])
    weights = spread.weights()
    centre = points[0]
    mean = centre + weights[1] * (points[1:] - centre).sum(axis=0)
    A = np.hstack([(points[1:] - mean).T, (centre - mean)[:, None], noise_root])
    root = np.empty((n, n))
    root_of_points(np.ascontiguousarray(A), n, A.shape[1], weights, root)
    return mean, root


def unscented_update(
    x: Array,
    S: Array,
    z: Array,
    h: Callable[[Array], Array],
    R: Array,
    spread: SigmaSpread,
    iterations: int = 1,
) -> tuple[Array, Array, float]:
    """Use a measurement ``z = h(x) + v`` of a vector state.

    Parameters
    ----------
    x, S : (n,), (n, n) arrays
        Estimate and lower triangular root of its covariance.
    z : (d,) array
    h : callable
        From (n,) to (d,) arrays.
    R : (d, d) array
        Covariance of v.
    spread : SigmaSpread
    iterations : int
        How often the regression is made: the second time with points drawn from the first posterior, and so on
        (posterior linearization, Garcia-Fernandez, Svensson, Morelande and Sarkka 2015).

    Returns
    -------
    x, S : (n,), (n, n) arrays
    nis : float
        Normalised innovation squared of the first regression.

    Raises
    ------
    ConfigError
        If R is not positive semi-definite or the innovation has no positive definite covariance.
    """
    n, d = x.size, z.size
    weights, held = spread.weights(), np.zeros(3)
    Szz, Sinv, H, m = np.empty((d, d)), np.empty((d, d)), np.empty((d, n)), np.empty(d)
    K, dx, A, L = np.empty((n, d)), np.zeros(n), np.empty((n, 3 * n + 1 + d)), np.empty((d, d))
    extra, root, nis = np.empty((d, 2 * n + 1 + d)), S.copy(), np.nan
    if not semidefinite_root(np.asarray(R, dtype=float), L):
        raise ConfigError("R is not positive semi-definite")
    extra[:, 2 * n + 1 :] = L
    for k in range(iterations):
        predicted = np.array([h(point) for point in draw(x + dx, root, spread)])
        regression(root, np.ascontiguousarray(predicted[1:] - predicted[0]), weights, H, m, extra)
        nu = z - predicted[0] - m + H @ dx
        found = linear_update(S, H, extra, 2 * n + 1 + d, nu, held, K, Szz, Sinv, dx, A)
        if not math.isfinite(found):
            raise ConfigError("the covariance of the innovation is not positive definite; look at R")
        nis = nis if k else float(found)
        triangularize(A, A.shape[1], root)
    return x + dx, root, nis
