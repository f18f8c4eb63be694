from __future__ import annotations

import json

import pytest

from navfuse.filters.ekf import ErrorStateFilter
from navfuse.filters.kinds import FILTERS
from navfuse.scenario_files import simulate_scenario
from navfuse.simulation.scenario import load_scenario


def hasty(start, model, sensors, settings):
    return ErrorStateFilter(start, model.replace(arw=20.0 * model.arw), sensors, settings)


@pytest.fixture(autouse=True)
def two_estimators(estimators_in_order, monkeypatch):
    monkeypatch.setattr("navfuse.comparison.USUAL", ("ekf", "ukf"))
    for name in set(FILTERS) - {"ekf", "ukf"}:
        del FILTERS[name]
    FILTERS["ukf"] = hasty


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight")
    simulate_scenario(load_scenario("aircraft-1hz", {"": {"duration_s": 200.0}}), folder)
    return folder


def test_table(navfuse, flight):
    code, out, err = navfuse("compare-filters", flight / "project.toml", "--estimators", "ekf, ukf")
    assert code == 0
    assert err.count("warning:") == 1
    lines = out.splitlines()
    assert lines[0].endswith("project.toml: ekf, ukf")
    (row,) = (line.split() for line in lines if line.strip().startswith("MAE 3-D position  "))
    assert row[:4] == ["MAE", "3-D", "position", "m"]
    assert len(row) == 6
    assert all(0.1 < float(value) < 5.0 for value in row[4:])
    assert any(line.strip().startswith("NEES / dof, navigation state") for line in lines)
    assert "Errors against the truth" in out
    assert "this machine" in out.replace("\n", " ")


def test_json_is_all_that_is_printed(navfuse, flight):
    code, out, _ = navfuse("compare-filters", flight / "project.toml", "--json")
    found = json.loads(out)
    assert code == 0
    assert list(found["estimators"]) == ["ekf", "ukf"]
    assert found["against_truth"] is True
    assert found["estimators"]["ekf"]["nees"]["position"]["dof"] == 3


def test_folder_and_other_truth(navfuse, flight, tmp_path):
    folder = tmp_path / "out"
    arguments = ("--estimators", "ekf", "--truth", flight / "aircraft.csv", "-o", folder, "-q")
    code, out, _ = navfuse("compare-filters", flight / "project.toml", *arguments)
    assert (code, out) == (0, "")
    assert sorted(path.name for path in folder.iterdir()) == ["comparison.html", "comparison.json", "comparison.png"]
    found = json.loads((folder / "comparison.json").read_text())
    assert found["reference"].endswith("aircraft.csv")
    assert list(found["estimators"]["ekf"]["nees"]) == ["position", "attitude"]


def test_without_truth_it_says_so(navfuse, flight, tmp_path):
    for name in ("imu.parquet", "gnss.csv", "project.toml"):
        (tmp_path / name).write_bytes((flight / name).read_bytes())
    code, out, _ = navfuse("compare-filters", tmp_path / "project.toml", "--estimators", "ekf")
    assert code == 0
    assert "DIFFERENCES FROM THE FIXES" in out
    assert "NEES" not in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--estimators", "ekf,kf"), 'error: there is no estimator "kf"; known are ekf, ukf'),
        (("--estimators", "ekf,ekf"), 'error: the estimator "ekf" is named 2 times; once is enough'),
        (("--estimators", "ekf,"), 'error: there is no estimator ""; known are ekf, ukf'),
        (("--truth", "none.csv"), "error: none.csv: there is no such file"),
    ],
)
def test_one_message_for_what_is_wrong(navfuse, flight, arguments, message):
    code, out, err = navfuse("compare-filters", flight / "project.toml", *arguments)
    assert (code, out) == (1, "")
    assert err.splitlines()[-1].startswith(message)
    assert err.count("error:") == 1


def test_a_file_where_the_folder_should_be(navfuse, flight, tmp_path):
    (tmp_path / "out").write_text("mine")
    code, _, err = navfuse("compare-filters", flight / "project.toml", "-o", tmp_path / "out")
    assert code == 1
    assert "is a file, not a folder" in err


def test_wrong_usage(navfuse, flight):
    assert navfuse("compare-filters")[0] == 2
    assert navfuse("compare-filters", flight / "project.toml", "--estimator", "ekf")[0] == 2
