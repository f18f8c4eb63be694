from __future__ import annotations

import dataclasses
import math
import pickle

import numpy as np
import pytest

from navfuse.errors import ConfigError
from navfuse.imu.error_model import DATASHEET_UNITS, ImuErrorModel


def test_defaults_are_a_perfect_sensor():
    model = ImuErrorModel()
    for field in dataclasses.fields(model):
        value = getattr(model, field.name)
        if field.name == "source":
            assert value == ""
        elif field.name.endswith("_tau"):
            assert value == math.inf
        else:
            assert value == 0.0


def test_printed_units_become_si():
    model = ImuErrorModel.from_datasheet(
        arw_deg_per_sqrt_h=0.2,
        vrw_mps_per_sqrt_h=0.1,
        gyro_bias_sd_dph=30.0,
        gyro_bias_walk_dph_per_sqrt_h=60.0,
        accel_bias_sd_mg=0.15,
        accel_bias_tau_s=3600.0,
        gyro_scale_sd_ppm=300.0,
        accel_scale_sd_ppm=[100.0, 200.0, 300.0],
        accel_scale_tau_s=7200.0,
        gyro_cross_sd_mrad=0.5,
        accel_cross_sd_mrad=0.25,
        source="a data sheet",
    )
    assert model.arw == pytest.approx(5.8177641733e-5, rel=1e-9)
    assert model.vrw == pytest.approx(1.0 / 600.0, rel=1e-12)
    assert model.gyro_bias_sd == pytest.approx(1.4544410433e-4, rel=1e-9)
    assert model.gyro_bias_walk == pytest.approx(4.8481368111e-6, rel=1e-9)
    assert model.accel_bias_sd == pytest.approx(1.4709975e-3, rel=1e-12)
    assert model.accel_bias_tau == 3600.0
    assert model.gyro_bias_tau == math.inf
    assert model.gyro_scale_sd == pytest.approx(3e-4, rel=1e-12)
    np.testing.assert_allclose(model.accel_scale_sd, [1e-4, 2e-4, 3e-4], rtol=1e-12)
    assert model.accel_scale_tau == 7200.0
    assert model.gyro_cross_sd == pytest.approx(5e-4)
    assert model.accel_cross_sd == pytest.approx(2.5e-4)
    assert model.source == "a data sheet"


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ({"arw_deg_per_sqrt_h": 0.3}, {"gyro_noise_degps_per_sqrt_hz": 0.005}),
        ({"vrw_mps_per_sqrt_h": 0.0588399}, {"accel_noise_ug_per_sqrt_hz": 100.0}),
        ({"gyro_bias_sd_dph": 3600.0}, {"gyro_bias_sd_degps": 1.0}),
        ({"accel_bias_sd_mg": 1.0}, {"accel_bias_sd_mgal": 980.665}),
    ],
)
def test_two_printed_units_of_one_quantity_agree(one, other):
    first, second = ImuErrorModel.from_datasheet(**one), ImuErrorModel.from_datasheet(**other)
    for field in dataclasses.fields(first):
        if field.name != "source":
            assert getattr(first, field.name) == pytest.approx(getattr(second, field.name), rel=1e-12)


def test_every_parameter_has_a_printed_unit_and_comes_back_from_it():
    names = {field.name for field in dataclasses.fields(ImuErrorModel)} - {"source"}
    assert {name for name, _ in DATASHEET_UNITS.values()} == names
    model = ImuErrorModel(
        1e-4,
        2e-3,
        (1e-4, 2e-4, 3e-4),
        100.0,
        0.0,
        1e-2,
        math.inf,
        1e-6,
        1e-3,
        50.0,
        (1e-3, 2e-3, 4e-3),
        80.0,
        1e-4,
        2e-4,
    )
    back = ImuErrorModel.from_datasheet(**model.to_datasheet())
    for name in names:
        np.testing.assert_allclose(getattr(back, name), getattr(model, name), rtol=1e-14)


def test_axes_gives_three_values_that_may_be_changed():
    model = ImuErrorModel(gyro_bias_sd=2.0, accel_bias_sd=[1.0, 2.0, 3.0])
    np.testing.assert_array_equal(model.axes("gyro_bias_sd"), [2.0, 2.0, 2.0])
    three = model.axes("accel_bias_sd")
    three[0] = 9.0
    np.testing.assert_array_equal(model.axes("accel_bias_sd"), [1.0, 2.0, 3.0])


def test_the_model_keeps_its_own_copy_of_arrays():
    mine = np.array([1.0, 2.0, 3.0])
    model = ImuErrorModel(gyro_bias_sd=mine)
    mine[0] = 9.0
    assert model.gyro_bias_sd[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        model.gyro_bias_sd[0] = 5.0


def test_replace_changes_what_it_is_told_and_nothing_else():
    model = ImuErrorModel(arw=1e-4, vrw=1e-3, source="x")
    changed = model.replace(arw=2e-4)
    assert (changed.arw, changed.vrw, changed.source) == (2e-4, 1e-3, "x")
    assert model.arw == 1e-4
    assert model.replace_datasheet(gyro_bias_sd_degps=1.0).gyro_bias_sd == pytest.approx(math.radians(1.0))


def test_a_model_survives_pickling():
    model = pickle.loads(pickle.dumps(ImuErrorModel(arw=1e-4, gyro_bias_sd=[1.0, 2.0, 3.0])))
    assert model.arw == 1e-4
    np.testing.assert_array_equal(model.gyro_bias_sd, [1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"arw": -1e-4}, "arw must be finite and not negative"),
        ({"vrw": math.nan}, "vrw must be finite and not negative"),
        ({"arw": [1e-4, 1e-4, 1e-4]}, "arw must be one number, not an array of shape"),
        ({"gyro_cross_sd": [1e-4, 1e-4, 1e-4]}, "gyro_cross_sd must be one number"),
        ({"gyro_bias_sd": math.inf}, "gyro_bias_sd must be finite"),
        ({"accel_bias_sd": [1.0, -1.0, 1.0]}, "accel_bias_sd must be finite and not negative"),
        ({"accel_scale_sd": [1.0, 1.0]}, "accel_scale_sd must be one number or three, not an array of shape"),
        ({"gyro_bias_tau": 0.0}, "gyro_bias_tau must be one number > 0"),
        ({"gyro_bias_tau": math.nan}, "gyro_bias_tau must be one number > 0"),
        ({"accel_scale_tau": [1.0, 2.0, 3.0]}, "accel_scale_tau must be one number > 0"),
        ({"arw": "much"}, "arw must be a number or three numbers, not 'much'"),
        ({"gyro_bias_walk": 1e-6, "gyro_bias_tau": 100.0}, "gyro_bias_walk needs gyro_bias_tau = inf"),
        ({"accel_bias_walk": 1e-6, "accel_bias_tau": 100.0}, "accel_bias_walk needs accel_bias_tau = inf"),
    ],
)
def test_impossible_values_are_refused(fields, message):
    with pytest.raises(ConfigError, match=message):
        ImuErrorModel(**fields)


def test_unknown_names_are_refused_with_the_nearest():
    with pytest.raises(ConfigError, match="unknown IMU error parameter 'gyro_bias_std': did you mean 'gyro_bias_sd'"):
        ImuErrorModel().replace(gyro_bias_std=1.0)
    with pytest.raises(ConfigError, match="unknown IMU error key 'arw_deg_sqrt_h': did you mean 'arw_deg_per_sqrt_h'"):
        ImuErrorModel.from_datasheet(arw_deg_sqrt_h=1.0)
    with pytest.raises(ConfigError, match="unknown IMU error key 'zzz'; known: arw_deg_per_sqrt_h, "):
        ImuErrorModel.from_datasheet(zzz=1.0)


def test_one_quantity_in_two_units_is_refused():
    with pytest.raises(ConfigError, match="'gyro_bias_sd_degps' sets gyro_bias_sd a second time"):
        ImuErrorModel.from_datasheet(gyro_bias_sd_dph=1.0, gyro_bias_sd_degps=1.0)


def test_a_printed_value_that_is_no_number_names_its_key():
    with pytest.raises(ConfigError, match="arw_deg_per_sqrt_h must be a number or three numbers, not 'low'"):
        ImuErrorModel.from_datasheet(arw_deg_per_sqrt_h="low")
