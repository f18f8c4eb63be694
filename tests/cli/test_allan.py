from __future__ import annotations

import json
import math
import tomllib

import numpy as np
import pytest

from navfuse.analysis.allan.terms import Term
from navfuse.config.imu_section import model_of_file
from navfuse.imu.grades import grade
from navfuse.report.allan_tables import term_dict

RATE, G = 50.0, 9.80665


@pytest.fixture
def log(tmp_path):
    """Ten minutes at rest, quantised and as noisy as a cheap sensor."""
    rng = np.random.default_rng(0)
    n = 30_000
    gyro = np.degrees(1e-3) * rng.standard_normal((n, 3)) * np.sqrt(RATE)
    gyro += 1e-3 * np.cumsum(rng.standard_normal((n, 3)), axis=0)
    accel = 1e-3 * rng.standard_normal((n, 3)) + [0.0, 0.0, -1.0]
    path = tmp_path / "log.npz"
    np.savez(path, gyro_degps=gyro, accel_g=accel, rate_hz=RATE)
    return path


def test_table(navfuse, log):
    code, out, err = navfuse("allan", log, "--grid", "octave", "-q")
    assert (code, out, err) == (0, "", "")
    code, out, err = navfuse("allan", log, "--grid", "octave")
    assert (code, err) == (0, "")
    assert "at rest from 0 to 600 s" in out
    assert "angle random walk" in out
    assert "deg/s/sqrt(Hz)" in out
    assert "not seen" in out
    assert "0.664 B" in out
    assert "(95 %)" in out


def test_everything_is_written(navfuse, log, tmp_path):
    folder = tmp_path / "out"
    code, out, _ = navfuse("allan", log, "-o", folder, "--kind", "oadev,hdev", "--grid", "5")
    assert code == 0
    assert "allan.json, allan.png, allan.html, imu.toml, oadev.csv, hdev.csv" in out
    assert sorted(path.name for path in folder.iterdir()) == [
        "allan.html", "allan.json", "allan.png", "hdev.csv", "imu.toml", "oadev.csv",
    ]  # fmt: skip
    assert (folder / "allan.png").read_bytes()[:4] == b"\x89PNG"
    page = (folder / "allan.html").read_text(encoding="utf-8")
    assert "src=" not in page.split("<script>")[0]
    assert "default-src 'none'" in page
    found = json.loads((folder / "allan.json").read_text())
    term = found["axes"]["gyro_x"]["terms"]["N"]
    assert term["value_degps_per_sqrt_hz"] == pytest.approx(np.degrees(1e-3), rel=0.02)
    assert 0.0 < term["sigma_degps_per_sqrt_hz"] < 0.01 * term["value_degps_per_sqrt_hz"]
    assert found["axes"]["gyro_x"]["terms"]["K"]["present"]
    absent = found["axes"]["accel_x"]["terms"]["K"]
    assert absent["below_probability"] in (0.95, 0.999)
    assert absent["contradicted"] is False
    assert 0.0 < absent["below_ug_per_sqrt_h"] < math.inf
    curve = found["axes"]["accel_z"]["deviations"]["hdev"]
    assert len(curve["tau_s"]) == len(curve["low_ug"]) == len(curve["edf"])
    assert (folder / "oadev.csv").read_text().startswith("tau_s,gyro_x_deviation_dph,gyro_x_low_dph")
    model = model_of_file(folder / "imu.toml")
    assert found["imu"] == tomllib.loads((folder / "imu.toml").read_text())["imu"]
    bias = found["bias_models"]["gyro"]
    walk = bias["random_walk"]["walk_dph_per_sqrt_h"]
    assert bias["shape"] in ("random walk", "Gauss-Markov process")
    assert len(bias["sd_dph"]) == len(walk) == 3
    assert found["imu"]["gyro_bias_walk_dph_per_sqrt_h"] == pytest.approx(walk, rel=1e-3)
    assert bias["fitted_s"][0] < bias["fitted_s"][1] <= 600.0
    assert bias["relative_error"] > 0.0
    assert bias["random_walk"]["relative_error"] > 0.0
    assert found["axes"]["gyro_x"]["resolution_dph"] is None
    assert found["axes"]["gyro_x"]["used_for_imu"] is True
    assert model.arw == pytest.approx(1e-3, rel=0.02)


def test_a_term_that_the_deviation_contradicts_says_so():
    entry = term_dict(Term("B", False, limit=math.radians(1.0) / 3600.0, limit_level=0.999, contradicted=True), "gyro")
    assert entry["contradicted"] is True
    assert entry["below_probability"] == 0.999
    assert entry["below_dph"] == pytest.approx(1.0)
    assert not any("95" in key for key in entry)


def test_the_log_is_never_replaced_and_no_table_of_an_earlier_run_stays(navfuse, log, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    for name in ("oadev.csv", "hdev.csv"):
        (folder / name).write_text("time_s,gyro_x_dph\n0,1\n")
        code, out, err = navfuse("allan", folder / name, "-o", folder)
        assert (code, out) == (1, "")
        assert f"{name} is read by this run and would be replaced by it" in err
        assert (folder / name).read_text() == "time_s,gyro_x_dph\n0,1\n"
    (folder / "notes.csv").write_text("mine")
    code, _, _ = navfuse("allan", log, "-o", folder, "-q", "--grid", "octave", "--accel", "accel_g")
    assert code == 0
    assert sorted(path.name for path in folder.glob("*.csv")) == ["notes.csv", "oadev.csv"]


def test_json_and_settings_on_standard_output(navfuse, log):
    code, out, _ = navfuse("allan", log, "--json", "--grid", "octave", "--gyro", "gyro_degps", "--terms", "N,K,sin")
    assert code == 0
    assert json.loads(out)["axes"]["gyro_y"]["terms"]["sin"]["present"] is False
    assert json.loads(out)["bias_models"]["accel"] is None
    code, out, err = navfuse("allan", log, "--config", "--grid", "octave", "--gyro-turn-on", "0.2 deg/s")
    keys = tomllib.loads(out)["imu"]
    assert code == 0
    assert min(np.atleast_1d(keys["gyro_bias_sd_dph"])) > 720.0
    assert keys["gyro_bias_tau_s"] == float("inf")
    assert "accel_bias_sd: left to the grade" in out
    assert not any(key.startswith("accel_bias") for key in keys)
    assert err.count("the bias at switch-on is not in a record at rest") == 1
    assert "with --accel-turn-on" in err
    assert "--gyro-turn-on" not in err


def test_without_a_turn_on_figure_the_bias_starts_as_the_grade_says(navfuse, log, tmp_path):
    code, out, err = navfuse("allan", log, "--config", "--grid", "octave")
    assert code == 0
    assert err.count("warning:") == 1
    assert "--gyro-turn-on and --accel-turn-on" in err
    keys = tomllib.loads(out)["imu"]
    assert set(keys) == {"arw_deg_per_sqrt_h", "vrw_mps_per_sqrt_h", "gyro_bias_walk_dph_per_sqrt_h"}
    assert min(np.atleast_1d(keys["gyro_bias_walk_dph_per_sqrt_h"])) > 0.0
    (tmp_path / "imu.toml").write_text(out + 'grade = "consumer"\n')
    model, preset = model_of_file(tmp_path / "imu.toml"), grade("consumer")
    assert np.all(model.gyro_bias_sd == preset.gyro_bias_sd)
    assert np.all(model.accel_bias_sd == preset.accel_bias_sd)
    assert model.accel_bias_tau == preset.accel_bias_tau
    code, out, err = navfuse(
        "allan", log, "--config", "--grid", "octave", "--gyro-turn-on", "0.2 deg/s", "--accel-turn-on", "16 mg"
    )
    assert (code, err) == (0, "")
    assert tomllib.loads(out)["imu"]["accel_bias_sd_mg"] == 16.0


def test_a_line_break_in_the_path_leaves_valid_toml(navfuse, log):
    odd = log.rename(log.with_name("a\narw = 1.npz"))
    code, out, _ = navfuse("allan", odd, "--gyro", "gyro_degps", "--config", "--grid", "octave")
    assert code == 0
    assert all(key.startswith(("arw_deg_per", "gyro_bias")) for key in tomllib.loads(out)["imu"])


def test_one_sensor_alone(navfuse, log):
    code, out, _ = navfuse("allan", log, "--accel", "accel_g", "--config", "--grid", "octave")
    assert code == 0
    assert "arw" not in tomllib.loads(out)["imu"]
    assert "gyro" not in "".join(tomllib.loads(out)["imu"])


def test_warnings_reach_the_terminal(navfuse, tmp_path):
    values = np.random.default_rng(1).standard_normal((5000, 3))
    values[100:300, 0] = 0.5
    np.savez(tmp_path / "log.npz", gyro_dph=values, rate_hz=10.0)
    code, _, err = navfuse("allan", tmp_path / "log.npz", "-q", "--grid", "octave")
    assert code == 0
    assert "warning:" in err
    assert "warning: log.npz: gyro x repeats one value 200 times" in err
    assert str(tmp_path) not in err


def test_a_folder_that_cannot_be_written_is_told_before_the_work(navfuse, log, tmp_path):
    (tmp_path / "file").write_text("mine")
    for folder in (tmp_path / "file", tmp_path / "file" / "out"):
        code, out, err = navfuse("allan", log, "-o", folder, "-q")
        assert (code, out) == (1, "")
        assert err.startswith("error: ")
        assert err.count("\n") == 1
    assert (tmp_path / "file").read_text() == "mine"


def test_an_error_leaves_nothing_behind(navfuse, log, tmp_path):
    before = sorted(tmp_path.iterdir())
    code, _, _ = navfuse("allan", log, "-o", tmp_path / "out", "-q", "--longest-s", "500")
    assert code == 1
    assert sorted(tmp_path.iterdir()) == before


def test_a_rate_beside_unused_time_stamps(navfuse, tmp_path):
    values = np.random.default_rng(4).standard_normal((2000, 3))
    np.savetxt(tmp_path / "log.txt", np.column_stack([np.arange(2000) / 100.0, values]))
    options = ["--gyro", "2,3,4", "--gyro-unit", "deg/h", "--grid", "octave", "-q"]
    code, _, err = navfuse("allan", tmp_path / "log.txt", *options, "--rate", "50")
    assert code == 0
    assert "warning: log.txt: column '1' rises steadily by 0.01, as time stamps in seconds at 100 Hz do" in err
    code, out, err = navfuse("allan", tmp_path / "log.txt", *options, "--rate", "50", "--time", "1")
    assert (code, out) == (1, "")
    assert "--rate 50 Hz contradicts the time stamps, whose steps make 100 Hz" in err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--config", "--json"], "--config and --json both print"),
        (["--rate", "100"], "--rate 100 Hz contradicts the file"),
        (["--gyro-turn-on", "3 mg"], "'mg' is a unit of acceleration; wanted is angular rate"),
        (["--accel-turn-on", "-3 mg"], "must not be negative"),
        (["--kind", "avar"], "unknown deviation avar"),
        (["--grid", "fine"], "give octave, decade, all, or a number"),
        (["--terms", "Z"], "noise terms Z: known are Q, N"),
        (["--gyro", "w"], "no column 'w' for --gyro"),
        (["--gyro", "gyro_degps", "--gyro-unit", "furlong"], "unknown unit 'furlong'"),
        (["--from-s", "700"], "is not in the record, which is 600 s long"),
        (["--until-s", "2"], "100 samples are too short a record"),
        (["--accel-turn-on", "1e308 g"], "is beyond any sensor"),
        (["--until-s", "inf"], "until_s = inf must be a finite number"),
        (["--from-s", "1e308"], "is not in the record"),
        (["--longest-s", "nan"], "longest = nan must be a finite number of seconds > 0"),
        (["--longest-s", "0"], "longest = 0.0 must be a finite number of seconds > 0"),
        (["--longest-s", "0.001"], "shorter than the sampling interval, 0.02 s"),
        (["--horizon-s", "inf"], "horizon = inf must be"),
        (["--longest-s", "500"], "needs a record of twice that"),
        (["--horizon-s", "0"], "horizon = 0.0 must be"),
    ],
)
def test_one_clear_message(navfuse, log, options, message):
    code, out, err = navfuse("allan", log, "-q", *options)
    assert (code, out) == (1, "")
    assert err.startswith("error: ")
    assert message in err
    assert err.count("\n") == 1


def test_bad_logs(navfuse, tmp_path):
    rng = np.random.default_rng(2)
    moving = rng.standard_normal((20_000, 3)) * 0.1 + 20.0 * np.sin(np.arange(20_000) / 300.0)[:, None]
    cases = {
        "moving": (moving, "Allan variance needs a sensor at rest"),
        "constant": (np.zeros((5000, 3)), "gyro x is constant"),
        "nan": (np.full((5000, 3), np.nan), "gyro x (column 'gyro_degps') has no number in any of its 5000 rows"),
        "short": (rng.standard_normal((50, 3)), "50 samples are too short a record"),
    }
    for name, (values, message) in cases.items():
        np.savez(tmp_path / f"{name}.npz", gyro_degps=values, rate_hz=100.0)
        code, _, err = navfuse("allan", tmp_path / f"{name}.npz", "-q")
        assert code == 1, name
        assert message in err
    code, _, err = navfuse("allan", tmp_path / "none.csv")
    assert code == 1
    assert "there is no such file" in err


@pytest.mark.parametrize("rate", ["1e-300", "1e300"])
def test_a_rate_of_no_sensor(navfuse, tmp_path, rate):
    np.savez(tmp_path / "log.npz", gyro_dph=np.random.default_rng(3).standard_normal((2000, 3)))
    code, out, err = navfuse("allan", tmp_path / "log.npz", "-q", "--rate", rate)
    assert (code, out) == (1, "")
    assert "Hz is none of a sensor" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("content", [b"", b"\x00" * 300, b"junk" * 100, bytes(range(256)) * 4])
@pytest.mark.parametrize("extension", [".mat", ".npz"])
def test_a_file_of_arrays_that_is_none(navfuse, tmp_path, extension, content):
    path = tmp_path / f"log{extension}"
    path.write_bytes(content)
    code, out, err = navfuse("allan", path, "-q", "--gyro", "w", "--gyro-unit", "deg/s", "--rate", "100")
    assert (code, out) == (1, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1


def test_a_damaged_mat_file(navfuse, tmp_path):
    from scipy.io import savemat

    path = tmp_path / "log.mat"
    savemat(path, {"w": np.random.default_rng(3).standard_normal((2000, 3))}, do_compression=True)
    whole = path.read_bytes()
    for damaged in (whole[:2000], whole[:130], whole[:200] + bytes(50) + whole[250:]):
        path.write_bytes(damaged)
        code, _, err = navfuse("allan", path, "-q", "--gyro", "w", "--gyro-unit", "deg/s", "--rate", "100")
        assert code == 1
        assert "not a readable .mat file" in err
        assert err.count("\n") == 1


def test_the_static_record_of_the_manual(navfuse, shared_data):
    path = shared_data / "adis16405-static" / "adis_16405_imu1.npz"
    code, out, err = navfuse("allan", path, "--json", "--grid", "octave", "--gyro", "gyro_degps")
    assert code == 0
    assert "no sum of the terms fits the whole spectrum" in err
    axes = json.loads(out)["axes"]
    absent = [term for axis in axes.values() for term in axis["terms"].values() if not term["present"]]
    assert {term["below_probability"] for term in absent} == {0.95}
    for axis in axes.values():
        assert axis["terms"]["N"]["value_degps_per_sqrt_hz"] == pytest.approx(0.04, abs=0.004)
        assert axis["resolution_dph"] == pytest.approx(180.0, rel=1e-3)
        assert axis["terms"]["B"]["floor_degps"] == pytest.approx(0.006, abs=0.003)
