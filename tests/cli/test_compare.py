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


def test_the_page_of_a_bare_trajectory(navfuse, tmp_path, truth):
    solution, page = write(tmp_path / "solution.csv", 2.0, sd=True), tmp_path / "page.html"
    _, plain, _ = navfuse("compare", solution, truth, "--skip-s", 10)
    code, out, err = navfuse("compare", solution, truth, "--skip-s", 10, "--report", page)
    assert (code, out, err) == (0, plain, "")
    text = page.read_text(encoding="utf-8")
    assert "solution.csv against truth.csv" in text
    assert "the first 10 s left out" in text
    assert "True error of the solution" in text
    assert "a trajectory alone holds no measurements" in text
    assert "No GNSS position was used" not in text


def test_the_page_of_a_run(navfuse, tmp_path, truth):
    folder, page = tmp_path / "out", tmp_path / "page.html"
    folder.mkdir()
    write(folder / "forward.csv", 3.0, sd=True)
    write(folder / "smoothed.csv", 1.0, sd=True)
    code, out, _ = navfuse("compare", folder, truth, "-o", page, "--json")
    assert code == 0
    assert json.loads(out)["errors"]["position_down_m"]["rms"] == pytest.approx(1.0, abs=1e-6)
    text = page.read_text(encoding="utf-8")
    for expected in ("True error of the filter", "True error of the smoother", "Filter minus smoother: position"):
        assert expected in text


def test_a_report_never_replaces_what_it_is_made_of(navfuse, tmp_path, truth):
    folder = tmp_path / "out"
    folder.mkdir()
    write(folder / "forward.csv", 3.0)
    write(folder / "smoothed.csv", 1.0)
    for page in (truth, folder / "forward.csv", folder / "summary.json"):
        code, out, err = navfuse("compare", folder, truth, "-o", page)
        assert (code, out) == (1, "")
        assert "is a file that the report is made of" in err
    assert truth.read_text().startswith(COLUMNS)


def test_a_report_that_cannot_be_written(navfuse, tmp_path, truth):
    solution = write(tmp_path / "solution.csv", 2.0)
    code, _, err = navfuse("compare", solution, truth, "-o", tmp_path / "none" / "page.html")
    assert code == 1
    assert err.startswith("error: ")
