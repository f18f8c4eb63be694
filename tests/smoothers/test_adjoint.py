"""The vectorized backward pass against plain matrices."""

from __future__ import annotations

import numpy as np
import pytest

from navfuse.smoothers.adjoint import back_across_rows, tile_space


def full(F):
    """The whole transition matrix of its (10, n) form."""
    matrix = np.diag(F[9])
    matrix[:9] = F[:9]
    return matrix


@pytest.mark.parametrize("n", [9, 15, 21, 22, 33, 60])
@pytest.mark.parametrize("held", [np.zeros(3), np.array([0.6, 0.0, 0.8])], ids=["free", "held"])
def test_rows_are_smoothed_and_the_adjoint_carried_back(n, held):
    rng = np.random.default_rng(n)
    rows = 4
    x, P, F = rng.normal(size=(rows, n)), rng.normal(size=(rows, 9, n)), 0.1 * rng.normal(size=(rows, 10, n))
    P[:, :, :9] += P[:, :, :9].transpose(0, 2, 1)
    F[:, :9, :9] += np.eye(9)
    F[:, 9] = 0.99
    root = 0.1 * rng.normal(size=(n, n))
    lam, Lam = rng.normal(size=n), root @ root.T
    keep = np.eye(n)
    keep[6:9, 6:9] -= np.outer(held, held)
    wanted_lam, wanted = lam.copy(), Lam.copy()
    smoothed = []
    for k in range(rows - 1, -1, -1):
        smoothed.insert(0, (x[k, :9] - P[k] @ wanted_lam, P[k, :, :9] - P[k] @ wanted @ P[k].T))
        wanted_lam, wanted = keep @ full(F[k]).T @ wanted_lam, keep @ full(F[k]).T @ wanted @ full(F[k]) @ keep
    out_x, out_P = np.empty((rows, 9)), np.empty((rows, 9, 9))
    back_across_rows(rows, x, P, F, held, lam, Lam, out_x, out_P, tile_space(n))
    assert np.array_equal(Lam, Lam.T)
    np.testing.assert_allclose(lam, wanted_lam, rtol=0.0, atol=1e-13 * np.abs(wanted_lam).max())
    np.testing.assert_allclose(Lam, wanted, rtol=0.0, atol=1e-13 * np.abs(wanted).max())
    for k, (wanted_x, wanted_P) in enumerate(smoothed):
        np.testing.assert_allclose(out_x[k], wanted_x, rtol=0.0, atol=1e-13 * np.abs(wanted_x).max())
        np.testing.assert_allclose(out_P[k], wanted_P, rtol=0.0, atol=1e-13 * np.abs(wanted_P).max())
