"""The example of the tutorial, on small campaigns."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from navfuse.montecarlo import ScenarioRecipe, montecarlo

FILE = Path(__file__).resolve().parents[2] / "examples" / "choose_an_imu.py"


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location("choose_an_imu", FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_table_and_the_figure(example, tmp_path, capsys):
    for grade in example.GRADES:
        changes = (("imu", "grade", grade), ("imu", "rate_hz", 20.0))
        montecarlo(ScenarioRecipe("tunnel", changes, smooth=True), tmp_path / f"mc-{grade}", 6, jobs=1)
    example.main(tmp_path)
    table = capsys.readouterr().out
    assert all(grade in table for grade in example.GRADES)
    assert (tmp_path / "choose-an-imu.png").read_bytes().startswith(b"\x89PNG")
    drift = {grade: example.figures_of(tmp_path, grade) for grade in example.GRADES}
    assert drift["consumer"]["filter says [m]"] > 2.0 * drift["tactical"]["filter says [m]"]
    for found in drift.values():
        assert found["smoother, worst, rms [m]"] < found["filter says [m]"]
        assert 0.3 < found["filter, rms [m]"] / found["filter says [m]"] < 2.0
