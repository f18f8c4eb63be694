from __future__ import annotations

import numpy as np
import pytest

from navfuse.errors import InputError, NavfuseWarning
from navfuse.io.gnss_plausibility import check_position_units, check_velocity_units, vertical_motion
from navfuse.io.gnss_table import read_gnss
from navfuse.io.tables import open_table, write_table

NAMES = ("lat_deg", "lon_deg", "height_m")
VELOCITY = ("vn_mps", "ve_mps", "vd_mps")


def drive(lat_deg=48.0, lon_deg=11.5, speed=12.0, n=300, noise=0.0):
    """Positions [rad, rad, m] and velocities of a round drive, 1 Hz."""
    time = np.arange(float(n))
    angle = 0.02 * time
    velocity = np.column_stack((speed * np.cos(angle), speed * np.sin(angle), 0.5 * np.sin(0.1 * time)))
    scatter = noise * np.random.default_rng(1).standard_normal((n, 2))
    north = speed / 0.02 * np.sin(angle) + scatter[:, 0]
    east = speed / 0.02 * (1.0 - np.cos(angle)) + scatter[:, 1]
    lat = np.radians(lat_deg) + north / 6371e3
    lon = np.radians(lon_deg) + east / 6371e3 / np.cos(np.radians(lat_deg))
    return time, lat, lon, 500.0 + 5.0 * np.cos(0.1 * time), velocity


def radians_as_degrees(time, lat, lon, height, velocity):
    return time, np.radians(lat), np.radians(lon), height, velocity


def test_degrees_pass():
    *position, velocity = drive()
    assert check_position_units(*position, velocity, NAMES, "f") == []
    assert check_position_units(*position, None, NAMES, "f") == []
    assert check_velocity_units(*position, velocity, VELOCITY, "f") == []


@pytest.mark.parametrize("lat_deg", [48.0, -75.0])
def test_radians_with_velocity_are_certain(lat_deg):
    time, lat, lon, height, velocity = radians_as_degrees(*drive(lat_deg=lat_deg, speed=200.0))
    with pytest.raises(InputError, match="only as radians do they move as the velocities say: rename them to lat_rad"):
        check_position_units(time, lat, lon, height, velocity, NAMES, "f")


@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_radians_without_velocity(noise):
    time, lat, lon, height, _ = radians_as_degrees(*drive(noise=noise))
    with pytest.raises(InputError, match="open sea in the Gulf of Guinea .* look like radians; rename them to lat_rad"):
        check_position_units(time, lat, lon, height, None, NAMES, "f")


def test_radians_with_velocity_that_tells_nothing():
    time, lat, lon, height, velocity = radians_as_degrees(*drive(speed=0.0))
    with pytest.raises(InputError, match="look like radians"):
        check_position_units(time, lat, lon, height, velocity, NAMES, "f")


def test_radian_columns_are_not_suspected():
    time, lat, lon, height, _ = radians_as_degrees(*drive())
    assert check_position_units(time, lat, lon, height, None, ("lat_rad", "lon_rad", "height_m"), "f") == []


def test_ship_in_the_gulf_of_guinea():
    *position, velocity = drive(lat_deg=0.7, lon_deg=2.0, speed=7.0)
    assert check_position_units(*position, velocity, NAMES, "f") == []
    assert check_position_units(*position, None, NAMES, "f") == []


def test_test_range_at_zero_zero():
    *position, _ = drive(lat_deg=0.0, lon_deg=0.0, speed=1.0)
    assert check_position_units(*position, None, NAMES, "f") == []
    *position, _ = drive(lat_deg=0.1, lon_deg=0.1, speed=1.0)
    (note,) = check_position_units(*position, None, NAMES, "f")
    assert "within 22 km of 0 N 0 E; if they are radians, rename them to lat_rad" in note


def test_two_fixes():
    time, lat, lon, height, velocity = (array[:2] for array in radians_as_degrees(*drive()))
    with pytest.raises(InputError, match="look like radians"):
        check_position_units(time, lat, lon, height, velocity, NAMES, "f")


def test_height_in_millimetres():
    time, lat, lon, height, velocity = drive()
    (note,) = check_position_units(time, lat, lon, 1000.0 * height, velocity, NAMES, "f")
    assert note == "f: column 'height_m': the median height is 500 km; is it in millimetres?"


def test_upward_velocity_in_a_downward_column():
    *position, velocity = drive()
    (note,) = check_velocity_units(*position, velocity * (1.0, 1.0, -1.0), VELOCITY, "f")
    assert "column 'vd_mps': the heights move -1.00 times" in note
    assert "is up positive" in note


def test_slow_climbs_tell_and_noise_of_heights_alone_does_not():
    """0.1 m/s of climb under 0.1 m of noise: too slow for rows a second apart, clear over ten seconds."""
    time = np.arange(600.0)
    down = -0.1 * np.sign(np.sin(2.0 * np.pi * time / 120.0))
    noise = 0.1 * np.random.default_rng(3).standard_normal(600)
    height = -np.concatenate(([0.0], np.cumsum(0.5 * (down[1:] + down[:-1])))) + noise
    assert abs(np.corrcoef(np.diff(height), down[1:])[0, 1]) < 0.7
    for factor, words in ((1.0, ""), (-1.0, "up positive"), (1.0 / 0.3048, "in feet")):
        motion = vertical_motion(time, factor * height, down)
        assert motion is not None
        assert motion.told
        assert motion.ratio == pytest.approx(factor, abs=4.0 * motion.sd)
        assert motion.odd == bool(words)
        assert not words or words in motion.fault
        assert motion.reversed == (factor == -1.0)
    motion = vertical_motion(time, noise, 0.02 * np.random.default_rng(4).standard_normal(600))
    assert motion is not None
    assert not motion.told
    assert vertical_motion(time, np.full(600, 5.0), down) is None
    assert vertical_motion(time[:20], height[:20], down[:20]) is None


def test_kmph_in_a_mps_column():
    *position, velocity = drive()
    (note,) = check_velocity_units(*position, velocity * (3.6, 3.6, 1.0), VELOCITY, "f")
    assert "column 'vn_mps', 've_mps': the positions move 0.28 times as fast" in note
    assert "are they km/h?" in note


def test_noise_and_outliers_raise_no_suspicion():
    *position, velocity = drive(noise=20.0)
    velocity = velocity + 100.0 * (np.random.default_rng(2).random((300, 3)) < 0.01)
    assert check_velocity_units(*position, velocity, VELOCITY, "f") == []


def test_standing_log_raises_no_suspicion():
    *position, velocity = drive(speed=0.0)
    assert check_velocity_units(*position, 0.0 * velocity, VELOCITY, "f") == []


def test_reader_passes_notes_on(write, gnss):
    gnss["vd_mps"] = -gnss["vd_mps"]
    gnss["height_m"] *= 1000.0
    with pytest.warns(NavfuseWarning) as caught:
        log = read_gnss(write(gnss))
    assert log.notes == tuple(str(warning.message) for warning in caught)
    assert "is it in millimetres" in log.notes[0]


@pytest.mark.parametrize("folder", ["car-1h-200hz", "rtklibexplorer-drive"])
def test_shared_logs_in_radians(shared_data, tmp_path, folder):
    table = open_table(shared_data / folder / "gnss.csv")
    columns = table.read([name for name in table.names if name != "fix"])
    columns |= {name: np.radians(columns[name]) for name in ("lat_deg", "lon_deg")}
    write_table(tmp_path / "gnss.csv", columns)
    with pytest.raises(InputError, match="radians.* rename them to lat_rad, lon_rad"):
        read_gnss(tmp_path / "gnss.csv")


@pytest.mark.parametrize(("column", "value"), [(0, 360.0), (1, -80.0), (2, 100.0)])
def test_velocities_of_another_world_are_refused(column, value):
    *position, velocity = drive()
    velocity[:, column] = value
    with pytest.raises(InputError, match=f"{VELOCITY[column]}.*are [0-9.]+ m/s away from how the positions move"):
        check_velocity_units(*position, velocity, VELOCITY, "f")


def test_a_velocity_column_of_zeros_is_noted():
    *position, velocity = drive(noise=2.0)
    velocity[:, 0] = 0.0
    (note,) = check_velocity_units(*position, velocity, VELOCITY, "f")
    assert "'vn_mps', 've_mps': over ten seconds these velocities are " in note


@pytest.mark.parametrize("flaw", ["noise", "outliers", "gaps", "holes", "few"])
def test_noisy_positions_are_not_held_against_the_velocities(flaw):
    time, lat, lon, height, velocity = drive(noise=5.0 if flaw == "noise" else 0.0)
    if flaw == "outliers":
        lat[::20] += 3000.0 / 6371e3
    if flaw == "gaps":
        time, lat, lon, height, velocity = (part[(time % 60.0) < 35.0] for part in (time, lat, lon, height, velocity))
    if flaw == "holes":
        velocity[::7] = np.nan
    if flaw == "few":
        time, lat, lon, height, velocity = (part[:2] for part in (time, lat, lon, height, velocity))
    assert check_velocity_units(time, lat, lon, height, velocity, VELOCITY, "f") == []


def spoilt(flaw):
    time, lat, lon, height, velocity = drive(noise=1.0)
    turned = velocity.copy()
    if flaw == "positions":
        return time, lon, lat, height, velocity
    if flaw == "velocities":
        turned[:, :2] = velocity[:, 1::-1]
    else:
        turned[:, "ne".index(flaw)] *= -1.0
    return time, lat, lon, height, turned


@pytest.mark.parametrize(
    ("flaw", "told"),
    [
        ("positions", "latitude and longitude are exchanged"),
        ("velocities", "the columns 'vn_mps', 've_mps' are exchanged"),
        ("n", "latitude or 'vn_mps' has the wrong sign"),
        ("e", "longitude or 've_mps' has the wrong sign"),
    ],
)
def test_the_exchange_or_sign_that_explains_it_all_is_named(flaw, told):
    *position, velocity = spoilt(flaw)
    with pytest.raises(InputError, match=f"do not move as the velocities say, but they would if {told}"):
        check_velocity_units(*position, velocity, VELOCITY, "f")


def test_a_straight_drive_north_tells_no_exchange_from_another():
    time, lat, lon, height, velocity = drive()
    velocity = np.tile([12.0, 0.0, 0.0], (time.size, 1))
    lat = lat[0] + 12.0 * time / 6371e3
    height = np.full_like(height, 500.0)
    assert check_velocity_units(time, lat, np.full_like(lon, lon[0]), height, velocity, VELOCITY, "f") == []
