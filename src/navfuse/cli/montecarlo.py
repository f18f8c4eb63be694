"""``navfuse montecarlo``: many simulated runs of the filter against its own covariance."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from navfuse.cli.progress import compilation, progress


class Frame(StrEnum):
    """Where the filter works."""

    NED = "ned"
    ECEF = "ecef"


def montecarlo(
    source: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO|PROJECT",
            help="A name that `navfuse scenarios` lists, a scenario file, or a project file, whose solution becomes "
            "the truth.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of the results; made if it is not there.")
    ],
    runs: Annotated[int, typer.Option(min=1, help="How many runs.")] = 200,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Processes; default one for each core. The results do not depend on it.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first run; the next ones follow.")] = 0,
    grade: Annotated[str | None, typer.Option(help="Another grade of the simulated IMU.")] = None,
    duration: Annotated[float | None, typer.Option(metavar="S", help="Cut the motion there.")] = None,
    imu_rate: Annotated[float | None, typer.Option(metavar="HZ", help="Another rate of the IMU.")] = None,
    gnss_rate: Annotated[float | None, typer.Option(metavar="HZ", help="Another rate of the fixes.")] = None,
    frame: Annotated[Frame | None, typer.Option(help="Frame that the filter works in; default the project's.")] = None,
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
    changes: list[tuple[str, str, Any]] = [
        (section, key, value)
        for section, key, value in (
            ("imu", "grade", grade),
            ("imu", "rate_hz", imu_rate),
            ("gnss", "rate_hz", gnss_rate),
            ("", "duration_s", duration),
        )
        if value is not None
    ]
    if not scale:
        changes += [("imu", f"{sensor}_scale_sd_ppm", 0.0) for sensor in ("gyro", "accel")]
    with compilation(quiet), progress(quiet) as tell:
        from navfuse.montecarlo import Tampering, describe, recipe_from
        from navfuse.montecarlo import montecarlo as run_montecarlo

        chosen = recipe_from(
            source,
            changes=tuple(changes),
            frame=None if frame is None else frame.value,
            smooth=smooth,
            tampering=Tampering(gnss_sd_factor, imu_noise_factor),
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
