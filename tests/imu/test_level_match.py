"""The kernels against slow twins, and least squares against what was put in."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.imu.axes_reading import along_track
from navfuse.imu.grades import grade
from navfuse.imu.level_kernels import correlate, read_rows
from navfuse.imu.level_match import prepare, refine, scan
from navfuse.imu.seen_motion import Stretches, chain, coarse_increments, stretches
from navfuse.simulation import car_drive, simulate


@pytest.fixture(scope="module")
def logs():
    made = simulate(car_drive(150.0, seed=2), grade("tactical"), 1, gnss_rate=2.0, lever_arm_b=(1.2, -0.7, -0.9))
    return made.imu, made.gnss


@pytest.fixture(scope="module", params=[False, True], ids=["velocities", "positions"])
def match(request, logs):
    imu, gnss = logs
    increments, holes = coarse_increments(imu)
    return prepare(chain(increments, holes), stretches(gnss, 5.0, 145.0, holes, request.param, 5.0))


def test_reading_between_rows():
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.01, 0.2, 60))
    values = rng.standard_normal((60, 3))
    at = np.concatenate([time, rng.uniform(time[0] - 1.0, time[-1] + 1.0, 200), time[::-1]])
    out = np.empty((at.size, 3))
    read_rows(time, values, at, out)
    expected = np.stack([np.interp(at, time, column) for column in values.T], axis=1)
    assert np.allclose(out, expected, rtol=0.0, atol=1e-13)


def test_products_of_detrended_signals():
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.uniform(0.02, 0.05, 1500))
    integral = np.cumsum(rng.standard_normal((1500, 3)), axis=0)
    basis = np.stack([np.linalg.qr(rng.standard_normal((3, 3)))[0][:2] for _ in range(4)])
    rows = np.sort(rng.uniform(5.0, 45.0, (4, 30)), axis=1)
    weight = rng.uniform(0.2, 1.0, (4, 30)) * (rng.random((4, 30)) > 0.2)
    lags = np.array([-1.3, 0.0, 0.45])
    columns = np.stack([rows**p for p in range(3)], axis=2) * weight[:, :, None]
    nuisance = np.linalg.qr(columns)[0]
    other = (rng.standard_normal((4, 30)) + 1j * rng.standard_normal((4, 30))) * weight
    seen = np.stack([y - c @ np.linalg.lstsq(c, y, rcond=None)[0] for y, c in zip(other, columns, strict=True)])
    power, plain, mirrored = np.empty((3, 4)), np.empty((3, 4), complex), np.empty((3, 4), complex)
    correlate(time, integral, basis, rows, weight, nuisance, seen, lags, power, plain, mirrored)
    for j, lag in enumerate(lags):
        for w in range(4):
            read = np.stack([np.interp(rows[w] - lag, time, column) for column in integral.T], axis=1)
            A = (read @ basis[w, 0] + 1j * (read @ basis[w, 1])) * weight[w]
            A = A - columns[w] @ np.linalg.lstsq(columns[w], A, rcond=None)[0]
            assert power[j, w] == pytest.approx(np.vdot(A, A).real, rel=1e-9)
            assert plain[j, w] == pytest.approx(np.vdot(A, seen[w]), rel=1e-8, abs=1e-8)
            assert mirrored[j, w] == pytest.approx(np.sum(A * seen[w]), rel=1e-8, abs=1e-8)


def test_lever_arm_and_offset_together(match):
    """The arm along the course and the offset are told apart, within their standard deviations."""
    fit = refine(match, 0.0)
    assert abs(fit.offset) < 4.0 * fit.sd
    assert np.all(np.abs(fit.lever - (1.2, -0.7, -0.9)) < 4.0 * fit.sd_lever)
    assert fit.modulus == pytest.approx(1.0, abs=0.1 if match.rows.positions else 0.01)
    assert fit.inflation < 1.5


def test_a_known_lever_arm_would_only_help(match):
    """The standard deviation allows for what is not known: it exceeds that of the noise alone."""
    fit = refine(match, 0.0)
    assert fit.sd_lever[0] < 1.5
    assert 0.0 < fit.sd < 0.2


def test_the_first_offset_does_not_matter(match):
    starts = [refine(match, offset).offset for offset in (-0.3, 0.0, 0.25)]
    assert np.ptp(starts) < 2e-3


def test_the_best_shift_is_the_true_one(match):
    plain, mirrored = scan(match, np.arange(-3.0, 3.05, 0.1))
    assert plain.lags[np.argmin(plain.deviance)] == pytest.approx(0.0, abs=0.15)
    assert plain.deviance.min() < mirrored.deviance.min() - 200.0
    assert np.all(plain.correlation <= plain.alike + 1e-12)


def test_along_the_track():
    """A circle at 10 m/s: the speed stays, what comes across is speed times turned angle."""
    time = np.arange(0.0, 30.0, 0.5)[None, :]
    velocity = 10.0 * np.exp(0.2j * time)
    rows = along_track(Stretches(time, velocity, np.ones_like(time), positions=False))
    assert np.allclose(rows.seen, 10.0 + 2.0j * time, atol=1e-9)
    places = along_track(Stretches(time, velocity / 0.2j, np.ones_like(time), positions=True))
    chord = 10.0 * np.sin(0.4) / 0.4
    assert np.allclose(places.seen.real, chord, atol=1e-9)
    assert np.allclose(np.diff(places.seen.imag, axis=1), 0.1 * chord, atol=1e-9)
    assert np.allclose(places.time, time[:, 4:-4])
