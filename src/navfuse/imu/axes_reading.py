"""How the axes of an inertial log have to be read for it to see what GNSS sees.

As they stand; with the gyroscopes reversed; mirrored, which is left-handed axes or accelerometers that are all reversed;
or without the gyroscopes, which takes the vehicle for a thing that points along its course on level ground, and compares
speed and the turning of the course with accelerations along and across.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from navfuse.imu.increments import ImuIncrements
from navfuse.imu.level_match import Match, Scan, prepare, scan
from navfuse.imu.seen_motion import Array, Stretches, chain

GAINED = 25.0
"""-2 log likelihood by which a reading has to beat one that comes before it."""
SURE_CORRELATION = 0.95
"""Below it, other readings are tried than the axes as they stand."""
LEAST_CORRELATION = 0.6
LEAST_BIAS = np.radians(0.2)
"""Median rates above this may be a bias; the log is compared with and without it."""
CHORD_S = 4.0
"""Length over which positions tell a velocity."""


@dataclass(frozen=True, slots=True)
class Reading:
    """A way to read the axes of a log.

    Attributes
    ----------
    sense : float
        -1 if the gyroscopes turn the other way; 0 if they are not used.
    mirrored : bool
        Whether the axes of the accelerometers are taken as left-handed, or all as reversed.
    bias : (3,) array [rad/s] or None
        Taken off the gyroscopes.
    """

    sense: float = 1.0
    mirrored: bool = False
    bias: Array | None = None


@dataclass(frozen=True, slots=True)
class Compared:
    """Accelerations compared at some shifts, in one reading."""

    match: Match
    scan: Scan
    reading: Reading

    @property
    def best(self) -> int:
        """Index of the best shift."""
        return int(np.argmin(self.scan.deviance))

    @property
    def deviance(self) -> float:
        """-2 log likelihood there, against no relation."""
        return float(self.scan.deviance[self.best])

    @property
    def correlation(self) -> float:
        """Correlation there."""
        return float(self.scan.correlation[self.best])


def compare(
    increments: ImuIncrements, holes: Array, rows: Stretches, lags: Array, reading: Reading | None = None
) -> Compared:
    """Compare accelerations in the first reading that no other beats clearly.

    Parameters
    ----------
    increments, holes
        Of :func:`~navfuse.imu.seen_motion.coarse_increments`.
    rows : Stretches
        At least one.
    lags : (k,) array [s]
        Offsets that are added to the inertial stamps.
    reading : Reading, optional
        Use this one.
    """
    best = _tried(increments, holes, rows, lags, reading or Reading())
    if reading is None:
        for other in _others(best, increments):
            new = _tried(increments, holes, rows, lags, other)
            if new.deviance < best.deviance - GAINED:
                best = new
    return best


def compare_along_track(increments: ImuIncrements, holes: Array, rows: Stretches, lags: Array) -> Compared:
    """Compare speed and turns of the course with accelerations along and across, without the gyroscopes.

    ``scan`` is over the chords that :func:`along_track` makes of positions. Parameters as in :func:`compare`.
    """
    track = along_track(rows)
    plain, mirrored = (_tried(increments, holes, track, lags, Reading(0.0, way)) for way in (False, True))
    return mirrored if mirrored.deviance < plain.deviance - GAINED else plain


def along_track(rows: Stretches) -> Stretches:
    """Speed + i x the integral of speed times the rate of the course [m/s] in place of velocity or position."""
    time, seen, weight = rows.time, rows.seen, rows.weight
    if rows.positions:
        steps = np.diff(time, axis=1)
        usual = float(np.median(steps[steps > 0.0]))
        k = int(np.clip(round(CHORD_S / usual), 1, time.shape[1] // 2))
        whole = (weight[:, k:] > 0.0) & (weight[:, :-k] > 0.0)
        length = np.where(whole, time[:, k:] - time[:, :-k], 1.0)
        seen = np.where(whole, (seen[:, k:] - seen[:, :-k]) / length, 0.0)
        weight = np.where(whole, np.minimum(weight[:, k:], weight[:, :-k]), 0.0)
        time = 0.5 * (time[:, k:] + time[:, :-k])
    speed = np.abs(seen)
    turn = np.angle(seen[:, 1:] * seen[:, :-1].conj())
    across = np.cumsum(0.5 * (speed[:, 1:] + speed[:, :-1]) * turn, axis=1)
    across = np.concatenate([np.zeros((len(across), 1)), across], axis=1)
    return Stretches(time, speed + 1j * across, weight, positions=False)


def _tried(increments: ImuIncrements, holes: Array, rows: Stretches, lags: Array, reading: Reading) -> Compared:
    motion = chain(increments, holes, reading.sense, reading.bias)
    seen = replace(rows, seen=rows.seen.conj()) if reading.mirrored else rows
    match = prepare(motion, seen)
    return Compared(match, scan(match, lags), reading)


def _others(plain: Compared, increments: ImuIncrements) -> list[Reading]:
    """Other readings that are worth a trial."""
    rate = np.median(increments.inc_theta_b / increments.dt[:, None], axis=0)
    biases = [rate] if np.linalg.norm(rate) > LEAST_BIAS else []
    if plain.correlation >= SURE_CORRELATION:
        return [Reading(bias=bias) for bias in biases]
    ways = [(1.0, False), (-1.0, False), (-1.0, True), (1.0, True)]
    return [Reading(*way, bias) for bias in (None, *biases) for way in ways][1:]
