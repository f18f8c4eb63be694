"""Unscented and cubature Kalman filters of the whole navigation state, on its manifold, in square-root form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from navfuse.aiding.base import AidingSensor, noise_covariance
from navfuse.core.fused import fused
from navfuse.core.rotation import left_jacobian, mat_vec
from navfuse.core.unscented import (
    SigmaSpread,
    gain,
    innovation,
    posterior_columns,
    triangularize,
)
from navfuse.data.nav_state import NavState, boxplus_navigation, correct_rates, sensor_offsets
from navfuse.errors import ConfigError, FilterError
from navfuse.filters.event import parts, room
from navfuse.filters.navigation_filter import NavigationFilter
from navfuse.filters.settings import FilterSettings
from navfuse.mechanization.error_dynamics import ACC_TIME
from navfuse.mechanization.sigma_points import UnscentedPropagator, covariance_of_root, draw_points

Array = np.ndarray


@fused
def states_at_points(nav, s, rates, S, distance, offsets, ecef, X, point_rates):
    """What aiding sensors see at every sigma point: states X (2 n + 1, n + 1) and rates (2 n + 1, 6). No checks."""
    n = S.shape[0]
    draw_points(nav, s, S, distance, ecef, X)
    d = np.empty(n)
    for p in range(2 * n + 1):
        for i in range(6):
            point_rates[p, i] = rates[i]
        if p > 0:
            j = (p - 1) % n
            c = distance if p <= n else -distance
            for i in range(n):
                d[i] = c * S[i, j]
            correct_rates(point_rates[p], d, offsets)


@fused
def take_points(carried, rates, S, offsets, ecef, delta, z0, R, limit, weights, numbers):
    """Use a measurement predicted at the sigma points, if it passes the gate: the counterpart of
    :func:`navfuse.filters.event.take`.

    Parameters
    ----------
    S : (n, n) array
        Root of the covariance.
    delta, z0, R, weights
        See :func:`navfuse.core.unscented.innovation`.

    Returns
    -------
    float
        Normalised innovation squared; NaN if its covariance is not positive definite: then nothing is changed.

    Notes
    -----
    The attitude error is turned with the estimate, exactly to first order in what remains of it:
    :func:`navfuse.core.rotation.left_jacobian`. No checks are made.
    """
    n, d = S.shape[0], z0.size
    z, Szz, Sinv, H, K, dx = parts(numbers, d, n)
    L, m, work = np.empty((d, d)), np.empty(d), np.empty((d, 2 * n + 1 + d))
    nis = innovation(S, delta, z0, R, weights, z, Szz, Sinv, H, L, m, work)
    if not nis <= limit or nis == np.inf:
        return nis
    gain(S, delta, Sinv, z, weights, K, dx)
    A = np.empty((n, 2 * n + 1 + d))
    posterior_columns(S, delta, m, L, K, weights, A)
    J = left_jacobian((dx[6], dx[7], dx[8]))
    for c in range(2 * n + 1 + d):
        A[6, c], A[7, c], A[8, c] = mat_vec(J, (A[6, c], A[7, c], A[8, c]))
    triangularize(A, 2 * n + 1 + d, S)
    boxplus_navigation(carried[:10], dx, ecef)
    for i in range(n - 9):
        carried[10 + i] += dx[9 + i]
    correct_rates(rates, dx, offsets)
    covariance_of_root(S, carried[2 * n + 1 :].reshape((n, n)))
    return nis


class UnscentedFilter(NavigationFilter):
    """Unscented Kalman filter: sigma points in place of Jacobians, for the mechanization and for the measurements.

    The state is a point of the manifold: position, velocity, attitude as a rotation, and the sensor states of the layout.
    The covariance is carried as a square root that is never subtracted from. A sensor needs nothing but ``value``,
    ``predict`` and ``noise``; its ``jacobian`` is not used. Parameters and attributes are those of
    :class:`~navfuse.filters.navigation_filter.NavigationFilter`; the settings ``alpha``, ``beta`` and ``kappa`` place the
    points.

    Raises
    ------
    ConfigError
        In an open loop, for settings of the points that are out of range, or if they lie so far out at the start that
        an attitude would come round to the other side.

    Notes
    -----
    A heading that is not known is not held at rest, as the extended filter has to: points around the compass do not
    agree on what a change of level means, and so nothing is learned. Sources: Julier and Uhlmann 2004, van der Merwe and
    Wan 2001 (square root), Hertzberg et al. 2013 (manifold); the weights are in :mod:`navfuse.core.unscented`.
    """

    holds_heading = False
    estimator = "ukf"

    def _spread(self) -> SigmaSpread:
        s = self.settings
        return SigmaSpread(self.layout.size, s.alpha, s.beta, s.kappa)

    def _make_propagator(self, imu_map: Array, noise: Array, stochastic: Array) -> UnscentedPropagator:
        s = self.settings
        if s.open_loop:
            raise ConfigError(
                'an unscented filter corrects the inertial solution: use [filter] feedback = "closed", or estimator = "ekf"'
            )
        spread = self._spread()
        self._weights = spread.weights()
        return UnscentedPropagator(
            imu_map, noise, stochastic, s.ecef, s.covariance_period, s.output_period, spread
        )

    def _begin(self) -> None:
        """The root of the start covariance, and whether the points are on this side of the globe of attitudes."""
        n, spread = self.layout.size, self._spread()
        self._take_root()
        widest = float(np.sqrt(np.max(np.linalg.eigvalsh(self.P[6:9, 6:9]))))
        if spread.distance * widest >= np.pi:
            raise ConfigError(
                f"sigma points {spread.distance:.3g} standard deviations out (alpha = {spread.scale:.3g}, kappa = "
                f"{spread.kappa:g}, {n} states) reach {np.degrees(spread.distance * widest):.0f} deg of attitude, with "
                f"a start known to {np.degrees(widest):.0f} deg: past half a turn they come round; lower alpha, below "
                f"{np.pi / widest / np.sqrt(n + spread.kappa):.3g}, or give a better start"
            )

    def _take_root(self) -> None:
        if not _root_of(self.P, self.root):
            raise ConfigError("the covariance of the filter is not positive semi-definite")

    @property
    def root(self) -> Array:
        """Lower triangular root S (n, n) of the covariance P = S S^T, a view."""
        return self.propagator.root(self._acc)

    @property
    def P(self) -> Array:
        """Covariance (n, n) of the errors in the order of `layout`. Assign a whole matrix to it, in place nothing."""
        return self._views[3]

    @P.setter
    def P(self, value: Array) -> None:
        self._views[3][...] = value
        self._take_root()

    def _make_take(self) -> Callable[..., float]:
        return partial(take_points, self._carried, self._last)

    def _predictions(self, sensor: AidingSensor, k: int) -> tuple[Array, Array, Array]:
        """Predictions at the outer points less that at the centre (2 n, d), innovation of the centre, and noise."""
        n, time = self.layout.size, float(sensor.times[k])
        X, rates = np.empty((2 * n + 1, n + 1)), np.empty((2 * n + 1, 6))
        nav, s, _, _ = self._views
        offsets = sensor_offsets(self.layout)
        ecef, layout = self.settings.ecef, self.layout
        states_at_points(nav, s, self._last, self.root, self._weights[0], offsets, ecef, X, rates)
        predict, subtract = sensor.predict, sensor.subtract
        values = [
            predict(NavState(self.time, x[:10], ecef, x[10:], layout, rate[:3], rate[3:]), k)
            for x, rate in zip(X, rates, strict=True)
        ]
        centre = values[0]
        z0 = np.atleast_1d(np.asarray(subtract(sensor.value(k), centre), dtype=float))
        delta = np.empty((2 * n, z0.size))
        for row, value in zip(delta, values[1:], strict=True):
            row[:] = subtract(value, centre)
        if not np.isfinite(delta).all():
            bad = int(np.flatnonzero(~np.isfinite(delta).all(axis=1))[0])
            raise FilterError(
                f"{sensor.name} measurement {k} at {time:.3f} s: predict gives {np.asarray(values[1 + bad])} at a sigma "
                f"point, {self._weights[0]:.3g} standard deviations from the estimate along state {bad % n}; predict has "
                "to give finite values for every state within the uncertainty"
            )
        R = np.array(noise_covariance(sensor.noise(k), z0.size), dtype=float, order="C")
        if R.shape != (z0.size, z0.size):
            raise FilterError(
                f"{sensor.name} measurement {k} at {time:.3f} s: noise has the shape {R.shape} for {z0.size} values"
            )
        return delta, z0, R

    def _use(self, sensor: AidingSensor, k: int, limit: Callable[[int], float] | None) -> tuple[float, int, Array]:
        delta, z0, R = self._predictions(sensor, k)
        d = z0.size
        numbers = np.empty(room(d, self.layout.size))
        offsets, ecef = sensor_offsets(self.layout), self.settings.ecef
        most = -1.0 if limit is None else limit(d)
        nis = self._take(self.root, offsets, ecef, delta, z0, R, most, self._weights, numbers)
        return nis, d, numbers

    def _enlarge(self, change: Callable[[Array], None]) -> None:
        n = self.layout.size
        larger = self.P.copy()
        change(larger)
        values, vectors = np.linalg.eigh(larger - self.P)
        added = vectors * np.sqrt(np.maximum(values, 0.0))
        triangularize(np.ascontiguousarray(np.hstack([self.root, added])), 2 * n, self.root)
        covariance_of_root(self.root, self.P)


def cubature_filter(start, imu_model, sensors, settings: FilterSettings | None = None) -> UnscentedFilter:
    """An unscented filter with the points of the third-degree cubature rule: alpha = 1, beta = kappa = 0."""
    settings = replace(settings or FilterSettings(), alpha=1.0, beta=0.0, kappa=0.0)
    return UnscentedFilter(start, imu_model, sensors, settings)


def _root_of(P: Array, S: Array) -> bool:
    """Write a lower triangular root of P into S; False if P is not positive semi-definite.

    The correlations are decomposed, so that states of very different size do not drown each other.
    """
    sd = np.sqrt(np.diagonal(P))
    if not np.isfinite(sd).all():
        return False
    scale = np.where(sd > 0.0, sd, 1.0)
    values, vectors = np.linalg.eigh(P / np.outer(scale, scale))
    if not np.isfinite(values).all() or values[0] < -1e-9:
        return False
    columns = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    triangularize(np.ascontiguousarray(columns), P.shape[0], S)
    return True
