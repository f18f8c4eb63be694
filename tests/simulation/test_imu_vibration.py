from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import quad

from navfuse.data.logs import ImuLog
from navfuse.simulation import ImuSensorModel, measure_imu

DT = 0.01


def a_log(kind="rates", count=6001):
    """A sensor that feels nothing."""
    return ImuLog(DT * np.arange(count), np.zeros((count, 3)), np.zeros((count, 3)), kind)


def test_sinusoids_have_their_amplitude_and_frequency_and_increments_their_integral():
    keys = {
        "vibration_hz": (7.3, 33.0),
        "gyro_vibration_degps": (1.0, 2.0),
        "accel_vibration_mg": ((1.0, 2.0, 3.0), (0.0, 5.0, 0.0)),
    }
    model = ImuSensorModel.from_datasheet(**keys)
    log, t = a_log(), DT * np.arange(6001)
    rates, truth = measure_imu(log, model, np.random.default_rng(6))
    sums, _ = measure_imu(dataclasses.replace(log, kind="increments"), model, np.random.default_rng(6))
    columns = [f(2.0 * math.pi * hz * t) for hz in (7.3, 33.0) for f in (np.sin, np.cos)]
    for name, amplitudes in (("gyro", model.gyro_vibration), ("accel", model.accel_vibration)):
        fit, *_ = np.linalg.lstsq(np.column_stack(columns), getattr(rates, name), rcond=None)
        np.testing.assert_allclose(np.column_stack(columns) @ fit, getattr(rates, name), atol=1e-11)
        np.testing.assert_allclose(np.hypot(fit[0::2], fit[1::2]), amplitudes, atol=1e-11)
        np.testing.assert_array_equal(getattr(truth, f"{name}_vibration"), getattr(rates, name))
        for k in (1, 77, 6000):
            for j in range(3):

                def value(s, c=fit[:, j]):
                    return sum(
                        c[2 * i] * math.sin(2 * math.pi * hz * s) + c[2 * i + 1] * math.cos(2 * math.pi * hz * s)
                        for i, hz in enumerate((7.3, 33.0))
                    )

                assert getattr(sums, name)[k, j] == pytest.approx(
                    quad(value, t[k - 1], t[k], epsabs=1e-13)[0], abs=1e-12
                )
    phases = np.arctan2(fit[1::2], fit[0::2])
    assert np.ptp(phases[0]) > 0.1


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize(("centre", "width"), [(23.0, 4.0), (0.0, 8.0), (70.0, 10.0)])
def test_band_noise_has_the_autocorrelation_of_its_resonance(kind, centre, width):
    model = ImuSensorModel.from_datasheet(
        vibration_noise_hz=centre, vibration_noise_width_hz=width, accel_vibration_noise_mg=1e3 / 9.80665
    )
    count = 200_000
    log = a_log(kind, count)
    measured, _ = measure_imu(log, model, np.random.default_rng(7))
    x = measured.accel / (1.0 if kind == "rates" else DT)

    def correlation(tau):
        return math.exp(-math.pi * width * abs(tau)) * math.cos(2.0 * math.pi * centre * tau)

    def covariance(lag):
        if kind == "rates":
            return correlation(lag * DT)
        return quad(lambda u: (DT - abs(u)) * correlation(lag * DT + u), -DT, DT, points=[0.0])[0] / DT**2

    theory = [covariance(lag) for lag in range(4)]
    long = np.array([covariance(lag) for lag in range(120)])
    for lag in range(4):
        found = np.mean(x[lag:] * x[: count - lag])
        spread = math.sqrt(2.0 * (long[0] ** 2 + 2.0 * np.sum(long[1:] ** 2)) / (3 * count))
        assert abs(found - theory[lag]) < 4.0 * spread
    assert abs(theory[0]) > 15.0 * spread


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_irregular_sampling_keeps_the_band_noise(kind):
    dt = np.random.default_rng(2).choice([0.004, 0.01], 100_000)
    log = ImuLog(np.cumsum(dt), np.zeros((dt.size, 3)), np.zeros((dt.size, 3)), kind)
    model = ImuSensorModel(vibration_noise_frequency=30.0, vibration_noise_width=20.0, gyro_vibration_noise=2.0)
    _, truth = measure_imu(log, model, np.random.default_rng(8))
    for length in (0.004, 0.01):
        rows = np.flatnonzero(dt == length)
        rows = rows[rows > 0]

        def weighted(u, length=length):
            return (length - u) * math.exp(-20.0 * math.pi * u) * math.cos(60.0 * math.pi * u)

        expected = 4.0 * (1.0 if kind == "rates" else 2.0 * quad(weighted, 0.0, length)[0] / length**2)
        assert np.mean(truth.gyro_vibration[rows] ** 2) == pytest.approx(expected, rel=0.025)


def test_vibration_is_felt_by_the_errors_that_follow():
    keys = {"vibration_hz": 11.0, "accel_vibration_mg": 500.0}
    _, before = measure_imu(a_log(), ImuSensorModel.from_datasheet(**keys), np.random.default_rng(1))
    model = ImuSensorModel.from_datasheet(**keys, accel_scale_sd_ppm=1e5, gyro_g_sensitivity_sd_degps_per_g=1.0)
    measured, truth = measure_imu(a_log(), model, np.random.default_rng(1))
    np.testing.assert_array_equal(truth.accel_vibration, before.accel_vibration)
    np.testing.assert_allclose(measured.accel, truth.accel_vibration * (1.0 + truth.states.accel_scale), atol=1e-13)
    np.testing.assert_allclose(measured.gyro, truth.accel_vibration @ truth.g_sensitivity.T, atol=1e-13)
