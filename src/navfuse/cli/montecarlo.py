"""``navfuse montecarlo``: many simulated runs of the filter against its own covariance."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from navfuse.cli.progress import compilation, progress


class Frame(StrEnum):
    """Where the filter works."""

    NED = "ned"
    ECEF = "ecef"


def montecarlo(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Motion: car, circle-flight, figure-eight or static.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of the results; made if it is not there.")
    ],
    runs: Annotated[int, typer.Option(min=1, help="How many runs.")] = 200,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Processes; default one for each core. The results do not depend on it.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first run; the next ones follow.")] = 0,
    grade: Annotated[str, typer.Option(help="Grade of the simulated IMU.")] = "industrial-mems",
    duration: Annotated[float, typer.Option(metavar="S", help="Length of a run.")] = 120.0,
    imu_rate: Annotated[float, typer.Option(metavar="HZ")] = 100.0,
    gnss_rate: Annotated[float, typer.Option(metavar="HZ")] = 1.0,
    frame: Annotated[Frame, typer.Option(help="Frame that the filter works in.")] = Frame.NED,
    smooth: Annotated[bool, typer.Option("--smooth/--no-smooth", help="Judge the smoother too.")] = False,
    scale: Annotated[
        bool, typer.Option("--scale/--no-scale", help="Scale-factor errors in simulation and filter.")
    ] = True,
    gnss_sd_factor: Annotated[
        float, typer.Option(help="Tell the filter the sigmas of the fixes times this, to see it found out.")
    ] = 1.0,
    imu_noise_factor: Annotated[
        float, typer.Option(help="Tell the filter the noise of the IMU times this, to see it found out.")
    ] = 1.0,
    settle: Annotated[float, typer.Option(metavar="S", min=0.0, help="Beginning that is not judged.")] = 10.0,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but warnings and errors.")] = False,
) -> None:
    """Simulate many runs, each with its own errors, and say whether the filter is as good as it claims.

    Writes runs.parquet, nis.parquet, nees.parquet, summary.json and plots. Ctrl-C keeps the finished runs.
    """
    with compilation(quiet), progress(quiet) as tell:
        from navfuse.montecarlo import describe, recipe
        from navfuse.montecarlo import montecarlo as run_montecarlo

        chosen = recipe(
            name,
            grade=grade,
            duration=duration,
            imu_rate=imu_rate,
            gnss_rate=gnss_rate,
            frame=frame.value,
            smooth=smooth,
            scale_states=scale,
            gnss_sd_factor=gnss_sd_factor,
            imu_noise_factor=imu_noise_factor,
        )
        campaign, assessments = run_montecarlo(
            chosen, output, runs, jobs=jobs, first_seed=seed, settle_s=settle, progress=tell
        )
    if not quiet:
        for line in describe(campaign, assessments):
            print(line)
        print(f"results in {output}; look at {output / 'nees.png'}")
    if campaign.interrupted:
        raise typer.Exit(130)
