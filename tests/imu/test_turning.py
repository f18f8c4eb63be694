from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from navfuse.data.logs import GnssLog
from navfuse.errors import InputError
from navfuse.imu.grades import grade
from navfuse.imu.increments import ImuIncrements, to_increments
from navfuse.imu.turning import check_turns, fit_turns
from navfuse.simulation import car_drive, figure_eight_flight, simulate, static

LEVER = (-0.4, 0.2, -1.3)


def logs(motion, sensor="consumer", **more):
    made = simulate(motion, grade(sensor), 5, lever_arm_b=LEVER, gnss_rate=2.0, **more)
    return to_increments(made.imu), made.gnss


@pytest.fixture(scope="module")
def drive():
    return logs(car_drive(200.0, seed=4))


def scaled(increments, factor):
    return ImuIncrements(increments.time, increments.inc_theta_b * factor, increments.inc_v_b)


def without_velocity(gnss):
    return replace(gnss, velocity_n=None, sd_velocity=None)


@pytest.mark.parametrize("velocity", [True, False])
def test_a_car_with_a_cheap_sensor(drive, velocity):
    increments, gnss = drive
    fit = fit_turns(increments, gnss if velocity else without_velocity(gnss))
    assert 0.9 < fit.ratio < 1.15
    assert abs(fit.lag_s) < 0.3
    assert fit.correlation > 0.95
    assert fit.turn > np.radians(3.0)
    assert fit.count >= 20
    assert check_turns(increments, gnss) == []


def test_axes_do_not_matter(drive):
    increments, gnss = drive
    turn = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    turned = ImuIncrements(increments.time, increments.inc_theta_b @ turn.T, increments.inc_v_b @ turn.T)
    assert fit_turns(turned, gnss).ratio == pytest.approx(fit_turns(increments, gnss).ratio, rel=1e-9)


def test_an_aeroplane_in_coordinated_turns():
    increments, gnss = logs(figure_eight_flight(300.0))
    fit = fit_turns(increments, gnss)
    assert 0.8 < fit.ratio < 1.2
    assert abs(fit.lag_s) < 0.3
    assert check_turns(increments, gnss) == []


@pytest.mark.parametrize("velocity", [True, False])
@pytest.mark.parametrize("late_s", [-9.0, -2.0, 1.5, 4.0])
def test_clocks_apart(drive, late_s, velocity):
    increments, gnss = drive
    late = ImuIncrements(increments.time + late_s, increments.inc_theta_b, increments.inc_v_b)
    gnss = gnss if velocity else without_velocity(gnss)
    assert fit_turns(late, gnss).lag_s == pytest.approx(late_s, abs=0.1 if velocity else 0.3)
    (note,) = check_turns(late, gnss)
    word = "late" if late_s > 0.0 else "early"
    assert f"s too {word} against those of GNSS" in note
    assert "added to imu.time_offset_s" in note


@pytest.mark.parametrize("late_s", [-18.0, 18.0])
def test_leap_seconds_are_named(late_s):
    increments, gnss = logs(car_drive(400.0, seed=4))
    (note,) = check_turns(ImuIncrements(increments.time + late_s, increments.inc_theta_b, increments.inc_v_b), gnss)
    assert f"{-late_s:+.1f} s added to imu.time_offset_s; GPS time and UTC are that far apart" in note


def test_degrees_taken_for_radians(drive):
    increments, gnss = drive
    with pytest.raises(InputError, match="turn 5[0-9.]+ times as much as .* are these degrees in columns of radians"):
        check_turns(scaled(increments, 180.0 / np.pi), gnss)


def test_radians_taken_for_degrees(drive):
    increments, gnss = drive
    with pytest.raises(InputError, match=r"turn 0\.01[0-9]+ times .* are these radians in columns of degrees"):
        check_turns(scaled(increments, np.pi / 180.0), gnss)


def test_another_unit(drive):
    increments, gnss = drive
    with pytest.raises(InputError, match="check their unit"):
        check_turns(scaled(increments, 10.0), gnss)


def test_a_wrong_rate_is_only_told(drive):
    increments, gnss = drive
    (note,) = check_turns(scaled(increments, 2.0), gnss)
    assert note.startswith("the gyroscopes turn 1.9")


@pytest.mark.parametrize("sign", [(-1.0, -1.0, -1.0), (1.0, 1.0, -1.0)])
def test_wrong_signs(drive, sign):
    increments, gnss = drive
    with pytest.raises(InputError, match="turn left where the course over ground turns right"):
        check_turns(scaled(increments, np.array(sign)), gnss)


def test_nothing_is_said_of_what_stands():
    increments, gnss = logs(static(100.0))
    assert fit_turns(increments, gnss) is None
    assert check_turns(increments, gnss) == []


def test_nothing_is_said_of_what_goes_straight():
    increments, gnss = logs(figure_eight_flight(120.0, straight=200.0))
    assert check_turns(scaled(increments, -1.0), gnss) == []


@pytest.mark.parametrize("late_s", [0.0, 4.0, 8.0])
def test_a_course_that_repeats_itself_is_not_taken_for_another(late_s):
    """A slalom of sixteen seconds looks the same, but for the sign, eight seconds later."""
    time = np.arange(0.0, 200.0, 0.02)
    rate = 0.2 * np.sin(2.0 * np.pi * time / 16.0)
    theta = np.column_stack([np.zeros((time.size, 2)), rate * 0.02])[1:]
    increments = ImuIncrements(time + late_s, theta, np.tile([0.0, 0.0, -9.8 * 0.02], (time.size - 1, 1)))
    course = np.cumsum(rate * 0.02)[::25]
    velocity = 10.0 * np.column_stack([np.cos(course), np.sin(course), np.zeros(course.size)])
    place = np.full(course.size, 0.5)
    gnss = GnssLog(time[::25], place, place, place, np.ones_like(velocity), velocity, np.ones_like(velocity))
    fit = fit_turns(increments, gnss)
    assert (fit is not None) == (late_s == 0.0)
    assert check_turns(increments, gnss) == []


def test_nothing_is_said_of_what_moves_another_way_than_it_points(drive):
    increments, gnss = drive
    rng = np.random.default_rng(2)
    drifting = rng.permutation(increments.inc_theta_b[:, 2].reshape(-1, 100), axis=0).ravel()
    other = increments.inc_theta_b.copy()
    other[:, 2] = drifting
    shuffled = ImuIncrements(increments.time, other, increments.inc_v_b)
    assert check_turns(shuffled, gnss) == []


@pytest.mark.parametrize("count", [2, 7])
def test_few_fixes(drive, count):
    increments, gnss = drive
    rows = {name: getattr(gnss, name)[100 : 100 + count] for name in ("time", "lat", "lon", "height", "sd_position")}
    assert fit_turns(increments, GnssLog(**rows)) is None


def test_a_short_log(drive):
    increments, gnss = drive
    assert fit_turns(increments.piece(0, 50), gnss) is None


def test_fixes_without_velocity_among_others(drive):
    increments, gnss = drive
    velocity = gnss.velocity_n.copy()
    velocity[::5] = np.nan
    assert 0.9 < fit_turns(increments, replace(gnss, velocity_n=velocity)).ratio < 1.15
