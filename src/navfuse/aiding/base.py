"""What an aiding sensor is to a filter.

A sensor says when it measures, what it measured, what it would measure given a navigation state, and how noisy it is.
Everything else has a default. Filters and smoothers see nothing but this class, so a sensor of your own has exactly
the standing of the ones that come with navfuse.

Recipe: subclass :class:`AidingSensor`, set ``name`` and ``times``, write :meth:`~AidingSensor.value`,
:meth:`~AidingSensor.predict` and :meth:`~AidingSensor.noise`, then run :func:`navfuse.aiding.check` on it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from navfuse.data.layout import NAVIGATION_STATES, Block, Layout
from navfuse.data.nav_state import NavState, NavStates

Array = np.ndarray


class AidingSensor:
    """Base class of aiding sensors.

    Attributes
    ----------
    name : str
        Unique within a filter; prefixes the sensor's own states and marks its innovation records.
    times : (m,) array [s]
        When it measured, not decreasing.
    gate : float or None
        Probability that a good measurement passes the chi-square gate; None takes the filter's.
    states : sequence of Block
        States that the sensor adds to the filter (bias, scale factor, lever arm, ...). In the filter they are called
        ``f"{name}.{block.name}"``.
    """

    name: str = "sensor"
    times: Array
    gate: float | None = None
    states: Sequence[Block] = ()

    def value(self, k: int) -> Array:
        """Measurement number k, (d,)."""
        raise NotImplementedError(f"{type(self).__name__} must define value(k)")

    def predict(self, nav: NavState, k: int) -> Array:
        """What measurement k would be without noise if `nav` were true, (d,)."""
        raise NotImplementedError(f"{type(self).__name__} must define predict(nav, k)")

    def noise(self, k: int) -> Array | float:
        """Noise of measurement k: standard deviations (d,) or one for all, or a covariance matrix (d, d)."""
        raise NotImplementedError(f"{type(self).__name__} must define noise(k)")

    def subtract(self, measured: Array, predicted: Array) -> Array:
        """Difference of two values, (d,); override it for angles and other values that are not vectors."""
        return measured - predicted

    def withheld(self, k: int) -> bool:
        """Whether measurement k is kept from the filter (it is still predicted and recorded)."""
        return False

    def log_row(self, k: int) -> int:
        """Row of measurement k in the log it came from, for records."""
        return k

    def jacobian(self, nav: NavState, k: int) -> Array:
        """Derivative of the measurement with respect to the errors, (d, n); by default central differences through
        ``boxplus``.
        """
        return numerical_jacobian(self, nav, k)

    def linearize(self, nav: NavState, k: int) -> tuple[Array, Array, Array]:
        """Innovation z (d,), measurement matrix H (d, n) and noise covariance R (d, d) at a navigation state.

        Built from the other methods; override it only for speed. The filter compiles its update anew for arrays that
        are not float, in C order and writable.
        """
        z = np.atleast_1d(np.asarray(self.subtract(self.value(k), self.predict(nav, k)), dtype=float))
        H = np.array(self.jacobian(nav, k), dtype=float, order="C", ndmin=2)
        return z, H, np.array(noise_covariance(self.noise(k), z.size), dtype=float, order="C")

    def predict_points(self, navs: NavStates, k: int) -> tuple[Array, Array]:
        """Predictions at navigation states less that at the first of them (m - 1, d), and innovation of the first (d,).

        What an unscented filter asks for. Built from the other methods; override it only for speed.
        """
        values = [self.predict(navs[p], k) for p in range(len(navs))]
        first = values[0]
        z = np.atleast_1d(np.asarray(self.subtract(self.value(k), first), dtype=float))
        delta = np.empty((len(values) - 1, z.size))
        for row, value in zip(delta, values[1:], strict=True):
            row[:] = self.subtract(value, first)
        return delta, z

    def state_blocks(self) -> tuple[Block, ...]:
        """The sensor's own states under their full names."""
        return tuple(Block(f"{self.name}.{b.name}", b.size, b.sd, b.tau, b.walk, b.value) for b in self.states)


def noise_covariance(noise: Array | float, size: int) -> Array:
    """The covariance matrix (size, size) that a sensor's :meth:`~AidingSensor.noise` stands for."""
    noise = np.asarray(noise, dtype=float)
    if noise.ndim == 2:
        return noise
    return np.diag(np.broadcast_to(noise, size) ** 2)


def difference_steps(layout: Layout) -> Array:
    """Step of each state for central differences: 1 m, 0.01 m/s, 1e-4 rad, and a tenth of the prior deviation of
    other states.
    """
    steps = np.empty(layout.size)
    steps[0:3] = 1.0
    steps[3:6] = 1e-2
    steps[6:9] = 1e-4
    sd = layout.per_state("sd")
    steps[NAVIGATION_STATES:] = np.where(sd > 0, 0.1 * sd, 1e-3)
    return steps


def numerical_jacobian(sensor: AidingSensor, nav: NavState, k: int) -> Array:
    """Central differences of a sensor's prediction with respect to the errors, (d, n)."""
    steps = difference_steps(nav.layout)
    columns = []
    for i, step in enumerate(steps):
        delta = np.zeros(steps.size)
        delta[i] = step
        ahead = sensor.predict(nav.boxplus(delta), k)
        behind = sensor.predict(nav.boxplus(-delta), k)
        columns.append(np.atleast_1d(sensor.subtract(ahead, behind)) / (2.0 * step))
    return np.stack(columns, axis=1)
