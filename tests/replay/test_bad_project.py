"""What can be wrong in a project file, through the command line: one message that names the key."""

from __future__ import annotations

import pytest

from navfuse.config import template
from navfuse.io.result_folder import TABLES
from replay.job import navfuse


@pytest.mark.parametrize(
    ("section", "key", "meant"),
    [("imu", "axis", "imu.axes"), ("gnss", "leverarm_m", "gnss.lever_arm_m"), ("filter", "fram", "filter.frame")],
)
def test_misspelt_key(job, section, key, meant):
    job.set(section, **{key: "FRD"}).refused("project.toml", f"{section}.{key}", f"did you mean {meant}?")


def test_misspelt_section(job):
    job.set("smother", method="none").refused("project.toml", "smother", "did you mean [smoother]?")


@pytest.mark.parametrize(
    ("section", "key", "value", "words"),
    [
        ("imu", "axes", "FRU", ("left-handed", "FRD")),
        ("imu", "axes", "FFD", ("one direction twice",)),
        ("imu", "axes", "XYZ", ("three letters",)),
        ("imu", "rotation", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]], ("determinant -1",)),
        ("imu", "rotation", [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], ("not orthonormal",)),
        ("imu", "grade", "tacticle", ("tactical",)),
        ("gnss", "lever_arm_m", [1.0, 2.0], ("list of 3 numbers",)),
        ("gnss", "outages_s", [[55.0, 40.0]], ("must end after it starts",)),
        ("gnss", "sd_scale", 0.0, ("> 0",)),
        ("start", "lat_deg", 48.0, ("start.lon_deg", "missing")),
        ("start", "sd_attitude_deg", [1.0, 1.0, 1.0], ("start.roll_deg",)),
        ("filter", "frame", "enu", ("ned", "ecef")),
        ("output", "formats", ["xlsx"], ("parquet", "csv")),
    ],
)
def test_a_value_that_cannot_be(job, section, key, value, words):
    job.set(section, **{key: value}).refused("project.toml", section, *words)


def test_not_toml(job):
    path = job.write()
    path.write_text("[imu]\nfile = imu.parquet\n")
    outcome = navfuse("run", path, "-o", job.output, "--no-report")
    assert (outcome.code, outcome.out) == (1, "")
    assert "line 2" in outcome.err


@pytest.mark.parametrize("time_s", [-5.0, 500.0])
def test_a_start_outside_the_log(job, time_s):
    job.set("start", time_s=time_s).refused("time_s", "0.000 to 120.000 s")


def test_an_end_before_the_log(job):
    job.set("filter", until_s=-3.0).refused("until_s")


def test_a_start_without_gnss_has_to_be_whole(job):
    job.set("gnss", file=None, lever_arm_m=None)
    job.set("start", lat_deg=45.8, lon_deg=11.5, height_m=100.0).refused("heading_deg")


DESIGN = """\
[imu]
file = "imu.parquet"
axes = "FRD"
time_offset_s = 0.0
grade = "industrial-mems"
arw_deg_per_sqrt_h = 0.2
vrw_mps_per_sqrt_h = 0.1
gyro_bias_sd_dph = 100.0
gyro_bias_tau_s = 3600.0
accel_bias_sd_mg = 2.0
accel_bias_tau_s = 3600.0
gyro_scale_sd_ppm = 300.0
accel_scale_sd_ppm = 300.0
[gnss]
file = "gnss.csv"
use = ["position", "velocity"]
lever_arm_m = [-0.4, 0.2, -1.3]
time_offset_s = 0.0
outages_s = [[85.0, 100.0]]
[start]
lat_deg = 45.83662361046586
lon_deg = 11.459155902616466
height_m = 100.0
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
formats = ["parquet", "csv"]
"""


def test_every_key_of_the_house_plan_at_once(job):
    path = job.write()
    path.write_text(DESIGN)
    code, out, err = navfuse("run", path, "-o", job.output)
    assert (code, err) == (0, "")
    assert "30 withheld" in out
    names = {f"{table}.{kind}" for table in TABLES for kind in ("parquet", "csv")}
    assert {entry.name for entry in job.output.iterdir()} == names | {"imu.json", "summary.json", "report.html"}


@pytest.mark.parametrize("key", ["frame", "feedback", "method", "rate_hz"])
def test_every_other_choice_of_the_house_plan(job, key):
    choices = {
        "frame": ("filter", "ecef"),
        "feedback": ("filter", "open"),
        "method": ("smoother", "none"),
        "rate_hz": ("output", 0.0),
    }
    section, value = choices[key]
    done = job.set(section, **{key: value}).done()
    assert (done.job.output / "smoothed.parquet").exists() == (key != "method")
    assert done.errors("forward", skip_s=5.0).statistics["position_horizontal"].max < 1.0


def test_what_config_prints_is_a_project_that_runs(job):
    path = job.write()
    path.write_text(template())
    code, _, err = navfuse("run", path, "-o", job.output, "--no-report")
    assert code == 0, err


def test_a_log_in_the_output_folder_is_not_replaced(job):
    job.output.mkdir()
    job.gnss_name = "out/smoothed.csv"
    path = job.set("gnss", file="out/smoothed.csv").write()
    before = (job.output / "smoothed.csv").read_bytes()
    code, _, err = navfuse("run", path, "-o", job.output, "--no-report")
    assert code == 1
    assert "smoothed.csv is read by this run and would be replaced by it; choose another output folder" in err
    assert (job.output / "smoothed.csv").read_bytes() == before


def test_an_outage_without_a_fix_is_warned_about(job):
    job.set("gnss", outages_s=[[5000.0, 5100.0]]).done(
        "gnss.outages_s: there is no fix to withhold from 5000 s to 5100 s"
    )


@pytest.mark.parametrize(
    ("section", "key", "value", "words"),
    [
        ("imu", "arw_deg_per_sqrt_h", 1e300, ("sensible size",)),
        ("gnss", "sd_scale", 1e13, ("sensible size",)),
        ("gnss", "time_offset_s", -1e15, ("sensible size",)),
        ("output", "rate_hz", 1e9, (">= 0 and <= 1000",)),
    ],
)
def test_numbers_of_absurd_size(job, section, key, value, words):
    job.set(section, **{key: value}).refused(f"{section}.{key}", *words)


def test_axes_and_rotation_are_not_both_taken(job):
    rotation = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]
    job.set("imu", axes="RFU", rotation=rotation).refused("imu.rotation", "given beside imu.axes")


def test_a_run_that_contradicts_itself_says_so_where_it_states_its_accuracy(job):
    finished = job.set("gnss", sd_scale=0.01, velocity_sd_scale=0.01).done("innovations are larger than claimed")
    assert "NOT TO BE RELIED ON: innovations are " in finished.outcome.out
    verdict = finished.summary["verdict"]
    assert verdict["reliable"] is False
    assert verdict["innovations_over_claim"] > 10.0


def test_a_sound_run_says_that_it_can_be_relied_on(job):
    finished = job.done()
    assert "NOT TO BE RELIED ON" not in finished.outcome.out
    assert finished.summary["verdict"]["reliable"] is True
