"""What the page's panels are made of: the scene they show, and curves, rows and panels as plain dictionaries.

A curve is ``{name, role, kind, x, y}``: `role` picks its colour in the style sheet; `kind` is ``line``, ``points``,
``steps`` (a histogram) or ``band`` (from `y` to `y2`, or from -`y2` to `y2` without `y`). Rows share the axis of their
panel: time since the start of the run, or `x` of a panel that says so. A panel without rows says why in `empty`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from navfuse.analysis.consistency import NisSummary
from navfuse.analysis.metrics import ErrorSeries
from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.report.packing import Steps
from navfuse.report.series import NAMES
from navfuse.report.text import label, shown

Array = np.ndarray
Curve = dict[str, Any]
Row = dict[str, Any]
Panel = dict[str, Any]
Solutions = dict[str, Trajectory]

CURVE_POINTS = 2000
BAND_POINTS = 1200
CLOUD_POINTS = 1500
TIME_STEP = 1e-4

AXES = {
    "position": ("north", "east", "down"),
    "velocity": ("north", "east", "down"),
    "attitude": ("roll", "pitch", "heading"),
}
UNITS = {"position": ("m", 1.0), "velocity": ("m/s", 1.0), "attitude": ("deg", 180.0 / np.pi)}
STATE_UNITS = {
    "gyro_bias": ("deg/h", 180.0 / np.pi * 3600.0),
    "accel_bias": ("mg", 1e3 / STANDARD_GRAVITY),
    "gyro_scale": ("ppm", 1e6),
    "accel_scale": ("ppm", 1e6),
    "gyro_cross": ("mrad", 1e3),
    "accel_cross": ("mrad", 1e3),
}
BARE_NAMES = {"forward": "solution", "smoothed": "smoother", "truth": "truth"}
NO_TRUTH = "no truth was given; navfuse compare RUN TRUTH --report FILE makes this page with one"


@dataclass(frozen=True)
class Scene:
    """All that the panels show.

    Attributes
    ----------
    result : Result
    truth : Trajectory or None
    errors : dict of str to ErrorSeries
        By role ("forward", "smoothed"); empty without a truth.
    apart : ErrorSeries or None
        Filter minus smoother.
    why_not_apart : str
        Why there is no such thing.
    consistency : dict of str to NisSummary
    bare : bool
        A trajectory alone, not a run.
    """

    result: Result
    truth: Trajectory | None
    errors: dict[str, ErrorSeries]
    apart: ErrorSeries | None
    why_not_apart: str
    consistency: dict[str, NisSummary]
    bare: bool = False

    @property
    def start(self) -> float:
        """Log time from which the curves count [s]."""
        return float(self.result.forward.time[0])

    @property
    def names(self) -> dict[str, str]:
        """What the solutions are called, by role."""
        return BARE_NAMES if self.bare else NAMES

    @property
    def solutions(self) -> Solutions:
        """Trajectories by role, without the truth."""
        return solutions_of(self.result)


def solutions_of(result: Result, truth: Trajectory | None = None) -> Solutions:
    """Trajectories to draw by role."""
    found = {"forward": result.forward}
    if result.smoothed is not None and len(result.smoothed):
        found["smoothed"] = result.smoothed
    if truth is not None:
        found["truth"] = truth
    return found


def curve(name: str, role: str, kind: str, x: Array | Steps, y: Array | Steps, **more: Any) -> Curve:
    """A curve over anything; the name may come from outside."""
    return {"name": label(name), "role": role, "kind": kind, "x": x, "y": y, **more}


def over_time(name: str, role: str, kind: str, time: Array, y: Array | Steps, **more: Any) -> Curve:
    """A curve over the time since the start of the run [s]."""
    return curve(name, role, kind, Steps(time, TIME_STEP), y, **more)


def band(name: str, role: str, time: Array, half: Array) -> Curve:
    """A band about zero."""
    return {"name": label(name), "role": role, "kind": "band", "x": Steps(time, TIME_STEP), "y2": half}


def band_between(name: str, role: str, time: Array, low: Array, high: Array) -> Curve:
    """A band from one curve to another."""
    return over_time(name, role, "band", time, low, y2=high)


def row(
    name: str,
    unit: str,
    curves: Sequence[Curve],
    *,
    log: bool = False,
    zero: bool = False,
    span: tuple[float, float] | None = None,
    floor: float = 0.0,
) -> Row:
    """A row of a panel: bands behind, then curves.

    `zero`: an error about zero; `log`: a logarithmic axis, from `floor` up where that is given; `span`: fixed limits.
    """
    ordered = sorted(curves, key=lambda entry: entry["kind"] != "band")
    made: Row = {"label": label(name), "unit": unit, "curves": ordered, "log": log, "zero": zero}
    if span is not None:
        made["range"] = span
    if floor > 0.0:
        made["floor"] = floor
    return made


def panel(
    title: str,
    note: str,
    rows: Iterable[Row],
    section: str,
    *,
    numbers: str = "",
    why: str = "nothing was recorded",
    x: tuple[str, str, bool] | None = None,
    span: tuple[float, float] | None = None,
) -> Panel:
    """A panel of the rows that have curves; without any it says why.

    Parameters
    ----------
    title, note, section : str
    rows : iterable of Row
    numbers : str
        The few numbers one would read off the curves.
    why : str
        Said in place of the plot when there is nothing to draw.
    x : (label, unit, logarithmic), optional
        Axis of a panel that is not over time.
    span : (from, to), optional
        Its limits; default all that is drawn.
    """
    drawn = [entry for entry in rows if entry["curves"]]
    made: Panel = {
        "title": shown(title, 120),
        "note": note,
        "rows": drawn,
        "section": section,
        "numbers": shown(numbers) if drawn else "",
        "empty": "" if drawn else shown(why),
    }
    if x is not None:
        made["x"] = {"label": x[0], "unit": x[1], "log": x[2]} | ({} if span is None else {"range": span})
    return made


def digits(value: float) -> str:
    """Three significant digits, for sentences; more before the point where there are more."""
    size = abs(value)
    if not np.isfinite(value):
        return "unknown"
    if size >= 1e6 or 0.0 < size < 1e-4:
        return f"{value:.2e}"
    return f"{value:.0f}" if size >= 100.0 else f"{value:.3g}"


def rms(values: Array) -> float:
    """Root mean square of what is finite; NaN without any."""
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else float("nan")


def middle(values: Array) -> float:
    """Median of what is finite; NaN without any."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else float("nan")
