"""Trajectories to files of other programs: ``navfuse.export``, and what ``navfuse run`` writes of its ``formats``."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from navfuse.analysis.export_track import Point, export_track
from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.errors import ConfigError, InputError
from navfuse.io.atomic import atomic_folder, refuse_to_replace
from navfuse.io.events_table import read_events
from navfuse.io.exports import EXTENSIONS, known_formats, write_track
from navfuse.io.result_folder import FORMATS, TABLES, read_result
from navfuse.io.rtklib_pos import parse_rtklib_track
from navfuse.io.trajectory_table import read_trajectory

Source = Result | Trajectory | str | os.PathLike[str]


def export(
    source: Source,
    folder: str | os.PathLike[str] | None = None,
    formats: str | Sequence[str] = ("kml",),
    *,
    solution: Literal["best", "smoothed", "forward"] = "best",
    point: Point = "imu",
    rate_hz: float | None = None,
    at: str | os.PathLike[str] | Sequence[float] | np.ndarray | None = None,
    labels: Sequence[str] | np.ndarray | None = None,
    height: Literal["ellipsoid", "geoid"] = "ellipsoid",
    geoid: str = "egm96",
    epoch: GpsEpoch | Sequence[float] | None = None,
    name: str | None = None,
) -> list[Path]:
    """Write a trajectory in the formats of other programs.

    Parameters
    ----------
    source : Result, Trajectory, or path-like
        The folder of a run, or the file of a trajectory.
    folder : path-like, optional
        Where to write; made if it is not there. Default: ``exports`` in the folder of the run, or beside the file.
    formats : str or sequence of str
        Keys of :data:`navfuse.io.exports.EXTENSIONS`.
    at : path-like or (n,) array-like [s], optional
        A table of events (:func:`navfuse.io.events_table.read_events`), or their log times.
    epoch : GpsEpoch or (week, seconds), optional
        GPS time from which the times count; default that of the run, or of a ``.pos`` file.
    name : str, optional
        Of the track; default that of the folder of the run, or of the file.
    solution, point, rate_hz, labels, height, geoid
        See :func:`navfuse.analysis.export_track.export_track`.

    Returns
    -------
    list of Path
        The files: ``smoothed.kml``, ``forward.gpx``, ... after the solution or the file they come from, and
        ``smoothed-events.kml`` of events. They appear together or not at all.

    Raises
    ------
    ConfigError
        If a setting makes no sense, or a format with dates is asked for and nobody says to which the times belong.
    InputError
        If the source or the events cannot be used, or lack what a format needs.
    OutputError
        If the files cannot be written.

    Warns
    -----
    NavfuseWarning
        For events that are left out, and for files without times.
    """
    names = known_formats((formats,) if isinstance(formats, str) else tuple(formats))
    start = GpsEpoch.of(*epoch) if epoch is not None else None
    found, stem, home = _opened(source, solution)
    if folder is None:
        if home is None:
            raise ConfigError("folder: say where to write what is no file itself")
        folder = home / "exports"
    if start is None:
        start = found.epoch if isinstance(found, Result) else _date_of(source)
    if isinstance(at, str | os.PathLike):
        events = read_events(at, start)
        read = [Path(at)]
        at, labels = events.time, events.labels if labels is None else labels
    else:
        read = []
    track = export_track(
        found,
        solution=solution,
        point=point,
        rate_hz=rate_hz,
        at=at,
        labels=labels,
        height=height,
        geoid=geoid,
        epoch=start,
        name=name or (home.absolute().name if home is not None and isinstance(found, Result) else stem),
    )
    stem = stem if at is None else f"{stem}-events"
    files = {format_: f"{stem}{EXTENSIONS[format_]}" for format_ in names}
    if not isinstance(source, Result | Trajectory):
        read += _tables(Path(source)) if Path(source).is_dir() else [Path(source)]
    refuse_to_replace(read, folder, files.values())
    with atomic_folder(folder) as staging:
        for format_, file in files.items():
            write_track(format_, staging / file, track)
    return [Path(folder) / file for file in files.values()]


def export_result(
    staging: Path,
    result: Result,
    formats: Sequence[str],
    *,
    point: Point,
    height: Literal["ellipsoid", "geoid"],
    geoid: str,
    rate_hz: float | None,
    name: str,
) -> dict[str, str]:
    """Write the best trajectory of a run into its folder, in the formats that are not tables of navfuse.

    Returns
    -------
    dict of str to str
        The formats that could not be written, and why: not a reason to lose the run.
    """
    refused: dict[str, str] = {}
    stem = "forward" if result.smoothed is None else "smoothed"
    try:
        track = export_track(result, point=point, height=height, geoid=geoid, rate_hz=rate_hz, name=name)
    except (ConfigError, InputError) as error:
        return dict.fromkeys(formats, str(error))
    for format_ in formats:
        try:
            write_track(format_, staging / f"{stem}{EXTENSIONS[format_]}", track)
        except (ConfigError, InputError) as error:
            refused[format_] = str(error)
    return refused


def _tables(folder: Path) -> list[Path]:
    """The tables of a run that are there."""
    return [path for name in TABLES for format_ in FORMATS if (path := folder / f"{name}.{format_}").exists()]


def _date_of(source: Source) -> GpsEpoch | None:
    """GPS time from which the times of a trajectory count, where its file says so: a ``.pos`` of RTKLIB."""
    if isinstance(source, Result | Trajectory) or Path(source).suffix.lower() != ".pos":
        return None
    return parse_rtklib_track(Path(source)).epoch


def _opened(source: Source, solution: str) -> tuple[Result | Trajectory, str, Path | None]:
    """What is exported, the stem of the files' names, and the folder it came from."""
    home = None
    if not isinstance(source, Result | Trajectory):
        path = Path(source)
        home = path if path.is_dir() else path.parent
        if not path.is_dir():
            return read_trajectory(path), path.stem, home
        source = read_result(path)
    if isinstance(source, Trajectory):
        return source, "trajectory", home
    return source, "forward" if solution == "forward" or source.smoothed is None else "smoothed", home
