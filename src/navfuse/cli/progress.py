"""Progress of long work: a bar on a terminal, silence in a pipe."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from navfuse import _numba_cache, _warm_up

Report = Callable[[str, float], None]
"""Called with the name of the stage and the fraction of it that is done, 0 to 1."""


@contextmanager
def progress(quiet: bool = False) -> Iterator[Report]:
    """A function to report progress to.

    Parameters
    ----------
    quiet : bool
        Show nothing. So it is, too, where standard error is no terminal.

    Yields
    ------
    Report
        A stage appears when it is first named and stands at its last fraction.
    """
    if quiet or not sys.stderr.isatty():
        yield _nothing
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description:<12}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        tasks = {}

        def report(stage: str, fraction: float) -> None:
            if stage not in tasks:
                tasks[stage] = bar.add_task(stage, total=1.0)
            bar.update(tasks[stage], completed=fraction)

        yield report


@contextmanager
def compilation(quiet: bool = False) -> Iterator[None]:
    """Around everything that needs the kernels: on a first run, say what it waits for and put a second core to work."""
    if not _numba_cache.is_cold():
        yield
        return
    if not quiet:
        print(
            "compiling the numerical kernels, once for this version: about 20 s more ...", file=sys.stderr, flush=True
        )
    with _warm_up.second_core():
        yield


def _nothing(stage: str, fraction: float) -> None:
    pass
