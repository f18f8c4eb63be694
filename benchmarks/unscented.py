"""Speed of the unscented and the cubature filter beside the extended one, and beside FilterPy on the same problem.

CPU time of this process on one core, kernels compiled, best of several; the kinds take turns, so that the ratios hold
on a busy machine. The hot loop has no events and no output; the filter has fixes of position and velocity at 1 Hz,
output at 10 Hz and checkpoints. The velocities are those of the truth with white noise. FilterPy is no dependency:
``pip install filterpy`` for its rows. It has a state of 15 numbers (position in metres about the start, velocity,
rotation vector, biases) and calls our compiled mechanization for every point and increment.
"""

from __future__ import annotations

import importlib
import math
import sys
import tempfile
import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.console import Console
from rich.table import Table

from benchmarks.logs import car_project
from navfuse.config import Project
from navfuse.core.constants import WGS84_A
from navfuse.core.rotation import quat_from_rotvec, rotvec_from_quat
from navfuse.data.logs import GnssLog
from navfuse.data.start import Start
from navfuse.errors import NavfuseWarning
from navfuse.filters.kinds import FILTERS
from navfuse.filters.settings import FilterSettings
from navfuse.imu.alignment import align
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.gaps import gap_limit
from navfuse.imu.increments import ImuIncrements, to_increments
from navfuse.mechanization.ned import step_ned
from navfuse.pipeline import filter_settings, gnss_sensors, known_start, read_logs
from navfuse.smoothers.rts import smooth

REPEATS = 5
SECONDS, PEER_SECONDS = 120.0, 4.0
SD_VELOCITY = 0.05


class _Problem:
    """A piece of the log, with everything that a filter is made of."""

    def __init__(self, scratch: Path, states: int, frame: str):
        self.label, settings, truth = car_project(scratch, states)
        settings["filter"] = {"frame": frame}
        settings["gnss"]["use"] = ["position", "velocity"]
        self.project = project = Project.from_dict(settings)
        imu, gnss = read_logs(project)
        self.gnss = _with_velocity(gnss, truth)
        increments = to_increments(imu)
        self.model: ImuErrorModel = project.imu_error_model()
        lever = np.array(project.gnss.lever_arm_m)
        self.start: Start = align(increments, self.gnss, self.model, lever, known_start(project)).start
        first = int(np.searchsorted(increments.time, self.start.time - 1e-6))
        last = int(np.searchsorted(increments.time, self.start.time + SECONDS))
        self.increments: ImuIncrements = increments.piece(first, last)
        self.settings: FilterSettings = filter_settings(project, gap_limit(self.increments.time), self.increments)

    def times(self, kind: str) -> tuple[float, float, float]:
        """CPU time [us] per sample of the hot loop, the filter and the smoother."""
        alone = replace(self.settings, output_period=-1.0, checkpoints=False)
        bare = FILTERS[kind](self.start, self.model, (), alone)
        whole = FILTERS[kind](self.start, self.model, gnss_sensors(self.project, self.gnss), self.settings)
        marks = [time.process_time()]
        for call in (
            lambda: bare.feed(self.increments),
            lambda: whole.feed(self.increments),
            lambda: smooth(whole, self.increments),
        ):
            call()
            marks.append(time.process_time())
        hot, filtering, smoothing = 1e6 * np.diff(marks) / len(self.increments)
        return float(hot), float(filtering), float(smoothing)


def main() -> None:
    """Measure and print."""
    console = Console(width=None if sys.stdout.isatty() else 120)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", NavfuseWarning)
        scratch = Path(folder)
        problem = _Problem(scratch, 15, "ned")
        table = Table(title=f"{SECONDS:.0f} s of {problem.label}, us of CPU per IMU sample (best of {REPEATS})")
        for name in ("states", "frame", "filter", "hot loop", "filter", "filter / ekf", "smoother"):
            table.add_column(name)
        for states in (15, 21):
            for frame in ("ned", "ecef"):
                _add_rows(table, _Problem(scratch, states, frame))
        for name, step in (("every sample", 1), ("10 Hz", 20)):
            spent = _filterpy(problem, step)
            if spent is not None:
                table.add_row("15", "ned", f"FilterPy, covariance {name}", "-", f"{spent:.0f}", "-", "-")
        console.print(table)
        if spent is None:
            console.print("FilterPy is not installed: its rows are left out")


def _add_rows(table: Table, problem: _Problem) -> None:
    best = dict.fromkeys(FILTERS, (math.inf, math.inf, math.inf))
    for repeat in range(REPEATS + 1):
        for kind in FILTERS:
            spent = problem.times(kind)
            if repeat:
                best[kind] = tuple(map(min, best[kind], spent))
    for kind, (hot, filtering, smoothing) in best.items():
        n = 15 if problem.project.imu.gyro_scale_sd_ppm == 0 else 21
        frame = "ecef" if problem.settings.ecef else "ned"
        ratio = filtering / best["ekf"][1]
        table.add_row(str(n), frame, kind, f"{hot:.2f}", f"{filtering:.2f}", f"{ratio:.1f}", f"{smoothing:.2f}")


def _with_velocity(gnss: GnssLog, truth: Path) -> GnssLog:
    rows = pd.read_parquet(truth)
    columns = ("vn_mps", "ve_mps", "vd_mps")
    velocity = np.column_stack([np.interp(gnss.time, rows.time_s, rows[name]) for name in columns])
    velocity += np.random.default_rng(0).normal(0.0, SD_VELOCITY, velocity.shape)
    return replace(gnss, velocity_n=velocity, sd_velocity=np.full(velocity.shape, SD_VELOCITY))


def _filterpy(problem: _Problem, step: int) -> float | None:
    """CPU time [us] per sample of FilterPy's unscented filter, `step` increments to a prediction; None without it."""
    try:
        kalman: Any = importlib.import_module("filterpy.kalman")
    except ImportError:
        return None
    increments, start, model = problem.increments, problem.start, problem.model
    nav = start.nav
    metres = np.array([WGS84_A, WGS84_A * math.cos(nav[0]), 1.0])

    def pack(now: np.ndarray) -> np.ndarray:
        attitude = rotvec_from_quat((now[6], now[7], now[8], now[9]))
        return np.concatenate([(now[:3] - nav[:3]) * metres, now[3:6], attitude])

    def advance(x: np.ndarray, _: float, at: int) -> np.ndarray:
        now = np.concatenate([nav[:3] + x[:3] / metres, x[3:6], quat_from_rotvec((x[6], x[7], x[8]))])
        for k in range(at, at + step):
            dt = increments.time[k + 1] - increments.time[k]
            step_ned(now, dt, *(increments.inc_theta_b[k] - x[9:12] * dt), *(increments.inc_v_b[k] - x[12:15] * dt))
        return np.concatenate([pack(now), x[9:]])

    period = step * float(increments.time[1] - increments.time[0])
    points = kalman.MerweScaledSigmaPoints(15, math.sqrt(3.0 / 15.0), 2.0, 0.0)
    peer = kalman.UnscentedKalmanFilter(15, 6, period, lambda x: x[:6], advance, points)
    peer.x = np.concatenate([pack(nav), np.zeros(6)])
    sd = np.concatenate([np.full(3, 1.5e-4), np.full(3, 1.5e-3)])
    peer.P = np.diag(np.concatenate([np.diag(start.P), sd**2]))
    walk = np.repeat([1e-8, model.vrw**2, model.arw**2, 1e-16, 1e-14], 3)
    peer.Q = np.diag(walk * period)
    peer.R = np.diag(np.repeat([1.0, SD_VELOCITY**2], 3))
    fixes = np.column_stack([problem.gnss.lat, problem.gnss.lon, problem.gnss.height])
    fixes = np.hstack([(fixes - nav[:3]) * metres, problem.gnss.velocity_n])
    samples = int(PEER_SECONDS / period) * step
    due = int(np.searchsorted(problem.gnss.time, start.time + 1e-6))
    peer.predict(at=0)
    begin = time.process_time()
    for at in range(step, step + samples, step):
        peer.predict(at=at)
        if increments.time[at + step] >= problem.gnss.time[due] - 1e-6:
            peer.update(fixes[due])
            due += 1
    if not np.isfinite(peer.x).all():
        raise RuntimeError("FilterPy's filter has broken down")
    return 1e6 * (time.process_time() - begin) / samples


if __name__ == "__main__":
    main()
