from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from navfuse.analysis.metrics import errors, summarize
from navfuse.analysis.separation import separation
from navfuse.data.result import Innovations, Result
from navfuse.data.trajectory import Trajectory
from navfuse.errors import InputError
from navfuse.filters.gate import Gate
from navfuse.filters.settings import FilterSettings
from navfuse.report.quality import (
    error_cdf,
    gate_limits,
    gnss_sigmas,
    normalised,
    position_percentiles,
    realised_sigma,
    residual_histogram,
    running_nis,
)


def records(z, sd, status="used", time=None, source="gnss_position"):
    """Records of independent components (m, d)."""
    z = np.atleast_2d(np.asarray(z, dtype=float))
    sd = np.broadcast_to(np.asarray(sd, dtype=float), z.shape)
    m, d = z.shape
    padded = np.full((2, m, 3), np.nan)
    padded[0, :, :d], padded[1, :, :d] = z, sd
    return Innovations(
        np.arange(float(m)) if time is None else time,
        np.full(m, source),
        np.broadcast_to(np.asarray(status), m).copy(),
        ((z / sd) ** 2).sum(axis=1),
        np.full(m, d),
        padded[0],
        padded[1],
        np.arange(m),
    )


def random_walk(seed, n=30, q=0.3, r=1.0, model_q=None):
    """Filtered and smoothed estimates (2, n) of a scalar random walk, and their variances (2, n)."""
    rng = np.random.default_rng(seed)
    true = np.cumsum(np.sqrt(q) * rng.standard_normal(n))
    z = true + np.sqrt(r) * rng.standard_normal(n)
    q = q if model_q is None else model_q
    x, P = np.zeros((2, n)), np.zeros((2, n))
    ahead = np.zeros((2, n))
    before, variance = 0.0, 0.0
    for k in range(n):
        variance += q
        ahead[:, k] = before, variance
        gain = variance / (variance + r)
        before, variance = before + gain * (z[k] - before), (1.0 - gain) * variance
        x[0, k], P[0, k] = before, variance
    x[1], P[1] = x[0], P[0]
    for k in range(n - 2, -1, -1):
        gain = P[0, k] / ahead[1, k + 1]
        x[1, k] = x[0, k] + gain * (x[1, k + 1] - ahead[0, k + 1])
        P[1, k] = P[0, k] + gain**2 * (P[1, k + 1] - ahead[1, k + 1])
    return x, P


def vertical(down, variance):
    """A trajectory that stands, with this error downwards."""
    n = down.size
    sd = np.ones((n, 3))
    sd[:, 2] = np.sqrt(variance)
    place = np.full(n, 0.5)
    return Trajectory(np.arange(float(n)), place, place, -down, sd_position=sd)


@pytest.mark.parametrize(("model_q", "right"), [(None, True), (0.05, False)])
def test_filter_minus_smoother_has_the_variance_it_is_said_to_have(model_q, right):
    """Over 400 runs the normalised square at one epoch is chi-square; with too little process noise it is far above."""
    runs, k, total = 400, 12, 0.0
    for seed in range(runs):
        x, P = random_walk(seed, model_q=model_q)
        found = separation(vertical(x[0], P[0]), vertical(x[1], P[1]))
        assert found.position[k, 2] == pytest.approx(x[0, k] - x[1, k], abs=1e-8)
        assert found.sd_position is not None
        assert found.sd_position[k, 2] == pytest.approx(np.sqrt(P[0, k] - P[1, k]), rel=1e-9)
        total += (found.position[k, 2] / found.sd_position[k, 2]) ** 2
    low, high = stats.chi2.interval(0.9999, runs)
    assert bool(low <= total <= high) is right
    if not right:
        assert total > 1.5 * high


def test_separation_of_the_made_up_drive_covers_all_three_blocks(drive):
    result, _ = drive
    found = separation(result.forward, result.smoothed)
    np.testing.assert_array_equal(found.time, result.smoothed.time)
    for block in ("position", "velocity"):
        sd = getattr(found, f"sd_{block}")
        expected = getattr(result.forward, f"sd_{block}") ** 2 - getattr(result.smoothed, f"sd_{block}") ** 2
        np.testing.assert_allclose(sd**2, np.maximum(expected, 0.0), atol=1e-12)
        assert (np.abs(getattr(found, block)) <= 3.0 * sd + 1e-6).mean() > 0.97
    assert found.attitude is not None
    assert np.abs(found.attitude).max() < 0.5
    np.testing.assert_allclose(found.position[-1], 0.0, atol=1e-6)


def test_separation_where_the_smoother_lacks_epochs_or_sigmas(drive):
    result, _ = drive
    some = result.smoothed.take(np.arange(len(result.smoothed)) % 7 == 0)
    found = separation(result.forward, some)
    whole = separation(result.forward, result.smoothed)
    np.testing.assert_allclose(found.position, whole.position[::7], atol=1e-9)
    np.testing.assert_allclose(found.sd_position, whole.sd_position[::7], atol=1e-9)
    assert separation(result.forward, replace(some, sd_position=None)).sd_position is None
    assert separation(replace(result.forward, sd_velocity=None), some).sd_velocity is None
    worse = replace(result.smoothed, sd_position=2.0 * result.forward.sd_position)
    assert (separation(result.forward, worse).sd_position == 0.0).all()


def test_separation_of_what_cannot_be_compared(drive):
    result, _ = drive
    one = result.forward.take(slice(0, 1))
    with pytest.raises(InputError, match="at least two"):
        separation(one, one)


def test_histogram_of_normal_residuals_is_the_normal_distribution():
    values = stats.norm.ppf((np.arange(100_000) + 0.5) / 100_000)
    found = residual_histogram(values.reshape(-1, 2))
    np.testing.assert_allclose(found.density, found.expected, atol=1e-4)
    assert found.n == 100_000
    assert (found.mean, found.sd) == (pytest.approx(0.0, abs=1e-12), pytest.approx(1.0, abs=1e-3))
    assert found.beyond_3 == pytest.approx(0.0027, abs=2e-5)
    assert found.outside == 0
    width = np.diff(found.edges)
    assert (found.expected * width).sum() == pytest.approx(1.0, abs=1e-6)


def test_histogram_counts_by_hand_and_leaves_out_what_is_no_number():
    found = residual_histogram(np.array([0.1, 0.1, 0.2, -4.0, 7.0, -9.0, np.nan, np.inf]))
    width = found.edges[1] - found.edges[0]
    assert found.n == 6
    assert found.outside == 2
    assert found.beyond_3 == pytest.approx(0.5)
    assert found.density.sum() * width == pytest.approx(4 / 6)
    assert found.density[np.searchsorted(found.edges, 0.15) - 1] * width == pytest.approx(0.5)
    nothing = residual_histogram(np.array([np.nan]))
    assert nothing.n == 0
    assert np.isnan(nothing.mean)
    assert (nothing.density == 0.0).all()


def test_normalised_residuals_have_no_component_that_was_not_measured():
    found = normalised(records([[1.0], [3.0]], 2.0))
    np.testing.assert_array_equal(found[:, 0], [0.5, 1.5])
    assert np.isnan(found[:, 1:]).all()
    no_sigma = replace(records([[1.0, 1.0, 1.0]], 1.0), sd=np.zeros((1, 3)))
    assert np.isnan(normalised(no_sigma)).all()


def test_running_nis_is_the_mean_over_each_window():
    rng = np.random.default_rng(3)
    found_records = records(rng.standard_normal((40, 2)), 1.0, time=1e6 + np.arange(40.0) ** 1.1)
    found = running_nis(found_records, window=7)
    assert found.time.size == 34
    for k in (0, 11, 33):
        assert found.mean[k] == pytest.approx(found_records.nis[k : k + 7].sum() / 14.0, rel=1e-12)
        assert found.time[k] == pytest.approx(found_records.time[k : k + 7].mean(), abs=1e-9)
    np.testing.assert_allclose(found.low, stats.chi2.ppf(0.005, 14) / 14)
    np.testing.assert_allclose(found.high, stats.chi2.ppf(0.995, 14) / 14)


def test_running_nis_takes_only_what_was_used_and_adapts_to_few():
    status = np.array(["used", "rejected", "reset", "withheld", "used"])
    found = running_nis(records(np.arange(1.0, 6.0)[:, np.newaxis], 1.0, status))
    assert found.window == 3
    np.testing.assert_allclose(found.mean, (1.0 + 9.0 + 25.0) / 3.0)
    np.testing.assert_allclose(found.high, stats.chi2.ppf(0.995, 3) / 3)
    rejected = running_nis(records([[1.0]], 1.0, "rejected"))
    assert rejected.time.size == 0
    assert np.isnan(rejected.inside)


def test_running_nis_with_components_that_come_and_go():
    three, one = records(np.ones((4, 3)), 1.0), records(np.ones((4, 1)), 1.0)
    mixed = Innovations(*(np.concatenate((getattr(three, name), getattr(one, name))) for name in Innovations.__slots__))
    found = running_nis(mixed, window=2)
    np.testing.assert_allclose(found.mean, 1.0)
    degrees = np.array([6, 6, 6, 4, 2, 2, 2])
    np.testing.assert_allclose(found.low, stats.chi2.ppf(0.005, degrees) / degrees)


@pytest.mark.parametrize(("factor", "right"), [(1.0, True), (1.5, False)])
def test_running_nis_is_inside_its_bounds_as_often_as_promised(factor, right):
    """Every fiftieth window is independent: of 200 a right model leaves 1 % outside; 9 or fewer in 99.99 % of cases."""
    z = factor * np.random.default_rng(5).standard_normal((10_000, 3))
    found = running_nis(records(z, 1.0))
    apart = slice(0, None, found.window)
    outside = int(((found.mean < found.low) | (found.mean > found.high))[apart].sum())
    assert bool(outside <= stats.binom.ppf(0.9999, 200, 0.01)) is right


def test_gate_limits_are_those_that_the_gate_had():
    """A gate driven by hand, with a sensor three times worse than it says and outliers among its values."""
    rng = np.random.default_rng(8)
    m = 300
    z = 3.0 * rng.standard_normal((m, 3))
    z[::40] *= 30.0
    nis = (z**2).sum(axis=1)
    gate, expected, status = Gate(0.99, FilterSettings()), [], []
    for k in range(m):
        expected.append(gate.limit(3))
        withheld = 100 <= k < 120
        status.append("withheld" if withheld else "used" if nis[k] <= expected[-1] else "rejected")
        if not withheld:
            gate.watch(nis[k] / 3.0, 0.2 * k)
    found = gate_limits(records(z, 1.0, status, time=0.2 * np.arange(m)), 0.99)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert found[0] == pytest.approx(stats.chi2.ppf(0.99, 3))
    assert found.max() > 1.5 * found[0]


def test_gate_limits_of_late_measurements_and_open_gates():
    late = replace(records([[1.0], [2.0]], 1.0), dof=np.array([0, 1]), nis=np.array([np.nan, 4.0]))
    found = gate_limits(late)
    assert np.isnan(found[0])
    assert found[1] == pytest.approx(stats.chi2.ppf(FilterSettings().gate_probability, 1))
    assert np.isinf(gate_limits(late, 1.0)[1])


@pytest.mark.parametrize("factor", [0.5, 1.0, 4.0])
def test_realised_sigma_is_the_one_behind_the_innovations(factor):
    """Prediction of 1 m, fixes of 2 m that state 2 m over `factor`: the intervals hold 2 m as often as promised."""
    rng = np.random.default_rng(11)
    n = 20_000
    stated = np.full((n, 3), 2.0 / factor)
    z = rng.standard_normal((n, 3)) + 2.0 * rng.standard_normal((n, 3))
    found = realised_sigma(records(z, np.sqrt(1.0 + stated[0] ** 2)), stated)
    assert found.time.size == n // 50
    np.testing.assert_allclose(found.stated, 2.0 / factor)
    np.testing.assert_allclose(np.sqrt(np.mean(found.realised**2, axis=0)), 2.0, rtol=0.03)
    misses = int(((found.low > 2.0) | (found.high < 2.0)).sum())
    assert misses <= stats.binom.ppf(0.9999, 1200, 0.01)
    if factor != 1.0:
        held = (found.low <= found.stated) & (found.stated <= found.high)
        assert held.mean() < 0.2


def test_realised_sigma_of_windows_by_hand():
    z = np.concatenate((np.full(5, 3.0), np.full(6, 1.0)))[:, np.newaxis]
    innovations = records(z, 2.0, time=np.arange(11.0) + 100.0)
    found = realised_sigma(innovations, np.full((11, 3), 1.0)[:, :3], window=5)
    assert found.time.size == 2
    np.testing.assert_allclose(found.time, [102.0, 107.5])
    # 9 - (4 - 1), and 1 - (4 - 1) that cannot be.
    np.testing.assert_allclose(found.realised[:, 0], [np.sqrt(6.0), 0.0])
    assert np.isnan(found.realised[:, 1]).all()
    scale = 5 / stats.chi2.ppf([0.995, 0.005], 5)
    np.testing.assert_allclose([found.low[0, 0], found.high[0, 0]], np.sqrt(np.maximum(9.0 * scale - 3.0, 0.0)))


def test_realised_sigma_leaves_out_rejected_ones_and_needs_a_few():
    status = np.where(np.arange(30) < 10, "rejected", "used")
    z = np.where(np.arange(30) < 10, 500.0, 1.0)[:, np.newaxis] * np.ones(3)
    found = realised_sigma(records(z, 1.0, status), np.full((30, 3), 0.5))
    np.testing.assert_allclose(found.realised, 0.5)
    assert found.window == 20
    assert realised_sigma(records(z[:4], 1.0), np.ones((4, 3))).time.size == 0
    gaps = np.full((30, 3), np.nan)
    assert realised_sigma(records(z, 1.0), gaps).time.size == 0


def test_sigmas_of_the_fixes_of_a_run(drive):
    result, _ = drive
    found = gnss_sigmas(result, "gnss_position")
    assert found is not None
    np.testing.assert_allclose(found.stated, 0.8)
    assert ((found.low < 0.8) & (found.high > 0.8)).all()
    assert gnss_sigmas(result, "gnss_velocity") is None
    assert gnss_sigmas(replace(result, fixes=None), "gnss_position") is None
    other = replace(result.innovations, row=result.innovations.row + 10_000)
    assert gnss_sigmas(replace(result, innovations=other), "gnss_position") is None
    assert gnss_sigmas(Result(result.forward, fixes=result.fixes), "gnss_position") is None


def test_error_cdf_by_hand():
    magnitude, share = error_cdf(np.array([-3.0, 1.0, np.nan, -2.0, 0.5]))
    np.testing.assert_array_equal(magnitude, [0.5, 1.0, 2.0, 3.0])
    np.testing.assert_array_equal(share, [0.25, 0.5, 0.75, 1.0])
    assert error_cdf(np.array([np.nan]))[0].size == 0


def test_percentiles_of_normal_errors_are_the_textbook_ones(drive):
    """Circular error probable 1.1774 sigma, 95 % 2.4477 sigma (Rayleigh); vertical 0.6745 and 1.9600 sigma."""
    result, truth = drive
    series = errors(result.forward, truth)
    n = 200_000
    normal = replace(series, position=2.0 * np.random.default_rng(2).standard_normal((n, 3)), time=np.arange(float(n)))
    found = position_percentiles(normal)
    np.testing.assert_allclose(found[:4], 2.0 * np.array([1.1774, 2.4477, 0.6745, 1.9600]), rtol=0.01)
    assert found.n == n


def test_percentiles_agree_with_the_error_table(drive):
    result, truth = drive
    series = errors(result.forward, truth)
    table = summarize(series).statistics
    found = position_percentiles(series)
    assert found.cep50 == pytest.approx(table["position_horizontal"].p50)
    assert found.le95 == pytest.approx(table["position_down"].p95)
    nothing = position_percentiles(replace(series, position=np.full((4, 3), np.nan)))
    assert nothing.n == 0
    assert np.isnan(nothing.cep95)
