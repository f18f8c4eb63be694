from __future__ import annotations

import tomllib

import numpy as np
import pytest

from navfuse.config.imu_section import imu_section, model_of_file
from navfuse.errors import ConfigError
from navfuse.imu.error_model import DATASHEET_UNITS, ImuErrorModel
from navfuse.imu.grades import grade


@pytest.mark.parametrize("name", ["tactical", "industrial-mems", "navigation"])
def test_what_is_written_is_read_back(name, tmp_path):
    path = tmp_path / "imu.toml"
    path.write_text(imu_section(grade(name), ["a remark"]))
    assert "# a remark" in path.read_text()
    found = model_of_file(path)
    for field in {field for field, _ in DATASHEET_UNITS.values()}:
        assert getattr(found, field) == pytest.approx(getattr(grade(name), field), rel=1e-3), field


def test_axes_that_differ_are_written_as_three():
    text = imu_section(ImuErrorModel(gyro_bias_sd=np.array([1.0, 2.0, 3.0]) * 1e-5), fields=["gyro_bias_sd"])
    keys = tomllib.loads(text)["imu"]
    assert list(keys) == ["gyro_bias_sd_dph"]
    assert keys["gyro_bias_sd_dph"] == pytest.approx([2.063, 4.125, 6.188])


def test_everything_is_written_by_default_and_nothing_if_nothing_is_known():
    keys = tomllib.loads(imu_section(ImuErrorModel()))["imu"]
    assert keys["gyro_bias_walk_dph_per_sqrt_h"] == 0.0
    assert keys["arw_deg_per_sqrt_h"] == 0.0
    assert imu_section(ImuErrorModel(), fields=[]) == "[imu]\n"


def test_a_comment_of_several_lines_stays_a_comment():
    text = imu_section(grade("tactical"), ["from a\nb = 1\r\n[c]\u2028d = 2\x1b[0m\x00\udc80.npz"], ["arw"])
    assert list(tomllib.loads(text)) == ["imu"]
    assert list(tomllib.loads(text)["imu"]) == ["arw_deg_per_sqrt_h"]
    assert "# b = 1\n# [c]\n# d = 2?[0m??.npz\n" in text
    assert text.encode()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "cannot be read: No such file"),
        ("[imu", "is not TOML"),
        ("[gnss]\n", r"has no table \[imu\]"),
        ("[imu]\narw = 1.0\n", "arw"),
    ],
)
def test_files_that_hold_no_model(tmp_path, content, message):
    path = tmp_path / "imu.toml"
    if content is not None:
        path.write_text(content)
    with pytest.raises(ConfigError, match=message):
        model_of_file(path)
