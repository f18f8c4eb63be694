from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import simpson

from navfuse.errors import ConfigError, InputError
from navfuse.simulation import car_drive, figure_eight_flight, perfect_imu, sample_times, static

MOTIONS = {
    "car": lambda: car_drive(40.0, seed=2, standing=5.0),
    "car at the pole": lambda: car_drive(40.0, seed=2, standing=5.0, lat=math.pi / 2.0),
    "flight": lambda: figure_eight_flight(40.0, straight=5.0),
}


def dense(motion, start, end):
    """Integrals of rate and specific force by Simpson's rule on 401 points."""
    t = np.linspace(start, end, 401)
    state = motion.at(t)
    return simpson(state.w_ib_b, x=t, axis=0), simpson(state.f_b, x=t, axis=0)


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("rate", [1.0, 10.0, 97.0, 200.0])
def test_increments_are_integrals_of_rate_and_specific_force(name, rate):
    motion = MOTIONS[name]()
    time = sample_times(0.0, 40.0, rate)
    log = perfect_imu(motion, time)
    assert log.kind == "increments"
    rows = np.unique(np.linspace(1, time.size - 1, 60).astype(int))
    expected = [dense(motion, time[k - 1], time[k]) for k in rows]
    np.testing.assert_allclose(log.gyro[rows], [e[0] for e in expected], atol=1e-10)
    np.testing.assert_allclose(log.accel[rows], [e[1] for e in expected], atol=1e-9)


def test_increments_add_up_over_any_sampling():
    motion = MOTIONS["car"]()
    stamps = np.unique(np.concatenate([[0.0, 40.0], np.random.default_rng(0).uniform(0.0, 40.0, 3000)]))
    regular, irregular = perfect_imu(motion, sample_times(0.0, 40.0, 200.0)), perfect_imu(motion, stamps)
    np.testing.assert_allclose(regular.gyro[1:].sum(axis=0), irregular.gyro[1:].sum(axis=0), atol=1e-11)
    np.testing.assert_allclose(regular.accel[1:].sum(axis=0), irregular.accel[1:].sum(axis=0), atol=1e-10)


def test_rates_are_instantaneous():
    motion = MOTIONS["flight"]()
    time = sample_times(3.0, 30.0, 50.0)
    log = perfect_imu(motion, time, "rates")
    assert log.kind == "rates"
    np.testing.assert_array_equal(log.gyro, motion.w_ib_b(time))
    np.testing.assert_array_equal(log.accel, motion.f_b(time))
    np.testing.assert_array_equal(log.time, time)


def test_the_first_increment_stands_for_the_interval_before():
    motion = static(10.0)
    log = perfect_imu(motion, sample_times(0.0, 10.0, 100.0))
    np.testing.assert_allclose(log.gyro[0], log.gyro[1], atol=1e-17)
    np.testing.assert_allclose(log.accel[0], log.accel[1], atol=1e-13)
    assert log.accel[0, 2] == pytest.approx(-9.81 / 100.0, rel=1e-3)


def test_sample_times_run_from_start_to_end():
    np.testing.assert_allclose(sample_times(2.0, 3.0, 4.0), [2.0, 2.25, 2.5, 2.75, 3.0])
    np.testing.assert_allclose(sample_times(2.0, 3.0, 4.0, 0.1), [2.1, 2.35, 2.6, 2.85])
    assert sample_times(0.0, 1.0, 1.0, 1.5).size == 0
    for rate in (3.0, 7.0, 97.0, 100.0, 200.0):
        time = sample_times(0.0, 3600.0, rate)
        assert time.size == round(3600 * rate) + 1
        assert time[-1] == 3600.0


@pytest.mark.parametrize("rate", [0.0, -1.0, math.nan, math.inf])
def test_impossible_rates_are_refused(rate):
    with pytest.raises(ConfigError, match="sampling rate must be positive and finite"):
        sample_times(0.0, 1.0, rate)


def test_impossible_logs_are_refused():
    motion = static(10.0)
    with pytest.raises(ConfigError, match="'rates' or 'increments', not 'deltas'"):
        perfect_imu(motion, np.arange(3.0), "deltas")
    with pytest.raises(InputError, match="at least two stamps"):
        perfect_imu(motion, np.array([1.0]))
    with pytest.raises(InputError, match="they must increase"):
        perfect_imu(motion, np.array([1.0, 2.0, 2.0]))
    with pytest.raises(InputError, match="known from 0 s to 10 s"):
        perfect_imu(motion, np.array([9.0, 11.0]))
