"""Tracks by dead reckoning: exact on the ellipsoid, of second order in the interval, refused where they cannot be."""

from itertools import pairwise

import numpy as np
import pytest
from pyproj import Geod
from scipy.integrate import solve_ivp

from navfuse.core.earth import radii
from navfuse.data.aiding_logs import BodyVelocityLog, HeadingLog, OdometerLog
from navfuse.dead_reckoning.odometry import (
    StartPoint,
    Steps,
    from_body_velocity,
    from_speed_and_heading,
    from_steps,
    from_velocity,
    metres_per_radian,
)
from navfuse.errors import InputError

START = StartPoint(np.radians(52.0), np.radians(-3.0), 120.0)
LENGTH = 60.0


def speed(t):
    return 15.0 + 8.0 * np.sin(0.13 * t)


def psi(t):
    return 1.0 + 0.9 * np.sin(0.11 * t) + 0.05 * t


def truth(start=START):
    """Latitude and longitude at the end, integrated to rounding."""

    def rate(t, x):
        meridian, transverse = radii(np.sin(x[0]))
        v, heading = speed(t), psi(t)
        return (
            v * np.cos(heading) / (meridian + start.height),
            v * np.sin(heading) / ((transverse + start.height) * np.cos(x[0])),
        )

    return solve_ivp(rate, (0.0, LENGTH), (start.lat, start.lon), rtol=1e-13, atol=1e-16).y[:, -1]


def off(track, end):
    """Horizontal distance of the end of a track from a place [m]."""
    metres = metres_per_radian(track.lat[-1:], track.height[-1:])[0]
    return float(np.hypot((track.lat[-1] - end[0]) * metres[0], (track.lon[-1] - end[1]) * metres[1]))


def sampled(dt):
    t = np.arange(0.0, LENGTH + 0.5 * dt, dt)
    return from_speed_and_heading(OdometerLog(t, speed(t)), HeadingLog(t, psi(t) % (2 * np.pi)), START)


def arcs(dt):
    t = np.arange(0.0, LENGTH + 0.5 * dt, dt)
    travelled = 15.0 * t - 8.0 / 0.13 * np.cos(0.13 * t)
    start = StartPoint(START.lat, START.lon, START.height, psi(0.0))
    return from_steps(Steps(t, np.diff(travelled), np.diff(psi(t))), start)


@pytest.mark.parametrize("track", [sampled, arcs])
def test_halving_the_interval_quarters_the_error(track):
    end = truth()
    errors = [off(track(dt), end) for dt in (1.0, 0.5, 0.25)]
    assert errors[0] < 2.0
    for coarse, fine in pairwise(errors):
        assert 3.6 < coarse / fine < 4.4


def test_a_long_way_north_and_a_parallel_are_those_of_the_ellipsoid():
    """60 km in steps of 100 m against geodesics and the length of the parallel."""
    geod = Geod(ellps="WGS84")
    t = np.arange(601.0)
    low = StartPoint(np.radians(47.0), np.radians(8.0), 0.0)
    north = from_velocity(t, np.tile((100.0, 0.0, 0.0), (t.size, 1)), low)
    lon, lat, _ = geod.fwd(8.0, 47.0, 0.0, 60_000.0)
    assert off(north, np.radians((lat, lon))) < 1e-6
    east = from_velocity(t, np.tile((0.0, 100.0, 0.0), (t.size, 1)), low)
    assert np.abs(east.lat - low.lat).max() == 0.0
    _, transverse = radii(np.sin(low.lat))
    assert east.lon[-1] - low.lon == pytest.approx(60_000.0 / (transverse * np.cos(low.lat)), abs=1e-13)


def test_a_circle_of_arcs_closes():
    """Even with eight steps for the circle; on a plane up to 1e-5 of the radius."""
    steps = Steps(np.arange(9.0), np.full(8, 2.0 * np.pi * 20.0 / 8.0), np.full(8, 2.0 * np.pi / 8.0))
    track = from_steps(steps, StartPoint(START.lat, START.lon, 0.0, 0.3))
    assert off(track, (START.lat, START.lon)) < 1e-3
    metres = metres_per_radian(track.lat, track.height)
    half = (track.lat[4] - track.lat[0], track.lon[4] - track.lon[0]) * metres[0]
    np.testing.assert_allclose(half, 40.0 * np.array((-np.sin(0.3), np.cos(0.3))), atol=2e-3)


def test_a_lever_arm_swings_with_the_vehicle():
    steps = Steps(np.arange(5.0), np.zeros(4), np.full(4, np.pi / 8.0))
    track = from_steps(steps, StartPoint(START.lat, START.lon, 0.0, 0.0), lever=(2.0, 0.5))
    metres = metres_per_radian(track.lat, track.height)
    end = (track.lat[-1] - track.lat[0], track.lon[-1] - track.lon[0]) * metres[0]
    np.testing.assert_allclose(end, (-0.5 - 2.0, 2.0 - 0.5), atol=1e-6)
    np.testing.assert_allclose(track.velocity_n[-1, :2], np.pi / 8.0 * np.array((-2.0, -0.5)), atol=1e-12)


def test_the_date_line_is_crossed():
    t = np.arange(11.0)
    track = from_velocity(t, np.tile((0.0, 100.0, -1.0), (11, 1)), StartPoint(0.1, np.pi - 1e-5, 5.0))
    assert track.lon[0] > 3.0 > -3.0 > track.lon[-1] >= -np.pi
    assert track.height[-1] == pytest.approx(15.0)


def test_a_doppler_radar_that_sees_forward_motion_only_is_an_odometer():
    t = np.arange(0.0, 20.0, 0.5)
    heading = HeadingLog(t, psi(t) % (2 * np.pi))
    v = np.column_stack((speed(t), np.full(t.size, np.nan), np.full(t.size, np.nan)))
    radar, odometer = (
        from_body_velocity(BodyVelocityLog(t, v), heading, START),
        from_speed_and_heading(OdometerLog(t, speed(t)), heading, START),
    )
    np.testing.assert_array_equal(radar.lat, odometer.lat)
    sideways = np.column_stack((np.zeros(t.size), speed(t), np.zeros(t.size)))
    turned = HeadingLog(t, (psi(t) - np.pi / 2) % (2 * np.pi))
    crab = from_body_velocity(BodyVelocityLog(t, sideways), turned, START)
    np.testing.assert_allclose(crab.lat, odometer.lat, atol=1e-14)
    np.testing.assert_allclose(crab.lon, odometer.lon, atol=1e-14)


def test_headings_are_interpolated_across_north():
    track = from_speed_and_heading(
        OdometerLog(np.arange(0.0, 1.5, 0.5), np.ones(3)), HeadingLog(np.array([0.0, 1.0]), np.array([6.2, 0.1])), START
    )
    assert track.attitude[1, 2] == pytest.approx(0.5 * (6.2 + 0.1) - np.pi, abs=1e-12)


def test_what_cannot_be_dead_reckoned():
    t = np.arange(4.0)
    with pytest.raises(InputError, match="fewer than two epochs in common"):
        from_speed_and_heading(OdometerLog(t, t), HeadingLog(t + 100.0, t), START)
    with pytest.raises(InputError, match="fewer than two epochs in common"):
        from_speed_and_heading(OdometerLog(t, t), HeadingLog(t[:0], t[:0]), START)
    with pytest.raises(InputError, match="at least two epochs of finite velocities"):
        from_velocity(t, np.full((4, 3), np.nan), START)
    with pytest.raises(InputError, match="cannot start at latitude 90"):
        StartPoint(np.pi / 2, 0.0, 0.0)
    with pytest.raises(InputError, match="need one distance and one turn less"):
        Steps(t, t, t)
    with pytest.raises(InputError, match=r"step 2, at 2\.000 s, is not finite"):
        Steps(t, np.array([1.0, np.nan, 1.0]), np.zeros(3))
    v = np.ones((4, 3))
    v[2, 1] = np.nan
    with pytest.raises(InputError, match=r"no v_y at 2\.000 s; .* or in none"):
        from_body_velocity(BodyVelocityLog(t, v), HeadingLog(t, np.zeros(4)), START)
    v[:, 0] = np.nan
    with pytest.raises(InputError, match=r"no v_x at 0\.000 s; dead reckoning needs it in every row$"):
        from_body_velocity(BodyVelocityLog(t, v), HeadingLog(t, np.zeros(4)), START)
