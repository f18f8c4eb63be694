"""IMU and GNSS logs written as native tables, CSV or Parquet by the extension."""

from __future__ import annotations

import os

import numpy as np

from navfuse.data.logs import GnssLog, ImuLog
from navfuse.io.tables import write_table


def write_imu(path: str | os.PathLike[str], log: ImuLog) -> None:
    """Write an inertial log in body axes (``axes = "FRD"``), rates or increments as it holds them.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    names = ("dtheta_{}_rad", "dvel_{}_mps") if log.kind == "increments" else ("gyro_{}_radps", "accel_{}_mps2")
    columns = {"time_s": log.time}
    for name, values in zip(names, (log.gyro, log.accel), strict=True):
        columns |= {name.format(axis): values[:, k] for k, axis in enumerate("xyz")}
    write_table(path, columns)


def write_gnss(path: str | os.PathLike[str], log: GnssLog) -> None:
    """Write fixes; velocity, fix type and number of satellites where the log has them.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    columns = {
        "time_s": log.time,
        "lat_deg": np.degrees(log.lat),
        "lon_deg": np.degrees(log.lon),
        "height_m": log.height,
    }
    columns |= {f"sd_{axis}_m": log.sd_position[:, k] for k, axis in enumerate(("north", "east", "down"))}
    if log.velocity_n is not None:
        columns |= {f"v{axis}_mps": log.velocity_n[:, k] for k, axis in enumerate("ned")}
    if log.sd_velocity is not None:
        columns |= {f"sd_v{axis}_mps": log.sd_velocity[:, k] for k, axis in enumerate("ned")}
    if log.fix is not None:
        columns["fix"] = log.fix
    if log.n_satellites is not None:
        columns["n_satellites"] = log.n_satellites
    write_table(path, columns)
