"""The start found in the data: level, heading, position, velocity, and sigmas that are no smaller than the errors."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest

from navfuse.core.constants import EARTH_RATE
from navfuse.data.logs import GnssLog
from navfuse.data.nav_state import describe_rows
from navfuse.data.start import Known
from navfuse.errors import AlignmentError
from navfuse.imu.alignment import align
from navfuse.imu.grades import GRADES
from navfuse.imu.increments import to_increments
from navfuse.simulation import car_drive, simulate, static
from reference.engine_runs import cut
from reference.start_scenes import SCENES, level_drive

NO_LEVER = np.zeros(3)
UNKNOWN_DEG = 180.0 / np.sqrt(3.0)


def find(motion, grade, seed=0, begin=0.0, known=None, **options):
    """Alignment on simulated logs from `begin` on, and the logs."""
    logs = simulate(motion, GRADES[grade], seed, imu_rate=50.0, **options)
    increments = cut(to_increments(logs.imu), round(50.0 * begin))
    return align(increments, logs.gnss, GRADES[grade], np.asarray(options.get("lever_arm_b", NO_LEVER)), known), logs


def described(start):
    out = np.empty((1, 18))
    describe_rows(start.nav[None], np.zeros((1, 9)), start.P[None], False, out)
    return out[0]


def errors_and_deviations(start, motion):
    """Nine errors (north, east, down, velocity, roll, pitch, heading) of a start, and what it states."""
    row, truth = described(start), motion.trajectory(np.array([start.time]))
    metres = np.array([6.367e6, 6.388e6 * np.cos(row[0]), -1.0])
    position = metres * [truth.lat[0] - row[0], truth.lon[0] - row[1], truth.height[0] - row[2]]
    attitude = (truth.attitude[0] - row[6:9] + np.pi) % (2.0 * np.pi) - np.pi
    return np.concatenate([position, truth.velocity_n[0] - row[3:6], attitude]), row[9:]


@cache
def honesty(scene, grade, runs):
    """(runs, 9) errors and deviations, and where the headings came from."""
    make, begin, options = SCENES[scene]
    errors, deviations, sources = [], [], []
    for seed in range(runs):
        motion = make(seed)
        alignment, _ = find(motion, grade, seed, begin, **options)
        error, sd = errors_and_deviations(alignment.start, motion)
        errors.append(error)
        deviations.append(sd)
        sources.append(alignment.heading_source)
    return np.array(errors), np.array(deviations), sources


def assert_honest(scene, grade, runs):
    errors, deviations, _ = honesty(scene, grade, runs)
    ratios = np.sqrt(np.mean((errors / deviations) ** 2, axis=0))
    assert np.all(ratios < 1.3), f"errors over deviations: {np.round(ratios, 2)}"


@pytest.mark.parametrize("scene", SCENES)
def test_deviations_of_the_start_are_honest(scene):
    assert_honest(scene, "industrial-mems", 12)


@pytest.mark.slow
@pytest.mark.parametrize("grade", ["consumer", "industrial-mems", "tactical"])
@pytest.mark.parametrize("scene", SCENES)
def test_deviations_of_many_starts_are_honest(scene, grade):
    assert_honest(scene, grade, 60)


@pytest.mark.parametrize("scene", SCENES)
def test_heading_is_found_well_enough_to_linearise(scene):
    errors, deviations, sources = honesty(scene, "industrial-mems", 12)
    assert set(sources) == {"motion"}
    assert np.degrees(deviations[:, 8].max()) < 6.0
    assert np.degrees(np.abs(errors[:, 8]).max()) < 8.0


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_heading_of_a_poor_sensor_is_never_wrong_by_far(scene):
    errors, deviations, _ = honesty(scene, "consumer", 60)
    assert np.abs(errors[:, 8] / deviations[:, 8]).max() < 4.0


def test_a_stand_gives_level_and_gyro_bias():
    motion = static(60.0, roll=0.2, pitch=-0.3, heading=1.0)
    alignment, logs = find(motion, "industrial-mems", seed=3)
    assert alignment.level_source == "standing"
    assert alignment.standing_s > 55.0
    error, sd = errors_and_deviations(alignment.start, motion)
    assert np.all(np.abs(error[6:8]) < 3.0 * sd[6:8])
    assert np.degrees(sd[6:8].max()) < 0.5
    bias, bias_sd = alignment.start.states["gyro_bias"]
    assert np.all(np.abs(bias - logs.imu_errors.gyro_bias[100]) < 3.0 * bias_sd)
    assert np.all(bias_sd < np.radians(0.01))
    assert np.array_equal(alignment.start.nav[3:6], np.zeros(3))


def test_a_stand_ends_where_the_car_drives_off():
    alignment, _ = find(car_drive(60.0, seed=2, standing=20.0), "industrial-mems")
    assert 17.0 < alignment.standing_s < 22.5


@pytest.mark.parametrize("velocity", [True, False], ids=["velocity", "positions"])
def test_without_motion_the_heading_is_unknown(velocity):
    options = {} if velocity else {"sd_velocity": None}
    alignment, _ = find(static(120.0, heading=2.0), "consumer", **options)
    assert alignment.heading_source == "unknown"
    assert np.degrees(described(alignment.start)[17]) == pytest.approx(UNKNOWN_DEG)
    assert "heading could not be found" in "".join(alignment.notes)


@pytest.mark.parametrize("speed", [1.5, 3.0, 6.0, 12.0, 25.0])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_steady_motion_is_not_a_stand(speed, seed):
    motion = level_drive(90.0, [(50.0, 6.0, -0.5 * speed)], [(30.0, 8.0, 1.5)], speed=speed, heading=seed)
    alignment, _ = find(motion, "industrial-mems", seed, sd_velocity=None)
    error, sd = errors_and_deviations(alignment.start, motion)
    assert np.all(np.abs(error[3:6]) < 4.0 * sd[3:6])


@pytest.mark.parametrize("lat", [0.0, 0.8, -1.2])
def test_good_gyroscopes_find_north_at_rest(lat):
    ratios = []
    for seed in range(8):
        motion = static(240.0, lat=lat, heading=0.8 * seed, roll=0.02, pitch=0.05)
        alignment, _ = find(motion, "navigation", seed)
        error, sd = errors_and_deviations(alignment.start, motion)
        assert alignment.heading_source == "earth rate"
        assert np.degrees(sd[8]) < 0.3
        ratios.append(error[8] / sd[8])
    assert np.sqrt(np.mean(np.square(ratios))) < 1.6


def test_poor_gyroscopes_do_not_pretend_to_find_north():
    alignment, _ = find(static(240.0, heading=1.0), "industrial-mems")
    assert alignment.heading_source == "unknown"


def test_an_outlier_among_the_first_fixes_does_no_harm():
    motion = car_drive(60.0, seed=4, standing=20.0)
    logs = simulate(motion, GRADES["industrial-mems"], 1, imu_rate=50.0)
    logs.gnss.lat[0] += 500.0 / 6.4e6
    alignment = align(to_increments(logs.imu), logs.gnss, GRADES["industrial-mems"], NO_LEVER)
    error, sd = errors_and_deviations(alignment.start, motion)
    assert np.all(np.abs(error) < 4.0 * sd)


def test_the_start_is_at_the_first_moment_with_both():
    motion = car_drive(60.0, seed=4, standing=20.0)
    late_fixes, _ = find(motion, "industrial-mems", gnss_offset=7.5)
    assert late_fixes.start.time == pytest.approx(7.5, abs=0.021)
    late_imu, _ = find(motion, "industrial-mems", begin=4.3)
    assert late_imu.start.time == pytest.approx(4.3)


POSITION = np.array([0.8, 0.2, 100.0])
ALL_KNOWN = Known(
    time=2.0,
    position=POSITION,
    velocity_n=np.array([0.0, 0.0, 0.0]),
    roll=0.01,
    pitch=0.02,
    heading=3.0,
    sd_position=np.array([1.0, 2.0, 3.0]),
    sd_velocity=np.array([0.1, 0.2, 0.3]),
    sd_attitude=np.array([0.01, 0.02, 0.03]),
)


def test_a_start_that_is_given_is_taken_without_gnss():
    logs = simulate(static(20.0), GRADES["industrial-mems"], 1, imu_rate=50.0)
    alignment = align(to_increments(logs.imu), None, GRADES["industrial-mems"], NO_LEVER, ALL_KNOWN)
    row = described(alignment.start)
    assert alignment.start.time == pytest.approx(2.0)
    assert (alignment.level_source, alignment.heading_source) == ("given", "given")
    np.testing.assert_allclose(row[:9], [*POSITION, 0.0, 0.0, 0.0, 0.01, 0.02, 3.0], atol=1e-12)
    np.testing.assert_allclose(row[9:], [1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 0.01, 0.02, 0.03], rtol=1e-9)


@pytest.mark.parametrize("part", ["heading", "position", "velocity_n"])
def test_what_is_given_is_taken_and_the_rest_is_found(part):
    motion = car_drive(60.0, seed=2, heading=3.0, standing=20.0)
    truth = motion.trajectory(np.zeros(1))
    value = {
        "heading": float(truth.attitude[0, 2]) + 0.02,
        "position": np.array([truth.lat[0], truth.lon[0], truth.height[0] + 0.7]),
        "velocity_n": np.array([0.01, 0.02, 0.03]),
    }[part]
    known = Known(**{part: value}, sd_attitude=np.full(3, 0.03) if part == "heading" else None)
    alignment, _ = find(motion, "industrial-mems", known=known)
    row = described(alignment.start)
    where = {"heading": slice(8, 9), "position": slice(0, 3), "velocity_n": slice(3, 6)}[part]
    np.testing.assert_allclose(row[where], np.atleast_1d(value), atol=1e-12)
    error, sd = errors_and_deviations(alignment.start, motion)
    assert np.all(np.abs(error) < 4.0 * sd)
    assert (alignment.heading_source == "given") == (part == "heading")


def test_a_heading_given_as_good_as_unknown_is_improved_by_motion():
    known = Known(heading=0.0, sd_attitude=np.radians([1.0, 1.0, 180.0]))
    motion = car_drive(60.0, seed=2, heading=3.0, standing=20.0)
    alignment, _ = find(motion, "industrial-mems", known=known)
    assert alignment.heading_source == "motion"
    error, sd = errors_and_deviations(alignment.start, motion)
    assert abs(error[8]) < 4.0 * sd[8]
    static_start, _ = find(static(60.0), "industrial-mems", known=known)
    assert np.degrees(described(static_start.start)[17]) == pytest.approx(UNKNOWN_DEG)


def test_a_heading_that_the_motion_contradicts_is_pointed_out():
    known = Known(heading=1.0, sd_attitude=np.radians([1.0, 1.0, 2.0]))
    alignment, _ = find(car_drive(60.0, seed=2, heading=3.0, standing=20.0), "industrial-mems", known=known)
    assert "contradicts the motion" in "".join(alignment.notes)
    assert alignment.heading_source == "given"


def turned(log, rotation):
    return dataclasses.replace(log, gyro=log.gyro @ rotation.T, accel=log.accel @ rotation.T)


@pytest.mark.parametrize(
    ("axes", "upward"),
    [
        (np.diag([1.0, -1.0, -1.0]), r"\+z"),
        (np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]), "-x"),
        (np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), r"\+y"),
    ],
    ids=["z upward", "x down", "y upward"],
)
def test_wrong_axes_end_in_a_word_about_gravity(axes, upward):
    logs = simulate(car_drive(40.0, standing=20.0), GRADES["industrial-mems"], 1, imu_rate=50.0)
    increments = to_increments(turned(logs.imu, axes))
    with pytest.raises(AlignmentError, match=rf"gravity points the wrong way.*upward axis is {upward} "):
        align(increments, logs.gnss, GRADES["industrial-mems"], NO_LEVER)


def test_axes_that_are_turned_level_show_as_a_heading_of_the_sensor():
    """A sensor mounted sideways is no error: heading is that of its x axis."""
    motion = car_drive(60.0, seed=3, heading=1.0, standing=20.0, hills=0.0)
    logs = simulate(motion, GRADES["industrial-mems"], 1, imu_rate=50.0)
    quarter = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    alignment = align(to_increments(turned(logs.imu, quarter)), logs.gnss, GRADES["industrial-mems"], NO_LEVER)
    row = described(alignment.start)
    assert abs((row[8] - 1.0 - 0.5 * np.pi + np.pi) % (2.0 * np.pi) - np.pi) < 3.0 * row[17]


@pytest.mark.parametrize("factor", [1.0 / 9.80665, 100.0])
def test_wrong_units_of_the_accelerometers_are_noticed(factor):
    logs = simulate(car_drive(40.0, standing=20.0), GRADES["industrial-mems"], 1, imu_rate=50.0)
    log = dataclasses.replace(logs.imu, accel=logs.imu.accel * factor)
    with pytest.raises(AlignmentError, match="check the unit of the accelerometer columns"):
        align(to_increments(log), logs.gnss, GRADES["industrial-mems"], NO_LEVER)


def test_logs_that_do_not_overlap_are_named_with_their_times():
    logs = simulate(car_drive(40.0), GRADES["industrial-mems"], 1, imu_rate=50.0)
    gnss = dataclasses.replace(logs.gnss, time=logs.gnss.time + 1000.0)
    with pytest.raises(AlignmentError, match=r"\(0\.000 to 40\.000 s\) .* \(1000\.000 to 1040\.000 s\) do not overlap"):
        align(to_increments(logs.imu), gnss, GRADES["industrial-mems"], NO_LEVER)


def test_a_start_time_outside_the_log_is_refused():
    logs = simulate(car_drive(40.0), GRADES["industrial-mems"], 1, imu_rate=50.0)
    with pytest.raises(AlignmentError, match=r"time_s = 40\.000 lies outside .* 0\.000 to 40\.000 s"):
        align(to_increments(logs.imu), logs.gnss, GRADES["industrial-mems"], NO_LEVER, Known(time=40.0))


def test_without_gnss_a_start_must_be_given_in_full():
    logs = simulate(static(40.0), GRADES["industrial-mems"], 1, imu_rate=50.0)
    with pytest.raises(AlignmentError, match="given in full"):
        align(to_increments(logs.imu), None, GRADES["industrial-mems"], NO_LEVER, Known(heading=1.0))


def test_one_fix_is_not_enough_for_a_velocity():
    logs = simulate(car_drive(40.0, standing=2.0), GRADES["industrial-mems"], 1, imu_rate=50.0)
    g = logs.gnss
    one = GnssLog(g.time[15:16], g.lat[15:16], g.lon[15:16], g.height[15:16], g.sd_position[15:16])
    with pytest.raises(AlignmentError, match="from a single fix"):
        align(cut(to_increments(logs.imu), 700), one, GRADES["industrial-mems"], NO_LEVER)


def test_a_level_that_the_accelerometers_contradict_is_refused():
    known = Known(roll=0.5, pitch=0.0, sd_attitude=np.radians([1.0, 1.0, 2.0]))
    with pytest.raises(AlignmentError, match=r"roll_deg = 28\.6 contradicts the accelerometers"):
        find(static(60.0), "industrial-mems", known=known)


def test_a_position_far_from_the_fixes_is_refused():
    known = Known(position=np.array([0.81, 0.2, 100.0]))
    with pytest.raises(AlignmentError, match=r"lie 63\.\d km from the GNSS fixes"):
        find(static(60.0), "industrial-mems", known=known)


def test_a_sensor_that_does_not_fit_its_grade_is_pointed_out():
    logs = simulate(static(60.0), GRADES["industrial-mems"], 1, imu_rate=50.0)
    log = dataclasses.replace(logs.imu, gyro=logs.imu.gyro + 0.02 * np.radians(0.5))
    notes = align(to_increments(log), logs.gnss, GRADES["navigation"], NO_LEVER).notes
    assert "choose the imu.grade of your sensor" in "".join(notes)
    assert "at rest the gyroscopes read" in "".join(notes)


def test_motion_of_another_vehicle_is_refused():
    """Fixes of one drive, increments of another."""
    logs = simulate(car_drive(300.0, seed=1, standing=10.0), GRADES["tactical"], 1, imu_rate=50.0)
    wrong = dataclasses.replace(logs.imu, accel=logs.imu.accel * [3.0, 3.0, 1.0])
    with pytest.raises(AlignmentError, match="times that seen by GNSS"):
        align(to_increments(wrong), logs.gnss, GRADES["tactical"], NO_LEVER)


def test_gyrocompassing_allows_for_the_earth_rate_in_the_bias():
    alignment, _ = find(static(60.0, lat=1.2), "industrial-mems")
    _, sd = alignment.start.states["gyro_bias"]
    assert np.all(sd > EARTH_RATE)
