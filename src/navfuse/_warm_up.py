"""Compiles the kernels that a run comes to last, in a process of its own, while the run compiles the others.

A first run spends its time in the compiler, which uses one core. :func:`second_core` puts another to work on the way to
the same cache folder. Nothing depends on it: a kernel that is not ready when it is needed is compiled by the run.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress


@contextmanager
def second_core() -> Iterator[None]:
    """Compile in the background meanwhile; what is not done at the end is given up."""
    helper = None
    if sys.executable:
        with suppress(OSError):
            helper = subprocess.Popen(
                [sys.executable, "-m", "navfuse._warm_up"],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
    try:
        yield
    finally:
        if helper is not None:
            helper.terminate()
            helper.wait()


def compile_late_kernels() -> None:
    """Call, on small arrays, the kernels of measurement, correction, output and smoothing."""
    import numpy as np

    from navfuse.aiding.gnss_fix import linearize_position, linearize_velocity
    from navfuse.data.nav_state import describe_rows
    from navfuse.filters.event import carrier, note, room, take
    from navfuse.mechanization.propagate import identity_transition
    from navfuse.smoothers import adjoint, rts

    n, d, rows = 9, 3, 1
    nav = np.array([0.5, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    P, Lam, lam = np.eye(n), np.zeros((n, n)), np.zeros(n)
    H, R, z, x, held = np.zeros((d, n)), np.eye(d), np.zeros(d), np.zeros(n), np.zeros(3)
    navs, xs, Ps, out_x, out_P = nav[None], x[None], P[None], np.empty((rows, 9)), np.empty((rows, 9, 9))
    F, none_x, none_P = identity_transition(n)[None], np.empty((0, 9)), np.empty((0, 9, 9))
    s, rates, offsets, numbers = np.zeros(n - 9), np.zeros(6), np.full(6, -1), np.zeros(room(d, n))
    describe_rows(navs, xs, Ps, False, np.empty((rows, 18)))
    take(carrier(n), rates, offsets, False, False, z, H, R, np.inf, held, numbers)
    note(carrier(n), np.zeros((2, 0)), 0.0, -1, held, navs, xs, Ps)
    linearize_position(nav, False, held, np.ones(6), z, H.copy(), np.zeros((d, d)))
    adjoint.back_across_rows(rows, xs, Ps, F, held, lam, Lam, none_x, none_P, adjoint.tile_space(n))
    rts._back_across_update(numbers, d, True, lam, Lam, np.zeros((n + 13, n)))
    rts._smooth_rows(xs, Ps, lam, Lam, 0, out_x, out_P, np.zeros((n + 13, n)))
    rts._smooth_states(s, x, P, lam, Lam, np.empty(n - 9), np.empty(n - 9))
    rts._drop_direction(held, lam, Lam)
    rts._uncorrelate_direction(held, Ps.copy())
    linearize_velocity(nav, False, held, held, -1, -1, -1, np.ones(6), z, H.copy(), np.zeros((d, d)))


if __name__ == "__main__":
    compile_late_kernels()
