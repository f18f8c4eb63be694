"""The same as one interactive HTML page without network: deviations, spectrum, autocorrelation, table of terms."""

from __future__ import annotations

import json
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navfuse.analysis.allan.deviations import KINDS
from navfuse.io.atomic import atomic_file
from navfuse.report.allan_figures import MODEL, POINTS, TERM_COLORS, legend_of
from navfuse.report.allan_tables import FLOOR_NOTE, summary_lines, term_rows
from navfuse.report.allan_units import RATE_UNITS

if TYPE_CHECKING:
    from navfuse.analysis.allan.study import AllanStudy, AxisStudy

_STYLE = """
:root{color-scheme:light}
body{font:15px/1.45 system-ui,sans-serif;margin:0 auto;max-width:1200px;padding:0 16px
40px;color:#1c2430;background:#fff} h1{font-size:1.35rem}h2{font-size:1.1rem;margin-top:1.6rem}
table{border-collapse:collapse;font-variant-numeric:tabular-nums}td,th{padding:3px 12px 3px 0;text-align:left;
border-bottom:1px solid #e2e6ec;vertical-align:top}.wide{overflow-x:auto}.warning{color:#8a4b00}.plot{height:520px}
.absent td{color:#6b7480}
"""

_SCRIPT = """
for (const [id, traces, layout] of panels) {
  layout.paper_bgcolor = layout.plot_bgcolor = '#fff';
  layout.hovermode = 'closest';
  layout.margin = {l: 80, r: 20, t: 36, b: 52};
  Plotly.newPlot(id, traces, layout, {responsive: true, displaylogo: false});
}
"""


def write_page(path: str | Path, study: AllanStudy) -> None:
    """Write the page; it appears whole or not at all.

    Parameters
    ----------
    path : path-like
    study : AllanStudy

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    with atomic_file(path) as part:
        part.write_text(render(study), encoding="utf-8")


def render(study: AllanStudy) -> str:
    """The page as text."""
    from importlib.resources import files

    plotly = (files("plotly") / "package_data" / "plotly.min.js").read_text(encoding="utf-8")
    panels, bodies = [], []
    for k, axis in enumerate(study.axes):
        pieces = []
        for view, (traces, layout) in _views(study, axis).items():
            panels.append([f"{view}{k}", traces, layout])
            pieces.append(
                f'<div class="plot" id="{view}{k}" role="img" aria-label="{escape(axis.name)}: {view}"></div>'
            )
        bodies.append(f"<h2>{escape(axis.name)}</h2>\n" + "\n".join(pieces))
    title = f"Allan variance of {Path(study.source).name}"
    data = json.dumps(panels, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    lines = "".join(f"<li>{escape(line)}</li>" for line in summary_lines(study))
    warnings = "".join(f'<li class="warning">{escape(text)}</li>' for text in study.warnings)
    policy = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        f'<meta name="generator" content="navfuse"><title>{escape(title)}</title><style>{_STYLE}</style></head>\n'
        f"<body><h1>{escape(title)}</h1><ul>{lines}{warnings}</ul>\n<h2>Noise terms</h2>\n{_table(study)}\n"
        f"<p>{escape(FLOOR_NOTE)}. Values with one standard deviation.</p>\n"
        + "\n".join(bodies)
        + f"\n<script>{plotly}</script>\n<script>const panels = {data};{_SCRIPT}</script></body></html>\n"
    )


def _table(study: AllanStudy) -> str:
    head = "".join(f"<th>{name}</th>" for name in ("axis", "term", "value", "in other units", ""))
    rows = []
    for row in term_rows(study):
        absent = ' class="absent"' if row[2] == "not seen" else ""
        rows.append(f"<tr{absent}>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>")
    return f'<div class="wide"><table><tr>{head}</tr>{"".join(rows)}</table></div>'


def _views(study: AllanStudy, axis: AxisStudy) -> dict[str, tuple[list[Any], dict[str, Any]]]:
    name, _, factor = RATE_UNITS[axis.sensor]
    return {
        "deviation": _deviation(study, axis, name, factor),
        "spectrum": _spectrum(axis, name, factor),
        "autocorrelation": _autocorrelation(axis),
    }


def _deviation(study: AllanStudy, axis: AxisStudy, unit: str, factor: float) -> tuple[list[Any], dict[str, Any]]:
    traces: list[Any] = []
    for k, (kind, curve) in enumerate(axis.curves.items()):
        value, low, high = (x / factor for x in (curve.deviation, curve.low, curve.high))
        traces.append(
            {
                "x": _plain(curve.tau), "y": _plain(value), "mode": "markers", "name": KINDS[kind],
                "marker": {"size": 5, **({"color": POINTS} if k == 0 else {})},
                "error_y": {"type": "data", "symmetric": False, "array": _plain(high - value),
                            "arrayminus": _plain(value - low), "thickness": 1},
            }
        )  # fmt: skip
    first = next(iter(axis.curves.values()))
    tau = np.geomspace(first.tau[0], first.tau[-1], 200)
    found = axis.identification
    traces += [
        _line(
            tau,
            np.sqrt(found.allan_variance(tau, term.name)) / factor,
            legend_of(term.name, term.value, axis.sensor),
            TERM_COLORS[term.name],
            "dash",
        )
        for term in found.terms
        if term.present
    ]
    if any(term.present for term in found.terms):
        traces.append(_line(tau, np.sqrt(found.allan_variance(tau)) / factor, "fitted model", MODEL, "solid"))
    top, low = np.nanmax(first.deviation) / factor * 3.0, np.nanmin(first.low) / factor / 3.0
    layout = _layout("Deviation", "averaging time [s]", f"[{unit}]")
    layout["yaxis"]["range"] = [float(np.log10(low)), float(np.log10(top))]
    return traces, layout


def _spectrum(axis: AxisStudy, unit: str, factor: float) -> tuple[list[Any], dict[str, Any]]:
    found = axis.spectrum
    traces = [
        _line(found.frequency, np.sqrt(found.density) / factor, "Welch", POINTS, "solid"),
        _line(
            axis.identification.spectrum.frequency,
            np.sqrt(2.0 * axis.identification.density) / factor,
            "fitted model",
            MODEL,
            "solid",
        ),
    ]
    return traces, _layout("Amplitude spectral density, one-sided", "frequency [Hz]", f"[{unit}/sqrt(Hz)]")


def _autocorrelation(axis: AxisStudy) -> tuple[list[Any], dict[str, Any]]:
    found = axis.autocorrelation
    edge = [found.lag[0], found.lag[-1]]
    traces = [_line(found.lag, found.correlation, "autocorrelation", POINTS, "solid")]
    traces += [
        _line(np.array(edge), np.full(2, s * found.bound), "95 % of white noise", "#6b7280", "dot") for s in (1, -1)
    ]
    layout = _layout(f"Autocorrelation of means over {found.average:.4g} s", "lag [s]", "[1]")
    layout["xaxis"]["type"] = layout["yaxis"]["type"] = "linear"
    layout["showlegend"] = False
    return traces, layout


def _line(x: Any, y: Any, name: str, color: str, dash: str) -> dict[str, Any]:
    return {
        "x": _plain(x),
        "y": _plain(y),
        "mode": "lines",
        "name": name,
        "line": {"color": color, "dash": dash, "width": 1.6},
    }


def _layout(title: str, x: str, y: str) -> dict[str, Any]:
    return {
        "title": {"text": title, "font": {"size": 14}},
        "xaxis": {"title": {"text": x}, "type": "log", "exponentformat": "power"},
        "yaxis": {"title": {"text": y}, "type": "log", "exponentformat": "power"},
        "legend": {"font": {"size": 11}},
    }


def _plain(values: Any) -> list[float | None]:
    return [float(f"{x:.7g}") if np.isfinite(x) else None for x in np.asarray(values, dtype=float)]
