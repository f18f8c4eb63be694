"""The table of 19 columns without units: each reader takes its part, and what cannot be in its unit is refused."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse import InputError, read_gnss, read_imu, read_trajectory
from navfuse.data.trajectory import wrapped
from navfuse.errors import NavfuseWarning
from navfuse.io.nineteen_columns import COLUMNS
from navfuse.io.tables import open_table, write_table
from navfuse.scenario_files import nineteen_columns
from navfuse.simulation.scenario import load_scenario
from navfuse.simulation.scenario_run import ScenarioLogs, run_scenario

ATTITUDE = ("true_roll", "true_pitch", "true_heading")
READERS = pytest.mark.parametrize("read", [read_imu, read_gnss, read_trajectory])


@pytest.fixture(scope="module")
def flight() -> ScenarioLogs:
    """Five minutes with two turns."""
    return run_scenario(load_scenario("aircraft-1hz", {"": {"duration_s": 300.0}}))


@pytest.fixture
def table(flight) -> dict[str, np.ndarray]:
    return {name: values.copy() for name, values in nineteen_columns(flight).items()}


@pytest.fixture
def written(tmp_path):
    def write(columns, name="aircraft.csv"):
        write_table(tmp_path / name, columns)
        return tmp_path / name

    return write


@pytest.mark.filterwarnings("ignore::navfuse.NavfuseWarning")
@pytest.mark.parametrize("name", ["aircraft.csv", "aircraft.parquet"])
def test_every_reader_takes_its_part(flight, table, written, name):
    shuffled = {column: table[column] for column in sorted(table, reverse=True)}
    path = written(shuffled, name)
    assert tuple(table) == COLUMNS
    imu = read_imu(path)
    assert imu.kind == "rates"
    assert np.array_equal(imu.time, flight.imu.time)
    assert np.array_equal(imu.gyro, flight.imu.gyro)
    assert np.array_equal(imu.accel, flight.imu.accel)
    gnss = read_gnss(path, sd_position_m=[3, 3, 5], sd_velocity_mps=[0.1, 0.1, 0.15])
    assert gnss.lat == pytest.approx(flight.gnss.lat, abs=1e-15)
    assert gnss.lon == pytest.approx(flight.gnss.lon, abs=1e-15)
    assert np.array_equal(gnss.height, flight.gnss.height)
    assert np.array_equal(gnss.velocity_n, flight.gnss.velocity_n)
    assert np.array_equal(gnss.sd_position, flight.gnss.sd_position)
    assert np.array_equal(gnss.sd_velocity, flight.gnss.sd_velocity)
    truth, expected = read_trajectory(path), flight.truth.motion.trajectory(flight.imu.time)
    assert truth.lat == pytest.approx(expected.lat, abs=1e-15)
    assert np.array_equal(truth.height, expected.height)
    difference = truth.attitude - expected.attitude
    difference[:, 2] = wrapped(difference[:, 2] + 1.0, 2.0 * np.pi) - 1.0
    assert np.abs(difference).max() < 1e-14
    assert truth.velocity_n is None


def test_axes_and_offsets_apply_as_to_native_tables(table, written):
    path = written(table)
    with pytest.warns(NavfuseWarning, match="slow for an inertial sensor"):
        imu = read_imu(path, axes="FLU", time_offset_s=2.0)
    assert imu.time[0] == table["time"][0] + 2.0
    assert np.array_equal(imu.accel[:, 2], -table["accel_z"])


@pytest.mark.filterwarnings("ignore::navfuse.NavfuseWarning")
def test_missing_sigmas_have_the_defaults_of_the_reader(table, written):
    gnss = read_gnss(written(table))
    assert any("'sd_north_m' is missing: assumed 5 m" in note for note in gnss.notes)
    assert gnss.sd_position[0] == pytest.approx([5.0, 5.0, 10.0])
    assert gnss.sd_velocity[0] == pytest.approx([0.2, 0.2, 0.4])


def test_other_columns_are_ignored_with_a_note(table, written):
    path = written({"index": table["time"], **table})
    with pytest.warns(NavfuseWarning, match="ignored columns that navfuse does not know: 'index'"):
        read_trajectory(path)


def test_rows_without_a_fix_are_left_out(table, written):
    without = np.arange(table["time"].size) % 4 != 0
    for name in COLUMNS:
        if name.startswith("z_"):
            table[name][without] = np.nan
    with pytest.warns(NavfuseWarning, match="225 of 301 rows hold no position"):
        gnss = read_gnss(written(table), sd_position_m=(3, 3, 5), sd_velocity_mps=(0.1, 0.1, 0.15))
    assert np.array_equal(gnss.time, table["time"][::4])


@READERS
def test_a_name_that_is_missing_or_written_otherwise(table, written, read):
    table["z_vn"] = table.pop("z_VN")
    del table["gyro_y"]
    with pytest.raises(InputError) as error:
        read(written(table))
    text = str(error.value)
    assert "a table of truth, IMU and fixes in 19 columns needs more columns" in text
    assert "'gyro_y' is missing" in text
    assert "'z_VN' is missing, is the column 'z_vn' meant to be it?" in text


def test_a_few_of_the_names_do_not_make_such_a_table(table, written):
    few = {name: table[name] for name in ("time", "true_lat", "true_lon", "z_lat")}
    with pytest.raises(InputError, match="column 'time' has no unit"):
        read_trajectory(written(few))


def scaled(table, names, factor):
    for name in names:
        table[name] *= factor


@READERS
@pytest.mark.parametrize(
    ("names", "factor", "message"),
    [
        (("true_lat", "true_lon"), np.pi / 180.0, "multiply true_lat and true_lon by 180/pi"),
        (("z_lat", "z_lon"), np.pi / 180.0, "multiply z_lat and z_lon by 180/pi"),
        (("true_lat", "true_lon", "z_lat", "z_lon"), np.pi / 180.0, "multiply true_lat and true_lon by 180/pi"),
        (("z_alt",), 1.0 / 0.3048, "'z_alt' and 'true_alt' are 6.[0-9]+ km apart .* are both metres above"),
        (("gyro_x", "gyro_y", "gyro_z"), 180.0 / np.pi, "5[0-9.]+ times as fast as it turns; these look like deg/s"),
        (("gyro_x", "gyro_y", "gyro_z"), 0.01, "they have to be rates in rad/s, the true angles degrees"),
        (ATTITUDE, np.pi / 180.0, "turn with the true attitude only if .* are radians: multiply them by 180/pi"),
        (("accel_x", "accel_y", "accel_z"), 1.0 / 9.80665, "these look like values in g: multiply by 9.80665"),
        (("accel_x", "accel_y", "accel_z"), 100.0, "they have to be specific force in m/s"),
    ],
)  # fmt: skip
def test_a_unit_that_cannot_be_right(table, written, read, names, factor, message):
    scaled(table, names, factor)
    with pytest.raises(InputError, match=message):
        read(written(table))


def test_gravity_taken_out_is_no_specific_force(table, written):
    table["accel_z"] += 9.8
    with pytest.raises(InputError, match="gravity not taken out"):
        read_imu(written(table))


@pytest.mark.filterwarnings("ignore::navfuse.NavfuseWarning")
def test_units_are_judged_whatever_the_axes_of_the_sensor(table, written):
    table["gyro_x"], table["gyro_z"] = table["gyro_z"], -table["gyro_x"]
    read_imu(written(table))
    scaled(table, ("gyro_x", "gyro_y", "gyro_z"), 180.0 / np.pi)
    with pytest.raises(InputError, match="these look like deg/s"):
        read_imu(written(table))


@READERS
@pytest.mark.parametrize(
    ("column", "row", "value", "message"),
    [
        ("gyro_x", 7, np.nan, "row 8 .*column 'gyro_x': the value is empty, NaN"),
        ("accel_z", 0, np.inf, "row 1 .*column 'accel_z': the value is empty, NaN, infinite"),
        ("true_alt", 300, np.nan, "row 301 .*column 'true_alt': the value is empty"),
        ("time", 5, np.nan, "row 6 .*column 'time': the value is empty"),
        ("z_VE", 9, np.nan, "row 10 .*column 'z_VE': the value is empty.* A fix has six values or none"),
        ("true_lat", 4, 95.0, r"row 5 .*column 'true_lat': 95 is outside -90..90 deg"),
        ("z_lon", 4, 400.0, r"row 5 .*column 'z_lon': 400 is outside -180..360 deg"),
        ("true_pitch", 4, -91.0, r"row 5 .*column 'true_pitch': -91 is outside -90..90 deg"),
        ("time", 5, 4.0, "row 6 .*column 'time': 4 s repeats the stamp before it, 4 s; 1 rows do so"),
        ("time", 5, 3.5, "row 6 .*column 'time': 3.5 s falls behind the stamp before it, 4 s"),
    ],
)
def test_a_flaw_is_named_with_its_row_and_nothing_is_repaired(table, written, read, column, row, value, message):
    table[column][row] = value
    with pytest.raises(InputError, match=message):
        read(written(table))


def test_exchanged_positions(table, written):
    table["z_lat"], table["z_lon"] = table["z_lon"], table["z_lat"]
    with pytest.raises(InputError, match="'z_lat', 'z_lon' and 'true_lat', 'true_lon' are .* km apart"):
        read_gnss(written(table))


def test_one_row_is_no_log(table, written):
    with pytest.raises(InputError, match="the table has one row; at least two are needed"):
        read_imu(written({name: values[:1] for name, values in table.items()}))


def test_a_word_is_named_with_its_line(table, written):
    path = written(table)
    lines = path.read_text().splitlines()
    lines[3] = lines[3].replace(lines[3].split(",")[2], "west")
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match="line 4, column 'true_lon': 'west' is not a number"):
        read_imu(path)


@pytest.mark.filterwarnings("ignore::navfuse.NavfuseWarning")
def test_a_craft_at_rest_shows_no_unit_and_is_not_refused(table, written):
    for name in (*ATTITUDE, "true_lat", "true_lon", "true_alt", "accel_x", "accel_y", "accel_z"):
        table[name][:] = table[name][0]
    noise = np.random.default_rng(1).normal(size=(table["time"].size, 9))
    for k, name in enumerate(("gyro_x", "gyro_y", "gyro_z", "z_VN", "z_VE", "z_VD", "z_lat", "z_lon", "z_alt")):
        size = 1e-6 if name in ("z_lat", "z_lon") else 1e-3
        table[name][:] = (table[f"true_{name[2:]}"] if name[2:] in ("lat", "lon", "alt") else 0.0) + size * noise[:, k]
    path = written(table)
    assert len(read_trajectory(path)) == read_imu(path).time.size == open_table(path).read(["time"])["time"].size
