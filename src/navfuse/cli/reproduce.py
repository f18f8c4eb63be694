"""``navfuse reproduce``: published systems and studies, run again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfuse.cli.progress import compilation, progress


def reproduce(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="A name that `--list` shows.")] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="Write tables and figures into this folder.")
    ] = None,
    data: Annotated[
        Path | None, typer.Option("--data", metavar="DIR", help="Folder of the published data, for studies on them.")
    ] = None,
    runs: Annotated[int | None, typer.Option(min=1, help="Simulated runs; default the study's own number.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first run.")] = 1,
    format_: Annotated[
        str, typer.Option("--format", help="Of the figures: png, pdf, svg; several with commas.")
    ] = "png",
    listed: Annotated[bool, typer.Option("--list", help="List the studies and end.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but warnings and errors.")] = False,
) -> None:
    """Run a published system or study again: its table beside ours, its figures drawn anew."""
    from navfuse.io.atomic import check_folder
    from navfuse.reproduce import STUDIES, Wishes
    from navfuse.reproduce import reproduce as run

    if listed:
        width = max(map(len, STUDIES))
        for key, entry in STUDIES.items():
            print(f"{key:<{width}}  {entry.title}" + (f"; needs --data with {entry.data}" if entry.data else ""))
        return
    if name is None:
        raise typer.BadParameter("give the name of a study, or --list", param_hint="NAME")
    formats = tuple(part.strip().lower() for part in format_.split(","))
    unknown = [part for part in formats if part not in ("png", "pdf", "svg")]
    if unknown:
        raise typer.BadParameter(
            f"no figure can be written as {unknown[0]!r}; there are png, pdf, svg", param_hint="--format"
        )
    if output is not None:
        # A study may take long: what cannot be written is told before it.
        check_folder(output)
    with compilation(quiet), progress(quiet) as tell:
        study = run(name, Wishes(data, runs, seed, tell))
        files = study.write(output, formats) if output is not None else []
    if not quiet:
        print(study.text())
        if files:
            print("\nopen these:")
            for path in files:
                print(f"  {path}")
