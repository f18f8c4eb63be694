from __future__ import annotations

import json
import re

import numpy as np
import pytest

COLUMNS = "time_s,lat_deg,lon_deg,height_m"


def write(path, offset_m: float, sd: bool = False, gap: bool = False):
    """An epoch per second northwards at 10 m/s; `offset_m` too far down."""
    header = COLUMNS + (",sd_north_m,sd_east_m,sd_down_m" if sd else "")
    time = [t for t in np.arange(0.0, 60.0) if not (gap and 20 < t < 30)]
    rows = [f"{t},{45.0 + t * 9e-5:.12f},11.0,{100.0 - offset_m}" + (",1,1,1" if sd else "") for t in time]
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


@pytest.fixture
def truth(tmp_path):
    return write(tmp_path / "truth.csv", 0.0)


def test_table(navfuse, tmp_path, truth):
    code, out, err = navfuse("compare", write(tmp_path / "solution.csv", 2.0, sd=True), truth)
    assert (code, err) == (0, "")
    assert "solution.csv against" in out.replace("\n", " ")
    assert "60 epochs" in out.replace("\n", " ")
    row = next(line.split() for line in out.splitlines() if "position down" in line)
    assert row == ["position", "down", "m", *["2.0000"] * 7]
    assert re.search(r"position: 100\.00 % within the claimed 3 sigma, \(error / sigma\)\^2 = 1\.33 on average", out)


def test_json(navfuse, tmp_path, truth):
    solution = write(tmp_path / "solution.csv", 2.0)
    code, out, _ = navfuse("compare", solution, truth, "--skip-s", 10, "--until-s", 30, "--json")
    found = json.loads(out)
    assert code == 0
    assert (found["start_s"], found["end_s"], found["epochs"]) == (10.0, 29.0, 20)
    assert found["errors"]["position_down_m"]["rms"] == pytest.approx(2.0, abs=1e-6)


def test_gaps_are_told(navfuse, tmp_path, truth):
    _, out, _ = navfuse("compare", write(tmp_path / "solution.csv", 0.0, gap=True), truth)
    assert "9 epochs of the truth fall in gaps of the solution" in out


def test_a_result_folder_stands_for_its_best_trajectory(navfuse, tmp_path, truth):
    folder = tmp_path / "out"
    folder.mkdir()
    code, _, err = navfuse("compare", folder, truth)
    assert code == 1
    assert err.startswith(f"error: {folder}: no trajectory in this folder; looked for smoothed.parquet")
    write(folder / "forward.csv", 3.0)
    _, out, _ = navfuse("compare", folder, truth, "--json")
    assert json.loads(out)["errors"]["position_down_m"]["rms"] == pytest.approx(3.0, abs=1e-6)
    write(folder / "smoothed.csv", 1.0)
    _, out, _ = navfuse("compare", folder, truth, "--json")
    assert json.loads(out)["errors"]["position_down_m"]["rms"] == pytest.approx(1.0, abs=1e-6)


def test_a_file_that_is_not_there(navfuse, tmp_path, truth):
    code, out, err = navfuse("compare", tmp_path / "none.csv", truth)
    assert (code, out) == (1, "")
    assert err.startswith("error: ")
    assert "none.csv" in err
