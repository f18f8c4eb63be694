"""How the figures for papers look: sizes, fonts, colours that survive grey print, time axes, and when there is none.

Every figure is drawn inside :func:`drawing`, which starts from matplotlib's own defaults, whatever the settings of the
machine, and puts these back when it is done. Text is shown as it is: a ``$`` in the name of a sensor is a dollar sign.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from navfuse.core.nearest import nearest
from navfuse.data.result import Result
from navfuse.errors import ConfigError, InputError
from navfuse.io.gps_time import DAY
from navfuse.report.clock import leap_at, utc_text
from navfuse.report.text import label as label_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = np.ndarray
Size = str | tuple[float, float]

MM = 1.0 / 25.4
SIZES = {"single": (88.0, None, 8.0), "double": (181.0, None, 8.0), "slide": (254.0, 142.875, 14.0)}
"""Name -> width [mm], height [mm] (None: as the figure needs it), font [pt]: the columns of the IEEE, a 16:9 slide."""
LEAST_MM, MOST_MM = 20.0, 2000.0
MOST_HEIGHT_MM = 230.0
"""As high as the page of a journal is; the panels of a figure of free height share it."""

LEAST_PANEL_MM = 19.0
"""A panel is at least so high, to leave room for the label of its axis."""

CLOCKS = ("auto", "gps", "utc", "log")
FAR_FROM_ZERO_S = 1e6
"""Log times beyond are drawn from a round number near the start: the ticks stay readable."""

COLORS = {"forward": "#0b3c8c", "smoothed": "#e06a00", "truth": "#000000"}
LINES = {"forward": "-", "smoothed": (0, (4.0, 1.3)), "truth": (0, (1.0, 1.2))}
AXIS_COLORS = ("#0b3c8c", "#e06a00", "#333333")
AXIS_LINES = ("-", (0, (4.0, 1.3)), (0, (1.0, 1.0)))
GUIDE = "#333333"
SHADE = {"color": "0.5", "alpha": 0.18, "linewidth": 0}
MARKERS: dict[str, dict[str, Any]] = {
    "used": {"marker": ".", "color": "#2a9d8f", "s": 5.0, "linewidths": 0.0},
    "reset": {"marker": "*", "color": "#7a4a00", "s": 26.0, "linewidths": 0.0},
    "rejected": {"marker": "x", "color": "#b3001b", "s": 10.0, "linewidths": 0.7},
    "withheld": {"marker": "D", "facecolors": "none", "edgecolors": "#6a3fb5", "s": 7.0, "linewidths": 0.5},
    "late": {"marker": "+", "color": "#5f6b75", "s": 12.0, "linewidths": 0.7},
    "unused": {"marker": "+", "color": "#9aa3ab", "s": 8.0, "linewidths": 0.5},
}
"""Shape and colour of a measurement by its fate; the shapes alone tell them apart."""
VECTOR_POINTS = 1500
"""Clouds of more points become a picture inside a PDF or SVG, which keeps the file small."""


class FigureUnavailable(InputError):
    """The result has nothing to draw the figure from; the message says what is missing and what to do."""


@dataclass(frozen=True, slots=True)
class Sheet:
    """Width and height [mm] (None: free) and font [pt] of a figure."""

    width: float
    height: float | None
    font: float

    @property
    def wide(self) -> bool:
        """Whether three panels stand side by side."""
        return self.width / self.font >= 15.0


def sheet(size: Size) -> Sheet:
    """Size of a figure.

    Parameters
    ----------
    size : str or (float, float)
        ``single`` (88 mm wide), ``double`` (181 mm), ``slide`` (254 mm x 143 mm, larger fonts), or width and height
        [mm], as numbers or as text such as ``"120x80"``.

    Raises
    ------
    ConfigError
        If it is none of these, or out of 20 to 2000 mm.
    """
    if isinstance(size, str) and size in SIZES:
        return Sheet(*SIZES[size])
    numbers = re.fullmatch(r"(\d+(?:\.\d+)?)x(\d+(?:\.\d+)?)", size) if isinstance(size, str) else size
    if numbers is None:
        raise ConfigError(
            f"size {size!r} has to be {', '.join(SIZES)} or WIDTHxHEIGHT in millimetres, such as 120x80"
            f"{meant(str(size), SIZES)}"
        )
    width, height = (float(x) for x in (numbers if isinstance(numbers, tuple) else numbers.groups()))
    if not (LEAST_MM <= width <= MOST_MM and LEAST_MM <= height <= MOST_MM):
        raise ConfigError(
            f"size {width:g} x {height:g} mm is out of the range {LEAST_MM:g} to {MOST_MM:g} mm for each side"
        )
    return Sheet(width, height, SIZES["double"][2])


@contextmanager
def drawing(paper: Sheet, height: float) -> Iterator[Figure]:
    """A figure to draw in; its ticks are dressed when the block ends.

    Parameters
    ----------
    paper : Sheet
    height : float [mm]
        Of the figure where the size leaves it free.

    Yields
    ------
    matplotlib.figure.Figure
        With a canvas, without pyplot.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    with style(paper.font):
        size = (paper.width * MM, (height if paper.height is None else paper.height) * MM)
        pad = 0.2 * paper.font / 72.0
        layout = ConstrainedLayoutEngine(w_pad=pad, h_pad=pad, wspace=0.01, hspace=0.01)
        figure = Figure(figsize=size, layout=layout, dpi=150)
        FigureCanvasAgg(figure)
        yield figure
        for axes in figure.axes:
            axes.tick_params(which="both", labelsize=0.9 * paper.font, width=0.5, length=2.5, direction="in")
            axes.tick_params(which="minor", length=1.5)
        figure.align_ylabels()


@contextmanager
def style(font: float) -> Iterator[None]:
    """Settings of matplotlib as it comes, with those of the figures over them, for the time of the block."""
    import matplotlib
    import matplotlib.style

    chosen = {
        "font.family": ["DejaVu Sans"],
        "font.size": font,
        "axes.labelsize": font,
        "axes.titlesize": font,
        "legend.fontsize": 0.9 * font,
        "axes.linewidth": 0.5,
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.formatter.useoffset": False,
        "axes.formatter.limits": (-5, 7),
        "grid.color": "0.88",
        "grid.linewidth": 0.4,
        "lines.linewidth": 0.1 * font,
        "legend.frameon": False,
        "legend.handlelength": 2.4,
        "legend.columnspacing": 1.2,
        "text.parse_math": False,
        "pdf.fonttype": 42,
        "svg.fonttype": "none",
        "svg.hashsalt": "navfuse",
    }
    with matplotlib.style.context(["default", chosen]):
        yield


def height_of(rows: int, paper: Sheet, each: float = 24.0, extra: float = 18.0) -> float:
    """Height [mm] of a stack of panels with legend and time axis: a page at most, unless there are very many."""
    room = (MOST_HEIGHT_MM - extra) / max(rows, 1)
    return extra + rows * max(min(each, room), LEAST_PANEL_MM * paper.font / 8.0)


@dataclass(frozen=True, slots=True)
class Clock:
    """The time axis of the figures of a run.

    Attributes
    ----------
    label : str
        Of the axis.
    offset : float [s]
        Added to log time.
    utc : bool
        Whether seconds of the day are shown as hours and minutes.
    """

    label: str
    offset: float
    utc: bool = False

    def __call__(self, time: Array) -> Array:
        """Log time (n,) [s] as drawn."""
        return time + self.offset

    def at(self, time: float) -> float:
        """One log time [s] as drawn."""
        return float(time) + self.offset


def clock_of(result: Result, kind: str = "auto") -> Clock:
    """The time axis of a run.

    Parameters
    ----------
    result : Result
    kind : str
        ``gps``: seconds of the GPS week of the epoch, counted on past its end; ``utc``: time of day, with the leap
        seconds of the start of the run; ``log``: as the log has it; ``auto``: GPS where the epoch is known.

    Raises
    ------
    ConfigError
        If there is no such time, or the epoch that it needs is not known.
    """
    if kind not in CLOCKS:
        raise ConfigError(f"time {kind!r} has to be one of {', '.join(CLOCKS)}{meant(kind, CLOCKS)}")
    epoch, start = result.epoch, float(result.forward.time[0])
    if kind == "log" or epoch is None:
        if kind in ("gps", "utc"):
            raise ConfigError(
                f"time {kind!r}: the GPS time of this run is not known; give gnss.epoch_week_s and run it again"
            )
        base = 0.0 if abs(start) < FAR_FROM_ZERO_S else np.floor(start / 1000.0) * 1000.0
        return Clock(f"time since {base:.0f} s [s]" if base else "time [s]", -base)
    if kind != "utc":
        return Clock(f"GPS time [s of week {epoch.week}]", epoch.tow)
    gps = epoch.seconds + start
    leap = leap_at(gps)
    day = int((gps - leap) // DAY)
    return Clock(f"UTC, {utc_text(epoch, start)[:10]}", epoch.seconds - leap - day * DAY, True)


def time_axis(axes: Axes, clock: Clock, span: tuple[float, float], *, label: bool = True) -> None:
    """Limits, ticks and label of a time axis; `span` [s] in log time."""
    from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator

    first, last = (clock.at(t) for t in span)
    if not last > first:
        first, last = first - 0.5, last + 0.5
    axes.set_xlim(first, last)
    few = room_for(axes, 10.0 if clock.utc else 7.5)
    if clock.utc:
        step = next((s for s in _STEPS_S if (last - first) / s <= few), _STEPS_S[-1])
        axes.xaxis.set_major_locator(MultipleLocator(step))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: _time_of_day(x, step)))
    else:
        axes.xaxis.set_major_locator(MaxNLocator(max(few - 1, 1), steps=[1, 2, 5, 10]))
    if label:
        axes.set_xlabel(clock.label)


_STEPS_S = (
    0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 120.0, 300.0, 600.0, 900.0, 1800.0,
    3600.0, 7200.0, 10800.0, 21600.0, 43200.0, 86400.0, 604800.0,
)  # fmt: skip


def _time_of_day(x: float, step: float) -> str:
    x = round(x, 3) % DAY
    hours, minutes, seconds = int(x // 3600), int(x % 3600 // 60), x % 60
    if step >= 60.0:
        return f"{hours:02d}:{minutes:02d}"
    return f"{hours:02d}:{minutes:02d}:" + (f"{seconds:02.0f}" if step >= 1.0 else f"{seconds:04.1f}")


def room_for(axes: Axes, characters: float) -> int:
    """How many tick labels of so many characters stand beside each other under a panel."""
    import matplotlib

    figure, place = axes.get_figure(root=True), axes.get_subplotspec()
    columns = 1 if place is None else place.get_gridspec().ncols / len(place.colspan)
    width = 0.0 if figure is None else figure.get_size_inches()[0] * 72.0 * 0.82 / columns

    return max(int(width / (0.62 * 0.9 * matplotlib.rcParams["font.size"] * characters)), 2)


def log_axis(axes: Axes, values: Array, which: str = "y") -> None:
    """A logarithmic axis (``x`` or ``y``) around the positive values, ticks written as numbers; linear without any."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    positive = values[np.isfinite(values) & (values > 0.0)]
    if positive.size == 0:
        return
    low, high = float(positive.min()), float(positive.max())
    margin = max((high / low) ** 0.06, 1.15)
    low, high = low / margin, high * margin
    axes.set(**{f"{which}scale": "log", f"{which}lim": (low, high)})
    axis = axes.xaxis if which == "x" else axes.yaxis
    decades = np.log10(high / low)
    if decades < 0.8:
        axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10], min_n_ticks=3))
        axis.set_minor_formatter(NullFormatter())
    else:
        subs = (1.0, 2.0, 5.0) if decades < 2.0 else (1.0,)
        axis.set_major_locator(LogLocator(subs=subs, numticks=_ticks_up(axes) if which == "y" else 8))
        axis.set_minor_formatter(NullFormatter())
    axis.set_major_formatter(FuncFormatter(lambda x, _: power_text(x)))


def _ticks_up(axes: Axes) -> int:
    """How many tick labels stand above each other beside a panel."""
    import matplotlib

    figure, place = axes.get_figure(root=True), axes.get_subplotspec()
    rows = 1 if place is None else place.get_gridspec().nrows
    height = 0.0 if figure is None else figure.get_size_inches()[1] * 72.0 * 0.8 / rows
    return int(np.clip(height / (2.0 * matplotlib.rcParams["font.size"]), 2, 8))


def power_text(x: float) -> str:
    """A tick of a logarithmic axis: 0.01, 50, 10⁻⁵, 2·10⁻⁶."""
    if x == 0.0 or 1e-3 <= abs(x) < 9.9e4:
        return f"{x:.10g}"
    mantissa, exponent = f"{x:.3e}".split("e")
    power = "10" + str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    number = f"{float(mantissa):g}"
    return power if number == "1" else f"{number}·{power}"


def legend(figure: Figure, panels: list[Axes], paper: Sheet) -> None:
    """One legend over the panels of a figure, every label once, in as many columns as there is room for."""
    entries: dict[str, Any] = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if not entries:
        return
    longest = max(len(label) for label in entries)
    room = paper.width * MM * 72.0 / (0.9 * paper.font * (0.56 * longest + 4.5))
    columns = max(min(int(room), len(entries)), 1)
    columns = -(-len(entries) // -(-len(entries) // columns))
    figure.legend(list(entries.values()), list(entries), loc="outside upper center", ncols=columns, markerscale=1.4)


def meant(word: str, known: Iterable[str]) -> str:
    """End of a message: the known word that is nearest, if one is near."""
    like = nearest(word, known)
    return f"; did you mean {like}?" if like else ""


def plain(name: str) -> str:
    """Name of a sensor or state for people, on one line."""
    return " ".join(label_of(name).split())
