"""Whether what is fed to the planar algorithms can be what it is called."""

from __future__ import annotations

from math import degrees

import numpy as np
from numpy.typing import ArrayLike

from navfuse.errors import InputError

Array = np.ndarray

MIN_TURN = np.pi / 2.0
"""Turning [rad] in all, back and forth, in strides of 5 deg and more, below which yaw and gyro cannot be compared."""
_STRIDE = 0.5
_LEAST = np.radians(5.0)
_FAR = 3.0


def rows_of(name: str, values: ArrayLike, widths: tuple[int, ...], length: int | None = None) -> Array:
    """An array of floats of one of these widths (none for one dimension), checked.

    Raises
    ------
    InputError
        For another shape or length.
    """
    array = np.asarray(values, dtype=float)
    fits = array.ndim == 1 if not widths else array.ndim == 2 and array.shape[1] in widths
    if not fits or (length is not None and len(array) != length):
        count = "n" if length is None else str(length)
        wanted = " or ".join(f"({count}, {width})" for width in widths) or f"({count},)"
        raise InputError(f"{name} has shape {array.shape}; it has to be {wanted}")
    return array


def times_of(name: str, values: ArrayLike) -> Array:
    """Times that increase strictly.

    Raises
    ------
    InputError
        Otherwise.
    """
    time = rows_of(name, values, ())
    if time.size < 2 or not np.isfinite(time).all():
        raise InputError(f"{name}: at least two finite times are needed, there are {time.size}")
    step = np.diff(time)
    if not (step > 0.0).all():
        row = int(np.argmin(step > 0.0)) + 1
        raise InputError(
            f"{name}: row {row + 1} ({time[row]:.9g} s) is not later than the row before ({time[row - 1]:.9g} s); sort"
            " the log and leave repeated rows out"
        )
    return time


def check_yaw_against_gyro(time: ArrayLike, gyro_z: ArrayLike, yaw: ArrayLike) -> float | None:
    """Make sure that a measured yaw turns as the gyro says.

    Parameters
    ----------
    time : (n,) array-like [s]
    gyro_z : (n,) array-like [rad/s]
        Angular rate about body z, down.
    yaw : (n,) array-like [rad]
        Clockwise from above; may be NaN in rows without a measurement.

    Returns
    -------
    float or None
        What yaw turns for every radian that the gyro turns, about 1; None where the vehicle turned less than
        :data:`MIN_TURN`.

    Raises
    ------
    InputError
        If yaw turns against the gyro, or one of the two is in degrees.

    Notes
    -----
    Slope of a line through zero, yaw against gyro, from the second moments of both, over strides of half a second in
    which the gyro turned by 5 deg or more: a straight road tells nothing.
    """
    t = times_of("time", time)
    rate = rows_of("gyro_z", gyro_z, (), t.size)
    psi = rows_of("yaw", yaw, (), t.size)
    known = np.isfinite(psi) & np.isfinite(rate)
    if np.count_nonzero(known) < 2:
        return None
    turned = np.concatenate(([0.0], np.cumsum(0.5 * (rate[known][1:] + rate[known][:-1]) * np.diff(t[known]))))
    # Yaw in degrees has to be unwrapped as such, else it is torn to pieces.
    turn = 360.0 if np.abs(psi[known]).max() > _FAR * np.pi else 2.0 * np.pi
    grid = np.arange(t[known][0], t[known][-1], _STRIDE)
    by_gyro = np.diff(np.interp(grid, t[known], turned))
    by_yaw = np.diff(np.interp(grid, t[known], np.unwrap(psi[known], period=turn)))
    turning = np.abs(by_gyro) > _LEAST
    by_gyro, by_yaw = by_gyro[turning], by_yaw[turning]
    if np.abs(by_gyro).sum() < MIN_TURN:
        return None
    if np.abs(by_yaw).sum() == 0.0:
        raise InputError("yaw stands still while the gyro turns; is it the column of another sensor?")
    sense = float(np.sum(by_gyro * by_yaw))
    ratio = float(np.sqrt(np.sum(by_yaw**2) / np.sum(by_gyro**2))) * (1.0 if sense >= 0.0 else -1.0)
    correlation = abs(sense) / float(np.sqrt(np.sum(by_yaw**2) * np.sum(by_gyro**2)))
    if correlation < 0.5:
        raise InputError(
            f"yaw and gyro do not turn together (correlation {correlation:.2f} over strides of {_STRIDE} s): the"
            " magnetometer is disturbed, another axis than z is the gyro's, or the times do not belong together"
        )
    if ratio < 0.0:
        raise InputError(
            f"yaw turns against the gyro ({ratio:.2f} rad of yaw for every rad): an axis of the magnetometer or the"
            " gyro is inverted, or z points up; both have to be forward, right, down"
        )
    if ratio > 0.3 * degrees(1.0):
        raise InputError(f"yaw turns {ratio:.1f} times as far as the gyro: it is in degrees; give radians")
    if ratio < 1.0 / (0.3 * degrees(1.0)):
        raise InputError(f"yaw turns {ratio:.3f} times as far as the gyro: gyro_z is in deg/s; give rad/s")
    return ratio
