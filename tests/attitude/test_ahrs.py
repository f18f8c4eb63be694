from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from navfuse.analysis.consistency import average_bounds
from navfuse.attitude.ahrs import estimate_attitude
from navfuse.attitude.ahrs_settings import AhrsSettings
from navfuse.data.aiding_logs import MagnetometerLog
from navfuse.data.logs import ImuLog
from navfuse.errors import ConfigError, FilterError, InputError
from reference.ahrs_world import FIELD_N, attitude_error, make_world, world_settings


def consistency(seeds, seconds=24.0):
    settings = world_settings()
    squares = {"realtime": [], "smoothed": []}
    bias, nis, delay = [], [], []
    for seed in seeds:
        world = make_world(settings, seconds, seed)
        run = estimate_attitude(world.imu, world.magnetometer, settings)
        k = world.q_nb.shape[0] * 2 // 3
        for name, kept in squares.items():
            solution = getattr(run, name)
            kept.append((attitude_error(world.q_nb[[k]], solution.q_nb[[k]])[0] / solution.sd[k]) ** 2)
        bias.append(((world.gyro_bias - run.realtime.gyro_bias[k]) / run.realtime.sd_gyro_bias[k]) ** 2)
        delay.append(((run.delay - world.delay) / run.sd_delay) ** 2)
        nis.append(np.nanmean(run.magnetic_nis[run.block_time > 10.0]) / 3.0)
    return {name: np.array(kept) for name, kept in squares.items()}, np.array(bias), np.array(nis), np.array(delay)


def judge(seeds):
    squares, bias, nis, delay = consistency(seeds)
    for name in ("realtime", "smoothed"):
        low, high = average_bounds(2 * len(seeds))
        assert low < squares[name][:, :2].mean() < high, name
        low, high = average_bounds(len(seeds))
        assert low < squares[name][:, 2].mean() < high, name
    low, high = average_bounds(3 * len(seeds))
    assert low < bias.mean() < high
    low, high = average_bounds(len(seeds))
    assert low < delay.mean() < high
    assert nis.mean() == pytest.approx(1.0, abs=0.03)


def test_consistency_where_the_model_holds():
    judge(range(12))


@pytest.mark.slow
def test_consistency_over_many_seeds():
    judge(range(100, 220))


def test_noise_that_is_larger_than_claimed_is_seen():
    settings = world_settings(mag_noise=1.6e-6)
    world = make_world(settings, 36.0, 3)
    claimed = world_settings(mag_noise=8e-7)
    run = estimate_attitude(world.imu, world.magnetometer, claimed)
    assert np.nanmean(run.magnetic_nis) / 3.0 > 1.3


def test_without_a_magnetometer_the_horizon_is_as_good():
    settings = world_settings()
    squares = []
    for seed in range(10):
        world = make_world(settings, 20.0, seed)
        run = estimate_attitude(world.imu, None, settings)
        k = 1500
        q = run.realtime.q_nb[[k]]
        # A heading of its own: that of the start is taken from the truth.
        start = (
            Rotation.from_quat(world.q_nb[0][[1, 2, 3, 0]])
            * Rotation.from_quat(run.realtime.q_nb[0][[1, 2, 3, 0]]).inv()
        )
        turn = Rotation.from_euler("Z", start.as_euler("ZYX")[0])
        turned = (turn * Rotation.from_quat(q[:, [1, 2, 3, 0]])).as_quat()[:, [3, 0, 1, 2]]
        error = attitude_error(world.q_nb[[k]], turned)[0]
        squares.append((error[:2] / run.realtime.sd[k][0]) ** 2)
        assert abs(error[2]) < 5.0 * run.realtime.sd[k][2]
        assert np.all(run.smoothed.sd[k][:2] < run.realtime.sd[k][:2])
        assert run.realtime.sd[0][2] == 0.0
    low, high = average_bounds(20)
    assert low < np.mean(squares) < high


def test_a_passing_magnet_is_rejected_and_does_not_tilt_the_horizon():
    settings = world_settings()

    def magnet(time):
        return np.outer((time > 20.0) & (time < 26.0), [0.0, 3e-5, 1e-5])

    clean = make_world(settings, 40.0, 5)
    disturbed = make_world(settings, 40.0, 5, magnet)
    run = estimate_attitude(disturbed.imu, disturbed.magnetometer, settings)
    without = estimate_attitude(clean.imu, clean.magnetometer, settings)
    inside = (run.block_time > 20.1) & (run.block_time < 26.0)
    assert run.magnetic_rejected[inside].all()
    assert not run.magnetic_rejected[~inside & (run.block_time < 20.0)].any()
    error = attitude_error(disturbed.q_nb, run.realtime.q_nb)
    assert np.degrees(np.abs(error[1500:, 2])).max() < 8.0
    tilt = attitude_error(without.realtime.q_nb, run.realtime.q_nb)[:, :2]
    assert np.degrees(np.abs(tilt)).max() < 0.2


def test_a_field_that_changed_for_good_is_believed_in_the_end():
    settings = world_settings(patience=5.0)

    def moved(time):
        return np.outer(time > 10.0, [-3e-6, 1.2e-5, 0.0])

    world = make_world(settings, 80.0, 6, moved)
    run = estimate_attitude(world.imu, world.magnetometer, settings)
    late = run.block_time > 60.0
    assert run.magnetic_rejected[(run.block_time > 10.5) & (run.block_time < 14.0)].all()
    assert run.magnetic_rejected[late].mean() < 0.1
    # North is where the new field points, atan2(12, 15) from the old one.
    error = np.degrees(attitude_error(world.q_nb, run.realtime.q_nb)[7000:, 2].mean())
    assert error == pytest.approx(np.degrees(np.arctan2(12.0, 15.0)), abs=12.0)


@pytest.mark.parametrize("degrees", [70.0, -150.0])
def test_a_turn_that_the_gyro_did_not_see(degrees):
    """The heading comes back after the patience, and the smoother leaves the time before the turn alone."""
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 90.0, 0.01)
    rate = 0.5 * np.sin(0.3 * time)
    heading = np.concatenate([[0.0], np.cumsum(0.005 * (rate[1:] + rate[:-1]))])
    heading += np.where(time >= 45.0, np.radians(degrees), 0.0)
    gyro = 0.002 * rng.standard_normal((time.size, 3))
    gyro[:, 2] += rate + 0.002
    accel = [0.0, 0.0, -9.81] + 0.02 * rng.standard_normal((time.size, 3))
    c, s = 18e-6 * np.cos(heading), 18e-6 * np.sin(heading)
    field = np.column_stack([c, -s, np.full(time.size, 45e-6)]) + 2e-7 * rng.standard_normal((time.size, 3))
    run = estimate_attitude(
        ImuLog(time, gyro, accel), MagnetometerLog(time, field), AhrsSettings(patience=10.0)
    )  # fmt: skip
    for solution in (run.realtime, run.smoothed):
        off = np.degrees(np.angle(np.exp(1j * (solution.euler[:, 2] - np.interp(solution.time, time, heading)))))
        for within in ((solution.time > 10.0) & (solution.time < 44.0), solution.time > 60.0):
            assert np.abs(off[within]).max() < 1.0
            assert np.degrees(solution.sd[within, 2]).max() < 3.0


def still(seconds=10.0, rate=100.0, heading=0.7, roll=0.1, pitch=-0.2, field=FIELD_N):
    n = round(seconds * rate)
    C_nb = Rotation.from_euler("ZYX", [heading, pitch, roll])
    rng = np.random.default_rng(0)
    time = np.arange(n) / rate
    gyro = np.array([0.003, -0.002, 0.004]) + 1e-3 * rng.standard_normal((n, 3))
    accel = C_nb.inv().apply([0.0, 0.0, -9.80665]) + 0.02 * rng.standard_normal((n, 3))
    mag = np.tile(C_nb.inv().apply(field), (n, 1)) + 5e-7 * rng.standard_normal((n, 3))
    return ImuLog(time, gyro, accel), MagnetometerLog(time, mag)


def test_at_rest_attitude_and_gyro_bias_are_found():
    imu, mag = still()
    run = estimate_attitude(imu, mag)
    np.testing.assert_allclose(run.smoothed.euler[-1], [0.1, 2.0 * np.pi - 0.2 - 2.0 * np.pi, 0.7], atol=0.05)
    np.testing.assert_allclose(run.smoothed.gyro_bias[-1], [0.003, -0.002, 0.004], atol=2e-4)
    assert run.resting[-1]
    assert run.smoothed.time.size == imu.time.size == run.smoothed.q_nb.shape[0]


@pytest.mark.parametrize("given", ["declination", "field"])
def test_true_north(given):
    east = 0.25
    field = [np.cos(east) * 2e-5, np.sin(east) * 2e-5, 4e-5]
    imu, mag = still(field=field)
    settings = AhrsSettings(declination=east) if given == "declination" else AhrsSettings(field_n=field, field_sd=1e-6)
    assert estimate_attitude(imu, mag, settings).realtime.euler[-1, 2] == pytest.approx(0.7, abs=0.05)


def test_blocks_and_a_slow_magnetometer_make_no_great_difference():
    settings = world_settings()
    world = make_world(settings, 36.0, 8)
    fine = estimate_attitude(world.imu, world.magnetometer, settings).smoothed
    rows = slice(3, None, 5)
    slow = MagnetometerLog(world.magnetometer.time[rows] - 0.004, world.magnetometer.field_b[rows])
    sparse = estimate_attitude(world.imu, slow, settings).smoothed
    long = estimate_attitude(world.imu, world.magnetometer, world_settings(block=0.08)).smoothed
    for other in (sparse, long):
        apart = np.abs(attitude_error(fine.q_nb, other.q_nb))[500:]
        assert np.degrees(np.sqrt(np.mean(apart**2, axis=0))).max() < 1.5


def test_a_gap_and_a_late_magnetometer_are_survived():
    settings = world_settings()
    world = make_world(settings, 36.0, 9)
    kept = (world.imu.time < 15.0) | (world.imu.time > 16.0)
    imu = replace(world.imu, time=world.imu.time[kept], gyro=world.imu.gyro[kept], accel=world.imu.accel[kept])
    late = world.magnetometer.time > 5.0
    mag = MagnetometerLog(world.magnetometer.time[late], world.magnetometer.field_b[late])
    run = estimate_attitude(imu, mag, settings)
    assert 4.9 < run.realtime.time[0] <= 5.01
    error = attitude_error(world.q_nb[np.isin(world.imu.time, run.smoothed.time)], run.smoothed.q_nb)
    assert np.degrees(np.abs(error[-500:])).max() < 6.0


def test_what_cannot_be_used_is_refused_with_a_message():
    imu, mag = still(1.0)
    spoiled = imu.gyro.copy()
    spoiled[7, 1] = np.nan
    with pytest.raises(InputError, match="row 7: gyro is not finite"):
        estimate_attitude(replace(imu, gyro=spoiled), mag)
    with pytest.raises(InputError, match="no magnetic sample lies inside"):
        estimate_attitude(imu, MagnetometerLog(mag.time + 1e4, mag.field_b))
    with pytest.raises(InputError, match="at least three inertial samples"):
        estimate_attitude(replace(imu, time=imu.time[:2], gyro=imu.gyro[:2], accel=imu.accel[:2]))
    with pytest.raises(InputError, match="not near gravity; check the unit"):
        estimate_attitude(replace(imu, accel=imu.accel / 9.80665 / 20.0), mag)
    with pytest.raises(FilterError, match="lost its state"):
        estimate_attitude(replace(imu, accel=np.where(imu.time[:, None] > 0.5, 1e200, imu.accel)), None, smooth=False)


@pytest.mark.parametrize(
    ("key", "value"),
    [("block", 0.0), ("gyro_noise", -1.0), ("mag_noise", np.nan), ("gate_probability", 1.5), ("declination", 7.0),
     ("field_n", [0.0, 0.0, 4e-5]), ("field_n", [1e-5, 0.0])],
)  # fmt: skip
def test_settings_out_of_range_are_refused(key, value):
    with pytest.raises(ConfigError, match=key):
        AhrsSettings(**{key: value})
