from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.errors import ConfigError
from navfuse.simulation import (
    Accelerate,
    Climb,
    FigureEight,
    Hold,
    Stop,
    STurns,
    Turn,
    aircraft,
    boat,
    car,
    drive,
    drone,
    pedestrian,
    segments_from_tables,
)


def ended(vehicle, segments, **start):
    motion = drive(vehicle, segments, **start)
    return motion, motion.trajectory(np.array([0.0, motion.end]))


def test_a_turn_changes_the_heading_and_keeps_the_speed():
    motion, ends = ended(car(), [Hold(2.0), Turn(math.radians(90.0)), Hold(2.0)], heading=6.0, speed=10.0)
    assert ends.attitude[1, 2] == pytest.approx((6.0 + 0.5 * math.pi) % (2.0 * math.pi), abs=1e-4)
    speed = np.linalg.norm(motion.v_e(np.linspace(0.0, motion.end, 500)), axis=1)
    np.testing.assert_allclose(speed, 10.0, rtol=1e-4)
    radius = drive(car(), [Turn(4.0, radius=40.0)], speed=10.0)
    across = np.abs(np.einsum("kji,kj->ki", radius.C_eb(np.linspace(3, 12, 90)), radius.a_e(np.linspace(3, 12, 90))))
    np.testing.assert_allclose(across[:, 1], 100.0 / 40.0, rtol=0.02)


def test_a_climb_gains_its_height_and_a_stop_stands():
    _, ends = ended(aircraft(), [Hold(1.0), Climb(80.0, 5.0), Climb(-30.0)], height=500.0)
    assert ends.height[1] == pytest.approx(550.0, abs=1e-6)
    motion, ends = ended(car(), [Accelerate(20.0), Climb(6.0), Stop(5.0)], height=0.0)
    assert ends.height[1] == pytest.approx(6.0, abs=1e-6)
    np.testing.assert_array_equal(motion.v_e(motion.end - np.linspace(0.0, 4.8, 20)), 0.0)
    motion, ends = ended(drone(), [Climb(30.0, 2.0), Hold(1.0)], height=0.0)
    assert ends.height[1] == pytest.approx(30.0, abs=1e-6)
    assert np.linalg.norm(np.cross(motion.r_e(0.0), motion.r_e(motion.end))) < 1.0 * np.linalg.norm(motion.r_e(0.0))
    assert motion.trajectory(np.linspace(0, motion.end, 300)).velocity_n[:, 2].min() == pytest.approx(-2.0, abs=1e-3)


@pytest.mark.parametrize("segment", [FigureEight(), STurns(0.6, 3), FigureEight(radius=80.0), Turn(2.0 * math.pi)])
def test_weaving_and_circling_end_in_the_old_direction(segment):
    motion, ends = ended(boat(0.0, 0.0, 0.0), [Hold(1.0), segment, Hold(1.0)], speed=6.0, heading=1.0)
    assert ends.attitude[1, 2] == pytest.approx(1.0, abs=1e-3)
    turned = motion.trajectory(np.linspace(0.0, motion.end, 400)).attitude[:, 2]
    assert np.ptp(turned) > 0.5


def test_a_figure_eight_comes_back_to_where_it_began():
    motion = drive(aircraft(), [FigureEight(), Hold(1.0)], speed=50.0, heading=0.3)
    assert np.linalg.norm(motion.r_e(motion.end - 1.0) - motion.r_e(0.0)) < 450.0


def test_vehicles_that_pivot_turn_on_the_spot():
    motion, ends = ended(drone(), [Hold(2.0), Turn(1.0), Hold(2.0)])
    assert ends.attitude[1, 2] == pytest.approx(1.0, abs=1e-6)
    assert np.linalg.norm(motion.r_e(motion.end) - motion.r_e(0.0)) < 1e-6


@pytest.mark.parametrize(("lat", "lon"), [(0.5 * math.pi, 0.3), (-0.5 * math.pi, 0.0), (0.0, math.pi)])
def test_a_drive_is_the_same_anywhere(lat, lon):
    plan = [Accelerate(15.0), Turn(1.0), STurns(0.4), Stop(2.0)]
    here, there = drive(car(), plan), drive(car(), plan, lat=lat, lon=lon)
    t = np.linspace(0.0, here.end, 300)
    np.testing.assert_allclose(there.w_eb_b(t), here.w_eb_b(t), atol=5e-5)
    np.testing.assert_allclose(
        np.linalg.norm(there.v_e(t), axis=1), np.linalg.norm(here.v_e(t), axis=1), rtol=1e-5, atol=1e-6
    )


def test_tables_with_units_make_the_same_segments():
    tables = [
        {"do": "accelerate", "speed_mps": 12, "acceleration_mps2": 2.0},
        {"do": "hold", "duration_s": 5},
        {"do": "turn", "angle_deg": 90.0, "radius_m": 60.0},
        {"do": "climb", "height_m": 4.0, "rate_mps": 0.5},
        {"do": "s_turns", "angle_deg": 20.0, "count": 3, "lateral_mps2": 2.0},
        {"do": "figure_eight"},
        {"do": "stop", "duration_s": 3.0, "braking_mps2": 4.0},
    ]
    assert segments_from_tables(tables) == [
        Accelerate(12.0, 2.0),
        Hold(5.0),
        Turn(math.radians(90.0), radius=60.0),
        Climb(4.0, 0.5),
        STurns(math.radians(20.0), 3, 2.0),
        FigureEight(),
        Stop(3.0, 4.0),
    ]
    assert drive(car(), segments_from_tables(tables)).end > 30.0


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"do": "trun"}, r"segment 2: do = 'trun' is none of hold, .*; did you mean turn\?"),
        ({}, "do = None is none of"),
        ({"do": "turn", "angle": 3.0}, r"no key 'angle', only angle_deg, .*; did you mean angle_deg\?"),
        ({"do": "hold", "duration_s": "5"}, "duration_s must be a number, not '5'"),
        ({"do": "hold", "duration_s": True}, "duration_s must be a number, not True"),
        ({"do": "s_turns", "angle_deg": 5, "count": 2.5}, "count must be a whole number, not 2.5"),
        ({"do": "accelerate"}, r"segment 2 \(accelerate\) needs speed_mps"),
    ],
)
def test_wrong_tables_are_refused(table, message):
    with pytest.raises(ConfigError, match=message):
        segments_from_tables([{"do": "hold", "duration_s": 1.0}, table])


@pytest.mark.parametrize(
    ("vehicle", "segments", "message"),
    [
        (car, [Hold(-1.0)], r"segment 1 \(hold\): the duration must be finite and not negative, not -1.0"),
        (car, [Accelerate(80.0)], r"segment 1 \(accelerate\): a car goes at 0 to 60 m/s, not at 80"),
        (aircraft, [Hold(1.0), Stop()], r"segment 2 \(stop\): an aircraft goes at 25 to 300 m/s, not at 0"),
        (car, [Accelerate(10.0, 6.0)], "a car accelerates by more than 0 and at most 4, not 6 m/s"),
        (car, [Accelerate(10.0), Stop(braking=9.0)], r"segment 2 \(stop\): a car brakes by .* at most 8, not 9"),
        (car, [Accelerate(10.0), Turn(1.0, lateral=7.0)], r"takes 7 m/s\^2 across, a car has .* at most 5"),
        (car, [Accelerate(20.0), Turn(1.0, radius=40.0)], r"takes 10 m/s\^2 across.* radius of 80 m or more at 20 m/s"),
        (car, [Accelerate(1.0), Turn(1.0, radius=0.5)], "takes 115 deg/s, a car turns by at most 57.3"),
        (car, [Accelerate(1.0), Turn(1.0, radius=-5.0)], "radius of a turn must be positive, not -5.0"),
        (car, [Turn(1.0)], r"segment 1 \(turn\): a car cannot turn on the spot"),
        (car, [Accelerate(10.0), Turn(math.nan)], "angle of a turn must be finite, not nan"),
        (car, [Accelerate(10.0), Turn(1.0, 2.0, 50.0)], "lateral acceleration or the radius of a turn, not both"),
        (car, [Accelerate(10.0), STurns(1.0, 0)], "count of turns must be in 1 .. 10000, not 0"),
        (car, [Accelerate(10.0), Climb(50.0, 4.0)], "the slope is 40 %, a car goes on at most 30 %"),
        (aircraft, [Climb(100.0, 25.0)], "the climb takes 25 m/s, an aircraft climbs at most at 20 m/s"),
        (aircraft, [Climb(100.0, -1.0)], "a climb needs a finite height and a rate > 0, not 100.0 m at -1.0"),
        (pedestrian, [Climb(1.0)], "a pedestrian cannot climb on the spot"),
        (car, [], "the plan is empty"),
    ],
)
def test_what_a_vehicle_cannot_do_is_refused(vehicle, segments, message):
    with pytest.raises(ConfigError, match=message):
        drive(vehicle(), segments)


def test_an_impossible_start_is_refused():
    with pytest.raises(ConfigError, match="the start: an aircraft goes at 25 to 300 m/s, not at 5 m/s"):
        drive(aircraft(), [Hold(5.0)], speed=5.0)
