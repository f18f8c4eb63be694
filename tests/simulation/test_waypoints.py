from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.errors import ConfigError
from navfuse.simulation import (
    Waypoint,
    aircraft,
    car,
    drone,
    follow_waypoints,
    local_waypoints,
    pedestrian,
)

SQUARE = [
    (0.0, 0.0, 0.0, 0.0, 3.0),
    (200.0, 0.0, 2.0, 10.0, 0.0),
    (200.0, 150.0, 5.0, 15.0, 0.0),
    (20.0, 150.0, 5.0, 8.0, 0.0),
    (20.0, -300.0, 0.0, 0.0, 2.0),
]
PLACES = [(0.8, 0.2), (0.5 * math.pi, 0.0), (-0.5 * math.pi, 2.0), (1e-6, math.pi), (1.5705, -3.0)]


def closest(motion, waypoint):
    """Distance [m] of the motion from a waypoint, and the speed there."""
    from pymap3d import geodetic2ecef

    t = np.arange(motion.start, motion.end, 0.01)
    place = np.array(geodetic2ecef(waypoint.lat, waypoint.lon, waypoint.height, deg=False))
    distance = np.linalg.norm(motion.r_e(t) - place, axis=1)
    k = int(np.argmin(distance))
    return distance[k], np.linalg.norm(motion.v_e(t[k]))


@pytest.mark.parametrize(("lat", "lon"), PLACES)
def test_waypoints_are_passed_at_their_speed_anywhere(lat, lon):
    points = local_waypoints(lat, lon, 50.0, SQUARE)
    motion = follow_waypoints(car(), points)
    for point, cut in zip(points, (1e-6, 15.0, 25.0, 10.0, 1e-6), strict=True):
        distance, speed = closest(motion, point)
        assert distance < cut
        assert speed == pytest.approx(point.speed, abs=0.05)
    for time, point in ((0.0, points[0]), (motion.end, points[-1])):
        assert motion.trajectory(time).height[0] == pytest.approx(point.height, abs=1e-6)
    np.testing.assert_array_equal(motion.v_e(np.linspace(0.0, 2.9, 9)), 0.0)
    across = np.einsum("kji,kj->ki", motion.C_eb(t := np.arange(0.0, motion.end, 0.05)), motion.a_e(t))[:, 1]
    assert 4.0 < np.abs(across).max() < 5.05


def test_local_metres_are_true_metres():
    points = local_waypoints(0.8, 0.2, 50.0, [(0.0, 0.0, 0.0, 5.0), (300.0, 400.0, 0.0, 5.0)])
    motion = follow_waypoints(car(), points)
    assert motion.end == pytest.approx(100.0, rel=1e-4)
    assert np.linalg.norm(motion.r_e(motion.end) - motion.r_e(0.0)) == pytest.approx(500.0, rel=1e-4)


def test_a_flight_of_a_thousand_kilometres_reaches_its_end():
    points = [
        Waypoint(0.85, math.pi - 0.05, 3000.0, 120.0),
        Waypoint(0.87, math.pi + 0.03, 5000.0, 150.0),
        Waypoint(0.83, -math.pi + 0.08, 4000.0, 150.0),
    ]
    motion = follow_waypoints(aircraft(), points)
    t = np.linspace(0.0, motion.end, 2000)
    assert np.abs(motion.f_b(t)[:, 1]).max() < 1e-4
    end = motion.trajectory(motion.end)
    assert end.lat[0] == pytest.approx(0.83, abs=1e-10)
    assert end.lon[0] == pytest.approx(0.08 - math.pi, abs=1e-10)
    assert end.height[0] == pytest.approx(4000.0, abs=1e-4)
    speed = np.linalg.norm(motion.v_e(t), axis=1)
    assert speed.max() < 151.0


def test_a_drone_stops_pivots_and_climbs_at_its_waypoints():
    rows = [(0, 0, 0, 0, 1), (0, 0, 20, 0, 1), (80, 0, 20, 6, 0), (160, 0, 20, 0, 2), (160, 60, 10, 5, 0)]
    points = local_waypoints(0.3, 0.1, 0.0, rows)
    motion = follow_waypoints(drone(), points)
    for point in points:
        distance, speed = closest(motion, point)
        assert distance < 0.05
        assert speed == pytest.approx(point.speed, abs=0.05)


def test_a_walker_turns_round_on_the_spot():
    motion = follow_waypoints(pedestrian(side=0.0), local_waypoints(0.3, 0.1, 0.0, [(0, 0, 0, 0, 2), (30, 0, 0, 1.4, 0), (60, 0, 0, 0, 2), (40, 0, 0, 1, 0)]))  # fmt: skip  # noqa: E501
    heading = np.unwrap(motion.trajectory(np.arange(0.0, motion.end, 0.1)).attitude[:, 2])
    assert abs(heading[-1] - heading[0]) == pytest.approx(math.pi, abs=0.01)


def rows(*changes, base=SQUARE):
    table = [list(row) for row in base]
    for row, column, value in changes:
        table[row][column] = value
    return local_waypoints(0.8, 0.2, 50.0, table)


@pytest.mark.parametrize(
    ("vehicle", "points", "message"),
    [
        (car, rows((2, 3, 40.0)), r"waypoint 3: a turn of 90 deg at 40 m/s is too tight: with at most 5 m/s\^2 across"),
        (car, rows((1, 3, 70.0)), "waypoint 2: a car goes at 0 to 60 m/s, not at 70"),
        (car, rows((0, 3, 30.0), (0, 4, 0.0), (1, 3, 10.0), (1, 0, 60.0)), "leg from waypoint 1 to 2: from 30 to 10"),
        (
            car,
            rows((1, 3, 5.0), (2, 3, 5.0), (2, 2, 80.0)),
            r"leg from waypoint 2 to 3: the slope is .* %, a car goes on at most 30 %",
        ),
        (car, rows((2, 3, 0.0)), "waypoint 3: a car cannot turn on the spot"),
        (car, rows((1, 0, 0.0), (1, 3, 0.0)), "waypoints 1 and 2 lie above one another .* a car cannot go"),
        (drone, rows((1, 0, 0.0)), "waypoints 1 and 2 lie above one another .* with speed 0 at both"),
        (drone, rows((1, 3, 0.0)), "leg from waypoint 1 to 2: the speed is 0 at both ends"),
        (car, rows((1, 4, 2.0)), "waypoint 2: a pause of 2 s at 10 m/s; pause >= 0, and only at speed 0"),
        (car, rows((1, 3, math.nan)), "waypoint 2: .* must be finite"),
        (car, rows()[:1], "at least two waypoints, not 1"),
        (
            aircraft,
            [Waypoint(0.0, 0.0, 0.0, 100.0), Waypoint(1.0, 0.0, 0.0, 100.0)],
            "more than 2000 km from their middle",
        ),
        (
            aircraft,
            [Waypoint(0.0, 0.0, 0.0, 100.0), Waypoint(0.0, math.pi, 0.0, 100.0)],
            "more than 2000 km from their middle",
        ),
    ],
)
def test_waypoints_that_the_vehicle_cannot_follow_are_refused(vehicle, points, message):
    with pytest.raises(ConfigError, match=message):
        follow_waypoints(vehicle(), points)


def test_local_waypoints_of_another_shape_are_refused():
    with pytest.raises(ConfigError, match="rows of north, east, up, speed"):
        local_waypoints(0.0, 0.0, 0.0, [(1.0, 2.0, 3.0)])
