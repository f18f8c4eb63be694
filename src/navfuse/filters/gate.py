"""The gate of one aiding sensor: which innovations pass, and what happens when none do."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from navfuse.filters.settings import FilterSettings

SCATTER_GAIN = 0.02
SCATTER_LIMIT = 10.0


class Gate:
    """A chi-square gate that follows the scatter it sees.

    The largest normalised innovation squared that passes is the chi-square quantile of the gate probability, times
    the running mean of what this sensor's innovations really are per degree of freedom, if that is above one. So
    sigmas that are too small do not shut the sensor out, while what is far out of its own scatter is still rejected.

    Parameters
    ----------
    probability : float or None
        Share of good measurements that passes; None takes that of the settings.
    settings : FilterSettings

    Attributes
    ----------
    scatter : float
        Running mean of the normalised innovation squared per degree of freedom.
    rejections : int
        Measurements rejected in a row.
    since : float [s]
        Time of the first of them.
    """

    def __init__(self, probability: float | None, settings: FilterSettings):
        self.probability = settings.gate_probability if probability is None else probability
        self.reset_count = settings.reset_count
        self.reset_s = settings.reset_s
        self.scatter = 1.0
        self.rejections = 0
        self.since = 0.0
        self._quantiles: dict[int, float] = {}

    def limit(self, size: int) -> float:
        """Largest normalised innovation squared that passes for a measurement of `size` values."""
        if size not in self._quantiles:
            p = self.probability
            self._quantiles[size] = float(chdtri(size, 1.0 - p)) if p < 1.0 else np.inf
        return self._quantiles[size] * max(1.0, self.scatter)

    def watch(self, ratio: float) -> None:
        """Take note of a normalised innovation squared per degree of freedom."""
        self.scatter += SCATTER_GAIN * (min(ratio, SCATTER_LIMIT * max(1.0, self.scatter)) - self.scatter)

    def accept(self) -> None:
        """Take note of a measurement that was used."""
        self.rejections = 0

    def reject(self, time: float) -> bool:
        """Take note of a rejection; True if there were so many, for so long, that the filter must be wrong."""
        if self.rejections == 0:
            self.since = time
        self.rejections += 1
        return self.rejections >= self.reset_count and time - self.since >= self.reset_s

    def state(self) -> tuple[float, float, float]:
        """What :meth:`restore` needs."""
        return self.scatter, float(self.rejections), self.since

    def restore(self, state: tuple[float, float, float]) -> None:
        """Go on from a saved :meth:`state`."""
        self.scatter, self.rejections, self.since = float(state[0]), int(state[1]), float(state[2])
