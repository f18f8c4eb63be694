from __future__ import annotations

import math
import sys

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from navfuse.core.earth import geodetic_to_ecef_batch
from navfuse.errors import ConfigError, InputError
from navfuse.io.earth_magnetism import magnetic_field_along, magnetic_field_n
from navfuse.simulation import (
    MagnetometerModel,
    circle_flight,
    measure_magnetometer,
    static,
)
from reference.aiding_sensors import FIELD_UT, attitude_b, sway, within_chi_square

UT = 1e-6


def measure(motion, seed=0, **keys):
    model = MagnetometerModel.from_datasheet(**({"field_ut": FIELD_UT} | keys))
    return measure_magnetometer(motion, model, np.random.default_rng(seed))


@pytest.fixture(name="tripod", scope="module")
def _tripod():
    return static(4000.0, 0.8, 0.2, 50.0)


@pytest.mark.parametrize(
    ("year", "height_km", "lat", "lon", "x", "y", "z"),
    [
        (2025.0, 0.0, 80.0, 0.0, 6521.6, 145.9, 54791.5),
        (2025.0, 0.0, 0.0, 120.0, 39677.8, -109.6, -10580.2),
        (2025.0, 0.0, -80.0, 240.0, 6117.5, 15751.9, -52022.5),
        (2025.0, 100.0, 80.0, 0.0, 6216.0, 92.4, 52598.8),
        (2025.0, 100.0, 0.0, 120.0, 37688.6, -96.2, -10152.1),
        (2025.0, 100.0, -80.0, 240.0, 5907.6, 14780.3, -49540.7),
        (2027.5, 0.0, 80.0, 0.0, 6500.8, 294.5, 54869.4),
        (2027.5, 0.0, 0.0, 120.0, 39701.6, -167.4, -10381.8),
        (2027.5, 0.0, -80.0, 240.0, 6200.7, 15730.3, -51783.7),
        (2027.5, 100.0, 80.0, 0.0, 6196.7, 233.8, 52670.5),
        (2027.5, 100.0, 0.0, 120.0, 37711.5, -148.7, -9969.8),
        (2027.5, 100.0, -80.0, 240.0, 5984.0, 14760.1, -49317.7),
        (2020.0, 0.0, 80.0, 0.0, 6570.4, -146.3, 54606.0),
        (2022.5, 100.0, -80.0, 240.0, 5815.0, 14803.0, -49755.3),
    ],
)
def test_the_published_values_of_the_world_magnetic_model(year, height_km, lat, lon, x, y, z):
    """WMM2025 and WMM2020 test values, in nanotesla to one decimal."""
    found = magnetic_field_n(math.radians(lat), math.radians(lon), 1e3 * height_km, year)
    np.testing.assert_allclose(1e9 * found, [[x, y, z]], atol=0.0501)


@pytest.mark.parametrize(
    ("lat", "lon", "azimuth", "height"),
    [(48.0, 11.0, 20.0, 0.0), (-33.0, 151.0, 250.0, 12e3), (0.0, 179.5, 90.0, 1e3), (89.0, 0.0, 0.0, 5e3),
     (-80.0, 100.0, 135.0, 9e3)],
)  # fmt: skip
def test_along_a_track_it_is_continued_to_a_tenth_of_a_nanotesla(lat, lon, azimuth, height):
    reach = np.linspace(0.0, 150e3, 301)
    side = 4e3 * np.sin(reach / 10e3)
    north = reach * math.cos(math.radians(azimuth)) - side * math.sin(math.radians(azimuth))
    east = reach * math.sin(math.radians(azimuth)) + side * math.cos(math.radians(azimuth))
    r_e = np.column_stack(pymap3d.enu2ecef(east, north, height + reach * 0.05, lat, lon, 0.0))
    places = np.radians(np.column_stack(pymap3d.ecef2geodetic(*r_e.T)))
    heights = pymap3d.ecef2geodetic(*r_e.T)[2]
    exact_n = magnetic_field_n(places[:, 0], places[:, 1], heights, 2026.3)
    exact_e = np.column_stack(
        pymap3d.enu2uvw(exact_n[:, 1], exact_n[:, 0], -exact_n[:, 2], *np.degrees(places[:, :2]).T)
    )
    error = 1e9 * np.linalg.norm(magnetic_field_along(r_e, 2026.3) - exact_e, axis=1)
    assert error.max() < 0.1
    assert error.max() > 1e-4


def test_level_and_north_it_reads_the_horizontal_field_on_x_and_down_on_z():
    motion = static(10.0, math.radians(48.0), math.radians(11.0), 500.0)
    heading = motion.trajectory(np.array([1.0])).attitude[0, 2]
    log, truth = measure_magnetometer(motion, MagnetometerModel(year=2026.0), np.random.default_rng(0))
    north, east, down = magnetic_field_n(math.radians(48.0), math.radians(11.0), 500.0, 2026.0)[0]
    assert north > 15e-6
    assert down > 35e-6
    turned = Rotation.from_euler("Z", heading).apply(log.field_b)
    np.testing.assert_allclose(turned, np.tile([north, east, down], (log.time.size, 1)), atol=2e-12)
    declination = math.atan2(east, north)
    yaw = np.arctan2(-log.field_b[:, 1], log.field_b[:, 0]) + declination
    np.testing.assert_allclose(np.angle(np.exp(1j * (yaw - heading))), 0.0, atol=1e-7)
    np.testing.assert_allclose(np.arctan2(truth.field_n[:, 1], truth.field_n[:, 0]), declination, atol=1e-7)


def test_south_of_the_magnetic_equator_the_field_points_up():
    motion = static(10.0, math.radians(-33.0), math.radians(151.0), 50.0)
    log, _ = measure_magnetometer(motion, MagnetometerModel(), np.random.default_rng(0))
    assert log.field_b[:, 2].max() < -40e-6


@pytest.mark.parametrize("field", [None, FIELD_UT])
def test_without_errors_it_is_the_field_turned_into_the_body(field):
    motion = sway()
    keys = {} if field is None else {"field_ut": field}
    log, truth = measure_magnetometer(
        motion, MagnetometerModel.from_datasheet(rate_hz=2.0, **keys), np.random.default_rng(0)
    )
    place = motion.trajectory(log.time)
    if field is None:
        field_n = magnetic_field_n(place.lat, place.lon, place.height, 2026.0)
    else:
        field_n = np.tile(np.array(field) * UT, (log.time.size, 1))
    twin = attitude_b(motion, log.time).apply(field_n, inverse=True)
    np.testing.assert_allclose(log.field_b, twin, atol=1e-10)
    np.testing.assert_allclose(truth.field_n, field_n, atol=1e-10)
    assert np.ptp(log.field_b, axis=0).min() > 10e-6


def test_the_log_is_made_of_the_stated_parts_and_rounded():
    motion = sway()
    steel = {"disturbances_s": [[10.0, 20.0], [15.0, 30.0]], "disturbance_ut": [[10.0, 0.0, 0.0], [0.0, 0.0, -5.0]]}
    iron = {"hard_iron_ut": (5.0, -3.0, 8.0), "soft_iron": [[1.05, 0.02, 0.0], [-0.03, 0.97, 0.01], [0.04, 0.0, 1.0]]}
    sensor = {"scale_sd_percent": 1.0, "misalignment_sd_deg": 1.0, "field_sd_nt": 100.0, "field_lsb_nt": 300.0}
    log, truth = measure(motion, **steel, **iron, **sensor)
    np.testing.assert_array_equal(truth.soft_iron, iron["soft_iron"])
    np.testing.assert_allclose(truth.hard_iron, np.array(iron["hard_iron_ut"]) * UT)
    felt = np.stack([truth.soft_iron @ row + truth.hard_iron for row in truth.field_b + truth.disturbance_b])
    expected = np.stack([truth.sensor @ row for row in felt]) + truth.noise
    assert abs(log.field_b - expected).max() <= 0.15e-6 + 1e-15
    np.testing.assert_allclose(log.field_b / 0.3e-6, np.rint(log.field_b / 0.3e-6), atol=1e-6)
    for at, offset in ((9.9, (0.0, 0.0, 0.0)), (10.0, (10.0, 0.0, 0.0)), (16.0, (10.0, 0.0, -5.0)), (30.0, (0.0,) * 3)):
        row = np.argmin(abs(truth.true_time - at))
        np.testing.assert_allclose(truth.disturbance_b[row], np.array(offset) * UT, atol=1e-18)


def test_steel_beside_the_road_keeps_its_direction_over_ground():
    motion = sway()
    keys = {"disturbances_s": [[0.0, 1000.0]], "disturbance_ut": [3.0, -4.0, 1.0]}
    _, truth = measure(motion, disturbance_frame="level", **keys)
    turned = attitude_b(motion, truth.true_time).apply(truth.disturbance_b)
    np.testing.assert_allclose(turned, np.tile([3e-6, -4e-6, 1e-6], (truth.true_time.size, 1)), atol=1e-12)


def test_errors_have_the_stated_deviations(tripod):
    _, truth = measure(tripod, rate_hz=1.0, field_sd_ut=(0.1, 0.2, 0.3), correlated_sd_ut=(1.0, 2.0, 3.0),
                       correlated_tau_s=20.0)  # fmt: skip
    assert within_chi_square(truth.noise, np.array([0.1, 0.2, 0.3]) * UT)
    path = truth.disturbance_b / (np.array([1.0, 2.0, 3.0]) * UT)
    decay = math.exp(-1.0 / 20.0)
    assert within_chi_square(path[1:] - decay * path[:-1], math.sqrt(1.0 - decay**2))


def test_what_is_drawn_once_has_the_stated_deviations():
    short = static(2.0)
    keys = {"hard_iron_ut": (1.0, 2.0, 3.0), "hard_iron_sd_ut": (5.0, 6.0, 7.0), "soft_iron_sd_percent": 3.0,
            "scale_sd_percent": (1.0, 2.0, 3.0), "misalignment_sd_deg": 0.5}  # fmt: skip
    truths = [measure(short, seed, **keys)[1] for seed in range(500)]
    assert within_chi_square(np.array([t.hard_iron for t in truths]) - np.array([1, 2, 3]) * UT,
                             np.array([5, 6, 7]) * UT)  # fmt: skip
    assert within_chi_square(np.array([(t.soft_iron - np.eye(3)).ravel() for t in truths]), 0.03)
    assert within_chi_square(np.array([np.diag(t.sensor) - 1.0 for t in truths]), [0.01, 0.02, 0.03])
    off = ~np.eye(3, dtype=bool)
    assert within_chi_square(np.array([t.sensor[off] for t in truths]), math.radians(0.5))


def test_random_disturbances_come_as_often_and_as_large_as_stated():
    keys = {"disturbances_per_h": 9.0, "disturbance_mean_s": 60.0, "disturbance_sd_ut": (5.0, 10.0, 20.0)}
    _, truth = measure(static(400_000.0), rate_hz=0.2, **keys)
    on = truth.disturbance_b.any(axis=1)
    begins = np.flatnonzero(on[1:] & ~on[:-1]) + 1
    assert within_chi_square(truth.disturbance_b[begins], np.array([5.0, 10.0, 20.0]) * UT)
    assert on.mean() == pytest.approx(1.0 - math.exp(-0.15), rel=3.5 * math.sqrt(2.0 / 1000.0))


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"field_ut": 50.0}, "field must be three finite numbers"),
        ({"year": "now"}, "year must be a number or an array of numbers"),
        ({"hard_iron_ut": (1.0, np.nan, 0.0)}, "hard_iron must be three finite numbers"),
        ({"soft_iron": 1.0}, "soft_iron must be a 3 x 3 matrix of finite numbers"),
        ({"soft_iron": np.diag([1.0, 1.0, -1.0])}, "soft_iron must have a positive determinant"),
        ({"field_sd_ut": (1.0, 2.0)}, "field_sd must be one number or three"),
        ({"correlated_sd_ut": 1.0}, r"correlated_sd needs correlated_tau > 0 \(inf for a constant\)"),
        ({"correlated_tau_s": -1.0}, "correlated_tau must be at least 0"),
        ({"disturbances_s": [[1.0, 2.0]]}, "three finite numbers for each of the 1 windows of disturbances"),
        ({"disturbance_ut": [1.0, 2.0, 3.0]}, "three finite numbers for each of the 0 windows of disturbances"),
        ({"disturbances_s": [[1.0, 2.0]], "disturbance_ut": [1.0, 2.0, np.inf]}, "three finite numbers for each"),
        ({"disturbance_frame": "earth"}, "disturbance_frame must be 'body' or 'level', not 'earth'"),
        ({"disturbances_per_h": 1.0}, "random disturbances need disturbance_frequency and disturbance_mean"),
    ],
)
def test_settings_that_make_no_sense_are_refused(keys, message):
    with pytest.raises(ConfigError, match=message):
        MagnetometerModel.from_datasheet(**keys)


@pytest.mark.parametrize("year", [2009.9, 2030.0])
def test_a_year_without_model_is_refused(year):
    with pytest.raises(ConfigError, match="is there for the years 2010 to 2030, not for"):
        measure_magnetometer(static(2.0), MagnetometerModel(year=year), np.random.default_rng(0))


def test_heights_outside_the_model_are_refused():
    with pytest.raises(InputError, match=r"holds from -1 to 850 km above the ellipsoid, not at -2 km"):
        magnetic_field_along(geodetic_to_ecef_batch(np.array([0.8]), np.array([0.2]), np.array([-2000.0])), 2026.0)


def test_without_the_package_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygeomag", None)
    with pytest.raises(ConfigError, match=r"the package pygeomag: install navfuse\[magnetic\], or give the"):
        measure_magnetometer(static(2.0), MagnetometerModel(), np.random.default_rng(0))
    log, _ = measure(circle_flight(20.0))
    assert np.linalg.norm(log.field_b, axis=1) == pytest.approx(np.linalg.norm(FIELD_UT) * UT)
