"""``navfuse simulate`` and ``navfuse scenarios``: logs with their truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from navfuse.cli.progress import compilation, progress


def simulate(
    scenario: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="A name that `navfuse scenarios` lists, or your own .toml file.")
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of the logs; made if it is not there.")
    ],
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of the errors; default the scenario's own. Same seed, same bytes.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but warnings and errors.")] = False,
) -> None:
    """Simulate a scenario: write its logs, the truth, and a project file for `navfuse run`.

    Writes imu.parquet, gnss.csv, a table for every other sensor, truth.parquet and project.toml.
    """
    with compilation(quiet), progress(quiet) as tell:
        from navfuse.scenario_files import PROJECT_FILE, TRUTH_FILE, describe, simulate_scenario

        logs = simulate_scenario(scenario, output, seed, progress=tell)
    if not quiet:
        for line in describe(logs, output):
            print(line)
        print(f"next: navfuse run {output / PROJECT_FILE} -o {output / 'out'}")
        print(f"then: navfuse compare {output / 'out'} {output / TRUTH_FILE}")


def scenarios(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Print the file of this scenario.")] = None,
) -> None:
    """List the scenarios that come along, or print one to copy and change."""
    from navfuse.simulation.scenario import load_scenario, scenario_names, scenario_text

    if name is not None:
        print(scenario_text(name), end="")
        return
    names = scenario_names()
    width = max(map(len, names))
    for entry in names:
        print(f"{entry:<{width}}  {load_scenario(entry).title}")
    print("navfuse scenarios NAME prints the file of one; navfuse simulate NAME -o DIR runs it")
