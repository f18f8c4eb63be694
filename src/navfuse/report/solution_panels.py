"""Panels of the solution: errors against a truth, their distribution, sigmas, motion, filter minus smoother."""

from __future__ import annotations

import numpy as np

from navfuse.analysis.metrics import ErrorSeries
from navfuse.data.trajectory import Trajectory
from navfuse.report.curves import (
    AXES,
    BAND_POINTS,
    CURVE_POINTS,
    NO_TRUTH,
    UNITS,
    Curve,
    Panel,
    Scene,
    band,
    curve,
    digits,
    middle,
    over_time,
    panel,
    rms,
    row,
    solutions_of,
)
from navfuse.report.packing import Steps
from navfuse.report.quality import error_cdf, position_percentiles
from navfuse.report.series import Origin, break_wraps, decimate, east_north, origin_of, thin

Array = np.ndarray

CDF_POINTS = 600
HALF_TURN_DEG = 180.0
SHARES = (50.0, 95.0)
MOTION_STEPS = {"m": 1e-3, "m/s": 1e-4, "deg": 1e-3}


def error_panels(scene: Scene) -> list[Panel]:
    """Errors inside their envelopes, and how they are distributed; one notice without a truth."""
    if scene.truth is None:
        return [panel("Errors and their distribution", "", [], "Errors", why=NO_TRUTH)]
    found = []
    for block in AXES:
        note = (
            "Solution minus truth, inside three standard deviations (shaded) 99.7 % of the time when these are right."
        )
        found.append(_deviations(scene, block, scene.errors, f"{block.capitalize()} errors against truth", note))
    return [*found, *(_distribution(scene, block) for block in AXES)]


def sigma_panels(scene: Scene) -> list[Panel]:
    """Standard deviations that the solutions claim."""
    return [_sigmas(scene, block) for block in AXES]


def separation_panels(scene: Scene) -> list[Panel]:
    """Filter minus smoother inside three standard deviations of the difference."""
    title = "Filter minus smoother"
    if scene.apart is None:
        return [panel(title, "", [], "Separation", why=scene.why_not_apart)]
    note = (
        "Two solutions of the same data: when both are right, the difference has the covariance of the filter less "
        "that of the smoother and stays inside three of its standard deviations (shaded). No truth is needed. "
        "Spikes far beyond what 95 % of the epochs need leave the picture."
    )
    series = {"difference": scene.apart}
    return [_deviations(scene, block, series, f"{title}: {block}", note, "Separation") for block in AXES]


def motion_panels(scene: Scene) -> list[Panel]:
    """Position, velocity and attitude over time."""
    origin = origin_of(scene.result.forward)
    solutions = solutions_of(scene.result, scene.truth)
    rows: dict[str, dict[str, list[Curve]]] = {
        "position": {"north": [], "east": [], "height": []},
        "velocity": {"north": [], "east": [], "down": []},
        "attitude": {"roll": [], "pitch": [], "heading": []},
    }
    for role, trajectory in solutions.items():
        for block, values in _motion(trajectory, origin).items():
            for name, one in values.items():
                chosen = decimate(one, CURVE_POINTS)
                drawn = break_wraps(one[chosen], 360.0) if block == "attitude" else one[chosen]
                time = trajectory.time[chosen] - scene.start
                step = Steps(drawn, MOTION_STEPS[UNITS[block][0]])
                rows[block][name].append(over_time(scene.names[role], role, "line", time, step))
    notes = {
        "position": "North and east of the start; height above the ellipsoid.",
        "velocity": "Relative to the Earth.",
        "attitude": "Roll right side down, pitch nose up, heading clockwise from true north.",
    }
    why = {block: f"the trajectory has no {block}" for block in rows}
    return [
        panel(
            block.capitalize(),
            notes[block],
            [row(name, UNITS[block][0], curves) for name, curves in named.items()],
            "Motion",
            numbers=_motion_numbers(scene.result.trajectory, block),
            why=why[block],
        )
        for block, named in rows.items()
    ]


def _deviations(
    scene: Scene, block: str, series: dict[str, ErrorSeries], title: str, note: str, section: str = "Errors"
) -> Panel:
    unit, scale = UNITS[block]
    rows, numbers = [], []
    for k, axis in enumerate(AXES[block]):
        curves = []
        for role, errors in series.items():
            values, sd = getattr(errors, block), getattr(errors, f"sd_{block}")
            if values is None:
                continue
            name, value, time = scene.names.get(role, role), values[:, k] * scale, errors.time - scene.start
            chosen = decimate(value, CURVE_POINTS)
            curves.append(over_time(name, role, "line", time[chosen], value[chosen]))
            if sd is not None:
                limit = np.minimum(3.0 * sd[:, k] * scale, HALF_TURN_DEG if block == "attitude" else np.inf)
                chosen = decimate(limit, BAND_POINTS)
                curves.append(band(f"{name} ±3σ", role, time[chosen], limit[chosen]))
        rows.append(row(axis, unit, curves, zero=True))
    for role, errors in series.items():
        if getattr(errors, block) is not None:
            numbers.append(_deviation_numbers(scene.names.get(role, role), errors, block))
    why = f"the solution or the truth has no {block}" if section == "Errors" else f"the trajectories have no {block}"
    return panel(title, note, rows, section, numbers=" ".join(numbers), why=why)


def _deviation_numbers(name: str, errors: ErrorSeries, block: str) -> str:
    unit, scale = UNITS[block]
    values, sd = getattr(errors, block) * scale, getattr(errors, f"sd_{block}")
    each = ", ".join(f"{axis} {digits(rms(values[:, k]))}" for k, axis in enumerate(AXES[block]))
    text = f"{name.capitalize()}: RMS {each} {unit}"
    size = np.where(np.isfinite(values), np.abs(values), -1.0)
    at, k = np.unravel_index(int(np.argmax(size)), size.shape)
    if size[at, k] >= 0.0:
        text += f"; largest {digits(size[at, k])} {unit} ({AXES[block][k]}, at {errors.time[at]:.1f} s)"
    if sd is not None:
        ratio = values / np.where(sd > 0.0, sd * scale, np.nan)
        known = np.isfinite(ratio)
        if known.any():
            text += f"; {np.mean(np.abs(ratio[known]) <= 3.0):.1%} inside ±3σ, {digits(rms(ratio))} σ RMS"
    return text + "."


def _distribution(scene: Scene, block: str) -> Panel:
    unit, scale = UNITS[block]
    curves, numbers = [], []
    for role, errors in scene.errors.items():
        values = getattr(errors, block)
        if values is None:
            continue
        name = scene.names[role]
        for part, dash, error in _parts(block, values, errors):
            size, share = error_cdf(error * scale)
            if not size.size:
                continue
            chosen = thin(size.size, CDF_POINTS)
            curves.append(curve(f"{name} {part}", role, "line", size[chosen], 100.0 * share[chosen], dash=dash))
        numbers.append(_percentile_text(name, block, errors, values))
    span = _reach([entry["x"] for entry in curves])
    if span is not None:
        curves += [curve(f"{share:.0f} %", "guide", "line", np.array(span), np.full(2, share)) for share in SHARES]
    note = "Share of the errors that are not larger than a size, logarithmic."
    return panel(
        f"Distribution of the {block} errors",
        note,
        [row("share", "%", curves if span else [], span=(0.0, 102.0))],
        "Errors",
        numbers=" ".join(numbers),
        why=f"the solution or the truth has no {block}, or no error is above zero",
        x=(f"{block} error", unit, True),
        span=span,
    )


def _reach(sizes: list[Array]) -> tuple[float, float] | None:
    """From the smallest first percentile to the largest size; None where all are zero."""
    above = [size[size > 0.0] for size in sizes]
    low = [float(size[size.size // 100]) for size in above if size.size]
    high = [float(size[-1]) for size in above if size.size]
    return (min(low), max(max(high), 1.01 * min(low))) if low else None


def _parts(block: str, values: Array, errors: ErrorSeries) -> list[tuple[str, str, Array]]:
    if block != "attitude":
        return [("horizontal", "solid", np.hypot(values[:, 0], values[:, 1])), ("vertical", "dot", values[:, 2])]
    return [("roll, pitch", "dot", np.hypot(values[:, 0], values[:, 1])), ("heading", "solid", values[:, 2])]


def _percentile_text(name: str, block: str, errors: ErrorSeries, values: Array) -> str:
    unit, scale = UNITS[block]
    if block == "position":
        found = position_percentiles(errors)
        return (
            f"{name.capitalize()}: horizontal CEP50 {digits(found.cep50)} m, CEP95 {digits(found.cep95)} m; "
            f"vertical 50 % {digits(found.le50)} m, 95 % {digits(found.le95)} m."
        )
    texts = []
    for part, _, error in _parts(block, values, errors):
        size, _ = error_cdf(error * scale)
        if size.size:
            half, most = np.percentile(size, SHARES)
            texts.append(f"{part} 50 % {digits(half)}, 95 % {digits(most)} {unit}")
    return f"{name.capitalize()}: {'; '.join(texts)}."


def _sigmas(scene: Scene, block: str) -> Panel:
    unit, scale = UNITS[block]
    rows, numbers = [], []
    for k, axis in enumerate(AXES[block]):
        curves = []
        for role, trajectory in scene.solutions.items():
            sd = getattr(trajectory, f"sd_{block}")
            if sd is not None:
                chosen = decimate(sd[:, k], CURVE_POINTS)
                time = trajectory.time[chosen] - scene.start
                curves.append(over_time(scene.names[role], role, "line", time, sd[chosen, k] * scale))
        rows.append(row(f"σ {axis}", unit, curves, log=True))
    for role, trajectory in scene.solutions.items():
        sd = getattr(trajectory, f"sd_{block}")
        if sd is not None:
            each = ", ".join(f"{axis} {digits(middle(sd[:, k]) * scale)}" for k, axis in enumerate(AXES[block]))
            worst = ", ".join(digits(value * scale) for value in np.nanmax(sd, axis=0, initial=0.0))
            numbers.append(f"{scene.names[role].capitalize()}: median {each} {unit}; largest {worst} {unit}.")
    return panel(
        f"Expected {block} error",
        "One standard deviation, logarithmic.",
        rows,
        "Accuracy",
        numbers=" ".join(numbers),
        why=f"the trajectory has no standard deviations of {block}",
    )


def _motion(trajectory: Trajectory, origin: Origin) -> dict[str, dict[str, Array]]:
    plane = east_north(trajectory, origin)
    found = {"position": {"north": plane[:, 1], "east": plane[:, 0], "height": trajectory.height}}
    if trajectory.velocity_n is not None:
        found["velocity"] = dict(zip(AXES["velocity"], trajectory.velocity_n.T, strict=True))
    if trajectory.attitude is not None:
        found["attitude"] = dict(zip(AXES["attitude"], np.degrees(trajectory.attitude).T, strict=True))
        found["attitude"]["heading"] = np.mod(found["attitude"]["heading"], 360.0)
    return found


def _motion_numbers(best: Trajectory, block: str) -> str:
    if block == "position":
        return f"Height {digits(np.nanmin(best.height))} to {digits(np.nanmax(best.height))} m."
    if block == "velocity" and best.velocity_n is not None:
        speed = np.hypot(best.velocity_n[:, 0], best.velocity_n[:, 1])
        return f"Fastest {digits(np.nanmax(speed))} m/s horizontally, median {digits(middle(speed))} m/s."
    if block == "attitude" and best.attitude is not None:
        low, high = np.degrees(np.nanmin(best.attitude, axis=0)), np.degrees(np.nanmax(best.attitude, axis=0))
        return f"Roll {low[0]:.1f} to {high[0]:.1f} deg, pitch {low[1]:.1f} to {high[1]:.1f} deg."
    return ""
