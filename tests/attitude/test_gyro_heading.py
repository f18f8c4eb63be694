from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from navfuse.analysis.consistency import average_bounds, nis_summary
from navfuse.attitude.gyro_heading import SOURCE, GyroHeadingSettings, gyro_heading
from navfuse.attitude.heading_logs import YawRateLog, magnetic_heading, yaw_rate_from_imu
from navfuse.data.aiding_logs import HeadingLog
from navfuse.errors import ConfigError, FilterError, InputError, NavfuseWarning
from navfuse.simulation.scenario import load_scenario
from navfuse.simulation.scenario_run import run_scenario, scenario_truth

DEGREE = np.pi / 180.0
MODEL = GyroHeadingSettings(
    gyro_noise=2e-3, gyro_bias_sd=0.02, gyro_bias_walk=2e-4, heading_sd=4.0 * DEGREE, gate_probability=1.0
)


def wrap(x):
    return np.angle(np.exp(1j * np.asarray(x)))


def drawn(seed, seconds=300.0, settings=MODEL, heading_step=0.5, rate=None):
    """Logs that obey the model of the filter exactly, and the true heading and bias at the gyro stamps."""
    rng = np.random.default_rng(seed)
    dt = 0.1
    time = dt * np.arange(round(seconds / dt) + 1)
    true_rate = 0.4 * np.sin(0.05 * time[1:]) + 0.3 if rate is None else rate(time[1:])
    heading = 5.9 + np.concatenate([[0.0], np.cumsum(true_rate * dt)])
    walk = settings.gyro_bias_walk
    bias = settings.gyro_bias_sd * rng.standard_normal() + walk * np.sqrt(dt) * np.cumsum(
        rng.standard_normal(time.size)
    )
    # The mean of the bias over an interval, and the rest of its walk inside it, which Q counts as S tau^3 / 3.
    inside = walk * np.sqrt(dt**3 / 12.0) * rng.standard_normal(time.size - 1)
    turn = true_rate * dt + 0.5 * (bias[1:] + bias[:-1]) * dt + inside
    turn += settings.gyro_noise * np.sqrt(dt) * rng.standard_normal(time.size - 1)
    yaw = YawRateLog(time, np.concatenate([[0.0], turn / dt]), averaged=True)
    rows = np.arange(0, time.size, round(heading_step / dt))
    measured = heading[rows] + settings.heading_sd * rng.standard_normal(rows.size)
    return yaw, HeadingLog(time[rows], np.mod(measured, 2.0 * np.pi)), heading, bias


def test_open_loop_with_correction_is_closed_loop():
    yaw, heading, _, _ = drawn(1)
    for gate in (1.0, 0.9):
        both = [
            gyro_heading(yaw, heading, GyroHeadingSettings(gyro_noise=2e-3, gate_probability=gate, feedback=feedback))
            for feedback in ("open", "closed")
        ]
        assert (both[0].innovations.status == both[1].innovations.status).all()
        for name in ("forward", "smoothed"):
            one, other = (getattr(run, name) for run in both)
            np.testing.assert_allclose(wrap(one.heading - other.heading), 0.0, atol=1e-11)
            np.testing.assert_allclose(one.gyro_bias, other.gyro_bias, atol=1e-13)
            np.testing.assert_allclose(one.P, other.P, rtol=1e-12)


def test_filter_and_smoother_are_batch_least_squares():
    settings = GyroHeadingSettings(gyro_noise=2e-3, gyro_bias_walk=5e-4, gate_probability=1.0)
    yaw, heading, _, _ = drawn(2, seconds=4.0)
    run = gyro_heading(yaw, heading, settings)
    n = yaw.time.size
    # Unknowns: heading, and bias, at every stamp. Rows are weighted to unit variance.
    rows, values = [], []

    def add(block, value, W):
        root = np.linalg.inv(np.linalg.cholesky(W))
        rows.append(root @ block)
        values.append(root @ np.atleast_1d(value))

    def unit(k):
        e = np.zeros((1, 2 * n))
        e[0, k] = 1.0
        return e

    unwrapped = np.unwrap(heading.heading)
    add(unit(0), unwrapped[0], np.array([[settings.heading_sd**2]]))
    add(unit(1), 0.0, np.array([[settings.gyro_bias_sd**2]]))
    s, q = settings.gyro_noise**2, settings.gyro_bias_walk**2
    for k in range(1, n):
        dt = yaw.time[k] - yaw.time[k - 1]
        block = np.vstack([unit(2 * k) - unit(2 * k - 2) + dt * unit(2 * k - 1), unit(2 * k + 1) - unit(2 * k - 1)])
        Q = np.array([[s * dt + q * dt**3 / 3.0, -0.5 * q * dt**2], [-0.5 * q * dt**2, q * dt]])
        add(block, np.array([yaw.rate[k] * dt, 0.0]), Q)
    for k, value in list(zip(np.searchsorted(yaw.time, heading.time), unwrapped, strict=True))[1:]:
        add(unit(2 * k), value, np.array([[settings.heading_sd**2]]))
    A, b = np.vstack(rows), np.concatenate(values)
    solution, cov = np.linalg.lstsq(A, b, rcond=None)[0], np.linalg.inv(A.T @ A)
    np.testing.assert_allclose(wrap(run.smoothed.heading - solution[0::2]), 0.0, atol=1e-9)
    np.testing.assert_allclose(run.smoothed.gyro_bias, solution[1::2], atol=1e-9)
    np.testing.assert_allclose(run.smoothed.sd_heading**2, np.diagonal(cov)[0::2], rtol=1e-7)
    np.testing.assert_allclose(run.forward.P[-1], cov[-2:, -2:], rtol=1e-7)


def test_consistency_over_seeds():
    seeds, nees, nis = 40, {"forward": [], "smoothed": []}, []
    for seed in range(seeds):
        yaw, heading, truth, bias = drawn(seed)
        run = gyro_heading(yaw, heading, MODEL)
        nis.append(run.innovations.nis)
        for name in nees:
            solution = getattr(run, name)
            k = truth.size * 2 // 3
            e = np.array([wrap(truth[k] - solution.heading[k]), bias[k] - solution.gyro_bias[k]])
            nees[name].append(e @ np.linalg.solve(solution.P[k], e))
    for name, values in nees.items():
        low, high = average_bounds(2 * seeds)
        assert low < np.mean(values) / 2.0 < high, name
    nis = np.concatenate(nis)
    low, high = average_bounds(nis.size)
    assert low < nis.mean() < high
    # The negative test: half the true noise has to be told as overconfident.
    yaw, heading, _, _ = drawn(0)
    bold = GyroHeadingSettings(gyro_noise=2e-3, gyro_bias_walk=2e-4, heading_sd=2.0 * DEGREE, gate_probability=1.0)
    assert "overconfident" in nis_summary(gyro_heading(yaw, heading, bold).innovations)[SOURCE].verdict


@pytest.mark.parametrize("name", ["lawnmower", pytest.param("rc-car", marks=pytest.mark.slow)])
def test_bars_on_a_scenario(name):
    truth = scenario_truth(load_scenario(name))
    ideal = yaw_rate_from_imu(truth.ideal_imu)
    step = np.diff(ideal.time).mean()
    psi = truth.motion.trajectory(ideal.time).attitude[:, 2]
    rows = np.arange(0, psi.size, round(0.5 / step))
    bias, late = 1.0 * DEGREE, ideal.time > ideal.time[0] + 120.0
    errors, found = {"forward": [], "smoothed": []}, []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        noise = 7e-5 / np.sqrt(step) * rng.standard_normal(psi.size)
        measured = np.mod(psi[rows] + 4.0 * DEGREE * rng.standard_normal(rows.size), 2.0 * np.pi)
        run = gyro_heading(
            YawRateLog(ideal.time, ideal.rate + bias + noise, averaged=True),
            HeadingLog(ideal.time[rows], measured),
            GyroHeadingSettings(gyro_noise=7e-5, gyro_bias_sd=0.03),
        )
        for which, kept in errors.items():
            kept.append(np.mean(wrap(getattr(run, which).heading - psi)[late] ** 2))
        found.append(run.forward.gyro_bias[-1] - bias)
    assert np.sqrt(np.mean(errors["forward"])) <= 0.5 * DEGREE
    assert np.sqrt(np.mean(errors["smoothed"])) <= 0.3 * DEGREE
    assert np.abs(found).max() <= 0.02 * DEGREE


@pytest.mark.slow
def test_the_model_car_with_its_own_magnetometer_stays_on_course():
    logs = run_scenario(load_scenario("rc-car"), 3)
    log, truth = logs.sensors["magnetometer"]
    declination = float(np.arctan2(truth.field_n[0, 1], truth.field_n[0, 0]))
    compass = magnetic_heading(log)
    run = gyro_heading(
        yaw_rate_from_imu(logs.imu), compass,
        GyroHeadingSettings(gyro_bias_sd=0.01, heading_sd=10.0 * DEGREE, declination=declination),
    )  # fmt: skip
    motion = logs.truth.motion
    inside = (run.forward.time >= motion.start) & (run.forward.time <= motion.end)
    true = motion.trajectory(run.forward.time[inside]).attitude[:, 2]
    raw = np.interp(run.forward.time[inside], compass.time, np.unwrap(compass.heading)) + declination
    error = np.sqrt(np.mean(wrap(run.smoothed.heading[inside] - true) ** 2))
    # Hard iron of the scenario (3 uT of 22 uT) turns the compass by degrees, to and fro as the car circles.
    assert error < 3.0 * DEGREE
    assert error < 0.7 * np.sqrt(np.mean(wrap(raw - true) ** 2))


def test_coursework_lawnmower(shared_data):
    table = np.loadtxt(shared_data / "ucl-comp0130" / "cw1-A" / "Dead_reckoning.csv", delimiter=",")
    yaw = YawRateLog(table[:, 0], table[:, 5], averaged=True)
    heading = HeadingLog(table[:, 0], np.mod(np.radians(table[:, 6]), 2.0 * np.pi))
    kept = {}
    for sd in (2.0, 4.0):
        settings = GyroHeadingSettings(
            gyro_noise=8.2e-5, gyro_bias_sd=1.0 * DEGREE, gyro_scale_sd=0.01, heading_sd=sd * DEGREE
        )
        run = gyro_heading(yaw, heading, settings)
        kept[sd] = nis_summary(run.innovations)[SOURCE]
        assert abs(run.forward.gyro_bias[-1] / DEGREE) < 1.0
    # The file is said to have a compass of 4 deg; it has one of 2 deg, with which the innovations fit and are white.
    assert kept[2.0].verdict == "consistent"
    assert kept[2.0].white
    assert kept[4.0].verdict == "pessimistic by factor 2.00"


def test_headings_wrap_and_may_come_between_gyro_stamps():
    time = np.arange(0.0, 60.0, 0.1)
    rate = np.full(time.size, 0.5)
    stamps = np.arange(0.03, 59.0, 0.77)
    true = 6.2 + 0.5 * stamps
    for averaged in (True, False):
        run = gyro_heading(
            YawRateLog(time, rate, averaged=averaged), HeadingLog(stamps, np.mod(true, 2.0 * np.pi)), MODEL
        )
        np.testing.assert_allclose(wrap(run.smoothed.heading - (6.2 + 0.5 * run.smoothed.time)), 0.0, atol=1e-9)
        assert np.all((run.forward.heading >= 0.0) & (run.forward.heading < 2.0 * np.pi))
        np.testing.assert_allclose(run.forward.gyro_bias, 0.0, atol=1e-9)


def test_a_linear_rate_is_integrated_exactly():
    time = np.array([0.0, 1.0, 3.0, 4.0])
    yaw = YawRateLog(time, 0.2 + 0.6 * time)
    at = np.array([0.0, 0.5, 2.2, 3.9])
    np.testing.assert_allclose(yaw.turned(at), 0.2 * at + 0.3 * at**2, rtol=1e-13)


def test_a_disturbance_is_rejected_and_a_lasting_one_believed_in_the_end():
    settings = GyroHeadingSettings(gyro_noise=1e-4, heading_sd=2.0 * DEGREE, patience=20.0)
    yaw, heading, truth, _ = drawn(4, settings=MODEL, seconds=400.0)
    disturbed = heading.heading.copy()
    magnet = (heading.time >= 100.0) & (heading.time < 110.0)
    disturbed[magnet] += 1.0
    run = gyro_heading(yaw, HeadingLog(heading.time, np.mod(disturbed, 2.0 * np.pi)),
                       GyroHeadingSettings(gyro_noise=2e-3, heading_sd=4.0 * DEGREE, patience=20.0))  # fmt: skip
    inside = (run.innovations.time >= 100.0) & (run.innovations.time < 110.0)
    assert (run.innovations.status[inside] == "rejected").all()
    assert np.abs(wrap(run.forward.heading - truth)).max() < 8.0 * DEGREE
    # For good: rejected for the patience, then used.
    lasting = heading.heading + np.where(heading.time >= 100.0, 1.0, 0.0)
    run = gyro_heading(yaw, HeadingLog(heading.time, np.mod(lasting, 2.0 * np.pi)), settings)
    status = run.innovations.status[run.innovations.time >= 100.0]
    assert (status[:38] == "rejected").all()
    assert "reset" in status[:60]
    late = run.forward.time > 300.0
    assert np.abs(wrap(run.forward.heading - truth - 1.0))[late].max() < 5.0 * DEGREE


def unseen(turn=0.0, first=0.0, bias=0.005, seconds=300.0):
    """A gyro of known bias and a compass of 1 deg; the body turns unseen at 150 s, the first heading is disturbed."""
    rng = np.random.default_rng(0)
    time = np.arange(0.0, seconds, 0.1)
    rate = 0.1 * np.sin(0.05 * time)
    true = np.concatenate([[0.0], np.cumsum(0.05 * (rate[1:] + rate[:-1]))]) + np.where(time >= 150.0, turn, 0.0)
    measured = true[::10] + DEGREE * rng.standard_normal(time[::10].size)
    measured[0] += first
    yaw = YawRateLog(time, rate + bias + 1e-4 * rng.standard_normal(time.size))
    return yaw, HeadingLog(time[::10], np.mod(measured, 2.0 * np.pi)), true


@pytest.mark.parametrize("feedback", ["open", "closed"])
def test_a_turn_that_the_gyro_did_not_see_is_not_carried_back(feedback):
    yaw, heading, true = unseen(turn=60.0 * DEGREE)
    run = gyro_heading(yaw, heading, GyroHeadingSettings(heading_sd=DEGREE, feedback=feedback), check=False)
    assert (run.innovations.status == "reset").sum() == 1
    for solution in (run.forward, run.smoothed):
        for within in ((yaw.time > 20.0) & (yaw.time < 149.0), yaw.time > 200.0):
            off = wrap(solution.heading - true)[within]
            assert np.abs(off / solution.sd_heading[within]).max() < 4.5
            assert np.abs(off).max() < 1.0 * DEGREE
            assert np.abs((solution.gyro_bias - 0.005) / solution.sd_gyro_bias)[within].max() < 4.5
            assert solution.sd_gyro_bias[within].max() < 1e-3


@pytest.mark.parametrize("first", [60.0, -170.0])
def test_a_first_heading_that_is_wrong_does_not_start_it(first):
    yaw, heading, true = unseen(first=first * DEGREE)
    run = gyro_heading(yaw, heading, GyroHeadingSettings(heading_sd=DEGREE), check=False)
    assert (run.innovations.status == "used").mean() > 0.99
    for solution in (run.forward, run.smoothed):
        off = wrap(solution.heading - true)
        assert np.abs(off / solution.sd_heading).max() < 4.5
        assert np.abs(off[20:]).max() < 4.0 * DEGREE
    # A good first heading is the start as it is; so is one of two, of which nothing tells which is wrong.
    yaw, heading, _ = unseen()
    run = gyro_heading(yaw, heading, GyroHeadingSettings(heading_sd=DEGREE), check=False)
    assert wrap(run.gyro_only[0] - heading.heading[0]) == pytest.approx(0.0, abs=1e-12)
    two = HeadingLog(heading.time[:2], np.array([1.0, 3.0]))
    run = gyro_heading(yaw, two, GyroHeadingSettings(gate_probability=1.0), check=False)
    assert run.gyro_only[0] == 1.0


def test_the_heading_of_a_start_from_the_median_is_as_good_as_it_says():
    squares = []
    for seed in range(60):
        yaw, heading, truth, _ = drawn(seed, seconds=10.0)
        values = heading.heading.copy()
        values[0] += 1.5
        settings = replace(MODEL, gate_probability=0.9999)
        run = gyro_heading(yaw, HeadingLog(heading.time, np.mod(values, 2.0 * np.pi)), settings, check=False)
        at = [0, 20, 60]
        squares.append((wrap(truth[at] - run.forward.heading[at]) / run.forward.sd_heading[at]) ** 2)
    mean = np.mean(squares, axis=0)
    assert mean.max() < average_bounds(60)[1]
    assert mean.min() > 0.1


def test_a_compass_that_never_fits_is_told():
    yaw, heading, _ = unseen(seconds=100.0)
    wild = HeadingLog(heading.time, np.random.default_rng(1).uniform(0.0, 6.28, heading.time.size))
    with pytest.warns(NavfuseWarning, match=r"of 99 headings do not fit .* were rejected; check heading_sd"):
        gyro_heading(yaw, wild, GyroHeadingSettings(heading_sd=DEGREE), check=False)


def test_settings_that_leave_nothing_uncertain_cannot_be_smoothed():
    yaw, heading, _ = unseen(seconds=20.0)
    with pytest.raises(FilterError, match=r"the covariance at 19\.900 s cannot be smoothed; set gyro_noise"):
        gyro_heading(yaw, heading, GyroHeadingSettings(gyro_bias_sd=0.0, gyro_bias_walk=0.0), check=False)


def test_declination_turns_the_result():
    yaw, heading, _, _ = drawn(6, seconds=60.0)
    plain = gyro_heading(yaw, heading, MODEL).smoothed.heading
    turned = gyro_heading(
        yaw, heading, GyroHeadingSettings(gyro_noise=2e-3, gyro_bias_sd=0.02, gyro_bias_walk=2e-4,
                                          gate_probability=1.0, declination=-0.19)
    ).smoothed.heading  # fmt: skip
    np.testing.assert_allclose(wrap(turned - plain), -0.19, atol=1e-10)


def test_logs_that_do_not_meet_are_refused():
    yaw, heading, _, _ = drawn(7, seconds=20.0)
    with pytest.raises(InputError, match="fewer than two headings lie inside"):
        gyro_heading(yaw, HeadingLog(heading.time + 1e6, heading.heading), MODEL)


@pytest.mark.parametrize(
    ("key", "value"),
    [("gyro_noise", -1.0), ("gyro_bias_walk", np.nan), ("heading_sd", 0.0), ("declination", 4.0),
     ("gate_probability", 0.0), ("patience", np.inf), ("feedback", "half")],
)  # fmt: skip
def test_settings_out_of_range_are_refused(key, value):
    with pytest.raises(ConfigError, match=key):
        GyroHeadingSettings(**{key: value})
