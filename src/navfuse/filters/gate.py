"""The gate of one aiding sensor: which innovations pass, and what happens when none do."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from navfuse.filters.settings import FilterSettings

SCATTER_GAIN = 0.02
SCATTER_LIMIT = 10.0
SCATTER_MEMORY_S = 10.0
DOUBTFUL_S, MOST_DOUBTFUL = 2.0, 3


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
        if not settings.gated:
            self.probability = 1.0
        self.last = self.doubtful = -np.inf
        self.reset_count = settings.reset_count
        self.reset_s = settings.reset_s
        self.scatter = 1.0
        self.rejections = 0
        self.since = 0.0
        self._quantiles: dict[int, float] = {}

    def limit(self, size: int) -> float:
        """Largest normalised innovation squared that passes for a measurement of `size` values."""
        quantile = self._quantiles.get(size)
        if quantile is None:
            p = self.probability
            quantile = self._quantiles[size] = float(chdtri(size, 1.0 - p)) if p < 1.0 else np.inf
        return quantile * self.scatter if self.scatter > 1.0 else quantile

    def watch(self, ratio: float, time: float) -> None:
        """Take note of a normalised innovation squared per degree of freedom.

        The memory is fifty measurements, and not less than ten seconds.
        """
        gain = (time - self.last) / SCATTER_MEMORY_S
        gain = SCATTER_GAIN if gain > SCATTER_GAIN else max(gain, 0.0)
        most = SCATTER_LIMIT * (self.scatter if self.scatter > 1.0 else 1.0)
        self.last = time
        self.scatter += gain * ((ratio if ratio < most else most) - self.scatter)

    def accept(self) -> None:
        """Take note of a measurement that was used."""
        self.rejections = 0

    def reject(self, time: float) -> bool:
        """Take note of a rejection; True if there were so many, for so long, that the filter must be wrong."""
        if self.rejections == 0:
            self.since = time
        self.rejections += 1
        patience = min(DOUBTFUL_S, self.reset_s) if time < self.doubtful else self.reset_s
        return self.rejections >= min(
            self.reset_count, MOST_DOUBTFUL if time < self.doubtful else self.reset_count
        ) and (time - self.since >= patience)

    def doubt_filter_until(self, time: float) -> None:
        """Until then the filter, not the sensor, is the likelier to be wrong: it has just crossed a gap."""
        self.doubtful = time

    def state(self) -> tuple[float, ...]:
        """What :meth:`restore` needs."""
        return self.scatter, float(self.rejections), self.since, self.last, self.doubtful

    def restore(self, state: tuple[float, ...]) -> None:
        """Go on from a saved :meth:`state`."""
        self.scatter, self.rejections, self.since = state[0], int(state[1]), state[2]
        self.last, self.doubtful = state[3], state[4]
