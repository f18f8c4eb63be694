"""Unscented and cubature transforms against the linear Kalman filter, their plain formulas and hostile numbers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navfuse.core.unscented import (
    SigmaSpread,
    draw,
    semidefinite_root,
    triangularize,
    unscented_predict,
    unscented_update,
)
from navfuse.errors import ConfigError

SPREADS = [
    lambda n: SigmaSpread(n),
    lambda n: SigmaSpread(n, 1.0, 2.0, 0.0),
    lambda n: SigmaSpread(n, 0.3, 2.0, 0.0),
    lambda n: SigmaSpread(n, 1.0, 2.0, 3.0 - n),
    SigmaSpread.cubature,
]


def random_root(rng, n, decades=0.0):
    A = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-decades / 2, decades / 2, size=(n, 1))
    return np.linalg.cholesky(A @ A.T + 1e-3 * np.diag(np.diag(A @ A.T)))


@pytest.mark.parametrize("shape", [(1, 1), (3, 7), (15, 49), (6, 6), (5, 3)])
def test_triangularize_gives_the_root_of_the_gram_matrix(shape):
    A = np.random.default_rng(3).normal(size=shape)
    P, S = A @ A.T, np.empty((shape[0], shape[0]))
    triangularize(A.copy(), shape[1], S)
    np.testing.assert_allclose(S @ S.T, P, atol=1e-13)
    assert not np.triu(S, 1).any()
    assert np.all(np.diag(S) >= 0.0)


def test_triangularize_copes_with_zero_rows_and_tiny_numbers():
    A = np.zeros((4, 9))
    A[0], A[2] = 1e-170 * np.arange(9.0), np.arange(9.0) ** 2
    S = np.empty((4, 4))
    triangularize(A.copy(), 9, S)
    assert np.isfinite(S).all()
    np.testing.assert_allclose(S[2] @ S[2], A[2] @ A[2], rtol=1e-14)
    np.testing.assert_allclose(S[0, 0], 1e-170 * np.sqrt(204.0), rtol=1e-14)
    assert not S[[1, 3]].any()


@pytest.mark.parametrize("spread", SPREADS)
def test_moments_are_those_of_the_scaled_transform_with_its_own_weights(spread):
    """The twin has the weights of the literature, negative ones included."""
    rng = np.random.default_rng(8)
    n = 5
    spread = spread(n)
    S, x, Q = random_root(rng, n), rng.normal(size=n), random_root(rng, n)

    def f(v):
        return np.array([np.sin(v[0]) * v[1], v[1] + v[2] ** 2, np.cos(v[3]), v[0] * v[4], v[4]])

    alpha, c2 = spread.scale, spread.distance**2
    mean_weight = np.full(2 * n + 1, 0.5 / c2)
    mean_weight[0] = 1.0 - n / c2
    covariance_weight = mean_weight.copy()
    covariance_weight[0] += 1.0 - alpha**2 + spread.beta
    points = np.array([f(p) for p in draw(x, S, spread)])
    mean = mean_weight @ points
    d = points - mean
    P = (covariance_weight * d.T) @ d + Q @ Q.T
    got_mean, got_S = unscented_predict(x, S, f, Q, spread)
    np.testing.assert_allclose(got_mean, mean, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(got_S @ got_S.T, P, rtol=1e-9, atol=1e-10 * np.abs(P).max())


@pytest.mark.parametrize("spread", SPREADS)
@pytest.mark.parametrize("n", [2, 9, 15, 21])
def test_linear_model_gives_the_kalman_filter(spread, n):
    rng = np.random.default_rng(n)
    spread = spread(n)
    x, S = rng.normal(size=n), random_root(rng, n, 3.0)
    P, y = S @ S.T, x.copy()
    F = np.eye(n) + 0.1 * rng.normal(size=(n, n))
    G, H = 0.3 * random_root(rng, n), rng.normal(size=(3, n))
    R = np.diag([0.5, 1.0, 2.0])
    for k in range(40):
        x, S = unscented_predict(x, S, lambda v: F @ v / 1.3, G, spread)
        y, P = F @ y / 1.3, F @ P @ F.T / 1.69 + G @ G.T
        z = rng.normal(size=3) + k
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        nu = z - H @ y
        nis = nu @ np.linalg.solve(H @ P @ H.T + R, nu)
        y, P = y + K @ nu, (np.eye(n) - K @ H) @ P @ (np.eye(n) - K @ H).T + K @ R @ K.T
        x, S, got = unscented_update(x, S, z, lambda v: H @ v, R, spread)
        scale = np.sqrt(np.diag(P))
        assert np.abs(S @ S.T - P).max() <= 1e-10 * np.abs(P).max()
        assert np.abs((S @ S.T - P) / np.outer(scale, scale)).max() <= 1e-10
        assert np.abs((x - y) / scale).max() <= 1e-10
        assert got == pytest.approx(nis, rel=1e-10)


@pytest.mark.parametrize("spread", SPREADS)
def test_quadratic_measurement_moments_are_exact_to_second_order(spread):
    """z = x^2: mean S^2 + m^2 exactly; the variance with beta = 2 and one state too (2 s^4 + 4 m^2 s^2)."""
    spread = spread(1)
    m, s = 0.7, 0.5
    mean, S = unscented_predict(np.array([m]), np.array([[s]]), lambda v: v**2, np.zeros((1, 1)), spread)
    assert mean[0] == pytest.approx(m * m + s * s, rel=1e-9)
    excess = 2.0 * s**4 if spread.beta == 2.0 and spread.scale <= 1.0 and spread.kappa == 0.0 else None
    if excess is not None:
        assert S[0, 0] ** 2 == pytest.approx(4 * m * m * s * s + (spread.beta) * s**4, rel=1e-6)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    decades=st.floats(0.0, 12.0),
    noise=st.floats(-12.0, 3.0),
    n=st.integers(3, 15),
    which=st.integers(0, len(SPREADS) - 1),
)
def test_the_root_stays_a_root_with_hostile_numbers(seed, decades, noise, n, which):
    rng = np.random.default_rng(seed)
    spread = SPREADS[which](n)
    S = np.diag(10.0 ** rng.uniform(-decades / 2, decades / 2, n))
    x = rng.normal(size=n)
    H = rng.normal(size=(2, n))
    R = np.diag([10.0**noise, 10.0**noise])
    for _ in range(30):
        x, S = unscented_predict(x, S, lambda v: v + 0.01 * np.sin(v), 1e-6 * np.eye(n), spread)
        x, S, nis = unscented_update(x, S, H @ x, lambda v: H @ v + 0.01 * np.tanh(v[:2]), R, spread)
        assert np.isfinite([*x, *S.ravel()]).all()
        assert nis >= 0.0
        assert np.all(np.diag(S) > 0.0)


def test_iterations_change_nothing_in_a_linear_model():
    rng = np.random.default_rng(4)
    x, S, H = rng.normal(size=6), random_root(rng, 6), rng.normal(size=(2, 6))
    once = unscented_update(x, S, np.ones(2), lambda v: H @ v, np.eye(2), SigmaSpread(6))
    often = unscented_update(x, S, np.ones(2), lambda v: H @ v, np.eye(2), SigmaSpread(6), iterations=5)
    np.testing.assert_allclose(often[0], once[0], atol=1e-12)
    np.testing.assert_allclose(often[1] @ often[1].T, once[1] @ once[1].T, atol=1e-12)
    assert often[2] == once[2]


@pytest.mark.parametrize("angle", [-150.0, -80.0, 30.0, 120.0, 170.0])
def test_iterations_find_an_angle_that_one_regression_misses(angle):
    """A direction known to 60 deg and seen with 2 deg: the posterior is all but that of the measurement."""
    truth, noise = np.radians(angle), np.radians(2.0)
    z = np.array([np.cos(truth), np.sin(truth)])
    x, S = np.zeros(1), np.array([[np.radians(60.0)]])

    def h(v):
        return np.array([np.cos(v[0]), np.sin(v[0])])

    R = noise**2 * np.eye(2)
    once = unscented_update(x, S, z, h, R, SigmaSpread(1))
    often = unscented_update(x, S, z, h, R, SigmaSpread(1), iterations=12)
    assert abs(often[0][0] - truth) < 0.2 * noise
    assert often[1][0, 0] == pytest.approx(noise, rel=0.02)
    assert abs(once[0][0] - truth) > 3.0 * once[1][0, 0]


def test_semidefinite_root():
    L = np.empty((3, 3))
    R = np.array([[4.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 9.0]])
    assert semidefinite_root(R, L)
    np.testing.assert_allclose(L @ L.T, R, atol=1e-15)
    assert not semidefinite_root(np.diag([1.0, -1.0, 1.0]), L)
    assert not semidefinite_root(np.diag([1.0, np.nan, 1.0]), L)


def test_spread_of_the_points():
    assert SigmaSpread(15).distance == pytest.approx(np.sqrt(3.0))
    assert SigmaSpread(15, 1e-3).distance == pytest.approx(1e-3 * np.sqrt(15.0))
    np.testing.assert_allclose(SigmaSpread.cubature(15).weights(), [np.sqrt(15.0), 1.0 / 30.0, 0.0, 0.0], atol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((15, 0.0), "alpha = 0"),
        ((15, -1.0), "alpha = -1"),
        ((15, float("nan")), "alpha = nan"),
        ((15, 1.0, float("inf")), "beta = inf"),
        ((15, 1e-4), "0.00039 standard deviations .* let alpha be 0.00052 or more"),
        ((15, 1e-9), "rounding takes the place of the model"),
        ((15, 1.0, 2.0, -15.0), "greater than -15"),
        ((15, None, 2.0, -15.0), "greater than -15"),
        ((15, 1.0, -0.1), "beta"),
        ((15, 1.0, 0.0, -1.0), "beta"),
    ],
)
def test_settings_out_of_range_are_named(arguments, told):
    with pytest.raises(ConfigError, match=told):
        SigmaSpread(*arguments)


def test_a_measurement_without_noise_and_variance_is_refused():
    with pytest.raises(ConfigError, match="not positive definite"):
        unscented_update(np.zeros(2), np.zeros((2, 2)), np.zeros(1), lambda v: v[:1], np.zeros((1, 1)), SigmaSpread(2))
    with pytest.raises(ConfigError, match="semi-definite"):
        unscented_update(np.zeros(2), np.eye(2), np.zeros(1), lambda v: v[:1], -np.eye(1), SigmaSpread(2))
