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

ALLAN_KINDS = ("adev", "oadev", "totdev")
"""Deviations that estimate the Allan deviation, in which the model is written."""


def figure_allan(study: AllanStudy) -> Figure:
    """One panel for each axis, a row for each sensor; the legend of a panel stands below it, off the curves.

    Parameters
    ----------
    study : AllanStudy
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    sensors = [sensor for sensor in ("gyro", "accel") if study.of(sensor)]
    columns = max(len(study.of(sensor)) for sensor in sensors)
    figure = Figure(figsize=(1.0 + 4.6 * columns, 0.6 + 4.9 * len(sensors)), layout="constrained", dpi=130)
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(sensors), columns, squeeze=False)
    for row, sensor in enumerate(sensors):
        axes = study.of(sensor)
        reach = row_limits(study, sensor)
        for column in range(columns):
            if column < len(axes):
                _panel(grid[row, column], study, axes[column], reach)
            else:
                grid[row, column].set_visible(False)
        grid[row, 0].set_ylabel(f"{KINDS[study.settings.kinds[0]]} [{RATE_UNITS[sensor][0]}]")
    figure.suptitle(f"{Path(study.source).name}: {duration(study.span)} at rest, {study.rate:.6g} Hz", fontsize=11)
    return figure


def row_limits(study: AllanStudy, sensor: str) -> tuple[float, float]:
    """Limits of the deviations of all axes of a sensor, in the unit for people; half a decade of room at both ends.

    Intervals that end at nothing or infinity reach out of the panel.
    """
    _, _, factor = RATE_UNITS[sensor]
    values = np.concatenate([axis.curves[study.settings.kinds[0]].deviation for axis in study.of(sensor)]) / factor
    values = values[np.isfinite(values) & (values > 0.0)]
    if values.size == 0:
        return 1e-3, 1e3
    return float(values.min()) / 3.0, float(values.max()) * 3.0


def duration(seconds: float) -> str:
    """A time for people: seconds up to two minutes, minutes up to two hours, then hours."""
    for limit, size, unit in ((120.0, 1.0, "s"), (7200.0, 60.0, "min")):
        if seconds < limit:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 3600.0:.3g} h"


def level_text(level: float) -> str:
    """Probability of the intervals."""
    return f"{100.0 * level:.3g} % interval"


def model_label(kind: str) -> str:
    """Name of the model's curve, which is an Allan deviation, beside deviations of some kind."""
    return "fitted model" if kind in ALLAN_KINDS else "fitted model as Allan deviation"


def _panel(axes: Axes, study: AllanStudy, axis: AxisStudy, reach: tuple[float, float]) -> None:
    _, _, factor = RATE_UNITS[axis.sensor]
    curve = axis.curves[study.settings.kinds[0]]
    value, low, high = (x / factor for x in (curve.deviation, curve.low, curve.high))
    axes.errorbar(
        curve.tau,
        value,
        yerr=np.array([value - low, high - value]),
        fmt=".",
        color=POINTS,
        markersize=4,
        linewidth=0.8,
        alpha=0.9,
        label=f"measured, {level_text(study.settings.level)}",
    )
    tau = np.geomspace(curve.tau[0], curve.tau[-1], 300)
    present = [term for term in axis.identification.terms if term.present]
    if present:
        whole = np.sqrt(axis.identification.allan_variance(tau)) / factor
        axes.plot(tau, whole, color=MODEL, linewidth=1.5, label=model_label(study.settings.kinds[0]))
    for name in dict.fromkeys(term.name for term in present):
        line = np.sqrt(axis.identification.allan_variance(tau, name)) / factor
        label = legend_of([term.value for term in present if term.name == name], name, axis.sensor)
        axes.plot(tau, line, "--", color=TERM_COLORS[name], linewidth=1.1, label=label)
    axes.set(xscale="log", yscale="log", ylim=reach, xlabel="averaging time [s]")
    axes.set_title(axis.name, fontsize=10)
    axes.grid(which="major", alpha=0.35)
    axes.grid(which="minor", alpha=0.12)
    handles, labels = axes.get_legend_handles_labels()
    handles, labels = handles[-1:] + handles[:-1], labels[-1:] + labels[:-1]
    axes.legend(
        handles, labels, fontsize=7.5, frameon=False, loc="upper left", bbox_to_anchor=(-0.02, -0.13), borderaxespad=0.0
    )


def legend_of(values: list[float], name: str, sensor: str) -> str:
    """A term with its value, or those of several of one kind, for a legend."""
    unit, _, factor = TERM_UNITS[sensor][name][0]
    text = f"{name} = {', '.join(significant(value / factor, 3) for value in values)} {unit}, {NAMES[sensor][name]}"
    return f"{text} (floor {significant(FLOOR * values[0] / factor, 3)} {unit})" if name == "B" else text


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
