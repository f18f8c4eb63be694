"""What ``navfuse run`` asks before it begins: the checks of an inspection that cost next to nothing.

An hour at 200 Hz takes some ten milliseconds: long logs are looked at in every so-many-th row, and what is found there
is confirmed in all rows.
"""

from __future__ import annotations

import numpy as np

from navfuse.data.logs import GnssLog, ImuLog
from navfuse.errors import InputError
from navfuse.inspection.channel_checks import is_noisy, longest_run
from navfuse.inspection.clock_checks import check_overlap
from navfuse.inspection.declared import NOTHING
from navfuse.inspection.findings import Verdict
from navfuse.inspection.sigma_checks import check_sigmas

Array = np.ndarray

ROWS = 20000
STUCK_S = 5.0


def quick_check(imu: ImuLog, gnss: GnssLog | None) -> list[str]:
    """Look at logs as a run has read them.

    Parameters
    ----------
    imu : ImuLog
        Body axes.
    gnss : GnssLog or None

    Returns
    -------
    list of str
        Warnings, where the evidence is strong.

    Raises
    ------
    InputError
        If an axis is dead, or the two logs share no time and a usual difference of scales explains it.
    """
    notes = [*_stuck(imu, imu.gyro, "gyro"), *_stuck(imu, imu.accel, "accelerometer")]
    if gnss is None:
        return notes
    overlap = check_overlap(imu, gnss, NOTHING)
    if overlap.met and overlap.finding.verdict is Verdict.WRONG and not overlap.finding.remedy.endswith("a guess"):
        raise InputError(f"{imu.source}, {gnss.source}: {overlap.finding.text}")
    names = ("sd_north_m", "sd_east_m", "sd_down_m")
    doubts = [one for one in check_sigmas(gnss, gnss.sd_position, names) if one.verdict is Verdict.LOOK]
    return notes + [f"{gnss.source}: {one.text}" for one in doubts]


def _stuck(imu: ImuLog, values: Array, sensor: str) -> list[str]:
    """Warnings about axes that hold one value for seconds; refuses one that does so all the time."""
    every = max(1, imu.time.size // ROWS)
    sample = values[::every]
    same = sample[1:] == sample[:-1]
    notes = []
    for k in range(3):
        others = [j for j in range(3) if j != k]
        start, length = longest_run(same[:, k])
        first, last = start * every, min((start + length - 1) * every, imu.time.size - 1)
        seconds = float(imu.time[last] - imu.time[first])
        if seconds < STUCK_S or length < 10:
            continue
        block = values[first : last + 1]
        if not (block[:, k] == block[0, k]).all() or not any(is_noisy(block[:, j]) for j in others):
            continue
        found = f"{imu.source}: the {sensor} along {'xyz'[k]} of the vehicle stays at {block[0, k]:.6g}"
        if length == sample.shape[0]:
            raise InputError(
                f"{found} in all rows while the other {sensor}s change: the axis is dead or stuck; check the "
                "sensor and the export"
            )
        notes.append(
            f"{found} for {seconds:.4g} s from {imu.time[first]:.6g} s on while the other {sensor}s change: the "
            "axis is stuck there"
        )
    return notes
