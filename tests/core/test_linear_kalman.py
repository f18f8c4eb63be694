from __future__ import annotations

import numpy as np
import pytest

from navfuse.core.linear_kalman import propagate, smooth, update


def covariance(rng, n):
    root = rng.standard_normal((n, n)) + np.eye(n)
    return root @ root.T


def run_update(P, H, R, z, gate=np.inf, free=None):
    n, d = P.shape[0], z.size
    P, S, dx = P.copy(), np.full((d, d), np.nan), np.full(n, np.nan)
    nis = update(P, H, R, z, gate, np.ones(n) if free is None else free, S, dx)
    return P, S, dx, nis


@pytest.mark.parametrize("n", [1, 2, 7, 21])
def test_propagation_is_the_textbook_one(n):
    rng = np.random.default_rng(n)
    P, Q, F = covariance(rng, n), covariance(rng, n), rng.standard_normal((n, n)) * (rng.random((n, n)) > 0.5)
    out = np.full((n, n), np.nan)
    propagate(P, F, Q, out)
    np.testing.assert_allclose(out, F @ P @ F.T + Q, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(out, out.T)


@pytest.mark.parametrize(("n", "d"), [(1, 1), (2, 1), (9, 3), (21, 3)])
@pytest.mark.parametrize("masked", [False, True])
def test_update_is_the_textbook_one_for_any_gain(n, d, masked):
    rng = np.random.default_rng(10 * n + d)
    P, R, H, z = covariance(rng, n), covariance(rng, d), rng.standard_normal((d, n)), rng.standard_normal(d)
    free = (rng.random(n) > 0.4).astype(float) if masked else np.ones(n)
    updated, S, dx, nis = run_update(P, H, R, z, free=free)
    wanted_S = H @ P @ H.T + R
    K = free[:, None] * np.linalg.solve(wanted_S, H @ P).T
    A = np.eye(n) - K @ H
    np.testing.assert_allclose(S, wanted_S, rtol=1e-12)
    np.testing.assert_allclose(dx, K @ z, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(updated, A @ P @ A.T + K @ R @ K.T, rtol=1e-9, atol=1e-10)
    assert nis == pytest.approx(z @ np.linalg.solve(wanted_S, z), rel=1e-10)
    held = free == 0.0
    np.testing.assert_allclose(updated[np.ix_(held, held)], P[np.ix_(held, held)], rtol=1e-12)


def test_a_rejected_measurement_and_a_singular_one_change_nothing():
    rng = np.random.default_rng(5)
    P, H, z = covariance(rng, 4), rng.standard_normal((2, 4)), np.array([30.0, -20.0])
    kept, _, dx, nis = run_update(P, H, np.eye(2), z, gate=9.0)
    assert nis > 9.0
    assert np.isnan(dx).all()
    np.testing.assert_array_equal(kept, P)
    kept, _, dx, nis = run_update(P, np.zeros((2, 4)), np.zeros((2, 2)), z)
    assert np.isnan(nis)
    np.testing.assert_array_equal(kept, P)


def test_filter_and_smoother_are_batch_least_squares():
    rng = np.random.default_rng(8)
    n, epochs = 3, 6
    F = [np.eye(n) + 0.3 * rng.standard_normal((n, n)) for _ in range(epochs)]
    Q = [0.2 * covariance(rng, n) for _ in range(epochs)]
    H = [rng.standard_normal((2, n)) for _ in range(epochs)]
    R = [covariance(rng, 2) for _ in range(epochs)]
    y = [rng.standard_normal(2) for _ in range(epochs)]
    x, P = np.zeros(n), covariance(rng, n)
    # The joint information of all epochs: prior, transitions, measurements.
    information, right = np.zeros((epochs * n, epochs * n)), np.zeros(epochs * n)

    def add(J, W, value):
        information[:] += J.T @ np.linalg.solve(W, J)
        right[:] += J.T @ np.linalg.solve(W, value)

    def at(k, A):
        J = np.zeros((A.shape[0], epochs * n))
        J[:, k * n : (k + 1) * n] = A
        return J

    add(at(0, np.eye(n)), P, np.zeros(n))
    filtered, before = [], []
    for k in range(epochs):
        if k:
            add(at(k, np.eye(n)) - at(k - 1, F[k]), Q[k], np.zeros(n))
            predicted = np.empty((n, n))
            propagate(P, F[k], Q[k], predicted)
            x, P = F[k] @ x, predicted
        before.append((x, P.copy()))
        add(at(k, H[k]), R[k], y[k])
        P, _, dx, _ = run_update(P, H[k], R[k], y[k] - H[k] @ x)
        x = x + dx
        filtered.append((x, P.copy()))
    smoothed = [filtered[-1]]
    for k in range(epochs - 2, -1, -1):
        dx, Ps = np.empty(n), np.empty((n, n))
        x_next, P_next = smoothed[0]
        assert smooth(filtered[k][1], F[k + 1], before[k + 1][1], P_next, x_next - before[k + 1][0], dx, Ps)
        smoothed.insert(0, (filtered[k][0] + dx, Ps))
    joint = np.linalg.inv(information)
    np.testing.assert_allclose(np.concatenate([x for x, _ in smoothed]), joint @ right, rtol=1e-9, atol=1e-10)
    for k, (_, Ps) in enumerate(smoothed):
        np.testing.assert_allclose(Ps, joint[k * n : (k + 1) * n, k * n : (k + 1) * n], rtol=1e-8, atol=1e-10)


def test_smoothing_across_a_singular_covariance_says_so():
    dx, out = np.full(2, np.nan), np.full((2, 2), np.nan)
    assert not smooth(np.eye(2), np.eye(2), np.zeros((2, 2)), np.eye(2), np.ones(2), dx, out)
    assert np.isnan(dx).all()
    assert np.isnan(out).all()
