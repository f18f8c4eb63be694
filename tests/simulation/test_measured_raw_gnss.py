"""Simulated pseudo-ranges and range rates against their definitions, and the size of every error."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pymap3d
import pytest
from scipy import stats

from navfuse.errors import InputError
from navfuse.gnss.atmosphere import ionosphere_obliquity, saastamoinen_zenith, troposphere_mapping
from navfuse.gnss.ranging import range_and_rate
from navfuse.gnss.single_point import single_point_position, single_point_velocity
from navfuse.simulation import RawGnssModel, antenna_state, car_drive, circle_flight, measure_raw_gnss, static

LEVER_ARM = (1.5, -0.4, -1.2)
EVERYTHING = {
    "rate_hz": 2.0,
    "clock_offset_m": 1e5,
    "clock_drift_mps": 200.0,
    "clock_phase_psd_m2_per_s": 0.01,
    "clock_frequency_psd_m2_per_s3": 0.04,
    "signal_sd_m": 1.0,
    "signal_tau_s": 1800.0,
    "ionosphere_sd_m": 2.0,
    "ionosphere_tau_s": 900.0,
    "troposphere_sd_m": 0.2,
    "troposphere_tau_s": 900.0,
    "code_sd_m": 0.5,
    "code_elevation_sd_m": 0.5,
    "multipath_sd_m": 1.0,
    "multipath_tau_s": 60.0,
    "range_rate_sd_mps": 0.02,
    "range_rate_elevation_sd_mps": 0.01,
    "outlier_percent": 1.0,
    "outlier_s": 10.0,
    "outlier_from_m": 90.0,
    "outlier_to_m": 120.0,
    "cn0_sd_db": 1.0,
    "latency_ms": 80.0,
}
PARTS = ("signal", "ionosphere", "troposphere", "code_noise", "multipath", "outlier")


def make(motion, seed=0, lever_arm=LEVER_ARM, **keys):
    return measure_raw_gnss(motion, RawGnssModel.from_datasheet(**keys), np.random.default_rng(seed), lever_arm)


def within_chi_square(values, sd):
    """Whether the mean square of independent normals lies in its 99.9 % interval."""
    low, high = stats.chi2.ppf([0.0005, 0.9995], values.size) / values.size
    return low < np.mean(np.square(values / sd)) < high


def same(a, b, names):
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names)


@pytest.fixture(name="tripod", scope="module")
def _tripod():
    return static(4000.0, 0.8, 0.2, 50.0)


@pytest.fixture(name="drive", scope="module")
def _drive():
    return car_drive(300.0, seed=1, standing=2.0)


@pytest.mark.parametrize("corrected", [True, False])
def test_the_log_is_made_of_the_stated_parts(drive, corrected):
    log, truth = make(drive, corrected=corrected, **EVERYTHING)
    k = truth.epoch
    r_e, v_e = antenna_state(drive, truth.epoch_time, LEVER_ARM)
    np.testing.assert_array_equal(truth.antenna_r_e, r_e)
    np.testing.assert_array_equal(truth.antenna_v_e, v_e)
    parts = sum(getattr(truth, name) for name in PARTS)
    np.testing.assert_allclose(log.pseudorange, truth.rho + truth.clock_offset[k] + parts, rtol=0, atol=1e-7)
    np.testing.assert_allclose(log.range_rate, truth.rate + truth.clock_drift[k] + truth.range_rate_noise, atol=1e-9)
    for row in range(0, len(log), 97):
        rho, rate, *_ = range_and_rate(*log.sat_r_e[row], *log.sat_v_e[row], *r_e[k[row]], *v_e[k[row]])
        assert (rho, rate) == (truth.rho[row], truth.rate[row])
    np.testing.assert_allclose(log.time, truth.epoch_time[k] + 0.08, rtol=0, atol=1e-12)
    times, first = log.epochs()
    assert times.size == truth.epoch_time.size
    assert np.all(np.diff(log.time) >= 0.0)
    for begin, end in pairwise(first):
        assert len(set(log.satellite[begin:end])) == end - begin
    assert log.corrected is corrected


@pytest.mark.parametrize(("lat", "lon"), [(0.8, 0.2), (0.1, math.pi), (math.pi / 2.0, 0.0), (-1.56, 3.0)])
def test_without_errors_least_squares_gives_the_truth(lat, lon):
    motion = static(60.0, lat, lon, 50.0) if lat > 1.57 else circle_flight(60.0, lat=lat, lon=lon)
    log, truth = make(motion, clock_offset_m=1e5, clock_drift_mps=200.0, rate_hz=0.1)
    _, first = log.epochs()
    for k, rows in enumerate(slice(*pair) for pair in pairwise(first)):
        fix = single_point_position(log.pseudorange[rows], log.sat_r_e[rows])
        moving = single_point_velocity(log.range_rate[rows], log.sat_r_e[rows], log.sat_v_e[rows], fix.vector_e)
        np.testing.assert_allclose(fix.vector_e, truth.antenna_r_e[k], rtol=0, atol=1e-6)
        np.testing.assert_allclose(moving.vector_e, truth.antenna_v_e[k], rtol=0, atol=1e-6)
        assert fix.clock == pytest.approx(truth.clock_offset[k], abs=1e-6)
        assert moving.clock == pytest.approx(truth.clock_drift[k], abs=1e-6)
    np.testing.assert_array_equal(log.sd_pseudorange, 0.01)
    np.testing.assert_array_equal(log.sd_range_rate, 0.001)


def test_pseudoranges_grow_as_the_range_rates_say():
    """Error-free, with the clock running: differences of sixth order over 0.6 s against the rate in the middle."""
    log, truth = make(static(300.0, 0.8, 0.2, 50.0), clock_drift_mps=150.0, rate_hz=10.0)
    rows = {}
    for row, key in enumerate(zip(truth.epoch, log.satellite, strict=True)):
        rows[int(key[0]), str(key[1])] = row
    checked = 0
    for (k, name), row in rows.items():
        around = [rows.get((k + step, name)) for step in (-3, -2, -1, 1, 2, 3)]
        if None in around or k % 50:
            continue
        p = log.pseudorange[around]
        slope = (45.0 * (p[3] - p[2]) - 9.0 * (p[4] - p[1]) + (p[5] - p[0])) / 6.0
        assert log.range_rate[row] == pytest.approx(slope, abs=1e-6)
        checked += 1
    assert checked > 300


def test_elevation_and_azimuth_are_those_of_the_satellites(drive):
    log, truth = make(drive)
    r = truth.antenna_r_e[truth.epoch]
    turn = 7.292115e-5 * truth.rho / 299792458.0
    x, y, z = log.sat_r_e.T
    there = (np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x, z)
    azimuth, elevation, _ = pymap3d.ecef2aer(*there, *pymap3d.ecef2geodetic(*r.T))
    np.testing.assert_allclose(np.degrees(log.elevation), elevation, rtol=0, atol=1e-7)
    np.testing.assert_allclose(np.degrees(log.azimuth), azimuth, rtol=0, atol=1e-7)
    assert 6 <= len(log) / truth.epoch_time.size <= 14
    np.testing.assert_allclose(log.cn0, 35.0 + 13.0 * np.sin(log.elevation), rtol=1e-14)


def test_the_same_seed_gives_the_same_bytes(drive):
    one, truth = make(drive, 5, **EVERYTHING)
    two, again = make(drive, 5, **EVERYTHING)
    for a, b in ((one, two), (truth, again)):
        for entry in dataclasses.fields(a):
            assert np.asarray(getattr(a, entry.name)).tobytes() == np.asarray(getattr(b, entry.name)).tobytes()
    other, _ = make(drive, 6, **EVERYTHING)
    assert not np.array_equal(one.pseudorange, other.pseudorange)


OFF = {
    "signal": {"signal_sd_m": 0.0},
    "ionosphere": {"ionosphere_sd_m": 0.0},
    "troposphere": {"troposphere_sd_m": 0.0},
    "code_noise": {"code_sd_m": 0.0, "code_elevation_sd_m": 0.0},
    "multipath": {"multipath_sd_m": 0.0},
    "outlier": {"outlier_percent": 0.0},
    "range_rate_noise": {"range_rate_sd_mps": 0.0, "range_rate_elevation_sd_mps": 0.0},
    "clock_offset": {"clock_phase_psd_m2_per_s": 0.0},
    "clock_drift": {"clock_frequency_psd_m2_per_s3": 0.0},
}


@pytest.mark.parametrize("name", OFF)
def test_switching_one_error_off_leaves_the_draws_of_the_others(drive, name):
    _, everything = make(drive, **EVERYTHING)
    _, without = make(drive, **(EVERYTHING | OFF[name]))
    others = [entry.name for entry in dataclasses.fields(everything) if entry.name != name]
    if name == "clock_drift":
        others.remove("clock_offset")
    assert same(everything, without, others)
    assert not np.array_equal(getattr(everything, name), getattr(without, name))


def test_another_sky_leaves_the_draws_of_what_is_left(drive):
    log, whole = make(drive, **EVERYTHING)
    part, cut = make(
        drive,
        **EVERYTHING,
        sectors=[{"azimuth_from_deg": 300.0, "azimuth_to_deg": 100.0, "elevation_below_deg": 50.0}],
        outages_s=[[50.0, 60.0]],
        satellite_outages=[{"satellite": str(log.satellite[0])}],
    )
    both = np.isin(
        np.array([f"{t} {s}" for t, s in zip(log.time, log.satellite, strict=True)]),
        np.array([f"{t} {s}" for t, s in zip(part.time, part.satellite, strict=True)]),
    )
    assert 0.2 < both.mean() < 0.9
    assert same(log.take(both), part, ("time", "satellite", "pseudorange", "range_rate", "cn0", "sd_pseudorange"))
    np.testing.assert_array_equal(whole.outlier[both], cut.outlier)
    assert str(log.satellite[0]) not in part.satellite


def test_the_mask_and_sectors_are_exact(drive):
    log, truth = make(drive, elevation_mask_deg=0.0, rate_hz=0.5)
    heading = drive.trajectory(truth.epoch_time).attitude[truth.epoch, 2]
    time = truth.epoch_time[truth.epoch]
    nose = np.degrees(log.azimuth - heading) % 360.0
    el, az = np.degrees(log.elevation), np.degrees(log.azimuth)
    cases = [
        ({"elevation_mask_deg": 15.0}, el >= 15.0),
        ({"sectors": [(350.0, 80.0, 40.0, {})]}, ~(((az >= 350.0) | (az < 80.0)) & (el < 40.0))),
        (
            {"sectors": [(-60.0, 60.0, 70.0, {"relative_to": "vehicle"})]},
            ~(((nose >= 300.0) | (nose < 60.0)) & (el < 70.0)),
        ),
        (
            {"sectors": [(0.0, 360.0, 90.0, {"windows_s": [[100.0, 120.0]]}), (0.0, 90.0, 30.0, {})]},
            ~((time >= 100.0) & (time < 120.0)) & ~((az < 90.0) & (el < 30.0)),
        ),
        ({"outages_s": [[10.0, 20.0]]}, ~((time >= 10.0) & (time < 20.0))),
        (
            {"satellite_outages": [{"satellite": str(log.satellite[2]), "from_s": 5.0, "to_s": 44.0}]},
            ~((log.satellite == log.satellite[2]) & (time >= 5.0) & (time < 44.0)),
        ),
    ]  # fmt: skip
    for keys, kept in cases:
        if "sectors" in keys:
            keys = {
                "sectors": [
                    {"azimuth_from_deg": a, "azimuth_to_deg": b, "elevation_below_deg": c} | more
                    for a, b, c, more in keys["sectors"]
                ]
            }
        part, _ = make(drive, **({"elevation_mask_deg": 0.0, "rate_hz": 0.5} | keys))
        assert 0 < kept.sum() < len(log)
        assert same(log.take(kept), part, ("time", "satellite", "pseudorange"))


def test_white_noise_has_the_stated_size_at_every_elevation(tripod):
    keys = {
        "code_sd_m": 0.3,
        "code_elevation_sd_m": 0.6,
        "range_rate_sd_mps": 0.01,
        "range_rate_elevation_sd_mps": 0.02,
    }
    log, truth = make(tripod, **keys)
    for values, a, b, stated in (
        (truth.code_noise, 0.3, 0.6, log.sd_pseudorange),
        (truth.range_rate_noise, 0.01, 0.02, log.sd_range_rate),
    ):
        sd = np.sqrt(a**2 + (b / np.sin(log.elevation)) ** 2)
        np.testing.assert_allclose(stated, sd, rtol=1e-12)
        for low, high in ((5.0, 20.0), (20.0, 50.0), (50.0, 90.0)):
            rows = (np.degrees(log.elevation) >= low) & (np.degrees(log.elevation) < high)
            assert rows.sum() > 1000
            assert within_chi_square(values[rows], sd[rows])


@pytest.mark.parametrize("name", ["signal", "multipath"])
def test_slow_errors_of_satellites_are_stationary_gauss_markov(tripod, name):
    """Innovations of the known process are white and independent between satellites; so is the first sample."""
    tau, sd = 50.0, 2.0
    first, later = [], []
    for seed in range(40):
        log, truth = make(tripod, seed, **{f"{name}_sd_m": sd, f"{name}_tau_s": tau, "rate_hz": 0.05})
        for satellite in np.unique(log.satellite):
            rows = np.flatnonzero(log.satellite == satellite)
            path, step = getattr(truth, name)[rows], np.diff(truth.epoch[rows])
            first.append(path[0])
            decay = np.exp(-step * 20.0 / tau)
            later.append((path[1:] - decay * path[:-1]) / np.sqrt(1.0 - decay**2))
    later = np.concatenate(later)
    assert within_chi_square(np.array(first), sd)
    assert within_chi_square(later, sd)
    correlation = np.mean(later[1:] * later[:-1]) / sd**2
    assert abs(correlation) < 3.3 / math.sqrt(later.size)
    assert len(first) >= 300
    np.testing.assert_allclose(log.sd_pseudorange, sd, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "growth"), [("ionosphere", ionosphere_obliquity), ("troposphere", troposphere_mapping)]
)
def test_the_atmosphere_leaves_one_error_at_the_zenith_for_all(tripod, name, growth):
    tau, sd = 60.0, 1.5
    draws = []
    for seed in range(30):
        log, truth = make(tripod, seed, **{f"{name}_sd_m": sd, f"{name}_tau_s": tau, "rate_hz": 0.05})
        zenith = getattr(truth, name) / growth(log.elevation)
        times, first = log.epochs()
        per_epoch = zenith[first[:-1]]
        np.testing.assert_allclose(zenith, per_epoch[truth.epoch], rtol=1e-12)
        decay = math.exp(-20.0 / tau)
        draws.append(np.append(per_epoch[0], (per_epoch[1:] - decay * per_epoch[:-1]) / math.sqrt(1.0 - decay**2)))
        np.testing.assert_allclose(log.sd_pseudorange, sd * growth(log.elevation), rtol=1e-12)
        assert times.size == 201
    assert within_chi_square(np.concatenate(draws), sd)


def test_what_is_not_corrected_holds_the_whole_atmosphere(tripod):
    log, truth = make(tripod, corrected=False, ionosphere_zenith_m=5.0, lever_arm=(0.0, 0.0, 0.0))
    np.testing.assert_allclose(truth.ionosphere, 5.0 * ionosphere_obliquity(log.elevation), rtol=1e-12)
    zenith = sum(saastamoinen_zenith(0.8, 50.0))
    assert 2.3 < zenith < 2.5
    np.testing.assert_allclose(truth.troposphere, zenith * troposphere_mapping(log.elevation), rtol=1e-9)
    assert not log.corrected
    _, clean = make(tripod)
    assert not clean.ionosphere.any()
    assert not clean.troposphere.any()


@pytest.mark.parametrize("rate", [0.025, 0.25])
def test_the_clock_wanders_as_its_two_densities_say(rate):
    """After T, in one step and in ten, 400 runs: variances S_f T^3 / 3 + S_p T and S_f T, covariance S_f T^2 / 2."""
    T, S_p, S_f = 40.0, 0.3, 0.02
    drive = static(T, 0.8, 0.2, 50.0)
    ends = []
    for seed in range(400):
        _, truth = make(
            drive, seed, clock_offset_m=7.0, clock_drift_mps=-3.0, clock_phase_psd_m2_per_s=S_p,
            clock_frequency_psd_m2_per_s3=S_f, rate_hz=rate,
        )  # fmt: skip
        assert (truth.clock_offset[0], truth.clock_drift[0]) == (7.0, -3.0)
        ends.append([truth.clock_offset[-1] - 7.0 + 3.0 * T, truth.clock_drift[-1] + 3.0])
    ends = np.array(ends)
    covariance = np.array([[S_f * T**3 / 3.0 + S_p * T, S_f * T**2 / 2.0], [S_f * T**2 / 2.0, S_f * T]])
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), ends.T)
    assert within_chi_square(whitened[0], 1.0)
    assert within_chi_square(whitened[1], 1.0)
    assert abs(np.mean(whitened[0] * whitened[1])) < 3.3 / math.sqrt(400.0)
    assert np.all(np.abs(ends.mean(axis=0)) < 3.3 * np.sqrt(np.diag(covariance) / 400.0))


@pytest.mark.parametrize("length", [0.0, 10.0])
def test_outliers_have_the_stated_share_size_and_length(tripod, length):
    log, truth = make(tripod, outlier_percent=2.0, outlier_s=length, outlier_from_m=50.0, outlier_to_m=60.0)
    hit = truth.outlier != 0.0
    events = len(log) * 0.02 / max(length, 1.0)
    assert abs(hit.sum() / max(length, 1.0) - events) < 3.3 * math.sqrt(events)
    assert truth.outlier[hit].min() >= 50.0
    assert truth.outlier[hit].max() <= 60.0
    assert stats.kstest(np.unique(truth.outlier[hit]), stats.uniform(50.0, 10.0).cdf).pvalue > 1e-3
    sizes, counts = np.unique(truth.outlier[hit], return_counts=True)
    assert counts.max() == max(length, 1.0)
    assert np.mean(counts == max(length, 1.0)) > 0.8
    assert sizes.size > 30


def test_stated_sigmas_follow_the_factor_and_the_least(tripod):
    honest, _ = make(tripod, code_sd_m=2.0, range_rate_sd_mps=0.05)
    shy, _ = make(tripod, code_sd_m=2.0, range_rate_sd_mps=0.05, stated_sigma_factor=0.5, stated_least_mps=0.1)
    np.testing.assert_allclose(honest.sd_pseudorange, 2.0, rtol=1e-12)
    np.testing.assert_allclose(shy.sd_pseudorange, 1.0, rtol=1e-12)
    np.testing.assert_array_equal(shy.sd_range_rate, 0.1)
    np.testing.assert_array_equal(shy.pseudorange, honest.pseudorange)


def test_the_constellation_starts_when_told(tripod):
    one, _ = make(tripod, rate_hz=0.01)
    two, _ = make(tripod, rate_hz=0.01, constellation_start_s=1000.0)
    later, early = one.take(one.time == 1000.0), two.take(two.time == 0.0)
    assert later.satellite.tolist() == early.satellite.tolist()
    np.testing.assert_allclose(later.sat_r_e, early.sat_r_e, rtol=0, atol=1e-6)


ALL_ROUND = {"azimuth_from_deg": 0.0, "azimuth_to_deg": 360.0}


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"offset_s": 1e4}, "before the first GNSS epoch at 10000 s"),
        ({"elevation_mask_deg": 89.9}, "above the elevation mask of 89.9 deg at all 301 epochs: lower the mask"),
        ({"sectors": [ALL_ROUND | {"elevation_below_deg": 90.0}]}, "sectors hide every satellite at all 301 epochs"),
        ({"sectors": [ALL_ROUND | {"elevation_below_deg": 88.0}]}, "make one narrower or lower, or give it windows"),
        ({"outages_s": [[0.0, 1e3]]}, "the outages hide every satellite that the sky leaves at all 301 epochs"),
        ({"rate_hz": 1e-4, "outages_s": [[0.0, 1e3]]}, "leaves at the only epoch: shorten them"),
    ],
)  # fmt: skip
def test_an_empty_sky_is_refused(drive, keys, message):
    with pytest.raises(InputError, match=message):
        make(drive, **keys)
