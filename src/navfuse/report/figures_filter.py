"""Figures of the filter at work: innovations in their gates, normalised residuals, NIS, sensor states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from navfuse.analysis.consistency import PROBABILITY
from navfuse.data.result import Innovations, Result, StateHistory
from navfuse.report.curves import AXES, STATE_UNITS, UNITS
from navfuse.report.figures_panels import band, clouds, curve, finish, grid_of
from navfuse.report.figures_style import (
    COLORS,
    GUIDE,
    FigureUnavailable,
    Sheet,
    Size,
    clock_of,
    drawing,
    height_of,
    legend,
    log_axis,
    meant,
    plain,
    sheet,
)
from navfuse.report.measurement_panels import gate_of
from navfuse.report.quality import normalised, residual_histogram, running_nis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = np.ndarray

BIASES = ("gyro_bias", "accel_bias")
GATED = ("gnss_position", "gnss_velocity")
"""Sources whose gate stands in the settings of a run."""
USED_REACH = 1.15
NEAR_GATE = 1.6
SMALL_NIS_PERCENT = 0.5
MOST_NARROW_ROWS = 10


def figure_innovations(result: Result, *, size: Size = "double", time: str = "auto") -> Figure:
    """Innovations of every source by their fate, three of their standard deviations, and the gate of GNSS fixes.

    The gate tests all components together; its line is where one component alone would meet it. The range follows the
    used ones and three standard deviations; what lies beyond is a triangle at the edge that points out.

    Parameters
    ----------
    result : Result
    size : str or (float, float)
        See :func:`navfuse.report.figures_style.sheet`.
    time : str
        Of the axis: ``auto``, ``gps``, ``utc`` or ``log``.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    FigureUnavailable
        If the run has no innovations.
    """
    sources = _sources(result, "innovations")
    paper, clock = sheet(size), clock_of(result, time)
    columns = [(name, min(int(records.dof.max()), records.z.shape[1])) for name, records in sources.items()]
    across = _across(columns, paper)
    with drawing(paper, _columns_height(columns, across, paper)) as figure:
        grid, places = _columns(figure, columns, across)
        for name, count in columns:
            records = sources[name]
            labels, unit = _components(name)
            gate = np.sqrt(_gate(result, name, records))
            for k in range(count):
                axes = places[name, k]
                formed = np.isfinite(records.z[:, k]) & np.isfinite(records.sd[:, k])
                order = np.flatnonzero(formed)[np.argsort(records.time[formed], kind="stable")]
                shown, sd = records.select(order), records.sd[order, k]
                limits = _reach(shown, sd, gate[order] * sd, k)
                clouds(axes, clock, shown, shown.z[:, k], limits)
                at = clock(shown.time)
                band(axes, at, -3.0 * sd, 3.0 * sd, color=COLORS["forward"], alpha=0.18, label="±3σ")
                if np.isfinite(gate[order]).any():
                    look = {"color": GUIDE, "linestyle": (0, (5.0, 2.0)), "linewidth": 0.6}
                    curve(axes, at, gate[order] * sd, label="gate", **look)
                    curve(axes, at, -gate[order] * sd, **look)
                axes.set_ylim(*limits)
                axes.set_ylabel(f"{labels[k]} [{unit}]")
            places[name, 0].set_title(_shortened(plain(name), across, paper))
        finish(figure, grid, paper, clock, result)
    return figure


def figure_nis(result: Result, *, size: Size = "double", time: str = "auto") -> Figure:
    """Normalised innovations squared of every source, the 99 % bound, the gate, and the running mean in its bounds.

    Logarithmic. The running mean is per component and has the bounds of a right model with white innovations;
    parameters as :func:`figure_innovations`.
    """
    sources = {name: r for name, r in _sources(result, "nis").items() if (r.nis > 0.0).any()}
    if not sources:
        raise FigureUnavailable("nis: no innovation of this run has a size above zero")
    paper, clock = sheet(size), clock_of(result, time)
    across = 2 if paper.wide else 1
    with drawing(paper, height_of(2 * len(sources) // across, paper, 34.0)) as figure:
        grid = grid_of(figure, 2 * len(sources) // across, across)
        panels = grid.reshape(-1, 2)
        for (name, records), (single, mean) in zip(sources.items(), panels, strict=True):
            formed = records.select(np.flatnonzero(np.isfinite(records.nis) & (records.nis > 0.0)))
            bound = _chi_square(formed.dof)
            low = float(np.percentile(formed.nis, SMALL_NIS_PERCENT))
            clouds(single, clock, formed, formed.nis, (low, np.inf))
            order = np.argsort(formed.time, kind="stable")
            curve(single, clock(formed.time[order]), bound[order], color=GUIDE, label=f"χ² {100.0 * PROBABILITY:g} %")
            gate = _gate(result, name, formed)
            if np.isfinite(gate).any():
                curve(
                    single, clock(formed.time[order]), gate[order],
                    color=GUIDE, linestyle=(0, (5.0, 2.0)), linewidth=0.6, label="gate",
                )  # fmt: skip
            log_axis(single, np.concatenate((formed.nis[formed.nis >= low], bound, gate[np.isfinite(gate)])))
            single.set_ylabel("NIS [1]")
            running = running_nis(records)
            label = f"{100.0 * PROBABILITY:g} % bounds"
            if running.time.size:
                at = clock(running.time)
                order = np.argsort(at, kind="stable")
                band(mean, at[order], running.low[order], running.high[order], color="#2a9d8f", alpha=0.3, label=label)
                curve(mean, at[order], running.mean[order], color=COLORS["forward"], label="running mean")
                log_axis(mean, np.concatenate((running.mean, running.low, running.high)))
            mean.axhline(1.0, color=GUIDE, linewidth=0.5, linestyle=":")
            mean.set_ylabel("NIS / dof [1]")
            ending = f", mean of {running.window}" if running.time.size else ", none used"
            single.set_title(_shortened(plain(name), across, paper))
            mean.set_title(_shortened(plain(name), across, paper, ending))
        finish(figure, grid, paper, clock, result)
    return figure


def figure_residuals(result: Result, *, size: Size = "double") -> Figure:
    """Innovations over their standard deviations as a histogram, against the standard normal; a panel per source.

    Used and rejected ones together: without the rejected the tails would be cut off by the gate. Parameters as
    :func:`figure_innovations`.
    """
    found = {}
    for name, records in _sources(result, "residuals").items():
        histogram = residual_histogram(
            normalised(records.select(np.isin(records.status, ("used", "reset", "rejected"))))
        )
        if histogram.n:
            found[name] = histogram
    if not found:
        raise FigureUnavailable("residuals: no measurement of this run was used or rejected")
    paper = sheet(size)
    across = min(len(found), 3 if paper.wide else 1)
    rows = -(-len(found) // across)
    with drawing(paper, height_of(rows, paper, 62.0 if across < 3 else 50.0, 12.0)) as figure:
        grid = figure.subplots(rows, across, squeeze=False)
        for axes in grid.flat[len(found) :]:
            axes.set_visible(False)
        for axes, (name, histogram) in zip(grid.flat, found.items(), strict=False):
            axes.stairs(histogram.density, histogram.edges, fill=True, color="#9db4d8", label="residuals")
            axes.stairs(histogram.density, histogram.edges, color=COLORS["forward"], linewidth=0.6)
            middle = 0.5 * (histogram.edges[1:] + histogram.edges[:-1])
            axes.plot(
                middle, histogram.expected, color=COLORS["smoothed"], linestyle=(0, (4.0, 1.3)), label="standard normal"
            )
            axes.set(xlim=histogram.edges[[0, -1]], ylim=(0.0, 1.55 * max(histogram.density.max(), 0.4)))
            axes.set(xlabel="residual / its σ [1]", ylabel="density [1]")
            axes.set_title(_shortened(plain(name), across, paper))
            lines = [
                f"n = {histogram.n}, mean {histogram.mean:.2f}, sd {histogram.sd:.2f}",
                f"beyond 3σ: {100.0 * histogram.beyond_3:.2f} % (0.27 %)",
            ]
            lines += [f"{histogram.outside} outside the picture"] if histogram.outside else []
            axes.text(
                0.03, 0.97, "\n".join(lines), transform=axes.transAxes, ha="left", va="top", fontsize=0.85 * paper.font
            )
        legend(figure, [axes for axes in grid.flat if axes.get_visible()], paper)
    return figure


def figure_states(
    result: Result, blocks: Sequence[str] | None = None, *, size: Size = "double", time: str = "auto"
) -> Figure:
    """Every block of sensor states with three standard deviations, a panel per component.

    Parameters
    ----------
    result : Result
    blocks : sequence of str, optional
        Names of blocks in ``result.states``; default all.
    size, time
        As :func:`figure_innovations`.

    Raises
    ------
    FigureUnavailable
        If the run has no such states.
    """
    chosen = _histories(result, blocks)
    paper, clock = sheet(size), clock_of(result, time)
    columns = [(name, history.values.shape[1]) for name, history in chosen.items()]
    across = _across(columns, paper)
    with drawing(paper, _columns_height(columns, across, paper)) as figure:
        grid, places = _columns(figure, columns, across)
        for name, history in chosen.items():
            unit, scale = STATE_UNITS.get(name, ("SI", 1.0))
            count = history.values.shape[1]
            for k in range(count):
                axes = places[name, k]
                value, limit = history.values[:, k] * scale, 3.0 * history.sd[:, k] * scale
                at = clock(history.time)
                band(axes, at, value - limit, value + limit, color=COLORS["forward"], label="±3σ")
                curve(axes, at, value, color=COLORS["forward"], label="filter")
                axes.axhline(0.0, color=GUIDE, linewidth=0.4, linestyle=":", zorder=1.5)
                axes.set_ylabel(f"{'xyz'[k] if count == 3 else k + 1} [{unit}]")
            places[name, 0].set_title(_shortened(plain(name), across, paper))
        finish(figure, grid, paper, clock, result)
    return figure


def figure_biases(result: Result, *, size: Size = "double", time: str = "auto") -> Figure:
    """The biases of gyroscopes and accelerometers: :func:`figure_states` of these two blocks."""
    known = [name for name in BIASES if name in result.states]
    if not known:
        _histories(result, None, "biases")
        raise FigureUnavailable(
            f"biases: this run has no inertial biases among its states ({', '.join(result.states)}); see 'states'"
        )
    return figure_states(result, known, size=size, time=time)


def _sources(result: Result, what: str) -> dict[str, Innovations]:
    """The records of every source that formed an innovation."""
    found = {name: result.innovations.of(name) for name in result.innovations.sources}
    found = {name: records for name, records in found.items() if (records.dof > 0).any()}
    if not found:
        reason = "every measurement came too late" if len(result.innovations) else "it was offered no measurement"
        raise FigureUnavailable(f"{what}: this run has no innovations, {reason}")
    return found


def _histories(result: Result, blocks: Sequence[str] | None, what: str = "states") -> dict[str, StateHistory]:
    states = {name: history for name, history in result.states.items() if history.time.size and history.values.shape[1]}
    if not states:
        raise FigureUnavailable(
            f"{what}: this result has no sensor states (no states.parquet in its folder); run it again with this "
            "version of navfuse"
        )
    if blocks is None:
        return states
    for name in blocks:
        if name not in states:
            raise FigureUnavailable(f"states: no block {name!r} among {', '.join(states)}{meant(name, states)}")
    return {name: states[name] for name in blocks}


def _gate(result: Result, name: str, records: Innovations) -> Array:
    """Gate of each measurement of a source; infinite where the record does not tell."""
    limits = gate_of(result, name, records)
    return np.full(len(records), np.inf) if limits is None else limits


def _reach(records: Innovations, sd: Array, gate: Array, k: int) -> tuple[float, float]:
    """Vertical range: all used innovations, the usual three standard deviations, and the gate where it is not far."""
    used = np.isin(records.status, ("used", "reset"))
    chosen = used if used.any() else np.ones(len(records), dtype=bool)
    reach = max(
        float(np.max(np.abs(records.z[chosen, k]), initial=0.0)),
        3.0 * float(np.percentile(sd, 95.0)) if sd.size else 0.0,
    )
    usual_gate = float(np.median(gate)) if gate.size else np.inf
    if usual_gate < NEAR_GATE * reach:
        reach = max(reach, usual_gate)
    reach = USED_REACH * reach if reach > 0.0 else 1.0
    return -reach, reach


def _chi_square(dof: Array) -> Array:
    from scipy.special import chdtri

    return chdtri(dof.astype(float), 1.0 - PROBABILITY)


def _components(name: str) -> tuple[tuple[str, ...], str]:
    """Names and unit of the components of a measurement."""
    if name in GATED:
        block = name.removeprefix("gnss_")
        return AXES[block], UNITS[block][0]
    return tuple(f"z{k + 1}" for k in range(3)), "SI"


def _columns(
    figure: Figure, columns: Sequence[tuple[str, int]], across: int
) -> tuple[Array, dict[tuple[str, int], Axes]]:
    """A column of panels for each name, so many columns side by side, further ones below."""
    lines = [columns[k : k + across] for k in range(0, len(columns), across)]
    heights = [max(count for _, count in line) for line in lines]
    grid = grid_of(figure, sum(heights), across)
    for axes in grid.flat:
        axes.set_visible(False)
    places, top = {}, 0
    for line, height in zip(lines, heights, strict=True):
        for j, (name, count) in enumerate(line):
            for k in range(count):
                axes = grid[top + k, j]
                axes.set_visible(True)
                places[name, k] = axes
        top += height
    return grid, places


def _columns_height(columns: Sequence[tuple[str, int]], across: int, paper: Sheet) -> float:
    rows = sum(max(count for _, count in columns[k : k + across]) for k in range(0, len(columns), across))
    return height_of(rows, paper, 26.0)


def _shortened(text: str, across: int, paper: Sheet, ending: str = "") -> str:
    """A title that fits over its panel; the ending is kept."""
    room = max(int(paper.width / 25.4 * 72.0 * 0.8 / across / (0.6 * paper.font)) - len(ending), 8)
    return (text if len(text) <= room else text[: room - 1] + "…") + ending


def _across(columns: Sequence[tuple[str, int]], paper: Sheet) -> int:
    """Columns of panels side by side: as many as look well, two in a narrow figure only where one would be too high."""
    if paper.wide:
        return min(len(columns), 2 if len(columns) in (2, 4) else 3)
    return 2 if sum(count for _, count in columns) > MOST_NARROW_ROWS else 1
