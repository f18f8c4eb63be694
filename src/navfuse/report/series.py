"""What the page and the figures draw: local coordinates, thinned curves, stretches without a fix, withheld windows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from navfuse.analysis.interpolation import ned_axes
from navfuse.core.earth import geodetic_to_ecef_batch
from navfuse.data.logs import GnssLog
from navfuse.data.result import Innovations, Result
from navfuse.data.trajectory import Trajectory

Array = np.ndarray

NAMES = {"forward": "filter", "smoothed": "smoother", "truth": "truth"}
POSITION_SOURCE = "gnss_position"
STEP_S = 1.0
STANDING_MPS = 0.2


class Window(NamedTuple):
    """A stretch of time [s], with the largest horizontal innovation [m] in it (NaN where there was none)."""

    start: float
    end: float
    largest_m: float


class Origin(NamedTuple):
    """Origin of the local plane: its ECEF position [m] and the axes C_en (3, 3) there."""

    r_e: Array
    C_en: Array


def origin_of(trajectory: Trajectory) -> Origin:
    """Local plane at the first epoch of a trajectory."""
    first = slice(0, 1)
    r_e = _ecef(trajectory.lat[first], trajectory.lon[first], trajectory.height[first])
    return Origin(r_e[0], ned_axes(trajectory.lat[first], trajectory.lon[first])[0])


def east_north(points: Trajectory | GnssLog, origin: Origin) -> Array:
    """East and north (n, 2) [m] of positions in the plane that touches the Earth at the origin.

    The plane leaves the Earth with distance: scale 1e-6 at 9 km, 1e-4 at 90 km. It is for pictures, not for errors.
    """
    local = (_ecef(points.lat, points.lon, points.height) - origin.r_e) @ origin.C_en
    return local[:, 1::-1]


def distance(trajectory: Trajectory) -> float:
    """Length of the path [m], from chords of one second; slower than 0.2 m/s counts as standing."""
    keep = _thin_in_time(trajectory.time, STEP_S)
    r_e = _ecef(trajectory.lat[keep], trajectory.lon[keep], trajectory.height[keep])
    chords = np.linalg.norm(np.diff(r_e, axis=0), axis=1)
    moving = chords > STANDING_MPS * np.diff(trajectory.time[keep])
    return float(chords[moving].sum())


def decimate(values: Array, limit: int) -> Array:
    """Rows to draw so that no spike is lost: the smallest and the largest of every column in equal buckets.

    Parameters
    ----------
    values : (n,) or (n, k) array
        Curves drawn over a common time. NaN (a break in the line) is kept.
    limit : int
        At most so many rows.

    Returns
    -------
    (m,) int array
        Increasing row numbers, m <= limit; the first and the last row are among them. All rows when n <= limit.
    """
    table = values.reshape(values.shape[0], int(np.prod(values.shape[1:])))
    n, k = table.shape
    if n <= limit:
        return np.arange(n)
    picks = 2 * k + int(np.isnan(table).any())
    buckets = max((limit - 2) // picks, 1)
    edges = np.linspace(0, n, buckets + 1).astype(np.int64)
    width = int(np.diff(edges).max())
    rows = np.minimum(edges[:-1, np.newaxis] + np.arange(width), edges[1:, np.newaxis] - 1)
    order = np.arange(buckets)
    found = [np.array([0, n - 1])]
    for column in table.T:
        bucket = column[rows]
        missing = np.isnan(bucket)
        found.append(rows[order, np.argmin(np.where(missing, np.inf, bucket), axis=1)])
        found.append(rows[order, np.argmax(np.where(missing, -np.inf, bucket), axis=1)])
    if picks > 2 * k:
        gap = np.isnan(table).max(axis=1)[rows]
        found.append(rows[order, np.argmax(gap, axis=1)][gap.any(axis=1)])
    return np.unique(np.concatenate(found))


def thin(count: int, limit: int) -> Array:
    """At most `limit` row numbers of `count`, evenly spread, first and last among them; for clouds of points."""
    return np.arange(count) if count <= limit else np.unique(np.linspace(0, count - 1, limit).astype(np.int64))


def break_wraps(angle: Array, period: float) -> Array:
    """Copy of an angle curve with NaN where it jumps over half a period, so that no line crosses the plot."""
    broken = np.array(angle, dtype=np.float64)
    broken[1:][np.abs(np.diff(angle)) > 0.5 * period] = np.nan
    return broken


def gaps(result: Result) -> list[Window]:
    """Stretches without a used position fix: longer than three usual intervals and than two seconds, longest first.

    The time before the first and after the last used fix counts too. Without any used fix it is the whole run.
    """
    records = result.innovations.of(POSITION_SOURCE)
    used = records.time[np.isin(records.status, ("used", "reset"))]
    span = result.forward.time[[0, -1]]
    edges = np.concatenate((span[:1], np.clip(used, *span), span[1:]))
    lengths = np.diff(edges)
    usual = float(np.median(np.diff(used))) if used.size > 1 else 0.0
    found = np.flatnonzero(lengths > max(3.0 * usual, 2.0))
    windows = [Window(float(edges[k]), float(edges[k + 1]), float("nan")) for k in found]
    return sorted(windows, key=lambda window: window.start - window.end)


def withheld_windows(innovations: Innovations) -> list[Window]:
    """Runs of consecutive withheld position fixes, each with the filter's largest horizontal difference from them."""
    records = innovations.of(POSITION_SOURCE)
    withheld = (records.status == "withheld").astype(np.int8)
    turns = np.diff(np.concatenate(([0], withheld, [0])))
    windows = []
    for start, end in zip(np.flatnonzero(turns == 1), np.flatnonzero(turns == -1), strict=True):
        horizontal = np.hypot(records.z[start:end, 0], records.z[start:end, 1])
        largest = float(np.nanmax(horizontal)) if np.isfinite(horizontal).any() else float("nan")
        windows.append(Window(float(records.time[start]), float(records.time[end - 1]), largest))
    return windows


def excluded_windows(innovations: Innovations) -> list[tuple[float, float]]:
    """The withheld windows [from, to) [s], as statistics leave them out."""
    return [(window.start, float(np.nextafter(window.end, np.inf))) for window in withheld_windows(innovations)]


def fix_status(result: Result) -> Array | None:
    """Status (n,) of every GNSS fix as a position, "unused" where the filter never saw it; None without fixes."""
    if result.fixes is None:
        return None
    records = result.innovations.of(POSITION_SOURCE)
    status = np.full(result.fixes.time.size, "unused", dtype="U8")
    status[records.row] = records.status
    return status


def _ecef(lat: Array, lon: Array, height: Array) -> Array:
    return geodetic_to_ecef_batch(*(np.ascontiguousarray(array) for array in (lat, lon, height)))


def _thin_in_time(time: Array, step: float) -> Array:
    """Rows at least about `step` apart: the first in every interval of that length, and the last."""
    slot = np.floor((time - time[0]) / step + 1e-9).astype(np.int64)
    first = np.concatenate(([True], np.diff(slot) > 0))
    first[-1] = True
    return np.flatnonzero(first)
