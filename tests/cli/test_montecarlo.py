from __future__ import annotations

import json

import pytest

QUICK = ("--duration", 20, "--imu-rate", 20, "--jobs", 1, "--runs", 3, "--no-scale")


def test_a_campaign(navfuse, tmp_path):
    code, out, err = navfuse("montecarlo", "car", "-o", tmp_path / "mc", *QUICK, "--frame", "ecef", "--seed", 5)
    assert (code, err) == (0, "")
    assert out.startswith("filter, 3 of 3 runs: ")
    assert out.rstrip().endswith("nees.png")
    found = json.loads((tmp_path / "mc" / "summary.json").read_text(encoding="utf-8"))
    assert (found["recipe"]["frame"], found["recipe"]["grade"]) == ("ecef", "industrial-mems")
    assert (found["runs"]["first_seed"], found["speed"]["jobs"]) == (5, 1)
    assert "smoother" not in found


def test_options_reach_the_recipe(navfuse, tmp_path):
    options = ("--grade", "tactical", "--smooth", "--gnss-sd-factor", 0.5, "--imu-noise-factor", 2, "--gnss-rate", 2)
    code, out, _ = navfuse("montecarlo", "static", "-o", tmp_path, *QUICK, *options, "--settle", 5, "-q")
    assert (code, out) == (0, "")
    found = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    chosen = found["recipe"]
    assert (chosen["name"], chosen["grade"], chosen["smooth"]) == ("static", "tactical", True)
    assert (chosen["gnss_sd_factor"], chosen["imu_noise_factor"], chosen["gnss_rate"]) == (0.5, 2.0, 2.0)
    assert found["smoother"]["settle_s"] == 5.0


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("helicopter",), 1, "error: unknown scenario 'helicopter'"),
        (("car", "--grade", "cheap"), 1, "error: unknown IMU grade 'cheap'"),
        (("car", "--duration", -3), 1, "error: duration must be positive and finite, not -3.0"),
        (("car", "--settle", 120), 1, "error: the beginning that is not judged"),
        (("car", "--runs", 0), 2, "--runs"),
        (("car", "--frame", "enu"), 2, "--frame"),
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
    code, out, err = navfuse("montecarlo", "car", "-o", tmp_path, *QUICK)
    assert (code, err.strip()) == (130, "interrupted")
    assert out.startswith("filter, 2 of 3 runs (interrupted): ")
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["runs"]["interrupted"]
