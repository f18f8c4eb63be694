"""Strapdown mechanization in the Earth-fixed frame: no singular place on Earth."""

from __future__ import annotations

from navfuse.core.constants import EARTH_RATE
from navfuse.core.earth import gravity_e
from navfuse.core.fused import fused
from navfuse.core.rotation import quat_from_rotvec, quat_multiply
from navfuse.mechanization.ned import rotate_increment


@fused(inline="always")
def advance_ecef(x, y, z, vx, vy, vz, q0, q1, q2, q3, qb, dt, tx, ty, tz, ux, uy, uz):
    """:func:`step_ecef` of numbers: the quaternion qb of the rotation is given, so that there is no branch and no call
    in it. No checks are made.
    """
    bx, by, bz = rotate_increment(tx, ty, tz, ux, uy, uz)
    fx = (1.0 - 2.0 * (q2 * q2 + q3 * q3)) * bx + 2.0 * ((q1 * q2 - q0 * q3) * by + (q1 * q3 + q0 * q2) * bz)
    fy = (1.0 - 2.0 * (q1 * q1 + q3 * q3)) * by + 2.0 * ((q1 * q2 + q0 * q3) * bx + (q2 * q3 - q0 * q1) * bz)
    fz = (1.0 - 2.0 * (q1 * q1 + q2 * q2)) * bz + 2.0 * ((q1 * q3 - q0 * q2) * bx + (q2 * q3 + q0 * q1) * by)

    half = 0.5 * dt
    gx, gy, gz = gravity_e(x + half * vx, y + half * vy, z + half * vz)
    zeta = EARTH_RATE * dt
    vx_m = vx + 0.5 * (fx + gx * dt) + zeta * vy
    vy_m = vy + 0.5 * (fy + gy * dt) - zeta * vx
    dvx = fx + 0.5 * zeta * fy
    dvy = fy - 0.5 * zeta * fx
    vx1 = vx + dvx + dt * gx + 2.0 * zeta * vy_m
    vy1 = vy + dvy + dt * gy - 2.0 * zeta * vx_m
    vz1 = vz + fz + dt * gz

    p = quat_multiply((q0, q1, q2, q3), qb)
    e0 = 1.0 - 0.125 * zeta * zeta
    e3 = -0.5 * zeta
    r0 = e0 * p[0] - e3 * p[3]
    r1 = e0 * p[1] - e3 * p[2]
    r2 = e0 * p[2] + e3 * p[1]
    r3 = e0 * p[3] + e3 * p[0]
    scale = 1.5 - 0.5 * (r0 * r0 + r1 * r1 + r2 * r2 + r3 * r3)
    return (
        (x + half * (vx + vx1), y + half * (vy + vy1), z + half * (vz + vz1)),
        (vx1, vy1, vz1),
        (r0 * scale, r1 * scale, r2 * scale, r3 * scale),
        (dvx, dvy, fz),
    )


@fused
def step_ecef(nav, dt, tx, ty, tz, ux, uy, uz):
    """Advance an ECEF navigation state by one increment, in place.

    Parameters
    ----------
    nav : (10,) array
        Position r_e [m], velocity v_e relative to the Earth [m/s], quaternion q_eb.
    dt, tx, ty, tz, ux, uy, uz
        As in :func:`navfuse.mechanization.ned.step_ned`.

    Returns
    -------
    dvx, dvy, dvz : float [m/s]
        The specific-force increment resolved in e.

    Notes
    -----
    Second order in `dt`; gravity and the Coriolis term are taken at the predicted middle of the interval (Groves 2013,
    section 5.2). No checks are made.
    """
    r, v, q, f = advance_ecef(
        nav[0], nav[1], nav[2], nav[3], nav[4], nav[5], nav[6], nav[7], nav[8], nav[9],
        quat_from_rotvec((tx, ty, tz)), dt, tx, ty, tz, ux, uy, uz,
    )  # fmt: skip
    nav[0], nav[1], nav[2] = r
    nav[3], nav[4], nav[5] = v
    nav[6], nav[7], nav[8], nav[9] = q
    return f
