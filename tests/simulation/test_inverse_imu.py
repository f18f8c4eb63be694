"""Increments that the engine turns back into the motion, step by step."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.errors import ConfigError, InputError
from navfuse.imu.increments import to_increments
from navfuse.mechanization.ecef import step_ecef
from navfuse.simulation import circle_flight, perfect_imu, sample_times
from reference.engine_runs import nav_at
from reference.missions import mission
from reference.navigation_algebra import dcm


def apart(motion, time, start=0):
    """Largest error of velocity [m/s] and of attitude [rad] at any stamp of the ECEF steps, begun on the motion."""
    increments = to_increments(perfect_imu(motion, time, form="inverse"))
    truth = motion.at(time)
    nav = nav_at(motion, time[start], ecef=True)
    velocity, attitude = [], []
    for k, (dt, theta, dv) in enumerate(zip(increments.dt, increments.inc_theta_b, increments.inc_v_b, strict=True)):
        step_ecef(nav, dt, *theta, *dv)
        velocity.append(nav[3:6] - truth.v_e[k + 1])
        attitude.append(dcm(nav[6:]) - dcm(truth.q_eb[k + 1]))
    return np.abs(velocity).max(), np.abs(attitude).max()


UNEVEN = np.unique(np.round(np.cumsum(np.random.default_rng(3).choice([0.004, 0.005, 0.0055], 4000)), 6))


@pytest.mark.parametrize("name", ["car", "drone, hard", "pedestrian", "table"])
@pytest.mark.parametrize("rate", [1.0, 10.0, 50.0, 200.0, "uneven"])
def test_velocity_and_attitude_come_back_at_every_stamp(name, rate):
    motion = mission(name, 21.0)
    velocity, attitude = apart(motion, UNEVEN if rate == "uneven" else sample_times(0.0, 20.0, rate))
    assert velocity < 1e-13
    assert attitude < 1e-14


def test_it_may_begin_anywhere_in_a_motion():
    motion = mission("pedestrian", 41.0)
    velocity, attitude = apart(motion, sample_times(21.37, 40.0, 100.0))
    assert velocity < 1e-13
    assert attitude < 1e-14


def test_how_it_began_is_forgotten_after_a_few_rows():
    motion = mission("drone, hard", 41.0)
    early = perfect_imu(motion, sample_times(0.0, 40.0, 100.0), form="inverse")
    late = perfect_imu(motion, sample_times(20.0, 40.0, 100.0), form="inverse")
    at = np.flatnonzero(early.time >= late.time[0] - 1e-9)
    np.testing.assert_allclose(early.time[at], late.time, atol=1e-12)
    np.testing.assert_allclose(early.gyro[at][8:], late.gyro[8:], atol=1e-13)
    np.testing.assert_allclose(early.accel[at][8:], late.accel[8:], atol=1e-11)


def test_it_nears_the_integrals_with_the_fourth_power_of_the_interval():
    motion = mission("pedestrian", 61.0)
    gyro, accel = [], []
    for rate in (100.0, 200.0, 400.0):
        time = sample_times(0.0, 60.0, rate)
        integrals, inverse = perfect_imu(motion, time), perfect_imu(motion, time, form="inverse")
        gyro.append(rate * np.sqrt(np.mean(np.square(inverse.gyro - integrals.gyro)[2:])))
        accel.append(rate * np.sqrt(np.mean(np.square(inverse.accel - integrals.accel)[2:])))
    assert gyro[0] / gyro[1] == pytest.approx(16.0, rel=0.2)
    assert gyro[1] / gyro[2] == pytest.approx(16.0, rel=0.2)
    assert accel[0] / accel[1] == pytest.approx(16.0, rel=0.2)
    assert gyro[0] < 1e-5
    assert accel[0] < 1e-3


def test_over_a_pole():
    motion = circle_flight(30.0, lat=0.5 * math.pi, speed=200.0)
    velocity, attitude = apart(motion, sample_times(0.0, 30.0, 50.0))
    assert velocity < 1e-12
    assert attitude < 1e-14


def test_the_integrals_are_the_default():
    motion = mission("car", 21.0)
    time = sample_times(0.0, 20.0, 100.0)
    default, integrals = perfect_imu(motion, time), perfect_imu(motion, time, form="integrals")
    assert np.array_equal(default.gyro, integrals.gyro)
    assert np.array_equal(default.accel, integrals.accel)


def test_no_inverse_of_rates():
    with pytest.raises(ConfigError, match="cannot be inverted for rates"):
        perfect_imu(mission("car", 21.0), sample_times(0.0, 20.0, 100.0), "rates", form="inverse")


def test_unknown_form():
    with pytest.raises(ConfigError, match="'integrals' or 'inverse', not 'exact'"):
        perfect_imu(mission("car", 21.0), sample_times(0.0, 20.0, 100.0), form="exact")


def test_an_interval_that_looks_like_missing_rows_is_refused():
    motion = mission("pedestrian", 41.0)
    force = np.linalg.norm(motion.f_b(np.arange(20.0, 40.0, 0.01)), axis=1)
    k = int(np.argmin(force[5:] / force[:-5])) + 3
    at = 20.0 + 0.01 * k
    time = np.concatenate([at - 0.02 * np.arange(5.0)[::-1], [at + 0.04, at + 0.06]])
    with pytest.raises(InputError, match=r"looks like one behind missing rows, .* changes by less than half"):
        perfect_imu(motion, time, form="inverse")
