from __future__ import annotations

import numpy as np
import pyarrow.parquet
import pytest

from navfuse.errors import InputError, NavfuseWarning
from navfuse.imu.grades import grade
from navfuse.io.imu_plausibility import check_imu_units, gravity_coherence
from navfuse.io.imu_table import read_imu
from navfuse.io.tables import write_table
from navfuse.simulation import car_drive, simulate

RATE_COLUMNS = ["time_s", *(f"gyro_{axis}_radps" for axis in "xyz"), *(f"accel_{axis}_mps2" for axis in "xyz")]
INCREMENT_COLUMNS = ["time_s", *(f"dtheta_{axis}_rad" for axis in "xyz"), *(f"dvel_{axis}_mps" for axis in "xyz")]
G = 9.80665


def swaying(seconds=120.0, rate=100.0, size=0.3, period=4.0):
    """A sensor that rolls and pitches by `size` rad while it turns, with the gravity it feels [s, rad/s, m/s^2]."""
    time = np.arange(0.0, seconds, 1.0 / rate)
    attitude = np.eye(3)
    gyro = np.column_stack(
        (
            size * 2.0 * np.pi / period * np.cos(2.0 * np.pi * time / period),
            0.7 * size * 2.0 * np.pi / period * np.sin(2.0 * np.pi * time / period),
            np.full(time.size, 0.2),
        )
    )
    accel = np.empty_like(gyro)
    for k, rate_b in enumerate(gyro):
        accel[k] = attitude.T @ (0.0, 0.0, -G)
        angle = rate_b / rate
        skew = np.array([[0.0, -angle[2], angle[1]], [angle[2], 0.0, -angle[0]], [-angle[1], angle[0], 0.0]])
        attitude = attitude @ (np.eye(3) + skew + 0.5 * skew @ skew)
        attitude = np.linalg.qr(attitude)[0] * np.sign(np.diag(np.linalg.qr(attitude)[1]))
    return time, gyro, accel


def check(time, gyro, accel, kind="rates"):
    columns = RATE_COLUMNS if kind == "rates" else INCREMENT_COLUMNS
    return check_imu_units(time, gyro, accel, kind, columns, "f.csv")


def as_increments(time, gyro, accel):
    step = np.diff(time, prepend=time[0] - (time[1] - time[0]))[:, None]
    return time, gyro * step, accel * step, "increments"


@pytest.fixture(scope="module")
def log():
    return swaying()


def test_right_units_pass(log):
    assert check(*log) == []
    assert check(*as_increments(*log)) == []


def test_gravity_is_found_again(log):
    np.testing.assert_allclose(gravity_coherence(*log, "rates"), G, atol=0.01)
    np.testing.assert_allclose(gravity_coherence(*as_increments(*log)), G, atol=0.02)


def test_factor_and_bias_of_the_gyro(log):
    time, gyro, accel = log
    bias = np.array([0.02, -0.03, 0.01])
    np.testing.assert_allclose(gravity_coherence(time, 4.0 * gyro + bias, accel, "rates", 0.25, bias), G, atol=0.01)


def test_windows_with_a_gap_are_left_out(log):
    time, gyro, accel = log
    kept = (time < 40.0) | (time >= 55.0)
    for torn in ((time[kept], gyro[kept], accel[kept], "rates"), as_increments(time[kept], gyro[kept], accel[kept])):
        whole = gravity_coherence(*torn)
        assert 0 < whole.size < gravity_coherence(*log, "rates").size
        np.testing.assert_allclose(whole, G, atol=0.02)
        assert check(*torn) == []


@pytest.mark.parametrize("log_is", ["short", "slow"])
def test_no_windows(log, log_is):
    take = slice(0, 900) if log_is == "short" else slice(0, None, 20)
    assert gravity_coherence(*(array[take] for array in log), "rates").size == 0


def test_degrees_in_a_rate_column(log):
    time, gyro, _ = log
    with pytest.raises(
        InputError, match=r"f\.csv: columns gyro_x_radps, .* if they are degrees: rename to gyro_x_degps"
    ):
        check(time, np.degrees(0.3 * gyro), swaying(size=0.09)[2])


def test_degrees_of_a_car_that_turns_about_the_vertical_only():
    """Under any such rotation the mean of gravity stays, but for the bias, which tilts it at 57 times the rate."""
    logs = simulate(car_drive(duration=120.0, seed=4), grade("industrial-mems"), 5, imu_kind="rates")
    imu = logs.imu
    assert check(imu.time, imu.gyro, imu.accel) == []
    with pytest.raises(InputError, match="if they are degrees: rename to gyro_x_degps"):
        check(imu.time, np.degrees(imu.gyro), imu.accel)


def test_degrees_in_an_increment_column(log):
    time, gyro, accel, kind = as_increments(*log)
    with pytest.raises(InputError, match="rename to dtheta_x_deg"):
        check(time, np.degrees(gyro), accel, kind)


def test_fast_degrees_are_told_by_their_size():
    time, gyro, accel = swaying(seconds=5.0, size=0.8)
    with pytest.raises(InputError, match="one row in a hundred turns faster than .* rename to gyro_x_degps"):
        check(time, np.degrees(gyro), accel)


def test_short_log_with_fast_rates_is_noted(log):
    time, gyro, accel = (array[:500] for array in log)
    (note,) = check(time, gyro * 8.0, accel)
    assert "the median rate is" in note
    assert "are these degrees? Then rename to gyro_x_degps" in note


def test_raw_gyro_bias_is_not_taken_for_degrees():
    time, gyro, accel = swaying()
    assert check(time, gyro + np.array([0.1, -0.15, 0.05]), accel) == []


def test_orbit_is_not_taken_for_degrees():
    """Banked at 60 degrees all the time: |f| is 2 g and constant in the body, yet gravity is what remains in space."""
    time = np.arange(0.0, 120.0, 0.01)
    turn = G * np.tan(np.radians(60.0)) / 15.0
    gyro = np.tile([0.0, turn * np.sin(np.radians(60.0)), turn * np.cos(np.radians(60.0))], (time.size, 1))
    accel = np.tile([0.0, 0.0, -1.99 * G], (time.size, 1))
    assert check(time, gyro, accel) == []


def test_triads_that_do_not_fit_are_noted():
    time, gyro, accel = swaying(size=1.2)
    (note,) = check(time, -gyro, accel)
    assert "check the units, signs and order of the gyro and accelerometer columns" in note


def test_g_in_an_acceleration_column(log):
    time, gyro, accel = log
    with pytest.raises(InputError, match=r"accel_x_mps2.*is 1 m/s\^2 .* look like values in g: rename to accel_x_g"):
        check(time, gyro, accel / G)


def test_g_in_an_increment_column(log):
    time, gyro, accel, kind = as_increments(*log)
    with pytest.raises(InputError, match=r"look like values in g: multiply the columns by 9\.80665"):
        check(time, gyro, accel / G, kind)


def test_metres_in_a_column_of_g(log):
    time, gyro, accel = log
    with pytest.raises(InputError, match=r"look like values in m/s\^2 in a column of g: rename to accel_x_mps2"):
        check(time, gyro, accel * G)


@pytest.mark.parametrize("factor", [1000.0 / G, 100.0])
def test_milli_g_or_gal(log, factor):
    time, gyro, accel = log
    with pytest.raises(InputError, match="look like values in milli-g"):
        check(time, gyro, accel * factor)


def test_increments_in_rate_columns(log):
    time, gyro, accel, _ = as_increments(*log)
    with pytest.raises(InputError, match=r"velocity increments over 0\.01 s, not accelerations: rename to dvel_x_mps"):
        check(time, gyro, accel)


def test_increments_at_10_hz_look_like_g(log):
    time, gyro, accel = (array[::10] for array in log)
    with pytest.raises(
        InputError, match=r"rename to accel_x_g \.\.\. \(or, at 0\.1 s between rows, velocity increments"
    ):
        check(time, gyro * 0.1, accel * 0.1)


def test_rates_in_increment_columns(log):
    time, gyro, accel = log
    with pytest.raises(InputError, match="these are accelerations, not increments: rename to accel_x_mps2"):
        check(time, gyro, accel, "increments")


def test_weightless_log_is_noted(log):
    time, gyro, accel = log
    (note,) = check(time[:500], gyro[:500], accel[:500] * 1e-3)
    assert "check the unit of these columns" in note


@pytest.mark.parametrize("step", [5.0, 1e-6])
def test_impossible_rate(log, step):
    _, gyro, accel = log
    with pytest.raises(InputError, match="which no inertial sensor does; is 'time_s' in the unit its name says"):
        check(step * np.arange(gyro.shape[0]), gyro, accel)


def test_slow_rate_is_noted(log):
    _, gyro, accel = log
    (note,) = check(1.0 * np.arange(gyro.shape[0]), 0.01 * gyro, accel)
    assert "which is slow for an inertial sensor" in note


def test_two_rows():
    assert check(np.array([0.0, 0.01]), np.zeros((2, 3)), np.full((2, 3), 5.7)) == []


def spoiled(shared_data, tmp_path, folder, factor, rename=None):
    """A shared log with the gyro (or other) columns multiplied or renamed."""
    table = pyarrow.parquet.read_table(shared_data / folder / "imu.parquet")
    columns = {}
    for name in table.column_names:
        scale = next((value for begin, value in factor.items() if name.startswith(begin)), 1.0)
        columns[(rename or {}).get(name, name)] = np.asarray(table[name]) * scale
    write_table(tmp_path / "imu.parquet", columns)
    return tmp_path / "imu.parquet"


@pytest.mark.parametrize(
    ("folder", "axes", "factor", "message"),
    [
        ("rtklibexplorer-drive", "BRU", {"gyro": 180.0 / np.pi}, "if they are degrees: rename to gyro_x_degps"),
        ("rtklibexplorer-drive", "BRU", {"accel": 1.0 / G}, "look like values in g: rename to accel_x_g"),
        ("rtklibexplorer-drive", "BRU", {"time": 1000.0}, "is 'time_s' in the unit its name says"),
        ("rtklibexplorer-drive", "BRU", {"gyro": 0.01, "accel": 0.01}, "these are velocity increments"),
        ("car-1h-200hz", "FRD", {"dtheta": 180.0 / np.pi}, "if they are degrees: rename to dtheta_x_deg"),
        ("car-1h-200hz", "FRD", {"d": 200.0}, "these are accelerations, not increments"),
    ],
)
def test_shared_logs_in_wrong_units(shared_data, tmp_path, folder, axes, factor, message):
    path = spoiled(shared_data, tmp_path, folder, factor)
    with pytest.raises(InputError, match=message):
        read_imu(path, axes=axes)


def test_static_real_sensor(shared_data, tmp_path):
    with np.load(shared_data / "adis16405-static/adis_16405_imu1.npz") as file:
        gyro, accel = file["gyro_degps"][:60000], file["accel_g"][:60000]
    columns = {"time_s": 0.01 * np.arange(60000)}
    columns |= {f"gyro_{axis}_degps": gyro[:, k] for k, axis in enumerate("xyz")}
    columns |= {f"accel_{axis}_g": accel[:, k] for k, axis in enumerate("xyz")}
    write_table(tmp_path / "imu.csv", columns)
    log = read_imu(tmp_path / "imu.csv")
    assert log.notes == ()
    assert np.linalg.norm(log.accel.mean(axis=0)) == pytest.approx(9.95, abs=0.05)


def test_notes_are_warnings_of_the_reader(write, rates):
    columns = rates | {name: values * 1e-3 for name, values in rates.items() if "accel" in name}
    with pytest.warns(NavfuseWarning, match="check the unit of these columns") as caught:
        log = read_imu(write(columns))
    assert log.notes == (str(caught[0].message),)
