from __future__ import annotations

import math
from decimal import Decimal, localcontext

import numpy as np
import pymap3d
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfuse.core import constants, earth

DEG = math.pi / 180.0
LATITUDES = np.array([-90.0, -89.999999, -60.0, -1e-7, 0.0, 1e-7, 30.5, 45.0, 89.0, 89.9999999, 90.0]) * DEG


def decimal_geodetic(x, y, z):
    """Latitude and height by Newton's method on the Lagrange multiplier of the foot point, with 60 digits.

    The point minus its foot is t times the gradient of the ellipsoid, so p = (1 + t/a^2) p0 and z = (1 + t/b^2) z0.
    """
    with localcontext(prec=60):
        x, y, z = Decimal(float(x)), Decimal(float(y)), Decimal(float(z))
        a = Decimal(6378137)
        b = a * (1 - 1 / Decimal("298.257223563"))
        p, depth = (x * x + y * y).sqrt(), abs(z)
        t = max(b * depth - b * b, a * p - a * a)
        for _ in range(200):
            u, v = a * p / (a * a + t), b * depth / (b * b + t)
            step = (u * u + v * v - 1) / (2 * (u * u / (a * a + t) + v * v / (b * b + t)))
            t += step
            if abs(step) < Decimal("1e-30"):
                break
        else:
            raise AssertionError("the twin has not converged")
        foot_p, foot_z = a * a * p / (a * a + t), b * b * depth / (b * b + t)
        height = ((p - foot_p) ** 2 + (depth - foot_z) ** 2).sqrt().copy_sign(t)
        lat = math.atan2(a * a * foot_z, b * b * foot_p)
    return math.copysign(lat, z), height


def decimal_difference(value, exact):
    return abs(float(Decimal(float(value)) - exact))


def random_points(smallest, largest, n, seed):
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    return direction * np.exp(rng.uniform(math.log(smallest), math.log(largest), n))[:, None]


def exact_normal_gravity(lat, h):
    """Gravity of the level ellipsoid in ellipsoidal-harmonic coordinates (NIMA TR8350.2, eqs. 4-5 to 4-17)."""
    a, f = constants.WGS84_A, constants.WGS84_F
    b = a * (1.0 - f)
    e2 = a * a - b * b
    e = math.sqrt(e2)
    p, _, z = pymap3d.geodetic2ecef(lat / DEG, 0.0, h)
    t = p * p + z * z - e2
    u = math.sqrt(0.5 * t * (1.0 + math.sqrt(1.0 + 4.0 * e2 * z * z / (t * t))))
    r2 = u * u + e2
    sin_beta, cos_beta = z / u, p / math.sqrt(r2)

    def series(term):
        return sum((-1.0) ** k / ((2 * k + 3.0) * (2 * k + 5.0)) * term(k) for k in range(12))

    def q(v):
        return series(lambda k: 2.0 * (k + 1.0) * (e / v) ** (2 * k + 3))

    def q_prime(v):
        return series(lambda k: 6.0 * (e / v) ** (2 * k + 2))

    w = math.sqrt((u * u + e2 * sin_beta**2) / r2)
    wa2 = (constants.EARTH_RATE * a) ** 2
    attraction = constants.EARTH_GM / r2 + wa2 * e / r2 * q_prime(u) / q(b) * (0.5 * sin_beta**2 - 1.0 / 6.0)
    along_u = (constants.EARTH_RATE**2 * u * cos_beta**2 - attraction) / w
    along_beta = (wa2 / math.sqrt(r2) * q(u) / q(b) - constants.EARTH_RATE**2 * math.sqrt(r2)) * sin_beta * cos_beta / w
    return math.hypot(along_u, along_beta)


def test_constants_are_the_published_ones():
    assert constants.WGS84_B == pytest.approx(6356752.314245179, abs=1e-9)
    assert constants.WGS84_E2 == pytest.approx(6.69437999014132e-3, abs=1e-17)
    assert constants.WGS84_EP2 == pytest.approx(6.73949674227643e-3, abs=1e-17)
    assert constants.SOMIGLIANA_K == pytest.approx(0.00193185265241, abs=5e-12)
    assert constants.GRAVITY_M == pytest.approx(0.00344978650684, abs=1e-14)
    assert constants.TWO_PI == 2.0 * math.pi


@pytest.mark.parametrize("lat", LATITUDES)
def test_radii_against_pymap3d(lat):
    r_meridian, r_transverse = earth.radii(math.sin(lat))
    assert r_meridian == pytest.approx(pymap3d.rcurve.meridian(lat, deg=False), abs=1e-8)
    assert r_transverse == pytest.approx(pymap3d.rcurve.transverse(lat, deg=False), abs=1e-8)


def test_radii_at_pole_and_equator():
    a, b = constants.WGS84_A, constants.WGS84_B
    assert earth.radii(1.0) == pytest.approx((a * a / b, a * a / b), abs=5e-9)
    assert earth.radii(0.0) == pytest.approx((b * b / a, a), abs=5e-9)


def test_gravity_on_the_ellipsoid():
    assert earth.normal_gravity(0.0, 0.0) == constants.GAMMA_EQUATOR
    assert earth.normal_gravity(1.0, 0.0) == pytest.approx(constants.GAMMA_POLE, abs=1e-14)
    assert earth.normal_gravity(-1.0, 0.0) == earth.normal_gravity(1.0, 0.0)
    assert earth.normal_gravity(math.sqrt(0.5), 0.0) == pytest.approx(9.806197769, abs=1e-9)


@pytest.mark.parametrize(
    ("h", "bar"), [(0.0, 1e-10), (-400.0, 1e-7), (1e3, 1.1e-7), (5e3, 5e-7), (2e4, 2e-6), (1e5, 2e-4)]
)
def test_gravity_against_the_exact_normal_field(h, bar):
    errors = [earth.normal_gravity(math.sin(lat), h) - exact_normal_gravity(lat, h) for lat in LATITUDES]
    assert np.max(np.abs(errors)) < bar


def test_gravity_falls_by_the_free_air_gradient():
    gradient = (earth.normal_gravity(0.5, 100.0) - earth.normal_gravity(0.5, -100.0)) / 200.0
    assert gradient == pytest.approx(-3.086e-6, abs=2e-9)


@pytest.mark.parametrize(
    ("smallest", "largest"), [(4.5e4, 1e6), (1e6, 6.3e6), (6.34e6, 6.5e6), (6.5e6, 8e6), (8e6, 1e8)]
)
def test_ecef_to_geodetic_against_sixty_digits(smallest, largest):
    for point in random_points(smallest, largest, 300, seed=int(smallest)):
        lat, lon, h = earth.ecef_to_geodetic(*point)
        exact_lat, exact_h = decimal_geodetic(*point)
        assert abs(lat - exact_lat) < 1e-15
        assert abs(lon - math.atan2(point[1], point[0])) == 0.0
        assert decimal_difference(h, exact_h) < max(5e-10, 2.0 * math.ulp(h))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_ecef_to_geodetic_next_to_the_planes_of_symmetry(axis):
    rng = np.random.default_rng(axis)
    for offset in (1e-300, 1e-12, 1e-6, 1e-3, 1.0, 100.0):
        point = rng.normal(size=3) * 5e6
        point[axis] = offset
        if axis < 2 and offset < 1.0:
            point[1 - axis] = offset
        lat, _, h = earth.ecef_to_geodetic(*point)
        exact_lat, exact_h = decimal_geodetic(*point)
        assert abs(lat - exact_lat) < 1e-15
        assert decimal_difference(h, exact_h) < 1e-9


def test_ecef_to_geodetic_against_pyproj_and_pymap3d_near_the_ground():
    rng = np.random.default_rng(8)
    lat, lon = rng.uniform(-math.pi / 2, math.pi / 2, 500), rng.uniform(-math.pi, math.pi, 500)
    h = rng.uniform(-500.0, 9000.0, 500)
    transformer = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    points = np.stack(transformer.transform(lon / DEG, lat / DEG, h), axis=1)
    ours = earth.ecef_to_geodetic_batch(points)
    for other in ((lat, lon, h), pymap3d.ecef2geodetic(*points.T, deg=False)):
        assert np.max(np.abs(ours[0] - other[0])) < 1e-12
        assert np.max(np.abs(ours[1] - other[1])) < 1e-12
        assert np.max(np.abs(ours[2] - other[2])) < 5e-9


@given(
    lat=st.floats(-math.pi / 2, math.pi / 2),
    lon=st.floats(-math.pi, math.pi),
    h=st.one_of(st.floats(-6.3e6, 1e4), st.floats(-500.0, 2e4), st.floats(1e4, 1e8)),
)
def test_geodetic_round_trip(lat, lon, h):
    x, y, z = earth.geodetic_to_ecef(lat, lon, h)
    lat_back, lon_back, h_back = earth.ecef_to_geodetic(x, y, z)
    assert abs(lat_back - lat) < 1e-12
    assert abs(lon_back - lon) * math.cos(lat) < 1e-12
    assert abs(h_back - h) < (1e-9 if abs(h) < 1e5 else 2.5 * math.ulp(max(abs(h), math.hypot(x, y, z))))


@pytest.mark.parametrize("h", [0.0, -400.0, 9000.0, 4e5, 2e7, 1e8])
def test_geodetic_to_ecef_against_sixty_digits(h):
    rng = np.random.default_rng(5)
    for lat, lon in zip(rng.uniform(-math.pi / 2, math.pi / 2, 100), rng.uniform(-math.pi, math.pi, 100), strict=True):
        point = earth.geodetic_to_ecef(lat, lon, h)
        exact_lat, exact_h = decimal_geodetic(*point)
        assert abs(lat - exact_lat) < 1e-15
        assert abs(lon - math.atan2(point[1], point[0])) < 1e-15
        assert decimal_difference(h, exact_h) < max(1e-9, 1.5 * math.ulp(h))


def test_geodetic_to_ecef_against_pymap3d():
    rng = np.random.default_rng(6)
    lat, lon = rng.uniform(-math.pi / 2, math.pi / 2, 500), rng.uniform(-math.pi, math.pi, 500)
    h = rng.uniform(-1e3, 1e5, 500)
    other = np.stack(pymap3d.geodetic2ecef(lat, lon, h, deg=False), axis=1)
    assert np.max(np.abs(earth.geodetic_to_ecef_batch(lat, lon, h) - other)) < 5e-9


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("h", [-6.3e6, -1e4, 0.0, 1e4, 1e8])
def test_poles(sign, h):
    lat, lon, height = earth.ecef_to_geodetic(0.0, 0.0, sign * (constants.WGS84_B + h))
    assert (lat, lon) == (sign * math.pi / 2, 0.0)
    assert height == pytest.approx(h, abs=1e-9)
    x, y, z = earth.geodetic_to_ecef(sign * math.pi / 2, 1.0, h)
    assert math.hypot(x, y) < 1e-8
    assert z == pytest.approx(sign * (constants.WGS84_B + h), abs=1e-9)


@pytest.mark.parametrize("h", [-6.3e6, 0.0, 1e8])
def test_equator_and_date_line(h):
    r = constants.WGS84_A + h
    assert earth.ecef_to_geodetic(r, 0.0, 0.0) == (0.0, 0.0, h)
    assert earth.ecef_to_geodetic(0.0, r, 0.0) == (0.0, math.pi / 2, h)
    assert earth.ecef_to_geodetic(-r, 0.0, 0.0) == (0.0, math.pi, h)
    assert earth.ecef_to_geodetic(-r, -0.0, 0.0) == (0.0, -math.pi, h)
    assert earth.ecef_to_geodetic(-r, -1e-9, 0.0)[1] == pytest.approx(-math.pi, abs=1e-13)
    west, east = earth.geodetic_to_ecef(0.0, -math.pi, h), earth.geodetic_to_ecef(0.0, math.pi, h)
    assert np.max(np.abs(np.subtract(west, east))) < 3e-16 * r


@pytest.mark.parametrize(("lowest", "highest", "bar"), [(-1e4, 2e4, 5e-9), (2e4, 1e6, 5e-9), (1e6, 1e7, 2e-8)])
def test_the_quick_ellipsoid_normal_is_the_exact_one(lowest, highest, bar):
    rng = np.random.default_rng(10)
    latitudes = np.concatenate((LATITUDES, rng.uniform(-math.pi / 2, math.pi / 2, 500)))
    for lat, lon, h in zip(latitudes, rng.uniform(-3, 3, 511), rng.uniform(lowest, highest, 511), strict=True):
        p, cos_lat, sin_lat, height = earth.ellipsoid_normal(*earth.geodetic_to_ecef(lat, lon, h))
        assert p >= 0.0
        assert abs(cos_lat - math.cos(lat)) < 3e-13
        assert abs(sin_lat - math.sin(lat)) < 3e-13
        assert abs(height - h) < bar


def test_nan_is_not_hidden():
    assert all(math.isnan(v) for v in earth.ecef_to_geodetic(math.nan, 1.0, 6e6)[1:])
    assert math.isnan(earth.ecef_to_geodetic(1.0, 2.0, math.nan)[0])
    assert math.isnan(earth.ecef_to_geodetic(0.0, 0.0, 0.0)[2])


@pytest.mark.parametrize("lat", LATITUDES[1:-1])
@pytest.mark.parametrize("lon", [-math.pi, -1.0, 0.0, 2.0, math.pi])
def test_columns_of_dcm_en_are_north_east_down(lat, lon):
    C_en = np.reshape(earth.dcm_en(lat, lon), (3, 3))
    assert np.max(np.abs(C_en.T @ C_en - np.eye(3))) < 5e-16
    assert np.linalg.det(C_en) == pytest.approx(1.0, abs=1e-15)
    r_meridian, r_transverse = earth.radii(math.sin(lat))
    step = 1e-4
    north = np.subtract(earth.geodetic_to_ecef(lat + step, lon, 0.0), earth.geodetic_to_ecef(lat - step, lon, 0.0))
    east = np.subtract(earth.geodetic_to_ecef(lat, lon + step, 0.0), earth.geodetic_to_ecef(lat, lon - step, 0.0))
    down = np.subtract(earth.geodetic_to_ecef(lat, lon, -1e3), earth.geodetic_to_ecef(lat, lon, 1e3))
    assert np.max(np.abs(north / (2 * step * r_meridian) - C_en[:, 0])) < 1e-8
    assert np.max(np.abs(east / (2 * step * r_transverse) - math.cos(lat) * C_en[:, 1])) < 1e-8
    assert np.max(np.abs(down / 2e3 - C_en[:, 2])) < 1e-11


@pytest.mark.parametrize("lat", LATITUDES)
def test_earth_rate_is_along_the_axis(lat):
    C_en = np.reshape(earth.dcm_en(lat, 0.7), (3, 3))
    w_ie_e = C_en @ earth.earth_rate_n(math.sin(lat), math.cos(lat))
    assert np.max(np.abs(w_ie_e - [0.0, 0.0, constants.EARTH_RATE])) < 1e-19


@pytest.mark.parametrize("lat", LATITUDES[2:-2])
def test_transport_rate_turns_the_level_frame(lat):
    lon, h, vn, ve = 0.4, 3000.0, 120.0, -75.0
    r_meridian, r_transverse = earth.radii(math.sin(lat))
    lat_rate, lon_rate = vn / (r_meridian + h), ve / ((r_transverse + h) * math.cos(lat))
    dt = 0.1
    later = np.reshape(earth.dcm_en(lat + lat_rate * dt, lon + lon_rate * dt), (3, 3))
    sooner = np.reshape(earth.dcm_en(lat - lat_rate * dt, lon - lon_rate * dt), (3, 3))
    turn = np.reshape(earth.dcm_en(lat, lon), (3, 3)).T @ (later - sooner) / (2.0 * dt)
    expected = [turn[2, 1], turn[0, 2], turn[1, 0]]
    assert earth.transport_rate_n(math.sin(lat), math.cos(lat), h, vn, ve) == pytest.approx(expected, abs=1e-12)


def test_transport_rate_is_not_finite_at_a_pole():
    assert math.isinf(earth.transport_rate_n(1.0, 0.0, 0.0, 0.0, 1.0)[2])


@pytest.mark.parametrize("lat", LATITUDES)
@pytest.mark.parametrize("h", [-400.0, 0.0, 12000.0])
def test_gravity_e_is_normal_gravity_down_the_ellipsoid_normal(lat, h):
    lon = 2.3
    g_e = np.array(earth.gravity_e(*earth.geodetic_to_ecef(lat, lon, h)))
    down = np.reshape(earth.dcm_en(lat, lon), (3, 3))[:, 2]
    assert np.max(np.abs(g_e - earth.normal_gravity(math.sin(lat), h) * down)) < 3e-12


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_gravity_e_on_the_axis(sign):
    g = earth.gravity_e(0.0, 0.0, sign * constants.WGS84_B)
    assert g == pytest.approx((0.0, 0.0, -sign * constants.GAMMA_POLE), abs=1e-14)


def test_batches_are_the_scalar_functions():
    points = random_points(6e6, 7e6, 20, seed=9)
    lat, lon, h = earth.ecef_to_geodetic_batch(points)
    r_e = earth.geodetic_to_ecef_batch(lat, lon, h)
    for k, point in enumerate(points):
        assert (lat[k], lon[k], h[k]) == earth.ecef_to_geodetic(*point)
        assert tuple(r_e[k]) == earth.geodetic_to_ecef(lat[k], lon[k], h[k])
