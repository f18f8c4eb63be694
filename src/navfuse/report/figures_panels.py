"""Pieces of the figures over time: curves, bands, clouds, shaded outages, and the grid that they stand in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from navfuse.data.result import Innovations, Result
from navfuse.report.figures_style import MARKERS, SHADE, VECTOR_POINTS, Clock, Sheet, legend, time_axis
from navfuse.report.measurement_panels import STATUS_NAMES
from navfuse.report.series import POSITION_SOURCE, decimate, gaps

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = np.ndarray

CURVE_POINTS = 2000
"""Of a curve: one for each 0.09 mm of a double column, and none of the extremes is left out."""
BAND_POINTS = 1000
CLOUD_POINTS = 20000
FEW_POINTS = 600
"""Fewer points are drawn larger."""
BREAK_STEPS, BREAK_S = 5.0, 1.0
"""A curve breaks where a step is longer than so many usual ones and than so many seconds."""
NO_FIX = "no position fix used"
BEYOND = "beyond the axis"


def grid_of(figure: Figure, rows: int, columns: int) -> Array:
    """Panels (rows, columns) with a common time axis; those of the upper rows have no tick labels."""
    return figure.subplots(rows, columns, sharex=True, squeeze=False)


def broken(time: Array, *values: Array) -> tuple[Array, ...]:
    """Time and curves with a NaN put into every gap of the time, so that no line bridges it."""
    steps = np.diff(time)
    if steps.size == 0:
        return (time, *values)
    at = np.flatnonzero(steps > max(BREAK_STEPS * float(np.median(steps)), BREAK_S)) + 1
    if at.size == 0:
        return (time, *values)
    middle = 0.5 * (time[at - 1] + time[at])
    return (np.insert(time, at, middle), *(np.insert(np.asarray(v, dtype=np.float64), at, np.nan) for v in values))


def curve(axes: Axes, x: Array, y: Array, **look: Any) -> None:
    """A line, thinned without losing an extreme, broken at gaps; a single point is a dot."""
    x, y = broken(x, y)
    rows = decimate(y, CURVE_POINTS)
    axes.plot(x[rows], y[rows], marker="." if np.isfinite(y).sum() == 1 else None, markersize=4.0, **look)


def band(axes: Axes, x: Array, low: Array, high: Array, **look: Any) -> None:
    """A filled band, thinned like a curve."""
    x, low, high = broken(x, low, high)
    rows = decimate(np.column_stack((low, high)), BAND_POINTS)
    axes.fill_between(x[rows], low[rows], high[rows], **({"alpha": 0.2, "linewidth": 0} | look))


def steps(axes: Axes, x: Array, y: Array, **look: Any) -> None:
    """A line that keeps its value until the next point."""
    rows = decimate(np.asarray(y, dtype=np.float64), CURVE_POINTS)
    axes.plot(x[rows], y[rows], drawstyle="steps-post", **look)


def cloud(axes: Axes, x: Array, y: Array, status: str, label: str | None = None, **look: Any) -> None:
    """Measurements of one fate; a picture inside the vector formats where there are many."""
    rows = decimate(y, CLOUD_POINTS)
    chosen = MARKERS[status] | look
    chosen["s"] *= float(np.clip(FEW_POINTS / max(rows.size, 1), 1.0, 4.0 if status == "used" else 1.5))
    axes.scatter(
        x[rows],
        y[rows],
        label=label or STATUS_NAMES.get(status, status),
        rasterized=rows.size > VECTOR_POINTS,
        **chosen,
    )


def clouds(
    axes: Axes, clock: Clock, records: Innovations, values: Array, limits: tuple[float, float] | None = None
) -> None:
    """Measurements by fate over time; what lies beyond the limits is drawn at them, as a triangle that points out."""
    for status in STATUS_NAMES:
        chosen = (records.status == status) & np.isfinite(values)
        if not chosen.any():
            continue
        x, y = clock(records.time[chosen]), values[chosen]
        inside = np.ones(y.size, dtype=bool) if limits is None else (y >= limits[0]) & (y <= limits[1])
        cloud(axes, x[inside], y[inside], status, zorder=2.5)
        if limits is not None:
            for beyond, limit, marker in ((y < limits[0], limits[0], "v"), (y > limits[1], limits[1], "^")):
                if beyond.any():
                    color = MARKERS[status].get("color", MARKERS[status].get("edgecolors"))
                    axes.plot(
                        x[beyond], np.full(int(beyond.sum()), limit), marker, color=color, markersize=3.0,
                        markeredgewidth=0.0, linestyle="none", clip_on=False, zorder=3.0,
                    )  # fmt: skip


def beyond_edge(axes: Axes, x: Array, y: Array, limit: float, color: str) -> None:
    """Triangles that point out, at the edges of a panel from -limit to limit, where a curve leaves it."""
    for beyond, edge, marker in ((y < -limit, -limit, "v"), (y > limit, limit, "^")):
        rows = np.flatnonzero(beyond)
        if rows.size:
            rows = rows[np.unique(np.linspace(0, rows.size - 1, 200).astype(np.int64))]
            axes.plot(
                x[rows], np.full(rows.size, edge), marker, color=color, markersize=3.0, markeredgewidth=0.0,
                linestyle="none", clip_on=False, zorder=3.0, label=BEYOND,
            )  # fmt: skip


def shade(panels: Sequence[Axes], clock: Clock, result: Result) -> None:
    """Shade the stretches without a used position fix, where the run has position fixes at all."""
    from matplotlib.collections import PolyCollection

    if POSITION_SOURCE not in result.innovations.sources:
        return
    windows = [(clock.at(w.start), clock.at(w.end)) for w in gaps(result)]
    if not windows:
        return
    corners = [((a, 0.0), (a, 1.0), (b, 1.0), (b, 0.0)) for a, b in windows]
    for axes in panels:
        patch = PolyCollection(corners, transform=axes.get_xaxis_transform(), label=NO_FIX, zorder=0.5, **SHADE)
        axes.add_collection(patch, autolim=False)


def finish(
    figure: Figure, grid: Array, paper: Sheet, clock: Clock, result: Result, span: tuple[float, float] | None = None
) -> None:
    """Time axis, shaded outages and the legend of a grid of panels."""
    first, last = (float(t) for t in result.forward.time[[0, -1]])
    panels = [axes for axes in grid.flat if axes.get_visible()]
    shade(panels, clock, result)
    room = paper.width / 25.4 * 72.0 * 0.75 / grid.shape[1]
    common = grid.shape[1] > 1 and 0.6 * paper.font * len(clock.label) > room
    if common:
        figure.supxlabel(clock.label, fontsize=paper.font)
    for column in grid.T:
        shown = [axes for axes in column if axes.get_visible()]
        for axes in shown:
            time_axis(axes, clock, span or (first, last), label=axes is shown[-1] and not common)
        if shown:
            shown[-1].tick_params(labelbottom=True)
    legend(figure, panels, paper)
