from __future__ import annotations

import errno
import subprocess
import sys
import warnings

import pytest
from typer.testing import CliRunner

import navfuse
from navfuse.cli.app import app
from navfuse.errors import AlignmentError, ConfigError, FilterError, InputError, NavfuseWarning, OutputError

COMMANDS = ("run", "demo", "compare", "config")


def program(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "navfuse", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("arguments", [(), *((command,) for command in COMMANDS)])
def test_help(arguments):
    shown = CliRunner().invoke(app, [*arguments, "--help"])
    assert shown.exit_code == 0
    assert shown.output.startswith("Usage: ")


def test_help_names_every_command():
    shown = CliRunner().invoke(app, ["--help"])
    for command in COMMANDS:
        assert f"\n  {command} " in shown.output


def test_program_in_a_process_of_its_own(tmp_path):
    done = program("--version")
    assert (done.returncode, done.stdout, done.stderr) == (0, f"navfuse {navfuse.__version__}\n", "")
    done = program("run", tmp_path / "none.toml", "-o", tmp_path / "out")
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.startswith(f"error: {tmp_path / 'none.toml'}: no such project file")
    assert "Traceback" not in done.stderr


def test_output_into_a_closed_pipe():
    command = f"{sys.executable} -m navfuse config --help-keys | head -n 1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert done.stdout.startswith("imu.file: path")
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    "arguments", [("fly",), ("run",), ("run", "p.toml"), ("compare", "a"), ("config", "--colour"), ()]
)
def test_wrong_usage_ends_with_2(navfuse, arguments):
    code, _, err = navfuse(*arguments)
    assert code == 2
    assert "Usage: " in err
    assert "Traceback" not in err


@pytest.mark.parametrize("error", [InputError, ConfigError, AlignmentError, FilterError, OutputError])
def test_an_error_of_the_data_is_one_message(navfuse, pipeline, project_file, tmp_path, error):
    def fail(*_, **__):
        raise error("imu.csv: [bold]row 7[/bold] is odd")

    pipeline.run_project = fail
    code, out, err = navfuse("run", project_file, "-o", tmp_path / "out", "-q")
    assert (code, out, err) == (1, "", "error: imu.csv: [bold]row 7[/bold] is odd\n")


def test_a_full_disk_is_one_message(navfuse, pipeline, project_file, tmp_path, monkeypatch):
    """Compiled kernels are written by numba, which knows nothing of our errors."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/the/cache")

    def fail(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    pipeline.run_project = fail
    code, out, err = navfuse("run", project_file, "-o", tmp_path / "out", "-q")
    assert (code, out) == (1, "")
    assert err.startswith("error: /the/cache: cannot be written: No space left on device; make room there")
    assert err.count("\n") == 1


def test_another_error_of_the_operating_system_is_a_defect(pipeline, project_file, tmp_path):
    def fail(*_, **__):
        raise OSError(errno.EBADF, "Bad file descriptor")

    pipeline.run_project = fail
    from navfuse.cli.app import main

    with pytest.raises(OSError, match="Bad file descriptor"):
        main(["run", str(project_file), "-o", str(tmp_path / "out"), "-q"])


def test_a_defect_of_the_program_is_not_hidden(pipeline, project_file, tmp_path):
    def fail(*_, **__):
        raise ZeroDivisionError("a defect")

    pipeline.run_project = fail
    from navfuse.cli.app import main

    with pytest.raises(ZeroDivisionError, match="a defect"):
        main(["run", str(project_file), "-o", str(tmp_path / "out"), "-q"])


def test_interruption(navfuse, pipeline, project_file, tmp_path):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    pipeline.run_project = interrupt
    code, out, err = navfuse("run", project_file, "-o", tmp_path / "out", "-q")
    assert (code, out, err) == (130, "", "interrupted\n")


def test_warnings_are_shown_once_each(navfuse, pipeline, project_file, tmp_path, result):
    def warn(*_, **__):
        for text in ("two rows are missing", "two rows are missing", "heading is [uncertain]"):
            warnings.warn(text, NavfuseWarning, stacklevel=1)
        return result

    pipeline.run_project = warn
    code, _, err = navfuse("run", project_file, "-o", tmp_path / "out", "-q")
    assert (code, err) == (0, "warning: two rows are missing\nwarning: heading is [uncertain]\n")


def test_other_warnings_are_left_to_python(navfuse, pipeline, project_file, tmp_path, result):
    def warn(*_, **__):
        warnings.warn("of another library", RuntimeWarning, stacklevel=1)
        return result

    pipeline.run_project = warn
    with pytest.warns(RuntimeWarning, match="of another library"):
        code, _, err = navfuse("run", project_file, "-o", tmp_path / "out", "-q")
    assert (code, err) == (0, "")


def test_showing_warnings_ends_with_the_program(navfuse, pipeline, project_file, tmp_path):
    before = warnings.showwarning
    navfuse("run", project_file, "-o", tmp_path / "out", "-q")
    assert warnings.showwarning is before
