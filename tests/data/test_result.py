from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from navfuse.data.result import Innovations, Result, StateHistory
from navfuse.data.trajectory import Trajectory
from navfuse.errors import InputError


@pytest.fixture
def records():
    z = np.array([[1.0, 2.0, 3.0], [0.5, np.nan, np.nan], [9.0, 9.0, 9.0], [np.nan] * 3])
    return Innovations(
        np.array([1.0, 1.0, 2.0, 0.5]),
        np.array(["gnss_position", "odometer", "gnss_position", "odometer"]),
        np.array(["used", "used", "rejected", "late"]),
        np.array([2.0, 0.3, 80.0, np.nan]),
        np.array([3, 1, 3, 0]),
        z,
        np.where(np.isnan(z), np.nan, 1.5),
        np.array([0, 0, 1, 1]),
    )


@pytest.fixture
def trajectory():
    time = np.arange(0.0, 5.0)
    sd = np.column_stack((np.full(5, 3.0), 4.0 - np.array([0.0, 0.0, -8.0, 0.0, 0.0]), np.ones(5)))
    return Trajectory(time, np.full(5, 0.8), np.full(5, 0.2), np.zeros(5), sd_position=sd)


def test_select_of_and_count(records):
    assert len(records) == 4
    assert records.sources == ("gnss_position", "odometer")
    assert records.of("odometer").row.tolist() == [0, 1]
    assert len(records.of("magnetometer")) == 0
    assert records.select(np.array([2, 0])).nis.tolist() == [80.0, 2.0]
    assert records.count("gnss_position", "used") == 1
    assert records.count("gnss_position", "late") == 0


def test_columns_are_the_native_ones(records):
    columns = records.to_columns()
    expected = ["time_s", "source", "status", "nis", "dof", "z_1", "z_2", "z_3", "sd_1", "sd_2", "sd_3", "row"]
    assert list(columns) == expected
    np.testing.assert_array_equal(columns["z_2"], [2.0, np.nan, 9.0, np.nan])
    frame = records.to_pandas()
    assert list(frame.columns) == expected
    assert frame.loc[frame.status == "rejected", "nis"].tolist() == [80.0]


def test_empty():
    assert len(Innovations.empty()) == 0
    assert Innovations.empty().sources == ()
    assert len(Innovations.empty().to_pandas()) == 0


@pytest.mark.parametrize("name", [entry.name for entry in fields(Innovations) if entry.name != "time"])
def test_lengths_have_to_agree(records, name):
    with pytest.raises(InputError, match=rf"innovations: {name} has shape"):
        replace(records, **{name: getattr(records, name)[:2]})


def test_an_unknown_status_is_refused(records):
    with pytest.raises(InputError, match="innovations: unknown status 'maybe'; known: used, rejected"):
        replace(records, status=np.array(["used", "maybe", "used", "late"]))


def test_the_best_trajectory_is_the_smoothed_one(trajectory):
    other = replace(trajectory, source="smoothed")
    assert Result(trajectory).trajectory is trajectory
    assert Result(trajectory, other).trajectory is other
    frame = Result(trajectory, replace(other, height=other.height + 7.0)).to_pandas()
    assert frame["height_m"].tolist() == [7.0] * 5
    assert frame["lat_deg"][0] == pytest.approx(np.degrees(0.8))


def test_description(trajectory, records):
    states = {"gyro_bias": StateHistory(np.arange(2.0), np.zeros((2, 3)), np.ones((2, 3)))}
    text = Result(trajectory, None, records, states, {}, ("no sigma given",)).describe()
    assert text.splitlines() == [
        "forward trajectory, 5 epochs, 0.000 .. 4.000 s (4.0 s)",
        "gnss_position: 1 used, 1 rejected",
        "odometer: 1 used, 1 late",
        "expected horizontal error (1 sigma): 5 m at the end, 12.4 m at worst (t = 2.0 s)",
        "estimated sensor states: gyro_bias",
        "warning: no sigma given",
    ]
    bare = replace(trajectory, sd_position=None)
    assert Result(bare, bare).describe() == "forward and smoothed trajectory, 5 epochs, 0.000 .. 4.000 s (4.0 s)"


def test_description_of_a_run_without_epochs():
    nothing = np.empty(0)
    bare = Trajectory(nothing, nothing, nothing, nothing, sd_position=np.empty((0, 3)))
    assert Result(bare).describe() == "forward trajectory, 0 epochs"
