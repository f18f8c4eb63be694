"""Scenarios on disk: native tables, and a project file that a run takes as it stands."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tomllib

import numpy as np
import pytest

import navfuse
from navfuse.analysis.metrics import compare
from navfuse.config import Project, load_project
from navfuse.errors import ConfigError, InputError, OutputError
from navfuse.io import aiding_tables
from navfuse.io.gnss_table import read_gnss
from navfuse.io.imu_table import read_imu
from navfuse.io.raw_gnss_table import read_raw_gnss
from navfuse.io.tables import open_table
from navfuse.io.trajectory_table import read_trajectory
from navfuse.scenario_files import describe, project_tables, simulate_scenario, write_scenario
from navfuse.simulation.scenario import SENSORS, load_scenario, read_scenario, scenario_names, scenario_text
from navfuse.simulation.scenario_run import run_scenario

SHORT = {"": {"duration_s": 40.0}}


def digests(folder):
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.iterdir())}


def test_what_is_written_is_what_was_simulated(tmp_path):
    logs = simulate_scenario(load_scenario("city-car", SHORT), tmp_path / "out", 3)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "imu.parquet", "gnss.csv", "odometer.csv", "truth.parquet", "project.toml",
    }  # fmt: skip
    imu, gnss = read_imu(tmp_path / "out" / "imu.parquet"), read_gnss(tmp_path / "out" / "gnss.csv")
    assert (imu.kind, imu.time.size) == ("increments", 4001)
    assert np.array_equal(imu.gyro, logs.imu.gyro)
    assert np.array_equal(imu.accel, logs.imu.accel)
    assert gnss.lat == pytest.approx(logs.gnss.lat, abs=1e-15)
    assert gnss.sd_velocity == pytest.approx(logs.gnss.sd_velocity)
    truth = read_trajectory(tmp_path / "out" / "truth.parquet")
    assert truth.height == pytest.approx(logs.truth.trajectory.height, abs=1e-9)
    assert "4001 rows of increments" in "\n".join(describe(logs, tmp_path))


@pytest.mark.parametrize("name", scenario_names())
def test_the_filter_is_told_the_error_model_of_the_simulated_sensor(name):
    scenario = load_scenario(name)
    tables = project_tables(scenario)
    overruled = set(tables["imu"]) & set(scenario.project.get("imu", {}))
    told = Project.from_dict(tables).imu_error_model()
    for field in ("arw", "vrw", "gyro_bias_sd", "gyro_bias_tau", "gyro_bias_walk", "accel_bias_sd", "gyro_scale_sd"):
        if not any(key.startswith(field.replace("_tau", "")) for key in overruled):
            assert np.allclose(getattr(told, field), getattr(scenario.imu.base, field), rtol=1e-12, atol=0.0), field


@pytest.mark.parametrize("name", ["city-car", "lawnmower", "drone"])
def test_a_run_takes_the_project_as_it_stands(tmp_path, name):
    simulate_scenario(load_scenario(name, {"": {"duration_s": 90.0}}), tmp_path, 2)
    result = navfuse.process(tmp_path / "project.toml")
    errors = compare(result.forward, read_trajectory(tmp_path / "truth.parquet"), skip_s=40.0)
    assert errors.statistics["position_horizontal"].max < 8.0
    assert result.summary["verdict"]["reliable"]


def test_latencies_become_time_offsets(tmp_path):
    late = {"imu": {"stamp_latency_ms": 20.0}, "gnss": {"latency_s": 0.1}} | SHORT
    simulate_scenario(load_scenario("city-car", late), tmp_path)
    project = load_project(tmp_path / "project.toml")
    assert (project.imu.time_offset_s, project.gnss.time_offset_s) == (-0.02, -0.1)


def test_the_same_seed_gives_the_same_bytes_on_any_number_of_cores(tmp_path):
    found = []
    for threads in ("1", "2"):
        folder = tmp_path / threads
        code = (
            "from navfuse.scenario_files import simulate_scenario as s;"
            "from navfuse.simulation.scenario import load_scenario as l;"
            f"s(l('urban-canyon', {{'': {{'duration_s': 60.0}}}}), {str(folder)!r}, 11)"
        )
        env = {**os.environ, "NUMBA_NUM_THREADS": threads, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
        subprocess.run([sys.executable, "-c", code], check=True, env=env)
        found.append(digests(folder))
    assert found[0] == found[1]
    simulate_scenario(load_scenario("urban-canyon", {"": {"duration_s": 60.0}}), tmp_path / "other", 12)
    assert digests(tmp_path / "other")["imu.parquet"] != found[0]["imu.parquet"]


READERS = {
    "pseudoranges": read_raw_gnss,
    "odometer": aiding_tables.read_odometer,
    "wheel_speeds": aiding_tables.read_wheel_speeds,
    "magnetometer": aiding_tables.read_magnetometer,
    "heading": aiding_tables.read_heading,
    "barometer": aiding_tables.read_barometer,
    "body_velocity": aiding_tables.read_body_velocity,
    "uwb": aiding_tables.read_uwb,
}
UWB = {
    "rate_hz": 10.0,
    "range_sd_m": 0.1,
    "anchors": [
        {"name": "mast", "lat_deg": 59.901, "lon_deg": 10.651, "height_m": 60.0},
        {"name": "pier", "lat_deg": 59.899, "lon_deg": 10.649, "height_m": 42.0},
    ],
}


def test_every_aiding_sensor_is_read_back_as_it_was_simulated(tmp_path):
    seen = set()
    for name, more in (("lawnmower", {}), ("drone", {}), ("boat", {"uwb": UWB}), ("city-car", {})):
        logs = simulate_scenario(load_scenario(name, {"": {"duration_s": 30.0}} | more), tmp_path / name, 3)
        for section, (log, _) in logs.sensors.items():
            seen.add(section)
            again = READERS[section](tmp_path / name / SENSORS[section].file)
            assert again.time == pytest.approx(log.time, abs=1e-9)
            for column, values in log.columns().items():
                found = np.asarray(again.columns()[column])
                if found.dtype.kind == "f":
                    assert found == pytest.approx(np.asarray(values), rel=1e-12, nan_ok=True), (section, column)
                else:
                    assert np.array_equal(found, values), (section, column)
    assert seen == set(SENSORS)
    assert set(aiding_tables.read_uwb_anchors(tmp_path / "boat" / "anchors.csv").name) == {"mast", "pier"}


def test_pseudoranges_are_those_of_the_antenna_and_almanacs_lie_beside_the_scenario(tmp_path):
    quiet = {"rate_hz": 1.0, "code_sd_m": 0.0, "clock_offset_m": 0.0}
    motion = {"vehicle": "static", "duration_s": 5.0, "height_m": 10.0}
    data = {"motion": motion, "imu": {"rate_hz": 20.0}, "gnss": {"position_sd_m": 1.0}, "pseudoranges": quiet}
    at_imu = run_scenario(read_scenario(data, "x")).sensors["pseudoranges"][0].pseudorange
    data["gnss"]["lever_arm_m"] = [0.0, 0.0, -100.0]
    above = run_scenario(read_scenario(data, "x")).sensors["pseudoranges"][0]
    rise = at_imu - above.pseudorange
    assert rise == pytest.approx(100.0 * np.sin(above.elevation), abs=0.05)
    data["pseudoranges"] = quiet | {"lever_arm_m": [0.0, 0.0, 0.0]}
    assert np.array_equal(run_scenario(read_scenario(data, "x")).sensors["pseudoranges"][0].pseudorange, at_imu)
    data["pseudoranges"] = quiet | {"constellation": "sky.yuma"}
    with pytest.raises((ConfigError, InputError), match="sky.yuma"):
        read_scenario(data, "x", folder=tmp_path)


def test_a_hidden_sky_is_one_message(tmp_path):
    hidden = [{"azimuth_from_deg": 0.0, "azimuth_to_deg": 360.0, "elevation_below_deg": 90.0}]
    scenario = load_scenario("urban-canyon", {"": {"duration_s": 20.0}, "pseudoranges": {"sectors": hidden}})
    with pytest.raises(InputError, match=r"urban-canyon: \[pseudoranges\]: "):
        simulate_scenario(scenario, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_nineteen_columns(tmp_path):
    logs = simulate_scenario(load_scenario("aircraft-1hz", {"": {"duration_s": 100.0}}), tmp_path)
    table = open_table(tmp_path / "aircraft.csv")
    assert list(table.names) == [
        "time", "true_lat", "true_lon", "true_alt", "true_roll", "true_pitch", "true_heading", "gyro_x", "gyro_y",
        "gyro_z", "accel_x", "accel_y", "accel_z", "z_lat", "z_lon", "z_alt", "z_VN", "z_VE", "z_VD",
    ]  # fmt: skip
    values = np.loadtxt(tmp_path / "aircraft.csv", delimiter=",", skiprows=1)
    assert values.shape == (101, 19)
    truth = logs.truth.motion.trajectory(values[:, 0])
    assert values[:, 1] == pytest.approx(np.degrees(truth.lat), abs=1e-12)
    assert values[:, 9] == pytest.approx(logs.imu.gyro[:, 2])
    assert values[:, 18] == pytest.approx(logs.gnss.velocity_n[:, 2])


@pytest.mark.filterwarnings("ignore::navfuse.NavfuseWarning")
def test_nineteen_columns_stand_for_all_three_tables(tmp_path):
    simulate_scenario(load_scenario("aircraft-1hz", {"": {"duration_s": 300.0}}), tmp_path)
    native = tomllib.loads((tmp_path / "project.toml").read_text())
    sigmas = {"sd_position_m": [3.0, 3.0, 5.0], "sd_velocity_mps": [0.1, 0.1, 0.15]}
    joint = native | {"imu": native["imu"] | {"file": "aircraft.csv"}}
    joint["gnss"] = native["gnss"] | {"file": "aircraft.csv"} | sigmas
    results = [navfuse.process(Project.from_dict(tables, folder=tmp_path)) for tables in (native, joint)]
    for name, values in results[0].smoothed.to_columns().items():
        assert np.array_equal(values, results[1].smoothed.to_columns()[name]), name
    found = [
        compare(result.smoothed, read_trajectory(tmp_path / truth)).statistics
        for result, truth in zip(results, ("truth.parquet", "aircraft.csv"), strict=True)
    ]
    assert set(found[0]) - set(found[1]) == {f"velocity_{name}" for name in ("north", "east", "down", "3d")}
    for name, numbers in found[1].items():
        assert numbers == pytest.approx(found[0][name], rel=1e-9, abs=1e-9), name


@pytest.mark.parametrize(
    "changes",
    [{"imu": {"kind": "increments"}}, {"gnss": {"rate_hz": 0.5}}, {"gnss": {"velocity_sd_mps": 0.0}}],
)
def test_nineteen_columns_need_one_row_of_everything(tmp_path, changes):
    with pytest.raises(ConfigError, match='aircraft-1hz: one_table needs an IMU of kind = "rates" and GNSS fixes with'):
        simulate_scenario(load_scenario("aircraft-1hz", {"": {"duration_s": 50.0}} | changes), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_wrong_project_section_is_found_before_anything_is_simulated(tmp_path):
    scenario = load_scenario("city-car", {"project": {"filter": {"fram": "ned"}}})
    with pytest.raises(
        ConfigError, match=r"city-car: \[project\]: filter.fram: unknown key; did you mean filter.frame\?"
    ):
        simulate_scenario(scenario, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_logs_of_an_earlier_scenario_go_and_other_files_stay(tmp_path):
    simulate_scenario(load_scenario("city-car", SHORT), tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    simulate_scenario(load_scenario("static", {"": {"duration_s": 5.0}}), tmp_path)
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert not (tmp_path / "odometer.csv").exists()
    assert tomllib.loads((tmp_path / "project.toml").read_text())["start"]["sd_attitude_deg"] == pytest.approx(
        [0.2, 0.2, 1.0]
    )


def test_logs_that_no_simulation_wrote_are_neither_replaced_nor_removed(tmp_path):
    (tmp_path / "odometer.csv").write_text("mine")
    with pytest.raises(OutputError, match="odometer.csv would be replaced, and no earlier simulation wrote it"):
        simulate_scenario(load_scenario("city-car", SHORT), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["odometer.csv"]
    simulate_scenario(load_scenario("static", {"": {"duration_s": 5.0}}), tmp_path)
    simulate_scenario(load_scenario("static", {"": {"duration_s": 6.0}}), tmp_path)
    assert (tmp_path / "odometer.csv").read_text() == "mine"


@pytest.mark.parametrize("name", ["gnss.csv", "odometer.csv", "anchors.csv", ".csv", "a b.csv"])
def test_one_table_takes_no_name_of_another(name):
    with pytest.raises(ConfigError, match="one_table must name a .csv file of its own"):
        load_scenario("aircraft-1hz", {"": {"one_table": name}})


@pytest.mark.parametrize("section", ["imu", "gnss"])
def test_the_project_section_names_no_logs(section):
    with pytest.raises(ConfigError, match=rf"city-car: \[project.{section}\]: file is what the simulation writes"):
        project_tables(load_scenario("city-car", {"project": {section: {"file": "x.csv"}}}))


def test_what_a_scenario_is_made_of_is_never_replaced(tmp_path):
    own = tmp_path / "project.toml"
    own.write_text(scenario_text("static"), encoding="utf-8")
    with pytest.raises(ConfigError, match="project.toml is read by this run and would be replaced by it"):
        simulate_scenario(own, tmp_path)
    assert own.read_text(encoding="utf-8") == scenario_text("static")
    rows = ["time_s,lat_deg,lon_deg,height_m"] + [f"{k},{48.0 + 1e-4 * k},11.0,500.0" for k in range(20)]
    (tmp_path / "gnss.csv").write_text("\n".join(rows), encoding="utf-8")
    data = {
        "motion": {"vehicle": "track", "file": "gnss.csv", "rule": "car"},
        "imu": {"rate_hz": 20.0},
        "gnss": {"position_sd_m": 1.0},
    }
    scenario = read_scenario(data, "again", folder=tmp_path)
    with pytest.raises(ConfigError, match="gnss.csv is read by this run and would be replaced by it"):
        simulate_scenario(scenario, tmp_path)
    simulate_scenario(scenario, tmp_path / "elsewhere")
    assert (tmp_path / "gnss.csv").read_text(encoding="utf-8") == "\n".join(rows)


def test_a_place_that_cannot_be_written_is_found_out_first(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="is a file, not a folder"):
        simulate_scenario("city-car", tmp_path / "file")


def test_a_scenario_without_gnss_is_written_but_needs_a_start(tmp_path):
    data = {"motion": {"vehicle": "static", "duration_s": 3.0}, "imu": {"rate_hz": 20.0, "grade": "tactical"}}
    with pytest.raises(ConfigError, match="gnss.file: missing; without GNSS"):
        simulate_scenario(read_scenario(data, "x"), tmp_path / "no")
    logs = run_scenario(read_scenario(data | {"start": {}}, "x"))
    write_scenario(tmp_path, logs)
    assert not (tmp_path / "gnss.csv").exists()
    assert load_project(tmp_path / "project.toml").gnss.file is None
