"""One motion as inertial sensors and as GNSS see it, brought to where the two can be held against each other.

Inertial data are integrated once, from an attitude called zero at their start, in a frame L that follows the
gyroscopes and hangs at no direction in particular. Any stretch of half a minute is then level but for one rotation,
which the mean specific force gives, and points north but for one angle. Integrals are read between samples, so
neither the rate of the log nor what its rows hold (rates, increments) shifts anything in time.

GNSS is cut into such stretches, with the horizontal velocity, or position where there is no velocity, as complex
numbers north + i east.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from navfuse.core.earth import dcm_en, geodetic_to_ecef_batch
from navfuse.data.logs import GnssLog, ImuLog
from navfuse.imu.heading import integrate_level
from navfuse.imu.increments import ImuIncrements, to_increments

Array = np.ndarray

STEP_S = 0.025
"""Inertial increments are summed up to about this length; linear interpolation in between errs by millimetres/s."""
GAP_S = 0.25
"""Intervals between inertial rows above this are holes, whatever the rate up to 20 Hz."""
STRETCH_S = 30.0
STRETCH_ROWS = 15
FEWEST_ROWS = 10
MOST_STRETCHES = 120
MOST_ROWS = 6000
LEAST_VELOCITY_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class ChainedMotion:
    """Integrals of an inertial log in the frame L.

    Attributes
    ----------
    time : (n,) array [s]
    velocity_l, place_l : (n, 3) arrays [m/s], [m]
        Integrals of the specific force, gravity's reaction included.
    axes_l : (3, n, 3) array
        The three axes of the sensor in L.
    swing_l : (3, n, 3) array [rad/s]
        Angular rate x those axes.
    holes : (h, 2) array [s]
        From and to where there are no rows.
    """

    time: Array
    velocity_l: Array
    place_l: Array
    axes_l: Array
    swing_l: Array
    holes: Array


@dataclass(frozen=True, slots=True)
class Stretches:
    """GNSS in stretches, padded to equal length.

    Attributes
    ----------
    time : (w, m) array [s]
    seen : (w, m) complex array
        Horizontal velocity [m/s], or position [m] against the first of the stretch.
    weight : (w, m) array
        0 for padding; else up to 1, relative to the usual standard deviation of the log.
    positions : bool
        Whether `seen` holds positions.
    """

    time: Array
    seen: Array
    weight: Array
    positions: bool

    def take(self, rows: Array) -> Stretches:
        """Some of the stretches."""
        return replace(self, time=self.time[rows], seen=self.seen[rows], weight=self.weight[rows])


def coarse_increments(imu: ImuLog) -> tuple[ImuIncrements, Array]:
    """Increments of about 25 ms, and the holes (h, 2) [s] of the log; rows that are not finite are left out."""
    whole = np.isfinite(imu.gyro).all(axis=1) & np.isfinite(imu.accel).all(axis=1)
    if not whole.all():
        imu = replace(imu, time=imu.time[whole], gyro=imu.gyro[whole], accel=imu.accel[whole])
    fine = to_increments(imu, GAP_S)
    step = float(np.median(fine.dt)) if len(fine) else STEP_S
    far = np.flatnonzero(fine.dt > max(GAP_S, 5.0 * step))
    holes = np.column_stack([fine.time[far], fine.time[far + 1]])
    every = max(1, round(STEP_S / step))
    if every == 1 or len(fine) < 2 * every:
        return fine, holes
    edges = np.arange(0, fine.time.size, every)
    theta, v = (_summed(rows, edges) for rows in (fine.inc_theta_b, fine.inc_v_b))
    return ImuIncrements(fine.time[edges], theta, v), holes


def _summed(rows: Array, edges: Array) -> Array:
    return np.add.reduceat(rows[: edges[-1]], edges[:-1], axis=0)


def chain(increments: ImuIncrements, holes: Array, sense: float = 1.0, bias: Array | None = None) -> ChainedMotion:
    """Integrate a log in the frame L.

    Parameters
    ----------
    increments, holes
        From :func:`coarse_increments`.
    sense : float
        -1 to take the gyroscopes as reversed.
    bias : (3,) array [rad/s], optional
        Taken off the gyroscopes as they stand in the log.
    """
    dt = increments.dt
    n = len(increments)
    theta = increments.inc_theta_b if bias is None else increments.inc_theta_b - bias * dt[:, None]
    theta = np.ascontiguousarray(sense * theta)
    v = np.ascontiguousarray(increments.inc_v_b)
    start = np.array([1.0, 0.0, 0.0, 0.0])
    dv = np.empty((n, 3))
    axes, swing = np.zeros((3, n + 1, 3)), np.zeros((3, n + 1, 3))
    axes[:, 0] = np.eye(3)
    for i in (0, 1):
        integrate_level(theta, v, dt, start, np.zeros(3), axes[i, 0], dv, axes[i, 1:], swing[i, 1:])
    axes[2] = np.cross(axes[0], axes[1])
    swing[2] = np.cross(swing[0], axes[1]) + np.cross(axes[0], swing[1])
    swing[:, 0] = swing[:, min(1, n)]
    velocity = np.concatenate([np.zeros((1, 3)), np.cumsum(dv, axis=0)])
    place = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * dt[:, None] * (velocity[1:] + velocity[:-1]), axis=0)])
    return ChainedMotion(increments.time, velocity, place, axes, swing, holes)


def error_integrals(motion: ChainedMotion, positions: bool) -> tuple[Array, Array, Array]:
    """What biases add to the integrals of a log, per unit, in the frame L.

    Parameters
    ----------
    motion : ChainedMotion
    positions : bool
        For ``place_l`` instead of ``velocity_l``.

    Returns
    -------
    turned : (3, n, 3) array [s]
        Rotation in L by a bias of each gyroscope.
    by_gyro : (3, n, 3) array
        Of each gyroscope [m/s or m per rad/s], counted from the start of the log; where the attitude is known at
        another time, ``turned`` then x ``velocity_l`` (or ``place_l``) has to be taken off.
    by_accel : (3, n, 3) array
        Of each accelerometer [m/s or m per m/s^2].
    """
    dt = np.diff(motion.time)[:, None]

    def integral(values: Array) -> Array:
        steps = 0.5 * dt * (values[:, 1:] + values[:, :-1])
        return np.concatenate([np.zeros((3, 1, 3)), np.cumsum(steps, axis=1)], axis=1)

    turned = integral(motion.axes_l)
    dv = np.diff(motion.velocity_l, axis=0)
    steps = np.cross(0.5 * (turned[:, 1:] + turned[:, :-1]), dv)
    by_gyro = np.concatenate([np.zeros((3, 1, 3)), np.cumsum(steps, axis=1)], axis=1)
    return (turned, integral(by_gyro), integral(turned)) if positions else (turned, by_gyro, turned)


def usable_gnss(gnss: GnssLog) -> GnssLog:
    """The fixes that have a position."""
    whole = np.isfinite(gnss.lat) & np.isfinite(gnss.lon) & np.isfinite(gnss.height)
    return gnss if whole.all() else gnss.take(whole)


def has_velocity(gnss: GnssLog) -> bool:
    """Whether enough rows have a horizontal velocity to go by it."""
    if gnss.velocity_n is None:
        return False
    return bool(np.isfinite(gnss.velocity_n[:, :2]).all(axis=1).mean() >= LEAST_VELOCITY_SHARE)


def stretches(gnss: GnssLog, first: float, last: float, holes: Array, positions: bool, reach: float = 0.0) -> Stretches:
    """GNSS between two times in stretches of half a minute (more if it is slow), those without inertial data left out.

    Parameters
    ----------
    gnss : GnssLog
    first, last : float [s]
        Rows outside are not used.
    holes : (h, 2) array [s]
        Where the inertial log has none.
    positions : bool
        Use positions even if there are velocities.
    reach : float [s]
        How far from a stretch a hole still spoils it.
    """
    rows = (gnss.time >= first) & (gnss.time <= last)
    if not positions:
        assert gnss.velocity_n is not None
        rows &= np.isfinite(gnss.velocity_n[:, :2]).all(axis=1)
    index = np.flatnonzero(rows)
    index = index[:: max(1, -(-index.size // MOST_ROWS))]
    time = gnss.time[index]
    if time.size < FEWEST_ROWS:
        return Stretches(np.empty((0, 1)), np.empty((0, 1), complex), np.empty((0, 1)), positions)
    length = max(STRETCH_S, STRETCH_ROWS * float(np.median(np.diff(time))))
    span = float(time[-1] - time[0])
    length = np.nextafter(span, np.inf) / max(1, round(span / length))
    edges = [0, *(1 + np.flatnonzero(np.diff(np.floor((time - time[0]) / length)))), time.size]
    pieces = [slice(int(a), int(b)) for a, b in pairwise(edges) if b - a >= FEWEST_ROWS]
    pieces = [p for p in pieces if not _spoilt(time[p], holes, reach)]
    if len(pieces) > MOST_STRETCHES:
        pieces = [pieces[k] for k in np.linspace(0, len(pieces) - 1, MOST_STRETCHES).round().astype(int)]
    longest = max((p.stop - p.start for p in pieces), default=1)
    shape = (len(pieces), longest)
    out_time, seen, weight = np.zeros(shape), np.zeros(shape, complex), np.zeros(shape)
    sd = _horizontal_sd(gnss, positions)[index]
    usual = float(np.median(sd))
    for k, piece in enumerate(pieces):
        n = piece.stop - piece.start
        out_time[k, :n], out_time[k, n:] = time[piece], time[piece.stop - 1]
        seen[k, :n] = _horizontal(gnss, index[piece], positions)
        weight[k, :n] = np.minimum(1.0, usual / sd[piece])
    return Stretches(out_time, seen, weight, positions)


def _spoilt(time: Array, holes: Array, reach: float) -> bool:
    return bool(np.any((holes[:, 0] < time[-1] + reach) & (holes[:, 1] > time[0] - reach)))


def _horizontal_sd(gnss: GnssLog, positions: bool) -> Array:
    sd = gnss.sd_position if positions else gnss.sd_velocity
    if sd is None:
        return np.ones(gnss.time.size)
    worst = np.max(sd[:, :2], axis=1)
    given = np.isfinite(worst) & (worst > 0.0)
    return np.where(given, worst, np.median(worst[given])) if given.any() else np.ones(worst.size)


def _horizontal(gnss: GnssLog, rows: Array, positions: bool) -> Array:
    if not positions:
        assert gnss.velocity_n is not None
        return gnss.velocity_n[rows, 0] + 1j * gnss.velocity_n[rows, 1]
    r = geodetic_to_ecef_batch(gnss.lat[rows], gnss.lon[rows], gnss.height[rows])
    away = (r - r[0]) @ np.array(dcm_en(gnss.lat[rows[0]], gnss.lon[rows[0]])).reshape(3, 3)
    return away[:, 0] + 1j * away[:, 1]
