"""Rate, gaps and spectra of logs whose answers are known."""

import numpy as np
import pytest
from scipy.signal import welch

from navfuse.data.logs import ImuLog
from navfuse.imu.overview import imu_overview


def _log(time, sd=(0.01, 0.2), kind="rates", seed=1):
    rng = np.random.default_rng(seed)
    gyro, accel = (rng.normal(0.0, each, (time.size, 3)) for each in sd)
    return ImuLog(time, gyro, accel, kind)


def test_white_noise_has_the_density_of_its_variance():
    rate, time = 100.0, np.arange(60_000) / 100.0
    found = imu_overview(_log(time))
    assert found.usual_rate == pytest.approx(rate)
    np.testing.assert_allclose(found.rate, rate, rtol=0.02)
    # one-sided: the variance is spread from zero to half the rate
    np.testing.assert_allclose(found.gyro_psd.mean(axis=0), 0.01**2 / 50.0, rtol=0.03)
    np.testing.assert_allclose(found.accel_psd.mean(axis=0), 0.2**2 / 50.0, rtol=0.03)
    assert found.frequency[-1] == pytest.approx(50.0)


def test_increments_have_the_spectra_of_their_rates():
    time = np.arange(20_000) / 200.0
    rates = _log(time)
    increments = ImuLog(time, rates.gyro / 200.0, rates.accel / 200.0, "increments")
    # the first row of increments covers an unknown time and is left out
    without_first = ImuLog(time[1:], rates.gyro[1:], rates.accel[1:])
    one, other = imu_overview(without_first), imu_overview(increments)
    np.testing.assert_allclose(one.gyro_psd, other.gyro_psd, rtol=1e-9)
    np.testing.assert_allclose(one.accel_psd, other.accel_psd, rtol=1e-9)


def test_a_line_stands_at_its_frequency_across_gaps():
    time = np.concatenate((np.arange(8000), np.arange(8400, 16_000))) / 100.0
    log = _log(time)
    log.accel[:, 1] += np.sin(2.0 * np.pi * 12.5 * time)
    found = imu_overview(log)
    assert found.frequency[np.argmax(found.accel_psd[:, 1])] == pytest.approx(12.5, abs=0.05)
    width = found.frequency[1] - found.frequency[0]
    near = np.abs(found.frequency - 12.5) < 1.0
    assert found.accel_psd[near, 1].sum() * width == pytest.approx(0.5, rel=0.05)
    np.testing.assert_allclose(found.gap_start, [79.99])
    np.testing.assert_allclose(found.gap_length, [4.01])
    assert found.rate.min() < 1.0


def test_short_logs_have_no_spectrum():
    found = imu_overview(_log(np.arange(40) / 100.0))
    assert found.frequency.size == 0
    assert found.gyro_psd.shape == (0, 3)
    assert found.rate == pytest.approx([100.0])
    alone = imu_overview(_log(np.array([1.0])))
    assert alone.time.size == 0
    assert np.isnan(alone.usual_rate)


def test_runs_shorter_than_the_others_are_left_out():
    time = np.concatenate((np.arange(5000), np.arange(5300, 5350))) / 100.0
    found = imu_overview(_log(time))
    assert found.frequency.size == 1024
    assert np.isfinite(found.gyro_psd).all()


@pytest.mark.parametrize("count", [2048, 5001, 999])
def test_spectra_are_those_of_welch(count):
    log = _log(np.arange(count) / 125.0)
    found = imu_overview(log)
    frequency, psd = welch(np.hstack((log.gyro, log.accel)).T, fs=125.0, nperseg=min(count, 2048))
    np.testing.assert_allclose(found.frequency, frequency[1:], rtol=1e-12)
    np.testing.assert_allclose(np.hstack((found.gyro_psd, found.accel_psd)), psd.T[1:], rtol=1e-9)
