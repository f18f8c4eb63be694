"""Starts that are rough or unknown, improved by trial filters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from navfuse.aiding import GnssPosition, GnssVelocity
from navfuse.data.start import Start
from navfuse.filters.ekf import ErrorStateFilter, FilterSettings
from navfuse.imu.alignment import UNKNOWN_HEADING_SD, align
from navfuse.imu.grades import grade
from navfuse.imu.increments import to_increments
from navfuse.simulation import car_drive, simulate, static
from navfuse.smoothers.start import improve_start

STILL = np.zeros(3)


def setting(motion, name, seed):
    model = grade(name)
    logs = simulate(motion, model, seed)
    increments = to_increments(logs.imu)
    alignment = align(increments, logs.gnss, model, STILL)
    return logs, model, increments, alignment, [GnssPosition(logs.gnss), GnssVelocity(logs.gnss)]


def with_heading(alignment, degrees, sd, source):
    start = alignment.start
    parts = (start.time, start.nav[:3], start.nav[3:6], np.array([0.0, 0.0, np.radians(degrees)]))
    sds = np.sqrt(np.diagonal(start.P))
    rough = Start.from_parts(*parts, sds[:3], sds[3:6], np.array([0.02, 0.02, sd]), start.states)
    return replace(alignment, start=rough, heading_source=source)


def heading_of(alignment, model, sensors):
    estimator = ErrorStateFilter(alignment.start, model, sensors, FilterSettings())
    trajectory_start = estimator.nav_state()
    C = trajectory_start.C_nb
    sd = np.sqrt(alignment.start.P[8, 8])
    return float(np.arctan2(C[1, 0], C[0, 0])), float(sd)


@pytest.mark.parametrize(("name", "seed"), [("industrial-mems", 1), ("consumer", 2)])
@pytest.mark.parametrize("heading", [0.0, 95.0, 215.0])
def test_an_unknown_heading_is_found_by_trial(name, seed, heading):
    logs, model, increments, alignment, sensors = setting(car_drive(duration=120.0, seed=seed, heading=2.0), name, seed)
    unknown = with_heading(alignment, heading, UNKNOWN_HEADING_SD, "unknown")
    improved = improve_start(unknown, increments, model, sensors, FilterSettings())
    assert improved.heading_source == "search"
    found, sd = heading_of(improved, model, sensors)
    error = (found - logs.truth.attitude[0, 2] + np.pi) % (2 * np.pi) - np.pi
    assert abs(error) < 3.0 * sd
    assert sd < np.radians(2.0)


def test_a_log_that_never_moves_leaves_it_unknown():
    _, model, increments, alignment, sensors = setting(static(duration=90.0), "consumer", 3)
    assert alignment.heading_source == "unknown"
    assert improve_start(alignment, increments, model, sensors, FilterSettings()) is alignment


def test_a_rough_heading_becomes_a_good_one():
    logs, model, increments, alignment, sensors = setting(car_drive(duration=120.0, seed=5), "consumer", 5)
    truth = np.degrees(logs.truth.attitude[0, 2])
    rough = with_heading(alignment, truth + 15.0, np.radians(20.0), "motion")
    improved = improve_start(rough, increments, model, sensors, FilterSettings())
    found, sd = heading_of(improved, model, sensors)
    error = (found - logs.truth.attitude[0, 2] + np.pi) % (2 * np.pi) - np.pi
    assert abs(error) < min(3.0 * sd, np.radians(2.0))


def test_what_the_user_gave_is_left_alone():
    _, model, increments, alignment, sensors = setting(car_drive(duration=60.0, seed=5), "consumer", 5)
    given = with_heading(alignment, 10.0, np.radians(20.0), "given")
    assert improve_start(given, increments, model, sensors, FilterSettings()) is given
