"""What the runs of a campaign say about the filter: averages within bounds, ratios, and a verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from navfuse.analysis.ensemble import (
    Average,
    Finding,
    Rmse,
    average,
    family_probability,
    findings,
    group_ratios,
    most_telling,
    rms_error,
    verdict,
)
from navfuse.errors import ConfigError, InputError
from navfuse.montecarlo.campaign import Campaign
from navfuse.montecarlo.single import SAME_TIME, RunRecord

Array = np.ndarray

SETTLE_S = 10.0
VERDICT_PROBABILITY = 0.999
"""Of all bounds of the verdict together, at one epoch."""


@dataclass(frozen=True, eq=False)
class Assessment:
    """Consistency of one estimator over the runs.

    Attributes
    ----------
    estimator : str
        ``"filter"`` or ``"smoother"``.
    runs : int
    settle_s : float [s]
        Epochs before it are shown, but not judged.
    nees : dict of str to Average
        Of every group of states, the whole last, with 99 % bounds.
    nis : dict of str to Average
        Of every aiding source, all measurements that an innovation was formed of; none for a smoother.
    squares : dict of str to Average
        Squared error over variance of every component.
    rms : list of Rmse
        Of every component, after `settle_s`.
    findings : list of Finding
        What is outside for more than 3 % of the time. For this the bounds are widened so that a consistent filter is
        inside those of all groups, and of all components, with 99.9 % at any one epoch: errors that last, such as a
        scale factor that nothing observes, have only one chance in a campaign.
    verdict : str
    """

    estimator: str
    runs: int
    settle_s: float
    nees: dict[str, Average]
    nis: dict[str, Average]
    squares: dict[str, Average]
    rms: list[Rmse]
    findings: list[Finding]
    verdict: str

    @property
    def consistent(self) -> bool:
        """Whether nothing stands out."""
        return not self.findings

    @property
    def ratios(self) -> dict[str, float]:
        """RMSE over sigma of every group of states."""
        return group_ratios(self.rms)

    def to_dict(self) -> dict[str, Any]:
        """For ``summary.json``."""
        return {
            "runs": self.runs,
            "verdict": self.verdict,
            "settle_s": self.settle_s,
            "nees": {name: self._described(entry) for name, entry in self.nees.items()},
            "nis": {name: self._described(entry) for name, entry in self.nis.items()},
            "rmse_over_sigma": self.ratios,
            "components": {
                entry.component.name: {
                    "unit": entry.component.unit,
                    "rmse": entry.total * entry.component.factor,
                    "rmse_95": [entry.low * entry.component.factor, entry.high * entry.component.factor],
                    "sigma": entry.total_sigma * entry.component.factor,
                    "ratio": entry.ratio,
                    "share_inside_99": self.squares[entry.component.name].after(self.settle_s).share_inside,
                }
                for entry in self.rms
            },
            "findings": [
                {
                    "name": finding.name,
                    "factor": finding.factor,
                    "start_s": finding.start,
                    "end_s": finding.end,
                    "share_outside": finding.share,
                }
                for finding in self.findings
            ],
        }

    def _described(self, entry: Average) -> dict[str, Any]:
        judged = entry.after(self.settle_s)
        return {
            "mean_per_dof": float(np.mean(judged.mean)),
            "bounds_99": [float(np.mean(judged.low)), float(np.mean(judged.high))],
            "share_inside_99": judged.share_inside,
        }


def assess(campaign: Campaign, settle_s: float = SETTLE_S) -> dict[str, Assessment]:
    """Judge the filter, and the smoother if there was one.

    Parameters
    ----------
    campaign : Campaign
    settle_s : float [s]
        Length of the beginning that is not judged.

    Returns
    -------
    dict of str to Assessment
        ``"filter"`` and ``"smoother"``.

    Raises
    ------
    InputError
        If there are no epochs that all runs share.
    ConfigError
        If nothing is left to be judged.
    """
    runs = _at_common_epochs(campaign.runs)
    time = runs[0].time
    begin = float(time[0]) + settle_s
    if not begin <= time[-1]:
        raise ConfigError(
            f"the runs last {time[-1] - time[0]:g} s, of which the first {settle_s:g} s are not judged: nothing is "
            "left; make the runs longer"
        )
    found = {"filter": _assessment("filter", runs, time, begin, "", _nis(runs))}
    if runs[0].smoothed_error is not None:
        found["smoother"] = _assessment("smoother", runs, time, begin, "smoothed_", {})
    return found


def _at_common_epochs(runs: list[RunRecord]) -> list[RunRecord]:
    """The runs at the epochs that all of them have; stamps that jitter put the first or the last fix in or out."""
    time = runs[0].time
    if all(run.time.shape == time.shape and np.all(np.abs(run.time - time) <= SAME_TIME) for run in runs):
        return runs
    common = _stamps(time)
    for run in runs[1:]:
        common = np.intersect1d(common, _stamps(run.time), assume_unique=True)
    if not common.size:
        raise InputError(
            "the runs have no epoch in common: they can only be averaged where all of them have measurements at the "
            "same times"
        )
    return [_picked(run, np.isin(_stamps(run.time), common), common) for run in runs]


def _stamps(time: Array) -> Array:
    """Times as whole numbers of ten microseconds, so that they can be compared."""
    return np.rint(np.asarray(time) / (10.0 * SAME_TIME)).astype(np.int64)


def _picked(run: RunRecord, rows: Array, common: Array) -> RunRecord:
    smoothed = (
        {}
        if run.smoothed_error is None or run.smoothed_sd is None
        else {
            "smoothed_error": run.smoothed_error[rows],
            "smoothed_sd": run.smoothed_sd[rows],
            "smoothed_nees": {name: values[rows] for name, values in run.smoothed_nees.items()},
        }
    )
    return replace(
        run,
        time=run.time[rows],
        error=run.error[rows],
        sd=run.sd[rows],
        nees={name: values[rows] for name, values in run.nees.items()},
        innovations=run.innovations.select(np.isin(_stamps(run.innovations.time), common)),
        **smoothed,
    )


def _assessment(
    estimator: str,
    runs: Sequence[RunRecord],
    time: Array,
    begin: float,
    prefix: str,
    nis: dict[str, Average],
) -> Assessment:
    """Judge what stands in the attributes of the runs that begin with `prefix`."""
    components, dof = runs[0].components, runs[0].dof
    error, sd = (np.array([getattr(run, prefix + name) for run in runs]) for name in ("error", "sd"))
    squared = {name: np.array([getattr(run, f"{prefix}nees")[name] for run in runs]) for name in dof}
    some = {name: np.isfinite(values).any(axis=0) for name, values in squared.items()}
    tested = [name for name in dof if (some[name] & (time >= begin - SAME_TIME)).any()]
    of_tested = {name: (time[some[name]], squared[name][:, some[name]], dof[name]) for name in tested}
    nees = {name: average(name, *values) for name, values in of_tested.items()}
    all_groups = family_probability(max(len(tested), 1), VERDICT_PROBABILITY)
    judged_groups = [average(name, *values, all_groups).after(begin) for name, values in of_tested.items()]
    there = np.asarray(np.all(np.isfinite(error) & (sd > 0.0), axis=0))
    judged = np.asarray(time >= begin - SAME_TIME)
    usable = np.flatnonzero((there & judged[:, None]).any(axis=0)).tolist()
    each = family_probability(len(usable), VERDICT_PROBABILITY)
    squares, wide, rms = {}, [], []
    for k in usable:
        component, at, rows = components[k], time[there[:, k]], there[:, k] & judged
        ratio = (error[:, there[:, k], k] / sd[:, there[:, k], k]) ** 2
        squares[component.name] = average(component.name, at, ratio, 1.0)
        wide.append(average(component.name, at, ratio, 1.0, each).after(begin))
        rms.append(rms_error(component, time[rows], error[:, rows, k], sd[:, rows, k]))
    members = {component.name: component.group for component in components}
    named = most_telling(findings(judged_groups), findings(wide), members)
    return Assessment(estimator, len(runs), begin, nees, nis, squares, rms, named, verdict(named))


def _nis(runs: Sequence[RunRecord]) -> dict[str, Average]:
    """Average NIS of every source, at the times that every run has; rejected measurements count."""
    found = {}
    for source in runs[0].innovations.sources:
        entries = [run.innovations.of(source) for run in runs]
        if any(len(entry) != len(entries[0]) for entry in entries):
            continue
        nis = np.array([entry.nis for entry in entries])
        there = np.isfinite(nis).any(axis=0)
        dof = entries[0].dof[there]
        if there.any() and np.all(dof == dof[0]):
            found[source] = average(source, entries[0].time[there], nis[:, there], float(dof[0]))
    return found
