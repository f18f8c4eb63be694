from __future__ import annotations

import math

import numpy as np
import pytest

from navfuse.errors import ConfigError
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.grades import grade
from navfuse.simulation import ImuSensorModel
from navfuse.simulation.imu_errors import SENSOR_UNITS

G = 9.80665
DPH = math.radians(1.0) / 3600.0


def test_a_model_without_keys_has_no_errors():
    model = ImuSensorModel()
    for name, _ in SENSOR_UNITS.values():
        if name.endswith("_range"):
            assert getattr(model, name) == math.inf
        elif name != "bias_instability_tau":
            assert not np.any(getattr(model, name))


@pytest.mark.parametrize(
    ("key", "printed", "field", "value"),
    [
        ("gyro_bias_instability_dph", 1.0, "gyro_bias_instability", DPH),
        ("gyro_bias_floor_dph", 0.6642824702679600, "gyro_bias_instability", DPH),
        ("accel_bias_instability_ug", 50.0, "accel_bias_instability", 50e-6 * G),
        ("accel_bias_floor_ug", 66.42824702679600, "accel_bias_instability", 100e-6 * G),
        ("gyro_rate_walk_dph_per_sqrt_h", 60.0, "gyro_rate_walk", DPH),
        ("gyro_rate_walk_degps_per_sqrt_s", 1.0, "gyro_rate_walk", math.radians(1.0)),
        ("accel_rate_walk_ug_per_sqrt_h", 60.0, "accel_rate_walk", 1e-6 * G),
        ("accel_rate_walk_mps2_per_sqrt_s", 0.1, "accel_rate_walk", 0.1),
        ("gyro_scale_asymmetry_sd_ppm", 100.0, "gyro_scale_asymmetry_sd", 1e-4),
        ("accel_scale_asymmetry_sd_ppm", 100.0, "accel_scale_asymmetry_sd", 1e-4),
        ("gyro_g_sensitivity_sd_dph_per_g", 1.0, "gyro_g_sensitivity_sd", DPH / G),
        ("gyro_g_sensitivity_sd_degps_per_g", 1.0, "gyro_g_sensitivity_sd", math.radians(1.0) / G),
        ("gyro_temperature_sd_dph_per_k", 2.0, "gyro_temperature_sd", 2.0 * DPH),
        ("gyro_temperature_sd_degps_per_k", 0.1, "gyro_temperature_sd", math.radians(0.1)),
        ("accel_temperature_sd_mg_per_k", 1.0, "accel_temperature_sd", 1e-3 * G),
        ("temperature_ramp_k_per_h", -3600.0, "temperature_ramp", -1.0),
        ("temperature_ramp_k_per_min", 60.0, "temperature_ramp", 1.0),
        ("warm_up_tau_s", 600.0, "warm_up_tau", 600.0),
        ("gyro_range_degps", 180.0, "gyro_range", math.pi),
        ("accel_range_g", 16.0, "accel_range", 16.0 * G),
        ("gyro_rate_lsb_degps", 0.18, "gyro_rate_lsb", 1e-3 * math.pi),
        ("accel_force_lsb_mg", 1.0, "accel_force_lsb", 1e-3 * G),
        ("gyro_angle_lsb_urad", 1.0, "gyro_angle_lsb", 1e-6),
        ("gyro_angle_lsb_arcsec", 3600.0, "gyro_angle_lsb", math.radians(1.0)),
        ("accel_velocity_lsb_mmps", 1.0, "accel_velocity_lsb", 1e-3),
        ("stamp_jitter_sd_us", 20.0, "stamp_jitter_sd", 2e-5),
        ("stamp_jitter_sd_ms", 0.02, "stamp_jitter_sd", 2e-5),
        ("stamp_latency_ms", -5.0, "stamp_latency", -0.005),
        ("stamp_latency_s", 0.1, "stamp_latency", 0.1),
        ("dropped_percent", 1.0, "dropped_fraction", 0.01),
    ],
)
def test_printed_units_become_si(key, printed, field, value):
    model = ImuSensorModel.from_datasheet(**{key: printed})
    np.testing.assert_allclose(getattr(model, field), value, rtol=1e-12)


def test_keys_that_need_each_other_become_si():
    model = ImuSensorModel.from_datasheet(
        warm_up_k=10.0,
        warm_up_tau_s=5.0,
        dropouts_per_h=3600.0,
        dropout_s=0.5,
        vibration_hz=(25.0, 50.0),
        gyro_vibration_degps=(180.0, 90.0),
        accel_vibration_mg=((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)),
        vibration_noise_hz=60.0,
        vibration_noise_width_hz=10.0,
        gyro_vibration_noise_degps=180.0,
        accel_vibration_noise_mg=(1.0, 2.0, 3.0),
        bias_instability_tau_s=(1.0, 100.0),
    )
    assert (model.warm_up, model.dropout_frequency, model.dropout_length) == (10.0, 1.0, 0.5)
    assert (model.vibration_noise_frequency, model.vibration_noise_width) == (60.0, 10.0)
    np.testing.assert_allclose(model.vibration_frequency, [25.0, 50.0])
    np.testing.assert_allclose(model.gyro_vibration, np.array([[1.0] * 3, [0.5] * 3]) * math.pi)
    np.testing.assert_allclose(model.accel_vibration, 1e-3 * G * np.arange(1.0, 7.0).reshape(2, 3))
    np.testing.assert_allclose(model.gyro_vibration_noise, math.pi)
    np.testing.assert_allclose(model.accel_vibration_noise, 1e-3 * G * np.arange(1.0, 4.0))
    np.testing.assert_array_equal(model.bias_instability_tau, [1.0, 100.0])


def test_keys_of_the_engine_change_the_base():
    model = ImuSensorModel.from_datasheet("tactical", arw_deg_per_sqrt_h=60.0, gyro_range_degps=400.0)
    assert model.base.arw == pytest.approx(math.radians(1.0))
    assert model.base.vrw == grade("tactical").vrw
    again = model.replace_datasheet(vrw_mps_per_sqrt_h=60.0)
    assert (again.base.vrw, again.base.arw, again.gyro_range) == (1.0, model.base.arw, model.gyro_range)
    own = ImuErrorModel(arw=0.5)
    assert ImuSensorModel.from_datasheet(own).base.arw == 0.5


def test_the_arrays_of_a_model_cannot_be_changed():
    model = ImuSensorModel.from_datasheet(gyro_bias_floor_dph=1.0)
    with pytest.raises(ValueError, match="read-only"):
        model.gyro_bias_instability[0] = 2.0


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"gyro_bias_flor_dph": 1.0}, "unknown key or unit 'gyro_bias_flor_dph': did you mean 'gyro_bias_floor_dph'"),
        ({"gyro_range_radps": 1.0}, "did you mean 'gyro_range_degps'"),
        ({"arw_deg_per_h": 1.0}, "did you mean 'arw_deg_per_sqrt_h'"),
        ({"qqqqqq": 1.0}, "unknown key or unit 'qqqqqq': known: arw_deg_per_sqrt_h, .*dropout_s"),
        ({"stamp_jitter_sd_us": 1.0, "stamp_jitter_sd_ms": 1.0}, "sets stamp_jitter_sd a second time"),
        ({"accel_rate_walk_ug_per_sqrt_h": -1.0}, "accel_rate_walk must be finite and not negative"),
        ({"gyro_bias_floor_dph": math.nan}, "gyro_bias_instability must be finite and not negative"),
        ({"gyro_bias_floor_dph": (1.0, 2.0)}, "must be one number or three, not an array of shape"),
        ({"gyro_bias_floor_dph": "one"}, "must be a number or an array of numbers, not 'one'"),
        ({"arw_deg_per_sqrt_h": -1.0}, "arw must be finite and not negative"),
        ({"warm_up_k": (1.0, 2.0)}, "warm_up must be one number, not an array"),
        ({"warm_up_k": math.inf}, "warm_up must be a number and finite"),
        ({"warm_up_k": 5.0}, "warm_up needs warm_up_tau > 0"),
        ({"stamp_jitter_sd_us": -1.0}, "stamp_jitter_sd must be at least 0 and finite"),
        ({"gyro_range_degps": 0.0}, "gyro_range must be more than 0"),
        ({"dropped_percent": 100.0}, "dropped_fraction must be less than 1"),
        ({"dropouts_per_h": 1.0}, "dropout_frequency and dropout_length need each other"),
        ({"dropout_s": 1.0}, "dropout_frequency and dropout_length need each other"),
        ({"bias_instability_tau_s": (1.0, 5.0)}, "a decade or more apart"),
        ({"bias_instability_tau_s": 10.0}, "the shortest and the longest correlation time"),
        ({"vibration_hz": 0.0}, "vibration_frequency must be finite numbers > 0"),
        ({"vibration_hz": 25.0, "gyro_vibration_degps": (1.0, 2.0)}, "for each of the 1 values of vibration_frequency"),
        ({"accel_vibration_mg": 5.0}, "for each of the 0 values of vibration_frequency"),
        ({"vibration_hz": 25.0, "gyro_vibration_degps": -1.0}, "gyro_vibration must be finite and not negative"),
        ({"gyro_vibration_noise_degps": 1.0}, "vibration noise needs vibration_noise_width > 0"),
    ],
)
def test_impossible_models_are_refused(keys, message):
    with pytest.raises(ConfigError, match=message):
        ImuSensorModel.from_datasheet(**keys)


def test_an_unknown_grade_is_refused_with_the_nearest():
    with pytest.raises(ConfigError, match="unknown IMU grade 'tactikal': did you mean 'tactical'"):
        ImuSensorModel.from_datasheet("tactikal")


def test_a_base_that_is_no_model_is_refused():
    with pytest.raises(ConfigError, match="base must be an ImuErrorModel, not str"):
        ImuSensorModel("tactical")
