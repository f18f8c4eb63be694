"""Figures for papers and the demo: matplotlib without its global state, so no window and no style left behind."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from navfuse.analysis.metrics import ErrorSeries, errors
from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.report.panels import AXES, MAP_POINTS, UNITS, solutions_of
from navfuse.report.series import NAMES, decimate, east_north, fix_status, gaps, origin_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = {"forward": "#2563c9", "smoothed": "#d9600a", "truth": "#3a3f47"}
MARKERS = {
    "used": {"marker": ".", "color": "#0e8a7d", "s": 6},
    "reset": {"marker": "*", "color": "#a15c00", "s": 40},
    "rejected": {"marker": "x", "color": "#c01f2e", "s": 24, "linewidths": 1.2},
    "withheld": {"marker": "D", "facecolors": "none", "edgecolors": "#7c3aed", "s": 14, "linewidths": 0.8},
}
CURVE_POINTS = 4000


def figure_map(result: Result, truth: Trajectory | None = None) -> Figure:
    """Map of the tracks and of the GNSS fixes by their fate, in metres east and north of the start, to scale."""
    figure = _figure(7.0, 5.4)
    axes = figure.add_subplot()
    origin = origin_of(result.forward)
    status = fix_status(result)
    if result.fixes is not None and status is not None:
        plane = east_north(result.fixes, origin)
        for name, style in MARKERS.items():
            chosen = status == name
            if chosen.any():
                axes.scatter(plane[chosen, 0], plane[chosen, 1], label=f"fixes {name}", zorder=2.0, **style)
    for role, trajectory in solutions_of(result, truth).items():
        plane = east_north(trajectory, origin)
        rows = decimate(plane, MAP_POINTS)
        dotted = ":" if role == "truth" else "-"
        axes.plot(
            plane[rows, 0], plane[rows, 1], dotted, color=COLORS[role], label=NAMES[role], linewidth=1.3, zorder=3.0
        )
    axes.plot(0.0, 0.0, "k*", markersize=9, label="start", zorder=4.0)
    axes.set(xlabel="east of the start [m]", ylabel="north of the start [m]", aspect="equal")
    axes.set_adjustable("datalim")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, framealpha=0.9)
    return figure


def figure_errors(result: Result, truth: Trajectory) -> Figure:
    """Position, velocity and attitude errors inside their 3-sigma envelopes, filter and smoother, over log time.

    A row per component and a column per kind; stretches without a used fix are shaded. The vertical range follows the
    errors and the smoother's envelope; a wider envelope of the filter runs out of the picture.
    """
    series = {role: errors(trajectory, truth) for role, trajectory in solutions_of(result).items()}
    blocks = [block for block in AXES if any(getattr(entry, block) is not None for entry in series.values())]
    figure = _figure(4.4 * len(blocks), 6.4)
    grid = figure.subplots(3, len(blocks), sharex=True, squeeze=False)
    for column, block in enumerate(blocks):
        for row, axis in enumerate(AXES[block]):
            _draw_errors(grid[row, column], series, block, row)
            grid[row, column].set_ylabel(f"{axis} [{UNITS[block][0]}]")
            for window in gaps(result):
                grid[row, column].axvspan(window.start, window.end, color="0.5", alpha=0.15, linewidth=0)
        grid[0, column].set_title(f"{block} error", fontsize=10)
        grid[2, column].set_xlabel("log time [s]")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), fontsize=8, frameon=False)
    return figure


def _draw_errors(axes: Axes, series: dict[str, ErrorSeries], block: str, k: int) -> None:
    scale = UNITS[block][1]
    reach = 0.0
    for role, entry in series.items():
        values, sd = getattr(entry, block), getattr(entry, f"sd_{block}")
        if values is None:
            continue
        value = values[:, k] * scale
        limit = np.full_like(value, np.nan) if sd is None else 3.0 * sd[:, k] * scale
        rows = decimate(np.column_stack((value, limit)) if sd is not None else value, CURVE_POINTS)
        time = entry.time[rows]
        if sd is not None:
            axes.fill_between(
                time,
                -limit[rows],
                limit[rows],
                color=COLORS[role],
                alpha=0.18,
                linewidth=0,
                label=f"{NAMES[role]} ±3σ",
            )
        axes.plot(time, value[rows], color=COLORS[role], linewidth=0.9, label=NAMES[role])
        tight = np.percentile(limit, 95.0) if sd is not None else 0.0
        reach = max(reach, float(np.nanmax(np.abs(value))), float(tight))
    if reach > 0.0:
        axes.set_ylim(-1.08 * reach, 1.08 * reach)
    axes.margins(x=0.0)
    axes.grid(alpha=0.3)


def _figure(width: float, height: float) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained", dpi=150)
    FigureCanvasAgg(figure)
    return figure
