"""Sigma points carried through the mechanization: the hot loop of the unscented filters.

At the beginning of a covariance step the points are drawn from the estimate and the root of its covariance. Every point
then integrates every increment with sensor errors of its own. At the end the sensor states decay as they do in the
extended filter, the points are brought together to a mean on the manifold, and their deviations from it, with the noise
of the step, give the next root (:mod:`navfuse.core.unscented`). Increments are never left out or averaged.

The noise of the inertial sensor in a step is additive, which for a step of a fraction of a second is what
augmentation of the state gives: its effect is some 1e-5 rad and 1e-3 m/s, too little to multiply with anything. A
rotation psi about the frame axes at an age of a before the end of the step arrives as psi, a (psi x f) and a^2/2 (psi x
f) in attitude, velocity and position, a velocity error dv as dv and a dv, and a change of a sensor state through the
mean direction cosines. The white noise is spread over the step by two Gauss points, which gives its integrals up to a^3
exactly; the change of a sensor state stands in the middle.

The coordinates of the errors are those of :mod:`navfuse.mechanization.arc_errors`.
"""

from __future__ import annotations

from functools import partial
from math import exp, sqrt

import numpy as np

from navfuse.core.fused import fused
from navfuse.core.rotation import (
    cross,
    dcm_from_quat,
)
from navfuse.core.unscented import SigmaSpread, regress, root_of_points, triangularize
from navfuse.data.nav_state import boxminus_navigation
from navfuse.mechanization.arc_errors import (
    down_axis,
    draw_points,
    plain_columns,
    plain_rows,
    retract,
    turn_gone,
    untwist,
)
from navfuse.mechanization.error_dynamics import ACC_TIME, ACCEL, BIAS, GYRO, PAIR, corrections, imu_places
from navfuse.mechanization.point_tiles import (
    LANES,
    LEFT,
    ROTATION,
    SIZE,
    TABLE,
    deviations_of_tiles,
    draw_tiles,
    load_points,
    step_tiles,
    store_points,
    tile_numbers,
    widest_rotation,
)
from navfuse.mechanization.propagate import TIME_TOLERANCE, Propagator, next_stop

Array = np.ndarray

FORCE, ANGLE, SPEED, DCM, GONE, BEGUN, ROOT = 1, 4, 7, 10, 19, 25, 31
"""Where, after ACC_TIME, the sums of a step stand for the centre point: velocity increment in m, increments of angle
and velocity in b, C_mb at the beginning; then Dw and Du since the last event, now and at the beginning of the step;
then the root of the covariance, and the points.
"""

MEAN_PASSES = 8
MEAN_ANGLE, MEAN_POSITION = 1e-10, 1e-6
EARLY, LATE = 0.5 - 0.5 / sqrt(3.0), 0.5 + 0.5 / sqrt(3.0)


@fused
def points_of(acc, n):
    """Root (n, n) and points (2 n + 1, n + 1) in an accumulator, as views. No checks are made."""
    split = ROOT + n * n
    return acc[ROOT:split].reshape((n, n)), acc[split:].reshape((2 * n + 1, n + 1))


@fused
def _correct_points(X, place, imu, cross_coupled, buffer, tiles):
    """Corrections (12 of the gyro, 12 of the accelerometer) of every point into the tiles. No checks are made."""
    for i in range(buffer.size):
        buffer[i] = 0.0
    for p in range(tiles.size // SIZE * LANES):
        row = p if p < X.shape[0] else 0
        for k in range(imu):
            buffer[place[k]] = X[row, 10 + k]
        gyro = corrections(buffer, 1, GYRO, cross_coupled)
        accel = corrections(buffer, 1, ACCEL, cross_coupled)
        at = p // LANES * SIZE + TABLE + p % LANES
        for i in range(12):
            tiles[at + i * LANES] = gyro[i]
            tiles[at + (12 + i) * LANES] = accel[i]


@fused
def _draw(nav, s, gone, S, distance, ecef, X, tiles):
    """The sigma points about the estimate: the navigation states into the tiles, the other states into X. No checks."""
    n = S.shape[0]
    if draw_tiles(nav, gone, S, distance, down_axis(nav, ecef), ecef, tiles):
        for p in range(2 * n + 1):
            j = (p - 1) % n
            c = 0.0 if p == 0 else (distance if p <= n else -distance)
            for i in range(9, n):
                X[p, 1 + i] = s[i - 9] + c * S[i, j]
        return
    draw_points(nav, s, gone, S, np.zeros(n), distance, ecef, X)
    load_points(X, tiles)


@fused
def _deviations(X, tiles, reference, gone, ecef, A):
    """Deviations of all points from a reference into the columns of A: outer points, then the centre. No checks."""
    count = X.shape[0]
    n = A.shape[0]
    u = down_axis(reference, ecef)
    if deviations_of_tiles(reference, gone, u, ecef, tiles):
        for p in range(count):
            column = p - 1 if p > 0 else count - 1
            at = p // LANES * SIZE + LEFT + p % LANES
            for i in range(9):
                A[i, column] = tiles[at + i * LANES]
            for i in range(9, n):
                A[i, column] = X[p, 1 + i] - reference[1 + i]
        return
    d = np.empty(9)
    for p in range(count):
        column = p - 1 if p > 0 else count - 1
        boxminus_navigation(X[p, :10], reference[:10], ecef, d)
        turn_gone(gone, (d[6], d[7], d[8]), d, -1.0)
        untwist(d, u)
        for i in range(9):
            A[i, column] = d[i]
        for i in range(9, n):
            A[i, column] = X[p, 1 + i] - reference[1 + i]


@fused
def _mean_of_points(X, tiles, weight, gone, ecef, reference, shift, A):
    """Weighted mean of the points on the manifold, from the centre by Gauss and Newton; leaves the deviations from it
    in A. X and tiles both hold the points.

    No checks are made.
    """
    n = A.shape[0]
    outer = X.shape[0] - 1
    for i in range(n + 1):
        reference[i] = X[0, i]
    for _ in range(MEAN_PASSES):
        _deviations(X, tiles, reference, gone, ecef, A)
        for i in range(n):
            total = 0.0
            for p in range(outer):
                total += A[i, p] - A[i, outer]
            shift[i] = A[i, outer] + weight * total
        angle = max(abs(shift[6]), abs(shift[7]), abs(shift[8]))
        far = max(abs(shift[0]), abs(shift[1]), abs(shift[2]))
        if angle < MEAN_ANGLE and far < MEAN_POSITION:
            break
        retract(reference[:10], gone, shift, ecef)
        for i in range(9, n):
            reference[1 + i] += shift[i]


@fused
def _add_noise(acc, imu_map, stochastic, decay, noise, after, A, first):
    """Columns of the noise of a step, from column `first` of A (n, m) on; the column behind the last. No checks."""
    n = A.shape[0]
    T = acc[ACC_TIME]
    at = first
    f = (acc[FORCE] / T, acc[FORCE + 1] / T, acc[FORCE + 2] / T)
    for sensor in range(2):
        size = sqrt(0.5 * noise[sensor] * T)
        if size > 0.0:
            for node in range(2):
                age = T * (EARLY if node == 0 else LATE)
                for axis in range(3):
                    for i in range(n):
                        A[i, at] = 0.0
                    if sensor == GYRO:
                        A[6 + axis, at] = size
                        v = cross((A[6, at], A[7, at], A[8, at]), f)
                        for i in range(3):
                            A[3 + i, at] = age * v[i]
                            A[i, at] = 0.5 * age * age * v[i]
                    else:
                        A[3 + axis, at] = size
                        A[axis, at] = age * size
                    at += 1
    for k in range(n - 9):
        size = sqrt(stochastic[k, 0] * (1.0 - decay[k] * decay[k]) + stochastic[k, 1] * T)
        if size == 0.0:
            continue
        for i in range(n):
            A[i, at] = 0.0
        A[9 + k, at] = size
        if k < imu_map.shape[0]:
            sensor, row, column = imu_map[k]
            factor = size
            if column != BIAS:
                factor *= acc[(ANGLE if sensor == GYRO else SPEED) + column] / T
            u = (
                -0.5 * factor * (acc[DCM + row] + after[row]),
                -0.5 * factor * (acc[DCM + 3 + row] + after[3 + row]),
                -0.5 * factor * (acc[DCM + 6 + row] + after[6 + row]),
            )
            v = cross(u, f)
            for i in range(3):
                if sensor == GYRO:
                    A[6 + i, at] = 0.5 * T * u[i]
                    A[3 + i, at] = 0.125 * T * T * v[i]
                else:
                    A[3 + i, at] = 0.5 * T * u[i]
                    A[i, at] = 0.125 * T * T * u[i]
        at += 1
    return at


@fused
def _collect(acc, nav, s, F, weights, ecef, imu_map, stochastic, noise, decay, tiles, A, W, reference, shift):
    """End a covariance step: mean and root of the points, and their transition into F if it has rows. No checks."""
    n = A.shape[0]
    S, X = points_of(acc, n)
    T = acc[ACC_TIME]
    store_points(tiles, X)
    for k in range(n - 9):
        decay[k] = exp(-T * stochastic[k, 2]) if stochastic[k, 2] > 0.0 else 1.0
        for p in range(2 * n + 1):
            X[p, 10 + k] *= decay[k]
    after = dcm_from_quat((X[0, 6], X[0, 7], X[0, 8], X[0, 9]))
    gone = acc[GONE:BEGUN]
    _mean_of_points(X, tiles, weights[1], gone, ecef, reference, shift, A)
    if F.shape[0] > 0:
        for i in range(9):
            for j in range(n):
                W[i, j] = (A[i, j] - A[i, n + j]) / (2.0 * weights[0])
        regress(W, S)
        plain_rows(gone, W)
        plain_columns(acc[BEGUN:ROOT], W)
        _chain(W, decay, F)
    first = 2 * n + 1
    columns = _add_noise(acc, imu_map, stochastic, decay, noise, after, A, first)
    for c in range(first, columns):
        psi = (A[6, c], A[7, c], A[8, c])
        for part in range(0, 6, 3):
            u = cross(psi, (gone[part], gone[part + 1], gone[part + 2]))
            for i in range(3):
                A[part + i, c] -= u[i]
    root_of_points(A, n, columns, weights, S)
    for i in range(10):
        nav[i] = reference[i]
    for i in range(n - 9):
        s[i] = reference[10 + i]
    for i in range(GONE):
        acc[i] = 0.0


@fused
def _chain(W, decay, F):
    """F (10, n) <- transition of the step times F; W (9, n) holds its navigation rows. No checks are made."""
    n = F.shape[1]
    column = np.empty(9)
    for c in range(n):
        for i in range(9):
            v = W[i, c] * F[9, c] if c >= 9 else 0.0
            for k in range(9):
                v += W[i, k] * F[k, c]
            column[i] = v
        for i in range(9):
            F[i, c] = column[i]
    for k in range(n - 9):
        F[9, 9 + k] *= decay[k]


@fused
def covariance_of_root(acc, P):
    """The first nine or all n rows of the covariance of the plain errors, into P (9 or n, n). No checks are made."""
    n = P.shape[1]
    S = acc[ROOT : ROOT + n * n].reshape((n, n))
    T = S.copy()
    plain_rows(acc[GONE:BEGUN], T)
    for i in range(P.shape[0]):
        for c in range(n):
            if c < i:
                P[i, c] = P[c, i]
                continue
            v = 0.0
            for k in range(max(9, i + 1)):
                v += T[i, k] * T[c, k]
            P[i, c] = v


@fused
def _drop(acc, part, A):
    """Take a part (6,) out of Dw and Du, to first order; A is a (n, n) work space. No checks are made."""
    n = A.shape[0]
    S = acc[ROOT : ROOT + n * n].reshape((n, n))
    for i in range(n):
        for j in range(n):
            A[i, j] = S[i, j]
    plain_rows(part, A)
    triangularize(A, n, S)
    for i in range(6):
        acc[GONE + i] -= part[i]


@fused
def relax(acc, A):
    """Begin to integrate anew, Dw = Du = 0, where plain errors are as good: the covariance that is put out stays what
    it is. A is a (n, n) work space. No checks are made.
    """
    _drop(acc, acc[GONE:BEGUN].copy(), A)


@fused
def relax_vertical(nav, acc, ecef, A):
    """The same for the vertical parts of Dw and Du alone. A is a (n, n) work space. No checks are made.

    A heading leaves them as they are. They are mostly gravity, g tau and g tau^2 / 2, so that at rest a tilt t and a
    heading y, known to half a degree and 20 deg, stand for y t g tau^2 / 2 = 6 m after 20 s: on an arc, if y was there
    all the time, but not if a gyro bias has made it since.
    """
    gone = acc[GONE:BEGUN]
    u = down_axis(nav, ecef)
    vertical = np.empty(6)
    for part in range(0, 6, 3):
        along = gone[part] * u[0] + gone[part + 1] * u[1] + gone[part + 2] * u[2]
        for i in range(3):
            vertical[part + i] = along * u[i]
    _drop(acc, vertical, A)


@fused
def settle(carried, acc, weights, ecef, X, A):
    """Begin to integrate anew: Dw = Du = 0. The sigma points X, whose deviations from their mean are now plain, give
    the new estimate and root; A is a (n, 2 n + 1) work space. No checks are made.
    """
    n = A.shape[0]
    gone = acc[GONE:BEGUN]
    moved = False
    for i in range(6):
        moved = moved or gone[i] != 0.0
    if not moved:
        return
    S = acc[ROOT : ROOT + n * n].reshape((n, n))
    reference, shift = np.empty(n + 1), np.empty(n)
    tiles = np.empty(tile_numbers(2 * n + 1))
    _draw(carried[:10], carried[10 : n + 1], gone, S, weights[0], ecef, X, tiles)
    store_points(tiles, X)
    for i in range(6):
        gone[i] = 0.0
    _mean_of_points(X, tiles, weights[1], gone, ecef, reference, shift, A)
    root_of_points(A, n, 2 * n + 1, weights, S)
    for i in range(n + 1):
        carried[i] = reference[i]
    covariance_of_root(acc, carried[2 * n + 1 :].reshape((n, n)))


@fused
def propagate_points(
    times,
    inc_theta_b,
    inc_v_b,
    nav,
    s,
    x,
    P,
    F,
    acc,
    last,
    ecef,
    cross_coupled,
    place,
    imu_map,
    stochastic,
    noise,
    weights,
    buffer,
    tiles,
    decay,
    A,
    W,
    reference,
    shift,
    cov_period,
    out_period,
    out_time,
    out_nav,
    out_x,
    out_P,
    out_F,
    i,
    t,
    t_end,
    out_next,
    rows,
):
    """Carry the sigma points through every increment up to `t_end`, the counterpart of
    :func:`navfuse.mechanization.propagate.propagate`, whose parameters and results it shares.

    Parameters
    ----------
    x : (n,) array
        Stays zero: a closed loop.
    acc : array
        Sums, root and points, as :meth:`UnscentedPropagator.accumulator` makes it.
    cross_coupled : bool
    place, imu_map, stochastic, noise, weights
        What :class:`UnscentedPropagator` was made with, and the weights of the points.
    buffer, tiles, decay, A, W, reference, shift : arrays
        Work space.

    Notes
    -----
    Inside a step `nav` and `s` are those of the centre point, P that of the step's beginning. No checks are made.
    """
    k = inc_theta_b.shape[0]
    n = x.size
    capacity = out_time.shape[0]
    S, X = points_of(acc, n)
    dt = 0.0
    if acc[ACC_TIME] > 0.0:
        load_points(X, tiles)
        _correct_points(X, place, imu_map.shape[0], cross_coupled, buffer, tiles)
    factor, bias = widest_rotation(tiles)
    while i < k and t < t_end - TIME_TOLERANCE:
        stop, put, whole, dt, part = next_stop(times, i, t, t_end, capacity > 0, out_period, out_next)
        if acc[ACC_TIME] == 0.0:
            _draw(nav, s, acc[GONE:BEGUN], S, weights[0], ecef, X, tiles)
            for c in range(6):
                acc[BEGUN + c] = acc[GONE + c]
            _correct_points(X, place, imu_map.shape[0], cross_coupled, buffer, tiles)
            factor, bias = widest_rotation(tiles)
            C = dcm_from_quat((nav[6], nav[7], nav[8], nav[9]))
            for c in range(9):
                acc[DCM + c] = C[c]
        inc = (part * inc_theta_b[i, 0], part * inc_theta_b[i, 1], part * inc_theta_b[i, 2])
        push = (part * inc_v_b[i, 0], part * inc_v_b[i, 1], part * inc_v_b[i, 2])
        rotation = abs(inc[0]) + abs(inc[1]) + abs(inc[2]) + 3.0 * bias * dt
        step_tiles(tiles, ecef, dt, inc, push, factor * rotation < ROTATION)
        acc[ACC_TIME] += dt
        for c in range(3):
            theta, dv, f = tiles[LEFT + c * LANES], tiles[LEFT + (3 + c) * LANES], tiles[LEFT + (6 + c) * LANES]
            acc[FORCE + c] += f
            acc[GONE + c] += dt * acc[GONE + 3 + c] + 0.5 * dt * f
            acc[GONE + 3 + c] += f
            acc[ANGLE + c] += theta
            acc[SPEED + c] += dv
            last[c] = theta / dt
            last[3 + c] = dv / dt
        t = stop
        if whole:
            i += 1
        if put or acc[ACC_TIME] >= cov_period - TIME_TOLERANCE or t >= t_end - TIME_TOLERANCE:
            _collect(acc, nav, s, F, weights, ecef, imu_map, stochastic, noise, decay, tiles, A, W, reference, shift)
        if put:
            out_time[rows] = t if out_period <= 0.0 else out_next * out_period
            for c in range(10):
                out_nav[rows, c] = nav[c]
            for c in range(n):
                out_x[rows, c] = 0.0
            covariance_of_root(acc, out_P[rows])
            if out_F.shape[0] > 0:
                for r in range(10):
                    for c in range(n):
                        out_F[rows, r, c] = F[r, c]
                        F[r, c] = 1.0 if r == c or (r == 9 and c >= 9) else 0.0
                for c in range(9):
                    F[9, c] = 1.0
            rows += 1
            out_next += 1
            if rows == capacity:
                break
    if acc[ACC_TIME] > 0.0:
        store_points(tiles, X)
        for c in range(10):
            nav[c] = X[0, c]
        for c in range(n - 9):
            s[c] = X[0, 10 + c]
    covariance_of_root(acc, P)
    return i, t, out_next, rows


class UnscentedPropagator(Propagator):
    """The hot loop of an unscented filter, with everything that stays the same during a run.

    Parameters
    ----------
    imu_map, noise, stochastic, ecef, covariance_period, output_period
        See :class:`navfuse.mechanization.propagate.Propagator`.
    spread : SigmaSpread
    """

    def __init__(
        self,
        imu_map,
        noise,
        stochastic,
        ecef: bool,
        covariance_period: float,
        output_period: float,
        spread: SigmaSpread,
    ):
        super().__init__(imu_map, noise, stochastic, ecef, covariance_period, output_period)
        n = self.size
        decays = stochastic[:, 2] > 0.0
        place = imu_places(imu_map)
        cross_coupled = bool(place.max(initial=-1) >= PAIR)
        kept = np.column_stack(
            [np.where(decays, stochastic[:, 0], 0.0), np.where(decays, 0.0, stochastic[:, 1]), stochastic[:, 2]]
        )
        self.weights = spread.weights()
        columns = 2 * n + 1 + 12 + (n - 9)
        self._fixed = (
            ecef,
            cross_coupled,
            place,
            np.ascontiguousarray(imu_map, dtype=np.int64),
            np.ascontiguousarray(kept),
            np.asarray(noise, dtype=float),
            self.weights,
            np.zeros(2 * PAIR),
            np.empty(tile_numbers(2 * n + 1)),
            np.empty(n - 9),
            np.empty((n, columns)),
            np.empty((9, n)),
            np.empty(n + 1),
            np.empty(n),
        )

    def accumulator(self) -> np.ndarray:
        """Sums, a root of zero, and room for the points."""
        n = self.size
        return np.zeros(ROOT + n * n + (2 * n + 1) * (n + 1))

    def keep(self, acc: np.ndarray) -> np.ndarray | None:
        """The sums and the root, and within a step the points."""
        return (acc if acc[ACC_TIME] > 0.0 else acc[: ROOT + self.size**2]).copy()

    def resume(self, kept: np.ndarray | None) -> np.ndarray:
        """See :meth:`navfuse.mechanization.propagate.Propagator.resume`."""
        acc = self.accumulator()
        if kept is not None:
            acc[: kept.size] = kept
        return acc

    def root(self, acc: np.ndarray) -> np.ndarray:
        """The root of the covariance (n, n) in an accumulator, a view."""
        return acc[ROOT : ROOT + self.size**2].reshape(self.size, self.size)

    def stepper(self, increments, nav, s, x, P, F, acc, last, out) -> partial[tuple[int, float, int, int]]:
        """See :meth:`navfuse.mechanization.propagate.Propagator.stepper`."""
        return partial(
            propagate_points,
            increments.time,
            increments.inc_theta_b,
            increments.inc_v_b,
            nav,
            s,
            x,
            P,
            F,
            acc,
            last,
            *self._fixed,
            self.covariance_period,
            self.output_period,
            *out,
        )
