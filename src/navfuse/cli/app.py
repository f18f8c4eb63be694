"""The program ``navfuse``: its commands, and how errors and warnings reach the person at the terminal.

Exit codes: 0 done; 1 the data or the settings are at fault, with one message and no traceback; 2 wrong usage of the
command line; 130 interrupted.
"""

from __future__ import annotations

import errno
import os
import sys
import warnings
from typing import Annotated

import typer

from navfuse import __version__
from navfuse.cli import (
    allan,
    compare,
    compare_filters,
    config,
    demo,
    export,
    inspect,
    montecarlo,
    noise,
    plot,
    reproduce,
    run,
    simulate,
)
from navfuse.errors import NavfuseError, NavfuseWarning

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)

app = typer.Typer(
    name="navfuse",
    help="From sensor logs to a trajectory one can trust.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.command("run", short_help="Process a project: IMU and GNSS logs to a trajectory.")(run.run)
app.command("inspect", short_help="Look at logs before a run: formats, units, axes, clocks; draft a project.")(
    inspect.inspect
)
app.command("demo", short_help="Simulate a short drive, process it, show how it went.")(demo.demo)
app.command("compare", short_help="Compare a trajectory with a truth.")(compare.compare)
app.command("compare-filters", short_help="Run a project with several estimators, side by side.")(
    compare_filters.compare_filters
)
app.command("export", short_help="A trajectory for other programs: KML, GPX, GeoJSON, NMEA, SBET, ...")(export.export)
app.command("convert", hidden=True)(export.export)
app.command("plot", short_help="Figures for papers from the folder of a run.")(plot.plot)
app.command("simulate", short_help="Simulate a scenario: logs, truth, project file.")(simulate.simulate)
app.command("scenarios", short_help="List the scenarios that come along.")(simulate.scenarios)
app.command("montecarlo", short_help="Simulate many runs; is the filter as good as it says?")(montecarlo.montecarlo)
app.command("allan", short_help="Noise of a sensor from a log at rest, and the settings for the filter.")(allan.allan)
app.command("noise", short_help="Data sheet figures to [imu] keys, and back.")(noise.noise)
app.command("reproduce", short_help="Run a published system or study again.")(reproduce.reproduce)
app.command("config", short_help="Print a commented project file to begin with.")(config.config)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"navfuse {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and end.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """From sensor logs to a trajectory one can trust."""


def main(arguments: list[str] | None = None) -> None:
    """Run the program and end the process with its exit code.

    Parameters
    ----------
    arguments : list of str, optional
        Command-line arguments; default those of the process.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("always", NavfuseWarning)
        warnings.showwarning = _Warnings(warnings.showwarning)
        try:
            app(arguments, prog_name="navfuse")
        except NavfuseError as error:
            print(f"error: {error}", file=sys.stderr)
            sys.exit(1)
        except OSError as error:
            if error.errno not in _NO_ROOM:
                raise
            place = error.filename or os.environ.get("NUMBA_CACHE_DIR", "the cache of compiled kernels")
            advice = "make room there (NUMBA_CACHE_DIR moves the cache of compiled kernels)"
            print(f"error: {place}: cannot be written: {error.strerror}; {advice}", file=sys.stderr)
            sys.exit(1)
        except KeyboardInterrupt:
            sys.exit(130)
        except SystemExit as ending:
            if ending.code == 130:
                print("interrupted", file=sys.stderr)
            raise


class _Warnings:
    """Shows a warning of navfuse as one line, each text once; leaves all others to Python."""

    def __init__(self, others) -> None:
        self._others = others
        self._seen: set[str] = set()

    def __call__(self, message, category, filename, lineno, file=None, line=None) -> None:
        if not issubclass(category, NavfuseWarning):
            self._others(message, category, filename, lineno, file, line)
        elif str(message) not in self._seen:
            self._seen.add(str(message))
            print(f"warning: {message}", file=sys.stderr)
