"""Settings that somebody wrote down, held against the logs."""

from __future__ import annotations

import numpy as np
import pytest

import navfuse
from navfuse.inspection.clock_checks import check_offset
from navfuse.inspection.declared import Declared
from navfuse.inspection.findings import Verdict
from navfuse.io.gnss_table import read_gnss
from navfuse.io.imu_table import read_imu


def project(folder, city, imu="", gnss=""):
    path = folder / "project.toml"
    path.write_text(
        f'[imu]\nfile = "{city / "imu.parquet"}"\naxes = "FRD"\n{imu}\n[gnss]\nfile = "{city / "gnss.csv"}"\n{gnss}\n'
    )
    return path


def test_a_stated_offset_that_the_logs_contradict_is_wrong(city, tmp_path):
    finding = navfuse.inspect(project(tmp_path, city, "time_offset_s = 0.5")).pair("time offset")
    assert finding.verdict is Verdict.WRONG
    assert "the project says imu.time_offset_s = 0.5" in finding.message
    assert finding.settings["imu.time_offset_s"] == pytest.approx(0.0, abs=0.05)


def test_a_default_that_the_logs_contradict_is_worth_a_look(city, city_tables, tmp_path):
    from tests.inspection.damages import late, write

    imu, gnss = (dict(columns) for columns in city_tables)
    late(imu, gnss)
    write(tmp_path, imu, gnss)
    assert navfuse.inspect(project(tmp_path, tmp_path)).pair("time offset").verdict is Verdict.LOOK


def test_a_stated_lever_arm_that_cannot_be(city, tmp_path):
    found = navfuse.inspect(project(tmp_path, city, gnss="lever_arm_m = [192.0, 0.0, 0.0]"))
    assert found.pair("lever arm").verdict is Verdict.WRONG


def test_a_lever_arm_that_the_turns_contradict_beyond_doubt_is_wrong():
    from navfuse.imu.lever_arm import LeverArm
    from navfuse.inspection.pair_checks import check_lever_arm

    fitted = LeverArm(np.array([0.5, 0.1, 0.0]), np.array([0.1, 0.1, 10.0]))
    arm = np.array([4.0, 0.0, -1.0])
    assert check_lever_arm(Declared(True, frozenset({"gnss.lever_arm_m"}), lever_arm=arm), fitted).verdict is (
        Verdict.WRONG
    )
    assert check_lever_arm(Declared(True, lever_arm=arm), fitted).verdict is Verdict.LOOK


def test_positions_and_velocities_that_disagree_widen_what_is_stated(shared_data):
    """The receiver's velocities of this drive lag: neither offset is known better than half of their distance."""
    folder = shared_data / "rtklibexplorer-drive"
    imu, gnss = read_imu(folder / "imu.parquet", axes="BRU"), read_gnss(folder / "gnss.csv")
    finding = check_offset(imu, gnss, 0.0, None, Declared()).finding
    assert finding.verdict is Verdict.LOOK
    assert finding.figures["sd_s"] > 0.05
