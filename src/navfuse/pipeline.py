"""Start here: from a project file to a result, one line per stage.

    read -> increments -> alignment -> filter (mechanization and aiding) -> smoother -> result -> report

:func:`process` is the whole of it as a function; :func:`run_project` writes the result folder that ``navfuse run``
promises.
"""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from navfuse.aiding.base import AidingSensor
from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity
from navfuse.analysis.plausibility import run_findings, silence
from navfuse.analysis.summary import describe_imu, summarize_run
from navfuse.config import DeadReckoningProject, Project, any_project, load_project
from navfuse.data.imu_overview import ImuOverview
from navfuse.data.logs import GnssLog, ImuLog
from navfuse.data.result import Result
from navfuse.data.start import Known
from navfuse.data.trajectory import Trajectory
from navfuse.errors import AlignmentError, ConfigError, FilterError, NavfuseWarning
from navfuse.filters.kinds import FILTERS
from navfuse.filters.navigation_filter import NavigationFilter
from navfuse.filters.record import FilterRecord, collect
from navfuse.filters.settings import FilterSettings
from navfuse.imu.alignment import Alignment, align
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.gaps import change_over, gap_limit, without_false_start
from navfuse.imu.increments import ImuIncrements, to_increments
from navfuse.imu.overview import imu_overview
from navfuse.imu.turning import check_turns
from navfuse.inspection.quick import quick_check
from navfuse.io.gnss_table import read_gnss
from navfuse.io.imu_table import read_imu
from navfuse.smoothers.rts import SmoothedRun, smooth
from navfuse.smoothers.start import improve_start

Array = np.ndarray
Progress = Callable[[str, float], None]

BLOCK_SAMPLES = 50_000
SILENT_GAP_S = 0.1
"""Inside a longer gap no epochs are put out."""


def process(
    config: Project | DeadReckoningProject | Mapping[str, Any] | str | os.PathLike[str],
    *,
    sensors: tuple[AidingSensor, ...] = (),
    progress: Progress | None = None,
) -> Result:
    """Process a project: logs in, trajectory out.

    Parameters
    ----------
    config : Project, DeadReckoningProject, mapping or path
        A project, the same as nested dictionaries, or the path of a project file. With ``[dead_reckoning]`` instead of
        ``[imu]`` see :mod:`navfuse.dead_reckoning_run`; `sensors` are not used then.
    sensors : tuple of AidingSensor
        Aiding sensors of your own, used beside those of the project.
    progress : callable, optional
        Called with the name of a stage and the fraction of it done.

    Returns
    -------
    Result

    Raises
    ------
    ConfigError, InputError, AlignmentError, FilterError
    """
    chosen = any_project(config)
    if isinstance(chosen, DeadReckoningProject):
        return _process_drive(chosen)
    project = chosen
    tell = progress or silent
    clock = Clock()
    build, smoothing = builder_of(project.filter.estimator), project.smoother.method == "rts"
    with collected_warnings() as caught:
        prepared = prepare(project, sensors, clock)
        length, gnss = prepared.length, prepared.gnss
        runs = [run_stretch(stretch, prepared.model, build, smoothing, clock, tell) for stretch in prepared.stretches]
        for run in runs:
            for note in (*run.alignment.notes, *run.filter.record.notes):
                _warn(note)
        _warn_of_gaps([gap for run in runs for gap in run.filter.record.gaps])
        result = replace(result_of(project, gnss, runs), imu=prepared.overview)
        if not len(result.forward):
            raise ConfigError(
                f"output.rate_hz = {project.output.rate_hz:g} puts out nothing in the {length:.1f} s of the log; give "
                "a larger one"
            )
        findings = run_findings(result, project.gnss.outages_s)
        for note in (*(one.text for one in findings), *silence(result, project.gnss.outages_s)):
            _warn(note)
    result = replace(result, warnings=tuple(dict.fromkeys(_texts(caught))))
    summary = summarize_run(
        result,
        settings=project.settings(),
        imu=prepared.imu,
        gnss=gnss,
        model=prepared.model,
        alignments=[run.alignment for run in runs],
        seconds=clock.seconds,
        contradicted=any(one.level == "bad" for one in findings),
        exclude=project.gnss.outages_s,
    )
    return replace(result, summary=summary)


def run_project(
    path: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    *,
    report: bool = True,
    progress: Progress | None = None,
) -> Result:
    """Process a project file and write the result folder.

    Writes the tables of :mod:`navfuse.io.result_folder` and the best trajectory for other programs
    (:mod:`navfuse.io.exports`) in the formats of ``[output] formats``, ``summary.json`` and, unless switched off,
    ``report.html``. They appear together or not at all.

    Raises
    ------
    OutputError
        If the folder cannot be written; found out before the work begins.
    ConfigError
        If a log of the project is a file that the run would replace.
    """
    from navfuse.io.atomic import atomic_folder, refuse_to_replace
    from navfuse.io.result_folder import RUN_NAMES, write_result

    project = any_project(path)
    refuse_to_replace(project_inputs(project, path), folder, RUN_NAMES)
    with atomic_folder(folder, stale=RUN_NAMES) as staging:
        result = process(project, progress=progress)
        result = _exported(staging, result, project, Path(path).stem)
        write_result(staging, result, project.output.tables)
        if report:
            from navfuse.report.page import write_report

            write_report(staging / "report.html", result, title=Path(path).stem)
    return result


def _exported(staging: Path, result: Result, project: Project | DeadReckoningProject, name: str) -> Result:
    """Write the formats of other programs; one that cannot be written costs a warning, not the run.

    Returns
    -------
    Result
        With those warnings.
    """
    from navfuse.export_files import export_result

    output = project.output
    if not output.exports:
        return result
    with collected_warnings() as caught:
        refused = export_result(
            staging,
            result,
            output.exports,
            point=output.export_point,
            height=output.export_height,
            geoid=output.export_geoid,
            rate_hz=output.export_rate_hz,
            name=name,
        )
        for format_, reason in refused.items():
            _warn(f'output.formats: "{format_}" is not written: {reason}')
    notes = tuple(dict.fromkeys((*result.warnings, *_texts(caught))))
    verdict = result.summary["verdict"] | {"warnings": len(notes)}
    return replace(result, warnings=notes, summary=result.summary | {"warnings": list(notes), "verdict": verdict})


def _process_drive(project: DeadReckoningProject) -> Result:
    from navfuse.dead_reckoning_run import process_drive

    with collected_warnings() as caught:
        result = process_drive(project)
    notes = tuple(dict.fromkeys(_texts(caught)))
    verdict = {**result.summary["verdict"], "warnings": len(notes)}
    return replace(result, warnings=notes, summary={**result.summary, "verdict": verdict, "warnings": list(notes)})


def project_inputs(project: Project | DeadReckoningProject, path: str | os.PathLike[str]) -> list[Path]:
    """The files that a project reads: its own and its logs."""
    if isinstance(project, DeadReckoningProject):
        from navfuse.dead_reckoning_run import inputs_of

        return inputs_of(project, Path(path))
    return [Path(path), *(file for file in (project.imu.file, project.gnss.file) if file is not None)]


def read_logs(project: Project) -> tuple[ImuLog, GnssLog | None]:
    """Read the logs of a project, with its axes, time offsets and sigmas applied."""
    imu = read_imu(
        project.imu.file, axes=project.imu.axes, rotation=project.imu.rotation, time_offset_s=project.imu.time_offset_s
    )
    settings = project.gnss
    if settings.file is None:
        return imu, None
    gnss = read_gnss(
        settings.file,
        time_offset_s=settings.time_offset_s,
        epoch=settings.epoch_week_s,
        sd_position_m=settings.sd_position_m,
        sd_velocity_mps=settings.sd_velocity_mps,
    )
    sd_position = np.maximum(gnss.sd_position * settings.sd_scale, settings.sd_floor_m)
    sd_velocity = None if gnss.sd_velocity is None else gnss.sd_velocity * settings.velocity_sd_scale
    return imu, replace(gnss, sd_position=sd_position, sd_velocity=sd_velocity)


def cut(increments: ImuIncrements, until_s: float | None) -> ImuIncrements:
    """Increments up to a time."""
    if until_s is None or until_s >= increments.time[-1]:
        return increments
    last = int(np.searchsorted(increments.time, until_s, side="right")) - 1
    if last < 1:
        raise FilterError(
            f"[filter] until_s = {until_s:g}: nothing is left of the inertial data, which begin at "
            f"{increments.time[0]:.3f} s"
        )
    return increments.piece(0, last)


def known_start(project: Project) -> Known:
    """What the project says about the start, in SI units."""
    s = project.start

    def scaled(value: Any, factor: Any = 1.0) -> Any:
        return None if value is None else np.multiply(value, factor)

    degrees = np.pi / 180.0
    position = None
    if s.lat_deg is not None and s.lon_deg is not None and s.height_m is not None:
        position = np.array([s.lat_deg * degrees, s.lon_deg * degrees, s.height_m])
    return Known(
        time=s.time_s,
        position=position,
        velocity_n=scaled(s.velocity_mps),
        roll=scaled(s.roll_deg, degrees),
        pitch=scaled(s.pitch_deg, degrees),
        heading=scaled(s.heading_deg, degrees),
        sd_position=scaled(s.sd_position_m),
        sd_velocity=scaled(s.sd_velocity_mps),
        sd_attitude=scaled(s.sd_attitude_deg, degrees),
    )


def gnss_sensors(project: Project, gnss: GnssLog | None) -> list[AidingSensor]:
    """The aiding sensors that the project makes of its GNSS log."""
    if gnss is None:
        return []
    settings = project.gnss
    lever = np.array(settings.lever_arm_m)
    sensors: list[AidingSensor] = []
    if settings.use == ("velocity",) and gnss.velocity_n is None:
        raise ConfigError(f'gnss.use = ["velocity"], but {gnss.source} has no velocities; use position')
    if "position" in settings.use:
        sensors.append(GnssPosition(gnss, lever, settings.outages_s, settings.gate_probability))
    if "velocity" in settings.use and gnss.velocity_n is not None and gnss.sd_velocity is not None:
        sensors.append(GnssVelocity(gnss, lever, settings.outages_s, settings.gate_probability))
    return sensors


def filter_settings(project: Project, gap_s: float, increments: ImuIncrements) -> FilterSettings:
    """Settings of the filter as the project says."""
    rate, output = project.filter.covariance_rate_hz, project.output.rate_hz
    default = FilterSettings()
    longest = float(increments.dt.max())
    gap_gyro_sd, gap_accel_sd = default.gap_gyro_sd, default.gap_accel_sd
    if longest > gap_s:
        gap_gyro_sd, gap_accel_sd = change_over(increments, longest)
    return FilterSettings(
        ecef=project.filter.frame == "ecef",
        open_loop=project.filter.feedback == "open",
        covariance_period=default.covariance_period if rate is None else 1.0 / rate if rate > 0 else 0.0,
        output_period=1.0 / output if output > 0 else 0.0,
        gap_s=gap_s,
        gap_gyro_sd=gap_gyro_sd,
        gap_accel_sd=gap_accel_sd,
        checkpoints=project.smoother.method == "rts",
        alpha=project.filter.ukf_alpha,
        beta=default.beta if project.filter.ukf_beta is None else project.filter.ukf_beta,
        kappa=default.kappa if project.filter.ukf_kappa is None else project.filter.ukf_kappa,
    )


@dataclass(frozen=True)
class Stretch:
    """Inertial data without a long gap, aligned: all that a filter is given."""

    alignment: Alignment
    increments: ImuIncrements
    sensors: tuple[AidingSensor, ...]
    settings: FilterSettings


@dataclass(frozen=True)
class Prepared:
    """A project up to where a filter takes over.

    Attributes
    ----------
    gnss : GnssLog or None
    model : ImuErrorModel
    stretches : tuple of Stretch
        At least one.
    imu : dict
        What :func:`navfuse.analysis.summary.describe_imu` says.
    overview : ImuOverview
    length : float [s]
        Of the inertial data.
    """

    gnss: GnssLog | None
    model: ImuErrorModel
    stretches: tuple[Stretch, ...]
    imu: dict[str, Any]
    overview: ImuOverview
    length: float


@dataclass(frozen=True)
class Run:
    """What a filter, and a smoother, made of a stretch."""

    alignment: Alignment
    filter: NavigationFilter
    smoothed: SmoothedRun | None


def as_project(config: Project | Mapping[str, Any] | str | os.PathLike[str]) -> Project:
    """A project, given as one, as nested dictionaries, or as the path of its file."""
    if isinstance(config, Project):
        return config
    return Project.from_dict(config) if isinstance(config, Mapping) else load_project(config)


def builder_of(estimator: str) -> Callable[..., NavigationFilter]:
    """What builds the filter of a name.

    Raises
    ------
    ConfigError
        If there is none.
    """
    if estimator not in FILTERS:
        raise ConfigError(f'there is no estimator "{estimator}"; known are {", ".join(FILTERS)}')
    return FILTERS[estimator]


def prepare(project: Project, sensors: tuple[AidingSensor, ...], clock: Clock) -> Prepared:
    """Read the logs of a project, cut them at long gaps, and find the start of every stretch."""
    with clock("read"):
        imu, gnss = read_logs(project)
    _warn_of_idle_outages(gnss, project)
    with clock("inspection"):
        for note in quick_check(imu, gnss):
            _warn(note)
    with clock("increments"):
        increments = cut(to_increments(imu, gap_limit(imu.time)), project.filter.until_s)
        increments = without_false_start(increments)
        described, overview = describe_imu(imu), imu_overview(imu)
        del imu
        for note in check_turns(increments, gnss) if gnss is not None else ():
            _warn(note)
    model = project.imu_error_model()
    length = float(increments.time[-1] - increments.time[0])
    found = [
        _align_piece(piece, gnss, model, project, sensors, first=k == 0, clock=clock)
        for k, piece in enumerate(_pieces(increments, project))
    ]
    stretches = tuple(stretch for stretch in found if stretch is not None)
    if not stretches:
        raise AlignmentError("no stretch of the inertial data between gaps could be aligned; see the warnings")
    return Prepared(gnss, model, stretches, described, overview, length)


def _pieces(increments: ImuIncrements, project: Project) -> list[ImuIncrements]:
    """Stretches between gaps after which the navigation has to start anew."""
    step = np.diff(increments.time)
    usual = float(np.median(step))
    limit = max(project.imu.max_gap_s, 5.0 * usual)
    longest = int(np.argmax(step))
    if project.imu.on_gap == "stop" and step[longest] > limit:
        raise FilterError(
            f"no inertial data for {step[longest]:.3f} s after {increments.time[longest]:.3f} s, and imu.on_gap = "
            '"stop"; set imu.on_gap = "continue" or a larger imu.max_gap_s'
        )
    breaks = np.flatnonzero(step > limit)
    pieces, begin = [], 0
    for gap in [*breaks.tolist(), len(increments)]:
        if gap > begin:
            pieces.append(increments.piece(begin, gap))
        if gap < len(increments):
            _warn(
                f"no inertial data for {step[gap]:.3f} s after {increments.time[gap]:.3f} s: too long to bridge; "
                "navigation starts anew behind it"
            )
        begin = gap + 1
    return pieces


def _align_piece(
    increments: ImuIncrements,
    gnss: GnssLog | None,
    model: ImuErrorModel,
    project: Project,
    sensors: tuple[AidingSensor, ...],
    *,
    first: bool,
    clock: Clock,
) -> Stretch | None:
    try:
        with clock("alignment"):
            usable = _without_outages(gnss, project)
            alignment = align(
                increments,
                usable,
                model,
                np.array(project.gnss.lever_arm_m),
                known_start(project) if first else Known(),
            )
    except AlignmentError as error:
        if first:
            raise
        _warn(f"the stretch from {increments.time[0]:.3f} s to {increments.time[-1]:.3f} s is left out: {error}")
        return None
    begin = int(np.searchsorted(increments.time, alignment.start.time - 1e-6))
    increments = increments.piece(begin)
    gap_s = gap_limit(increments.time)
    settings = filter_settings(project, gap_s, increments)
    sources = (*gnss_sensors(project, gnss), *sensors)
    if not settings.open_loop:
        with clock("alignment"):
            alignment = improve_start(alignment, increments, model, sources, settings)
    return Stretch(alignment, increments, sources, settings)


def run_stretch(
    stretch: Stretch,
    model: ImuErrorModel,
    build: Callable[..., NavigationFilter],
    smoothing: bool,
    clock: Clock,
    tell: Progress,
    events: Callable[[FilterRecord], Sequence[int]] | None = None,
) -> Run:
    """Run a filter, and the smoother if it is wanted, over a stretch.

    `events` chooses the checkpoints at which the smoother is to keep the whole covariance.
    """
    increments = stretch.increments
    with clock("filter"):
        estimator = build(stretch.alignment.start, model, stretch.sensors, stretch.settings)
        for at in range(0, len(increments), BLOCK_SAMPLES):
            stop = min(at + BLOCK_SAMPLES, len(increments))
            estimator.feed(increments.piece(at, stop))
            tell("filter", stop / len(increments))
    smoothed = None
    if smoothing:
        with clock("smoother"):
            chosen = () if events is None else events(estimator.record)
            smoothed = smooth(estimator, increments, lambda fraction: tell("smoother", fraction), chosen)
    return Run(stretch.alignment, estimator, smoothed)


def _without_outages(gnss: GnssLog | None, project: Project) -> GnssLog | None:
    """The fixes that alignment may use: none from a withheld window."""
    if gnss is None or not project.gnss.outages_s:
        return gnss
    keep = np.ones(gnss.time.size, dtype=bool)
    for start, end in project.gnss.outages_s:
        keep &= (gnss.time < start) | (gnss.time >= end)
    if not keep.any():
        raise AlignmentError("gnss.outages_s withhold every fix; leave some for the filter")
    return gnss.take(keep)


def _warn_of_idle_outages(gnss: GnssLog | None, project: Project) -> None:
    """Windows without a fix, which are in another time scale more often than not."""
    if gnss is None:
        return
    for start, end in project.gnss.outages_s:
        if not np.any((gnss.time >= start) & (gnss.time < end)):
            _warn(
                f"gnss.outages_s: there is no fix to withhold from {start:g} s to {end:g} s; the fixes go from "
                f"{gnss.time[0]:.3f} s to {gnss.time[-1]:.3f} s"
            )


def result_of(project: Project, gnss: GnssLog | None, runs: list[Run]) -> Result:
    """Trajectories, innovations and states of the runs over all stretches, without warnings and summary."""
    forward, innovations, states = collect([run.filter.record for run in runs])
    gaps = [gap for run in runs for gap in run.filter.record.gaps]
    smoothed = None
    if project.smoother.method == "rts":
        smoothed = _joined([run.smoothed.trajectory for run in runs if run.smoothed is not None], "smoothed")
        smoothed = _outside_gaps(smoothed, gaps)
    forward = _outside_gaps(forward, gaps)
    return Result(
        forward=forward,
        smoothed=smoothed,
        innovations=innovations,
        states=states,
        fixes=gnss,
        epoch=None if gnss is None else gnss.epoch,
    )


def _outside_gaps(trajectory: Trajectory, gaps: list[tuple[float, float]]) -> Trajectory:
    """The trajectory without the epochs inside bridged gaps: nothing was measured there."""
    keep = np.ones(len(trajectory), dtype=bool)
    for start, length in gaps:
        if length > SILENT_GAP_S:
            keep &= (trajectory.time <= start + 1e-6) | (trajectory.time >= start + length - 1e-6)
    return trajectory if keep.all() else trajectory.take(keep)


def _warn_of_gaps(gaps: list[tuple[float, float]]) -> None:
    if gaps:
        start, longest = max(gaps, key=lambda gap: gap[1])
        _warn(
            f"inertial samples are missing in {len(gaps)} place{'s' * (len(gaps) > 1)}, "
            f"{sum(length for _, length in gaps):.3f} s in all, the longest {longest:.3f} s after {start:.3f} s: "
            "bridged with "
            "enlarged covariance"
        )


def _joined(trajectories: list[Trajectory], source: str) -> Trajectory:
    if len(trajectories) == 1:
        return trajectories[0]
    columns = [trajectory.to_columns() for trajectory in trajectories]
    return Trajectory.from_columns({name: np.concatenate([c[name] for c in columns]) for name in columns[0]}, source)


class Clock:
    """Seconds spent in each stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Add the time of the block to a stage."""
        start = time.perf_counter()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - start


@contextmanager
def collected_warnings() -> Iterator[list[warnings.WarningMessage]]:
    """Collect the text of every warning navfuse gives, each once, and pass all warnings on at the end.

    The caller's filters decide what becomes of them, as if they had been given then.
    """
    caught: list[warnings.WarningMessage] = []
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield caught
    finally:
        shown: set[str] = set()
        for entry in caught:
            if str(entry.message) not in shown:
                shown.add(str(entry.message))
                warnings.warn_explicit(entry.message, entry.category, entry.filename, entry.lineno)


def _texts(caught: list[warnings.WarningMessage]) -> list[str]:
    return [str(entry.message) for entry in caught if issubclass(entry.category, NavfuseWarning)]


def _warn(text: str) -> None:
    warnings.warn(text, NavfuseWarning, stacklevel=3)


def silent(stage: str, fraction: float) -> None:
    """No progress wanted."""
