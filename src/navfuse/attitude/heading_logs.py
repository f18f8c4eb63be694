"""What a heading filter takes: yaw rates, headings of a levelled magnetometer, and whether the two agree."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from navfuse.core.constants import TWO_PI
from navfuse.data.aiding_logs import HeadingLog, MagnetometerLog
from navfuse.data.trajectory import wrapped
from navfuse.errors import InputError
from navfuse.imu.increments import to_increments

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from navfuse.data.logs import ImuLog

Array = np.ndarray

_DEGREE = np.pi / 180.0
_ENOUGH_TURN = np.radians(60.0)
_TELLING = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class YawRateLog:
    """Rate of turn about the vertical.

    Attributes
    ----------
    time : (n,) array [s]
        Strictly increasing.
    rate : (n,) array [rad/s]
        Clockwise seen from above, as heading grows.
    averaged : bool
        Whether a row is the mean over the interval that ends at its stamp, as sensors that integrate give it (the rate
        of row 0 is then never used); else it is the rate at the stamp.
    source : str
        For messages.
    """

    time: Array
    rate: Array
    averaged: bool = False
    source: str = "yaw gyro"

    def __post_init__(self) -> None:
        time, rate = np.asarray(self.time, dtype=float), np.asarray(self.rate, dtype=float)
        if time.ndim != 1 or rate.shape != time.shape:
            raise InputError(f"{self.source}: {time.shape} stamps and {rate.shape} rates; one rate per stamp is needed")
        flawed = ~(np.isfinite(time) & np.isfinite(rate))
        flawed[1:] |= ~(np.diff(time) > 0.0)
        if flawed.any():
            raise InputError(
                f"{self.source}: row {int(np.argmax(flawed))} has a rate or stamp that is not finite, or a stamp that "
                "does not increase; remove such rows"
            )
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "rate", rate)

    def turned(self, time: Array) -> Array:
        """Angle (m,) turned from the first stamp to times (m,) within the log [rad]; whole turns are counted."""
        dt = np.diff(self.time)
        mean = self.rate[1:] if self.averaged else 0.5 * (self.rate[1:] + self.rate[:-1])
        angle = np.concatenate([[0.0], np.cumsum(mean * dt)])
        if self.averaged:
            return np.interp(time, self.time, angle)
        k = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, dt.size - 1)
        s = time - self.time[k]
        return angle[k] + s * (self.rate[k] + 0.5 * s * (self.rate[k + 1] - self.rate[k]) / dt[k])


def yaw_rate_from_imu(imu: ImuLog, roll: ArrayLike = 0.0, pitch: ArrayLike = 0.0) -> YawRateLog:
    """Yaw rate of an inertial log.

    Parameters
    ----------
    imu : ImuLog
        Body axes forward-right-down.
    roll, pitch : float or (n - 1,) arrays [rad]
        Attitude in the intervals of the log: ``(w_y sin roll + w_z cos roll) / cos pitch`` (Groves 2013, eq.
        2.58). Zero for a level platform, where an inclination of 5 deg costs 0.4 % of the rate.

    Returns
    -------
    YawRateLog
        Means over the intervals of `imu`, coning included.

    Raises
    ------
    InputError
        For a pitch of 80 deg or more, where the yaw rate is not defined well.
    """
    roll, pitch = np.asarray(roll, dtype=float), np.asarray(pitch, dtype=float)
    if np.any(~(np.abs(pitch) < np.radians(80.0))):
        raise InputError(f"{imu.source}: a yaw rate needs a pitch within 80 deg; use navfuse.attitude.ahrs instead")
    increments = to_increments(imu)
    rate = increments.inc_theta_b / increments.dt[:, None]
    yaw = (rate[:, 1] * np.sin(roll) + rate[:, 2] * np.cos(roll)) / np.cos(pitch)
    return YawRateLog(increments.time, np.concatenate([yaw[:1], yaw]), averaged=True, source=imu.source)


def magnetic_heading(log: MagnetometerLog, roll: ArrayLike = 0.0, pitch: ArrayLike = 0.0) -> HeadingLog:
    """Magnetic heading of a magnetometer whose roll and pitch are known.

    Parameters
    ----------
    log : MagnetometerLog
        Body axes forward-right-down, calibrated.
    roll, pitch : float or (n,) arrays [rad]

    Returns
    -------
    HeadingLog
        ``atan2(-m_y, m_x)`` of the field turned into the level frame (Groves 2013, eq. 6.13), from magnetic north.
        No standard deviations: one degree of inclination costs up to one degree times the tangent of the dip.

    Raises
    ------
    InputError
        For a field that is zero, which has no direction.
    """
    m = log.field_b
    none = ~(np.linalg.norm(m, axis=1) > 0.0)
    if none.any():
        raise InputError(f"{log.source}: row {int(np.argmax(none))} holds no field (zero or NaN); remove such rows")
    roll, pitch = np.asarray(roll, dtype=float), np.asarray(pitch, dtype=float)
    across = m[:, 1] * np.cos(roll) - m[:, 2] * np.sin(roll)
    ahead = m[:, 0] * np.cos(pitch) + (m[:, 1] * np.sin(roll) + m[:, 2] * np.cos(roll)) * np.sin(pitch)
    return HeadingLog(log.time, wrapped(np.arctan2(-across, ahead), TWO_PI), source=log.source)


def check_heading_against_gyro(yaw: YawRateLog, heading: HeadingLog) -> float | None:
    """Do the headings turn as the gyro does?

    Parameters
    ----------
    yaw : YawRateLog
    heading : HeadingLog

    Returns
    -------
    float or None
        Slope of the changes of heading over the turns of the gyro, about 1; None if the body turned too little to
        tell.

    Raises
    ------
    InputError
        If the headings turn the other way, or not at all, or as degrees do that were radians.

    Notes
    -----
    Over pairs of headings between which the gyro turned by 60 to 170 deg, so that no whole turn hides, one of the other
    readings (the negative, the radians, no turn at all) has to leave at most a third of the residual (RMS) of the
    headings as they are.
    """
    inside = np.flatnonzero((heading.time >= yaw.time[0]) & (heading.time <= yaw.time[-1]))
    psi, angle = heading.heading[inside], yaw.turned(heading.time[inside])
    first, last = _pairs(angle)
    if first.size < 3:
        return None
    turn = angle[last] - angle[first]

    def residual(values: Array) -> float:
        return float(np.sqrt(np.mean(np.angle(np.exp(1j * (values[last] - values[first] - turn))) ** 2)))

    claimed = residual(psi)
    faults = (
        (
            -psi,
            "turn against the gyro: either the yaw rate is positive counter-clockwise (z up instead of down), or the "
            "headings count counter-clockwise; change the sign of the one that does",
        ),
        (
            psi / _DEGREE,
            "turn by pi/180 of what the gyro turns: they are radians that were read as degrees; name the column "
            "'heading_rad'",
        ),
    )
    values, fault = min(faults, key=lambda item: residual(item[0]))
    left = residual(values)
    change = np.angle(np.exp(1j * (psi[last] - psi[first])))
    still = float(np.sqrt(np.mean(change**2)))
    if left * _TELLING >= claimed and still * _TELLING < claimed:
        left, fault = still, "do not turn while the gyro does: the column is not a heading, or it is stuck"
    if left * _TELLING < claimed:
        raise InputError(
            f"{heading.source}: in {first.size} turns of 60 deg or more of {yaw.source} the headings {fault} (residual "
            f"{np.degrees(left):.1f} deg, as they are {np.degrees(claimed):.0f} deg)"
        )
    return float(change @ turn / (turn @ turn))


def _pairs(angle: Array) -> tuple[Array, Array]:
    """Rows between which the body turned by 60 to 170 deg, one pair after the other."""
    pairs: list[tuple[int, int]] = []
    first = 0
    for k in range(1, angle.size):
        turn = abs(angle[k] - angle[first])
        if turn > np.radians(170.0):
            first = k
        elif turn >= _ENOUGH_TURN:
            pairs.append((first, k))
            first = k
    picked = np.array(pairs, dtype=int).reshape(-1, 2)
    return picked[:, 0], picked[:, 1]
