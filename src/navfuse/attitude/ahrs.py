r"""Attitude and heading reference: attitude from gyro, accelerometer and magnetometer, in real time and smoothed.

The filter integrates the gyro and, with that attitude, the accelerometer, and knows one thing about the motion: the
body stays about where it is, so that its velocity is noise about zero. What the velocity runs up to is then the error
of the inclination, and gravity is found by averaging the specific force in the level frame over seconds, whatever the
body does in between.
(VQF, Laidig and Seel 2023, low-passes the specific force in an inertial frame for the same reason; here the
gain follows from the noises and changes with the motion, and there is a covariance.) The errors obey

.. math::

    \dot\psi = -C_{nb}\,(\delta b_g + n_g), \qquad
    \delta\dot v = -[f_n\times]\psi_{NE} - C_{nb}\,\delta b_a + n_a

(Groves 2013, section 14.2, without the rotation and the curvature of the Earth); the
heading error has no part in the velocity, which is resolved in the level frame of the estimated heading. The
magnetometer gives, turned into n by the estimated attitude,

.. math::

    C_{nb} m_b = M + [M\times]\psi + C_{nb} b_m + \tau\, w_n \times M + n_m, \qquad M = m_0 + d

with the reference field :math:`m_0` (unknown horizontal and downward strength, no east part: that defines north), a
disturbance d that changes as the body moves, the rest :math:`b_m` of the calibration, and the delay :math:`\tau` of the
magnetometer, to first order. Inclination, velocity and accelerometer bias get no gain from it (Schmidt): a disturbed
field may turn the heading, never the horizon. Blocks outside a chi-square gate are not used. While the body rests the
rate is zero but for the bias, and the magnetometer says nothing new.

Sources: Markley (2003) for the attitude error and its reset, Rauch, Tung and Striebel (1965) for the smoother, on
differences of attitudes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from navfuse.attitude.ahrs_kernels import BG, LAG, MEMORY, PSI, REF, REJECTED, N, backward, forward, spread
from navfuse.attitude.ahrs_settings import AhrsSettings
from navfuse.attitude.magnetic_axes import check_magnetic_axes
from navfuse.core.rotation import euler_from_quat_batch, quat_from_dcm, quat_from_rotvec, quat_multiply
from navfuse.data.aiding_logs import MagnetometerLog
from navfuse.data.logs import ImuLog
from navfuse.errors import FilterError, InputError
from navfuse.imu.increments import ImuIncrements, to_increments

Array = np.ndarray

_STRETCH = 64
_MICRO = 1e6
_WAIT = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class AttitudeSolution:
    """Attitude at every stamp of the inertial log.

    Attributes
    ----------
    time : (n,) array [s]
    q_nb : (n, 4) array
        Body forward-right-down to north-east-down, scalar first. North is true north with a declination or a `field_n`,
        else magnetic north; without a magnetometer it is where the x axis pointed at the start.
    sd : (n, 3) array [rad]
        Standard deviations of the attitude error about north, east, down: two of inclination, one of heading. Without
        a magnetometer the heading is that turned since the start.
    gyro_bias, accel_bias : (n, 3) arrays [rad/s], [m/s^2]
        Measured minus true, held from one block to the next.
    sd_gyro_bias : (n, 3) array [rad/s]
    """

    time: Array
    q_nb: Array
    sd: Array
    gyro_bias: Array
    accel_bias: Array
    sd_gyro_bias: Array

    @property
    def euler(self) -> Array:
        """Roll, pitch, heading (n, 3) [rad]."""
        return euler_from_quat_batch(self.q_nb)


@dataclass(frozen=True, slots=True, eq=False)
class AttitudeReference:
    """What :func:`estimate_attitude` gives.

    Attributes
    ----------
    realtime : AttitudeSolution
        Of the measurements up to each stamp.
    smoothed : AttitudeSolution or None
        Of the whole record.
    block_time : (b,) array [s]
        Ends of the blocks.
    magnetic_nis : (b,) array
        Normalized innovation squared of the magnetometer, 3 degrees of freedom; NaN where it said nothing.
    magnetic_rejected : (b,) bool array
        Where the gate rejected it as disturbed.
    resting : (b,) bool array
    delay, sd_delay : float [s]
        By which the magnetometer came late against its stamps, at the end of the record.
    """

    realtime: AttitudeSolution
    smoothed: AttitudeSolution | None
    block_time: Array
    magnetic_nis: Array
    magnetic_rejected: Array
    resting: Array
    delay: float
    sd_delay: float


def estimate_attitude(
    imu: ImuLog,
    magnetometer: MagnetometerLog | None = None,
    settings: AhrsSettings | None = None,
    *,
    smooth: bool = True,
    check: bool = True,
) -> AttitudeReference:
    """Attitude of a body that is handled, worn or mounted on something that stays about where it is.

    Parameters
    ----------
    imu : ImuLog
        Body axes forward-right-down. Rates are taken at their stamps; a sensor that gives means over the interval
        before the stamp is better passed as increments.
    magnetometer : MagnetometerLog, optional
        In the same axes, at any rate. None for inclination and a heading relative to the start ("6-D").
    settings : AhrsSettings, optional
    smooth : bool
        Whether to smooth: once back through the record, which takes twice as long as the filter alone.
    check : bool
        Whether the axes of the magnetometer are held against gyro and reference field first.

    Returns
    -------
    AttitudeReference
        From the first stamp on; from the first magnetic sample on if that comes more than 0.2 s later.

    Raises
    ------
    InputError
        If fewer than two inertial samples, or less than one magnetic sample, lie in the common time; for values that
        are not finite; for accelerometers that do not feel gravity; or as
        :func:`~navfuse.attitude.magnetic_axes.check_magnetic_axes`.
    FilterError
        If the covariance was lost, which wrong units can do.
    """
    settings = settings or AhrsSettings()
    for name, values in (("gyro", imu.gyro), ("accel", imu.accel)):
        _need_finite(imu.source, name, values)
    if magnetometer is not None:
        _need_finite(magnetometer.source, "field", magnetometer.field_b)
        imu = _from_first_field(imu, magnetometer)
    if imu.time.size < 3:
        raise InputError(f"{imu.source}: an attitude needs at least three inertial samples, not {imu.time.size}")
    increments = to_increments(imu)
    if magnetometer is not None and check:
        check_magnetic_axes(increments, magnetometer, settings.field_n)
    run = _Run(increments, magnetometer, settings, imu.source)
    return run.result(smooth)


def _need_finite(source: str, name: str, values: Array) -> None:
    bad = ~np.isfinite(values).all(axis=1)
    if bad.any():
        raise InputError(f"{source}: row {int(np.argmax(bad))}: {name} is not finite; remove or repair such rows")


def _from_first_field(imu: ImuLog, magnetometer: MagnetometerLog) -> ImuLog:
    inside = (magnetometer.time > imu.time[0]) & (magnetometer.time <= imu.time[-1]) if imu.time.size else [False]
    if not np.any(inside):
        raise InputError(
            f"{magnetometer.source}: no magnetic sample lies inside {imu.source}; are both on one time scale?"
        )
    first = magnetometer.time[np.argmax(inside)]
    if first - imu.time[0] <= _WAIT:
        return imu
    rows = slice(max(int(np.searchsorted(imu.time, first)) - 2, 0), None)
    return replace(imu, time=imu.time[rows], gyro=imu.gyro[rows], accel=imu.accel[rows])


class _Run:
    """One record on its way through the filter and back."""

    def __init__(
        self, increments: ImuIncrements, magnetometer: MagnetometerLog | None, settings: AhrsSettings, source: str
    ):
        self.settings, self.source = settings, source
        self.time, self.dt = increments.time, increments.dt
        self.inc = (increments.inc_theta_b, increments.inc_v_b)
        number = np.floor((self.time[1:] - self.time[0]) / settings.block - 1e-9).astype(np.int64)
        self.ends = np.concatenate([[0], np.flatnonzero(np.diff(number)) + 1, [self.dt.size]])
        self.magnetic = magnetometer is not None
        self.mag, self.age = np.empty((0, 3)), np.empty(0)
        self.mag_from = np.zeros(self.dt.size + 1, dtype=np.int64)
        if magnetometer is not None:
            rows = (magnetometer.time > self.time[0]) & (magnetometer.time <= self.time[-1])
            stamps = magnetometer.time[rows]
            self.mag = _MICRO * np.ascontiguousarray(magnetometer.field_b[rows])
            self.mag_from = np.searchsorted(stamps, self.time, side="right").astype(np.int64)
            self.age = self.time[np.searchsorted(self.time, stamps)] - stamps
        self.q0, self.x0 = self._start()
        self.P0 = np.diag(settings.start_sd(self.magnetic) ** 2)

    def _start(self) -> tuple[Array, Array]:
        """Level by the first force, north by the first field."""
        first = self.inc[1][: self.ends[1]].sum(axis=0)
        size = np.linalg.norm(first)
        mean = size / self.dt[: self.ends[1]].sum()
        if not 0.1 * self.settings.gravity < mean < 10.0 * self.settings.gravity:
            raise InputError(
                f"{self.source}: the first specific force is {mean:.3g} m/s^2, not near "
                "gravity; check the unit of the accelerometer, or let the log begin where the body is not in free fall"
            )
        down = -first / size
        north = self.mag[0] if self.magnetic else np.array([1.0, 0.0, 0.0])
        if np.linalg.norm(np.cross(down, north)) < 1e-3 * np.linalg.norm(north):
            north = np.array([0.0, 0.0, -1.0])
        east = np.cross(down, north)
        east /= np.linalg.norm(east)
        C_nb = np.array([np.cross(east, down), east, down])
        x0 = np.zeros(N)
        if self.settings.field_n is not None:
            field_n = _MICRO * np.asarray(self.settings.field_n, dtype=float)
            x0[REF], x0[REF + 1] = np.hypot(field_n[0], field_n[1]), field_n[2]
        elif self.magnetic:
            field = C_nb @ self.mag[0]
            x0[REF], x0[REF + 1] = field[0], field[2]
        return np.array(quat_from_dcm(C_nb.ravel())), x0

    def _forward(self, first: int, last: int, state: list[Array], out_q: Array) -> _Stretch:
        stretch = _Stretch(last - first)
        inc_theta, inc_v = self.inc
        q, x, P, memory = state
        forward(
            first, last, self.ends, inc_theta, inc_v, self.dt, self.mag, self.mag_from, self.age,
            self.settings.numbers(), q, x, P, memory, out_q, stretch.x_pred, stretch.q_pred, stretch.x_post,
            stretch.q_post, stretch.P_pred, stretch.P_post, stretch.F, stretch.record,
        )  # fmt: skip
        if not (np.all(np.isfinite(stretch.x_post)) and np.all(np.isfinite(stretch.P_post))):
            raise FilterError(f"{self.source}: the attitude filter lost its state; check units and axes of the logs")
        return stretch

    def _filter(self) -> _Pass:
        """Through the whole record."""
        memory = np.zeros(MEMORY)
        memory[0:3], memory[3:6] = self.inc[0][0] / self.dt[0], self.inc[1][0] / self.dt[0]
        blocks = self.ends.size - 1
        found = _Pass([self.q0.copy(), self.x0.copy(), self.P0.copy(), memory], blocks, self.dt.size)
        found.x[0], found.variance[0] = self.x0, np.diagonal(self.P0)
        for first in range(0, blocks, _STRETCH):
            found.checkpoints.append([part.copy() for part in found.state])
            last = min(first + _STRETCH, blocks)
            stretch = self._forward(first, last, found.state, found.q)
            found.x[first + 1 : last + 1] = stretch.x_post
            found.variance[first + 1 : last + 1] = np.diagonal(stretch.P_post, axis1=1, axis2=2)
            found.record[first:last] = stretch.record
        return found

    def result(self, smooth: bool) -> AttitudeReference:
        now = self._filter()
        record = now.record
        smoothed = None
        if smooth:
            back = self._smooth(now)
            smoothed = self._solution(np.vstack([back.state[0], back.q]), back.x, back.variance, True)
        return AttitudeReference(
            self._solution(np.vstack([self.q0, now.q]), now.x, now.variance, False),
            smoothed,
            self.time[self.ends[1:]],
            record[:, 0],
            record[:, 1] == REJECTED,
            record[:, 2] == 1.0,
            float(now.x[-1, LAG]),
            float(np.sqrt(now.variance[-1, LAG])),
        )

    def _smooth(self, now: _Pass) -> _Pass:
        """Back through the record, one stretch filtered once more at a time; `state` is then that of the start."""
        blocks = self.ends.size - 1
        back = _Pass([now.state[0].copy(), now.state[1].copy(), now.state[2].copy()], blocks, self.dt.size)
        qs, xs, Ps = back.state
        back.x[:], back.variance[:] = now.x, now.variance
        smoothed_q = np.empty((blocks + 1, 4))
        smoothed_q[-1] = qs
        for number in range(len(now.checkpoints) - 1, -1, -1):
            first, last = number * _STRETCH, min((number + 1) * _STRETCH, blocks)
            q, x, P, memory = now.checkpoints[number]
            stretch = self._forward(first, last, [q.copy(), x.copy(), P.copy(), memory.copy()], back.q)
            q_before = np.vstack([q, stretch.q_post[:-1]])
            good = backward(
                stretch.x_pred, stretch.q_pred, np.vstack([x, stretch.x_post[:-1]]), q_before, stretch.P_pred,
                np.concatenate([P[None], stretch.P_post[:-1]]), stretch.F, xs, qs, Ps, back.x[first:last],
                smoothed_q[first:last], back.variance[first:last],
            )  # fmt: skip
            if not good:
                raise FilterError(f"{self.source}: a covariance cannot be smoothed; check the settings for zero noises")
            spread(first, last, self.ends, self.time, back.q, stretch.q_pred, q_before, smoothed_q[first : last + 1])
        return back

    def _solution(self, q: Array, x: Array, variance: Array, interpolate: bool) -> AttitudeSolution:
        """Epochs -> stamps; the states are turned to true north with the attitude."""
        north = quat_from_rotvec((0.0, 0.0, self.settings.north if self.magnetic else 0.0))
        turned = np.stack(quat_multiply(north, q.T), axis=1)
        sd = np.sqrt(np.maximum(variance, 0.0))
        epochs = self.time[self.ends]
        if interpolate:
            sd_psi = np.column_stack([np.interp(self.time, epochs, sd[:, PSI + i]) for i in range(3)])
        held = np.searchsorted(epochs, self.time, side="right") - 1
        if not interpolate:
            sd_psi = sd[held, PSI : PSI + 3]
        return AttitudeSolution(
            self.time, turned, sd_psi, x[held, BG : BG + 3], x[held, BG + 3 : BG + 6], sd[held, BG : BG + 3]
        )


class _Pass:
    """One way through the record: attitude per interval, states and variances per epoch, and where it ended."""

    def __init__(self, state: list[Array], blocks: int, intervals: int):
        self.state = state
        self.q = np.empty((intervals, 4))
        self.x, self.variance = np.empty((2, blocks + 1, N))
        self.record = np.empty((blocks, 3))
        self.checkpoints: list[list[Array]] = []


class _Stretch:
    """Room for what the smoother needs of some blocks."""

    def __init__(self, size: int):
        self.x_pred, self.x_post = np.empty((2, size, N))
        self.q_pred, self.q_post = np.empty((2, size, 4))
        self.P_pred, self.P_post, self.F = np.empty((3, size, N, N))
        self.record = np.empty((size, 3))
