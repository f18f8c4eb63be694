"""The navigation state that aiding sensors see, and the one function that corrects it."""

from __future__ import annotations

import numpy as np
from numba import njit

from navfuse.core.constants import EARTH_RATE
from navfuse.core.earth import dcm_en, ecef_to_geodetic, geodetic_to_ecef
from navfuse.core.kalman import reset_attitude
from navfuse.core.rotation import (
    dcm_from_quat,
    euler_from_quat,
    mat_mul,
    mat_t_mul,
    mat_t_vec,
    mat_vec,
    quat_conjugate,
    quat_from_dcm,
    quat_from_rotvec,
    quat_multiply,
    quat_normalize,
    rotvec_from_quat,
)
from navfuse.data.layout import CROSS_PAIRS, NAVIGATION_STATES, Layout

Array = np.ndarray


@njit(cache=True)
def boxplus_navigation(nav, d, ecef):
    """Apply a navigation error to a navigation state, in place.

    Parameters
    ----------
    nav : (10,) array
        NED (latitude, longitude, height, v_n, q_nb) or ECEF (r_e, v_e, q_eb).
    d : (9,) array
        Position [m], velocity [m/s] and attitude [rad] error, true minus estimate, resolved in n or e of the estimate.
    ecef : bool

    Notes
    -----
    In NED the corrected position has a north-east-down frame of its own; velocity and attitude are turned into
    it, so that the function is exact for corrections of any size. No checks are made.
    """
    dq = quat_from_rotvec((d[6], d[7], d[8]))
    q = quat_normalize(quat_multiply(dq, (nav[6], nav[7], nav[8], nav[9])))
    v = (nav[3] + d[3], nav[4] + d[4], nav[5] + d[5])
    if ecef:
        for i in range(3):
            nav[i] += d[i]
            nav[3 + i] = v[i]
        for i in range(4):
            nav[6 + i] = q[i]
        return
    C_en = dcm_en(nav[0], nav[1])
    r = geodetic_to_ecef(nav[0], nav[1], nav[2])
    dr = mat_vec(C_en, (d[0], d[1], d[2]))
    nav[0], nav[1], nav[2] = ecef_to_geodetic(r[0] + dr[0], r[1] + dr[1], r[2] + dr[2])
    turn = mat_t_mul(dcm_en(nav[0], nav[1]), C_en)
    v = mat_vec(turn, v)
    q = quat_normalize(quat_multiply(quat_from_dcm(turn), q))
    for i in range(3):
        nav[3 + i] = v[i]
    for i in range(4):
        nav[6 + i] = q[i]


@njit(cache=True, error_model="numpy")
def boxminus_navigation(nav, reference, ecef, d):
    """Error of a navigation state against a reference: what :func:`boxplus_navigation` takes the reference to it with.

    Parameters
    ----------
    nav, reference : (10,) arrays
        NED or ECEF.
    ecef : bool
    d : (9,) array
        Receives position [m], velocity [m/s] and attitude [rad] of `nav` less those of `reference`, resolved in n or e
        of the reference.

    Notes
    -----
    The attitude is at most half a turn. No checks are made.
    """
    q_reference = quat_conjugate((reference[6], reference[7], reference[8], reference[9]))
    q = (nav[6], nav[7], nav[8], nav[9])
    if ecef:
        for i in range(6):
            d[i] = nav[i] - reference[i]
    else:
        C_en = dcm_en(reference[0], reference[1])
        turn = mat_t_mul(C_en, dcm_en(nav[0], nav[1]))
        r = geodetic_to_ecef(nav[0], nav[1], nav[2])
        r0 = geodetic_to_ecef(reference[0], reference[1], reference[2])
        d[0], d[1], d[2] = mat_t_vec(C_en, (r[0] - r0[0], r[1] - r0[1], r[2] - r0[2]))
        v = mat_vec(turn, (nav[3], nav[4], nav[5]))
        for i in range(3):
            d[3 + i] = v[i] - reference[3 + i]
        q = quat_multiply(quat_from_dcm(turn), q)
    d[6], d[7], d[8] = rotvec_from_quat(quat_multiply(q, q_reference))


@njit(cache=True)
def to_ecef(nav):
    """ECEF navigation array (r_e, v_e, q_eb) of an NED one. No checks are made."""
    out = np.empty(10)
    C_en = dcm_en(nav[0], nav[1])
    out[0], out[1], out[2] = geodetic_to_ecef(nav[0], nav[1], nav[2])
    out[3], out[4], out[5] = mat_vec(C_en, (nav[3], nav[4], nav[5]))
    q = quat_multiply(quat_from_dcm(C_en), (nav[6], nav[7], nav[8], nav[9]))
    out[6], out[7], out[8], out[9] = quat_normalize(q)
    return out


@njit(cache=True)
def to_ned(nav):
    """NED navigation array (latitude, longitude, height, v_n, q_nb) of an ECEF one. No checks are made."""
    out = np.empty(10)
    out[0], out[1], out[2] = ecef_to_geodetic(nav[0], nav[1], nav[2])
    C_en = dcm_en(out[0], out[1])
    out[3], out[4], out[5] = mat_t_vec(C_en, (nav[3], nav[4], nav[5]))
    C_eb = dcm_from_quat((nav[6], nav[7], nav[8], nav[9]))
    out[6], out[7], out[8], out[9] = quat_from_dcm(
        mat_mul((C_en[0], C_en[3], C_en[6], C_en[1], C_en[4], C_en[7], C_en[2], C_en[5], C_en[8]), C_eb)
    )
    return out


_SENSOR_BLOCKS = ("gyro_bias", "gyro_scale", "gyro_cross", "accel_bias", "accel_scale", "accel_cross")


def sensor_offsets(layout: Layout) -> Array:
    """Where the gyro's and the accelerometer's biases, scale factors and couplings begin in a layout, (6,) int array;
    -1 for what it has not.
    """
    return np.array([layout.find(name) for name in _SENSOR_BLOCKS])


@njit(cache=True)
def correct_rates(rates, d, offsets):
    """Correct angular rate and specific force (6,) for a change `d` (n,) of the estimated sensor errors, in place.

    dw = -db_g - M_g w, df = -db_a - M_a f, to first order in the scale and coupling errors. `offsets` comes from
    :func:`sensor_offsets`. No checks are made.
    """
    for sensor in range(2):
        bias, scale, coupling = offsets[3 * sensor], offsets[3 * sensor + 1], offsets[3 * sensor + 2]
        at = 3 * sensor
        before = (rates[at], rates[at + 1], rates[at + 2])
        for i in range(3):
            if bias >= 0:
                rates[at + i] -= d[bias + i]
            if scale >= 0:
                rates[at + i] -= d[scale + i] * before[i]
        if coupling >= 0:
            for k in range(6):
                row, column = CROSS_PAIRS[k]
                rates[at + row] -= d[coupling + k] * before[column]


@njit(cache=True)
def apply_correction(nav, states, rates, P, d, offsets, ecef):
    """Apply an error estimate to all that a filter carries, in place.

    Parameters
    ----------
    nav : (10,) array
        Navigation state, NED or ECEF.
    states : (n - 9,) array
        Estimates of the states after the ninth.
    rates : (6,) array
        Angular rate [rad/s] and specific force [m/s^2].
    P : (n, n) array
        Covariance of the errors, turned with the attitude: see :func:`navfuse.core.kalman.reset_attitude`.
    d : (n,) array
        Error estimate.
    offsets : (6,) int array
        From :func:`sensor_offsets`.
    ecef : bool

    Notes
    -----
    No checks are made.
    """
    boxplus_navigation(nav, d, ecef)
    for i in range(states.size):
        states[i] += d[9 + i]
    correct_rates(rates, d, offsets)
    reset_attitude(P, d[6:9])


class NavState:
    """Position, velocity, attitude and estimated sensor states at one moment, in whichever frame the filter works.

    Everything a sensor may need is a property, computed when asked for. Aiding sensors read it; only :meth:`boxplus`
    changes it, and that returns a new state.

    Attributes
    ----------
    time : float [s]
    array : (10,) array
        NED: latitude, longitude [rad], height [m], v_n [m/s], q_nb. ECEF: r_e [m], v_e [m/s], q_eb.
    ecef : bool
    states : (n - 9,) array
        Estimates of the states after the ninth, in the order of `layout`.
    w_ib_b, f_b : (3,) arrays [rad/s], [m/s^2]
        Angular rate and specific force, corrected for the estimated sensor errors, mean over the last inertial
        interval.
    layout : Layout
    """

    __slots__ = ("_ned", "array", "ecef", "f_b", "layout", "states", "time", "w_ib_b")

    def __init__(self, time: float, array: Array, ecef: bool, states: Array, layout: Layout, w_ib_b: Array, f_b: Array):
        self.time = time
        self.array = array
        self.ecef = ecef
        self.states = states
        self.layout = layout
        self.w_ib_b = w_ib_b
        self.f_b = f_b
        self._ned: Array | None = None

    @property
    def ned(self) -> Array:
        """(10,) array: latitude, longitude [rad], height [m], v_n [m/s], q_nb."""
        if self._ned is None:
            self._ned = to_ned(self.array) if self.ecef else self.array
        return self._ned

    @property
    def lat(self) -> float:
        """Geodetic latitude [rad]."""
        return float(self.ned[0])

    @property
    def lon(self) -> float:
        """Longitude [rad]."""
        return float(self.ned[1])

    @property
    def height(self) -> float:
        """Ellipsoidal height [m]."""
        return float(self.ned[2])

    @property
    def v_n(self) -> Array:
        """Velocity relative to the Earth [m/s], north, east, down."""
        return self.ned[3:6]

    @property
    def C_nb(self) -> Array:
        """(3, 3) rotation from b to n."""
        return np.array(dcm_from_quat(self.ned[6:10])).reshape(3, 3)

    @property
    def C_en(self) -> Array:
        """(3, 3) rotation from n to e."""
        return np.array(dcm_en(self.ned[0], self.ned[1])).reshape(3, 3)

    @property
    def r_e(self) -> Array:
        """ECEF position [m]."""
        return self.array[:3] if self.ecef else np.array(geodetic_to_ecef(self.array[0], self.array[1], self.array[2]))

    @property
    def v_e(self) -> Array:
        """Velocity relative to the Earth [m/s], resolved in e."""
        return self.array[3:6] if self.ecef else self.C_en @ self.array[3:6]

    @property
    def C_eb(self) -> Array:
        """(3, 3) rotation from b to e."""
        return np.array(dcm_from_quat(self.array[6:10])).reshape(3, 3) if self.ecef else self.C_en @ self.C_nb

    @property
    def C_nm(self) -> Array:
        """(3, 3) rotation from the frame the errors are resolved in (n or e) to n."""
        return self.C_en.T if self.ecef else np.eye(3)

    @property
    def w_eb_b(self) -> Array:
        """Angular rate of the body relative to the Earth [rad/s]."""
        return self.w_ib_b - self.C_eb[2] * EARTH_RATE

    def state(self, name: str) -> Array:
        """Estimate of a named block of states after the ninth, e.g. ``"gyro_bias"``; KeyError if the filter has
        none.
        """
        where = self.layout.slice(name)
        return self.states[where.start - NAVIGATION_STATES : where.stop - NAVIGATION_STATES]

    def boxplus(self, delta: Array) -> NavState:
        """The state corrected by an error vector (n,), true minus estimate, in the order of `layout`."""
        array = self.array.copy()
        boxplus_navigation(array, delta, self.ecef)
        rates = np.concatenate([self.w_ib_b, self.f_b])
        correct_rates(rates, delta, sensor_offsets(self.layout))
        states = self.states + delta[NAVIGATION_STATES:]
        return NavState(self.time, array, self.ecef, states, self.layout, rates[:3], rates[3:])


class NavStates:
    """Several navigation states of one moment, row by row; item k is a :class:`NavState` that looks into them.

    Attributes
    ----------
    time : float [s]
    array : (m, 10) array
    ecef : bool
    states : (m, n - 9) array
    layout : Layout
    rates : (m, 6) array
        Angular rate [rad/s] and specific force [m/s^2].
    """

    __slots__ = ("array", "ecef", "layout", "rates", "states", "time")

    def __init__(self, time: float, array: Array, ecef: bool, states: Array, layout: Layout, rates: Array):
        self.time = time
        self.array = array
        self.ecef = ecef
        self.states = states
        self.layout = layout
        self.rates = rates

    def __len__(self) -> int:
        return len(self.array)

    def __getitem__(self, k: int) -> NavState:
        rate = self.rates[k]
        return NavState(self.time, self.array[k], self.ecef, self.states[k], self.layout, rate[:3], rate[3:])


@njit(cache=True)
def describe_rows(nav, d, P, ecef, out):
    """Corrected navigation states as people read them, with standard deviations.

    Parameters
    ----------
    nav : (r, 10) array
        Navigation states, NED or ECEF.
    d : (r, 9+) array
        Error estimates to apply first (zero in a closed loop).
    P : (r, 9, 9+) array
        Covariance of the navigation errors; only the first nine columns are read.
    ecef : bool
    out : (r, 18) array
        Receives latitude, longitude [rad], height [m], v_n [m/s], roll, pitch, heading [rad], then the standard
        deviations of position north, east, down [m], velocity [m/s], roll, pitch, heading [rad].

    Notes
    -----
    The small rotation psi resolved in n changes pitch by -sin(heading) psi_N + cos(heading) psi_E, roll by
    (cos(heading) psi_N + sin(heading) psi_E) / cos(pitch) and heading by psi_D + sin(pitch) times the change of roll.
    Standard deviations of angles are capped at pi/sqrt(3), that of an angle of which nothing is known. No checks are
    made.
    """
    cap = np.pi / np.sqrt(3.0)
    J = np.zeros((9, 9))
    work = np.empty(10)
    error = np.empty(9)
    for row in range(nav.shape[0]):
        for i in range(10):
            work[i] = nav[row, i]
        moved = False
        for i in range(9):
            error[i] = d[row, i]
            moved = moved or error[i] != 0.0
        if moved:
            boxplus_navigation(work, error, ecef)
        ned = to_ned(work) if ecef else work
        roll, pitch, heading = euler_from_quat((ned[6], ned[7], ned[8], ned[9]))
        for i in range(6):
            out[row, i] = ned[i]
        out[row, 6] = roll
        out[row, 7] = pitch
        out[row, 8] = heading
        s, c = np.sin(heading), np.cos(heading)
        cp = max(np.cos(pitch), 1e-9)
        sp = np.sin(pitch)
        A = (c / cp, s / cp, 0.0, -s, c, 0.0, sp * c / cp, sp * s / cp, 1.0)
        if ecef:
            C = dcm_en(ned[0], ned[1])
            C = (C[0], C[3], C[6], C[1], C[4], C[7], C[2], C[5], C[8])
            A = mat_mul(A, C)
        else:
            C = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
        for i in range(3):
            for j in range(3):
                J[i, j] = C[3 * i + j]
                J[3 + i, 3 + j] = C[3 * i + j]
                J[6 + i, 6 + j] = A[3 * i + j]
        for block in range(3):
            for i in range(3 * block, 3 * block + 3):
                v = 0.0
                for j in range(3 * block, 3 * block + 3):
                    for k in range(3 * block, 3 * block + 3):
                        v += J[i, j] * P[row, j, k] * J[i, k]
                v = np.sqrt(max(v, 0.0))
                out[row, 9 + i] = min(v, cap) if block == 2 else v
