"""Algorithm 3: two independent Kalman filters of position, velocity and acceleration, one north, one east."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from navfuse.core.linear import predict, update
from navfuse.errors import ConfigError, InputError
from navfuse.planar.checks import rows_of, times_of

Array = np.ndarray


@dataclass(frozen=True, slots=True)
class ChannelNoise:
    """What each of the two filters is told.

    Attributes
    ----------
    jerk : float [m/s^3/sqrt(Hz)]
        Density of the white noise that drives the acceleration: how much it may change between samples.
    accel : float [m/s^2]
        Standard deviation of a sample of the acceleration, with the errors of attitude that turning it brings.
    position : float [m]
    velocity : float [m/s]
        Of a GNSS fix.
    start_position, start_velocity, start_accel : float [m], [m/s], [m/s^2]
        Of the start.
    """

    jerk: float = 5.0
    accel: float = 0.5
    position: float = 1.0
    velocity: float = 0.1
    start_position: float = 10.0
    start_velocity: float = 10.0
    start_accel: float = 10.0

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ConfigError(f"{name} = {value} of the noise of the planar filter has to be positive")


@dataclass(frozen=True, slots=True, eq=False)
class PlanarTrack:
    """What the two filters estimate, north in column 0 and east in column 1.

    Attributes
    ----------
    time : (n,) array [s]
    position, velocity, accel : (n, 2) arrays [m], [m/s], [m/s^2]
    sd_position, sd_velocity : (n, 2) arrays
        Standard deviations that the filters claim.
    """

    time: Array
    position: Array
    velocity: Array
    accel: Array
    sd_position: Array
    sd_velocity: Array


def filter_positions(
    time: ArrayLike,
    accel: ArrayLike,
    fix_time: ArrayLike,
    fix_position: ArrayLike,
    fix_velocity: ArrayLike | None = None,
    noise: ChannelNoise | None = None,
) -> PlanarTrack:
    """Combine accelerations and GNSS fixes.

    Parameters
    ----------
    time : (n,) array-like [s]
        Of the accelerations, strictly increasing.
    accel : (n, 2) array-like [m/s^2]
        North and east, as :func:`~navfuse.planar.yaw.to_north_east` makes them. A row of NaN is not used.
    fix_time : (m,) array-like [s]
        Strictly increasing; same scale.
    fix_position : (m, 2) array-like [m]
        North and east.
    fix_velocity : (m, 2) array-like [m/s], optional
        NaN where a fix has none.
    noise : ChannelNoise, optional

    Returns
    -------
    PlanarTrack
        At every `time`, with all that was measured up to then.

    Raises
    ------
    InputError
        If the arrays do not fit together, or no fix lies in the time of the accelerations.

    Notes
    -----
    State (x, v, a), constant acceleration over a step T and a white jerk::

        Phi = [1 T T^2/2; 0 1 T; 0 0 1],  Q = q [T^5/20 T^4/8 T^3/6; . T^3/3 T^2/2; . . T]

    An acceleration is measured at each of its samples, position and velocity at the time of their fix. All of them are
    elements of the state, so that H is made of rows of the unit matrix. The tutorial updates with all three at once
    whenever GPS comes; here each comes at its own time, which is what fills the gaps between fixes. The start is that
    of the first fix. Source: NASA/TM-2015-218803, Algorithm 3, whose Q is not stated.
    """
    told = ChannelNoise() if noise is None else noise
    t = times_of("time", time)
    a = rows_of("accel", accel, (2,), t.size)
    ft = times_of("fix_time", fix_time)
    fx = rows_of("fix_position", fix_position, (2,), ft.size)
    fv = np.full_like(fx, np.nan) if fix_velocity is None else rows_of("fix_velocity", fix_velocity, (2,), ft.size)
    inside = (ft >= t[0]) & (ft <= t[-1]) & np.isfinite(fx).all(axis=1)
    if not inside.any():
        raise InputError(
            f"no fix ({ft[0]:.3f}..{ft[-1]:.3f} s) lies in the time of the accelerations ({t[0]:.3f}..{t[-1]:.3f} s):"
            " are both on one scale?"
        )
    ft, fx, fv = ft[inside], fx[inside], fv[inside]
    sd = np.array([told.position, told.velocity, told.accel])
    start_sd = np.array([told.start_position, told.start_velocity, told.start_accel])
    out, spread = np.empty((t.size, 2, 3)), np.empty((t.size, 2, 2))
    for channel in range(2):
        start = np.array([fx[0, channel], 0.0 if np.isnan(fv[0, channel]) else fv[0, channel], 0.0])
        _channel(
            t, a[:, channel], ft, fx[:, channel], fv[:, channel], told.jerk**2, sd**2, start, start_sd**2,
            out[:, channel], spread[:, channel],
        )  # fmt: skip
    return PlanarTrack(t, out[..., 0], out[..., 1], out[..., 2], spread[..., 0], spread[..., 1])


@njit(cache=True, error_model="numpy")
def _channel(time, accel, fix_time, fix_position, fix_velocity, q, variance, start, start_variance, out, spread):
    """One filter; fills `out` (n, 3) and `spread` (n, 2). No checks are made."""
    x, P = start.copy(), np.diag(start_variance)
    Phi, Q = np.eye(3), np.empty((3, 3))
    H, R, z = np.zeros((1, 3)), np.empty((1, 1)), np.empty(1)
    now, fix = time[0], 0
    for k in range(time.size):
        while True:
            is_fix = fix < fix_time.size and fix_time[fix] <= time[k]
            at = fix_time[fix] if is_fix else time[k]
            T = at - now
            if T > 0.0:
                Phi[0, 1], Phi[0, 2], Phi[1, 2] = T, 0.5 * T * T, T
                Q[0, 0], Q[0, 1], Q[0, 2] = q * T**5 / 20.0, q * T**4 / 8.0, q * T**3 / 6.0
                Q[1, 1], Q[1, 2], Q[2, 2] = q * T**3 / 3.0, q * T**2 / 2.0, q * T
                Q[1, 0], Q[2, 0], Q[2, 1] = Q[0, 1], Q[0, 2], Q[1, 2]
                predict(x, P, Phi, Q)
                now = at
            for state in range(3):
                if is_fix:
                    value = fix_position[fix] if state == 0 else fix_velocity[fix] if state == 1 else np.nan
                else:
                    value = accel[k] if state == 2 else np.nan
                if not np.isnan(value):
                    H[:] = 0.0
                    H[0, state] = 1.0
                    R[0, 0] = variance[state]
                    z[0] = value - x[state]
                    update(x, P, z, H, R, np.inf)
            if not is_fix:
                break
            fix += 1
        out[k] = x
        spread[k, 0], spread[k, 1] = np.sqrt(P[0, 0]), np.sqrt(P[1, 1])
