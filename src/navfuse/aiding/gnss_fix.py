"""GNSS position and velocity of an antenna with a lever arm."""

from __future__ import annotations

import numpy as np
from numba import njit

from navfuse.aiding.base import AidingSensor
from navfuse.core.constants import EARTH_RATE
from navfuse.core.earth import dcm_en, ecef_to_geodetic, geodetic_to_ecef
from navfuse.core.rotation import cross, dcm_from_quat, mat_mul, mat_t_vec, mat_vec
from navfuse.data.layout import CROSS_PAIRS
from navfuse.data.logs import GnssLog
from navfuse.data.nav_state import NavState, NavStates, to_ned
from navfuse.errors import InputError

Array = np.ndarray
OutageWindows = tuple[tuple[float, float], ...]


@njit(cache=True)
def _antenna(nav, ecef, l_b):
    """Rotation from the error frame to n, lever arm in the error frame and ECEF antenna position. No checks are
    made.
    """
    C_mb = dcm_from_quat((nav[6], nav[7], nav[8], nav[9]))
    l_m = mat_vec(C_mb, (l_b[0], l_b[1], l_b[2]))
    if ecef:
        r = (nav[0] + l_m[0], nav[1] + l_m[1], nav[2] + l_m[2])
        ned = to_ned(nav)
        C_en = dcm_en(ned[0], ned[1])
        C_nm = (C_en[0], C_en[3], C_en[6], C_en[1], C_en[4], C_en[7], C_en[2], C_en[5], C_en[8])
    else:
        C_en = dcm_en(nav[0], nav[1])
        r0 = geodetic_to_ecef(nav[0], nav[1], nav[2])
        l_e = mat_vec(C_en, l_m)
        r = (r0[0] + l_e[0], r0[1] + l_e[1], r0[2] + l_e[2])
        C_nm = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    return C_mb, C_nm, l_m, r, C_en


@njit(cache=True)
def predict_position(nav, ecef, l_b):
    """Latitude, longitude [rad] and height [m] of an antenna with lever arm `l_b` (3,) [m]. No checks are made."""
    r = _antenna(nav, ecef, l_b)[3]
    return ecef_to_geodetic(r[0], r[1], r[2])


@njit(cache=True)
def linearize_position(nav, ecef, l_b, fix, z, H, R):
    """Innovation (3,) north, east, down [m] of an antenna position, its matrix H (3, n) and covariance R (3, 3).

    z = C_ne (r_measured - r_e - C_eb l_b);  dz = C_nm (dr - [C_mb l_b x] psi). `fix` (6,) holds latitude, longitude
    [rad], height [m] and their deviations [m]. Written into `z`, `H` and `R`, of which the last two must be zero
    before. No checks are made.
    """
    _, C_nm, l, r, C_en = _antenna(nav, ecef, l_b)
    m = geodetic_to_ecef(fix[0], fix[1], fix[2])
    z[0], z[1], z[2] = mat_t_vec(C_en, (m[0] - r[0], m[1] - r[1], m[2] - r[2]))
    lx = mat_mul(C_nm, (0.0, -l[2], l[1], l[2], 0.0, -l[0], -l[1], l[0], 0.0))
    for a in range(3):
        R[a, a] = fix[3 + a] ** 2
        for b in range(3):
            H[a, b] = C_nm[3 * a + b]
            H[a, 6 + b] = -lx[3 * a + b]


@njit(cache=True)
def position_at_points(navs, ecef, l_b, fix, z, delta):
    """Innovation z (3,) of an antenna position at the first of navigation states (m, 10), and delta (m - 1, 3), the
    positions at the others less that at the first [m], north, east, down of each; `fix` as in
    :func:`linearize_position`. No checks are made.
    """
    first = _antenna(navs[0], ecef, l_b)[3]
    m = geodetic_to_ecef(fix[0], fix[1], fix[2])
    z[0], z[1], z[2] = mat_t_vec(dcm_en(fix[0], fix[1]), (m[0] - first[0], m[1] - first[1], m[2] - first[2]))
    for p in range(1, navs.shape[0]):
        r = _antenna(navs[p], ecef, l_b)[3]
        lat, lon, _ = ecef_to_geodetic(r[0], r[1], r[2])
        d = mat_t_vec(dcm_en(lat, lon), (r[0] - first[0], r[1] - first[1], r[2] - first[2]))
        delta[p - 1, 0], delta[p - 1, 1], delta[p - 1, 2] = d


@njit(cache=True)
def _antenna_velocity(nav, ecef, l_b, w_ib_b):
    C_mb, C_nm, l, _, C_en = _antenna(nav, ecef, l_b)
    wl = mat_vec(C_mb, cross((w_ib_b[0], w_ib_b[1], w_ib_b[2]), (l_b[0], l_b[1], l_b[2])))
    ie = (0.0, 0.0, EARTH_RATE)
    if not ecef:
        ie = mat_t_vec(C_en, ie)
    el = cross(ie, l)
    v = mat_vec(C_nm, (nav[3] + wl[0] - el[0], nav[4] + wl[1] - el[1], nav[5] + wl[2] - el[2]))
    return v, C_mb, C_nm, l, wl, ie


@njit(cache=True)
def predict_velocity(nav, ecef, l_b, w_ib_b):
    """Velocity relative to the Earth of an antenna, resolved in n, as a 3-tuple [m/s]. No checks are made."""
    return _antenna_velocity(nav, ecef, l_b, w_ib_b)[0]


@njit(cache=True)
def velocity_at_points(navs, ecef, l_b, rates, fix, z, delta):
    """Innovation z (3,) of an antenna velocity at the first of navigation states (m, 10) with rates (m, 6), and delta
    (m - 1, 3), the velocities at the others less that at the first [m/s]; `fix` as in :func:`linearize_velocity`. No
    checks are made.
    """
    first = predict_velocity(navs[0], ecef, l_b, rates[0])
    for i in range(3):
        z[i] = fix[i] - first[i]
    for p in range(1, navs.shape[0]):
        v = predict_velocity(navs[p], ecef, l_b, rates[p])
        for i in range(3):
            delta[p - 1, i] = v[i] - first[i]


@njit(cache=True)
def linearize_velocity(nav, ecef, l_b, w_ib_b, gyro_bias, gyro_scale, gyro_cross, fix, z, H, R):
    """Innovation (3,) of an antenna velocity, resolved in n [m/s], its matrix H (3, n) and covariance R (3, 3).

    v_a = v + C_mb (w_ib_b x l_b) - w_ie x C_mb l_b, hence with dw = -db_g - dM_g w

        dv_a = dv - [C_mb (w x l) x] psi + w_ie x [C_mb l x] psi - C_mb [l x] dw.

    `fix` (6,) holds the velocity and its deviations; `gyro_bias`, `gyro_scale` and `gyro_cross` are the first column of
    those states, or -1. Written into `z`, `H` and `R`, of which the last two must be zero before. No checks are made.
    """
    v, C_mb, C_nm, l, wl, ie = _antenna_velocity(nav, ecef, l_b, w_ib_b)
    for a in range(3):
        z[a] = fix[a] - v[a]
        R[a, a] = fix[3 + a] ** 2
    skew_wl = (0.0, -wl[2], wl[1], wl[2], 0.0, -wl[0], -wl[1], wl[0], 0.0)
    skew_ie = (0.0, -ie[2], ie[1], ie[2], 0.0, -ie[0], -ie[1], ie[0], 0.0)
    skew_l = (0.0, -l[2], l[1], l[2], 0.0, -l[0], -l[1], l[0], 0.0)
    coriolis = mat_mul(skew_ie, skew_l)
    tilt = (
        coriolis[0] - skew_wl[0],
        coriolis[1] - skew_wl[1],
        coriolis[2] - skew_wl[2],
        coriolis[3] - skew_wl[3],
        coriolis[4] - skew_wl[4],
        coriolis[5] - skew_wl[5],
        coriolis[6] - skew_wl[6],
        coriolis[7] - skew_wl[7],
        coriolis[8] - skew_wl[8],
    )
    tilt = mat_mul(C_nm, tilt)
    lb = (0.0, -l_b[2], l_b[1], l_b[2], 0.0, -l_b[0], -l_b[1], l_b[0], 0.0)
    rate = mat_mul(C_nm, mat_mul(C_mb, lb))
    for a in range(3):
        for b in range(3):
            H[a, 3 + b] = C_nm[3 * a + b]
            H[a, 6 + b] = tilt[3 * a + b]
            if gyro_bias >= 0:
                H[a, gyro_bias + b] = rate[3 * a + b]
            if gyro_scale >= 0:
                H[a, gyro_scale + b] = rate[3 * a + b] * w_ib_b[b]
        if gyro_cross >= 0:
            for j in range(6):
                row, column = CROSS_PAIRS[j]
                H[a, gyro_cross + j] = rate[3 * a + row] * w_ib_b[column]


class _GnssSensor(AidingSensor):
    log: GnssLog
    fixes: Array

    def __init__(self, log: GnssLog, lever_arm_b: Array, outages: OutageWindows, gate: float | None):
        self.lever_arm_b = np.asarray(lever_arm_b, dtype=float)
        self.outages = outages
        self.gate = gate
        self._take(log)

    def _take(self, log: GnssLog) -> None:
        raise NotImplementedError

    def extend(self, block: GnssLog) -> None:
        """Take in later fixes, as they arrive in a live run; feed them before the increments that pass their time."""
        self._take(self.log.joined(block))

    def withheld(self, k: int) -> bool:
        """True inside an outage window [from, to)."""
        return bool(self.outages) and any(start <= self.times[k] < end for start, end in self.outages)


class GnssPosition(_GnssSensor):
    """Position of the antenna.

    Parameters
    ----------
    log : GnssLog
    lever_arm_b : (3,) array [m]
        From the IMU to the antenna, in b.
    outages : tuple of (from, to) [s]
        Windows, half open, in which the fixes are withheld from the filter.
    gate : float or None
        See :class:`navfuse.aiding.AidingSensor`.

    Notes
    -----
    A value is latitude, longitude [rad] and height [m]; the difference of two values is in metres north, east, down.
    """

    name = "gnss_position"

    def __init__(
        self, log: GnssLog, lever_arm_b=(0.0, 0.0, 0.0), outages: OutageWindows = (), gate: float | None = None
    ):
        super().__init__(log, lever_arm_b, outages, gate)

    def _take(self, log: GnssLog) -> None:
        self.log = log
        self.times = log.time
        self.fixes = np.column_stack([log.lat, log.lon, log.height, log.sd_position])

    def value(self, k: int) -> Array:
        """Measured latitude, longitude [rad], height [m]."""
        return self.fixes[k, :3]

    def predict(self, nav: NavState, k: int) -> Array:
        """Latitude, longitude [rad], height [m] of the antenna."""
        return np.array(predict_position(nav.array, nav.ecef, self.lever_arm_b))

    def noise(self, k: int) -> Array:
        """Standard deviations north, east, down [m]."""
        return self.fixes[k, 3:]

    def subtract(self, measured: Array, predicted: Array) -> Array:
        """Difference [m] resolved in the north, east, down of the measured position."""
        C_en = np.array(dcm_en(measured[0], measured[1])).reshape(3, 3)
        return C_en.T @ (np.array(geodetic_to_ecef(*measured)) - np.array(geodetic_to_ecef(*predicted)))

    def linearize(self, nav: NavState, k: int) -> tuple[Array, Array, Array]:
        """See :class:`navfuse.aiding.AidingSensor`."""
        z, H, R = np.empty(3), np.zeros((3, nav.layout.size)), np.zeros((3, 3))
        linearize_position(nav.array, nav.ecef, self.lever_arm_b, self.fixes[k], z, H, R)
        return z, H, R

    def jacobian(self, nav: NavState, k: int) -> Array:
        """Matrix H (3, n)."""
        return self.linearize(nav, k)[1]

    def predict_points(self, navs: NavStates, k: int) -> tuple[Array, Array]:
        """See :class:`navfuse.aiding.AidingSensor`."""
        z, delta = np.empty(3), np.empty((len(navs) - 1, 3))
        position_at_points(navs.array, navs.ecef, self.lever_arm_b, self.fixes[k], z, delta)
        return delta, z


class GnssVelocity(_GnssSensor):
    """Velocity of the antenna relative to the Earth, resolved in n. Parameters as :class:`GnssPosition`.

    Fixes without a velocity are left out.
    """

    name = "gnss_velocity"

    def __init__(
        self, log: GnssLog, lever_arm_b=(0.0, 0.0, 0.0), outages: OutageWindows = (), gate: float | None = None
    ):
        super().__init__(log, lever_arm_b, outages, gate)

    def _take(self, log: GnssLog) -> None:
        if log.velocity_n is None or log.sd_velocity is None:
            raise InputError(f"{log.source}: has no velocities; use position only")
        self.log = log
        self.rows = np.flatnonzero(np.all(np.isfinite(log.velocity_n), axis=1))
        self.times = log.time[self.rows]
        self.fixes = np.column_stack([log.velocity_n, log.sd_velocity])[self.rows]

    def log_row(self, k: int) -> int:
        """Row in the log: fixes without a velocity are not counted in k."""
        return int(self.rows[k])

    def value(self, k: int) -> Array:
        """Measured velocity [m/s], north, east, down."""
        return self.fixes[k, :3]

    def predict(self, nav: NavState, k: int) -> Array:
        """Velocity [m/s] of the antenna, north, east, down."""
        return np.array(predict_velocity(nav.array, nav.ecef, self.lever_arm_b, nav.w_ib_b))

    def noise(self, k: int) -> Array:
        """Standard deviations [m/s], north, east, down."""
        return self.fixes[k, 3:]

    def linearize(self, nav: NavState, k: int) -> tuple[Array, Array, Array]:
        """See :class:`navfuse.aiding.AidingSensor`."""
        layout = nav.layout
        z, H, R = np.empty(3), np.zeros((3, layout.size)), np.zeros((3, 3))
        bias, scale, coupling = layout.find("gyro_bias"), layout.find("gyro_scale"), layout.find("gyro_cross")
        fix = self.fixes[k]
        linearize_velocity(nav.array, nav.ecef, self.lever_arm_b, nav.w_ib_b, bias, scale, coupling, fix, z, H, R)
        return z, H, R

    def jacobian(self, nav: NavState, k: int) -> Array:
        """Matrix H (3, n)."""
        return self.linearize(nav, k)[1]

    def predict_points(self, navs: NavStates, k: int) -> tuple[Array, Array]:
        """See :class:`navfuse.aiding.AidingSensor`."""
        z, delta = np.empty(3), np.empty((len(navs) - 1, 3))
        velocity_at_points(navs.array, navs.ecef, self.lever_arm_b, navs.rates, self.fixes[k], z, delta)
        return delta, z
