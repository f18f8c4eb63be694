from __future__ import annotations

import json

import pytest

QUICK = ("--duration", 20, "--imu-rate", 20, "--jobs", 1, "--runs", 3, "--no-scale")


def test_a_campaign(navfuse, tmp_path):
    code, out, err = navfuse("montecarlo", "city-car", "-o", tmp_path / "mc", *QUICK, "--frame", "ecef", "--seed", 5)
    assert (code, err) == (0, "")
    assert out.startswith("filter, 3 of 3 runs: ")
    assert out.rstrip().endswith("nees.png")
    found = json.loads((tmp_path / "mc" / "summary.json").read_text(encoding="utf-8"))
    assert (found["recipe"]["frame"], found["recipe"]["scenario"]) == ("ecef", "city-car")
    assert ["imu", "rate_hz", 20.0] in found["recipe"]["changes"]
    assert (found["runs"]["first_seed"], found["speed"]["jobs"]) == (5, 1)
    assert "smoother" not in found


def test_options_reach_the_recipe(navfuse, tmp_path):
    options = ("--grade", "tactical", "--smooth", "--gnss-sd-factor", 0.5, "--imu-noise-factor", 2, "--gnss-rate", 2)
    code, out, _ = navfuse("montecarlo", "tunnel", "-o", tmp_path, *QUICK, *options, "--settle", 5, "-q")
    assert (code, out) == (0, "")
    found = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    chosen = found["recipe"]
    assert (chosen["scenario"], chosen["smooth"]) == ("tunnel", True)
    assert (chosen["gnss_sd_factor"], chosen["imu_noise_factor"]) == (0.5, 2.0)
    assert [["imu", "grade", "tactical"], ["gnss", "rate_hz", 2.0]] == [chosen["changes"][k] for k in (0, 2)]
    assert found["smoother"]["settle_s"] == 5.0


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("helicopter",), 1, "error: there is no scenario 'helicopter'; there are aircraft-1hz, "),
        (("city-kar",), 1, "error: there is no scenario 'city-kar'; did you mean city-car?"),
        (("city-car", "--grade", "cheap"), 1, "error: city-car: [imu]: unknown IMU grade 'cheap'"),
        (("city-car", "--duration", -3), 1, "error: city-car: duration_s must be more than 0, not -3.0"),
        (("city-car", "--imu-rate", 0), 1, "error: city-car: [imu]: rate_hz must be more than 0, not 0.0"),
        (("city-car", "--settle", 700), 1, "error: the beginning that is not judged"),
        (("city-car", "--gnss-sd-factor", 0), 1, "error: gnss_sd_factor must be positive and finite, not 0.0"),
        (("city-car", "--runs", 0), 2, "--runs"),
        (("city-car", "--frame", "enu"), 2, "--frame"),
        (("missing.toml",), 1, "error: missing.toml: no such scenario file"),
    ],
)
def test_bad_use(navfuse, tmp_path, arguments, code, message):
    found, _, err = navfuse("montecarlo", *arguments, "-o", tmp_path / "out")
    assert found == code
    assert message in err
    assert "Traceback" not in err
    assert not (tmp_path / "out").exists()


def test_ctrl_c_keeps_the_finished_runs(navfuse, tmp_path, monkeypatch):
    from navfuse.montecarlo import campaign

    run_seeds = campaign._run_seeds

    def interrupted(recipe, seeds):
        if seeds[0] == 2:
            raise KeyboardInterrupt
        return run_seeds(recipe, seeds)

    monkeypatch.setattr(campaign, "_run_seeds", interrupted)
    code, out, err = navfuse("montecarlo", "city-car", "-o", tmp_path, *QUICK)
    assert (code, err.strip()) == (130, "interrupted")
    assert out.startswith("filter, 2 of 3 runs (interrupted): ")
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["runs"]["interrupted"]
