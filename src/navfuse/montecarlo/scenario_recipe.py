"""Recipes from scenarios and from projects of your own: the filter is the one that ``navfuse run`` would make."""

from __future__ import annotations

import dataclasses
import os
import tomllib
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from navfuse.config import Project, load_project
from navfuse.data.logs import GnssLog, ImuLog
from navfuse.data.start import Start
from navfuse.errors import ConfigError, InputError
from navfuse.filters.settings import FilterSettings
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.gaps import gap_limit
from navfuse.imu.increments import to_increments
from navfuse.montecarlo.recipes import TRUTHFUL, Case, Recipe, Tampering
from navfuse.pipeline import builder_of, filter_settings, gnss_sensors, process, project_inputs, read_logs
from navfuse.scenario_files import project_tables
from navfuse.simulation import (
    Motion,
    SimulatedLogs,
    add_imu_errors,
    follow_track,
    noisy_fixes,
    perfect_imu,
)
from navfuse.simulation.scenario import Scenario, StartErrors, load_scenario
from navfuse.simulation.scenario_run import ScenarioTruth, run_scenario, scenario_truth, section_stream, told_start

Array = np.ndarray


@dataclass(frozen=True)
class ScenarioRecipe:
    """The runs of a scenario: everything drawn anew for every seed, along the same motion.

    The filter is that of the scenario's project file, and it always is told its start: with the errors that the
    scenario states, or 1, 1, 2 m, 0.05 m/s and 0.3, 0.3, 1 deg where it states none.

    Attributes
    ----------
    source : str
        Name or path of the scenario.
    changes : tuple of (section, key, value)
        Put in the place of the scenario's keys.
    frame : str or None
        ``"ned"`` or ``"ecef"``; None as the project says.
    smooth : bool
    tampering : Tampering

    Raises
    ------
    ConfigError
        On construction, as :func:`~navfuse.simulation.scenario.load_scenario`, and for a scenario without GNSS or with
        outages at random.
    """

    source: str
    changes: tuple[tuple[str, str, Any], ...] = ()
    frame: str | None = None
    smooth: bool = False
    tampering: Tampering = TRUTHFUL

    def __post_init__(self) -> None:
        scenario, project, _ = self._prepared()
        if scenario.gnss is not None and scenario.gnss.outage_frequency > 0.0:
            raise ConfigError(
                f"{self.source}: [gnss] outages_per_h takes other fixes from every run, and only runs with fixes at "
                "the same times can be averaged; list the outages in outages_s instead"
            )
        if self.frame not in (None, "ned", "ecef"):
            raise ConfigError(f"frame must be 'ned' or 'ecef', not {self.frame!r}")
        if project.gnss.file is None:
            raise ConfigError(f"{self.source}: without [gnss] there are no measurements to judge the filter by")

    def __call__(self, seed: int) -> Case:
        """The run of a seed."""
        scenario, project, truth = self._prepared()
        logs = run_scenario(scenario, seed, truth=truth, aiding=False)
        first = logs.imu.time[0] + project.imu.time_offset_s
        start = logs.start or told_start(truth.motion, first, StartErrors(), seed)
        simulated = SimulatedLogs(
            _shifted(logs.imu, project.imu.time_offset_s),
            _shifted(logs.gnss, project.gnss.time_offset_s),
            truth.trajectory,
            replace(logs.imu_truth.states, time=logs.imu_truth.states.time + project.imu.time_offset_s),
            truth.motion,
        )
        whole = logs.imu.time.size == truth.ideal_imu.time.size
        return _case(self, simulated, start, project, whole)

    @property
    def inputs(self) -> tuple[Path, ...]:
        """Files that the scenario is made of."""
        return self._prepared()[0].inputs

    @property
    def duration(self) -> float:
        """Length of a run [s]."""
        motion = self._prepared()[2].motion
        return motion.end - motion.start

    def settings(self) -> dict[str, Any]:
        """For the summary."""
        return {
            "scenario": self.source,
            "changes": [list(change) for change in self.changes],
            "frame": self.frame or self._prepared()[1].filter.frame,
            "smooth": self.smooth,
            **dataclasses.asdict(self.tampering),
        }

    def _prepared(self) -> tuple[Scenario, Project, ScenarioTruth]:
        return _scenario(self.source, self.changes)


@dataclass(frozen=True)
class ProjectRecipe:
    """Runs along the solution of a project of your own: is its filter consistent on this drive?

    The solution of the project (smoothed, where it smooths) is taken for the truth. Along it the inertial sensor is
    simulated with the error model of the project at the stamps of its log, and the fixes with the sigmas of their log,
    white. What the filter gets wrong about the real sensors does not show; what it gets wrong about this motion does.

    Attributes
    ----------
    path : str
        Of the project file.
    frame, smooth, tampering : see :class:`ScenarioRecipe`.

    Raises
    ------
    ConfigError, InputError, AlignmentError, FilterError
        On construction, as :func:`navfuse.process`, and where the solution has gaps.
    """

    path: str
    frame: str | None = None
    smooth: bool = False
    tampering: Tampering = TRUTHFUL

    def __post_init__(self) -> None:
        _project(self.path)

    def __call__(self, seed: int) -> Case:
        """The run of a seed."""
        project, motion, ideal, fixes = _project(self.path)
        model = project.imu_error_model()
        imu, imu_errors = add_imu_errors(ideal, model, section_stream(seed, "imu"))
        gnss = noisy_fixes(motion, fixes, project.gnss.lever_arm_m, section_stream(seed, "gnss"))
        start = told_start(motion, imu.time[0], StartErrors(), seed)
        simulated = SimulatedLogs(imu, gnss, motion.trajectory(fixes.time), imu_errors, motion)
        return _case(self, simulated, start, project, True)

    @property
    def inputs(self) -> list[Path]:
        """The project file and its logs."""
        return project_inputs(_project(self.path)[0], self.path)

    @property
    def duration(self) -> float:
        """Length of a run [s]."""
        motion = _project(self.path)[1]
        return motion.end - motion.start

    def settings(self) -> dict[str, Any]:
        """For the summary."""
        return {
            "project": self.path,
            "frame": self.frame or _project(self.path)[0].filter.frame,
            "smooth": self.smooth,
            **dataclasses.asdict(self.tampering),
        }


def recipe_from(
    source: str | os.PathLike[str],
    *,
    changes: tuple[tuple[str, str, Any], ...] = (),
    frame: str | None = None,
    smooth: bool = False,
    tampering: Tampering = TRUTHFUL,
) -> Recipe:
    """The recipe of a scenario or of a project file, whichever it is.

    Parameters
    ----------
    source : str or path-like
        Name of a scenario, path of a scenario file, or path of a project file.
    changes, frame, smooth, tampering : see :class:`ScenarioRecipe`
        A project takes no changes.

    Raises
    ------
    ConfigError, InputError, AlignmentError, FilterError
        As the recipes.
    """
    name = os.fspath(source)
    if _is_project(Path(name)):
        if changes:
            keys = ", ".join(f"[{section}] {key}" if section else key for section, key, _ in changes)
            raise ConfigError(f"{name} is a project: {keys} cannot be changed from outside; change the project file")
        return ProjectRecipe(name, frame, smooth, tampering)
    return ScenarioRecipe(name, changes, frame, smooth, tampering)


def _is_project(path: Path) -> bool:
    """Whether a file is a project rather than a scenario: no motion, and an IMU with a file."""
    if path.suffix.lower() != ".toml":
        return False
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return False
    imu = data.get("imu")
    return "motion" not in data and isinstance(imu, dict) and "file" in imu


@lru_cache(maxsize=4)
def _told(recipe: ScenarioRecipe | ProjectRecipe) -> tuple[ImuErrorModel, FilterSettings]:
    """Error model and settings of the filter for logs of which no sample is lost, made once per process."""
    if isinstance(recipe, ScenarioRecipe):
        _, project, truth = _scenario(recipe.source, recipe.changes)
        ideal = truth.ideal_imu
    else:
        project, _, ideal, _ = _project(recipe.path)
    return recipe.tampering.imu(project.imu_error_model()), _settings(project, ideal, recipe.frame)


def _case(
    recipe: ScenarioRecipe | ProjectRecipe, logs: SimulatedLogs, start: Start, project: Project, whole: bool
) -> Case:
    model, settings = _told(recipe)
    if not whole:
        settings = _settings(project, logs.imu, recipe.frame)
    sensors = tuple(gnss_sensors(project, recipe.tampering.gnss(logs.gnss)))
    builder_of(project.filter.estimator)
    return Case(logs, start, model, sensors, settings, recipe.smooth, project.filter.estimator)


def _settings(project: Project, imu: ImuLog, frame: str | None) -> FilterSettings:
    limit = gap_limit(imu.time)
    settings = filter_settings(project, limit, to_increments(imu, limit))
    ecef = settings.ecef if frame is None else frame == "ecef"
    return replace(settings, ecef=ecef, checkpoints=True, output_period=-1.0)


def _shifted(log: Any, offset: float) -> Any:
    return log if log is None or offset == 0.0 else replace(log, time=log.time + offset)


@lru_cache(maxsize=2)
def _scenario(source: str, changes: tuple[tuple[str, str, Any], ...]) -> tuple[Scenario, Project, ScenarioTruth]:
    """What all runs of a scenario share, made once per process."""
    tables: dict[str, dict[str, Any]] = {}
    for section, key, value in changes:
        tables.setdefault(section, {})[key] = value
    scenario = load_scenario(source, tables)
    return scenario, Project.from_dict(project_tables(scenario), source=source), scenario_truth(scenario)


@lru_cache(maxsize=2)
def _project(path: str) -> tuple[Project, Motion, ImuLog, GnssLog]:
    """Settings, motion, perfect IMU log and the times and sigmas of the fixes of a project, made once per process."""
    project = load_project(path)
    imu, fixes = read_logs(project)
    if fixes is None:
        raise ConfigError(f"{path}: without [gnss] file there are no measurements to judge the filter by")
    solution = process(project).trajectory
    try:
        motion = follow_track(solution)
    except InputError as error:
        raise InputError(f"{path}: the solution of the project cannot be made a motion: {error}") from error
    inside = (imu.time >= motion.start) & (imu.time <= motion.end)
    fixes = fixes.take((fixes.time >= motion.start) & (fixes.time <= motion.end))
    return project, motion, perfect_imu(motion, imu.time[inside], imu.kind), fixes
