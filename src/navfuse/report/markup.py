"""Pieces of the report's HTML that show without any script; every text that comes from outside is escaped here."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

from navfuse.analysis.consistency import NisSummary
from navfuse.analysis.metrics import ErrorMetrics
from navfuse.report.panels import Panel
from navfuse.report.tables import METRIC_COLUMNS, consistency_rows, metrics_rows
from navfuse.report.verdict import Verdict

FRAME_PX = 60
ROW_PX = 132
MARKS = {"bad": "Serious", "check": "Look", "info": "Note"}


def verdict(outcome: Verdict) -> str:
    """The headline and its points."""
    points = "".join(f'<li class="{p.level}"><b>{MARKS[p.level]}</b>{escape(p.text)}</li>' for p in outcome.points)
    listing = f"<ul>{points}</ul>" if points else ""
    return f'<div class="verdict {outcome.level}"><p>{escape(outcome.headline)}</p>{listing}</div>'


def cards(outcome: Verdict) -> str:
    """The numbers that matter."""
    cells = (
        f"<div><dt>{escape(card.label)}</dt><dd>{escape(card.value)}</dd><dd>{escape(card.detail)}</dd></div>"
        for card in outcome.cards
    )
    return f'<dl class="cards">{"".join(cells)}</dl>'


def metrics(found: dict[str, ErrorMetrics], skip_s: float) -> str:
    """The table of errors against the truth; nothing without one."""
    if not found:
        return ""
    width = len(METRIC_COLUMNS)
    since = f", the first {skip_s:g} s left out" if skip_s else ""
    groups = (f'<th class="group" scope="colgroup" colspan="{width}">{escape(name)}</th>' for name in found)
    names = (f'<th scope="col">{name}</th>' for _ in found for name, _ in METRIC_COLUMNS)
    rows = []
    for label, unit, values in metrics_rows(found):
        cells = (_cell(text, "group" if k % width == 0 else "") for k, text in enumerate(values))
        rows.append(f'<tr><th scope="row">{escape(label)} [{escape(unit)}]</th>{"".join(cells)}</tr>')
    head = f"<tr><td></td>{''.join(groups)}</tr><tr><td></td>{''.join(names)}</tr>"
    caption = f"Solution minus truth{since}; percentiles and maximum of the magnitude."
    return f'<section id="table"><h2>Errors against truth</h2>{_table("Errors", caption, head, rows)}</section>'


def consistency(found: dict[str, NisSummary]) -> str:
    """The table of innovation statistics per aiding source."""
    header, body = consistency_rows(found)
    rows = [f'<tr><th scope="row">{escape(row[0])}</th>{"".join(_cell(text) for text in row[1:])}</tr>' for row in body]
    head = "".join(f"<th scope=col>{escape(name)}</th>" for name in header)
    caption = "Mean NIS per component; 1 for a right model. Withheld windows are left out of the test."
    return _table("Consistency", caption, f"<tr>{head}</tr>", rows)


def section(name: str, before: str, panels: Iterable[tuple[int, Panel]]) -> str:
    """A section of panels, each with its place in the page's data."""
    figures = "".join(_figure(k, panel) for k, panel in panels)
    return f'<section id="{name.lower()}"><h2>{name}</h2>{before}{figures}</section>'


def details(summary: Mapping[str, Any]) -> str:
    """The run's summary as a table of dotted keys."""
    rows = [f"<tr><th scope=row>{escape(key)}</th>{_cell(value)}</tr>" for key, value in _flat(summary)]
    return _table("Details", "As in summary.json.", "", rows) if rows else "<p>None recorded.</p>"


def _figure(index: int, panel: Panel) -> str:
    height = FRAME_PX + ROW_PX * max(len(panel["rows"]), 2)
    title, note = escape(panel["title"]), escape(panel["note"])
    rows = escape(", ".join(f"{row['label']} in {row['unit']}" for row in panel["rows"]))
    box = f'data-panel="{index}" role="img" aria-label="{title} over time: {rows}" style="height:{height}px"'
    return f'<figure><figcaption><h3>{title}</h3><p>{note}</p></figcaption><div class="plot" {box}></div></figure>'


def _table(name: str, caption: str, head: str, rows: list[str]) -> str:
    return (
        f'<p class="soft">{escape(caption)}</p>'
        f'<div class="scroll" tabindex="0" role="region" aria-label="{name}"><table>'
        f"<thead>{head}</thead><tbody>{''.join(rows)}</tbody></table></div>"
    )


def _cell(text: str, kind: str = "") -> str:
    return f"<td{f' class={kind}' if kind else ''}>{escape(text)}</td>"


def _flat(value: Any, prefix: str = "") -> list[tuple[str, str]]:
    if isinstance(value, Mapping):
        return [row for key, entry in value.items() for row in _flat(entry, f"{prefix}.{key}" if prefix else str(key))]
    if isinstance(value, float):
        return [(prefix, f"{value:.6g}")]
    if isinstance(value, (list, tuple)):
        return [(prefix, ", ".join(text for entry in value for _, text in _flat(entry, prefix)))]
    return [(prefix, str(value))]
