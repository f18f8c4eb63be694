from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from navfuse.analysis.nees import (
    WHOLE,
    components_of,
    groups_of,
    navigation_errors,
    nees,
    nees_of_groups,
    to_components,
)
from navfuse.core.rotation import euler_from_quat, quat_from_euler
from navfuse.data.layout import Block, Layout
from navfuse.data.nav_state import boxplus_navigation, describe_rows, to_ecef
from navfuse.errors import InputError
from reference.navigation_algebra import error as error_twin

LAYOUT = Layout.join([Block("gyro_bias", 3, 1e-4), Block("accel_cross", 6, 1e-3)], [Block("odometer.scale", 1, 0.01)])


def random_navs(count, seed):
    rng = np.random.default_rng(seed)
    navs = np.empty((count, 10))
    for row in navs:
        row[:3] = rng.uniform(-1.3, 1.3), rng.uniform(-3.1, 3.1), rng.uniform(-100.0, 9000.0)
        row[3:6] = rng.normal(0.0, 50.0, 3)
        row[6:] = quat_from_euler(*rng.uniform(-1.2, 1.2, 2), rng.uniform(-3.0, 3.0))
    return navs


def random_covariances(count, size, seed):
    A = np.random.default_rng(seed).normal(size=(count, size, 2 * size))
    scale = np.logspace(-4.0, 1.0, size)
    return np.einsum("kij,klj->kil", A, A) * scale[:, None] * scale[None, :]


@pytest.mark.parametrize("ecef", [False, True], ids=["n", "e"])
def test_errors_are_those_of_exact_algebra(ecef):
    estimates, rng = random_navs(20, 1), np.random.default_rng(2)
    true = estimates.copy()
    for row in true:
        boxplus_navigation(
            row, np.concatenate([rng.normal(0, 30, 3), rng.normal(0, 2, 3), rng.normal(0, 0.3, 3)]), False
        )
    if ecef:
        estimates, true = (np.array([to_ecef(row) for row in rows]) for rows in (estimates, true))
    truth = true if ecef else np.array([to_ecef(row) for row in true])
    found, _ = navigation_errors(truth[:, :3], truth[:, 3:6], truth[:, 6:], estimates, ecef)
    expected = np.array([error_twin(a, b, ecef) for a, b in zip(true, estimates, strict=True)])
    np.testing.assert_allclose(found, expected, atol=2e-8, rtol=0.0)


@pytest.mark.parametrize("ecef", [False, True], ids=["n", "e"])
def test_an_error_is_what_the_correction_takes_away(ecef):
    """Sign and frame: the estimate, corrected by its error, is the truth."""
    nav = to_ecef(random_navs(1, 3)[0]) if ecef else random_navs(1, 3)[0]
    d = np.array([3.0, -2.0, 1.0, 0.1, 0.2, -0.3, 0.01, -0.02, 0.03])
    true = nav.copy()
    boxplus_navigation(true, d, ecef)
    truth = true if ecef else to_ecef(true)
    found, _ = navigation_errors(truth[None, :3], truth[None, 3:6], truth[None, 6:], nav[None], ecef)
    np.testing.assert_allclose(found[0], d, atol=5e-9, rtol=0.0)


@pytest.mark.parametrize("ecef", [False, True], ids=["n", "e"])
def test_components_are_those_of_the_trajectory(ecef):
    navs = random_navs(10, 4)
    P = random_covariances(10, 9, 5) * 1e-6
    if ecef:
        navs = np.array([to_ecef(row) for row in navs])
    d = np.zeros((10, 9))
    d[:, 6:] = np.random.default_rng(6).normal(0.0, 1e-5, (10, 3))
    truth = navs.copy()
    for row, error in zip(truth, d, strict=True):
        boxplus_navigation(row, error, ecef)
    true_e = truth if ecef else np.array([to_ecef(row) for row in truth])
    error, J = navigation_errors(true_e[:, :3], true_e[:, 3:6], true_e[:, 6:], navs, ecef)
    values, sd = to_components(error, P, J)
    rows, true_rows = np.empty((10, 18)), np.empty((10, 18))
    describe_rows(navs, np.zeros((10, 9)), P, ecef, rows)
    describe_rows(truth, np.zeros((10, 9)), P, ecef, true_rows)
    np.testing.assert_allclose(sd, rows[:, 9:], rtol=1e-9)
    np.testing.assert_allclose(values[:, 6:], true_rows[:, 6:9] - rows[:, 6:9], atol=3e-9, rtol=0.0)


def test_heading_error_is_true_minus_estimate():
    nav = np.array([0.8, 0.2, 100.0, 0.0, 0.0, 0.0, *quat_from_euler(0.05, -0.1, 1.0)])
    true = nav.copy()
    true[6:] = quat_from_euler(0.05, -0.1, 1.001)
    truth = to_ecef(true)[None]
    error, J = navigation_errors(truth[:, :3], truth[:, 3:6], truth[:, 6:], nav[None], False)
    values, _ = to_components(error, np.eye(9)[None], J)
    assert euler_from_quat(true[6:])[2] - euler_from_quat(nav[6:])[2] == pytest.approx(1e-3)
    np.testing.assert_allclose(values[0, 6:], [0.0, 0.0, 1e-3], atol=1e-6)


def test_nees_is_the_quadratic_form():
    P = random_covariances(30, 15, 7)
    d = np.random.default_rng(8).normal(size=(30, 15)) * np.logspace(-4.0, 1.0, 15)
    np.testing.assert_allclose(nees(d, P), [x @ np.linalg.solve(p, x) for x, p in zip(d, P, strict=True)], rtol=1e-7)


def test_nees_of_draws_is_chi_square():
    P = random_covariances(1, 6, 9)[0]
    draws = np.random.default_rng(10).normal(size=(4000, 6)) @ np.linalg.cholesky(P).T
    values = nees(draws, np.broadcast_to(P, (4000, 6, 6)))
    assert np.mean(values) == pytest.approx(6.0, abs=4.0 * np.sqrt(12.0 / 4000.0))
    assert np.mean(values < chi2.ppf(0.9, 6)) == pytest.approx(0.9, abs=0.02)


@pytest.mark.parametrize(
    ("P", "message"),
    [
        (np.diag([1.0, 0.0]), "epoch 0 is not positive definite"),
        (np.array([[1.0, 1.0], [1.0, 1.0]]), "epoch 0 is not positive definite"),
        (np.diag([1.0, -1.0]), "epoch 0 is not positive definite"),
        (np.diag([1.0, np.nan]), "finite errors and covariances"),
        (np.eye(3), "errors (m, n) and covariances (m, n, n)"),
    ],
)
def test_a_covariance_without_nees_is_refused(P, message):
    with pytest.raises(InputError) as caught:
        nees(np.ones((1, 2)), P[None])
    assert message in str(caught.value)


def test_components_and_groups_follow_the_layout():
    components = components_of(LAYOUT)
    assert len(components) == LAYOUT.size
    named = {component.name: component for component in components}
    assert list(named)[:9] == ["north", "east", "down", "vn", "ve", "vd", "roll", "pitch", "heading"]
    assert (named["gyro_bias_z"].unit, named["odometer.scale_1"].unit) == ("dph", "si")
    assert named["gyro_bias_x"].factor == pytest.approx(np.degrees(1.0) * 3600.0)
    assert [name for name in named if name.startswith("accel_cross")][1] == "accel_cross_xz"
    groups = groups_of(components)
    for name in LAYOUT.names:
        where = LAYOUT.slice(name)
        assert groups[name].tolist() == list(range(where.start, where.stop))
    assert groups[WHOLE].tolist() == list(range(LAYOUT.size))


def test_untested_components_are_left_out():
    components = components_of(LAYOUT)
    tested = np.ones(LAYOUT.size, dtype=bool)
    tested[LAYOUT.slice("odometer.scale")] = False
    groups = groups_of(components, tested)
    assert "odometer.scale" not in groups
    assert groups[WHOLE].size == LAYOUT.size - 1
    P = random_covariances(2, LAYOUT.size, 11)
    d = np.full((2, LAYOUT.size), 1e-3)
    d[:, ~tested] = np.nan
    found = nees_of_groups(d, P, groups)
    kept = d[1][tested]
    assert found[WHOLE][1] == pytest.approx(kept @ np.linalg.solve(P[1][np.ix_(tested, tested)], kept), rel=1e-6)


def test_a_covariance_that_is_not_definite_may_be_passed_over():
    P = np.stack([np.eye(3), np.diag([1.0, -1.0, 1.0])])
    found = nees_of_groups(np.ones((2, 3)), P, {"all": np.arange(3), "first": np.arange(1)}, strict=False)
    np.testing.assert_array_equal(found["all"], [3.0, np.nan])
    np.testing.assert_array_equal(found["first"], [1.0, 1.0])
    P[1, 0, 0] = np.inf
    with pytest.raises(InputError, match="finite errors and covariances"):
        nees_of_groups(np.ones((2, 3)), P, {"all": np.arange(3)}, strict=False)
