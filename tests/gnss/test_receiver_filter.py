"""The eight-state receiver filter: exact motion, consistency, outliers, and the published exercise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from navfuse.core.earth import geodetic_to_ecef_batch
from navfuse.data.raw_gnss import RawGnssLog
from navfuse.errors import ConfigError, InputError
from navfuse.gnss.orbits import gps_constellation
from navfuse.gnss.outliers import position_without_outliers
from navfuse.gnss.ranging import arriving_signals
from navfuse.gnss.receiver_filter import ReceiverModel, filter_receiver

MODEL = ReceiverModel(acceleration_psd=0.5)
SD_RANGE, SD_RATE = 3.0, 0.1


def drawn(seed, epochs=120, model=MODEL, dt=1.0, sd=(SD_RANGE, SD_RATE)):
    """A log of an antenna that moves as the model says, and the truth (n, 8)."""
    rng = np.random.default_rng(seed)
    Phi, Q = model.step(dt)
    x = np.zeros(8)
    x[:3] = geodetic_to_ecef_batch(np.array([0.8]), np.array([0.1]), np.array([200.0]))[0]
    x[3:6], x[6:] = rng.normal(0.0, 5.0, 3), (1e5, 120.0)
    root = np.linalg.cholesky(Q)
    truth = [x]
    for _ in range(epochs - 1):
        truth.append(Phi @ truth[-1] + root @ rng.standard_normal(8))
    truth = np.array(truth)
    time = dt * np.arange(epochs)
    constellation = gps_constellation(32)
    sat_r, sat_v, rho, rate, u = arriving_signals(constellation, time, truth[:, :3], truth[:, 3:6])
    up = np.einsum("kji,ki->kj", u, truth[:, :3] / np.linalg.norm(truth[:, :3], axis=1)[:, None]) > 0.17
    k, j = np.nonzero(up)
    names = np.array([f"G{n + 1:02d}" for n in range(len(constellation))])
    log = RawGnssLog(
        time[k],
        names[j],
        rho[k, j] + truth[k, 6] + sd[0] * rng.standard_normal(k.size),
        np.full(k.size, sd[0]),
        sat_r[k, j],
        rate[k, j] + truth[k, 7] + sd[1] * rng.standard_normal(k.size),
        np.full(k.size, sd[1]),
        sat_v[k, j],
    )
    return log, truth


def nees(track, truth):
    delta = truth - track.x
    return np.einsum("ki,kij,kj->k", delta, np.linalg.inv(track.P), delta)


@pytest.mark.parametrize("smooth", [False, True])
def test_errors_are_as_large_as_it_says(smooth):
    runs = 30
    found = np.array([nees(filter_receiver(log, MODEL, smooth=smooth), x) for log, x in map(drawn, range(runs))])
    # filter errors are independent between runs; a mean over all epochs too has no more freedom than one epoch of each
    low, high = chi2.ppf((0.0005, 0.9995), 8 * runs)
    assert np.mean((found.sum(axis=0) > low) & (found.sum(axis=0) < high)) > 0.98


def test_innovations_are_as_large_as_it_says():
    tracks = [filter_receiver(drawn(seed)[0], MODEL) for seed in range(100, 110)]
    total, dof = sum(track.nis[1:].sum() for track in tracks), sum(track.dof[1:].sum() for track in tracks)
    low, high = chi2.ppf((0.0005, 0.9995), dof)
    assert low < total < high
    # one good measurement in a hundred thousand is rejected
    assert sum((~track.used).sum() + (~track.used_rate).sum() for track in tracks) < 5
    assert not any(track.restarts for track in tracks)


def test_smoothing_helps_and_never_claims_more_than_it_knows():
    log, truth = drawn(7)
    forward, smoothed = filter_receiver(log, MODEL), filter_receiver(log, MODEL, smooth=True)
    np.testing.assert_array_equal(forward.x[-1], smoothed.x[-1])
    sd = [np.sqrt(np.diagonal(track.P, axis1=1, axis2=2)) for track in (forward, smoothed)]
    assert (sd[1] <= sd[0] * (1.0 + 1e-9)).all()
    errors = [np.sqrt(np.mean((track.x - truth)[10:-10, :3] ** 2)) for track in (forward, smoothed)]
    assert errors[1] < 0.9 * errors[0]


def test_exact_measurements_leave_no_error():
    log, truth = drawn(3, 60, sd=(1e-3, 1e-4))
    track = filter_receiver(log, MODEL)
    assert np.abs((track.x - truth)[:, :3]).max() < 0.02
    fixes = track.to_gnss_log()
    there = geodetic_to_ecef_batch(fixes.lat, fixes.lon, fixes.height)
    np.testing.assert_allclose(there, track.x[:, :3], rtol=0, atol=1e-6)
    assert np.linalg.norm(fixes.velocity_n, axis=1) == pytest.approx(np.linalg.norm(track.x[:, 3:6], axis=1))
    total = np.trace(track.P[:, :3, :3], axis1=1, axis2=2)
    assert np.sum(fixes.sd_position**2, axis=1) == pytest.approx(total)


def test_outliers_are_left_out_and_named():
    log, _ = drawn(11)
    rng = np.random.default_rng(1)
    wrong = rng.choice(len(log), len(log) // 20, replace=False)
    pseudorange = log.pseudorange.copy()
    pseudorange[wrong] += rng.choice((-1.0, 1.0), wrong.size) * rng.uniform(60.0, 500.0, wrong.size)
    track = filter_receiver(replace(log, pseudorange=pseudorange), MODEL)
    np.testing.assert_array_equal(np.flatnonzero(~track.used), np.sort(wrong))
    clean = filter_receiver(log, MODEL)
    assert np.abs(track.x - clean.x)[:, :3].max() < 4.0


def test_two_satellites_are_better_than_none():
    log, truth = drawn(5, 100)
    late = (log.time >= 50.0) & (log.time < 80.0)
    two = np.isin(log.satellite, sorted(set(log.satellite[late].tolist()))[:2])
    some, row = filter_receiver(log.take(~late | two), MODEL), 79
    Phi, Q = MODEL.step(30.0)
    without = Phi @ some.P[49] @ Phi.T + Q
    assert np.trace(some.P[row, :3, :3]) < 0.8 * np.trace(without[:3, :3])
    assert nees(some, truth)[row] < chi2.ppf(0.9999, 8)


def test_a_jump_of_everything_starts_it_anew():
    log, truth = drawn(9)
    jumped = np.where(log.time >= 60.0, 3e5, 0.0)
    track = filter_receiver(replace(log, pseudorange=log.pseudorange + jumped), MODEL)
    assert track.restarts == (64.0,)
    assert (track.nis[64], track.dof[64]) == (0.0, 0)
    assert track.dof[65] > 0
    assert np.abs((track.x - truth)[70:, :3]).max() < 15.0
    smoothed = filter_receiver(replace(log, pseudorange=log.pseudorange + jumped), MODEL, smooth=True)
    np.testing.assert_array_equal(smoothed.x[63], track.x[63])


def test_process_noise_adds_up():
    one, two = MODEL.step(1.0), MODEL.step(0.5)
    np.testing.assert_allclose(two[0] @ two[0], one[0], atol=1e-12)
    np.testing.assert_allclose(two[0] @ two[1] @ two[0].T + two[1], one[1], atol=1e-12)


def test_what_cannot_be():
    log, truth = drawn(1, 3)
    with pytest.raises(InputError, match="no epoch has four satellites"):
        filter_receiver(log.take(np.isin(log.satellite, log.satellite[:3])))
    with pytest.raises(InputError, match=r"shapes \(3,\) and \(8, 8\)"):
        filter_receiver(log, start=(0.0, np.zeros(3), np.eye(8)))
    with pytest.raises(InputError, match="are the units right"):
        filter_receiver(log, start=(0.0, np.full(8, np.nan), np.eye(8)))
    with pytest.raises(InputError, match="after the first epoch"):
        filter_receiver(log, start=(1.0, np.zeros(8), np.eye(8)))
    # A start that is known but for one direction, and a model that adds nothing.
    still = ReceiverModel(acceleration_psd=0.0, clock_phase_psd=0.0, clock_rate_psd=0.0, gate_probability=1.0)
    with pytest.raises(InputError, match=r"the covariance at [12]\.000 s cannot be smoothed"):
        filter_receiver(log, still, (0.0, truth[0], np.full((8, 8), 4.0)), smooth=True)
    for change in ({"acceleration_psd": -1.0}, {"clock_rate_psd": np.nan}):
        with pytest.raises(ConfigError, match="must be finite and not negative"):
            ReceiverModel(**change)
    with pytest.raises(ConfigError, match="gate_probability"):
        ReceiverModel(gate_probability=0.0)
    with pytest.raises(InputError, match="threshold"):
        position_without_outliers(log.pseudorange[:6], log.sat_r_e[:6], threshold=0.0)


def test_residual_test_finds_what_was_put_in():
    found = []
    for seed in range(40):
        log, _ = drawn(seed, 1)
        rng = np.random.default_rng(seed)
        j = int(rng.integers(len(log)))
        wrong = log.pseudorange.copy()
        wrong[j] += 200.0
        checked = position_without_outliers(wrong, log.sat_r_e, SD_RANGE)
        found.append(np.flatnonzero(~checked.used).tolist() == [j])
        clean = position_without_outliers(log.pseudorange, log.sat_r_e, SD_RANGE)
        assert clean.used.all()
        assert np.nanmax(np.abs(clean.statistic)) < 5.0
    assert np.mean(found) > 0.9


@pytest.fixture(name="exercise")
def _exercise(shared_data):
    folder = shared_data / "ucl-comp0130" / "workshops"
    if not folder.is_dir():
        pytest.skip("the exercises are not among the shared data")
    return folder


def test_workshop_2(exercise):
    """Filtered positions scatter less about the flight than the published single-epoch ones, and agree with them."""
    from navfuse.reproduce.multisensor_course import read_exercise

    log = read_exercise(
        exercise / "Workshop2_Pseudo_ranges.csv", exercise / "Workshop2_Pseudo_range_rates.csv", 10.0, 0.05
    )
    x = np.array([2447023.4, -5884195.9, -284784.3, 184.5, 76.9, -0.1, 9901.1, 99.9])
    P = np.diag([100.0, 100.0, 100.0, 0.01, 0.01, 0.01, 100.0, 0.01])
    track = filter_receiver(log, ReceiverModel(), (-1.0, x, P))
    printed = np.loadtxt(exercise / "Workshop2_GNSS_Pos_ECEF.csv", delimiter=",")[:, 1:]
    apart = track.x[:, :3] - printed
    assert np.sqrt(np.mean(apart**2)) < 3.0
    # the second difference of a smooth flight is small; that of noise is not
    rough = [np.sqrt(np.mean(np.diff(r, n=2, axis=0) ** 2)) for r in (track.x[:, :3], printed)]
    assert rough[0] < 0.3 * rough[1]
