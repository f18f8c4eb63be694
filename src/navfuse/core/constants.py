"""Constants, SI: the Earth model, and a few that several parts share.

WGS 84 defining and derived values: NGA.STND.0036_1.0.0_WGS84 (2014), tables 3.1, 3.5 and 3.7. The derived ones are
computed here from the defining ones, so that they agree to the last bit with each other.
"""

from __future__ import annotations

import math

WGS84_A = 6378137.0
"""Semi-major axis [m] (defining)."""

WGS84_F = 1.0 / 298.257223563
"""Flattening (defining)."""

WGS84_B = WGS84_A * (1.0 - WGS84_F)
"""Semi-minor axis [m]."""

WGS84_E2 = WGS84_F * (2.0 - WGS84_F)
"""First eccentricity squared."""

WGS84_EP2 = WGS84_E2 / (1.0 - WGS84_E2)
"""Second eccentricity squared."""

EARTH_RATE = 7.292115e-5
"""Rotation rate of the Earth [rad/s] (defining)."""

EARTH_GM = 3.986004418e14
"""Gravitational constant of the Earth, atmosphere included [m^3/s^2] (defining)."""

GAMMA_EQUATOR = 9.7803253359
"""Normal gravity on the ellipsoid at the equator [m/s^2]."""

GAMMA_POLE = 9.8321849379
"""Normal gravity on the ellipsoid at the poles [m/s^2]."""

SOMIGLIANA_K = WGS84_B * GAMMA_POLE / (WGS84_A * GAMMA_EQUATOR) - 1.0
"""Constant k of Somigliana's formula."""

GRAVITY_M = EARTH_RATE**2 * WGS84_A**2 * WGS84_B / EARTH_GM
"""Ratio m of centrifugal to gravitational acceleration at the equator."""

ALLAN_FLOOR = math.sqrt(2.0 * math.log(2.0) / math.pi)
"""Allan deviation of flicker noise over its bias instability coefficient B, 0.664 (IEEE Std 952-1997, annex C)."""

STANDARD_GRAVITY = 9.80665
"""The unit g [m/s^2]; a unit conversion, not a model of gravity."""

TWO_PI = 2.0 * math.pi
"""One turn [rad]."""

LIGHT_SPEED = 299792458.0
"""Speed of light in vacuum [m/s] (defining, 17th CGPM, 1983)."""
