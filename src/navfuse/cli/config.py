"""``navfuse config``: the project file explained."""

from __future__ import annotations

from typing import Annotated

import typer


def config(
    help_keys: Annotated[
        bool, typer.Option("--help-keys", help="List every key with unit, type, default and meaning instead.")
    ] = False,
    dead_reckoning: Annotated[
        bool, typer.Option("--dead-reckoning", help="For a project without an inertial sensor.")
    ] = False,
) -> None:
    """Print a commented project file to begin with: navfuse config > project.toml."""
    from navfuse import config as project_file

    kind = project_file.DeadReckoningProject if dead_reckoning else project_file.Project
    if not help_keys:
        print(project_file.template(kind), end="")
        return
    import shutil
    import textwrap

    width = max(60, min(110, shutil.get_terminal_size().columns))
    for entry in project_file.help_keys(kind):
        unit = f" [{entry.unit}]" if entry.unit else ""
        default = f"; default {entry.default}" if entry.default not in ("", "required") else ""
        need = "; required" if entry.default == "required" else ""
        print(f"{entry.key}{unit}: {entry.type}{default}{need}")
        print(textwrap.indent(textwrap.fill(entry.description, width, break_on_hyphens=False), "    "))
