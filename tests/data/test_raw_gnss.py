from __future__ import annotations

import numpy as np

from navfuse.data.raw_gnss import RawGnssLog


def log(**more):
    time = np.array([1.0, 1.0, 1.0, 2.5, 4.0, 4.0])
    sat = np.arange(18.0).reshape(6, 3) * 1e6 + 2e7
    return RawGnssLog(time, np.array(["G01", "G02", "G03", "G02", "G01", "G02"]), time + 2e7, time, sat, **more)


def test_epochs_are_runs_of_equal_stamps():
    time, first = log().epochs()
    assert time.tolist() == [1.0, 2.5, 4.0]
    assert first.tolist() == [0, 3, 4, 6]
    assert len(log()) == 6
    time, first = log().take(slice(0, 0)).epochs()
    assert time.size == 0
    assert first.tolist() == [0]


def test_picked_rows_keep_what_is_no_array():
    some = log(corrected=False, cn0=np.arange(6.0), notes=("said",)).take(np.array([4, 0]))
    assert some.satellite.tolist() == ["G01", "G01"]
    assert some.sat_r_e[:, 0].tolist() == [3.2e7, 2e7]
    assert some.cn0.tolist() == [4.0, 0.0]
    assert some.range_rate is None
    assert not some.corrected
    assert some.notes == ("said",)


def test_columns_are_those_that_there_are():
    assert list(log().columns()) == [
        "time_s", "satellite", "pseudorange_m", "sd_pseudorange_m", "sat_x_m", "sat_y_m", "sat_z_m", "corrected",
    ]  # fmt: skip
    more = np.linspace(0.1, 1.0, 6)
    whole = log(
        range_rate=more, sd_range_rate=more, sat_v_e=np.ones((6, 3)), elevation=more, azimuth=more, cn0=more
    ).columns()
    assert list(whole) == [
        "time_s", "satellite", "pseudorange_m", "sd_pseudorange_m", "range_rate_mps", "sd_range_rate_mps",
        "sat_x_m", "sat_y_m", "sat_z_m", "sat_vx_mps", "sat_vy_mps", "sat_vz_mps", "elevation_deg", "azimuth_deg",
        "cn0_dbhz", "corrected",
    ]  # fmt: skip
    np.testing.assert_array_equal(whole["elevation_deg"], np.degrees(more))
    assert whole["corrected"].tolist() == [1] * 6
