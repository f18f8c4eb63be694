"""The tutorial in the plane: each algorithm better than the one before, and the two real logs."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from navfuse.errors import InputError
from navfuse.planar import check_yaw_against_gyro, dead_reckon
from navfuse.reproduce import STUDIES, Wishes, reproduce
from navfuse.reproduce import planar_drives as drives
from navfuse.reproduce import planar_real as real
from navfuse.reproduce import planar_runs as runs


@pytest.fixture(scope="module")
def drive():
    return drives.model_car(1)


@pytest.fixture(scope="module")
def phone(shared_data):
    return drives.phone_in_a_car(Wishes(shared_data))


def perfect(drive):
    """The same drive, measured without errors; fixes on the truth."""
    angle = drive.yaw - drive.declination
    velocity = np.gradient(drive.velocity, drive.time, axis=0)
    c, s = np.cos(drive.yaw), np.sin(drive.yaw)
    accel = np.column_stack((c * velocity[:, 0] + s * velocity[:, 1], -s * velocity[:, 0] + c * velocity[:, 1]))
    at = np.arange(0, drive.time.size, 10)
    return replace(
        drive,
        gyro_z=np.concatenate(([0.0], np.diff(drive.yaw) / np.diff(drive.time))),
        accel_b=accel,
        field_b=21e-6 * np.column_stack((np.cos(angle), -np.sin(angle))),
        fix_time=drive.time[at],
        fix_position=drive.position[at],
        fix_velocity=drive.velocity[at],
    )


def test_without_errors_all_three_find_the_truth(drive):
    exact = perfect(drive)
    both = runs.yaws(exact)
    assert np.degrees(np.abs(runs.yaw_error(both.first, exact)).max()) < 1e-6
    assert np.degrees(np.abs(runs.yaw_error(both.second, exact)).max()) < 1e-6
    reckoned = runs.dead_reckoned(exact, both.second)
    assert np.isfinite(reckoned).all()
    assert runs.rms_length(reckoned - exact.position) < 0.15
    assert runs.rms_length(runs.track(exact, both.second).position - exact.position) < 0.05


def test_the_simulated_drive_is_self_consistent(drive):
    """True yaw turns as the gyro says, true velocities are the slope of the true positions."""
    assert check_yaw_against_gyro(drive.time, drive.gyro_z, drive.yaw) == pytest.approx(1.0, abs=0.02)
    between, _ = dead_reckon(drive.time, np.gradient(drive.velocity, drive.time, axis=0), velocity=drive.velocity[0])
    assert np.abs(between - drive.position).max() < 0.5
    assert np.degrees(drive.declination) == pytest.approx(-10.79, abs=0.01)


def test_dead_reckoning_begins_anew_in_every_window(drive):
    both = runs.yaws(drive)
    short, long = (runs.dead_reckoned(drive, both.second, window) for window in (2.0, 20.0))
    assert runs.rms_length(short - drive.position) < runs.rms_length(long - drive.position)
    last = replace(drive, fix_time=drive.fix_time[:50], fix_position=drive.fix_position[:50],
                   fix_velocity=drive.fix_velocity[:50])  # fmt: skip
    reckoned = runs.dead_reckoned(last, both.second)
    assert np.isnan(reckoned[drive.time > 10.1]).all()
    np.testing.assert_array_equal(runs.held(last)[-1], drive.fix_position[49])


def test_each_algorithm_is_better_than_the_one_before(tmp_path):
    study = reproduce("first-ins-gnss", Wishes(runs=2, seed=1))
    for one, two in study.numbers["yaw_rms_deg"].values():
        assert two < one
    offset, declined, calibrated = (pair[0] for pair in study.numbers["yaw_rms_deg"].values())
    assert calibrated < declined < offset
    position = study.numbers["position_rms_m"]
    assert position["3: filter, GPS at 5 Hz"] < position["2: dead reckoned"] < position["1: dead reckoned"]
    assert position["3: filter, GPS at 5 Hz"] < position["GPS at 5 Hz alone, last fix held"]
    sparse = position["3: filter, GPS at 1 Hz"]
    assert sparse < position["GPS at 1 Hz, filter without accelerations"] < position["GPS at 1 Hz alone, last fix held"]
    assert set(study.pictures) == {"yaw", "declination", "velocity", "position", "gaps"}
    assert study.name in STUDIES
    study.write(tmp_path / "out")
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"gaps.png", "first-ins-gnss.md", "yaw.png"}


def test_real_logs(shared_data):
    table, pictures, found, notes = real.real_logs(Wishes(shared_data))
    circles = found["vn100-circle, iron removed"]
    assert circles["yaw_2_scatter_deg"] < circles["yaw_1_scatter_deg"] < 5.0
    assert any("do not turn together" in note for note in notes)
    car = found["comma2k19-example1"]
    assert car["position_3_m"] < car["position_gps_held_m"]
    assert car["position_3_sparse_m"] < 0.5 * car["position_gps_held_sparse_m"]
    assert car["velocity_3_mps"] < 1.0
    assert len(table.rows) == sum(map(len, found.values()))
    assert len(pictures) == 3
    study = reproduce("first-ins-gnss", Wishes(shared_data, runs=1))
    assert study.numbers["real_data"] == found
    assert set(pictures) < set(study.pictures)
    assert study.tables[-1] == table


def test_axes_of_the_phone(phone):
    """Forward and right of the accelerations are those of the reference; north is where the car drives."""
    true = np.gradient(phone.velocity, phone.time, axis=0)
    smooth = np.ones(100) / 100
    forward = np.convolve(true[:, 0] * np.cos(phone.yaw) + true[:, 1] * np.sin(phone.yaw), smooth, "same")
    measured = np.convolve(phone.accel_b[:, 0], smooth, "same")
    assert np.corrcoef(forward, measured)[0, 1] > 0.8
    assert np.degrees(np.abs(phone.yaw)).max() < 5.0
    assert np.degrees(phone.declination) == pytest.approx(13.3, abs=0.3)


def test_data_that_are_not_there_or_not_arrays(shared_data, tmp_path):
    with pytest.raises(InputError, match="give the folder that holds"):
        drives.phone_in_a_car(Wishes())
    with pytest.raises(InputError, match="there is no such file"):
        drives.sensor_in_circles(Wishes(tmp_path))
    copy = tmp_path / drives.COMMA
    shutil.copytree(shared_data / drives.COMMA, copy)
    gyro = copy / "processed_log" / "IMU" / "gyro" / "value"
    for path in (gyro.parent, gyro):
        path.chmod(0o755)
    gyro.write_bytes(b"not an array")
    with pytest.raises(InputError, match="not an array as numpy saves it"):
        drives.phone_in_a_car(Wishes(tmp_path))
    with gyro.open("wb") as stream:
        np.save(stream, np.zeros((5, 2)))
    with pytest.raises(InputError, match=r"shape \(5, 2\), finite \(n, 3\) was expected"):
        drives.phone_in_a_car(Wishes(tmp_path))
