from __future__ import annotations

import tomllib

import numpy as np
import pytest

from navfuse.config.imu_section import model_of_file
from navfuse.imu.error_model import DATASHEET_UNITS
from navfuse.imu.grades import grade


def test_data_sheet_to_settings(navfuse):
    code, out, err = navfuse("noise", "--gyro-noise", "0.005 deg/s/sqrt(Hz)", "--gyro-bias", "6 deg/h", "--tau", "1 h")
    assert (code, err) == (0, "")
    assert "# gyro: N = 0.005 deg/s/sqrt(Hz) = 0.3 deg/sqrt(h)" in out
    assert tomllib.loads(out)["imu"] == {
        "arw_deg_per_sqrt_h": 0.3,
        "gyro_bias_sd_dph": 9.718,
        "gyro_bias_tau_s": 3600.0,
    }


def test_a_line_break_in_a_figure_leaves_valid_toml(navfuse):
    code, out, _ = navfuse("noise", "--gyro-noise", "0.3\ndeg/sqrt(h)")
    assert code == 0
    assert tomllib.loads(out)["imu"] == {"arw_deg_per_sqrt_h": 0.3}


@pytest.mark.parametrize(
    ("options", "keys"),
    [
        (["--gyro-noise", "0.3 deg/sqrt(h)"], {"arw_deg_per_sqrt_h"}),
        (["--accel-walk", "60 ug/sqrt(h)"], {"accel_bias_walk_mg_per_sqrt_h"}),
        (["--gyro-turn-on", "0.2 deg/s"], {"gyro_bias_sd_dph"}),
        (["--gyro-bias", "6 deg/h"], {"gyro_bias_sd_dph", "gyro_bias_tau_s"}),
        (
            ["--accel-bias", "40 ug", "--accel-turn-on", "2 mg"],
            {"accel_bias_sd_mg", "accel_bias_tau_s", "accel_bias_walk_mg_per_sqrt_h"},
        ),
    ],
)
def test_what_no_figure_was_given_for_stays_with_the_grade(navfuse, tmp_path, options, keys):
    code, out, _ = navfuse("noise", *options)
    assert code == 0
    assert set(tomllib.loads(out)["imu"]) == keys
    assert ("in-run only" in out) == (options[0] == "--gyro-bias")
    (tmp_path / "imu.toml").write_text(out + 'grade = "industrial-mems"\n')
    model, preset = model_of_file(tmp_path / "imu.toml"), grade("industrial-mems")
    given = {DATASHEET_UNITS[key][0] for key in keys}
    for field in {"arw", "vrw", "gyro_bias_sd", "accel_bias_sd"} - given:
        assert np.all(getattr(model, field) == getattr(preset, field))
        assert np.all(getattr(model, field) > 0.0)


def test_settings_to_data_sheet(navfuse, tmp_path):
    _, out, _ = navfuse("noise", "--gyro-noise", "0.3 deg/sqrt(h)", "--accel-noise", "0.06 m/s/sqrt(h)")
    (tmp_path / "imu.toml").write_text(out)
    code, out, _ = navfuse("noise", "--from", tmp_path / "imu.toml", "--bandwidth", "50 Hz")
    assert code == 0
    assert "0.3 deg/sqrt(h) = 0.005 deg/s/sqrt(Hz)" in out
    assert "accel rms noise in 50 Hz" in out
    code, out, _ = navfuse("noise", "--grade", "navigation")
    assert code == 0
    assert "gyro in-run bias stability" in out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "give figures of a data sheet"),
        (["--grade", "tactical", "--gyro-noise", "1 deg/sqrt(h)"], "give figures of a data sheet"),
        (["--grade", "tactical", "--one-sided"], "leave them out with --from and --grade"),
        (["--grade", "tactical", "--digits", "0"], "digits = 0 must be 1 to 17"),
        (["--gyro-noise", "1 deg/sqrt(h)", "--digits", "18"], "digits = 18 must be 1 to 17"),
        (["--gyro-noise", "1 deg/sqrt(h)", "--bandwidth", "50 Hz"], "--bandwidth is for an rms noise"),
        (["--grade", "tactial"], "did you mean 'tactical'"),
        (["--gyro-noise", "1 deg/sqrt(parsec)"], "unknown unit 'parsec'"),
        (["--gyro-bias", "1e308 deg/s"], "--gyro-bias = '1e308 deg/s' is beyond any sensor"),
        (["--accel-noise", "1e308 g/sqrt(Hz)"], "is beyond any sensor"),
        (["--gyro-noise", "1e-400 deg/s/sqrt(Hz)"], "--gyro-noise = '1e-400 deg/s/sqrt(Hz)' is too small a number"),
        (["--accel-noise", "0.05e-320 ug/sqrt(Hz)"], "is too small a number for any sensor; check number and unit"),
        (["--gyro-noise", "0.1 deg/s"], "needs --bandwidth"),
        (["--gyro-noise", "0.1 deg/s", "--bandwidth", "3 s"], "'s' is a unit of time; wanted is frequency"),
        (["--gyro-bias", "1 deg/h", "--tau", "5"], "the unit is missing"),
        (["--grade", "tactical", "--bandwidth", "10 Hz", "--order", "9"], "order = 9 must be one of"),
    ],
)
def test_one_clear_message(navfuse, options, message):
    code, out, err = navfuse("noise", *options)
    assert (code, out) == (1, "")
    assert err.startswith("error: ")
    assert message in err


def test_all_digits(navfuse, tmp_path):
    _, out, _ = navfuse("noise", "--gyro-noise", "0.3 deg/sqrt(h)", "--accel-noise", "123.456789012345 ug/sqrt(Hz)",
                        "--digits", "17")  # fmt: skip
    (tmp_path / "imu.toml").write_text(out)
    code, out, _ = navfuse("noise", "--from", tmp_path / "imu.toml", "--digits", "14")
    assert code == 0
    assert "0.3 deg/sqrt(h) = 0.005 deg/s/sqrt(Hz)" in out
    assert "= 123.45678901234 ug/sqrt(Hz)" in out or "= 123.45678901235 ug/sqrt(Hz)" in out
