"""The folder of a run, written and read back: trajectories, innovations, sensor states, fixes, the inertial overview.

=================  =========================================================================================
``forward``        the filter's trajectory, in every format asked for (Parquet, CSV)
``smoothed``       the smoother's, when there was one
``innovations``    every measurement and what became of it
``states``         sensor states: ``time_s``, then ``gyro_bias_x_dph``, ``sd_gyro_bias_x_dph``, ...
``fixes``          the GNSS fixes offered to the filter, as a native GNSS table with the log's time offset applied
``imu.json``       rate, gaps and spectra of the inertial log
``summary.json``   inputs, settings, counts, consistency, warnings
=================  =========================================================================================
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.data.gps_epoch import GpsEpoch
from navfuse.data.imu_overview import ImuOverview
from navfuse.data.result import COMPONENTS, Innovations, Result, StateHistory
from navfuse.errors import InputError, NavfuseWarning
from navfuse.io.exports import EXTENSIONS
from navfuse.io.gnss_table import read_gnss
from navfuse.io.json_file import write_json
from navfuse.io.log_tables import write_gnss
from navfuse.io.tables import open_table, write_table
from navfuse.io.trajectory_table import read_trajectory, write_trajectory

Array = np.ndarray

TABLES = ("forward", "smoothed", "innovations", "states", "fixes")
FORMATS = ("parquet", "csv")
"""Formats in which a run can write its tables."""
EXPORTS = tuple(name for name in EXTENSIONS if name not in FORMATS)
"""Formats of other programs, in which a run can write its best trajectory beside the tables."""
RUN_NAMES = tuple(
    [f"{name}.{format_}" for name in TABLES for format_ in FORMATS]
    + [f"{name}{EXTENSIONS[format_]}" for name in ("forward", "smoothed") for format_ in EXPORTS]
    + ["imu.json", "summary.json", "report.html"]
)
"""Every file that ``navfuse run`` may write."""

STATE_UNITS = {
    "gyro_bias": ("dph", 180.0 / np.pi * 3600.0),
    "accel_bias": ("mg", 1e3 / STANDARD_GRAVITY),
    "gyro_scale": ("ppm", 1e6),
    "accel_scale": ("ppm", 1e6),
    "gyro_cross": ("mrad", 1e3),
    "accel_cross": ("mrad", 1e3),
}
"""Block of sensor states -> unit in column names, and that unit per SI unit. Blocks of other sensors stay in SI."""

_STATE = re.compile(r"(?P<block>.+?)_(?P<axis>[xyz]|\d+)(_(?P<unit>dph|mg|ppm|mrad))?")


def write_result(folder: Path, result: Result, formats: tuple[str, ...] = ("parquet",)) -> None:
    """Write the tables and the summary of a result into a folder.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    for format_ in formats:
        write_trajectory(folder / f"forward.{format_}", result.forward)
        if result.smoothed is not None:
            write_trajectory(folder / f"smoothed.{format_}", result.smoothed)
        write_table(folder / f"innovations.{format_}", result.innovations.to_columns())
        if result.states:
            write_table(folder / f"states.{format_}", state_columns(result.states))
        if result.fixes is not None:
            write_gnss(folder / f"fixes.{format_}", result.fixes)
    if result.imu is not None:
        write_json(folder / "imu.json", _overview_to_dict(result.imu))
    write_json(folder / "summary.json", result.summary)


def read_result(folder: str | os.PathLike[str]) -> Result:
    """Read the folder of a run.

    Parameters
    ----------
    folder : path-like
        As ``navfuse run`` writes it. ``forward`` has to be there; what else is missing is missing in the result.

    Returns
    -------
    Result
        As :func:`navfuse.process` returned it, to the precision of the tables (CSV rounds).

    Raises
    ------
    InputError
        If it is not the folder of a run, or one of its files cannot be read.
    """
    folder = Path(folder)
    if not folder.is_dir():
        what = "is a file" if folder.exists() else "is not there"
        raise InputError(f"{folder}: {what}; give the folder that `navfuse run -o` wrote")
    found = {name: path for name in TABLES if (path := _table(folder, name)) is not None}
    if "forward" not in found:
        raise InputError(f"{folder}: no forward.parquet or forward.csv in this folder; is it that of a run?")
    summary = _read_json(folder / "summary.json")
    for name in ("settings", "verdict"):
        if not isinstance(summary.get(name, {}), dict):
            raise InputError(f"{folder / 'summary.json'}: {name} is no object; run the project again")
    epoch = _epoch(summary, folder / "summary.json")
    with warnings.catch_warnings():
        # Doubts about the fixes were told when the log itself was read.
        warnings.simplefilter("ignore", NavfuseWarning)
        fixes = read_gnss(found["fixes"], epoch=epoch) if "fixes" in found else None
    overview = _read_json(folder / "imu.json")
    measured = "innovations" in found and summary.get("measurements", True)
    return Result(
        forward=read_trajectory(found["forward"]),
        smoothed=read_trajectory(found["smoothed"]) if "smoothed" in found else None,
        innovations=_read_innovations(found["innovations"]) if measured else Innovations.empty(),
        states=_read_states(found["states"]) if "states" in found else {},
        summary=summary,
        warnings=_texts(summary, folder / "summary.json"),
        fixes=fixes,
        imu=_overview_from_dict(overview, folder / "imu.json") if overview else None,
        epoch=epoch,
    )


def state_columns(states: Mapping[str, StateHistory]) -> dict[str, Array]:
    """Columns of the states table: every time of any block, NaN where a block has none."""
    time = np.unique(np.concatenate([history.time for history in states.values()]))
    columns = {"time_s": time}
    for name, history in states.items():
        unit, factor = STATE_UNITS.get(name, ("", 1.0))
        size = history.values.shape[1]
        rows = np.searchsorted(time, history.time)
        for k in range(size):
            axis = "xyz"[k] if size == 3 else str(k + 1)
            column = f"{name}_{axis}" + (f"_{unit}" if unit else "")
            for prefix, values in (("", history.values), ("sd_", history.sd)):
                columns[prefix + column] = np.full(time.size, np.nan)
                columns[prefix + column][rows] = values[:, k] * factor
    return columns


def _table(folder: Path, name: str) -> Path | None:
    paths = (folder / f"{name}.{format_}" for format_ in FORMATS)
    return next((path for path in paths if path.is_file()), None)


def _epoch(summary: Mapping[str, Any], path: Path) -> GpsEpoch | None:
    found = summary.get("epoch_week_s")
    if found is None:
        return None
    if not isinstance(found, list) or len(found) != 2 or not all(type(value) in (int, float) for value in found):
        raise InputError(f"{path}: epoch_week_s has to be a GPS week and the seconds of it; run the project again")
    return GpsEpoch.of(*found)


def _texts(summary: Mapping[str, Any], path: Path) -> tuple[str, ...]:
    found = summary.get("warnings", [])
    if not isinstance(found, list) or not all(isinstance(text, str) for text in found):
        raise InputError(f"{path}: warnings has to be a list of texts; run the project again")
    return tuple(found)


def _read_innovations(path: Path) -> Innovations:
    table = open_table(path)
    texts = ("source", "status")
    wanted = tuple(Innovations.empty().to_columns())
    missing = [name for name in wanted if name not in table.names]
    if missing:
        raise InputError(f"{path}: not a table of innovations, it lacks {', '.join(missing)}; run the project again")
    values = table.read([name for name in wanted if name not in texts], texts)
    for name in ("dof", "row"):
        if not np.isfinite(values[name]).all():
            raise InputError(f"{path}: the column '{name}' holds values that are no numbers; run the project again")
    z, sd = (np.column_stack([values[f"{name}_{k + 1}"] for k in range(COMPONENTS)]) for name in ("z", "sd"))
    dof, row = (values[name].astype(np.int64) for name in ("dof", "row"))
    source, status = (np.asarray(values[name]).astype(np.str_) for name in ("source", "status"))
    return Innovations(values["time_s"], source, status, values["nis"], dof, z, sd, row)


def _read_states(path: Path) -> dict[str, StateHistory]:
    table = open_table(path)
    if "time_s" not in table.names:
        raise InputError(f"{path}: not a table of sensor states, it lacks time_s; run the project again")
    values = table.read(list(table.names))
    time = values["time_s"]
    blocks: dict[str, list[tuple[Array, Array]]] = {}
    for name in table.names:
        match = _STATE.fullmatch(name)
        if match is None or name.startswith("sd_"):
            continue
        if f"sd_{name}" not in values:
            raise InputError(f"{path}: column '{name}' has no 'sd_{name}' beside it")
        factor = STATE_UNITS.get(match["block"], ("", 1.0))[1]
        blocks.setdefault(match["block"], []).append((values[name] / factor, values[f"sd_{name}"] / factor))
    states = {}
    for block, pairs in blocks.items():
        value, sd = (np.column_stack(columns) for columns in zip(*pairs, strict=True))
        known = np.isfinite(value).all(axis=1)
        states[block] = StateHistory(time[known], value[known], sd[known])
    return states


def _overview_to_dict(overview: ImuOverview) -> dict[str, Any]:
    return {
        "time_s": overview.time,
        "rate_hz": overview.rate,
        "usual_rate_hz": overview.usual_rate,
        "gap_start_s": overview.gap_start,
        "gap_length_s": overview.gap_length,
        "frequency_hz": overview.frequency,
        "gyro_psd_rad2ps2phz": overview.gyro_psd,
        "accel_psd_m2ps4phz": overview.accel_psd,
    }


def _overview_from_dict(data: Mapping[str, Any], path: Path) -> ImuOverview:
    def array(name: str) -> Array:
        if name not in data:
            raise InputError(f"{path}: lacks {name}; run the project again")
        try:
            values = np.array(data[name], dtype=np.float64)
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(f"{path}: {name} has to hold numbers; run the project again") from error
        shape = shapes.get(name, (None,))
        if values.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, values.shape, strict=True)):
            if not values.size and len(shape) == 2:
                return np.empty((0, 3))
            raise InputError(f"{path}: {name} has the wrong shape {values.shape}; run the project again")
        return values

    shapes: dict[str, tuple[int | None, ...]] = {
        "usual_rate_hz": (),
        "gyro_psd_rad2ps2phz": (None, 3),
        "accel_psd_m2ps4phz": (None, 3),
    }
    return ImuOverview(
        time=array("time_s"),
        rate=array("rate_hz"),
        usual_rate=float(array("usual_rate_hz")),
        gap_start=array("gap_start_s"),
        gap_length=array("gap_length_s"),
        frequency=array("frequency_hz"),
        gyro_psd=array("gyro_psd_rad2ps2phz"),
        accel_psd=array("accel_psd_m2ps4phz"),
    )


def _read_json(path: Path) -> dict[str, Any]:
    import json

    if not path.is_file():
        return {}
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as JSON ({error}); run the project again") from error
    if not isinstance(found, dict):
        raise InputError(f"{path}: holds no object; run the project again")
    return found
