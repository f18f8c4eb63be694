"""``navfuse export``: a trajectory in the formats of other programs."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from navfuse.errors import ConfigError


def export(
    source: Annotated[
        Path, typer.Argument(metavar="RUN_OR_TRAJECTORY", help="The folder of a run, or the file of a trajectory.")
    ],
    formats: Annotated[
        list[str],
        typer.Option(
            "--format", "-f", metavar="FORMAT,...", help="kml, gpx, geojson, csv, pos, nmea, sbet, smrmsg, tum, kitti."
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="Where to write; default: exports in or beside the source."),
    ] = None,
    solution: Annotated[str, typer.Option("--solution", help="Of a run: best, smoothed or forward.")] = "best",
    point: Annotated[
        str, typer.Option("--point", metavar="imu|antenna|F,R,D", help="Whose trajectory; lever arm from the IMU [m].")
    ] = "imu",
    rate_hz: Annotated[
        float | None, typer.Option("--rate-hz", help="Epochs at this rate; default: those of the trajectory.")
    ] = None,
    at: Annotated[
        Path | None,
        typer.Option(
            "--at", metavar="EVENTS", help="Only at the times of a table: time_s, gps_week and gps_tow_s, or utc."
        ),
    ] = None,
    height: Annotated[
        str, typer.Option("--height", help="ellipsoid or geoid, for formats that leave the choice (pos, sbet).")
    ] = "ellipsoid",
    geoid: Annotated[str, typer.Option("--geoid", help="egm96, or egm2008 where PROJ has its grid.")] = "egm96",
    epoch: Annotated[
        str | None,
        typer.Option("--epoch", metavar="WEEK,SECONDS", help="GPS week and seconds from which the times count."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but warnings and errors.")] = False,
) -> None:
    """Write a trajectory for other programs: any point of the vehicle, at any rate or at the times of events."""
    from navfuse.export_files import export as write

    names = [name.strip() for text in formats for name in text.split(",") if name.strip()]
    files = write(
        source,
        output,
        names,
        solution=solution,  # pyright: ignore[reportArgumentType]
        point=point if point in ("imu", "antenna") else _numbers("--point", point, 3),
        rate_hz=rate_hz,
        at=at,
        height=height,  # pyright: ignore[reportArgumentType]
        geoid=geoid,
        epoch=None if epoch is None else _numbers("--epoch", epoch, 2),
    )
    if not quiet:
        for file in files:
            print(file)


def _numbers(option: str, text: str, count: int) -> tuple[float, ...]:
    try:
        numbers = tuple(float(word) for word in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(isfinite(number) for number in numbers):
        wanted = "imu, antenna, or three numbers F,R,D [m]" if count == 3 else "two numbers WEEK,SECONDS"
        raise ConfigError(f"{option} {text}: has to be {wanted}")
    return numbers
