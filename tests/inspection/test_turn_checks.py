"""Gyros of an aeroplane that banks see less of its turns, and nothing is wrong with them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from navfuse.inspection.findings import Verdict
from navfuse.inspection.turn_checks import check_turns
from navfuse.io.gnss_table import read_gnss
from navfuse.io.imu_table import read_imu
from navfuse.scenario_files import simulate_scenario


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight")
    simulate_scenario("aircraft-300s", folder)
    return read_imu(folder / "imu.parquet", axes="FRD"), read_gnss(folder / "gnss.csv")


def test_a_bank_is_no_scale(flight):
    finding, _ = check_turns(*flight)
    assert finding.verdict is Verdict.OK
    assert finding.figures["ratio"] < 0.85
    assert finding.figures["scale"] == pytest.approx(1.0, abs=4.0 * finding.figures["scale_sd"])


@pytest.mark.parametrize("scale", [0.85, 1.2])
def test_a_scale_of_the_gyros_is_told_through_the_bank(flight, scale):
    imu, gnss = flight
    finding, _ = check_turns(replace(imu, gyro=scale * imu.gyro), gnss)
    assert finding.verdict is Verdict.LOOK
    assert finding.figures["scale"] == pytest.approx(scale, rel=0.02)
