"""The adjoint of the smoother carried back across rows of output, arranged for vector instructions.

For the recursion see :mod:`navfuse.smoothers.rts`. While it goes back over a stretch, the adjoint matrix Lam (n, n) is
laid out in tiles as a covariance is in :mod:`navfuse.mechanization.tiles`: TILE columns to a tile, the rows at a
distance that the compiler knows, and zero rows at the end up to a multiple of four.
"""

from __future__ import annotations

import numpy as np

from navfuse.core.fused import fused
from navfuse.mechanization.tiles import at_a_cache_line

TILE = 24


def tile_space(n: int) -> np.ndarray:
    """Work space of :func:`back_across_rows` for n states."""
    return at_a_cache_line((n + TILE - 1) // TILE * (2 * (n + 3) + 10) * TILE + 9 * TILE)


@fused
def back_across_rows(rows, x, P, F, held, lam, Lam, out_x, out_P, work):
    """Smooth rows of output in reverse, carrying the adjoint back over the transition that leads to each.

    Parameters
    ----------
    rows : int
        How many of the rows are filled.
    x : (r, n), P : (r, 9, n), F : (r, 10, n) arrays
        Error estimate, navigation rows of the covariance, and transition from the row before, in the form of
        :func:`navfuse.mechanization.propagate.identity_transition`.
    held : (3,) array
        Direction of the attitude error of which the adjoint is to say nothing; zero for none.
    lam : (n,), Lam : (n, n) arrays
        Adjoint, after the last row; on return, before the transition to the first.
    out_x : (r, 9), out_P : (r, 9, 9) arrays
        Receive the smoothed navigation errors and their covariances; without rows, nothing is smoothed.
    work : array
        From :func:`tile_space`.

    Notes
    -----
    No checks are made.
    """
    n = lam.size
    tiles = (n + TILE - 1) // TILE
    size = (n + 3) // 4 * 4 * TILE
    L = work[: tiles * size]
    T = work[tiles * size : 2 * tiles * size]
    G = work[2 * tiles * size : 2 * tiles * size + 10 * tiles * TILE]
    U = work[2 * tiles * size + 10 * tiles * TILE :]
    for i in range(tiles * size):
        L[i] = 0.0
    for c in range(n):
        for i in range(n):
            L[c // TILE * size + i * TILE + c % TILE] = Lam[i, c]
    is_held = held[0] != 0.0 or held[1] != 0.0 or held[2] != 0.0
    for row in range(rows - 1, -1, -1):
        if out_x.shape[0] > 0:
            _smooth_row(x[row], P[row], lam, L, size, U, out_x[row], out_P[row])
        _back_across_transition(F[row], lam, L, size, T, G)
        if is_held:
            _drop_direction(held, lam, L, size)
    for c in range(n):
        for i in range(c + 1):
            v = 0.5 * (L[c // TILE * size + i * TILE + c % TILE] + L[i // TILE * size + c * TILE + i % TILE])
            Lam[i, c] = v
            Lam[c, i] = v


@fused(inline="always")
def _smooth_row(x, P, lam, L, size, U, out_x, out_P):
    """Smoothed navigation error x - P lam (9,) and covariance P - P Lam P (9, 9) of one row. No checks are made."""
    n = lam.size
    for i in range(9):
        v = x[i]
        for k in range(n):
            v -= P[i, k] * lam[k]
        out_x[i] = v
        for j in range(9):
            out_P[i, j] = P[i, j]
    for first in range(0, n, TILE):
        _products(P, L[first // TILE * size :], U, n)
        for i in range(9):
            for j in range(i + 1):
                v = 0.0
                for c in range(min(TILE, n - first)):
                    v += U[i * TILE + c] * P[j, first + c]
                out_P[i, j] -= v
    for i in range(9):
        for j in range(i):
            out_P[j, i] = out_P[i, j]


@fused(inline="always")
def _products(P, L, U, n):
    """U <- P L for the navigation rows P (9, n) and one tile. No checks are made."""
    columns = min(TILE, (n + 3) // 4 * 4)
    for i in range(9):
        out = U[i * TILE :]
        for c in range(columns):
            out[c] = 0.0
        for k in range(0, n, 4):
            a = P[i, k]
            b = P[i, k + 1] if k + 1 < n else 0.0
            d = P[i, k + 2] if k + 2 < n else 0.0
            e = P[i, k + 3] if k + 3 < n else 0.0
            four = L[k * TILE :]
            for c in range(columns):
                v = a * four[c] + b * four[TILE + c]
                out[c] += v + (d * four[2 * TILE + c] + e * four[3 * TILE + c])


@fused(inline="always")
def _back_across_transition(F, lam, L, size, T, G):
    """Adjoint before a transition: lam <- F^T lam, Lam <- F^T Lam F. No checks are made."""
    n = lam.size
    tiles = (n + TILE - 1) // TILE
    for c in range(n):
        g = c // TILE * 10 * TILE + c % TILE
        for r in range(9):
            G[g + r * TILE] = F[r, c]
        G[g + 9 * TILE] = F[9, c] if c >= 9 else 0.0
    for c in range(9, n):
        lam[c] *= F[9, c]
        for r in range(9):
            lam[c] += F[r, c] * lam[r]
    _turn_navigation(F, lam)
    for tile in range(tiles):
        _rows_from_left(F, L[tile * size :], T[tile * size :], n)
    for tile in range(tiles):
        _rows_from_right(T, T[tile * size :], G[tile * 10 * TILE :], L[tile * size :], n)


@fused(inline="always")
def _turn_navigation(F, lam):
    """Navigation part of F^T lam. No checks are made."""
    a, b, c, d, e, f, g, h, i = lam[0], lam[1], lam[2], lam[3], lam[4], lam[5], lam[6], lam[7], lam[8]
    for k in range(9):
        lam[k] = (
            F[0, k] * a + F[1, k] * b + F[2, k] * c + F[3, k] * d + F[4, k] * e
            + F[5, k] * f + F[6, k] * g + F[7, k] * h + F[8, k] * i
        )  # fmt: skip


@fused(inline="always")
def _rows_from_left(F, L, T, n):
    """T <- F^T L for one tile. No checks are made."""
    columns = min(TILE, (n + 3) // 4 * 4)
    for i in range(n):
        f0, f1, f2, f3, f4 = F[0, i], F[1, i], F[2, i], F[3, i], F[4, i]
        f5, f6, f7, f8 = F[5, i], F[6, i], F[7, i], F[8, i]
        own = F[9, i] if i >= 9 else 0.0
        mine, out = L[i * TILE :], T[i * TILE :]
        for c in range(columns):
            v = f0 * L[c] + f1 * L[TILE + c] + f2 * L[2 * TILE + c]
            w = f3 * L[3 * TILE + c] + f4 * L[4 * TILE + c] + f5 * L[5 * TILE + c]
            u = f6 * L[6 * TILE + c] + f7 * L[7 * TILE + c] + f8 * L[8 * TILE + c]
            out[c] = v + w + u + own * mine[c]


@fused(inline="always")
def _rows_from_right(T0, T, G, L, n):
    """L <- T F for one tile; `T0` is the first tile of T, `G` holds F. No checks are made."""
    columns = min(TILE, (n + 3) // 4 * 4)
    for i in range(n):
        at = i * TILE
        mine, out = T[at:], L[at:]
        t0, t1, t2, t3, t4 = T0[at], T0[at + 1], T0[at + 2], T0[at + 3], T0[at + 4]
        t5, t6, t7, t8 = T0[at + 5], T0[at + 6], T0[at + 7], T0[at + 8]
        for c in range(columns):
            v = t0 * G[c] + t1 * G[TILE + c] + t2 * G[2 * TILE + c]
            w = t3 * G[3 * TILE + c] + t4 * G[4 * TILE + c] + t5 * G[5 * TILE + c]
            u = t6 * G[6 * TILE + c] + t7 * G[7 * TILE + c] + t8 * G[8 * TILE + c]
            out[c] = v + w + u + mine[c] * G[9 * TILE + c]


@fused(inline="always")
def _drop_direction(held, lam, L, size):
    """Take out of the adjoint what it says of one direction of the attitude error. No checks are made."""
    n = lam.size
    v = held[0] * lam[6] + held[1] * lam[7] + held[2] * lam[8]
    for i in range(3):
        lam[6 + i] -= held[i] * v
    for c in range(n):
        at = c // TILE * size + c % TILE + 6 * TILE
        v = held[0] * L[at] + held[1] * L[at + TILE] + held[2] * L[at + 2 * TILE]
        for i in range(3):
            L[at + i * TILE] -= held[i] * v
    for c in range(n):
        at = c * TILE + 6
        v = held[0] * L[at] + held[1] * L[at + 1] + held[2] * L[at + 2]
        for i in range(3):
            L[at + i] -= held[i] * v
