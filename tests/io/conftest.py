"""Tables that are right, for tests to spoil."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

Columns = dict[str, np.ndarray]


def imu_columns(n: int = 1000, rate: float = 100.0) -> Columns:
    """A level sensor that sways by some degrees, as rates."""
    time = np.arange(n) / rate
    columns = {"time_s": time}
    for axis, (amplitude, period) in zip("xyz", ((0.05, 7.0), (0.04, 5.0), (0.1, 11.0)), strict=True):
        columns[f"gyro_{axis}_radps"] = amplitude * np.cos(2.0 * np.pi * time / period)
    columns["accel_x_mps2"] = 0.3 * np.sin(time)
    columns["accel_y_mps2"] = 0.2 * np.cos(time)
    columns["accel_z_mps2"] = np.full(n, -9.81)
    return columns


def increment_columns(n: int = 1000, rate: float = 100.0) -> Columns:
    """The same as increments."""
    rates = imu_columns(n, rate)
    columns = {"time_s": rates["time_s"]}
    for axis in "xyz":
        columns[f"dtheta_{axis}_rad"] = rates[f"gyro_{axis}_radps"] / rate
    for axis in "xyz":
        columns[f"dvel_{axis}_mps"] = rates[f"accel_{axis}_mps2"] / rate
    return columns


def gnss_columns(n: int = 120, velocity: bool = True) -> Columns:
    """A car that goes round at 12 m/s near Munich, 1 Hz."""
    time = np.arange(float(n))
    angle = 0.05 * time
    vn, ve, vd = 12.0 * np.cos(angle), 12.0 * np.sin(angle), 0.5 * np.sin(0.1 * time)
    north, east = 240.0 * np.sin(angle), 240.0 * (1.0 - np.cos(angle))
    columns = {
        "time_s": time,
        "lat_deg": 48.0 + np.degrees(north / 6371e3),
        "lon_deg": 11.5 + np.degrees(east / 6371e3 / np.cos(np.radians(48.0))),
        "height_m": 500.0 + 5.0 * np.cos(0.1 * time),
        "sd_north_m": np.full(n, 1.0),
        "sd_east_m": np.full(n, 1.5),
        "sd_down_m": np.full(n, 2.0),
    }
    if velocity:
        columns |= {"vn_mps": vn, "ve_mps": ve, "vd_mps": vd}
        columns |= {name: np.full(n, 0.1) for name in ("sd_vn_mps", "sd_ve_mps", "sd_vd_mps")}
    return columns


def trajectory_columns(n: int = 50) -> Columns:
    """A trajectory with every native column."""
    gnss = gnss_columns(n)
    time = gnss["time_s"]
    columns = {name: gnss[name] for name in ("time_s", "lat_deg", "lon_deg", "height_m", "vn_mps", "ve_mps", "vd_mps")}
    columns |= {"roll_deg": np.sin(time), "pitch_deg": 2.0 * np.cos(time), "heading_deg": (7.0 * time) % 360.0}
    groups = ("north_m", "east_m", "down_m", "vn_mps", "ve_mps", "vd_mps", "roll_deg", "pitch_deg", "heading_deg")
    columns |= {f"sd_{name}": np.full(n, 0.1 + 0.01 * k) for k, name in enumerate(groups)}
    return columns


def csv_text(columns: Columns) -> str:
    """Comma-separated text with a header."""
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return "\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows)]) + "\n"


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Write columns as a CSV or Parquet file, text as it is, and return the path."""

    def write_file(content: Columns | str | bytes, name: str = "log.csv") -> Path:
        path = tmp_path / name
        if isinstance(content, bytes):
            path.write_bytes(content)
        elif isinstance(content, str):
            path.write_text(content, encoding="utf-8", newline="")
        elif path.suffix == ".csv":
            path.write_text(csv_text(content), encoding="utf-8")
        else:
            import pyarrow
            import pyarrow.parquet

            arrays = [pyarrow.array(column.tolist()) for column in content.values()]
            pyarrow.parquet.write_table(pyarrow.Table.from_arrays(arrays, names=list(content)), path)
        return path

    return write_file


@pytest.fixture
def rates() -> Columns:
    return imu_columns()


@pytest.fixture
def increments() -> Columns:
    return increment_columns()


@pytest.fixture
def gnss() -> Columns:
    return gnss_columns()


@pytest.fixture
def gnss_positions() -> Columns:
    return gnss_columns(velocity=False)


@pytest.fixture
def trajectory() -> Columns:
    return trajectory_columns()


@pytest.fixture
def text_of() -> Callable[[Columns], str]:
    return csv_text
