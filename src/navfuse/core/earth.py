"""The WGS 84 Earth: radii, normal gravity, geodetic and Earth-centred coordinates, rates of the local level frame.

Frames: e Earth-centred Earth-fixed, n local north-east-down. Latitude and longitude [rad], ellipsoidal height [m].
No checks are made in any of these functions.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from navfuse.core.constants import (
    EARTH_RATE,
    GAMMA_EQUATOR,
    GRAVITY_M,
    SOMIGLIANA_K,
    WGS84_A,
    WGS84_B,
    WGS84_E2,
    WGS84_EP2,
    WGS84_F,
)

_E4 = WGS84_E2 * WGS84_E2
_ONE_MINUS_E2 = (1.0 - WGS84_F) * (1.0 - WGS84_F)
_FOCAL2 = WGS84_A * WGS84_A * WGS84_E2
_SPLITTER = 2.0**27 + 1.0  # halves a double (Dekker 1971)
_B_LO = 2.020241106426024e-10  # what WGS84_B lacks of a (1 - f)


@njit(cache=True, error_model="numpy")
def radii(sin_lat):
    """Radii of curvature of the ellipsoid.

    Parameters
    ----------
    sin_lat : float
        Sine of the geodetic latitude.

    Returns
    -------
    r_meridian, r_transverse : float [m]
        North-south radius M and east-west radius N; at the poles both are a^2/b.

    Notes
    -----
    No checks are made. Source: Groves (2013), eqs. 2.105 and 2.106.
    """
    w2 = 1.0 - WGS84_E2 * sin_lat * sin_lat
    r_transverse = WGS84_A / math.sqrt(w2)
    return r_transverse * _ONE_MINUS_E2 / w2, r_transverse


@njit(cache=True, error_model="numpy")
def normal_gravity(sin_lat, height):
    """Magnitude of normal gravity, centrifugal part included.

    Parameters
    ----------
    sin_lat : float
        Sine of the geodetic latitude.
    height : float [m]
        Above the ellipsoid.

    Returns
    -------
    float [m/s^2]

    Notes
    -----
    No checks are made. Somigliana's closed formula on the ellipsoid with the height reduction to second order: NIMA
    TR8350.2 (2000), eqs. 4-1 and 4-3. Against the exact closed form of the normal field it is within 1e-7 m/s^2 up to
    1 km, 5e-7 at 5 km, 2e-6 at 20 km and 2e-4 at 100 km; above a few hundred kilometres the series is of no use.
    """
    s2 = sin_lat * sin_lat
    surface = GAMMA_EQUATOR * (1.0 + SOMIGLIANA_K * s2) / math.sqrt(1.0 - WGS84_E2 * s2)
    x = height * (1.0 / WGS84_A)
    return surface * (1.0 - 2.0 * (1.0 + WGS84_F + GRAVITY_M - 2.0 * WGS84_F * s2) * x + 3.0 * x * x)


@njit(cache=True, error_model="numpy")
def _two_product(a, b):
    t = _SPLITTER * a
    a_hi = t - (t - a)
    a_lo = a - a_hi
    t = _SPLITTER * b
    b_hi = t - (t - b)
    b_lo = b - b_hi
    hi = a * b
    return hi, ((a_hi * b_hi - hi) + a_hi * b_lo + a_lo * b_hi) + a_lo * b_lo


@njit(cache=True, error_model="numpy")
def _two_sum(a, b):
    hi = a + b
    t = hi - a
    return hi, (a - (hi - t)) + (b - t)


@njit(cache=True, error_model="numpy")
def _unit(c, s):
    n = 1.0 / math.sqrt(c * c + s * s)
    return c * n, s * n


@njit(cache=True, error_model="numpy")
def _unit_defect(c, s):
    c2, c2_lo = _two_product(c, c)
    s2, s2_lo = _two_product(s, s)
    return 0.5 * ((1.0 - max(c2, s2)) - min(c2, s2) - (c2_lo + s2_lo))


@njit(cache=True, error_model="numpy")
def geodetic_to_ecef(lat, lon, h):
    """Earth-centred Cartesian position of a geodetic one.

    Returns
    -------
    x, y, z : float [m]

    Notes
    -----
    No checks are made. The foot point on the ellipsoid is taken from the reduced latitude beta: ``p = a cos(beta) + h
    cos(lat)``, ``z = b sin(beta) + h sin(lat)``, ``tan(beta) = (1 - f) tan(lat)``; the same as Groves (2013), eq.
    2.112. Products are carried in two doubles and unit vectors are corrected for what rounding takes off their length
    (see :func:`meridian_normal`). Near the ground each coordinate is within 1.5e-9 m, the unavoidable rounding of
    sine and cosine, which acts along the surface; the height is kept to 7e-10 m through :func:`ecef_to_geodetic` and
    back.
    """
    sin_lat, cos_lat = math.sin(lat), math.cos(lat)
    sin_lon, cos_lon = math.sin(lon), math.cos(lon)
    c, s = _unit(WGS84_A * cos_lat, WGS84_B * sin_lat)
    stretch = _unit_defect(c, s)
    stretch_h = _unit_defect(cos_lat, sin_lat)
    stretch_lon = _unit_defect(cos_lon, sin_lon)

    foot, foot_lo = _two_product(WGS84_A, c)
    lift, lift_lo = _two_product(h, cos_lat)
    p, p_lo = _two_sum(foot, lift)
    p_lo += foot_lo + lift_lo + foot * stretch + lift * stretch_h

    foot, foot_lo = _two_product(WGS84_B, s)
    lift, lift_lo = _two_product(h, sin_lat)
    z, z_lo = _two_sum(foot, lift)
    z_lo += foot_lo + _B_LO * s + lift_lo + foot * stretch + lift * stretch_h

    x, x_lo = _two_product(p, cos_lon)
    y, y_lo = _two_product(p, sin_lon)
    return x + (x_lo + p_lo * cos_lon + x * stretch_lon), y + (y_lo + p_lo * sin_lon + y * stretch_lon), z + z_lo


@njit(cache=True, error_model="numpy")
def meridian_normal(x, y, z):
    """Ellipsoid normal and height of an Earth-centred position, to the last digit; see also :func:`ellipsoid_normal`.

    Parameters
    ----------
    x, y, z : float [m]

    Returns
    -------
    p : float [m]
        Distance from the axis.
    cos_lat, sin_lat : float
        Components of the outward unit normal, away from the axis and along z.
    h : float [m]
        Height above the ellipsoid.

    Notes
    -----
    No checks are made. Closed form: the quartic of the foot point is solved as in Vermeille (2002), with the cube root
    written as in Vermeille (2011), which does not cancel; one Newton step on the reduced latitude takes away what
    rounding is left near the evolute. Height is the projection of the vector from the foot point on the normal, with
    the differences formed in twice the working precision and with the length defect of each unit vector put back.
    Valid outside the evolute, that is farther than 43 km from the centre; nearer, the foot point is not unique and
    the result means nothing (NaN at the centre). Worst errors from 45 km to 1e8 m from the centre: 6e-16 rad, and the
    larger of 5e-10 m and 1.6 units in the last place of the height.
    """
    p = math.sqrt(x * x + y * y)
    pp = (p / WGS84_A) ** 2
    q = (z / WGS84_A) ** 2 * _ONE_MINUS_E2
    r = (pp + q - _E4) / 6.0
    e4pq = _E4 * pp * q
    root = math.sqrt(max(8.0 * r * r * r + e4pq, 0.0)) + math.sqrt(e4pq)
    t = 0.5 * (root * root) ** (1.0 / 3.0)
    u = r + t
    if t > 0.0:
        u += r * r / t
    v = math.sqrt(u * u + _E4 * q)
    w = WGS84_E2 * (u + v - q) / (2.0 * v)
    k = (u + v) / (math.sqrt(w * w + u + v) + w)
    c, s = _unit(k * p, (k + WGS84_E2) * z * (1.0 - WGS84_F))

    g = p * WGS84_A * s - z * WGS84_B * c - _FOCAL2 * s * c
    step = g / (p * WGS84_A * c + z * WGS84_B * s - _FOCAL2 * (c - s) * (c + s))
    c, s = _unit(c + step * s, s - step * c)
    cos_lat, sin_lat = _unit(WGS84_B * c, WGS84_A * s)

    x2, x2_lo = _two_product(x, x)
    y2, y2_lo = _two_product(y, y)
    p2, p2_lo = _two_product(p, p)
    p_lo = 0.0
    if p > 0.0:
        p_lo = 0.5 * ((max(x2, y2) - p2) + min(x2, y2) + (x2_lo + y2_lo - p2_lo)) / p
    stretch = _unit_defect(c, s)
    foot, foot_lo = _two_product(WGS84_A, c)
    dp, dp_lo = _two_sum(p, -foot)
    dp_lo += p_lo - foot_lo - foot * stretch
    foot, foot_lo = _two_product(WGS84_B, s)
    dz, dz_lo = _two_sum(z, -foot)
    dz_lo -= foot_lo + _B_LO * s + foot * stretch
    h = dp * cos_lat + dz * sin_lat
    return p, cos_lat, sin_lat, h + (dp_lo * cos_lat + dz_lo * sin_lat + h * _unit_defect(cos_lat, sin_lat))


@njit(cache=True, error_model="numpy")
def ecef_to_geodetic(x, y, z):
    """Geodetic position of an Earth-centred Cartesian one.

    Parameters
    ----------
    x, y, z : float [m]

    Returns
    -------
    lat, lon : float [rad]
        Longitude in (-pi, pi]; on the axis the sign of x decides, as ``atan2`` does.
    h : float [m]
        Above the ellipsoid.

    Notes
    -----
    No checks are made. For method, accuracy and domain see :func:`meridian_normal`.
    """
    _, cos_lat, sin_lat, h = meridian_normal(x, y, z)
    return math.atan2(sin_lat, cos_lat), math.atan2(y, x), h


@njit(cache=True, error_model="numpy")
def dcm_en(lat, lon):
    """Matrix that takes north-east-down to Earth-centred axes.

    Returns
    -------
    9-tuple
        ``C_en`` row by row; its columns are north, east and down resolved in e.

    Notes
    -----
    No checks are made. Source: transpose of Groves (2013), eq. 2.150.
    """
    sin_lat, cos_lat = math.sin(lat), math.cos(lat)
    sin_lon, cos_lon = math.sin(lon), math.cos(lon)
    return (
        -sin_lat * cos_lon, -sin_lon, -cos_lat * cos_lon,
        -sin_lat * sin_lon, cos_lon, -cos_lat * sin_lon,
        cos_lat, 0.0, -sin_lat,
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def earth_rate_n(sin_lat, cos_lat):
    """Earth rate ``w_ie_n`` [rad/s] resolved in north-east-down; the down component is negative in the north.

    Notes
    -----
    No checks are made. Source: Groves (2013), eq. 2.123.
    """
    return EARTH_RATE * cos_lat, 0.0, -EARTH_RATE * sin_lat


@njit(cache=True, error_model="numpy")
def transport_rate_n(sin_lat, cos_lat, h, vn, ve):
    """Transport rate ``w_en_n`` [rad/s]: how the local level frame turns as it moves over the Earth.

    Parameters
    ----------
    sin_lat, cos_lat : float
    h : float [m]
    vn, ve : float [m/s]
        Velocity north and east.

    Notes
    -----
    No checks are made. Not finite at a pole, where north has no direction. Source: Groves (2013), eq. 5.44.
    """
    r_meridian, r_transverse = radii(sin_lat)
    east_rate = ve / (r_transverse + h)
    return east_rate, -vn / (r_meridian + h), -east_rate * sin_lat / cos_lat


@njit(cache=True, error_model="numpy")
def ellipsoid_normal(x, y, z):
    """Ellipsoid normal and height of an Earth-centred position, for the loop: no trigonometry, a fifth of the time.

    Parameters
    ----------
    x, y, z : float [m]

    Returns
    -------
    p, cos_lat, sin_lat, h
        As :func:`meridian_normal`, within 3e-13 of the normal and 5e-9 m of the height (2e-8 m at 1e7 m) wherever the
        height is above -10 km.

    Notes
    -----
    No checks are made. Source: Bowring (1985), "The accuracy of geodetic latitude and height equations".
    """
    p2 = x * x + y * y
    p, r = math.sqrt(p2), math.sqrt(p2 + z * z)
    c, s = _unit(p * WGS84_A * r, z * WGS84_B * (r + WGS84_EP2 * WGS84_B))
    cos_lat, sin_lat = _unit(p - WGS84_E2 * WGS84_A * c * c * c, z + WGS84_EP2 * WGS84_B * s * s * s)
    return p, cos_lat, sin_lat, p * cos_lat + z * sin_lat - WGS84_A * math.sqrt(1.0 - WGS84_E2 * sin_lat * sin_lat)


@njit(cache=True, error_model="numpy")
def gravity_e(x, y, z):
    """Normal gravity vector [m/s^2] resolved in e, centrifugal part included.

    The magnitude is that of :func:`normal_gravity`, the direction is the inward ellipsoid normal through the point: the
    same model as in north-east-down, so that both frames integrate the same physics. The true normal field leans from
    that direction by 8e-9 m/s^2 per metre of height, times sin(2 lat), which both leave out.

    Notes
    -----
    No checks are made. Within 3e-12 m/s^2 of the exact normal and height; on the axis the direction is exactly along z.
    """
    p, cos_lat, sin_lat, h = ellipsoid_normal(x, y, z)
    g = normal_gravity(sin_lat, h)
    k = -g * cos_lat / p if p > 0.0 else 0.0
    return k * x, k * y, -g * sin_lat


@njit(cache=True, error_model="numpy")
def geodetic_to_ecef_batch(lat, lon, h):
    """:func:`geodetic_to_ecef` of (n,) arrays; returns ``r_e`` (n, 3) [m]."""
    out = np.empty((lat.size, 3))
    for i in range(lat.size):
        out[i, 0], out[i, 1], out[i, 2] = geodetic_to_ecef(lat[i], lon[i], h[i])
    return out


@njit(cache=True, error_model="numpy")
def ecef_to_geodetic_batch(r_e):
    """:func:`ecef_to_geodetic` of an (n, 3) array; returns latitude [rad], longitude [rad], height [m], each (n,)."""
    n = r_e.shape[0]
    lat, lon, h = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        lat[i], lon[i], h[i] = ecef_to_geodetic(r_e[i, 0], r_e[i, 1], r_e[i, 2])
    return lat, lon, h
