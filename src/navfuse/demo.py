"""The demonstration: a simulated drive with a GNSS outage, processed like any project."""

from __future__ import annotations

import os
from pathlib import Path

from navfuse.analysis.metrics import compare
from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.imu.grades import grade
from navfuse.io.atomic import atomic_folder
from navfuse.io.log_tables import write_gnss, write_imu
from navfuse.io.result_folder import TABLES, write_result
from navfuse.io.trajectory_table import write_trajectory
from navfuse.pipeline import process
from navfuse.report.figures import figure_errors, figure_map
from navfuse.report.page import write_report
from navfuse.report.tables import metrics_text
from navfuse.simulation import SimulatedLogs, car_drive, simulate

DURATION_S = 120.0
OUTAGE_S = (85.0, 105.0)
GRADE = "industrial-mems"

_PROJECT = """\
[imu]
file = "imu.parquet"
axes = "FRD"
grade = "{grade}"

[gnss]
file = "gnss.csv"
lever_arm_m = [{lever[0]}, {lever[1]}, {lever[2]}]
outages_s = [[{outage[0]}, {outage[1]}]]
"""


def run_demo(folder: str | os.PathLike[str], seed: int = 1) -> tuple[Result, list[str]]:
    """Simulate a two-minute car drive with a GNSS outage, process it, and show how well that went.

    Writes the simulated logs, the truth, ``project.toml``, the results of ``navfuse run``, ``report.html`` with the
    errors, ``map.png`` and ``errors.png``.

    Parameters
    ----------
    folder : path-like
    seed : int
        Of the simulated drive and noise.

    Returns
    -------
    Result
    lines : list of str
        What to tell a newcomer.
    """
    logs, lever = simulate_drive(seed)
    with atomic_folder(folder, stale=tuple(f"{name}.csv" for name in TABLES)) as staging:
        write_logs(staging, logs)
        (staging / "project.toml").write_text(
            _PROJECT.format(grade=GRADE, lever=lever, outage=OUTAGE_S), encoding="utf-8"
        )
        result = process(staging / "project.toml")
        for section in ("imu", "gnss"):
            result.summary["settings"][section]["file"] = Path(result.summary["settings"][section]["file"]).name
            result.summary["inputs"][section]["source"] = Path(result.summary["inputs"][section]["source"]).name
        write_result(staging, result)
        write_report(staging / "report.html", result, logs.truth, title="navfuse demo: a two-minute drive")
        figure_map(result, logs.truth).savefig(staging / "map.png")
        figure_errors(result, logs.truth).savefig(staging / "errors.png")
    return result, _lines(Path(folder), result, logs.truth)


def simulate_drive(seed: int) -> tuple[SimulatedLogs, tuple[float, float, float]]:
    """The logs of the demonstration and its lever arm [m]."""
    lever = (-0.4, 0.2, -1.3)
    motion = car_drive(duration=DURATION_S, seed=seed)
    return simulate(motion, grade(GRADE), seed, imu_rate=100.0, gnss_rate=1.0, lever_arm_b=lever), lever


def write_logs(folder: Path, logs: SimulatedLogs) -> None:
    """Write simulated logs and their truth as native tables."""
    write_imu(folder / "imu.parquet", logs.imu)
    write_gnss(folder / "gnss.csv", logs.gnss)
    write_trajectory(folder / "truth.parquet", logs.truth)


def _lines(folder: Path, result: Result, truth: Trajectory) -> list[str]:
    found = {"filter": compare(result.forward, truth)}
    if result.smoothed is not None:
        found["smoothed"] = compare(result.smoothed, truth)
    inside = {
        name: compare(trajectory, truth, skip_s=OUTAGE_S[0], until_s=OUTAGE_S[1]).statistics["position_horizontal"].max
        for name, trajectory in (("filter", result.forward), ("smoothed", result.smoothed))
        if trajectory is not None
    }
    return [
        f"a simulated car drive of {DURATION_S:.0f} s: {GRADE} IMU at 100 Hz, GNSS at 1 Hz with 1 m noise, lost from "
        f"{OUTAGE_S[0]:.0f} to "
        f"{OUTAGE_S[1]:.0f} s",
        "",
        metrics_text(found),
        "",
        "worst horizontal error while GNSS was lost: "
        + ", ".join(f"{name} {value:.2f} m" for name, value in inside.items()),
        "",
        "open these:",
        f"  {folder / 'report.html'}    the whole run, interactive",
        f"  {folder / 'map.png'}        where it went",
        f"  {folder / 'errors.png'}     errors inside their 3-sigma bounds",
        f"  {folder / 'project.toml'}   the project; try: navfuse run {folder / 'project.toml'} -o my-output",
    ]
