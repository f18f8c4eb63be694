"""Figures of the solution: map, position, velocity, attitude, sigmas, filter minus smoother, errors, error CDF."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from navfuse.analysis.metrics import ErrorSeries, errors
from navfuse.analysis.separation import separation
from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.report.curves import AXES, UNITS, solutions_of
from navfuse.report.figures_panels import band, beyond_edge, broken, cloud, curve, finish, grid_of
from navfuse.report.figures_style import (
    COLORS,
    LINES,
    FigureUnavailable,
    Sheet,
    Size,
    clock_of,
    drawing,
    height_of,
    legend,
    log_axis,
    room_for,
    sheet,
)
from navfuse.report.map_panel import MAP_POINTS
from navfuse.report.measurement_panels import STATUS_NAMES
from navfuse.report.quality import error_cdf, position_percentiles
from navfuse.report.series import NAMES, break_wraps, decimate, east_north, fix_status, origin_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = np.ndarray

LEAST_MAP_M = 0.02
"""The map shows so many metres at least."""
KILOMETRES_FROM_M = 5000.0
MAP_MARGIN = 0.05
INSIDE_PERCENT = (1.0, 99.0)
MOST_CDF_PERCENT = 99.9
SPIKES = 3.0
"""Differences that reach so many times beyond what 95 % of the epochs and the 3-sigma band need are cut off."""


def figure_map(result: Result, truth: Trajectory | None = None, *, size: Size = "double") -> Figure:
    """Tracks and GNSS fixes by their fate, east and north of the start, to scale.

    The map covers the tracks and the fixes that were used; how many of the others lie outside stands in the legend.

    Parameters
    ----------
    result : Result
    truth : Trajectory, optional
    size : str or (float, float)
        See :func:`navfuse.report.figures_style.sheet`.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.ticker import MaxNLocator

    paper = sheet(size)
    origin = origin_of(result.forward)
    shown = _tracks(result, truth)
    tracks = {role: east_north(track, origin) for role, track in shown.items()}
    status = fix_status(result)
    fixes = east_north(result.fixes, origin) if result.fixes is not None else np.empty((0, 2))
    low, high = _map_limits(tracks, fixes, status)
    unit, scale = ("km", 1e-3) if np.max(high - low) > KILOMETRES_FROM_M else ("m", 1.0)
    low, high, fixes = low * scale, high * scale, fixes * scale
    with drawing(paper, _map_height(paper, high - low)) as figure:
        axes = figure.add_subplot()
        for name in ("unused", *STATUS_NAMES):
            chosen = np.zeros(len(fixes), dtype=bool) if status is None else status == name
            if chosen.any():
                inside = chosen & ((fixes >= low) & (fixes <= high)).all(axis=1)
                label = f"fixes {STATUS_NAMES.get(name, 'not used')}"
                outside = int(chosen.sum() - inside.sum())
                label += f" ({outside} of {int(chosen.sum())} outside)" if outside else ""
                cloud(axes, fixes[inside, 0], fixes[inside, 1], name, label, zorder=2.0)
        for role, plane in tracks.items():
            _, east, north = broken(shown[role].time, plane[:, 0] * scale, plane[:, 1] * scale)
            rows = decimate(np.column_stack((east, north)), MAP_POINTS)
            axes.plot(east[rows], north[rows], color=COLORS[role], linestyle=LINES[role], label=NAMES[role], zorder=3.0)
        axes.plot(0.0, 0.0, "k*", markersize=0.8 * paper.font, markeredgewidth=0.0, label="start", zorder=4.0)
        axes.set(xlabel=f"east of the start [{unit}]", ylabel=f"north of the start [{unit}]", aspect="equal")
        axes.set_xlim(low[0], high[0], auto=True)
        axes.set_ylim(low[1], high[1], auto=True)
        axes.set_adjustable("datalim")
        axes.xaxis.set_major_locator(MaxNLocator(room_for(axes, 8.0), steps=[1, 2, 5, 10]))
        legend(figure, [axes], paper)
    return figure


def figure_position(
    result: Result, truth: Trajectory | None = None, *, size: Size = "double", time: str = "auto"
) -> Figure:
    """North and east of the start, and ellipsoidal height, over time; parameters as :func:`figure_errors`."""
    origin = origin_of(result.forward)
    curves = {}
    for role, track in _tracks(result, truth).items():
        plane = east_north(track, origin)
        curves[role] = (track.time, np.column_stack((plane[:, 1], plane[:, 0], track.height)))
    return _stack(result, curves, ("north [m]", "east [m]", "height [m]"), size, time)


def figure_velocity(
    result: Result, truth: Trajectory | None = None, *, size: Size = "double", time: str = "auto"
) -> Figure:
    """Velocity north, east and down over time; parameters as :func:`figure_errors`."""
    curves = _known(result, truth, "velocity_n")
    return _stack(result, curves, tuple(f"{axis} [m/s]" for axis in AXES["velocity"]), size, time)


def figure_attitude(
    result: Result, truth: Trajectory | None = None, *, size: Size = "double", time: str = "auto"
) -> Figure:
    """Roll, pitch and heading over time, heading broken where it passes north; parameters as :func:`figure_errors`."""
    curves = {}
    for role, (at, values) in _known(result, truth, "attitude").items():
        angles = np.degrees(values)
        angles[:, 2] = break_wraps(np.mod(angles[:, 2], 360.0), 360.0)
        angles[:, 0] = break_wraps(angles[:, 0], 360.0)
        curves[role] = (at, angles)
    return _stack(result, curves, tuple(f"{axis} [deg]" for axis in AXES["attitude"]), size, time)


def figure_errors(
    result: Result, truth: Trajectory | None = None, *, size: Size = "double", time: str = "auto", skip_s: float = 0.0
) -> Figure:
    """Position, velocity and attitude errors inside their 3-sigma envelopes, filter and smoother, over time.

    Solution minus truth. A column per kind (below each other in a narrow figure) and a panel per component; stretches
    without a used fix are shaded. The vertical range follows the errors and the usual width of the envelopes; what is
    wider runs out of the picture.

    Parameters
    ----------
    result : Result
    truth : Trajectory
    size : str or (float, float)
        See :func:`navfuse.report.figures_style.sheet`.
    time : str
        Of the axis: ``auto``, ``gps``, ``utc`` or ``log``.
    skip_s : float [s]
        The first seconds that both have in common are left out.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    FigureUnavailable
        Without a truth.
    InputError
        If the truth has no time in common with the run.
    """
    return _components(result, _errors(result, truth, skip_s, "errors"), "error", size, time)


def figure_separation(result: Result, *, size: Size = "double", time: str = "auto", skip_s: float = 0.0) -> Figure:
    """Filter minus smoother inside three standard deviations of that difference; parameters as :func:`figure_errors`.

    Raises
    ------
    FigureUnavailable
        Without a smoother.
    """
    if result.smoothed is None:
        raise FigureUnavailable('separation: this run has no smoother; set smoother.method = "rts" and run it again')
    late = result.forward.time >= result.forward.time[0] + skip_s
    if np.count_nonzero(late) < 2:
        raise FigureUnavailable(f"separation: the run has no two epochs after the first {skip_s:g} s")
    found = separation(result.forward.take(late), result.smoothed)
    return _components(result, {"forward": found}, "difference", size, time, "filter − smoother")


def figure_sigmas(result: Result, *, size: Size = "double", time: str = "auto") -> Figure:
    """Standard deviations of position, velocity and attitude over time, logarithmic; parameters as above."""
    paper, clock = sheet(size), clock_of(result, time)
    solutions = solutions_of(result)
    blocks = [b for b in AXES if any(getattr(track, f"sd_{b}") is not None for track in solutions.values())]
    if not blocks:
        raise FigureUnavailable("sigmas: the trajectories of this run have no standard deviations")
    with drawing(paper, _height(blocks, paper)) as figure:
        grid, places = _places(figure, blocks, paper)
        for (block, k), axes in places.items():
            unit, scale = UNITS[block]
            drawn = []
            for role, track in solutions.items():
                sd = getattr(track, f"sd_{block}")
                if sd is not None:
                    drawn.append(sd[:, k] * scale)
                    shown = np.where(drawn[-1] > 0.0, drawn[-1], np.nan)
                    curve(axes, clock(track.time), shown, color=COLORS[role], linestyle=LINES[role], label=NAMES[role])
            log_axis(axes, np.concatenate(drawn))
            axes.set_ylabel(f"σ {AXES[block][k]} [{unit}]")
        finish(figure, grid, paper, clock, result)
    return figure


def figure_error_cdf(
    result: Result, truth: Trajectory | None = None, *, size: Size = "double", skip_s: float = 0.0
) -> Figure:
    """Share of the epochs with a smaller error: horizontal position with CEP50 and CEP95, height, velocity, heading.

    Parameters and errors as for :func:`figure_errors`.
    """
    series = _errors(result, truth, skip_s, "error_cdf")
    paper = sheet(size)
    wanted = {
        "position_horizontal": "horizontal position [m]",
        "position_down": "height [m]",
        "velocity_3d": "velocity [m/s]",
        "heading": "heading [deg]",
    }
    columns = {role: entry.columns() for role, entry in series.items()}
    names = [name for name in wanted if any(name in found for found in columns.values())]
    across = 2 if paper.wide else 1
    rows = -(-len(names) // across)
    with drawing(paper, height_of(rows, paper, 46.0, 12.0)) as figure:
        grid = figure.subplots(rows, across, squeeze=False)
        for axes in grid.flat[len(names) :]:
            axes.set_visible(False)
        for axes, name in zip(grid.flat, names, strict=False):
            reach, notes = 0.0, []
            for role, found in columns.items():
                if name not in found:
                    continue
                magnitude, share = error_cdf(found[name])
                if not magnitude.size:
                    continue
                shown = np.unique(np.linspace(0, magnitude.size - 1, 2000).astype(np.int64))
                axes.plot(
                    magnitude[shown],
                    100.0 * share[shown],
                    drawstyle="steps-post" if magnitude.size < 200 else "default",
                    color=COLORS[role],
                    linestyle=LINES[role],
                    label=NAMES[role],
                )
                reach = max(reach, float(np.percentile(magnitude, MOST_CDF_PERCENT)))
                if name.startswith("position"):
                    notes.append((role, position_percentiles(series[role])))
            axes.set(xlabel=f"error in {wanted[name]}", ylabel="epochs with less [%]", ylim=(0.0, 100.0))
            axes.set_xlim(0.0, 1.05 * reach if reach > 0.0 else 1.0)
            axes.set_yticks([0, 25, 50, 75, 95])
            _note_percentiles(axes, name, notes)
        legend(figure, list(grid.flat), paper)
    return figure


def _note_percentiles(axes: Axes, name: str, notes: list) -> None:
    """Percentiles of the position in the free corner of a panel, the lower right one."""
    kind = "CEP" if name == "position_horizontal" else "LE"
    lines = []
    for role, found in notes:
        half, most = (found.cep50, found.cep95) if kind == "CEP" else (found.le50, found.le95)
        lines.append(f"{NAMES[role]}: {kind}50 {half:.3g} m, {kind}95 {most:.3g} m")
        axes.plot([half, most], [50.0, 95.0], "o", color=COLORS[role], markersize=3.0, linestyle="none", zorder=4.0)
    if lines:
        axes.text(
            0.97, 0.05, "\n".join(lines), transform=axes.transAxes, ha="right", va="bottom", fontsize="small",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.0},
        )  # fmt: skip


def _errors(result: Result, truth: Trajectory | None, skip_s: float, name: str) -> dict[str, ErrorSeries]:
    if truth is None:
        raise FigureUnavailable(f"{name}: needs a truth to compare with; give --truth FILE")
    return {role: errors(track, truth, skip_s=skip_s) for role, track in solutions_of(result).items()}


def _tracks(result: Result, truth: Trajectory | None) -> dict[str, Trajectory]:
    """Trajectories to draw by role; of a truth the stretch of the run."""
    if truth is not None:
        first, last = result.forward.time[[0, -1]]
        truth = truth.take((truth.time >= first) & (truth.time <= last))
    return solutions_of(result, truth if truth is not None and len(truth) else None)


def _known(result: Result, truth: Trajectory | None, name: str) -> dict[str, tuple[Array, Array]]:
    found = {
        role: (track.time, values)
        for role, track in _tracks(result, truth).items()
        if (values := getattr(track, name)) is not None
    }
    if not set(found) - {"truth"}:
        what = name.removesuffix("_n")
        raise FigureUnavailable(f"{what}: the trajectories of this run have no {what}")
    return found


def _stack(
    result: Result, curves: Mapping[str, tuple[Array, Array]], labels: tuple[str, ...], size: Size, time: str
) -> Figure:
    paper, clock = sheet(size), clock_of(result, time)
    with drawing(paper, height_of(len(labels), paper, 30.0)) as figure:
        grid = grid_of(figure, len(labels), 1)
        for k, label in enumerate(labels):
            axes = grid[k, 0]
            for role, (at, values) in curves.items():
                curve(axes, clock(at), values[:, k], color=COLORS[role], linestyle=LINES[role], label=NAMES[role])
            axes.set_ylabel(label)
            _least_range(axes)
        finish(figure, grid, paper, clock, result)
    return figure


def _components(
    result: Result, series: Mapping[str, ErrorSeries], what: str, size: Size, time: str, label: str = ""
) -> Figure:
    """Panels of position, velocity and attitude differences inside three standard deviations."""
    paper, clock = sheet(size), clock_of(result, time)
    blocks = [block for block in AXES if any(getattr(entry, block) is not None for entry in series.values())]
    with drawing(paper, _height(blocks, paper)) as figure:
        grid, places = _places(figure, blocks, paper)
        for (block, k), axes in places.items():
            reach = usual = 0.0
            drawn = []
            for role, entry in series.items():
                values, sd = getattr(entry, block), getattr(entry, f"sd_{block}")
                if values is None:
                    continue
                value = values[:, k] * UNITS[block][1]
                at = clock(entry.time)
                if sd is not None:
                    limit = 3.0 * sd[:, k] * UNITS[block][1]
                    band(axes, at, -limit, limit, color=COLORS[role], label=f"{label or NAMES[role]} ±3σ")
                    reach, usual = max(reach, _percentile(limit, 95.0)), max(usual, _percentile(limit, 95.0))
                curve(axes, at, value, color=COLORS[role], linestyle=LINES[role], label=label or NAMES[role])
                drawn.append((role, at, value))
                reach = max(reach, _percentile(np.abs(value), 100.0))
                usual = max(usual, _percentile(np.abs(value), 95.0))
            if 0.0 < SPIKES * usual < reach:
                reach = usual
                for role, at, value in drawn:
                    beyond_edge(axes, at, value, 1.08 * reach, COLORS[role])
            if reach > 0.0:
                axes.set_ylim(-1.08 * reach, 1.08 * reach)
            axes.set_ylabel(f"{AXES[block][k]} [{UNITS[block][0]}]")
            if k == 0:
                axes.set_title(f"{block} {what}")
        finish(figure, grid, paper, clock, result)
    return figure


def _places(figure: Figure, blocks: list[str], paper: Sheet) -> tuple[Array, dict[tuple[str, int], Axes]]:
    """The panel of every component: a column per block, or one column where the figure is narrow."""
    columns = len(blocks) if paper.wide else 1
    grid = grid_of(figure, 3 * len(blocks) // columns, columns)
    flat = grid.T.ravel()
    return grid, {(block, k): flat[3 * b + k] for b, block in enumerate(blocks) for k in range(3)}


def _height(blocks: list[str], paper: Sheet) -> float:
    return height_of(3, paper, 30.0) if paper.wide else height_of(3 * len(blocks), paper)


def _percentile(values: Array, percent: float) -> float:
    finite = values[np.isfinite(values)]
    return float(np.percentile(finite, percent)) if finite.size else 0.0


def _least_range(axes: Axes, least: float = 1e-6) -> None:
    """Keep a constant curve from being drawn as rounding noise."""
    low, high = axes.get_ylim()
    if high - low < least:
        middle = 0.5 * (low + high)
        axes.set_ylim(middle - 0.5, middle + 0.5)


def _map_limits(tracks: Mapping[str, Array], fixes: Array, status: Array | None) -> tuple[Array, Array]:
    """Corners of the map [m]: all tracks, and all but the farthest of the used fixes (of all, if none was used)."""
    boxes = [np.nanpercentile(plane, (0.0, 100.0), axis=0) for plane in tracks.values()]
    if status is not None and len(fixes):
        used = np.isin(status, ("used", "reset", "withheld"))
        boxes.append(np.nanpercentile(fixes[used] if used.any() else fixes, INSIDE_PERCENT, axis=0))
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    margin = max(MAP_MARGIN * float(np.max(high - low)), 0.5 * LEAST_MAP_M)
    return low - margin, high + margin


def _map_height(paper: Sheet, extent: Array) -> float:
    """Height [mm] that suits the shape of the track, between a wide strip and a little more than a square."""
    return paper.width * float(np.clip(extent[1] / extent[0], 0.45, 0.95)) + 18.0
