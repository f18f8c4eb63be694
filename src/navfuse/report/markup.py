"""Pieces of the report's HTML that show without any script; every text that comes from outside is escaped here."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

from navfuse.analysis.consistency import NisSummary
from navfuse.analysis.metrics import ErrorMetrics
from navfuse.report.curves import Panel
from navfuse.report.quality import Percentiles
from navfuse.report.tables import METRIC_COLUMNS, consistency_rows, metrics_rows, number
from navfuse.report.text import shown
from navfuse.report.verdict import Verdict

FRAME_PX = 70
ROW_PX = 132
MOST_POINTS = 40
MARKS = {"bad": "Serious", "check": "Look", "info": "Note"}


def text(content: object) -> str:
    """Text from anywhere as HTML that shows it and does nothing else."""
    return escape(shown(content))


def verdict(outcome: Verdict) -> str:
    """The headline and its points."""
    points = [f'<li class="{p.level}"><b>{MARKS[p.level]}</b>{text(p.text)}</li>' for p in outcome.points]
    if len(points) > MOST_POINTS:
        more = f"<li><b>Note</b>{len(points) - MOST_POINTS} more are in summary.json</li>"
        points = [*points[:MOST_POINTS], more]
    listing = f"<ul>{''.join(points)}</ul>" if points else ""
    return (
        f'<section class="verdict {outcome.level}" aria-label="Verdict"><h2>{text(outcome.headline)}</h2>'
        f"{listing}</section>"
    )


def cards(outcome: Verdict) -> str:
    """The numbers that matter."""
    cells = (
        f"<div><dt>{text(card.label)}</dt><dd>{text(card.value)}</dd><dd>{text(card.detail)}</dd></div>"
        for card in outcome.cards
    )
    return f'<dl class="cards">{"".join(cells)}</dl>'


def metrics(found: dict[str, ErrorMetrics], circles: dict[str, Percentiles], skip_s: float) -> str:
    """The tables of errors against the truth; nothing without one."""
    if not found:
        return ""
    width = len(METRIC_COLUMNS)
    since = f", the first {skip_s:g} s left out" if skip_s else ""
    groups = (f'<th class="group" scope="colgroup" colspan="{width}">{escape(name)}</th>' for name in found)
    names = (f'<th scope="col">{name}</th>' for _ in found for name, _ in METRIC_COLUMNS)
    rows = []
    for label, unit, values in metrics_rows(found):
        cells = (_cell(value, "group" if k % width == 0 else "") for k, value in enumerate(values))
        rows.append(f'<tr><th scope="row">{escape(label)} [{escape(unit)}]</th>{"".join(cells)}</tr>')
    head = f"<tr><td></td>{''.join(groups)}</tr><tr><td></td>{''.join(names)}</tr>"
    caption = f"Solution minus truth{since}; percentiles and maximum of the magnitude."
    errors = _table("Errors", caption, head, rows)
    return f'<section id="table"><h2>Errors against truth</h2>{errors}{_circles(circles)}</section>'


def _circles(circles: dict[str, Percentiles]) -> str:
    names = ("CEP50 [m]", "CEP95 [m]", "vertical 50 % [m]", "vertical 95 % [m]", "epochs")
    head = "".join(f'<th scope="col">{name}</th>' for name in names)
    rows = [
        f'<tr><th scope="row">{escape(name)}</th>{"".join(_cell(number(value)) for value in found[:4])}'
        f"{_cell(str(found.n))}</tr>"
        for name, found in circles.items()
    ]
    caption = "Radii about the truth that hold half, and 95 %, of the horizontal errors; the same of the height."
    return _table("Position percentiles", caption, f"<tr><td></td>{head}</tr>", rows)


def consistency(found: dict[str, NisSummary]) -> str:
    """The table of innovation statistics per aiding source."""
    if not found:
        return ""
    header, body = consistency_rows(found)
    rows = [f'<tr><th scope="row">{text(row[0])}</th>{"".join(_cell(text) for text in row[1:])}</tr>' for row in body]
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in header)
    caption = "Mean NIS per component; 1 for a right model. Withheld windows are left out of the test."
    return _table("Consistency", caption, f"<tr>{head}</tr>", rows)


def section(name: str, before: str, panels: Iterable[tuple[int, Panel]]) -> str:
    """A section of panels, each with its place in the page's data."""
    figures = "".join(_figure(k, panel) for k, panel in panels)
    return f'<section id="{name.lower()}"><h2>{name}</h2>{before}{figures}</section>'


def details(summary: Mapping[str, Any]) -> str:
    """The run's summary as a table of dotted keys."""
    rows = [f'<tr><th scope="row">{text(key)}</th>{_cell(value)}</tr>' for key, value in _flat(summary)]
    return _table("Details", "As in summary.json.", "", rows) if rows else "<p>None recorded.</p>"


def _figure(index: int, panel: Panel) -> str:
    title, note, numbers = text(panel["title"]), text(panel["note"]), text(panel["numbers"])
    if panel["empty"]:
        return f'<div class="empty"><h3>{title}</h3><p>Not shown: {text(panel["empty"])}</p></div>'
    height = FRAME_PX + ROW_PX * max(len(panel["rows"]), 2)
    axis = f"{panel['x']['label']} in {panel['x']['unit']}" if "x" in panel else "time"
    rows = ", ".join(f"{row['label']} in {row['unit']}" for row in panel["rows"])
    alternative = f"{title} over {text(axis)}: {text(rows)}. {numbers}"
    summary = f'<p class="numbers">{numbers}</p>' if numbers else ""
    box = f'data-panel="{index}" role="img" aria-label="{alternative}" style="height:{height}px"'
    caption = f"<figcaption><h3>{title}</h3><p>{note}</p>{summary}</figcaption>"
    return f'<figure>{caption}<div class="plot" {box}></div></figure>'


def _table(name: str, caption: str, head: str, rows: list[str]) -> str:
    return (
        f'<p class="soft">{escape(caption)}</p>'
        f'<div class="scroll" tabindex="0" role="region" aria-label="{name}"><table>'
        f"{f'<thead>{head}</thead>' if head else ''}<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _cell(content: str, kind: str = "") -> str:
    return f"<td{f' class={kind}' if kind else ''}>{text(content)}</td>"


def _flat(value: Any, prefix: str = "") -> list[tuple[str, str]]:
    if isinstance(value, Mapping):
        return [row for key, entry in value.items() for row in _flat(entry, f"{prefix}.{key}" if prefix else str(key))]
    if isinstance(value, float):
        return [(prefix, f"{value:.6g}")]
    if isinstance(value, (list, tuple)):
        return [(prefix, ", ".join(one for entry in value for _, one in _flat(entry, prefix)))]
    return [(prefix, str(value))]
