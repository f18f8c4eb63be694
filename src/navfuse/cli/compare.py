"""``navfuse compare``: a solution against a truth, in numbers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from navfuse.errors import InputError

if TYPE_CHECKING:
    from rich.table import Table

    from navfuse.analysis.metrics import ErrorMetrics
    from navfuse.data.trajectory import Trajectory

SOLUTIONS = ("smoothed.parquet", "smoothed.csv", "forward.parquet", "forward.csv")
"""Trajectories in a result folder, the best first."""


def compare(
    solution: Annotated[
        Path, typer.Argument(help="A trajectory, or the folder of a run: its smoothed trajectory first.")
    ],
    truth: Annotated[Path, typer.Argument(help="The trajectory to compare with.")],
    skip_s: Annotated[float, typer.Option("--skip-s", min=0.0, help="Leave out the first seconds in common.")] = 0.0,
    until_s: Annotated[
        float | None, typer.Option("--until-s", min=0.0, help="Stop this many seconds after the common start.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    report: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--report",
            metavar="FILE",
            help="Write the report as an HTML page too: of the folder of a run the whole one, of a trajectory what it "
            "alone tells.",
        ),
    ] = None,
) -> None:
    """Compare a trajectory with a truth: RMSE, percentiles and maximum of every error.

    Errors are solution minus truth at the truth's times, resolved north, east, down; angles are wrapped.
    """
    from navfuse.analysis import metrics
    from navfuse.io.trajectory_table import read_trajectory

    if report is not None:
        _refuse(report, solution, truth)
    best, reference = read_trajectory(trajectory_file(solution)), read_trajectory(truth)
    found = metrics.compare(best, reference, skip_s=skip_s, until_s=until_s)
    if report is not None:
        _write_report(report, solution, best, reference, skip_s, until_s)
    if as_json:
        import json

        from navfuse.io.json_file import to_plain

        print(json.dumps(to_plain(found.to_dict()), indent=2))
        return
    from rich.console import Console

    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = 120
    console.print(f"{found.source}, {found.start_s:.3f} .. {found.end_s:.3f} s, {found.n} epochs", markup=False)
    console.print(_table(found))
    for name, value in found.consistency.items():
        console.print(
            f"{name}: {100.0 * value.inside_3_sigma:.2f} % within the claimed 3 sigma, "
            f"(error / sigma)^2 = {value.nees_per_dof:.3g} on average",
            markup=False,
        )
    if found.skipped:
        console.print(
            f"{found.skipped} epochs of the truth fall in gaps of the solution and are left out", markup=False
        )


def trajectory_file(solution: Path) -> Path:
    """The trajectory itself, or the best one in the folder of a run.

    Raises
    ------
    InputError
        If the folder holds none.
    """
    if not solution.is_dir():
        return solution
    for name in SOLUTIONS:
        if (solution / name).is_file():
            return solution / name
    raise InputError(f"{solution}: no trajectory in this folder; looked for {', '.join(SOLUTIONS)}")


def _refuse(report: Path, solution: Path, truth: Path) -> None:
    """Refuse a report that would replace what it is made of."""
    from navfuse.errors import OutputError
    from navfuse.io.result_folder import RUN_NAMES

    sources = [solution, truth, *(solution / name for name in RUN_NAMES if name != "report.html")]
    if any(report.resolve() == source.resolve() for source in sources):
        raise OutputError(f"{report}: is a file that the report is made of; give the report another name")


def _write_report(
    report: Path, solution: Path, best: Trajectory, truth: Trajectory, skip_s: float, until_s: float | None
) -> None:
    from navfuse.data.result import Result
    from navfuse.io.result_folder import read_result
    from navfuse.report.page import write_report

    bare = not solution.is_dir()
    result = Result(best) if bare else read_result(solution)
    title = f"{solution.resolve().name} against {Path(truth.source).name}"
    write_report(report, result, truth, title=title, skip_s=skip_s, until_s=until_s, bare=bare)


def _table(found: ErrorMetrics) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("error")
    for title in ("unit", "RMSE", "mean", "50 %", "68 %", "95 %", "99 %", "max"):
        table.add_column(title, justify="left" if title == "unit" else "right")
    for label, unit, row in found.rows():
        numbers = (row.rms, row.mean, row.p50, row.p68, row.p95, row.p99, row.max)
        table.add_row(label, unit, *(f"{number:.4f}" for number in numbers))
    return table
