"""Several estimators on the same logs, side by side: errors, consistency, cost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from navfuse.analysis.consistency import NisSummary
from navfuse.analysis.event_nees import NeesSummary
from navfuse.analysis.great_circle import haversine
from navfuse.analysis.interpolation import earth_states, interpolate
from navfuse.analysis.metrics import KEY_SUFFIX, ErrorMetrics, ErrorSeries, errors, summarize
from navfuse.core.earth import ecef_to_geodetic_batch
from navfuse.data.trajectory import Trajectory

Array = np.ndarray

WINDOW_S = 60.0
"""Of the running RMSE."""


FIGURES = (
    ("RMSE horizontal", "position_horizontal", "rms"),
    ("RMSE vertical", "position_down", "rms"),
    ("RMSE 3-D position", "position_3d", "rms"),
    ("MAE 3-D position", "position_3d", "mean"),
    ("maximum 3-D position", "position_3d", "max"),
    ("RMSE 3-D velocity", "velocity_3d", "rms"),
    ("RMSE roll", "roll", "rms"),
    ("RMSE pitch", "pitch", "rms"),
    ("RMSE heading", "heading", "rms"),
)
"""Label, quantity of :data:`navfuse.analysis.metrics.QUANTITIES`, statistic. The mean of a 3-D distance is its MAE."""
_UNITS = {"position": "m", "velocity": "m/s", "roll": "deg", "pitch": "deg", "heading": "deg"}


@dataclass(frozen=True, slots=True)
class Solution:
    """A trajectory of an estimator against the reference.

    Attributes
    ----------
    trajectory : Trajectory
        Of the point that the reference describes: the IMU, or the antenna where the reference are fixes.
    errors : ErrorSeries
        Solution minus reference at the times of the reference.
    metrics : ErrorMetrics
    great_circle : (n,) array [m]
        Haversine distance at the times of `errors`.
    """

    trajectory: Trajectory
    errors: ErrorSeries
    metrics: ErrorMetrics
    great_circle: Array

    @property
    def distance(self) -> Array:
        """Straight distance from the reference (n,) [m], in three dimensions."""
        return np.linalg.norm(self.errors.position, axis=1)

    def figures(self) -> dict[str, float]:
        """The numbers of :data:`FIGURES` by label, those that the reference allows."""
        statistics = self.metrics.statistics
        return {
            label: float(getattr(statistics[quantity], statistic))
            for label, quantity, statistic in FIGURES
            if quantity in statistics
        }


@dataclass(frozen=True, slots=True)
class EstimatorRun:
    """What one estimator made of the logs.

    Attributes
    ----------
    estimator : str
    states : int
        Number of states.
    forward : Solution
        Each epoch knows only its past.
    smoothed : Solution or None
    nees : dict of str to NeesSummary
        Of the filter, by group; empty without truth.
    smoothed_nees : dict of str to NeesSummary
        Of the smoother, at no more than 2500 events of a stretch, and not while the filter held its heading.
    nis : dict of str to NisSummary
        By source.
    seconds : float [s]
        Time of the filter alone over the logs, with everything compiled and loaded: the fastest run if there were
        several.
    samples : int
        IMU samples it took in.
    notes : tuple of str
        What the filter says about the run.
    """

    estimator: str
    states: int
    forward: Solution
    smoothed: Solution | None
    nees: dict[str, NeesSummary]
    smoothed_nees: dict[str, NeesSummary]
    nis: dict[str, NisSummary]
    seconds: float
    samples: int
    notes: tuple[str, ...] = ()

    @property
    def us_per_sample(self) -> float:
        """Time of the filter per IMU sample [us], on this machine."""
        return 1e6 * self.seconds / self.samples

    def count(self, *statuses: str) -> int:
        """Number of measurements with one of these fates."""
        return sum(one.counts.get(status, 0) for one in self.nis.values() for status in statuses)


@dataclass(frozen=True, slots=True)
class FilterComparison:
    """Estimators by the same logs, start, settings and sensors.

    Attributes
    ----------
    project : str
        Where the settings came from.
    reference : Trajectory
        What the solutions are compared with.
    against_truth : bool
        False if the reference are the fixes: the numbers are then differences from the fixes, and no errors.
    runs : tuple of EstimatorRun
        In the order asked for.
    """

    project: str
    reference: Trajectory
    against_truth: bool
    runs: tuple[EstimatorRun, ...]

    @property
    def what(self) -> str:
        """What the numbers are, in a sentence."""
        if self.against_truth:
            return f"Errors against the truth {self.reference.source}."
        return (
            f"There is no truth: DIFFERENCES FROM THE FIXES of {self.reference.source}, which hold the errors of the"
            " fixes themselves. A filter that follows the fixes closely is not better for it."
        )

    @property
    def estimators(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(run.estimator for run in self.runs)

    def table(self) -> list[tuple[str, str, list[str]]]:
        """Label, unit and one text for each estimator, row by row."""
        rows = _error_rows("", [run.forward for run in self.runs])
        smoothed = [run.smoothed for run in self.runs]
        if any(one is not None for one in smoothed):
            rows += _error_rows(", smoothed", smoothed)
        rows += _nees_rows("", [run.nees for run in self.runs])
        rows += _nees_rows(", smoothed", [run.smoothed_nees for run in self.runs])
        for source in dict.fromkeys(source for run in self.runs for source in run.nis):
            rows.append((f"NIS / dof, {source}", "1", [_nis_text(run.nis.get(source)) for run in self.runs]))
        rows.append(("measurements used", "", [str(run.count("used", "reset")) for run in self.runs]))
        rows.append(("measurements rejected", "", [str(run.count("rejected")) for run in self.runs]))
        rows.append(("states", "", [str(run.states) for run in self.runs]))
        rows.append(
            ("filter with its updates, per IMU sample", "us", [_text(run.us_per_sample, 2) for run in self.runs])
        )
        return rows

    def notes(self) -> list[str]:
        """How to read the table."""
        lines = [self.what]
        if any(run.nees for run in self.runs):
            lines.append(
                "NEES with the full covariance of the filter after its measurements, averaged over the epochs; 1 and 95"
                " % for a consistent filter. Epochs of one run are correlated: for a test run `navfuse montecarlo`."
            )
        lines.append(
            "NIS of the used measurements, in brackets what a right model keeps to with 99 %. Times are of this"
            " machine, kernels compiled and loaded, the fastest of three runs of each filter where they are short."
        )
        return lines

    def to_dict(self) -> dict[str, Any]:
        """Plain nested dictionary with the unit in every key, for JSON."""
        return {
            "project": self.project,
            "reference": self.reference.source,
            "against_truth": self.against_truth,
            "running_rmse_window_s": WINDOW_S,
            "estimators": {run.estimator: _run_dict(run) for run in self.runs},
        }


def compare_solution(solution: Trajectory, reference: Trajectory) -> Solution:
    """A trajectory against the reference.

    Raises
    ------
    InputError
        If they have no time in common.
    """
    series = errors(solution, reference)
    rows = np.searchsorted(reference.time, series.time)
    estimate = interpolate(earth_states(solution), series.time)
    lat, lon, _ = ecef_to_geodetic_batch(estimate.r_e)
    across = haversine(reference.lat[rows], reference.lon[rows], lat, lon)
    return Solution(solution, series, summarize(series), np.asarray(across))


def running_rms(time: Array, values: Array, window: float = WINDOW_S) -> Array:
    """Root mean square over a window that ends at each time.

    Parameters
    ----------
    time : (n,) array [s]
        Increasing.
    values : (n,) array
    window : float [s]
        The mean at t is over (t - window, t]; in the beginning over what there is.

    Returns
    -------
    (n,) array

    Notes
    -----
    Sums run from block to block of about a window each, and are never subtracted: a large error that has left the
    window leaves no rounding behind.
    """
    squares = np.square(values)
    first = np.searchsorted(time, time - window, side="right")
    total = np.empty(time.size)
    begin, tail = 0, np.zeros(1)
    while begin < time.size:
        end = int(np.searchsorted(first, begin, side="right"))
        rows = slice(begin, end)
        total[rows] = np.cumsum(squares[rows]) + tail[begin - first[rows]]
        tail = np.concatenate([[0.0], np.cumsum(squares[rows][::-1])])
        begin = end
    return np.sqrt(total / (np.arange(1, time.size + 1) - first))


def _error_rows(suffix: str, solutions: Sequence[Solution | None]) -> list[tuple[str, str, list[str]]]:
    figures = [{} if one is None else one.figures() for one in solutions]
    return [
        (label + suffix, _UNITS[quantity.split("_")[0]], [_text(found.get(label), 4) for found in figures])
        for label, quantity, _ in FIGURES
        if any(label in found for found in figures)
    ]


def _nees_rows(suffix: str, runs: Sequence[dict[str, NeesSummary]]) -> list[tuple[str, str, list[str]]]:
    rows = []
    for group in dict.fromkeys(group for nees in runs for group in nees):
        found = [nees.get(group) for nees in runs]
        means = [_text(None if one is None else one.mean_per_dof, 3) for one in found]
        inside = [_text(None if one is None else 100.0 * one.share_inside, 1) for one in found]
        rows += [(f"NEES / dof, {group}{suffix}", "1", means), ("  epochs below the 95 % bound", "%", inside)]
        if any(one is not None and one.not_definite for one in found):
            broken = ["-" if one is None else str(one.not_definite) for one in found]
            rows.append(("  epochs of a covariance not positive definite", "", broken))
    return rows


def _text(value: float | None, digits: int) -> str:
    return "-" if value is None or not np.isfinite(value) else f"{value:.{digits}f}"


def _nis_text(found: NisSummary | None) -> str:
    if found is None or not np.isfinite(found.mean_nis_per_dof):
        return "-"
    return f"{found.mean_nis_per_dof:.3f} ({found.bounds[0]:.3f}..{found.bounds[1]:.3f})"


def _solution_dict(solution: Solution | None) -> dict[str, float] | None:
    if solution is None:
        return None
    units = {label: KEY_SUFFIX[_UNITS[quantity.split("_")[0]]] for label, quantity, _ in FIGURES}
    return {
        f"{label.lower().replace('3-d', '3d').replace(' ', '_')}_{units[label]}": value
        for label, value in solution.figures().items()
    } | {"mean_great_circle_m": float(np.mean(solution.great_circle)), "epochs": solution.metrics.n}


def _run_dict(run: EstimatorRun) -> dict[str, Any]:
    return {
        "states": run.states,
        "forward": _solution_dict(run.forward),
        "smoothed": _solution_dict(run.smoothed),
        "nees": {name.replace(" ", "_"): one.to_dict() for name, one in run.nees.items()},
        "smoothed_nees": {name.replace(" ", "_"): one.to_dict() for name, one in run.smoothed_nees.items()},
        "nis": {source: one.to_dict() for source, one in run.nis.items()},
        "used": run.count("used", "reset"),
        "rejected": run.count("rejected"),
        "filter_us_per_imu_sample": run.us_per_sample,
        "imu_samples": run.samples,
        "notes": list(run.notes),
    }
