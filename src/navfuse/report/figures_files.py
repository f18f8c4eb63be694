"""Figures as files: drawn by name from a result or the folder of a run, written together, the same bytes every time."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.errors import ConfigError, NavfuseWarning
from navfuse.io.atomic import atomic_folder
from navfuse.io.result_folder import read_result
from navfuse.io.trajectory_table import read_trajectory
from navfuse.report.figures import FIGURES, draw, names_of
from navfuse.report.figures_style import FigureUnavailable, Size, clock_of, meant, sheet, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "pdf", "svg")
METADATA = {"png": {}, "pdf": {"CreationDate": None}, "svg": {"Date": None}}
"""Without dates, so that the same result gives the same bytes."""
LEAST_DPI, MOST_DPI = 30, 2400
MOST_PIXELS = 2e8


class Plots(NamedTuple):
    """What :func:`plot` did.

    Attributes
    ----------
    files : tuple of Path
        Written, in the order of the figures.
    skipped : dict of str to str
        Figures of ``all`` that this result has nothing for, and why.
    """

    files: tuple[Path, ...]
    skipped: dict[str, str]


def plot(
    source: Result | str | os.PathLike[str],
    what: str | Sequence[str] = "all",
    *,
    folder: str | os.PathLike[str] | None = None,
    formats: str | Sequence[str] = "png",
    truth: Trajectory | str | os.PathLike[str] | None = None,
    skip_s: float = 0.0,
    size: Size = "double",
    time: str = "auto",
    dpi: int = 300,
) -> Plots:
    """Draw figures of a run and write them as files ``NAME.FORMAT``, all of them or none.

    Parameters
    ----------
    source : Result or path-like
        A result, or the folder of a run.
    what : str or sequence of str
        Names of :data:`navfuse.figures.FIGURES`, as a sequence or parted by commas. ``all`` leaves out those that the
        result has nothing for; one asked for by name has to be there.
    folder : path-like, optional
        Where to write; default ``figures`` in the folder of the run. Other files there stay.
    formats : str or sequence of str
        Of ``png``, ``pdf``, ``svg``.
    truth : Trajectory or path-like, optional
    skip_s : float [s]
        Leave out the first seconds of comparisons: errors, error_cdf, separation.
    size : str or (float, float)
        ``single``, ``double``, ``slide``, ``"120x80"`` or (width, height) in millimetres.
    time : str
        Of the time axes: ``auto``, ``gps``, ``utc`` or ``log``.
    dpi : int
        Dots per inch of PNG, and of the dense clouds inside PDF and SVG.

    Returns
    -------
    Plots

    Raises
    ------
    ConfigError
        If an option is wrong, a figure unknown, or the size too small for one.
    FigureUnavailable
        If the result has nothing for a figure asked for by name.
    InputError
        If the folder or the truth cannot be read, or have no time in common.
    OutputError
        If the files cannot be written.
    """
    names, kinds, paper = names_of(what), _formats(formats), sheet(size)
    if not LEAST_DPI <= dpi <= MOST_DPI:
        raise ConfigError(f"dpi = {dpi} is out of the range {LEAST_DPI} to {MOST_DPI}")
    if not (math.isfinite(skip_s) and skip_s >= 0.0):
        raise ConfigError(f"skip_s = {skip_s} has to be a time of zero or more seconds")
    if isinstance(source, Result):
        if folder is None:
            raise ConfigError("plot: give the folder to write to, folder=...; a result has none of its own")
        result, target = source, Path(folder)
    else:
        result, target = read_result(source), Path(source) / "figures" if folder is None else Path(folder)
    clock_of(result, time)
    known = truth if truth is None or isinstance(truth, Trajectory) else read_trajectory(Path(truth))
    everything = set(FIGURES) <= set(names)
    files: list[Path] = []
    skipped: dict[str, str] = {}
    with atomic_folder(target) as staging:
        for name in names:
            try:
                figure = draw(name, result, known, size=size, time=time, skip_s=skip_s)
            except FigureUnavailable as reason:
                if not everything:
                    raise
                skipped[name] = str(reason).removeprefix(f"{name}: ")
                continue
            for kind in kinds:
                save(figure, staging / f"{name}.{kind}", dpi, paper.font, name)
                files.append(target / f"{name}.{kind}")
    return Plots(tuple(files), skipped)


def save(figure: Figure, path: Path, dpi: int, font: float, name: str = "figure") -> None:
    """Write a figure so that the same figure gives the same bytes; the extension of the path tells the format.

    Raises
    ------
    ConfigError
        If the figure is too small for its texts, or has too many pixels.
    """
    kind = path.suffix.removeprefix(".")
    width, height = figure.get_size_inches() * dpi
    if kind == "png" and (width * height > MOST_PIXELS or max(width, height) >= 2**16):
        raise ConfigError(f"{name}: {width:.0f} x {height:.0f} pixels are too many; give a smaller size or dpi")
    with style(font), warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        figure.savefig(path, format=kind, dpi=dpi, metadata=METADATA[kind])
    lacking = False
    for warning in told:
        text = str(warning.message)
        if "collapsed to zero" in text:
            raise ConfigError(
                f"{name}: {25.4 * width / dpi:.0f} x {25.4 * height / dpi:.0f} mm is too small for its panels; give a "
                "larger size"
            )
        if text.startswith("Glyph ") and "missing from font" in text:
            lacking = True
        else:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    if lacking:
        warnings.warn(
            f"{name}: some letters of a name are not in the font DejaVu Sans and are drawn as boxes",
            NavfuseWarning,
            stacklevel=3,
        )


def _formats(formats: str | Sequence[str]) -> list[str]:
    words = formats.split(",") if isinstance(formats, str) else formats
    found = list(dict.fromkeys(str(word).strip().lower().removeprefix(".") for word in words))
    for kind in found:
        if kind not in FORMATS:
            raise ConfigError(f"format {kind!r} has to be one of {', '.join(FORMATS)}{meant(kind, FORMATS)}")
    return found
