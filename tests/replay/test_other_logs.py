"""Logs that nobody tuned anything for: grade, axes and lever arm as their owners state them, no start given."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from navfuse import compare, process, read_trajectory
from navfuse.demo import write_logs
from navfuse.errors import NavfuseWarning
from navfuse.imu.grades import grade
from navfuse.simulation import simulate
from replay import conversions

LEVER = (1.0, 0.5, -1.5)


def run(folder, **sections):
    """Filter and smoother over a folder of native tables, warnings left in the result."""
    project = {"imu": {"file": str(folder / "imu.parquet")}, "gnss": {"file": str(folder / "gnss.parquet")}}
    for section, keys in sections.items():
        project.setdefault(section, {}).update(keys)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NavfuseWarning)
        return process(project)


def rms(trajectory, folder, **window):
    found = compare(trajectory, read_trajectory(folder / "truth.parquet"), **window)
    return {name: value.rms for name, value in found.statistics.items()}


def assert_below(found, **bounds):
    assert {name: found[name] for name in bounds if found[name] > bounds[name]} == {}


def verdicts(result):
    return {source: value["verdict"] for source, value in result.summary["measurements"].items()}


@pytest.mark.slow
def test_navego_with_a_good_mems_sensor(shared_data, tmp_path):
    """NaveGo from the true attitude: .33 .48 .69 m, .037 .034 .075 m/s, .050 .097 .81 deg."""
    conversions.navego(shared_data / "navego-synthetic", tmp_path, "imu2")
    result = run(tmp_path, imu={"grade": "adis16488"})
    assert result.warnings == ()
    assert verdicts(result) == {"gnss_position": "consistent", "gnss_velocity": "consistent"}
    forward = rms(result.forward, tmp_path)
    assert_below(forward, position_north=0.345, position_east=0.48, position_down=0.69)
    assert_below(forward, velocity_north=0.037, velocity_east=0.034, velocity_down=0.075)
    assert_below(forward, roll=0.06, pitch=0.097, heading=0.5)
    smoothed = rms(result.smoothed, tmp_path)
    assert_below(smoothed, position_horizontal=0.3, velocity_3d=0.015, roll=0.02, pitch=0.05, heading=0.1)


@pytest.mark.slow
def test_navego_with_a_poor_mems_sensor(shared_data, tmp_path):
    """NaveGo: heading 8.7 deg, .12 .21 .17 m/s; gyro biases of three degrees per second."""
    conversions.navego(shared_data / "navego-synthetic", tmp_path, "imu1")
    result = run(tmp_path, imu={"grade": "adis16405"})
    assert verdicts(result) == {"gnss_position": "consistent", "gnss_velocity": "consistent"}
    forward = rms(result.forward, tmp_path)
    assert_below(forward, velocity_north=0.03, velocity_east=0.03, velocity_down=0.02, heading=2.0)
    smoothed = rms(result.smoothed, tmp_path)
    assert_below(smoothed, position_horizontal=0.3, velocity_3d=0.025, roll=0.06, pitch=0.06, heading=0.4)


def test_kitti(shared_data, tmp_path):
    """The reference is the unit's own solution, good to some tenths of a degree."""
    conversions.kitti(shared_data / "kitti-raw-100hz/2011_09_30_drive_0033_extract.npz", tmp_path)
    result = run(tmp_path, imu={"grade": "rt3003", "axes": "FLU"})
    assert verdicts(result) == {"gnss_position": "consistent"}
    assert_below(rms(result.forward, tmp_path), position_horizontal=0.7, velocity_3d=0.25, heading=1.2)
    assert_below(rms(result.smoothed, tmp_path), position_horizontal=0.45, velocity_3d=0.1, roll=0.2, pitch=0.2)


def test_kitti_with_seven_gaps_of_a_second_and_a_half(shared_data, tmp_path):
    conversions.kitti(shared_data / "kitti-raw-100hz/2011_10_03_drive_0027_extract.npz", tmp_path)
    result = run(tmp_path, imu={"grade": "rt3003", "axes": "FLU"})
    (warning,) = result.warnings
    assert warning.startswith("inertial samples are missing in 1")
    assert result.summary["measurements"]["gnss_position"]["counts"]["used"] > 460
    assert_below(rms(result.forward, tmp_path), position_horizontal=0.8, heading=4.0)
    assert_below(
        rms(result.smoothed, tmp_path), position_horizontal=0.4, velocity_3d=0.12, roll=0.2, pitch=0.3, heading=1.3
    )


def test_an_aeroplane_that_is_carried_about_first(shared_data, tmp_path):
    """Standing, carried by hand, standing again, taking off after three minutes; reference: the filter on board."""
    conversions.thor(shared_data / "umn-thor-flight75", tmp_path)
    result = run(tmp_path, imu={"grade": "consumer"}, filter={"until_s": 560.0})
    flight = {"skip_s": 300.0 - result.forward.time[0]}
    assert_below(rms(result.forward, tmp_path, **flight), position_horizontal=4.0, velocity_3d=2.0, heading=6.0)
    assert_below(rms(result.smoothed, tmp_path, **flight), position_horizontal=4.0, roll=1.5, pitch=1.0, heading=2.5)


def test_a_phone_on_a_motorway(shared_data, tmp_path):
    """A minute, hardly a turn; u-blox fixes that lie 0.1 s behind, and claim nothing of their own accuracy."""
    conversions.comma(shared_data / "comma2k19-example1", tmp_path)
    result = run(tmp_path, imu={"grade": "lsm6ds3"})
    assert result.summary["measurements"]["gnss_position"]["counts"]["used"] == 578
    smoothed = rms(result.smoothed, tmp_path)
    assert_below(smoothed, position_horizontal=2.0, position_down=1.5, velocity_3d=0.1)


@pytest.mark.parametrize(
    ("number", "sensor", "heading_deg"),
    [
        (1, "industrial-mems", 0.6),
        (2, "consumer", 1.2),
        (3, "tactical", 0.1),
        (3, "consumer", 2.5),
        (4, "tactical", 2.0),
    ],
    ids=["car", "longer car", "aeroplane", "aeroplane with a cheap sensor", "boat"],
)
def test_profiles_of_groves(shared_data, tmp_path, number, sensor, heading_deg):
    """Simulated sensors on published motions; a boat at walking pace tells its heading late."""
    motion = conversions.groves(shared_data / "groves-profiles", number)
    write_logs(tmp_path, simulate(motion, grade(sensor), 7, lever_arm_b=LEVER))
    result = run(tmp_path, imu={"grade": sensor}, gnss={"file": str(tmp_path / "gnss.csv"), "lever_arm_m": LEVER})
    assert result.warnings == ()
    assert verdicts(result) == {"gnss_position": "consistent", "gnss_velocity": "consistent"}
    truth = read_trajectory(tmp_path / "truth.parquet")
    for trajectory in (result.forward, result.smoothed):
        for value in compare(trajectory, truth).consistency.values():
            assert value.nees_per_dof < 2.5
    assert_below(rms(result.smoothed, tmp_path), position_horizontal=0.5, velocity_3d=0.04, heading=heading_deg)
    assert np.all(np.diff(result.forward.time) > 0.0)
