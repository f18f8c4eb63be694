from __future__ import annotations

import math
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from pydantic import ValidationError

from navfuse.config import Project, load_project
from navfuse.errors import ConfigError
from navfuse.imu.grades import grade

LEAST = {"imu": {"file": "imu.csv"}, "gnss": {"file": "gnss.csv"}}

EVERY_KEY_OF_THE_PLAN = """
[imu]
file = "imu.parquet"
axes = "FRD"
time_offset_s = 0.0
grade = "industrial-mems"
arw_deg_per_sqrt_h = 0.2
vrw_mps_per_sqrt_h = 0.1
gyro_bias_sd_dph = 30.0
gyro_bias_tau_s = 3600.0
accel_bias_sd_mg = 0.15
accel_bias_tau_s = 3600.0
gyro_scale_sd_ppm = 300.0
accel_scale_sd_ppm = 300.0
[gnss]
file = "gnss.csv"
use = ["position", "velocity"]
lever_arm_m = [0.0, 0.0, 0.0]
time_offset_s = 0.0
outages_s = [[40.0, 55.0]]
[start]
lat_deg = 30.5
lon_deg = 114.3
height_m = 25.0
velocity_mps = [0.0, 0.0, 0.0]
roll_deg = 0.0
pitch_deg = 0.0
heading_deg = 35.0
sd_position_m = [1.0, 1.0, 2.0]
sd_velocity_mps = [0.05, 0.05, 0.05]
sd_attitude_deg = [0.5, 0.5, 2.0]
[filter]
estimator = "ekf"
frame = "ned"
feedback = "closed"
[smoother]
method = "rts"
[aiding]
zero_velocity = "auto"
nonholonomic = false
[output]
rate_hz = 10.0
formats = ["parquet"]
"""


def project(**sections: dict) -> Project:
    return Project.from_dict({name: LEAST.get(name, {}) | sections.get(name, {}) for name in {**LEAST, **sections}})


def write(folder: Path, text: str) -> Path:
    path = folder / "project.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_two_files_are_enough():
    least = project()
    assert least.imu.grade == "industrial-mems"
    assert least.imu.axes == "FRD"
    assert least.gnss.use == ("position", "velocity")
    assert least.gnss.lever_arm_m == (0.0, 0.0, 0.0)
    assert least.start.lat_deg is None
    assert least.start.sd_attitude_deg is None
    assert (least.filter.estimator, least.filter.frame, least.filter.feedback) == ("ekf", "ned", "closed")
    assert least.filter.covariance_rate_hz is None
    assert least.smoother.method == "rts"
    assert least.output.rate_hz == 10.0
    assert least.output.formats == ("parquet",)


def test_every_key_of_the_plan_is_known(tmp_path):
    whole = load_project(write(tmp_path, EVERY_KEY_OF_THE_PLAN))
    assert whole.gnss.outages_s == ((40.0, 55.0),)
    assert whole.start.sd_attitude_deg == (0.5, 0.5, 2.0)
    assert whole.imu.gyro_scale_sd_ppm == 300.0


def test_files_are_relative_to_the_project_file(tmp_path):
    elsewhere = tmp_path / "elsewhere" / "gnss.csv"
    loaded = load_project(write(tmp_path, f"[imu]\nfile = 'logs/imu.csv'\n[gnss]\nfile = '{elsewhere.as_posix()}'"))
    assert loaded.imu.file == tmp_path / "logs" / "imu.csv"
    assert loaded.gnss.file == elsewhere


def test_files_of_a_dictionary_are_relative_to_the_working_directory():
    assert project().imu.file == Path("imu.csv")
    assert Project.from_dict(LEAST, folder="logs").imu.file == Path("logs/imu.csv")


def test_home_folder_in_a_file_name():
    assert project(imu={"file": "~/imu.csv"}).imu.file == Path.home() / "imu.csv"


def test_byte_order_mark_of_windows_editors(tmp_path):
    path = tmp_path / "project.toml"
    path.write_bytes(b"\xef\xbb\xbf[imu]\nfile = 'a.csv'\n[gnss]\nfile = 'b.csv'\n")
    assert load_project(path).gnss.file == tmp_path / "b.csv"


def test_settings_cannot_be_changed_afterwards():
    with pytest.raises(ValidationError, match="frozen"):
        project().imu.axes = "FLU"


def test_no_such_project_file(tmp_path):
    with pytest.raises(ConfigError, match=r"project\.toml: no such project file; `navfuse config` prints one"):
        load_project(tmp_path / "project.toml")


def test_project_file_that_cannot_be_read(tmp_path):
    with pytest.raises(ConfigError, match="cannot be read as a project file: Is a directory"):
        load_project(tmp_path)
    path = tmp_path / "project.toml"
    path.write_bytes(b"# caf\xe9")
    with pytest.raises(ConfigError, match="cannot be read as a project file: 'utf-8' codec"):
        load_project(path)


def test_broken_toml_names_the_line(tmp_path):
    with pytest.raises(ConfigError, match=r"project\.toml: not valid TOML: .*line 2"):
        load_project(write(tmp_path, "[imu]\nfile = imu.csv\n"))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"imu": {"fil": "imu.csv"}}, "imu.fil: unknown key; did you mean imu.file?"),
        ({"imu": {"file": "a", "arw": 0.2}}, "imu.arw: unknown key; did you mean imu.arw_deg_per_sqrt_h?"),
        ({"imu": {"file": "a", "lever_arm_m": [0, 0, 0]}}, "did you mean gnss.lever_arm_m?"),
        ({**LEAST, "output": {"colour": "red"}}, "output.colour: unknown key; [output] has rate_hz, formats"),
        ({**LEAST, "imuu": {}}, "imuu: unknown section; did you mean [imu]?"),
        ({**LEAST, "radar": {}}, "radar: unknown section; there are [imu], [gnss]"),
        ({**LEAST, "lat_deg": 3.0}, "lat_deg: unknown key; did you mean start.lat_deg?"),
    ],
)
def test_unknown_keys_name_the_nearest(data, message):
    with pytest.raises(ConfigError) as error:
        Project.from_dict(data, source="drive.toml")
    assert str(error.value).startswith("drive.toml: ")
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("section", "key", "value", "message"),
    [
        ("imu", "arw_deg_per_sqrt_h", -1.0, "imu.arw_deg_per_sqrt_h = -1.0: must be >= 0"),
        ("imu", "arw_deg_per_sqrt_h", math.inf, "imu.arw_deg_per_sqrt_h = inf: must be a finite number"),
        ("imu", "arw_deg_per_sqrt_h", "0.2", 'imu.arw_deg_per_sqrt_h = "0.2": must be a number'),
        (
            "imu",
            "gyro_bias_sd_dph",
            [1.0, 2.0],
            "imu.gyro_bias_sd_dph = [1.0, 2.0]: must be a number or a list of 3 numbers",
        ),
        ("imu", "gyro_bias_sd_dph", [1.0, 2.0, -3.0], "must be >= 0"),
        ("imu", "gyro_bias_tau_s", 0.0, "imu.gyro_bias_tau_s = 0.0: must be > 0"),
        ("imu", "gyro_bias_tau_s", math.nan, "must be a finite number"),
        ("imu", "max_gap_s", True, "imu.max_gap_s = true: must be a number"),
        ("imu", "on_gap", "ignore", 'imu.on_gap = "ignore": must be "continue" or "stop"'),
        ("imu", "rotation", [[1, 0, 0]], "imu.rotation = [[1, 0, 0]]: must be a list of 3 lists of 3 numbers"),
        ("imu", "file", "", 'imu.file = "": must name a file'),
        ("imu", "file", 3, "imu.file = 3: must be a path"),
        ("gnss", "lever_arm_m", [0.0, 0.0, 2000.0], "must be >= -1000 and <= 1000"),
        ("gnss", "use", "position", 'gnss.use = "position": must be a list of "position" or "velocity"'),
        ("gnss", "use", [], "gnss.use = []: must name at least one"),
        ("gnss", "outages_s", [[55.0, 40.0]], "window [55, 40] must end after it starts"),
        ("gnss", "outages_s", [40.0, 55.0], "must be a list of lists of 2 numbers"),
        ("gnss", "epoch_week_s", [-1, 0.0], "gnss.epoch_week_s = [-1, 0.0]: must be >= 0"),
        ("gnss", "epoch_week_s", [2374.5, 0.0], "must be a list of whole number, number"),
        ("gnss", "gate_probability", 0.0, "must be > 0 and <= 1"),
        ("gnss", "sd_scale", 0.0, "must be > 0"),
        ("start", "lat_deg", 95.0, "start.lat_deg = 95.0: must be >= -90 and <= 90"),
        ("start", "sd_position_m", [1.0, 1.0, 0.0], "must be > 0"),
        (
            "filter",
            "estimator",
            "particle",
            'filter.estimator = "particle": must be "ekf" or "ukf" or "ckf" or "iekf" or "ukf-f',
        ),
        ("filter", "frame", "enu", 'filter.frame = "enu": must be "ned" or "ecef"'),
        ("aiding", "nonholonomic", True, "the land vehicle constraint is not available yet"),
        ("output", "rate_hz", -1.0, "output.rate_hz = -1.0: must be >= 0"),
        ("output", "formats", ["kmz"], '"kmz" is not a format that can be written; there are parquet, csv, kml, gpx'),
        ("output", "export_point", "roof", "output.export_point"),
        ("output", "export_point", [0.0, 0.0, 2e3], "must be >= -1000 and <= 1000"),
        ("output", "export_rate_hz", 0.0, "must be > 0 and <= 1000"),
        ("output", "export_height", "msl", "output.export_height"),
        ("output", "export_geoid", "egm84", "output.export_geoid"),
        ("output", "formats", [], "must name at least one of parquet, csv"),
    ],
)
def test_a_wrong_value_is_named_with_what_is_allowed(section, key, value, message):
    start = {"lat_deg": 1.0, "lon_deg": 2.0, "height_m": 3.0} if section == "start" else {}
    with pytest.raises(ConfigError) as error:
        project(**{section: {**start, key: value}})
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("sections", "message"),
    [
        ({"imu": {"axes": "FRX"}}, 'imu.axes = "FRX" has to be three letters'),
        ({"imu": {"axes": "FRU"}}, "left-handed"),
        ({"imu": {"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 2]]}}, "imu.rotation is not orthonormal"),
        ({"imu": {"grade": "tacticl"}}, "imu.grade: unknown IMU grade 'tacticl': did you mean 'tactical'?"),
        (
            {"imu": {"gyro_bias_tau_s": 10.0, "gyro_bias_walk_dph_per_sqrt_h": 3.0}},
            "imu.gyro_bias_walk_dph_per_sqrt_h: only with imu.gyro_bias_tau_s = inf, which is 10",
        ),
        ({"start": {"lat_deg": 3.0}}, "start.lon_deg: missing beside start.lat_deg"),
        ({"start": {"sd_velocity_mps": [1.0, 1.0, 1.0]}}, "start.sd_velocity_mps: given without start.velocity_mps"),
        ({"start": {"time_s": 3.0}, "filter": {"until_s": 2.0}}, "filter.until_s = 2: must be after start.time_s = 3"),
    ],
)
def test_settings_that_do_not_go_together(sections, message):
    with pytest.raises(ConfigError) as error:
        project(**sections)
    assert message in str(error.value)


def test_without_gnss_a_start_is_needed():
    position = {"lat_deg": 30.0, "lon_deg": 114.0, "height_m": 20.0}
    with pytest.raises(ConfigError, match=r"gnss\.file: missing; without GNSS, \[start\] has to give"):
        Project.from_dict({"imu": {"file": "imu.csv"}, "start": position})
    inertial = Project.from_dict({"imu": {"file": "imu.csv"}, "start": {**position, "heading_deg": 10.0}})
    assert inertial.gnss.file is None


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({}, "project: imu: missing"),
        ({"imu": {}}, "project: imu.file: missing"),
        ({"imu": 3}, "project: imu must be a table, written as [imu]"),
        (3, "project: must be a table of sections"),
    ],
)
def test_what_is_missing_altogether(data, message):
    with pytest.raises(ConfigError) as error:
        Project.from_dict(data)
    assert str(error.value) == message


def test_several_faults_are_reported_together():
    with pytest.raises(ConfigError) as error:
        project(imu={"arw_deg_per_sqrt_h": -1.0}, output={"rate_hz": "fast"})
    lines = str(error.value).splitlines()
    assert lines[0] == "project: 2 keys are wrong"
    assert lines[1:] == ["  imu.arw_deg_per_sqrt_h = -1.0: must be >= 0", '  output.rate_hz = "fast": must be a number']


def test_a_given_start_has_standard_deviations():
    start = project(start={"lat_deg": 1, "lon_deg": 2, "height_m": 3, "heading_deg": 4}).start
    assert start.sd_position_m == (5.0, 5.0, 5.0)
    assert start.sd_attitude_deg == (2.0, 2.0, 5.0)
    assert start.sd_velocity_mps is None


def test_repeated_choices_count_once():
    assert project(gnss={"use": ["position", "position"]}).gnss.use == ("position",)
    assert project(output={"formats": ["csv", "csv"]}).output.formats == ("csv",)


def test_formats_of_tables_and_of_other_programs():
    output = project(output={"formats": ["kml", "csv", "gpx"], "export_point": [1.0, 0.0, -1.0]}).output
    assert (output.tables, output.exports, output.export_point) == (("csv",), ("kml", "gpx"), (1.0, 0.0, -1.0))
    assert project(output={"formats": ["kml"]}).output.tables == ("parquet",)
    assert (project().output.tables, project().output.exports) == (("parquet",), ())


def test_error_model_of_the_benchmark_in_si_units():
    model = project(
        imu={
            "arw_deg_per_sqrt_h": 0.2,
            "vrw_mps_per_sqrt_h": 0.1,
            "gyro_bias_sd_dph": 30.0,
            "gyro_bias_tau_s": 3600.0,
            "accel_bias_sd_mg": [0.15, 0.3, 0.15],
            "accel_bias_tau_s": 3600.0,
            "gyro_scale_sd_ppm": 300.0,
        }
    ).imu_error_model()
    assert model.arw == pytest.approx(math.radians(0.2) / 60.0, rel=1e-14)
    assert model.vrw == pytest.approx(0.1 / 60.0, rel=1e-14)
    assert model.gyro_bias_sd == pytest.approx(math.radians(30.0) / 3600.0, rel=1e-14)
    np.testing.assert_allclose(model.accel_bias_sd, np.array([0.15, 0.3, 0.15]) * 9.80665e-3, rtol=1e-14)
    assert model.gyro_bias_tau == 3600.0
    assert model.gyro_scale_sd == pytest.approx(3e-4, rel=1e-14)
    assert model.accel_scale_sd == grade("industrial-mems").accel_scale_sd


def test_correlation_time_and_walk_replace_each_other():
    preset = grade("industrial-mems")
    assert preset.gyro_bias_walk > 0.0
    assert math.isinf(preset.gyro_bias_tau)
    with_tau = project(imu={"gyro_bias_tau_s": 100.0}).imu_error_model()
    assert (with_tau.gyro_bias_tau, with_tau.gyro_bias_walk) == (100.0, 0.0)
    assert with_tau.accel_bias_walk == preset.accel_bias_walk
    car = grade("benchmark-car")
    assert math.isfinite(car.accel_bias_tau)
    with_walk = project(imu={"grade": "benchmark-car", "accel_bias_walk_mg_per_sqrt_h": 0.6}).imu_error_model()
    assert with_walk.accel_bias_walk == pytest.approx(0.01 * 9.80665e-3, rel=1e-14)
    assert math.isinf(with_walk.accel_bias_tau)
    assert math.isinf(
        project(imu={"grade": "benchmark-car", "gyro_bias_tau_s": math.inf}).imu_error_model().gyro_bias_tau
    )


def test_every_parameter_of_the_error_model_can_be_set():
    assert set(grade("tactical").to_datasheet()) <= set(type(project().imu).model_fields)


@given(
    offset=st.floats(-1e6, 1e6),
    lever=st.tuples(*[st.floats(-1000.0, 1000.0)] * 3),
    bias=st.one_of(st.floats(0.0, 1e6), st.tuples(*[st.floats(0.0, 1e6)] * 3)),
    tau=st.one_of(st.just(math.inf), st.floats(1e-3, 1e9)),
    name=st.text(st.characters(blacklist_categories=["Cs", "Cc"], blacklist_characters="/~"), min_size=1, max_size=20),
)
def test_settings_survive_the_file(tmp_path_factory, offset, lever, bias, tau, name):
    first = project(
        imu={"file": f"x{name}", "time_offset_s": offset, "gyro_bias_sd_dph": bias, "gyro_bias_tau_s": tau},
        gnss={"lever_arm_m": lever, "outages_s": [[1.0, 2.0], [3.0, 4.0]]},
        start={"heading_deg": 12.5},
    )
    folder = tmp_path_factory.mktemp("project")
    again = load_project(write(folder, first.to_toml()))
    assert again.imu.file == folder / first.imu.file
    assert again.settings() | {"imu": None, "gnss": None} == first.settings() | {"imu": None, "gnss": None}
    assert again.settings()["imu"] | {"file": 0} == first.settings()["imu"] | {"file": 0}
    assert again.settings()["gnss"] | {"file": 0} == first.settings()["gnss"] | {"file": 0}


def test_sigma_points_are_placed_by_the_file_for_the_unscented_filter_only():
    tables = {"imu": {"file": "a.csv", "grade": "consumer"}, "gnss": {"file": "b.csv"}}
    keys = {"ukf_alpha": 0.5, "ukf_beta": 1.0, "ukf_kappa": 2.0}
    project = Project.from_dict({**tables, "filter": {"estimator": "ukf", **keys}})
    assert (project.filter.ukf_alpha, project.filter.ukf_beta, project.filter.ukf_kappa) == (0.5, 1.0, 2.0)
    for name, value in keys.items():
        with pytest.raises(ConfigError, match=f'filter.{name}.*estimator = "ukf"; with "ekf" leave it out'):
            Project.from_dict({**tables, "filter": {name: value}})
    with pytest.raises(ConfigError, match="ukf_alpha"):
        Project.from_dict({**tables, "filter": {"estimator": "ukf", "ukf_alpha": 0.0}})
