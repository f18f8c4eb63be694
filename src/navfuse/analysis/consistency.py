"""Do the innovations fit the covariances that were claimed? Chi-square tests on the normalized innovations squared.

An innovation z with covariance S has a NIS of z' S^-1 z, chi-square with as many degrees of freedom as components when
the model is right. Averaged over many measurements it is known closely, so a filter that trusts itself or its sensors
too much is found from its own record, without any truth. See Bar-Shalom, Li and Kirubarajan, *Estimation with
Applications to Tracking and Navigation* (2001), section 5.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from navfuse.data.result import Innovations

Array = np.ndarray

PROBABILITY = 0.99
WHITE_LAG_SIGMAS = 2.576


@dataclass(frozen=True, slots=True)
class NisSummary:
    """Consistency of one aiding source.

    Attributes
    ----------
    source : str
    counts : dict of str to int
        Measurements by status, excluded windows included.
    n : int
        Used measurements outside the excluded windows: the ones tested.
    mean_nis_per_dof : float [1]
        Of those; 1 when the model is right. The gate cuts off the largest, so that a right model gives a little less
        (0.995 for three components and a gate at 99.9 %).
    mean_nis_per_dof_with_rejected : float [1]
        The same with the rejected ones.
    mean_nis_per_dof_withheld : float [1]
        That of the withheld ones: above 1 the filter drifts more than it says while it is alone. They follow each
        other closely, so that an outage counts for little more than one measurement. NaN if none was withheld.
    bounds : (float, float) [1]
        Interval that holds `mean_nis_per_dof` of a right model with the `probability`. Computed from the number of
        measurements and widened by the lag-one correlation of the innovations.
    probability : float
    lag_one : float [1]
        Correlation of successive normalized innovations; 0 for white ones, which a right model leaves.
    white : bool
        Whether `lag_one` is within its own 99 % bound. Innovations that are not white point to measurement errors
        correlated in time (common with GNSS) or to a wrong process model; their sigmas are then too small even
        where the mean NIS looks right.
    verdict : str
        ``consistent``, ``overconfident by factor x``, ``pessimistic by factor x`` (x applies to the standard
        deviation) or ``nothing to test``.
    """

    source: str
    counts: dict[str, int]
    n: int
    mean_nis_per_dof: float
    mean_nis_per_dof_with_rejected: float
    mean_nis_per_dof_withheld: float
    bounds: tuple[float, float]
    probability: float
    lag_one: float
    white: bool
    verdict: str

    @property
    def factor(self) -> float:
        """How many times larger the innovations are than claimed: square root of the mean NIS per component."""
        return float(np.sqrt(self.mean_nis_per_dof))

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionary for JSON; numbers that do not exist become None."""

        def number(value: float) -> float | None:
            return value if np.isfinite(value) else None

        return {
            "counts": dict(self.counts),
            "tested": self.n,
            "mean_nis_per_dof": number(self.mean_nis_per_dof),
            "mean_nis_per_dof_with_rejected": number(self.mean_nis_per_dof_with_rejected),
            "mean_nis_per_dof_withheld": number(self.mean_nis_per_dof_withheld),
            "bounds": [number(value) for value in self.bounds],
            "probability": self.probability,
            "lag_one": number(self.lag_one),
            "white": self.white,
            "verdict": self.verdict,
        }


def average_bounds(degrees: float, probability: float = PROBABILITY) -> tuple[float, float]:
    """Two-sided bounds of a chi-square sum divided by its degrees of freedom.

    Parameters
    ----------
    degrees : float
        Total degrees of freedom: the sum over all runs or measurements that were averaged.
    probability : float
        Probability that the average of a right model lies inside.

    Returns
    -------
    (float, float)
        Lower and upper bound of an average NIS or NEES per degree of freedom; 1 lies between them.
    """
    from scipy.special import chdtri

    tail = 0.5 * (1.0 - probability)
    return float(chdtri(degrees, 1.0 - tail)) / degrees, float(chdtri(degrees, tail)) / degrees


def nis_summary(
    innovations: Innovations,
    exclude: Sequence[tuple[float, float]] = (),
    probability: float = PROBABILITY,
) -> dict[str, NisSummary]:
    """Consistency of every aiding source.

    Parameters
    ----------
    innovations : Innovations
    exclude : sequence of (from, to) [s]
        Windows [from, to) left out of the test, for example outages or the time before alignment.
    probability : float
        Of the bounds.
    """
    inside = np.zeros(len(innovations), dtype=bool)
    for start, end in exclude:
        inside |= (innovations.time >= start) & (innovations.time < end)
    return {
        source: _summary(source, innovations.of(source), innovations.select(~inside).of(source), probability)
        for source in innovations.sources
    }


def lag_one_correlation(innovations: Innovations) -> float:
    """Correlation of each normalized innovation component with its predecessor, NaN for fewer than three rows.

    Only the components are scaled, each by its own standard deviation; a mean that is not zero counts as correlation.
    """
    ratio = innovations.z / innovations.sd
    if ratio.shape[0] < 3:
        return float("nan")
    product = ratio[1:] * ratio[:-1]
    power = ratio**2
    total = float(np.nansum(power))
    return float(np.nansum(product)) / total * power.shape[0] / product.shape[0] if total > 0.0 else 0.0


def _summary(source: str, everything: Innovations, tested: Innovations, probability: float) -> NisSummary:
    statuses = tuple(dict.fromkeys(everything.status.tolist()))
    counts = {status: everything.count(source, status) for status in ("used", "rejected", "withheld")}
    counts |= {status: everything.count(source, status) for status in statuses if status not in counts}
    used = tested.select(tested.status == "used")
    offered = tested.select(np.isin(tested.status, ("used", "rejected", "reset")))
    withheld = _mean_nis(everything.select(everything.status == "withheld"))
    degrees = float(used.dof.sum())
    if degrees == 0.0:
        nan = float("nan")
        bounds = (nan, nan)
        return NisSummary(
            source, counts, 0, nan, _mean_nis(offered), withheld, bounds, probability, nan, True, "nothing to test"
        )
    lag_one = lag_one_correlation(used)
    rho = 0.0 if np.isnan(lag_one) else float(np.clip(lag_one, -0.99, 0.99))
    bounds = average_bounds(max(degrees * (1.0 - rho**2) / (1.0 + rho**2), 1.0), probability)
    mean = _mean_nis(used)
    return NisSummary(
        source=source,
        counts=counts,
        n=len(used),
        mean_nis_per_dof=mean,
        mean_nis_per_dof_with_rejected=_mean_nis(offered),
        mean_nis_per_dof_withheld=withheld,
        bounds=bounds,
        probability=probability,
        lag_one=lag_one,
        white=bool(np.isnan(lag_one) or abs(lag_one) <= WHITE_LAG_SIGMAS / np.sqrt(degrees)),
        verdict=_verdict(mean, bounds),
    )


def _mean_nis(innovations: Innovations) -> float:
    degrees = innovations.dof.sum()
    return float(innovations.nis.sum() / degrees) if degrees else float("nan")


def _verdict(mean: float, bounds: tuple[float, float]) -> str:
    if mean > bounds[1]:
        return f"overconfident by factor {np.sqrt(mean):.2f}"
    if mean < bounds[0]:
        return f"pessimistic by factor {1.0 / np.sqrt(max(mean, 1e-12)):.2f}"
    return "consistent"
