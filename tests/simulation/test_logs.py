from __future__ import annotations

import numpy as np
import pytest

from navfuse.imu.grades import grade
from navfuse.simulation import car_drive, simulate


@pytest.fixture(name="motion", scope="module")
def _motion():
    return car_drive(30.0, seed=1, standing=5.0)


def same(one, other):
    for part in ("imu", "gnss", "truth", "imu_errors"):
        a, b = getattr(one, part), getattr(other, part)
        for field in a.__slots__:
            x, y = getattr(a, field), getattr(b, field)
            if isinstance(x, np.ndarray):
                np.testing.assert_array_equal(x, y)
            else:
                assert x == y


def test_the_same_seed_gives_the_same_logs(motion):
    model = grade("consumer")
    same(simulate(motion, model, 3), simulate(motion, model, 3))
    other = simulate(motion, model, 4)
    assert not np.array_equal(simulate(motion, model, 3).imu.gyro, other.imu.gyro)
    assert not np.array_equal(simulate(motion, model, 3).gnss.lat, other.gnss.lat)


def test_imu_and_gnss_errors_are_independent(motion):
    one = simulate(motion, grade("consumer"), 3, imu_rate=50.0)
    other = simulate(motion, grade("tactical"), 3, imu_rate=200.0)
    np.testing.assert_array_equal(one.gnss.lat, other.gnss.lat)
    third = simulate(motion, grade("tactical"), 3, imu_rate=200.0, gnss_rate=5.0, sd_velocity=None)
    np.testing.assert_array_equal(other.imu.accel, third.imu.accel)


def test_the_logs_are_as_asked_for(motion):
    logs = simulate(
        motion, grade("tactical"), 1, imu_rate=50.0, imu_kind="rates", gnss_rate=2.0, gnss_offset=0.3, truth_rate=25.0
    )
    assert logs.imu.kind == "rates"
    assert logs.imu.time.size == 1501
    np.testing.assert_allclose(logs.gnss.time, 0.3 + np.arange(60) / 2.0)
    assert len(logs.truth) == 751
    np.testing.assert_array_equal(logs.imu_errors.time, logs.imu.time)
    assert logs.motion is motion
    np.testing.assert_allclose(logs.truth.lat, motion.trajectory(logs.truth.time).lat, atol=0.0)


def test_the_lever_arm_moves_the_fixes_and_not_the_truth(motion):
    arm = (0.0, 0.0, -50.0)
    without, with_arm = (simulate(motion, grade("tactical"), 1, lever_arm_b=arm) for arm in ((0.0, 0.0, 0.0), arm))
    rise = with_arm.gnss.height - without.gnss.height
    np.testing.assert_allclose(rise, 50.0, atol=0.1)
    np.testing.assert_array_equal(with_arm.truth.height, without.truth.height)


def test_the_fixes_surround_the_truth(motion):
    logs = simulate(motion, grade("tactical"), 1, sd_position=(0.01, 0.01, 0.02), sd_velocity=(0.01, 0.01, 0.01))
    at_fixes = motion.trajectory(logs.gnss.time)
    assert np.abs(logs.gnss.height - at_fixes.height).max() < 0.1
    assert np.abs(logs.gnss.velocity_n - at_fixes.velocity_n).max() < 0.05
