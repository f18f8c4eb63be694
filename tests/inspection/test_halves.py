"""A clock that drifts: how fast, and nothing of a clock that is only late."""

from __future__ import annotations

from dataclasses import replace

import pytest

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


def test_axes_that_stay_and_logs_that_are_too_short(logs):
    imu, gnss = logs
    parts = halves(imu, gnss)
    assert parts is not None
    assert check_change(parts) is None
    assert halves(imu, gnss.take(gnss.time < gnss.time[0] + 100.0)) is None
