"""``navfuse noise``: data sheet figures to ``[imu]`` keys, and back."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfuse.errors import ConfigError


def noise(
    gyro_noise: Annotated[
        str, typer.Option(metavar="VALUE", help="'0.2 deg/sqrt(h)', '0.004 deg/s/sqrt(Hz)', or rms: '0.1 deg/s'.")
    ] = "",
    accel_noise: Annotated[
        str, typer.Option(metavar="VALUE", help="'0.06 m/s/sqrt(h)', '120 ug/sqrt(Hz)', or rms: '2 mg'.")
    ] = "",
    gyro_bias: Annotated[
        str, typer.Option(metavar="VALUE", help="In-run bias stability: '7 deg/h'. The floor, unless --coefficient.")
    ] = "",
    accel_bias: Annotated[str, typer.Option(metavar="VALUE", help="The same of the accelerometers: '40 ug'.")] = "",
    gyro_walk: Annotated[str, typer.Option(metavar="VALUE", help="Rate random walk: '8 deg/h/sqrt(h)'.")] = "",
    accel_walk: Annotated[
        str, typer.Option(metavar="VALUE", help="The same of the accelerometers: '50 ug/sqrt(h)'.")
    ] = "",
    gyro_turn_on: Annotated[
        str, typer.Option(metavar="VALUE", help="Bias repeatability from one switch-on to the next: '0.2 deg/s'.")
    ] = "",
    accel_turn_on: Annotated[str, typer.Option(metavar="VALUE", help="The same of the accelerometers: '16 mg'.")] = "",
    tau: Annotated[
        str, typer.Option(metavar="TIME", help="Correlation time of the process that stands for the in-run bias.")
    ] = "1000 s",
    bandwidth: Annotated[
        str, typer.Option(metavar="VALUE", help="-3 dB bandwidth that an rms noise is for: '50 Hz'.")
    ] = "",
    order: Annotated[int, typer.Option(help="Order of that filter (Butterworth), 1 to 4.")] = 1,
    one_sided: Annotated[
        bool, typer.Option("--one-sided", help="Densities per sqrt(Hz) are one-sided: N is smaller by sqrt(2).")
    ] = False,
    coefficient: Annotated[
        bool, typer.Option("--coefficient", help="Bias instability is B of IEEE Std 952; the floor is 0.664 B.")
    ] = False,
    from_file: Annotated[
        Path | None,
        typer.Option("--from", metavar="TOML", help="The other way: data sheet figures of a file with [imu]."),
    ] = None,
    grade: Annotated[
        str, typer.Option(metavar="NAME", help="The other way: figures of a ready-made grade, such as tactical.")
    ] = "",
    digits: Annotated[
        int | None, typer.Option(help="Digits of every number, 1 to 17; 4 in [imu] keys and 5 in figures otherwise.")
    ] = None,
) -> None:
    """Convert between data sheet figures and the [imu] keys of a project file, with the formulas."""
    from navfuse.imu.datasheet import SheetReading, check_digits, from_sheet, sheet_fields, to_sheet
    from navfuse.io.unit_text import parse_quantity

    given = {
        "gyro_noise": gyro_noise,
        "accel_noise": accel_noise,
        "gyro_bias": gyro_bias,
        "accel_bias": accel_bias,
        "gyro_walk": gyro_walk,
        "accel_walk": accel_walk,
        "gyro_turn_on": gyro_turn_on,
        "accel_turn_on": accel_turn_on,
    }
    figures = {name: text for name, text in given.items() if text}
    ways = [bool(figures), from_file is not None, bool(grade)]
    if sum(ways) != 1:
        raise ConfigError(
            "give figures of a data sheet, such as --gyro-noise '0.2 deg/sqrt(h)', or one of --from and "
            "--grade for the other way"
        )
    width = parse_quantity(bandwidth, "frequency", what="--bandwidth")[0].value if bandwidth else None
    if figures:
        from navfuse.config.imu_section import imu_section

        seconds = parse_quantity(tau, "time", what="--tau")[0].value
        model, formulas = from_sheet(figures, SheetReading(one_sided, coefficient, seconds, width, order))
        digits = check_digits(4 if digits is None else digits)
        print(imu_section(model, formulas, sheet_fields(figures), digits), end="")
        return
    if one_sided or coefficient:
        raise ConfigError(
            "--one-sided and --coefficient say how figures of a data sheet are meant; leave them out with --from and "
            "--grade, which print both densities and the floor"
        )
    from navfuse.config.imu_section import model_of_file
    from navfuse.imu.grades import grade as ready_made

    model = model_of_file(from_file) if from_file is not None else ready_made(grade)
    rows = to_sheet(model, width, order, 5 if digits is None else digits)
    wide = [max(len(row[k]) for row in rows) for k in range(2)]
    for what, figure, formula in rows:
        print(f"{what:{wide[0]}}  {figure:{wide[1]}}  {formula}")
