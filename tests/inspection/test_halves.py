"""A clock that drifts: how fast, and nothing of a clock that is only late."""

from __future__ import annotations

from dataclasses import replace

import pytest

from navfuse.imu.time_offset import estimate_time_offset
from navfuse.inspection.halves import check_change, check_drift, halves
from navfuse.io.gnss_table import read_gnss
from navfuse.io.imu_table import read_imu


@pytest.fixture(scope="module")
def logs(city):
    return read_imu(city / "imu.parquet", axes="FRD"), read_gnss(city / "gnss.csv")


@pytest.mark.parametrize("ppm", [0.0, 1000.0, -600.0])
def test_the_drift_of_a_clock(logs, ppm):
    imu, gnss = logs
    parts = halves(replace(imu, time=0.1 + (1.0 + 1e-6 * ppm) * imu.time), gnss)
    assert parts is not None
    found = check_drift(parts, positions_only=False)
    if ppm == 0.0:
        assert found is None
        return
    assert found is not None
    slope = found.figures["change_sd_s"] / found.figures["change_s"] * ppm
    assert found.figures["drift_ppm"] == pytest.approx(-ppm, abs=4.0 * abs(slope) + 0.01 * abs(ppm))


def test_the_clock_of_the_real_drive_drifts_by_positions_and_by_velocities_alike(shared_data):
    """Two measurements that share nothing but the clock: 0.11 s apart from each other, they drift at one rate."""
    folder = shared_data / "rtklibexplorer-drive"
    imu, gnss = read_imu(folder / "imu.parquet", axes="BRU"), read_gnss(folder / "gnss.csv")
    parts = halves(imu, gnss)
    assert parts is not None
    drift = check_drift(parts, positions_only=True)
    assert drift is not None
    by_velocities = [estimate_time_offset(*part).by_velocities for part in parts]
    change = by_velocities[1] - by_velocities[0]
    assert change == pytest.approx(drift.figures["change_s"], abs=4.0 * drift.figures["change_sd_s"])
    assert drift.figures["drift_ppm"] == pytest.approx(-270.0, abs=60.0)


def test_axes_that_stay_and_logs_that_are_too_short(logs):
    imu, gnss = logs
    parts = halves(imu, gnss)
    assert parts is not None
    assert check_change(parts) is None
    assert halves(imu, gnss.take(gnss.time < gnss.time[0] + 100.0)) is None
