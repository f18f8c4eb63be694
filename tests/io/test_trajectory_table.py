from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from navfuse.data.trajectory import Trajectory
from navfuse.errors import InputError, NavfuseWarning, OutputError
from navfuse.io.gnss_table import read_gnss
from navfuse.io.tables import open_table
from navfuse.io.trajectory_table import read_trajectory, write_trajectory

BOTH = pytest.mark.parametrize("name", ["t.csv", "t.parquet"])
ATTRIBUTES = ("time", "lat", "lon", "height", "velocity_n", "attitude", "sd_position", "sd_velocity", "sd_attitude")


def assert_same(one, other, atol=1e-13):
    for name in ATTRIBUTES:
        if getattr(one, name) is None:
            assert getattr(other, name) is None
        else:
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=0, atol=atol)


@BOTH
def test_every_column(write, trajectory, name):
    path = write(trajectory, name)
    read = read_trajectory(path)
    assert read.source == str(path)
    assert_same(read, Trajectory.from_columns(trajectory))


@BOTH
def test_write_and_read_back(tmp_path, trajectory, name):
    written = Trajectory.from_columns(trajectory)
    write_trajectory(tmp_path / name, written)
    assert open_table(tmp_path / name).names == tuple(written.to_columns())
    assert_same(read_trajectory(tmp_path / name), written)


def test_truth_with_positions_only(write, trajectory):
    read = read_trajectory(write({name: trajectory[name] for name in ("time_s", "lat_deg", "lon_deg", "height_m")}))
    assert len(read) == 50
    for name in ATTRIBUTES[4:]:
        assert getattr(read, name) is None


def test_other_units(write, trajectory):
    columns = {name: values for name, values in trajectory.items() if not name.startswith("sd_")}
    columns["vn_knots"] = columns.pop("vn_mps") * 3600.0 / 1852.0
    columns["heading_rad"] = np.radians(columns.pop("heading_deg"))
    columns["height_km"] = columns.pop("height_m") / 1000.0
    native = Trajectory.from_columns(
        {name: values for name, values in trajectory.items() if not name.startswith("sd_")}
    )
    assert_same(read_trajectory(write(columns)), native, atol=1e-12)


def test_heading_that_runs_on(write, trajectory):
    trajectory["heading_deg"] = np.linspace(-800.0, 800.0, 50)
    trajectory["heading_deg"][3] = -1e-18
    heading = read_trajectory(write(trajectory)).attitude[:, 2]
    assert (heading >= 0.0).all()
    assert (heading < 2.0 * np.pi).all()
    np.testing.assert_allclose(np.sin(heading), np.sin(np.radians(trajectory["heading_deg"])), atol=1e-13)
    assert heading[3] == 0.0


def test_longitude_to_360(write, trajectory):
    trajectory["lon_deg"] += 180.0
    assert read_trajectory(write(trajectory)).lon[0] == pytest.approx(np.radians(11.5 - 180.0), abs=1e-14)


def test_missing_position_column(write, trajectory):
    trajectory["latdeg"] = trajectory.pop("lat_deg")
    with pytest.raises(
        InputError, match="a trajectory needs more columns: 'lat_deg' is missing, is the column 'latdeg'"
    ):
        read_trajectory(write(trajectory))


@pytest.mark.parametrize("name", ["ve_mps", "roll_deg", "sd_down_m", "sd_vn_mps", "sd_heading_deg"])
def test_part_of_a_group(write, trajectory, name):
    del trajectory[name]
    with pytest.raises(InputError, match=f"'{name}' is missing"):
        read_trajectory(write(trajectory))


def test_unknown_column(write, trajectory):
    with pytest.warns(NavfuseWarning, match="ignored columns .* 'speed_of_sound'") as caught:
        read_trajectory(write(trajectory | {"speed_of_sound": np.zeros(50)}))
    assert caught[0].filename == __file__


@BOTH
@pytest.mark.parametrize("value", [np.nan, np.inf, -1e300])
@pytest.mark.parametrize("column", ["time_s", "height_m", "pitch_deg", "sd_north_m"])
def test_value_that_is_none(write, trajectory, name, value, column):
    trajectory[column][6] = value
    row = r"row 7 \(line 8\)" if name.endswith("csv") else "row 7"
    with pytest.raises(InputError, match=rf"{row}, column '{column}': the value is empty, NaN, infinite or absurd"):
        read_trajectory(write(trajectory, name))


@pytest.mark.parametrize(
    ("column", "value", "limits"), [("lat_deg", -90.5, "-90..90"), ("lon_deg", 361.0, "-180..360")]
)
def test_position_out_of_range(write, trajectory, column, value, limits):
    trajectory[column][6] = value
    with pytest.raises(InputError, match=rf"row 7 \(line 8\), column '{column}': {value:g} deg is outside {limits}"):
        read_trajectory(write(trajectory))


def test_radians_in_degree_columns(write, trajectory):
    trajectory |= {name: np.radians(trajectory[name]) for name in ("lat_deg", "lon_deg")}
    with pytest.raises(InputError, match="only as radians do they move as the velocities say"):
        read_trajectory(write(trajectory))


def test_late_and_repeated_rows(write, trajectory):
    columns = {name: np.tile(values, 5) for name, values in trajectory.items()}
    columns["time_s"] = np.arange(250.0)
    for values in columns.values():
        values[[30, 31]] = values[[31, 30]]
    columns["time_s"][70] = columns["time_s"][69]
    with pytest.warns(NavfuseWarning, match="1 rows are out of order and 1 rows repeat .*: sorted by time"):
        read = read_trajectory(write(columns))
    assert len(read) == 249
    assert (np.diff(read.time) > 0.0).all()


def test_reversed_time(write, trajectory):
    trajectory["time_s"] = trajectory["time_s"][::-1]
    with pytest.raises(InputError, match="does not increase"):
        read_trajectory(write(trajectory))


def test_single_row(write, trajectory):
    assert len(read_trajectory(write({name: values[:1] for name, values in trajectory.items()}))) == 1


def test_write_another_extension(tmp_path, trajectory):
    with pytest.raises(OutputError, match="cannot write a table"):
        write_trajectory(tmp_path / "t.txt", Trajectory.from_columns(trajectory))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow], max_examples=40)
@given(
    values=arrays(np.float64, (3, 15), elements=st.floats(-1e6, 1e6)),
    lat=arrays(np.float64, 3, elements=st.floats(-1.5, 1.5).filter(lambda x: abs(x) > 0.1)),
    lon=arrays(np.float64, 3, elements=st.floats(-3.1, 3.1)),
    present=st.sets(st.sampled_from(ATTRIBUTES[4:])),
    name=st.sampled_from(["t.csv", "t.parquet"]),
)
def test_any_trajectory_survives_writing_and_reading(tmp_path, values, lat, lon, present, name):
    groups = {group: values[:, 3 * k : 3 * k + 3] for k, group in enumerate(ATTRIBUTES[4:]) if group in present}
    written = Trajectory(np.array([0.1, 0.2, 1e5]), lat, lon, np.array([-50.0, 0.1, 9000.0]), **groups)
    write_trajectory(tmp_path / name, written)
    read = read_trajectory(tmp_path / name)
    for attribute in ATTRIBUTES:
        expected, got = getattr(written, attribute), getattr(read, attribute)
        if expected is None:
            assert got is None
        elif attribute == "attitude":
            np.testing.assert_allclose(got[:, :2], expected[:, :2], rtol=1e-15, atol=1e-15)
            np.testing.assert_allclose(np.sin(got[:, 2] - expected[:, 2]), 0.0, atol=1e-9)
        else:
            np.testing.assert_allclose(got, expected, rtol=1e-15, atol=1e-15)


def test_truth_of_the_car(shared_data):
    truth = read_trajectory(shared_data / "car-1h-200hz/truth.parquet")
    assert len(truth) == 36001
    assert truth.sd_position is None
    np.testing.assert_allclose(np.degrees(truth.attitude[0]), [0.0, 0.738801, 35.0], atol=1e-6)


def test_an_rtklib_solution(shared_data):
    """A whole .pos of RTKPOST is a trajectory: where every row has a velocity, with it; no standard deviations."""
    path = shared_data / "taroz-matrtklib" / "rover_rtk.pos"
    read = read_trajectory(path)
    assert len(read) == 301
    np.testing.assert_allclose(np.degrees([read.lat[0], read.lon[0]]), [35.134699011, 136.977575483], rtol=0, atol=1e-9)
    assert read.height[0] == 104.8619
    assert read.velocity_n is not None
    np.testing.assert_allclose(read.velocity_n[0], [0.00141, -0.00126, 0.01073], rtol=0, atol=1e-12)
    assert read.sd_position is None
    assert read.source == str(path)


POS = "%  GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu"


def pos(*rows: tuple[int, float, float]) -> str:
    """A .pos file of rows of Q, standard deviation and velocity north."""
    lines = [
        f"2024/06/24 08:20:0{k}.000 48.0000{k} 11.5 500 {q} 9 {sd} {sd} {sd} {v} 0 0 {0.1 * v} {0.1 * v} {0.1 * v}"
        for k, (q, sd, v) in enumerate(rows)
    ]
    return "\n".join([POS, *lines]) + "\n"


def test_an_rtklib_solution_where_some_rows_have_no_velocity(write):
    read = read_trajectory(write(pos((1, 0.01, 1.1), (1, 0.01, 0.0), (1, 0.01, 1.1)), "t.pos"))
    assert len(read) == 3
    assert read.velocity_n is None


def test_an_rtklib_solution_with_dead_reckoning_and_no_sigmas(write):
    """A measurement it could not be, and is refused as such; a trajectory it is, but for the row without a position."""
    path = write(pos((1, 0.0, 1.1), (7, 0.0, 1.1), (0, 0.0, 1.1), (5, 0.0, 1.1)), "t.pos")
    with pytest.raises(InputError, match="would mean a perfect measurement"):
        read_gnss(path)
    with pytest.warns(NavfuseWarning, match="1 of 4 rows hold no position"):
        read = read_trajectory(path)
    np.testing.assert_allclose(np.degrees(read.lat), [48.0, 48.00001, 48.00003], rtol=0, atol=1e-12)
    np.testing.assert_allclose(read.velocity_n, np.tile([1.1, 0.0, 0.0], (3, 1)), rtol=0, atol=1e-12)
    assert read.sd_velocity is None


@pytest.mark.parametrize("name", ["t.pos", "t.sbet"])
def test_trajectories_of_others_that_are_not_there(tmp_path, name):
    with pytest.raises(InputError, match="there is no such file"):
        read_trajectory(tmp_path / name)
