from __future__ import annotations

import json
import tomllib

import pytest
from tests.inspection.damages import degrees, read_columns

from navfuse.io.tables import write_table
from navfuse.scenario_files import simulate_scenario


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drive")
    simulate_scenario("tunnel", folder)
    return folder


def test_a_clean_drive_ends_with_0_and_plain_text(navfuse, drive):
    code, out, _ = navfuse("inspect", drive / "imu.parquet", drive / "gnss.csv", drive / "odometer.csv")
    assert code == 0
    lines = out.splitlines()
    assert lines[0].startswith(f"{drive / 'imu.parquet'}: imu, Parquet table, increments, 30001 rows")
    assert "between the logs" in lines
    assert not any(line.startswith(("  wrong", "  look")) for line in lines)


def test_a_project_is_inspected_with_its_settings(navfuse, drive, tmp_path):
    text = (drive / "project.toml").read_text().replace('"FRD"', '"FLU"')
    project = tmp_path / "project.toml"
    for name in ("imu.parquet", "gnss.csv"):
        (tmp_path / name).write_bytes((drive / name).read_bytes())
    project.write_text(text)
    code, out, err = navfuse("inspect", project)
    assert code == 1
    assert 'the project says axes = "FLU"' in out
    assert 'set imu.axes = "FRD"' in err


def test_what_is_certainly_wrong_ends_with_1_and_the_message_at_the_end(navfuse, drive, tmp_path):
    imu = read_columns(drive / "imu.parquet")
    degrees(imu, {})
    write_table(tmp_path / "imu.parquet", imu)
    code, out, err = navfuse("inspect", tmp_path / "imu.parquet")
    assert code == 1
    assert "  wrong        gyro unit" in out
    assert err.startswith("error: ")
    assert "dtheta_x_deg" in err


def test_json_holds_every_finding(navfuse, drive):
    code, out, _ = navfuse("inspect", drive / "gnss.csv", "--json")
    found = json.loads(out)
    assert code == 0
    assert found["files"][0]["role"] == "gnss"
    checks = {one["check"]: one for one in found["files"][0]["findings"]}
    assert checks["rate"]["figures"]["rate_hz"] == pytest.approx(1.0)
    assert {one["verdict"] for one in checks.values()} <= {"ok", "look", "wrong", "cannot tell"}


def test_a_draft_is_a_project_with_reasons(navfuse, drive, tmp_path):
    draft = tmp_path / "new.toml"
    code, _, _ = navfuse("inspect", drive / "imu.parquet", drive / "gnss.csv", "--draft", draft)
    assert code == 0
    project = tomllib.loads(draft.read_text())
    assert project["imu"]["axes"] == "FRD"
    assert project["imu"]["file"] == (drive / "imu.parquet").as_posix()
    assert abs(project["imu"]["time_offset_s"]) < 0.05
    assert project["gnss"]["lever_arm_m"] == [0.0, 0.0, 0.0]
    lines = draft.read_text().splitlines()
    for k, line in enumerate(lines):
        if " = " in line and not line.startswith(("#", "file")):
            assert lines[k - 1].startswith("# "), line


def test_a_draft_replaces_nothing(navfuse, drive, tmp_path):
    draft = tmp_path / "mine.toml"
    draft.write_text("[imu]\n")
    code, _, err = navfuse("inspect", drive / "imu.parquet", "--draft", draft)
    assert code == 1
    assert "is there already" in err
    assert draft.read_text() == "[imu]\n"


def test_a_draft_needs_an_inertial_log(navfuse, drive, tmp_path):
    code, _, err = navfuse("inspect", drive / "gnss.csv", "--draft", tmp_path / "new.toml")
    assert code == 1
    assert "no draft without an inertial log" in err


def test_no_file_is_wrong_usage(navfuse):
    assert navfuse("inspect")[0] == 2
