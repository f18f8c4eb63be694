"""Unscented and cubature Kalman filters of the whole navigation state, on its manifold, in square-root form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from navfuse.aiding.base import AidingSensor, noise_covariance
from navfuse.core.fused import fused
from navfuse.core.rotation import cross, dcm_from_rotvec, mat_vec
from navfuse.core.unscented import SigmaSpread, linear_update, regression, semidefinite_root, triangularize
from navfuse.data.nav_state import (
    NavStates,
    boxminus_navigation,
    boxplus_navigation,
    correct_rates,
    sensor_offsets,
)
from navfuse.errors import ConfigError, FilterError
from navfuse.filters.event import parts, room
from navfuse.filters.navigation_filter import NavigationFilter
from navfuse.filters.settings import FilterSettings
from navfuse.imu.increments import ImuIncrements
from navfuse.mechanization.arc_errors import (
    correction_turn,
    down_axis,
    draw_points,
    plain_columns,
    plain_rows,
    retract,
    turned,
)
from navfuse.mechanization.error_dynamics import ACC_TIME
from navfuse.mechanization.sigma_points import (
    BEGUN,
    GONE,
    ROOT,
    UnscentedPropagator,
    covariance_of_root,
    points_of,
    relax,
    relax_vertical,
    settle,
)

Array = np.ndarray


LINEAR_SHARE = 1e-3
"""Of the variance of an innovation that may be left unexplained by a regression before it is made again."""
SETTLED = 0.05
"""Change of the correction, in standard deviations of the posterior, at which the iterations end."""
WIDEST = np.radians(170.0)
"""How far from the estimate a point's attitude may be at the start or after the covariance was enlarged."""
TURN = 27
"""Numbers that an update leaves behind on top of those of an extended filter."""
SAGITTA = 0.05
"""Velocity [m/s] by which a heading wrong by its standard deviation may leave a straight line before the errors are
kept in the coordinates of the arc.
"""


@fused
def states_at_points(carried, rates, gone, S, mean, distance, offsets, ecef, X, point_rates):
    """What aiding sensors see at every sigma point: states X (2 n + 1, n + 1) and rates (2 n + 1, 6). No checks."""
    n = S.shape[0]
    draw_points(carried[:10], carried[10 : n + 1], gone, S, mean, distance, ecef, X)
    d = np.empty(n)
    for p in range(2 * n + 1):
        for i in range(6):
            point_rates[p, i] = rates[i]
        j = (p - 1) % n
        c = 0.0 if p == 0 else (distance if p <= n else -distance)
        for i in range(n):
            d[i] = mean[i] + c * S[i, j]
        correct_rates(point_rates[p], d, offsets)


@fused
def update_at_points(S, root, delta, z0, L, before, held, weights, numbers, A):
    """Update with the regression at points drawn about a correction `before` (n,) with a root of its own.

    Returns the normalised innovation squared and the largest share of a component's variance that the regression leaves
    unexplained, as in :func:`navfuse.core.unscented.linear_update`. No checks are made.
    """
    n, d = S.shape[0], z0.size
    nu, Szz, Sinv, H, K, dx = parts(numbers, d, n)
    m, extra = np.empty(d), np.empty((d, 2 * n + 1 + d))
    regression(root, delta, weights, H, m, extra)
    for e in range(d):
        nu[e] = z0[e] - m[e]
        for i in range(n):
            nu[e] += H[e, i] * before[i]
        for f in range(d):
            extra[e, 2 * n + 1 + f] = L[e, f]
    nis = linear_update(S, H, extra, 2 * n + 1 + d, nu, held, K, Szz, Sinv, dx, A)
    share = 0.0
    for e in range(d):
        v = 0.0
        for j in range(2 * n + 1):
            v += extra[e, j] * extra[e, j]
        share = max(share, v / Szz[e, e])
    return nis, share


@fused
def commit(carried, rates, acc, offsets, ecef, numbers, d, A):
    """Take an update for good: correct the estimate, and turn what belongs to its attitude.

    The attitude error that is left is turned by :func:`navfuse.mechanization.arc_errors.correction_turn`. For the
    smoother the numbers are changed to plain errors, and the last TURN of them receive what the correction did to these
    (9, 3): the attitude error turns, and takes what was integrated, which has been turned too. No checks are made.
    """
    n = A.shape[0]
    _, _, _, H, K, dx = parts(numbers, d, n)
    gone = acc[GONE:BEGUN]
    plain_columns(gone, H)
    plain_rows(gone, K)
    u = down_axis(carried[:10], ecef)
    J = correction_turn(dx, u)
    E = dcm_from_rotvec(turned(dx, u))
    for c in range(A.shape[1]):
        A[6, c], A[7, c], A[8, c] = mat_vec(J, (A[6, c], A[7, c], A[8, c]))
    triangularize(A, A.shape[1], acc[ROOT : ROOT + n * n].reshape((n, n)))
    d9 = dx[:9].copy()
    retract(carried[:10], gone, d9, ecef)
    G = numbers[room(d, n) :].reshape((9, 3))
    for c in range(3):
        psi = (J[c], J[3 + c], J[6 + c])
        G[6, c], G[7, c], G[8, c] = psi
        before = (1.0 if c == 0 else 0.0, 1.0 if c == 1 else 0.0, 1.0 if c == 2 else 0.0)
        for part in range(0, 6, 3):
            old = (gone[part], gone[part + 1], gone[part + 2])
            u, v = cross(psi, mat_vec(E, old)), cross(before, old)
            for i in range(3):
                G[part + i, c] = u[i] - v[i]
    for part in range(0, 6, 3):
        gone[part], gone[part + 1], gone[part + 2] = mat_vec(E, (gone[part], gone[part + 1], gone[part + 2]))
    for i in range(n - 9):
        carried[10 + i] += dx[9 + i]
    correct_rates(rates, dx, offsets)
    covariance_of_root(acc, carried[2 * n + 1 :].reshape((n, n)))


class UnscentedFilter(NavigationFilter):
    """Unscented Kalman filter: sigma points in place of Jacobians, for the mechanization and for the measurements.

    The state is a point of the manifold: position, velocity, attitude as a rotation, and the sensor states of the
    layout. The covariance is carried as a square root that is never subtracted from. A sensor needs nothing but
    ``value``, ``predict`` and ``noise``; its ``jacobian`` is not used. Parameters and attributes are those of
    :class:`~navfuse.filters.navigation_filter.NavigationFilter`; the settings ``alpha``, ``beta`` and ``kappa`` place
    the points.

    Raises
    ------
    ConfigError
        In an open loop, for settings of the points that are out of range, or if they lie so far out at the start that
        an attitude would come round to the other side.

    Notes
    -----
    Where a regression leaves more than a thousandth of an innovation's variance unexplained it is made again with
    points drawn from the posterior (posterior linearization, Garcia-Fernandez et al. 2015), which finds a heading from
    anywhere; with errors of usual size it never is. The gate judges the first regression. Sources: Julier and Uhlmann
    2004, van der Merwe and Wan 2001 (square root), Hertzberg et al. 2013 (manifold); the weights are in
    :mod:`navfuse.core.unscented`, the coordinates of the errors in :mod:`navfuse.mechanization.arc_errors`.
    """

    lets_go_early = True
    unknown_heading = (
        "the measurements are going to tell it; until the standard deviation of the heading has fallen, a smoothed "
        "solution, which is linear over the correction, is not to be trusted"
    )

    def _spread(self) -> SigmaSpread:
        s = self.settings
        return SigmaSpread(self.layout.size, s.alpha, s.beta, s.kappa)

    def _make_propagator(self, imu_map: Array, noise: Array, stochastic: Array) -> UnscentedPropagator:
        s = self.settings
        if s.open_loop:
            raise ConfigError(
                'an unscented filter corrects the inertial solution: use [filter] feedback = "closed", or estimator = '
                '"ekf"'
            )
        if s.iterations < 1:
            raise ConfigError(f"iterations = {s.iterations} of an unscented filter must be at least 1")
        spread = self._spread()
        self._weights = spread.weights()
        self._offsets = sensor_offsets(self.layout)
        return UnscentedPropagator(imu_map, noise, stochastic, s.ecef, s.covariance_period, s.output_period, spread)

    def _begin(self) -> None:
        """The root of the start covariance, and whether the points are on this side of the globe of attitudes."""
        n, spread = self.layout.size, self._spread()
        self._take_root()
        widest = float(np.sqrt(np.max(np.linalg.eigvalsh(self.P[6:9, 6:9]))))
        if spread.distance * widest > np.pi * (1.0 + 1e-6):
            most = np.pi / widest / np.sqrt(n + spread.kappa)
            raise ConfigError(
                f"sigma points {spread.distance:.3g} standard deviations out (alpha = {spread.scale:.3g}, kappa = "
                f"{spread.kappa:g}, {n} states) reach {np.degrees(spread.distance * widest):.0f} deg of attitude, with "
                f"a start known to {np.degrees(widest):.0f} deg: past half a turn they come round; give a better start "
                f'or use estimator = "ukf" with alpha below {most:.3g}'
            )
        self._narrow()

    def _narrow(self) -> None:
        """Take back an attitude known so badly that points would come round from the other side."""
        most, root = (WIDEST / self._weights[0]) ** 2, self.root
        values, vectors = np.linalg.eigh(root[6:9] @ root[6:9].T)
        if values[-1] <= most:
            return
        A = root.copy()
        A[6:9] = (vectors * np.sqrt(np.minimum(most / np.maximum(values, 1e-300), 1.0))) @ vectors.T @ root[6:9]
        triangularize(A, self.layout.size, root)
        covariance_of_root(self._acc, self.P)

    def _take_root(self) -> None:
        if not _root_of(self.P, self.root):
            raise ConfigError("the covariance of the filter is not positive semi-definite")

    @property
    def root(self) -> Array:
        """Lower triangular root S (n, n) of the covariance P = S S^T, a view."""
        return self.propagator.root(self._acc)

    @property
    def P(self) -> Array:
        """Covariance (n, n) of the errors in the order of `layout`. Assign a whole matrix to it, in place nothing.

        A covariance step that is under way ends with the assignment.
        """
        return self._views[3]

    @P.setter
    def P(self, value: Array) -> None:
        self._views[3][...] = value
        self._take_in_changes()
        self._acc[:BEGUN] = 0.0
        self._take_root()

    def feed(self, increments: ImuIncrements) -> None:
        """See :meth:`navfuse.filters.navigation_filter.NavigationFilter.feed`."""
        self._take_in_changes()
        super().feed(increments)

    def _take_in_changes(self) -> None:
        """Move the points of a covariance step under way along with an estimate that was assigned to."""
        if self._acc[ACC_TIME] == 0.0:
            return
        _, X = points_of(self._acc, self.layout.size)
        if np.array_equal(X[0, :10], self.nav) and np.array_equal(X[0, 10:], self.s):
            return
        before, d = X[0].copy(), np.empty(9)
        for x in X:
            boxminus_navigation(x[:10], before[:10], self.settings.ecef, d)
            x[:10] = self.nav
            boxplus_navigation(x[:10], d, self.settings.ecef)
        X[:, 10:] += self.s - before[10:]
        X[0, :10], X[0, 10:] = self.nav, self.s

    def _predictions(self, sensor: AidingSensor, k: int, mean: Array, root: Array) -> tuple[Array, Array]:
        """Predictions at the outer points less that at the centre (2 n, d), and the innovation of the centre (d,)."""
        n, layout, ecef = self.layout.size, self.layout, self.settings.ecef
        X, rates = np.empty((2 * n + 1, n + 1)), np.empty((2 * n + 1, 6))
        gone = self._acc[GONE:BEGUN]
        states_at_points(self._carried, self._last, gone, root, mean, self._weights[0], self._offsets, ecef, X, rates)
        points = NavStates(self.time, X[:, :10], ecef, X[:, 10:], layout, rates)
        with np.errstate(invalid="ignore"):
            delta, z0 = sensor.predict_points(points, k)
        if not np.isfinite(delta).all():
            raise self._refusal(sensor, k, points)
        return delta, z0

    def _refusal(self, sensor: AidingSensor, k: int, points: NavStates) -> FilterError:
        n = self.layout.size
        measurement = f"{sensor.name} measurement {k} at {float(sensor.times[k]):.3f} s"
        values = [sensor.predict(points[p], k) for p in range(2 * n + 1)]
        bad = next((p for p, value in enumerate(values) if not np.isfinite(value).all()), None)
        if not np.isfinite(self.nav).all():
            return FilterError(
                f"the navigation state is no longer finite at {self.time:.3f} s; look at the inertial data before it"
            )
        if bad is None:
            return FilterError(f"{measurement}: subtract gives no finite difference of two finite predictions")
        where = (
            "at the estimate"
            if bad == 0
            else f"at a sigma point, {self._weights[0]:.3g} standard deviations from the estimate along column "
            f"{(bad - 1) % n} of the covariance's root"
        )
        return FilterError(
            f"{measurement}: predict gives {np.asarray(values[bad])} {where}; it has to give finite values for every "
            "state within the uncertainty"
        )

    def _use(self, sensor: AidingSensor, k: int, limit: Callable[[int], float] | None) -> tuple[float, int, Array]:
        n, S = self.layout.size, self.root
        before, root, first = np.zeros(n), S, np.nan
        for k_iteration in range(self.settings.iterations):
            delta, z0 = self._predictions(sensor, k, before, root)
            d = z0.size
            if k_iteration == 0:
                L = self._noise_root(sensor, k, d)
                numbers, A = np.empty(room(d, n) + TURN), np.empty((n, 3 * n + 1 + d))
                most = -1.0 if limit is None else limit(d)
            nis, share = update_at_points(
                S, root, delta, z0, L, before, self._hold.direction, self._weights, numbers, A
            )
            if k_iteration == 0:
                first = nis
                if not nis <= most:
                    return nis, d, numbers
            elif not np.isfinite(nis):
                return np.nan, d, numbers
            dx = parts(numbers, d, n)[5]
            if share < LINEAR_SHARE or k_iteration + 1 == self.settings.iterations:
                break
            root = np.empty((n, n))
            triangularize(A.copy(), A.shape[1], root)
            sd = np.sqrt(np.sum(root * root, axis=1))
            settled = bool(np.all(np.abs(dx - before) <= SETTLED * sd))
            before = dx.copy()
            if settled and k_iteration:
                break
        commit(self._carried, self._last, self._acc, self._offsets, self.settings.ecef, numbers, d, A)
        return first, d, numbers

    def _noise_root(self, sensor: AidingSensor, k: int, d: int) -> Array:
        noise, L = np.asarray(sensor.noise(k), dtype=float), np.empty((d, d))
        fits = noise.shape in ((), (1,), (d,), (d, d))
        if not fits or not semidefinite_root(np.ascontiguousarray(noise_covariance(noise, d)), L):
            raise FilterError(
                f"{sensor.name} measurement {k} at {float(sensor.times[k]):.3f} s: its noise must be {d} standard "
                f"deviations or a positive semi-definite covariance ({d}, {d}), got {noise.tolist()}"
            )
        return L

    def _settle(self) -> None:
        n = self.layout.size
        X, A = np.empty((2 * n + 1, n + 1)), np.empty((n, 2 * n + 1))
        settle(self._carried, self._acc, self._weights, self.settings.ecef, X, A)

    def _finish_event(self) -> None:
        if self._hold.direction.any():
            self._settle()
            self._drop_correlations()
        elif self._is_straight():
            relax(self._acc, np.empty(self.P.shape))
        else:
            relax_vertical(self._carried[:10], self._acc, self.settings.ecef, np.empty(self.P.shape))
        if float(np.max(np.diagonal(self.P)[6:9])) > 1.0:
            self._narrow()

    def _is_straight(self) -> bool:
        """Whether the arc on which a wrong heading takes the velocity since the last settling is as good as straight.

        To stay unsettled has its price: products of heading and level errors are seen by none of the points.
        """
        down, Du = np.array(down_axis(self.nav, self.settings.ecef)), self._acc[GONE + 3 : BEGUN]
        level = Du - (down @ Du) * down
        return bool(0.5 * (down @ self.P[6:9, 6:9] @ down) * np.sqrt(level @ level) < SAGITTA)

    def _uncorrelate(self) -> None:
        """Nothing before a measurement: points around the compass know what a heading does to it."""

    def _drop_correlations(self) -> None:
        n, down = self.layout.size, self._hold.direction
        A = np.zeros((n, n + 1))
        A[:, :n] = self.root
        along = down @ A[6:9, :n]
        A[6:9, :n] -= np.outer(down, along)
        A[6:9, n] = down * np.sqrt(along @ along)
        triangularize(A, n + 1, self.root)
        covariance_of_root(self._acc, self.P)

    def _enlarge(self, change: Callable[[Array], None]) -> None:
        self._settle()
        n = self.layout.size
        larger = self.P.copy()
        change(larger)
        values, vectors = np.linalg.eigh(larger - self.P)
        added = vectors * np.sqrt(np.maximum(values, 0.0))
        triangularize(np.ascontiguousarray(np.hstack([self.root, added])), 2 * n, self.root)
        covariance_of_root(self._acc, self.P)
        self._narrow()


def cubature_filter(start, imu_model, sensors, settings: FilterSettings | None = None) -> UnscentedFilter:
    """An unscented filter with the points of the third-degree cubature rule: alpha = 1, beta = kappa = 0."""
    settings = replace(settings or FilterSettings(), alpha=1.0, beta=0.0, kappa=0.0)
    return UnscentedFilter(start, imu_model, sensors, settings)


def _root_of(P: Array, S: Array) -> bool:
    """Write a lower triangular root of P into S; False if P is not positive semi-definite.

    The correlations are decomposed, so that states of very different size do not drown each other.
    """
    if not np.isfinite(P).all() or np.min(np.diagonal(P)) < 0.0:
        return False
    sd = np.sqrt(np.diagonal(P))
    scale = np.where(sd > 0.0, sd, 1.0)
    values, vectors = np.linalg.eigh(P / np.outer(scale, scale))
    if values[0] < -1e-9:
        return False
    columns = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    triangularize(np.ascontiguousarray(columns), P.shape[0], S)
    return True
