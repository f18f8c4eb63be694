"""``navfuse plot``: figures for papers from the folder of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def plot(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run, as `navfuse run -o` wrote it.")],
    what: Annotated[
        str,
        typer.Option(
            "--what",
            metavar="NAMES",
            help="Figures, parted by commas: map, position, velocity, attitude, errors, error_cdf, sigmas, separation, "
            "innovations, residuals, nis, states, biases, gnss_sigmas, satellites, imu_rate, spectra; or all.",
        ),
    ] = "all",
    formats: Annotated[
        str, typer.Option("--format", metavar="FORMATS", help="png, pdf, svg, parted by commas.")
    ] = "png",
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FOLDER", help="Where to write; default DIR/figures.")
    ] = None,
    truth: Annotated[
        Path | None, typer.Option("--truth", metavar="FILE", help="The trajectory to compare with, for the errors.")
    ] = None,
    skip_s: Annotated[
        float, typer.Option("--skip-s", min=0.0, help="Leave out the first seconds of comparisons.")
    ] = 0.0,
    size: Annotated[
        str,
        typer.Option(
            "--size",
            metavar="SIZE",
            help="single (88 mm wide), double (181 mm), slide (254 x 143 mm), or WIDTHxHEIGHT in mm.",
        ),
    ] = "double",
    time: Annotated[
        str, typer.Option("--time", metavar="KIND", help="Of the time axes: gps, utc, log; auto: gps where known.")
    ] = "auto",
    dpi: Annotated[int, typer.Option("--dpi", help="Of PNG, and of dense clouds inside PDF and SVG.")] = 300,
) -> None:
    """Draw figures for papers from the folder of a run.

    Writes NAME.FORMAT for every figure. With `all`, those that the run has nothing for are left out with a note.
    """
    from navfuse.report import figures_files

    done = figures_files.plot(
        folder,
        what,
        folder=output,
        formats=formats,
        truth=truth,
        skip_s=skip_s,
        size=size,
        time=time,
        dpi=dpi,
    )
    for name, reason in done.skipped.items():
        print(f"left out {name}: {reason}")
    print(f"{len(done.files)} files in {done.files[0].parent}: {', '.join(file.name for file in done.files)}")
