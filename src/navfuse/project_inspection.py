"""Logs and project files to findings: what ``navfuse inspect`` does."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from navfuse.config import DeadReckoningProject, Project, any_project
from navfuse.errors import ConfigError
from navfuse.inspection.declared import NOTHING, Declared
from navfuse.inspection.findings import Inspection
from navfuse.inspection.inspect import inspect as inspect_logs

Path_ = str | os.PathLike[str]


def inspect(files: Path_ | Iterable[Path_]) -> Inspection:
    """Find out what files are, and whether they can be what they say, before anything is estimated.

    Parameters
    ----------
    files : path-like or iterable of them
        Logs of one drive: inertial, GNSS, reference, other sensors; what each is, is found out. A project file
        (``.toml``) stands for its logs, whose settings are then checked against them.

    Returns
    -------
    Inspection
        A finding for every check, with a verdict. Nothing is raised for what is wrong in a log.

    Raises
    ------
    ConfigError
        If a project file is not usable or is one with ``[dead_reckoning]``, or two are given.
    InputError
        If there is nothing to inspect.
    """
    paths = [Path(files)] if isinstance(files, str | os.PathLike) else [Path(file) for file in files]
    projects = [path for path in paths if path.suffix.lower() == ".toml"]
    if len(projects) > 1:
        raise ConfigError(f"{projects[1]}: a second project file; inspect one at a time")
    if not projects:
        return inspect_logs(paths)
    project = any_project(projects[0])
    if isinstance(project, DeadReckoningProject):
        # What a project declares is held against an inertial log; here is none.
        drive = project.dead_reckoning
        logs = [str(file) for file in (drive.file, drive.heading_file, project.gnss.file) if file is not None]
        raise ConfigError(
            f"{projects[0]}: a project with [dead_reckoning]; inspect takes its logs one by one: navfuse inspect "
            + " ".join(logs)
        )
    logs = [file for file in (project.imu.file, project.gnss.file) if file is not None]
    return inspect_logs([*logs, *(path for path in paths if path is not projects[0])], declared=declared_by(project))


def declared_by(project: Project) -> Declared:
    """What a project says about its logs."""
    if project.gnss.file is None:
        arm = NOTHING.lever_arm
    else:
        arm = np.array(project.gnss.lever_arm_m)
    return Declared(
        stated=True,
        explicit=frozenset(
            f"{name}.{key}"
            for name, part in (("imu", project.imu), ("gnss", project.gnss))
            for key in part.model_fields_set
        ),
        axes=project.imu.axes,
        rotation=None if project.imu.rotation is None else np.array(project.imu.rotation),
        imu_time_offset=project.imu.time_offset_s,
        gnss_time_offset=project.gnss.time_offset_s,
        epoch=project.gnss.epoch_week_s,
        lever_arm=arm,
    )
