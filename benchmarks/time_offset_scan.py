"""The time offset that the filter itself prefers, beside the one estimated before any filter runs.

    python -m benchmarks.time_offset_scan [--from -0.4 --to 0.2 --step 0.1]

Runs the real drive with the extended Kalman filter at offsets on a coarse grid, then on a grid of a quarter of its
steps about the best, and fits a parabola to the normalized innovations squared there, of used and rejected fixes alike.
"""

from __future__ import annotations

import argparse
import copy
import warnings
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import navfuse
from benchmarks.logs import rtk_project
from navfuse.errors import NavfuseWarning
from navfuse.imu.time_offset import estimate_time_offset

USES = (("position",), ("velocity",), ("position", "velocity"))
LIMIT = 100.0
"""A normalized innovation squared counts up to this times its degrees of freedom, lest a few wrong fixes decide."""


def cost(project: dict[str, Any], offset: float, use: tuple[str, ...]) -> tuple[float, float]:
    """Mean normalized innovation squared per degree of freedom, and median horizontal innovation of the first of `use`.

    Parameters
    ----------
    project : dict
        Without outages.
    offset : float [s]
        For ``imu.time_offset_s``.
    use : tuple of str
        For ``gnss.use``.
    """
    settings = copy.deepcopy(project)
    settings["imu"]["time_offset_s"] = float(offset)
    settings["gnss"]["use"] = list(use)
    settings["filter"] = {"estimator": "ekf"}
    settings["smoother"] = {"method": "none"}
    settings["output"] = {"rate_hz": 1.0}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NavfuseWarning)
        log = navfuse.process(settings).innovations
    tested = log.dof > 0
    nis = np.minimum(log.nis[tested] / log.dof[tested], LIMIT)
    first = tested & (log.source == f"gnss_{use[0]}")
    return float(nis.mean()), float(np.sqrt(np.median(np.sum(log.z[first, :2] ** 2, axis=1))))


def best_offset(project: dict[str, Any], grid: np.ndarray, use: tuple[str, ...]) -> tuple[float, list[tuple]]:
    """Offset of the least cost, and all that was tried: (offset, mean NIS, innovation)."""
    tried = [(offset, *cost(project, offset, use)) for offset in grid]
    step = 0.25 * (grid[1] - grid[0])
    least = min(tried, key=lambda row: row[1])[0]
    tried += [(offset, *cost(project, offset, use)) for offset in least + step * np.array([-3, -2, -1, 1, 2, 3])]
    tried.sort()
    offsets, costs = np.array([row[0] for row in tried]), np.array([row[1] for row in tried])
    near = np.abs(offsets - offsets[np.argmin(costs)]) < 2.5 * step
    curve = np.polyfit(offsets[near], costs[near], 2)
    vertex = -0.5 * curve[1] / curve[0] if curve[0] > 0.0 else offsets[np.argmin(costs)]
    return float(np.clip(vertex, offsets[near].min(), offsets[near].max())), tried


def main() -> None:
    """Print the offsets of filter and estimator."""
    parser = argparse.ArgumentParser(description="The time offset by the filter and by the estimator.")
    parser.add_argument("--from", dest="begin", type=float, default=-0.4)
    parser.add_argument("--to", type=float, default=0.2)
    parser.add_argument("--step", type=float, default=0.1)
    arguments = parser.parse_args()
    found = rtk_project()
    if found is None:
        raise SystemExit("the real drive is not beside the project")
    project, gnss_file = found
    project["gnss"].pop("outages_s")
    grid = np.arange(arguments.begin, arguments.to + 0.5 * arguments.step, arguments.step)
    console = Console()
    table = Table("fixes used", "offset [s]", "mean NIS per dof", "median innovation")
    for use in USES:
        best, tried = best_offset(project, grid, use)
        for offset, nis, innovation in tried:
            table.add_row(", ".join(use), f"{offset:+.3f}", f"{nis:.3f}", f"{innovation:.4f}")
        table.add_row(", ".join(use), f"[bold]{best:+.3f}[/bold]", "least", "", end_section=True)
    console.print(table)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NavfuseWarning)
        imu, gnss = navfuse.read_imu(project["imu"]["file"]), navfuse.read_gnss(gnss_file)
    told = estimate_time_offset(imu, gnss)
    console.print(f"estimated before the filter: {told.offset} s, sd {told.sd} s, {told.used}; {' '.join(told.notes)}")


if __name__ == "__main__":
    main()
