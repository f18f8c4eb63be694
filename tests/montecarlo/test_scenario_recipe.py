"""Campaigns of scenarios and of projects: the filter is that of ``navfuse run``, and can be told what is wrong."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.errors import ConfigError, InputError
from navfuse.filters.ekf import ErrorStateFilter
from navfuse.filters.kinds import FILTERS
from navfuse.io.trajectory_table import write_trajectory
from navfuse.montecarlo import ProjectRecipe, ScenarioRecipe, Tampering, assess, montecarlo, recipe_from, run_campaign
from navfuse.montecarlo.single import run_case
from navfuse.scenario_files import simulate_scenario
from navfuse.simulation.scenario import load_scenario

SHORT = (("", "duration_s", 30.0), ("imu", "rate_hz", 20.0))


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A project of a drive of 80 s, on disk."""
    folder = tmp_path_factory.mktemp("project")
    simulate_scenario(load_scenario("city-car", {"": {"duration_s": 80.0}}), folder, 4)
    return folder / "project.toml"


def test_the_same_seed_gives_the_same_run_and_the_scenario_is_what_is_simulated():
    recipe = ScenarioRecipe("city-car", SHORT)
    one, again, other = recipe(3), recipe(3), recipe(4)
    assert np.array_equal(one.logs.imu.gyro, again.logs.imu.gyro)
    assert np.array_equal(one.start.nav, again.start.nav)
    assert not np.array_equal(one.start.nav, other.start.nav)
    assert recipe.duration == 30.0
    assert one.model.arw == load_scenario("city-car").imu.base.arw
    assert [sensor.name for sensor in one.sensors] == ["gnss_position", "gnss_velocity"]


def test_stamps_are_put_right_as_the_project_does():
    recipe = ScenarioRecipe("city-car", (*SHORT, ("imu", "stamp_latency_ms", 30.0), ("gnss", "latency_s", 0.2)))
    case = recipe(1)
    assert case.logs.imu.time == pytest.approx(0.05 * np.arange(601), abs=1e-12)
    assert case.logs.imu_errors.time == pytest.approx(case.logs.imu.time, abs=1e-12)
    assert case.logs.gnss.time == pytest.approx(np.arange(31.0), abs=1e-12)


def test_the_estimator_is_that_of_the_project(project, estimators_in_order):
    def hasty(start, model, sensors, settings):
        return ErrorStateFilter(start, model.replace(arw=20.0 * model.arw), sensors, settings)

    other = project.with_name("other.toml")
    other.write_text(project.read_text() + '\n[filter]\nestimator = "ukf"\n')
    FILTERS["ukf"] = hasty
    own, told = ProjectRecipe(str(project))(1), ProjectRecipe(str(other))(1)
    assert (own.estimator, told.estimator) == ("ekf", "ukf")
    assert run_case(told).sd[-1, 8] > 1.5 * run_case(own).sd[-1, 8]
    del FILTERS["ukf"]
    with pytest.raises(ConfigError, match='there is no estimator "ukf"'):
        ProjectRecipe(str(other))(1)


def test_tampering_reaches_the_filter_alone():
    true = ScenarioRecipe("city-car", SHORT)(2)
    told = ScenarioRecipe("city-car", SHORT, tampering=Tampering(0.5, 0.25))(2)
    assert np.array_equal(true.logs.gnss.lat, told.logs.gnss.lat)
    assert told.sensors[0].noise(0) == pytest.approx(0.5 * true.sensors[0].noise(0))
    assert told.model.arw == 0.25 * true.model.arw
    assert told.model.gyro_bias_sd == pytest.approx(true.model.gyro_bias_sd)


def test_frames_and_outages():
    assert ScenarioRecipe("city-car", SHORT, frame="ecef")(1).settings.ecef
    assert not ScenarioRecipe("city-car", SHORT)(1).settings.ecef
    tunnel = ScenarioRecipe("tunnel", (("imu", "rate_hz", 20.0),))(1)
    assert tunnel.sensors[0].withheld(200)
    assert not tunnel.sensors[0].withheld(100)


def test_lost_samples_and_jittering_stamps_go_through():
    changes = (("", "duration_s", 40.0), ("imu", "dropped_percent", 0.5), ("imu", "grade", "industrial-mems"))
    campaign = run_campaign(ScenarioRecipe("urban-canyon", changes, smooth=True), 6, jobs=1)
    epochs = {run.time.size for run in campaign.runs}
    found = assess(campaign)
    assert len(epochs) > 1
    assert set(found) == {"filter", "smoother"}
    assert found["filter"].nees["position"].time.size <= min(epochs)


def test_a_project_is_simulated_along_its_own_solution(project, tmp_path):
    recipe = recipe_from(project)
    assert isinstance(recipe, ProjectRecipe)
    case = recipe(5)
    again = ProjectRecipe(str(project))(5)
    assert np.array_equal(case.logs.imu.accel, again.logs.imu.accel)
    assert case.logs.imu.kind == "increments"
    assert case.logs.gnss.time == pytest.approx(np.arange(case.logs.gnss.time[0], 81.0))
    assert case.logs.gnss.sd_position[0] == pytest.approx([1.0, 1.0, 2.0])
    campaign, found = montecarlo(recipe, tmp_path / "mc", 12, jobs=1)
    assert len(campaign.runs) == 12
    assert found["filter"].ratios["position"] == pytest.approx(1.0, abs=0.35)
    wrong = montecarlo(recipe_from(project, tampering=Tampering(0.3)), tmp_path / "wrong", 12, jobs=1)[1]["filter"]
    assert not wrong.consistent


def test_a_scenario_file_is_a_scenario(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        '[motion]\nvehicle = "static"\nduration_s = 20.0\n[imu]\nrate_hz = 20.0\ngrade = "tactical"\n'
        "[gnss]\nposition_sd_m = 1.0\n",
        encoding="utf-8",
    )
    assert isinstance(recipe_from(path), ScenarioRecipe)
    assert recipe_from(path).duration == 20.0


def test_what_cannot_be(project, tmp_path):
    with pytest.raises(ConfigError, match="there is no scenario 'city'"):
        recipe_from("city")
    with pytest.raises(ConfigError, match="frame must be 'ned' or 'ecef', not 'enu'"):
        ScenarioRecipe("city-car", SHORT, frame="enu")
    with pytest.raises(ConfigError, match=r"city-car: \[gnss\] outages_per_h takes other fixes from every run"):
        ScenarioRecipe("city-car", (*SHORT, ("gnss", "outages_per_h", 60.0), ("gnss", "outage_s", 5.0)))
    with pytest.raises(ConfigError, match="imu_noise_factor must be positive and finite, not 0"):
        Tampering(imu_noise_factor=0)
    with pytest.raises(ConfigError, match=r"is a project: \[imu\] rate_hz cannot be changed from outside"):
        recipe_from(project, changes=(("imu", "rate_hz", 5.0),))
    alone = tmp_path / "alone.toml"
    alone.write_text(
        f'[imu]\nfile = "{project.parent / "imu.parquet"}"\n[start]\nlat_deg = 48\nlon_deg = 11\nheight_m = 500\n'
        "roll_deg = 0\npitch_deg = 0\nheading_deg = 0\n",
        encoding="utf-8",
    )
    with pytest.raises(ConfigError, match=r"without \[gnss\] file there are no measurements"):
        recipe_from(alone)
    lonely = tmp_path / "lonely.toml"
    lonely.write_text(
        '[motion]\nvehicle = "static"\nduration_s = 20.0\n[imu]\nrate_hz = 20.0\n[start]\n'
        "[project.start]\nlat_deg = 48\nlon_deg = 11\nheight_m = 0\nroll_deg = 0\npitch_deg = 0\nheading_deg = 0\n",
        encoding="utf-8",
    )
    with pytest.raises(ConfigError, match=r"without \[gnss\] there are no measurements to judge the filter by"):
        recipe_from(lonely)


def test_a_recipe_names_what_it_reads(project, tmp_path):
    rows = ["time_s,lat_deg,lon_deg,height_m"] + [f"{k},{48.0 + 1e-4 * k},11.0,500.0" for k in range(30)]
    (tmp_path / "track.csv").write_text("\n".join(rows), encoding="utf-8")
    own = tmp_path / "mine.toml"
    own.write_text(
        '[motion]\nvehicle = "track"\nfile = "track.csv"\nrule = "car"\n[imu]\nrate_hz = 20.0\n'
        "[gnss]\nposition_sd_m = 1.0\n",
        encoding="utf-8",
    )
    assert {path.name for path in recipe_from(own).inputs} == {"mine.toml", "track.csv"}
    assert {path.name for path in recipe_from(project).inputs} == {"project.toml", "imu.parquet", "gnss.csv"}
    assert list(ScenarioRecipe("boat", SHORT).inputs) == []


def test_a_track_in_the_place_of_a_result_is_kept(tmp_path):
    motion = load_scenario("city-car", {"": {"duration_s": 40.0}}).motion
    write_trajectory(tmp_path / "runs.parquet", motion.trajectory(np.arange(0.0, 40.0, 0.1)))
    before = (tmp_path / "runs.parquet").read_bytes()
    own = tmp_path / "mine.toml"
    own.write_text(
        '[motion]\nvehicle = "track"\nfile = "runs.parquet"\n[imu]\nrate_hz = 20.0\n[gnss]\nposition_sd_m = 1.0\n',
        encoding="utf-8",
    )
    with pytest.raises(ConfigError, match="runs.parquet is read by this run and would be replaced by it"):
        montecarlo(recipe_from(own), tmp_path, 2, jobs=1)
    assert (tmp_path / "runs.parquet").read_bytes() == before


def test_a_solution_with_a_hole_is_no_motion(project, tmp_path):
    text = project.read_text().replace('file = "', f'file = "{project.parent}/')
    hole = tmp_path / "hole.toml"
    import pyarrow.parquet as pq

    table = pq.read_table(project.parent / "imu.parquet")
    rows = np.r_[0:3000, 3600 : table.num_rows]
    pq.write_table(table.take(rows), tmp_path / "imu.parquet")
    hole.write_text(text.replace(f"{project.parent}/imu.parquet", f"{tmp_path}/imu.parquet"), encoding="utf-8")
    with (
        pytest.warns(match="no inertial data for"),
        pytest.raises(InputError, match="cannot be made a motion: .*gaps above"),
    ):
        recipe_from(hole)
