"""Strapdown mechanization in the local north-east-down frame."""

from __future__ import annotations

from math import cos, sin, sqrt

from navfuse.core.constants import EARTH_RATE, WGS84_A, WGS84_E2
from navfuse.core.earth import normal_gravity
from navfuse.core.fused import fused
from navfuse.core.rotation import quat_from_rotvec, quat_multiply


@fused(inline="always")
def rotate_increment(tx, ty, tz, ux, uy, uz):
    """Velocity increment resolved at the start of its interval: u + B t x u + C t x (t x u).

    ``B = (1 - cos |t|)/|t|^2`` and ``C = (|t| - sin |t|)/|t|^3`` as series up to |t|^2, hence exact to fourth order in
    the rotation `t` for a rate and a specific force that are constant in the body over the interval; what varies inside
    is the sculling term that :mod:`navfuse.imu.increments` adds beforehand (Groves 2013, eq. 5.84; Savage 1998). No
    checks are made.
    """
    t2 = tx * tx + ty * ty + tz * tz
    b = 0.5 - (1.0 / 24.0) * t2
    c = 1.0 / 6.0 - (1.0 / 120.0) * t2
    cx = ty * uz - tz * uy
    cy = tz * ux - tx * uz
    cz = tx * uy - ty * ux
    return (
        ux + b * cx + c * (ty * cz - tz * cy),
        uy + b * cy + c * (tz * cx - tx * cz),
        uz + b * cz + c * (tx * cy - ty * cx),
    )


@fused(inline="always")
def advance_ned(lat, lon, h, s0, c0, vn, ve, vd, q0, q1, q2, q3, qb, dt, tx, ty, tz, ux, uy, uz):
    """:func:`step_ned` of numbers: sine and cosine s0, c0 of the latitude and the quaternion qb of the rotation are
    given, so that there is no branch and no call in it. No checks are made.
    """
    bx, by, bz = rotate_increment(tx, ty, tz, ux, uy, uz)
    fn = (1.0 - 2.0 * (q2 * q2 + q3 * q3)) * bx + 2.0 * ((q1 * q2 - q0 * q3) * by + (q1 * q3 + q0 * q2) * bz)
    fe = (1.0 - 2.0 * (q1 * q1 + q3 * q3)) * by + 2.0 * ((q1 * q2 + q0 * q3) * bx + (q2 * q3 - q0 * q1) * bz)
    fd = (1.0 - 2.0 * (q1 * q1 + q2 * q2)) * bz + 2.0 * ((q1 * q3 - q0 * q2) * bx + (q2 * q3 + q0 * q1) * by)

    half = 0.5 * dt
    dlat = half * vn / (WGS84_A * (1.0 - WGS84_E2 * (1.0 - 1.5 * s0 * s0)) + h)
    s = s0 + c0 * dlat
    c = c0 - s0 * dlat
    hm = h - half * vd
    x = 1.0 - WGS84_E2 * s * s
    root = sqrt(x)
    to_north = x * root / (WGS84_A * (1.0 - WGS84_E2) + hm * x * root)
    to_east = root / (WGS84_A + hm * root)
    sec = 1.0 / c
    tan = s * sec
    g = normal_gravity(s, hm)

    ie_n = EARTH_RATE * c
    ie_d = -EARTH_RATE * s
    an = 2.0 * ie_n + ve * to_east
    ae = -vn * to_north
    ad = 2.0 * ie_d - ve * tan * to_east
    vn_m = vn + 0.5 * (fn - dt * (ae * vd - ad * ve))
    ve_m = ve + 0.5 * (fe - dt * (ad * vn - an * vd))
    vd_m = vd + 0.5 * (fd + g * dt - dt * (an * ve - ae * vn))
    en_n = ve_m * to_east
    en_e = -vn_m * to_north
    en_d = -en_n * tan

    zn = (ie_n + en_n) * dt
    ze = en_e * dt
    zd = (ie_d + en_d) * dt
    dvn = fn - 0.5 * (ze * fd - zd * fe)
    dve = fe - 0.5 * (zd * fn - zn * fd)
    dvd = fd - 0.5 * (zn * fe - ze * fn)

    wn = 2.0 * ie_n + en_n
    wd = 2.0 * ie_d + en_d
    vn1 = vn + dvn - dt * (en_e * vd_m - wd * ve_m)
    ve1 = ve + dve - dt * (wd * vn_m - wn * vd_m)
    vd1 = vd + dvd - dt * (wn * ve_m - en_e * vn_m - g)

    dlat = half * (vn + vn1) * to_north
    turn = 1.0 - 0.5 * dlat * dlat
    p = quat_multiply((q0, q1, q2, q3), qb)
    n0 = 1.0 - 0.125 * (zn * zn + ze * ze + zd * zd)
    q = quat_multiply((n0, -0.5 * zn, -0.5 * ze, -0.5 * zd), p)
    scale = 1.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (
        (lat + dlat, lon + half * (ve + ve1) * to_east * sec, h - half * (vd + vd1)),
        (vn1, ve1, vd1),
        (q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale),
        (dvn, dve, dvd),
        s0 * turn + c0 * dlat,
        c0 * turn - s0 * dlat,
    )


@fused
def step_ned(nav, dt, tx, ty, tz, ux, uy, uz):
    """Advance an NED navigation state by one increment, in place.

    Parameters
    ----------
    nav : (10,) array
        Latitude, longitude [rad], height [m], velocity north, east, down [m/s], quaternion q_nb.
    dt : float [s]
    tx, ty, tz : float [rad]
        Rotation vector of the body over the interval (coning included), relative to inertial space.
    ux, uy, uz : float [m/s]
        Specific-force increment (sculling included, without the velocity-rotation term).

    Returns
    -------
    dv : 3-tuple [m/s]
        The specific-force increment resolved in n.
    sin_lat, cos_lat : float
        Of the new latitude.

    Notes
    -----
    Second order in `dt`. Gravity, Earth rate and transport rate are evaluated once, at the predicted middle of
    the interval; the position takes the mean of the velocities (Groves 2013, section 5.3-5.4, with the midpoint in
    place of his start values). Not valid within a few metres of a pole, where longitude is undefined: use the ECEF
    mechanization there. No checks are made.
    """
    r, v, q, f, sin_lat, cos_lat = advance_ned(
        nav[0], nav[1], nav[2], sin(nav[0]), cos(nav[0]), nav[3], nav[4], nav[5], nav[6], nav[7], nav[8], nav[9],
        quat_from_rotvec((tx, ty, tz)), dt, tx, ty, tz, ux, uy, uz,
    )  # fmt: skip
    nav[0], nav[1], nav[2] = r
    nav[3], nav[4], nav[5] = v
    nav[6], nav[7], nav[8], nav[9] = q
    return f, sin_lat, cos_lat
