"""Algorithm 1: yaw from a magnetometer with two axes, and accelerations turned to north and east."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from navfuse.errors import InputError
from navfuse.planar.checks import rows_of

Array = np.ndarray


def magnetic_yaw(field_b: ArrayLike) -> Array:
    """Yaw of a level sensor against magnetic north.

    Parameters
    ----------
    field_b : (n, 2) or (n, 3) array-like
        Magnetic field along body x, y (and z, which is not used), in any unit. A row of NaN gives NaN.

    Returns
    -------
    (n,) array [rad]
        psi = atan2(-m_y, m_x), -pi < psi <= pi.

    Raises
    ------
    InputError
        For another shape, or a row in which both axes are zero.

    Notes
    -----
    The tutorial divides by the magnitude of both components first; an arc tangent of two arguments does not notice.
    A tilt of 1 deg costs 1 deg times the tangent of the dip: 2 deg where the field points down by 63 deg.
    """
    field = rows_of("field_b", field_b, (2, 3))
    zero = (field[:, 0] == 0.0) & (field[:, 1] == 0.0)
    if zero.any():
        raise InputError(
            f"field_b: row {int(np.argmax(zero)) + 1} is zero along x and y, which has no direction; leave such rows"
            " out"
        )
    return np.arctan2(0.0 - field[:, 1], field[:, 0])


def declination(field_n: ArrayLike) -> float:
    """Angle [rad] from true to magnetic north, positive to the east, of a field (3,) in north, east, down."""
    north, east = np.asarray(field_n, dtype=float)[:2]
    return float(np.arctan2(east, north))


def planar_dcm(yaw: ArrayLike) -> Array:
    """``C_nb`` in the plane: [[cos, -sin], [sin, cos]] of yaw [rad], shape (..., 2, 2)."""
    psi = np.asarray(yaw, dtype=float)
    c, s = np.cos(psi), np.sin(psi)
    return np.stack((np.stack((c, -s), axis=-1), np.stack((s, c), axis=-1)), axis=-2)


def to_north_east(accel_b: ArrayLike, yaw: ArrayLike) -> Array:
    """Accelerations along body x and y, turned to north and east.

    Parameters
    ----------
    accel_b : (n, 2) or (n, 3) array-like [m/s^2]
        Of a level vehicle these are specific forces too; z is not used.
    yaw : (n,) array-like [rad]

    Returns
    -------
    (n, 2) array [m/s^2]

    Raises
    ------
    InputError
        If the shapes do not fit.
    """
    accel = rows_of("accel_b", accel_b, (2, 3))
    psi = rows_of("yaw", yaw, (), len(accel))
    return np.einsum("nij,nj->ni", planar_dcm(psi), accel[:, :2])


def hard_iron(field_b: ArrayLike) -> Array:
    """Offset of a magnetometer that was turned through a full circle: centre of the circle that its readings draw.

    Parameters
    ----------
    field_b : (n, 2) or (n, 3) array-like
        As in :func:`magnetic_yaw`; rows with NaN are left out.

    Returns
    -------
    (2,) array
        To be subtracted from x and y, in the unit of the field.

    Raises
    ------
    InputError
        If the readings cover less than three quarters of a circle.

    Notes
    -----
    Least squares of x^2 + y^2 = 2 a x + 2 b y + c (Kasa, 1976), linear. The tutorial leaves this step to the sensor.
    """
    field = rows_of("field_b", field_b, (2, 3))[:, :2]
    field = field[np.isfinite(field).all(axis=1)]
    if len(field) < 8:
        raise InputError(f"field_b: {len(field)} rows are too few to fit a circle to")
    scale = float(np.abs(field).max()) or 1.0
    x, y = (field / scale).T
    (a, b, _), *_ = np.linalg.lstsq(np.column_stack((2.0 * x, 2.0 * y, np.ones_like(x))), x * x + y * y, rcond=None)
    centre = np.array([a, b]) * scale
    sectors = np.floor((np.arctan2(*(field - centre).T) + np.pi) / (2.0 * np.pi) * 8.0).astype(int) % 8
    if np.unique(sectors).size < 6:
        raise InputError(
            f"field_b: the readings lie in {np.unique(sectors).size} of 8 sectors of a circle; drive at least one full"
            " circle to find the offset"
        )
    return centre
