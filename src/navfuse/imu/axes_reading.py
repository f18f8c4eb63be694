"""How the axes of an inertial log have to be read for it to see what GNSS sees.

As they stand; with the gyroscopes reversed; mirrored, which is left-handed axes or accelerometers that are all
reversed; or without the gyroscopes, which takes the vehicle for a thing that points along its course on level ground,
and compares speed and the turning of the course with accelerations along and across.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from navfuse.data.logs import GnssLog
from navfuse.imu.increments import ImuIncrements
from navfuse.imu.level_match import Match, Scan, prepare, scan
from navfuse.imu.seen_motion import Array, Stretches, chain
from navfuse.imu.turning import FEWEST, LEAST_TURN, changes_of_course

GAINED, GAINED_SHARE = 25.0, 0.05
"""-2 log likelihood by which a reading has to beat one that comes before it, at least, and as a share of it."""
SURE_CORRELATION = 0.95
"""Below it, gyroscopes in another order are looked for, and a comparison without them is tried."""
CLEARER = 0.5
"""Share of what a comparison with the gyroscopes leaves unexplained, that one without them may leave."""
TURNS_ALIKE = 0.7
TURN_STEP_S = 0.2
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


def best_reading(increments: ImuIncrements, holes: Array, gnss: GnssLog, rows: Stretches, lags: Array) -> Compared:
    """Compare accelerations in the reading that agrees best; a simpler one unless another is clearly better.

    Parameters
    ----------
    increments, holes
        Of :func:`~navfuse.imu.seen_motion.coarse_increments`.
    gnss : GnssLog
    rows : Stretches
        Of it, at least one.
    lags : (k,) array [s]
        Offsets that are added to the inertial stamps.

    Returns
    -------
    Compared
        Where it is without gyroscopes, ``scan`` is over the chords that :func:`along_track` makes of positions.
    """
    best = compare(increments, holes, rows, lags, (1.0, -1.0), None)
    rate = np.median(increments.inc_theta_b / increments.dt[:, None], axis=0)
    if np.linalg.norm(rate) > LEAST_BIAS:
        best = _better(best, compare(increments, holes, rows, lags, (1.0, -1.0), rate))
    if best.correlation >= SURE_CORRELATION:
        return best
    track = compare(increments, holes, rows, lags, (0.0,), None)
    axes = vertical_axes(increments, gnss, lags)
    disordered = axes is not None and axes.gyro != axes.force
    clearer = 1.0 - track.correlation**2 < CLEARER * (1.0 - best.correlation**2)
    return track if disordered or (clearer and track.correlation > LEAST_CORRELATION) else best


def compare(
    increments: ImuIncrements, holes: Array, rows: Stretches, lags: Array, senses: tuple[float, ...], bias: Array | None
) -> Compared:
    """Compare accelerations with gyroscopes of some senses (0: without), mirrored and not.

    Other parameters as in :func:`best_reading`.
    """
    found = []
    for sense in senses:
        seen = rows if sense else along_track(rows)
        match = prepare(chain(increments, holes, sense, bias), seen)
        plain, mirrored = scan(match, lags)
        other = replace(match, rows=replace(seen, seen=seen.seen.conj()))
        found += [
            Compared(match, plain, Reading(sense, False, bias)),
            Compared(other, mirrored, Reading(sense, True, bias)),
        ]
    best = found[0]
    for one in found[1:]:
        best = _better(best, one)
    return best


def _better(best: Compared, other: Compared) -> Compared:
    return other if other.deviance < best.deviance - max(GAINED, GAINED_SHARE * abs(best.deviance)) else best


class VerticalAxes(NamedTuple):
    """Which axis of a log is vertical, by either sensor.

    Attributes
    ----------
    force, gyro : int
        0..2: the accelerometer that feels gravity, the gyroscope that turns with the course.
    gyro_down : float
        1 if that gyroscope is positive in a turn to the right, -1 if in one to the left.
    sense : float
        -1..1, correlation of the turning about down, as the accelerometers have it, with that of the course.
    """

    force: int
    gyro: int
    gyro_down: float
    sense: float


def vertical_axes(increments: ImuIncrements, gnss: GnssLog, lags: Array) -> VerticalAxes | None:
    """Compare the turning of every gyroscope with that of the course, at the shift where they agree best.

    Returns
    -------
    VerticalAxes or None
        None if it does not turn, or no gyroscope turns with the course.
    """
    up = increments.inc_v_b.sum(axis=0)
    up = up / max(float(np.linalg.norm(up)), 1e-9)
    time = increments.time
    begin, end, course, weight = changes_of_course(gnss, time[0] + lags[-1], time[-1] + lags[0])
    if course.size < FEWEST:
        return None
    share = weight / weight.sum()
    course = course - share @ course
    turn = np.sqrt(share @ course**2)
    if turn < LEAST_TURN:
        return None
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(increments.inc_theta_b, axis=0)])
    total = np.column_stack([total, -total @ up])
    best = np.zeros(4)
    for lag in lags[:: max(1, round(TURN_STEP_S / (lags[1] - lags[0])))] if lags.size > 1 else lags:
        turned = np.stack([np.interp(end - lag, time, x) - np.interp(begin - lag, time, x) for x in total.T], axis=1)
        turned -= share @ turned
        power = np.sqrt(share @ turned**2) * turn
        found = (share @ (turned * course[:, None])) / np.maximum(power, 1e-12)
        best = found if np.max(np.abs(found[:3])) > np.max(np.abs(best[:3])) else best
    k = int(np.argmax(np.abs(best[:3])))
    if abs(best[k]) < TURNS_ALIKE:
        return None
    return VerticalAxes(int(np.argmax(np.abs(up))), k, float(np.sign(best[k])), float(best[3]))


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
