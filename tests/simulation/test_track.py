from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from navfuse.data.trajectory import Trajectory
from navfuse.errors import ConfigError, InputError, NavfuseWarning
from navfuse.simulation import (
    Accelerate,
    Hold,
    Stop,
    STurns,
    Turn,
    car,
    car_drive,
    drive,
    figure_eight_flight,
    follow_track,
    read_track,
    track_residuals,
)

PROFILES = {0: (1e-8, 1e-9), 1: (1e-3, 0.1), 2: (2e-3, 0.5), 3: (1e-3, 1.0), 4: (2e-3, 0.1)}


@pytest.mark.parametrize("number", PROFILES)
def test_the_profiles_of_groves_are_reproduced(shared_data, number):
    track = read_track(shared_data / "groves-profiles" / f"Profile_{number}.csv")
    motion = follow_track(track)
    position, attitude_deg = PROFILES[number]
    assert (motion.start, motion.end) == (track.time[0], track.time[-1])
    assert track_residuals(motion, track).max() < position
    made = Rotation.from_matrix(motion.C_nb(track.time))
    given = Rotation.from_euler("ZYX", track.attitude[:, ::-1])
    off = np.degrees((made.inv() * given).magnitude())
    assert off.max() < attitude_deg
    assert np.sqrt(np.mean(off**2)) < 0.05
    velocity = motion.trajectory(track.time).velocity_n
    assert np.sqrt(np.mean((velocity - track.velocity_n) ** 2)) < 0.05


def test_a_fit_smooths_what_interpolation_would_follow(shared_data):
    track = read_track(shared_data / "groves-profiles" / "Profile_2.csv")
    inner = np.arange(1.0, track.time[-1] - 1.0, 0.01)
    exact, fitted = follow_track(track, spacing=0.01), follow_track(track, spacing=0.2)
    assert track_residuals(exact, track).max() < 1e-6
    assert np.abs(exact.f_b(inner)[:, :2]).max() > 2.0 * np.abs(fitted.f_b(inner)[:, :2]).max()


@pytest.fixture(name="truth", scope="module")
def _truth():
    plan = [Hold(5.0), Accelerate(15.0), Turn(1.0), STurns(0.5), Hold(5.0), Stop(6.0), Accelerate(12.0), Turn(-1.5)]
    return drive(car(), plan, lat=-0.6, lon=math.pi - 1e-5, heading=1.0)


def sampled(motion, rate, attitude=False):
    track = motion.trajectory(np.arange(math.ceil(motion.start * rate), math.floor(motion.end * rate) + 1) / rate)
    return dataclasses.replace(track, velocity_n=None, attitude=track.attitude if attitude else None)


@pytest.mark.parametrize("rate", [1.0, 5.0])
def test_a_gps_track_becomes_a_drive_over_the_date_line(truth, rate):
    track = sampled(truth, rate)
    motion = follow_track(track, "car")
    assert track_residuals(motion, track).max() < 1e-3
    t = np.arange(0.0, motion.end, 0.05)
    v_b = np.einsum("kji,kj->ki", motion.C_eb(t), motion.v_e(t))
    moving = np.linalg.norm(v_b, axis=1) > 1.6
    assert np.abs(v_b[moving, 1]).max() < 2e-2
    if rate == 5.0:
        fast = moving & (np.linalg.norm(truth.v_e(t), axis=1) > 3.0)
        angle = (
            Rotation.from_matrix(truth.C_eb(t[fast])).inv() * Rotation.from_matrix(motion.C_eb(t[fast]))
        ).magnitude()
        assert np.degrees(angle).max() < 0.5
        np.testing.assert_allclose(motion.r_e(t), truth.r_e(t), atol=0.05)


def test_acceleration_and_angular_rate_of_a_track_are_continuous(truth):
    for motion in (follow_track(sampled(truth, 1.0), "car"), follow_track(sampled(truth, 50.0, attitude=True))):
        inner = motion.knots[1:-1]
        before, after = motion.at(np.nextafter(inner, 0.0)), motion.at(inner)
        np.testing.assert_allclose(before.a_e, after.a_e, atol=1e-6)
        np.testing.assert_allclose(before.w_eb_b, after.w_eb_b, atol=1e-8)


@pytest.mark.parametrize("lat", [0.8, 0.5 * math.pi])
def test_a_table_with_attitude_comes_back_at_a_pole_too(lat):
    truth = car_drive(60.0, seed=3, standing=5.0, lat=lat)
    motion = follow_track(sampled(truth, 50.0, attitude=True))
    t = np.linspace(0.5, 59.5, 700)
    np.testing.assert_allclose(motion.r_e(t), truth.r_e(t), atol=1e-5)
    np.testing.assert_allclose(motion.C_eb(t), truth.C_eb(t), atol=1e-5)


def test_a_flight_is_coordinated_and_a_drone_pushes_up():
    track = sampled(figure_eight_flight(90.0, straight=5.0, lat=1.57), 5.0)
    flight = follow_track(track, "aircraft")
    t = np.linspace(1.0, 89.0, 900)
    assert np.abs(flight.f_b(t)[:, 1]).max() < 1e-2
    copter = follow_track(track, "drone")
    assert np.abs(copter.f_b(t)[:, :2]).max() < 1e-2
    assert np.abs(follow_track(track, "car").f_b(t)[:, 1]).max() > 3.0


def test_noise_of_fixes_is_smoothed_by_a_wide_spacing(truth):
    track = sampled(truth, 1.0)
    rng = np.random.default_rng(0)
    noisy = dataclasses.replace(track, height=track.height + rng.standard_normal(track.height.size))
    t = np.linspace(5.0, track.time[-1] - 5.0, 2000)
    rough, smooth = (np.abs(follow_track(noisy, "car", spacing=s).a_e(t)).max() for s in (None, 5.0))
    assert smooth < 0.5 * rough


def straight(rows=20, rate=1.0):
    time = np.arange(rows) / rate
    return Trajectory(time, 0.5 + 3e-6 * time, np.full(rows, 0.1), np.zeros(rows), source="log.csv")


def changed(row, **values):
    track = straight()
    columns = {name: getattr(track, name).copy() for name in ("time", "lat", "lon", "height")}
    for name, value in values.items():
        columns[name][row:] += value
    return dataclasses.replace(track, **columns)


@pytest.mark.parametrize(
    ("track", "message"),
    [
        (changed(7, time=10.0), r"log.csv, row 8 at 17 s: 11 s after the row before, and gaps above 5 s"),
        (changed(7, lat=2e-5), r"log.csv, row 8 at 7 s: the position jumps: it lies 127.* m from where"),
        (changed(7, height=60.0), r"row 8 at 7 s: the position jumps: it lies 60 m"),
        (changed(7, time=-1.0), r"row 8 at 6 s: the time does not increase"),
        (changed(7, lat=np.nan), r"log.csv, row 8: time, position and attitude must be finite"),
        (straight(5), "at least 6 rows, not 5"),
        (dataclasses.replace(straight(), lat=np.full(20, 0.5)), r"never faster than 1.5 m/s"),
    ],
)
def test_tracks_that_cannot_be_followed_are_refused(track, message):
    with pytest.raises(InputError, match=message):
        follow_track(track, "car")


def test_a_longer_gap_may_be_allowed():
    track = changed(7, time=10.0, lat=3e-5)
    assert follow_track(track, "car", max_gap=12.0).end == 29.0


def test_other_misuse_is_refused():
    track = straight()
    with pytest.raises(InputError, match="log.csv: the track has no attitude; name a rule"):
        follow_track(track)
    with pytest.raises(ConfigError, match="the rule is 'car', 'aircraft', 'drone' or None, not 'tank'"):
        follow_track(track, "tank")
    with pytest.raises(ConfigError, match="spacing must be positive and finite, not 0.0 s"):
        follow_track(track, "car", spacing=0.0)
    with pytest.raises(ConfigError, match="max_gap must be positive and finite, not -1.0 s"):
        follow_track(track, "car", max_gap=-1.0)
    attitude = np.zeros((20, 3))
    attitude[11:, 2] = 2.0
    with pytest.raises(InputError, match="row 12 at 11 s: the attitude turns by 115 deg from the row before"):
        follow_track(dataclasses.replace(track, attitude=attitude))
    slow = dataclasses.replace(track, lat=0.5 + 1e-7 * track.time)
    with pytest.raises(InputError, match="an aircraft does not fly at"):
        follow_track(slow, "aircraft")
    lon = np.linspace(0.0, 2.0 * math.pi, 2000, endpoint=False)
    zero = np.zeros(2000)
    with pytest.raises(InputError, match="spreads over half the Earth"):
        follow_track(Trajectory(60.0 * np.arange(2000), zero, lon, zero, source="orbit"), "aircraft")


GPX = """<?xml version="1.0"?>
<gpx xmlns="http://www.topografix.com/GPX/1/1" version="1.1" creator="test"><trk><trkseg>{}</trkseg></trk></gpx>"""
POINT = '<trkpt lat="{lat}" lon="7.5">{ele}<time>{time}</time></trkpt>'


def gpx(path, points):
    path.write_text(GPX.format("".join(points)))
    return path


def points(count=12, ele="<ele>{}</ele>"):
    return [
        POINT.format(lat=47.0 + 1e-4 * k, ele=ele.format(400 + k), time=f"2024-05-01T12:00:{k:02d}Z")
        for k in range(count)
    ]


def test_a_gpx_track_is_read_and_followed(tmp_path):
    track = read_track(gpx(tmp_path / "ride.gpx", points()))
    np.testing.assert_array_equal(track.time, np.arange(12.0))
    np.testing.assert_allclose(np.degrees(track.lat), 47.0 + 1e-4 * np.arange(12), atol=1e-12)
    np.testing.assert_allclose(np.degrees(track.lon), 7.5)
    np.testing.assert_allclose(track.height, 400.0 + np.arange(12.0))
    motion = follow_track(track, "car")
    assert track_residuals(motion, track).max() < 1e-6
    speed = np.linalg.norm(motion.v_e(np.linspace(1.0, 10.0, 50)), axis=1)
    np.testing.assert_allclose(speed, math.hypot(11.12, 1.0), rtol=0.01)


def test_a_gpx_track_without_elevations_is_flat_with_a_warning(tmp_path):
    path = gpx(tmp_path / "flat.gpx", points(ele=""))
    with pytest.warns(NavfuseWarning, match="no elevations; heights are taken as 0"):
        track = read_track(path)
    np.testing.assert_array_equal(track.height, 0.0)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            [*points()[:2], '<trkpt lat="47" lon="7.5"><time>2024-05-01T12:00:09Z</time></trkpt>'],
            "track point 3: the elev",
        ),
        ([*points()[:1], '<trkpt lat="47" lon="7.5"><ele>3</ele></trkpt>'], "track point 2: the time must be like"),
        ([*points()[:1], '<trkpt lat="97" lon="7.5"/>'], "track point 2: latitude and longitude must be numbers"),
        (
            [*points()[:1], points()[1].replace("401", "high")],
            "track point 2: the elevation must be a number .* 'high'",
        ),
        ([], "no track points"),
        (["<oops>"], "this is no GPX file"),
    ],
)
def test_wrong_gpx_files_are_refused(tmp_path, content, message):
    with pytest.raises(InputError, match=message):
        read_track(gpx(tmp_path / "wrong.gpx", content))


def test_native_tables_and_profiles_are_told_apart(tmp_path):
    native = tmp_path / "truth.csv"
    native.write_text("time_s,lat_deg,lon_deg,height_m\n" + "".join(f"{k},47.0{k},7,400\n" for k in range(8)))
    assert read_track(native).attitude is None
    profile = tmp_path / "profile.csv"
    profile.write_text("".join(f"{k},47,7,400,1,2,3,10,20,-30\n" for k in range(3)) + "\n")
    track = read_track(profile)
    np.testing.assert_allclose(np.degrees(track.attitude[1]), [10.0, 20.0, 330.0])
    np.testing.assert_array_equal(track.velocity_n[2], [1.0, 2.0, 3.0])
    profile.write_text("0,47,7,400,1,2,3,10,20,-30\n1,47,7\n")
    with pytest.raises(InputError, match="row 2: a motion profile has 10 numbers a row"):
        read_track(profile)
    with pytest.raises(InputError, match="there is no such file"):
        read_track(tmp_path / "none.gpx")
