"""All runs of a Monte Carlo campaign, on several cores, the same whatever their number."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from multiprocessing.context import BaseContext
from multiprocessing.synchronize import Event
from time import perf_counter

from navfuse.errors import ConfigError, FilterError, InputError
from navfuse.montecarlo.recipes import Recipe
from navfuse.montecarlo.single import RunRecord, run_case

Progress = Callable[[str, float], None]

MOST_PER_TASK = 8
"""Runs handed to a process at once; after Ctrl-C each process ends the run that it is at."""


@dataclass(frozen=True, eq=False)
class Campaign:
    """The finished runs.

    Attributes
    ----------
    runs : list of RunRecord
        In the order of their seeds.
    failed : dict of int to str
        Seeds whose filter could not go on, and why.
    wanted : int
        How many runs were asked for.
    interrupted : bool
    jobs : int
        Processes that worked.
    seconds : float
        From the first task to the last result, the start of the processes included.
    steady_seconds, steady_samples : float, int
        From the first result on, and the IMU samples filtered in that time: the throughput without start-up.
    """

    runs: list[RunRecord]
    failed: dict[int, str]
    wanted: int
    interrupted: bool
    jobs: int
    seconds: float
    steady_seconds: float
    steady_samples: int

    @property
    def throughput(self) -> float:
        """Filter epochs (IMU samples) per second after start-up, simulation included; NaN if not known."""
        return self.steady_samples / self.steady_seconds if self.steady_samples else float("nan")


def run_campaign(
    recipe: Recipe,
    runs: int,
    *,
    jobs: int | None = None,
    first_seed: int = 0,
    progress: Progress | None = None,
) -> Campaign:
    """Run a recipe for many seeds.

    Parameters
    ----------
    recipe : callable, seed -> Case
        Picklable if `jobs` is not 1.
    runs : int
    jobs : int, optional
        Processes; default as many as there are cores. With 1 everything happens in this process.
    first_seed : int
        Seeds are ``first_seed, first_seed + 1, ...``; the results depend on them alone, not on `jobs`.
    progress : callable, optional
        Called with ``"runs"`` and the fraction done.

    Returns
    -------
    Campaign
        After Ctrl-C those runs that were finished, ``interrupted``; if there were none, the KeyboardInterrupt passes.

    Raises
    ------
    ConfigError
        For a number of runs or jobs below 1, a negative seed, a recipe that cannot be pickled, or whatever the recipe
        raises.
    FilterError
        If every run failed, or a process was ended from outside.
    """
    for name, value, least in (
        ("runs", runs, 1),
        ("jobs", 1 if jobs is None else jobs, 1),
        ("first_seed", first_seed, 0),
    ):
        if value < least:
            raise ConfigError(f"{name} must be at least {least}, not {value}")
    jobs = min(jobs or os.cpu_count() or 1, runs)
    seeds = list(range(first_seed, first_seed + runs))
    collected = _Collection(runs, progress)
    try:
        if jobs == 1:
            for seed in seeds:
                collected.add(_run_seeds(recipe, [seed]))
        else:
            _in_processes(recipe, seeds, jobs, collected)
    except KeyboardInterrupt:
        if not collected.runs:
            raise
        collected.interrupted = True
    return collected.campaign(jobs)


def _in_processes(recipe: Recipe, seeds: list[int], jobs: int, collected: _Collection) -> None:
    try:
        pickle.dumps(recipe)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ConfigError(
            f"the recipe cannot be handed to other processes ({error}); define it at the top level of a module, or use "
            "jobs = 1"
        ) from error
    size = max(1, min(MOST_PER_TASK, len(seeds) // (4 * jobs)))
    tasks = [seeds[at : at + size] for at in range(0, len(seeds), size)]
    context = _clean_context()
    stop = context.Event()
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_begin_work, initargs=(stop,))
    waiting: set[Future[list[RunRecord | tuple[int, str]]]] = set()
    try:
        waiting.update(pool.submit(partial(_run_seeds, recipe), task) for task in tasks)
        for future in as_completed(list(waiting)):
            waiting.discard(future)
            collected.add(future.result())
    except KeyboardInterrupt:
        stop.set()
        pool.shutdown(wait=True, cancel_futures=True)
        for future in waiting:
            if not future.cancelled() and future.exception() is None:
                collected.add(future.result())
        raise
    except BrokenProcessPool as error:
        raise FilterError(
            f"a process of the campaign ended after {len(collected.runs)} runs: most often for want of memory (use "
            'fewer jobs), or because the script that calls it does so outside of `if __name__ == "__main__":`'
        ) from error
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _clean_context() -> BaseContext:
    """Processes that inherit no threads, made of one that has imported what they need where the system can do that."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["navfuse.montecarlo.single"])
    return context


def _begin_work(stop: Event) -> None:
    """Ctrl-C reaches every process of a terminal; the first one decides what happens, and says so by `stop`."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _Worker.stop = stop


class _Worker:
    """What a process of a campaign knows of the campaign."""

    stop: Event | None = None


def _run_seeds(recipe: Recipe, seeds: list[int]) -> list[RunRecord | tuple[int, str]]:
    """Records of some seeds; seed and reason for those whose filter could not go on. Short of some after Ctrl-C."""
    done: list[RunRecord | tuple[int, str]] = []
    for seed in seeds:
        if _Worker.stop is not None and _Worker.stop.is_set():
            break
        case = recipe(seed)
        try:
            done.append(run_case(case, seed))
        except (FilterError, InputError) as error:
            done.append((seed, str(error)))
    return done


class _Collection:
    """What has come back so far."""

    def __init__(self, wanted: int, progress: Progress | None) -> None:
        self.wanted = wanted
        self.progress = progress
        self.runs: dict[int, RunRecord] = {}
        self.failed: dict[int, str] = {}
        self.interrupted = False
        self.began = perf_counter()
        self.first = self.last = self.began
        self.samples = 0

    def add(self, results: list[RunRecord | tuple[int, str]]) -> None:
        now = perf_counter()
        warm = bool(self.runs)
        for result in results:
            if isinstance(result, RunRecord):
                self.runs[result.seed] = result
                self.samples += result.samples * warm
            else:
                self.failed[result[0]] = result[1]
        if not warm:
            self.first = now
        self.last = now
        if self.progress is not None:
            self.progress("runs", (len(self.runs) + len(self.failed)) / self.wanted)

    def campaign(self, jobs: int) -> Campaign:
        if not self.runs:
            seed, reason = min(self.failed.items())
            raise FilterError(f"none of the {len(self.failed)} runs could be finished; seed {seed}: {reason}")
        return Campaign(
            [self.runs[seed] for seed in sorted(self.runs)],
            dict(sorted(self.failed.items())),
            self.wanted,
            self.interrupted,
            jobs,
            self.last - self.began,
            self.last - self.first,
            self.samples,
        )
