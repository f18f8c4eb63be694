"""Speed of a Monte Carlo campaign: filter epochs per second on all cores, with and without the simulation.

Runs of one minute at 100 Hz with 15 states, corrected by position and velocity at 1 Hz. The first figure is that of
``navfuse montecarlo`` after start-up. The others are of one process, best of many runs, times the number of cores: what
the machine could do if nothing else ran on it.
"""

from __future__ import annotations

import os
from time import perf_counter

from rich.console import Console
from rich.table import Table

from navfuse.montecarlo.campaign import run_campaign
from navfuse.montecarlo.recipes import SimulatedRecipe
from navfuse.montecarlo.single import run_case

RUNS = 1000
BEST_OF = 300


def main() -> None:
    """Measure and print."""
    recipe = SimulatedRecipe("car", duration=60.0, imu_rate=100.0, scale_states=False)
    cores = os.cpu_count() or 1
    table = Table(title=f"Monte Carlo, 15 states, 100 Hz, position and velocity at 1 Hz, {cores} cores")
    for name in ("", "million epochs per second"):
        table.add_column(name)
    table.add_row(f"campaign of {RUNS} runs", f"{run_campaign(recipe, RUNS).throughput / 1e6:.2f}")
    whole, filtering = [], []
    for seed in range(BEST_OF):
        begin = perf_counter()
        case = recipe(seed)
        middle = perf_counter()
        samples = run_case(case, seed).samples
        end = perf_counter()
        whole.append((end - begin) / samples)
        filtering.append((end - middle) / samples)
    table.add_row(f"best of {BEST_OF} runs, simulation included, times {cores}", f"{1e-6 * cores / min(whole):.2f}")
    table.add_row(f"the same without simulation, times {cores}", f"{1e-6 * cores / min(filtering):.2f}")
    Console().print(table)


if __name__ == "__main__":
    main()
