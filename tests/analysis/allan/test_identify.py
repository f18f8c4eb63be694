from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.fft import dct

from navfuse.analysis.allan import identify
from navfuse.analysis.allan.likelihood import Restricted, cosine_spectrum
from navfuse.analysis.allan.terms import (
    FLOOR,
    allan_variance,
    flicker,
    gauss_markov_allan,
    gauss_markov_density,
    random_density,
)
from navfuse.errors import ConfigError, InputError

RATE = 50.0


def test_quantisation_white_noise_and_walk_are_exactly_diagonal():
    n, dt = 48, 0.02
    q, noise, walk = 0.3, 0.7, 5.0
    inner = np.zeros((n, n - 1))
    inner[np.arange(n - 1), np.arange(n - 1)] = 1.0 / dt
    inner[np.arange(1, n), np.arange(n - 1)] = -1.0 / dt
    summed = np.tril(np.ones((n, n)), -1)
    covariance = q**2 * inner @ inner.T + noise**2 / dt * np.eye(n) + walk**2 * dt * summed @ summed.T
    transform = np.asarray(dct(np.eye(n), type=2, norm="ortho", axis=0))[1:]
    found = transform @ covariance @ transform.T * dt
    f = np.arange(1, n) / (2.0 * n * dt)
    bias = flicker(n * dt)
    expected = sum(
        size**2 * random_density(name, f, dt, n * dt, bias) for name, size in (("Q", q), ("N", noise), ("K", walk))
    )
    assert np.diag(found) == pytest.approx(expected, rel=1e-9)
    assert np.max(np.abs(found - np.diag(np.diag(found)))) < 1e-9 * np.max(expected)


@pytest.mark.parametrize("correlation", [0.3, 3.0, 30.0, 300.0])
def test_gauss_markov_processes_are_diagonal_but_for_the_ends(correlation):
    n, dt = 600, 0.05
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n))) * dt
    transform = np.asarray(dct(np.eye(n), type=2, norm="ortho", axis=0))[1:]
    found = transform @ np.exp(-lag / correlation) @ transform.T * dt
    f = np.arange(1, n) / (2.0 * n * dt)
    assert np.diag(found)[:200] == pytest.approx(gauss_markov_density(f, dt, n * dt, correlation)[:200], rel=0.02)
    scale = np.sqrt(np.outer(np.diag(found), np.diag(found)))
    off = np.abs(found / scale - np.eye(n - 1))
    assert np.mean(off**2) < 1e-3


def test_allan_variances_are_those_of_the_densities():
    """By quadrature of the density: sigma^2 = 4 int S sin^4(pi f tau) / (pi f tau)^2 df, one-sided half of it."""
    f = np.geomspace(1e-6, 1e3, 400_001)
    for tau in (0.5, 4.0, 60.0):
        window = 4.0 * np.sin(math.pi * f * tau) ** 4 / (math.pi * f * tau) ** 2
        correlation = 7.0
        density = 2.0 * correlation / (1.0 + (2.0 * math.pi * f * correlation) ** 2)
        assert np.trapezoid(window * density, f) == pytest.approx(
            float(gauss_markov_allan(np.array([tau]), correlation)[0]), rel=2e-3
        )
        walk = np.trapezoid(window / (2.0 * math.pi * f) ** 2, f)
        assert walk == pytest.approx(float(allan_variance("K", np.array(tau), {"K": 1.0})), rel=2e-3)
        flat = np.trapezoid(window / (2.0 * math.pi * f), f)
        assert flat == pytest.approx(float(allan_variance("B", np.array(tau), {"B": 1.0})), rel=2e-3)


def test_the_series_of_the_gauss_markov_process_joins_its_formula():
    below, above = gauss_markov_allan(np.array([0.0099999, 0.0100001]), 1.0)
    assert above / below == pytest.approx(1.0, abs=3e-5)
    assert gauss_markov_allan(np.array([1.893]), 1.0)[0] ** 0.5 == pytest.approx(0.6174, abs=2e-4)


def test_flicker_is_flat_in_its_band_and_grows_with_the_record():
    tau = np.geomspace(1.2, 3000.0, 50)
    deviation = np.sqrt(allan_variance("B", tau, {"B": 2.0}, flicker(3600.0)))
    assert deviation == pytest.approx(2.0 * FLOOR, rel=0.02)
    assert flicker(3600.0).tau[-1] == pytest.approx(1e4)
    assert flicker(1e5).tau[-1] == pytest.approx(1e5)


def test_the_gradient_of_the_likelihood():
    spectrum = cosine_spectrum(np.random.default_rng(1).standard_normal(3000), 0.02)
    for ramp in (False, True):
        likelihood = Restricted(spectrum, ramp)
        density = 0.02 * (1.0 + 0.01 / spectrum.frequency)
        _, slope = likelihood.value(density)
        for k in (0, 5, 200, -1):
            step = np.zeros(density.size)
            step[k] = 1e-5
            change = likelihood.value(density * np.exp(step))[0] - likelihood.value(density * np.exp(-step))[0]
            assert slope[k] == pytest.approx(change / 2e-5, rel=1e-4, abs=1e-4)


def record(n, seed, q=0.0, noise=0.0, walk=0.0, ramp=0.0, markov=None):
    rng = np.random.default_rng(seed)
    dt = 1.0 / RATE
    values = noise / math.sqrt(dt) * rng.standard_normal(n) + ramp * dt * np.arange(n)
    values += walk * math.sqrt(dt) * np.cumsum(rng.standard_normal(n))
    values += np.diff(q * rng.standard_normal(n + 1)) / dt
    if markov:
        sd, tau = markov
        decay = math.exp(-dt / tau)
        drive = sd * math.sqrt(1.0 - decay**2) * rng.standard_normal(n)
        from scipy.signal import lfilter

        values += lfilter([1.0], [1.0, -decay], drive)
    return values


def test_terms_within_three_sigma():
    found = identify(record(100_000, 3, q=0.01, noise=0.5, walk=0.2), RATE)
    truth = {"Q": 0.01, "N": 0.5, "K": 0.2}
    for name, value in truth.items():
        term = found.term(name)
        assert term.present
        assert abs(term.value - value) < 3.0 * term.sigma
        assert 0.0 < term.sigma < 0.3 * value
    assert not found.term("B").present
    assert not found.term("R").present
    assert found.misfit == 0.0
    assert abs(found.chi2 - found.dof) < 5.0 * math.sqrt(2.0 * found.dof) + 100.0
    assert found.term("N").least_span < found.span


def test_stated_sigmas_cover_the_truth():
    """Of 40 records: one sigma covers 68 %, so 27 give or take 2.9; three of these are allowed."""
    inside, seen, count = {"N": 0, "K": 0}, 0, 40
    for seed in range(count):
        found = identify(record(10_000, 100 + seed, noise=0.5, walk=0.3), RATE)
        for name, truth in (("N", 0.5), ("K", 0.3)):
            term = found.term(name)
            inside[name] += term.present and abs(term.value - truth) < term.sigma
        seen += sum(found.term(name).present for name in "QBR")
    for name, number in inside.items():
        assert abs(number - 0.683 * count) < 3.0 * math.sqrt(0.683 * 0.317 * count), name
    assert seen <= 0.05 * 3 * count


def test_a_ramp_is_told_from_a_walk():
    found = identify(record(60_000, 5, noise=0.5, ramp=0.01), RATE)
    assert found.term("R").present
    assert abs(found.term("R").value - 0.01) < 3.0 * found.term("R").sigma
    assert not found.term("K").present
    without = identify(record(60_000, 6, noise=0.5, walk=0.3), RATE)
    assert without.term("K").present
    assert not without.term("R").present


def test_a_limit_holds_what_is_not_seen():
    found = identify(record(50_000, 8, noise=0.5, walk=0.002), RATE)
    assert not found.term("K").present
    assert 0.002 < found.term("K").limit < 0.2
    assert found.term("K").limit_level == 0.95
    assert math.isnan(found.term("N").limit_level)
    assert math.isnan(found.term("K").value)


def test_gauss_markov_process():
    found = identify(record(200_000, 9, noise=0.2, markov=(0.5, 20.0)), RATE, terms=("N", "B", "K", "GM"))
    term = found.term("GM")
    assert term.present
    assert abs(term.value - 0.5) < 3.0 * term.sigma
    assert abs(term.extra - 20.0) < 3.0 * term.extra_sigma
    assert found.parameters[-1] == "GM_tau"
    assert not identify(record(50_000, 10, noise=0.2), RATE, terms=("N", "GM")).term("GM").present


def test_sinusoids():
    values = record(60_000, 11, noise=0.3)
    time = np.arange(values.size) / RATE
    values += 0.2 * np.sin(2.0 * math.pi * 3.21 * time + 0.4) + 0.15 * np.cos(2.0 * math.pi * 11.7 * time)
    found = identify(values, RATE, terms=("N", "B", "sin"))
    lines = [term for term in found.terms if term.name == "sin"]
    assert len(lines) == 2
    for line, (amplitude, frequency) in zip(lines, ((0.2, 3.21), (0.15, 11.7)), strict=True):
        assert abs(line.value - amplitude) < 4.0 * line.sigma
        assert abs(line.extra - frequency) < 4.0 * line.extra_sigma
    assert abs(found.term("N").value - 0.3) < 4.0 * found.term("N").sigma
    quiet = identify(record(20_000, 12, noise=0.3), RATE, terms=("N", "sin"))
    assert not quiet.term("sin").present


def test_a_line_or_the_edge_of_a_filter_does_not_spoil_the_rest():
    from scipy.signal import butter, lfilter

    values = record(200_000, 13, noise=0.5, walk=0.1)
    numerator, denominator = np.asarray(butter(2, 0.5))
    values = np.asarray(lfilter(numerator, denominator, values))
    values += 0.5 * np.sin(2.0 * math.pi * 5.0 * np.arange(values.size) / RATE)
    found = identify(values, RATE)
    assert found.misfit > 0.0 or found.left_out > 0.0
    assert found.term("N").value == pytest.approx(0.5, rel=0.03)
    assert found.term("K").value == pytest.approx(0.1, rel=0.3)


def test_what_the_deviation_does_not_hold_is_not_reported():
    """Band-limited shaking at rest: the angle goes nowhere, whatever the spectrum looks like below the band."""
    from scipy.signal import butter, sosfilt

    rng = np.random.default_rng(14)
    shaping = butter(2, (1.0, 4.0), "bandpass", fs=RATE, output="sos")
    values = np.asarray(sosfilt(shaping, rng.standard_normal(100_000)))
    found = identify(values, RATE)
    for term in found.terms:
        if term.present:
            assert np.all(found.allan_variance(np.array([1.0, 10.0, 100.0]), term.name) < 1.0)
    assert not found.term("B").present
    assert not found.term("K").present


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.ones(5000), "constant: a channel without any noise"),
        (np.arange(100.0), "100 samples are too short a record to identify noise: at least 1000"),
        (np.where(np.arange(5000) == 7, np.inf, np.arange(5000.0)), "values that are infinite"),
        (
            np.where(np.arange(5000) % 4 == 0, np.nan, np.arange(5000.0)),
            "25 % of the samples are missing, so that no part of 1000 .* most 5 % missing .the longest has 3",
        ),
        (np.full(5000, np.nan), "0 samples are too short a record to identify noise"),
        (np.ones((5000, 2)), "one axis at a time"),
    ],
)
def test_records_that_tell_nothing(values, message):
    with pytest.raises(InputError, match=message):
        identify(values, RATE)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"terms": ("N", "X")}, "noise terms X: known are Q, N, B"),
        ({"terms": ()}, r"noise terms \(none\)"),
        ({"terms": ("R",)}, "of the terms Q, N, B and K at least one"),
        ({"flicker_band": (1.0, 5.0)}, "two correlation times in seconds, a decade or more apart"),
    ],
)
def test_settings_that_make_no_sense(options, message):
    with pytest.raises(ConfigError, match=message):
        identify(record(2000, 1, noise=1.0), RATE, **options)


@pytest.mark.slow
def test_simulated_sensors_of_two_grades():
    """Five logs of 6 h: 15 records of each grade; the full study is ``benchmarks.allan_identification``.

    One sigma covers the truth in 68 % of the records; of 90 terms that is 61.5 give or take 4.4, three of which are
    allowed. Medians of 15 scatter by 1.25 / sqrt(15) = 0.32 of the sigma of one.
    """
    from navfuse.data.logs import ImuLog
    from navfuse.imu.error_model import ImuErrorModel
    from navfuse.simulation import ImuSensorModel, measure_imu

    dph = math.radians(1.0) / 3600.0
    truth = {
        "gyro": {"N": 12.0 * dph, "B": 5.0 / FLOOR * dph, "K": 0.5 * dph},
        "accel": {"N": 2.4 * dph, "B": 0.25 / FLOOR * dph, "K": 0.024 * dph},
    }
    n = 2_160_000
    still = ImuLog(np.arange(n) / 100.0, np.zeros((n, 3)), np.zeros((n, 3)), "rates")
    model = ImuSensorModel(
        ImuErrorModel(arw=truth["gyro"]["N"], vrw=truth["accel"]["N"]),
        gyro_bias_instability=truth["gyro"]["B"],
        accel_bias_instability=truth["accel"]["B"],
        gyro_rate_walk=truth["gyro"]["K"],
        accel_rate_walk=truth["accel"]["K"],
    )
    ratios: dict[tuple[str, str], list[float]] = {}
    covered, spurious = 0, 0
    for seed in range(5):
        log, _ = measure_imu(still, model, np.random.default_rng(500 + seed))
        for sensor, values in truth.items():
            for axis in range(3):
                found = identify(np.ascontiguousarray(getattr(log, sensor)[:, axis]), 100.0)
                spurious += found.term("Q").present + found.term("R").present
                for name, value in values.items():
                    term = found.term(name)
                    covered += term.present and abs(term.value - value) < term.sigma
                    ratios.setdefault((sensor, name), []).append(term.value / value)
    for (_, name), values in ratios.items():
        assert abs(np.nanmedian(values) - 1.0) < {"N": 0.02, "B": 0.15, "K": 0.20}[name]
    assert abs(covered - 0.683 * 90) < 3.0 * math.sqrt(90 * 0.683 * 0.317)
    assert spurious <= 5


def test_the_sums_of_the_spectrum_against_arrays_of_the_whole_length():
    rng = np.random.default_rng(20)
    for n in (1000, 4097, 60_000):
        dt, values = 0.02, np.cumsum(rng.standard_normal(n)) + rng.standard_normal(n)
        found = cosine_spectrum(values, dt)
        k = np.arange(1, n)
        c = math.sqrt(dt) * np.asarray(dct(values - values.mean(), type=2, norm="ortho"))[1:]
        edge = np.concatenate([[0], np.cumsum(found.dof)[:-1]]).astype(int)
        half = 0.5 * math.pi * k / n
        first = math.sqrt(2.0 / n * dt) * np.cos(half)
        odd = k % 2 == 1
        ramp = np.where(odd, -math.sqrt(2.0 / n * dt) * dt * np.cos(half) / (2.0 * np.sin(half) ** 2), 0.0)
        columns = (first, np.where(odd, -first, first), ramp)
        assert found.power == pytest.approx(np.add.reduceat(c * c, edge), rel=1e-12)
        assert found.frequency == pytest.approx(
            np.exp(np.add.reduceat(np.log(k), edge) / found.dof) / (2 * n * dt), rel=1e-12
        )
        for i, x in enumerate(columns):
            scale = np.sqrt(np.add.reduceat(x * x, edge))
            room = 1e-12 * scale * np.sqrt(found.power) + 1e-300
            assert np.all(np.abs(found.design[i] - np.add.reduceat(x * c, edge)) <= room)
            for j, y in enumerate(columns):
                room = 1e-12 * scale * np.sqrt(np.add.reduceat(y * y, edge)) + 1e-300
                assert np.all(np.abs(found.gram[i, j] - np.add.reduceat(x * y, edge)) <= room)


def test_memory_of_an_identification():
    """Two vectors of the length of the record beside it: the transform, and the phase."""
    import tracemalloc

    values = record(1_000_000, 21, noise=0.5)
    identify(values[:5000], RATE)
    tracemalloc.start()
    identify(values, RATE)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2.0 * values.nbytes
