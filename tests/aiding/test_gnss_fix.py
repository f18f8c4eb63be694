from __future__ import annotations

import numpy as np
import pytest

from navfuse.aiding.base import AidingSensor, numerical_jacobian
from navfuse.aiding.gnss_fix import GnssPosition, GnssVelocity
from navfuse.data.layout import Block, Layout
from navfuse.data.logs import GnssLog
from navfuse.data.nav_state import NavState
from navfuse.errors import InputError
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.states import imu_blocks
from navfuse.simulation import antenna_state, circle_flight, figure_eight_flight, gnss_fixes
from reference.engine_runs import nav_at
from reference.navigation_algebra import position_e, rotation_en

FRAMES = pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])
LEVER = np.array([1.5, -0.8, -2.0])
FAR_LEVER = np.array([30.0, -20.0, 10.0])
MODEL = ImuErrorModel(
    gyro_bias_sd=1e-2,
    accel_bias_sd=0.3,
    gyro_scale_sd=1e-2,
    accel_scale_sd=1e-2,
    gyro_cross_sd=7e-3,
    accel_cross_sd=7e-3,
)
LAYOUT = Layout.join(imu_blocks(MODEL), [Block("odometer.scale", 1, 0.01)])
MOTIONS = {
    "banked turn": figure_eight_flight(30.0, straight=2.0, bank=0.8, speed=80.0, lat=-0.6),
    "banked turn at 86 degrees": circle_flight(30.0, straight=2.0, bank=0.8, speed=80.0, lat=1.5),
}


def fixes(motion, lever=LEVER, rng=None, **options):
    return gnss_fixes(motion, 1.0, (1.0, 1.5, 2.0), (0.05, 0.06, 0.1), lever, rng, **options)


def true_state(motion, time, ecef, layout=LAYOUT):
    state = motion.at(time)
    sensor_errors = np.zeros(layout.size - 9)
    return NavState(time, nav_at(motion, time, ecef), ecef, sensor_errors, layout, state.w_ib_b[0], state.f_b[0])


@FRAMES
@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("lever", [LEVER, FAR_LEVER], ids=["lever arm of 3 m", "lever arm of 37 m"])
def test_the_true_state_predicts_an_exact_fix(name, lever, ecef):
    motion = MOTIONS[name]
    log = fixes(motion, lever)
    position, velocity = GnssPosition(log, lever), GnssVelocity(log, lever)
    for k in (0, 5, 20):
        nav = true_state(motion, log.time[k], ecef)
        north_at_the_antenna = 80.0 * np.linalg.norm(lever) * (1.0 + abs(np.tan(nav.lat))) / 6.3e6
        assert np.abs(position.linearize(nav, k)[0]).max() < 1e-7
        assert np.abs(position.subtract(position.value(k), position.predict(nav, k))).max() < 1e-7
        assert np.abs(velocity.linearize(nav, k)[0]).max() < north_at_the_antenna
        assert np.abs(velocity.value(k) - velocity.predict(nav, k)).max() < north_at_the_antenna
        assert np.linalg.norm(velocity.predict(nav, k)) == pytest.approx(np.linalg.norm(velocity.value(k)), abs=1e-9)


@FRAMES
def test_predicted_velocity_is_the_rate_of_the_predicted_position(ecef):
    motion = MOTIONS["banked turn"]
    log = fixes(motion)
    position, velocity = GnssPosition(log, LEVER), GnssVelocity(log, LEVER)
    for t in (6.0, 11.5, 20.25):
        ends = [position_e(*position.predict(true_state(motion, t + h, ecef), 0)) for h in (5e-3, -5e-3)]
        nav = true_state(motion, t, ecef)
        expected = rotation_en(nav.lat, nav.lon).T @ (ends[0] - ends[1]) / 1e-2
        assert np.abs(velocity.predict(nav, 0) - expected).max() < 2e-5


def test_predicted_antenna_is_that_of_the_simulator():
    motion = MOTIONS["banked turn"]
    r_e, _ = antenna_state(motion, np.array([7.5]), FAR_LEVER)
    predicted = GnssPosition(fixes(motion), FAR_LEVER).predict(true_state(motion, 7.5, False), 0)
    assert np.linalg.norm(position_e(*predicted) - r_e[0]) < 1e-8


def wrong_state(motion, time, ecef):
    """A state off by metres, decimetres per second and a degree, with sensor errors."""
    rng = np.random.default_rng(1)
    nav = true_state(motion, time, ecef)
    delta = np.zeros(LAYOUT.size)
    delta[:9] = rng.standard_normal(9) * np.repeat([5.0, 0.3, 0.02], 3)
    moved = nav.boxplus(delta)
    moved.states = rng.standard_normal(LAYOUT.size - 9) * 1e-3
    return moved


@FRAMES
@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("kind", [GnssPosition, GnssVelocity])
def test_jacobian_is_that_of_differences(name, kind, ecef):
    motion = MOTIONS[name]
    sensor = kind(fixes(motion, rng=np.random.default_rng(0)), FAR_LEVER)
    nav = wrong_state(motion, 10.0, ecef)
    z, H, _ = sensor.linearize(nav, 10)
    numeric = numerical_jacobian(sensor, nav, 10)
    assert np.array_equal(H, sensor.jacobian(nav, 10))
    turn_of_north_per_metre = 80.0 / 6.3e6 * (1.0 + np.abs(np.tan(nav.lat)))
    assert np.abs(H - numeric)[:, :3].max() < (1e-5 if kind is GnssPosition else turn_of_north_per_metre)
    assert np.abs(H - numeric)[:, 3:6].max() < 1e-7
    assert np.abs(H - numeric)[:, 6:9].max() < 1e-5 * np.linalg.norm(FAR_LEVER)
    assert np.abs(H - numeric)[:, 9:].max() < 1e-5
    np.testing.assert_allclose(z, AidingSensor.linearize(sensor, nav, 10)[0], atol=1e-3)


@pytest.mark.parametrize("block", ["gyro_bias", "gyro_scale", "gyro_cross"])
def test_velocity_jacobian_knows_every_error_of_the_gyroscopes(block):
    """The rate in the prediction is (I + M)^-1 (measured - bias): differences of that, not of the linear boxplus."""
    motion = MOTIONS["banked turn"]
    sensor = GnssVelocity(fixes(motion), FAR_LEVER)
    nav = true_state(motion, 10.0, False)
    where = LAYOUT.slice(block)
    columns = []
    for k in range(where.stop - where.start):
        ends = []
        for step in (1e-4, -1e-4):
            M, bias = np.eye(3), np.zeros(3)
            if block == "gyro_bias":
                bias[k] = step
            elif block == "gyro_scale":
                M[k, k] += step
            else:
                M[((0, 0, 1, 1, 2, 2)[k], (1, 2, 0, 2, 0, 1)[k])] += step
            w = np.linalg.solve(M, nav.w_ib_b - bias)
            moved = NavState(nav.time, nav.array, False, nav.states, LAYOUT, w, nav.f_b)
            ends.append(sensor.predict(moved, 10))
        columns.append((ends[0] - ends[1]) / 2e-4)
    np.testing.assert_allclose(sensor.linearize(nav, 10)[1][:, where], np.column_stack(columns), atol=1e-5)


@FRAMES
def test_without_a_lever_arm_only_position_and_velocity_show(ecef):
    motion = MOTIONS["banked turn"]
    log = fixes(motion, (0.0, 0.0, 0.0))
    nav = true_state(motion, 10.0, ecef)
    H = np.vstack([GnssPosition(log).jacobian(nav, 10), GnssVelocity(log).jacobian(nav, 10)])
    expected = np.zeros((6, LAYOUT.size))
    expected[:3, :3] = expected[3:, 3:6] = nav.C_nm
    np.testing.assert_allclose(H, expected, atol=1e-14)


def test_layouts_without_gyro_states_are_served():
    motion = MOTIONS["banked turn"]
    sensor = GnssVelocity(fixes(motion), LEVER)
    nav = true_state(motion, 10.0, False, Layout.join([]))
    assert sensor.linearize(nav, 10)[1].shape == (3, 9)


def test_noise_is_that_of_each_fix():
    log = fixes(MOTIONS["banked turn"])
    nav = true_state(MOTIONS["banked turn"], 3.0, False)
    log.sd_position[3] = (4.0, 5.0, 6.0)
    log.sd_velocity[3] = (0.4, 0.5, 0.6)
    position, velocity = GnssPosition(log), GnssVelocity(log)
    assert np.array_equal(position.linearize(nav, 3)[2], np.diag([16.0, 25.0, 36.0]))
    np.testing.assert_allclose(velocity.linearize(nav, 3)[2], np.diag([0.16, 0.25, 0.36]))
    assert position.noise(3).tolist() == [4.0, 5.0, 6.0]
    assert velocity.noise(3).tolist() == [0.4, 0.5, 0.6]


def test_difference_of_positions_is_in_metres_across_the_date_line():
    log = GnssLog(np.zeros(1), np.zeros(1), np.array([np.pi - 1e-7]), np.zeros(1), np.ones((1, 3)))
    sensor = GnssPosition(log)
    difference = sensor.subtract(sensor.value(0), np.array([0.0, 1e-7 - np.pi, 5.0]))
    np.testing.assert_allclose(difference, [0.0, -2e-7 * 6378137.0, 5.0], atol=1e-5)


def test_outages_are_half_open():
    log = fixes(MOTIONS["banked turn"])
    for sensor in (
        GnssPosition(log, outages=((5.0, 8.0), (20.0, 21.0))),
        GnssVelocity(log, outages=((5.0, 8.0), (20.0, 21.0))),
    ):
        assert [k for k in range(30) if sensor.withheld(k)] == [5, 6, 7, 20]


def test_fixes_without_velocity_are_left_out_of_the_velocities():
    log = fixes(MOTIONS["banked turn"])
    log.velocity_n[[0, 4]] = np.nan
    log.velocity_n[7, 1] = np.nan
    sensor = GnssVelocity(log, outages=((5.0, 6.0),))
    assert sensor.times.tolist() == [1.0, 2.0, 3.0, 5.0, 6.0, *range(8, 31)]
    assert np.array_equal(sensor.value(3), log.velocity_n[5])
    assert [k for k in range(10) if sensor.withheld(k)] == [3]


def test_a_log_without_velocity_has_no_velocity_sensor():
    log = gnss_fixes(MOTIONS["banked turn"], 1.0, (1.0, 1.0, 2.0), None)
    with pytest.raises(InputError, match="has no velocities; use position only"):
        GnssVelocity(log)


def test_later_fixes_join_those_that_are_there():
    whole = fixes(MOTIONS["banked turn"])
    whole.velocity_n[12] = np.nan
    rows = {"first": slice(0, 10), "second": slice(10, 31)}
    parts = {
        name: GnssLog(
            whole.time[k], whole.lat[k], whole.lon[k], whole.height[k], whole.sd_position[k], whole.velocity_n[k],
            whole.sd_velocity[k],
        )
        for name, k in rows.items()
    }  # fmt: skip
    for kind in (GnssPosition, GnssVelocity):
        sensor, expected = kind(parts["first"], outages=((11.0, 14.0),)), kind(whole, outages=((11.0, 14.0),))
        sensor.extend(parts["second"])
        assert np.array_equal(sensor.times, expected.times)
        for k in range(sensor.times.size):
            assert np.array_equal(sensor.value(k), expected.value(k))
            assert sensor.withheld(k) == expected.withheld(k)
            assert sensor.log_row(k) == expected.log_row(k)
    assert expected.log_row(12) == 13
