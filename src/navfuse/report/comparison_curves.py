"""What page and figure of a comparison of estimators draw: the same panels, once as curves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from navfuse.analysis.filter_comparison import WINDOW_S, EstimatorRun, FilterComparison, Solution, running_rms
from navfuse.data.trajectory import Trajectory
from navfuse.report.series import break_wraps, decimate

Array = np.ndarray

COLORS = ("#0072b2", "#d55e00", "#009e73", "#b5458f", "#8a6d00", "#4b3f9e", "#3d94d1", "#7a1f1f")
"""The first three after Okabe and Ito (2008); all with a contrast of 3 or more to white, which a thin line needs."""
REFERENCE = "#80868b"
CURVE_POINTS = 3000
THICKEST, THINNEST, REFERENCE_WIDTH = 2.4, 1.0, 4.5
"""Widths of lines [pt]."""


class Curve(NamedTuple):
    """A line of a panel; `kind` is "filter", "smoother" or "reference". Later lines are thinner, so that those below
    show where they lie on each other.
    """

    name: str
    kind: str
    color: str
    width: float
    x: Array
    y: Array


class Panel(NamedTuple):
    """Curves with common axes; `ratio` is how much longer a unit of y is drawn than one of x, zero for any, and
    `from_zero` whether y begins at zero.
    """

    key: str
    title: str
    x: str
    y: str
    curves: list[Curve]
    ratio: float = 0.0
    from_zero: bool = False


def panels(comparison: FilterComparison) -> list[Panel]:
    """Track, great-circle distance, latitude, longitude, altitude, running RMSE and 3-D distance.

    The filters come first, then the smoothers, which share their colours.
    """
    truth = comparison.against_truth
    other = "truth" if truth else "fixes"
    error = "error" if truth else "difference from the fixes"
    rmse = "RMSE" if truth else "RMS difference from the fixes"
    reference, time = comparison.reference, "time [s]"
    found = [
        Panel(
            "track",
            "Latitude against longitude",
            "longitude [deg]",
            "latitude [deg]",
            [_track(comparison, reference, other), *_each(comparison, lambda s: _degrees(s.trajectory), "")],
            1.0 / max(float(np.cos(np.mean(reference.lat))), 0.01),
        ),
        Panel(
            "great-circle",
            f"Great-circle distance from the {other} (haversine: a sphere, without height)",
            time,
            "distance [m]",
            _each(
                comparison, lambda s: (s.errors.time, s.great_circle), "mean {:.3g} m", lambda s: s.great_circle.mean()
            ),
            from_zero=True,
        ),
    ]
    for key, unit, column in (("latitude", "deg", 1), ("longitude", "deg", 0), ("altitude", "m", 2)):
        curves = [_over_time(comparison, reference, other, column)]
        curves += _each(comparison, lambda s, column=column: (s.trajectory.time, _position(s.trajectory)[column]), "")
        found.append(
            Panel(key, key.capitalize() + (" above the ellipsoid" * (column == 2)), time, f"{key} [{unit}]", curves)
        )
    found.append(
        Panel(
            "running-rmse",
            f"Running {rmse} of the 3-D position, over the last {WINDOW_S:g} s",
            time,
            f"{rmse} [m]",
            _each(
                comparison,
                lambda s: (s.errors.time, running_rms(s.errors.time, s.distance)),
                "RMSE {:.3g} m" if truth else "RMS {:.3g} m",
                lambda s: float(np.sqrt(np.mean(s.distance**2))),
            ),
            from_zero=True,
        )
    )
    found.append(
        Panel(
            "distance",
            f"3-D position {error}: straight distance, height included",
            time,
            "distance [m]",
            _each(comparison, lambda s: (s.errors.time, s.distance), "MAE {:.3g} m", lambda s: s.distance.mean()),
            from_zero=True,
        )
    )
    return found


def _each(comparison: FilterComparison, points, legend: str, value=None) -> list[Curve]:
    """A curve of every filter, then of every smoother; `points` gives x and y of a solution."""
    curves = []
    for kind in ("filter", "smoother"):
        for number, run in enumerate(comparison.runs):
            solution = _solution(run, kind)
            if solution is None:
                continue
            x, y = points(solution)
            rows = decimate(np.column_stack([x, y]) if not legend and value is None else np.asarray(y), CURVE_POINTS)
            name = run.estimator + (", smoothed" if kind == "smoother" else "")
            name += f": {legend.format(value(solution))}" if value is not None else ""
            width = THICKEST - (THICKEST - THINNEST) * number / max(len(comparison.runs) - 1, 1)
            if kind == "smoother":
                width *= 0.7
            curves.append(Curve(name, kind, COLORS[number % len(COLORS)], width, x[rows], y[rows]))
    return curves


def _solution(run: EstimatorRun, kind: str) -> Solution | None:
    return run.forward if kind == "filter" else run.smoothed


def _degrees(trajectory: Trajectory) -> tuple[Array, Array]:
    lon, lat, _ = _position(trajectory)
    return lon, lat


def _position(trajectory: Trajectory) -> tuple[Array, Array, Array]:
    return break_wraps(np.degrees(trajectory.lon), 360.0), np.degrees(trajectory.lat), trajectory.height


def _within(comparison: FilterComparison, reference: Trajectory) -> Trajectory:
    """The reference while there are solutions, so that it does not set the scale."""
    time = np.concatenate([run.forward.trajectory.time[[0, -1]] for run in comparison.runs])
    return reference.take((reference.time >= time.min()) & (reference.time <= time.max()))


def _track(comparison: FilterComparison, reference: Trajectory, name: str) -> Curve:
    lon, lat = _degrees(_within(comparison, reference))
    rows = decimate(np.column_stack([lon, lat]), CURVE_POINTS)
    return Curve(name, "reference", REFERENCE, REFERENCE_WIDTH, lon[rows], lat[rows])


def _over_time(comparison: FilterComparison, reference: Trajectory, name: str, column: int) -> Curve:
    shown = _within(comparison, reference)
    y = _position(shown)[column]
    rows = decimate(y, CURVE_POINTS)
    return Curve(name, "reference", REFERENCE, REFERENCE_WIDTH, shown.time[rows], y[rows])
