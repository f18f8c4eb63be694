"""Every fault is found and named by the check that is for it, and nothing is found in clean logs."""

from __future__ import annotations

import pytest
from tests.inspection import damages
from tests.inspection.damages import negated, read_columns, sigmas, write

from navfuse.inspection.findings import Inspection, Verdict
from navfuse.inspection.inspect import inspect

CASES = {
    "degrees": (damages.degrees, "gyro unit", "deg"),
    "g": (damages.g_units, "accelerometer unit", "in g"),
    "FLU": (damages.flu, "axes", "imu.axes"),
    "IMU late": (damages.late, "time offset", "too late"),
    "GNSS late": (damages.gnss_late, "time offset", "too early"),
    "sigmas large": (sigmas(100.0), "position sigmas", "too large"),
    "sigmas small": (sigmas(0.01), "position sigmas", "too small"),
    "stuck": (damages.stuck, "stuck channel", "stays at"),
    "dead": (damages.dead, "stuck channel", "dead or stuck"),
    "places exchanged": (damages.exchanged_places, ("velocity", "position"), "exchanged"),
    "kind": (damages.other_kind, "accelerometer unit", "increments"),
    "rollover": (damages.rollover, "rollover", "604800"),
    "week apart": (damages.week_apart, "overlap", "1 week"),
    "1024 weeks": (damages.weeks_1024, "overlap", "1024"),
    "leap seconds": (damages.leap_seconds, "time offset", "18 s apart"),
    "Unix time": (damages.unix, "overlap", "Unix"),
    "gap": (damages.gap, "gaps", "60"),
    "GNSS gap": (damages.gnss_gap, "gaps", "6"),
    "sensors exchanged": (damages.exchanged_sensors, "columns", "exchanged"),
    "gravity down": (damages.all_negated, "handedness", "all three"),
    "gyro order": (damages.gyro_order, "gyro order", "correct the gyro columns"),
    "heading gyro negated": (negated(2), "handedness", "sign of a gyro"),
    "roll gyro negated": (negated(0), "signs", "gyro x"),
    "pitch gyro negated": (negated(1), "signs", "gyro y"),
    "accelerometer negated": (negated(4), "handedness", "left-handed"),
    "km/h": (damages.speeds_kmph, "velocity", "km/h"),
    "radians": (damages.radians, "position", "radians"),
    "latitude in radians": (damages.latitude_in_radians, "velocity", "held radians"),
    "west positive": (damages.west_positive, "velocity", "longitude"),
    "milliseconds": (damages.milliseconds, "time unit", "milliseconds"),
    "GNSS milliseconds": (damages.gnss_milliseconds, "time unit", "milliseconds"),
    "decreasing": (damages.decreasing, "stamps", "decrease"),
    "NaN": (damages.nan_column, "values", "holds no number"),
    "1 Hz": (damages.every_second, "rate", "slow"),
    "zero sigmas": (damages.zero_sigmas, "position sigmas", "perfect"),
    "clipped": (damages.clipped, "saturation", "clipped"),
    "copied": (damages.twice, "columns", "copy"),
    "gravity subtracted": (damages.gravity_subtracted, "accelerometer unit", "gravity has been taken out"),
    "milli-degrees": (damages.milli_degrees, "gyro unit", "as mdeg/s"),
    "velocities exchanged": (damages.velocities_exchanged, "velocity", "'ve_mps' are exchanged"),
    "shuffled": (damages.shuffled, "stamps", "in no order"),
    "rows twice": (damages.rows_twice, "stamps", "exact duplicates"),
    "weak gyros": (damages.weak_gyros, "turns", "scale is off"),
    "frozen": (damages.frozen, "frozen positions", "does not change at all for"),
    "minutes": (damages.minutes_as_fraction, "velocity", "ddmm.mmmm"),
    "flipped midway": (damages.axis_flipped_midway, "axes change", "first half"),
    "clock drift": (damages.clock_drifts, "clock drift", "ppm"),
}
"""What was done -> who has to find it, and a word of how it is called."""


def told(found: Inspection, checks: str | tuple[str, ...]) -> str:
    """What these checks said that is not fine."""
    checks = (checks,) if isinstance(checks, str) else checks
    return " ".join(
        one.text for one in found.findings if one.check in checks and one.verdict in (Verdict.LOOK, Verdict.WRONG)
    )


def complaints(found: Inspection) -> list[str]:
    return [f"{one.check}: {one.text}" for one in found.findings if one.verdict in (Verdict.LOOK, Verdict.WRONG)]


NOT = {
    "gravity subtracted": ("values in g",),
    "milli-degrees": ("gyro_x_degps ...; check",),
    "velocities exchanged": ("handedness", "turns:", "signs:"),
    "shuffled": ("microseconds", "overlap"),
    "rows twice": ("too coarse",),
    "sensors exchanged": ("rename to dvel",),
}
"""Wrong causes and advice that must not come with it."""
QUICK = (
    "degrees",
    "g",
    "FLU",
    "IMU late",
    "sigmas large",
    "stuck",
    "kind",
    "rollover",
    "leap seconds",
    "gravity down",
    "milli-degrees",
    "velocities exchanged",
    "shuffled",
    "clock drift",
    "flipped midway",
)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in CASES]
)
def test_a_fault_of_a_simulated_drive_is_named(name, city_tables, tmp_path):
    damage, checks, word = CASES[name]
    imu, gnss = (dict(columns) for columns in city_tables)
    damage(imu, gnss)
    found = inspect(write(tmp_path, imu, gnss))
    assert word in told(found, checks), complaints(found)
    assert not [text for text in complaints(found) for wrong in NOT.get(name, ()) if wrong in text]


def test_nothing_is_found_in_the_clean_drive(city):
    found = inspect([city / "imu.parquet", city / "gnss.csv", city / "odometer.csv", city / "truth.parquet"])
    assert complaints(found) == []
    assert [report.role for report in found.files] == ["imu", "gnss", "odometer", "truth"]


REAL = [
    "degrees", "g", "FLU", "IMU late", "sigmas large", "sigmas small", "stuck", "places exchanged", "kind", "rollover",
    "gap", *NOT, "weak gyros", "frozen", "minutes", "flipped midway", "clock drift",
]  # fmt: skip
LOGS = {
    "car-1h-200hz": {"axes": "FRD", "fine": ()},
    "rtklibexplorer-drive": {"axes": "BRU", "fine": ("axes", "time offset", "clock drift")},
}


@pytest.mark.parametrize(
    "log", [pytest.param(log, marks=pytest.mark.slow if log.startswith("car") else ()) for log in LOGS]
)
def test_the_shared_drives_are_clean(log, shared_data):
    """But for what has to be set: the axes and the late stamps of the real one."""
    found = inspect([shared_data / log / "imu.parquet", shared_data / log / "gnss.csv"])
    assert [text for text in complaints(found) if not text.startswith(LOGS[log]["fine"])] == []
    assert found.settings["imu.axes"] == LOGS[log]["axes"]


@pytest.mark.slow
@pytest.mark.parametrize("name", REAL)
@pytest.mark.parametrize("log", LOGS)
def test_a_fault_of_a_shared_drive_is_named(log, name, shared_data, tmp_path):
    damage, checks, word = CASES[name]
    if log.startswith("car") and name in ("velocities exchanged", "frozen", "minutes"):
        pytest.skip("this log has no velocities")
    imu, gnss = read_columns(shared_data / log / "imu.parquet"), read_columns(shared_data / log / "gnss.csv")
    damage(imu, gnss)
    found = inspect(write(tmp_path, imu, gnss))
    if (log, name) == ("rtklibexplorer-drive", "FLU"):
        assert found.settings["imu.axes"] == "BLD"
    assert word in told(found, checks), complaints(found)
    assert not [text for text in complaints(found) for wrong in NOT.get(name, ()) if wrong in text]


RTK = {
    "called single": (damages.called_single, "position sigmas", "correct the fix label, if these are rtk-fixed"),
    "variances": (damages.variances, "position sigmas", "variances"),
    "up positive": (damages.up_positive, "vertical velocity", "up positive"),
    "feet": (damages.heights_in_feet, "vertical velocity", "in feet"),
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == "up positive" else pytest.mark.slow) for name in RTK]
)
def test_what_only_centimetres_tell_is_named(name, shared_data, tmp_path):
    damage, checks, word = RTK[name]
    folder = shared_data / "rtklibexplorer-drive"
    imu, gnss = read_columns(folder / "imu.parquet"), read_columns(folder / "gnss.csv")
    damage(imu, gnss)
    found = inspect(write(tmp_path, imu, gnss))
    assert word in told(found, checks), complaints(found)
    assert "sd_scale" not in told(found, checks)


@pytest.mark.slow
def test_logs_of_two_drives_are_asked_about(shared_data, city):
    found = inspect([city / "imu.parquet", shared_data / "rtklibexplorer-drive" / "gnss.csv"])
    assert "one drive?" in told(found, ("same drive", "overlap")), complaints(found)


def test_a_stand_is_found_where_the_fixes_are_of_another_time(city_tables, tmp_path):
    imu, gnss = (dict(columns) for columns in city_tables)
    clean = inspect(write(tmp_path, imu, gnss)).of("imu").finding("noise at rest")
    gnss["time_s"] = gnss["time_s"] + 1e5
    apart = inspect(write(tmp_path, imu, gnss)).of("imu").finding("noise at rest")
    assert clean.verdict is apart.verdict is Verdict.OK
    assert apart.figures == pytest.approx(clean.figures, rel=0.5)
