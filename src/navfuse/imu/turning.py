"""Do the gyroscopes and GNSS see the same turns? Units, signs and clocks, checked before anything is estimated.

Whatever goes forward turns its course when it turns itself. The angular rate along the specific force (which is the
vertical to a car, and the axis of the turn to an aeroplane in a coordinated one) is integrated and held against the
course over ground, at all shifts of time up to 20 s. The slope tells units and sign of the gyroscopes, the best shift
the offset between the clocks. Mounting, biases and levelling do not enter: the dot product is the same in any
axes, and a constant rate drops out.

Vehicles that move another way than they point (helicopters, pedestrians) show no correlation and are not judged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from navfuse.core.earth import dcm_en, geodetic_to_ecef_batch
from navfuse.data.logs import GnssLog
from navfuse.errors import InputError
from navfuse.imu.increments import ImuIncrements

Array = np.ndarray

STEP_S = 0.1
LONGEST_LAG_S, LAG_SHARE = 20.0, 1.0 / 6.0
"""Shifts that are tried: at most 20 s, and a sixth of the log."""
LEAP_SECONDS = 18.0
"""GPS time less UTC since 2017."""
LEAST_SPEED = 3.0
FULL_SPEED = 20.0
CHORD_S = 4.0
FEWEST = 20
MOST = 2000
LEAST_TURN = np.radians(2.0)
ALIKE = 0.9
RIVAL = 0.6
LAG_TOLD_S = 0.8
"""By slip, and by where the antenna is, a course leads the heading or lags behind it by some tenths of a second."""


@dataclass(frozen=True, slots=True)
class TurnFit:
    """Turns of the gyroscopes against turns of the course.

    Attributes
    ----------
    ratio : float
        Turn of the gyroscopes over turn of the course; 1 if units and signs are right.
    lag_s : float [s]
        How late the stamps of the inertial data are against those of GNSS.
    correlation : float
        Between -1 and 1, at that lag; has the sign of `ratio`.
    turn : float [rad]
        Root mean square of the changes of course that were compared.
    count : int
        How many.
    """

    ratio: float
    lag_s: float
    correlation: float
    turn: float
    count: int


def check_turns(increments: ImuIncrements, gnss: GnssLog) -> list[str]:
    """Warnings about turns that inertial data and GNSS see differently.

    Raises
    ------
    InputError
        If the gyroscopes turn the other way, or by another unit.
    """
    fit = fit_turns(increments, gnss)
    if fit is None or abs(fit.correlation) < ALIKE or fit.turn < LEAST_TURN:
        return []
    if fit.ratio < 0.0:
        raise InputError(
            "the gyroscopes turn left where the course over ground turns right, and the other way round: the sign of"
            " the gyroscopes does not go with that of the accelerometers; right-handed axes, for both the same, are"
            " needed"
        )
    if not 0.2 < fit.ratio < 5.0:
        hint = "; are these degrees in columns of radians?" if 40.0 < fit.ratio < 80.0 else "; check their unit"
        hint = "; are these radians in columns of degrees?" if 1 / 80.0 < fit.ratio < 1 / 40.0 else hint
        raise InputError(f"the gyroscopes turn {fit.ratio:.3g} times as much as the course over ground{hint}")
    notes = []
    if not 0.6 < fit.ratio < 1.6:
        notes.append(
            f"the gyroscopes turn {fit.ratio:.2f} times as much as the course over ground; check their unit and rate"
        )
    if abs(fit.lag_s) > LAG_TOLD_S:
        leap = abs(abs(fit.lag_s) - LEAP_SECONDS) < 0.5
        clocks = "; GPS time and UTC are that far apart" if leap else ""
        notes.append(
            f"the stamps of the inertial data look {abs(fit.lag_s):.1f} s too {'late' if fit.lag_s > 0 else 'early'}"
            f" against those of GNSS: the turns agree best (correlation {fit.correlation:.3f}) with"
            f" {-fit.lag_s:+.1f} s added to imu.time_offset_s{clocks}"
        )
    return notes


def fit_turns(increments: ImuIncrements, gnss: GnssLog) -> TurnFit | None:
    """Compare turns at the shift of time where they agree best.

    Returns
    -------
    TurnFit or None
        None if it moves too little, or too regularly, to say anything.
    """
    grid, heading = _turned(increments)
    longest = STEP_S * round(min(LONGEST_LAG_S, LAG_SHARE * (grid[-1] - grid[0])) / STEP_S)
    begin, end, course, weight = changes_of_course(gnss, grid[0] + longest, grid[-1] - longest)
    if course.size < FEWEST:
        return None
    share = weight / weight.sum()
    y = course - share @ course
    variance = share @ y**2
    lags = np.arange(-longest, longest + 0.5 * STEP_S, STEP_S)
    correlation, slope = np.zeros(lags.size), np.zeros(lags.size)
    for k, lag in enumerate(lags):
        turn = _between(grid, heading, end + lag) - _between(grid, heading, begin + lag)
        turn -= share @ turn
        power, product = share @ turn**2, share @ (turn * y)
        if power > 0.0 and variance > 0.0:
            correlation[k], slope[k] = product / np.sqrt(power * variance), product / variance
    k = _chosen(lags, correlation)
    if k is None:
        return None
    return TurnFit(
        ratio=float(slope[k] / max(correlation[k] ** 2, 1e-12)),
        lag_s=float(lags[k] + STEP_S * _vertex(np.abs(correlation), k)),
        correlation=float(correlation[k]),
        turn=float(np.sqrt(variance)),
        count=course.size,
    )


def _chosen(lags: Array, correlation: Array) -> int | None:
    """Index of the lag to believe, None if the motion repeats itself so that several would do.

    A periodic course correlates as well half a period off, with the other sign. So the clocks are taken for right if
    the correlation peaks where they may be, and another lag or sign only counts if nothing else comes near it.
    """
    best = int(np.argmax(np.abs(correlation)))
    inner = correlation[1:-1]
    peaks = 1 + np.flatnonzero((inner >= correlation[:-2]) & (inner >= correlation[2:]))
    here = peaks[np.abs(lags[peaks]) <= LAG_TOLD_S]
    if here.size:
        highest = int(here[np.argmax(correlation[here])])
        if correlation[highest] >= ALIKE * abs(correlation[best]):
            return highest
    away = np.abs(lags - lags[best]) > LAG_TOLD_S
    others = np.abs(correlation[away & (np.sign(correlation) != np.sign(correlation[best]))])
    if others.size and np.max(others) > RIVAL * abs(correlation[best]):
        return None
    return best


def _turned(increments: ImuIncrements) -> tuple[Array, Array]:
    """Times of a grid, and the angle turned about the direction of gravity until then."""
    time = increments.time
    grid = np.arange(time[0], time[-1], STEP_S)
    theta, speed = (
        np.column_stack([np.interp(grid, time[1:], total) for total in np.cumsum(rows, axis=0).T])
        for rows in (increments.inc_theta_b, increments.inc_v_b)
    )
    half = int(round(0.5 / STEP_S))
    last = np.arange(grid.size)
    force = speed[np.minimum(last + half, grid.size - 1)] - speed[np.maximum(last - half, 0)]
    up = force / np.maximum(np.linalg.norm(force, axis=1), 1e-12)[:, None]
    return grid, np.concatenate([[0.0], np.cumsum(-np.sum(up[1:] * np.diff(theta, axis=0), axis=1))])


def changes_of_course(gnss: GnssLog, first: float, last: float) -> tuple[Array, Array, Array, Array]:
    """Begin, end [s], change of course [rad] and weight of some intervals in which it goes fast enough."""
    if gnss.velocity_n is not None and np.isfinite(gnss.velocity_n).all(axis=1).mean() > 0.5:
        rows = np.flatnonzero(np.isfinite(gnss.velocity_n).all(axis=1))
        time, velocity = gnss.time[rows], gnss.velocity_n[rows, 0] + 1j * gnss.velocity_n[rows, 1]
        every = _rows_per(time, 1.0)
    else:
        every = _rows_per(gnss.time, CHORD_S)
        r = geodetic_to_ecef_batch(gnss.lat, gnss.lon, gnss.height)
        away = (r - r[0]) @ np.array(dcm_en(gnss.lat[0], gnss.lon[0])).reshape(3, 3)
        place = away[:, 0] + 1j * away[:, 1]
        if gnss.time.size <= every:
            return np.empty(0), np.empty(0), np.empty(0), np.empty(0)
        velocity = (place[every:] - place[:-every]) / (gnss.time[every:] - gnss.time[:-every])
        time = 0.5 * (gnss.time[every:] + gnss.time[:-every])
    start = np.arange(0, time.size - every, max(every, time.size // MOST))
    begin, end = time[start], time[start + every]
    speed = np.minimum(np.abs(velocity[start]), np.abs(velocity[start + every]))
    usual = np.median(end - begin) if start.size else 0.0
    use = (speed > LEAST_SPEED) & (end - begin < 2.0 * usual) & (begin > first) & (end < last)
    course = np.angle(velocity[start + every] * np.conj(velocity[start]))
    return begin[use], end[use], course[use], np.minimum(speed[use], FULL_SPEED)


def _rows_per(time: Array, seconds: float) -> int:
    return max(1, int(round(seconds / np.median(np.diff(time))))) if time.size > 1 else 1


def _between(grid: Array, heading: Array, time: Array) -> Array:
    """Linear interpolation on the even grid."""
    at = np.clip((time - grid[0]) / STEP_S, 0.0, grid.size - 1.001)
    left = at.astype(np.int64)
    return heading[left] + (at - left) * (heading[left + 1] - heading[left])


def _vertex(values: Array, k: int) -> float:
    """Where the parabola through a maximum and its neighbours peaks, in steps from `k`."""
    if not 0 < k < values.size - 1:
        return 0.0
    bend = values[k - 1] - 2.0 * values[k] + values[k + 1]
    return float(0.5 * (values[k - 1] - values[k + 1]) / bend) if bend < 0.0 else 0.0
