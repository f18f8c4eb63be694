"""A heading of which nothing is known stays unknown at rest."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity
from navfuse.data.start import Known, Start
from navfuse.filters.ekf import FilterSettings
from navfuse.imu.alignment import align
from navfuse.imu.grades import GRADES
from navfuse.imu.increments import to_increments
from navfuse.simulation import simulate, static
from navfuse.smoothers.rts import smooth
from reference.engine_runs import run_filter

UNKNOWN = np.pi / np.sqrt(3.0)


def unknown_start(motion, sd_level, rng):
    """Level as well as `sd_level` [rad], heading anywhere."""
    truth = motion.trajectory(np.zeros(1))
    wrong = np.array([*(sd_level * rng.standard_normal(2)), rng.uniform(-np.pi, np.pi)])
    position = np.array([truth.lat[0], truth.lon[0], truth.height[0]])
    sd_euler = [sd_level, sd_level, UNKNOWN]
    return Start.from_parts(0.0, position, np.zeros(3), truth.attitude[0] + wrong, [2.0, 2.0, 4.0], [0.1] * 3, sd_euler)


def run(motion, grade, sd_level, seed, mode, velocity=True):
    logs = simulate(motion, GRADES[grade], seed, imu_rate=50.0, sd_velocity=(0.05, 0.05, 0.1) if velocity else None)
    sensors = [kind(logs.gnss) for kind in ([GnssPosition, GnssVelocity] if velocity else [GnssPosition])]
    options = FilterSettings(output_period=5.0, checkpoints=True, **mode)
    increments = to_increments(logs.imu)
    start = unknown_start(motion, sd_level, np.random.default_rng(seed))
    return run_filter(start, GRADES[grade], sensors, increments, options), increments


def attitude_errors(trajectory, motion):
    """(r, 3) errors of roll, pitch and heading [rad]."""
    truth = motion.trajectory(trajectory.time).attitude
    return (truth - trajectory.attitude + np.pi) % (2.0 * np.pi) - np.pi


@pytest.mark.parametrize("velocity", [True, False], ids=["with velocity", "positions only"])
@pytest.mark.parametrize(
    ("grade", "sd_level", "mode"),
    [
        ("consumer", 1.8, {}),
        ("consumer", 1.8, {"ecef": True}),
        ("industrial-mems", 0.3, {}),
        ("industrial-mems", 0.3, {"ecef": True}),
        ("industrial-mems", 0.3, {"open_loop": True}),
    ],
)
def test_ten_minutes_at_rest_teach_no_heading(grade, sd_level, mode, velocity):
    filter_, increments = run(static(600.0, heading=2.0), grade, np.radians(sd_level), 1, mode, velocity)
    forward, back = filter_.record.trajectory(), smooth(filter_, increments).trajectory
    assert np.degrees(forward.sd_attitude[:, 2].min()) > 100.0
    assert np.degrees(back.sd_attitude[:, 2].min()) > 100.0


def tilt_at_rest(grade, mode, runs=24):
    """Root mean square of roll and pitch errors over their deviations after ten minutes."""
    ratios = []
    for seed in range(runs):
        motion = static(600.0, heading=0.5 * seed, roll=0.05, pitch=-0.03)
        logs = simulate(motion, GRADES[grade], seed, imu_rate=50.0)
        increments = to_increments(logs.imu)
        start = align(increments, logs.gnss, GRADES[grade], np.zeros(3)).start
        sensors = [GnssPosition(logs.gnss), GnssVelocity(logs.gnss)]
        options = FilterSettings(output_period=60.0, **mode)
        trajectory = run_filter(start, GRADES[grade], sensors, increments, options).record.trajectory()
        ratios.append((attitude_errors(trajectory, motion) / trajectory.sd_attitude)[-1, :2])
    return np.sqrt(np.mean(np.square(ratios)))


@pytest.mark.slow
@pytest.mark.parametrize("mode", [{}, {"open_loop": True}], ids=["closed", "open"])
def test_roll_and_pitch_stay_honest_at_rest(mode):
    assert tilt_at_rest("industrial-mems", mode) < 1.5


@pytest.mark.slow
def test_roll_and_pitch_of_a_poor_sensor_stay_honest_at_rest_in_an_open_loop():
    assert tilt_at_rest("consumer", {"open_loop": True}) < 1.5


@pytest.mark.slow
@pytest.mark.xfail(
    reason="at rest tilt and accelerometer bias cannot be told apart; a closed loop that corrects both by degrees "
    "learns from its own corrections, as extended Kalman filters do"
)
def test_roll_and_pitch_of_a_poor_sensor_stay_honest_at_rest_in_a_closed_loop():
    assert tilt_at_rest("consumer", {}) < 1.5


@pytest.mark.slow
@pytest.mark.xfail(
    reason="a heading known to 25 deg is not held: minutes at rest shrink its deviation to 8 deg without reason; "
    "a start found in the log is better than that or unknown"
)
def test_ten_minutes_at_rest_teach_nothing_about_a_heading_half_known():
    logs = simulate(static(600.0, heading=2.0), GRADES["industrial-mems"], 1, imu_rate=50.0)
    increments = to_increments(logs.imu)
    known = Known(heading=2.3, sd_attitude=np.radians([0.3, 0.3, 25.0]))
    start = align(increments, logs.gnss, GRADES["industrial-mems"], np.zeros(3), known).start
    sensors = [GnssPosition(logs.gnss), GnssVelocity(logs.gnss)]
    filter_ = run_filter(start, GRADES["industrial-mems"], sensors, increments)
    assert np.degrees(filter_.record.trajectory().sd_attitude[-1, 2]) > 22.0
