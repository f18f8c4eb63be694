from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory


@pytest.fixture
def result() -> Result:
    """A short level drive north."""
    time = np.arange(5.0)
    still = np.zeros((5, 3))
    lat = np.radians(45.0 + 1e-6 * time)
    return Result(
        forward=Trajectory(
            time, lat, np.full(5, 0.2), np.full(5, 100.0), still, still, still + 1.0, still + 1.0, still + 0.1
        ),
        warnings=("the sky is falling",),
    )


@pytest.fixture
def pipeline(monkeypatch, result) -> ModuleType:
    """Stands in for the pipeline, remembering how it was called."""
    module = ModuleType("navfuse.pipeline")
    module.calls = []

    def run_project(path, folder, *, report=True, progress=None):
        module.calls.append((path, folder, report))
        progress("filter", 0.5)
        progress("filter", 1.0)
        progress("smoother", 1.0)
        return result

    def run_demo(folder, seed):
        module.calls.append((folder, seed))
        return result, ["horizontal error: 0.3 m", f"open {folder}/report.html"]

    module.run_project = run_project
    monkeypatch.setitem(sys.modules, "navfuse.pipeline", module)
    demo = ModuleType("navfuse.demo")
    demo.run_demo = run_demo
    monkeypatch.setitem(sys.modules, "navfuse.demo", demo)
    return module


@pytest.fixture
def project_file(tmp_path) -> Path:
    path = tmp_path / "project.toml"
    path.write_text('[imu]\nfile = "imu.csv"\n[gnss]\nfile = "gnss.csv"\n')
    return path


@pytest.fixture
def navfuse(capsys):
    """Run the program in this process: exit code, standard output, standard error."""
    from navfuse.cli.app import main

    def run(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as ending:
            main([str(argument) for argument in arguments])
        text = capsys.readouterr()
        return ending.value.code or 0, text.out, text.err

    return run
