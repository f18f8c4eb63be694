"""Panels of the sensors: estimated states, and the inertial log's rate, gaps and spectra."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.data.imu_overview import ImuOverview
from navfuse.data.result import StateHistory
from navfuse.report.curves import (
    BAND_POINTS,
    CLOUD_POINTS,
    CURVE_POINTS,
    STATE_UNITS,
    Panel,
    Scene,
    band_between,
    curve,
    digits,
    middle,
    over_time,
    panel,
    row,
)
from navfuse.report.series import decimate
from navfuse.report.text import label

Array = np.ndarray

SECTION = "Sensors"
MOST_BLOCKS = 12
MOST_ROWS = 6
SPECTRUM_POINTS = 1100
BODY = ("x", "y", "z")
NO_SPECTRUM = "the log is too short for a spectrum, or all its values are equal"
CROSS = ("xy", "xz", "yx", "yz", "zx", "zy")


def sensor_panels(scene: Scene) -> list[Panel]:
    """Every panel of the section, in page order."""
    if scene.bare:
        why = "a trajectory alone holds no sensor states; give the folder of a run"
        return [panel("Sensor states, IMU rate and spectra", "", [], SECTION, why=why)]
    states = scene.result.states
    found = [_state(scene, name, history) for name, history in list(states.items())[:MOST_BLOCKS]]
    if not found:
        found.append(panel("Estimated sensor states", "", [], SECTION, why="the filter estimated no sensor states"))
    if len(states) > MOST_BLOCKS:
        more = ", ".join(label(name) for name in list(states)[MOST_BLOCKS : MOST_BLOCKS + 20])
        found.append(panel("Other sensor states", "", [], SECTION, why=f"not drawn, in states.parquet: {more}"))
    return [*found, _rate(scene, scene.result.imu), *_spectra(scene.result.imu)]


def _state(scene: Scene, name: str, history: StateHistory) -> Panel:
    unit, scale = STATE_UNITS.get(name, ("SI", 1.0))
    time, values, sd = history.time - scene.start, history.values * scale, history.sd * scale
    labels = _labels(name, values.shape[1])
    rows, numbers = [], []
    for k, axis in enumerate(labels[:MOST_ROWS]):
        if not time.size:
            continue
        value, limit = values[:, k], 3.0 * sd[:, k]
        drawn = decimate(value, CURVE_POINTS)
        edges = decimate(np.column_stack((value - limit, value + limit)), BAND_POINTS)
        low, high = (value - limit)[edges], (value + limit)[edges]
        curves = [over_time("filter", "forward", "line", time[drawn], value[drawn])]
        curves.append(band_between("±3σ", "forward", time[edges], low, high))
        rows.append(row(axis, unit, curves))
        numbers.append(f"{axis} {digits(value[-1])} ± {digits(sd[-1, k])}")
    more = f" {len(labels) - MOST_ROWS} more components are in states.parquet." if len(labels) > MOST_ROWS else ""
    return panel(
        f"Estimated {label(name)}",
        "The filter's estimate and three standard deviations (shaded); it should settle inside its own first band."
        + more,
        rows,
        SECTION,
        numbers=f"At the end: {', '.join(numbers)} {unit} (1σ).",
        why="no event happened at which it would have been noted",
    )


def _labels(name: str, size: int) -> Sequence[str]:
    if size == len(BODY):
        return BODY
    if size == len(CROSS) and name.endswith("_cross"):
        return CROSS
    return tuple(f"component {k + 1}" for k in range(size))


def _rate(scene: Scene, imu: ImuOverview | None) -> Panel:
    rows, numbers = [], ""
    if imu is not None and imu.time.size:
        time = imu.time - scene.start
        chosen = decimate(imu.rate, CURVE_POINTS)
        ends = time[[0, -1]]
        curves = [
            over_time("samples per second", "forward", "line", time[chosen], imu.rate[chosen]),
            over_time("usual rate", "guide", "line", ends, np.full(2, imu.usual_rate)),
        ]
        rows.append(row("rate", "Hz", curves))
        numbers = f"Usual rate {digits(imu.usual_rate)} Hz; no gaps."
        if imu.gap_start.size:
            picked = decimate(imu.gap_length, CLOUD_POINTS)
            gaps = over_time("gaps", "rejected", "points", imu.gap_start[picked] - scene.start, imu.gap_length[picked])
            rows.append(row("gap", "s", [gaps], log=True))
            k = int(np.argmax(imu.gap_length))
            numbers = (
                f"Usual rate {digits(imu.usual_rate)} Hz; {imu.gap_start.size} gaps, {digits(imu.gap_length.sum())} s "
                f"in all, the longest {digits(imu.gap_length[k])} s after {imu.gap_start[k]:.2f} s."
            )
    return panel(
        "IMU rate and gaps",
        "Samples in each stretch of the inertial log over its length; a step half more than the usual one is a gap.",
        rows,
        SECTION,
        numbers=numbers,
        why=_why_no_imu(imu),
    )


def _spectra(imu: ImuOverview | None) -> list[Panel]:
    kinds = (
        ("Angular rate spectrum", "gyro_psd", "deg/s/√Hz", 180.0 / np.pi),
        ("Specific force spectrum", "accel_psd", "mg/√Hz", 1e3 / STANDARD_GRAVITY),
    )
    note = (
        "Square root of the one-sided power spectral density over the whole log, logarithmic: lines are engine and "
        "structure, the floor is the noise of the sensor, the rise to the left is the motion. "
    )
    found = []
    for title, attribute, unit, scale in kinds:
        curves, numbers = [], []
        if imu is not None and imu.frequency.size:
            density = np.sqrt(getattr(imu, attribute)) * scale
            for k, axis in enumerate(BODY):
                known = np.flatnonzero(density[:, k] > 0.0)
                if known.size:
                    chosen = known[decimate(density[known, k], SPECTRUM_POINTS)]
                    x, y = imu.frequency[chosen], density[chosen, k]
                    curves.append(curve(axis, f"axis{k + 1}", "line", x, y))
                    numbers.append(f"{axis} {digits(middle(density[:, k]))}")
        found.append(
            panel(
                title,
                note,
                [row("density", unit, curves, log=True)],
                SECTION,
                numbers=f"Median over frequency: {', '.join(numbers)} {unit}." if numbers else "",
                why=_why_no_imu(imu) if imu is None else NO_SPECTRUM,
                x=("frequency", "Hz", True),
            )
        )
    return found


def _why_no_imu(imu: ImuOverview | None) -> str:
    return "no overview of the inertial log was kept with this run" if imu is None else "the log is too short"
