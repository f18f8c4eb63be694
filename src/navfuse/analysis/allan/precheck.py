"""Is a record one of a sensor at rest, and from when to when? Motion, saturation, stuck values, drift."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

Array = np.ndarray

FLOOR = {"gyro": math.radians(0.1), "accel": 0.05}
"""Changes of the mean from one window to the next [rad/s], [m/s^2] that are never called motion."""

STEADY = math.radians(100.0) / 3600.0
"""Differences of the mean rate between two stretches [rad/s] that are never called a steady rotation."""

_SIGMAS = 8.0
_SLOWEST = 3
_NOISE_RATIO = 3.0
_NEIGHBOURS = 30
_SATURATED = 20
CLIPPED = 0.001
"""Share of the samples at the ends of the range beyond which an axis says too little of its noise."""

_COARSE = 0.3
_LEVELS = 30
_TREND = 0.8
_AT_ONCE = 1 << 16
"""Samples that statistics of windows are made of at once, so that they need no memory to speak of."""


@dataclass(frozen=True, slots=True)
class StaticSpan:
    """The longest part of a record at rest.

    Attributes
    ----------
    begin, end : int
        Samples, the last one not included.
    moving : float
        Share of the record that is in motion.
    shaken : float
        Share of the record where the noise stands out, as from steps or a passing lorry, while the sensor stays.
    windows : tuple of (int, int)
        Where it moves: first and last sample of each stretch, at most ten of them.
    """

    begin: int
    end: int
    moving: float
    shaken: float
    windows: tuple[tuple[int, int], ...]


def static_span(channels: list[tuple[str, Array]], rate: float) -> StaticSpan:
    """Find motion.

    The record is cut into windows of a second (a hundred samples, if that is more). It moves where the mean of an axis
    jumps from one window to the next by more than it usually does and by more than a sensor could be blamed for. Slow
    drift is not motion, nor is noise that stands out from that of the windows around: that is shaking. A stretch
    between jumps turns steadily where a gyro's mean is off that of the slowest stretch of three windows or more by
    eight times the scatter of the windows, and by 100 deg/h. A record that turns throughout has nothing to compare
    with.

    Parameters
    ----------
    channels : list of (sensor, (n,) array)
        "gyro" [rad/s] or "accel" [m/s^2]; NaN where missing.
    rate : float [Hz]

    Returns
    -------
    StaticSpan
    """
    n = channels[0][1].size
    width = max(100, round(rate))
    count = n // width
    if count < 4:
        return StaticSpan(0, n, 0.0, 0.0, ())
    moves, shakes = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    gyros = []
    for sensor, values in channels:
        windows = window_statistics(values, width)
        jump, shaken = _moving(windows, FLOOR[sensor])
        moves |= jump
        shakes |= shaken
        if sensor == "gyro":
            gyros.append(np.where(windows.number >= 0.5 * width, windows.mean, np.nan))
    for begin, end in _turning(_true_runs(~moves), gyros):
        moves[begin:end] = True
    shaking = float(np.mean(shakes & ~moves))
    stretches = _true_runs(moves)
    if not stretches:
        return StaticSpan(0, n, 0.0, shaking, ())
    still = _true_runs(~moves)
    if not still:
        return StaticSpan(0, 0, 1.0, 0.0, ((0, n),))
    begin, end = max(still, key=lambda run: run[1] - run[0])
    return StaticSpan(
        begin * width,
        n if end == count else end * width,
        float(np.mean(moves)),
        shaking,
        tuple((a * width, min(b * width, n)) for a, b in stretches[:10]),
    )


@dataclass(frozen=True, slots=True, eq=False)
class WindowStatistics:
    """Windows of equal length of a record.

    Attributes
    ----------
    width : int
        Samples in each; what is left at the end of the record is in none.
    number : (w,) array
        Samples that are there.
    mean, sd : (w,) arrays
        Of these; 0 where there are none.
    """

    width: int
    number: Array
    mean: Array
    sd: Array


def window_statistics(values: Array, width: int) -> WindowStatistics:
    """Number, mean and standard deviation of the samples in each window.

    Parameters
    ----------
    values : (n,) array
        NaN where missing.
    width : int
        Samples in a window, <= n.
    """
    count = values.size // width
    number, mean, sd = np.empty(count), np.empty(count), np.empty(count)
    several = max(1, _AT_ONCE // width)
    for begin in range(0, count, several):
        part = slice(begin, min(begin + several, count))
        windows = values[part.start * width : part.stop * width].reshape(-1, width)
        good = np.isfinite(windows)
        number[part] = good.sum(axis=1)
        many = np.maximum(number[part], 1.0)
        mean[part] = np.where(good, windows, 0.0).sum(axis=1) / many
        sd[part] = np.sqrt(np.where(good, (windows - mean[part, None]) ** 2, 0.0).sum(axis=1) / many)
    return WindowStatistics(width, number, mean, sd)


def _moving(windows: WindowStatistics, floor: float) -> tuple[Array, Array]:
    """Windows of one axis between which the mean jumps, and those whose noise stands out."""
    jumps, shakes = np.zeros(windows.mean.size, dtype=bool), np.zeros(windows.mean.size, dtype=bool)
    known = np.flatnonzero(windows.number >= 0.5 * windows.width)
    if known.size < 4:
        return jumps, shakes
    mean, noise = windows.mean[known], windows.sd[known]
    quiet = float(np.quantile(noise, 0.1))
    step = np.abs(np.diff(mean, prepend=mean[0]))
    usual_step = 1.4826 * float(np.median(step[1:]))
    white = quiet / math.sqrt(windows.width)
    jump = step > max(_SIGMAS * min(usual_step, 5.0 * white + 0.2 * floor), floor)
    jump[:-1] |= jump[1:]
    jumps[known] = jump
    shakes[known] = noise > _NOISE_RATIO * np.minimum(_running_median(noise), _NOISE_RATIO * quiet)
    return jumps, shakes


def _turning(still: list[tuple[int, int]], gyros: list[Array]) -> list[tuple[int, int]]:
    """Stretches without jumps that turn at a steady rate, by the means of the windows of each gyro."""
    if not gyros:
        return []
    rates = np.array(gyros)
    known = np.asarray(np.isfinite(rates).all(axis=0))
    parts = [(run, rates[:, run[0] : run[1]][:, known[run[0] : run[1]]]) for run in still]
    long = [(run, part) for run, part in parts if part.shape[1] >= _SLOWEST]
    if len(long) < 2:
        return []
    slowest = min((part for _, part in long), key=lambda part: float(np.linalg.norm(part.mean(axis=1))))
    turning = []
    for run, part in long:
        scatter = np.hypot(part.std(axis=1), slowest.std(axis=1))
        off = np.abs(part.mean(axis=1) - slowest.mean(axis=1))
        if (off > np.maximum(_SIGMAS * scatter, STEADY)).any():
            turning.append(run)
    return turning


def _running_median(values: Array) -> Array:
    from scipy.ndimage import median_filter

    return median_filter(values, size=min(2 * _NEIGHBOURS + 1, values.size), mode="nearest")


def _true_runs(flags: Array) -> list[tuple[int, int]]:
    edge = np.diff(flags.astype(np.int8), prepend=np.int8(0), append=np.int8(0))
    return list(zip(np.flatnonzero(edge == 1).tolist(), np.flatnonzero(edge == -1).tolist(), strict=True))


@dataclass(frozen=True, slots=True)
class ChannelCheck:
    """What is odd about one axis.

    Attributes
    ----------
    constant : bool
        All values are equal.
    step : float
        Smallest difference of two values, the resolution of the output; 0 if they are not on a grid.
    stuck : tuple of (int, int)
        First and last sample of the longest run of equal values, if it is longer than chance allows.
    held : tuple of (int, int)
        First and last sample of every run that is so long, where the output is fine enough to change at nearly every
        sample otherwise: what follows the first one was not measured.
    saturated : int
        Samples at the largest or smallest value, if they pile up there.
    clipped : bool
        Whether they are more than :data:`CLIPPED` of all: the noise is larger than what is seen of it.
    trend : float
        Change along the record of a straight line, unit of the values.
    drifts : bool
        Whether that line explains most of what the means of the windows do: it is warm-up or drift, not noise.
    """

    constant: bool
    step: float
    stuck: tuple[int, int] | None
    held: tuple[tuple[int, int], ...]
    saturated: int
    clipped: bool
    trend: float
    drifts: bool


def check_channel(values: Array, rate: float) -> ChannelCheck:
    """Look for a constant, stuck, saturated or drifting axis.

    Parameters
    ----------
    values : (n,) array
        NaN where missing.
    rate : float [Hz]
    """
    finite = np.isfinite(values)
    good = values if finite.all() else values[finite]
    if good.size < 2 or np.ptp(good) == 0.0:
        return ChannelCheck(True, 0.0, None, (), 0, False, 0.0, False)
    trend, drifts = _trend(values, rate)
    runs, coarse = _stuck(values, good.size)
    longest = max(runs, key=lambda run: run[1] - run[0], default=None)
    saturated = _saturated(good)
    return ChannelCheck(
        False, resolution(good), longest, () if coarse else tuple(runs), saturated, saturated > CLIPPED * good.size,
        trend, drifts,
    )  # fmt: skip


def without_held(values: Array, check: ChannelCheck) -> Array:
    """A record with NaN where it was stuck: a copy, or the record itself where it never was."""
    if not check.held:
        return values
    copy = values.copy()
    for first, last in check.held:
        copy[first + 1 : last + 1] = np.nan
    return copy


def resolution(values: Array) -> float:
    """Step between neighbouring output values; 0 where the values are not multiples of one.

    Parameters
    ----------
    values : (n,) array
        Without NaN.
    """
    levels = np.unique(values[:100_000])
    gaps = np.diff(levels)
    scale = float(np.max(np.abs(levels)))
    gaps = gaps[gaps > 1e-6 * scale]
    if gaps.size == 0:
        return 0.0
    step = float(np.min(gaps))
    step = float(np.mean(gaps[gaps < 1.5 * step]))
    ratio = gaps / step
    on_grid = np.abs(ratio - np.rint(ratio)) < 0.05 * np.maximum(1.0, ratio * 0.02)
    return step if levels.size < 0.2 * min(values.size, 100_000) and np.mean(on_grid) > 0.9 else 0.0


def _stuck(values: Array, known: int) -> tuple[list[tuple[int, int]], bool]:
    """Runs of equal values that chance would not make, and whether the output repeats itself often without them.

    They are longer than ten times what independent values would show.
    """
    same = values[1:] == values[:-1]
    share = min(float(np.count_nonzero(same)) / (known - 1), 0.98)
    expected = math.log(known) / -math.log(share) if share > 0.0 else 1.0
    runs = [run for run in _true_runs(same) if run[1] - run[0] > 3.0 * expected + 10.0]
    inside = sum(end - begin for begin, end in runs)
    others = (np.count_nonzero(same) - inside) / max(known - 1 - inside, 1)
    return runs, bool(others > _COARSE)


def _saturated(values: Array) -> int:
    """Samples that pile up at an end of the range, instead of thinning out towards it."""
    if np.unique(values[:100_000]).size < _LEVELS:
        return 0
    total = 0
    for top, inner, inside in (
        (values.max(), np.max, np.less),
        (values.min(), np.min, np.greater),
    ):
        at_top = int(np.count_nonzero(values == top))
        if at_top < _SATURATED or at_top == values.size:
            continue
        outermost = -math.inf if inside is np.less else math.inf
        next_one = inner(values, where=inside(values, top), initial=outermost)
        if at_top > 2 * int(np.count_nonzero(values == next_one)):
            total += at_top
    return total


def _trend(values: Array, rate: float) -> tuple[float, bool]:
    """Change along a straight line through the means of a hundred windows, and whether it explains most of them."""
    count = 100
    width = values.size // count
    if width < 2:
        return 0.0, False
    windows = window_statistics(values[: count * width], width)
    known = windows.number > 0.5 * width
    if np.count_nonzero(known) < 10:
        return 0.0, False
    mean = windows.mean[known]
    where = (np.arange(count) + 0.5)[known] / count - 0.5
    slope = float(where @ (mean - mean.mean()) / (where @ where))
    explained = slope**2 * float(where @ where) / float(np.sum((mean - mean.mean()) ** 2) or 1.0)
    return slope, explained > _TREND
