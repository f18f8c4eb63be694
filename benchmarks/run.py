"""Speed: time of the filter per IMU sample, of the smoother, of whole processes, and their memory.

Times of the filter and the smoother are those of calls in this process, with the kernels compiled, best and median of
several; one core is used. A process is ``navfuse run`` on the hour: Parquet in, Parquet and summary out, no report;
cold means that no kernel has been compiled on the machine before.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.logs import car_project, write_project
from benchmarks.peers import python_ins
from navfuse.config import Project
from navfuse.errors import NavfuseWarning
from navfuse.filters.ekf import ErrorStateFilter
from navfuse.imu.alignment import align
from navfuse.imu.gaps import gap_limit
from navfuse.imu.increments import to_increments
from navfuse.pipeline import filter_settings, gnss_sensors, known_start, read_logs
from navfuse.smoothers.rts import smooth

REPEATS = 5
PEER_SECONDS = 120.0
FULL_RATE = 0.0
MEGABYTE = 1 / 1024


def main() -> None:
    """Measure and print."""
    console = Console(width=None if sys.stdout.isatty() else 120)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", NavfuseWarning)
        scratch = Path(folder)
        console.print(_filter_table(scratch))
        console.print(_process_table(scratch))


def _filter_table(scratch: Path) -> Table:
    label = car_project(scratch)[0]
    table = Table(title=f"Filter and smoother on {label}, us per IMU sample (median, best of {REPEATS})")
    for name in ("tool", "states", "frame", "covariance", "filter", "with smoothing and 10 Hz output"):
        table.add_column(name)
    for states in (15, 21):
        for frame in ("ned", "ecef"):
            for name, rate in (("10 Hz", None), ("every sample", FULL_RATE)):
                project = car_project(scratch, states)[1]
                project["filter"] = {"frame": frame} | ({} if rate is None else {"covariance_rate_hz": rate})
                filtering, both = _engine(project)
                table.add_row("navfuse", str(states), frame, name, _times(filtering), _times(both))
        for name, step in (("10 Hz", 0.1), ("1 Hz", 1.0)):
            each, version = python_ins(car_project(scratch, states)[1], states, PEER_SECONDS, step)
            table.add_row(f"python-ins {version}", str(states), "ned", name, f"{each:.0f}", "-")
    return table


def _engine(settings: dict[str, Any]) -> tuple[list[float], list[float]]:
    """Microseconds per sample of the filter alone and with the smoother, several runs."""
    project = Project.from_dict(settings)
    imu, gnss = read_logs(project)
    increments = to_increments(imu)
    model = project.imu_error_model()
    start = align(increments, gnss, model, np.array(project.gnss.lever_arm_m), known_start(project)).start
    increments = increments.piece(int(np.searchsorted(increments.time, start.time - 1e-6)))
    choice = filter_settings(project, gap_limit(increments.time), increments)
    filtering, both = [], []
    for _ in range(REPEATS + 1):
        begin = time.perf_counter()
        estimator = ErrorStateFilter(start, model, gnss_sensors(project, gnss), choice)
        estimator.feed(increments)
        middle = time.perf_counter()
        smooth(estimator, increments)
        filtering.append(1e6 * (middle - begin) / len(increments))
        both.append(1e6 * (time.perf_counter() - begin) / len(increments))
    return filtering[1:], both[1:]


def _times(values: list[float]) -> str:
    return f"{median(values):.3f}  ({min(values):.3f})"


def _process_table(scratch: Path) -> Table:
    label, project, _ = car_project(scratch)
    write_project(scratch / "project.toml", project)
    table = Table(title=f"Whole processes on {label}: navfuse run, 21 states, smoothed, no report")
    for name in ("kernels", "wall s", "CPU s", "memory MB"):
        table.add_column(name)
    kernels = scratch / "kernels"
    wall, cpu, memory = _process(scratch, kernels)
    table.add_row("cold", f"{wall:.1f}", f"{cpu:.1f}", f"{memory:.0f}")
    runs = [_process(scratch, kernels) for _ in range(REPEATS)]
    wall, cpu, memory = (median(values) for values in zip(*runs, strict=True))
    table.add_row(f"warm, median of {REPEATS}", f"{wall:.2f}", f"{cpu:.2f}", f"{memory:.0f}")
    return table


def _process(scratch: Path, kernels: Path) -> tuple[float, float, float]:
    """Wall time [s], CPU time [s] and peak memory [MB] of one `navfuse run` in a process of its own."""
    command = [sys.executable, "-m", "navfuse", "run", str(scratch / "project.toml"), "-o", str(scratch / "out")]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(kernels)}
    small = [sys.executable, "-c", _WATCH, *command, "--no-report"]
    done = subprocess.run(small, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"navfuse run ended with code {done.returncode}: {done.stderr}")
    wall, cpu, memory = (float(value) for value in done.stdout.split())
    return wall, cpu, memory * MEGABYTE


_WATCH = """
import os, subprocess, sys, time
begin = time.perf_counter()
child = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL)
_, status, usage = os.wait4(child.pid, 0)
print(time.perf_counter() - begin, usage.ru_utime + usage.ru_stime, usage.ru_maxrss)
sys.exit(os.waitstatus_to_exitcode(status))
"""
"""A process as large as this one would pass its own size on to its children's peak."""


if __name__ == "__main__":
    main()
