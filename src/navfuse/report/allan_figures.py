"""Allan deviations of a static record as a figure: points with intervals, the fitted model, its asymptotes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from navfuse.analysis.allan.deviations import KINDS
from navfuse.analysis.allan.terms import FLOOR, NAMES
from navfuse.report.allan_units import RATE_UNITS, TERM_UNITS, significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from navfuse.analysis.allan.study import AllanStudy, AxisStudy

POINTS, MODEL = "#2563c9", "#d9600a"
TERM_COLORS = {
    "Q": "#7c3aed", "N": "#0e8a7d", "B": "#c01f2e", "K": "#a15c00", "R": "#6b7280", "GM": "#be185d", "sin": "#475569",
}  # fmt: skip


def figure_allan(study: AllanStudy) -> Figure:
    """One panel for each axis, a row for each sensor.

    Parameters
    ----------
    study : AllanStudy
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    sensors = [sensor for sensor in ("gyro", "accel") if study.of(sensor)]
    columns = max(len(study.of(sensor)) for sensor in sensors)
    figure = Figure(figsize=(1.0 + 4.6 * columns, 0.6 + 4.1 * len(sensors)), layout="constrained", dpi=130)
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(sensors), columns, squeeze=False, sharex=True, sharey="row")
    for row, sensor in enumerate(sensors):
        axes = study.of(sensor)
        for column in range(columns):
            if column < len(axes):
                _panel(grid[row, column], study, axes[column])
            else:
                grid[row, column].set_visible(False)
        grid[row, 0].set_ylabel(f"{KINDS[study.settings.kinds[0]]} [{RATE_UNITS[sensor][0]}]")
    for axes in grid[-1]:
        axes.set_xlabel("averaging time [s]")
    figure.suptitle(
        f"{Path(study.source).name}: {study.span / 3600.0:.3g} h at rest, {study.rate:.6g} Hz; bars: "
        f"{100.0 * study.settings.level:.3g} % intervals",
        fontsize=10,
    )
    return figure


def _panel(axes: Axes, study: AllanStudy, axis: AxisStudy) -> None:
    _, _, factor = RATE_UNITS[axis.sensor]
    curve = axis.curves[study.settings.kinds[0]]
    value, low, high = (x / factor for x in (curve.deviation, curve.low, curve.high))
    bars = np.array([value - low, high - value])
    axes.errorbar(
        curve.tau, value, yerr=bars, fmt=".", color=POINTS, markersize=4, linewidth=0.8, alpha=0.9, label="measured"
    )
    tau = np.geomspace(curve.tau[0], curve.tau[-1], 300)
    reach = (float(np.nanmin(low)) / 3.0, float(np.nanmax(value)) * 3.0)
    for term in axis.identification.terms:
        if not term.present:
            continue
        line = np.sqrt(axis.identification.allan_variance(tau, term.name)) / factor
        line = np.where((line > reach[0]) & (line < reach[1]), line, np.nan)
        axes.plot(
            tau,
            line,
            "--",
            color=TERM_COLORS[term.name],
            linewidth=1.0,
            label=legend_of(term.name, term.value, axis.sensor),
        )
    if any(term.present for term in axis.identification.terms):
        whole = np.sqrt(axis.identification.allan_variance(tau)) / factor
        axes.plot(tau, whole, color=MODEL, linewidth=1.4, label="fitted model")
    axes.set(xscale="log", yscale="log", ylim=reach)
    axes.set_title(axis.name, fontsize=10)
    axes.grid(which="major", alpha=0.35)
    axes.grid(which="minor", alpha=0.12)
    axes.legend(fontsize=7, framealpha=0.9)


def legend_of(name: str, value: float, sensor: str) -> str:
    """A term with its value, for a legend."""
    unit, _, factor = TERM_UNITS[sensor][name][0]
    text = f"{name} = {significant(value / factor, 3)} {unit}, {NAMES[sensor][name]}"
    return f"{text} (floor {significant(FLOOR * value / factor, 3)})" if name == "B" else text


def write_figure(path: Path, study: AllanStudy) -> None:
    """Write the figure as PNG; the file appears whole or not at all.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    from navfuse.io.atomic import atomic_file

    with atomic_file(path) as part:
        figure_allan(study).savefig(part, format="png")
