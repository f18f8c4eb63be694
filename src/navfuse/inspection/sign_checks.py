"""Single columns of an inertial log with the wrong sign, told by how well its motion then agrees with GNSS.

The filter of a run would find an inverted roll or pitch gyro only by diverging: about the vertical, where most turns
are, everything is in order. But levelled accelerations agree with those of GNSS clearly less; what is left of them,
one minus the correlation, drops to a half or less if the column is turned round.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from navfuse.data.logs import GnssLog, ImuLog
from navfuse.imu.mounting import FoundAxes
from navfuse.imu.time_offset import estimate_time_offset
from navfuse.inspection.findings import Finding, Verdict

Array = np.ndarray

CLEARLY = 0.6
"""Rest of the correlation with a column turned round over that as it is, below which the sign is told to be wrong."""
LEAST = 0.8
SEARCH_S = 0.5


def check_signs(imu: ImuLog, gnss: GnssLog, found: FoundAxes, correlation: float) -> list[Finding]:
    """Look for a gyro column, or an accelerometer column of left-handed axes, with the wrong sign.

    Parameters
    ----------
    imu : ImuLog
        File axes, stamps put right.
    gnss : GnssLog
    found : FoundAxes
        Of the log as it is.
    correlation : float
        Of accelerations, of the log as it is.
    """
    if found.up is None or found.gyro_sense == -1:
        return []
    upright = "xyz".index(found.up[-1])
    if found.left_handed:
        return []
    rest = 1.0 - correlation if correlation > LEAST else 1.0
    trials = {}
    for axis in range(3):
        if axis != upright:
            trials[axis] = _rest(replace(imu, gyro=imu.gyro * _flip(axis)), gnss)
    if not trials or correlation <= LEAST:
        return []
    best = min(trials, key=trials.__getitem__)
    if trials[best] > CLEARLY * rest:
        return []
    return [
        Finding(
            "signs",
            Verdict.LOOK,
            f"accelerations agree better with those of GNSS if gyro {'xyz'[best]} is turned round: correlation "
            f"{1.0 - trials[best]:.4f} instead of {correlation:.4f}; the sign of that column looks wrong",
            f"negate the column of gyro {'xyz'[best]}",
            figures={"correlation": correlation, "turned_round": 1.0 - trials[best]},
        )
    ]


def inverted_accelerometer(imu: ImuLog, gnss: GnssLog) -> str:
    """Which columns of left-handed accelerometers have the wrong sign, in words; "" if it cannot be told."""
    trials = {
        f"accelerometer {'xyz'[axis]}": _rest(replace(imu, accel=imu.accel * _flip(axis)), gnss) for axis in range(3)
    }
    trials["all three accelerometers"] = _rest(replace(imu, accel=-imu.accel), gnss)
    best, second = sorted(trials, key=trials.__getitem__)[:2]
    return best if trials[best] < CLEARLY * trials[second] and trials[best] < 1.0 - LEAST else ""


def _flip(axis: int) -> Array:
    signs = np.ones(3)
    signs[axis] = -1.0
    return signs


def _rest(imu: ImuLog, gnss: GnssLog) -> float:
    """One minus the correlation of the accelerations."""
    return 1.0 - estimate_time_offset(imu, gnss, search_s=SEARCH_S).correlation
