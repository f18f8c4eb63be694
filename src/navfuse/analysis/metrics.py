"""Errors of a solution against a truth, and the numbers that sum them up.

Errors are *solution minus truth*, resolved north, east, down at the truth's position and formed at the truth's times,
to which the solution is interpolated (see :mod:`navfuse.analysis.interpolation`); nothing is extrapolated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from navfuse.analysis.interpolation import (
    check_epochs,
    conjugate,
    covered,
    earth_states,
    interpolate,
    interpolate_linear,
    multiply,
    ned_axes,
    ned_quaternion,
)
from navfuse.core.rotation import euler_from_quat_batch
from navfuse.data.trajectory import Trajectory
from navfuse.errors import InputError

Array = np.ndarray

QUANTITIES = {
    "position_north": "m",
    "position_east": "m",
    "position_down": "m",
    "position_horizontal": "m",
    "position_3d": "m",
    "velocity_north": "m/s",
    "velocity_east": "m/s",
    "velocity_down": "m/s",
    "velocity_3d": "m/s",
    "roll": "deg",
    "pitch": "deg",
    "heading": "deg",
    "attitude_3d": "deg",
}
KEY_SUFFIX = {"m": "m", "m/s": "mps", "deg": "deg"}


class Statistics(NamedTuple):
    """One error in numbers, in the unit of the error.

    `rms` and `mean` are of the signed error; the percentiles and `max` of its magnitude. `n` counts the finite samples.
    """

    n: int
    rms: float
    mean: float
    p50: float
    p68: float
    p95: float
    p99: float
    max: float


class Consistency(NamedTuple):
    """How errors compare with their claimed standard deviations.

    Attributes
    ----------
    n : int
        Number of components compared.
    nees_per_dof : float [1]
        Mean of (error / sd)^2: the normalized estimation error squared with the *diagonal* of the covariance only
        (a trajectory holds no correlations), divided by its degrees of freedom. 1 when the claim is right; above 1
        the solution is overconfident. Samples of one run are correlated in time, so no chi-square bound applies.
    inside_3_sigma : float [1]
        Fraction of components within three sigma; 0.9973 when the claim is right.
    """

    n: int
    nees_per_dof: float
    inside_3_sigma: float


@dataclass(frozen=True, slots=True)
class ErrorSeries:
    """Errors over time, solution minus truth.

    Attributes
    ----------
    time : (n,) array [s]
        Times of the truth that the solution covers.
    position : (n, 3) array [m]
        North, east, down: the straight ECEF difference turned to the truth's local axes.
    velocity : (n, 3) array [m/s] or None
        North, east, down at the truth's position.
    attitude : (n, 3) array [rad] or None
        Roll, pitch, heading, each wrapped to [-pi, pi). Near a pitch of +-90 deg roll and heading are not defined
        apart and their errors mean nothing; `attitude_angle` stays meaningful.
    attitude_angle : (n,) array [rad] or None
        Angle of the single rotation between the two attitudes, >= 0.
    sd_position, sd_velocity, sd_attitude : (n, 3) arrays or None
        Standard deviation of the error: the solution's, root-sum-squared with the truth's when that has any.
    skipped : int
        Times of the truth inside a gap of the solution, left out.
    source : str
        Names of the two trajectories.
    """

    time: Array
    position: Array
    velocity: Array | None
    attitude: Array | None
    attitude_angle: Array | None
    sd_position: Array | None
    sd_velocity: Array | None
    sd_attitude: Array | None
    skipped: int
    source: str

    def columns(self) -> dict[str, Array]:
        """The errors by name, in the order and units of :data:`QUANTITIES` (angles in degrees)."""
        found: dict[str, Array] = {}
        found |= zip(("position_north", "position_east", "position_down"), self.position.T, strict=True)
        found["position_horizontal"] = np.hypot(self.position[:, 0], self.position[:, 1])
        found["position_3d"] = np.linalg.norm(self.position, axis=1)
        if self.velocity is not None:
            found |= zip(("velocity_north", "velocity_east", "velocity_down"), self.velocity.T, strict=True)
            found["velocity_3d"] = np.linalg.norm(self.velocity, axis=1)
        if self.attitude is not None and self.attitude_angle is not None:
            found |= zip(("roll", "pitch", "heading"), np.degrees(self.attitude).T, strict=True)
            found["attitude_3d"] = np.degrees(self.attitude_angle)
        return found


@dataclass(frozen=True, slots=True)
class ErrorMetrics:
    """A comparison in numbers.

    Attributes
    ----------
    start_s, end_s : float [s]
        First and last time compared.
    n : int
        Number of epochs compared.
    skipped : int
        Epochs of the truth inside a gap of the solution.
    statistics : dict of str to Statistics
        By quantity, see :data:`QUANTITIES` for names and units (angles in degrees).
    consistency : dict of str to Consistency
        ``position``, ``velocity``, ``attitude``: those for which the solution has standard deviations.
    source : str
        Names of the two trajectories.
    """

    start_s: float
    end_s: float
    n: int
    skipped: int
    statistics: dict[str, Statistics]
    consistency: dict[str, Consistency]
    source: str

    def to_dict(self) -> dict[str, Any]:
        """Plain nested dictionary with the unit in every key, for JSON."""
        named = {f"{name}_{KEY_SUFFIX[QUANTITIES[name]]}": s._asdict() for name, s in self.statistics.items()}
        return {
            "compared": self.source,
            "start_s": self.start_s,
            "end_s": self.end_s,
            "epochs": self.n,
            "epochs_in_gaps": self.skipped,
            "errors": named,
            "consistency": {name: value._asdict() for name, value in self.consistency.items()},
        }

    def rows(self) -> list[tuple[str, str, Statistics]]:
        """(label, unit, statistics) of every quantity, in a fixed order, for tables."""
        labels = {name: name.replace("_3d", " 3-D").replace("_", " ") for name in QUANTITIES}
        return [
            (labels[name], QUANTITIES[name], self.statistics[name]) for name in QUANTITIES if name in self.statistics
        ]


def errors(
    solution: Trajectory,
    truth: Trajectory,
    *,
    skip_s: float = 0.0,
    until_s: float | None = None,
    max_gap_s: float | None = None,
) -> ErrorSeries:
    """Errors of a solution at the truth's times.

    Parameters
    ----------
    solution, truth : Trajectory
        On the same time scale and for the same point of the vehicle. The truth may be denser or sparser.
    skip_s, until_s : float [s]
        Compare from `skip_s` until before `until_s`, both counted from the first time that both cover.
    max_gap_s : float [s], optional
        Longest interval of the solution that is bridged; default the larger of 1 s and five median intervals.

    Raises
    ------
    InputError
        When nothing is left to compare, or a time does not increase.
    """
    for trajectory in (solution, truth):
        check_epochs(trajectory)
    inside = (truth.time >= solution.time[0]) & (truth.time <= solution.time[-1])
    if not inside.any():
        raise InputError(
            f"{solution.source} ({_span(solution)}) and {truth.source} ({_span(truth)}) have no time in common; "
            "are both on the same time scale?"
        )
    start = max(solution.time[0], truth.time[0])
    since = truth.time - start
    wanted = inside & (since >= skip_s) & (since < (np.inf if until_s is None else until_s))
    chosen = wanted & covered(solution.time, truth.time, max_gap_s)
    if not chosen.any():
        until = "the end" if until_s is None else f"{until_s:g} s"
        raise InputError(
            f"nothing to compare from {skip_s:g} s to {until} after the common start {start:.3f} s: {solution.source} "
            f"covers {_span(solution)}, {truth.source} {_span(truth)}, and {int(wanted.sum())} epochs fall in gaps"
        )
    reference = _take(truth, chosen)
    time = reference.time
    est, ref = interpolate(earth_states(solution), time), earth_states(reference)
    C_en = ned_axes(reference.lat, reference.lon)
    position = np.einsum("nji,nj->ni", C_en, est.r_e - ref.r_e)
    velocity = attitude = angle = None
    if est.v_e is not None and ref.v_e is not None:
        velocity = np.einsum("nji,nj->ni", C_en, est.v_e - ref.v_e)
    if est.q_eb is not None and ref.q_eb is not None and reference.attitude is not None:
        q_nb = multiply(conjugate(ned_quaternion(reference.lat, reference.lon)), est.q_eb)
        attitude = _wrap(euler_from_quat_batch(q_nb) - reference.attitude)
        turn = multiply(conjugate(ref.q_eb), est.q_eb)
        angle = 2.0 * np.arctan2(np.linalg.norm(turn[:, 1:], axis=1), np.abs(turn[:, 0]))
    return ErrorSeries(
        time=time,
        position=position,
        velocity=velocity,
        attitude=attitude,
        attitude_angle=angle,
        sd_position=_sd(solution, solution.sd_position, reference.sd_position, time),
        sd_velocity=None if velocity is None else _sd(solution, solution.sd_velocity, reference.sd_velocity, time),
        sd_attitude=None if attitude is None else _sd(solution, solution.sd_attitude, reference.sd_attitude, time),
        skipped=int(wanted.sum() - chosen.sum()),
        source=f"{solution.source} against {truth.source}",
    )


def compare(
    solution: Trajectory,
    truth: Trajectory,
    *,
    skip_s: float = 0.0,
    until_s: float | None = None,
    max_gap_s: float | None = None,
) -> ErrorMetrics:
    """RMSE, mean, percentiles and maximum of every error of a solution; parameters as for :func:`errors`."""
    return summarize(errors(solution, truth, skip_s=skip_s, until_s=until_s, max_gap_s=max_gap_s))


def summarize(series: ErrorSeries) -> ErrorMetrics:
    """Numbers of an error series."""
    blocks = {
        "position": (series.position, series.sd_position),
        "velocity": (series.velocity, series.sd_velocity),
        "attitude": (series.attitude, series.sd_attitude),
    }
    return ErrorMetrics(
        start_s=float(series.time[0]),
        end_s=float(series.time[-1]),
        n=series.time.size,
        skipped=series.skipped,
        statistics={name: _statistics(values) for name, values in series.columns().items()},
        consistency={
            name: _consistency(error, sd)
            for name, (error, sd) in blocks.items()
            if error is not None and sd is not None
        },
        source=series.source,
    )


def _statistics(values: Array) -> Statistics:
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return Statistics(0, *([float("nan")] * 7))
    percentiles = np.percentile(np.abs(finite), [50.0, 68.0, 95.0, 99.0, 100.0])
    rms = float(np.sqrt(np.mean(finite**2)))
    return Statistics(finite.size, rms, float(np.mean(finite)), *(float(value) for value in percentiles))


def _consistency(error: Array, sd: Array) -> Consistency:
    known = np.isfinite(error) & (sd > 0.0)
    ratio = error[known] / sd[known]
    if ratio.size == 0:
        return Consistency(0, float("nan"), float("nan"))
    return Consistency(ratio.size, float(np.mean(ratio**2)), float(np.mean(np.abs(ratio) <= 3.0)))


def _sd(solution: Trajectory, sd: Array | None, sd_truth: Array | None, time: Array) -> Array | None:
    if sd is None:
        return None
    own = interpolate_linear(solution.time, sd, time)
    return own if sd_truth is None else np.sqrt(own**2 + np.nan_to_num(sd_truth) ** 2)


def _take(trajectory: Trajectory, mask: Array) -> Trajectory:
    def rows(array: Array | None) -> Array | None:
        return None if array is None else array[mask]

    t = trajectory
    return Trajectory(
        t.time[mask],
        t.lat[mask],
        t.lon[mask],
        t.height[mask],
        *(rows(a) for a in (t.velocity_n, t.attitude, t.sd_position, t.sd_velocity, t.sd_attitude)),
        source=t.source,
    )


def _wrap(angle: Array) -> Array:
    return np.mod(angle + np.pi, 2.0 * np.pi) - np.pi


def _span(trajectory: Trajectory) -> str:
    return f"{trajectory.time[0]:.3f} .. {trajectory.time[-1]:.3f} s"
