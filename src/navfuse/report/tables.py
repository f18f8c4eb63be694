"""Tables of errors and of consistency, as rows of text, as plain text, and for a terminal with rich."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from navfuse.analysis.consistency import NisSummary
from navfuse.analysis.metrics import ErrorMetrics

if TYPE_CHECKING:
    import rich.table

METRIC_COLUMNS = (("RMS", "rms"), ("50 %", "p50"), ("95 %", "p95"), ("max", "max"))
ALL_METRIC_COLUMNS = (
    ("RMS", "rms"),
    ("mean", "mean"),
    ("50 %", "p50"),
    ("68 %", "p68"),
    ("95 %", "p95"),
    ("99 %", "p99"),
    ("max", "max"),
)
CONSISTENCY_COLUMNS = (
    "source",
    "used",
    "rejected",
    "withheld",
    "mean NIS",
    "99 % bounds",
    "with rejected",
    "lag-one",
    "verdict",
)

MAX_DECIMALS = 6

Columns = Sequence[tuple[str, str]]


def number(value: float, decimals: int | None = None) -> str:
    """A number for a table: three significant digits, or a fixed count of decimals; a dash for what does not exist."""
    if not math.isfinite(value):
        return "-"
    places = decimals_for(value) if decimals is None else decimals
    return f"{value:.2e}" if places > MAX_DECIMALS else f"{value:.{places}f}"


def decimals_for(value: float) -> int:
    """Decimals that show three significant digits of a number; above :data:`MAX_DECIMALS` it wants an exponent."""
    return max(0, 2 - math.floor(math.log10(abs(value)))) if value and math.isfinite(value) else 0


def metrics_rows(
    metrics: dict[str, ErrorMetrics], columns: Columns = METRIC_COLUMNS
) -> list[tuple[str, str, list[str]]]:
    """Label, unit and the columns of every solution side by side, for the quantities that any of them has.

    The decimals of a row show three digits of its smallest RMS, so that the numbers in it line up.
    """
    listed = {
        name: {label: (unit, values) for label, unit, values in metric.rows()} for name, metric in metrics.items()
    }
    labels = dict.fromkeys(label for entries in listed.values() for label in entries)
    rows = []
    for label in labels:
        found = [entries.get(label) for entries in listed.values()]
        known = [entry for entry in found if entry is not None]
        decimals = max(decimals_for(values.rms) for _, values in known)
        cells = []
        for entry in found:
            cells += ["-" if entry is None else number(getattr(entry[1], key), decimals) for _, key in columns]
        rows.append((label, known[0][0], cells))
    return rows


def consistency_rows(consistency: dict[str, NisSummary]) -> tuple[tuple[str, ...], list[list[str]]]:
    """Header and rows of the consistency table, one row per aiding source; means and bounds per component."""
    rows = []
    for source, summary in consistency.items():
        counts = [str(summary.counts.get(status, 0)) for status in ("used", "rejected", "withheld")]
        bounds = " .. ".join(number(value) for value in summary.bounds) if summary.n else "-"
        tested = [
            number(summary.mean_nis_per_dof),
            bounds,
            number(summary.mean_nis_per_dof_with_rejected),
            number(summary.lag_one),
        ]
        rows.append([source, *counts, *tested, summary.verdict])
    return CONSISTENCY_COLUMNS, rows


def metrics_text(metrics: dict[str, ErrorMetrics], columns: Columns = METRIC_COLUMNS) -> str:
    """Error table of one or more solutions as aligned plain text, for pipes and logs."""
    header = ["error", "unit", *(f"{name} {label}" for name in metrics for label, _ in columns)]
    return _aligned(header, [[label, unit, *cells] for label, unit, cells in metrics_rows(metrics, columns)], left=2)


def consistency_text(consistency: dict[str, NisSummary]) -> str:
    """Consistency table as aligned plain text."""
    header, rows = consistency_rows(consistency)
    return _aligned(list(header), rows, left=1)


def metrics_table(
    metrics: dict[str, ErrorMetrics], columns: Columns = METRIC_COLUMNS, title: str = ""
) -> rich.table.Table:
    """Error table of one or more solutions for a terminal."""
    header = ["error", "unit", *(f"{name}\n{label}" for name in metrics for label, _ in columns)]
    return _rich(header, [[label, unit, *cells] for label, unit, cells in metrics_rows(metrics, columns)], 2, title)


def consistency_table(consistency: dict[str, NisSummary], title: str = "") -> rich.table.Table:
    """Consistency table for a terminal."""
    header, rows = consistency_rows(consistency)
    return _rich(list(header), rows, 1, title)


def _aligned(header: list[str], rows: list[list[str]], left: int) -> str:
    table = [header, *rows]
    widths = [max(len(row[k]) for row in table) for k in range(len(header))]
    lines = []
    for row in table:
        cells = [
            text.ljust(width) if k < left else text.rjust(width)
            for k, (text, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def _rich(header: list[str], rows: list[list[str]], left: int, title: str) -> rich.table.Table:
    from rich.box import SIMPLE
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title) if title else None, box=SIMPLE)
    for k, name in enumerate(header):
        table.add_column(Text(name), justify="left" if k < left else "right", no_wrap=True)
    for row in rows:
        table.add_row(*(Text(text) for text in row))
    return table
