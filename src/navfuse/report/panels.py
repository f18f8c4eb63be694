"""The page's plots as plain data: panels of stacked rows over one time axis, and the map; ``page.js`` draws them.

A curve is a dictionary ``{name, role, kind, x, y}``: `role` picks its colour (forward, smoothed, truth, used, rejected,
withheld, late, guide); `kind` is ``line``, ``points`` or ``band`` (from `y` to `y2`). Arrays are float32 in base64,
times relative to the start of the run.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator
from typing import Any

import numpy as np

from navfuse.analysis.metrics import ErrorSeries
from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.data.result import Innovations, Result
from navfuse.data.trajectory import Trajectory
from navfuse.report.series import (
    NAMES,
    POSITION_SOURCE,
    break_wraps,
    decimate,
    east_north,
    fix_status,
    gaps,
    origin_of,
    thin,
)

Array = np.ndarray
Panel = dict[str, Any]
Solutions = dict[str, Trajectory]

CURVE_POINTS = 2000
CLOUD_POINTS = 1500
MAP_POINTS = 4000

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
STATUS_NAMES = {
    "used": "used",
    "reset": "used after a reset",
    "rejected": "rejected",
    "withheld": "withheld",
    "late": "too late",
}


def solutions_of(result: Result, truth: Trajectory | None = None) -> Solutions:
    """Trajectories to draw by role."""
    found = {"forward": result.forward}
    if result.smoothed is not None:
        found["smoothed"] = result.smoothed
    if truth is not None:
        found["truth"] = truth
    return found


def map_panel(result: Result, truth: Trajectory | None) -> Panel:
    """Tracks and fixes in local east and north [m], origin at the start of the run."""
    origin = origin_of(result.forward)
    start = float(result.forward.time[0])
    tracks = []
    for role, trajectory in solutions_of(result, truth).items():
        plane = east_north(trajectory, origin)
        rows = decimate(plane, MAP_POINTS)
        tracks.append(
            _curve(NAMES[role], role, "line", trajectory.time[rows] - start, plane[rows, 1])
            | {"e": _pack(plane[rows, 0])}
        )
    clouds = []
    status = fix_status(result)
    if result.fixes is not None and status is not None:
        plane = east_north(result.fixes, origin)
        for name in ("unused", *STATUS_NAMES):
            found = np.flatnonzero(status == name)
            rows = found[thin(found.size, CLOUD_POINTS)]
            if rows.size:
                label = f"fixes {STATUS_NAMES.get(name, 'not used')}"
                cloud = _curve(label, name, "points", result.fixes.time[rows] - start, plane[rows, 1])
                clouds.append(cloud | {"e": _pack(plane[rows, 0])})
    return {"clouds": clouds, "tracks": tracks}


def time_panels(result: Result, truth: Trajectory | None, series: dict[str, ErrorSeries]) -> list[Panel]:
    """Every panel over time, in page order."""
    start = float(result.forward.time[0])
    panels = [_errors(block, series, start) for block in AXES]
    panels += [_sigmas(block, solutions_of(result), start) for block in AXES]
    panels.append(_motion(solutions_of(result, truth), start))
    panels += [_innovations(source, result.innovations.of(source), start) for source in result.innovations.sources]
    panels.append(_nis(result.innovations, start))
    panels += list(_states(result, start))
    return [panel for panel in panels if panel["rows"]]


def shading(result: Result) -> list[list[float]]:
    """Stretches without a used fix, relative to the start of the run [s]."""
    start = float(result.forward.time[0])
    known = POSITION_SOURCE in result.innovations.sources
    return [[window.start - start, window.end - start] for window in gaps(result)] if known else []


def _errors(block: str, series: dict[str, ErrorSeries], start: float) -> Panel:
    unit, scale = UNITS[block]
    rows = []
    for k, axis in enumerate(AXES[block]):
        curves = []
        for role, errors in series.items():
            values, sd = getattr(errors, block), getattr(errors, f"sd_{block}")
            if values is None:
                continue
            value = values[:, k] * scale
            limit = np.full_like(value, np.nan) if sd is None else np.minimum(3.0 * sd[:, k] * scale, _ceiling(block))
            chosen = decimate(np.column_stack((value, limit)) if sd is not None else value, CURVE_POINTS)
            time = errors.time[chosen] - start
            if sd is not None:
                curves.append(_band(f"{NAMES[role]} ±3σ", role, time, -limit[chosen], limit[chosen]))
            curves.append(_curve(NAMES[role], role, "line", time, value[chosen]))
        rows.append(_row(axis, unit, sorted(curves, key=lambda curve: curve["kind"] != "band"), zero=True))
    found = [row for row in rows if row["curves"]]
    note = "Solution minus truth, inside three standard deviations (shaded) 99.7 % of the time when these are right."
    return _panel(f"{block.capitalize()} errors against truth", note, found, "Errors")


def _ceiling(block: str) -> float:
    return 180.0 if block == "attitude" else np.inf


def _sigmas(block: str, solutions: Solutions, start: float) -> Panel:
    unit, scale = UNITS[block]
    rows = []
    for k, axis in enumerate(AXES[block]):
        curves = []
        for role, trajectory in solutions.items():
            sd = getattr(trajectory, f"sd_{block}")
            if sd is not None:
                chosen = decimate(sd[:, k], CURVE_POINTS)
                curves.append(_curve(NAMES[role], role, "line", trajectory.time[chosen] - start, sd[chosen, k] * scale))
        rows.append(_row(f"σ {axis}", unit, curves, log=True))
    found = [row for row in rows if row["curves"]]
    note = "Expected error, one standard deviation, logarithmic."
    return _panel(f"Expected {block} error", note, found, "Accuracy")


def _motion(solutions: Solutions, start: float) -> Panel:
    labels = (("height", "m"), ("speed", "m/s"), ("roll", "deg"), ("pitch", "deg"), ("heading", "deg"))
    rows = {label: _row(label, unit, []) for label, unit in labels}
    for role, trajectory in solutions.items():
        curves = {"height": trajectory.height}
        if trajectory.velocity_n is not None:
            curves["speed"] = np.linalg.norm(trajectory.velocity_n, axis=1)
        if trajectory.attitude is not None:
            curves |= dict(zip(AXES["attitude"], np.degrees(trajectory.attitude).T, strict=True))
            curves["heading"] = np.mod(curves["heading"], 360.0)
        for label, values in curves.items():
            chosen = decimate(values, CURVE_POINTS)
            drawn = break_wraps(values[chosen], 360.0) if label in AXES["attitude"] else values[chosen]
            rows[label]["curves"].append(_curve(NAMES[role], role, "line", trajectory.time[chosen] - start, drawn))
    note = "Ellipsoidal height; heading clockwise from true north."
    return _panel("Height, speed and attitude", note, [row for row in rows.values() if row["curves"]], "Motion")


def _innovations(source: str, records: Innovations, start: float) -> Panel:
    size = int(records.dof.max())
    block = source.removeprefix("gnss_")
    known = source in ("gnss_position", "gnss_velocity")
    axes = AXES[block] if known else tuple(f"z{k + 1}" for k in range(size))
    unit = UNITS[block][0] if known else "sensor unit"
    rows = []
    for k in range(size):
        formed = records.select(np.isfinite(records.z[:, k]) & np.isfinite(records.sd[:, k]))
        order = np.argsort(formed.time, kind="stable")
        limit = 3.0 * formed.sd[order, k]
        chosen = decimate(limit, CURVE_POINTS)
        curves = [_band("±3σ", "guide", formed.time[order][chosen] - start, -limit[chosen], limit[chosen])]
        curves += _clouds(formed, formed.z[:, k], start)
        rows.append(_row(axes[k], unit, curves, zero=True))
    note = "Measured minus predicted, and three standard deviations of it (shaded)."
    return _panel(f"Innovations: {_plain(source)}", note, rows, "Measurements")


def _nis(innovations: Innovations, start: float) -> Panel:
    from scipy.special import chdtri

    rows = []
    for source in innovations.sources:
        records = innovations.of(source)
        formed = records.select(np.isfinite(records.nis) & (records.nis > 0.0))
        if len(formed):
            usual = float(chdtri(float(np.median(formed.dof)), 0.01))
            ends = formed.time[[0, -1]] - start
            curves = _clouds(formed, formed.nis, start)
            curves.append(_curve("99 % lie below", "guide", "line", ends, np.full(2, usual)))
            rows.append(_row(_plain(source), "1", curves, log=True))
    note = "Normalized innovation squared, logarithmic. Many points above the line: the filter is too sure of itself."
    return _panel("Consistency (NIS)", note, rows, "Measurements")


def _clouds(records: Innovations, values: Array, start: float) -> list[dict[str, Any]]:
    curves = []
    for status, name in STATUS_NAMES.items():
        found = np.flatnonzero(records.status == status)
        if found.size:
            rows = found[decimate(values[found], CLOUD_POINTS)]
            curves.append(_curve(name, status, "points", records.time[rows] - start, values[rows]))
    return curves


def _states(result: Result, start: float) -> Iterator[Panel]:
    for name, (time, values, sd) in result.states.items():
        unit, scale = STATE_UNITS.get(name, ("SI", 1.0))
        labels = ("x", "y", "z") if values.shape[1] == 3 else tuple(str(k + 1) for k in range(values.shape[1]))
        rows = []
        for k, label in enumerate(labels):
            value, limit = values[:, k] * scale, 3.0 * sd[:, k] * scale
            chosen = decimate(np.column_stack((value - limit, value + limit, value)), CURVE_POINTS)
            x, low, high = time[chosen] - start, (value - limit)[chosen], (value + limit)[chosen]
            curves = [_band("±3σ", "forward", x, low, high), _curve("filter", "forward", "line", x, value[chosen])]
            rows.append(_row(label, unit, curves))
        note = (
            "The filter's estimate and three standard deviations (shaded); it should settle inside its own first band."
        )
        yield _panel(f"Estimated {_plain(name)}", note, rows, "Sensor")


def _plain(name: str) -> str:
    return name.replace("_", " ")


def _panel(title: str, note: str, rows: list[Panel], section: str) -> Panel:
    return {"title": title, "note": note, "rows": rows, "section": section}


def _row(label: str, unit: str, curves: list[dict[str, Any]], *, log: bool = False, zero: bool = False) -> Panel:
    return {"label": label, "unit": unit, "curves": curves, "log": log, "zero": zero}


def _curve(name: str, role: str, kind: str, x: Array, y: Array) -> dict[str, Any]:
    return {"name": name, "role": role, "kind": kind, "x": _pack(x), "y": _pack(y)}


def _band(name: str, role: str, x: Array, low: Array, high: Array) -> dict[str, Any]:
    return _curve(name, role, "band", x, low) | {"y2": _pack(high)}


def _pack(values: Array) -> str:
    return b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")
