"""Attitude: direction cosine matrices, quaternions, rotation vectors, Euler angles and every arrow between them.

All describe the rotation that takes vectors from b to n: ``v_n = C_nb v_b = q_nb v_b q_nb*``. Quaternions are
Hamilton, scalar first. Matrices are flat 9-sequences, row by row. Euler angles are roll, pitch, heading [rad] of
``C_nb = Rz(heading) Ry(pitch) Rx(roll)``. Arguments may be tuples or 1-D arrays, results are tuples. No checks are
made in any of these functions.

Two rotations that differ only in the sign of the quaternion are the same rotation. Where a function chooses a sign
(:func:`quat_from_dcm`, :func:`rotvec_from_quat`), the scalar part is not negative, and for a half turn the first
non-zero component of the axis is positive.

Series replace sine and cosine where the squared angle (halved angle for quaternions) is below 0.01: the first omitted
term is then less than 3e-17, under half a unit in the last place of 1.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from navfuse.core.constants import TWO_PI

_SERIES_LIMIT = 1e-2
_TINY_SQUARE = 1e-30
_LOCK_COSINE = 4.5e-16


@njit(cache=True, error_model="numpy")
def cross(a, b):
    """Cross product ``a x b`` of two 3-vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, error_model="numpy")
def transpose(A):
    """Transpose of a 3 x 3 matrix."""
    return A[0], A[3], A[6], A[1], A[4], A[7], A[2], A[5], A[8]


@njit(cache=True, error_model="numpy")
def mat_mul(A, B):
    """Product ``A B`` of two 3 x 3 matrices."""
    return (
        A[0] * B[0] + A[1] * B[3] + A[2] * B[6],
        A[0] * B[1] + A[1] * B[4] + A[2] * B[7],
        A[0] * B[2] + A[1] * B[5] + A[2] * B[8],
        A[3] * B[0] + A[4] * B[3] + A[5] * B[6],
        A[3] * B[1] + A[4] * B[4] + A[5] * B[7],
        A[3] * B[2] + A[4] * B[5] + A[5] * B[8],
        A[6] * B[0] + A[7] * B[3] + A[8] * B[6],
        A[6] * B[1] + A[7] * B[4] + A[8] * B[7],
        A[6] * B[2] + A[7] * B[5] + A[8] * B[8],
    )


@njit(cache=True, error_model="numpy")
def mat_t_mul(A, B):
    """Product ``A^T B`` of two 3 x 3 matrices."""
    return mat_mul(transpose(A), B)


@njit(cache=True, error_model="numpy")
def mat_vec(A, v):
    """Product ``A v`` of a 3 x 3 matrix and a 3-vector."""
    return (
        A[0] * v[0] + A[1] * v[1] + A[2] * v[2],
        A[3] * v[0] + A[4] * v[1] + A[5] * v[2],
        A[6] * v[0] + A[7] * v[1] + A[8] * v[2],
    )


@njit(cache=True, error_model="numpy")
def mat_t_vec(A, v):
    """Product ``A^T v`` of a 3 x 3 matrix and a 3-vector."""
    return (
        A[0] * v[0] + A[3] * v[1] + A[6] * v[2],
        A[1] * v[0] + A[4] * v[1] + A[7] * v[2],
        A[2] * v[0] + A[5] * v[1] + A[8] * v[2],
    )


@njit(cache=True, error_model="numpy")
def wrap_pi(x):
    """Angle [rad] brought into (-pi, pi]; values already there come back unchanged."""
    if -math.pi < x <= math.pi:
        return x
    y = x - TWO_PI * math.ceil((x - math.pi) / TWO_PI)
    if y <= -math.pi or y > math.pi:
        return math.pi
    return y


@njit(cache=True, error_model="numpy")
def wrap_two_pi(x):
    """Angle [rad] brought into [0, 2 pi); values already there come back unchanged."""
    if 0.0 <= x < TWO_PI:
        return x
    y = x - TWO_PI * math.floor(x / TWO_PI)
    if y < 0.0 or y >= TWO_PI:
        return 0.0
    return y


@njit(cache=True, error_model="numpy")
def quat_multiply(p, q):
    """Hamilton product ``p q``: the rotation q followed by p."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@njit(cache=True, error_model="numpy")
def quat_conjugate(q):
    """Conjugate: the inverse rotation of a unit quaternion."""
    return q[0], -q[1], -q[2], -q[3]


@njit(cache=True, error_model="numpy")
def quat_normalize(q):
    """Quaternion scaled to unit length; the sign is kept."""
    k = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return q[0] * k, q[1] * k, q[2] * k, q[3] * k


@njit(cache=True, error_model="numpy")
def quat_rotate(q, v):
    """Vector ``q v q*``: with ``q_nb`` it takes a vector from b to n. The quaternion has unit length."""
    tx = 2.0 * (q[2] * v[2] - q[3] * v[1])
    ty = 2.0 * (q[3] * v[0] - q[1] * v[2])
    tz = 2.0 * (q[1] * v[1] - q[2] * v[0])
    return (
        v[0] + q[0] * tx + q[2] * tz - q[3] * ty,
        v[1] + q[0] * ty + q[3] * tx - q[1] * tz,
        v[2] + q[0] * tz + q[1] * ty - q[2] * tx,
    )


@njit(cache=True, error_model="numpy")
def quat_from_rotvec(r):
    """Unit quaternion of a rotation vector [rad] of any length.

    The scalar part is ``cos(|r| / 2)``, hence negative beyond half a turn.
    """
    y = 0.25 * (r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    if y < _SERIES_LIMIT:
        k = 0.5 - y * (1.0 / 12.0 - y * (1.0 / 240.0 - y * (1.0 / 10080.0 - y * (1.0 / 725760.0))))
        w = 1.0 - y * (1.0 / 2.0 - y * (1.0 / 24.0 - y * (1.0 / 720.0 - y * (1.0 / 40320.0))))
    else:
        half = math.sqrt(y)
        k = 0.5 * math.sin(half) / half
        w = math.cos(half)
    return w, k * r[0], k * r[1], k * r[2]


@njit(cache=True, error_model="numpy")
def _canonical(w, x, y, z):
    if w < 0.0 or (w == 0.0 and (x < 0.0 or (x == 0.0 and (y < 0.0 or (y == 0.0 and z < 0.0))))):
        return -w, -x, -y, -z
    return w, x, y, z


@njit(cache=True, error_model="numpy")
def rotvec_from_quat(q):
    """Rotation vector [rad] of a quaternion, of length at most pi.

    Only the direction of the 4-vector counts, so a slightly denormalized quaternion is taken as the nearest unit one.
    The arctangent keeps full precision near zero and near half a turn.
    """
    w, x, y, z = _canonical(q[0], q[1], q[2], q[3])
    n2 = x * x + y * y + z * z
    if n2 < _TINY_SQUARE:
        k = 2.0 / w
    else:
        n = math.sqrt(n2)
        k = 2.0 * math.atan2(n, w) / n
    return k * x, k * y, k * z


@njit(cache=True, error_model="numpy")
def quat_from_dcm(C):
    """Unit quaternion of a rotation matrix, with the scalar part not negative.

    The largest of the four components is found first and the others are divided by it (Shepperd 1978), so that no
    rotation is singular; the result is normalized.
    """
    trace = C[0] + C[4] + C[8]
    if trace >= C[0] and trace >= C[4] and trace >= C[8]:
        w, x, y, z = 1.0 + trace, C[7] - C[5], C[2] - C[6], C[3] - C[1]
    elif C[0] >= C[4] and C[0] >= C[8]:
        w, x, y, z = C[7] - C[5], 1.0 + C[0] - C[4] - C[8], C[1] + C[3], C[2] + C[6]
    elif C[4] >= C[8]:
        w, x, y, z = C[2] - C[6], C[1] + C[3], 1.0 - C[0] + C[4] - C[8], C[5] + C[7]
    else:
        w, x, y, z = C[3] - C[1], C[2] + C[6], C[5] + C[7], 1.0 - C[0] - C[4] + C[8]
    k = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    return _canonical(k * w, k * x, k * y, k * z)


@njit(cache=True, error_model="numpy")
def dcm_from_quat(q):
    """Rotation matrix of a unit quaternion."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    return (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def dcm_from_rotvec(r):
    """Rotation matrix ``exp([r x])`` of a rotation vector [rad] of any length (Rodrigues)."""
    x, y, z = r[0], r[1], r[2]
    n2 = x * x + y * y + z * z
    if n2 < _SERIES_LIMIT:
        a = 1.0 - n2 / 6.0 * (1.0 - n2 / 20.0 * (1.0 - n2 / 42.0 * (1.0 - n2 / 72.0)))
        b = 0.5 * (1.0 - n2 / 12.0 * (1.0 - n2 / 30.0 * (1.0 - n2 / 56.0 * (1.0 - n2 / 90.0))))
    else:
        n = math.sqrt(n2)
        a = math.sin(n) / n
        half = math.sin(0.5 * n)
        b = 2.0 * half * half / n2
    return (
        1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y,
        b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x,
        b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y),
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def left_jacobian(r):
    """Left Jacobian of a rotation vector [rad]: ``exp([(r + e) x]) = exp([J e x]) exp([r x])`` to first order in e.

    ``J = I + (1 - cos n)/n^2 [r x] + (n - sin n)/n^3 [r x]^2`` with n = |r| (Barfoot 2017, *State Estimation for
    Robotics*, eq. 7.77). Its transpose belongs to -r.
    """
    x, y, z = r[0], r[1], r[2]
    n2 = x * x + y * y + z * z
    if n2 < _SERIES_LIMIT:
        b = 0.5 * (1.0 - n2 / 12.0 * (1.0 - n2 / 30.0 * (1.0 - n2 / 56.0 * (1.0 - n2 / 90.0))))
        c = 1.0 / 6.0 * (1.0 - n2 / 20.0 * (1.0 - n2 / 42.0 * (1.0 - n2 / 72.0 * (1.0 - n2 / 110.0))))
    else:
        n = math.sqrt(n2)
        half = math.sin(0.5 * n)
        b = 2.0 * half * half / n2
        c = (n - math.sin(n)) / (n2 * n)
    return (
        1.0 - c * (y * y + z * z), c * x * y - b * z, c * x * z + b * y,
        c * x * y + b * z, 1.0 - c * (x * x + z * z), c * y * z - b * x,
        c * x * z - b * y, c * y * z + b * x, 1.0 - c * (x * x + y * y),
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def rotvec_from_dcm(C):
    """Rotation vector [rad] of a rotation matrix, of length at most pi; no loss at zero and at half a turn."""
    return rotvec_from_quat(quat_from_dcm(C))


@njit(cache=True, error_model="numpy")
def dcm_from_euler(roll, pitch, heading):
    """Matrix ``C_nb`` of roll, pitch and heading [rad]. Source: transpose of Groves (2013), eq. 2.22."""
    sr, cr = math.sin(roll), math.cos(roll)
    sp, cp = math.sin(pitch), math.cos(pitch)
    sh, ch = math.sin(heading), math.cos(heading)
    return (
        cp * ch, sr * sp * ch - cr * sh, cr * sp * ch + sr * sh,
        cp * sh, sr * sp * sh + cr * ch, cr * sp * sh - sr * ch,
        -sp, sr * cp, cr * cp,
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def euler_from_dcm(C):
    """Roll in [-pi, pi], pitch in [-pi/2, pi/2] and heading in [0, 2 pi) [rad] of ``C_nb``.

    Pitch comes from an arctangent, so that it keeps full precision at +-90 deg. Heading is found after roll, from the
    matrix with that roll undone: near gimbal lock roll and heading are each uncertain, but together they give the
    matrix back to rounding. Where cos(pitch) is below 4.5e-16 (two units in the last place of 1) the matrix no longer
    tells them apart: roll is 0.
    """
    cos_pitch = math.sqrt(C[7] * C[7] + C[8] * C[8])
    if cos_pitch < _LOCK_COSINE:
        roll, sr, cr = 0.0, 0.0, 1.0
    else:
        roll = math.atan2(C[7], C[8])
        sr, cr = C[7] / cos_pitch, C[8] / cos_pitch
    heading = math.atan2(sr * C[2] - cr * C[1], cr * C[4] - sr * C[5])
    return roll, math.atan2(-C[6], cos_pitch), wrap_two_pi(heading)


@njit(cache=True, error_model="numpy")
def quat_from_euler(roll, pitch, heading):
    """Unit quaternion ``q_nb`` of roll, pitch and heading [rad]; the sign follows the half angles."""
    sr, cr = math.sin(0.5 * roll), math.cos(0.5 * roll)
    sp, cp = math.sin(0.5 * pitch), math.cos(0.5 * pitch)
    sh, ch = math.sin(0.5 * heading), math.cos(0.5 * heading)
    return (
        ch * cp * cr + sh * sp * sr,
        ch * cp * sr - sh * sp * cr,
        ch * sp * cr + sh * cp * sr,
        sh * cp * cr - ch * sp * sr,
    )


@njit(cache=True, error_model="numpy")
def euler_from_quat(q):
    """Roll, pitch and heading [rad] of a unit quaternion ``q_nb``; see :func:`euler_from_dcm`."""
    return euler_from_dcm(dcm_from_quat(q))


@njit(cache=True, error_model="numpy")
def euler_from_rotvec(r):
    """Roll, pitch and heading [rad] of a rotation vector [rad]; see :func:`euler_from_dcm`."""
    return euler_from_dcm(dcm_from_rotvec(r))


@njit(cache=True, error_model="numpy")
def rotvec_from_euler(roll, pitch, heading):
    """Rotation vector [rad], of length at most pi, of roll, pitch and heading [rad]."""
    return rotvec_from_quat(quat_from_euler(roll, pitch, heading))


@njit(cache=True, error_model="numpy")
def quat_from_euler_batch(euler):
    """:func:`quat_from_euler` of an (n, 3) array; returns (n, 4)."""
    out = np.empty((euler.shape[0], 4))
    for i in range(euler.shape[0]):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = quat_from_euler(euler[i, 0], euler[i, 1], euler[i, 2])
    return out


@njit(cache=True, error_model="numpy")
def euler_from_quat_batch(q):
    """:func:`euler_from_quat` of an (n, 4) array; returns (n, 3)."""
    out = np.empty((q.shape[0], 3))
    for i in range(q.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = euler_from_quat(q[i])
    return out


@njit(cache=True, error_model="numpy")
def dcm_from_quat_batch(q):
    """:func:`dcm_from_quat` of an (n, 4) array; returns (n, 3, 3)."""
    out = np.empty((q.shape[0], 3, 3))
    for i in range(q.shape[0]):
        C = dcm_from_quat(q[i])
        for j in range(9):
            out[i, j // 3, j % 3] = C[j]
    return out
