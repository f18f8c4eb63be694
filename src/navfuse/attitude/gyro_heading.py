r"""Heading from a yaw gyro and a compass: the filter of two states, heading error and gyro bias.

The gyro heading is the integral of the measured yaw rate, which is the true rate plus a bias and white noise. With the
signs of navfuse, error = true - estimate and measured = true + bias,

.. math::

    \delta\psi_k = \delta\psi_{k-1} - \tau b_{k-1}, \qquad b_k = b_{k-1}, \qquad
    z_k = \psi^M_k - \psi^g_k = \delta\psi_k + v_k

    F = \begin{pmatrix} 1 & -\tau \\ 0 & 1 \end{pmatrix}, \quad
    Q = \begin{pmatrix} S_{rg}\tau + S_{bgd}\tau^3/3 & -S_{bgd}\tau^2/2 \\ -S_{bgd}\tau^2/2 & S_{bgd}\tau \end{pmatrix},
    \quad H = \begin{pmatrix} 1 & 0 \end{pmatrix}, \quad R = \sigma_M^2

That is the gyro-magnetometer integration of Groves' lecture "Multisensor Integrated Navigation" (UCL COMP0130, session
3B, part 3; Groves 2013, section 6.1.4), whose heading error has the other sign (estimate - true), hence F with +tau,
H = (-1 0) and Q with + off the diagonal there. Angles are clockwise from above; innovations are wrapped into
(-pi, pi], and the filter itself counts whole turns.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit
from scipy.special import chdtri

from navfuse.attitude.heading_logs import YawRateLog, check_heading_against_gyro
from navfuse.core.constants import TWO_PI
from navfuse.core.linear_kalman import propagate, smooth, update
from navfuse.core.rotation import wrap_pi
from navfuse.data.aiding_logs import HeadingLog
from navfuse.data.result import Innovations
from navfuse.data.trajectory import wrapped
from navfuse.errors import ConfigError, FilterError, InputError, NavfuseWarning

Array = np.ndarray

SOURCE = "magnetic_heading"
_STATUS = np.array(["used", "rejected", "reset"])
_FEWEST_REJECTED = 5
_FIRST = 9


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroHeadingSettings:
    """What the filter believes, SI units and radians.

    Attributes
    ----------
    gyro_noise : float [rad/sqrt(s)]
        Square root of S_rg: angle random walk of the yaw gyro.
    gyro_bias_sd : float [rad/s]
        Of the bias before anything is measured.
    gyro_bias_walk : float [rad/s/sqrt(s)]
        Square root of S_bgd.
    gyro_scale_sd : float [1]
        Scale factor error of the gyro. It is no state: each step of the gyro heading adds
        ``(scale dpsi)^2`` to S_rg tau.
    heading_sd : float [rad]
        sigma_M, where the heading log states none.
    declination : float [rad]
        Added to the headings of the log: east positive, true = magnetic + declination.
    gate_probability : float
        Share of good headings that passes the gate; 1 = no gate.
    patience : float [s]
        A heading that follows rejections only, five or more over at least this time, is used whatever it says, after
        the variance of the heading was enlarged by the square of its innovation and that of the bias by its first one.
    feedback : {"closed", "open"}
        Whether estimates are fed back into the gyro integration after each heading, or kept beside an uncorrected gyro
        heading. The results are the same to rounding, because the filter is linear.

    Raises
    ------
    ConfigError
        On construction, for a value out of its range.
    """

    gyro_noise: float = 1e-4
    gyro_bias_sd: float = 0.02
    gyro_bias_walk: float = 1e-6
    gyro_scale_sd: float = 0.0
    heading_sd: float = np.radians(4.0)
    declination: float = 0.0
    gate_probability: float = 0.999
    patience: float = 30.0
    feedback: Literal["closed", "open"] = "closed"

    def __post_init__(self) -> None:
        for name in ("gyro_noise", "gyro_bias_sd", "gyro_bias_walk", "gyro_scale_sd", "patience"):
            _need(np.isfinite(value := getattr(self, name)) and value >= 0.0, name, value, "must be finite and >= 0")
        _need(np.isfinite(self.heading_sd) and self.heading_sd > 0.0, "heading_sd", self.heading_sd, "must be > 0")
        _need(abs(self.declination) <= np.pi, "declination", self.declination, "must be an angle within half a turn")
        _need(0.0 < self.gate_probability <= 1.0, "gate_probability", self.gate_probability, "must be in (0, 1]")
        _need(self.feedback in ("closed", "open"), "feedback", self.feedback, "must be 'closed' or 'open'")


def _need(good: bool, name: str, value: object, what: str) -> None:
    if not good:
        raise ConfigError(f"{name} = {value!r} {what}")


@dataclass(frozen=True, slots=True, eq=False)
class HeadingSolution:
    """Heading and gyro bias at every stamp of both logs from the first heading on.

    Attributes
    ----------
    time : (n,) array [s]
    heading : (n,) array [rad]
        From true north, clockwise, 0 <= heading < 2 pi.
    gyro_bias : (n,) array [rad/s]
        Measured minus true yaw rate.
    P : (n, 2, 2) array
        Covariance of heading [rad] and bias [rad/s].
    """

    time: Array
    heading: Array
    gyro_bias: Array
    P: Array

    @property
    def sd_heading(self) -> Array:
        """Standard deviation (n,) of the heading [rad]."""
        return np.sqrt(self.P[:, 0, 0])

    @property
    def sd_gyro_bias(self) -> Array:
        """Standard deviation (n,) of the gyro bias [rad/s]."""
        return np.sqrt(self.P[:, 1, 1])


@dataclass(frozen=True, slots=True, eq=False)
class GyroHeading:
    """What :func:`gyro_heading` gives.

    Attributes
    ----------
    forward : HeadingSolution
        In real time: of the measurements up to each stamp.
    smoothed : HeadingSolution
        Of all measurements.
    gyro_only : (n,) array [rad]
        The gyro heading without any correction after the first heading, 0 <= heading < 2 pi.
    innovations : Innovations
        Of every heading after the first, in radians, source ``magnetic_heading``.
    """

    forward: HeadingSolution
    smoothed: HeadingSolution
    gyro_only: Array
    innovations: Innovations


@njit(cache=True, error_model="numpy")
def _filter(time, turn, measured, variance, settings, closed, x, P, x_before, P_before, F_all, record):
    """Forward filter over the union of stamps; row 0 of `x` (n, 2) and `P` (n, 2, 2) holds the start.

    `turn` (n,) is what the gyro turned since the row before, `measured` (n,) NaN where there is no heading. `record`
    (n, 4) receives innovation, its variance, NIS and 0 used, 1 rejected, 2 reset. No checks are made.
    """
    arw, walk, scale, gate, patience, fewest = settings
    psi_gyro, rate_bias = x[0, 0], x[0, 1]
    error, bias_error = 0.0, 0.0
    rejected, since = 0, 0.0
    Pk = P[0].copy()
    free, H, R, S = np.ones(2), np.zeros((1, 2)), np.zeros((1, 1)), np.zeros((1, 1))
    H[0, 0] = 1.0
    z, dx, Q = np.zeros(1), np.zeros(2), np.zeros((2, 2))
    for k in range(1, time.size):
        dt = time[k] - time[k - 1]
        F = F_all[k]
        F[0, 0] = F[1, 1] = 1.0
        F[0, 1], F[1, 0] = -dt, 0.0
        Q[0, 0] = arw * arw * dt + walk * walk * dt**3 / 3.0 + (scale * turn[k]) ** 2
        Q[0, 1] = Q[1, 0] = -0.5 * walk * walk * dt * dt
        Q[1, 1] = walk * walk * dt
        psi_gyro += turn[k] - rate_bias * dt
        error -= bias_error * dt
        propagate(Pk, F, Q, P_before[k])
        Pk[:] = P_before[k]
        x_before[k, 0], x_before[k, 1] = psi_gyro + error, rate_bias + bias_error
        if not np.isnan(measured[k]):
            z[0] = wrap_pi(measured[k] - psi_gyro - error)
            R[0, 0] = variance[k]
            nis = update(Pk, H, R, z, gate, free, S, dx)
            record[k, 0], record[k, 1], record[k, 2], record[k, 3] = z[0], S[0, 0], nis, 0.0
            if not nis <= gate:
                if rejected == 0:
                    since = time[k]
                rejected += 1
                record[k, 3] = 1.0
                dx[0] = dx[1] = 0.0
                if rejected >= fewest and time[k] - since >= patience:
                    # Counted as noise of the step, so that the smoother does not carry the change back before it. The
                    # bias is doubted too: a wrong one may be why nothing fitted.
                    Pk[0, 0] += z[0] * z[0]
                    Pk[1, 1] += P[0, 1, 1]
                    P_before[k, 0, 0] += z[0] * z[0]
                    P_before[k, 1, 1] += P[0, 1, 1]
                    update(Pk, H, R, z, np.inf, free, S, dx)
                    record[k, 3] = 2.0
                    rejected = 0
            else:
                rejected = 0
            if closed:
                psi_gyro += dx[0]
                rate_bias += dx[1]
            else:
                error += dx[0]
                bias_error += dx[1]
        x[k, 0], x[k, 1] = psi_gyro + error, rate_bias + bias_error
        P[k] = Pk


@njit(cache=True, error_model="numpy")
def _smooth(x, P, x_before, P_before, F, xs, Ps):
    """Backward pass over what :func:`_filter` left; `xs` and `Ps` come as copies of `x` and `P`.

    Returns the row at which a predicted covariance was not positive definite, -1 if none. No checks are made.
    """
    e, dx = np.zeros(2), np.zeros(2)
    for k in range(x.shape[0] - 2, -1, -1):
        for i in range(2):
            e[i] = xs[k + 1, i] - x_before[k + 1, i]
        if not smooth(P[k], F[k + 1], P_before[k + 1], Ps[k + 1], e, dx, Ps[k]):
            return k + 1
        for i in range(2):
            xs[k, i] = x[k, i] + dx[i]
    return -1


def gyro_heading(
    yaw: YawRateLog, heading: HeadingLog, settings: GyroHeadingSettings | None = None, *, check: bool = True
) -> GyroHeading:
    """Integrate a yaw gyro with a compass, forward and smoothed.

    Parameters
    ----------
    yaw : YawRateLog
        Clockwise from above. :func:`~navfuse.attitude.heading_logs.yaw_rate_from_imu` makes one of an IMU log.
    heading : HeadingLog
        Magnetic headings, or true ones if the declination of `settings` is zero. For a magnetometer see
        :func:`~navfuse.attitude.heading_logs.magnetic_heading`. Its standard deviations count where it has them.
    settings : GyroHeadingSettings, optional
    check : bool
        Whether the turns of the compass are held against those of the gyro first, which finds a wrong sign and
        headings in the wrong unit.

    Returns
    -------
    GyroHeading
        From the first heading inside the gyro log on. That heading is the start, unless it lies outside the gate about
        the circular median of the first nine less what the gyro turned: then the median is.

    Raises
    ------
    InputError
        If fewer than two headings lie inside the gyro log, or as
        :func:`~navfuse.attitude.heading_logs.check_heading_against_gyro`.
    FilterError
        If a covariance cannot be smoothed, because settings are zero that leave nothing uncertain.

    Warns
    -----
    NavfuseWarning
        If more than half of the headings are rejected.

    Notes
    -----
    Between gyro stamps the rate is taken as constant (averaged rates) or linear; a heading may come at any time.
    """
    settings = settings or GyroHeadingSettings()
    inside = (heading.time >= yaw.time[0]) & (heading.time <= yaw.time[-1]) if yaw.time.size > 1 else np.zeros(0, bool)
    if np.count_nonzero(inside) < 2:
        raise InputError(
            f"{heading.source}: fewer than two headings lie inside {yaw.source}; are both on one time scale?"
        )
    if check:
        check_heading_against_gyro(yaw, heading)
    rows = np.flatnonzero(inside)
    time = np.union1d(yaw.time[yaw.time >= heading.time[rows[0]]], heading.time[rows])
    turn = np.diff(yaw.turned(time), prepend=np.nan)
    at = np.searchsorted(time, heading.time[rows])
    measured, variance = np.full((2, time.size), np.nan)
    measured[at] = heading.heading[rows] + settings.declination
    sd = np.full(rows.size, settings.heading_sd) if heading.sd_heading is None else heading.sd_heading[rows]
    variance[at] = sd**2
    n = time.size
    x, x_before, record = np.zeros((n, 2)), np.zeros((n, 2)), np.full((n, 4), np.nan)
    P, P_before, F = np.zeros((n, 2, 2)), np.zeros((n, 2, 2)), np.zeros((n, 2, 2))
    tail = 1.0 - settings.gate_probability
    gate = float(chdtri(1, tail)) if tail > 0.0 else np.inf
    x[0, 0], start_variance = _start(time[at], np.cumsum(turn[1:]), measured[at], variance[at], at, settings, gate)
    P[0] = np.diag([start_variance, settings.gyro_bias_sd**2])
    numbers = (
        settings.gyro_noise, settings.gyro_bias_walk, settings.gyro_scale_sd, gate, settings.patience,
        float(_FEWEST_REJECTED),
    )  # fmt: skip
    _filter(time, turn, measured, variance, numbers, settings.feedback == "closed", x, P, x_before, P_before, F, record)
    xs, Ps = x.copy(), P.copy()
    failed = _smooth(x, P, x_before, P_before, F, xs, Ps)
    if failed >= 0:
        raise FilterError(
            f"{heading.source}: the covariance at {time[failed]:.3f} s cannot be smoothed; "
            "set gyro_noise, and gyro_bias_sd or gyro_bias_walk, above 0"
        )
    innovations = _innovations(time, at, rows, record)
    rejected = np.count_nonzero(innovations.status == "rejected")
    if 2 * rejected > len(innovations):
        warnings.warn(
            f"{heading.source}: {rejected} of {len(innovations)} headings do not fit {yaw.source} and were rejected; "
            "check heading_sd, the scale of the gyro and iron near the compass",
            NavfuseWarning,
            stacklevel=2,
        )
    alone = wrapped(x[0, 0] + np.concatenate([[0.0], np.cumsum(turn[1:])]), TWO_PI)
    return GyroHeading(_solution(time, x, P), _solution(time, xs, Ps), alone, innovations)


def _start(
    time: Array, turned: Array, measured: Array, variance: Array, at: Array, settings: GyroHeadingSettings, gate: float
) -> tuple[float, float]:
    """Heading [rad] and its variance at the first row.

    That is the first heading, unless it contradicts the circular median of the first nine, brought there by the gyro.
    The headings that the median is made of are used again later, so its variance is taken as four times that of one
    heading: their information then counts an eighth of one heading too much at most. Drift of the gyro comes on top.
    """
    few = min(_FIRST, time.size)
    angle = np.concatenate([[0.0], turned])[at[:few]]
    there = measured[:few] - angle
    apart = np.abs(np.angle(np.exp(1j * (there[:, None] - there))))
    j = int(apart.sum(axis=1).argmin())
    dt = time[j] - time[0]
    drift = (
        settings.gyro_noise**2 * dt
        + (settings.gyro_bias_sd * dt) ** 2
        + settings.gyro_bias_walk**2 * dt**3 / 3.0
        + (settings.gyro_scale_sd * angle[j]) ** 2
    )
    if few < 3 or apart[0, j] ** 2 <= gate * (variance[0] + variance[j] + drift):
        return measured[0], variance[0]
    return there[j], 4.0 * variance[j] + drift


def _solution(time: Array, x: Array, P: Array) -> HeadingSolution:
    return HeadingSolution(time, wrapped(x[:, 0], TWO_PI), x[:, 1].copy(), P)


def _innovations(time: Array, at: Array, rows: Array, record: Array) -> Innovations:
    at, rows = at[1:], rows[1:]
    padded = np.full((2, at.size, 3), np.nan)
    padded[0, :, 0], padded[1, :, 0] = record[at, 0], np.sqrt(record[at, 1])
    status = _STATUS[record[at, 3].astype(int)]
    source = np.full(at.size, SOURCE)
    return Innovations(time[at], source, status, record[at, 2], np.ones(at.size, dtype=int), padded[0], padded[1], rows)
