"""What a project says about its logs, as far as an inspection can hold it against them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Declared:
    """Settings of a run. Without a project its defaults, which nobody stated.

    Attributes
    ----------
    stated : bool
        Whether a project says so; a default that does not fit is worth a look, a statement that does not fit is wrong.
    explicit : frozenset of str
        Keys that are written down, as "imu.time_offset_s", rather than left to their defaults.
    axes, rotation
        As :func:`navfuse.io.imu_table.read_imu` takes them.
    imu_time_offset, gnss_time_offset : float [s]
    epoch : (week, seconds of week) or None
        Of an RTKLIB solution.
    lever_arm : (3,) array [m] or None
        From the IMU to the antenna, forward, right, down.
    """

    stated: bool = False
    explicit: frozenset[str] = frozenset()
    axes: str = "FRD"
    rotation: Array | None = None
    imu_time_offset: float = 0.0
    gnss_time_offset: float = 0.0
    epoch: tuple[int, float] | None = None
    lever_arm: Array | None = None


NOTHING = Declared()
"""No project: defaults."""
