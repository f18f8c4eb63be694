"""The odometry filter: derivatives, claims, constants found, start heading, refusals; a robot mower."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from navfuse.data.logs import GnssLog
from navfuse.dead_reckoning import planar_kernels
from navfuse.dead_reckoning.odometry import StartPoint, Steps, from_steps, metres_per_radian
from navfuse.dead_reckoning.planar import OdometryModel, filter_odometry, first_heading
from navfuse.errors import ConfigError, FilterError, InputError

HOME = StartPoint(np.radians(40.4), np.radians(-79.9), 300.0, 1.1)
MODEL = OdometryModel(
    distance_noise=0.05, slip_noise=0.02, turn_noise=2e-3, turn_slip=0.02, gyro_bias_sd=2e-3, gyro_bias_walk=1e-5,
    scale_sd=0.02, scale_walk=1e-5, height_walk=0.05, sd_position=0.5, sd_heading=0.05,
)  # fmt: skip
LEVER = (0.7, -0.2)
SD = 0.3
N, DT = 900, 0.2


def drawn(seed, model=MODEL, lever=LEVER):
    """Steps of a mower whose errors are those of the model, fixes every 10 s, the true track, and bias and scale."""
    rng = np.random.default_rng(seed)
    d = np.full(N, 0.2)
    w = 0.05 * np.sin(0.05 * np.arange(N)) + np.where(np.arange(N) % 150 < 15, 0.2, 0.0)
    # what really happened: noise of distance and turn, and slip across the way
    true_turn = w
    true = from_steps(Steps(DT * np.arange(N + 1), d, true_turn), HOME, lever)
    slip = np.cumsum(model.slip_noise * np.sqrt(0.2) * rng.standard_normal(N))
    psi = HOME.heading + np.cumsum(true_turn) - 0.5 * true_turn
    metres = metres_per_radian(true.lat[:1], true.height[:1])[0]
    side = np.concatenate(([0.0], np.diff(slip, prepend=0.0)))
    north = np.cumsum(-side * np.sin(np.concatenate(([0.0], psi))))
    east = np.cumsum(side * np.cos(np.concatenate(([0.0], psi))))
    height = np.cumsum(np.concatenate(([0.0], model.height_walk * np.sqrt(DT) * rng.standard_normal(N))))
    true = replace(true, lat=true.lat + north / metres[0], lon=true.lon + east / metres[1], height=true.height + height)
    bias = model.gyro_bias_sd * rng.standard_normal() + np.cumsum(
        model.gyro_bias_walk * np.sqrt(DT) * rng.standard_normal(N)
    )
    scale = model.scale_sd * rng.standard_normal() + np.cumsum(model.scale_walk * np.sqrt(DT) * rng.standard_normal(N))
    distance = (d + model.distance_noise * np.sqrt(0.2) * rng.standard_normal(N)) * (1.0 + scale)
    spread = np.sqrt(model.turn_noise**2 * DT + model.turn_slip**2 * np.abs(w))
    turn = true_turn + DT * bias + spread * rng.standard_normal(N)
    at = np.arange(0, N + 1, 50)
    off = SD * rng.standard_normal((at.size, 3))
    fixes = GnssLog(
        true.time[at], true.lat[at] + off[:, 0] / metres[0], true.lon[at] + off[:, 1] / metres[1],
        true.height[at] - off[:, 2], np.full((at.size, 3), SD),
    )  # fmt: skip
    wrong = model.sd_position * rng.standard_normal(3)
    start = StartPoint(
        HOME.lat + wrong[0] / metres[0], HOME.lon + wrong[1] / metres[1], HOME.height - wrong[2],
        HOME.heading + model.sd_heading * rng.standard_normal(),
    )  # fmt: skip
    return Steps(true.time, distance, turn), fixes, start, true, (bias, scale)


def error(track, true):
    metres = metres_per_radian(true.lat, true.height)
    return np.column_stack(
        ((true.lat - track.lat) * metres[:, 0], (true.lon - track.lon) * metres[:, 1], track.height - true.height)
    )


def test_the_transition_is_the_derivative_of_the_step():
    x = np.array([HOME.lat, HOME.lon, HOME.height, 0.8, 3e-3, 0.02])
    noise = (0.05, 0.02, 1e-3, 0.01, 0.05, 1e-6, 1e-5)

    def step(start):
        found, Phi = start.copy(), np.zeros((6, 6))
        planar_kernels.advance(found, np.eye(6), 0.9, 0.04, 0.2, noise, Phi)
        return found, Phi

    centre, Phi = step(x)
    metres = metres_per_radian(centre[:1], centre[2:3])[0]
    scaled = np.array([metres[0], metres[1], -1.0, 1.0, 1.0, 1.0])
    small = np.array([1e-2, 1e-2, 1e-2, 1e-3, 1e-3, 1e-3])
    for k in range(6):
        ends = []
        for sign in (-1.0, 1.0):
            moved, dx = x.copy(), np.zeros(6)
            dx[k] = sign * small[k]
            planar_kernels.correct(moved, dx)
            ends.append(step(moved)[0])
        derivative = (ends[1] - ends[0]) * scaled / (2.0 * small[k])
        # sinc of the half turn is taken as constant: second order in the turn
        np.testing.assert_allclose(Phi[:, k], derivative, atol=2e-3 * (k == 4) + 3e-6, rtol=0)


def test_errors_and_innovations_are_as_large_as_it_says():
    runs = 60
    sums, nis, dof = {"forward": [], "smoothed": [], "constants": []}, 0.0, 0
    model = replace(MODEL, gate_probability=1.0)
    for seed in range(runs):
        steps, fixes, start, true, (bias, scale) = drawn(seed)
        found = filter_odometry(steps, fixes, start, model, lever=LEVER)
        for role in ("forward", "smoothed"):
            best = getattr(found, role)
            ratio = error(best, true) / best.sd_position
            turned = (true.attitude[:, 2] - best.attitude[:, 2] + np.pi) % (2 * np.pi) - np.pi
            sums[role].append([*(ratio[625] ** 2), (turned[625] / best.sd_attitude[625, 2]) ** 2])
        last = [(found.states[name].values[-1, 0] - value[-1]) / found.states[name].sd[-1, 0]
                for name, value in (("yaw_gyro_bias", bias), ("odometer_scale", scale))]  # fmt: skip
        sums["constants"].append(np.square(last))
        nis, dof = nis + found.innovations.nis.sum(), dof + found.innovations.dof.sum()
    low, high = chi2.ppf((0.0005, 0.9995), runs)
    for role, squares in sums.items():
        total = np.sum(squares, axis=0)
        assert ((total > low) & (total < high)).all(), (role, total)
    low, high = chi2.ppf((0.0005, 0.9995), dof)
    assert low < nis < high


def test_a_model_with_half_the_noise_is_overconfident():
    told = replace(MODEL, distance_noise=0.025, slip_noise=0.01, turn_noise=1e-3, turn_slip=0.01, gate_probability=1.0)
    nis = dof = 0.0
    for seed in range(30):
        steps, fixes, start, _, _ = drawn(seed)
        found = filter_odometry(steps, replace(fixes, sd_position=0.5 * fixes.sd_position), start, told, lever=LEVER)
        nis, dof = nis + found.innovations.nis.sum(), dof + found.innovations.dof.sum()
    assert nis > chi2.ppf(0.9995, dof)


def test_without_noise_bias_and_scale_are_found_to_the_digit():
    steps = Steps(DT * np.arange(N + 1), np.full(N, 0.2), np.where(np.arange(N) % 100 < 20, 0.1, -0.005))
    true = from_steps(steps, HOME)
    at = np.arange(0, N + 1, 20)
    fixes = GnssLog(true.time[at], true.lat[at], true.lon[at], true.height[at], np.full((at.size, 3), 0.01))
    wrong = Steps(steps.time, 1.02 * steps.distance, steps.turn + DT * 2e-3)
    found = filter_odometry(wrong, fixes, HOME, OdometryModel(gyro_bias_sd=5e-3, scale_sd=0.05, sd_heading=0.1))
    assert found.states["yaw_gyro_bias"].values[-1, 0] == pytest.approx(2e-3, abs=3e-5)
    assert found.states["odometer_scale"].values[-1, 0] == pytest.approx(0.02, abs=3e-3)
    assert np.abs(error(found.smoothed, true)[:, :2]).max() < 0.02
    # without the two states it has to take them for noise
    plain = filter_odometry(wrong, fixes, HOME, OdometryModel(gyro_bias_sd=0.0, scale_sd=0.0, sd_heading=0.1))
    assert plain.states == {}
    assert np.abs(error(plain.smoothed, true)[:, :2]).max() > np.abs(error(found.smoothed, true)[:, :2]).max()


def test_a_fix_inside_a_step_is_compared_there():
    steps = Steps(np.arange(21.0), np.full(20, 2.0), np.full(20, 0.05))
    true = from_steps(steps, HOME, LEVER)
    fine = from_steps(Steps(0.25 * np.arange(81), np.full(80, 0.5), np.full(80, 0.0125)), HOME, LEVER)
    at = np.array([13, 30, 55, 80])
    fixes = GnssLog(fine.time[at], fine.lat[at], fine.lon[at], fine.height[at], np.full((4, 3), 0.05))
    found = filter_odometry(steps, fixes, HOME, lever=LEVER)
    # the chord of a step instead of its arc
    assert np.abs(found.innovations.z).max() < 0.02
    np.testing.assert_allclose(found.smoothed.lat, true.lat, atol=1e-8)


def test_the_heading_at_the_start_is_found():
    steps, fixes, start, true, _ = drawn(3)
    turned = replace(start, heading=0.0)
    heading, sd = first_heading(steps, fixes, LEVER)
    assert abs(heading - HOME.heading) < 4.0 * sd < 1.0
    found = filter_odometry(steps, fixes, replace(turned, heading=heading), replace(MODEL, sd_heading=sd), lever=LEVER)
    assert np.abs(error(found.smoothed, true)[:, :2]).max() < 1.5
    with pytest.raises(InputError, match="too near to each other for a heading"):
        first_heading(Steps(steps.time, 0.001 * steps.distance, steps.turn), fixes)
    with pytest.raises(InputError, match="a heading needs two"):
        first_heading(steps, fixes.take(slice(0, 1)))


def test_outliers_and_a_jump():
    steps, fixes, start, true, _ = drawn(5)
    lat = fixes.lat.copy()
    lat[6] += 100.0 / 6.4e6
    one = filter_odometry(steps, replace(fixes, lat=lat), start, MODEL, lever=LEVER, outages=[(100.0, 115.0)])
    assert one.innovations.row[one.innovations.status == "rejected"].tolist() == [6]
    assert one.innovations.count("gnss_position", "withheld") == 2
    assert np.abs(error(one.smoothed, true)[:, :2]).max() < 1.5
    jumped = replace(fixes, lat=fixes.lat + 300.0 / 6.4e6 * (fixes.time > 60.0))
    two = filter_odometry(steps, jumped, start, MODEL, lever=LEVER)
    assert two.innovations.count("gnss_position", "reset") >= 1
    assert abs(error(two.forward, true)[-1, 0] + 300.0) < 5.0


def test_what_it_refuses():
    steps, fixes, start, _, _ = drawn(6)
    with pytest.raises(InputError, match="no fix lies inside"):
        filter_odometry(steps, replace(fixes, time=fixes.time - 1e5), start)
    with pytest.raises(InputError, match=r"gnss: row 1 at .* is not later"):
        filter_odometry(steps, replace(fixes, time=fixes.time[::-1].copy()), start)
    with pytest.raises(FilterError, match="the odometry filter failed at"):
        filter_odometry(steps, replace(fixes, sd_position=np.full_like(fixes.sd_position, np.nan)), start)
    with pytest.raises(ConfigError, match="turn_noise = -1.0 must be finite and not negative"):
        OdometryModel(turn_noise=-1.0)
    with pytest.raises(ConfigError, match="sd_heading = 0 must be positive"):
        OdometryModel(sd_heading=0.0)
    with pytest.raises(ConfigError, match="gate_probability = 2"):
        OdometryModel(gate_probability=2.0)


def test_a_smoother_that_fails_says_where(monkeypatch):
    steps, fixes, start, _, _ = drawn(6)
    monkeypatch.setattr(planar_kernels, "run_backward", lambda *arrays: 5)
    with pytest.raises(FilterError, match=r"the odometry smoother failed at 1\.000 s"):
        filter_odometry(steps, fixes, start, MODEL, lever=LEVER)
