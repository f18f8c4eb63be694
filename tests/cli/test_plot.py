from __future__ import annotations

from dataclasses import replace

import pytest

from navfuse.io.result_folder import write_result
from navfuse.io.trajectory_table import write_trajectory


@pytest.fixture
def folder(result, tmp_path):
    place = tmp_path / "run"
    place.mkdir()
    write_result(place, replace(result, summary={"measurements": {}}))
    write_trajectory(tmp_path / "truth.parquet", result.forward)
    return place


def test_named_figures_in_several_formats(navfuse, folder, tmp_path):
    target = tmp_path / "paper"
    looks = ("--size", "single", "--dpi", 50, "--skip-s", 1, "--format", "png,svg", "-o", target)
    truth = tmp_path / "truth.parquet"
    code, out, err = navfuse("plot", folder, "--what", "map,error_cdf", "--truth", truth, *looks)
    assert (code, err) == (0, "")
    assert out == f"4 files in {target}: map.png, map.svg, error_cdf.png, error_cdf.svg\n"
    assert sorted(path.name for path in target.iterdir()) == ["error_cdf.png", "error_cdf.svg", "map.png", "map.svg"]


def test_all_leaves_out_what_there_is_not(navfuse, folder):
    code, out, err = navfuse("plot", folder, "--dpi", 40)
    assert (code, err) == (0, "")
    notes = out.splitlines()
    assert "left out errors: needs a truth to compare with; give --truth FILE" in notes
    assert any(note.startswith("left out separation: this run has no smoother") for note in notes)
    assert (
        notes[-1] == f"5 files in {folder / 'figures'}: map.png, position.png, velocity.png, attitude.png, sigmas.png"
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--what", "errors"), "error: errors: needs a truth to compare with; give --truth FILE\n"),
        (("--what", "erorrs"), "error: no figure 'erorrs'; did you mean errors?; there are map, "),
        (("--format", "jpg"), "error: format 'jpg' has to be one of png, pdf, svg"),
        (("--size", "tiny"), "error: size 'tiny' has to be single, double, slide or WIDTHxHEIGHT in millimetres"),
        (("--truth", "none.csv"), "error: none.csv: "),
    ],
)
def test_one_message(navfuse, folder, arguments, message):
    code, out, err = navfuse("plot", folder, *arguments)
    assert (code, out) == (1, "")
    assert err.startswith(message)
    assert not (folder / "figures").exists()


def test_no_folder_of_a_run(navfuse, tmp_path):
    code, _, err = navfuse("plot", tmp_path)
    assert (code, err.startswith(f"error: {tmp_path}: no forward.parquet or forward.csv in this folder")) == (1, True)
