"""What goes into the work space comes out again, and the places are where the kernels look for them."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.mechanization.error_dynamics import imu_places, imu_state_map
from navfuse.mechanization.propagate import identity_transition
from navfuse.mechanization.tiles import Workspace, pack, reset_transition, unpack

BIASES = ("gyro_bias", "accel_bias")
SCALES = ("gyro_scale", "accel_scale")
CROSS = ("gyro_cross", "accel_cross")


@pytest.mark.parametrize("names", [(), ("gyro_bias",), BIASES, BIASES + SCALES, BIASES + SCALES + CROSS])
@pytest.mark.parametrize("others", [0, 1, 14])
def test_a_covariance_comes_back_bit_for_bit(names, others):
    imu_map = imu_state_map(names)
    m = len(imu_map) + others
    rng = np.random.default_rng(m)
    space = Workspace(imu_map, np.zeros(2), np.zeros((m, 3)))
    root = rng.normal(size=(9 + m, 9 + m))
    P, s, x, F = root + root.T, rng.normal(size=m), rng.normal(size=9 + m), identity_transition(9 + m)
    F[:9] = rng.normal(size=(9, 9 + m))
    F[9, 9:] = rng.normal(size=m)
    pack(space.work, space.places, space.place, s, x, P, F)
    back = [np.zeros_like(a) for a in (s, x, P, F)]
    unpack(space.work, space.places, space.place, *back)
    for wanted, found in zip((s, x, P, F), back, strict=True):
        assert np.array_equal(wanted, found)
    reset_transition(space.work, space.places)
    unpack(space.work, space.places, space.place, *back)
    assert np.array_equal(back[3], identity_transition(9 + m))


def test_the_places_of_the_inertial_states():
    places = imu_places(imu_state_map(BIASES + SCALES + CROSS))
    assert places.tolist() == [*range(12), 12, 13, 14, 18, 19, 20, 15, 16, 17, 21, 22, 23]
    assert imu_places(imu_state_map(("accel_bias",))).tolist() == [3, 4, 5]


def test_the_work_space_begins_at_a_cache_line():
    space = Workspace(imu_state_map(BIASES), np.zeros(2), np.zeros((6, 3)))
    assert space.work.ctypes.data % 64 == 0
