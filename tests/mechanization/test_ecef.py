"""What only the Earth-fixed mechanization can do, and that both frames give one trajectory."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.data.nav_state import to_ecef
from navfuse.simulation import car_drive, circle_flight, figure_eight_flight, static
from reference.engine_runs import mechanize, nav_at, perfect_increments
from reference.navigation_algebra import error


@pytest.mark.parametrize("lat", [0.5 * math.pi, -0.5 * math.pi], ids=["north pole", "south pole"])
@pytest.mark.parametrize("heading", [0.3, 2.9])
def test_drives_over_a_pole(lat, heading):
    motion = car_drive(120.0, seed=6, lat=lat, heading=heading, standing=2.0)
    nav, _ = mechanize(perfect_increments(motion, 100.0), nav_at(motion, 0.0, ecef=True), ecef=True)
    d = np.linalg.norm(error(nav_at(motion, 120.0, ecef=True), nav, ecef=True).reshape(3, 3), axis=1)
    assert d[0] < 2e-4
    assert d[1] < 1e-6
    assert d[2] < 1e-9


def test_stands_on_a_pole():
    motion = static(60.0, lat=0.5 * math.pi, heading=1.0, pitch=0.2)
    nav, _ = mechanize(perfect_increments(motion, 100.0), nav_at(motion, 0.0, ecef=True), ecef=True)
    d = np.linalg.norm(error(nav_at(motion, 60.0, ecef=True), nav, ecef=True).reshape(3, 3), axis=1)
    assert np.all(d < [1e-5, 1e-7, 1e-10])


@pytest.mark.parametrize(
    "motion",
    [
        car_drive(120.0, seed=8),
        figure_eight_flight(120.0, speed=120.0, bank=0.9, climb=400.0),
        circle_flight(120.0, lat=1.5, lon=3.1, speed=200.0),
    ],
    ids=["car", "aerobatic flight", "fast flight at 86 degrees"],
)
def test_agrees_with_the_local_level_mechanization(motion):
    increments = perfect_increments(motion, 100.0)
    earth, _ = mechanize(increments, nav_at(motion, 0.0, ecef=True), ecef=True)
    level, _ = mechanize(increments, nav_at(motion, 0.0, ecef=False), ecef=False)
    d = np.linalg.norm(error(to_ecef(level), earth, ecef=True).reshape(3, 3), axis=1)
    assert d[0] < 1e-5
    assert d[1] < 2e-7
    assert d[2] < 1e-9


def test_agrees_with_the_local_level_mechanization_a_kilometre_from_the_pole():
    motion = car_drive(60.0, seed=8, lat=0.5 * math.pi - 1.6e-4, heading=1.5, standing=2.0)
    increments = perfect_increments(motion, 200.0)
    earth, _ = mechanize(increments, nav_at(motion, 0.0, ecef=True), ecef=True)
    level, _ = mechanize(increments, nav_at(motion, 0.0, ecef=False), ecef=False)
    d = np.linalg.norm(error(to_ecef(level), earth, ecef=True).reshape(3, 3), axis=1)
    assert d[0] < 1e-4
    assert d[1] < 1e-5
    assert d[2] < 1e-7
