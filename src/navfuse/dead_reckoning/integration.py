r"""Any dead-reckoned track corrected by GNSS: the filter and smoother of velocity and position errors.

Loosely coupled, six states, in e or in n. With error = true - estimate, over a step of tau,

.. math::

    \delta v_k = \delta v_{k-1} + w, \qquad \delta r_k = \delta r_{k-1} + \tau \delta v_{k-1} + \ldots, \qquad
    Q = S_{DR} \begin{pmatrix} \tau & \tau^2/2 \\ \tau^2/2 & \tau^3/3 \end{pmatrix},

    z = \begin{pmatrix} r^G - r^D \\ v^G - v^D \end{pmatrix} = \begin{pmatrix} \delta r \\ \delta v \end{pmatrix} + v

In n the position states are errors of latitude, longitude and height: metres are divided by R_N + h, (R_E + h) cos L
and -1. That is the basic integration of Groves' lecture "Multisensor Integrated Navigation" (UCL COMP0130, session 3B,
part 2), whose errors have the other sign, hence H = -(0 I; I 0) there. Three states more may be added for the slow part
of the errors of the fixes.

Closed loop the correction goes back into the track: the geometry is then that of the corrected track. In e nothing else
differs, because the filter is linear.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.special import chdtri

from navfuse.core.earth import dcm_en, ecef_to_geodetic_batch, geodetic_to_ecef_batch
from navfuse.data.logs import GnssLog
from navfuse.data.result import Innovations, Result, StateHistory
from navfuse.data.trajectory import Trajectory
from navfuse.dead_reckoning import kernels
from navfuse.dead_reckoning.checks import check_belongs_together, check_order
from navfuse.dead_reckoning.odometry import metres_per_radian
from navfuse.errors import ConfigError, FilterError, InputError

Array = np.ndarray

SOURCES = ("gnss_position", "gnss_velocity")
STATUS = np.array(["used", "rejected", "withheld", "reset"])


@dataclass(frozen=True, slots=True, kw_only=True)
class DrModel:
    """What is known of the errors of a dead-reckoned track.

    Attributes
    ----------
    velocity_psd : float [m^2/s^3]
        S_DR, of the random walk of the horizontal velocity error on each axis.
    vertical_psd : float [m^2/s^3] or None
        The same of the vertical; None for that of the horizontal.
    sd_position : float or (3,) [m]
        Of the start of the track, north, east, down.
    sd_velocity : float or (3,) [m/s]
        Of its velocity there.
    heading_noise, speed_noise : float [rad], [m/s]
        White noise of the headings and speeds that the track was made of. The difference of two velocities has twice
        the variance of one: every step adds 2 (heading_noise speed)^2 + 2 speed_noise^2 to that of the horizontal
        velocity error.
    fix_error_sd : float or (3,) [m]
        > 0 adds the slow part of the errors of the fixes as three states, north, east, down: a Gauss-Markov process of
        this standard deviation. The standard deviations of the fixes are then those of the white part. Most receivers
        filter, so that their errors last.
    fix_error_tau : float [s]
        Its correlation time.
    gate_probability : float
        Share of good fixes that passes the gate; 1 for no gate.
    patience : float [s]
        When fixes were rejected for so long, five at least, the covariance is enlarged and they are used.

    Raises
    ------
    ConfigError
        On construction, for a value out of its range.
    """

    velocity_psd: float = 0.2
    vertical_psd: float | None = None
    sd_position: float | Sequence[float] | Array = 10.0
    sd_velocity: float | Sequence[float] | Array = 0.5
    heading_noise: float = 0.0
    speed_noise: float = 0.0
    fix_error_sd: float | Sequence[float] | Array = 0.0
    fix_error_tau: float = 60.0
    gate_probability: float = 0.999
    patience: float = 10.0

    def __post_init__(self) -> None:
        for name in ("velocity_psd", "vertical_psd", "heading_noise", "speed_noise", "patience"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value >= 0.0):
                raise ConfigError(f"{name} = {value} must be finite and not negative")
        for name in ("sd_position", "sd_velocity"):
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape not in ((), (3,)) or not (np.isfinite(value).all() and (value > 0.0).all()):
                raise ConfigError(f"{name} = {getattr(self, name)} must be one positive number, or three")
        slow = np.asarray(self.fix_error_sd, dtype=float)
        if (
            slow.shape not in ((), (3,))
            or not np.isfinite(slow).all()
            or (slow < 0.0).any()
            or (slow.any() and not slow.all())
        ):
            raise ConfigError(f"fix_error_sd = {self.fix_error_sd} must be one number, or three, positive or all zero")
        if not (math.isfinite(self.fix_error_tau) and self.fix_error_tau > 0.0):
            raise ConfigError(f"fix_error_tau = {self.fix_error_tau} must be positive")
        if not 0.0 < self.gate_probability <= 1.0:
            raise ConfigError(f"gate_probability = {self.gate_probability} must be above 0 and at most 1")

    def psd(self, track: Trajectory) -> Array:
        """Densities (n, 3) [m^2/s^3] north, east, down over the steps that end at the epochs of a track."""
        step = np.diff(track.time, prepend=np.nan)
        v = np.asarray(track.velocity_n)
        white = 2.0 * (self.heading_noise**2 * (v[:, 0] ** 2 + v[:, 1] ** 2) + self.speed_noise**2)
        horizontal = self.velocity_psd + white / step
        vertical = self.velocity_psd if self.vertical_psd is None else self.vertical_psd
        return np.column_stack((horizontal, horizontal, np.full(step.size, vertical)))

    @property
    def slow(self) -> tuple[Array, float]:
        """Standard deviation (3,) [m] and correlation time [s] of the slow errors of the fixes."""
        return np.broadcast_to(np.asarray(self.fix_error_sd, dtype=float), 3).copy(), self.fix_error_tau


def integrate(
    track: Trajectory,
    gnss: GnssLog,
    model: DrModel | None = None,
    *,
    frame: Literal["ned", "ecef"] = "ned",
    feedback: Literal["open", "closed"] = "open",
    use: Sequence[str] = ("position", "velocity"),
    outages: Sequence[tuple[float, float]] = (),
    smooth: bool = True,
) -> Result:
    """Correct a dead-reckoned track by GNSS.

    Parameters
    ----------
    track : Trajectory
        With velocities; of the antenna. Its attitude is handed on as it is.
    gnss : GnssLog
        Its standard deviations count. Fixes outside the track, and velocities that are NaN, are left out.
    model : DrModel, optional
    frame : {"ned", "ecef"}
        Of the error states.
    feedback : {"open", "closed"}
    use : sequence of {"position", "velocity"}
    outages : sequence of (from, to) [s]
        Fixes in [from, to) are withheld: compared only.
    smooth : bool

    Returns
    -------
    Result
        Forward and smoothed corrected track at the epochs of the track and of the fixes inside it; innovations; the
        forward estimates of the errors as states ``dr_velocity_error`` [m/s] and ``dr_position_error`` [m], north,
        east, down, true minus track, and ``fix_error`` [m], measured minus true, where the model has it.

    Raises
    ------
    ConfigError
        For an unknown word in `frame`, `feedback` or `use`.
    InputError
        If the track has no velocity, a time does not increase, no fix lies inside the track, or as
        :func:`~navfuse.dead_reckoning.checks.check_belongs_together`.
    FilterError
        If the covariance fails.
    """
    model = DrModel() if model is None else model
    for name, value, known in (("frame", frame, ("ned", "ecef")), ("feedback", feedback, ("open", "closed"))):
        if value not in known:
            raise ConfigError(f'{name} = "{value}" must be "{known[0]}" or "{known[1]}"')
    if not use or not set(use) <= {"position", "velocity"}:
        raise ConfigError(f'use = {list(use)} must hold "position" or "velocity", or both')
    if track.velocity_n is None or not np.isfinite(track.velocity_n).all():
        raise InputError(f"{track.source}: dead reckoning needs a velocity in every row: vn_mps, ve_mps, vd_mps")
    check_belongs_together(track, gnss)
    check_order(track.source, track.time)
    check_order(gnss.source, gnss.time)
    ecef = frame == "ecef"
    rows = np.flatnonzero((gnss.time >= track.time[0]) & (gnss.time <= track.time[-1]))
    fixes = gnss.take(rows)
    track = at_epochs(track, np.union1d(track.time, fixes.time))
    at = np.searchsorted(track.time, fixes.time)
    slow_at = 6 if model.slow[0].any() else -1
    n, m = len(track), 9 if slow_at > 0 else 6

    dr_p, dr_v, C = _in_frame(track.lat, track.lon, track.height, np.asarray(track.velocity_n), ecef)
    fix_p, fix_v = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    var_p, var_v = np.ones((n, 3)), np.ones((n, 3))
    use_p, use_v = np.full(n, kernels.NOTHING), np.full(n, kernels.NOTHING)
    velocity = np.full((rows.size, 3), np.nan) if fixes.velocity_n is None else fixes.velocity_n
    fix_p[at], fix_v[at], _ = _in_frame(fixes.lat, fixes.lon, fixes.height, velocity, ecef)
    var_p[at] = np.square(fixes.sd_position)
    withheld = np.array([any(begin <= t < end for begin, end in outages) for t in fixes.time.tolist()])
    state = np.where(withheld, kernels.WITHHELD, kernels.USED)
    if "position" in use:
        use_p[at] = state
    if "velocity" in use and fixes.sd_velocity is not None:
        known = np.isfinite(velocity).all(axis=1) & np.isfinite(fixes.sd_velocity).all(axis=1)
        var_v[at] = np.square(np.where(np.column_stack([known] * 3), fixes.sd_velocity, 1.0))
        use_v[at] = np.where(known, state, kernels.NOTHING)
    if not ((use_p == kernels.USED).any() or (use_v == kernels.USED).any()):
        raise InputError(f"{gnss.source}: nothing in it can be used: {' or '.join(use)}, outside the outages")

    x, P = np.zeros((n, m)), np.zeros((n, m, m))
    P[0] = _start_covariance(model, dr_p[0], ecef, m)
    Phi, x_before, P_before = np.tile(np.eye(m), (n, 1, 1)), np.zeros((n, m)), np.zeros((n, m, m))
    record = np.full((n, 2, 8), np.nan)
    gate = math.inf if model.gate_probability == 1.0 else float(chdtri(3, 1.0 - model.gate_probability))
    failed = kernels.run_forward(
        ecef, feedback == "closed", track.time, dr_v, dr_p, model.psd(track), slow_at, *model.slow,
        fix_p, fix_v, var_p, var_v, use_p, use_v, (gate, model.patience), x, P, Phi, x_before, P_before, record,
    )  # fmt: skip
    if failed >= 0:
        raise FilterError(
            f"the DR/GNSS filter failed at {track.time[failed]:.3f} s: its covariance is not positive definite; are "
            "the sigmas and densities of sensible size?"
        )
    corrector = (track, dr_p, dr_v, C, ecef)
    forward, states = _corrected(*corrector, x, P, "forward")
    smoothed = None
    if smooth:
        if (failed := kernels.run_backward(x, P, Phi, x_before, P_before)) >= 0:
            raise FilterError(
                f"the DR/GNSS smoother failed at {track.time[failed]:.3f} s: a covariance is not positive definite; "
                "velocity_psd = 0 leaves it nothing to divide by"
            )
        smoothed, _ = _corrected(*corrector, x, P, "smoothed")
    return Result(forward, smoothed, _innovations(track.time, at, rows, record), states, fixes=gnss, epoch=gnss.epoch)


def at_epochs(track: Trajectory, time: Array) -> Trajectory:
    """A track at given times inside it: positions by cubics through its positions and velocities, in e.

    Raises
    ------
    InputError
        If the track has no velocity.
    """
    if track.velocity_n is None:
        raise InputError(f"{track.source}: has no velocity to interpolate with")
    if time.size == track.time.size and np.array_equal(time, track.time):
        return track
    r_e, v_e, _ = _in_frame(track.lat, track.lon, track.height, track.velocity_n, True)
    lat, lon, height = ecef_to_geodetic_batch(np.ascontiguousarray(CubicHermiteSpline(track.time, r_e, v_e)(time)))
    velocity = np.column_stack([np.interp(time, track.time, track.velocity_n[:, k]) for k in range(3)])
    attitude = None
    if track.attitude is not None:
        attitude = np.column_stack([np.interp(time, track.time, np.unwrap(track.attitude[:, k])) for k in range(3)])
        attitude[:, 2] %= 2.0 * np.pi
    return Trajectory(time, lat, lon, height, velocity, attitude, source=track.source)


def _in_frame(lat: Array, lon: Array, height: Array, velocity_n: Array, ecef: bool) -> tuple[Array, Array, Array]:
    """Position, velocity in the frame of the filter, and C (n, 3, 3) from n to it."""
    if not ecef:
        return (
            np.column_stack((lat, lon, height)),
            np.ascontiguousarray(velocity_n),
            np.tile(np.eye(3), (lat.size, 1, 1)),
        )
    C = np.array([np.reshape(dcm_en(a, b), (3, 3)) for a, b in zip(lat, lon, strict=True)])
    return geodetic_to_ecef_batch(lat, lon, height), np.einsum("kij,kj->ki", C, velocity_n), C


def _start_covariance(model: DrModel, place: Array, ecef: bool, m: int) -> Array:
    C, per_metre = kernels.scales(ecef, place)
    P = np.zeros((m, m))
    variance = [np.square(np.broadcast_to(np.asarray(sd, float), 3)) for sd in (model.sd_velocity, model.sd_position)]
    P[kernels.VELOCITY, kernels.VELOCITY] = (C * variance[0]) @ C.T
    P[kernels.POSITION, kernels.POSITION] = (C * variance[1]) @ C.T * np.outer(per_metre, per_metre)
    if m > 6:
        P[range(6, 9), range(6, 9)] = np.square(model.slow[0])
    return P


def _corrected(
    track: Trajectory,
    dr_p: Array,
    dr_v: Array,
    C: Array,
    ecef: bool,
    x: Array,
    P: Array,
    name: str,
) -> tuple[Trajectory, dict[str, StateHistory]]:
    """The track with the estimated errors added, its standard deviations, and the errors themselves."""
    n = x.shape[0]
    v_n = np.asarray(track.velocity_n)
    to_n = np.swapaxes(C, 1, 2)
    error_v = np.einsum("kij,kj->ki", to_n, x[:, kernels.VELOCITY])
    sd_v = np.sqrt(np.einsum("kij,kjl,kil->ki", to_n, P[:, kernels.VELOCITY, kernels.VELOCITY], to_n))
    place = dr_p + x[:, kernels.POSITION]
    P_p = P[:, kernels.POSITION, kernels.POSITION]
    if ecef:
        lat, lon, height = ecef_to_geodetic_batch(np.ascontiguousarray(place))
        C_there = np.array([np.reshape(dcm_en(a, b), (3, 3)) for a, b in zip(lat, lon, strict=True)])
        sd_p = np.sqrt(np.einsum("kji,kjl,kli->ki", C_there, P_p, C_there))
        error_p = np.einsum("kji,kj->ki", C, x[:, kernels.POSITION])
        velocity = np.einsum("kji,kj->ki", C_there, dr_v + x[:, kernels.VELOCITY])
    else:
        lat, lon, height = place.T
        lon = (lon + np.pi) % (2.0 * np.pi) - np.pi
        metres = np.column_stack((metres_per_radian(lat, height), np.full(n, -1.0)))
        sd_p = np.sqrt(np.diagonal(P_p, axis1=1, axis2=2)) * np.abs(metres)
        error_p = x[:, kernels.POSITION] * metres
        velocity = v_n + error_v
    best = replace(
        track, lat=np.ascontiguousarray(lat), lon=np.ascontiguousarray(lon), height=np.ascontiguousarray(height),
        velocity_n=velocity, sd_position=sd_p, sd_velocity=sd_v, source=f"{track.source}, {name}",
    )  # fmt: skip
    states = {
        "dr_velocity_error": StateHistory(track.time, error_v, sd_v),
        "dr_position_error": StateHistory(track.time, error_p, sd_p),
    }
    if x.shape[1] > 6:
        at = slice(6, 9)
        variance = np.diagonal(P, axis1=1, axis2=2)[:, at]
        states["fix_error"] = StateHistory(track.time, x[:, at].copy(), np.sqrt(variance))
    return best, states


def _innovations(time: Array, at: Array, rows: Array, record: Array) -> Innovations:
    found = record[at]
    order = [(k, what) for k in range(at.size) for what in range(2) if found[k, what, 0] != kernels.NOTHING]
    k, what = np.array(order, dtype=np.int64).reshape(-1, 2).T
    picked = found[k, what]
    return Innovations(
        time[at[k]],
        np.array(SOURCES)[what],
        STATUS[picked[:, 0].astype(np.int64)],
        picked[:, 1],
        np.full(k.size, 3, dtype=np.int64),
        picked[:, 2:5],
        np.sqrt(picked[:, 5:8]),
        rows[k],
    )
