from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from navfuse.data.trajectory import GROUP_COLUMNS, POSITION_COLUMNS, Trajectory, wrapped
from navfuse.errors import InputError


def trajectory(n=4, **changes):
    triad = np.arange(3.0 * n).reshape(n, 3)
    whole = Trajectory(
        time=np.arange(float(n)),
        lat=np.linspace(-1.0, 1.0, n),
        lon=np.linspace(-3.0, 3.0, n),
        height=np.linspace(0.0, 100.0, n),
        velocity_n=triad,
        attitude=0.01 * triad,
        sd_position=1.0 + triad,
        sd_velocity=2.0 + triad,
        sd_attitude=0.001 * (1.0 + triad),
    )
    return dataclasses.replace(whole, **changes)


def test_native_columns_in_the_order_of_the_contract():
    names = "time_s lat_deg lon_deg height_m vn_mps ve_mps vd_mps roll_deg pitch_deg heading_deg"
    sigmas = "sd_north_m sd_east_m sd_down_m sd_vn_mps sd_ve_mps sd_vd_mps sd_roll_deg sd_pitch_deg sd_heading_deg"
    assert list(trajectory().to_columns()) == names.split() + sigmas.split()


def test_units():
    columns = trajectory().to_columns()
    assert columns["lat_deg"][-1] == pytest.approx(57.29577951308232, abs=1e-13)
    assert columns["height_m"][-1] == 100.0
    assert columns["ve_mps"][1] == 4.0
    assert columns["pitch_deg"][1] == pytest.approx(np.degrees(0.04), abs=1e-15)
    assert columns["sd_down_m"][0] == 3.0
    assert columns["sd_heading_deg"][0] == pytest.approx(np.degrees(0.003), abs=1e-15)


def test_absent_groups_have_no_columns():
    bare = trajectory(velocity_n=None, attitude=None, sd_position=None, sd_velocity=None, sd_attitude=None)
    assert tuple(bare.to_columns()) == POSITION_COLUMNS


def test_columns_and_back():
    original = trajectory()
    back = Trajectory.from_columns(original.to_columns(), source="here")
    assert back.source == "here"
    assert len(back) == len(original) == 4
    for field in dataclasses.fields(Trajectory)[:-1]:
        np.testing.assert_allclose(getattr(back, field.name), getattr(original, field.name), rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize("heading", [-0.1, -np.pi, 0.0, 7.0, 2.0 * np.pi, -1e-20, 6.283185307179586])
def test_heading_is_wrapped(heading):
    attitude = np.zeros((4, 3))
    attitude[:, 2] = heading
    columns = trajectory(attitude=attitude).to_columns()
    assert 0.0 <= columns["heading_deg"][0] < 360.0
    back = Trajectory.from_columns(columns | {"heading_deg": np.degrees(attitude[:, 2])}).attitude[:, 2]
    assert 0.0 <= back[0] < 2.0 * np.pi
    assert np.sin(back[0] - heading) == pytest.approx(0.0, abs=1e-14)


def test_wrapped_never_gives_a_full_turn():
    assert wrapped(np.array([-1e-20, 360.0, 359.5, -0.5]), 360.0).tolist() == [0.0, 0.0, 359.5, 359.5]


def test_columns_are_copies():
    original = trajectory()
    for values in original.to_columns().values():
        values[:] = -7.0
    assert original.time[1] == 1.0
    assert original.sd_position[0, 0] == 1.0
    columns = original.to_columns()
    back = Trajectory.from_columns(columns)
    columns["time_s"][0] = columns["height_m"][0] = -7.0
    assert back.time[0] == 0.0
    assert back.height[0] == 0.0


def test_lists_and_other_columns_are_accepted():
    made = Trajectory.from_columns(
        {"time_s": [0, 1], "lat_deg": [1, 2], "lon_deg": [3, 4], "height_m": [5, 6], "x": ["a"]}
    )
    assert made.time.dtype == np.float64
    assert made.velocity_n is None


def test_missing_columns():
    columns = trajectory().to_columns()
    del columns["lon_deg"], columns["vd_mps"]
    with pytest.raises(InputError, match="here: a trajectory needs the columns lon_deg, vd_mps too"):
        Trajectory.from_columns(columns, "here")


@pytest.mark.parametrize("values", [np.zeros(3), np.zeros((4, 1)), 1.0])
def test_columns_of_another_length(values):
    with pytest.raises(InputError, match="column 'height_m' has shape"):
        Trajectory.from_columns(trajectory().to_columns() | {"height_m": values})


def test_to_pandas():
    frame = trajectory().to_pandas()
    assert list(frame.columns) == [*POSITION_COLUMNS, *(name for names in GROUP_COLUMNS.values() for name in names)]
    assert frame.shape == (4, 19)
    np.testing.assert_array_equal(frame["vn_mps"], [0.0, 3.0, 6.0, 9.0])
    back = Trajectory.from_columns(frame)
    np.testing.assert_allclose(back.lat, trajectory().lat, rtol=1e-15)
