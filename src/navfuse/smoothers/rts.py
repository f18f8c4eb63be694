"""Fixed-interval smoothing in the form of Bryson and Frazier.

The smoothed estimate is that of the Rauch-Tung-Striebel smoother, but no covariance is inverted and no process noise
is needed. Going back in time an adjoint vector and matrix gather what the later measurements say (Bierman 1977,
*Factorization methods for discrete sequential estimation*, ch. X; Bryson and Frazier 1963)::

    across a transition F           lam <- F^T lam
                                    Lam <- F^T Lam F
    across an update (H, K, S, z)   lam <- (I - K H)^T G^T lam - H^T S^-1 z
                                    Lam <- (I - K H)^T G^T Lam G (I - K H) + H^T S^-1 H
    smoothed                        x_s = x - P lam,  P_s = P - P Lam P

with x and P of the filter at that moment and G the change of the attitude error when the estimate was corrected. In a
closed loop x is zero and x_s is applied to the navigation state of the filter.

Memory grows by one checkpoint per event. What lies between two events is propagated once more from the checkpoint,
exactly as the filter did it, and smoothed on the way back.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from navfuse.core.fused import fused
from navfuse.core.rotation import left_jacobian, mat_t_vec
from navfuse.data.nav_state import describe_rows
from navfuse.data.trajectory import Trajectory
from navfuse.errors import ConfigError
from navfuse.filters.event import parts, room, split
from navfuse.filters.navigation_filter import NavigationFilter
from navfuse.filters.record import Checkpoint, trajectory_from_rows
from navfuse.imu.increments import ImuIncrements
from navfuse.mechanization.propagate import TIME_TOLERANCE, identity_transition
from navfuse.smoothers.adjoint import back_across_rows, tile_space

Array = np.ndarray

CHUNK_ROWS = 256


@dataclass(frozen=True, slots=True)
class SmoothedRun:
    """Result of :func:`smooth`.

    Attributes
    ----------
    trajectory : Trajectory
    start : (18,) array
        Smoothed navigation state where the filter began, as :func:`navfuse.data.nav_state.describe_rows` gives it.
    state_time : (m,) array [s]
        Times of the filter's events.
    state_value, state_sd : (m, n - 9) arrays
        Smoothed estimates of the states after the ninth and their standard deviations.
    error : (k, n) array
        Smoothed estimate of the error of what the filter carried (``nav``, ``s``) after the events asked for, in the
        frame of the filter.
    P : (k, n, n) array
        Its covariance.
    """

    trajectory: Trajectory
    start: Array
    state_time: Array
    state_value: Array
    state_sd: Array
    error: Array
    P: Array


@fused
def _smooth_rows(x, P, lam, Lam, row, out_x, out_P, work):
    """Smoothed navigation error and its covariance of one row. `P` (r, 9, n) holds navigation rows. No checks are
    made.
    """
    n = lam.size
    for i in range(9):
        v = x[row, i]
        for c in range(n):
            v -= P[row, i, c] * lam[c]
            work[i, c] = 0.0
        out_x[row, i] = v
        for k in range(n):
            p = P[row, i, k]
            for c in range(n):
                work[i, c] += p * Lam[k, c]
    for i in range(9):
        for j in range(i + 1):
            v = P[row, i, j]
            for c in range(n):
                v -= work[i, c] * P[row, j, c]
            out_P[row, i, j] = v
            out_P[row, j, i] = v


@fused
def _drop_direction(held, lam, Lam):
    """Take out of the adjoint what it says of one direction (3,) of the attitude error. No checks are made."""
    v = held[0] * lam[6] + held[1] * lam[7] + held[2] * lam[8]
    for i in range(3):
        lam[6 + i] -= held[i] * v
    for c in range(lam.size):
        v = held[0] * Lam[6, c] + held[1] * Lam[7, c] + held[2] * Lam[8, c]
        for i in range(3):
            Lam[6 + i, c] -= held[i] * v
    for c in range(lam.size):
        v = held[0] * Lam[c, 6] + held[1] * Lam[c, 7] + held[2] * Lam[c, 8]
        for i in range(3):
            Lam[c, 6 + i] -= held[i] * v


@fused
def _uncorrelate_direction(held, P):
    """Uncorrelate one direction (3,) of the attitude error from all else in rows (r, 9, n) of covariance. No checks."""
    if held[0] == 0.0 and held[1] == 0.0 and held[2] == 0.0:
        return
    for row in range(P.shape[0]):
        variance = 0.0
        for i in range(3):
            for j in range(3):
                variance += held[i] * P[row, 6 + i, 6 + j] * held[j]
        for c in range(P.shape[2]):
            v = held[0] * P[row, 6, c] + held[1] * P[row, 7, c] + held[2] * P[row, 8, c]
            for i in range(3):
                P[row, 6 + i, c] -= held[i] * v
        for r in range(9):
            v = held[0] * P[row, r, 6] + held[1] * P[row, r, 7] + held[2] * P[row, r, 8]
            for i in range(3):
                P[row, r, 6 + i] -= held[i] * v
        for i in range(3):
            for j in range(3):
                P[row, 6 + i, 6 + j] += variance * held[i] * held[j]


@fused
def _back_across_turn(G, lam, Lam):
    """Carry the adjoint to before a correction that made ``d + (G - D) psi`` of a navigation error d with the attitude
    psi, D the columns (9, 3) of the identity that belong to it. No checks are made.
    """
    n = lam.size
    turned = np.empty(3)
    for c in range(3):
        turned[c] = 0.0
        for k in range(9):
            turned[c] += G[k, c] * lam[k]
    for c in range(3):
        lam[6 + c] = turned[c]
    for i in range(n):
        for c in range(3):
            turned[c] = 0.0
            for k in range(9):
                turned[c] += Lam[i, k] * G[k, c]
        for c in range(3):
            Lam[i, 6 + c] = turned[c]
    for i in range(n):
        for c in range(3):
            turned[c] = 0.0
            for k in range(9):
                turned[c] += Lam[k, i] * G[k, c]
        for c in range(3):
            Lam[6 + c, i] = turned[c]


@fused
def _back_across_update(numbers, d, turned, lam, Lam, work):
    """Carry the adjoint from after a measurement update to before it.

    `numbers` is what :func:`navfuse.filters.event.take` left behind of the d values; `turned` tells whether the
    estimate was corrected. An unscented filter leaves behind what its correction did to the navigation error as well.
    No checks are made.
    """
    n = lam.size
    z, _, Sinv, H, K, dx = parts(numbers, d, n)
    if numbers.size > room(d, n):
        _back_across_turn(numbers[room(d, n) :].reshape((9, 3)), lam, Lam)
    elif turned:
        J = left_jacobian((dx[6], dx[7], dx[8]))
        lam[6], lam[7], lam[8] = mat_t_vec(J, (lam[6], lam[7], lam[8]))
        for i in range(n):
            Lam[i, 6], Lam[i, 7], Lam[i, 8] = mat_t_vec(J, (Lam[i, 6], Lam[i, 7], Lam[i, 8]))
        for i in range(n):
            Lam[6, i], Lam[7, i], Lam[8, i] = mat_t_vec(J, (Lam[6, i], Lam[7, i], Lam[8, i]))
    for e in range(d):
        v = 0.0
        for i in range(n):
            v += K[i, e] * lam[i]
        for f in range(d):
            v += Sinv[e, f] * z[f]
        work[0, e] = v
    for i in range(n):
        for e in range(d):
            lam[i] -= H[e, i] * work[0, e]
    for e in range(d):
        for i in range(n):
            v = 0.0
            for j in range(n):
                v += Lam[i, j] * K[j, e]
            work[1 + e, i] = v
    for i in range(n):
        for j in range(n):
            v = Lam[i, j]
            for e in range(d):
                v -= work[1 + e, i] * H[e, j]
            Lam[i, j] = v
    for e in range(d):
        for i in range(n):
            v = 0.0
            for j in range(n):
                v += K[j, e] * Lam[j, i]
            for f in range(d):
                v -= Sinv[e, f] * H[f, i]
            work[1 + e, i] = v
    for i in range(n):
        for j in range(n):
            v = Lam[i, j]
            for e in range(d):
                v -= H[e, i] * work[1 + e, j]
            Lam[i, j] = v
    for i in range(n):
        for j in range(i):
            v = 0.5 * (Lam[i, j] + Lam[j, i])
            Lam[i, j] = v
            Lam[j, i] = v


@fused
def _smooth_states(s, x, P, lam, Lam, value, sd):
    """Smoothed states after the ninth and their deviations. No checks are made."""
    n = lam.size
    for i in range(9, n):
        v = s[i - 9] + x[i]
        var = P[i, i]
        for c in range(n):
            v -= P[i, c] * lam[c]
            u = 0.0
            for k in range(n):
                u += P[i, k] * Lam[k, c]
            var -= u * P[c, i]
        value[i - 9] = v
        sd[i - 9] = np.sqrt(max(var, 0.0))


def smooth(
    filter_: NavigationFilter,
    increments: ImuIncrements,
    progress: Callable[[float], None] | None = None,
    events: Sequence[int] = (),
) -> SmoothedRun:
    """Smooth a finished filter run.

    Parameters
    ----------
    filter_ : NavigationFilter
        After its last increment, with ``settings.checkpoints`` on from the start.
    increments : ImuIncrements
        All increments it was fed since it was made or restored, as one block.
    progress : callable, optional
        Called now and then with the fraction done.
    events : sequence of int
        Numbers of the checkpoints, ascending, at which the whole smoothed error and its covariance are wanted.

    Returns
    -------
    SmoothedRun
        Output at the same times as the filter's.

    Raises
    ------
    ConfigError
        If the filter kept no checkpoints, the increments are others, or `events` are no ascending numbers of
        checkpoints.

    Notes
    -----
    While the filter holds its heading (:class:`~navfuse.filters.heading_hold.HeadingHold`) the covariance at `events`
    is not to be used: it leaves out what dropping the correlations did to the other states.
    """
    record, settings = filter_.record, filter_.settings
    if not record.checkpoints:
        raise ConfigError("smoothing needs a filter that keeps checkpoints: FilterSettings(checkpoints=True)")
    for checkpoint in (record.checkpoints[0], record.checkpoints[-1]):
        at = checkpoint.index
        if at >= increments.time.size or not increments.time[at] - TIME_TOLERANCE <= checkpoint.time:
            raise ConfigError("the increments are not those that the filter was fed, all of them, since its start")
    n = record.layout.size
    lam, Lam, work = np.zeros(n), np.zeros((n, n)), np.zeros((n + 13, n))
    tiles = tile_space(n)
    pool: list[tuple[Array, ...]] = []
    times: list[Array] = []
    pieces: list[Array] = []
    values, deviations, value_times = [], [], []
    numbers = np.asarray(events, dtype=np.int64)
    if numbers.size and (numbers[0] < 0 or numbers[-1] >= len(record.checkpoints) or np.any(np.diff(numbers) <= 0)):
        raise ConfigError(f"events must be ascending numbers of the {len(record.checkpoints)} checkpoints")
    wanted, last = np.zeros(len(record.checkpoints), dtype=bool), len(record.checkpoints) - 1
    wanted[numbers] = True
    errors, covariances = np.empty((len(events), n)), np.empty((len(events), n, n))
    row = len(events)
    end = filter_.time
    boundaries = [c.time for c in record.checkpoints[1:]] + [max(end, increments.time[-1]) + 2 * TIME_TOLERANCE]
    for k, (checkpoint, t_end) in enumerate(zip(reversed(record.checkpoints), reversed(boundaries), strict=True)):
        if progress is not None and k % 200 == 0:
            progress(k / len(boundaries))
        _smooth_stretch(filter_, increments, checkpoint, t_end, lam, Lam, work, tiles, pool, times, pieces)
        value, sd = np.empty(n - 9), np.empty(n - 9)
        _, s, x, P = checkpoint.parts
        _smooth_states(s, x, P, lam, Lam, value, sd)
        value_times.append(checkpoint.time)
        values.append(value)
        deviations.append(sd)
        if wanted[last - k]:
            row -= 1
            errors[row] = x - P @ lam
            covariances[row] = P - P @ Lam @ P
        _drop_direction(checkpoint.held, lam, Lam)
        for update in reversed(checkpoint.updates):
            _back_across_update(update.numbers, update.size, not settings.open_loop, lam, Lam, work)
        _drop_direction(checkpoint.held, lam, Lam)
    if progress is not None:
        progress(1.0)
    trajectory = trajectory_from_rows(times[::-1], pieces[::-1], "smoothed")
    start = _smoothed_row(record.checkpoints[0], lam, Lam, work, settings.ecef)
    return SmoothedRun(
        trajectory,
        start,
        np.array(value_times[::-1]),
        np.array(values[::-1]),
        np.array(deviations[::-1]),
        errors,
        covariances,
    )


def _smooth_stretch(filter_, increments, checkpoint, t_end, lam, Lam, work, tiles, pool, times, pieces) -> None:
    """Propagate again from a checkpoint to `t_end`, then smooth the outputs in between and at the checkpoint, last
    first.
    """
    settings = filter_.settings
    n = lam.size
    period = settings.output_period
    out_next, at_checkpoint = _outputs_from(checkpoint.time, period, increments)
    runs: list[int] = []
    propagator = filter_.propagator
    nav, s, x, P = split(checkpoint.carried.copy())
    F, last = identity_transition(n), np.zeros(6)
    acc = propagator.resume(checkpoint.acc)
    capacity = 0 if period < 0 else CHUNK_ROWS
    at, t = checkpoint.index, checkpoint.time
    while True:
        if len(pool) == len(runs):
            pool.append(propagator.buffers(capacity, transitions=True))
        at, t, out_next, rows = propagator.advance(
            increments, at, t, t_end, nav, s, x, P, F, acc, out_next, pool[len(runs)], last
        )
        runs.append(rows)
        if rows < capacity or capacity == 0:
            break
    nothing = (np.empty((0, 9)), np.empty((0, 9, 9)))
    back_across_rows(1, x[None], P[None, :9], F[None], checkpoint.held, lam, Lam, *nothing, tiles)
    for (time, row_nav, row_x, row_P, row_F), rows in zip(reversed(pool[: len(runs)]), reversed(runs), strict=True):
        if rows:
            x_s, P_s, out = np.empty((rows, 9)), np.empty((rows, 9, 9)), np.empty((rows, 18))
            _uncorrelate_direction(checkpoint.held, row_P[:rows])
            back_across_rows(rows, row_x, row_P, row_F, checkpoint.held, lam, Lam, x_s, P_s, tiles)
            describe_rows(row_nav[:rows], x_s, P_s, settings.ecef, out)
            times.append(time[:rows].copy())
            pieces.append(out)
    if at_checkpoint is not None and t_end > checkpoint.time + TIME_TOLERANCE:
        times.append(np.array([at_checkpoint]))
        pieces.append(_smoothed_row(checkpoint, lam, Lam, work, settings.ecef)[None])


def _smoothed_row(checkpoint: Checkpoint, lam: Array, Lam: Array, work: Array, ecef: bool) -> Array:
    x_s, P_s, out = np.empty((1, 9)), np.empty((1, 9, 9)), np.empty((1, 18))
    nav, _, x, P = checkpoint.parts
    _smooth_rows(x[None], P[None, :9], lam, Lam, 0, x_s, P_s, work)
    describe_rows(nav[None], x_s, P_s, ecef, out)
    return out[0]


def _outputs_from(time: float, period: float, increments: ImuIncrements) -> tuple[int, float | None]:
    """Number of the first output after a checkpoint, and the time of the one due at the checkpoint itself, if any."""
    if period < 0:
        return 0, None
    if period == 0:
        k = int(np.searchsorted(increments.time, time - TIME_TOLERANCE))
        on_stamp = k < increments.time.size and increments.time[k] == time
        return 0, time if on_stamp else None
    number = int(np.ceil(time / period - 1e-9))
    while number * period < time - TIME_TOLERANCE:
        number += 1
    if number * period <= time + TIME_TOLERANCE:
        return number + 1, number * period
    return number, None
