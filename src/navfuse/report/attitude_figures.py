"""Figures of the attitude systems: errors over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from navfuse.attitude.gyro_heading import GyroHeading
    from navfuse.data.aiding_logs import HeadingLog

Array = np.ndarray

COLOURS = {"navfuse": "#2563c9", "navfuse smoothed": "#0e8a7d", "VQF": "#d9600a", "VQF offline": "#a15c00"}
_MOST = 4000


def figure_heading(run: GyroHeading, truth: Array, compass: HeadingLog) -> Figure:
    """Heading errors of compass, forward filter and smoother with two sigma, and the gyro bias.

    Parameters
    ----------
    run : GyroHeading
    truth : (n,) array [rad]
        True heading at ``run.forward.time``.
    compass : HeadingLog
        That was used.
    """
    figure, (top, bottom) = _figure(2, 7.0)
    time = run.forward.time
    reading = np.interp(compass.time, time, np.unwrap(truth))
    top.plot(compass.time, _degrees(compass.heading - reading), ".", color="0.75", markersize=2, label="compass")
    step = max(time.size // _MOST, 1)
    for solution, colour, label in (
        (run.forward, COLOURS["navfuse"], "forward"),
        (run.smoothed, COLOURS["navfuse smoothed"], "smoothed"),
    ):
        error = _degrees(solution.heading - truth)
        top.plot(time[::step], error[::step], color=colour, linewidth=1.0, label=label)
        for sign in (-2.0, 2.0):
            top.plot(time[::step], sign * np.degrees(solution.sd_heading[::step]), ":", color=colour, linewidth=0.8)
        bottom.plot(time[::step], np.degrees(solution.gyro_bias[::step]), color=colour, linewidth=1.0, label=label)
    top.set_ylabel("heading - truth [deg]")
    top.set_ylim(-10.0, 10.0)
    bottom.set_ylabel("gyro bias [deg/s]")
    bottom.set_xlabel("time [s]")
    for axes in (top, bottom):
        axes.legend(loc="upper right", fontsize=8)
        axes.grid(alpha=0.3)
    return figure


def figure_ahrs(trials: Sequence[tuple[str, Array, dict[str, Array]]]) -> Figure:
    """Total orientation error over time, a panel for each trial.

    Parameters
    ----------
    trials : sequence of (name, time (n,) [s], method -> error (n,) [rad])
    """
    figure, panels = _figure(len(trials), 2.6 * len(trials) + 0.6)
    for axes, (name, time, course) in zip(panels, trials, strict=True):
        step = max(time.size // _MOST, 1)
        for method, error in course.items():
            colour = COLOURS.get(method, "0.5")
            axes.plot(time[::step], np.degrees(error[::step]), color=colour, linewidth=0.8, label=method)
        axes.set_title(name, fontsize=9)
        axes.set_ylabel("total error [deg]")
        axes.grid(alpha=0.3)
    panels[0].legend(loc="upper right", fontsize=8, ncols=2)
    panels[-1].set_xlabel("time [s]")
    return figure


def _figure(rows: int, height: float):
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, list(figure.subplots(rows, 1, squeeze=False)[:, 0])


def _degrees(angle: Array) -> Array:
    return np.degrees(np.angle(np.exp(1j * angle)))
