"""NEES of the navigation states of one run, filter and smoother, against a trajectory as truth.

The full covariance is that of the checkpoints that a filter keeps after every event.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from navfuse.analysis.interpolation import EarthStates, covered, earth_states, interpolate
from navfuse.analysis.nees import navigation_errors, nees_of_groups
from navfuse.core.kalman import reset_attitude
from navfuse.data.nav_state import boxplus_navigation
from navfuse.data.trajectory import Trajectory
from navfuse.filters.event import split
from navfuse.filters.record import FilterRecord
from navfuse.smoothers.rts import SmoothedRun

Array = np.ndarray

NEES_PROBABILITY = 0.95
NAVIGATION = "navigation state"
_GROUPS = {"position": slice(0, 3), "velocity": slice(3, 6), "attitude": slice(6, 9), NAVIGATION: slice(0, 9)}
MOST_SMOOTHED = 2500
"""Events of a stretch whose smoothed covariance is asked for."""
_CHUNK = 4096
_SAME_TIME = 1e-6


@dataclass(frozen=True, slots=True)
class NeesSummary:
    """Normalized estimation error squared of a group of states over the epochs of one run.

    Attributes
    ----------
    dof : int
    time : (m,) array [s]
        Moments after a measurement that the truth covers.
    values : (m,) array [1]
        d' P^-1 d with the full covariance of the group; NaN where that is not positive definite.
    """

    dof: int
    time: Array
    values: Array

    @property
    def mean_per_dof(self) -> float:
        """Average over the epochs, over the degrees of freedom; about 1 for a consistent filter.

        Epochs of one run are correlated in time, so that no chi-square bound applies to the average.
        """
        good = self.values[np.isfinite(self.values)]
        return float(np.mean(good)) / self.dof if good.size else float("nan")

    @property
    def bound(self) -> float:
        """Value that a consistent filter stays below with the probability of 95 %, at any one epoch."""
        from scipy.special import chdtri

        return float(chdtri(self.dof, 1.0 - NEES_PROBABILITY))

    @property
    def share_inside(self) -> float:
        """Share of the epochs at which the value is below its bound; 0.95 for a consistent filter.

        An epoch whose covariance is not positive definite counts as outside.
        """
        return float(np.mean(self.values <= self.bound))

    @property
    def not_definite(self) -> int:
        """Number of epochs whose covariance is not positive definite: the estimator is at fault there."""
        return int(np.count_nonzero(~np.isfinite(self.values)))

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionary for JSON."""
        return {
            "epochs": int(self.values.size),
            "epochs_not_positive_definite": self.not_definite,
            "dof": self.dof,
            "mean_per_dof": self.mean_per_dof,
            "bound_95": self.bound,
            "share_inside_95": self.share_inside,
        }


def nees_at_events(
    records: Sequence[FilterRecord], truth: Trajectory, ecef: bool, open_loop: bool
) -> dict[str, NeesSummary]:
    """NEES of the navigation states of a run, after the last measurement of every moment.

    Parameters
    ----------
    records : sequence of FilterRecord
        With checkpoints, which hold the full covariance; one for each stretch between gaps.
    truth : Trajectory
        Of the IMU. Between its epochs it is interpolated; in its gaps there is no NEES.
    ecef, open_loop : bool
        As the filter works.

    Returns
    -------
    dict of str to NeesSummary
        ``position``, ``velocity``, ``attitude`` and ``navigation state``, those that the truth has; empty if no
        checkpoint is within the truth.

    Raises
    ------
    InputError
        If a covariance is not finite.
    """
    reference, groups = _reference(truth)
    parts: list[tuple[Array, dict[str, Array]]] = []
    for record in records:
        kept = events_within(record, truth)
        for at in range(0, kept.size, _CHUNK):
            some = [record.checkpoints[k] for k in kept[at : at + _CHUNK].tolist()]
            time = np.array([checkpoint.time for checkpoint in some])
            nav, _, x, P = split(np.array([checkpoint.carried for checkpoint in some]))
            error = _errors(reference, time, nav, ecef)
            if open_loop:
                error -= x[:, :9]
            parts.append((time, nees_of_groups(error, P[:, :9, :9], groups, strict=False)))
    return _joined(parts, groups)


def smoothed_nees_at_events(
    records: Sequence[FilterRecord], smoothed: Sequence[SmoothedRun], truth: Trajectory, ecef: bool
) -> dict[str, NeesSummary]:
    """The same of the smoother.

    Parameters
    ----------
    records, truth, ecef
        As for :func:`nees_at_events`.
    smoothed : sequence of SmoothedRun
        Of the same stretches, with the errors and covariances at the events of :func:`events_to_smooth`.
    """
    reference, groups = _reference(truth)
    parts: list[tuple[Array, dict[str, Array]]] = []
    for record, back in zip(records, smoothed, strict=True):
        kept = [record.checkpoints[k] for k in events_to_smooth(record, truth).tolist()]
        if not kept:
            continue
        nav = np.array([checkpoint.parts[0] for checkpoint in kept])
        P = back.P.copy()
        for row in range(len(kept)):
            boxplus_navigation(nav[row], back.error[row], ecef)
            reset_attitude(P[row], back.error[row, 6:9])
        time = np.array([checkpoint.time for checkpoint in kept])
        error = _errors(reference, time, nav, ecef)
        parts.append((time, nees_of_groups(error, P[:, :9, :9], groups, strict=False)))
    return _joined(parts, groups)


def events_within(record: FilterRecord, truth: Trajectory) -> Array:
    """Numbers of the checkpoints that are the last of their moment, and within the truth."""
    time = np.array([checkpoint.time for checkpoint in record.checkpoints])
    last = np.append(np.diff(time) > _SAME_TIME, True)
    return np.flatnonzero(last & covered(truth.time, time))


def events_to_smooth(record: FilterRecord, truth: Trajectory) -> Array:
    """No more than 2500 of these, evenly; none while the heading was held, when the smoothed covariance is no good."""
    held = [k for k, checkpoint in enumerate(record.checkpoints) if checkpoint.held.any()]
    events = events_within(record, truth)
    events = events[events > (held[-1] if held else -1)]
    if events.size <= MOST_SMOOTHED:
        return events
    return events[np.linspace(0, events.size - 1, MOST_SMOOTHED).round().astype(np.int64)]


def _reference(truth: Trajectory) -> tuple[EarthStates, dict[str, Array]]:
    """The truth in Earth axes, and the groups of states that it has."""
    reference = earth_states(truth)
    present = {"position": True, "velocity": reference.v_e is not None, "attitude": reference.q_eb is not None}
    present[NAVIGATION] = all(present.values())
    return reference, {name: np.arange(span.start, span.stop) for name, span in _GROUPS.items() if present[name]}


def _errors(reference: EarthStates, time: Array, nav: Array, ecef: bool) -> Array:
    """Errors (m, 9) in the frame of the filter; those that the reference does not have are arbitrary."""
    state = interpolate(reference, time)
    v_e = np.zeros_like(state.r_e) if state.v_e is None else state.v_e
    q_eb = np.tile([1.0, 0.0, 0.0, 0.0], (time.size, 1)) if state.q_eb is None else state.q_eb
    error, _ = navigation_errors(state.r_e, v_e, q_eb, nav, ecef)
    return error


def _joined(parts: list[tuple[Array, dict[str, Array]]], groups: dict[str, Array]) -> dict[str, NeesSummary]:
    if not parts:
        return {}
    time = np.concatenate([time for time, _ in parts])
    return {
        name: NeesSummary(index.size, time, np.concatenate([squares[name] for _, squares in parts]))
        for name, index in groups.items()
    }
