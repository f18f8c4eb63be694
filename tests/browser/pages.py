"""The other pages that navfuse writes, made by the commands that write them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from navfuse.cli.app import main
from navfuse.config.toml_text import toml_value
from navfuse.demo import simulate_drive, write_logs


def allan(folder: Path) -> Path:
    """Ten minutes of a cheap sensor at rest, with two kinds of deviation."""
    rng = np.random.default_rng(0)
    gyro = 0.4 * rng.standard_normal((30_000, 3)) + 1e-3 * np.cumsum(rng.standard_normal((30_000, 3)), axis=0)
    accel = 1e-3 * rng.standard_normal((30_000, 3)) + [0.0, 0.0, -1.0]
    np.savez(folder / "log.npz", gyro_degps=gyro, accel_g=accel, rate_hz=50.0)
    _command("allan", folder / "log.npz", "-o", folder / "out", "--kind", "oadev,hdev", "--grid", "5", "-q")
    return folder / "out" / "allan.html"


def comparison(folder: Path) -> Path:
    """Two estimators on the demonstration's drive, against its truth."""
    logs, lever = simulate_drive(1)
    write_logs(folder, logs)
    text = '[imu]\nfile = "imu.parquet"\ngrade = "industrial-mems"\n[gnss]\nfile = "gnss.csv"\n'
    text += f"lever_arm_m = {toml_value(lever)}\n"
    (folder / "project.toml").write_text(text, encoding="utf-8")
    arguments = ("--estimators", "ekf,iekf", "--truth", folder / "truth.parquet", "-o", folder / "out", "-q")
    _command("compare-filters", folder / "project.toml", *arguments)
    return folder / "out" / "comparison.html"


PAGES: dict[str, Callable[[Path], Path]] = {"allan": allan, "comparison": comparison}


def write_page(name: str, folder: Path, page: Path) -> None:
    """Make a page in a folder of its own and put it in its place."""
    shutil.copyfile(PAGES[name](folder), page)


def _command(*arguments: object) -> None:
    with pytest.raises(SystemExit) as ending:
        main([str(argument) for argument in arguments])
    assert not ending.value.code
