"""A scenario on disk: the logs of one run, their truth, and a project file that ``navfuse run`` takes as it stands."""

from __future__ import annotations

import os
from collections.abc import Callable
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np

from navfuse.config import Project
from navfuse.config.sections import ImuConfig
from navfuse.config.toml_text import toml_value
from navfuse.core.rotation import euler_from_quat
from navfuse.data.start import Start
from navfuse.data.trajectory import wrapped
from navfuse.errors import ConfigError, OutputError
from navfuse.imu.error_model import DATASHEET_UNITS
from navfuse.io.aiding_tables import write_aiding
from navfuse.io.atomic import atomic_folder, refuse_to_replace
from navfuse.io.log_tables import write_gnss, write_imu
from navfuse.io.tables import write_table
from navfuse.io.trajectory_table import write_trajectory
from navfuse.simulation.scenario import SENSORS, Scenario, load_scenario
from navfuse.simulation.scenario_run import ScenarioLogs, run_scenario

Progress = Callable[[str, float], None]

_NOUGHT = np.zeros(3)
_ANYWHERE = Start.from_parts(0.0, _NOUGHT, _NOUGHT, _NOUGHT, _NOUGHT, _NOUGHT, _NOUGHT)

UWB, ANCHORS_FILE = "uwb", "anchors.csv"
IMU_FILE, GNSS_FILE, TRUTH_FILE, PROJECT_FILE = "imu.parquet", "gnss.csv", "truth.parquet", "project.toml"
_MANIFEST = "# files of this simulation: "


def simulate_scenario(
    scenario: Scenario | str | os.PathLike[str],
    folder: str | os.PathLike[str],
    seed: int | None = None,
    *,
    progress: Progress | None = None,
) -> ScenarioLogs:
    """Simulate a scenario and write its logs, its truth and a project file.

    Parameters
    ----------
    scenario : Scenario, str or path-like
        The name of one in the package or the path of a scenario file.
    folder : path-like
        Gets ``imu.parquet``, ``gnss.csv``, a table for every other sensor, ``truth.parquet`` and ``project.toml``, all
        or nothing. What an earlier simulation wrote there goes, as its project file lists it; other files stay.
    seed : int, optional
        Default the scenario's own. The same seed gives the same bytes.
    progress : callable, optional
        Called with the name of a stage and the fraction of it done.

    Returns
    -------
    ScenarioLogs

    Raises
    ------
    ConfigError, InputError
        As :func:`~navfuse.simulation.scenario.load_scenario` and
        :func:`~navfuse.simulation.scenario_run.run_scenario`, and if the scenario's ``[project]`` is no valid project.
    OutputError
        If the folder cannot be written, or holds files of the same names that no simulation wrote; found out before the
        work begins.
    """
    tell = progress or _silent
    chosen = scenario if isinstance(scenario, Scenario) else load_scenario(Path(scenario))
    project_tables(chosen, None if chosen.start is None else _ANYWHERE)
    earlier = _written_earlier(Path(folder))
    names = scenario_file_names(chosen)
    refuse_to_replace(chosen.inputs, folder, (*names, *earlier))
    foreign = [name for name in names if name not in earlier and (Path(folder) / name).exists()]
    if foreign:
        raise OutputError(
            f"{folder}: {', '.join(foreign)} would be replaced, and no earlier simulation wrote it; choose another "
            "folder"
        )
    with atomic_folder(folder, stale=earlier) as staging:
        tell("simulate", 0.0)
        logs = run_scenario(chosen, seed)
        tell("simulate", 1.0)
        write_scenario(staging, logs)
        tell("write", 1.0)
    return logs


def write_scenario(folder: Path, logs: ScenarioLogs) -> None:
    """Write the tables and the project file of a run into an existing folder.

    Raises
    ------
    ConfigError
        If the scenario's ``[project]`` is no valid project.
    OutputError
        If a file cannot be written.
    """
    write_imu(folder / IMU_FILE, logs.imu)
    if logs.gnss is not None:
        write_gnss(folder / GNSS_FILE, logs.gnss)
    for section, (log, _) in logs.sensors.items():
        write_table(folder / SENSORS[section].file, log.columns())
    if UWB in logs.scenario.sensors:
        write_aiding(folder / ANCHORS_FILE, logs.scenario.sensors[UWB][0].anchor_table())
    write_trajectory(folder / TRUTH_FILE, logs.truth.trajectory)
    if logs.scenario.one_table:
        write_table(folder / logs.scenario.one_table, nineteen_columns(logs))
    (folder / PROJECT_FILE).write_text(project_text(logs), encoding="utf-8")


def project_tables(scenario: Scenario, start: Start | None = None) -> dict[str, dict[str, Any]]:
    """Tables of the project file of a scenario: only what differs from the defaults or ought to be seen.

    The filter is told the error model that the IMU was simulated with, as far as it has one, and latencies as time
    offsets; ``[project]`` of the scenario has the last word.

    Raises
    ------
    ConfigError
        If the scenario's ``[project]`` is no valid project.
    """
    tables: dict[str, dict[str, Any]] = {"imu": {"file": IMU_FILE, "axes": "FRD"} | _imu_keys(scenario)}
    if scenario.gnss is not None:
        tables["gnss"] = {"file": GNSS_FILE, "lever_arm_m": list(scenario.gnss_lever_arm_b)}
        if scenario.gnss.latency:
            tables["gnss"]["time_offset_s"] = -scenario.gnss.latency
    if start is not None:
        tables["start"] = _start_keys(start, scenario)
    for name, table in scenario.project.items():
        if "file" in table:
            raise ConfigError(f"{scenario.name}: [project.{name}]: file is what the simulation writes; leave it out")
        tables.setdefault(name, {}).update(table)
    Project.from_dict(tables, source=f"{scenario.name}: [project]")
    return tables


def project_text(logs: ScenarioLogs) -> str:
    """The project file of a run.

    Raises
    ------
    ConfigError
        If the scenario's ``[project]`` is no valid project.
    """
    scenario = logs.scenario
    lines = [
        f"# {' '.join(scenario.title.split())}: scenario {scenario.name}, seed {logs.seed}",
        _MANIFEST + " ".join(scenario_file_names(scenario)),
    ]
    for name, table in project_tables(scenario, logs.start).items():
        lines += ["", f"[{name}]", *(f"{key} = {toml_value(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"


def scenario_file_names(scenario: Scenario) -> list[str]:
    """Names of the files that a run of a scenario writes."""
    names = [IMU_FILE, *([GNSS_FILE] if scenario.gnss is not None else [])]
    names += [SENSORS[section].file for section in scenario.sensors]
    names += [ANCHORS_FILE] * (UWB in scenario.sensors) + [scenario.one_table] * bool(scenario.one_table)
    return [*names, TRUTH_FILE, PROJECT_FILE]


def _written_earlier(folder: Path) -> tuple[str, ...]:
    """Names of the files of an earlier simulation, by the second line of its project file."""
    try:
        lines = (folder / PROJECT_FILE).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return ()
    if len(lines) < 2 or not lines[1].startswith(_MANIFEST):
        return ()
    names = lines[1][len(_MANIFEST) :].split()
    return tuple(name for name in names if Path(name).name == name)


def nineteen_columns(logs: ScenarioLogs) -> dict[str, np.ndarray]:
    """Truth, IMU rates and GNSS side by side, in degrees, metres, m/s, rad/s and m/s^2.

    Columns: ``time, true_lat, true_lon, true_alt, true_roll, true_pitch, true_heading, gyro_x, gyro_y, gyro_z, accel_x,
    accel_y, accel_z, z_lat, z_lon, z_alt, z_VN, z_VE, z_VD``.

    Raises
    ------
    ConfigError
        If IMU and GNSS do not have the same stamps, the IMU gives increments, or the fixes have no velocity.
    """
    imu, gnss = logs.imu, logs.gnss
    same = (
        gnss is not None and imu.time.shape == gnss.time.shape and np.allclose(imu.time, gnss.time, atol=1e-9, rtol=0)
    )
    if gnss is None or not same or gnss.velocity_n is None or imu.kind != "rates":
        raise ConfigError(
            f'{logs.scenario.name}: one_table needs an IMU of kind = "rates" and GNSS fixes with velocities at the '
            "same stamps, none lost"
        )
    truth = logs.truth.motion.trajectory(imu.time)
    attitude, velocity = truth.attitude, gnss.velocity_n
    assert attitude is not None
    columns = {"time": imu.time, "true_lat": np.degrees(truth.lat), "true_lon": np.degrees(truth.lon)}
    columns |= {"true_alt": truth.height}
    columns |= {f"true_{name}": np.degrees(attitude[:, k]) for k, name in enumerate(("roll", "pitch", "heading"))}
    columns |= {f"gyro_{axis}": imu.gyro[:, k] for k, axis in enumerate("xyz")}
    columns |= {f"accel_{axis}": imu.accel[:, k] for k, axis in enumerate("xyz")}
    columns |= {"z_lat": np.degrees(gnss.lat), "z_lon": np.degrees(gnss.lon), "z_alt": gnss.height}
    return columns | {f"z_V{axis}": velocity[:, k] for k, axis in enumerate("NED")}


def describe(logs: ScenarioLogs, folder: str | os.PathLike[str]) -> list[str]:
    """What was written, in a few lines."""
    folder, scenario, motion = Path(folder), logs.scenario, logs.truth.motion
    imu = logs.imu
    length, distance = motion.end - motion.start, _distance(logs)
    lines = [
        f"{scenario.name}, seed {logs.seed}: {length:.0f} s, {distance / 1000.0:.2f} km",
        f"  {folder / IMU_FILE}: {imu.time.size} rows of {imu.kind} at {scenario.imu_rate:g} Hz",
    ]
    if logs.gnss is not None and scenario.gnss is not None:
        lines.append(f"  {folder / GNSS_FILE}: {logs.gnss.time.size} fixes at {scenario.gnss.rate:g} Hz")
    lines += [f"  {folder / SENSORS[name].file}: {log.time.size} rows" for name, (log, _) in logs.sensors.items()]
    if scenario.one_table:
        lines.append(f"  {folder / scenario.one_table}: truth, IMU and fixes in 19 columns")
    lines.append(f"  {folder / TRUTH_FILE}: the truth at {scenario.truth_rate:g} Hz")
    return lines


def _distance(logs: ScenarioLogs) -> float:
    """Length of the way [m], to about the rate of the truth."""
    r_e = logs.truth.motion.r_e(logs.truth.trajectory.time)
    return float(np.sum(np.linalg.norm(np.diff(r_e, axis=0), axis=1)))


def _imu_keys(scenario: Scenario) -> dict[str, Any]:
    """Keys of ``[imu]`` that give the filter the base error model of the simulated sensor."""
    keys: dict[str, Any] = {}
    grade = scenario.imu_keys["grade"]
    if grade:
        keys["grade"] = grade
    base = scenario.imu.base
    told = [key for key in DATASHEET_UNITS if key in ImuConfig.model_fields]
    if grade:
        changed = {DATASHEET_UNITS[key][0] for key in scenario.imu_keys if key in DATASHEET_UNITS}
        told = [key for key in told if DATASHEET_UNITS[key][0] in changed]
    for key in told:
        field, factor = DATASHEET_UNITS[key]
        value = np.asarray(getattr(base, field), dtype=float) / factor
        numbers = np.unique(value)
        keys[key] = float(numbers[0]) if numbers.size == 1 else value.tolist()
    if scenario.imu.stamp_latency:
        keys["time_offset_s"] = -scenario.imu.stamp_latency
    return keys


def _start_keys(start: Start, scenario: Scenario) -> dict[str, Any]:
    errors = scenario.start
    assert errors is not None
    roll, pitch, heading = (degrees(angle) for angle in euler_from_quat(start.nav[6:10]))
    return {
        "time_s": start.time,
        "lat_deg": degrees(start.nav[0]),
        "lon_deg": degrees(start.nav[1]),
        "height_m": float(start.nav[2]),
        "velocity_mps": start.nav[3:6].tolist(),
        "roll_deg": roll,
        "pitch_deg": pitch,
        "heading_deg": float(wrapped(np.array(heading), 360.0)),
        "sd_position_m": list(errors.sd_position),
        "sd_velocity_mps": list(errors.sd_velocity),
        "sd_attitude_deg": [degrees(angle) for angle in errors.sd_attitude],
    }


def _silent(stage: str, fraction: float) -> None:
    """No progress wanted."""
