"""Perfect increments of every vehicle, mechanized again in both frames, give the motion back."""

from __future__ import annotations

import math

import numpy as np
import pytest

from reference.engine_runs import mechanize, nav_at, perfect_increments
from reference.missions import NAMES, mission
from reference.navigation_algebra import error

FRAMES = pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])
RIGID = tuple(name for name in NAMES if name != "pedestrian")


def drift(motion, rate, end, ecef):
    """Error at `end`: horizontal and whole position [m], velocity [m/s], attitude [deg]."""
    increments = perfect_increments(motion, rate, 0.0, end)
    nav, _ = mechanize(increments, nav_at(motion, 0.0, ecef), ecef)
    d = error(nav_at(motion, end, ecef), nav, ecef).reshape(3, 3)
    up = motion.r_e(end) / np.linalg.norm(motion.r_e(end))
    vertical = abs(d[0] @ up) if ecef else abs(d[0, 2])
    whole = np.linalg.norm(d[0])
    return math.sqrt(max(whole**2 - vertical**2, 0.0)), whole, np.linalg.norm(d[1]), math.degrees(np.linalg.norm(d[2]))


@pytest.fixture(params=RIGID, name="ten_minutes", scope="module")
def _ten_minutes(request):
    return mission(request.param, 601.0)


@FRAMES
def test_ten_minutes_at_100_hz_come_back_within_a_millimetre(ten_minutes, ecef):
    _, position, velocity, attitude = drift(ten_minutes, 100.0, 600.0, ecef)
    assert position < 1e-3
    assert velocity < 1e-5
    assert attitude < 1e-6


@FRAMES
@pytest.mark.parametrize(("lat", "lon"), [(0.5 * math.pi, 0.0), (-0.5 * math.pi, 1.0), (0.0, math.pi)])
@pytest.mark.parametrize("name", RIGID)
def test_it_is_so_anywhere_on_earth(name, lat, lon, ecef):
    if not ecef and abs(lat) > 1.5:
        lat = math.copysign(1.5, lat)
    motion = mission(name, 61.0, lat=lat, lon=lon)
    _, position, _, attitude = drift(motion, 100.0, 60.0, ecef)
    assert position < 2e-4
    assert attitude < 1e-6


@FRAMES
def test_a_foot_comes_back_with_the_third_power_of_the_interval(ecef):
    motion = mission("pedestrian", 61.0)
    coarse, middle, fine = (drift(motion, rate, 60.0, ecef)[1] for rate in (100.0, 200.0, 400.0))
    assert coarse < 0.1
    assert coarse / middle == pytest.approx(8.0, rel=0.25)
    assert middle / fine == pytest.approx(8.0, rel=0.25)


@pytest.mark.slow
@FRAMES
def test_ten_minutes_on_foot_come_back_within_a_millimetre_at_2_khz(ecef):
    motion = mission("pedestrian", 601.0)
    _, position, _, attitude = drift(motion, 2000.0, 600.0, ecef)
    assert position < 1e-3
    assert attitude < 1e-6


@pytest.mark.slow
@FRAMES
@pytest.mark.parametrize("name", RIGID)
def test_an_hour_at_100_hz_comes_back_within_a_decimetre(name, ecef):
    horizontal, _, _, attitude = drift(mission(name, 3601.0), 100.0, 3600.0, ecef)
    assert horizontal < 0.1
    assert attitude < 1e-6
