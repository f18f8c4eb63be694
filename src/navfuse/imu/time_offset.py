"""How far the clock of the inertial log is from that of GNSS, found before any filter runs.

Accelerations tell it (:mod:`navfuse.imu.level_match`): they arrive at antenna and sensor together, whatever the
mounting. Where gyroscopes and accelerometers do not go together, so that nothing can be levelled, turns and changes of
speed are compared along the track (:mod:`navfuse.imu.track_match`); that is less certain, because a course leads or
lags behind a heading by the distance of the antenna from the axle that does not slip, over the speed.

The offset is told only where one shift stands out. What repeats itself fits at several, what stands at all of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from navfuse.data.logs import GnssLog, ImuLog
from navfuse.imu.increments import ImuIncrements
from navfuse.imu.level_match import LAG_STEP_S, Fit, Match, Scan, prepare, refine, scan
from navfuse.imu.seen_motion import (
    Array,
    chain,
    coarse_increments,
    has_velocity,
    stretches,
    usable_gnss,
)

SHORTEST_S = 15.0
"""Least length of what both logs cover at every shift."""
STANDS_OUT = 25.0
"""Least -2 log likelihood, correlation of the errors allowed for, that a shift gains on no relation, and on a rival."""
LEAST_CORRELATION = 0.6
SURE_CORRELATION = 0.95
"""Below it, reversed gyroscopes and left-handed axes are tried as well."""
MODULUS = (0.6, 1.6)
"""Where the ratio of accelerations has to be."""
LEAST_BIAS = np.radians(0.2)
"""Median rates above this may be a bias; the log is matched with and without it."""
APART = 3.5
"""Standard deviations between offsets from positions and from velocities that are told."""


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


@dataclass(frozen=True, slots=True)
class Reading:
    """How the axes of a log have to be read for it to agree with GNSS.

    Attributes
    ----------
    sense : float
        -1 if the gyroscopes turn the other way.
    mirrored : bool
        Whether the accelerometers are left-handed, or all reversed.
    bias : (3,) array [rad/s] or None
        That was taken off the gyroscopes.
    """

    sense: float = 1.0
    mirrored: bool = False
    bias: Array | None = None


@dataclass(frozen=True, slots=True)
class Found:
    """One comparison of accelerations."""

    match: Match
    scan: Scan
    fit: Fit
    reading: Reading
    rival: float

    @property
    def best(self) -> int:
        """Index of the best shift."""
        return int(np.argmin(self.scan.deviance))

    @property
    def correlation(self) -> float:
        """Correlation there."""
        return float(self.scan.correlation[self.best])


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
    """
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
    reading = None
    told = {}
    for positions in _kinds(gnss):
        found = compare(increments, holes, gnss, positions, search_s, reading)
        told[positions] = _judged(found, positions)
        if found is not None and found.correlation >= SURE_CORRELATION:
            reading = found.reading
    return _chosen(told)


def compare(
    increments: ImuIncrements,
    holes: Array,
    gnss: GnssLog,
    positions: bool,
    search_s: float,
    reading: Reading | None = None,
) -> Found | None:
    """Compare accelerations as the axes stand; if they agree badly, as they might have been meant.

    Parameters
    ----------
    increments, holes
        Of :func:`~navfuse.imu.seen_motion.coarse_increments`.
    gnss : GnssLog
    positions : bool
        Compare positions, though there may be velocities.
    search_s : float [s]
    reading : Reading, optional
        Try this one only.

    Returns
    -------
    Found or None
        None if there are no stretches of GNSS long enough.
    """
    first, last = increments.time[0] + search_s, increments.time[-1] - search_s
    rows = stretches(gnss, first, last, holes, positions, search_s)
    if not rows.time.shape[0]:
        return None
    lags = LAG_STEP_S * np.arange(-round(search_s / LAG_STEP_S), round(search_s / LAG_STEP_S) + 1)

    def tried(reading: Reading) -> tuple[Match, Scan, Reading]:
        motion = chain(increments, holes, reading.sense, reading.bias)
        seen = replace(rows, seen=rows.seen.conj()) if reading.mirrored else rows
        match = prepare(motion, seen)
        return match, scan(match, lags), reading

    best = tried(reading or Reading())
    if reading is None:
        for other in _others(best, increments):
            new = tried(other)
            if new[1].deviance.min() < best[1].deviance.min() - STANDS_OUT:
                best = new
    match, scanned, reading = best
    return Found(match, scanned, refine(match, float(lags[np.argmin(scanned.deviance)])), reading, _rival(scanned))


def _others(plain: tuple[Match, Scan, Reading], increments: ImuIncrements) -> list[Reading]:
    """Other ways to read the axes that are worth a trial."""
    scanned = plain[1]
    rate = np.median(increments.inc_theta_b / increments.dt[:, None], axis=0)
    biases = [rate] if np.linalg.norm(rate) > LEAST_BIAS else []
    if scanned.correlation[np.argmin(scanned.deviance)] >= SURE_CORRELATION:
        return [Reading(bias=bias) for bias in biases]
    ways = [(1.0, False), (-1.0, False), (-1.0, True), (1.0, True)]
    return [Reading(*way, bias) for bias in (None, *biases) for way in ways][1:]


def _kinds(gnss: GnssLog) -> tuple[bool, ...]:
    return (False, True) if has_velocity(gnss) else (True,)


def _common(a: Array, b: Array) -> float:
    return float(min(a[-1], b[-1]) - max(a[0], b[0])) if a.size > 1 and b.size > 1 else 0.0


def _rival(scanned: Scan) -> float:
    """Deviance of the next best shift that is not on the slope of the best."""
    values = scanned.deviance
    k = int(np.argmin(values))
    padded = np.concatenate([[np.inf], values, [np.inf]])
    lowest = (values <= padded[:-2]) & (values <= padded[2:])
    lowest[max(0, k - 2) : k + 3] = False
    return float(values[lowest].min()) if lowest.any() else 0.0


def _nothing(reason: str) -> TimeOffset:
    return TimeOffset(None, None, 0.0, 0.0, "", reason)


def _judged(found: Found | None, positions: bool) -> TimeOffset:
    """What one comparison says, or why it says nothing."""
    used = f"acceleration, from {'positions' if positions else 'velocities'}"
    if found is None:
        return _nothing("there is no stretch with enough fixes and without holes in the inertial data")
    k, fit = found.best, found.fit
    values = found.scan.deviance / fit.inflation
    at = int(np.argmin(np.abs(found.scan.deviance - found.rival)))
    rival = float(found.scan.correlation[at]) if found.rival < 0.0 else 0.0
    reason = None
    in_scale = MODULUS[0] < fit.modulus < MODULUS[1]
    noisy = found.correlation < (LEAST_CORRELATION if in_scale else SURE_CORRELATION)
    if -values[k] < STANDS_OUT or noisy:
        reason = (
            "accelerations do not stand out of the noise at any shift (correlation"
            f" {found.correlation:.2f}): it stands, moves evenly, or the axes do not go together"
        )
    elif k in (0, values.size - 1):
        reason = f"the logs agree best at the end of the search, {found.scan.lags[k]:+.1f} s; search further"
    elif found.rival / fit.inflation - values[k] < STANDS_OUT:
        reason = f"the motion repeats itself: it fits as well at {found.scan.lags[at]:+.1f} s"
    elif not in_scale:
        reason = f"accelerations of GNSS are {fit.modulus:.2f} times those of the inertial sensor"
    told = (None, None) if reason else (fit.offset, fit.sd)
    return TimeOffset(*told, found.correlation, rival, used, reason, _oddities(found) if reason is None else ())


def _oddities(found: Found) -> tuple[str, ...]:
    notes = []
    if found.reading.sense < 0.0:
        notes.append("the logs agree only if the gyroscopes are taken as reversed")
    if found.reading.mirrored:
        notes.append("the logs agree only if the accelerometers are taken as left-handed, or all reversed")
    return tuple(notes)


def _chosen(told: dict[bool, TimeOffset]) -> TimeOffset:
    """The more certain of the offsets from positions and from velocities; positions if they contradict each other."""
    good = {kind: one for kind, one in told.items() if one.offset is not None}
    if not good:
        return max(told.values(), key=lambda one: one.correlation)
    best = min(good.values(), key=lambda one: one.sd)
    if len(good) < 2:
        return best
    apart = good[False].offset - good[True].offset
    if abs(apart) < APART * np.hypot(good[True].sd, good[False].sd):
        return best
    best = good[True] if good[True].sd < 3.0 * good[False].sd else best
    note = (
        f"by positions {good[True].offset:+.3f} s is to be added to the inertial stamps, by velocities"
        f" {good[False].offset:+.3f} s: the velocities look {abs(apart):.3f} s {'late' if apart > 0.0 else 'early'}"
    )
    return replace(best, sd=float(np.hypot(best.sd, 0.5 * apart)), notes=(*best.notes, note))
