"""Perfect increments of every vehicle, mechanized again in both frames, give the motion back."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.imu.increments import to_increments
from navfuse.simulation import perfect_imu, sample_times
from reference.engine_runs import mechanize, nav_at
from reference.missions import NAMES, mission
from reference.navigation_algebra import error

FRAMES = pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])
FORMS = pytest.mark.parametrize("form", ["integrals", "inverse"])
RIGID = tuple(name for name in NAMES if name != "pedestrian")


def drift(motion, time, ecef, form="integrals"):
    """Error at the last stamp: horizontal and whole position [m], velocity [m/s], attitude [deg]."""
    increments = to_increments(perfect_imu(motion, time, form=form))
    nav, _ = mechanize(increments, nav_at(motion, time[0], ecef), ecef)
    d = error(nav_at(motion, time[-1], ecef), nav, ecef).reshape(3, 3)
    up = motion.r_e(time[-1]) / np.linalg.norm(motion.r_e(time[-1]))
    vertical = abs(d[0] @ up) if ecef else abs(d[0, 2])
    whole = np.linalg.norm(d[0])
    return math.sqrt(max(whole**2 - vertical**2, 0.0)), whole, np.linalg.norm(d[1]), math.degrees(np.linalg.norm(d[2]))


def uneven_times(end, seed=0):
    """Stamps about 10 ms apart, by up to a fifth more or less."""
    steps = 0.01 * np.random.default_rng(seed).uniform(0.8, 1.2, int(120 * end))
    time = np.concatenate([[0.0], np.cumsum(steps)])
    return time[time < end]


@pytest.fixture(params=NAMES, name="ten_minutes", scope="module")
def _ten_minutes(request):
    return request.param, mission(request.param, 601.0)


@FRAMES
def test_ten_minutes_at_100_hz_come_back_within_a_millimetre(ten_minutes, ecef):
    name, motion = ten_minutes
    _, position, velocity, attitude = drift(motion, sample_times(0.0, 600.0, 100.0), ecef)
    if name == "pedestrian":
        assert position < 0.2
        assert velocity < 1e-3
        assert attitude < 2e-4
        return
    assert position < 1e-4
    assert velocity < 1e-6
    assert attitude < 1e-7


@FRAMES
@pytest.mark.parametrize(
    "rate",
    [pytest.param(50.0, marks=pytest.mark.slow), 100.0, pytest.param(200.0, marks=pytest.mark.slow), "uneven"],
)
def test_ten_minutes_of_inverse_increments_come_back_within_a_millimetre(ten_minutes, rate, ecef):
    _, motion = ten_minutes
    time = uneven_times(600.0) if rate == "uneven" else sample_times(0.0, 600.0, rate)
    _, position, velocity, attitude = drift(motion, time, ecef, "inverse")
    assert position < 1e-3
    assert velocity < (1e-13 if ecef else 1e-7)
    assert attitude < (1e-12 if ecef else 1e-8)


@FRAMES
@FORMS
@pytest.mark.parametrize(("lat", "lon"), [(0.5 * math.pi, 0.0), (-0.5 * math.pi, 1.0), (0.0, math.pi)])
@pytest.mark.parametrize("name", NAMES)
def test_it_is_so_anywhere_on_earth(name, lat, lon, form, ecef):
    if not ecef and abs(lat) > 1.5:
        lat = math.copysign(1.5, lat)
    motion = mission(name, 61.0, lat=lat, lon=lon)
    _, position, _, attitude = drift(motion, sample_times(0.0, 60.0, 100.0), ecef, form)
    on_foot = name == "pedestrian" and form == "integrals"
    assert position < (2e-2 if on_foot else 1e-4)
    assert attitude < (2e-4 if on_foot else 1e-6)


@FRAMES
def test_a_foot_comes_back_with_the_fourth_power_of_the_interval(ecef):
    motion = mission("pedestrian", 61.0)
    coarse, middle, fine = (drift(motion, sample_times(0.0, 60.0, rate), ecef) for rate in (100.0, 200.0, 400.0))
    assert coarse[1] < 0.02
    assert coarse[1] / middle[1] == pytest.approx(16.0, rel=0.25)
    assert coarse[3] / middle[3] == pytest.approx(16.0, rel=0.25)
    assert middle[3] / fine[3] == pytest.approx(16.0, rel=0.25)


@pytest.mark.slow
@FRAMES
def test_ten_minutes_on_foot_come_back_within_a_millimetre_at_400_hz(ecef):
    _, position, _, attitude = drift(mission("pedestrian", 601.0), sample_times(0.0, 600.0, 400.0), ecef)
    assert position < 1e-3
    assert attitude < 1e-6


@pytest.mark.slow
@FRAMES
@FORMS
@pytest.mark.parametrize("name", NAMES)
def test_an_hour_at_100_hz_comes_back_within_a_decimetre(name, form, ecef):
    horizontal, _, _, attitude = drift(mission(name, 3601.0), sample_times(0.0, 3600.0, 100.0), ecef, form)
    on_foot = name == "pedestrian" and form == "integrals"
    assert horizontal < (10.0 if on_foot else 0.1)
    assert attitude < (1e-3 if on_foot else 1e-6)
