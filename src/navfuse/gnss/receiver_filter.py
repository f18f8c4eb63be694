"""Position, velocity and receiver clock from raw GNSS measurements: a Kalman filter and smoother with eight states.

States: position [m] and velocity [m/s] of the antenna in e, clock offset [m] and clock drift [m/s]. Between epochs the
velocity and the clock wander (Groves 2013, section 9.4.2). Needs neither an inertial sensor nor four satellites.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from navfuse.core.earth import dcm_en, ecef_to_geodetic_batch
from navfuse.core.fused import fused
from navfuse.core.linear import predict, smooth_step, update
from navfuse.data.logs import GnssLog
from navfuse.data.raw_gnss import RawGnssLog
from navfuse.errors import ConfigError, InputError
from navfuse.gnss.outliers import position_without_outliers
from navfuse.gnss.ranging import range_and_rate
from navfuse.gnss.single_point import single_point_velocity

Array = np.ndarray

STATES = 8
LOCKED_OUT = 5
"""After so many epochs in a row in which most satellites were rejected the filter starts anew."""


@dataclass(frozen=True, slots=True)
class ReceiverModel:
    """How an antenna moves and its receiver's clock wanders.

    Attributes
    ----------
    acceleration_psd : float [m^2/s^3]
        Of the white acceleration on each axis: 5 for a vehicle, 0.01 for a walk, 1000 for a fighter.
    clock_phase_psd : float [m^2/s]
        Of the white frequency noise; 0.01 for a temperature-compensated crystal.
    clock_rate_psd : float [m^2/s^3]
        Of the random walk of the frequency; 0.04 for the same.
    gate_probability : float
        Share of good measurements that the gate lets pass; 1 for no gate.

    Raises
    ------
    ConfigError
        On construction, for a density that is negative or a probability outside (0, 1].
    """

    acceleration_psd: float = 5.0
    clock_phase_psd: float = 0.01
    clock_rate_psd: float = 0.04
    gate_probability: float = 0.99999

    def __post_init__(self) -> None:
        for name in ("acceleration_psd", "clock_phase_psd", "clock_rate_psd"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0.0):
                raise ConfigError(f"{name} = {getattr(self, name)} must be finite and not negative")
        if not 0.0 < self.gate_probability <= 1.0:
            raise ConfigError(f"gate_probability = {self.gate_probability} must be above 0 and at most 1")

    def step(self, dt: float) -> tuple[Array, Array]:
        """Transition and process noise (8, 8) over `dt` [s], exact for these densities."""
        Phi, Q = np.eye(STATES), np.zeros((STATES, STATES))
        for axis in range(3):
            Phi[axis, 3 + axis] = dt
            Q[axis, axis] = self.acceleration_psd * dt**3 / 3.0
            Q[axis, 3 + axis] = Q[3 + axis, axis] = self.acceleration_psd * dt**2 / 2.0
            Q[3 + axis, 3 + axis] = self.acceleration_psd * dt
        Phi[6, 7] = dt
        Q[6, 6] = self.clock_phase_psd * dt + self.clock_rate_psd * dt**3 / 3.0
        Q[6, 7] = Q[7, 6] = self.clock_rate_psd * dt**2 / 2.0
        Q[7, 7] = self.clock_rate_psd * dt
        return Phi, Q


@dataclass(frozen=True, slots=True, eq=False)
class ReceiverTrack:
    """What the filter, or the smoother, made of a log.

    Attributes
    ----------
    time : (n,) array [s]
        Epochs of the log, from the first at which a position was known.
    x : (n, 8) array
        Position, velocity in e; clock offset [m] and drift [m/s].
    P : (n, 8, 8) array
    used : (rows,) bool array
        Which pseudo-ranges of the log were used; `used_rate` the same of the range rates.
    nis, dof : (n,) arrays
        Normalised innovation squared of the measurements used at an epoch, and their number; of the filter. Zero at a
        start from the measurements of an epoch alone.
    satellites : (n,) int array
        Pseudo-ranges used.
    restarts : tuple of float [s]
        Epochs at which the filter started anew, because hardly anything fitted any more.
    source : str
    """

    time: Array
    x: Array
    P: Array
    used: Array
    used_rate: Array
    nis: Array
    dof: Array
    satellites: Array
    restarts: tuple[float, ...]
    source: str

    def __len__(self) -> int:
        return self.time.size

    def to_gnss_log(self) -> GnssLog:
        """The track as fixes of the antenna, with velocities and standard deviations north, east, down."""
        lat, lon, height = ecef_to_geodetic_batch(np.ascontiguousarray(self.x[:, :3]))
        C_en = np.array([np.reshape(dcm_en(a, b), (3, 3)) for a, b in zip(lat, lon, strict=True)])
        sd = [np.sqrt(np.einsum("kji,kjl,kli->ki", C_en, self.P[:, at, at], C_en)) for at in (slice(0, 3), slice(3, 6))]
        velocity = np.einsum("kji,kj->ki", C_en, self.x[:, 3:6])
        return GnssLog(
            self.time, lat, lon, height, sd[0], velocity, sd[1], n_satellites=self.satellites, source=self.source
        )


def filter_receiver(
    log: RawGnssLog,
    model: ReceiverModel | None = None,
    start: tuple[float, Array, Array] | None = None,
    *,
    smooth: bool = False,
) -> ReceiverTrack:
    """Run the filter, and the smoother if it is wanted, over a log of raw measurements.

    Parameters
    ----------
    log : RawGnssLog
        Pseudo-ranges corrected for the atmosphere, range rates where there are any. Standard deviations are taken as
        stated.
    model : ReceiverModel, optional
    start : (time, x, P), optional
        State (8,) and covariance (8, 8) at a time not after the first epoch. Without it the first epoch that gives a
        position by least squares begins the filter: with the covariance of that solution and the velocity of the range
        rates.
    smooth : bool
        Use the whole log for every epoch.

    Returns
    -------
    ReceiverTrack

    Raises
    ------
    InputError
        If no epoch gives a position, the start has the wrong shape, or the covariance fails, in the filter or the
        smoother.

    Notes
    -----
    Within an epoch measurements come in the order of how well they fit; when the best of those left is outside its gate
    the rest are outliers. So a good majority defends the filter even where its prediction is poor.
    """
    model = ReceiverModel() if model is None else model
    times, first = log.epochs()
    begin, (x, P, *solved_with) = _first(log, times, first, model, start)
    gate = math.inf if model.gate_probability == 1.0 else float(chdtri(1.0, 1.0 - model.gate_probability))
    n = times.size - begin
    kept_x, kept_P = np.empty((n, STATES)), np.empty((n, STATES, STATES))
    predicted_x, predicted_P, Phis = kept_x.copy(), kept_P.copy(), np.tile(np.eye(STATES), (n, 1, 1))
    used, used_rate = np.zeros(len(log), dtype=bool), np.zeros(len(log), dtype=bool)
    nis, dof, satellites = np.zeros(n), np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    restarts: list[int] = []
    misfits = 0
    for k in range(n):
        at = slice(int(first[begin + k]), int(first[begin + k + 1]))
        if k:
            Phi, Q = model.step(float(times[begin + k] - times[begin + k - 1]))
            predict(x, P, Phi, Q)
            Phis[k] = Phi
        predicted_x[k], predicted_P[k] = x, P
        if k or start is not None:
            nis[k], dof[k] = _use(log, at, x, P, gate, used, used_rate)
        else:
            used[at], used_rate[at] = solved_with
        count = at.stop - at.start
        satellites[k] = used[at].sum()
        misfits = misfits + 1 if count > STATES // 2 and 2 * satellites[k] < count else 0
        if misfits >= LOCKED_OUT and (fresh := _solved(log, at)) is not None:
            x, P, used[at], used_rate[at] = fresh
            satellites[k], nis[k], dof[k] = used[at].sum(), 0.0, 0
            predicted_x[k], predicted_P[k] = x, P
            restarts.append(k)
            misfits = 0
        if not np.isfinite(x).all() or not (np.diagonal(P) > 0.0).all():
            raise InputError(f"{log.source}: the filter failed at {times[begin + k]:.3f} s; are the units right?")
        kept_x[k], kept_P[k] = x, P
    if smooth:
        failed = _smooth(kept_x, kept_P, Phis, predicted_x, predicted_P, restarts)
        if failed >= 0:
            raise InputError(
                f"{log.source}: the covariance at {times[begin + failed]:.3f} s cannot be smoothed; "
                "are the standard deviations and the start right? A model with more noise helps"
            )
    again = tuple(float(times[begin + k]) for k in restarts)
    source = f"{log.source}, {'smoothed' if smooth else 'filtered'}"
    return ReceiverTrack(times[begin:], kept_x, kept_P, used, used_rate, nis, dof, satellites, again, source)


def _first(
    log: RawGnssLog, times: Array, first: Array, model: ReceiverModel, start: tuple[float, Array, Array] | None
) -> tuple[int, tuple[Array, ...]]:
    if start is not None:
        x, P = (np.array(values, dtype=float) for values in start[1:])
        if x.shape != (STATES,) or P.shape != (STATES, STATES):
            raise InputError(
                f"the start of the receiver filter has shapes {x.shape} and {P.shape}, not (8,) and (8, 8)"
            )
        if not start[0] <= times[0]:
            raise InputError(f"the receiver filter starts at {start[0]} s, after the first epoch at {times[0]:.3f} s")
        predict(x, P, *model.step(float(times[0] - start[0])))
        return 0, (x, P)
    for k in range(times.size):
        found = _solved(log, slice(int(first[k]), int(first[k + 1])))
        if found is not None:
            return k, found
    raise InputError(f"{log.source}: no epoch has four satellites that give a position")


def _solved(log: RawGnssLog, at: slice) -> tuple[Array, Array, Array, Array] | None:
    """State and covariance of a single epoch, and the ranges and rates in it; None where it gives none."""
    try:
        fix, used, _ = position_without_outliers(log.pseudorange[at], log.sat_r_e[at], log.sd_pseudorange[at])
    except InputError:
        return None
    x, P = np.zeros(STATES), np.zeros((STATES, STATES))
    order = np.array([0, 1, 2, 6])
    x[:3], x[6] = fix.vector_e, fix.clock
    P[np.ix_(order, order)] = fix.covariance
    P[range(3, 6), range(3, 6)], P[7, 7] = 100.0**2, 300.0**2
    rates = _rates(log, at)
    if rates is not None:
        good = used & np.isfinite(rates[0])
        try:
            moving = single_point_velocity(rates[0][good], log.sat_r_e[at][good], rates[2][good], x[:3], rates[1][good])
        except InputError:
            return x, P, used, np.zeros_like(used)
        order = np.array([3, 4, 5, 7])
        x[3:6], x[7] = moving.vector_e, moving.clock
        P[np.ix_(order, order)] = moving.covariance
        return x, P, used, good
    return x, P, used, np.zeros_like(used)


def _rates(log: RawGnssLog, at: slice) -> tuple[Array, Array, Array] | None:
    if log.range_rate is None or log.sd_range_rate is None or log.sat_v_e is None:
        return None
    return log.range_rate[at], log.sd_range_rate[at], log.sat_v_e[at]


def _use(
    log: RawGnssLog, at: slice, x: Array, P: Array, gate: float, used: Array, used_rate: Array
) -> tuple[float, int]:
    m = at.stop - at.start
    nothing = np.full(m, np.nan)
    rate, sd_rate, sat_v = _rates(log, at) or (nothing, nothing, np.zeros((m, 3)))
    passed = np.zeros(2 * m, dtype=bool)
    nis = _use_epoch(
        x, P, log.pseudorange[at], log.sd_pseudorange[at], rate, sd_rate,
        np.ascontiguousarray(log.sat_r_e[at]), np.ascontiguousarray(sat_v), gate, passed,
    )  # fmt: skip
    used[at], used_rate[at] = passed[:m], passed[m:]
    return nis, int(passed.sum())


@fused
def _use_epoch(x, P, pseudorange, sd, rate, sd_rate, sat_r_e, sat_v_e, gate, passed):
    """Use the measurements of an epoch, best fit first; returns the sum of their NIS. No checks are made."""
    m, n = pseudorange.size, x.size
    z, H, R = np.empty(2 * m), np.zeros((2 * m, n)), np.empty(2 * m)
    open_ = np.ones(2 * m, dtype=np.bool_)
    x0 = x.copy()
    for j in range(m):
        rho, drho, ux, uy, uz, shrink = range_and_rate(
            sat_r_e[j, 0], sat_r_e[j, 1], sat_r_e[j, 2], sat_v_e[j, 0], sat_v_e[j, 1], sat_v_e[j, 2],
            x[0], x[1], x[2], x[3], x[4], x[5],
        )  # fmt: skip
        z[j], R[j] = pseudorange[j] - rho - x[6], sd[j] * sd[j]
        H[j, 0], H[j, 1], H[j, 2], H[j, 6] = -ux, -uy, -uz, 1.0
        k = m + j
        z[k], R[k] = rate[j] - drho - x[7], sd_rate[j] * sd_rate[j]
        H[k, 3], H[k, 4], H[k, 5], H[k, 7] = -shrink * ux, -shrink * uy, -shrink * uz, 1.0
        open_[j] = np.isfinite(z[j]) and np.isfinite(R[j])
        open_[k] = np.isfinite(z[k]) and np.isfinite(R[k])
    one_z, one_H, one_R = np.empty(1), np.empty((1, n)), np.empty((1, 1))
    total = 0.0
    while True:
        best, least, value = -1, np.inf, 0.0
        for k in range(2 * m):
            if not open_[k]:
                continue
            nu, S = z[k], R[k]
            for i in range(n):
                h = H[k, i]
                if h != 0.0:
                    nu -= h * (x[i] - x0[i])
                    for l in range(n):
                        S += h * P[i, l] * H[k, l]
            if nu * nu / S < least:
                best, least, value = k, nu * nu / S, nu
        if best < 0 or not least <= gate:
            return total
        one_z[0], one_R[0, 0] = value, R[best]
        for i in range(n):
            one_H[0, i] = H[best, i]
        total += update(x, P, one_z, one_H, one_R, np.inf)
        open_[best] = False
        passed[best] = True


def _smooth(x: Array, P: Array, Phis: Array, predicted_x: Array, predicted_P: Array, restarts: list[int]) -> int:
    """Carry what came later back, in place; never across a restart. The epoch that failed, or -1."""
    for k in range(len(x) - 2, -1, -1):
        if k + 1 in restarts:
            continue
        if not smooth_step(x[k], P[k], Phis[k + 1], predicted_x[k + 1], predicted_P[k + 1], x[k + 1], P[k + 1]):
            return k + 1
    return -1
