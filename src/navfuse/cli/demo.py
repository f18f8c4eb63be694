"""``navfuse demo``: a simulated drive through filter and smoother, without any file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfuse.cli.progress import compilation


def demo(
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of the results; made if it is not there.")
    ] = Path("demo-output"),
    seed: Annotated[int, typer.Option(min=0, help="Seed of the simulated noise.")] = 1,
    show: Annotated[bool, typer.Option("--open", help="Open the report in the web browser.")] = False,
) -> None:
    """Simulate a two-minute car drive with a GNSS outage, process it and show how well that went."""
    with compilation():
        from navfuse.demo import run_demo

        _, lines = run_demo(output, seed)
    for line in lines:
        print(line)
    if show:
        import webbrowser

        webbrowser.open((output / "report.html").resolve().as_uri())
