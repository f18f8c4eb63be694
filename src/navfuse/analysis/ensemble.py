"""Many runs together: average NEES and NIS within chi-square bounds, RMSE against sigma, and a verdict in words.

The sum of the NEES of N independent runs is chi-square with N times the degrees of freedom of one, at every epoch. So
its average is known to be inside bounds computed from N, and a filter that claims too much is found out epoch by epoch
and state by state. Epochs of one run are *not* independent: an error that lasts stays inside or outside for long.
Source: Bar-Shalom, Li and Kirubarajan (2001), section 5.4.2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from navfuse.analysis.consistency import PROBABILITY, average_bounds
from navfuse.analysis.nees import WHOLE, Component
from navfuse.errors import InputError

Array = np.ndarray

SHARE_INSIDE = 0.97
"""A consistent filter is expected inside its 99 % bounds for at least this share of the time."""
CONFIDENCE = 0.95
"""Of the intervals of the RMSE."""
BRIDGED_EPOCHS = 3
"""Epochs back inside the bounds that do not end a stretch outside."""


@dataclass(frozen=True, slots=True)
class Average:
    """Average of a normalized squared error over runs, per degree of freedom.

    Attributes
    ----------
    name : str
        Of a group of states, a component or a measurement.
    time : (m,) array [s]
    mean : (m,) array [1]
        1 for a consistent filter.
    low, high : (m,) arrays [1]
        Bounds from the number of runs that gave a value at the epoch.
    probability : float
        That the mean of a consistent filter is inside, at any one epoch.
    """

    name: str
    time: Array
    mean: Array
    low: Array
    high: Array
    probability: float

    @property
    def inside(self) -> Array:
        """(m,) bool array: whether the mean lies within its bounds."""
        return (self.low <= self.mean) & (self.mean <= self.high)

    @property
    def share_inside(self) -> float:
        """Share of the epochs at which the mean lies within its bounds."""
        return float(np.mean(self.inside))

    @property
    def factor(self) -> float:
        """How many times larger the errors are than claimed, over the whole time."""
        return float(np.sqrt(np.mean(self.mean)))

    def after(self, time: float) -> Average:
        """The epochs from a time [s] on.

        Raises
        ------
        InputError
            If there are none.
        """
        keep = self.time >= time - 1e-6
        if not keep.any():
            raise InputError(f"no epoch is left after {time:g} s; the last one is at {self.time[-1]:g} s")
        return Average(self.name, self.time[keep], self.mean[keep], self.low[keep], self.high[keep], self.probability)


@dataclass(frozen=True, slots=True)
class Rmse:
    """Root mean square error of a component over runs and time, against the sigma that was claimed.

    Attributes
    ----------
    component : Component
    time : (m,) array [s]
    rmse, sigma : (m,) arrays [SI]
        Over the runs: root mean square error, root mean variance.
    low, high : floats [SI]
        Interval of `total` with 95 % confidence. It takes an error as constant over a run, and is too wide for one that
        changes fast.
    """

    component: Component
    time: Array
    rmse: Array
    sigma: Array
    low: float
    high: float

    @property
    def total(self) -> float:
        """Root mean square error over runs and time."""
        return float(np.sqrt(np.mean(self.rmse**2)))

    @property
    def total_sigma(self) -> float:
        """Root mean variance over runs and time."""
        return float(np.sqrt(np.mean(self.sigma**2)))

    @property
    def ratio(self) -> float:
        """RMSE over sigma: root of the mean over time of the squared ratio; 1 for a consistent filter."""
        return float(np.sqrt(np.mean((self.rmse / self.sigma) ** 2)))


@dataclass(frozen=True, slots=True)
class Finding:
    """A stretch of time in which the errors of something are not as large as claimed.

    Attributes
    ----------
    name : str
    factor : float
        Errors over claimed sigmas, above 1 for overconfident.
    start, end : float [s]
        First and last epoch outside the bounds.
    share : float
        Of all epochs, those outside on this side.
    """

    name: str
    factor: float
    start: float
    end: float
    share: float

    @property
    def overconfident(self) -> bool:
        """True if the errors are larger than claimed, False if smaller."""
        return self.factor > 1.0

    def __str__(self) -> str:
        kind, factor = ("overconfident", self.factor) if self.overconfident else ("pessimistic", 1.0 / self.factor)
        return f"{kind} by a factor {factor:.2f} in {self.name} between {self.start:g} s and {self.end:g} s"


def average(name: str, time: Array, squares: Array, dof: float, probability: float = PROBABILITY) -> Average:
    """Average a normalized squared error over runs.

    Parameters
    ----------
    name : str
    time : (m,) array [s]
    squares : (runs, m) array
        NEES or NIS; NaN where a run has none.
    dof : float
        Degrees of freedom of one value.
    probability : float
        Of the bounds, two-sided.

    Raises
    ------
    InputError
        If the shapes do not fit or there is no value at some epoch.
    """
    squares = np.asarray(squares, dtype=float)
    if squares.ndim != 2 or squares.shape[1] != np.size(time) or dof <= 0:
        raise InputError(
            f"{name}: an average needs (runs, epochs) values of dof > 0, not {squares.shape} at {np.size(time)} epochs"
        )
    count = np.sum(np.isfinite(squares), axis=0)
    if not count.size or not count.all():
        raise InputError(f"{name}: there is an epoch at which no run has a value")
    bounds = {n: average_bounds(float(n * dof), probability) for n in np.unique(count).tolist()}
    low, high = (np.array([bounds[n][side] for n in count.tolist()]) for side in (0, 1))
    return Average(
        name, np.asarray(time, dtype=float), np.nansum(squares, axis=0) / (count * dof), low, high, probability
    )


def rms_error(component: Component, time: Array, error: Array, sd: Array) -> Rmse:
    """Errors of a component over the runs, against its sigmas.

    Parameters
    ----------
    component : Component
    time : (m,) array [s]
    error, sd : (runs, m) arrays [SI]

    Raises
    ------
    InputError
        If the shapes do not fit, or a sigma is not positive.
    """
    if error.shape != sd.shape or error.shape[1:] != time.shape or not np.all(sd > 0.0):
        raise InputError(
            f"{component.name}: RMSE against sigma needs errors and positive sigmas (runs, epochs), not {error.shape} "
            f"and {sd.shape} at {time.size} epochs"
        )
    rmse, sigma = np.sqrt(np.mean(error**2, axis=0)), np.sqrt(np.mean(sd**2, axis=0))
    low, high = average_bounds(float(error.shape[0]), CONFIDENCE)
    total = float(np.sqrt(np.mean(rmse**2)))
    return Rmse(component, time, rmse, sigma, total / np.sqrt(high), total / np.sqrt(low))


def group_ratios(rms: Sequence[Rmse]) -> dict[str, float]:
    """RMSE over sigma of every group: root mean square of its components' ratios."""
    groups: dict[str, list[float]] = {}
    for entry in rms:
        groups.setdefault(entry.component.group, []).append(entry.ratio)
    return {name: float(np.sqrt(np.mean(np.square(ratios)))) for name, ratios in groups.items()}


def findings(averages: Sequence[Average], share: float = 1.0 - SHARE_INSIDE) -> list[Finding]:
    """What is outside its bounds for more than a share of the time, the largest misjudgement first.

    Parameters
    ----------
    averages : sequence of Average
    share : float
        Of the epochs on one side, that may be outside.

    Returns
    -------
    list of Finding
        At most one for each side of each average: its longest stretch.
    """
    found = []
    for entry in averages:
        for outside in (entry.mean > entry.high, entry.mean < entry.low):
            if np.mean(outside) <= share:
                continue
            first, last = _longest_stretch(outside)
            factor = float(np.sqrt(np.mean(entry.mean[first : last + 1])))
            found.append(
                Finding(entry.name, factor, float(entry.time[first]), float(entry.time[last]), float(np.mean(outside)))
            )
    return sorted(found, key=lambda finding: -abs(np.log(max(finding.factor, 1e-12))))


def family_probability(count: int, probability: float) -> float:
    """Probability for each of `count` bounds so that all hold together with `probability` (Bonferroni)."""
    return 1.0 - (1.0 - probability) / max(count, 1)


def most_telling(groups: Sequence[Finding], components: Sequence[Finding], members: Mapping[str, str]) -> list[Finding]:
    """Findings to name: components, and groups of which no component stands out; the whole only if nothing else does.

    Parameters
    ----------
    groups, components : sequences of Finding
    members : mapping
        Component name -> group name.
    """
    explained = {members[finding.name] for finding in components}
    named = [*components, *(f for f in groups if f.name not in explained and f.name != WHOLE)]
    named = named or [f for f in groups if f.name == WHOLE]
    return sorted(named, key=lambda finding: -abs(np.log(max(finding.factor, 1e-12))))


def verdict(named: Sequence[Finding], most: int = 3) -> str:
    """One sentence: ``consistent``, or the worst findings."""
    if not named:
        return "consistent"
    text = "; ".join(str(finding) for finding in named[:most])
    return text + (f"; and {len(named) - most} more" if len(named) > most else "")


def _longest_stretch(outside: Array) -> tuple[int, int]:
    """First and last index of the longest run of True, returns of a few epochs bridged."""
    at = np.flatnonzero(outside)
    breaks = np.flatnonzero(np.diff(at) > BRIDGED_EPOCHS + 1)
    first, last = at[np.concatenate([[0], breaks + 1])], at[np.concatenate([breaks, [at.size - 1]])]
    longest = int(np.argmax(last - first))
    return int(first[longest]), int(last[longest])
