"""The runs whose pages are looked at: two real logs, and short simulated ones at the edge of what a page can show."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.logs import CAR_IMU, CAR_START, SCALE, rtk_project

from navfuse import process, read_trajectory
from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.demo import write_logs
from navfuse.errors import NavfuseWarning
from navfuse.imu.grades import grade
from navfuse.report.page import write_report
from navfuse.simulation import SimulatedLogs, car_drive, simulate

Case = tuple[Result, Trajectory | None]
GRADE = "industrial-mems"
TOW = 243258.0
"""Seconds of the GPS week at which the log of the real drive begins."""
OFF_DEG = 0.002
"""How far the fixes of the rejected run lie north of the truth."""


def car(data: Path, folder: Path) -> Case:
    """An hour at 200 Hz, with a truth."""
    logs = _shared(data, "car-1h-200hz")
    project = {
        "imu": {"file": str(logs / "imu.parquet"), **CAR_IMU, **SCALE},
        "gnss": {"file": str(logs / "gnss.csv"), "use": ["position"]},
        "start": dict(CAR_START),
    }
    return _run(project), read_trajectory(logs / "truth.parquet")


def drive(data: Path, folder: Path) -> Case:
    """A real drive with eleven withheld windows and a clock, without a truth."""
    _shared(data, "rtklibexplorer-drive")
    found = rtk_project()
    assert found is not None
    project = found[0]
    project["gnss"]["epoch_week_s"] = [2374, TOW]
    return _run(project), None


def ten_seconds(data: Path, folder: Path) -> Case:
    """A log of ten seconds with two fixes a second."""
    logs = _logs(10.0, gnss_rate=2.0)
    return _short(folder, logs), logs.truth


def one_fix(data: Path, folder: Path) -> Case:
    """Half a minute with a single fix in its middle; a log needs two, and the second comes after the end."""
    logs = _logs(30.0)
    two = logs.gnss.take(np.array([14, 15]))
    result = _short(folder, replace(logs, gnss=replace(two, time=two.time + np.array([0.0, 60.0]))))
    assert result.innovations.count("gnss_position", "used") == 1
    return result, logs.truth


def all_rejected(data: Path, folder: Path) -> Case:
    """A quarter of a minute, too short for the gate to yield, with every fix 220 m off."""
    logs = _logs(15.0)
    far = replace(logs.gnss, lat=logs.gnss.lat + np.radians(OFF_DEG))
    result = _short(folder, replace(logs, gnss=far))
    assert set(result.innovations.status.tolist()) == {"rejected"}
    return result, None


CASES: dict[str, Callable[[Path, Path], Case]] = {
    "drive": drive,
    "car": car,
    "ten-seconds": ten_seconds,
    "one-fix": one_fix,
    "all-rejected": all_rejected,
}


def write_case(name: str, data: Path, folder: Path, page: Path) -> None:
    """Run a case, its logs in `folder`, and write its page."""
    result, truth = CASES[name](data, folder)
    write_report(page, result, truth, title=f"Case {name}")


def _shared(data: Path, name: str) -> Path:
    if not (data / name).is_dir():
        pytest.skip(f"the shared log {name} is not beside the project")
    return data / name


def _run(project: dict[str, Any]) -> Result:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NavfuseWarning)
        return process(project)


def _logs(duration: float, gnss_rate: float = 1.0) -> SimulatedLogs:
    return simulate(car_drive(duration=duration, seed=3), grade(GRADE), 3, imu_rate=100.0, gnss_rate=gnss_rate)


def _short(folder: Path, logs: SimulatedLogs) -> Result:
    """Process simulated logs from the true start, which a log this short would not yield by itself."""
    write_logs(folder, logs)
    first = logs.truth
    roll, pitch, heading = np.degrees(first.attitude[0]).tolist()
    start = {
        "lat_deg": float(np.degrees(first.lat[0])),
        "lon_deg": float(np.degrees(first.lon[0])),
        "height_m": float(first.height[0]),
        "velocity_mps": first.velocity_n[0].tolist(),
        "roll_deg": roll,
        "pitch_deg": pitch,
        "heading_deg": heading,
        "sd_position_m": [1.0, 1.0, 2.0],
        "sd_velocity_mps": [0.05, 0.05, 0.05],
        "sd_attitude_deg": [0.5, 0.5, 2.0],
    }
    gnss = {"file": str(folder / "gnss.csv"), "use": ["position"]}
    return _run({"imu": {"file": str(folder / "imu.parquet"), "grade": GRADE}, "gnss": gnss, "start": start})
