"""``navfuse compare-filters``: a project with several estimators, side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from navfuse.cli.progress import compilation, progress

if TYPE_CHECKING:
    from rich.table import Table

    from navfuse.analysis.filter_comparison import FilterComparison


def compare_filters(
    project: Annotated[Path, typer.Argument(metavar="PROJECT.toml", help="Project file, with a GNSS log.")],
    estimators: Annotated[
        str | None,
        typer.Option(metavar="NAME,NAME,...", help="Estimators, separated by commas; default ekf, iekf, ukf and ckf."),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Trajectory of the IMU to compare with; default truth.parquet or truth.csv beside the project, else "
            "the fixes.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="Folder for comparison.html, .png and .json."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but warnings and errors.")] = False,
) -> None:
    """Run a project with several estimators: errors, consistency and time of each in one table.

    Logs, start, settings and sensors are the same for all. Without truth the numbers are differences from the fixes.
    """
    names = None if estimators is None else [name.strip() for name in estimators.split(",")]
    with compilation(quiet or as_json), progress(quiet) as tell:
        from navfuse import comparison

        if output is None:
            found = comparison.compare_filters(project, names, truth, tell)
        else:
            found = comparison.run_comparison(project, output, names, truth, tell)
    if as_json:
        import json

        from navfuse.io.json_file import to_plain

        print(json.dumps(to_plain(found.to_dict()), indent=2))
        return
    if quiet:
        return
    from rich.console import Console

    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = 60 + 26 * len(found.runs)
    console.print(f"{found.project}: {', '.join(found.estimators)}", markup=False)
    console.print(_table(found))
    for line in found.notes():
        console.print(line, markup=False)
    if output is not None:
        console.print(f"results in {output}; open {output / 'comparison.html'}", markup=False)


def _table(found: FilterComparison) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("figure", no_wrap=True)
    table.add_column("unit")
    for name in found.estimators:
        table.add_column(name, justify="right")
    for label, unit, values in found.table():
        table.add_row(label, unit, *values)
    return table
