r"""Odometer and yaw gyro with GNSS positions: heading, gyro bias and odometer scale estimated with the position.

Where fixes are sparse a dead-reckoned track is lost by errors that the six-state filter calls a random walk of velocity
and that are really constant: the heading at the start, the bias of the gyro, the scale of the odometer. Closed loop;
state north, east, height, heading psi, gyro bias b, odometer scale kappa. Measured distance d and turn t of a step are

.. math::

    d = (1 + \kappa)\, d_{true} + \ldots, \qquad t = \psi_k - \psi_{k-1} + \tau b + \ldots

and the vehicle moves along the arc of the corrected step. Errors are true minus estimate, north and east in metres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from navfuse.data.logs import GnssLog
from navfuse.data.result import Innovations, Result, StateHistory
from navfuse.data.trajectory import Trajectory, wrapped
from navfuse.dead_reckoning import planar_kernels
from navfuse.dead_reckoning.checks import check_belongs_together, check_order
from navfuse.dead_reckoning.integration import STATUS
from navfuse.dead_reckoning.odometry import StartPoint, Steps, chords, metres_per_radian
from navfuse.dead_reckoning.planar_kernels import BIAS, HEADING, SCALE, STATES
from navfuse.errors import ConfigError, FilterError, InputError

Array = np.ndarray


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryModel:
    """Errors of odometer and yaw gyro.

    Attributes
    ----------
    distance_noise : float [m/sqrt(m)]
        White noise along the way: after 100 m ten times as much.
    slip_noise : float [m/sqrt(m)]
        The same across it.
    turn_noise : float [rad/sqrt(s)]
        Angular random walk of the gyro, and whatever else turns the vehicle unseen.
    turn_slip : float [rad/sqrt(rad)]
        White noise that grows with what was turned.
    gyro_bias_sd : float [rad/s]
        At the start; 0 leaves the bias out.
    gyro_bias_walk : float [rad/s/sqrt(s)]
    scale_sd : float [1]
        Of the odometer, at the start; 0 leaves it out.
    scale_walk : float [1/sqrt(s)]
    height_walk : float [m/sqrt(s)]
        Height is a random walk.
    sd_position : float [m]
        Of the start, all three axes.
    sd_heading : float [rad]
        Of the heading at the start.
    gate_probability, patience : see :class:`~navfuse.dead_reckoning.integration.DrModel`

    Raises
    ------
    ConfigError
        On construction, for a value out of its range.
    """

    distance_noise: float = 0.05
    slip_noise: float = 0.02
    turn_noise: float = 1e-3
    turn_slip: float = 0.01
    gyro_bias_sd: float = 1e-3
    gyro_bias_walk: float = 1e-6
    scale_sd: float = 0.03
    scale_walk: float = 1e-5
    height_walk: float = 0.05
    sd_position: float = 5.0
    sd_heading: float = 0.2
    gate_probability: float = 0.999
    patience: float = 30.0

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ConfigError(f"{name} = {value} must be finite and not negative")
        for name in ("sd_position", "sd_heading"):
            if getattr(self, name) == 0.0:
                raise ConfigError(f"{name} = 0 must be positive")
        if not 0.0 < self.gate_probability <= 1.0:
            raise ConfigError(f"gate_probability = {self.gate_probability} must be above 0 and at most 1")


def first_heading(
    steps: Steps, gnss: GnssLog, lever: tuple[float, float] = (0.0, 0.0), length: float = 30.0
) -> tuple[float, float]:
    """Heading at the start of steps: the one that lays their track over the first fixes.

    Parameters
    ----------
    steps : Steps
    gnss : GnssLog
    lever : (forward, right) [m]
        From the point that the distances are of to the antenna.
    length : float [m]
        Of the way along which fixes are used: short, because the bias of a gyro turns the track as it goes on.

    Returns
    -------
    heading, sd : float [rad]
        Clockwise from true north; standard deviation from that of the fixes or what is left of them, whichever is
        larger, 0.02 rad at the least.

    Raises
    ------
    InputError
        If fewer than two fixes lie inside the steps, or all are nearer to each other than their errors.
    """
    inside = (gnss.time >= steps.time[0]) & (gnss.time <= steps.time[-1])
    if np.count_nonzero(inside) < 2:
        raise InputError(f"{gnss.source}: fewer than two fixes lie inside {steps.source}; a heading needs two")
    fixes = gnss.take(inside)
    psi = np.concatenate(([0.0], np.cumsum(steps.turn)))
    north, east = (np.concatenate(([0.0], np.cumsum(d))) for d in chords(steps.distance, psi[:-1], steps.turn))
    track = north + 1j * east + complex(*lever) * np.exp(1j * psi)
    moved = np.interp(fixes.time, steps.time, track.real) + 1j * np.interp(fixes.time, steps.time, track.imag)
    metres = metres_per_radian(fixes.lat[:1], fixes.height[:1])[0]
    dlon = (fixes.lon - fixes.lon[0] + np.pi) % (2.0 * np.pi) - np.pi
    seen = (fixes.lat - fixes.lat[0]) * metres[0] + 1j * dlon * metres[1]
    way = np.interp(fixes.time, steps.time, np.concatenate(([0.0], np.cumsum(np.abs(steps.distance)))))
    last = max(int(np.searchsorted(way, way[0] + length)) + 1, 2)
    a, b = moved[:last] - moved[:last].mean(), seen[:last] - seen[:last].mean()
    sd = float(np.hypot(*fixes.sd_position[0, :2]))
    reach = float(np.sqrt(np.sum(np.abs(a) ** 2)))
    if not reach > 2.0 * sd or np.abs(b).max() <= sd:
        raise InputError(
            f"{gnss.source}: the fixes are too near to each other for a heading; give heading_deg of the start"
        )
    turn = np.vdot(a, b)
    left = float(np.sqrt(np.mean(np.abs(b - a * turn / np.abs(turn)) ** 2)))
    return float(np.angle(turn)) % (2.0 * np.pi), max(sd / reach, left / reach, 0.02)


def filter_odometry(
    steps: Steps,
    gnss: GnssLog,
    start: StartPoint,
    model: OdometryModel | None = None,
    *,
    lever: tuple[float, float] = (0.0, 0.0),
    outages: Sequence[tuple[float, float]] = (),
    smooth: bool = True,
) -> Result:
    """Filter, and smooth, odometer and gyro steps with GNSS positions.

    Parameters
    ----------
    steps : Steps
    gnss : GnssLog
        Positions of the antenna; used at the epoch of the steps nearest to them, moved there along the track.
    start : StartPoint
        Position of the antenna, and heading, at the first time of the steps.
    model : OdometryModel, optional
    lever : (forward, right) [m]
        From the point that the distances are of to the antenna.
    outages : sequence of (from, to) [s]
        Fixes in [from, to) are withheld: compared only.
    smooth : bool

    Returns
    -------
    Result
        Track of the antenna, level, at the times of the steps; states ``yaw_gyro_bias`` [rad/s] and ``odometer_scale``
        [1].

    Raises
    ------
    InputError
        As :func:`~navfuse.dead_reckoning.checks.check_belongs_together`, and for times that do not increase.
    FilterError
        If the covariance fails.

    Notes
    -----
    An extended Kalman filter: a start heading off by more than about 60 deg can lead it astray; see
    :func:`first_heading`. Fixes between two epochs of the steps are compared at the time of the fix with a position
    interpolated on the step, and corrections are applied at its end.
    """
    model = OdometryModel() if model is None else model
    n = steps.time.size
    check_belongs_together(Trajectory(steps.time, *np.zeros((3, n)), source=steps.source), gnss)
    check_order(gnss.source, gnss.time)
    rows = np.flatnonzero((gnss.time >= steps.time[0]) & (gnss.time <= steps.time[-1]))
    fixes = gnss.take(rows)
    at = np.searchsorted(steps.time, fixes.time)
    part = np.ones(rows.size)
    part[at > 0] = ((fixes.time - steps.time[at - 1]) / (steps.time[at] - steps.time[at - 1]))[at > 0]
    withheld = np.array([any(begin <= t < end for begin, end in outages) for t in fixes.time], dtype=bool)
    x, P = np.zeros((n, STATES)), np.zeros((n, STATES, STATES))
    x[0] = start.lat, start.lon, start.height, start.heading, 0.0, 0.0
    planar_kernels.shift(x[0], np.array(lever), -1.0)
    P[0] = np.diag(np.square([model.sd_position] * 3 + [model.sd_heading, model.gyro_bias_sd, model.scale_sd]))
    keep = np.array([True] * 4 + [model.gyro_bias_sd > 0.0, model.scale_sd > 0.0])
    Phi, P_before, correction = np.tile(np.eye(STATES), (n, 1, 1)), np.zeros((n, STATES, STATES)), np.zeros((n, STATES))
    record = np.full((rows.size, 8), np.nan)
    gate = math.inf if model.gate_probability == 1.0 else float(chdtri(3, 1.0 - model.gate_probability))
    noise = (
        model.distance_noise, model.slip_noise, model.turn_noise, model.turn_slip, model.height_walk,
        model.gyro_bias_walk * (model.gyro_bias_sd > 0.0), model.scale_walk * (model.scale_sd > 0.0),
    )  # fmt: skip
    failed = planar_kernels.run_forward(
        steps.time, steps.distance, steps.turn, np.array(lever, dtype=float), noise, at, part,
        np.column_stack((fixes.lat, fixes.lon, fixes.height)), np.square(fixes.sd_position), withheld,
        (gate, model.patience), x, P, Phi, P_before, correction, record,
    )  # fmt: skip
    if failed >= 0:
        raise FilterError(f"the odometry filter failed at {steps.time[failed]:.3f} s; are the sigmas of sensible size?")
    forward = _trajectory(steps, x, P, lever, "forward")
    states = {
        name: StateHistory(steps.time, x[:, k : k + 1].copy(), np.sqrt(P[:, k, k])[:, None])
        for name, k in (("yaw_gyro_bias", BIAS), ("odometer_scale", SCALE))
        if keep[k]
    }
    smoothed = None
    if smooth:
        which = np.flatnonzero(keep)
        grid = np.ix_(np.arange(n), which, which)
        small, Ps = np.zeros((n, which.size)), np.ascontiguousarray(P[grid])
        failed = planar_kernels.run_backward(
            small, Ps, np.ascontiguousarray(Phi[grid]), np.ascontiguousarray(P_before[grid]),
            np.ascontiguousarray(correction[:, which]),
        )  # fmt: skip
        if failed >= 0:
            raise FilterError(
                f"the odometry smoother failed at {steps.time[failed]:.3f} s: give a walk or noise above 0"
            )
        whole, whole_P = np.zeros_like(x), np.zeros_like(P)
        whole[:, which], whole_P[grid] = small, Ps
        best = x.copy()
        for k in range(n):
            planar_kernels.correct(best[k], whole[k])
        smoothed = _trajectory(steps, best, whole_P, lever, "smoothed")
    innovations = Innovations(
        fixes.time, np.full(rows.size, "gnss_position"), STATUS[record[:, 0].astype(np.int64)], record[:, 1],
        np.full(rows.size, 3, dtype=np.int64), record[:, 2:5], np.sqrt(record[:, 5:8]), rows,
    )  # fmt: skip
    return Result(forward, smoothed, innovations, states, fixes=gnss, epoch=gnss.epoch)


def _trajectory(steps: Steps, x: Array, P: Array, lever: tuple[float, float], name: str) -> Trajectory:
    n = len(x)
    psi = x[:, HEADING]
    place = x.copy()
    for k in range(n):
        planar_kernels.shift(place[k], np.array(lever, dtype=float), 1.0)
    dt = np.diff(steps.time)
    speed, rate = steps.distance / dt / (1.0 + x[1:, SCALE]), steps.turn / dt - x[1:, BIAS]
    speed, rate = np.concatenate((speed[:1], speed)), np.concatenate((rate[:1], rate))
    c, s = np.cos(psi), np.sin(psi)
    ahead, right = speed - rate * lever[1], rate * lever[0]
    velocity = np.column_stack((c * ahead - s * right, s * ahead + c * right, np.zeros(n)))
    J = np.zeros((n, 3, STATES))
    J[:, range(3), range(3)] = 1.0
    J[:, 0, HEADING], J[:, 1, HEADING] = -s * lever[0] - c * lever[1], c * lever[0] - s * lever[1]
    sd = np.sqrt(np.einsum("kij,kjl,kil->ki", J, P, J))
    level = np.zeros(n)
    attitude = np.column_stack((level, level, wrapped(psi, 2.0 * np.pi)))
    return Trajectory(
        steps.time, place[:, 0], place[:, 1], place[:, 2], velocity, attitude, sd_position=sd,
        sd_attitude=np.column_stack((level, level, np.sqrt(P[:, HEADING, HEADING]))), source=f"{steps.source}, {name}",
    )  # fmt: skip
