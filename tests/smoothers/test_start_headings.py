"""Alignment, trial filters and the filter itself, one after the other: does every beginning lead to the right
heading?
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity
from navfuse.data.start import Start
from navfuse.filters.ekf import FilterSettings
from navfuse.imu.alignment import align
from navfuse.imu.grades import GRADES
from navfuse.imu.increments import to_increments
from navfuse.simulation import Accelerate, Hold, car, car_drive, drive, figure_eight_flight, simulate
from navfuse.smoothers.rts import smooth
from navfuse.smoothers.start import improve_start
from reference.engine_runs import cut, run_filter
from reference.start_scenes import SCENES

UNKNOWN = np.pi / np.sqrt(3.0)
FRAMES = pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])


def forgotten(alignment, heading):
    """An alignment that found all but the heading, and took `heading` [rad] for it."""
    start, sd = alignment.start, np.sqrt(np.diagonal(alignment.start.P))
    euler = np.array([0.0, 0.0, heading])
    level = max(*sd[6:8], np.radians(3.0))
    unknown = Start.from_parts(
        start.time, start.nav[:3], start.nav[3:6], euler, sd[:3], sd[3:6], [level, level, UNKNOWN], start.states
    )
    return replace(alignment, start=unknown, heading_source="unknown")


def heading_ratio(trajectory, motion):
    """(r, 2) heading errors [rad], and the same over their deviations."""
    truth = motion.trajectory(trajectory.time).attitude[:, 2]
    error = (truth - trajectory.attitude[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    return error, error / trajectory.sd_attitude[:, 2]


def journey(motion, grade, seed, begin, options, *, forget=None, ecef=False):
    """Where the heading came from, the filter from there on, and the smoother."""
    model, lever = GRADES[grade], np.array(options.get("lever_arm_b", (0.0, 0.0, 0.0)))
    logs = simulate(motion, model, seed, imu_rate=50.0, **options)
    increments = cut(to_increments(logs.imu), round(50.0 * begin))
    alignment = align(increments, logs.gnss, model, lever)
    if forget is not None:
        alignment = forgotten(alignment, forget)
    increments = cut(increments, int(np.searchsorted(increments.time, alignment.start.time - 1e-6)))
    sensors = [GnssPosition(logs.gnss, lever)]
    if logs.gnss.velocity_n is not None:
        sensors.append(GnssVelocity(logs.gnss, lever))
    settings = FilterSettings(ecef=ecef, output_period=1.0, checkpoints=True)
    improved = improve_start(alignment, increments, model, sensors, settings)
    filter_ = run_filter(improved.start, model, sensors, increments, settings)
    return improved.heading_source, filter_.record.trajectory(), smooth(filter_, increments).trajectory


def assert_heading_right(make, grade, seeds, begin, options, **arguments):
    """The heading is near the truth and as honest as a filter can be, from the first second to the last."""
    ends, everywhere, smoothed = [], [], []
    for seed in seeds:
        motion = make(seed)
        source, forward, back = journey(motion, grade, seed, begin, options, **arguments)
        assert source != "unknown", seed
        error, ratio = heading_ratio(forward, motion)
        assert np.degrees(abs(error[-1])) < 5.0, seed
        ends.append(ratio[-1])
        everywhere.append(np.abs(ratio).max())
        smoothed.append(np.abs(heading_ratio(back, motion)[1]).max())
    assert np.sqrt(np.mean(np.square(ends))) < 2.2
    assert max(everywhere) < 6.0
    assert max(smoothed) < 6.0


DRIVES = {
    "car": lambda seed: car_drive(120.0, seed=seed, heading=0.6 * seed, standing=15.0),
    "flight": lambda seed: figure_eight_flight(120.0, heading=0.6 * seed),
}
VELOCITY = pytest.mark.parametrize("velocity", [True, False], ids=["velocity", "positions"])


@FRAMES
@VELOCITY
@pytest.mark.parametrize("grade", ["consumer", "industrial-mems"])
@pytest.mark.parametrize("name", DRIVES)
def test_motion_tells_a_heading_that_was_unknown(name, grade, velocity, ecef):
    options = {} if velocity else {"sd_velocity": None}
    assert_heading_right(DRIVES[name], grade, range(1), 2.0, options, forget=2.0, ecef=ecef)


@pytest.mark.slow
@FRAMES
@VELOCITY
@pytest.mark.parametrize("grade", ["consumer", "industrial-mems"])
@pytest.mark.parametrize("name", DRIVES)
def test_motion_tells_a_heading_that_was_unknown_whatever_it_was(name, grade, velocity, ecef):
    options = {} if velocity else {"sd_velocity": None}
    assert_heading_right(DRIVES[name], grade, range(10, 40), 2.0, options, forget=2.0, ecef=ecef)


@pytest.mark.parametrize("grade", ["consumer", "industrial-mems"])
@pytest.mark.parametrize("scene", SCENES)
def test_every_beginning_leads_to_the_heading(scene, grade):
    make, begin, options = SCENES[scene]
    assert_heading_right(make, grade, range(2), begin, options)


@pytest.mark.slow
@pytest.mark.parametrize("grade", ["consumer", "industrial-mems", "tactical"])
@pytest.mark.parametrize("scene", SCENES)
def test_many_beginnings_lead_to_the_heading(scene, grade):
    make, begin, options = SCENES[scene]
    assert_heading_right(make, grade, range(10, 50), begin, options)


@pytest.mark.parametrize("seed", range(4))
def test_a_straight_course_is_not_made_worse(seed):
    """Where the log says little of heading and bias, smoothing the start must not spend what is known of them."""
    model = GRADES["industrial-mems"]
    motion = drive(
        car(), [Accelerate(20.0), Hold(200.0)], lat=0.8, lon=0.2, height=100.0, heading=0.3 + seed, speed=10.0
    )
    logs = simulate(motion, model, seed, imu_rate=50.0)
    increments = cut(to_increments(logs.imu), 1000)
    alignment = align(increments, logs.gnss, model, np.zeros(3))
    increments = cut(increments, int(np.searchsorted(increments.time, alignment.start.time - 1e-6)))
    sensors = [GnssPosition(logs.gnss), GnssVelocity(logs.gnss)]
    improved = improve_start(alignment, increments, model, sensors, FilterSettings(checkpoints=True))
    assert alignment.heading_source == "course"
    heading, given = (start.P[8, 8] for start in (improved.start, alignment.start))
    assert heading <= given * 1.01
    bias_sd = improved.start.states.get("gyro_bias", (0.0, model.axes("gyro_bias_sd")))[1]
    assert np.all(bias_sd <= model.axes("gyro_bias_sd") * (1.0 + 1e-9))
    filter_ = run_filter(improved.start, model, sensors, increments, FilterSettings(output_period=1.0))
    error, ratio = heading_ratio(filter_.record.trajectory(), motion)
    assert np.degrees(np.abs(error).max()) < 20.0
    assert np.abs(ratio).max() < 3.0
