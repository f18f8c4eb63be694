"""What users do to logs: each takes the columns of the two tables of one drive and spoils them in one way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from navfuse.io.tables import open_table, write_table

Array = np.ndarray
Columns = dict[str, Array]
Damage = Callable[[Columns, Columns], None]

G = 9.80665


def read_columns(path) -> Columns:
    """Every column of a table, text where the numbers end."""
    table = open_table(path)
    text = [name for name in table.names if name == "fix"]
    return table.read([name for name in table.names if name not in text], text)


def gyros(imu: Columns) -> list[str]:
    return [name for name in imu if name.startswith(("gyro", "dtheta"))]


def accels(imu: Columns) -> list[str]:
    return [name for name in imu if name.startswith(("accel", "dvel"))]


def scale(columns: Columns, names: list[str], factor: float) -> None:
    for name in names:
        columns[name] = columns[name] * factor


def rename(columns: Columns, names: dict[str, str]) -> None:
    """Under other names, in the same order."""
    renamed = {names.get(name, name): values for name, values in columns.items()}
    columns.clear()
    columns.update(renamed)


def degrees(imu: Columns, gnss: Columns) -> None:
    scale(imu, gyros(imu), 180.0 / np.pi)


def g_units(imu: Columns, gnss: Columns) -> None:
    scale(imu, accels(imu), 1.0 / G)


def flu(imu: Columns, gnss: Columns) -> None:
    """Half a turn about x: forward-right-down becomes forward-left-up."""
    scale(imu, [name for name in (*gyros(imu), *accels(imu)) if "_x_" not in name], -1.0)


def late(imu: Columns, gnss: Columns) -> None:
    imu["time_s"] = imu["time_s"] + 0.3


def gnss_late(imu: Columns, gnss: Columns) -> None:
    gnss["time_s"] = gnss["time_s"] + 0.3


def sigmas(factor: float) -> Damage:
    def damage(imu: Columns, gnss: Columns) -> None:
        scale(gnss, ["sd_north_m", "sd_east_m", "sd_down_m"], factor)

    return damage


def stuck(imu: Columns, gnss: Columns) -> None:
    """The last gyro holds its value from a third on."""
    name = gyros(imu)[2]
    imu[name] = imu[name].copy()
    start = imu[name].size // 3
    imu[name][start:] = imu[name][start]


def dead(imu: Columns, gnss: Columns) -> None:
    imu[accels(imu)[0]] = np.zeros_like(imu[accels(imu)[0]])


def exchanged_places(imu: Columns, gnss: Columns) -> None:
    gnss["lat_deg"], gnss["lon_deg"] = gnss["lon_deg"], gnss["lat_deg"]


def other_kind(imu: Columns, gnss: Columns) -> None:
    """Increments under the names of rates, or the other way round."""
    if "dvel_x_mps" in imu:
        rename(
            imu,
            {f"dtheta_{a}_rad": f"gyro_{a}_radps" for a in "xyz"} | {f"dvel_{a}_mps": f"accel_{a}_mps2" for a in "xyz"},
        )
    else:
        rename(
            imu,
            {f"gyro_{a}_radps": f"dtheta_{a}_rad" for a in "xyz"} | {f"accel_{a}_mps2": f"dvel_{a}_mps" for a in "xyz"},
        )


def rollover(imu: Columns, gnss: Columns) -> None:
    """Seconds of the week, over the week's end."""
    start = imu["time_s"][0] - 604700.0
    for table in (imu, gnss):
        table["time_s"] = (table["time_s"] - start) % 604800.0


def week_apart(imu: Columns, gnss: Columns) -> None:
    gnss["time_s"] = gnss["time_s"] + 604800.0


def weeks_1024(imu: Columns, gnss: Columns) -> None:
    gnss["time_s"] = gnss["time_s"] + 1024.0 * 604800.0


def leap_seconds(imu: Columns, gnss: Columns) -> None:
    imu["time_s"] = imu["time_s"] - 18.0


def unix(imu: Columns, gnss: Columns) -> None:
    imu["time_s"] = imu["time_s"] + 315964800.0 - 18.0 + 1.4e9
    gnss["time_s"] = gnss["time_s"] + 1.4e9


def gap(imu: Columns, gnss: Columns) -> None:
    begin = imu["time_s"][0] + 100.0
    keep = (imu["time_s"] < begin) | (imu["time_s"] > begin + 60.0)
    for name in imu:
        imu[name] = imu[name][keep]


def gnss_gap(imu: Columns, gnss: Columns) -> None:
    begin = gnss["time_s"][0] + 100.0
    keep = (gnss["time_s"] < begin) | (gnss["time_s"] > begin + 60.0)
    for name in gnss:
        gnss[name] = gnss[name][keep]


def exchanged_sensors(imu: Columns, gnss: Columns) -> None:
    for gyro, accel in zip(gyros(imu), accels(imu), strict=True):
        imu[gyro], imu[accel] = imu[accel], imu[gyro]


def negated(k: int) -> Damage:
    """One of the six columns with the wrong sign."""

    def damage(imu: Columns, gnss: Columns) -> None:
        scale(imu, [[*gyros(imu), *accels(imu)][k]], -1.0)

    return damage


def all_negated(imu: Columns, gnss: Columns) -> None:
    """Accelerations instead of specific force: gravity points down."""
    scale(imu, accels(imu), -1.0)


def gyro_order(imu: Columns, gnss: Columns) -> None:
    x, y, z = gyros(imu)
    imu[x], imu[y], imu[z] = imu[z], imu[x], imu[y]


def speeds_kmph(imu: Columns, gnss: Columns) -> None:
    scale(gnss, ["vn_mps", "ve_mps", "vd_mps"], 3.6)


def heights_in_feet(imu: Columns, gnss: Columns) -> None:
    scale(gnss, ["height_m"], 1.0 / 0.3048)


def radians(imu: Columns, gnss: Columns) -> None:
    scale(gnss, ["lat_deg", "lon_deg"], np.pi / 180.0)


def latitude_in_radians(imu: Columns, gnss: Columns) -> None:
    scale(gnss, ["lat_deg"], np.pi / 180.0)


def west_positive(imu: Columns, gnss: Columns) -> None:
    scale(gnss, ["lon_deg"], -1.0)


def milliseconds(imu: Columns, gnss: Columns) -> None:
    scale(imu, ["time_s"], 1000.0)


def gnss_milliseconds(imu: Columns, gnss: Columns) -> None:
    scale(gnss, ["time_s"], 1000.0)


def decreasing(imu: Columns, gnss: Columns) -> None:
    for name in imu:
        imu[name] = imu[name][::-1]


def nan_column(imu: Columns, gnss: Columns) -> None:
    imu[gyros(imu)[1]] = np.full(imu["time_s"].size, np.nan)


def every_second(imu: Columns, gnss: Columns) -> None:
    rows = np.searchsorted(imu["time_s"], np.arange(imu["time_s"][0], imu["time_s"][-1], 1.0))
    for name in imu:
        imu[name] = imu[name][rows]


def zero_sigmas(imu: Columns, gnss: Columns) -> None:
    scale(gnss, ["sd_east_m"], 0.0)


def clipped(imu: Columns, gnss: Columns) -> None:
    """The last gyro stops at half of what it reached."""
    name = gyros(imu)[2]
    limit = 0.5 * float(np.abs(imu[name]).max())
    imu[name] = np.clip(imu[name], -limit, limit)


def twice(imu: Columns, gnss: Columns) -> None:
    imu[gyros(imu)[1]] = imu[gyros(imu)[0]]


def gravity_subtracted(imu: Columns, gnss: Columns) -> None:
    """9.81 taken off the axis that points up."""
    name = accels(imu)[2]
    step = np.diff(imu["time_s"], prepend=2.0 * imu["time_s"][0] - imu["time_s"][1])
    per_row = step if name.startswith("dvel") else 1.0
    imu[name] = imu[name] - np.sign(np.median(imu[name])) * G * per_row


def milli_degrees(imu: Columns, gnss: Columns) -> None:
    scale(imu, gyros(imu), 1000.0 * 180.0 / np.pi)


def called_single(imu: Columns, gnss: Columns) -> None:
    gnss["fix"] = np.full(gnss["time_s"].size, "single")


def variances(imu: Columns, gnss: Columns) -> None:
    for name in ("sd_north_m", "sd_east_m", "sd_down_m"):
        gnss[name] = gnss[name] ** 2


def velocities_exchanged(imu: Columns, gnss: Columns) -> None:
    gnss["vn_mps"], gnss["ve_mps"] = gnss["ve_mps"], gnss["vn_mps"]


def shuffled(imu: Columns, gnss: Columns) -> None:
    order = np.random.default_rng(5).permutation(imu["time_s"].size)
    for name in imu:
        imu[name] = imu[name][order]


def rows_twice(imu: Columns, gnss: Columns) -> None:
    for name in imu:
        imu[name] = np.repeat(imu[name], 2)


def weak_gyros(imu: Columns, gnss: Columns) -> None:
    scale(imu, gyros(imu), 0.8)


def up_positive(imu: Columns, gnss: Columns) -> None:
    scale(gnss, ["vd_mps"], -1.0)


def frozen(imu: Columns, gnss: Columns) -> None:
    """The position stays where it is for half a minute of motion."""
    speed = np.hypot(gnss["vn_mps"], gnss["ve_mps"])
    rows = round(30.0 / float(np.median(np.diff(gnss["time_s"]))))
    total = np.convolve(speed, np.ones(rows), "valid")
    first = int(np.argmax(total))
    for name in ("lat_deg", "lon_deg", "height_m"):
        gnss[name] = gnss[name].copy()
        gnss[name][first : first + rows] = gnss[name][first]


def minutes_as_fraction(imu: Columns, gnss: Columns) -> None:
    """48 deg 30.5 min as 48.305."""
    for name in ("lat_deg", "lon_deg"):
        whole = np.trunc(gnss[name])
        gnss[name] = whole + 0.6 * (gnss[name] - whole)


def axis_flipped_midway(imu: Columns, gnss: Columns) -> None:
    name, half = accels(imu)[1], imu["time_s"].size // 2
    imu[name] = np.concatenate((imu[name][:half], -imu[name][half:]))


def clock_drifts(imu: Columns, gnss: Columns) -> None:
    """A second in a thousand."""
    imu["time_s"] = imu["time_s"][0] + 1.001 * (imu["time_s"] - imu["time_s"][0])


def write(folder, imu: Columns, gnss: Columns) -> tuple[str, str]:
    """Both tables into a folder; their paths."""
    names = str(folder / "imu.parquet"), str(folder / "gnss.csv")
    for name, columns in zip(names, (imu, gnss), strict=True):
        write_table(name, columns)
    return names
