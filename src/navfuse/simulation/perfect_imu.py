"""What an ideal inertial measurement unit reads along a motion.

Increments come in two forms. ``"integrals"`` are the plain integrals of angular rate and specific force over each
sampling interval, as an integrating gyro and accelerometer fixed to the body give them; nothing of a mechanization is
in them, so that mechanizing them again tests both, and shows the integration error of the engine. ``"inverse"`` are the
increments that the engine's own steps turn back into the motion: no sensor gives them, but a study that uses them
has no integration error in it, at any rate and however wild the motion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from navfuse.data.logs import ImuLog
from navfuse.errors import ConfigError, InputError
from navfuse.simulation.bounds import require_rows
from navfuse.simulation.inverse_imu import invert_mechanization
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
        For a rate that is not positive and finite, or more rows than :data:`~navfuse.simulation.bounds.MOST_ROWS`.
    """
    if not 0.0 < rate < np.inf:
        raise ConfigError(f"a sampling rate must be positive and finite, not {rate!r}")
    require_rows((end - start - offset) * rate, f"{end - start:g} s at {rate:g} Hz")
    count = int(np.floor((end - start - offset) * rate * (1.0 + 1e-12) + 1e-9)) + 1
    return np.minimum(start + offset + np.arange(max(count, 0)) / rate, end)


def perfect_imu(
    motion: Motion,
    time: Array,
    kind: Literal["rates", "increments"] = "increments",
    form: Literal["integrals", "inverse"] = "integrals",
) -> ImuLog:
    """An error-free IMU log.

    Parameters
    ----------
    motion : Motion
    time : (n,) array [s]
        Strictly increasing stamps within the motion, any spacing.
    kind : {"rates", "increments"}
        Rates are the instantaneous values at the stamps; increments are over (time[k-1], time[k]].
    form : {"integrals", "inverse"}
        Of increments: what a physical sensor gives, or what the ECEF mechanization, begun at ``time[0]`` on the motion,
        turns back into its velocity and attitude at every stamp. See the notes.

    Returns
    -------
    ImuLog
        In body axes. Row 0 of increments covers nothing known; it is the rate at the first stamp times the first
        interval.

    Raises
    ------
    InputError
        For fewer than two stamps, stamps that do not increase, or stamps outside the motion; for the inverse also where
        the engine would take a long interval for missing rows.
    ConfigError
        For another kind or form, or the inverse of rates.

    Notes
    -----
    *Integrals*: Gauss-Legendre quadrature of order 8 on panels of at most 20 ms. At 100 Hz and above the error is
    rounding for anything that moves slower than about 30 Hz.

    *Inverse*: velocity and attitude come back to rounding in the ECEF mechanization, and in the NED one to what the two
    differ by. The position follows from the velocities by the trapezoid, and nothing is left to choose: at equal, short
    intervals it is off by ``dt^2/12`` times the acceleration gained since the start. The increments have to be used
    from the first row on and with no interval taken for a gap. There is no inverse of rates: each increment is made of
    the sum of two neighbours, so each rate would mirror the one before, and a kink of the motion rings on from sample
    to sample without end (in the foot of a walker at 100 Hz up to 0.24 deg/s while it stands).
    """
    if kind not in ("rates", "increments"):
        raise ConfigError(f"an IMU log holds 'rates' or 'increments', not {kind!r}")
    if form not in ("integrals", "inverse"):
        raise ConfigError(f"perfect increments are 'integrals' or 'inverse', not {form!r}")
    time = np.ascontiguousarray(time, dtype=float)
    if time.size < 2 or np.any(np.diff(time) <= 0.0):
        raise InputError("an IMU log needs at least two stamps, and they must increase")
    motion.require(time)
    if kind == "rates":
        if form == "inverse":
            raise ConfigError(
                "the mechanization cannot be inverted for rates: each would mirror the one before and ring without "
                "end; ask for increments, or for the integrals form, which gives the true rates"
            )
        state = motion.at(time)
        return ImuLog(time, state.w_ib_b, state.f_b, "rates", source="simulation")
    inc_theta_b, inc_v_b = np.empty((time.size, 3)), np.empty((time.size, 3))
    inc_theta_b[0] = motion.w_ib_b(time[0]) * (time[1] - time[0])
    inc_v_b[0] = motion.f_b(time[0]) * (time[1] - time[0])
    path = motion.knots, motion.coefficients, motion.origin
    if form == "integrals":
        integrate_imu(*path, time, _NODES, _WEIGHTS, _MAX_PANEL, inc_theta_b, inc_v_b)
    else:
        row = invert_mechanization(*path, time, inc_theta_b, inc_v_b)
        if row:
            raise InputError(
                f"the increment over ({time[row - 1]:g} s, {time[row]:g} s] looks like one behind missing rows, its "
                "interval being longer than the one before and the specific force smaller; give stamps whose spacing "
                "changes by less than half"
            )
    return ImuLog(time, inc_theta_b, inc_v_b, "increments", source="simulation")
