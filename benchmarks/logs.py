"""The logs that are measured on, as projects: the shared benchmark logs where they are, else a simulated drive."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

from navfuse.config.toml_text import toml_value

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"

CAR_IMU = {
    "arw_deg_per_sqrt_h": 0.2,
    "vrw_mps_per_sqrt_h": 0.1,
    "gyro_bias_sd_dph": 30.0,
    "gyro_bias_tau_s": 3600.0,
    "accel_bias_sd_mg": 0.15296,
    "accel_bias_tau_s": 3600.0,
}
SCALE = {"gyro_scale_sd_ppm": 300.0, "accel_scale_sd_ppm": 300.0}
CAR_START = {
    "lat_deg": 30.50000963220,
    "lon_deg": 114.29999522802,
    "height_m": 25.73006,
    "velocity_mps": [0.117339, -0.068985, 0.033085],
    "roll_deg": -0.464777,
    "pitch_deg": 1.192151,
    "heading_deg": 36.479362,
    "sd_position_m": [1.0, 1.0, 2.0],
    "sd_velocity_mps": [0.05, 0.05, 0.05],
    "sd_attitude_deg": [0.5, 0.5, 2.0],
}
WINDOWS = tuple((40.499 + 45.0 * k, 55.499 + 45.0 * k) for k in range(11))


def car_project(scratch: Path, states: int = 21) -> tuple[str, dict[str, Any], Path]:
    """An hour of a car at 200 Hz with fixes at 1 Hz, filtered with 15 or 21 states.

    Parameters
    ----------
    scratch : Path
        Where a simulated drive is written if the shared log is absent.
    states : int

    Returns
    -------
    label : str
    project : dict
    truth : Path
    """
    imu = CAR_IMU | (SCALE if states == 21 else dict.fromkeys(SCALE, 0.0))
    folder = SHARED / "car-1h-200hz"
    if folder.is_dir():
        start: dict[str, Any] = dict(CAR_START)
        label = "car-1h-200hz"
    else:
        folder, start, label = scratch / "drive", {}, "a simulated drive of one hour"
        if not folder.is_dir():
            simulate_hour(folder)
    project = {
        "imu": {"file": str(folder / "imu.parquet"), **imu},
        "gnss": {"file": str(folder / "gnss.csv"), "use": ["position"]},
        "start": start,
    }
    return label, copy.deepcopy(project), folder / "truth.parquet"


def simulate_hour(folder: Path) -> None:
    """Simulate an hour of driving with the sensor errors of the shared log, and write it as native tables."""
    from navfuse.demo import write_logs
    from navfuse.imu.grades import grade
    from navfuse.simulation import car_drive, simulate

    folder.mkdir(parents=True)
    write_logs(
        folder,
        simulate(car_drive(duration=3600.0, seed=1), grade("benchmark-car"), 1, imu_rate=200.0, sd_velocity=None),
    )


def rtk_project() -> tuple[dict[str, Any], Path] | None:
    """The real drive with eleven withheld windows, and its log of fixes; None where it is absent."""
    folder = SHARED / "rtklibexplorer-drive"
    if not folder.is_dir():
        return None
    project = {
        "imu": {
            "file": str(folder / "imu.parquet"),
            "axes": "BRU",
            "time_offset_s": -0.2,
            "grade": "icm-45686-car",
        },
        "gnss": {
            "file": str(folder / "gnss.csv"),
            "lever_arm_m": [0.0, -0.05, 0.0],
            "velocity_sd_scale": 2.0,
            "outages_s": [list(window) for window in WINDOWS],
        },
    }
    return project, folder / "gnss.csv"


def write_project(path: Path, project: dict[str, Any]) -> None:
    """Write nested dictionaries as a project file."""
    lines = []
    for section, keys in project.items():
        lines.append(f"[{section}]")
        lines += [f"{name} = {toml_value(value)}" for name, value in keys.items()]
    text = "\n".join(lines) + "\n"
    tomllib.loads(text)
    path.write_text(text, encoding="utf-8")
