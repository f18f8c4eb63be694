"""What an operator's day brings: every kind of bad input, through the command line, to one message or a repair."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from replay.job import navfuse

GYRO = ["gyro_x_radps", "gyro_y_radps", "gyro_z_radps"]
ACCEL = ["accel_x_mps2", "accel_y_mps2", "accel_z_mps2"]
SD = ["sd_north_m", "sd_east_m", "sd_down_m"]
VELOCITY = ["vn_mps", "ve_mps", "vd_mps", "sd_vn_mps", "sd_ve_mps", "sd_vd_mps"]
IMU_FILES = ("imu.parquet", "imu.csv")


def with_imu_file(job, name):
    job.imu_name = name
    return job.set("imu", file=name)


def test_a_sound_project(job):
    """The tests below spoil this one."""
    done = job.done()
    assert done.outcome.err == ""
    assert done.counts()["used"] == len(job.gnss) == 241
    assert done.measurements()["verdict"] == "consistent"


@pytest.mark.parametrize("name", IMU_FILES)
def test_imu_column_missing(job, name):
    job.imu = job.imu.drop(columns="gyro_y_radps")
    message = with_imu_file(job, name).refused("gyro_y_radps", name)
    assert "missing" in message


def test_gnss_column_missing(job):
    job.gnss = job.gnss.drop(columns="height_m")
    job.refused("gnss.csv", "height_m", "missing")


def test_a_misspelt_required_column_is_named_beside_the_right_one(job):
    job.gnss = job.gnss.rename(columns={"height_m": "heigth_m"})
    job.refused("gnss.csv", "height_m", "heigth_m")


def test_an_unknown_column_is_ignored_with_a_warning(job):
    job.imu["temperature_c"] = 20.0
    job.done("temperature_c")


@pytest.mark.parametrize(
    ("table", "column", "wrong"),
    [
        ("imu", "gyro_x_radps", "gyro_x_rads"),
        ("imu", "accel_z_mps2", "accel_z_ms2"),
        ("gnss", "height_m", "height_ell"),
    ],
)
def test_unknown_unit(job, table, column, wrong):
    setattr(job, table, getattr(job, table).rename(columns={column: wrong}))
    message = job.refused(wrong)
    assert "unit" in message


def test_known_units_are_converted(job):
    sound = job.done().trajectory()
    job.imu[[name.replace("radps", "degps") for name in GYRO]] = np.degrees(job.imu[GYRO])
    job.imu[[name.replace("mps2", "g") for name in ACCEL]] = job.imu[ACCEL] / 9.80665
    job.imu = job.imu.drop(columns=[*GYRO, *ACCEL])
    done = job.done()
    assert done.outcome.err == ""
    np.testing.assert_allclose(done.trajectory().lat, sound.lat, atol=1e-12)


@pytest.mark.parametrize("name", ["imu.parquet", "imu.csv", "gnss.csv", "gnss.parquet", "gnss.pos"])
def test_empty_file(job, name):
    path = job.write()
    job.set(name[:3] if name.startswith("imu") else "gnss", file=name)
    (job.folder / name).write_bytes(b"")
    refused_as_written(job, path, name, "empty")


@pytest.mark.parametrize("table", ["imu", "gnss"])
@pytest.mark.parametrize("extension", ["csv", "parquet"])
def test_header_only(job, table, extension):
    setattr(job, table, getattr(job, table).iloc[:0])
    setattr(job, f"{table}_name", f"{table}.{extension}")
    message = job.set(table, file=f"{table}.{extension}").refused(f"{table}.{extension}")
    assert "no rows" in message


@pytest.mark.parametrize("share", [0.01, 0.5, 0.99])
@pytest.mark.parametrize("table", ["imu", "gnss"])
def test_truncated_parquet(job, table, share):
    setattr(job, f"{table}_name", f"{table}.parquet")
    path = job.set(table, file=f"{table}.parquet").write()
    whole = (job.folder / f"{table}.parquet").read_bytes()
    (job.folder / f"{table}.parquet").write_bytes(whole[: int(share * len(whole))])
    refused_as_written(job, path, f"{table}.parquet", "truncated or damaged", "again")


def test_a_damaged_page_of_parquet(job):
    path = job.write()
    whole = bytearray((job.folder / "imu.parquet").read_bytes())
    whole[1000:1400] = bytes(400)
    (job.folder / "imu.parquet").write_bytes(whole)
    refused_as_written(job, path, "imu.parquet", "truncated or damaged")


def test_truncated_csv(job):
    path = with_imu_file(job, "imu.csv").write()
    text = (job.folder / "imu.csv").read_text()
    (job.folder / "imu.csv").write_text(text[: len(text) // 2 - 7])
    outcome = run_as_written(path)
    assert outcome.code == 0, outcome.err
    assert "imu.csv" in outcome.err


def test_a_word_among_the_numbers(job):
    path = job.write()
    lines = (job.folder / "gnss.csv").read_text().splitlines()
    cells = lines[10].split(",")
    cells[3] = "n/a!"
    lines[10] = ",".join(cells)
    (job.folder / "gnss.csv").write_text("\n".join(lines))
    refused_as_written(job, path, "gnss.csv", "line 11", "height_m", "n/a!")


@pytest.mark.parametrize("table", ["imu", "gnss"])
def test_a_log_that_does_not_exist(job, table):
    file = {"imu": "imu.parquett", "gnss": "data/gnss.csv"}[table]
    job.set(table, file=file).refused(file, "no such file")


def test_a_project_that_does_not_exist(tmp_path):
    code, out, err = navfuse("run", tmp_path / "none.toml", "-o", tmp_path / "out")
    assert (code, out) == (1, "")
    assert err.startswith(f"error: {tmp_path / 'none.toml'}: no such project file")
    assert not (tmp_path / "out").exists()


def test_the_two_files_exchanged(job):
    job.write()
    job.set("imu", file="gnss.csv").set("gnss", file="imu.parquet").refused("gnss.csv", "gyro_x_radps", "lat_deg")
    job.set("imu", file="imu.parquet").refused("imu.parquet", "lat_deg", "gyro_x_radps")


def run_as_written(path):
    return navfuse("run", path, "-o", path.parent / "out", "--no-report")


def refused_as_written(job, path, *words):
    """As Job.refused, for logs that were spoilt after writing."""
    job.write_project()
    outcome = run_as_written(path)
    assert outcome.code == 1, outcome.out + outcome.err
    assert outcome.out == ""
    assert outcome.err.startswith("error: ")
    assert outcome.err.count("\n") == 1
    for word in words:
        assert word in outcome.err
    assert not job.output.exists()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e12])
@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_isolated_bad_imu_rows_are_repaired(make_job, kind, value):
    job = make_job(kind)
    sound = job.done().trajectory("smoothed")
    column = job.imu.columns[6]
    for row in (700, 3000, 3001, 8000):
        job.imu.loc[row, column] = value
    done = job.done("imu.parquet: 4 rows with NaN, infinite or absurd values were")
    assert "the first is row 701" in done.outcome.err
    solution = done.trajectory("smoothed")
    assert np.abs(solution.height - sound.height).max() < 0.02
    assert np.abs(solution.velocity_n - sound.velocity_n).max() < 0.01


def test_too_many_bad_imu_rows(job):
    job.imu.loc[::50, "accel_x_mps2"] = np.nan
    job.refused("imu.parquet", "241 of 12001 rows", "row 1", "1 % or more")


def test_a_run_of_bad_imu_rows(job):
    job.imu.loc[5000:5010, "accel_x_mps2"] = np.nan
    job.refused("imu.parquet", "11 rows in succession from row 5001 on")


def test_a_line_of_a_csv_is_named_as_an_editor_counts(job):
    job.imu.loc[5000:5010, "accel_x_mps2"] = np.nan
    with_imu_file(job, "imu.csv").refused("imu.csv", "line 5002")


@pytest.mark.parametrize("column", ["lat_deg", "height_m", "time_s"])
def test_fixes_without_a_position_are_left_out(job, column):
    job.gnss.loc[[30, 31, 90], column] = np.nan
    done = job.done("gnss.csv: 3 of 241 rows hold no position")
    assert "the first is row 31 (line 32)" in done.outcome.err
    assert done.counts()["used"] == 238


def test_fixes_without_a_velocity_keep_their_position(job):
    job.gnss.loc[100:149, "ve_mps"] = np.nan
    done = job.done()
    assert done.counts()["used"] == 241
    assert done.counts("gnss_velocity")["used"] == 191


def test_mostly_without_a_position(job):
    job.gnss.loc[50:, "lat_deg"] = np.nan
    job.refused("gnss.csv", "191 of 241 rows hold no position", "line 52")


@pytest.mark.parametrize("value", [0.0, -1.0])
def test_a_sigma_that_is_not_positive(job, value):
    job.gnss.loc[17, "sd_east_m"] = value
    job.refused("gnss.csv", "line 19", "sd_east_m", "standard deviation")


def test_all_sigmas_zero(job):
    job.gnss[SD] = 0.0
    job.refused("gnss.csv", "line 2", "sd_north_m", "241 rows", "remove the columns")


def test_sigmas_missing(job):
    job.gnss = job.gnss.drop(columns=SD)
    done = job.done("'sd_north_m' is missing: assumed", "'sd_down_m' is missing: assumed")
    assert done.counts()["used"] == 241


def test_a_sigma_is_empty_here_and_there(job):
    job.gnss.loc[[5, 6], "sd_down_m"] = np.nan
    done = job.done("'sd_down_m' is empty in 2 rows: assumed")
    assert done.counts()["used"] == 241


def test_latitude_out_of_range(job):
    job.gnss.loc[40, "lat_deg"] = 91.5
    job.refused("gnss.csv", "line 42", "lat_deg", "91.5", "-90..90")


def test_latitude_and_longitude_exchanged(job):
    job.gnss["lon_deg"] += 100.0
    job.gnss = job.gnss.rename(columns={"lat_deg": "lon_deg", "lon_deg": "lat_deg"})
    job.refused("gnss.csv", "lat_deg", "exchanged")


@pytest.mark.parametrize("velocity", [True, False])
def test_radians_in_degree_columns(job, velocity):
    job.gnss[["lat_deg", "lon_deg"]] = np.radians(job.gnss[["lat_deg", "lon_deg"]])
    if not velocity:
        job.gnss = job.gnss.drop(columns=VELOCITY)
    job.refused("gnss.csv", "lat_deg", "radians", "lat_rad")


def test_g_in_a_column_of_mps2(job):
    job.imu[ACCEL] /= 9.80665
    job.refused("imu.parquet", "accel_x_mps2", "accel_x_g")


def test_degrees_per_second_in_a_column_of_radps(job):
    job.imu[GYRO] = np.degrees(job.imu[GYRO])
    job.refused("imu.parquet", "gyro_x_radps", "gyro_x_degps")


def test_degrees_in_increments_of_radians(make_job):
    job = make_job("increments")
    names = [f"dtheta_{axis}_rad" for axis in "xyz"]
    job.imu[names] = np.degrees(job.imu[names])
    job.refused("imu.parquet", "dtheta_x_rad", "dtheta_x_deg")


def test_rates_called_increments(job):
    names = dict(zip(job.imu.columns[1:], job_names("increments"), strict=True))
    job.imu = job.imu.rename(columns=names)
    job.refused("imu.parquet", "dvel_x_mps", "accel_x_mps2")


def test_increments_called_rates(make_job):
    job = make_job("increments")
    job.imu = job.imu.rename(columns=dict(zip(job.imu.columns[1:], job_names("rates"), strict=True)))
    job.refused("imu.parquet", "accel_x_mps2", "dvel_x_mps")


def job_names(kind):
    if kind == "rates":
        return [*GYRO, *ACCEL]
    return [*(f"dtheta_{axis}_rad" for axis in "xyz"), *(f"dvel_{axis}_mps" for axis in "xyz")]


def test_milliseconds_in_a_column_of_seconds(job):
    job.imu["time_s"] *= 1e3
    job.refused("imu.parquet", "time_s", "_ms")


@pytest.mark.parametrize("table", ["imu", "gnss"])
def test_rows_out_of_order_are_sorted(job, table):
    sound = job.done().trajectory()
    rows = getattr(job, table)
    order = np.arange(len(rows))
    order[[100, 101]] = order[[101, 100]]
    setattr(job, table, rows.iloc[order].reset_index(drop=True))
    done = job.done("1 rows are out of order")
    np.testing.assert_array_equal(done.trajectory().lat, sound.lat)


@pytest.mark.parametrize("table", ["imu", "gnss"])
def test_repeated_rows_are_removed(job, table):
    sound = job.done().trajectory()
    rows = getattr(job, table)
    setattr(job, table, pd.concat([rows.iloc[:101], rows.iloc[100:]]))
    done = job.done("1 rows repeat a time stamp")
    np.testing.assert_array_equal(done.trajectory().lat, sound.lat)


def test_two_logs_joined(job):
    job.imu = pd.concat([job.imu, job.imu])
    job.refused("imu.parquet", "time_s", "12000 rows are out of order", "row 12002", "two logs joined")


def test_the_week_rolls_over(job):
    job.gnss["time_s"] = (job.gnss["time_s"] + 604740.0) % 604800.0
    job.imu["time_s"] = (job.imu["time_s"] + 604740.0) % 604800.0
    job.refused("imu.parquet", "time_s", "does not increase", "week")


@pytest.mark.parametrize("table", ["imu", "gnss"])
def test_time_stands_still(job, table):
    getattr(job, table)["time_s"] = 5.0
    job.refused("time_s", "repeat a time stamp")


@pytest.mark.parametrize(
    ("shift", "words"),
    [
        (1000.0, ("do not overlap", "0.000 to 120.000 s", "time_offset_s")),
        (-604800.0, ("no time in common", "from 0 to 120 s", "imu.time_offset_s = -604800", "1 week")),
    ],
)
def test_no_overlap(job, shift, words):
    job.gnss["time_s"] += shift
    job.refused(*words)


def test_a_time_offset_brings_them_together(job):
    job.gnss["time_s"] += 1000.0
    assert job.set("gnss", time_offset_s=-1000.0).done().outcome.err == ""


@pytest.mark.parametrize(("count", "code"), [(1, 1), (2, 0), (5, 0)])
def test_few_fixes(job, count, code):
    job.gnss = job.gnss.iloc[60 : 60 + count]
    outcome = job.run()
    assert outcome.code == code, outcome.err
    assert ("1 usable fix" in outcome.err) == (count == 1)
