"""The iterated extended Kalman filter of the errors of an inertial navigation solution."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from navfuse.aiding.base import AidingSensor
from navfuse.core.earth import dcm_en
from navfuse.core.kalman import update
from navfuse.core.rotation import left_jacobian
from navfuse.data.nav_state import NavState
from navfuse.errors import ConfigError
from navfuse.filters.ekf import ErrorStateFilter

Array = np.ndarray

SETTLED, RESOLUTION = 2e-7, 1e-9
"""Change of the correction at which the iterations end, in standard deviations of the posterior; in addition of the
navigation errors [m, m/s, rad], which is what rounding makes of metres on an Earth.
"""
HALVINGS = 6
ROUNDING = 1e-9


class IteratedFilter(ErrorStateFilter):
    """Extended Kalman filter that linearizes a measurement again where it has corrected the state to.

    The correction is the most probable error given the covariance before and the measurement, found by Gauss and Newton
    on the manifold, where the extended filter stops after the first step. Parameters and attributes are those of
    :class:`~navfuse.filters.navigation_filter.NavigationFilter`; ``settings.iterations`` is the most linearizations of
    one measurement.

    Raises
    ------
    ConfigError
        In an open loop: there the error is that of an inertial solution which stays where it is, and far from it the
        error equations of the mechanization are what limits the filter, not the measurement.

    Notes
    -----
    With e the correction so far, z_e and H_e innovation and matrix at the state corrected by it, and J the derivative
    of the error of that state by the error of the state before (a turn into the north-east-down of the corrected
    position; of the attitude also the left Jacobian), the next correction is that of a regular update with

        z = z_e + H_e J e        H = H_e J

    (Bell and Cathey 1993, on a manifold). A step that does not lower the cost ``e^T P^-1 e + z_e^T R^-1 z_e`` is
    halved. The gate judges the first linearization. A measurement that a second linearization would change by less than
    SETTLED is used as the extended filter uses it, so that the two are the same to the last bit where nothing is
    nonlinear. While a heading is held nothing is iterated. Innovations are recorded about the state before the
    measurement, as z and H above, which is what a smoother goes back across.
    """

    def _begin(self) -> None:
        if self.settings.open_loop:
            raise ConfigError(
                'an iterated filter corrects the inertial solution: use [filter] feedback = "closed", or estimator = '
                '"ekf"'
            )
        self._unsettled = False

    def _use(self, sensor: AidingSensor, k: int, limit: Callable[[int], float] | None) -> tuple[float, int, Array]:
        before = self._seen()
        z, H, R = self._linearize(sensor, k, before)
        most = -1.0 if limit is None else limit(z.size)
        first = self._correction(z, H, R)
        if not first.nis <= most or not np.isfinite(first.nis) or self._hold.direction.any():
            return self._update(z, H, R, most)
        z, H = self._iterate(sensor, k, before, (z, H, R), first)
        _, d, numbers = self._update(z, H, R, np.inf)
        return first.nis, d, numbers

    def _correction(self, z: Array, H: Array, R: Array) -> _Correction:
        """What a regular update would do."""
        d, n = H.shape
        P, K, S, Sinv, dx = self.P.copy(), np.empty((n, d)), np.empty((d, d)), np.empty((d, d)), np.zeros(n)
        nis = update(P, H, R, z, np.inf, self._hold.direction, K, S, Sinv, dx)
        return _Correction(nis, dx, H.T @ (Sinv @ z), np.sqrt(np.maximum(np.diagonal(P), 0.0)))

    def _iterate(
        self, sensor: AidingSensor, k: int, before: NavState, at: tuple[Array, Array, Array], step: _Correction
    ) -> tuple[Array, Array]:
        """Innovation and matrix about the state before, from the last of the linearizations.

        A correction e is P y, so that its cost e^T P^-1 e is y^T P y, whatever P is.
        """
        z, H, R = at
        P, weight = self.P, np.linalg.pinv(R, hermitian=True)
        e, y, cost = np.zeros_like(step.dx), np.zeros_like(step.y), float(z @ weight @ z)
        for _ in range(self.settings.iterations - 1):
            share = 1.0
            for _ in range(HALVINGS):
                trial, trial_y = e + share * (step.dx - e), y + share * (step.y - y)
                there = before.boxplus(trial)
                z_there, H_there, _ = self._linearize(sensor, k, there)
                trial_cost = float(trial_y @ P @ trial_y + z_there @ weight @ z_there)
                if trial_cost <= cost + ROUNDING * (1.0 + cost):
                    break
                share *= 0.5
            e, y, cost = trial, trial_y, trial_cost
            turn = error_derivative(before, there, e)
            H_e = H_there.copy()
            H_e[:, :9] = H_there[:, :9] @ turn
            z_e = z_there + H_e @ e
            following = self._correction(z_e, H_e, R)
            change = np.abs(following.dx - step.dx)
            small = SETTLED * following.sd
            small[:9] += RESOLUTION
            if share == 1.0 and np.all(change <= small):
                return z, H
            z, H, step = z_e, H_e, following
        if not self._unsettled and self.settings.iterations > 1:
            self._unsettled = True
            self.record.notes.append(
                f"{sensor.name}: the correction of measurement {k} at {self.time:.1f} s has not settled after "
                f"{self.settings.iterations} linearizations; it is used as the last one has it"
            )
        return z, H


class _Correction(NamedTuple):
    """Normalised innovation squared, correction e = P y, y, and standard deviations behind it."""

    nis: float
    dx: Array
    y: Array
    sd: Array


def error_derivative(before: NavState, there: NavState, e: Array) -> Array:
    """Derivative (9, 9) of the navigation error of one state by that of another.

    Parameters
    ----------
    before, there : NavState
        The second is the first corrected by `e`.
    e : (n,) array

    Notes
    -----
    The error of `there` is true minus estimate in the north-east-down of `there`. To first order in what `e` leaves of
    the error d of `before`: T (d - e) for position and velocity, T J(e) (d - e) for the attitude, with T the turn from
    the one north-east-down to the other and J from :func:`navfuse.core.rotation.left_jacobian`.
    """
    T = np.eye(3)
    if not before.ecef:
        T = _axes(there).T @ _axes(before)
    J = np.array(left_jacobian((e[6], e[7], e[8]))).reshape(3, 3)
    turn = np.zeros((9, 9))
    turn[:3, :3] = turn[3:6, 3:6] = T
    turn[6:, 6:] = T @ J
    return turn


def _axes(nav: NavState) -> Array:
    return np.array(dcm_en(nav.array[0], nav.array[1])).reshape(3, 3)
