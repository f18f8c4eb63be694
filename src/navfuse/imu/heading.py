"""Heading of a levelled inertial sensor, from the motion that GNSS saw or from the Earth's rotation.

With the attitude integrated from the gyroscopes in a level frame L of unknown heading psi, horizontal velocity obeys,
in complex notation (north + i east, forward + i right),

    v(t) = v0 + exp(i psi) A(t) + c1 t + c2 t^2 / 2,      A(t) = integral of the level specific force

where c1 takes the error of the levelling and of the accelerometer biases and c2 its growth by gyro errors, both with
a prior. That is linear in the complex unknowns (v0, z, c1, c2), with z = exp(i psi) left free: its modulus comes out
near one when the axes and units of the sensor are right, which is a check. Positions take the integral of the same
equation. Nothing is assumed about the vehicle: it may slide, climb, hover or drive backwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from navfuse.core.constants import EARTH_RATE, STANDARD_GRAVITY
from navfuse.core.rotation import cross, quat_from_rotvec, quat_multiply, quat_normalize, quat_rotate
from navfuse.imu.increments import ImuIncrements

Array = np.ndarray


@njit(cache=True)
def integrate_level(inc_theta_b, inc_v_b, dt, q_lb, gyro_bias, lever_b, dv_l, lever_l, lever_rate_l):
    """Turn velocity increments into a level frame that follows the gyroscopes from a first attitude.

    Parameters
    ----------
    inc_theta_b, inc_v_b, dt : (k, 3), (k, 3), (k,) arrays
    q_lb : (4,) array
        Attitude against the level frame at the start of the first interval.
    gyro_bias : (3,) array [rad/s]
    lever_b : (3,) array [m]
    dv_l, lever_l, lever_rate_l : (k, 3) arrays
        Receive, per interval, the velocity increment, and at its end the lever arm and its velocity, in the level
        frame.

    Notes
    -----
    The level frame does not turn with the Earth (15 deg/h). No checks are made.
    """
    q = (q_lb[0], q_lb[1], q_lb[2], q_lb[3])
    for k in range(dt.size):
        tx = inc_theta_b[k, 0] - gyro_bias[0] * dt[k]
        ty = inc_theta_b[k, 1] - gyro_bias[1] * dt[k]
        tz = inc_theta_b[k, 2] - gyro_bias[2] * dt[k]
        u = (inc_v_b[k, 0], inc_v_b[k, 1], inc_v_b[k, 2])
        c = cross((tx, ty, tz), u)
        u = quat_rotate(q, (u[0] + 0.5 * c[0], u[1] + 0.5 * c[1], u[2] + 0.5 * c[2]))
        q = quat_normalize(quat_multiply(q, quat_from_rotvec((tx, ty, tz))))
        l = quat_rotate(q, (lever_b[0], lever_b[1], lever_b[2]))
        w = cross((tx / dt[k], ty / dt[k], tz / dt[k]), (lever_b[0], lever_b[1], lever_b[2]))
        w = quat_rotate(q, w)
        for i in range(3):
            dv_l[k, i] = u[i]
            lever_l[k, i] = l[i]
            lever_rate_l[k, i] = w[i]


@dataclass(frozen=True, slots=True)
class HeadingFit:
    """What a stretch of motion says about the heading at its start.

    Attributes
    ----------
    heading : float [rad]
    sd : float [rad]
        Enlarged where the residuals are larger than the sigmas of the fixes explain.
    modulus : float
        |z|; near 1 if the sensor's axes and units are right.
    sd_modulus : float
    tilt_n : (2,) array [rad]
        Rotation about north and east that corrects the levelling.
    sd_tilt : float [rad]
    """

    heading: float
    sd: float
    modulus: float
    sd_modulus: float
    tilt_n: Array
    sd_tilt: float


def fit_heading(
    increments: ImuIncrements,
    q_lb: Array,
    gyro_bias: Array,
    lever_b: Array,
    time: Array,
    horizontal: Array,
    sd: Array,
    positions: bool,
    sd_c1: float,
    sd_c2: float,
) -> HeadingFit | None:
    """Fit the heading to fixes.

    Parameters
    ----------
    increments : ImuIncrements
        Covering the fixes; the heading holds for their start.
    q_lb : (4,) array
        Levelled attitude there.
    gyro_bias, lever_b : (3,) arrays [rad/s], [m]
    time : (m,) array [s]
        Of the fixes, inside the increments.
    horizontal : (m, 2) array
        North and east velocity [m/s] or position [m] of the antenna.
    sd : (m,) array
        Their standard deviations.
    positions : bool
        Whether `horizontal` holds positions.
    sd_c1, sd_c2 : float [m/s^2], [m/s^3]
        Priors of the level acceleration error and its growth.

    Returns
    -------
    HeadingFit or None
        None if the fixes are fewer than the unknowns or nothing moved.
    """
    n = len(increments)
    if time.size < 6 or n < 2:
        return None
    dt = increments.dt
    dv, lever, lever_rate = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    integrate_level(increments.inc_theta_b, increments.inc_v_b, dt, q_lb, gyro_bias, lever_b, dv, lever, lever_rate)
    t = increments.time[1:] - increments.time[0]
    speed = np.cumsum(dv[:, 0] + 1j * dv[:, 1])
    if positions:
        previous = np.concatenate([[0.0], speed[:-1]])
        signal = np.cumsum(0.5 * dt * (previous + speed)) + lever[:, 0] + 1j * lever[:, 1]
    else:
        signal = speed + lever_rate[:, 0] + 1j * lever_rate[:, 1]
    tau = time - increments.time[0]
    A = np.interp(tau, t, signal.real) + 1j * np.interp(tau, t, signal.imag)
    y = horizontal[:, 0] + 1j * horizontal[:, 1]
    scale = 1.0 / sd
    if positions:
        columns = [np.ones_like(tau), tau, A, 0.5 * tau**2, tau**3 / 6.0]
    else:
        columns = [np.ones_like(tau), A, tau, 0.5 * tau**2]
    M = np.stack(columns, axis=1) * scale[:, None]
    iz = 2 if positions else 1
    prior = np.zeros((2, M.shape[1]))
    prior[0, -2] = 1.0 / sd_c1
    prior[1, -1] = 1.0 / sd_c2
    normal = M.conj().T @ M + prior.T @ prior
    if np.linalg.cond(normal) > 1e14:
        return None
    covariance = np.linalg.inv(normal)
    solution = covariance @ (M.conj().T @ (y * scale))
    residual = y * scale - M @ solution
    freedom = 2 * (time.size - M.shape[1] + 2)
    factor = np.sqrt(max(1.0, float(np.sum(np.abs(residual) ** 2)) / freedom))
    z = solution[iz]
    sd_z = float(np.sqrt(covariance[iz, iz].real)) * factor
    if abs(z) < 1e-6:
        return None
    c1 = solution[-2]
    sd_c = float(np.sqrt(covariance[-2, -2].real)) * factor
    return HeadingFit(
        heading=float(np.angle(z) % (2 * np.pi)),
        sd=sd_z / abs(z),
        modulus=float(abs(z)),
        sd_modulus=sd_z,
        tilt_n=np.array([c1.imag, -c1.real]) / STANDARD_GRAVITY,
        sd_tilt=sd_c / STANDARD_GRAVITY,
    )


def earth_rate_heading(mean_rate_b: Array, C_lb: Array, lat: float, sd_rate: float) -> tuple[float, float]:
    """Heading and its standard deviation [rad] from the mean angular rate at rest (gyrocompassing).

    The horizontal Earth rate points north: levelled, it reads w_ie cos(lat) exp(-i heading). `sd_rate` [rad/s] is
    what is left of bias and noise of the mean. Source: Groves 2013, section 5.6.2.
    """
    w = C_lb @ mean_rate_b
    return float(np.arctan2(-w[1], w[0]) % (2 * np.pi)), float(sd_rate / max(EARTH_RATE * np.cos(lat), 1e-12))
