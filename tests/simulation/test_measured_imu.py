from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy import stats

from navfuse.data.logs import ImuLog
from navfuse.errors import ConfigError, InputError
from navfuse.imu.error_model import ImuErrorModel
from navfuse.simulation import ImuSensorModel, add_imu_errors, measure_imu

DT = 0.01
EVERYTHING = {
    "gyro_bias_floor_dph": 5.0,
    "accel_bias_floor_ug": 50.0,
    "gyro_rate_walk_dph_per_sqrt_h": 10.0,
    "accel_rate_walk_ug_per_sqrt_h": 50.0,
    "gyro_scale_asymmetry_sd_ppm": 100.0,
    "accel_scale_asymmetry_sd_ppm": 100.0,
    "gyro_g_sensitivity_sd_dph_per_g": 5.0,
    "gyro_temperature_sd_dph_per_k": 10.0,
    "accel_temperature_sd_mg_per_k": 0.1,
    "temperature_ramp_k_per_h": 20.0,
    "warm_up_k": 10.0,
    "warm_up_tau_s": 30.0,
    "vibration_hz": (25.0, 50.0),
    "gyro_vibration_degps": (0.1, 0.05),
    "accel_vibration_mg": (20.0, 10.0),
    "vibration_noise_hz": 40.0,
    "vibration_noise_width_hz": 10.0,
    "gyro_vibration_noise_degps": 0.05,
    "accel_vibration_noise_mg": 10.0,
    "stamp_jitter_sd_us": 50.0,
    "stamp_latency_ms": 3.0,
    "dropped_percent": 2.0,
    "dropouts_per_h": 360.0,
    "dropout_s": 0.5,
}


def a_log(kind="rates", count=6001, dt=DT, still=False):
    """Rates of every size and sign, or none; increments are the rates times the interval."""
    values = np.zeros((2, count, 3)) if still else np.random.default_rng(99).uniform(-1.0, 1.0, (2, count, 3))
    gyro, accel = values * np.array([1.0, 10.0])[:, None, None] * (1.0 if kind == "rates" else dt)
    return ImuLog(dt * np.arange(count), gyro, accel, kind, notes=("kept",))


def within_chi_square(values, sd):
    """Whether the mean square of independent normals lies in its 99.9 % interval, for every column."""
    low, high = stats.chi2.ppf([0.0005, 0.9995], len(values)) / len(values)
    ratio = np.mean(np.square(values), axis=0) / np.square(sd)
    return bool(np.all((low < ratio) & (ratio < high)))


def added(kind="rates", seed=1, still=False, count=6001, **keys):
    """What the keys add to a log that has the errors of a base model already, as rates; and the truth about it."""
    log = a_log(kind, count, still=still)
    model = ImuSensorModel.from_datasheet("consumer").replace_datasheet(gyro_cross_sd_mrad=1.0)
    without, _ = measure_imu(log, model, np.random.default_rng(seed))
    measured, truth = measure_imu(log, model.replace_datasheet(**keys), np.random.default_rng(seed))
    gain = 1.0 if kind == "rates" else DT
    return (measured.gyro - without.gyro) / gain, (measured.accel - without.accel) / gain, truth, log


def same(one, other, names):
    for name in names:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


TRUTHS = (
    "gyro_instability", "accel_instability", "gyro_walk", "accel_walk", "temperature", "gyro_temperature",
    "accel_temperature", "gyro_asymmetry", "accel_asymmetry", "g_sensitivity", "gyro_vibration", "accel_vibration",
    "row",
)  # fmt: skip


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_without_own_errors_the_log_is_that_of_the_base_model(kind):
    log, base = a_log(kind), ImuErrorModel(arw=1e-3, vrw=1e-2, gyro_bias_sd=0.1, gyro_bias_tau=3.0, accel_scale_sd=0.1)
    measured, truth = measure_imu(log, ImuSensorModel(base), np.random.default_rng(1))
    expected, states = add_imu_errors(log, base, np.random.default_rng(1).spawn(1)[0])
    same(measured, expected, ("time", "gyro", "accel"))
    same(truth.states, states, [entry.name for entry in dataclasses.fields(states)])
    assert (measured.kind, measured.source, measured.notes) == (kind, log.source, ("kept",))
    np.testing.assert_array_equal(truth.row, np.arange(6001))
    bare, _ = measure_imu(log, ImuSensorModel(), np.random.default_rng(1))
    same(bare, log, ("time", "gyro", "accel"))


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_the_same_seed_gives_the_same_bytes(kind):
    model = ImuSensorModel.from_datasheet("consumer", **EVERYTHING)
    logs = [measure_imu(a_log(kind), model, np.random.default_rng(seed))[0] for seed in (3, 3, 4)]
    for name in ("time", "gyro", "accel"):
        one, again, other = (getattr(log, name).tobytes() for log in logs)
        assert one == again
        assert one != other


@pytest.mark.parametrize(
    ("keys", "touched"),
    [
        (["gyro_bias_floor_dph"], ["gyro_instability"]),
        (["accel_bias_floor_ug"], ["accel_instability"]),
        (["gyro_rate_walk_dph_per_sqrt_h"], ["gyro_walk"]),
        (["accel_rate_walk_ug_per_sqrt_h"], ["accel_walk"]),
        (["gyro_scale_asymmetry_sd_ppm"], ["gyro_asymmetry"]),
        (["accel_scale_asymmetry_sd_ppm"], ["accel_asymmetry"]),
        (["gyro_g_sensitivity_sd_dph_per_g"], ["g_sensitivity"]),
        (["gyro_temperature_sd_dph_per_k"], ["gyro_temperature"]),
        (["accel_temperature_sd_mg_per_k"], ["accel_temperature"]),
        (["temperature_ramp_k_per_h"], ["temperature"]),
        (["gyro_vibration_degps"], ["gyro_vibration"]),
        (["accel_vibration_mg"], ["accel_vibration"]),
        (["gyro_vibration_noise_degps"], ["gyro_vibration"]),
        (["accel_vibration_noise_mg"], ["accel_vibration"]),
        (["stamp_jitter_sd_us"], []),
        (["stamp_latency_ms"], []),
    ],
)
def test_switching_one_error_off_leaves_the_draws_of_the_others_alone(keys, touched):
    model = ImuSensorModel.from_datasheet("consumer", **EVERYTHING)
    less = ImuSensorModel.from_datasheet("consumer", **{k: v for k, v in EVERYTHING.items() if k not in keys})
    log = a_log(count=501)
    (one, truth), (other, truth_less) = (measure_imu(log, m, np.random.default_rng(5)) for m in (model, less))
    same(truth, truth_less, [name for name in TRUTHS if name not in touched])
    for name in touched:
        assert not np.array_equal(getattr(truth, name), getattr(truth_less, name))
    same(truth.states, truth_less.states, ("gyro_scale", "accel_scale", "gyro_cross", "accel_cross"))
    untouched = {"gyro", "accel"} - {name.split("_")[0] for name in touched} - ({"gyro"} if "g_" in keys[0] else set())
    if "temperature" not in touched and "accel_vibration" not in touched:
        same(one, other, untouched)


def test_losses_change_no_value_and_not_each_other():
    log, kept = a_log(), {k: v for k, v in EVERYTHING.items() if not k.startswith("drop")}
    whole, _ = measure_imu(log, ImuSensorModel.from_datasheet("consumer", **kept), np.random.default_rng(5))
    model = ImuSensorModel.from_datasheet("consumer", **EVERYTHING)
    some, truth = measure_imu(log, model, np.random.default_rng(5))
    assert truth.row.size < 6001
    for name in ("time", "gyro", "accel"):
        np.testing.assert_array_equal(getattr(some, name), getattr(whole, name)[truth.row])
    np.testing.assert_array_equal(truth.true_time, log.time[truth.row])
    np.testing.assert_array_equal(truth.states.time, some.time)
    assert {len(getattr(truth, name)) for name in ("gyro_walk", "accel_vibration", "gyro_clipped")} == {truth.row.size}
    alone, only = (
        measure_imu(log, ImuSensorModel.from_datasheet(**k), np.random.default_rng(5))[1].row
        for k in ({"dropped_percent": 2.0}, {"dropouts_per_h": 360.0, "dropout_s": 0.5})
    )
    np.testing.assert_array_equal(truth.row, np.intersect1d(alone, only))


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_biases_add_up_to_what_a_filter_estimates(kind):
    keys = {k: v for k, v in EVERYTHING.items() if "bias" in k or "walk" in k or "temperature" in k or "warm" in k}
    gyro, accel, truth, _ = added(kind, **keys)
    model = ImuSensorModel.from_datasheet("consumer").replace_datasheet(gyro_cross_sd_mrad=1.0)
    _, before = measure_imu(a_log(kind), model, np.random.default_rng(1))
    for sensor, out in (("gyro", gyro), ("accel", accel)):
        slow = getattr(truth, f"{sensor}_instability") + getattr(truth, f"{sensor}_walk")
        slow = slow + truth.temperature[:, None] * getattr(truth, f"{sensor}_temperature")
        np.testing.assert_allclose(out, slow, atol=1e-12)
        whole = getattr(truth.states, f"{sensor}_bias") - getattr(before.states, f"{sensor}_bias")
        np.testing.assert_allclose(whole, slow, atol=1e-13)


def test_the_instability_is_stationary_with_the_variance_of_its_processes():
    log = ImuLog(np.array([0.0, 50.0]), np.zeros((2, 3)), np.zeros((2, 3)))
    model = ImuSensorModel(gyro_bias_instability=(1.0, 2.0, 3.0), bias_instability_tau=(1.0, 1000.0))
    ends = np.stack([measure_imu(log, model, np.random.default_rng(s))[1].gyro_instability for s in range(2000)])
    per_process = math.log(10.0) / math.pi
    sd = np.array([1.0, 2.0, 3.0]) * math.sqrt(4.0 * per_process)
    assert within_chi_square(ends[:, 0], sd)
    assert within_chi_square(ends[:, 1], sd)
    kept = sum(math.exp(-50.0 / tau) for tau in (1.0, 10.0, 100.0, 1000.0)) / 4.0
    products = ends[:, 0] * ends[:, 1] / sd**2
    assert np.all(np.abs(products.mean(axis=0) - kept) < 3.5 * math.sqrt((1.0 + kept**2) / 2000))


def test_the_rate_walk_has_independent_steps_of_its_density():
    time = np.cumsum(np.random.default_rng(2).choice([0.005, 0.02], 20000))
    log = ImuLog(time, np.zeros((20000, 3)), np.zeros((20000, 3)))
    model = ImuSensorModel(gyro_rate_walk=(1.0, 2.0, 3.0), accel_rate_walk=4.0)
    _, truth = measure_imu(log, model, np.random.default_rng(3))
    np.testing.assert_array_equal(truth.gyro_walk[0], 0.0)
    steps = np.diff(truth.gyro_walk, axis=0) / np.sqrt(np.diff(time))[:, None]
    assert within_chi_square(steps, [1.0, 2.0, 3.0])
    assert within_chi_square(np.diff(truth.accel_walk, axis=0) / np.sqrt(np.diff(time))[:, None], 4.0)
    assert np.all(np.abs(np.mean(steps[1:] * steps[:-1], axis=0)) < 3.5 * np.square([1.0, 2.0, 3.0]) / math.sqrt(2e4))


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_asymmetry_has_the_sign_of_the_input(kind):
    gyro, accel, truth, log = added(kind, gyro_scale_asymmetry_sd_ppm=1e4, accel_scale_asymmetry_sd_ppm=1e4)
    gain = 1.0 if kind == "rates" else DT
    np.testing.assert_allclose(gyro, truth.gyro_asymmetry * np.abs(log.gyro) / gain, atol=1e-12)
    np.testing.assert_allclose(accel, truth.accel_asymmetry * np.abs(log.accel) / gain, atol=1e-12)
    assert truth.gyro_asymmetry.all()
    assert truth.accel_asymmetry.all()


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_g_sensitivity_turns_force_into_rate(kind):
    gyro, accel, truth, log = added(kind, gyro_g_sensitivity_sd_degps_per_g=1.0)
    gain = 1.0 if kind == "rates" else DT
    np.testing.assert_allclose(gyro, log.accel @ truth.g_sensitivity.T / gain, atol=1e-12)
    assert truth.g_sensitivity.all()
    np.testing.assert_array_equal(accel, 0.0)


def test_constants_are_drawn_with_the_stated_deviations():
    log = a_log(count=2)
    model = ImuSensorModel(
        gyro_scale_asymmetry_sd=(1.0, 2.0, 3.0),
        accel_scale_asymmetry_sd=4.0,
        gyro_g_sensitivity_sd=(5.0, 6.0, 7.0),
        gyro_temperature_sd=8.0,
        accel_temperature_sd=(9.0, 10.0, 11.0),
    )
    truths = [measure_imu(log, model, np.random.default_rng(seed))[1] for seed in range(1500)]
    for name, sd in (
        ("gyro_asymmetry", [1.0, 2.0, 3.0]),
        ("accel_asymmetry", 4.0),
        ("g_sensitivity", np.array([[5.0], [6.0], [7.0]])),
        ("gyro_temperature", 8.0),
        ("accel_temperature", [9.0, 10.0, 11.0]),
    ):
        assert within_chi_square(np.array([getattr(truth, name) for truth in truths]), sd)


def test_temperature_ramps_and_warms_up():
    _, _, truth, log = added(temperature_ramp_k_per_min=-6.0, warm_up_k=12.0, warm_up_tau_s=20.0)
    np.testing.assert_allclose(truth.temperature, -0.1 * log.time + 12.0 * (1.0 - np.exp(-log.time / 20.0)), atol=1e-12)
    gyro, accel, truth, log = added(temperature_ramp_k_per_h=3600.0, gyro_temperature_sd_degps_per_k=1.0)
    np.testing.assert_allclose(gyro, log.time[:, None] * truth.gyro_temperature, atol=1e-11)
    np.testing.assert_array_equal(accel, 0.0)


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_the_range_is_exact(kind):
    log = a_log(kind)
    measured, truth = measure_imu(log, ImuSensorModel(gyro_range=0.5, accel_range=3.0), np.random.default_rng(0))
    gain = np.full((6001, 1), 1.0) if kind == "rates" else np.diff(log.time, prepend=-DT)[:, None]
    gain[0] = gain[1]
    for name, limit in (("gyro", 0.5), ("accel", 3.0)):
        true = getattr(log, name)
        np.testing.assert_array_equal(getattr(measured, name), np.clip(true, -limit * gain, limit * gain))
        np.testing.assert_array_equal(getattr(truth, f"{name}_clipped"), np.abs(true) > limit * gain)
        assert getattr(truth, f"{name}_clipped").any()


def test_rates_are_rounded_to_the_nearest_step_within_the_range():
    log = a_log()
    model = ImuSensorModel(gyro_rate_lsb=0.0625, accel_force_lsb=0.25, gyro_range=0.55)
    measured, _ = measure_imu(log, model, np.random.default_rng(0))
    np.testing.assert_array_equal(measured.accel, 0.25 * np.rint(log.accel / 0.25))
    np.testing.assert_array_equal(measured.gyro, 0.0625 * np.rint(np.clip(log.gyro, -0.5, 0.5) / 0.0625))
    assert np.abs(measured.gyro).max() == 0.5


def test_increments_are_rounded_so_that_nothing_is_lost():
    log = a_log("increments")
    model = ImuSensorModel(gyro_angle_lsb=2.0**-7, accel_velocity_lsb=2.0**-4)
    measured, _ = measure_imu(log, model, np.random.default_rng(0))
    for out, true, lsb in ((measured.gyro, log.gyro, 2.0**-7), (measured.accel, log.accel, 2.0**-4)):
        np.testing.assert_array_equal(out / lsb, np.rint(out / lsb))
        assert np.abs(np.cumsum(out, axis=0) - np.cumsum(true, axis=0)).max() <= 0.5 * lsb * (1.0 + 1e-9)
        np.testing.assert_array_equal(out[0], lsb * np.floor(true[0] / lsb + 0.5))


@pytest.mark.parametrize(
    ("kind", "given", "wanted"),
    [
        ("rates", "gyro_angle_lsb", "gyro_rate_lsb"),
        ("rates", "accel_velocity_lsb", "accel_force_lsb"),
        ("increments", "gyro_rate_lsb", "gyro_angle_lsb"),
        ("increments", "accel_force_lsb", "accel_velocity_lsb"),
    ],
)
def test_a_step_of_rounding_for_the_other_kind_alone_is_refused(kind, given, wanted):
    with pytest.raises(ConfigError, match=f"the log holds {kind}: give {wanted}, not {given} alone"):
        measure_imu(a_log(kind), ImuSensorModel(**{given: 1.0}), np.random.default_rng(0))
    both, _ = measure_imu(a_log(kind), ImuSensorModel(**{given: 1.0, wanted: 1e-9}), np.random.default_rng(0))
    np.testing.assert_allclose(both.accel, a_log(kind).accel, atol=1e-9)


def test_increments_and_rates_of_one_seed_agree():
    keys = {k: v for k, v in EVERYTHING.items() if "vibration" not in k}
    model = ImuSensorModel.from_datasheet("consumer", **keys, gyro_range_degps=50.0)
    rates, truth = measure_imu(a_log("rates"), model, np.random.default_rng(9))
    sums, _ = measure_imu(a_log("increments"), model, np.random.default_rng(9))
    np.testing.assert_array_equal(rates.time, sums.time)
    np.testing.assert_allclose(sums.gyro / DT, rates.gyro, atol=1e-10)
    np.testing.assert_allclose(sums.accel / DT, rates.accel, atol=1e-9)
    assert truth.gyro_clipped.any()


def test_stamps_are_late_and_jitter():
    log = a_log(count=20001)
    late, truth = measure_imu(log, ImuSensorModel(stamp_latency=0.25), np.random.default_rng(0))
    np.testing.assert_allclose(late.time, log.time + 0.25, atol=1e-12)
    np.testing.assert_array_equal(truth.true_time, log.time)
    np.testing.assert_array_equal(late.gyro, log.gyro)
    shaky, _ = measure_imu(log, ImuSensorModel(stamp_jitter_sd=1e-3), np.random.default_rng(0))
    error = shaky.time - log.time
    assert within_chi_square(error[:, None], 1e-3)
    assert abs(np.mean(error[1:] * error[:-1])) < 3.5e-6 / math.sqrt(20000)


def test_stamps_stay_in_order_however_much_they_jitter():
    shaky, _ = measure_imu(a_log(), ImuSensorModel(stamp_jitter_sd=0.1), np.random.default_rng(0))
    steps = np.diff(shaky.time)
    assert steps.min() > 0.99e-6
    assert np.mean(steps < 1.01e-6) > 0.3


def test_single_rows_are_lost_by_chance():
    log = a_log(count=50001)
    measured, truth = measure_imu(log, ImuSensorModel(dropped_fraction=0.1), np.random.default_rng(0))
    lost = 50001 - measured.time.size
    assert abs(lost - 5000) < 3.5 * math.sqrt(50000 * 0.1 * 0.9)
    assert truth.row[0] == 0
    runs = np.diff(truth.row) - 1
    assert abs(np.sum(runs >= 2) / np.sum(runs >= 1) - 0.1) < 3.5 * math.sqrt(0.09 / np.sum(runs >= 1))


def test_dropouts_take_their_time_and_come_as_often_as_stated():
    log = a_log(count=500_001)
    model = ImuSensorModel(dropout_frequency=0.02, dropout_length=0.5)
    _, truth = measure_imu(log, model, np.random.default_rng(1))
    gaps = np.diff(log.time[truth.row])
    gaps = gaps[gaps > 1.5 * DT]
    assert gaps.min() == pytest.approx(0.5 + DT, abs=1.01 * DT)
    assert np.mean(np.abs(gaps - 0.5 - DT) < 1.01 * DT) > 0.95
    expected = 5000.0 * 0.02 * math.exp(-0.02 * 0.5)
    assert abs(gaps.size - expected) < 3.5 * math.sqrt(expected)


def test_logs_too_short_are_refused():
    log = a_log(count=3)
    one = ImuLog(log.time[:1], log.gyro[:1], log.accel[:1], source="drive.csv")
    with pytest.raises(InputError, match=r"drive.csv: an IMU log needs at least two rows to be given errors, not 1"):
        measure_imu(one, ImuSensorModel(), np.random.default_rng(0))
    with pytest.raises(InputError, match="of 3 rows, only one survives the losses"):
        measure_imu(log, ImuSensorModel(dropped_fraction=0.9999), np.random.default_rng(0))
