"""A comparison of estimators as one figure for papers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from navfuse.report.comparison_curves import Panel, panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from navfuse.analysis.filter_comparison import FilterComparison

SETTLING = 0.1


def figure_comparison(comparison: FilterComparison) -> Figure:
    """Panels of all curves in two columns; filters in full lines, smoothers dashed.

    Parameters
    ----------
    comparison : FilterComparison
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 14.5), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplot_mosaic(
        [
            ["track", "altitude"],
            ["latitude", "longitude"],
            ["great-circle", "great-circle"],
            ["distance", "distance"],
            ["running-rmse", "running-rmse"],
        ]
    )
    drawn = panels(comparison)
    for panel in drawn:
        _draw(grid[panel.key], panel)
    handles, labels = grid[drawn[0].key].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 9), fontsize=8, frameon=False)
    figure.suptitle(f"{Path(comparison.project).name}: {', '.join(comparison.estimators)}", fontsize=12)
    return figure


def _draw(axes: Axes, panel: Panel) -> None:
    for curve in panel.curves:
        style = "--" if curve.kind == "smoother" else "-"
        axes.plot(curve.x, curve.y, style, color=curve.color, linewidth=curve.width, label=curve.name)
    title = panel.title
    axes.set(xlabel=panel.x, ylabel=panel.y)
    axes.ticklabel_format(useOffset=False)
    axes.grid(alpha=0.3)
    if panel.ratio:
        axes.set_aspect(panel.ratio, adjustable="datalim")
    else:
        axes.margins(x=0.0)
    if panel.from_zero:
        top, highest = _top(panel)
        axes.set_ylim(0.0, top)
        title += f"; at the start up to {highest:.3g} m, off the scale" if highest > top else ""
        axes.legend(fontsize=7, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes.set_title(title, fontsize=10)


def _top(panel: Panel) -> tuple[float, float]:
    """Upper end of an axis that shows the settled curves, and the highest value.

    An error of the first tenth of the time is cut off if it is more than twice as large as all that follow.
    """
    begin = min(curve.x[0] for curve in panel.curves)
    settled = begin + SETTLING * (max(curve.x[-1] for curve in panel.curves) - begin)
    highest = max(float(np.nanmax(curve.y)) for curve in panel.curves)
    later = max((float(np.nanmax(curve.y[curve.x >= settled])) for curve in panel.curves), default=highest)
    return (1.25 * later if highest > 2.0 * later > 0.0 else 1.05 * highest or 1.0), highest


def write_figure(path: Path, comparison: FilterComparison) -> None:
    """Write the figure as PNG; the file appears whole or not at all.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    from navfuse.io.atomic import atomic_file

    with atomic_file(path) as part:
        figure_comparison(comparison).savefig(part, format="png")
