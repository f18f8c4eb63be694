"""Inertial navigation alone, through the whole pipeline."""

from __future__ import annotations

import json

import numpy as np
import pytest

from navfuse.cli.app import main
from navfuse.demo import simulate_drive, write_logs
from navfuse.pipeline import process


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("inertial")
    write_logs(path, simulate_drive(3)[0])
    truth = simulate_drive(3)[0].truth
    lat, lon = np.degrees(truth.lat[0]), np.degrees(truth.lon[0])
    roll, pitch, heading = np.degrees(truth.attitude[0])
    (path / "project.toml").write_text(
        f'[imu]\nfile = "imu.parquet"\ngrade = "industrial-mems"\n[start]\nlat_deg = {lat}\nlon_deg = {lon}\n'
        f"height_m = {truth.height[0]}\nvelocity_mps = [0.0, 0.0, 0.0]\nroll_deg = {roll}\npitch_deg = {pitch}\n"
        f"heading_deg = {heading}\n"
    )
    return path


def test_process_without_gnss(folder):
    result = process(folder / "project.toml")
    assert len(result.innovations) == 0
    assert result.forward.time[-1] == pytest.approx(120.0)
    assert result.forward.sd_position[-1].max() > 10.0 * result.forward.sd_position[0].max()


def test_run_without_gnss(folder, tmp_path):
    with pytest.raises(SystemExit) as ending:
        main(["run", str(folder / "project.toml"), "-o", str(tmp_path / "out")])
    assert not ending.value.code
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["measurements"] == {}


def test_a_smoother_wants_all_increments():
    from navfuse.aiding import GnssPosition
    from navfuse.data.start import Start
    from navfuse.errors import ConfigError
    from navfuse.filters.ekf import ErrorStateFilter, FilterSettings
    from navfuse.imu.grades import grade
    from navfuse.imu.increments import to_increments
    from navfuse.smoothers.rts import smooth

    logs, _ = simulate_drive(4)
    increments = to_increments(logs.imu)
    t = logs.truth
    start = Start.from_parts(
        0.0, [t.lat[0], t.lon[0], t.height[0]], t.velocity_n[0], t.attitude[0], [1, 1, 2], [0.1] * 3, [0.01, 0.01, 0.05]
    )

    def made():
        return ErrorStateFilter(
            start, grade("industrial-mems"), [GnssPosition(logs.gnss)], FilterSettings(checkpoints=True)
        )

    whole, first, second = made(), made(), made()
    whole.feed(increments)
    first.feed(increments.piece(0, 6050))
    second.restore(first.state())
    second.feed(increments.piece(6050))
    with pytest.raises(ConfigError, match="increments are not those"):
        smooth(second, increments.piece(9000))
    a, b = smooth(whole, increments).trajectory, smooth(second, increments.piece(6050)).trajectory
    tail = a.take(a.time >= b.time[0] - 1e-6)
    np.testing.assert_allclose(tail.lat, b.lat, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(tail.sd_attitude, b.sd_attitude, rtol=1e-6)
