"""A project with several estimators: same logs and start for each, errors against truth or differences from fixes."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from pymap3d import ned2geodetic
from scipy.spatial.transform import Rotation

import navfuse
from navfuse import ConfigError, FilterError, InputError, NavfuseWarning, OutputError, process
from navfuse.analysis.metrics import compare
from navfuse.analysis.nees import WHOLE
from navfuse.comparison import OUTPUT_NAMES, USUAL, at_lever, compare_filters, run_comparison
from navfuse.config import Project, load_project
from navfuse.data.trajectory import Trajectory
from navfuse.filters.ekf import ErrorStateFilter
from navfuse.filters.kinds import FILTERS
from navfuse.io.log_tables import write_gnss
from navfuse.io.tables import open_table, write_table
from navfuse.io.trajectory_table import read_trajectory, write_trajectory
from navfuse.scenario_files import simulate_scenario
from navfuse.simulation.scenario import load_scenario

pytestmark = pytest.mark.filterwarnings("ignore:.*the IMU rows are 1 s apart:navfuse.NavfuseWarning")


def hasty(start, model, sensors, settings):
    """A filter that takes its gyros for twenty times as noisy as they are."""
    return ErrorStateFilter(start, model.replace(arw=20.0 * model.arw), sensors, settings)


def broken(start, model, sensors, settings):
    raise FilterError("the state is no longer finite at 3.0 s")


def chatty(start, model, sensors, settings):
    made = ErrorStateFilter(start, model, sensors, settings)
    made.record.notes.append("something to know")
    return made


@pytest.fixture(autouse=True)
def more_estimators(monkeypatch):
    for name, build in (("ukf", hasty), ("broken", broken), ("chatty", chatty)):
        monkeypatch.setitem(FILTERS, name, build)


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight")
    simulate_scenario(load_scenario("aircraft-1hz", {"": {"duration_s": 400.0}}), folder)
    return folder


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A car with a lever arm and an outage."""
    folder = tmp_path_factory.mktemp("drive")
    simulate_scenario(load_scenario("city-car", {"": {"duration_s": 60.0}}), folder)
    return folder


@pytest.fixture(scope="module")
def found(flight):
    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings():
        patch.setitem(FILTERS, "ukf", hasty)
        warnings.simplefilter("ignore", NavfuseWarning)
        return compare_filters(flight / "project.toml", ["ekf", "ukf"])


def test_every_estimator_has_the_numbers_of_its_own_run(found, flight):
    assert found.estimators == ("ekf", "ukf")
    assert found.against_truth
    truth = read_trajectory(flight / "truth.parquet")
    project = load_project(flight / "project.toml")
    for run in found.runs:
        with_it = project.model_copy(update={"filter": project.filter.model_copy(update={"estimator": run.estimator})})
        alone = process(with_it)
        for solution, trajectory in ((run.forward, alone.forward), (run.smoothed, alone.smoothed)):
            assert solution.metrics.statistics == compare(trajectory, truth).statistics
        assert run.count("used") == int(np.count_nonzero(alone.innovations.status == "used"))
        assert run.states == alone.summary["state_count"]
        assert {source: one.to_dict() for source, one in run.nis.items()} == alone.summary["measurements"]
    ekf, ukf = found.runs
    assert ekf.forward.figures() != ukf.forward.figures()
    assert ukf.nees["attitude"].mean_per_dof < 0.5 * ekf.nees["attitude"].mean_per_dof


def test_nees_has_every_moment_and_all_groups(found):
    for run in found.runs:
        assert list(run.nees) == ["position", "velocity", "attitude", "navigation state"]
        assert WHOLE not in run.nees
        for one in run.nees.values():
            np.testing.assert_array_equal(one.time, np.arange(401.0))
        assert list(run.smoothed_nees) == list(run.nees)
        np.testing.assert_array_equal(run.smoothed_nees["attitude"].time, np.arange(401.0))
    assert 0.5 < found.runs[0].nees["navigation state"].mean_per_dof < 1.6
    assert 0.2 < found.runs[0].smoothed_nees["navigation state"].mean_per_dof < 2.5


def test_the_filter_alone_is_timed(found):
    for run in found.runs:
        assert run.seconds > 0.0
        assert run.samples == 400
        assert run.us_per_sample == pytest.approx(1e6 * run.seconds / 400)


def test_the_table_has_a_text_for_every_estimator(found):
    rows = {label: (unit, values) for label, unit, values in found.table()}
    assert all(len(values) == 2 for _, values in rows.values())
    unit, values = rows["MAE 3-D position"]
    assert unit == "m"
    assert float(values[0]) == pytest.approx(found.runs[0].forward.distance.mean(), abs=1e-4)
    assert rows["RMSE heading, smoothed"][0] == "deg"
    low, high = found.runs[0].nis["gnss_position"].bounds
    assert rows["NIS / dof, gnss_position"][1][0].endswith(f"({low:.3f}..{high:.3f})")
    assert rows["measurements used"][1] == [str(run.count("used", "reset")) for run in found.runs]
    assert {"NEES / dof, attitude", "NEES / dof, navigation state", "filter with its updates, per IMU sample"} <= set(
        rows
    )
    assert "Errors against the truth" in found.notes()[0]
    assert "this machine" in found.notes()[-1]


def test_the_numbers_for_json_carry_their_units(found):
    plain = found.to_dict()["estimators"]["ekf"]
    assert plain["forward"]["mae_3d_position_m"] == found.runs[0].forward.figures()["MAE 3-D position"]
    assert plain["smoothed"]["rmse_heading_deg"] == found.runs[0].smoothed.figures()["RMSE heading"]
    assert plain["forward"]["rmse_3d_velocity_mps"] == found.runs[0].forward.figures()["RMSE 3-D velocity"]
    assert plain["nees"]["navigation_state"]["dof"] == 9


def test_without_truth_the_numbers_are_differences_from_the_fixes(flight, tmp_path):
    project = load_project(flight / "project.toml")
    found = compare_filters(project, ["ekf", "ukf"])
    assert not found.against_truth
    assert "DIFFERENCES FROM THE FIXES" in found.notes()[0]
    assert not any("NEES" in label for label, _, _ in found.table())
    ekf = found.runs[0]
    assert ekf.nees == {}
    fixes = navfuse.read_gnss(flight / "gnss.csv")
    assert ekf.forward.errors.time.size == fixes.time.size
    assert 3.0 < ekf.forward.figures()["RMSE horizontal"] < 5.5
    assert "RMSE 3-D velocity" in ekf.forward.figures()
    assert "RMSE roll" not in ekf.forward.figures()


def test_fixes_are_compared_with_the_antenna(drive):
    """Perfect fixes of an antenna two metres above the sensor are not two metres from the solution."""
    project = load_project(drive / "project.toml")
    truth = read_trajectory(drive / "truth.parquet")
    lever = (0.5, 1.5, -2.0)
    gnss = navfuse.read_gnss(project.gnss.file)
    antenna = at_lever(truth, np.array(lever))
    rows = np.searchsorted(truth.time, np.arange(1.0, truth.time[-1]) - 1e-6)
    size = rows.size
    exact = replace(
        gnss.take(np.arange(size)),
        time=truth.time[rows],
        lat=antenna.lat[rows],
        lon=antenna.lon[rows],
        height=antenna.height[rows],
        sd_position=np.full((size, 3), 0.02),
        velocity_n=None,
        sd_velocity=None,
    )
    write_gnss(drive / "exact.csv", exact)
    settings = project.gnss.model_copy(
        update={"file": drive / "exact.csv", "lever_arm_m": lever, "outages_s": (), "time_offset_s": 0.0}
    )
    found = compare_filters(project.model_copy(update={"gnss": settings}), ["ekf"])
    assert found.runs[0].smoothed.figures()["RMSE 3-D position"] < 0.1
    assert "RMSE 3-D velocity" not in found.runs[0].smoothed.figures()


def test_without_a_smoother_there_is_no_smoothed_row(flight):
    project = load_project(flight / "project.toml")
    off = project.model_copy(update={"smoother": project.smoother.model_copy(update={"method": "none"})})
    found = compare_filters(off, ["ekf"], flight / "truth.parquet")
    assert found.runs[0].smoothed is None
    assert found.runs[0].smoothed_nees == {}
    assert not any("smoothed" in label for label, _, _ in found.table())
    assert found.runs[0].nees["position"].time.size == 401


def test_the_truth_beside_a_project_is_found(flight, tmp_path):
    truth = read_trajectory(flight / "truth.parquet")
    for name in ("imu.parquet", "gnss.csv", "project.toml"):
        (tmp_path / name).write_bytes((flight / name).read_bytes())
    assert not compare_filters(tmp_path / "project.toml", ["ekf"]).against_truth
    write_trajectory(tmp_path / "truth.csv", truth)
    assert compare_filters(tmp_path / "project.toml", ["ekf"]).reference.source.endswith("truth.csv")
    given = compare_filters(tmp_path / "project.toml", ["ekf"], replace(truth, source="mine"))
    assert given.reference.source == "mine"


def test_progress_is_told_for_every_estimator(flight):
    told = []
    compare_filters(flight / "project.toml", ["ekf", "ukf"], progress=lambda *news: told.append(news))
    for name in ("ekf", "ukf"):
        fractions = [fraction for stage, fraction in told if stage == name]
        assert fractions == sorted(fractions)
        assert fractions[-1] == 1.0


def test_what_a_filter_says_is_passed_on_with_its_name(flight):
    with pytest.warns(NavfuseWarning, match="chatty: something to know"):
        found = compare_filters(flight / "project.toml", ["chatty"])
    assert found.runs[0].notes == ("something to know",)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["ekf", "particle"], 'there is no estimator "particle"; known are ekf, ukf'),
        (["ekf", "ukf", "ekf"], 'the estimator "ekf" is named 2 times; once is enough'),
        ([], "no estimator is named; known are ekf"),
    ],
)
def test_wrong_names_are_found_before_the_logs_are_read(tmp_path, names, message):
    project = {"imu": {"file": "none.csv"}, "gnss": {"file": "none.csv"}}
    with pytest.raises(ConfigError, match=message):
        compare_filters(project, names)


def test_default_are_the_estimators_that_suit_every_project(flight, monkeypatch):
    monkeypatch.setattr("navfuse.comparison.USUAL", ("ekf", "ukf"))
    assert compare_filters(flight / "project.toml").estimators == ("ekf", "ukf")
    monkeypatch.undo()
    assert set(USUAL) <= set(FILTERS)


def refusing(*_):
    raise ConfigError("not with me")


def test_of_the_usual_estimators_one_that_refuses_is_left_out(flight, monkeypatch):
    monkeypatch.setattr("navfuse.comparison.USUAL", ("ekf", "iekf"))
    monkeypatch.setitem(FILTERS, "iekf", refusing)
    with pytest.warns(NavfuseWarning, match="iekf is left out: not with me"):
        assert compare_filters(flight / "project.toml").estimators == ("ekf",)
    with pytest.raises(ConfigError, match="iekf: not with me"):
        compare_filters(flight / "project.toml", ["ekf", "iekf"])
    monkeypatch.setitem(FILTERS, "ekf", refusing)
    with pytest.raises(ConfigError, match="ekf is left out: not with me; iekf is left out"):
        compare_filters(flight / "project.toml")


def test_a_project_needs_fixes(flight):
    start = {"lat_deg": 1.0, "lon_deg": 2.0, "height_m": 3.0, "heading_deg": 4.0}
    project = Project.from_dict({"imu": {"file": str(flight / "imu.parquet")}, "start": start})
    with pytest.raises(
        ConfigError, match="gnss.file is missing: without measurements all estimators integrate the same"
    ):
        compare_filters(project, ["ekf"])


def test_a_truth_of_another_time(flight):
    truth = read_trajectory(flight / "truth.parquet")
    with pytest.raises(InputError, match=r"from 10000.000 s .* no epoch in common with the logs, 0.000 s to 400.000 s"):
        compare_filters(flight / "project.toml", ["broken"], replace(truth, time=truth.time + 1e4))


def test_an_estimator_that_fails_is_named(flight):
    with pytest.raises(FilterError, match="broken: the state is no longer finite"):
        compare_filters(flight / "project.toml", ["ekf", "broken"])


def test_a_project_may_name_an_estimator_that_is_not_there(flight, estimators_in_order):
    del FILTERS["ukf"]
    project = load_project(flight / "project.toml").model_dump(exclude_none=True)
    project["filter"]["estimator"] = "ukf"
    with pytest.raises(ConfigError, match='there is no estimator "ukf"; known are ekf'):
        process(project)


def test_the_folder_appears_whole(flight, tmp_path):
    folder = tmp_path / "new" / "out"
    found = run_comparison(flight / "project.toml", folder, ["ekf", "ukf"])
    assert sorted(path.name for path in folder.iterdir()) == sorted(OUTPUT_NAMES)
    assert json.loads((folder / "comparison.json").read_text())["estimators"]["ukf"]["used"] == found.runs[1].count(
        "used"
    )
    assert (folder / "comparison.png").read_bytes().startswith(b"\x89PNG")


def test_nothing_is_left_of_a_comparison_that_failed(flight, tmp_path):
    with pytest.raises(FilterError):
        run_comparison(flight / "project.toml", tmp_path / "out", ["ekf", "broken"])
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_the_way_is_found_before_the_work(flight, tmp_path):
    (tmp_path / "out").write_text("mine")
    with pytest.raises(OutputError, match="out: is a file, not a folder"):
        run_comparison(flight / "project.toml", tmp_path / "out", ["broken"])
    assert (tmp_path / "out").read_text() == "mine"


def test_an_input_is_not_replaced(flight, tmp_path):
    truth = tmp_path / "comparison.json"
    truth.write_text("{}")
    with pytest.raises(ConfigError, match="comparison.json is read by this run and would be replaced"):
        run_comparison(flight / "project.toml", tmp_path, ["ekf"], truth)


def test_the_lever_arm_by_rotation_matrices():
    lever, attitude, lat, lon, height = np.array([0.5, 1.5, -2.0]), (0.2, -0.3, 2.5), 0.8, -1.2, 300.0
    one = Trajectory(*(np.array([value]) for value in (0.0, lat, lon, height)), attitude=np.array([attitude]))
    moved = at_lever(one, lever)
    north, east, down = Rotation.from_euler("ZYX", attitude[::-1]).apply(lever)
    expected = ned2geodetic(north, east, down, lat, lon, height, deg=False)
    np.testing.assert_allclose((moved.lat[0], moved.lon[0]), expected[:2], rtol=0.0, atol=1e-14)
    assert moved.height[0] == pytest.approx(expected[2], abs=1e-7)


@pytest.mark.filterwarnings("ignore::navfuse.NavfuseWarning")
def test_a_log_with_a_long_gap_is_one_comparison(flight, tmp_path):
    """Twenty seconds without inertial data: two stretches, joined; nothing is judged in the gap."""
    table = open_table(flight / "imu.parquet")
    columns = table.read(table.names)
    keep = (columns["time_s"] < 200.0) | (columns["time_s"] > 220.0)
    write_table(tmp_path / "imu.parquet", {name: values[keep] for name, values in columns.items()})
    for name in ("gnss.csv", "project.toml", "truth.parquet"):
        (tmp_path / name).write_bytes((flight / name).read_bytes())
    for run in compare_filters(tmp_path / "project.toml", ["ekf", "ukf"]).runs:
        for time in (run.nees["navigation state"].time, run.forward.errors.time, run.smoothed.errors.time):
            assert not np.any((time > 200.0) & (time < 221.0))
            assert time[0] == 0.0
            assert time[-1] == 400.0
            assert np.all(np.diff(time) > 0.0)
        assert run.samples < 380
        assert run.smoothed.figures()["maximum 3-D position"] < 30.0
