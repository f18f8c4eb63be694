"""One measurement as the filter takes it in: gate, update of the covariance and correction in one compiled call."""

from __future__ import annotations

from navfuse.core.fused import fused
from navfuse.core.kalman import update
from navfuse.data.nav_state import apply_correction


def room(d: int, n: int) -> int:
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
def take(nav, s, rates, x, P, offsets, ecef, open_loop, z, H, R, limit, held, numbers):
    """Use a measurement, if it passes the gate.

    Parameters
    ----------
    nav, s, rates, x, P : arrays
        Navigation state (10,), estimates of the states after the ninth, rate and specific force (6,), error estimate
        (n,) and covariance (n, n). A measurement that passes corrects all but `x` in a closed loop, `x` and `P` in an
        open one.
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
    d, n = z.size, x.size
    kept_z, S, Sinv, kept_H, K, dx = parts(numbers, d, n)
    for a in range(d):
        kept_z[a] = z[a]
        for i in range(n):
            kept_H[a, i] = H[a, i]
    nis = update(P, H, R, z, limit, held, K, S, Sinv, dx)
    if not nis <= limit:
        return nis
    if open_loop:
        for i in range(n):
            x[i] += dx[i]
    else:
        apply_correction(nav, s, rates, P, dx, offsets, ecef)
    return nis
