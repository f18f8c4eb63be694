"""Sums of squared differences of a phase, the only loops over samples of the Allan family. No checks are made.

Every estimator works on one cumulative sum, the phase: the angle (or speed) that the sensor has counted. Stretches
between gaps lie one behind the other in one array. The work is cut into pieces of fixed size, whatever the number of
threads, and the pieces are added in a fixed order, so that the result is the same to the last bit on one core and on
many. A long stretch is several pieces; many short ones are one, or starting the threads would take longer than the
sum. ``reassoc`` lets the compiler keep several partial sums in a vector register within a piece; it changes the
rounding once, when it compiles, and not from run to run.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

PIECE = 1 << 15
"""Differences in a piece: its part of the phase stays in the cache of a core."""

ALLAN, MODIFIED, HADAMARD, TOTAL = 0, 1, 2, 3


@njit(cache=True, error_model="numpy", fastmath={"reassoc"})
def mean_of_stretches(values, begin, size):
    """Mean over the samples of all stretches: no deviation depends on it, but the phase stays small without it."""
    total, samples = 0.0, 0
    for s in range(begin.size):
        part, view = 0.0, values[begin[s] : begin[s] + size[s]]
        for k in range(view.size):
            part += view[k]
        total += part
        samples += size[s]
    return total / samples


@njit(cache=True, error_model="numpy")
def integrate(values, begin, size, mean, scale, out):
    """Phase of stretches of samples: ``out[k] = scale * sum(values[:k] - mean)``, summed with compensation.

    Parameters
    ----------
    values : (n,) array
    begin, size : (s,) int arrays
        First sample and number of samples of each stretch.
    mean, scale : float
    out : (sum of size + s,) array
        One stretch of phase behind the other, each one point longer than the samples.
    """
    at = 0
    for s in range(begin.size):
        total, rest = 0.0, 0.0
        out[at] = 0.0
        at += 1
        for k in range(begin[s], begin[s] + size[s]):
            term = (values[k] - mean) * scale - rest
            raised = total + term
            rest = (raised - total) - term
            total = raised
            out[at] = total
            at += 1


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


@njit(cache=True, error_model="numpy")
def _number(kind, n, m, step):
    """How many differences there are in a stretch of n samples."""
    if kind == TOTAL:
        return n - 1 if m <= n - 1 else 0
    spare = n - 2 * m if kind == ALLAN else n - 3 * m + (1 if kind == MODIFIED else 0)
    return spare // step + 1 if spare >= 0 else 0


@njit(cache=True, error_model="numpy")
def difference_counts(kind, size, factors, overlapping):
    """Number of differences by averaging factor (rows) and size of a stretch (columns)."""
    count = np.empty((factors.size, size.size), dtype=np.int64)
    for k in range(factors.size):
        for s in range(size.size):
            count[k, s] = _number(kind, size[s], factors[k], 1 if overlapping else factors[k])
    return count


@njit(cache=True, error_model="numpy", parallel=True)
def _sums(x, begin, size, kind, factor, step, low, high, first, length, out):
    """Sums of squared differences of pieces of work.

    Parameters
    ----------
    x : (k,) array
        Stretches of phase, one behind the other.
    begin, size : (s,) int arrays
        Of each stretch: its first point, and its samples (points less one).
    kind : int
        ALLAN, MODIFIED, HADAMARD or TOTAL.
    factor, step : (p,) int arrays
        Averaging factor of each piece, and distance of neighbouring differences: 1, or the factor.
    low, high : (p,) int arrays
        Stretches of the piece, from low to before high.
    first, length : (p,) int arrays
        First difference of the piece in each of its stretches, and how many there are in it at most.
    out : (p,) array
    """
    for p in prange(factor.size):
        m, total = factor[p], 0.0
        for s in range(low[p], high[p]):
            count = _number(kind, size[s], m, step[p])
            if count <= first[p]:
                continue
            part = x[begin[s] : begin[s] + size[s] + 1]
            end = min(first[p] + length[p], count)
            if kind == ALLAN:
                total += _allan_piece(part, first[p], end, step[p], m)
            elif kind == HADAMARD:
                total += _hadamard_piece(part, first[p], end, step[p], m)
            elif kind == MODIFIED:
                total += _modified_piece(part, first[p], end, m)
            else:
                total += _total_piece(part, first[p] + 1, end + 1, m)
        out[p] = total


def _groups(size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last stretch (exclusive) of every group: a long stretch alone, short ones up to a piece together."""
    edges, filled = [0], 0
    for k, n in enumerate(size.tolist()):
        if filled and filled + n > PIECE:
            edges.append(k)
            filled = 0
        filled += n
    edges.append(size.size)
    return np.array(edges[:-1]), np.array(edges[1:])


def sum_squares(
    x: np.ndarray, begin: np.ndarray, size: np.ndarray, kind: int, factors: np.ndarray, overlapping: bool
) -> np.ndarray:
    """Sum of the squared differences of all stretches for each averaging factor.

    Parameters
    ----------
    x : (k,) array
        Stretches of phase, one behind the other.
    begin, size : (s,) int arrays
        Of each stretch: its first point, and its samples (points less one).
    kind : int
        ALLAN, MODIFIED, HADAMARD or TOTAL.
    factors : (t,) int array
    overlapping : bool

    Returns
    -------
    (t,) array
        0 where no stretch is long enough.
    """
    low, high = _groups(size)
    longest = np.maximum.reduceat(size, low)
    step = np.ones_like(factors) if overlapping else factors
    length = np.full_like(factors, PIECE) if overlapping else np.maximum(PIECE // step, 1)
    if kind == MODIFIED:
        length = np.maximum(length, 4 * factors)
    # Of a group of short stretches one piece takes all differences, of a long one as many as its length says.
    pieces = -(-difference_counts(kind, longest, factors, overlapping) // length[:, None])
    pieces = np.where((high - low > 1)[None, :], np.minimum(pieces, 1), pieces).ravel()
    cell = np.repeat(np.arange(pieces.size), pieces)
    number = np.arange(cell.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    which, group = np.divmod(cell, low.size)
    first = number * length[which]
    most = np.where(high[group] - low[group] > 1, x.size, length[which])
    # Neighbours in time, whatever the factor, so that the phase is read from the memory once.
    order = np.argsort(begin[low[group]] + first * step[which], kind="stable")
    chosen, group = which[order], group[order]
    found = np.empty(which.size)
    _sums(
        x, begin, size, kind, factors[chosen], step[chosen], low[group], high[group], first[order], most[order], found
    )  # fmt: skip
    parts, total = np.empty(which.size), np.zeros(factors.size)
    parts[order] = found
    np.add.at(total, which, parts)
    return total
