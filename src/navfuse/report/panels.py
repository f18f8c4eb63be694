"""The page's plots as plain data: panels of stacked rows, the map, the stretches to shade. The script draws them."""

from __future__ import annotations

from navfuse.data.result import Result
from navfuse.report.curves import AXES, STATE_UNITS, UNITS, Panel, Scene, Solutions, solutions_of
from navfuse.report.map_panel import MAP_POINTS, map_panel
from navfuse.report.measurement_panels import STATUS_NAMES, measurement_panels
from navfuse.report.sensor_panels import sensor_panels
from navfuse.report.series import POSITION_SOURCE, gaps
from navfuse.report.solution_panels import error_panels, motion_panels, separation_panels, sigma_panels

__all__ = [
    "AXES",
    "MAP_POINTS",
    "STATE_UNITS",
    "STATUS_NAMES",
    "UNITS",
    "Panel",
    "Scene",
    "Solutions",
    "map_panel",
    "page_panels",
    "shading",
    "solutions_of",
]


def page_panels(scene: Scene) -> list[Panel]:
    """Every panel below the map, in page order."""
    return [
        *error_panels(scene),
        *sigma_panels(scene),
        *separation_panels(scene),
        *motion_panels(scene),
        *measurement_panels(scene),
        *sensor_panels(scene),
    ]


def shading(result: Result) -> list[list[float]]:
    """Stretches without a used fix, relative to the start of the run [s]."""
    start = float(result.forward.time[0])
    known = POSITION_SOURCE in result.innovations.sources
    return [[window.start - start, window.end - start] for window in gaps(result)] if known else []
