"""What holds for every simulated aiding sensor: draws, keys, stamps, messages."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from navfuse.errors import ConfigError, InputError
from navfuse.simulation import static
from reference.aiding_sensors import ERRORS, SENSORS, sway

EACH = pytest.mark.parametrize("name", SENSORS)
EACH_ERROR = pytest.mark.parametrize(("name", "part"), [(name, part) for name in ERRORS for part in ERRORS[name]])


@pytest.fixture(name="motion", scope="module")
def _motion():
    return sway()


def everything(name, *without):
    keys = dict(SENSORS[name][2])
    for part, given in ERRORS[name].items():
        if part not in without:
            keys |= given
    return keys


def measure(name, motion, keys, seed=0):
    Model, measure_it, _ = SENSORS[name]
    return measure_it(motion, Model.from_datasheet(**keys), np.random.default_rng(seed))


@EACH
def test_the_same_seed_gives_the_same_bytes(motion, name):
    tables = [measure(name, motion, everything(name), seed)[0].columns() for seed in (5, 5, 6)]
    assert all(tables[0][column].tobytes() == tables[1][column].tobytes() for column in tables[0])
    assert any(tables[0][column].tobytes() != tables[2][column].tobytes() for column in tables[0])


@EACH_ERROR
def test_switching_one_error_off_leaves_the_draws_of_the_others_alone(motion, name, part):
    _, full = measure(name, motion, everything(name), 3)
    _, less = measure(name, motion, everything(name, part), 3)
    for field in dataclasses.fields(full):
        one, other = np.asarray(getattr(full, field.name)), np.asarray(getattr(less, field.name))
        if field.name == part:
            assert not np.array_equal(one, other)
        else:
            np.testing.assert_array_equal(one, other)


@EACH_ERROR
def test_an_error_that_is_on_alone_has_the_draws_it_has_among_others(motion, name, part):
    _, full = measure(name, motion, everything(name), 4)
    _, alone = measure(name, motion, SENSORS[name][2] | ERRORS[name][part], 4)
    np.testing.assert_array_equal(getattr(full, part), getattr(alone, part))


@EACH
def test_stamps_are_late_by_the_latency_and_begin_after_the_offset(motion, name):
    keys = SENSORS[name][2]
    plain, _ = measure(name, motion, keys)
    late, truth = measure(name, motion, keys | {"latency_ms": 250.0})
    np.testing.assert_allclose(late.time, plain.time + 0.25, atol=1e-12)
    np.testing.assert_array_equal(truth.true_time, plain.time)
    np.testing.assert_allclose(np.diff(plain.time), 0.25, atol=1e-12)
    begun, _ = measure(name, motion, keys | {"offset_s": 3.1})
    assert begun.time[0] == motion.start + 3.1


@EACH
def test_the_motion_must_last_to_the_first_sample(name):
    with pytest.raises(InputError, match=r"the motion ends at 10 s, before the first sample of the .* at 11 s"):
        measure(name, static(10.0, 0.8, 0.2, 100.0), SENSORS[name][2] | {"offset_s": 11.0})


@EACH
def test_an_unknown_key_names_the_nearest_one(name):
    Model, _, keys = SENSORS[name]
    with pytest.raises(ConfigError, match=r"unknown key or unit 'rate_khz': did you mean 'rate_hz'\?"):
        Model.from_datasheet(**keys, rate_khz=1.0)
    with pytest.raises(ConfigError, match=r"unknown key or unit 'latency_min': did you mean 'latency"):
        Model.from_datasheet(**keys).replace_datasheet(latency_min=1.0)
    with pytest.raises(ConfigError, match="unknown key or unit 'qqqqqqqq': known: rate_hz, offset_s"):
        Model.from_datasheet(qqqqqqqq=1.0)


@EACH
@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"rate_hz": 0.0}, "rate must be more than 0 and finite"),
        ({"rate_hz": -1.0}, "rate must be more than 0 and finite"),
        ({"rate_hz": "fast"}, "rate_hz must be a number or an array of numbers, not 'fast'"),
        ({"offset_s": -1.0}, "offset must be at least 0 and finite"),
        ({"latency_s": np.inf}, "latency must be a number and finite"),
        ({"latency_s": 1.0, "latency_ms": 1.0}, "'latency_ms' sets latency a second time"),
    ],
)
def test_sampling_that_makes_no_sense_is_refused(name, keys, message):
    Model, _, needed = SENSORS[name]
    with pytest.raises(ConfigError, match=message):
        Model.from_datasheet(**(needed | keys))


SIZES = [
    (name, key)
    for name, (Model, _, _) in SENSORS.items()
    for key in Model.UNITS
    if "_sd_" in key or "_lsb_" in key or "_walk_" in key or "_mean_" in key or "per_h" in key or "sigma" in key
]


@pytest.mark.parametrize(("name", "key"), SIZES)
def test_sizes_of_errors_are_not_negative(name, key):
    Model, _, needed = SENSORS[name]
    with pytest.raises(ConfigError, match="at least 0 and finite|finite and not negative"):
        Model.from_datasheet(**(needed | {key: -1.0}))


@EACH
def test_every_key_reaches_its_field_in_si_units(name):
    Model, _, _ = SENSORS[name]
    names = {field.name for field in dataclasses.fields(Model)}
    assert {field for field, _ in Model.UNITS.values()} | set(Model.WORDS) == names


def test_a_key_is_converted():
    Model = SENSORS["barometer"][0]
    model = Model.from_datasheet(pressure_sd_hpa=0.5, pressure_walk_hpa_per_sqrt_h=0.6, dynamic_pressure_percent=5.0)
    assert model.pressure_sd == 50.0
    assert model.pressure_walk == pytest.approx(1.0)
    assert model.dynamic_pressure_factor == pytest.approx(0.05)
    assert model.replace_datasheet(pressure_sd_pa=1.0).pressure_walk == model.pressure_walk


@EACH
def test_every_field_has_a_key_in_the_manual(name):
    page = (Path(__file__).parents[2] / "docs" / "how-real.md").read_text(encoding="utf-8")
    Model = SENSORS[name][0]
    documented = {field for key, (field, _) in Model.UNITS.items() if f"`{key}`" in page}
    documented |= {word for word in Model.WORDS if f"`{word}" in page}
    assert documented == {field.name for field in dataclasses.fields(Model)}
