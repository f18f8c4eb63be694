"""Does a finished run agree with itself? What a user should hear of without reading a table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from navfuse.analysis.consistency import nis_summary
from navfuse.data.result import Result

OVERCONFIDENT = 1.5
"""Factor by which innovations may exceed their claimed size before a run says so."""
REJECTED_SHARE = 0.05
SIDEWAYS = np.radians(20.0)
FAST = 3.0
CONCENTRATED = 0.95


def run_warnings(result: Result, exclude: Sequence[tuple[float, float]] = ()) -> list[str]:
    """Warnings about a run that contradicts its own measurements.

    Parameters
    ----------
    result : Result
    exclude : sequence of (from, to) [s]
        Windows left out.

    Returns
    -------
    list of str
        Each says what is seen and what to look at, most likely cause first.
    """
    found = []
    for source, summary in nis_summary(result.innovations, exclude).items():
        counts = summary.counts
        tried = summary.n + counts.get("rejected", 0)
        factor = float(np.sqrt(max(summary.mean_nis_per_dof_with_rejected, 0.0)))
        share = counts.get("rejected", 0) / tried if tried else 0.0
        if summary.n > 10 and (factor > OVERCONFIDENT or share > REJECTED_SHARE):
            found.append(
                f"{source}: innovations are {factor:.1f} times as large as claimed and {100 * share:.1f} % were "
                "rejected, so "
                "the standard deviations of this run are too small. Check, in this order: the time offset between "
                "the logs "
                "(imu.time_offset_s), gnss.lever_arm_m, imu.axes, imu.grade, and the sigmas of the fixes "
                "(gnss.sd_scale, "
                "gnss.velocity_sd_scale)"
            )
    return found + _sideways(result)


def _sideways(result: Result) -> list[str]:
    """A vehicle that never moves along its forward axis has probably got its axes wrong, or is no wheeled vehicle."""
    best = result.trajectory
    if best.velocity_n is None or best.attitude is None:
        return []
    north, east = best.velocity_n[:, 0], best.velocity_n[:, 1]
    fast = np.hypot(north, east) > FAST
    if np.count_nonzero(fast) < 50:
        return []
    slip = np.exp(1j * (np.arctan2(east[fast], north[fast]) - best.attitude[fast, 2]))
    mean = slip.mean()
    if abs(mean) < CONCENTRATED or abs(np.angle(mean)) < SIDEWAYS:
        return []
    return [
        f"the vehicle moves {np.degrees(np.angle(mean)):.0f} deg off its forward axis all the time: if it drives, "
        "imu.axes or "
        "imu.rotation is turned about the vertical (position is right all the same, heading and lever arm are not)"
    ]
