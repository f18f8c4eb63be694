"""Inertial logs with holes: the filter goes on, says so, and knows that it does not know."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.aiding.gnss_fix import GnssPosition
from navfuse.filters.ekf import FilterSettings
from navfuse.imu.gaps import change_over
from navfuse.imu.increments import ImuIncrements, to_increments
from navfuse.simulation import car_drive, simulate
from reference.engine_runs import MEMS, run_filter, start_at
from reference.navigation_algebra import error

SD = ([1.0, 1.0, 2.0], [0.05] * 3, np.radians([0.5, 0.5, 2.0]))
GAP_S = 0.5
OPTIONS = FilterSettings(gap_s=GAP_S)


def holed(imu, begin, end):
    """A rate log without the rows between two times, as increments."""
    keep = (imu.time <= begin + 1e-9) | (imu.time >= end - 1e-9)
    return to_increments(type(imu)(imu.time[keep], imu.gyro[keep], imu.accel[keep], imu.kind), gap_s=GAP_S)


def logs(seed=0, **options):
    motion = car_drive(80.0, seed=20 + seed, standing=5.0)
    return simulate(motion, MEMS, seed=30 + seed, imu_rate=50.0, imu_kind="rates", **options)


def run(simulated, increments, options=OPTIONS):
    start = start_at(simulated.motion, 0.0, *SD, np.random.default_rng(1))
    return run_filter(start, MEMS, [GnssPosition(simulated.gnss)], increments, options)


def test_a_gap_enlarges_the_covariance_and_is_noted():
    simulated = logs(gnss_rate=0.1)
    whole = run(simulated, to_increments(simulated.imu))
    gappy = run(simulated, holed(simulated.imu, 43.0, 45.0))
    a, b = whole.record.trajectory(), gappy.record.trajectory()
    before, after = a.time < 42.95, (a.time > 45.05) & (a.time < 49.95)
    assert np.array_equal(a.time, b.time)
    np.testing.assert_allclose(b.sd_attitude[before], a.sd_attitude[before])
    assert np.all(b.sd_attitude[after] > np.radians(10.0))
    assert np.all(b.sd_velocity[after] > 2.0)
    assert np.all(b.sd_position[after] > a.sd_position[after] + 1.0)
    assert whole.record.gaps == []
    assert gappy.record.gaps == [(43.0, 2.0)]


def test_a_pause_shorter_than_the_limit_is_no_gap():
    simulated = logs()
    filter_ = run(simulated, holed(simulated.imu, 43.0, 43.4))
    assert filter_.record.gaps == []


def test_without_a_limit_nothing_is_a_gap():
    simulated = logs()
    filter_ = run(simulated, holed(simulated.imu, 43.0, 45.0), FilterSettings())
    assert filter_.record.gaps == []


@pytest.mark.parametrize("shift", [-5e-7, -1e-9, 0.0, 1e-9, 5e-7])
def test_a_fix_at_the_very_end_of_a_gap_does_not_hide_it(shift):
    simulated = logs()
    stamps = simulated.gnss.time
    stamps[45] += shift
    filter_ = run(simulated, holed(simulated.imu, 43.3, 45.0))
    assert len(filter_.record.gaps) == 1
    (fix,) = [i for i in filter_.record.innovations if i.row == 45]
    assert fix.status == "used"
    assert np.all(fix.sd > 2.0)


def worst_error_in_sigmas(filter_, motion, since, until):
    """Largest error of position, velocity and attitude in units of what the filter states."""
    trajectory = filter_.record.trajectory()
    worst = np.zeros(3)
    for k in np.flatnonzero((trajectory.time >= since) & (trajectory.time <= until)):
        truth = motion.trajectory(trajectory.time[k : k + 1])
        v = (truth.velocity_n[0] - trajectory.velocity_n[k]) / trajectory.sd_velocity[k]
        a = (truth.attitude[0] - trajectory.attitude[k] + np.pi) % (2.0 * np.pi) - np.pi
        r = [6.36e6 * (truth.lat[0] - trajectory.lat[k]),
             6.38e6 * np.cos(truth.lat[0]) * (truth.lon[0] - trajectory.lon[k]),
             truth.height[0] - trajectory.height[k]] / trajectory.sd_position[k]  # fmt: skip
        worst = np.maximum(worst, [np.abs(r).max(), np.abs(v).max(), np.abs(a / trajectory.sd_attitude[k]).max()])
    return worst


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("length", [0.5, 1.0, 2.0])
def test_the_filter_stays_honest_after_a_gap_with_fixes_inside(seed, length):
    simulated = logs(seed)
    increments = holed(simulated.imu, 43.3, 43.3 + length)
    gyro_sd, accel_sd = change_over(increments, length)
    options = FilterSettings(gap_s=GAP_S, gap_gyro_sd=gyro_sd, gap_accel_sd=accel_sd)
    filter_ = run(simulated, increments, options)
    assert np.all(worst_error_in_sigmas(filter_, simulated.motion, 43.3 + length, 80.0) < 4.5)
    assert np.linalg.norm(error(motion_end(simulated), filter_.nav, ecef=False)[:2]) < 8.0


def motion_end(simulated):
    from reference.engine_runs import nav_at

    return nav_at(simulated.motion, 80.0, ecef=False)


def test_gaps_of_increment_sensors_are_bridged_too():
    simulated = logs()
    increments = holed(simulated.imu, 43.0, 45.0)
    zero = increments.dt > GAP_S
    lost = ImuIncrements(
        increments.time, np.where(zero[:, None], 0.0, increments.inc_theta_b), increments.inc_v_b.copy()
    )
    filter_ = run(simulated, lost)
    assert np.isfinite(filter_.P).all()
    assert filter_.record.gaps == [(43.0, 2.0)]
