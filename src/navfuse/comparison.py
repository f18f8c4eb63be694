"""The same project with several estimators: same logs, start, settings and sensors, another filter each time."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navfuse.analysis.consistency import nis_summary
from navfuse.analysis.event_nees import events_to_smooth, nees_at_events, smoothed_nees_at_events
from navfuse.analysis.filter_comparison import (
    EstimatorRun,
    FilterComparison,
    Solution,
    compare_solution,
)
from navfuse.analysis.interpolation import earth_states, ned_axes
from navfuse.core.earth import ecef_to_geodetic_batch
from navfuse.core.rotation import quat_from_euler_batch
from navfuse.data.logs import GnssLog
from navfuse.data.trajectory import Trajectory
from navfuse.errors import ConfigError, InputError, NavfuseError, NavfuseWarning
from navfuse.filters.kinds import FILTERS
from navfuse.filters.record import FilterRecord
from navfuse.io.trajectory_table import read_trajectory
from navfuse.pipeline import (
    Clock,
    Prepared,
    Progress,
    as_project,
    builder_of,
    collected_warnings,
    prepare,
    project_inputs,
    result_of,
    run_stretch,
    silent,
)

if TYPE_CHECKING:
    from navfuse.config import Project

Array = np.ndarray

USUAL = ("ekf", "iekf", "ukf", "ckf")
"""Estimators that keep the states and the sensors of a project. Where one refuses it, the others are compared."""

WARM_UP_S, WARM_UP_SAMPLES = 30.0, 50
"""Each filter first runs over so much of the log, at least so many samples, that nothing has to be loaded later."""
TIMED_RUNS, TIMED_S = 3, 2.0
"""A filter is timed at most so often, and not again once its runs took so long."""
TRUTH_FILES = ("truth.parquet", "truth.csv")
"""Looked for beside a project file."""
OUTPUT_NAMES = ("comparison.html", "comparison.png", "comparison.json")


def compare_filters(
    project: Project | Mapping[str, Any] | str | os.PathLike[str],
    estimators: Sequence[str] | None = None,
    truth: Trajectory | str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> FilterComparison:
    """Run a project with each of several estimators and compare what they make of it.

    Logs are read and the start is found once. Whatever ``[filter] estimator`` says, the estimators asked for are run;
    all other settings of the project apply to each.

    Parameters
    ----------
    project : Project, mapping or path
        A project, the same as nested dictionaries, or the path of a project file. It needs a GNSS log.
    estimators : sequence of str, optional
        Keys of :data:`navfuse.filters.kinds.FILTERS`; default :data:`USUAL`.
    truth : Trajectory or path, optional
        Of the IMU. Default ``truth.parquet`` or ``truth.csv`` beside the project file. Without any, the solutions are
        compared with the GNSS fixes, those of ``gnss.outages_s`` too: differences, not errors.
    progress : callable, optional
        Called with the name of an estimator and the fraction of it done.

    Returns
    -------
    FilterComparison

    Raises
    ------
    ConfigError
        For an unknown estimator, one named twice, none at all, or a project without GNSS.
    InputError
        If the truth cannot be read or does not overlap the logs, or as :func:`navfuse.process`.
    AlignmentError, FilterError
        As :func:`navfuse.process`; the message begins with the estimator.

    Notes
    -----
    The time of a filter is that of its own run over the whole log, after a run over the beginning that loads and
    compiles what it needs, and the fastest of three where that takes no more than some seconds; smoother, reading and
    alignment are not in it. Where the start is rough it is improved, for
    all of them, with the extended filter.
    """
    names = _checked(USUAL if estimators is None else tuple(estimators))
    settings = as_project(project)
    if settings.gnss.file is None:
        raise ConfigError(
            "gnss.file is missing: without measurements all estimators integrate the same inertial data; give a GNSS"
            " log"
        )
    known = truth if isinstance(truth, Trajectory) else _truth(project, truth)
    with collected_warnings():
        prepared = prepare(settings, (), Clock())
        if known is not None:
            _check_overlap(known, prepared)
            stretches = (replace(s, settings=replace(s.settings, checkpoints=True)) for s in prepared.stretches)
            prepared = replace(prepared, stretches=tuple(stretches))
        reference = known or _fixes(prepared.gnss, settings)
        runs: list[EstimatorRun] = []
        refusals: list[str] = []
        for name in names:
            try:
                runs.append(_run(name, settings, prepared, reference, known is not None, progress or silent))
            except NavfuseError as error:
                if estimators is None and isinstance(error, ConfigError) and len(names) > 1:
                    refusals.append(f"{name} is left out: {error}")
                    continue
                raise type(error)(f"{name}: {error}") from error
    if not runs:
        raise ConfigError("; ".join(refusals))
    for refusal in refusals:
        warnings.warn(refusal, NavfuseWarning, stacklevel=2)
    source = str(project) if isinstance(project, str | os.PathLike) else "project"
    return FilterComparison(source, reference, known is not None, tuple(runs))


def run_comparison(
    path: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    estimators: Sequence[str] | None = None,
    truth: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> FilterComparison:
    """Compare estimators and write ``comparison.json``, ``comparison.png`` and ``comparison.html``, all or nothing.

    Parameters and errors as for :func:`compare_filters`, and

    Raises
    ------
    OutputError
        If the folder cannot be written; found out before the work begins.
    ConfigError
        If an input would be replaced.
    """
    from navfuse.io.atomic import atomic_folder, refuse_to_replace
    from navfuse.io.json_file import write_json
    from navfuse.report.comparison_figure import write_figure
    from navfuse.report.comparison_page import write_page

    _checked(USUAL if estimators is None else tuple(estimators))
    inputs = project_inputs(as_project(path), path) + ([] if truth is None else [Path(truth)])
    refuse_to_replace(inputs, folder, OUTPUT_NAMES)
    with atomic_folder(folder) as staging:
        found = compare_filters(path, estimators, truth, progress)
        write_page(staging / OUTPUT_NAMES[0], found)
        write_figure(staging / OUTPUT_NAMES[1], found)
        write_json(staging / OUTPUT_NAMES[2], found.to_dict())
    return found


def _checked(names: tuple[str, ...]) -> tuple[str, ...]:
    if not names:
        raise ConfigError(f"no estimator is named; known are {', '.join(FILTERS)}")
    for name in names:
        builder_of(name)
        if names.count(name) > 1:
            raise ConfigError(f'the estimator "{name}" is named {names.count(name)} times; once is enough')
    return names


def _truth(
    project: Project | Mapping[str, Any] | str | os.PathLike[str], truth: str | os.PathLike[str] | None
) -> Trajectory | None:
    if truth is not None:
        return read_trajectory(truth)
    if not isinstance(project, str | os.PathLike):
        return None
    beside = (Path(project).parent / name for name in TRUTH_FILES)
    return next((read_trajectory(file) for file in beside if file.is_file()), None)


def _check_overlap(truth: Trajectory, prepared: Prepared) -> None:
    start, end = prepared.stretches[0].increments.time[0], prepared.stretches[-1].increments.time[-1]
    if not np.any((truth.time >= start) & (truth.time <= end)):
        raise InputError(
            f"{truth.source} goes from {truth.time[0]:.3f} s to {truth.time[-1]:.3f} s and has no epoch in common with"
            f" the logs, {start:.3f} s to {end:.3f} s; are both on the same time scale?"
        )


def _run(
    name: str, project: Project, prepared: Prepared, reference: Trajectory, against_truth: bool, tell: Progress
) -> EstimatorRun:
    build, clock, model = builder_of(name), Clock(), prepared.model
    smoothing = project.smoother.method == "rts"
    share = 0.5 if smoothing else 1.0
    first = prepared.stretches[0]
    time = first.increments.time
    begin = first.increments.piece(0, max(WARM_UP_SAMPLES, int(np.searchsorted(time, time[0] + WARM_UP_S))))
    run_stretch(replace(first, increments=begin), model, build, smoothing, Clock(), silent)

    def told(stage: str, fraction: float) -> None:
        tell(name, share * fraction + (share if stage == "smoother" else 0.0))

    def events(record: FilterRecord) -> list[int]:
        return events_to_smooth(record, reference).tolist() if against_truth else []

    runs = [run_stretch(stretch, model, build, smoothing, clock, told, events) for stretch in prepared.stretches]
    seconds = [clock.seconds["filter"]]
    while len(seconds) < TIMED_RUNS and sum(seconds) < TIMED_S:
        again = Clock()
        for stretch in prepared.stretches:
            run_stretch(stretch, model, build, False, again, silent)
        seconds.append(again.seconds["filter"])
    result = result_of(project, prepared.gnss, runs)
    notes = tuple(dict.fromkeys(note for run in runs for note in run.filter.record.notes))
    for note in notes:
        warnings.warn(f"{name}: {note}", NavfuseWarning, stacklevel=2)
    estimator = runs[0].filter
    nees, smoothed_nees = {}, {}
    if against_truth:
        records, ecef = [run.filter.record for run in runs], estimator.settings.ecef
        nees = nees_at_events(records, reference, ecef, estimator.settings.open_loop)
        if smoothing:
            smoothed = [run.smoothed for run in runs if run.smoothed is not None]
            smoothed_nees = smoothed_nees_at_events(records, smoothed, reference, ecef)

    def compared(trajectory: Trajectory | None) -> Solution | None:
        if trajectory is None:
            return None
        lever = np.zeros(3) if against_truth else np.array(project.gnss.lever_arm_m)
        return compare_solution(at_lever(trajectory, lever), reference)

    forward = compared(result.forward)
    assert forward is not None
    return EstimatorRun(
        estimator=name,
        states=estimator.layout.size,
        forward=forward,
        smoothed=compared(result.smoothed),
        nees=nees,
        smoothed_nees=smoothed_nees,
        nis=nis_summary(result.innovations, project.gnss.outages_s),
        seconds=min(seconds),
        samples=sum(len(stretch.increments) for stretch in prepared.stretches),
        notes=notes,
    )


def _fixes(gnss: GnssLog | None, project: Project) -> Trajectory:
    """The fixes as a reference. Their velocity is that of the antenna, so that it serves without a lever arm only."""
    assert gnss is not None
    velocity = None if any(project.gnss.lever_arm_m) else gnss.velocity_n
    return Trajectory(gnss.time, gnss.lat, gnss.lon, gnss.height, velocity, source=gnss.source)


def at_lever(trajectory: Trajectory, lever_b: Array) -> Trajectory:
    """Positions of another point of the vehicle; velocity and the standard deviations stay those of the first.

    Parameters
    ----------
    trajectory : Trajectory
        With attitude.
    lever_b : (3,) array [m]
        From the one point to the other, body forward-right-down.
    """
    if not lever_b.any():
        return trajectory
    assert trajectory.attitude is not None
    q = quat_from_euler_batch(np.ascontiguousarray(trajectory.attitude))
    u = q[:, 1:]
    cross = np.cross(u, lever_b)
    lever_n = lever_b + 2.0 * (q[:, :1] * cross + np.cross(u, cross))
    C_en = ned_axes(trajectory.lat, trajectory.lon)
    r_e = earth_states(trajectory).r_e + np.einsum("nij,nj->ni", C_en, lever_n)
    lat, lon, height = ecef_to_geodetic_batch(r_e)
    return replace(trajectory, lat=lat, lon=lon, height=height)
