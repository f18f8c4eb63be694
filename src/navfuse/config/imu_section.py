"""The noise keys of ``[imu]`` as text, from an error model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from navfuse.config.toml_text import toml_value
from navfuse.imu.error_model import DATASHEET_UNITS, ImuErrorModel

SENSORS = {"arw": "gyro", "vrw": "accel"}
_DIGITS = 4


def imu_section(model: ImuErrorModel, comments: Sequence[str] = (), sensors: Sequence[str] = ("gyro", "accel")) -> str:
    """The table ``[imu]`` with the noise of a sensor, ready to be pasted into a project file.

    Parameters
    ----------
    model : ImuErrorModel
    comments : sequence of str
        Lines that are put before the keys.
    sensors : sequence of {"gyro", "accel"}
        Whose keys to write: those that the model knows something of.

    Returns
    -------
    str
        TOML. Numbers have four digits. Scale factors and cross-coupling are written where they are not zero, everything
        else always.
    """
    lines = ["[imu]", *(f"# {comment}" for comment in comments)]
    seen: set[str] = set()
    for key, (name, factor) in DATASHEET_UNITS.items():
        if name in seen:
            continue
        seen.add(name)
        if SENSORS.get(name, name.split("_")[0]) not in sensors:
            continue
        value = np.asarray(getattr(model, name), dtype=float) / factor
        size = np.max(np.abs(value))
        if size == 0.0 and ("scale" in name or "cross" in name):
            continue
        if ("scale_tau" in name) or (name.endswith("bias_walk") and np.isfinite(getattr(model, name[:-4] + "tau"))):
            continue
        if value.ndim and np.ptp(value) <= 1e-9 * size:
            value = value[0]
        lines.append(f"{key} = {toml_value(_rounded(value))}")
    return "\n".join(lines) + "\n"


def _rounded(value: np.ndarray | float) -> float | list[float]:
    numbers = [float(f"{x:.{_DIGITS}g}") for x in np.atleast_1d(value)]
    return numbers if np.ndim(value) else numbers[0]
