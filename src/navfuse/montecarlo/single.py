"""One run of a Monte Carlo campaign: filter, smoother, and their errors against the truth."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from navfuse.analysis.nees import (
    Component,
    components_of,
    groups_of,
    navigation_errors,
    nees_of_groups,
    to_components,
)
from navfuse.core.kalman import reset_attitude
from navfuse.data.layout import CROSS_PAIRS, Layout
from navfuse.data.nav_state import boxplus_navigation
from navfuse.data.result import Innovations
from navfuse.errors import ConfigError
from navfuse.filters.event import split
from navfuse.filters.kinds import FILTERS
from navfuse.filters.record import Checkpoint, FilterRecord, collect_innovations
from navfuse.imu.gaps import gap_limit
from navfuse.imu.increments import to_increments
from navfuse.montecarlo.recipes import Case
from navfuse.simulation import ImuErrorTruth, Motion, MotionState
from navfuse.smoothers.rts import smooth

Array = np.ndarray

SAME_TIME = 1e-6
"""Epochs closer than this [s] are one."""
FOUND_SD = np.radians(3.0)
"""Of an attitude [rad] that was unknown and has been found."""
MOST_EPOCHS = 2500
"""Of a run that are judged, and measurements of a source that are kept, spread evenly over it."""


@dataclass(frozen=True, slots=True, eq=False)
class RunRecord:
    """Errors of one run at its epochs: moments at which the filter took in a measurement.

    Attributes
    ----------
    seed : int
    components : tuple of Component
    time : (m,) array [s]
    error, sd : (m, n) arrays [SI]
        Of every component, true minus estimate, after the measurement; NaN where there is no truth.
    nees : dict of str to (m,) array
        Of every group of states, the whole last.
    dof : dict of str to int
        Their degrees of freedom.
    innovations : Innovations
    smoothed_error, smoothed_sd : (m, n) arrays [SI] or None
    smoothed_nees : dict of str to (m,) array
        The same of the smoother; empty without one. NaN while the filter held its heading: the smoothed covariance
        leaves out what that did to the other states.
    samples : int
        IMU samples that the filter took in.
    seconds : float
        Time that the run took, simulation not included.
    """

    seed: int
    components: tuple[Component, ...]
    time: Array
    error: Array
    sd: Array
    nees: dict[str, Array]
    dof: dict[str, int]
    innovations: Innovations
    smoothed_error: Array | None
    smoothed_sd: Array | None
    smoothed_nees: dict[str, Array]
    samples: int
    seconds: float


def run_case(case: Case, seed: int = 0) -> RunRecord:
    """Run the filter, and the smoother if the case wants one, and compare with the truth.

    Parameters
    ----------
    case : Case
    seed : int
        Kept in the record.

    Returns
    -------
    RunRecord

    Raises
    ------
    ConfigError
        If the settings keep no checkpoints, or the run has no epoch but its start.
    FilterError, InputError
        If the filter cannot go on, or its covariance is not positive definite.

    Notes
    -----
    The full covariance comes from the checkpoints that the filter keeps after every event; the engine does nothing
    extra. In an open loop the error is that of the inertial solution less its estimate.
    """
    if not case.settings.checkpoints:
        raise ConfigError("a Monte Carlo run needs FilterSettings(checkpoints=True): they hold the covariances")
    begin = perf_counter()
    increments = to_increments(case.logs.imu, gap_limit(case.logs.imu.time))
    increments = increments.piece(int(np.searchsorted(increments.time, case.start.time - SAME_TIME)))
    estimator = FILTERS[case.estimator](case.start, case.model, case.sensors, case.settings)
    estimator.feed(increments)
    record = estimator.record
    kept = _epochs(record.checkpoints)
    if kept.size < 2:
        raise ConfigError("the filter took in no measurement: without one a Monte Carlo run has no epochs")
    layout = record.layout
    components = components_of(layout)
    time = np.array([record.checkpoints[k].time for k in kept.tolist()])
    nav, s, x, P = split(np.array([record.checkpoints[k].carried for k in kept.tolist()]))
    error, J = _errors(case, layout, time, nav, s)
    if case.settings.open_loop:
        error -= x
    values, sd = to_components(error, P, J)
    tested = np.isfinite(error[0]) & (np.diagonal(P, axis1=1, axis2=2) > 0.0).all(axis=0)
    groups = groups_of(components, tested)
    nees = nees_of_groups(error, P, groups)
    smoothed_error = smoothed_sd = None
    smoothed_nees: dict[str, Array] = {}
    if case.smooth:
        back = smooth(estimator, increments, events=kept.tolist())
        nav = nav.copy()
        for row in range(time.size):
            boxplus_navigation(nav[row], back.error[row], case.settings.ecef)
            reset_attitude(back.P[row], back.error[row, 6:9])
        error, J = _errors(case, layout, time, nav, s + back.error[:, 9:])
        smoothed_error, smoothed_sd = to_components(error, back.P, J)
        free = _behind_held_heading([record.checkpoints[k] for k in kept.tolist()])
        smoothed_nees = {name: np.full(time.size, np.nan) for name in groups}
        for name, values_ in nees_of_groups(error[free:], back.P[free:], groups).items():
            smoothed_nees[name][free:] = values_
    return RunRecord(
        seed,
        components,
        time,
        values,
        sd,
        nees,
        {name: index.size for name, index in groups.items()},
        _innovations(record),
        smoothed_error,
        smoothed_sd,
        smoothed_nees,
        len(increments),
        perf_counter() - begin,
    )


def _epochs(checkpoints: list[Checkpoint]) -> Array:
    """Numbers of the checkpoints that are judged: the last of each time, and no more than MOST_EPOCHS, evenly."""
    time = np.array([checkpoint.time for checkpoint in checkpoints])
    return _some(np.flatnonzero(np.append(np.diff(time) > SAME_TIME, True)))


def _some(index: Array) -> Array:
    """No more than MOST_EPOCHS of some indices, evenly, the first and the last among them."""
    if index.size <= MOST_EPOCHS:
        return index
    return index[np.linspace(0, index.size - 1, MOST_EPOCHS).round().astype(np.int64)]


def _behind_held_heading(checkpoints: list[Checkpoint]) -> int:
    """How many checkpoints there are up to the last at which the heading was held, and from there on until it was
    found: no smoother is linear over that.
    """
    first = max((k + 1 for k, checkpoint in enumerate(checkpoints) if checkpoint.held.any()), default=0)
    if first == 0:
        return 0
    known = (k for k in range(first, len(checkpoints)) if np.diagonal(checkpoints[k].P)[6:9].max() < FOUND_SD**2)
    return next(known, len(checkpoints))


def _innovations(record: FilterRecord) -> Innovations:
    """Measurements, of every source no more than MOST_EPOCHS."""
    found = collect_innovations([record])
    kept = [_some(np.flatnonzero(found.source == source)) for source in found.sources]
    return found if len(found) == sum(map(len, kept)) else found.select(np.sort(np.concatenate(kept)))


def _errors(case: Case, layout: Layout, time: Array, nav: Array, s: Array) -> tuple[Array, Array]:
    """Errors (m, n) in the frame of the filter of what it carries, and J of :func:`navigation_errors`."""
    truth = _within(case.logs.motion, time)
    error = np.empty((time.size, layout.size))
    error[:, :9], J = navigation_errors(truth.r_e, truth.v_e, truth.q_eb, nav, case.settings.ecef)
    error[:, 9:] = sensor_truth(layout, case.logs.imu_errors, time) - s
    return error, J


def _within(motion: Motion, time: Array) -> MotionState:
    return motion.at(np.clip(time, motion.start, motion.end))


def sensor_truth(layout: Layout, errors: ImuErrorTruth, time: Array) -> Array:
    """True values of the states after the ninth.

    Parameters
    ----------
    layout : Layout
    errors : ImuErrorTruth
    time : (m,) array [s]

    Returns
    -------
    (m, n - 9) array
        Of the IMU interval that ends at or after the time; NaN for states that `errors` does not know.
    """
    row = np.clip(np.searchsorted(errors.time, time - SAME_TIME), 0, errors.time.size - 1)
    truth = np.full((time.size, layout.size - 9), np.nan)
    for block in layout.blocks:
        if not hasattr(errors, block.name):
            continue
        values = getattr(errors, block.name)
        where = layout.slice(block.name)
        if block.name.endswith("_cross"):
            values = np.array([values[pair] for pair in CROSS_PAIRS])
        truth[:, where.start - 9 : where.stop - 9] = values[row] if values.ndim == 2 else values
    return truth
