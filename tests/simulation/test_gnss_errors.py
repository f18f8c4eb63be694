from __future__ import annotations

import math

import numpy as np
import pymap3d
import pytest
from scipy import stats

from navfuse.errors import ConfigError, InputError
from navfuse.simulation import (
    FixType,
    GnssReceiverModel,
    antenna_state,
    car_drive,
    gnss_fixes,
    measure_gnss,
    static,
)
from navfuse.simulation.gnss_errors import RECEIVER_UNITS

EVERYTHING = {
    "rate_hz": 2.0,
    "position_sd_m": (1.0, 1.0, 2.0),
    "position_correlated_sd_m": 1.5,
    "position_correlated_tau_s": 60.0,
    "velocity_sd_mps": 0.05,
    "velocity_correlated_sd_mps": 0.02,
    "velocity_correlated_tau_s": 5.0,
    "latency_ms": 120.0,
    "stated_sigma_factor": 0.5,
    "outages_s": [[100.0, 110.0]],
    "outages_per_h": 60.0,
    "outage_s": 5.0,
    "multipath_jumps_per_h": 60.0,
    "multipath_mean_s": 10.0,
    "multipath_sd_m": 10.0,
    "drift_mps": (0.1, -0.2, 0.0),
    "drift_from_s": 300.0,
    "drift_to_s": 500.0,
}
KINDS = (FixType("rtk-fixed", 1.0, 40.0), FixType("rtk-float", 5.0, 20.0), FixType("single", 50.0, 10.0))
LEVER_ARM = (1.5, -0.4, -1.2)


def within_chi_square(values, sd):
    """Whether the mean square of independent normals lies in its 99.9 % interval, for every column."""
    low, high = stats.chi2.ppf([0.0005, 0.9995], len(values)) / len(values)
    ratio = np.mean(np.square(values), axis=0) / np.square(sd)
    return bool(np.all((low < ratio) & (ratio < high)))


@pytest.fixture(name="tripod", scope="module")
def _tripod():
    return static(4000.0, 0.8, 0.2, 50.0)


def make(motion, seed=0, **keys):
    model = GnssReceiverModel.from_datasheet(**({"position_sd_m": 1.0} | keys))
    return measure_gnss(motion, model, np.random.default_rng(seed))


@pytest.mark.parametrize(("lat", "lon"), [(0.8, 0.2), (0.1, math.pi), (-1.56, 3.0)])
def test_the_log_is_the_antenna_plus_the_stated_parts(lat, lon):
    motion = car_drive(600.0, seed=1, standing=2.0, lat=lat, lon=lon)
    model = GnssReceiverModel.from_datasheet(fix_types=KINDS, **EVERYTHING)
    log, truth = measure_gnss(motion, model, np.random.default_rng(1), LEVER_ARM)
    r_e, v_e = antenna_state(motion, truth.true_time, LEVER_ARM)
    exact = pymap3d.ecef2geodetic(*r_e.T, deg=False)
    east, north, up = pymap3d.geodetic2enu(log.lat, log.lon, log.height, *exact, deg=False)
    error_n = truth.position_white + truth.position_correlated + truth.multipath + truth.drift
    np.testing.assert_allclose(np.column_stack([north, east, -up]), error_n, atol=1e-6)
    v_n = np.column_stack(pymap3d.ecef2enuv(*v_e.T, log.lat, log.lon, deg=False))[:, [1, 0, 2]] * (1.0, 1.0, -1.0)
    pull = np.where((truth.true_time >= 300.0) & (truth.true_time < 500.0), 1.0, 0.0)[:, None] * (0.1, -0.2, 0.0)
    np.testing.assert_allclose(log.velocity_n, v_n + truth.velocity_white + truth.velocity_correlated + pull, atol=1e-9)
    np.testing.assert_allclose(log.time, truth.true_time + 0.12, atol=1e-12)
    assert np.all(np.diff(log.time) > 0.0)


def test_the_same_seed_gives_the_same_bytes(tripod):
    model = GnssReceiverModel.from_datasheet(fix_types=KINDS, **EVERYTHING)
    logs = [measure_gnss(tripod, model, np.random.default_rng(seed))[0] for seed in (1, 1, 2)]
    for name in ("lat", "height", "velocity_n", "sd_position", "fix"):
        one, again, other = (getattr(log, name).tobytes() for log in logs)
        assert one == again
        assert one != other


@pytest.mark.parametrize(
    ("keys", "touched"),
    [
        (["position_correlated_sd_m"], {"position_correlated"}),
        (["velocity_correlated_sd_mps"], {"velocity_correlated"}),
        (["velocity_sd_mps"], {"velocity_white"}),
        (["multipath_jumps_per_h", "multipath_mean_s", "multipath_sd_m"], {"multipath"}),
        (["drift_mps"], {"drift"}),
        (["latency_ms"], set()),
        (["stated_sigma_factor"], set()),
        (["outages_s"], {"row"}),
        (["outages_per_h", "outage_s"], {"row"}),
        (["fix"], {"sd_factor"}),
    ],
)
def test_switching_one_error_off_leaves_the_draws_of_the_others_alone(tripod, keys, touched):
    kinds = () if "fix" in keys else KINDS
    rest = {k: v for k, v in EVERYTHING.items() if k not in keys}
    model = GnssReceiverModel.from_datasheet(fix_types=KINDS, **EVERYTHING)
    less = GnssReceiverModel.from_datasheet(fix_types=kinds, **rest)
    one, other = (measure_gnss(tripod, m, np.random.default_rng(3))[1] for m in (model, less))
    _, a, b = np.intersect1d(one.true_time, other.true_time, return_indices=True)
    assert a.size > 6000
    assert ("row" in touched) == (one.true_time.size != other.true_time.size)
    for name in ("position_white", "position_correlated", "velocity_white", "velocity_correlated", "multipath"):
        left, right = getattr(one, name)[a], getattr(other, name)[b]
        if "sd_factor" in touched and name != "multipath":
            left = left / one.sd_factor[a][:, None]
        if name in touched:
            assert not np.array_equal(left, right)
        else:
            np.testing.assert_allclose(left, right, rtol=1e-14)


def test_white_errors_have_the_stated_deviations(tripod):
    _, truth = make(tripod, position_sd_m=(1.0, 2.0, 4.0), velocity_sd_mps=(0.1, 0.2, 0.4))
    assert within_chi_square(truth.position_white, [1.0, 2.0, 4.0])
    assert within_chi_square(truth.velocity_white, [0.1, 0.2, 0.4])
    for values in (truth.position_white / (1.0, 2.0, 4.0), truth.velocity_white / (0.1, 0.2, 0.4)):
        assert np.all(np.abs(np.mean(values[1:] * values[:-1], axis=0)) < 3.9 / math.sqrt(4000))


@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_correlated_errors_forget_at_their_rate(tripod, kind):
    unit = "m" if kind == "position" else "mps"
    keys = {f"{kind}_correlated_sd_{unit}": (1.0, 2.0, 3.0), f"{kind}_correlated_tau_s": 20.0}
    _, truth = make(tripod, **keys)
    path = getattr(truth, f"{kind}_correlated") / (1.0, 2.0, 3.0)
    decay = math.exp(-1.0 / 20.0)
    assert within_chi_square(path[1:] - decay * path[:-1], math.sqrt(1.0 - decay**2))
    starts = np.array([getattr(make(static(6.0), s, **keys)[1], f"{kind}_correlated")[0] for s in range(1000)])
    assert within_chi_square(starts, [1.0, 2.0, 3.0])


def test_sigmas_are_stated_for_what_is_white_and_correlated(tripod):
    keys = {"position_correlated_sd_m": 1.5, "position_correlated_tau_s": 60.0, "velocity_sd_mps": 0.05}
    honest, _ = make(tripod, position_sd_m=(1.0, 1.0, 2.0), **keys)
    np.testing.assert_allclose(honest.sd_position, np.tile(np.hypot([1.0, 1.0, 2.0], 1.5), (4001, 1)))
    np.testing.assert_allclose(honest.sd_velocity, 0.05)
    boasting, _ = make(tripod, position_sd_m=(1.0, 1.0, 2.0), stated_sigma_factor=0.25, **keys)
    np.testing.assert_allclose(boasting.sd_position, 0.25 * honest.sd_position)
    np.testing.assert_allclose(boasting.sd_velocity, 0.25 * honest.sd_velocity)
    np.testing.assert_array_equal(boasting.lat, honest.lat)


def test_with_white_errors_alone_it_is_the_simple_receiver():
    motion = car_drive(60.0, seed=1, standing=2.0)
    model = GnssReceiverModel(rate=4.0, offset=0.013, position_sd=(1e-9, 1e-9, 1e-9), velocity_sd=1e-9)
    log, _ = measure_gnss(motion, model, np.random.default_rng(0), LEVER_ARM)
    simple = gnss_fixes(motion, 4.0, 1.0, 1.0, LEVER_ARM, offset=0.013)
    np.testing.assert_array_equal(log.time, simple.time)
    np.testing.assert_allclose(log.lat, simple.lat, atol=1e-14)
    np.testing.assert_allclose(log.height, simple.height, atol=1e-7)
    np.testing.assert_allclose(log.velocity_n, simple.velocity_n, atol=1e-7)


def test_without_velocity_errors_there_is_no_velocity(tripod):
    log, truth = make(tripod)
    assert log.velocity_n is None
    assert log.sd_velocity is None
    assert log.fix is None
    assert not truth.velocity_white.any()


def test_outages_have_no_rows(tripod):
    log, _ = make(tripod, outages_s=[[10.0, 20.0], [3990.5, 5000.0]], latency_s=2.0)
    hidden = np.setdiff1d(np.arange(4001.0), log.time - 2.0)
    np.testing.assert_array_equal(hidden, np.concatenate([np.arange(10.0, 20.0), np.arange(3991.0, 4001.0)]))


def test_random_outages_come_as_often_and_last_as_long_as_stated():
    lengths = []
    for seed in range(20):
        log, _ = make(static(4000.0), seed, rate_hz=2.0, outages_per_h=9.0, outage_s=30.0)
        gaps = np.diff(log.time)
        lengths += list(gaps[gaps > 0.6])
    lengths = np.array(lengths)
    expected = 20 * 4000.0 * 9.0 / 3600.0 * math.exp(-9.0 * 30.0 / 3600.0)
    assert abs(lengths.size - expected) < 3.5 * math.sqrt(expected)
    assert lengths.min() == 30.5
    assert np.mean(lengths == 30.5) > 0.8


def test_multipath_jumps_and_holds():
    keys = {"multipath_jumps_per_h": 9.0, "multipath_mean_s": 60.0, "multipath_sd_m": (5.0, 10.0, 20.0)}
    _, truth = make(static(400_000.0), **keys)
    on = np.any(truth.multipath != 0.0, axis=1)
    begins = np.flatnonzero(on[1:] & ~on[:-1]) + 1
    assert within_chi_square(truth.multipath[begins], [5.0, 10.0, 20.0])
    busy = 1.0 - math.exp(-9.0 / 3600.0 * 60.0)
    jumps = 400_000.0 * 9.0 / 3600.0
    assert on.mean() == pytest.approx(busy, rel=3.5 * math.sqrt(2.0 / jumps))
    assert abs(begins.size - jumps * (1.0 - busy)) < 3.5 * math.sqrt(jumps)
    held = np.all(truth.multipath[1:] == truth.multipath[:-1], axis=1) | ~on[1:] | ~on[:-1]
    assert np.mean(~held) < 1.5 * 2.0 * jumps * busy / 400_000.0


def test_a_drift_pulls_position_and_velocity_and_then_stays(tripod):
    keys = {"drift_mps": (0.5, -0.25, 0.125), "drift_from_s": 1000.0, "drift_to_s": 1200.0, "velocity_sd_mps": 1e-9}
    log, truth = make(tripod, **keys)
    t = truth.true_time
    np.testing.assert_array_equal(truth.drift[t < 1000.0], 0.0)
    np.testing.assert_allclose(truth.drift[1100], [50.0, -25.0, 12.5])
    np.testing.assert_allclose(truth.drift[t >= 1200.0], np.tile([100.0, -50.0, 25.0], (2801, 1)))
    during = (t >= 1000.0) & (t < 1200.0)
    np.testing.assert_allclose(log.velocity_n[during], np.tile([0.5, -0.25, 0.125], (200, 1)), atol=1e-7)
    np.testing.assert_allclose(log.velocity_n[~during], 0.0, atol=1e-7)


def test_fix_types_scale_errors_and_sigmas_and_last_as_stated():
    motion = static(200_000.0)
    model = GnssReceiverModel.from_datasheet(fix_types=KINDS, position_sd_m=1.0)
    log, truth = measure_gnss(motion, model, np.random.default_rng(2))
    assert log.fix[0] == "rtk-fixed"
    shares = {kind.name: kind.mean_s for kind in KINDS}
    for kind in KINDS:
        rows = log.fix == kind.name
        np.testing.assert_array_equal(truth.sd_factor[rows], kind.sd_factor)
        np.testing.assert_allclose(log.sd_position[rows], kind.sd_factor)
        assert within_chi_square(truth.position_white[rows], kind.sd_factor)
        assert rows.mean() == pytest.approx(shares[kind.name] / 70.0, rel=0.08)
    changes = np.flatnonzero(log.fix[1:] != log.fix[:-1])
    stays = 200_000.0 / (70.0 / 3.0)
    assert 0.9 * stays < changes.size < 1.02 * stays
    after_fixed = log.fix[changes[log.fix[changes] == "rtk-fixed"] + 1]
    share = np.mean(after_fixed == "single")
    assert abs(share - 0.5) < 0.04


def test_one_fix_type_stays(tripod):
    log, _ = make(tripod, fix_types=[{"name": "single"}])
    assert set(log.fix) == {"single"}
    endless, _ = make(tripod, fix_types=[FixType("rtk-fixed"), FixType("single", 10.0)])
    assert set(endless.fix) == {"rtk-fixed"}


def test_every_key_becomes_its_field():
    given = dict.fromkeys(RECEIVER_UNITS, 1.0) | {"outages_s": [[1.0, 2.0]], "drift_mps": (1.0, 2.0, 3.0)}
    for key, (field, factor) in RECEIVER_UNITS.items():
        partner = {
            "position_sd_m": 1.0,
            "position_correlated_tau_s": 1.0,
            "velocity_correlated_tau_s": 1.0,
            "outages_per_h": 1.0,
            "outage_s": 1.0,
            "multipath_jumps_per_h": 1.0,
            "multipath_mean_s": 1.0,
            "multipath_sd_m": 1.0,
        }
        others = {k: v for k, v in partner.items() if RECEIVER_UNITS[k][0] != field}
        model = GnssReceiverModel.from_datasheet(**others, **{key: given[key]})
        np.testing.assert_allclose(getattr(model, field), factor * np.asarray(given[key]) + np.zeros(np.shape(getattr(model, field))))  # fmt: skip  # noqa: E501
    again = GnssReceiverModel.from_datasheet(position_sd_m=1.0).replace_datasheet(latency_ms=-5.0)
    assert (again.latency, again.position_sd[0]) == (-0.005, 1.0)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"positon_sd_m": 1.0}, "GNSS errors: unknown key or unit 'positon_sd_m': did you mean 'position_sd_m'"),
        ({"latency_us": 1.0}, "did you mean 'latency_s'|did you mean 'latency_ms'"),
        ({"latency_s": 1.0, "latency_ms": 1.0}, "sets latency a second time"),
        ({"position_sd_m": 0.0}, "both zero on some axis"),
        ({"position_sd_m": -1.0}, "position_sd must be finite and not negative"),
        ({"velocity_sd_mps": (0.1, 0.1, 0.0)}, "must give every axis an error, or none"),
        ({"rate_hz": 0.0}, "rate must be more than 0 and finite, not"),
        ({"stated_sigma_factor": 0.0}, "stated_sigma_factor must be more than 0"),
        ({"position_correlated_sd_m": 1.0}, "position_correlated_sd needs position_correlated_tau > 0"),
        ({"velocity_correlated_sd_mps": 1.0}, "velocity_correlated_sd needs velocity_correlated_tau > 0"),
        ({"outages_s": [[5.0, 4.0]]}, r"outages must be windows \[from, to\]"),
        ({"outages_s": [1.0, 2.0, 3.0]}, r"outages must be windows \[from, to\]"),
        ({"outages_per_h": 1.0}, "outage_frequency and outage_length need each other"),
        ({"multipath_sd_m": 1.0}, "multipath jumps need all of"),
        ({"drift_mps": 1.0}, "drift_velocity must be three finite numbers"),
        ({"drift_mps": (math.nan, 0.0, 0.0)}, "drift_velocity must be three finite numbers"),
        ({"drift_from_s": 5.0, "drift_to_s": 4.0}, "drift_to must be at least 5, not"),
        ({"fix_types": [{"name": "single", "sd_facto": 2.0}]}, "fix_types: unknown key or unit 'sd_facto'"),
        ({"fix_types": [{"sd_factor": 2.0}]}, "a fix type needs a name"),
        ({"fix_types": [{"name": "single", "sd_factor": 0.0}]}, "sd_factor of fix type 'single' must be more than 0"),
        ({"fix_types": [{"name": "single", "mean_s": -1.0}]}, "mean_s of fix type 'single' must be more than 0"),
    ],
)
def test_impossible_receivers_are_refused(keys, message):
    with pytest.raises(ConfigError, match=message):
        GnssReceiverModel.from_datasheet(**({"position_sd_m": 1.0} | keys))


def test_fix_types_of_another_kind_are_refused():
    with pytest.raises(ConfigError, match="fix_types must hold FixType, not str"):
        GnssReceiverModel(position_sd=1.0, fix_types=("single",))


def test_receivers_that_give_no_fix_are_refused(tripod):
    with pytest.raises(InputError, match="ends at 10 s, before the first GNSS fix at 12 s"):
        make(static(10.0), offset_s=12.0)
    with pytest.raises(InputError, match="the outages hide all 4001 GNSS fixes"):
        make(tripod, outages_s=[[-1.0, 5000.0]])
