"""Figures of a Monte Carlo campaign: normalized errors within their bounds, and RMSE against sigma."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from navfuse.analysis.ensemble import Average, Rmse

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MEAN, BOUNDS, SIGMA = "#2563c9", "#0e8a7d", "#d9600a"
COLUMNS = 3
UNIT_TEXT = {"mps": "m/s", "dph": "deg/h", "si": "SI"}


def figure_averages(averages: Sequence[Average], quantity: str = "NEES", settle_s: float | None = None) -> Figure:
    """Average NEES or NIS per degree of freedom over time, one panel each, with the bounds that belong to it.

    Parameters
    ----------
    averages : sequence of Average
    quantity : str
        For the axis.
    settle_s : float [s], optional
        The time before it is shaded: it is not judged.
    """
    figure = _figure(7.5, 0.6 + 1.45 * len(averages))
    grid = figure.subplots(len(averages), 1, sharex=True, squeeze=False)[:, 0]
    for axes, entry in zip(grid, averages, strict=True):
        axes.fill_between(entry.time, entry.low, entry.high, color=BOUNDS, alpha=0.25, linewidth=0, label="99 % bounds")
        axes.plot(entry.time, entry.mean, color=MEAN, linewidth=1.0, label="average over the runs")
        axes.axhline(1.0, color="0.4", linewidth=0.6, linestyle=":")
        if settle_s is not None and settle_s > entry.time[0]:
            axes.axvspan(entry.time[0], settle_s, color="0.5", alpha=0.15, linewidth=0)
        low, high = min(entry.low.min(), entry.mean.min()), max(entry.high.max(), entry.mean.max())
        if high > 4.0:
            axes.set_yscale("log")
        else:
            margin = 0.15 * (high - low)
            axes.set_ylim(low - margin, high + margin)
        axes.set_title(entry.name.replace("_", " "), fontsize=9)
        axes.margins(x=0.0)
        axes.grid(alpha=0.3)
        axes.set_ylabel(f"{quantity} / dof [1]", fontsize=8)
    grid[-1].set_xlabel("time [s]")
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncols=2, fontsize=8, frameon=False)
    return figure


def figure_rmse(rms: Sequence[Rmse]) -> Figure:
    """RMSE over the runs against the mean sigma of the filter, over time, one panel for each component."""
    rows = -(-len(rms) // COLUMNS)
    figure = _figure(9.0, 0.6 + 1.7 * rows)
    grid = figure.subplots(rows, COLUMNS, sharex=True, squeeze=False)
    for axes in grid.flat[len(rms) :]:
        axes.set_visible(False)
    for axes, entry in zip(grid.flat, rms, strict=False):
        factor, unit = entry.component.factor, entry.component.unit
        axes.plot(entry.time, entry.rmse * factor, color=MEAN, linewidth=1.0, label="RMSE over the runs")
        axes.plot(entry.time, entry.sigma * factor, color=SIGMA, linewidth=1.2, linestyle="--", label="claimed sigma")
        axes.set_ylim(0.0, 1.1 * factor * float(np.max([entry.rmse.max(), entry.sigma.max()])))
        axes.set_title(f"{entry.component.name.replace('_', ' ')}: ratio {entry.ratio:.2f}", fontsize=9)
        axes.set_ylabel(f"[{UNIT_TEXT.get(unit, unit)}]", fontsize=8)
        axes.margins(x=0.0)
        axes.grid(alpha=0.3)
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncols=2, fontsize=8, frameon=False)
    return figure


def _figure(width: float, height: float) -> Figure:
    """Margins by hand: the automatic layout takes seconds for this many panels."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=100)
    FigureCanvasAgg(figure)
    figure.subplots_adjust(
        left=0.75 / width,
        right=1.0 - 0.15 / width,
        bottom=0.5 / height,
        top=1.0 - 0.55 / height,
        hspace=0.35,
        wspace=0.3,
    )
    return figure
