from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from navfuse.analysis.ensemble import (
    average,
    family_probability,
    findings,
    group_ratios,
    most_telling,
    rms_error,
    verdict,
)
from navfuse.analysis.nees import WHOLE, components_of
from navfuse.data.layout import Layout
from navfuse.errors import InputError

TIME = np.arange(100.0)
NORTH, EAST = components_of(Layout(()))[:2]


def squares(runs, dof, seed=0, factor=None):
    """(runs, epochs) chi-square values; `factor` (epochs,) multiplies the errors."""
    values = np.random.default_rng(seed).chisquare(dof, (runs, TIME.size))
    return values if factor is None else values * factor**2


def test_bounds_come_from_the_number_of_runs():
    entry = average("position", TIME, squares(50, 3), 3.0)
    low, high = chi2.ppf([0.005, 0.995], 150) / 150
    np.testing.assert_allclose(entry.low, low, rtol=1e-9)
    np.testing.assert_allclose(entry.high, high, rtol=1e-9)
    assert entry.probability == 0.99


def test_the_share_inside_is_the_probability():
    entry = average("a", TIME, squares(40, 3), 3.0, 0.9)
    many = [average("a", TIME, squares(40, 3, seed), 3.0, 0.9).share_inside for seed in range(30)]
    assert np.mean(many) == pytest.approx(0.9, abs=4.0 * np.sqrt(0.09 / 3000.0))
    assert entry.factor == pytest.approx(1.0, abs=0.02)


def test_missing_values_widen_the_bounds():
    values = squares(40, 3)
    values[:30, 5] = np.nan
    entry = average("a", TIME, values, 3.0)
    assert entry.mean[5] == pytest.approx(np.mean(values[30:, 5]) / 3.0)
    assert entry.high[5] == pytest.approx(chi2.ppf(0.995, 30) / 30)


@pytest.mark.parametrize(
    ("values", "dof", "message"),
    [
        (np.ones((3, 99)), 3.0, "an average needs (runs, epochs)"),
        (np.ones(100), 3.0, "an average needs (runs, epochs)"),
        (np.ones((3, 100)), 0.0, "an average needs (runs, epochs)"),
        (np.where(TIME == 7.0, np.nan, np.ones((3, 100))), 3.0, "an epoch at which no run has a value"),
    ],
)
def test_what_cannot_be_averaged(values, dof, message):
    with pytest.raises(InputError) as caught:
        average("position", TIME, values, dof)
    assert message in str(caught.value)
    assert str(caught.value).startswith("position")


def test_the_beginning_can_be_left_out():
    entry = average("a", TIME, squares(10, 1), 1.0)
    assert entry.after(30.0).time[0] == 30.0
    assert entry.after(30.0).mean.size == 70
    with pytest.raises(InputError, match="no epoch is left after 100 s; the last one is at 99 s"):
        entry.after(100.0)


def test_a_consistent_filter_gives_no_finding():
    entries = [average(str(k), TIME, squares(200, 1, k), 1.0, family_probability(20, 0.999)) for k in range(20)]
    assert findings(entries) == []
    assert verdict([]) == "consistent"


def test_an_overconfident_stretch_is_found_with_its_time_and_factor():
    factor = np.where((TIME >= 40.0) & (TIME <= 90.0), 1.8, 1.0)
    entry = average("heading", TIME, squares(200, 1, 3, factor), 1.0)
    found = findings([entry])
    assert [finding.name for finding in found] == ["heading"]
    assert (found[0].start, found[0].end) == (40.0, 90.0)
    assert found[0].factor == pytest.approx(1.8, abs=0.05)
    assert found[0].overconfident
    assert str(found[0]).startswith("overconfident by a factor 1.7")
    assert str(found[0]).endswith("in heading between 40 s and 90 s")


def test_pessimism_is_found_too():
    found = findings([average("roll", TIME, squares(200, 1, 4, np.full(100, 0.5)), 1.0)])
    assert not found[0].overconfident
    assert str(found[0]).startswith("pessimistic by a factor 2.0")


def test_the_longest_stretch_is_named_and_short_returns_are_bridged():
    values = np.ones((400, 100))
    values[:, 10:13] = 4.0
    values[:, 50:70] = 4.0
    values[:, 60:62] = 1.0
    found = findings([average("vn", TIME, values, 1.0)])
    assert (found[0].start, found[0].end) == (50.0, 69.0)
    assert found[0].share == pytest.approx(0.21)


def test_components_explain_their_group_and_the_whole():
    bad = squares(200, 1, 5, np.full(100, 2.0))
    whole = findings([average(WHOLE, TIME, bad, 1.0), average("position", TIME, bad, 1.0)])
    north = findings([average("north", TIME, bad, 1.0)])
    members = {"north": "position", "heading": "attitude"}
    assert [f.name for f in most_telling(whole, north, members)] == ["north"]
    assert [f.name for f in most_telling(whole, [], members)] == ["position"]
    assert [f.name for f in most_telling(whole[:1], [], members)] == [whole[0].name]
    assert [f.name for f in most_telling([f for f in whole if f.name == WHOLE], [], members)] == [WHOLE]


def test_a_verdict_names_three_and_counts_the_rest():
    bad = [average(str(k), TIME, squares(100, 1, k, np.full(100, 1.5 + 0.5 * k)), 1.0) for k in range(5)]
    text = verdict(findings(bad))
    assert text.count("overconfident") == 3
    assert text.index("in 4 ") < text.index("in 3 ") < text.index("in 2 ")
    assert text.endswith("; and 2 more")


def test_rmse_against_sigma_and_its_interval():
    rng = np.random.default_rng(6)
    sd = np.broadcast_to(1.0 + 0.01 * TIME, (500, 100))
    entry = rms_error(NORTH, TIME, 1.3 * sd * rng.standard_normal((500, 100)), sd)
    assert entry.ratio == pytest.approx(1.3, abs=0.02)
    assert entry.total / entry.total_sigma == pytest.approx(1.3, abs=0.02)
    assert entry.low < entry.total < entry.high
    assert entry.high / entry.low == pytest.approx(np.sqrt(np.divide(*chi2.ppf([0.975, 0.025], 500))), rel=1e-6)
    other = rms_error(EAST, TIME, 0.0 * sd + sd, sd)
    assert group_ratios([entry, other]) == {"position": pytest.approx(np.sqrt((entry.ratio**2 + 1.0) / 2.0))}


@pytest.mark.parametrize("sd", [np.zeros((5, 100)), np.ones((5, 99)), np.full((5, 100), np.nan)])
def test_rmse_needs_positive_sigmas(sd):
    with pytest.raises(InputError, match="north: RMSE against sigma needs errors and positive sigmas"):
        rms_error(NORTH, TIME, np.ones((5, 100)), sd)


def test_bounds_of_many_hold_together():
    assert family_probability(1, 0.99) == pytest.approx(0.99)
    assert family_probability(20, 0.99) == pytest.approx(0.9995)
