from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from navfuse.imu.grades import grade
from navfuse.imu.lever_arm import LeverArm, check_lever_arm, fit_lever_arm
from navfuse.io.gnss_table import read_gnss
from navfuse.io.imu_table import read_imu
from navfuse.simulation import car_drive, simulate, static

ARM = (1.8, -0.9, -1.2)


@pytest.fixture(scope="module")
def drive():
    made = simulate(car_drive(200.0, seed=6), grade("industrial-mems"), 1, lever_arm_b=ARM, gnss_rate=4.0)
    return made.imu, made.gnss


def test_it_is_found_by_velocities(drive):
    imu, gnss = drive
    found = fit_lever_arm(imu, gnss)
    assert np.all(np.abs(found.lever - ARM) < 4.0 * found.sd)
    assert np.all(found.sd[:2] < 0.15)
    assert check_lever_arm(np.array(ARM), found) == []


def test_it_does_not_depend_on_the_axes_and_the_clock(drive):
    imu, gnss = drive
    turn = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    turned = replace(imu, gyro=imu.gyro @ turn.T, accel=imu.accel @ turn.T, time=imu.time - 0.3)
    found, plain = fit_lever_arm(turned, gnss, 0.31), fit_lever_arm(imu, gnss)
    assert np.allclose(found.lever[1:], (turn @ plain.lever)[1:], atol=0.03)


def test_positions_of_a_metre_do_not_tell_it(drive):
    imu, gnss = drive
    found = fit_lever_arm(imu, replace(gnss, velocity_n=None, sd_velocity=None))
    assert found is None or np.all(found.sd > 0.2)


def test_nothing_is_found_where_nothing_moves_or_the_gyroscopes_are_wrong(drive):
    imu, gnss = drive
    rest = simulate(static(100.0), grade("consumer"), 1)
    assert fit_lever_arm(rest.imu, rest.gnss) is None
    assert fit_lever_arm(replace(imu, gyro=-imu.gyro), gnss) is None
    assert fit_lever_arm(replace(imu, gyro=imu.gyro[:, [1, 2, 0]]), gnss) is None
    assert fit_lever_arm(replace(imu, time=imu.time + 1e4), gnss) is None


def test_a_sign(drive):
    (note,) = check_lever_arm(-np.array(ARM), fit_lever_arm(*drive))
    assert "is it from the antenna to the sensor instead" in note


@pytest.mark.parametrize(("factor", "unit"), [(10.0, None), (100.0, "centimetres"), (1000.0, "millimetres")])
def test_units_that_the_turns_reveal(factor, unit):
    arm = np.array([0.04, -0.02, -0.01])
    found = LeverArm(arm, np.full(3, 0.02))
    notes = check_lever_arm(factor * arm, found)
    if unit is None:
        assert notes == []
    else:
        assert notes[0].endswith(f"are these {unit}?")


@pytest.mark.parametrize(("size", "unit"), [(80.0, "centimetres"), (4900.0, "centimetres"), (5100.0, "millimetres")])
def test_longer_than_any_vehicle(size, unit):
    (note,) = check_lever_arm(np.array([0.0, size, 0.0]), None)
    assert f"is it in {unit}?" in note


def test_not_a_number():
    (note,) = check_lever_arm(np.array([np.nan, 0.0, 0.0]), None)
    assert "which is no length" in note


def test_another_arm(drive):
    (note,) = check_lever_arm(np.array([-1.0, -0.9, -1.2]), fit_lever_arm(*drive))
    assert "in turns the antenna moves as if the lever arm were x +1." in note
    assert note.endswith("stated are [-1.0, -0.9, -1.2] m")


def test_what_is_not_seen_is_not_told():
    assert check_lever_arm(np.array([3.0, 0.0, 0.0]), None) == []
    assert check_lever_arm(np.array([3.0, 0.0, 0.0]), LeverArm(np.zeros(3), np.full(3, 1.4))) == []


def test_real_drive(shared_data):
    """Stated is an antenna 5 cm beside the sensor: nothing to complain of."""
    folder = shared_data / "rtklibexplorer-drive"
    found = fit_lever_arm(read_imu(folder / "imu.parquet"), read_gnss(folder / "gnss.csv"), -0.08)
    assert check_lever_arm(np.array([0.0, -0.05, 0.0]), found) == []
    assert np.linalg.norm(found.lever[:2]) < 0.5
