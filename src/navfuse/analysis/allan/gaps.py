"""Short gaps of a record, bridged by what could have been there, so that a spectrum of the whole can be taken.

What stands in for missing samples is a draw: what the samples around lead to expect, plus noise that is as large as
that expectation is wrong. Noise terms of the bridged record are those of the sensor, where a line or a mean would make
it too quiet. It adds no information, which the standard deviations of the terms account for, and is used for
nothing but the spectrum: deviations are averaged over what was measured.

* Up to :data:`SHORT` samples: Gaussian conditional draw from the 16 samples on each side, with the autocovariance of
  the record itself, so that quantisation and the filter of a sensor go on as they are.
* Longer ones: a straight line between means of samples on each side, plus the deviation from
  such a line of a piece that is simulated with the noise terms found so far.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numba import njit

from navfuse.analysis.allan.terms import Flicker

Array = np.ndarray

SHORT = 16
"""Samples that are bridged from the samples around them."""

LONGEST = 0.005
"""Share of the record of the longest gap that is bridged."""

MOST = 0.05
"""Share of the record that is bridged at most."""

_REACH = 16
_BLOCK = 1024
_BLOCKS = 256
_LEVEL = 500
_PATTERNS = 512
_SEED = 952


def run_bounds(flags: Array) -> Array:
    """Beginnings and ends (not included) of the runs of true flags, (g, 2)."""
    edge = np.flatnonzero(flags[1:] != flags[:-1]) + 1
    ends = [[0] if flags[0] else [], edge, [flags.size] if flags[-1] else []]
    return np.concatenate(ends).astype(np.int64).reshape(-1, 2)


def runs(flags: Array) -> list[tuple[int, int]]:
    """Beginnings and ends (not included) of the runs of true flags."""
    return [(begin, end) for begin, end in run_bounds(flags).tolist()]


def usable(values: Array) -> slice:
    """The longest part of a record whose gaps are short and few enough to be bridged.

    Parameters
    ----------
    values : (n,) array
        NaN where missing.

    Returns
    -------
    slice
        Begins and ends with a sample. Either no gap in it is longer than 16 samples or half a percent of the record,
        and no more than 5 % are missing; or it is the longest stretch without any gap. Empty if there is no sample.
    """
    good = np.isfinite(values)
    if good.all():
        return slice(0, values.size)
    most = max(SHORT, int(LONGEST * values.size))
    ends = [0, *(k for gap in runs(~good) if gap[1] - gap[0] > most for k in gap), values.size]
    parts = runs(good)
    for begin, end in zip(ends[::2], ends[1::2], strict=True):
        inside = np.flatnonzero(good[begin:end])
        if inside.size:
            first, last = begin + int(inside[0]), begin + int(inside[-1]) + 1
            if inside.size >= (1.0 - MOST) * (last - first):
                parts.append((first, last))
    begin, end = max(parts, key=lambda part: part[1] - part[0], default=(0, 0))
    return slice(begin, end)


def bridge_short(values: Array) -> None:
    """Fill gaps of up to 16 samples, in place; the first and the last sample are there.

    Gaps with the same samples around them share one solution.
    """
    bounds = run_bounds(~np.isfinite(values))
    bounds = bounds[bounds[:, 1] - bounds[:, 0] <= SHORT]
    if not bounds.size:
        return
    covariance = _autocovariance(values, 2 * _REACH + SHORT)
    # Levels and expectations first: what is filled must not be taken for data at the next gap.
    level = np.empty(len(bounds))
    _levels(values, bounds, _LEVEL, level)
    width = bounds[:, 1] - bounds[:, 0]
    start = np.cumsum(width) - width
    drawn = np.random.default_rng(_SEED).standard_normal(int(width.sum()))
    filled = np.empty(drawn.size)
    for size in np.unique(width).tolist():
        chosen = np.flatnonzero(width == size)
        # What is beyond an end of the record, or missing itself, is not known.
        around = _around(values, bounds[chosen], level[chosen])
        known, which = np.unique(np.isfinite(around), axis=0, return_inverse=True)
        order = np.argsort(which.ravel(), kind="stable")
        edge = np.searchsorted(which.ravel()[order], np.arange(0, len(known) + _PATTERNS, _PATTERNS))
        for first, begin, end in zip(range(0, len(known), _PATTERNS), edge[:-1], edge[1:], strict=True):
            weight, root = _conditional(covariance, known[first : first + _PATTERNS], size)
            for part in range(begin, end, _PATTERNS):
                some = order[part : min(part + _PATTERNS, end)]
                at = start[chosen[some], None] + np.arange(size)
                own = which.ravel()[some] - first
                expected = np.einsum("gij,gj->gi", weight[own], np.nan_to_num(around[some]))
                scatter = np.einsum("gij,gj->gi", root[own], drawn[at])
                filled[at] = level[chosen[some], None] + expected + scatter
    values[np.repeat(bounds[:, 0] - start, width) + np.arange(drawn.size)] = filled


def _around(values: Array, bounds: Array, level: Array) -> Array:
    """The 16 samples before and the 16 after each of some gaps of one length, less its level; NaN where unknown."""
    where = np.concatenate([np.arange(-_REACH, 0) + bounds[:, :1], np.arange(_REACH) + bounds[:, 1:]], axis=1)
    inside = (where >= 0) & (where < values.size)
    return np.where(inside, values[np.clip(where, 0, values.size - 1)], np.nan) - level[:, None]


def _conditional(covariance: Array, known: Array, size: int) -> tuple[Array, Array]:
    """Weights (p, size, 32) of the samples around a gap, 0 where not known (p, 32), and roots of what remains."""
    place = np.concatenate([np.arange(-_REACH, 0), size + np.arange(_REACH)])
    wanted = np.arange(size)
    seen = covariance[np.abs(np.subtract.outer(place, place))] + 1e-9 * covariance[0] * np.eye(place.size)
    # Those that are not known are put apart as variables of their own.
    seen = np.where(known[:, :, None] & known[:, None, :], seen, covariance[0] * np.eye(place.size))
    cross = np.where(known[:, None, :], covariance[np.abs(np.subtract.outer(wanted, place))], 0.0)
    weight = np.linalg.solve(seen, cross.swapaxes(1, 2)).swapaxes(1, 2)
    rest = covariance[np.abs(np.subtract.outer(wanted, wanted))] - weight @ cross.swapaxes(1, 2)
    variance, vectors = np.linalg.eigh(rest)
    # The symmetric root: the signs of the vectors, and so the draw, would depend on the library.
    return weight, (vectors * np.sqrt(np.maximum(variance, 0.0))[:, None, :]) @ vectors.swapaxes(1, 2)


def _autocovariance(values: Array, lags: int) -> Array:
    """Biased autocovariance up to a lag, from blocks spread over the record, the mean of each removed."""
    size = min(_BLOCK, values.size)
    begins = np.unique(np.linspace(0, values.size - size, _BLOCKS).astype(np.int64))
    total, samples = np.zeros(lags + 1), 0
    for begin in begins:
        block = values[begin : begin + size]
        good = np.isfinite(block)
        if np.count_nonzero(good) < size // 2:
            continue
        block = np.where(good, block - np.mean(block[good]), 0.0)
        pairs = np.array([np.count_nonzero(good[k:] & good[: size - k]) for k in range(lags + 1)])
        products = np.array([block[k:] @ block[: size - k] for k in range(lags + 1)])
        total += products * (size - np.arange(lags + 1)) / np.maximum(pairs, 1)
        samples += size
    return total / max(samples, 1)


@njit(cache=True, error_model="numpy")
def _levels(values, gaps, reach, out):
    """Mean of the samples within a reach on each side of each gap. No checks are made."""
    for j in range(gaps.shape[0]):
        total, many = 0.0, 0
        for k in range(max(0, gaps[j, 0] - reach), min(values.size, gaps[j, 1] + reach)):
            if values[k] == values[k]:
                total += values[k]
                many += 1
        out[j] = total / many


def bridge_long(values: Array, gaps: list[tuple[int, int]], width: int, simulate: Callable[[int], Array]) -> None:
    """Fill, or fill again, longer gaps in place.

    Parameters
    ----------
    values : (n,) array
    gaps : list of (int, int)
    width : int
        Samples on each side that tell the level best: the averaging time at which the Allan deviation is lowest. No
        more than are missing are taken.
    simulate : callable
        Samples of the noise found so far, of a given number.
    """
    missing = np.zeros(values.size, dtype=bool)
    for a, b in gaps:
        missing[a:b] = True
    for a, b in gaps:
        reach = min(width, b - a)
        begin, end = max(0, a - reach), min(values.size, b + reach)
        before, after = ~missing[begin:a], ~missing[b:end]
        drawn = simulate(end - begin)
        drawn_gap, drawn_line = (
            drawn[a - begin : b - begin],
            _line(drawn[: a - begin], drawn[b - begin :], before, after, b - a),
        )
        values[a:b] = _line(values[begin:a], values[b:end], before, after, b - a) + drawn_gap - drawn_line


def _line(left: Array, right: Array, before: Array, after: Array, size: int) -> Array:
    """Straight line across a gap through the means of the samples on each side."""
    where_left = np.mean(np.flatnonzero(before) - float(left.size))
    where_right = np.mean(np.flatnonzero(after) + float(size))
    low, high = float(np.mean(left[before])), float(np.mean(right[after]))
    return low + (high - low) * (np.arange(size) - where_left) / (where_right - where_left)


def simulator(terms: dict[str, float], noise: Flicker, dt: float) -> Callable[[int], Array]:
    """Draws of samples of a sum of noise terms.

    Parameters
    ----------
    terms : dict
        Coefficients Q, N, B, K, GM and GM_tau of those that are there.
    noise : Flicker
    dt : float [s]
    """
    from scipy.signal import lfilter

    rng = np.random.default_rng(_SEED + 1)
    processes = []
    if "B" in terms:
        processes += [(terms["B"] * math.sqrt(noise.variance), float(tau)) for tau in noise.tau]
    if "GM" in terms:
        processes.append((terms["GM"], terms["GM_tau"]))

    def draw(count: int) -> Array:
        values = terms.get("N", 0.0) / math.sqrt(dt) * rng.standard_normal(count)
        values += np.diff(terms.get("Q", 0.0) / dt * rng.standard_normal(count + 1))
        values += terms.get("K", 0.0) * math.sqrt(dt) * np.cumsum(rng.standard_normal(count))
        for sd, tau in processes:
            decay = math.exp(-dt / tau)
            drive = sd * math.sqrt(-math.expm1(-2.0 * dt / tau)) * rng.standard_normal(count)
            drive[0] = sd * rng.standard_normal()
            values += lfilter([1.0], [1.0, -decay], drive)
        return values

    return draw
