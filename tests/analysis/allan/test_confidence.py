from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from navfuse.analysis.allan import deviation
from navfuse.analysis.allan.confidence import autocovariance, degrees_of_freedom, interval, pooled, total_bias
from reference.allan_twin import covariance, difference_rows, exact_bias, exact_edf, noise_rates

NOISES = (0, -1, -2)
STATIONARY = ("adev", "oadev", "mdev", "hdev", "ohdev")


@pytest.mark.parametrize("kind", STATIONARY)
@pytest.mark.parametrize("alpha", [2, 0, -2])
@pytest.mark.parametrize(("m", "n"), [(1, 60), (3, 80), (10, 90), (20, 130)])
def test_sampled_noise_against_the_covariance_written_out(kind, alpha, m, n):
    """To rounding: the covariance is that of the samples, not of noise that goes on between them."""
    assert degrees_of_freedom(kind, alpha, m, n) == pytest.approx(exact_edf(kind, alpha, m, n), rel=1e-6)


@pytest.mark.parametrize(
    ("kind", "alpha"), [*((kind, -1) for kind in STATIONARY), ("hdev", -3), ("ohdev", -3)], ids=str
)
@pytest.mark.parametrize(("m", "n"), [(1, 60), (3, 80), (10, 90), (20, 130), (20, 400)])
def test_flicker_against_the_covariance_written_out(kind, alpha, m, n):
    """What is left out are correlations beyond the last lag."""
    assert degrees_of_freedom(kind, alpha, m, n) == pytest.approx(exact_edf(kind, alpha, m, n), rel=4e-3)


def test_flicker_of_phase_and_the_steepest_noise_have_the_correlations_of_their_density():
    """The inverse transform of ``sin(pi f tau)^(2d) / f^(2 - alpha)``, of phase that is averaged over a sample."""
    frequency = (np.arange(400_000) + 0.5) * 5e-5
    for kind, alpha, d, m in (("oadev", 1, 2, 5), ("ohdev", -4, 3, 4)):
        density = np.sin(np.pi * frequency * m) ** (2 * d) / frequency ** (2 - alpha)
        if alpha == 1:
            density *= np.sinc(frequency) ** 2
        expected = np.array([np.sum(density * np.cos(2.0 * np.pi * frequency * lag)) for lag in (0, 1, 3, 2 * m)])
        signs = np.polynomial.polynomial.polypow([1.0, -1.0], 2 * d) * (-1.0) ** d
        lags = np.array([[lag + (k - d) * m for k in range(2 * d + 1)] for lag in (0, 1, 3, 2 * m)])
        found = autocovariance(lags, alpha) @ signs
        assert found / found[0] == pytest.approx(expected / expected[0], abs=2e-4), kind


@pytest.mark.parametrize("kind", ["oadev", "mdev", "ohdev", "totdev"])
@pytest.mark.parametrize("alpha", NOISES)
def test_fewer_lags_change_nothing(kind, alpha, monkeypatch):
    fine = degrees_of_freedom(kind, alpha, 1200, 60_000)
    monkeypatch.setattr("navfuse.analysis.allan.confidence.MOST_LAGS", 400)
    assert degrees_of_freedom(kind, alpha, 1200, 60_000) == pytest.approx(fine, rel=0.01)


def test_flicker_phase_noise_is_on_the_safe_side_beyond_the_most_lags(monkeypatch):
    fine = degrees_of_freedom("oadev", 1, 1200, 60_000)
    monkeypatch.setattr("navfuse.analysis.allan.confidence.MOST_LAGS", 400)
    assert 0.5 * fine < degrees_of_freedom("oadev", 1, 1200, 60_000) < fine


def test_published_values_of_total_variance():
    """NIST SP 1065, table 7: 1.5 T/tau for white rate noise, 1.168 T/tau - 0.222 and 0.927 T/tau - 0.358."""
    for alpha, published in ((0, 150.0), (-1, 116.578), (-2, 92.342)):
        assert degrees_of_freedom("totdev", alpha, 400, 40_000) == pytest.approx(published, rel=1e-4)


@pytest.mark.parametrize(("alpha", "bar"), [(2, 0.02), (0, 0.01), (-1, 0.01), (-2, 0.02)])
@pytest.mark.parametrize("m", [1, 2, 3, 8, 40, 120, 200])
def test_total_variance_against_the_covariance_written_out(alpha, bar, m):
    """The published fits give 1.5 n edf for white noise and m = 1, more than there are samples."""
    assert degrees_of_freedom("totdev", alpha, m, 400) == pytest.approx(exact_edf("totdev", alpha, m, 400), rel=bar)
    assert degrees_of_freedom("totdev", alpha, m, 400) < 400


@pytest.mark.parametrize("m", [1, 3, 20, 80, 130])
def test_total_variance_of_flicker_phase_noise_is_on_the_safe_side(m):
    rows, at = difference_rows("totdev", m, 400), np.arange(401)
    found = rows @ autocovariance(at[:, None] - at, 1) @ rows.T
    exact = np.trace(found) ** 2 / np.sum(found**2)
    assert 0.8 * exact < degrees_of_freedom("totdev", 1, m, 400) < 1.01 * exact


@pytest.mark.parametrize("alpha", [2, *NOISES])
@pytest.mark.parametrize("share", [0.01, 0.1, 0.3, 0.5, 0.75])
def test_bias_of_total_variance_against_the_covariance_written_out(alpha, share):
    m = round(200 * share)
    assert total_bias(alpha, m, 200) == pytest.approx(exact_bias(alpha, m, 200), abs=0.007)


def test_a_record_that_is_too_short_has_none():
    assert degrees_of_freedom("ohdev", 0, 40, 100) == 0.0
    assert degrees_of_freedom("oadev", 0, 40, np.array([79, 80])).tolist() == [0.0, 1.0]


@pytest.mark.parametrize("kind", ["oadev", "mdev", "adev", "totdev"])
def test_stretches_are_pooled_by_the_covariance_of_all_differences(kind):
    """Three unequal stretches of independent noise: one covariance matrix of blocks."""
    size, m = np.array([40, 95]), 12
    times = np.array([2, 1])
    blocks = [covariance(kind, 0, m, n) for n in size]
    trace = sum(k * np.trace(block) for k, block in zip(times, blocks, strict=True))
    squares = sum(k * np.sum(block**2) for k, block in zip(times, blocks, strict=True))
    edf, count = degrees_of_freedom(kind, 0, m, size), np.array([len(block) for block in blocks])
    assert pooled(edf, count, times) == pytest.approx(trace**2 / squares, rel=0.02 if kind == "totdev" else 1e-6)
    assert pooled(edf, count, times) < edf @ times


def test_limits_are_quantiles_of_chi_square():
    low, high = interval(np.array([4.0, np.nan, 1.0]), np.array([10.0, 5.0, 0.0]), 0.9)
    assert low[0] == pytest.approx(40.0 / chi2.ppf(0.95, 10))
    assert high[0] == pytest.approx(40.0 / chi2.ppf(0.05, 10))
    assert np.isnan(low[1:]).all()
    assert np.isnan(high[1:]).all()


def truth(kind, alpha, factors):
    """Expected square of each deviation, from covariances of one difference."""
    found = []
    for m in factors:
        allan = "oadev" if kind == "totdev" else kind
        n = {"oadev": 2, "adev": 2, "mdev": 3, "hdev": 3, "ohdev": 3}[allan] * m - (1 if kind == "mdev" else 0)
        scale = (6.0 if "hdev" in kind else 2.0) * m**2 * (m**2 if kind == "mdev" else 1)
        found.append(covariance(allan, alpha, m, n)[0, 0] / scale)
    return np.array(found)


def coverage(kind, noise, alpha, level, runs, n, factors, seed):
    """Share of records whose interval holds the true deviation, and the least edf, by averaging time."""
    rates = noise_rates(noise, runs, n, np.random.default_rng(seed))
    curves = [deviation(one, 1.0, kind, grid=factors, alpha=alpha, level=level) for one in rates]
    low, high = np.array([c.low for c in curves]), np.array([c.high for c in curves])
    used = curves[0].factor
    if noise == -1:
        # The generalised covariance of flicker knows ratios only: the level is that of the shortest time.
        shape = truth(kind, noise, used) / truth("oadev", noise, [8])
        reference = np.mean([deviation(one, 1.0, "oadev", grid=np.array([8])).deviation[0] ** 2 for one in rates])
        expected = np.sqrt(shape * reference)
    else:
        expected = np.sqrt(truth(kind, noise, used))
    return np.mean((low < expected) & (expected < high), axis=0), np.median([c.edf for c in curves], axis=0)


def check_coverage(kind, noise, alpha, runs, n, factors):
    """68.3 % intervals cover 65 to 72 %, 95 % intervals 93 to 97 %, and what chance adds in so many records."""
    for level, bars in ((0.6827, (0.65, 0.72)), (0.95, (0.93, 0.97))):
        inside, edf = coverage(kind, noise, alpha, level, runs, n, factors, 3 - noise)
        chance = 3.0 * np.sqrt(level * (1.0 - level) / runs)
        good = (bars[0] - chance < inside) & (inside < bars[1] + chance)
        assert np.all(good | (edf < 1.95)), (level, inside, edf)


@pytest.mark.parametrize("kind", ["oadev", "ohdev", "totdev"])
@pytest.mark.parametrize("noise", NOISES)
def test_intervals_cover_the_truth_as_often_as_they_say(kind, noise):
    """Also where the noise type has to be found, and where few averaging times are in the record."""
    check_coverage(kind, noise, "auto", 120, 1000, np.array([8, 32, 64, 125, 181, 256]))


@pytest.mark.slow
@pytest.mark.parametrize("given", [True, False], ids=["type given", "type found"])
@pytest.mark.parametrize("kind", ["oadev", "ohdev", "mdev", "adev", "hdev", "totdev"])
@pytest.mark.parametrize("noise", NOISES)
def test_intervals_cover_the_truth_in_many_records(kind, noise, given):
    # Below eight samples the deviation of simulated flicker, whose samples are not averages, is not that of flicker.
    factors = np.array([*([2] if noise != -1 else []), 8, 20, 32, 64, 90, 125, 181, 256, 300, 400])
    check_coverage(kind, noise, noise if given else "auto", 1500, 1000, factors)
