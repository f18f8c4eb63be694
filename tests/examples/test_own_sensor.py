"""The example of a user's own sensor does what its text says."""

from __future__ import annotations

import runpy
from pathlib import Path

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_sensor.py"


def test_the_radar_helps_in_the_outage(capsys):
    run = runpy.run_path(str(EXAMPLE))["run"]
    without, with_radar = run(False)[1], run(True)[1]
    assert with_radar < 0.7 * without
    assert "jacobian agrees with central differences of predict" in capsys.readouterr().out


def test_the_sensor_takes_about_twenty_lines():
    text = EXAMPLE.read_text(encoding="utf-8")
    body = text[text.index("class RadarSpeed") : text.index("def run(")]
    assert sum(bool(line.strip()) for line in body.splitlines()) <= 20
