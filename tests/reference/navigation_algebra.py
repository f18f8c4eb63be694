"""Navigation states and their errors in exact Earth-fixed algebra: NumPy and SciPy rotations only, nothing of navfuse.

A navigation array holds latitude, longitude [rad], height [m], v_n [m/s], q_nb (NED) or r_e, v_e, q_eb (ECEF). An error
is true minus estimate: position, velocity and the rotation vector psi with C_true = exp([psi x]) C_estimate, those of
the Earth-fixed quantities, resolved in the frame (n or e) of the estimate.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

Array = np.ndarray

A = 6378137.0
F = 1.0 / 298.257223563
E2 = F * (2.0 - F)


def rotation_en(lat: float, lon: float) -> Array:
    """(3, 3) rotation from north-east-down to e."""
    s, c, sl, cl = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    return np.array([[-s * cl, -sl, -c * cl], [-s * sl, cl, -c * sl], [c, 0.0, -s]])


def position_e(lat: float, lon: float, height: float) -> Array:
    """r_e [m] of a geodetic position."""
    transverse = A / np.sqrt(1.0 - E2 * np.sin(lat) ** 2)
    level = (transverse + height) * np.cos(lat)
    return np.array([level * np.cos(lon), level * np.sin(lon), (transverse * (1.0 - E2) + height) * np.sin(lat)])


def dcm(q: Array) -> Array:
    """(3, 3) matrix of a quaternion, scalar first."""
    return Rotation.from_quat(q, scalar_first=True).as_matrix()


def earth_fixed(nav: Array, ecef: bool) -> tuple[Array, Array, Array]:
    """r_e, v_e and C_eb of a navigation array."""
    if ecef:
        return nav[:3].copy(), nav[3:6].copy(), dcm(nav[6:])
    C_en = rotation_en(nav[0], nav[1])
    return position_e(*nav[:3]), C_en @ nav[3:6], C_en @ dcm(nav[6:])


def frame_of(nav: Array, ecef: bool) -> Array:
    """(3, 3) rotation from e to the frame that the errors are resolved in."""
    return np.eye(3) if ecef else rotation_en(nav[0], nav[1]).T


def error(true: Array, estimate: Array, ecef: bool) -> Array:
    """(9,) error, true minus estimate."""
    r1, v1, C1 = earth_fixed(true, ecef)
    r0, v0, C0 = earth_fixed(estimate, ecef)
    psi_e = Rotation.from_matrix(C1 @ C0.T).as_rotvec()
    to_m = frame_of(estimate, ecef)
    return np.concatenate([to_m @ (r1 - r0), to_m @ (v1 - v0), to_m @ psi_e])


def corrected(nav: Array, d: Array, ecef: bool) -> tuple[Array, Array, Array]:
    """r_e, v_e and C_eb of a navigation array after the correction `d` (9,)."""
    r, v, C = earth_fixed(nav, ecef)
    to_e = frame_of(nav, ecef).T
    return r + to_e @ d[:3], v + to_e @ d[3:6], Rotation.from_rotvec(to_e @ d[6:9]).as_matrix() @ C


def angle_between(C1: Array, C0: Array) -> float:
    """Angle [rad] of the rotation between two attitudes."""
    return float(np.linalg.norm(Rotation.from_matrix(C1 @ C0.T).as_rotvec()))
