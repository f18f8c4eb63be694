"""Algorithm 2: yaw from gyro and magnetometer, a complementary filter on the direction cosine matrix in the plane."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from navfuse.errors import ConfigError, InputError
from navfuse.planar.checks import rows_of, times_of

Array = np.ndarray


def complementary_yaw(
    time: ArrayLike,
    gyro_z: ArrayLike,
    yaw: ArrayLike,
    gain: float = 1.0,
    *,
    method: Literal["exact", "euler"] = "exact",
    start: float | None = None,
) -> Array:
    """Yaw that follows the gyro at once and a measured yaw in the long run.

    Parameters
    ----------
    time : (n,) array-like [s]
        Strictly increasing.
    gyro_z : (n,) array-like [rad/s]
        Angular rate about body z (down), mean over the step that ends at `time`.
    yaw : (n,) array-like [rad]
        Measured yaw, as of Algorithm 1; NaN in rows without a measurement, over which the gyro alone is followed.
    gain : float [1/s]
        K_p: an error decays with 1 / K_p. The tutorial takes 1 or more; less believes the gyro longer.
    method : {"exact", "euler"}
        Rotation by Rodrigues' formula, or one Euler step with the matrix made orthonormal again.
    start : float [rad], optional
        Estimate in row 0; default the first measurement.

    Returns
    -------
    (n,) array [rad]
        In -pi..pi, after the step that ends at `time`.

    Raises
    ------
    InputError
        If the arrays do not fit together, or no yaw was ever measured.
    ConfigError
        If `gain` is not positive, or so high for the steps that the estimate would swing up.

    Notes
    -----
    With the estimate C' and the measured C of the step's begin::

        pi    = (C'^T C - C^T C') / 2          what is missing, resolved in the body
        Omega = [0 -w; w 0] + K_p pi
        C'   <- C' exp(Omega T)
        exp(Omega T) = I + sin(|Omega| T) Omega / |Omega| + (1 - cos(|Omega| T)) Omega^2 / |Omega|^2

    pi is antisymmetric with sin(yaw - estimate) as its element, so that the filter is blind half a turn away.
    Sources: NASA/TM-2015-218803, Algorithm 2; Mahony, Hamel and Pflimlin (2008), the passive filter in the plane.
    """
    t = times_of("time", time)
    rate = rows_of("gyro_z", gyro_z, (), t.size)
    psi = rows_of("yaw", yaw, (), t.size)
    if method not in ("exact", "euler"):
        raise ConfigError(f"method = {method!r} has to be 'exact' or 'euler'")
    longest = float(np.diff(t).max())
    check_gain("gain", gain, longest)
    if not np.isfinite(rate[1:]).all():
        raise InputError(f"gyro_z: row {int(np.argmin(np.isfinite(rate[1:]))) + 2} is not finite; leave such rows out")
    known = np.isfinite(psi)
    if start is None:
        if not known.any():
            raise InputError("yaw: no row holds a measurement; give the start")
        start = float(psi[np.argmax(known)])
    return _filter(t, rate, psi, float(gain), method == "exact", float(start))


def check_gain(name: str, gain: float, step: float) -> None:
    """Refuse a gain that is not positive, or with which an error would grow over a step [s]."""
    if not (np.isfinite(gain) and gain > 0.0):
        raise ConfigError(f"{name} = {gain} has to be positive; the tutorial takes 1 or more")
    if gain * step >= 2.0:
        raise ConfigError(
            f"{name} = {gain} and a longest step of {step:.3g} s: the estimate would swing up, their product has to be"
            " below 2, better below 0.5; lower it, or cut the log at its gaps"
        )


@njit(cache=True, error_model="numpy")
def _filter(time, rate, yaw, gain, exact, start):
    """The recursion, on cosine and sine of the estimate: first column of its matrix. No checks are made."""
    n = time.size
    out = np.empty(n)
    c, s = math.cos(start), math.sin(start)
    out[0] = math.atan2(s, c)
    for k in range(1, n):
        dt = time[k] - time[k - 1]
        omega = rate[k]
        if not math.isnan(yaw[k - 1]):
            # Element (2, 1) of pi: (C'^T C) with C' = [c -s; s c].
            omega += gain * (c * math.sin(yaw[k - 1]) - s * math.cos(yaw[k - 1]))
        if exact:
            cr, sr = math.cos(omega * dt), math.sin(omega * dt)
        else:
            cr, sr = 1.0, omega * dt
        c, s = c * cr - s * sr, s * cr + c * sr
        norm = math.hypot(c, s)
        c /= norm
        s /= norm
        out[k] = math.atan2(s, c)
    return out
