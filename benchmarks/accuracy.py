"""Accuracy on the shared benchmark logs, beside what other tools reach on them.

The figures of the others are those that come with the logs (``README.md`` there); none is run here.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.logs import WINDOWS, car_project, rtk_project
from navfuse import compare, process, read_gnss, read_trajectory
from navfuse.core.earth import dcm_en, geodetic_to_ecef_batch
from navfuse.data.trajectory import Trajectory
from navfuse.errors import NavfuseWarning

COLUMNS = (
    *("position_north", "position_east", "position_down", "velocity_north", "velocity_east", "velocity_down"),
    *("roll", "pitch", "heading"),
)
DIGITS = (3, 3, 3, 4, 4, 4, 4, 4, 4)
SKIP_S = 120.0
PEERS = {
    "KF-GINS, 21 states": (0.471, 0.465, 0.475, 0.0655, 0.0648, 0.0175, 0.0308, 0.0310, 0.2278),
    "python-ins, feedback, 21 states": (0.471, 0.465, 0.452, 0.0655, 0.0648, 0.0159, 0.0309, 0.0310, 0.2270),
    "GTSAM batch, 15 states": (0.164, 0.168, 0.221, 0.0141, 0.0119, 0.0077, 0.0083, 0.0086, 0.0758),
}
WINDOW_PEERS = {
    "python-ins, forward": 7.72,
    "GNSS_IMU, forward": 6.85,
    "GNSS_IMU, with the non-holonomic constraint": 5.23,
    "GNSS_IMU, velocities matched after each window": 0.455,
}


def main() -> None:
    """Measure and print."""
    console = Console(width=None if sys.stdout.isatty() else 140)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", NavfuseWarning)
        console.print(_car_table(Path(folder)))
        windows = _windows_table()
        console.print(windows if windows is not None else "rtklibexplorer-drive is not here: its table is left out")


def _car_table(scratch: Path) -> Table:
    label, project, truth_file = car_project(scratch)
    truth = read_trajectory(truth_file)
    table = Table(title=f"RMSE after {SKIP_S:.0f} s on {label}")
    for name in ("", "N m", "E m", "D m", "vN m/s", "vE m/s", "vD m/s", "roll deg", "pitch deg", "heading deg", "NIS"):
        table.add_column(name)
    for frame in ("ned", "ecef"):
        result = process(project | {"filter": {"frame": frame}})
        nis = result.summary["measurements"]["gnss_position"]["mean_nis_per_dof"]
        table.add_row(f"navfuse, filter, {frame}", *_rmse(result.forward, truth), f"{nis:.3f}")
        table.add_row(f"navfuse, smoothed, {frame}", *_rmse(result.smoothed, truth), "-")
    if project["start"]:
        result = process({**project, "start": {}})
        table.add_row("navfuse, filter, start found", *_rmse(result.forward, truth), "-")
        for name, figures in PEERS.items():
            table.add_row(name, *(f"{x:.{d}f}" for x, d in zip(figures, DIGITS, strict=True)), "-")
    return table


def _rmse(solution: Trajectory | None, truth: Trajectory) -> list[str]:
    if solution is None:
        return ["-"] * len(COLUMNS)
    found = compare(solution, truth, skip_s=SKIP_S).statistics
    return [f"{found[name].rms:.{digits}f}" for name, digits in zip(COLUMNS, DIGITS, strict=True)]


def _windows_table() -> Table | None:
    found = rtk_project()
    if found is None:
        return None
    project, fixes = found
    result = process(project)
    table = Table(title="rtklibexplorer-drive, eleven windows of 15 s without fixes: horizontal error at their worst")
    for name in ("", "rms of the windows m", "largest m"):
        table.add_column(name)
    for name, trajectory in (("navfuse, filter", result.forward), ("navfuse, smoothed", result.smoothed)):
        if trajectory is not None:
            worst = window_errors(trajectory, fixes, project["gnss"]["lever_arm_m"])
            table.add_row(name, f"{np.sqrt(np.mean(worst**2)):.3f}", f"{worst.max():.3f}")
    for name, figure in WINDOW_PEERS.items():
        table.add_row(name, f"{figure:.3f}", "-")
    return table


def window_errors(trajectory: Trajectory, fixes: Path, lever_arm_b: Any) -> np.ndarray:
    """Largest horizontal error [m] of the antenna in each withheld window, at the times of the fixes."""
    from navfuse.core.rotation import dcm_from_quat_batch, quat_from_euler_batch

    gnss = read_gnss(fixes)
    C_nb = dcm_from_quat_batch(quat_from_euler_batch(trajectory.attitude))
    r_e = geodetic_to_ecef_batch(trajectory.lat, trajectory.lon, trajectory.height)
    worst = []
    for begin, end in WINDOWS:
        k = np.flatnonzero((gnss.time >= begin) & (gnss.time < end))
        C_en = np.array(dcm_en(gnss.lat[k[0]], gnss.lon[k[0]])).reshape(3, 3)
        antenna = r_e @ C_en + C_nb @ np.asarray(lever_arm_b, dtype=float)
        fix = geodetic_to_ecef_batch(gnss.lat[k], gnss.lon[k], gnss.height[k]) @ C_en
        apart = np.stack([np.interp(gnss.time[k], trajectory.time, antenna[:, i]) - fix[:, i] for i in range(2)])
        worst.append(np.linalg.norm(apart, axis=0).max())
    return np.array(worst)


if __name__ == "__main__":
    main()
