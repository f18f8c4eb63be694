from __future__ import annotations

import numpy as np
import pytest

from navfuse.attitude.ahrs import estimate_attitude
from navfuse.attitude.magnetic_axes import check_magnetic_axes
from navfuse.data.aiding_logs import MagnetometerLog
from navfuse.errors import InputError
from navfuse.imu.increments import to_increments
from reference.ahrs_world import FIELD_N, make_world, world_settings


@pytest.fixture(scope="module")
def world():
    return make_world(world_settings(), 24.0, 1)


def with_axes(world, matrix):
    return MagnetometerLog(world.magnetometer.time, world.magnetometer.field_b @ np.asarray(matrix).T, source="mag.csv")


def test_good_axes_pass(world):
    assert check_magnetic_axes(to_increments(world.imu), world.magnetometer, FIELD_N) < 0.15


@pytest.mark.parametrize(
    ("matrix", "names"),
    [
        (np.diag([1.0, -1.0, 1.0]), "x, -y, z"),
        (np.diag([1.0, 1.0, -1.0]), "x, y, -z"),
        (np.diag([-1.0, 1.0, 1.0]), "x, -y, -z"),
        (np.diag([1.0, -1.0, -1.0]), "x, -y, -z"),
        ([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], "y, x, z"),
    ],
)
def test_inverted_and_swapped_axes_are_named(world, matrix, names):
    with pytest.raises(InputError) as caught:
        estimate_attitude(world.imu, with_axes(world, matrix))
    assert "mag.csv: the field does not turn as the gyro does" in str(caught.value)
    if np.linalg.det(matrix) < 0.0 and names.startswith("x, -y, -z"):
        return
    assert f"({names})" in str(caught.value)


def test_a_field_that_points_the_wrong_way_is_told_where_the_field_is_known(world):
    log = with_axes(world, -np.eye(3))
    assert check_magnetic_axes(to_increments(world.imu), log) < 0.15
    with pytest.raises(InputError, match="points up, against the field of the Earth"):
        check_magnetic_axes(to_increments(world.imu), log, FIELD_N)


def test_a_body_that_does_not_turn_tells_nothing(world):
    from dataclasses import replace

    still = to_increments(replace(world.imu, gyro=0.0 * world.imu.gyro))
    assert check_magnetic_axes(still, world.magnetometer) is None
