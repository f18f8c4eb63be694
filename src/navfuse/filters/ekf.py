"""The error-state extended Kalman filter."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from navfuse.aiding.base import AidingSensor
from navfuse.data.nav_state import NavState, sensor_offsets
from navfuse.errors import FilterError
from navfuse.filters.event import room, take
from navfuse.filters.navigation_filter import NavigationFilter
from navfuse.filters.settings import FilterSettings
from navfuse.mechanization.propagate import Propagator

Array = np.ndarray

__all__ = ["ErrorStateFilter", "FilterSettings"]


class ErrorStateFilter(NavigationFilter):
    """The extended Kalman filter of the errors of an inertial navigation solution.

    Notes
    -----
    Errors are true minus estimate. In a closed loop every correction goes through
    :func:`navfuse.data.nav_state.boxplus_navigation`; in an open loop it is kept in ``x`` and carried by the same
    transition (Groves 2013, section 14.1.1). Parameters and attributes are those of
    :class:`~navfuse.filters.navigation_filter.NavigationFilter`.
    """

    def _make_propagator(self, imu_map: Array, noise: Array, stochastic: Array) -> Propagator:
        s = self.settings
        return Propagator(imu_map, noise, stochastic, s.ecef, s.covariance_period, s.output_period)

    def _bind(self) -> None:
        super()._bind()
        fixed = sensor_offsets(self.layout), self.settings.ecef, self.settings.open_loop
        self._take = partial(take, self._carried, self._last, *fixed)

    def _linearize(self, sensor: AidingSensor, k: int, nav: NavState) -> tuple[Array, Array, Array]:
        """Innovation, matrix and noise covariance of a measurement at a navigation state."""
        z, H, R = sensor.linearize(nav, k)
        d, n = z.size, self.layout.size
        if z.shape != (d,) or H.shape != (d, n) or R.shape != (d, d):
            raise FilterError(
                f"{sensor.name} measurement {k} at {float(sensor.times[k]):.3f} s: linearize gives z, H and R of the "
                f"shapes {z.shape}, {H.shape}, {R.shape}; with {n} states they must be (d,), (d, {n}) and (d, d)"
            )
        return z, H, R

    def _use(self, sensor: AidingSensor, k: int, limit: Callable[[int], float] | None) -> tuple[float, int, Array]:
        z, H, R = self._linearize(sensor, k, self._seen())
        return self._update(z, H, R, -1.0 if limit is None else limit(z.size))

    def _update(self, z: Array, H: Array, R: Array, most: float) -> tuple[float, int, Array]:
        """What :meth:`_use` is to return, after an update if the normalised innovation squared is at most `most`."""
        d = z.size
        numbers = np.empty(room(d, self.layout.size))
        return self._take(z, H, R, most, self._hold.direction, numbers), d, numbers

    def _enlarge(self, change: Callable[[Array], None]) -> None:
        change(self.P)

    def _uncorrelate(self) -> None:
        self._hold.uncorrelate(self.P)
