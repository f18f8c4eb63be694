"""Pictures of studies: panels of curves described as data, drawn with matplotlib."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from navfuse.report.series import decimate

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

Array = np.ndarray

CURVE_POINTS = 4000
COLORS = ("#2563c9", "#d9600a", "#0e8a7d", "#7c3aed", "#c01f2e", "#3a3f47")
STYLES = ("-", "--", "-.", ":")


@dataclass(frozen=True, slots=True)
class Curve:
    """A curve of a panel.

    Attributes
    ----------
    name : str
        In the legend; curves of one name have one colour in all panels.
    x, y : (n,) arrays
        In the units that the panel names.
    kind : {"line", "points", "band", "guide"}
        A band reaches from -y to y; a guide is a thin dotted line.
    """

    name: str
    x: Array
    y: Array
    kind: str = "line"


@dataclass(frozen=True, slots=True)
class Panel:
    """A pair of axes: labels with units, curves, whether an axis is logarithmic or both have one scale."""

    xlabel: str
    ylabel: str
    curves: tuple[Curve, ...]
    title: str = ""
    log: str = ""
    """Any of "x", "y", "xy"."""
    equal: bool = False
    limit: tuple[float, float] | None = None
    """Of y; None leaves it to the curves."""


@dataclass(frozen=True, slots=True)
class Picture:
    """Panels in rows of `columns`."""

    title: str
    panels: tuple[Panel, ...]
    columns: int = 1
    width_in: float = 7.2
    row_in: float = 2.2


def draw(picture: Picture) -> Figure:
    """Draw a picture; text is never read as mathematics."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = -(-len(picture.panels) // picture.columns)
    figure = Figure(figsize=(picture.width_in, picture.row_in * rows + 0.6), layout="constrained", dpi=150)
    FigureCanvasAgg(figure)
    figure.suptitle(picture.title, fontsize=10, parse_math=False)
    grid = figure.subplots(rows, picture.columns, squeeze=False)
    names = list(dict.fromkeys(curve.name for panel in picture.panels for curve in panel.curves))
    seen: dict[str, Artist] = {}
    for axes, panel in zip(grid.flat, picture.panels, strict=False):
        for curve in panel.curves:
            place = names.index(curve.name)
            color, style = COLORS[place % len(COLORS)], STYLES[place // len(COLORS) % len(STYLES)]
            x, y = np.asarray(curve.x, dtype=float), np.asarray(curve.y, dtype=float)
            if curve.kind == "points":
                drawn = axes.plot(x, y, ".", color=color, markersize=3, alpha=0.6, rasterized=x.size > CURVE_POINTS)[0]
            elif curve.kind == "band":
                shown = decimate(y, CURVE_POINTS)
                drawn = axes.fill_between(x[shown], -y[shown], y[shown], color=color, alpha=0.18, linewidth=0)
            else:
                shown = decimate(y, CURVE_POINTS)
                width = 0.8 if curve.kind == "guide" else 1.1
                look = ":" if curve.kind == "guide" else style
                drawn = axes.plot(x[shown], y[shown], look, color=color, linewidth=width)[0]
            seen.setdefault(curve.name, drawn)
        axes.set_xlabel(panel.xlabel, fontsize=8, parse_math=False)
        axes.set_ylabel(panel.ylabel, fontsize=8, parse_math=False)
        axes.set_title(panel.title, fontsize=9, parse_math=False)
        axes.tick_params(labelsize=8)
        axes.grid(alpha=0.3)
        if "x" in panel.log:
            axes.set_xscale("log")
        if "y" in panel.log:
            axes.set_yscale("log")
        if panel.equal:
            axes.set_aspect("equal", adjustable="datalim")
        if panel.limit is not None:
            axes.set_ylim(*panel.limit)
    for axes in grid.flat[len(picture.panels) :]:
        axes.set_visible(False)
    legend = figure.legend(
        list(seen.values()), list(seen), loc="outside lower center", ncols=min(len(seen), 5), fontsize=8, frameon=False
    )
    for text in legend.get_texts():
        text.set_parse_math(False)
    return figure
