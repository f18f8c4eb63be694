"""Speed of the overlapping Allan deviation beside allantools, in one run on the same record.

python -m benchmarks.allan_speed
"""

from __future__ import annotations

import time
from importlib.metadata import version

import allantools
import numpy as np
from rich.console import Console
from rich.table import Table

from navfuse.analysis.allan import deviation

SAMPLES = 10_000_000
REPEATS = 5
RATE = 100.0


def best(work, repeats: int) -> float:
    """Shortest time of several [s]."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


def main() -> None:
    """Measure and print."""
    import numba

    values = np.random.default_rng(0).standard_normal(SAMPLES)
    deviation(values[:10_000], RATE)
    threads = numba.get_num_threads()
    table = Table(title=f"Overlapping Allan deviation of {SAMPLES:g} rates, {threads} threads, shortest time")
    peer = f"allantools {version('allantools')} s"
    for name in ("averaging times", "navfuse s", peer, "ratio", "largest difference"):
        table.add_column(name)
    hundred = np.unique(np.rint(np.geomspace(1, SAMPLES // 3, 100)).astype(np.int64))
    for label, grid in (("octave", 2 ** np.arange(23)), ("100 logarithmic", hundred)):
        ours = best(lambda grid=grid: deviation(values, RATE, grid=grid), REPEATS)
        tau = grid / RATE
        theirs = best(lambda tau=tau: allantools.oadev(values, rate=RATE, data_type="freq", taus=tau), 2)
        found = deviation(values, RATE, grid=grid)
        _, expected, _, _ = allantools.oadev(values, rate=RATE, data_type="freq", taus=tau)
        error = float(np.max(np.abs(found.deviation[: expected.size] / expected - 1.0)))
        table.add_row(label, f"{ours:.3f}", f"{theirs:.2f}", f"{theirs / ours:.1f}", f"{error:.1e}")
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
