from __future__ import annotations

from dataclasses import replace
from io import StringIO

import pytest
from rich.console import Console

from navfuse.analysis.consistency import nis_summary
from navfuse.analysis.metrics import compare
from navfuse.data.result import Innovations
from navfuse.report.tables import (
    ALL_METRIC_COLUMNS,
    consistency_rows,
    consistency_table,
    consistency_text,
    metrics_rows,
    metrics_table,
    metrics_text,
    number,
)


@pytest.fixture(scope="module")
def metrics(drive):
    result, truth = drive
    return {
        "filter": compare(result.forward, truth),
        "smoother": compare(replace(result.smoothed, attitude=None), truth),
    }


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (1.0, "1.00"),
        (0.012345, "0.0123"),
        (-2.5, "-2.50"),
        (1234.5, "1234"),
        (3e-9, "3.00e-09"),
        (float("nan"), "-"),
    ],
)
def test_three_digits(value, text):
    assert number(value) == text


def test_decimals_can_be_given():
    assert number(1.0, 4) == "1.0000"
    assert number(1.0, 9) == "1.00e+00"


def test_solutions_stand_side_by_side(metrics):
    rows = metrics_rows(metrics)
    assert rows[0][:2] == ("position north", "m")
    assert len(rows[0][2]) == 8
    assert float(rows[0][2][0]) == pytest.approx(metrics["filter"].statistics["position_north"].rms, abs=6e-4)
    assert float(rows[0][2][4]) == pytest.approx(metrics["smoother"].statistics["position_north"].rms, abs=6e-4)
    heading = next(row for row in rows if row[0] == "heading")
    assert heading[2][4:] == ["-"] * 4


def test_plain_text_lines_up(metrics):
    lines = metrics_text(metrics).splitlines()
    assert len(lines) == 14
    assert lines[0].split("  ")[0] == "error"
    assert lines[0].split()[-8:] == ["smoother", "50", "%", "smoother", "95", "%", "smoother", "max"]
    assert len({len(line) for line in lines}) == 1


def test_consistency_row(drive):
    found = nis_summary(drive[0].innovations)
    header, rows = consistency_rows(found)
    assert header[:4] == ("source", "used", "rejected", "withheld")
    assert rows[0][:4] == ["gnss_position", "96", "3", "20"]
    assert rows[0][-1] == "consistent"
    assert "gnss_position" in consistency_text(found)
    untested = nis_summary(drive[0].innovations.select(drive[0].innovations.status == "withheld"))
    assert consistency_rows(untested)[1][0][4:] == ["-", "-", "-", "-", "nothing to test"]
    assert consistency_rows(nis_summary(Innovations.empty()))[1] == []


def test_terminal_tables_show_text_and_not_markup(metrics, drive):
    console = Console(width=200, record=True, file=StringIO())
    console.print(metrics_table(metrics, ALL_METRIC_COLUMNS, title="[bold]drive[/bold]"))
    console.print(consistency_table(nis_summary(drive[0].innovations)))
    shown = console.export_text()
    assert "[bold]drive[/bold]" in shown
    assert "position horizontal" in shown
    assert "consistent" in shown
