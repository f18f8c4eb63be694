"""Are the errors as large as the covariances say? Seeded Monte Carlo against chi-square bounds from the number of runs.

Every run draws the start error, the sensor errors and the noise of sensor and fixes from exactly the model that the
filter is given. NEES covers all 21 states, NIS every innovation; a smoother shows only deviations, so its errors are
tested one by one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2

from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity
from navfuse.filters.ekf import ErrorStateFilter, FilterSettings
from navfuse.imu.increments import to_increments
from navfuse.simulation import car_drive, figure_eight_flight, simulate
from navfuse.smoothers.rts import smooth
from reference.engine_runs import MEMS, cut, nav_at, start_at
from reference.navigation_algebra import error

MOTIONS = {
    "car": car_drive(90.0, seed=21, standing=3.0),
    "flight": figure_eight_flight(90.0, straight=10.0),
}
LEVER = np.array([0.8, -0.5, -1.4])
SD = ([1.0, 1.0, 2.0], [0.05] * 3, np.radians([0.3, 0.3, 1.0]))
EPOCHS = (15.0, 40.0, 90.0)
PROBABILITY = 0.999
NAMES = ("gyro_bias", "accel_bias", "gyro_scale", "accel_scale")


@dataclass
class Campaign:
    """Sums over runs.

    Attributes
    ----------
    nees : (runs, epochs) array
        Of 21 states.
    nis : (m,) array
        Of every innovation of three values.
    forward, smoothed : (runs, epochs, 9) arrays
        Errors of position, velocity, roll, pitch and heading over the stated deviations.
    states : (runs, epochs, 12) array
        The same of the smoothed sensor errors.
    """

    nees: np.ndarray
    nis: np.ndarray
    forward: np.ndarray
    smoothed: np.ndarray
    states: np.ndarray


def normalised(trajectory, motion):
    """(epochs, 9) errors over deviations at the epochs."""
    k = np.searchsorted(trajectory.time, np.array(EPOCHS) - 1e-6)
    truth = motion.trajectory(trajectory.time[k])
    lat, lon, height = trajectory.lat[k], trajectory.lon[k], trajectory.height[k]
    north, east = 6.367e6 * (truth.lat - lat), 6.388e6 * np.cos(lat) * (truth.lon - lon)
    position = np.column_stack([north, east, height - truth.height]) / trajectory.sd_position[k]
    velocity = (truth.velocity_n - trajectory.velocity_n[k]) / trajectory.sd_velocity[k]
    turned = (truth.attitude - trajectory.attitude[k] + np.pi) % (2.0 * np.pi) - np.pi
    return np.hstack([position, velocity, turned / trajectory.sd_attitude[k]])


def sensor_truth(logs, time):
    """(12,) true sensor errors at a time."""
    k = np.searchsorted(logs.imu.time, time - 1e-9)
    return np.concatenate([getattr(logs.imu_errors, name)[k] for name in NAMES])


@cache
def campaign(name, ecef, runs, first_seed=0, noise=1.0):
    """`noise` multiplies the deviations of the fixes that the filter is told."""
    motion = MOTIONS[name]
    nees, nis = np.empty((runs, len(EPOCHS))), []
    forward, smoothed = np.empty((runs, len(EPOCHS), 9)), np.empty((runs, len(EPOCHS), 9))
    states = np.empty((runs, len(EPOCHS), 12))
    for run in range(runs):
        seed = first_seed + run
        logs = simulate(motion, MEMS, seed, imu_rate=50.0, lever_arm_b=LEVER, sd_position=(0.5, 0.6, 1.2))
        log = logs.gnss
        log.sd_position[:] *= noise
        log.sd_velocity[:] *= noise
        start = start_at(motion, 0.0, *SD, np.random.default_rng([seed, 1]))
        options = FilterSettings(ecef=ecef, checkpoints=True, gate_probability=1.0, output_period=1.0)
        filter_ = ErrorStateFilter(start, MEMS, [GnssPosition(log, LEVER), GnssVelocity(log, LEVER)], options)
        increments = to_increments(logs.imu)
        edges = [0, *(round(epoch * 50.0) for epoch in EPOCHS)]
        for e, epoch in enumerate(EPOCHS):
            filter_.feed(cut(increments, edges[e], edges[e + 1]))
            navigation = error(nav_at(motion, epoch, ecef), filter_.nav, ecef)
            d = np.concatenate([navigation, sensor_truth(logs, epoch) - filter_.s])
            nees[run, e] = d @ np.linalg.solve(filter_.P, d)
        back = smooth(filter_, increments)
        nis += [innovation.nis for innovation in filter_.record.innovations]
        forward[run] = normalised(filter_.record.trajectory(), motion)
        smoothed[run] = normalised(back.trajectory, motion)
        rows = np.searchsorted(back.state_time, np.array(EPOCHS) - 1e-6)
        truth = np.array([sensor_truth(logs, epoch) for epoch in EPOCHS])
        states[run] = (truth - back.state_value[rows]) / back.state_sd[rows]
    return Campaign(nees, np.array(nis), forward, smoothed, states)


def bounds(degrees, probability=PROBABILITY):
    """Interval that holds the mean of `degrees` squared unit normals with the given probability."""
    tail = 0.5 * (1.0 - probability)
    return chi2.ppf([tail, 1.0 - tail], degrees) / degrees


def assert_consistent(squares, degrees_each):
    """Mean of the squares per degree of freedom within the bounds of their number."""
    mean = np.mean(squares) / degrees_each
    low, high = bounds(np.size(squares) * degrees_each)
    assert low < mean < high, f"{mean:.4f} per degree of freedom, not within {low:.4f} and {high:.4f}"


def assert_each_consistent(ratios):
    """Every column of (runs, epochs, k) normalised errors; with k epochs columns at once the bounds are wider."""
    runs, columns = ratios.shape[0], ratios[0].size
    low, high = bounds(runs, 1.0 - (1.0 - PROBABILITY) / columns)
    means = np.mean(ratios**2, axis=0)
    assert np.all((low < means) & (means < high)), f"{np.round(means, 2)}, not within {low:.2f} and {high:.2f}"


CASES = pytest.mark.parametrize(
    ("name", "ecef"), [("car", False), ("car", True), ("flight", False)], ids=["car, n", "car, e", "flight, n"]
)
RUNS = 40


@CASES
def test_the_filter_is_consistent(name, ecef):
    runs = campaign(name, ecef, RUNS)
    for epoch in range(len(EPOCHS)):
        assert_consistent(runs.nees[:, epoch], 21)
    assert_consistent(runs.nis, 3)
    assert_each_consistent(runs.forward)


@CASES
def test_the_smoother_is_consistent(name, ecef):
    runs = campaign(name, ecef, RUNS)
    assert_each_consistent(runs.smoothed)
    assert_each_consistent(runs.states)


@pytest.mark.parametrize("ecef", [False, True], ids=["n", "e"])
def test_half_the_variance_of_the_fixes_is_found_out(ecef):
    runs = campaign("car", ecef, 20, noise=np.sqrt(0.5))
    assert np.mean(runs.nis) / 3.0 > bounds(runs.nis.size * 3)[1]
    assert np.mean(runs.nees[:, -1]) / 21.0 > bounds(20 * 21)[1]


def test_twice_the_variance_of_the_fixes_is_found_out():
    runs = campaign("car", False, 20, noise=np.sqrt(2.0))
    assert np.mean(runs.nis) / 3.0 < bounds(runs.nis.size * 3)[0]


@pytest.mark.slow
@CASES
def test_many_runs_are_consistent(name, ecef):
    runs = campaign(name, ecef, 400, first_seed=1000)
    for epoch in range(len(EPOCHS)):
        assert_consistent(runs.nees[:, epoch], 21)
    assert_consistent(runs.nis, 3)
    for ratios in (runs.forward, runs.smoothed, runs.states):
        assert_each_consistent(ratios)
