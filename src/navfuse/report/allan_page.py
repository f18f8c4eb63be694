"""The same as one interactive HTML page without network: deviations, spectrum, autocorrelation, table of terms.

The numbers are plain HTML and show without any script. Colours are named by role and looked up in the style sheet,
which has a light and a dark set of them.
"""

from __future__ import annotations

import json
from html import escape
from importlib.resources import files
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navfuse.analysis.allan.deviations import KINDS
from navfuse.io.atomic import atomic_file
from navfuse.report.allan_figures import duration, legend_of, level_text, model_label, row_limits
from navfuse.report.allan_tables import FLOOR_NOTE, axis_rows, notices, term_rows
from navfuse.report.allan_units import RATE_UNITS

if TYPE_CHECKING:
    from navfuse.analysis.allan.study import AllanStudy, AxisStudy

TITLES = {
    "deviation": "Deviation",
    "spectrum": "Amplitude spectral density, one-sided",
    "autocorrelation": "Autocorrelation",
}


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
    plotly = (files("plotly") / "package_data" / "plotly.min.js").read_text(encoding="utf-8")
    panels: list[dict[str, Any]] = []
    bodies, links = [], []
    for k, axis in enumerate(study.axes):
        pieces = []
        for view, panel in _views(study, axis).items():
            panels.append({"id": f"{view}{k}", **panel})
            title = TITLES[view]
            if view == "autocorrelation":
                title += f" of means over {axis.autocorrelation.average:.4g} s"
            small = "" if view == "deviation" else ' class="small"'
            pieces.append(
                f'<div{small}><h3>{title}</h3><div class="plot" id="{view}{k}" role="group" '
                f'aria-label="{escape(axis.name)}: {title}"></div></div>'
            )
        bodies.append(f'<section id="axis{k}"><h2>{escape(axis.name)}</h2>\n' + "\n".join(pieces) + "</section>")
        links.append(f'<a href="#axis{k}">{escape(axis.name)}</a>')
    title = f"Allan variance of {Path(study.source).name}"
    facts = f"{study.kind}, {study.rate:.6g} Hz, {duration(study.span)} at rest, from {_seconds(study)} of the record"
    data = json.dumps(panels, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    policy = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        f'<meta name="generator" content="navfuse"><title>{escape(title)}</title>\n'
        f"<style>\n{_asset('allan.css')}</style></head>\n"
        f'<body><main><h1>{escape(title)}</h1>\n<p>{escape(facts)}</p>\n<p class="soft">{escape(study.source)}</p>\n'
        f'<nav aria-label="Axes"><a href="#terms">Noise terms</a>{"".join(links)}</nav>\n{_notices(study)}'
        f"<h2>Channels</h2>\n{_channels(study)}\n"
        f'<h2 id="terms">Noise terms</h2>\n{_terms(study)}\n'
        f'<p class="soft">{escape(FLOOR_NOTE)}. Values with one standard deviation. What is not seen stays below the '
        "limit, with the probability beside it.</p>\n"
        '<p id="message" class="message" role="status">The plots below need JavaScript.</p>\n'
        + "\n".join(bodies)
        + f"\n</main><script>{plotly}</script>\n<script>const panels = {data};\n{_asset('allan.js')}</script></body>"
        "</html>\n"
    )


def _asset(name: str) -> str:
    return (files("navfuse.report") / "assets" / name).read_text(encoding="utf-8")


def _seconds(study: AllanStudy) -> str:
    return f"{study.rest.begin / study.rate:.6g} to {study.rest.end / study.rate:.6g} s"


def _notices(study: AllanStudy) -> str:
    if not study.warnings:
        return ""
    lines = "".join(f"<li>{escape(text)}</li>\n" for text in notices(study))
    return f'<section class="notices"><h2>To know</h2><ul>{lines}</ul></section>\n'


def _channels(study: AllanStudy) -> str:
    titles = ("axis", "mean", "standard deviation", "resolution", "fit of the model")
    rows = [[f"<th>{escape(row[0])}</th>", *_cells(row[1:])] for row in axis_rows(study)]
    return _table("Axes", titles, [f"<tr>{''.join(row)}</tr>" for row in rows])


def _terms(study: AllanStudy) -> str:
    rows = []
    for axis, group in groupby(term_rows(study), key=lambda row: row[0]):
        entries = list(group)
        head = f'<th rowspan="{len(entries)}">{escape(axis)}</th>'
        for row in entries:
            absent = ' class="absent"' if row[2] == "not seen" else ""
            rows.append(f"<tr>{head}{''.join(_cells(row[1:], absent))}</tr>")
            head = ""
    return _table("Noise terms", ("axis", "term", "value", "in other units", "limit, floor or time"), rows)


def _cells(row: tuple[str, ...], attribute: str = "") -> list[str]:
    return [f"<td{attribute}>{escape(cell)}</td>" for cell in row]


def _table(name: str, titles: tuple[str, ...], rows: list[str]) -> str:
    head = "".join(f"<th>{title}</th>" for title in titles)
    body = "\n".join(rows)
    table = f"<table><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table>"
    return f'<div class="scroll" tabindex="0" role="region" aria-label="{name}">{table}</div>'


def _views(study: AllanStudy, axis: AxisStudy) -> dict[str, dict[str, Any]]:
    name, _, factor = RATE_UNITS[axis.sensor]
    return {
        "deviation": _deviation(study, axis, name, factor),
        "spectrum": _spectrum(axis, name, factor),
        "autocorrelation": _autocorrelation(axis),
    }


def _deviation(study: AllanStudy, axis: AxisStudy, unit: str, factor: float) -> dict[str, Any]:
    hover = f"%{{x:.4~g}} s: %{{y:.4~g}} {unit}"
    traces: list[dict[str, Any]] = []
    for k, (kind, curve) in enumerate(axis.curves.items()):
        value, low, high = (x / factor for x in (curve.deviation, curve.low, curve.high))
        traces.append(
            {
                "x": _plain(curve.tau), "y": _plain(value), "up": _plain(high - value), "down": _plain(value - low),
                "mode": "markers", "name": f"{KINDS[kind]}, {level_text(study.settings.level)}",
                "role": f"kind{k}" if k else "points", "hover": hover,
            }
        )  # fmt: skip
    first = next(iter(axis.curves.values()))
    tau = np.geomspace(first.tau[0], first.tau[-1], 200)
    found = axis.identification
    present = [term for term in found.terms if term.present]
    if present:
        label = model_label(study.settings.kinds[0])
        traces.append(_line(tau, np.sqrt(found.allan_variance(tau)) / factor, label, "model", "solid", hover))
    for name in dict.fromkeys(term.name for term in present):
        label = legend_of([term.value for term in present if term.name == name], name, axis.sensor)
        line = np.sqrt(found.allan_variance(tau, name)) / factor
        traces.append(_line(tau, line, label, name, "dash", hover))
    panel = _panel(traces, "averaging time [s]", f"deviation [{unit}]", "log")
    panel["y"]["range"] = [float(np.log10(limit)) for limit in row_limits(study, axis.sensor)]
    return panel


def _spectrum(axis: AxisStudy, unit: str, factor: float) -> dict[str, Any]:
    found, model = axis.spectrum, axis.identification
    hover = f"%{{x:.4~g}} Hz: %{{y:.4~g}} {unit}/sqrt(Hz)"
    traces = [_line(found.frequency, np.sqrt(found.density) / factor, "measured (Welch)", "points", "solid", hover)]
    if any(term.present for term in model.terms):
        density = np.sqrt(2.0 * model.density) / factor
        traces.append(_line(model.spectrum.frequency, density, "fitted model", "model", "solid", hover))
    return _panel(traces, "frequency [Hz]", f"density [{unit}/sqrt(Hz)]", "log")


def _autocorrelation(axis: AxisStudy) -> dict[str, Any]:
    found = axis.autocorrelation
    edge = np.array([found.lag[0], found.lag[-1]])
    hover = "%{x:.4~g} s: %{y:.3f}"
    traces = [_line(found.lag, found.correlation, "autocorrelation", "points", "solid", hover)]
    traces += [
        _line(edge, np.full(2, s * found.bound), "95 % of white noise", "bound", "dot", hover) for s in (1.0, -1.0)
    ]
    return {**_panel(traces, "lag [s]", "autocorrelation [1]", "linear"), "legend": False}


def _line(x: Any, y: Any, name: str, role: str, dash: str, hover: str) -> dict[str, Any]:
    return {"x": _plain(x), "y": _plain(y), "mode": "lines", "name": name, "role": role, "dash": dash, "hover": hover}


def _panel(traces: list[dict[str, Any]], x: str, y: str, scale: str) -> dict[str, Any]:
    return {"traces": traces, "x": {"title": x, "type": scale}, "y": {"title": y, "type": scale}, "legend": True}


def _plain(values: Any) -> list[float | None]:
    return [float(f"{x:.7g}") if np.isfinite(x) else None for x in np.asarray(values, dtype=float)]
