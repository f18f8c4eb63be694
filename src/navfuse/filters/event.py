"""What the filter does at an event, in one compiled call for each measurement and one at the end.

A call costs about as much for its arrays as for the work inside, so all that a filter of n states carries from
increment to increment lies in one array: the navigation state nav (10,), the estimates s (n - 9,) of the states after
the ninth, the error estimate x (n,) and the covariance P (n, n).
"""

from __future__ import annotations

from math import isqrt

import numpy as np

from navfuse.core.fused import fused
from navfuse.core.kalman import update
from navfuse.data.nav_state import apply_correction

Array = np.ndarray


def carrier(n: int) -> Array:
    """Zeros for all that a filter of n states carries; see :func:`split`."""
    return np.zeros((n + 1) ** 2)


def split(carried: Array) -> tuple[Array, Array, Array, Array]:
    """Views nav (..., 10), s (..., n - 9), x (..., n) and P (..., n, n) of what a filter carries; P a copy if there are
    several.
    """
    n = isqrt(carried.shape[-1]) - 1
    P = carried[..., 2 * n + 1 :]
    return (
        carried[..., :10],
        carried[..., 10 : n + 1],
        carried[..., n + 1 : 2 * n + 1],
        P.reshape(*P.shape[:-1], n, n),
    )


@fused
def room(d, n):
    """How many numbers :func:`take` leaves behind for d values and n states."""
    return d * (1 + 2 * d + 2 * n) + n


@fused
def parts(numbers, d, n):
    """What :func:`take` left behind, as views: z (d,), S (d, d), its inverse (d, d), H (d, n), K (n, d) and the
    correction (n,). No checks are made.
    """
    a = d + d * d
    b = a + d * d
    c = b + d * n
    e = c + n * d
    return (
        numbers[:d],
        numbers[d:a].reshape((d, d)),
        numbers[a:b].reshape((d, d)),
        numbers[b:c].reshape((d, n)),
        numbers[c:e].reshape((n, d)),
        numbers[e : e + n],
    )


@fused
def take(carried, rates, offsets, ecef, open_loop, z, H, R, limit, held, numbers):
    """Use a measurement, if it passes the gate.

    Parameters
    ----------
    carried : array
        A measurement that passes corrects all but x in a closed loop, x and P in an open one.
    rates : (6,) array
        Angular rate [rad/s] and specific force [m/s^2], corrected in a closed loop.
    offsets : (6,) int array
        From :func:`navfuse.data.nav_state.sensor_offsets`.
    ecef, open_loop : bool
    z, H, R : (d,), (d, n), (d, d) arrays
        See :meth:`navfuse.aiding.base.AidingSensor.linearize`.
    limit, held
        The gate and the direction without gain of :func:`navfuse.core.kalman.update`.
    numbers : array
        Receives what a smoother and a record need, in the order of :func:`parts`; K and the correction only of a
        measurement that passes.

    Returns
    -------
    float
        Normalized innovation squared; NaN if its covariance is not positive definite: then nothing is changed.

    Notes
    -----
    No checks are made.
    """
    d, n = H.shape
    x, P = carried[n + 1 : 2 * n + 1], carried[2 * n + 1 :].reshape((n, n))
    kept_z, S, Sinv, kept_H, K, dx = parts(numbers, d, n)
    for a in range(d):
        kept_z[a] = z[a]
        for i in range(n):
            kept_H[a, i] = H[a, i]
    nis = update(P, H, R, z, limit, held, K, S, Sinv, dx)
    if not nis <= limit or nis == np.inf:
        return nis
    if open_loop:
        for i in range(n):
            x[i] += dx[i]
    else:
        apply_correction(carried[:10], carried[10 : n + 1], rates, P, dx, offsets, ecef)
    return nis


@fused
def note(carried, states, time, row, out_time, out_nav, out_x, out_P):
    """Take down what is known after an event.

    Parameters
    ----------
    carried : array
    states : (2, n - 9) array
        Receives the estimates of the states after the ninth and their standard deviations.
    time : float [s]
    row : int
        Row of the output to be filled; negative for none.
    out_time (r,), out_nav (r, 10), out_x (r, n), out_P (r, 9, n) : arrays
        Output as :func:`navfuse.mechanization.propagate.propagate` fills it.

    Returns
    -------
    float
        Sum of the navigation state: not finite if the filter has broken down.

    Notes
    -----
    No checks are made.
    """
    n = states.shape[1] + 9
    x, P = carried[n + 1 : 2 * n + 1], carried[2 * n + 1 :].reshape((n, n))
    for i in range(9, n):
        states[0, i - 9] = carried[i + 1] + x[i]
        states[1, i - 9] = np.sqrt(P[i, i])
    total = 0.0
    for i in range(10):
        total += carried[i]
    if row >= 0:
        out_time[row] = time
        for i in range(10):
            out_nav[row, i] = carried[i]
        for c in range(n):
            out_x[row, c] = x[c]
            for i in range(9):
                out_P[row, i, c] = P[i, c]
    return total
