"""``navfuse allan``: from the log of a sensor at rest to filter settings."""

from __future__ import annotations

import tomllib
import warnings
from contextlib import nullcontext
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from navfuse.cli.progress import compilation, progress
from navfuse.errors import ConfigError, NavfuseWarning

if TYPE_CHECKING:
    from navfuse.analysis.allan.study import AllanStudy

FILES = ("allan.json", "allan.png", "allan.html", "imu.toml")
"""What ``-o`` writes beside one table for each kind of deviation."""


class Motion(StrEnum):
    """What to do where the log moves."""

    TRIM = "trim"
    REFUSE = "refuse"
    IGNORE = "ignore"


class Gaps(StrEnum):
    """What to do about missing samples."""

    SPLIT = "split"
    REFUSE = "refuse"


def allan(
    log: Annotated[
        Path, typer.Argument(metavar="LOG", help="Log at rest: .csv, .parquet, .npz, .mat, or text in columns.")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="DIR", help="Write JSON, tables, PNG, HTML and imu.toml into this folder."
        ),
    ] = None,
    config: Annotated[
        bool, typer.Option("--config", help="Print the [imu] keys for a project file, nothing else.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print every value with interval and unit as JSON.")] = False,
    kind: Annotated[
        str,
        typer.Option(metavar="KINDS", help="Deviations: adev, oadev, mdev, hdev, ohdev, totdev, with commas between."),
    ] = "oadev",
    grid: Annotated[str, typer.Option(help="Averaging times: octave, decade, all, or a number per decade.")] = "20",
    terms: Annotated[
        str, typer.Option(help="Noise terms to look for: Q, N, B, K, R, GM (Gauss-Markov), sin, with commas between.")
    ] = "Q,N,B,K,R",
    gyro: Annotated[
        str, typer.Option(metavar="COLUMNS", help="Columns of the gyros, by name, or by number from 1: 1,2,3.")
    ] = "",
    accel: Annotated[str, typer.Option(metavar="COLUMNS", help="Columns of the accelerometers.")] = "",
    gyro_unit: Annotated[
        str, typer.Option(metavar="UNIT", help="Their unit, with a scale if need be: deg/s, '0.1 arcsec' (increments).")
    ] = "",
    accel_unit: Annotated[str, typer.Option(metavar="UNIT", help="Such as g, m/s^2, '125 ug*s' (increments).")] = "",
    time: Annotated[str, typer.Option(metavar="COLUMN", help="Column of time in seconds.")] = "",
    rate: Annotated[float | None, typer.Option(metavar="HZ", help="Sampling rate, for a log without time.")] = None,
    skip_rows: Annotated[int, typer.Option(min=0, help="Rows of numbers to skip in a text file, after comments.")] = 0,
    from_s: Annotated[
        float | None, typer.Option("--from-s", min=0.0, help="Begin so long after the first sample.")
    ] = None,
    until_s: Annotated[
        float | None, typer.Option("--until-s", min=0.0, help="End so long after the first sample.")
    ] = None,
    longest_s: Annotated[float | None, typer.Option("--longest-s", help="Longest averaging time.")] = None,
    motion: Annotated[
        Motion, typer.Option(help="Where it moves: use the longest rest, refuse, or ignore it.")
    ] = Motion.TRIM,
    gaps: Annotated[Gaps, typer.Option(help="Missing samples: average between them, or refuse.")] = Gaps.SPLIT,
    horizon_s: Annotated[
        float,
        typer.Option("--horizon-s", help="How long the filter has to carry the bias, for the Gauss-Markov process."),
    ] = 3600.0,
    gyro_turn_on: Annotated[
        str, typer.Option(metavar="VALUE", help="Bias repeatability of the data sheet, such as '0.2 deg/s'.")
    ] = "",
    accel_turn_on: Annotated[str, typer.Option(metavar="VALUE", help="The same of the accelerometers: '16 mg'.")] = "",
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but warnings and errors.")] = False,
) -> None:
    """Allan variance of a log at rest: deviations with intervals, noise terms, settings for the filter.

    Nothing is repaired: motion, stuck or saturated channels and gaps are told, or refused.
    """
    if config and as_json:
        raise ConfigError("--config and --json both print to standard output; give one of them")
    turn_on = _turn_on(gyro_turn_on, "gyro"), _turn_on(accel_turn_on, "accel")
    from navfuse.io.atomic import atomic_folder, refuse_to_replace

    if output is not None:
        refuse_to_replace([log], output, _names())
    with nullcontext() if output is None else atomic_folder(output, _names()) as part:
        with compilation(quiet), progress(quiet) as tell:
            from navfuse.analysis.allan.study import StudySettings, study
            from navfuse.io.static_record import RecordLayout, read_static

            settings = StudySettings(
                kinds=_words(kind),
                grid=grid,
                terms=_words(terms),
                gaps=gaps.value,
                motion=motion.value,
                from_s=from_s,
                until_s=until_s,
                longest_s=longest_s,
                horizon_s=horizon_s,
            )
            layout = RecordLayout(gyro, accel, gyro_unit, accel_unit, time, rate, skip_rows)
            found = study(read_static(log, layout), settings, tell)
        _warn(found, log, turn_on if config or output is not None else None)
        section = _section(found, turn_on)
        if part is not None:
            _write(part, found, section)
    if config:
        print(section, end="")
    elif as_json:
        import json

        from navfuse.io.json_file import to_plain
        from navfuse.report.allan_tables import to_dict

        print(json.dumps(to_plain(to_dict(found, _keys(section))), indent=2))
    elif not quiet:
        _print(found)
        if output is not None:
            tables = [f"{kind}.csv" for kind in found.settings.kinds]
            print(f"results in {output}: {', '.join([*FILES, *tables])}")


def _warn(found: AllanStudy, log: Path, turn_on: tuple[float | None, float | None] | None) -> None:
    """Every warning under the name of the log without its folders; of the turn-on bias where settings are written."""
    from navfuse.analysis.allan.settings import missing_turn_on
    from navfuse.report.allan_tables import notices

    told = notices(found, log.name)
    if turn_on is not None and (text := missing_turn_on(found, turn_on)):
        told.append(f"{log.name}: {text.removeprefix(f'{found.source}: ')}")
    for text in told:
        warnings.warn(text, NavfuseWarning, stacklevel=1)


def _names() -> tuple[str, ...]:
    """Every file that ``-o`` may write, or takes away because an earlier run wrote it."""
    from navfuse.analysis.allan.deviations import KINDS

    return (*FILES, *(f"{kind}.csv" for kind in KINDS))


def _words(text: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(word.strip() for word in text.split(",") if word.strip()))


def _turn_on(text: str, sensor: str) -> float | None:
    if not text:
        return None
    from navfuse.imu.datasheet import LARGEST
    from navfuse.io.unit_text import parse_quantity

    quantity = "angular rate" if sensor == "gyro" else "acceleration"
    value = parse_quantity(text, quantity, what=f"--{sensor}-turn-on")[0].value
    if value < 0.0:
        raise ConfigError(f"--{sensor}-turn-on = {text!r} must not be negative")
    if not value < LARGEST:
        raise ConfigError(f"--{sensor}-turn-on = {text!r} is beyond any sensor; check number and unit")
    return value


def _section(found: AllanStudy, turn_on: tuple[float | None, float | None]) -> str:
    from navfuse.analysis.allan.settings import filter_settings, remarks
    from navfuse.config.imu_section import imu_section

    model, fields = filter_settings(found, *turn_on)
    return imu_section(model, remarks(found, turn_on), fields)


def _keys(section: str) -> dict[str, Any]:
    """The keys of ``[imu]`` as they are written, the unit in the name of each."""
    return tomllib.loads(section)["imu"]


def _write(folder: Path, found: AllanStudy, section: str) -> None:
    """Fill a folder that appears as a whole."""
    from navfuse.io.json_file import write_json
    from navfuse.io.tables import write_table
    from navfuse.report.allan_figures import write_figure
    from navfuse.report.allan_page import write_page
    from navfuse.report.allan_tables import curve_columns, to_dict

    write_json(folder / "allan.json", to_dict(found, _keys(section)))
    for kind in found.settings.kinds:
        write_table(folder / f"{kind}.csv", curve_columns(found, kind))
    write_figure(folder / "allan.png", found)
    write_page(folder / "allan.html", found)
    (folder / "imu.toml").write_text(section, encoding="utf-8")


def _print(found: AllanStudy) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from navfuse.report.allan_tables import FLOOR_NOTE, summary_lines, term_rows

    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = 150
    for line in summary_lines(found):
        console.print(line, markup=False)
    table = Table(box=box.SIMPLE_HEAD)
    for title in ("axis", "term", "value", "in other units", ""):
        table.add_column(title)
    before = ""
    for axis, *cells in term_rows(found):
        if before and axis != before:
            table.add_section()
        table.add_row(axis if axis != before else "", *cells)
        before = axis
    console.print(table)
    console.print(
        f"{FLOOR_NOTE}. Values with one standard deviation; what is not seen stays below the limit, with the "
        "probability beside it.",
        markup=False,
    )
