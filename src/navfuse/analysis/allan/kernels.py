"""Sums of squared differences of a phase, the only loops over samples of the Allan family. No checks are made.

Every estimator works on one cumulative sum, the phase: the angle (or speed) that the sensor has counted. The work is
cut into pieces of fixed size, whatever the number of threads, and the pieces are added in a fixed order, so that the
result is the same to the last bit on one core and on many. ``reassoc`` lets the compiler keep several partial sums in
a vector register within a piece; it changes the rounding once, when it compiles, and not from run to run.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

PIECE = 1 << 15
"""Differences in a piece: its part of the phase stays in the cache of a core."""

ALLAN, MODIFIED, HADAMARD, TOTAL = 0, 1, 2, 3


@njit(cache=True, error_model="numpy")
def integrate(values, mean, scale, out):
    """Phase of a stretch of samples: ``out[k] = scale * sum(values[:k] - mean)``, summed with compensation.

    Parameters
    ----------
    values : (n,) array
    mean, scale : float
    out : (n + 1,) array
    """
    total, rest = 0.0, 0.0
    out[0] = 0.0
    for k in range(values.size):
        term = (values[k] - mean) * scale - rest
        raised = total + term
        rest = (raised - total) - term
        total = raised
        out[k + 1] = total


@njit(cache=True, error_model="numpy", fastmath={"reassoc"})
def _allan_piece(x, begin, end, step, m):
    """Views with indices from 0 let the compiler see that none is negative, which it needs for vectors."""
    total = 0.0
    if step == 1:
        n = end - begin
        first, middle, last = x[begin:end], x[begin + m : end + m], x[begin + 2 * m : end + 2 * m]
        for i in range(n):
            d = (last[i] - middle[i]) - (middle[i] - first[i])
            total += d * d
    else:
        for j in range(begin, end):
            i = j * step
            d = (x[i + 2 * m] - x[i + m]) - (x[i + m] - x[i])
            total += d * d
    return total


@njit(cache=True, error_model="numpy", fastmath={"reassoc"})
def _hadamard_piece(x, begin, end, step, m):
    total = 0.0
    if step == 1:
        n = end - begin
        first, second = x[begin:end], x[begin + m : end + m]
        third, fourth = x[begin + 2 * m : end + 2 * m], x[begin + 3 * m : end + 3 * m]
        for i in range(n):
            d = (fourth[i] - first[i]) - 3.0 * (third[i] - second[i])
            total += d * d
    else:
        for j in range(begin, end):
            i = j * step
            d = (x[i + 3 * m] - x[i]) - 3.0 * (x[i + 2 * m] - x[i + m])
            total += d * d
    return total


@njit(cache=True, error_model="numpy")
def _modified_piece(x, begin, end, m):
    """Squares of sums of m neighbouring second differences; the sum is formed anew in each piece, then carried on."""
    window = 0.0
    for i in range(begin, begin + m):
        window += (x[i + 2 * m] - x[i + m]) - (x[i + m] - x[i])
    total = window * window
    n = end - 1 - begin
    first, second = x[begin : begin + n], x[begin + m : begin + n + m]
    third, fourth = x[begin + 2 * m : begin + n + 2 * m], x[begin + 3 * m : begin + n + 3 * m]
    for i in range(n):
        window += (fourth[i] - first[i]) - 3.0 * (third[i] - second[i])
        total += window * window
    return total


@njit(cache=True, error_model="numpy", fastmath={"reassoc"})
def _total_piece(x, begin, end, m):
    """Second differences about every inner point of a phase that is mirrored in both of its ends."""
    last = x.size - 1
    total = 0.0
    for i in range(begin, end):
        low, high = i - m, i + m
        before = x[low] if low >= 0 else 2.0 * x[0] - x[-low]
        after = x[high] if high <= last else 2.0 * x[last] - x[2 * last - high]
        d = (after - x[i]) - (x[i] - before)
        total += d * d
    return total


@njit(cache=True, error_model="numpy", parallel=True)
def sums_of_squares(x, kind, factor, step, count, piece, first, out):
    """Sum of squared differences for each averaging factor.

    Parameters
    ----------
    x : (n + 1,) array
        Phase of one stretch without gaps.
    kind : int
        ALLAN, MODIFIED, HADAMARD or TOTAL.
    factor : (p,) int array
        Averaging factor of each piece of work.
    step : (p,) int array
        Distance of neighbouring differences: 1 overlapping, the factor otherwise.
    count : (p,) int array
        Number of differences there are for this factor.
    piece : (p,) int array
        Differences in one piece for this factor.
    first : (p,) int array
        Index of the first difference of the piece.
    out : (p,) array
        The sums, one for each piece.
    """
    for p in prange(factor.size):
        begin = first[p]
        end = min(begin + piece[p], count[p])
        if kind == ALLAN:
            out[p] = _allan_piece(x, begin, end, step[p], factor[p])
        elif kind == HADAMARD:
            out[p] = _hadamard_piece(x, begin, end, step[p], factor[p])
        elif kind == MODIFIED:
            out[p] = _modified_piece(x, begin, end, factor[p])
        else:
            out[p] = _total_piece(x, begin + 1, end + 1, factor[p])


def sum_squares(x: np.ndarray, kind: int, factors: np.ndarray, overlapping: bool) -> tuple[np.ndarray, np.ndarray]:
    """Number of differences and sum of their squares for each averaging factor, for one stretch of phase.

    Parameters
    ----------
    x : (n + 1,) array
        Phase.
    kind : int
        ALLAN, MODIFIED, HADAMARD or TOTAL.
    factors : (t,) int array
    overlapping : bool

    Returns
    -------
    count : (t,) int array
        0 where the stretch is too short.
    total : (t,) array
    """
    n = x.size - 1
    reach = {ALLAN: 2, MODIFIED: 3, HADAMARD: 3, TOTAL: 1}[kind] * factors
    last = {ALLAN: n, MODIFIED: n + 1, HADAMARD: n, TOTAL: n}[kind]
    step = np.ones_like(factors) if overlapping else factors
    count = np.where(reach <= last, (last - reach) // step + 1, 0)
    if kind == TOTAL:
        count = np.where(factors <= n - 1, n - 1, 0)
    size = np.maximum(PIECE // step, 1) if not overlapping else np.full_like(factors, PIECE)
    if kind == MODIFIED:
        size = np.maximum(size, 4 * factors)
    pieces = -(-count // size)
    which = np.repeat(np.arange(factors.size), pieces)
    first = (np.arange(which.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)) * size[which]
    order = np.argsort(first * step[which], kind="stable")
    chosen = which[order]
    parts = np.zeros(which.size)
    found = np.empty(which.size)
    sums_of_squares(x, kind, factors[chosen], step[chosen], count[chosen], size[chosen], first[order], found)
    parts[order] = found
    total = np.zeros(factors.size)
    np.add.at(total, which, parts)
    return count, total
