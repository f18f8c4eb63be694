"""Positions that are repeated, with and without velocities, and a vehicle that stands."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.inspection.motion_checks import check_frozen
from navfuse.io.gnss_rows import GnssRows


def rows(north, velocity=None):
    time = np.arange(north.size, dtype=float)
    lat = 0.8 + north / 6371e3
    velocity_n = None if velocity is None else np.column_stack((velocity, 0.0 * velocity, 0.0 * velocity))
    return GnssRows(time=time, lat=lat, lon=np.full(north.size, 0.2), height=np.zeros(north.size),
                    sd_position=None, velocity_n=velocity_n, sd_velocity=None, fix=None, n_satellites=None)  # fmt: skip


@pytest.mark.parametrize("with_velocity", [True, False])
def test_a_repeated_position_is_told(with_velocity):
    north = 8.0 * np.arange(100.0)
    north[40:61] = north[40]
    (found,) = check_frozen(rows(north, np.full(100, 8.0) if with_velocity else None))
    assert found.figures["frozen_s"] == 20.0
    assert found.figures["from_s"] == 40.0
    assert found.figures["speed_mps"] == pytest.approx(8.0)


@pytest.mark.parametrize("with_velocity", [True, False])
def test_a_vehicle_that_stops_is_not(with_velocity):
    speed = np.concatenate((np.full(40, 8.0), np.linspace(8.0, 0.0, 5), np.zeros(40), np.full(40, 8.0)))
    north = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))))
    assert check_frozen(rows(north, speed if with_velocity else None)) == []
