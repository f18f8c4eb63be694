from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from navfuse.data.logs import GnssLog
from navfuse.errors import InputError
from navfuse.imu.grades import grade
from navfuse.imu.time_offset import estimate_time_offset
from navfuse.io.gnss_table import read_gnss
from navfuse.io.imu_table import read_imu
from navfuse.simulation import car_drive, figure_eight_flight, simulate, static

FINE = {"sd_position": (0.01, 0.01, 0.02), "sd_velocity": (0.01, 0.01, 0.02)}


def late(imu, seconds):
    """The log with stamps to which `seconds` have to be added."""
    return replace(imu, time=imu.time - seconds)


def in_axes(imu, gyro=None, accel=None):
    """The log with its vectors multiplied by matrices."""
    turn = [np.eye(3) if matrix is None else np.asarray(matrix, dtype=float) for matrix in (gyro, accel)]
    return replace(imu, gyro=imu.gyro @ turn[0].T, accel=imu.accel @ turn[1].T)


def positions_only(gnss):
    return replace(gnss, velocity_n=None, sd_velocity=None)


@pytest.fixture(scope="module")
def drive():
    made = simulate(car_drive(150.0, seed=3), grade("consumer"), 1, lever_arm_b=(0.8, 0.3, -1.0), gnss_rate=2.0)
    return made.imu, made.gnss


@pytest.fixture(scope="module")
def motion():
    return car_drive(120.0, seed=4)


@pytest.mark.parametrize(
    ("shift", "imu_rate", "gnss_rate", "kind", "velocity"),
    [
        (0.3, 100.0, 1.0, "increments", True),
        (-0.125, 50.0, 4.0, "rates", False),
        (0.0, 200.0, 10.0, "rates", True),
        (2.1, 100.0, 1.0, "increments", False),
        (2.1, 50.0, 10.0, "rates", True),
        (-0.125, 200.0, 1.0, "increments", False),
        (0.3, 50.0, 1.0, "rates", True),
        (0.0, 100.0, 4.0, "increments", False),
        (-0.125, 10.0, 4.0, "increments", True),
        (-4.3, 100.0, 4.0, "rates", True),
    ],
)
def test_known_shifts_without_half_a_step(motion, shift, imu_rate, gnss_rate, kind, velocity):
    """Ten milliseconds would be half a step of the slowest of the usual logs, and 0.5 s half of one of the fixes."""
    made = simulate(
        motion, grade("navigation"), 2, imu_rate=imu_rate, imu_kind=kind, gnss_rate=gnss_rate, gnss_offset=0.03, **FINE
    )
    gnss = made.gnss if velocity else positions_only(made.gnss)
    found = estimate_time_offset(late(made.imu, shift), gnss)
    assert found.reason is None
    assert found.offset == pytest.approx(shift, abs=0.006)
    assert abs(found.offset - shift) < 4.0 * found.sd
    assert found.correlation > 0.99
    assert found.rival < 0.95


def chi_square(seeds, velocity):
    total, count = 0.0, 0
    for seed in seeds:
        rng = np.random.default_rng(1000 + seed)
        shift, lever = rng.uniform(-3.0, 3.0), rng.normal(0.0, 1.0, 3)
        made = simulate(car_drive(180.0, seed=seed, heading=0.3 * seed), grade("consumer"), seed, lever_arm_b=lever)
        found = estimate_time_offset(late(made.imu, shift), made.gnss if velocity else positions_only(made.gnss))
        assert found.offset is not None, (seed, found.reason)
        total, count = total + ((found.offset - shift) / found.sd) ** 2, count + 1
    return total, count


@pytest.mark.parametrize("velocity", [True, False])
def test_the_standard_deviation_is_honest(velocity):
    total, count = chi_square(range(10), velocity)
    assert chi2.ppf(0.0005, count) < total < chi2.ppf(0.9995, count)


@pytest.mark.slow
@pytest.mark.parametrize("velocity", [True, False])
def test_the_standard_deviation_is_honest_over_many_drives(velocity):
    """The mean square of error over sd is 1.12 by velocities and 1.21 by positions."""
    total, count = chi_square(range(100), velocity)
    assert 0.6 * count < total < chi2.ppf(0.9995, count)


def test_stated_sigmas_do_not_matter(drive):
    imu, gnss = drive
    found = estimate_time_offset(imu, gnss)
    boasting = replace(gnss, sd_position=0.01 * gnss.sd_position, sd_velocity=0.01 * gnss.sd_velocity)
    assert estimate_time_offset(imu, boasting).sd == pytest.approx(found.sd, rel=1e-6)
    assert abs(found.offset) < 4.0 * found.sd < 0.05


def test_mounting_does_not_matter(drive):
    imu, gnss = drive
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    found, turned = estimate_time_offset(imu, gnss), estimate_time_offset(in_axes(imu, turn, turn), gnss)
    assert turned.offset == pytest.approx(found.offset, abs=1e-3)
    assert turned.notes == found.notes == ()


@pytest.mark.parametrize(
    ("gyro", "accel", "told"),
    [
        (-np.eye(3), None, ["gyroscopes are taken as reversed"]),
        (None, -np.eye(3), ["accelerometers are taken as left-handed, or all reversed"]),
        (np.diag([1, -1, 1]), np.diag([1, -1, 1]), ["gyroscopes are taken as reversed", "left-handed"]),
    ],
)
def test_wrong_signs_are_told_and_do_no_harm(drive, gyro, accel, told):
    imu, gnss = drive
    found = estimate_time_offset(late(in_axes(imu, gyro, accel), 0.3), gnss)
    assert found.offset == pytest.approx(0.3, abs=0.03)
    assert len(found.notes) == len(told)
    assert all(text in note for text, note in zip(told, found.notes, strict=True))


@pytest.mark.parametrize("velocity", [True, False])
def test_gyroscopes_in_another_order(drive, velocity):
    imu, gnss = drive
    wrong = late(in_axes(imu, np.eye(3)[[1, 2, 0]]), 0.3)
    found = estimate_time_offset(wrong, gnss if velocity else positions_only(gnss))
    assert found.used.startswith("acceleration along and across the track")
    assert abs(found.offset - 0.3) < 3.0 * found.sd < 0.6


def test_a_bias_of_several_degrees_per_second(drive):
    imu, gnss = drive
    step = np.diff(imu.time, prepend=imu.time[0] - 0.01)[:, None]
    biased = replace(imu, gyro=imu.gyro + np.radians([2.0, -3.0, 2.5]) * step)
    assert estimate_time_offset(biased, gnss).offset == pytest.approx(0.0, abs=0.03)


def test_an_aeroplane_in_coordinated_turns():
    made = simulate(figure_eight_flight(200.0), grade("tactical"), 1, gnss_rate=4.0)
    found = estimate_time_offset(late(made.imu, -0.125), made.gnss)
    assert abs(found.offset + 0.125) < 4.0 * found.sd < 0.15


def test_velocities_that_are_means_over_the_last_interval():
    made = simulate(car_drive(150.0, seed=3), grade("tactical"), 1, gnss_rate=4.0, **FINE)
    slow = replace(made.gnss, velocity_n=0.5 * (made.gnss.velocity_n + np.roll(made.gnss.velocity_n, 1, axis=0)))
    found = estimate_time_offset(made.imu, slow.take(slice(1, None)))
    (note,) = found.notes
    assert "by positions +0.00" in note or "by positions -0.00" in note
    assert "the velocities look 0.12" in note
    assert note.endswith("s late")
    assert 0.05 < found.sd < 0.08


def test_outliers_and_lost_fixes(drive):
    imu, gnss = drive
    rng = np.random.default_rng(5)
    wrong = rng.random(gnss.time.size) < 0.03
    velocity = gnss.velocity_n + wrong[:, None] * rng.normal(0.0, 3.0, gnss.velocity_n.shape)
    velocity[rng.random(gnss.time.size) < 0.1] = np.nan
    found = estimate_time_offset(late(imu, 0.3), replace(gnss, velocity_n=velocity))
    assert abs(found.offset - 0.3) < 4.0 * found.sd < 0.4


def test_a_hole_in_the_inertial_data_and_rows_that_are_not_numbers(drive):
    imu, gnss = drive
    kept = (imu.time < 60.0) | (imu.time > 63.0)
    gyro, accel = imu.gyro.copy(), imu.accel.copy()
    gyro[3000:3003] = np.nan
    holed = replace(imu, time=imu.time[kept], gyro=gyro[kept], accel=accel[kept])
    assert estimate_time_offset(late(holed, 0.3), gnss).offset == pytest.approx(0.3, abs=0.04)


def test_one_wild_stamp(drive):
    imu, gnss = drive
    wild = gnss.time.copy()
    wild[-1] = 1e12
    assert estimate_time_offset(imu, replace(gnss, time=wild)).offset == pytest.approx(0.0, abs=0.03)


@pytest.mark.parametrize("velocity", [True, False])
def test_nothing_is_said_of_what_stands(velocity):
    for seed in range(3):
        made = simulate(static(150.0), grade("consumer"), seed, gnss_rate=2.0)
        found = estimate_time_offset(made.imu, made.gnss if velocity else positions_only(made.gnss))
        assert found.offset is None
        assert found.sd is None
        assert "accelerations do not agree" in found.reason


def test_nothing_is_said_of_another_drive(drive):
    """Each sees accelerations, and they have nothing to do with each other."""
    imu, _ = drive
    for seed in range(41, 47):
        other = simulate(car_drive(150.0, seed=seed), grade("consumer"), seed, gnss_rate=2.0).gnss
        for gnss in (other, positions_only(other)):
            assert estimate_time_offset(imu, gnss).offset is None


def slalom(late_s):
    """Left and right every four seconds, for ever."""
    from navfuse.data.logs import ImuLog

    time = np.arange(0.0, 120.0, 0.02)
    rate = 0.2 * np.sin(2.0 * np.pi * time / 4.0)
    course = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * 0.02)])
    zero = np.zeros(time.size)
    imu = ImuLog(time - late_s, np.column_stack([zero, zero, rate]), np.column_stack([zero, 10.0 * rate, zero - 9.8]))
    rows = slice(0, None, 25)
    velocity = 10.0 * np.column_stack([np.cos(course), np.sin(course), zero])[rows]
    velocity += np.random.default_rng(1).normal(0.0, 0.03, velocity.shape)
    place = np.full(velocity.shape[0], 0.5)
    sd = np.ones_like(velocity)
    return imu, GnssLog(time[rows], place, place, place, sd, velocity, 0.03 * sd)


def test_nothing_is_said_of_what_repeats_itself():
    found = estimate_time_offset(*slalom(0.3))
    assert found.offset is None
    assert "the motion repeats itself" in found.reason
    assert found.rival > 0.9


def test_further_away_than_was_searched(drive):
    imu, gnss = drive
    assert estimate_time_offset(late(imu, 7.0), gnss).offset is None
    assert estimate_time_offset(late(imu, 7.0), gnss, search_s=10.0).offset == pytest.approx(7.0, abs=0.03)
    edge = estimate_time_offset(late(imu, 5.3), gnss)
    assert edge.offset is None
    assert "at the end of the search, +5.0 s" in edge.reason


def test_accelerations_in_another_unit(drive):
    imu, gnss = drive
    found = estimate_time_offset(replace(imu, accel=0.3 * imu.accel), gnss)
    assert found.offset is None
    assert "times those of the inertial sensor" in found.reason


def test_logs_that_are_apart_or_short(drive):
    imu, gnss = drive
    assert "do not overlap" in estimate_time_offset(late(imu, 1000.0), gnss).reason
    assert "25 s are needed" in estimate_time_offset(imu, gnss.take(slice(0, 30))).reason
    assert "do not overlap" in estimate_time_offset(imu, gnss.take(slice(0, 1))).reason
    few = gnss.take(np.linspace(0, gnss.time.size - 1, 8).astype(int))
    assert "no stretch with enough fixes" in estimate_time_offset(imu, few).reason


@pytest.mark.parametrize("search_s", [0.0, -1.0, np.nan, np.inf])
def test_a_search_that_is_none(drive, search_s):
    with pytest.raises(InputError, match="search_s has to be a positive number"):
        estimate_time_offset(*drive, search_s=search_s)


@pytest.mark.parametrize("shift", [0.0, 0.3])
def test_real_drive(shared_data, shift):
    """By least NIS the filter prefers -0.23 s with positions, -0.09 s with velocities: benchmarks.time_offset_scan."""
    folder = shared_data / "rtklibexplorer-drive"
    imu, gnss = read_imu(folder / "imu.parquet"), read_gnss(folder / "gnss.csv")
    found = estimate_time_offset(late(imu, shift), gnss)
    assert found.offset == pytest.approx(-0.19 + shift, abs=0.02)
    assert any("the velocities look 0.11" in note for note in found.notes)


def test_an_hour_with_positions_of_a_metre(shared_data):
    folder = shared_data / "car-1h-200hz"
    found = estimate_time_offset(read_imu(folder / "imu.parquet"), read_gnss(folder / "gnss.csv"))
    assert abs(found.offset) < 0.05
    assert abs(found.offset) < 3.0 * found.sd < 0.05
