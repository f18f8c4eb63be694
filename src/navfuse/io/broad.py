"""Trials of the BROAD benchmark: inertial and magnetic measurements with an optical reference attitude.

Laidig, Caruso, Cereatti and Seel, "BROAD - A Benchmark for Robust Inertial Orientation Estimation", Data 6(7), 2021. A
trial is a MATLAB file with ``imu_gyr`` [rad/s], ``imu_acc`` [m/s^2], ``imu_mag`` [uT], ``opt_quat`` (sensor
forward-left-up to east-north-up, rows of NaN where the cameras lost the body), ``movement`` and ``sampling_rate`` [Hz].
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from navfuse.core.rotation import quat_multiply
from navfuse.data.aiding_logs import MagnetometerLog
from navfuse.data.logs import ImuLog
from navfuse.errors import InputError

Array = np.ndarray

_WANTED = {"imu_gyr": 3, "imu_acc": 3, "imu_mag": 3, "opt_quat": 4, "movement": 1, "sampling_rate": 1}
_FRD = np.array([1.0, -1.0, -1.0])
_HALF = np.sqrt(0.5)
_ENU_TO_NED, _FRD_TO_FLU = (0.0, _HALF, _HALF, 0.0), (0.0, 1.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class BroadTrial:
    """One trial, in the frames of navfuse.

    Attributes
    ----------
    name : str
    imu : ImuLog
        Increments, row k > 0 over (time[k - 1], time[k]]: sample k of the trial, held over the interval that ends
        at it,
        as the published evaluations integrate it. Row 0 only opens the first interval, so there are n + 1 rows.
    magnetometer : MagnetometerLog
        n rows.
    q_nb : (n, 4) array
        Reference at ``imu.time[1:]``; NaN where there is none.
    movement : (n,) bool array
        Samples that count in the benchmark.
    """

    name: str
    imu: ImuLog
    magnetometer: MagnetometerLog
    q_nb: Array
    movement: Array


def read_broad(path: str | os.PathLike[str]) -> BroadTrial:
    """Read a trial.

    Raises
    ------
    InputError
        If the file is no MATLAB file, or lacks an array or has one of the wrong shape.
    """
    from scipy.io import loadmat

    path = Path(path)
    try:
        data = loadmat(path)
    except (OSError, ValueError, TypeError, NotImplementedError) as error:
        raise InputError(f"{path}: cannot be read as a MATLAB file of the BROAD benchmark ({error})") from error
    for name, columns in _WANTED.items():
        if name not in data or data[name].ndim != 2 or data[name].shape[1] != columns:
            raise InputError(f"{path}: a trial of BROAD holds '{name}' with {columns} columns; this file does not")
    rows = {name: data[name].shape[0] for name in _WANTED if name != "sampling_rate"}
    if len(set(rows.values())) != 1:
        raise InputError(f"{path}: the arrays of a trial have to be equally long, not {rows}")
    dt = 1.0 / float(data["sampling_rate"][0, 0])
    time = dt * np.arange(rows["imu_gyr"] + 1)
    gyro, accel = (np.vstack([np.zeros((1, 3)), data[name] * _FRD * dt]) for name in ("imu_gyr", "imu_acc"))
    source = path.name
    reference = np.asarray(data["opt_quat"], dtype=float)
    q_nb = np.stack(quat_multiply(_ENU_TO_NED, np.stack(quat_multiply(reference.T, _FRD_TO_FLU))), axis=1)
    return BroadTrial(
        path.stem,
        ImuLog(time, gyro, accel, "increments", source),
        MagnetometerLog(time[1:], 1e-6 * data["imu_mag"] * _FRD, source),
        q_nb,
        data["movement"][:, 0].astype(bool),
    )
