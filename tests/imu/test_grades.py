from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.errors import ConfigError
from navfuse.imu.grades import GRADES, grade


@pytest.mark.parametrize("name", GRADES)
def test_every_grade_is_a_noisy_biased_sensor_with_a_source(name):
    model = GRADES[name]
    assert model.source
    for field in ("arw", "vrw", "gyro_bias_sd", "accel_bias_sd", "gyro_scale_sd", "accel_scale_sd"):
        assert np.all(model.axes(field) > 0.0), field
    for sensor in ("gyro", "accel"):
        changes = math.isfinite(getattr(model, f"{sensor}_bias_tau")) or np.all(model.axes(f"{sensor}_bias_walk") > 0.0)
        assert changes, f"the {sensor} bias of a real sensor does not stay constant"


@pytest.mark.parametrize("name", GRADES)
def test_a_bias_at_switch_on_covers_what_it_does_in_the_first_ten_minutes(name):
    model = GRADES[name]
    for sensor in ("gyro", "accel"):
        assert np.all(model.axes(f"{sensor}_bias_sd") > model.axes(f"{sensor}_bias_walk") * math.sqrt(600.0))


def test_better_grades_are_better_in_everything():
    order = [GRADES[name] for name in ("consumer", "industrial-mems", "tactical", "navigation")]
    for field in ("arw", "vrw", "gyro_bias_sd", "accel_bias_sd", "gyro_scale_sd", "accel_scale_sd"):
        values = [float(model.axes(field).max()) for model in order]
        assert values == sorted(values, reverse=True), field
        assert values[0] > values[-1]


def test_the_sensors_of_the_data_sets_are_there():
    sensors = "benchmark-car adis16405 adis16488 rt3003 lsm6ds3 icm-45686 icm-45686-car vn-100 vn-200 ring-laser"
    assert set(sensors.split()) < set(GRADES)


def test_benchmark_car_has_the_published_figures():
    model = grade("benchmark-car")
    assert math.degrees(model.arw) * 60.0 == pytest.approx(0.2)
    assert model.vrw * 60.0 == pytest.approx(0.1)
    assert math.degrees(model.gyro_bias_sd) * 3600.0 == pytest.approx(30.0)
    assert model.accel_bias_sd == pytest.approx(150e-5)
    assert model.gyro_bias_tau == model.accel_bias_tau == 3600.0
    assert model.gyro_scale_sd == model.accel_scale_sd == pytest.approx(300e-6)


def test_adis16405_agrees_with_a_static_record(shared_data):
    record = np.load(shared_data / "adis16405-static" / "adis_16405_imu1.npz")
    model = grade("adis16405")
    rate = np.radians(record["gyro_degps"])
    seconds = rate[: rate.shape[0] // 100 * 100].reshape(-1, 100, 3).mean(axis=1)
    arw = np.sqrt(0.5 * np.mean(np.diff(seconds, axis=0) ** 2, axis=0))
    assert np.all(arw > 0.8 * model.arw)
    assert np.all(arw < 1.5 * model.arw)
    assert np.all(np.abs(rate.mean(axis=0)) < 3.0 * model.axes("gyro_bias_sd"))


def test_grades_cannot_be_changed_in_place():
    with pytest.raises(TypeError):
        GRADES["consumer"] = GRADES["tactical"]


def test_unknown_grade_names_the_nearest_and_lists_all():
    with pytest.raises(ConfigError, match=r"unknown IMU grade 'Tactcal': did you mean 'tactical'\? known: consumer, "):
        grade("Tactcal")
    with pytest.raises(ConfigError, match="unknown IMU grade '%%%': known: consumer, "):
        grade("%%%")
