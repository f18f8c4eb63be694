"""What an ideal inertial measurement unit reads along a motion.

Increments are the plain integrals of angular rate and specific force over each sampling interval, as an integrating
gyro and accelerometer fixed to the body give them; nothing here inverts a mechanization, so that mechanizing them again
tests both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from navfuse.data.logs import ImuLog
from navfuse.errors import ConfigError, InputError
from navfuse.simulation.motion_kernels import integrate_imu

if TYPE_CHECKING:
    from navfuse.simulation.motion import Motion

Array = np.ndarray

_MAX_PANEL = 0.02
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


def sample_times(start: float, end: float, rate: float, offset: float = 0.0) -> Array:
    """Regular stamps ``start + offset + k / rate`` up to and including `end`.

    Parameters
    ----------
    start, end : float [s]
    rate : float [Hz]
    offset : float [s]

    Raises
    ------
    ConfigError
        For a rate that is not positive and finite.
    """
    if not 0.0 < rate < np.inf:
        raise ConfigError(f"a sampling rate must be positive and finite, not {rate!r}")
    count = int(np.floor((end - start - offset) * rate * (1.0 + 1e-12) + 1e-9)) + 1
    return np.minimum(start + offset + np.arange(max(count, 0)) / rate, end)


def perfect_imu(motion: Motion, time: Array, kind: Literal["rates", "increments"] = "increments") -> ImuLog:
    """An error-free IMU log.

    Parameters
    ----------
    motion : Motion
    time : (n,) array [s]
        Strictly increasing stamps within the motion, any spacing.
    kind : {"rates", "increments"}
        Rates are the instantaneous values at the stamps; increments are integrals over (time[k-1], time[k]].

    Returns
    -------
    ImuLog
        In body axes. Row 0 of increments covers nothing known; it is the rate at the first stamp times the first
        interval.

    Raises
    ------
    InputError
        For fewer than two stamps, stamps that do not increase, or stamps outside the motion.
    ConfigError
        For another kind.

    Notes
    -----
    Gauss-Legendre quadrature of order 8 on panels of at most 20 ms. At 100 Hz and above the error is
    rounding for anything that moves slower than about 30 Hz.
    """
    if kind not in ("rates", "increments"):
        raise ConfigError(f"an IMU log holds 'rates' or 'increments', not {kind!r}")
    time = np.ascontiguousarray(time, dtype=float)
    if time.size < 2 or np.any(np.diff(time) <= 0.0):
        raise InputError("an IMU log needs at least two stamps, and they must increase")
    motion.require(time)
    if kind == "rates":
        state = motion.at(time)
        return ImuLog(time, state.w_ib_b, state.f_b, "rates", source="simulation")
    inc_theta_b, inc_v_b = np.empty((time.size, 3)), np.empty((time.size, 3))
    integrate_imu(
        motion.knots, motion.coefficients, motion.origin, time, _NODES, _WEIGHTS, _MAX_PANEL, inc_theta_b, inc_v_b
    )
    inc_theta_b[0] = motion.w_ib_b(time[0]) * (time[1] - time[0])
    inc_v_b[0] = motion.f_b(time[0]) * (time[1] - time[0])
    return ImuLog(time, inc_theta_b, inc_v_b, "increments", source="simulation")
