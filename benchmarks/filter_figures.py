"""Figures of the filter study, from its saved results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
import numpy as np

from benchmarks.filter_cases import CASES, DRIVING

COLOURS = {"ekf": "#d9600a", "iekf": "#8a6d3b", "ukf": "#2563c9", "ckf": "#0e8a7d"}
MARKERS = {"ekf": "o", "iekf": "s", "ukf": "D", "ckf": "^"}
HEADING, OUTAGE, RANGES = "heading-60", "outage-60", "ranges"
BEGINNING = 40.0
"""So much [s] is shown of a case without an outage."""

Results = dict[str, dict[str, dict[str, Any]]]


def draw(results: Results, folder: Path) -> list[Path]:
    """Draw whatever the results allow, into PNG files of a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = [_saved(_overview(results), folder / "when-ukf-overview.png")]
    if _finished(results, HEADING):
        drawn.append(_saved(_heading(_finished(results, HEADING)), folder / "when-ukf-heading.png"))
    over_time = [name for name in (OUTAGE, RANGES) if _finished(results, name)]
    if over_time:
        drawn.append(_saved(_position(results, over_time), folder / "when-ukf-position.png"))
    return drawn


def _finished(results: Results, name: str) -> dict[str, dict[str, Any]]:
    return {estimator: found for estimator, found in results.get(name, {}).items() if found["runs"]}


def _overview(results: Results):
    names = [name for name in CASES if _finished(results, name)]
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(9.0, 1.3 + 0.36 * len(names)), sharey=True, layout="constrained"
    )
    for row, name in enumerate(names):
        finished = _finished(results, name)
        low, high = next(iter(finished.values()))["nees"]["whole state"]["bounds"]
        left.fill_betweenx([row - 0.4, row + 0.4], low, high, color="0.8", linewidth=0)
        for k, (estimator, found) in enumerate(finished.items()):
            style = {"color": COLOURS[estimator], "marker": MARKERS[estimator], "markersize": 5, "linestyle": "none"}
            at = row + 0.18 * (k - 1.5)
            left.plot(found["nees"]["whole state"]["mean"], at, **style)
            if "ekf" in finished:
                right.plot(found["rmse"]["position_m"] / finished["ekf"]["rmse"]["position_m"], at, **style)
    for axes, label in ((left, "NEES / dof, whole state [1]"), (right, "RMSE of the position / that of the EKF [1]")):
        axes.set_xscale("log")
        axes.axvline(1.0, color="0.4", linewidth=0.6, linestyle=":")
        axes.set_xlabel(label)
        axes.grid(alpha=0.3)
    left.set_yticks(range(len(names)), names)
    left.invert_yaxis()
    used = [name for name in COLOURS if any(name in _finished(results, case) for case in names)]
    marks = [plt.Line2D([], [], color=COLOURS[n], marker=MARKERS[n], linestyle="none", label=n) for n in used]
    marks.append(plt.Rectangle((0, 0), 1, 1, color="0.8", label="99 % bounds of a consistent filter"))
    figure.legend(handles=marks, loc="outside upper center", ncols=len(marks), frameon=False, fontsize=8)
    return figure


def _heading(finished: dict[str, dict[str, Any]]):
    figure, (error, share, nees) = plt.subplots(3, 1, figsize=(7.5, 7.0), sharex=True, layout="constrained")
    for estimator, found in finished.items():
        time, colour = np.array(found["time"]), COLOURS[estimator]
        error.semilogy(time, found["heading_median"], color=colour, label=f"{estimator}, half of the runs below")
        error.semilogy(time, found["heading_90"], "--", color=colour, label=f"{estimator}, nine of ten below")
        share.plot(time, 100.0 * np.array(found["share_found"]), color=colour, label=estimator)
        nees.semilogy(time, found["nees"]["whole state"]["curve"], color=colour, label=estimator)
    low, high = next(iter(finished.values()))["nees"]["whole state"]["bounds"]
    nees.axhspan(low, high, color="0.75", label="99 % bounds")
    error.set_ylabel("heading error [deg]")
    share.set_ylabel("runs within 3 deg [%]")
    nees.set_ylabel("NEES / dof, whole state [1]")
    nees.set_xlabel("time [s]")
    for axes in (error, share, nees):
        axes.axvline(DRIVING, color="0.4", linewidth=0.8, linestyle=":")
        axes.margins(x=0.0)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    return figure


def _position(results: Results, names: list[str]):
    figure, panels = plt.subplots(1, len(names), figsize=(4.6 * len(names), 3.8), layout="constrained", squeeze=False)
    for axes, name in zip(panels[0], names, strict=True):
        window = CASES[name].outage
        for estimator, found in _finished(results, name).items():
            if estimator not in ("ekf", "ukf"):
                continue
            time = np.array(found["time"])
            keep = time <= BEGINNING if window is None else (time >= window[0] - 20.0) & (time <= window[1] + 20.0)
            axes.semilogy(time[keep], np.array(found["horizontal"])[keep], color=COLOURS[estimator], label=estimator)
            says = np.array(found["horizontal_sd"])[keep]
            axes.semilogy(time[keep], says, "--", color=COLOURS[estimator], label=f"{estimator} says")
        axes.set_title(CASES[name].title, fontsize=9)
        axes.set_xlabel("time [s]")
        axes.set_ylabel("horizontal error, rms over the runs [m]")
        axes.margins(x=0.0)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    return figure


def _saved(figure, path: Path) -> Path:
    figure.savefig(path, dpi=100)
    plt.close(figure)
    return path
