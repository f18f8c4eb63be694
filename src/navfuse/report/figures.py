"""Figures for papers, one function each: a result in, a matplotlib figure out. ``navfuse.figures`` is this module.

They are as wide as a column of a journal (or a slide), have a unit on every axis, and are told apart without colour.
No window opens and no setting of matplotlib is left changed. :func:`plot` draws by name and writes files.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.errors import ConfigError
from navfuse.report.figures_filter import (
    figure_biases,
    figure_innovations,
    figure_nis,
    figure_residuals,
    figure_states,
)
from navfuse.report.figures_motion import (
    figure_attitude,
    figure_error_cdf,
    figure_errors,
    figure_map,
    figure_position,
    figure_separation,
    figure_sigmas,
    figure_velocity,
)
from navfuse.report.figures_sensors import figure_gnss_sigmas, figure_imu_rate, figure_satellites, figure_spectra
from navfuse.report.figures_style import FigureUnavailable, Size, meant

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "FIGURES",
    "FigureUnavailable",
    "draw",
    "figure_attitude",
    "figure_biases",
    "figure_error_cdf",
    "figure_errors",
    "figure_gnss_sigmas",
    "figure_imu_rate",
    "figure_innovations",
    "figure_map",
    "figure_nis",
    "figure_position",
    "figure_residuals",
    "figure_satellites",
    "figure_separation",
    "figure_sigmas",
    "figure_spectra",
    "figure_states",
    "figure_velocity",
    "names_of",
]

FIGURES: dict[str, Callable[..., Figure]] = {
    "map": figure_map,
    "position": figure_position,
    "velocity": figure_velocity,
    "attitude": figure_attitude,
    "errors": figure_errors,
    "error_cdf": figure_error_cdf,
    "sigmas": figure_sigmas,
    "separation": figure_separation,
    "innovations": figure_innovations,
    "residuals": figure_residuals,
    "nis": figure_nis,
    "states": figure_states,
    "biases": figure_biases,
    "gnss_sigmas": figure_gnss_sigmas,
    "satellites": figure_satellites,
    "imu_rate": figure_imu_rate,
    "spectra": figure_spectra,
}
"""Name -> function, in the order of ``all``."""


def names_of(what: str | Sequence[str]) -> list[str]:
    """Names of figures, each once.

    Parameters
    ----------
    what : str or sequence of str
        Names of :data:`FIGURES`, as a sequence or parted by commas, or ``all``.

    Raises
    ------
    ConfigError
        If one is not known; names the nearest.
    """
    words = what.split(",") if isinstance(what, str) else what
    found: dict[str, None] = {}
    for word in words:
        name = str(word).strip().lower().replace("-", "_")
        if name == "all":
            found |= dict.fromkeys(FIGURES)
        elif name in FIGURES:
            found[name] = None
        else:
            raise ConfigError(
                f"no figure {str(word).strip()!r}{meant(name, FIGURES)}; there are {', '.join(FIGURES)}, all"
            )
    if not found:
        raise ConfigError(f"no figure is named; there are {', '.join(FIGURES)}, all")
    return list(found)


def draw(
    name: str,
    result: Result,
    truth: Trajectory | None = None,
    *,
    size: Size = "double",
    time: str = "auto",
    skip_s: float = 0.0,
) -> Figure:
    """Draw a figure by its name; what it has no use for of the options is left aside.

    Raises
    ------
    ConfigError
        If there is no such figure.
    FigureUnavailable
        If the result has nothing to draw it from.
    """
    function = FIGURES[names_of([name])[0]]
    options = {"truth": truth, "size": size, "time": time, "skip_s": skip_s}
    taken = inspect.signature(function).parameters
    return function(result, **{key: value for key, value in options.items() if key in taken})
