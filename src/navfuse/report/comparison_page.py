"""A comparison of estimators as one interactive HTML page without network: the table and every panel."""

from __future__ import annotations

import json
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navfuse.io.atomic import atomic_file
from navfuse.report.comparison_curves import Curve, Panel, panels

if TYPE_CHECKING:
    from navfuse.analysis.filter_comparison import FilterComparison

_STYLE = """
:root{color-scheme:light}
body{font:15px/1.45 system-ui,sans-serif;margin:0 auto;max-width:1200px;padding:0 16px
40px;color:#1c2430;background:#fff} h1{font-size:1.35rem}h2{font-size:1.1rem;margin-top:1.6rem}
table{border-collapse:collapse;font-variant-numeric:tabular-nums}td,th{padding:3px 16px 3px 0;text-align:right;
border-bottom:1px solid #e2e6ec;vertical-align:top}
td:first-child,th:first-child,td:nth-child(2),th:nth-child(2){text-align:left}
.wide{overflow-x:auto}.warning{color:#8a4b00;font-weight:600}.plot{height:420px}#track{height:640px}
"""

_SCRIPT = """
for (const [id, traces, layout] of panels) {
  layout.paper_bgcolor = layout.plot_bgcolor = '#fff';
  layout.hovermode = 'closest';
  layout.margin = {l: 90, r: 20, t: 44, b: 52};
  Plotly.newPlot(id, traces, layout, {responsive: true, displaylogo: false});
}
"""

_DASHES = {"filter": "solid", "smoother": "dash", "reference": "solid"}


def write_page(path: str | Path, comparison: FilterComparison) -> None:
    """Write the page; it appears whole or not at all.

    Parameters
    ----------
    path : path-like
    comparison : FilterComparison

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    with atomic_file(path) as part:
        part.write_text(render(comparison), encoding="utf-8")


def render(comparison: FilterComparison) -> str:
    """The page as text."""
    from importlib.resources import files

    plotly = (files("plotly") / "package_data" / "plotly.min.js").read_text(encoding="utf-8")
    drawn = panels(comparison)
    bodies = "\n".join(
        f'<div class="plot" id="{panel.key}" role="group" aria-label="{escape(panel.title)}"></div>' for panel in drawn
    )
    data = json.dumps([_plot(panel) for panel in drawn], separators=(",", ":"), allow_nan=False)
    title = f"Estimators on {Path(comparison.project).name}: {', '.join(comparison.estimators)}"
    first, *others = comparison.notes()
    kind = "" if comparison.against_truth else ' class="warning"'
    notes = f"<li{kind}>{escape(first)}</li>" + "".join(f"<li>{escape(line)}</li>" for line in others)
    for run in comparison.runs:
        notes += "".join(f'<li class="warning">{escape(run.estimator)}: {escape(note)}</li>' for note in run.notes)
    policy = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        f'<meta name="generator" content="navfuse"><title>{escape(title)}</title><style>{_STYLE}</style></head>\n'
        f"<body><main><h1>{escape(title)}</h1>\n<ul>{notes}</ul>\n{_table(comparison)}\n<h2>Plots</h2>\n"
        f"<p>Filters in full lines; click a smoother in a legend to show it, dashed.</p>\n{bodies}</main>\n"
        f"<script>{plotly}</script>\n<script>const panels = "
        + data.replace("<", "\\u003c")
        + f";{_SCRIPT}</script></body></html>\n"
    )


def _table(comparison: FilterComparison) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in ("quantity", "unit", *comparison.estimators))
    rows = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in (label, unit, *values))}</tr>"
        for label, unit, values in comparison.table()
    )
    table = f"<table><tr>{head}</tr>{rows}</table>"
    return f'<div class="wide" tabindex="0" role="region" aria-label="Errors">{table}</div>'


def _plot(panel: Panel) -> tuple[str, list[dict[str, Any]], dict[str, Any]]:
    layout: dict[str, Any] = {
        "title": {"text": panel.title, "font": {"size": 14}},
        "xaxis": {"title": {"text": panel.x}, "exponentformat": "none"},
        "yaxis": {"title": {"text": panel.y}, "exponentformat": "none"},
        "legend": {"font": {"size": 12}},
    }
    if panel.from_zero:
        layout["yaxis"]["rangemode"] = "tozero"
    if panel.ratio:
        layout["yaxis"] |= {"scaleanchor": "x", "scaleratio": panel.ratio}
    return panel.key, [_trace(curve) for curve in panel.curves], layout


def _trace(curve: Curve) -> dict[str, Any]:
    return {
        "x": _plain(curve.x),
        "y": _plain(curve.y),
        "mode": "lines",
        "name": curve.name,
        "visible": "legendonly" if curve.kind == "smoother" else True,
        "line": {"color": curve.color, "dash": _DASHES[curve.kind], "width": curve.width},
    }


def _plain(values: Any) -> list[float | None]:
    """Ten digits: a centimetre of longitude."""
    return [float(f"{x:.10g}") if np.isfinite(x) else None for x in np.asarray(values, dtype=float)]
