"""Figures as files: whole or not at all, the same bytes every time, text as text, one message where it cannot be."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import navfuse
from navfuse.data.result import StateHistory
from navfuse.errors import ConfigError, InputError, NavfuseWarning
from navfuse.io.result_folder import write_result
from navfuse.io.trajectory_table import write_trajectory
from navfuse.report.figures import FIGURES, FigureUnavailable


@pytest.fixture
def folder(drive, tmp_path):
    place = tmp_path / "run"
    place.mkdir()
    write_result(place, drive[0])
    write_trajectory(tmp_path / "truth.csv", drive[1])
    return place


def test_the_same_bytes_twice_in_every_format(drive, tmp_path):
    kinds = ("png", "pdf", "svg")
    for place in ("a", "b"):
        navfuse.plot(drive[0], "map,residuals", folder=tmp_path / place, formats=kinds, truth=drive[1], dpi=80)
    for name in ("map", "residuals"):
        for kind in kinds:
            first, second = ((tmp_path / place / f"{name}.{kind}").read_bytes() for place in ("a", "b"))
            assert first == second, (name, kind)
    pdf = (tmp_path / "a" / "map.pdf").read_bytes()
    assert b"CreationDate" not in pdf
    assert b"/FontFile2" in pdf
    assert b"/Type3" not in pdf
    svg = (tmp_path / "a" / "map.svg").read_text()
    assert re.search(r"<text[^>]*>east of the start \[m\]</text>", svg)
    assert "<dc:date>" not in svg


@pytest.mark.slow
def test_all_of_a_folder(folder, tmp_path):
    done = navfuse.plot(folder, truth=tmp_path / "truth.csv", dpi=40)
    assert done.skipped.keys() == {"satellites", "imu_rate", "spectra"}
    assert done.skipped["imu_rate"].startswith("this result has no overview of the IMU")
    assert [path.name for path in done.files] == [f"{name}.png" for name in FIGURES if name not in done.skipped]
    assert all(path.parent == folder / "figures" and path.stat().st_size for path in done.files)


def test_a_folder_of_a_run(folder, tmp_path):
    done = navfuse.plot(folder, "error_cdf,residuals", truth=tmp_path / "truth.csv", dpi=40)
    assert done == ((folder / "figures" / "error_cdf.png", folder / "figures" / "residuals.png"), {})
    navfuse.plot(folder, ["residuals"], dpi=40)
    assert (folder / "figures" / "error_cdf.png").is_file()


def test_without_a_figure_nothing_is_written(folder):
    with pytest.raises(FigureUnavailable, match="errors: needs a truth"):
        navfuse.plot(folder, "map,errors", dpi=40)
    assert not (folder / "figures").exists()


def test_a_dense_cloud_is_a_picture_in_a_vector_file(make_drive, tmp_path):
    result, _ = make_drive(duration_s=1700.0, rate_hz=1.0)
    navfuse.plot(result, "innovations", folder=tmp_path, formats="svg,pdf", dpi=100)
    svg = (tmp_path / "innovations.svg").read_text()
    assert "<image" in svg
    assert "<text" in svg
    assert len(svg) < 1_000_000
    assert (tmp_path / "innovations.pdf").stat().st_size < 300_000


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"what": "mapp"}, "no figure 'mapp'; did you mean map"),
        ({"formats": "pgn"}, "format 'pgn' has to be one of png, pdf, svg; did you mean png"),
        ({"size": "huge"}, "size 'huge' has to be"),
        ({"size": "25x20", "what": "errors"}, "errors: 25 x 20 mm is too small for its panels; give a larger size"),
        ({"dpi": 5}, "dpi = 5 is out of the range 30 to 2400"),
        ({"size": "2000x2000", "dpi": 2400}, "map: 188976 x 188976 pixels are too many; give a smaller size or dpi"),
        ({"skip_s": float("nan")}, "skip_s = nan has to be a time of zero or more seconds"),
        ({"time": "gps"}, "time 'gps': the GPS time of this run is not known"),
    ],
)
def test_options_that_cannot_be(drive, tmp_path, options, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        navfuse.plot(drive[0], **({"what": "map", "truth": drive[1], "folder": tmp_path / "f"} | options))
    assert not (tmp_path / "f").exists()


def test_a_result_has_no_folder_of_its_own(drive):
    with pytest.raises(ConfigError, match="plot: give the folder to write to"):
        navfuse.plot(drive[0], "map")


def test_what_is_no_run_is_said(tmp_path):
    with pytest.raises(InputError, match="is not there; give the folder that `navfuse run -o` wrote"):
        navfuse.plot(tmp_path / "none", "map")


def test_letters_without_a_glyph_are_told(drive, tmp_path):
    own = {"传感器": StateHistory(drive[0].forward.time, np.zeros((len(drive[0].forward), 1)), np.ones((1201, 1)))}
    with pytest.warns(NavfuseWarning, match="states: some letters of a name are not in the font DejaVu Sans"):
        navfuse.plot(replace(drive[0], states=own), "states", folder=tmp_path, dpi=40)
