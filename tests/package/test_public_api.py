from __future__ import annotations

import subprocess
import sys

import pytest

import navfuse

HEAVY = ("numba", "numpy", "pandas", "scipy", "pyarrow", "plotly", "matplotlib", "pydantic", "pyproj", "rich", "typer")


def modules_after(statement: str) -> set[str]:
    code = f"import sys\n{statement}\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_import_is_cheap():
    assert modules_after("import navfuse").isdisjoint(HEAVY)


def test_the_command_line_imports_nothing_that_computes():
    assert modules_after("import navfuse.cli.app").isdisjoint(set(HEAVY) - {"rich", "typer"})


@pytest.mark.parametrize("name", navfuse.__all__)
def test_public_names_are_there(name):
    assert getattr(navfuse, name) is not None
    assert name in dir(navfuse)


def test_public_names_are_sorted_and_unique():
    assert len(set(navfuse.__all__)) == len(navfuse.__all__)
    assert set(navfuse._HOMES) < set(navfuse.__all__)


def test_unknown_name():
    with pytest.raises(AttributeError, match="module 'navfuse' has no attribute 'proces'"):
        navfuse.proces  # noqa: B018


def test_conventions_are_on_the_front_page():
    for topic in ("Frames", "Units", "Attitude", "Position", "Signs of errors", "Time"):
        assert f"**{topic}.**" in navfuse.__doc__
