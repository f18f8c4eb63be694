from __future__ import annotations

from dataclasses import replace
from itertools import permutations, product

import numpy as np
import pytest

from navfuse.core.rotation import dcm_from_euler
from navfuse.errors import ConfigError
from navfuse.imu.grades import grade
from navfuse.imu.mounting import find_axes
from navfuse.io.gnss_table import read_gnss
from navfuse.io.imu_table import body_from_file, read_imu
from navfuse.simulation import car_drive, figure_eight_flight, simulate, static


def in_axes(imu, gyro=None, accel=None):
    """The log with its vectors multiplied by matrices."""
    turn = [np.eye(3) if matrix is None else np.asarray(matrix, dtype=float) for matrix in (gyro, accel)]
    return replace(imu, gyro=imu.gyro @ turn[0].T, accel=imu.accel @ turn[1].T)


def proper_axes():
    found = []
    for order in permutations(range(3)):
        for pick in product((0, 1), repeat=3):
            word = "".join(("FB", "RL", "DU")[k][pick[k]] for k in order)
            try:
                body_from_file(word)
            except ConfigError:
                continue
            found.append(word)
    return found


@pytest.fixture(scope="module")
def drive():
    made = simulate(car_drive(150.0, seed=3), grade("consumer"), 1, lever_arm_b=(0.8, 0.3, -1.0))
    return made.imu, made.gnss


@pytest.fixture(scope="module")
def flight():
    made = simulate(figure_eight_flight(200.0), grade("tactical"), 1)
    return made.imu, made.gnss


def test_there_are_24():
    assert len(proper_axes()) == 24


@pytest.mark.parametrize("axes", proper_axes())
def test_every_way_to_lie(drive, axes):
    imu, gnss = drive
    matrix = body_from_file(axes).T
    found = find_axes(in_axes(imu, matrix, matrix), gnss)
    assert found.axes == axes
    assert found.confidence > 0.9
    assert found.score > 0.9 > 0.3 > found.second_score
    assert found.second != axes
    assert "xyz"[axes.index("U")] == found.up[1] if "U" in axes else "xyz"[axes.index("D")] == found.up[1]
    assert found.up[0] == ("+" if "U" in axes else "-")
    assert found.forward[0] == ("+" if "F" in axes else "-")
    assert (found.gyro_sense, found.gyro_up, found.left_handed) == (1, found.up, False)
    assert found.reason is None
    assert found.notes == ()


@pytest.mark.parametrize("axes", ["FRD", "BRU", "URF"])
@pytest.mark.parametrize("euler_deg", [(5.0, 0.0, 0.0), (0.0, -8.0, 0.0), (0.0, 0.0, 12.0), (-4.0, 6.0, -9.0)])
def test_angles_of_the_mount(drive, axes, euler_deg):
    """Beyond what the car does itself: it leans, and the road is not level."""
    imu, gnss = drive
    plain = find_axes(imu, gnss)
    tilt = np.array(dcm_from_euler(*np.radians(euler_deg))).reshape(3, 3)
    matrix = body_from_file(axes).T @ tilt.T
    found = find_axes(in_axes(imu, matrix, matrix), gnss)
    assert found.axes == axes
    own = np.array(dcm_from_euler(plain.roll, plain.pitch, plain.yaw)).reshape(3, 3)
    seen = np.array(dcm_from_euler(found.roll, found.pitch, found.yaw)).reshape(3, 3)
    assert np.degrees(np.arccos(min(1.0, 0.5 * (np.trace(seen.T @ (own @ tilt)) - 1.0)))) < 0.2
    assert np.degrees(max(abs(plain.roll), abs(plain.pitch), abs(plain.yaw))) < 2.5


def test_an_aeroplane_in_coordinated_turns(flight):
    imu, gnss = flight
    for axes in ("FRD", "LBU", "DFL"):
        if axes not in proper_axes():
            continue
        matrix = body_from_file(axes).T
        found = find_axes(in_axes(imu, matrix, matrix), gnss)
        assert found.axes == axes
        assert found.confidence > 0.9


def test_positions_alone_will_do(drive):
    imu, gnss = drive
    found = find_axes(imu, replace(gnss, velocity_n=None, sd_velocity=None))
    assert found.axes == "FRD"
    assert abs(np.degrees(found.yaw)) < 5.0


def test_the_offset_matters_and_is_applied(drive):
    imu, gnss = drive
    late = replace(imu, time=imu.time - 2.0)
    assert find_axes(late, gnss, 2.0).yaw == pytest.approx(find_axes(imu, gnss).yaw, abs=1e-6)
    assert find_axes(late, gnss, 0.0).confidence < 0.92 < find_axes(late, gnss, 2.0).confidence


@pytest.mark.parametrize("which", ["drive", "flight"])
def test_reversed_gyroscopes(which, request):
    imu, gnss = request.getfixturevalue(which)
    found = find_axes(in_axes(imu, -np.eye(3)), gnss)
    assert found.axes == "FRD"
    assert found.confidence <= 0.5
    assert (found.gyro_sense, found.gyro_up, found.up) == (-1, "+z", "-z")
    assert "the gyroscopes turn left where the course turns right" in found.notes[0]


@pytest.mark.parametrize("which", ["drive", "flight"])
@pytest.mark.parametrize(("axis", "word"), [(0, "BRD"), (1, "FLD"), (2, "FRU")])
def test_left_handed_axes(which, axis, word, request):
    imu, gnss = request.getfixturevalue(which)
    flip = np.eye(3)
    flip[axis, axis] = -1.0
    found = find_axes(in_axes(imu, flip, flip), gnss)
    assert found.axes is None
    assert found.left_handed
    assert found.gyro_sense == 1
    assert f"left-handed: x, y, z point {word};" in found.reason
    with pytest.raises(ConfigError, match="left-handed"):
        body_from_file(word)


@pytest.mark.parametrize("which", ["drive", "flight"])
@pytest.mark.parametrize("axes", ["FRD", "BRU"])
def test_reversed_accelerometers(which, axes, request):
    imu, gnss = request.getfixturevalue(which)
    matrix = body_from_file(axes).T
    found = find_axes(in_axes(imu, matrix, -matrix), gnss)
    assert found.axes is None
    assert found.left_handed
    assert f'all three are reversed (+9.8 along what points down at rest), the axes are "{axes}"' in found.reason


def test_one_reversed_accelerometer(drive):
    imu, gnss = drive
    found = find_axes(in_axes(imu, None, np.diag([1.0, 1.0, -1.0])), gnss)
    assert found.axes is None
    assert 'if only the one along the vertical is, "FRD"' in found.reason


def test_gyroscopes_in_another_order(drive):
    imu, gnss = drive
    found = find_axes(in_axes(imu, np.eye(3)[[1, 2, 0]]), gnss)
    assert found.axes == "FRD"
    assert found.gyro_up == "-y"
    assert found.gyro_sense is None
    assert "gyroscope y turns with the course, but accelerometer z feels gravity" in found.notes[0]


def test_gyroscopes_in_another_order_in_the_air(flight):
    """Accelerations along and across tell nothing of what flies coordinated turns."""
    imu, gnss = flight
    found = find_axes(in_axes(imu, np.eye(3)[[1, 2, 0]]), gnss)
    assert found.axes is None
    assert found.reason is not None
    assert "different order" in found.notes[0]


@pytest.mark.parametrize("yaw_deg", [41.0, 45.0, -49.0])
def test_between_two_axes(drive, yaw_deg):
    imu, gnss = drive
    turn = np.array(dcm_from_euler(0.0, 0.0, np.radians(yaw_deg))).reshape(3, 3).T
    found = find_axes(in_axes(imu, turn, turn), gnss)
    assert found.axes is None
    assert found.confidence == 0.0
    assert "no axis is near the course" in found.reason


def test_upright_at_half_a_right_angle(drive):
    imu, gnss = drive
    turn = np.array(dcm_from_euler(0.0, np.radians(44.0), 0.0)).reshape(3, 3).T
    found = find_axes(in_axes(imu, turn, turn), gnss)
    assert found.axes is None
    assert "no axis is near the vertical" in found.reason
    assert np.degrees(found.tilt) == pytest.approx(44.0, abs=2.0)


def test_only_the_vertical_is_known_without_fixes(drive):
    found = find_axes(drive[0], None)
    assert (found.axes, found.up) == (None, "-z")
    assert "without GNSS only the vertical" in found.reason


def test_only_the_vertical_is_known_of_what_stands():
    made = simulate(static(120.0), grade("consumer"), 1)
    found = find_axes(made.imu, made.gnss)
    assert (found.axes, found.up, found.forward, found.gyro_sense) == (None, "-z", None, None)
    assert "does not accelerate enough" in found.reason


def test_without_gravity(drive):
    imu, gnss = drive
    found = find_axes(replace(imu, accel=0.01 * imu.accel), gnss)
    assert found.up is None
    assert "the mean specific force is 0.09 m/s^2" in found.reason
    assert find_axes(replace(imu, time=imu.time[:1], gyro=imu.gyro[:1], accel=imu.accel[:1]), gnss).axes is None


def test_a_sensor_on_a_turntable(drive):
    """The vehicle goes straight where the sensor turns: it does not point along its course."""
    imu, gnss = drive
    rate = np.radians(4.0)
    angle = rate * imu.time
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    turn = np.stack([np.stack([c, s, zero], 1), np.stack([-s, c, zero], 1), np.stack([zero, zero, one], 1)], 1)
    step = np.diff(imu.time, prepend=imu.time[0] - 0.01)
    gyro = np.einsum("nij,nj->ni", turn, imu.gyro) + np.column_stack([zero, zero, rate * step])
    found = find_axes(replace(imu, gyro=gyro, accel=np.einsum("nij,nj->ni", turn, imu.accel)), gnss)
    assert found.axes is None
    assert "does not point along its course" in found.reason


def test_real_drive(shared_data):
    """Its owner gives axes back, right, up, and about -6.8 deg of pitch and 5.4 deg of yaw."""
    folder = shared_data / "rtklibexplorer-drive"
    found = find_axes(read_imu(folder / "imu.parquet"), read_gnss(folder / "gnss.csv"), -0.19)
    assert found.axes == "BRU"
    assert found.confidence > 0.95
    assert np.degrees(found.pitch) == pytest.approx(-6.8, abs=1.0)
    assert np.degrees(found.yaw) == pytest.approx(5.4, abs=1.5)


def test_an_hour_with_positions(shared_data):
    folder = shared_data / "car-1h-200hz"
    found = find_axes(read_imu(folder / "imu.parquet"), read_gnss(folder / "gnss.csv"))
    assert found.axes == "FRD"
    assert found.confidence > 0.95
    assert np.degrees(max(abs(found.roll), abs(found.pitch), abs(found.yaw))) < 1.0
