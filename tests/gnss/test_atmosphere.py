from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.gnss.atmosphere import ionosphere_obliquity, saastamoinen_zenith, troposphere_mapping


def test_known_answers():
    assert ionosphere_obliquity(math.pi / 2.0) == pytest.approx(1.0, abs=1e-15)
    assert troposphere_mapping(math.pi / 2.0) == pytest.approx(1.0, abs=1e-15)
    zenith_angle = math.asin(6371.0 / 6721.0 * math.cos(math.radians(20.0)))
    assert ionosphere_obliquity(math.radians(20.0)) == pytest.approx(1.0 / math.cos(zenith_angle), rel=1e-14)
    assert troposphere_mapping(math.radians(5.0)) == pytest.approx(10.2, abs=0.05)
    assert troposphere_mapping(math.radians(30.0)) == pytest.approx(1.001 / math.sqrt(0.252001), abs=1e-12)


def test_saastamoinen_in_the_standard_atmosphere():
    dry, wet = saastamoinen_zenith(math.pi / 4.0, 0.0)
    assert dry == pytest.approx(0.0022768 * 1013.25, abs=1e-12)
    saturated = 17.04  # hPa at 15 degrees, steam tables
    assert wet == pytest.approx(
        0.002277 * (1255.0 / 288.15 + 0.05) * 0.7 * saturated, rel=1e-2
    )  # Saastamoinen's curve of vapour lies 0.6 % higher
    pressure = {1000.0: 898.76, 5000.0: 540.20, 11_000.0: 226.32, 15_000.0: 120.45}  # hPa, 1976 standard atmosphere
    for height, hpa in pressure.items():
        gravity = 1.0 - 0.00028e-3 * min(height, 11_000.0)
        assert saastamoinen_zenith(math.pi / 4.0, height)[0] == pytest.approx(0.0022768 * hpa / gravity, rel=2e-3)


def test_the_dry_delay_is_larger_where_gravity_is_weaker_and_all_fall_with_height():
    poles, equator = saastamoinen_zenith(np.array([math.pi / 2.0, 0.0]), np.zeros(2))[0]
    assert equator / poles == pytest.approx(1.00266 / 0.99734, rel=1e-9)
    height = np.linspace(-400.0, 30_000.0, 200)
    dry, wet = saastamoinen_zenith(np.full(200, 0.5), height)
    assert np.all(np.diff(dry) < 0.0)
    assert np.all(np.diff(wet) <= 0.0)
    assert wet[-1] == 0.0
