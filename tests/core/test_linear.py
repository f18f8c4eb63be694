"""The linear Kalman filter and smoother against textbook matrices and a batch solution."""

import numpy as np
import pytest

from navfuse.core.linear import predict, smooth_step, update


def _spd(rng, n):
    A = rng.standard_normal((n, n))
    return A @ A.T + 0.1 * np.eye(n)


@pytest.mark.parametrize(("n", "d"), [(1, 1), (2, 1), (3, 3), (6, 6), (8, 4), (15, 2)])
def test_a_step_is_that_of_the_textbook(n, d):
    rng = np.random.default_rng(n * 10 + d)
    x, P, Phi, Q = rng.standard_normal(n), _spd(rng, n), rng.standard_normal((n, n)), _spd(rng, n)
    expected_x, expected_P = Phi @ x, Phi @ P @ Phi.T + Q
    predict(x, P, Phi, Q)
    np.testing.assert_allclose(x, expected_x, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(P, expected_P, rtol=1e-12, atol=1e-12)

    z, H, R = rng.standard_normal(d), rng.standard_normal((d, n)), _spd(rng, d)
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    nis = z @ np.linalg.solve(S, z)
    kept = x.copy(), P.copy()
    assert update(x, P, z, H, R, 0.5 * nis) == pytest.approx(nis, rel=1e-9)
    np.testing.assert_array_equal(x, kept[0])
    np.testing.assert_array_equal(P, kept[1])
    update(x, P, z, H, R, np.inf)
    np.testing.assert_allclose(x, kept[0] + K @ z, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(P, (np.eye(n) - K @ H) @ kept[1], rtol=1e-7, atol=1e-9)
    np.testing.assert_array_equal(P, P.T)


def test_a_covariance_that_cannot_be_changes_nothing():
    x, P = np.ones(2), -np.eye(2)
    assert np.isnan(update(x, P, np.ones(1), np.ones((1, 2)), np.eye(1), np.inf))
    assert not smooth_step(x, np.eye(2), np.eye(2), x, P, x, P)
    np.testing.assert_array_equal(x, np.ones(2))


def test_filter_and_smoother_are_the_batch_solution():
    """All states of a walk at once by least squares, and the same by filtering forward and smoothing back."""
    rng = np.random.default_rng(3)
    n, steps = 3, 12
    Phi = np.array([[1.0, 0.5, 0.1], [0.0, 1.0, 0.5], [0.0, 0.0, 0.9]])
    Q, R, H = 0.1 * _spd(rng, n), np.array([[0.5]]), np.array([[1.0, 0.0, 0.2]])
    P0, z = _spd(rng, n), rng.standard_normal(steps)
    rows, values, weights = [np.hstack([np.eye(n), np.zeros((n, n * (steps - 1)))])], [np.zeros(n)], [np.linalg.inv(P0)]
    for k in range(steps):
        row = np.zeros((1, n * steps))
        row[:, n * k : n * k + n] = H
        rows.append(row), values.append(z[k : k + 1]), weights.append(np.linalg.inv(R))
        if k + 1 < steps:
            row = np.zeros((n, n * steps))
            row[:, n * k : n * k + n], row[:, n * k + n : n * k + 2 * n] = -Phi, np.eye(n)
            rows.append(row), values.append(np.zeros(n)), weights.append(np.linalg.inv(Q))
    normal = sum(A.T @ W @ A for A, W in zip(rows, weights, strict=True))
    right = sum(A.T @ W @ b for A, W, b in zip(rows, weights, values, strict=True))
    covariance = np.linalg.inv(normal)
    batch = (covariance @ right).reshape(steps, n)

    x, P = np.zeros(n), P0.copy()
    filtered, predicted = [], []
    for k in range(steps):
        if k:
            predict(x, P, Phi, Q)
        predicted.append((x.copy(), P.copy()))
        update(x, P, z[k : k + 1] - H @ x, H, R, np.inf)
        filtered.append((x.copy(), P.copy()))
    smoothed = [filtered[-1]]
    for k in range(steps - 2, -1, -1):
        x, P = filtered[k]
        assert smooth_step(x, P, Phi, *predicted[k + 1], *smoothed[0])
        smoothed.insert(0, (x, P))
    for k, (x, P) in enumerate(smoothed):
        block = slice(n * k, n * k + n)
        np.testing.assert_allclose(x, batch[k], atol=1e-10)
        np.testing.assert_allclose(P, covariance[block, block], atol=1e-10)
