"""Figures of the sensors: stated and realised sigmas of fixes, satellites, fix types, rate and spectra of the IMU."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from navfuse.data.logs import GnssLog
from navfuse.data.result import Result
from navfuse.report.curves import AXES, UNITS
from navfuse.report.figures_panels import band, curve, finish, grid_of, steps
from navfuse.report.figures_style import (
    AXIS_COLORS,
    AXIS_LINES,
    COLORS,
    GUIDE,
    LINES,
    FigureUnavailable,
    Size,
    clock_of,
    drawing,
    height_of,
    legend,
    log_axis,
    plain,
    sheet,
)
from navfuse.report.quality import gnss_sigmas

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = np.ndarray

AGAIN = "run it again with this version of navfuse"
MOST_FIX_TYPES = 8
REALISED_FLOOR = 1e-3
"""The lower end of an interval that reaches zero is drawn at this share of the smallest stated sigma."""


def figure_gnss_sigmas(result: Result, *, size: Size = "double", time: str = "auto") -> Figure:
    """Standard deviations that the fixes state, and those that the innovations show, with their 99 % intervals.

    Logarithmic. A realised sigma of zero (the uncertainty of the prediction alone explains the innovations) is left
    out.

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
        If there are no fixes, or too few were used.
    """
    _fixes(result, "gnss_sigmas")
    found = {
        block: sigmas
        for block in ("position", "velocity")
        if (sigmas := gnss_sigmas(result, f"gnss_{block}")) is not None and sigmas.time.size
    }
    if not found:
        raise FigureUnavailable("gnss_sigmas: too few fixes were used to tell their scatter")
    paper, clock = sheet(size), clock_of(result, time)
    across = len(found) if paper.wide else 1
    rows = 3 * len(found) // across
    with drawing(paper, height_of(rows, paper, 30.0)) as figure:
        grid = grid_of(figure, rows, across)
        panels = grid.T.reshape(-1, 3)
        for column, (block, sigmas) in zip(panels, found.items(), strict=True):
            for k, axes in enumerate(column):
                at = clock(sigmas.time)
                realised, low, high = (
                    np.where(x[:, k] > 0.0, x[:, k], np.nan) for x in (sigmas.realised, sigmas.low, sigmas.high)
                )
                shown = np.concatenate((sigmas.stated[:, k], realised, high))
                floor = REALISED_FLOOR * float(np.nanmin(sigmas.stated[:, k]))
                low = np.where(np.isfinite(high), np.fmax(np.nan_to_num(low), floor), np.nan)
                if at.size > 1:
                    band(axes, at, low, high, color=COLORS["smoothed"], alpha=0.25, label="99 % interval")
                else:
                    axes.errorbar(
                        at,
                        high,
                        yerr=[high - low, 0.0 * high],
                        fmt="none",
                        ecolor=COLORS["smoothed"],
                        elinewidth=0.8,
                        label="99 % interval",
                    )
                curve(axes, at, realised, color=COLORS["smoothed"], linestyle=LINES["smoothed"], label="realised")
                curve(axes, at, sigmas.stated[:, k], color=COLORS["forward"], label="stated")
                log_axis(axes, np.concatenate((shown, low[low > 0.2 * np.nanmin(shown)])))
                axes.set_ylabel(f"σ {AXES[block][k]} [{UNITS[block][0]}]")
            column[0].set_title(f"{block} fixes, windows of {sigmas.window}")
        finish(figure, grid, paper, clock, result)
    return figure


def figure_satellites(result: Result, *, size: Size = "double", time: str = "auto") -> Figure:
    """Satellites in use and type of every fix over time; parameters as :func:`figure_gnss_sigmas`."""
    fixes = _fixes(result, "satellites")
    kinds = [name for name in ("n_satellites", "fix") if getattr(fixes, name) is not None]
    if not kinds:
        raise FigureUnavailable("satellites: the GNSS log states neither satellites nor fix types (n_satellites, fix)")
    paper, clock = sheet(size), clock_of(result, time)
    with drawing(paper, height_of(len(kinds), paper, 34.0)) as figure:
        grid = grid_of(figure, len(kinds), 1)
        for axes, kind in zip(grid[:, 0], kinds, strict=True):
            at = clock(fixes.time)
            if kind == "n_satellites":
                count = np.asarray(fixes.n_satellites, dtype=np.float64)
                steps(axes, at, count, color=COLORS["forward"])
                axes.set_ylim(0.0, 1.12 * max(float(np.nanmax(count, initial=0.0)), 4.0))
                axes.yaxis.get_major_locator().set_params(integer=True)
                axes.set_ylabel("satellites [1]")
                continue
            names, row = _fix_types(fixes.fix)
            for k in range(len(names)):
                chosen = row == k
                axes.plot(
                    at[chosen],
                    row[chosen],
                    "|",
                    color=COLORS["forward"],
                    markersize=7.0,
                    rasterized=chosen.sum() > 1500,
                )
            axes.set_yticks(range(len(names)), names)
            for text in axes.get_yticklabels():
                text.set_parse_math(False)
            axes.set_ylim(-0.7, len(names) - 0.3)
            axes.set_ylabel("fix type")
        finish(figure, grid, paper, clock, result)
    return figure


def figure_imu_rate(result: Result, *, size: Size = "double", time: str = "auto") -> Figure:
    """Samples of the inertial log per second, and its gaps; parameters as :func:`figure_gnss_sigmas`."""
    overview = _overview(result, "imu_rate")
    if not overview.time.size:
        raise FigureUnavailable("imu_rate: the inertial log is too short to have a rate")
    paper, clock = sheet(size), clock_of(result, time)
    gaps = overview.gap_start.size
    with drawing(paper, height_of(1 + (gaps > 0), paper, 34.0)) as figure:
        grid = grid_of(figure, 1 + (gaps > 0), 1)
        axes = grid[0, 0]
        curve(axes, clock(overview.time), overview.rate, color=COLORS["forward"], label="rate")
        axes.axhline(overview.usual_rate, color=GUIDE, linestyle=":", label=f"usual: {overview.usual_rate:.6g} Hz")
        top = max(float(overview.rate.max()), overview.usual_rate)
        low = float(overview.rate.min())
        axes.set_ylim(min(0.95 * top, 0.97 * low), 1.03 * top)
        axes.set_ylabel("rate [Hz]")
        ends = np.concatenate((overview.time, overview.gap_start, overview.gap_start + overview.gap_length))
        if gaps:
            axes = grid[1, 0]
            x = clock(overview.gap_start)
            axes.vlines(
                x,
                1e-12,
                overview.gap_length,
                color="#b3001b",
                linewidth=0.7,
                rasterized=gaps > 1500,
                label=f"gaps: {gaps}",
            )
            axes.plot(x, overview.gap_length, "o", color="#b3001b", markersize=2.5, rasterized=gaps > 1500)
            log_axis(axes, np.append(overview.gap_length, 1.0 / overview.usual_rate))
            axes.set_ylabel("gap [s]")
        span = (
            min(float(ends.min()), float(result.forward.time[0])),
            max(float(ends.max()), float(result.forward.time[-1])),
        )
        finish(figure, grid, paper, clock, result, span)
    return figure


def figure_spectra(result: Result, *, size: Size = "double") -> Figure:
    """Amplitude densities of angular rate and specific force over frequency, logarithmic both ways.

    One-sided, the square roots of the power densities, body axes; parameters as :func:`figure_gnss_sigmas`.
    """
    overview = _overview(result, "spectra")
    if not overview.frequency.size:
        raise FigureUnavailable("spectra: the inertial log is too short for spectra")
    paper = sheet(size)
    rows, across = (1, 2) if paper.wide else (2, 1)
    with drawing(paper, height_of(rows, paper, 60.0 if paper.wide else 52.0, 12.0)) as figure:
        panels = figure.subplots(rows, across, squeeze=False).ravel()
        for axes, psd, scale, label in (
            (panels[0], overview.gyro_psd, np.degrees(1.0), "angular rate [deg/s/√Hz]"),
            (panels[1], overview.accel_psd, 1.0, "specific force [m/s²/√Hz]"),
        ):
            density = scale * np.sqrt(psd)
            positive = np.where(density > 0.0, density, np.nan)
            for k, axis in enumerate("xyz"):
                axes.plot(overview.frequency, positive[:, k], color=AXIS_COLORS[k], linestyle=AXIS_LINES[k], label=axis)
            log_axis(axes, positive)
            log_axis(axes, overview.frequency, "x")
            axes.set_xlim(*overview.frequency[[0, -1]]) if overview.frequency.size > 1 else None
            axes.set(xlabel="frequency [Hz]", ylabel=label)
        legend(figure, list(panels), paper)
    return figure


def _fixes(result: Result, what: str) -> GnssLog:
    if result.fixes is None:
        raise FigureUnavailable(f"{what}: this result has no GNSS fixes (no fixes.parquet in its folder); {AGAIN}")
    if not result.fixes.time.size:
        raise FigureUnavailable(f"{what}: the GNSS log of this run is empty")
    return result.fixes


def _overview(result: Result, what: str):
    if result.imu is None:
        raise FigureUnavailable(f"{what}: this result has no overview of the IMU (no imu.json in its folder); {AGAIN}")
    return result.imu


def _fix_types(fix: Array | None) -> tuple[list[str], Array]:
    """Names of the fix types, the most frequent lowest, rare ones of many put together; and the row of every fix."""
    names, row, counts = np.unique(np.asarray(fix), return_inverse=True, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    place = np.minimum(np.argsort(order), MOST_FIX_TYPES - 1)
    shown = [plain(str(names[k])) or "(none)" for k in order]
    if len(shown) > MOST_FIX_TYPES:
        shown = [*shown[: MOST_FIX_TYPES - 1], "others"]
    return [text if len(text) <= 16 else text[:15] + "…" for text in shown], place[row]
