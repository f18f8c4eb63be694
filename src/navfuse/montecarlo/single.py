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
from navfuse.core.rotation import quat_from_euler_batch
from navfuse.data.layout import CROSS_PAIRS, Layout
from navfuse.data.result import Innovations
from navfuse.data.trajectory import Trajectory
from navfuse.errors import ConfigError
from navfuse.filters.ekf import ErrorStateFilter
from navfuse.filters.event import split
from navfuse.filters.record import Checkpoint, collect_innovations
from navfuse.imu.gaps import gap_limit
from navfuse.imu.increments import to_increments
from navfuse.montecarlo.recipes import Case
from navfuse.simulation import ImuErrorTruth, Motion, MotionState
from navfuse.smoothers.rts import SmoothedRun, smooth

Array = np.ndarray

SAME_TIME = 1e-6
"""Epochs closer than this [s] are one."""


@dataclass(frozen=True, slots=True, eq=False)
class RunRecord:
    """Errors of one run at its epochs: the moments at which the filter took in a measurement.

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
        The same of the smoother; NaN at epochs at which it puts out no trajectory.
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
    estimator = ErrorStateFilter(case.start, case.model, case.sensors, case.settings)
    estimator.feed(increments)
    record = estimator.record
    kept = _last_of_each_time(record.checkpoints)
    if kept.size < 2:
        raise ConfigError("the filter took in no measurement: without one a Monte Carlo run has no epochs")
    checkpoints = [record.checkpoints[k] for k in kept.tolist()]
    layout = record.layout
    components = components_of(layout)
    time = np.array([checkpoint.time for checkpoint in checkpoints])
    error, P, J = _errors(case, layout, checkpoints, time)
    values, sd = to_components(error, P, J)
    tested = np.isfinite(error[0]) & (np.diagonal(P, axis1=1, axis2=2) > 0.0).all(axis=0)
    groups = groups_of(components, tested)
    smoothed_error = smoothed_sd = None
    if case.smooth:
        back = smooth(estimator, increments)
        smoothed_error, smoothed_sd = _smoothed_errors(back, kept, time, case, layout)
    return RunRecord(
        seed,
        components,
        time,
        values,
        sd,
        nees_of_groups(error, P, groups),
        {name: index.size for name, index in groups.items()},
        collect_innovations([record]),
        smoothed_error,
        smoothed_sd,
        len(increments),
        perf_counter() - begin,
    )


def _last_of_each_time(checkpoints: list[Checkpoint]) -> Array:
    time = np.array([checkpoint.time for checkpoint in checkpoints])
    return np.flatnonzero(np.append(np.diff(time) > SAME_TIME, True))


def _errors(case: Case, layout: Layout, checkpoints: list[Checkpoint], time: Array) -> tuple[Array, Array, Array]:
    """Errors (m, n) in the frame of the filter, covariances (m, n, n), and J of :func:`navigation_errors`."""
    carried = np.array([checkpoint.carried for checkpoint in checkpoints])
    nav, s, x, P = split(carried)
    truth = _within(case.logs.motion, time)
    error = np.empty((time.size, layout.size))
    error[:, :9], J = navigation_errors(truth.r_e, truth.v_e, truth.q_eb, nav, case.settings.ecef)
    error[:, 9:] = sensor_truth(layout, case.logs.imu_errors, time) - s
    if case.settings.open_loop:
        error -= x
    return error, P, J


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


def _smoothed_errors(back: SmoothedRun, kept: Array, time: Array, case: Case, layout: Layout) -> tuple[Array, Array]:
    """Errors and deviations (m, n) of the smoother, component by component."""
    error, sd = np.full((time.size, layout.size), np.nan), np.full((time.size, layout.size), np.nan)
    error[:, 9:] = sensor_truth(layout, case.logs.imu_errors, time) - back.state_value[kept]
    sd[:, 9:] = back.state_sd[kept]
    out = back.trajectory
    if len(out):
        row = np.clip(np.searchsorted(out.time, time - SAME_TIME), 0, len(out) - 1)
        there = np.flatnonzero(np.abs(out.time[row] - time) <= SAME_TIME)
        picked = out.take(row[there])
        error[there, :9], sd[there, :9] = _trajectory_errors(picked, case.logs.motion, time[there])
    return error, sd


def _trajectory_errors(out: Trajectory, motion: Motion, time: Array) -> tuple[Array, Array]:
    """(m, 9) errors of position, velocity [n] and roll, pitch, heading, and their deviations."""
    truth = _within(motion, time)
    nav = np.empty((time.size, 10))
    nav[:, 0], nav[:, 1], nav[:, 2] = out.lat, out.lon, out.height
    nav[:, 3:6] = out.velocity_n
    nav[:, 6:10] = quat_from_euler_batch(out.attitude)
    error, J = navigation_errors(truth.r_e, truth.v_e, truth.q_eb, nav, False)
    sd = np.array([out.sd_position, out.sd_velocity, out.sd_attitude], dtype=float)
    return np.einsum("kij,kj->ki", J, error), np.moveaxis(sd, 0, 1).reshape(-1, 9)
