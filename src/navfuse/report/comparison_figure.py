"""A comparison of estimators as one figure for papers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from navfuse.report.comparison_curves import Panel, panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from navfuse.analysis.filter_comparison import FilterComparison

_STYLES = {"filter": "-", "smoother": "--", "reference": "-"}
_WIDTHS = {"filter": 1.2, "smoother": 0.9, "reference": 3.0}


def figure_comparison(comparison: FilterComparison) -> Figure:
    """Panels of all curves in two columns; filters in full lines, smoothers dashed.

    Parameters
    ----------
    comparison : FilterComparison
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 14.5), dpi=130, layout="constrained")
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
    for panel in panels(comparison):
        _draw(grid[panel.key], panel)
    figure.suptitle(f"{Path(comparison.project).name}: {', '.join(comparison.estimators)}", fontsize=12)
    return figure


def _draw(axes: Axes, panel: Panel) -> None:
    for curve in panel.curves:
        axes.plot(
            curve.x, curve.y, _STYLES[curve.kind], color=curve.color, linewidth=_WIDTHS[curve.kind], label=curve.name
        )
    axes.set_title(panel.title, fontsize=10)
    axes.set(xlabel=panel.x, ylabel=panel.y)
    axes.ticklabel_format(useOffset=False)
    if panel.ratio:
        axes.set_aspect(panel.ratio, adjustable="datalim")
    else:
        axes.margins(x=0.0)
    if panel.from_zero:
        axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7, framealpha=0.9)


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
