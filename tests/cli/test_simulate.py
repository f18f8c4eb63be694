from __future__ import annotations

import pytest

from navfuse.simulation.scenario import scenario_text

SCENARIO = """\
title = "A short stand"
[motion]
vehicle = "static"
duration_s = 12.0
[imu]
rate_hz = 50.0
grade = "tactical"
[gnss]
position_sd_m = 0.5
[start]
"""


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "stand.toml"
    path.write_text(SCENARIO, encoding="utf-8")
    return path


def test_simulate_says_what_it_wrote_and_what_comes_next(navfuse, tmp_path, scenario):
    code, out, err = navfuse("simulate", scenario, "-o", tmp_path / "out", "--seed", 4)
    assert (code, err) == (0, "")
    assert out.startswith("stand, seed 4: 12 s, 0.00 km")
    assert f"next: navfuse run {tmp_path / 'out' / 'project.toml'}" in out
    assert navfuse("run", tmp_path / "out" / "project.toml", "-o", tmp_path / "run", "-q", "--no-report")[0] == 0


def test_quiet(navfuse, tmp_path, scenario):
    assert navfuse("simulate", scenario, "-o", tmp_path / "out", "-q") == (0, "", "")


def test_scenarios_are_listed_and_printed(navfuse):
    code, out, _ = navfuse("scenarios")
    assert code == 0
    assert "\ncity-car         A car in town\n" in out, out
    code, out, _ = navfuse("scenarios", "boat")
    assert (code, out) == (0, scenario_text("boat"))


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("simulate", "bot", "-o", "x"), 1, "error: there is no scenario 'bot'; did you mean boat?"),
        (("scenarios", "bot"), 1, "error: there is no scenario 'bot'; did you mean boat?"),
        (("simulate", "no/such.toml", "-o", "x"), 1, "error: no/such.toml: no such scenario file"),
        (("simulate", "boat"), 2, "-o"),
        (("simulate", "boat", "-o", "x", "--seed", -1), 2, "--seed"),
    ],
)
def test_bad_use(navfuse, arguments, code, message):
    found, _, err = navfuse(*arguments)
    assert found == code
    assert message in err
    assert "Traceback" not in err
