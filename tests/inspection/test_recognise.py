"""Files of all kinds, and those that are none."""

from __future__ import annotations

import numpy as np
import pytest
from tests.inspection.damages import accels, gyros

import navfuse
from navfuse.errors import ConfigError, InputError
from navfuse.inspection.findings import Verdict
from navfuse.io.tables import write_table


def verdicts(report, verdict):
    return [one.text for one in report.findings if one.verdict is verdict]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "empty"),
        ("1,2,3\n4,5,6\n", "column names"),
        ("time_s,lat_deg,lon_deg,height_m\n0,48,11,500\n", "1 row"),
        (
            "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n0,0,0,0,0,0,9.8\n",
            "1 row",
        ),
        ("time_s,lat_deg,lon_deg,height_m\n0,48,11,5,00\n", "cells"),
    ],
    ids=["empty", "no names", "one fix", "one row", "comma decimals"],
)
def test_a_broken_table_is_wrong_and_raises_nothing(text, word, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(text)
    (report,) = navfuse.inspect(path).files
    assert word in " ".join(verdicts(report, Verdict.WRONG))


def test_a_missing_file_is_wrong(tmp_path):
    (report,) = navfuse.inspect(tmp_path / "nothing.csv").files
    assert verdicts(report, Verdict.WRONG) == ["there is no such file"]


@pytest.mark.parametrize(
    ("name", "head", "word"),
    [
        ("rover.obs", b"     3.04           OBSERVATION DATA    M                   RINEX VERSION / TYPE\n", "RINEX"),
        ("log.ubx", b"\xb5b\x01\x07", "UBX"),
        ("log.nmea", b"$GPGGA,1,2\n", "NMEA"),
        ("notes.md", b"hello", "cannot tell the format"),
    ],
)
def test_a_format_that_is_not_read_is_named(name, head, word, tmp_path):
    path = tmp_path / name
    path.write_bytes(head)
    (report,) = navfuse.inspect(path).files
    assert word in verdicts(report, Verdict.UNKNOWN)[0]


def test_names_of_other_programs_are_understood_and_renamed(city_tables, tmp_path):
    imu = dict(city_tables[0])
    step = np.diff(imu["time_s"], prepend=-0.01)
    rates = {name: imu[name] / step for name in (*gyros(imu), *accels(imu))}
    rates |= {name: rates[name] / 9.80665 for name in accels(imu)}
    renamed = {f"{'gyr' if k < 3 else 'acc'}_{'xyz'[k % 3]}": values for k, values in enumerate(rates.values())}
    write_table(tmp_path / "log.csv", {"timestamp": imu["time_s"]} | renamed)
    (report,) = navfuse.inspect(tmp_path / "log.csv").files
    assert report.role == "imu"
    told = report.finding("column names")
    assert told.verdict is Verdict.WRONG
    for pair in ("'timestamp' to 'time_s'", "'gyr_x' to 'gyro_x_radps'", "'acc_z' to 'accel_z_g'"):
        assert pair in told.remedy


def test_semicolons_and_decimal_commas_are_read(tmp_path):
    rows = [f"{k},0;48,000{k % 10};11,5;500,25" for k in range(60)]
    (tmp_path / "gnss.csv").write_text("time_s;lat_deg;lon_deg;height_m\n" + "\n".join(rows) + "\n")
    (report,) = navfuse.inspect(tmp_path / "gnss.csv").files
    assert report.finding("rate").figures["rate_hz"] == pytest.approx(1.0)
    assert verdicts(report, Verdict.WRONG) == []


def test_a_static_record_is_judged(shared_data):
    (report,) = navfuse.inspect(shared_data / "adis16405-static" / "adis_16405_imu1.npz").files
    assert report.role == "imu"
    assert verdicts(report, Verdict.LOOK) == verdicts(report, Verdict.WRONG) == []
    assert report.finding("rate").figures["rate_hz"] == pytest.approx(100.0)
    assert "up is -z" in report.finding("axes").message


def test_fixes_at_rest_five_minutes_apart_are_no_milliseconds(shared_data):
    folder = shared_data / "instinct" / "GNSS" / "Spirent-SimGEN_static_duration-4h_rate-5min_sys-GERCQI"
    (report,) = navfuse.inspect(folder / "Iono-none_tropo-none" / "Septentrio-PolaRx5T_G.pos").files
    assert verdicts(report, Verdict.LOOK) == verdicts(report, Verdict.WRONG) == []


def test_nothing_and_two_projects_are_refused(tmp_path):
    with pytest.raises(InputError, match="no file to inspect"):
        navfuse.inspect([])
    with pytest.raises(ConfigError, match="second project"):
        navfuse.inspect([tmp_path / "a.toml", tmp_path / "b.toml"])
