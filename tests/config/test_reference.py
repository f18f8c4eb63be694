from __future__ import annotations

import re
import tomllib

import pytest

from navfuse.config import Project, help_keys, template
from navfuse.config.toml_text import toml_value, type_words

UNITS = {
    "deg_per_sqrt_h": "deg/sqrt(h)",
    "mps_per_sqrt_h": "m/s/sqrt(h)",
    "dph_per_sqrt_h": "deg/h/sqrt(h)",
    "mg_per_sqrt_h": "1e-3 g/sqrt(h)",
    "dph": "deg/h",
    "deg": "deg",
    "mg": "1e-3 g",
    "mps": "m/s",
    "mrad": "mrad",
    "ppm": "ppm",
    "hz": "Hz",
    "week_s": "week, s",
    "s": "s",
    "m": "m",
}
COMMENTED = re.findall(r"^#(\w+) = (.*)$", template(), flags=re.MULTILINE)


def test_template_is_the_default_project():
    files = {"imu": {"file": "imu.parquet"}, "gnss": {"file": "gnss.csv"}}
    assert Project.from_dict(tomllib.loads(template())) == Project.from_dict(files)


def test_template_names_every_key():
    named = {
        f"{section}.{key}" for section, text in sections() for key in re.findall(r"^#?(\w+) = ", text, re.MULTILINE)
    }
    assert named == {entry.key for entry in help_keys()}


def sections() -> list[tuple[str, str]]:
    parts = re.split(r"^\[(\w+)\]$", template(), flags=re.MULTILINE)
    return list(zip(parts[1::2], parts[2::2], strict=True))


@pytest.mark.parametrize(("key", "value"), COMMENTED, ids=[key for key, _ in COMMENTED])
def test_each_commented_key_can_be_uncommented(key, value):
    text = template().replace(f"\n#{key} = {value}", f"\n{key} = {value}")
    if key in ("lat_deg", "lon_deg", "height_m", "sd_position_m"):
        text = re.sub(r"^#(lat_deg|lon_deg|height_m) =", r"\1 =", text, flags=re.MULTILINE)
    elif key == "sd_velocity_mps":
        text = text.replace("#velocity_mps =", "velocity_mps =")
    elif key == "sd_attitude_deg":
        text = text.replace("#heading_deg =", "heading_deg =")
    elif key.startswith("ukf_"):
        text = re.sub(r'^#?estimator = "ekf"', 'estimator = "ukf"', text, flags=re.MULTILINE)
    settings = Project.from_dict(tomllib.loads(text)).settings()
    assert any(key in table and toml_value(table[key]) == value for table in settings.values())


def test_every_key_is_explained():
    for entry in help_keys():
        assert entry.description.endswith("."), entry.key
        assert entry.type
        if entry.default not in ("", "required"):
            tomllib.loads(f"value = {entry.default}")


def test_units_are_those_in_the_key_names():
    for entry in help_keys():
        suffix = next((name for name in UNITS if entry.key.endswith(f"_{name}")), None)
        assert entry.unit == (UNITS[suffix] if suffix else ""), entry.key


def test_help_tells_range_type_and_default():
    by_key = {entry.key: entry for entry in help_keys()}
    assert by_key["imu.file"].default == "required"
    assert by_key["start.lat_deg"].type == "number, >= -90 and <= 90"
    assert by_key["start.lat_deg"].default == ""
    assert by_key["gnss.outages_s"].type == "list of lists of 2 numbers"
    assert by_key["imu.gyro_bias_sd_dph"].type == "number or list of 3 numbers, >= 0"
    assert by_key["smoother.method"][2:4] == ('"rts" or "none"', '"rts"')


@pytest.mark.parametrize(
    "value", [True, False, 3, 0.1, float("inf"), 'quote " and \\ and é', ["a", "b"], [[1.0, 2.0], [3.0, 4.0]], []]
)
def test_toml_values_read_back(value):
    assert tomllib.loads(f"value = {toml_value(value)}")["value"] == value


def test_values_toml_does_not_have_are_shown_as_python_does():
    assert toml_value(None) == "None"


def test_types_in_words():
    assert type_words(int) == "whole number"
    assert type_words(tuple[int, float]) == "list of whole number, number"
    assert type_words(bytes) == "bytes"
    assert type_words(tuple[str, ...]) == "list of texts"
