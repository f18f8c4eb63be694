from __future__ import annotations

import copy
from pathlib import Path

import pandas as pd
import pytest

from navfuse.demo import write_logs
from navfuse.imu.grades import grade
from navfuse.simulation import SimulatedLogs, car_drive, simulate
from replay.job import Job, JobMaker

LEVER = (-0.4, 0.2, -1.3)
KINDS = ("rates", "increments")


@pytest.fixture(scope="session")
def drives() -> dict[str, SimulatedLogs]:
    """Two minutes of a car, once with a sensor of rates and once with one of increments."""
    motion = car_drive(duration=120.0, seed=4)
    return {
        kind: simulate(motion, grade("industrial-mems"), 5, imu_kind=kind, lever_arm_b=LEVER, gnss_rate=2.0)
        for kind in KINDS
    }


@pytest.fixture(scope="session")
def tables(drives, tmp_path_factory) -> dict[str, tuple[pd.DataFrame, pd.DataFrame]]:
    """The native tables of the drives: IMU and GNSS."""
    found = {}
    for kind, logs in drives.items():
        folder: Path = tmp_path_factory.mktemp(kind)
        write_logs(folder, logs)
        found[kind] = (pd.read_parquet(folder / "imu.parquet"), pd.read_csv(folder / "gnss.csv"))
    return found


@pytest.fixture
def make_job(drives, tables, tmp_path) -> JobMaker:
    """A sound project of one of the drives, the test's to spoil."""

    def make(kind: str = "rates") -> Job:
        imu, gnss = (table.copy() for table in tables[kind])
        project = {
            "imu": {"file": "imu.parquet", "grade": "industrial-mems"},
            "gnss": {"file": "gnss.csv", "lever_arm_m": LEVER},
        }
        return Job(tmp_path, imu, gnss, drives[kind].truth, copy.deepcopy(project))

    return make


@pytest.fixture
def job(make_job) -> Job:
    """The project with a sensor of rates."""
    return make_job()
