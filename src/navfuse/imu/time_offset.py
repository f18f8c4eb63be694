"""How far the clock of the inertial log is from that of GNSS, found before any filter runs.

Accelerations tell it (:mod:`navfuse.imu.level_match`): they arrive at antenna and sensor together, whatever the
mounting. Where gyroscopes and accelerometers do not go together, so that nothing can be levelled, speed and turns of
the course are compared with accelerations along and across (:mod:`navfuse.imu.axes_reading`); that is less certain,
because a course leads the heading, or lags behind it, by the distance of the antenna from the axle that does not slip,
over the speed.

The offset is told only where one shift stands out. What repeats itself fits at several, what stands at all of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from navfuse.data.logs import GnssLog, ImuLog
from navfuse.errors import InputError
from navfuse.imu.axes_reading import (
    LEAST_CORRELATION,
    SURE_CORRELATION,
    Compared,
    best_reading,
    compare,
)
from navfuse.imu.level_match import LAG_STEP_S, Fit, Scan, refine
from navfuse.imu.seen_motion import Array, coarse_increments, has_velocity, stretches, usable_gnss

SHORTEST_S = 15.0
"""Least length of what both logs cover at every shift."""
STANDS_OUT = 25.0
"""Least -2 log likelihood, correlation of the errors allowed for, that a shift gains on no relation, and on a rival."""
MODULUS = (0.6, 1.6)
"""Accelerations that are much alike, but in another ratio, are in another unit."""
NOISY_MODULUS, WHITE = (0.88, 1.15), 2.0
"""Of logs that agree moderately: ratio of accelerations and inflation of the variance. Simulated drives with positions
of 1 m have 0.94..1.08 and 1.0; pairs of different drives with correlations above 0.6 0.5..0.87 and 2.0 or more."""
ALONG_CORRELATION = 0.85
APART = 3.5
"""Standard deviations between offsets from positions and from velocities that are told."""
SLIP_M = 1.0
"""Antenna from the point of the vehicle that moves along its axis, as far as it is not known."""


@dataclass(frozen=True, slots=True)
class TimeOffset:
    """Offset between the stamps of an inertial log and those of GNSS.

    Attributes
    ----------
    offset : float [s] or None
        To be ADDED to the inertial stamps, as ``imu.time_offset_s``. None if the logs do not tell; see `reason`.
    sd : float [s] or None
    correlation : float
        0..1, of what both see, at the offset (or at the best shift, if that is not to be trusted).
    rival : float
        0..1, correlation at the next best shift away from the peak.
    used : str
        What was compared, e.g. "acceleration, from velocities" or "turns, from positions"; "" if nothing was.
    reason : str or None
        Why nothing can be said; None where `offset` is given.
    notes : tuple of str
        What looks odd, such as velocities that tell another offset than positions.
    """

    offset: float | None
    sd: float | None
    correlation: float
    rival: float
    used: str
    reason: str | None
    notes: tuple[str, ...] = ()


def estimate_time_offset(imu: ImuLog, gnss: GnssLog, *, search_s: float = 5.0) -> TimeOffset:
    """Offset that makes inertial sensors and GNSS see the same motion at the same time.

    Parameters
    ----------
    imu : ImuLog
        In any axes, also those of the file.
    gnss : GnssLog
    search_s : float [s]
        Offsets between -search_s and +search_s are tried.

    Returns
    -------
    TimeOffset

    Raises
    ------
    InputError
        If `search_s` is not a positive number, or the stamps of a log do not increase.

    Notes
    -----
    A hundred simulated drives of three minutes with a consumer-grade sensor and fixes at 1 Hz give it to 12 ms rms by
    velocities of 0.05 m/s, to 0.09 s by positions of 1 m; the mean square of error over `sd` is 1.1 and 1.2. A lever
    arm of some metres and gyroscope biases of a few deg/s do no harm. What delays one sensor against the other inside
    of a receiver or an inertial unit is part of the offset.
    """
    if not (np.isfinite(search_s) and search_s > 0.0):
        raise InputError(f"search_s has to be a positive number of seconds, not {search_s!r}")
    increments, holes = coarse_increments(imu)
    gnss = usable_gnss(gnss)
    common = _common(increments.time, gnss.time)
    if common < SHORTEST_S + 2.0 * search_s:
        return _nothing(
            f"both logs together cover {max(common, 0.0):.0f} s; {SHORTEST_S + 2.0 * search_s:.0f} s are needed to"
            f" search {search_s:g} s either way"
            if common > 0.0
            else "the logs do not overlap in time"
        )
    lags = LAG_STEP_S * np.arange(-round(search_s / LAG_STEP_S), round(search_s / LAG_STEP_S) + 1)
    first, last = increments.time[0] + search_s, increments.time[-1] - search_s
    reading, told = None, []
    for positions in _kinds(gnss):
        rows = stretches(gnss, first, last, holes, positions, search_s)
        if not rows.time.shape[0]:
            continue
        if reading is None:
            found = best_reading(increments, holes, gnss, rows, lags)
        else:
            found = compare(increments, holes, rows, lags, (reading.sense,), reading.bias)
        one = _judged(found, positions)
        told.append((positions, one))
        reading = found.reading if found.correlation >= SURE_CORRELATION else None
    if not told:
        return _nothing("there is no stretch with enough fixes and without holes in the inertial data")
    return _chosen(dict(told))


def _kinds(gnss: GnssLog) -> tuple[bool, ...]:
    return (False, True) if has_velocity(gnss) else (True,)


def _common(a: Array, b: Array) -> float:
    return float(min(a[-1], b[-1]) - max(a[0], b[0])) if a.size > 1 and b.size > 1 else 0.0


def _rival(scanned: Scan) -> int | None:
    """Index of the next best shift that is not on the slope of the best; None if there is none."""
    values = scanned.deviance
    k = int(np.argmin(values))
    padded = np.concatenate([[np.inf], values, [np.inf]])
    lowest = (values <= padded[:-2]) & (values <= padded[2:]) & (values < 0.0)
    lowest[max(0, k - 2) : k + 3] = False
    return int(np.argmin(np.where(lowest, values, np.inf))) if lowest.any() else None


def _nothing(reason: str) -> TimeOffset:
    return TimeOffset(None, None, 0.0, 0.0, "", reason)


def _judged(found: Compared, positions: bool) -> TimeOffset:
    """What one comparison says, or why it says nothing."""
    source = "positions" if positions else "velocities"
    along = found.reading.sense == 0.0
    used = f"acceleration along and across the track, from {source}" if along else f"acceleration, from {source}"
    k, scanned = found.best, found.scan
    fit = refine(found.match, float(scanned.lags[k]))
    values = scanned.deviance / fit.inflation
    at = _rival(scanned)
    rival = 0.0 if at is None else float(scanned.correlation[at])
    reason = None
    if scanned.alike[k] > SURE_CORRELATION and not MODULUS[0] < fit.modulus < MODULUS[1]:
        reason = f"accelerations of GNSS are {fit.modulus:.2f} times those of the inertial sensor"
    elif -values[k] < STANDS_OUT or found.correlation < LEAST_CORRELATION or not _is_noise(found, fit):
        reason = (
            f"accelerations do not agree well enough at any shift (correlation {found.correlation:.2f}): it stands,"
            " moves evenly, the axes do not go together, or the logs are of different drives"
        )
    elif k in (0, values.size - 1):
        reason = f"the logs agree best at the end of the search, {scanned.lags[k]:+.1f} s; search further"
    elif at is not None and values[at] - values[k] < STANDS_OUT:
        reason = f"the motion repeats itself: it fits as well at {scanned.lags[at]:+.1f} s"
    sd = float(np.hypot(fit.sd, SLIP_M / _usual_speed(found))) if along else fit.sd
    told = (None, None) if reason else (fit.offset, sd)
    return TimeOffset(*told, found.correlation, rival, used, reason, _oddities(found) if reason is None else ())


def _is_noise(found: Compared, fit: Fit) -> bool:
    """Whether what a moderate correlation leaves may be noise of the fixes, rather than another motion."""
    if found.correlation >= (ALONG_CORRELATION if found.reading.sense == 0.0 else SURE_CORRELATION):
        return True
    return NOISY_MODULUS[0] < fit.modulus < NOISY_MODULUS[1] and fit.inflation < WHITE


def _usual_speed(found: Compared) -> float:
    """Of a comparison along the track [m/s], root mean square; at least 1."""
    rows = found.match.rows
    return max(1.0, float(np.sqrt(np.mean(np.real(rows.seen)[rows.weight > 0.0] ** 2))))


def _oddities(found: Compared) -> tuple[str, ...]:
    notes = []
    if found.reading.sense < 0.0:
        notes.append("the logs agree only if the gyroscopes are taken as reversed")
    if found.reading.mirrored:
        notes.append("the logs agree only if the accelerometers are taken as left-handed, or all reversed")
    return tuple(notes)


def _chosen(told: dict[bool, TimeOffset]) -> TimeOffset:
    """The more certain of the offsets from positions and from velocities; positions if they contradict each other."""
    good = {kind: (one.offset, one.sd) for kind, one in told.items() if one.offset is not None and one.sd is not None}
    if not good:
        return max(told.values(), key=lambda one: one.correlation)
    best = told[min(good, key=lambda kind: good[kind][1])]
    if len(good) < 2:
        return best
    (by_positions, sd_positions), (by_velocities, sd_velocities) = good[True], good[False]
    apart = by_velocities - by_positions
    if abs(apart) < APART * np.hypot(sd_positions, sd_velocities):
        return best
    best = told[sd_positions < 3.0 * sd_velocities]
    note = (
        f"by positions {by_positions:+.3f} s is to be added to the inertial stamps, by velocities"
        f" {by_velocities:+.3f} s: the velocities look {abs(apart):.3f} s {'late' if apart > 0.0 else 'early'}"
    )
    return replace(best, sd=float(np.hypot(good[best is told[True]][1], 0.5 * apart)), notes=(*best.notes, note))
