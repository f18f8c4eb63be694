"""Other tools on the same data, in the same run."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np


def python_ins(project: dict[str, Any], states: int, seconds: float, time_step: float = 0.1) -> tuple[float, str]:
    """Time of the feedback filter of python-ins.

    Parameters
    ----------
    project : dict
        Of :func:`benchmarks.logs.car_project`; its IMU table has increments.
    states : int
        15 or 21.
    seconds : float
        Length of the part of the log that is filtered: the tool is slow.
    time_step : float [s]
        Of its covariance.

    Returns
    -------
    microseconds : float
        Per IMU sample.
    version : str
    """
    from importlib.metadata import version

    import pandas as pd
    from pyins import filters, inertial_sensor, measurements, strapdown

    table = pd.read_parquet(project["imu"]["file"])
    table = table[table.time_s <= table.time_s.iloc[0] + seconds]
    columns = [f"dtheta_{a}_rad" for a in "xyz"] + [f"dvel_{a}_mps" for a in "xyz"]
    imu = pd.DataFrame(
        table[columns].to_numpy(dtype=float),
        index=pd.Index(table.time_s.to_numpy(), name="time"),
        columns=["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"],
    )
    increments = strapdown.compute_increments_from_imu(imu, "increment")
    fixes = pd.read_csv(project["gnss"]["file"]).set_index("time_s")
    fixes = fixes[(fixes.index > imu.index[0]) & (fixes.index <= imu.index[-1])]
    position = measurements.Position(
        fixes[["lat_deg", "lon_deg", "height_m"]].set_axis(["lat", "lon", "alt"], axis=1), 1.0
    )
    degree, hour = np.pi / 180.0, 3600.0
    scale = np.diag(np.full(3, 300e-6)) if states == 21 else None
    gyro = inertial_sensor.EstimationModel(30.0 * degree / hour, 0.2 * degree / 60.0, None, scale)
    accel = inertial_sensor.EstimationModel(1.5e-3, 0.1 / 60.0, None, scale)
    start = project["start"] or _first_fix(project)
    pva = pd.Series(
        [
            *(start["lat_deg"], start["lon_deg"], start["height_m"], *start["velocity_mps"]),
            *(start["roll_deg"], start["pitch_deg"], start["heading_deg"]),
        ],
        index=["lat", "lon", "alt", "VN", "VE", "VD", "roll", "pitch", "heading"],
        name=imu.index[0],
    )
    begin = time.perf_counter()
    filters.run_feedback_filter(
        pva, 1.0, 0.05, 0.5, 2.0, increments, gyro, accel, measurements=[position], time_step=time_step
    )
    spent = time.perf_counter() - begin
    return 1e6 * spent / len(increments), version("python-ins")


def _first_fix(project: dict[str, Any]) -> dict[str, Any]:
    import pandas as pd

    truth = pd.read_parquet(Path(project["imu"]["file"]).with_name("truth.parquet")).iloc[0]
    return {
        "lat_deg": truth.lat_deg,
        "lon_deg": truth.lon_deg,
        "height_m": truth.height_m,
        "velocity_mps": [truth.vn_mps, truth.ve_mps, truth.vd_mps],
        "roll_deg": truth.roll_deg,
        "pitch_deg": truth.pitch_deg,
        "heading_deg": truth.heading_deg,
    }
