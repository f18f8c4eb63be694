"""Is the stated lever arm possible, and is it the one by which GNSS sees the turns?

Where the vehicle turns, the antenna moves by rate x lever arm beside the sensor. The least squares of
:mod:`navfuse.imu.level_match` find the arm with the time offset; by velocities of 0.05 m/s to a decimetre in a few
minutes of driving, by positions of a metre not at all. The part along the axis of the turns is hardly seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfuse.data.logs import GnssLog, ImuLog
from navfuse.imu.axes_reading import SURE_CORRELATION, best_reading
from navfuse.imu.level_match import LEVER_SD, refine
from navfuse.imu.seen_motion import Array, coarse_increments, has_velocity, stretches, usable_gnss

ABSURD_M = 50.0
"""No vehicle has its antenna further from its inertial sensor."""
KNOWN_SHARE = 0.3
"""Share of the expected size of an arm below which a standard deviation says something."""
CONTRADICTS, LEAST_M = 5.0, 0.5
"""Standard deviations, and metres, of a difference that is told."""
EDGE_S = 1.0
PREFIXES = ((100.0, "centimetres"), (1000.0, "millimetres"))


@dataclass(frozen=True, slots=True)
class LeverArm:
    """A lever arm found from a log.

    Attributes
    ----------
    lever : (3,) array [m]
        Inertial sensor to antenna, in the axes of the log; parts that are not seen are near zero.
    sd : (3,) array [m]
        Up to LEVER_SD, for parts that are not seen.
    """

    lever: Array
    sd: Array


def fit_lever_arm(imu: ImuLog, gnss: GnssLog, offset_s: float = 0.0) -> LeverArm | None:
    """Find the lever arm.

    Parameters
    ----------
    imu : ImuLog
        In any right-handed axes.
    gnss : GnssLog
    offset_s : float [s]
        Added to the inertial stamps; it is refined with the arm.

    Returns
    -------
    LeverArm or None
        None if the logs do not go together, or only without the gyroscopes.
    """
    increments, holes = coarse_increments(imu)
    gnss = usable_gnss(gnss)
    first, last = increments.time[0] + offset_s + EDGE_S, increments.time[-1] + offset_s - EDGE_S
    rows = stretches(gnss, first, last, holes + offset_s, not has_velocity(gnss))
    if not rows.time.shape[0]:
        return None
    seen = best_reading(increments, holes, gnss, rows, np.array([offset_s]))
    reading = seen.reading
    if seen.correlation < SURE_CORRELATION or reading.sense < 1.0 or reading.mirrored:
        return None
    fit = refine(seen.match, offset_s)
    return LeverArm(fit.lever, fit.sd_lever)


def check_lever_arm(stated: Array, found: LeverArm | None) -> list[str]:
    """Say what is odd about a lever arm.

    Parameters
    ----------
    stated : (3,) array [m]
        In the axes of `found`.
    found : LeverArm or None
        From :func:`fit_lever_arm`.

    Returns
    -------
    list of str
    """
    stated = np.asarray(stated, dtype=float)
    size = float(np.linalg.norm(stated))
    known = np.zeros(3, bool) if found is None else found.sd < KNOWN_SHARE * LEVER_SD
    if not np.isfinite(size):
        return [f"the lever arm is {stated.tolist()}, which is no length"]
    if size > ABSURD_M:
        factor, unit = PREFIXES[0] if size <= ABSURD_M * PREFIXES[0][0] else PREFIXES[1]
        return [
            f"the lever arm is {size:.4g} m long, more than any vehicle; is it in {unit}? In metres it would be"
            f" {size / factor:.3g} m"
        ]
    if found is None or not known.any():
        return []
    tolerance = np.maximum(LEAST_M, CONTRADICTS * found.sd)
    if not np.any(known & (np.abs(stated - found.lever) > tolerance)):
        return []
    told = ", ".join(
        f"{name} {value:+.2f} (sd {sd:.2f})"
        for name, value, sd, seen in zip("xyz", found.lever, found.sd, known, strict=True)
        if seen
    )
    note = f"in turns the antenna moves as if the lever arm were {told} m; stated are {stated.tolist()} m"
    guesses = {f"are these {unit}?": stated / factor for factor, unit in PREFIXES if size > 1.0}
    guesses["is it from the antenna to the sensor instead?"] = -stated
    apart = {guess: np.where(known, np.abs(arm - found.lever), 0.0) for guess, arm in guesses.items()}
    best = min(apart, key=lambda guess: float(np.linalg.norm(apart[guess])))
    if np.all(apart[best] < tolerance):
        note += f"; {best}"
    return [note]
