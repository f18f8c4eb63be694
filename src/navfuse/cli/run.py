"""``navfuse run``: a project file to a folder of results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfuse.cli.progress import compilation, progress

Project = Annotated[
    Path, typer.Argument(metavar="PROJECT.toml", help="Project file; `navfuse config` prints one to begin with.")
]
Folder = Annotated[
    Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of the results; made if it is not there.")
]


def run(
    project: Project,
    output: Folder,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write report.html.")] = True,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but warnings and errors.")] = False,
) -> None:
    """Process a project: IMU and GNSS logs, or dead reckoning and GNSS, to a filtered and smoothed trajectory.

    Writes forward.parquet, smoothed.parquet, innovations.parquet, summary.json and report.html.
    """
    from navfuse.config import any_project

    any_project(project)
    with compilation(quiet), progress(quiet) as tell:
        from navfuse.pipeline import run_project

        result = run_project(project, output, report=report, progress=tell)
    if not quiet:
        print(without_warnings(result.describe()))
        print(f"results in {output}" + (f"; open {output / 'report.html'}" if report else ""))


def without_warnings(description: str) -> str:
    """A result's account of itself less its warnings, which have been shown as they came."""
    return "\n".join(line for line in description.splitlines() if not line.startswith("warning:"))
