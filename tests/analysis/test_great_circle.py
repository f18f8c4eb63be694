"""The haversine distance: known answers, a geodesic, and what it cannot see."""

from __future__ import annotations

import math

import numpy as np
import pyproj
import pytest
from pymap3d.vincenty import vdist

from navfuse.analysis.great_circle import MEAN_RADIUS, haversine

SPHERE = pyproj.Geod(a=MEAN_RADIUS, b=MEAN_RADIUS)
ELLIPSOID = pyproj.Geod(ellps="WGS84")


def test_known_answers():
    quarter = 0.5 * math.pi
    assert haversine(0.0, 0.0, 0.0, quarter) == pytest.approx(quarter * MEAN_RADIUS, rel=1e-15)
    assert haversine(0.0, 1.0, quarter, -2.0) == pytest.approx(quarter * MEAN_RADIUS, rel=1e-15)
    assert haversine(-quarter, 0.3, quarter, 2.0) == pytest.approx(math.pi * MEAN_RADIUS, rel=1e-15)
    assert haversine(0.7, -1.2, 0.7, -1.2) == 0.0
    assert MEAN_RADIUS == pytest.approx((2.0 * 6378137.0 + 6356752.314245) / 3.0, abs=1e-3)


def test_any_two_points_on_the_sphere():
    rng = np.random.default_rng(1)
    lat, lon = np.arcsin(rng.uniform(-1.0, 1.0, (2, 500))), rng.uniform(-np.pi, np.pi, (2, 500))
    found = haversine(lat[0], lon[0], lat[1], lon[1])
    _, _, expected = SPHERE.inv(*np.degrees([lon[0], lat[0], lon[1], lat[1]]))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(haversine(lat[1], lon[1], lat[0], lon[0]), found, rtol=1e-12)


@pytest.mark.parametrize("metres", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("lat", [0.0, 0.7, -1.5, np.pi / 2 - 1e-4])
def test_small_distances_lose_nothing(lat, metres):
    step = metres / MEAN_RADIUS
    assert haversine(lat, 1.0, lat - step, 1.0) == pytest.approx(metres, abs=5e-9)
    assert haversine(lat, 1.0, lat, 1.0 + step) == pytest.approx(metres * np.cos(lat), rel=1e-6, abs=5e-9)


def test_the_law_of_cosines_would_lose_them():
    lat, step = 0.7, 1e-2 / MEAN_RADIUS
    cosine = math.sin(lat) * math.sin(lat + step) + math.cos(lat) * math.cos(lat + step)
    assert abs(MEAN_RADIUS * math.acos(min(cosine, 1.0)) - 1e-2) > 1e-3
    assert haversine(lat, 0.0, lat + step, 0.0) == pytest.approx(1e-2, abs=5e-9)


def test_across_the_date_line():
    assert haversine(0.5, np.pi - 1e-7, 0.5, -np.pi + 1e-7) == pytest.approx(2e-7 * np.cos(0.5) * MEAN_RADIUS, rel=1e-6)


def test_the_ellipsoid_is_another_by_up_to_half_a_per_cent():
    """The bound of the docstring holds, and is reached along the meridian at the equator."""
    lat = np.radians(np.arange(-80.0, 81.0, 10.0))
    for azimuth in (0.0, 45.0, 90.0):
        lon_2, lat_2, _ = ELLIPSOID.fwd(
            np.zeros(lat.size), np.degrees(lat), np.full(lat.size, azimuth), np.full(lat.size, 1e3)
        )
        ratio = haversine(lat, np.zeros(lat.size), np.radians(lat_2), np.radians(lon_2)) / 1e3
        assert np.all(np.abs(ratio - 1.0) < 0.0057)
    short, _ = vdist(-1e-3, 0.0, 1e-3, 0.0)
    assert haversine(-np.radians(1e-3), 0.0, np.radians(1e-3), 0.0) / short == pytest.approx(1.00561, abs=2e-5)
