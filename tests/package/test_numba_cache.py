from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from navfuse import _numba_cache

KERNEL = """
from numba import njit
from kernels.constant import FACTOR

@njit(cache=True)
def scaled(x):
    return FACTOR * x
"""


@pytest.fixture
def fresh(monkeypatch, tmp_path):
    """No choice made yet, and a cache folder of the test's own."""
    monkeypatch.delenv(_numba_cache.VARIABLE, raising=False)
    monkeypatch.delenv(_numba_cache.OWN_CHOICE, raising=False)
    monkeypatch.setattr(_numba_cache, "user_cache_folder", lambda: tmp_path / "cache")
    monkeypatch.setitem(sys.modules, "numba", type(sys)("numba"))
    sys.modules["numba"].config = type("Config", (), {"CACHE_DIR": ""})
    sys.modules["numba"].__spec__ = None
    monkeypatch.setattr(_numba_cache, "source_key", lambda: "0123456789abcdef-py311")
    return tmp_path / "cache" / "kernels"


@pytest.fixture
def package(tmp_path):
    root = tmp_path / "package"
    (root / "core" / "__pycache__").mkdir(parents=True)
    (root / "cli").mkdir()
    (root / "core" / "maths.py").write_text("A = 1\n")
    (root / "core" / "earth.py").write_text("B = 2\n")
    (root / "cli" / "app.py").write_text("C = 3\n")
    (root / "core" / "__pycache__" / "junk.py").write_text("D = 4\n")
    return root


def test_key_depends_on_content_only(package, tmp_path):
    key = _numba_cache.source_key(package)
    copy = tmp_path / "copy"
    shutil.copytree(package, copy)
    os.utime(copy / "core" / "maths.py", (1, 1))
    assert _numba_cache.source_key(copy) == key
    assert key.endswith(f"-py{sys.version_info.major}{sys.version_info.minor}")


@pytest.mark.parametrize("change", ["edit", "same size", "rename", "add", "move"])
def test_key_notices_every_change_below_the_command_line(package, change):
    key = _numba_cache.source_key(package)
    maths = package / "core" / "maths.py"
    if change == "edit":
        maths.write_text("A = 10\n")
    elif change == "same size":
        stamp = maths.stat().st_mtime
        maths.write_text("A = 7\n")
        os.utime(maths, (stamp, stamp))
    elif change == "rename":
        maths.rename(package / "core" / "algebra.py")
    elif change == "add":
        (package / "core" / "more.py").write_text("")
    else:
        (package / "filters").mkdir()
        maths.rename(package / "filters" / "maths.py")
    assert _numba_cache.source_key(package) != key


def test_key_overlooks_what_no_kernel_depends_on(package):
    key = _numba_cache.source_key(package)
    (package / "cli" / "app.py").write_text("C = 30\n")
    (package / "core" / "__pycache__" / "junk.py").write_text("D = 40\n")
    (package / "notes.txt").write_text("E")
    assert _numba_cache.source_key(package) == key


def test_choice_reaches_numba_and_children(fresh):
    chosen = _numba_cache.configure()
    assert chosen == fresh / "0123456789abcdef-py311"
    assert chosen.is_dir()
    assert os.environ["NUMBA_CACHE_DIR"] == str(chosen)
    assert sys.modules["numba"].config.CACHE_DIR == str(chosen)


def test_the_user_chooses_first(fresh, monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "mine"))
    assert _numba_cache.configure() == tmp_path / "mine"
    assert not fresh.exists()


def test_a_child_of_another_version_chooses_anew(fresh, monkeypatch):
    _numba_cache.configure()
    monkeypatch.setattr(_numba_cache, "source_key", lambda: "fedcba9876543210-py311")
    assert _numba_cache.configure() == fresh / "fedcba9876543210-py311"


def test_a_home_that_cannot_be_written_is_replaced(fresh, monkeypatch, tmp_path):
    fresh.parent.write_text("a file where the folder should be")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    chosen = _numba_cache.configure()
    assert chosen.parent.parent == tmp_path
    assert chosen.parent.stat().st_mode & 0o077 == 0


def test_a_folder_without_write_permission_is_replaced(fresh, monkeypatch, tmp_path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    assert _numba_cache.configure().parent.parent == tmp_path


def test_a_temporary_folder_that_others_can_write_is_not_trusted(fresh, monkeypatch, tmp_path):
    fresh.parent.write_text("a file where the folder should be")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    shared = tmp_path / _numba_cache._temporary().name
    shared.chmod(0o777)
    chosen = _numba_cache.configure()
    assert chosen.parent != shared
    assert chosen.parent.stat().st_mode & 0o077 == 0


def test_a_file_in_place_of_the_temporary_folder(monkeypatch, tmp_path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    taken = _numba_cache._temporary()
    taken.rmdir()
    taken.write_text("")
    assert _numba_cache._temporary() != taken


def test_kernels_unused_for_a_month_are_removed(fresh):
    old, recent, foreign = (fresh / name for name in ("aaaa-py311", "bbbb-py311", "else"))
    for folder in (old, recent, foreign):
        (folder / "inside").mkdir(parents=True)
        (folder / "inside" / "kernel.nbc").write_text("")
    for folder in (old, foreign):
        month = time.time() - 31 * 86400
        os.utime(folder, (month, month))
    chosen = _numba_cache.configure()
    assert not old.exists()
    assert recent.exists()
    assert foreign.exists()
    assert chosen.exists()


def test_use_keeps_kernels_fresh(fresh):
    chosen = _numba_cache.configure()
    os.utime(chosen, (1, 1))
    _numba_cache.configure()
    assert time.time() - chosen.stat().st_mtime < 3600.0


def test_cold_until_something_was_compiled(fresh):
    assert _numba_cache.is_cold()
    chosen = _numba_cache.configure()
    assert _numba_cache.is_cold()
    (chosen / "core_1234").mkdir()
    (chosen / "core_1234" / "earth.radii-20.py311.1.nbc").write_text("")
    assert not _numba_cache.is_cold()


@pytest.mark.parametrize(
    ("platform", "variable", "tail"),
    [("win32", "LOCALAPPDATA", ""), ("linux", "XDG_CACHE_HOME", ""), ("darwin", None, "Library/Caches")],
)
def test_cache_folder_by_operating_system(monkeypatch, tmp_path, platform, variable, tail):
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setenv("HOME", str(tmp_path))
    if variable:
        monkeypatch.setenv(variable, str(tmp_path))
    assert _numba_cache.user_cache_folder() == tmp_path / tail / "navfuse"


def test_cache_folder_without_any_variable(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert _numba_cache.user_cache_folder() == tmp_path / ".cache" / "navfuse"


def test_an_edited_constant_reaches_a_cached_kernel(tmp_path):
    """The reason for all this: with a fixed folder numba would answer 20 the second time."""
    package = tmp_path / "kernels"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "kernel.py").write_text(KERNEL)
    code = (
        "from navfuse import _numba_cache as c; from pathlib import Path; import os; os.environ.pop(c.VARIABLE);"
        f"c.source_key = lambda key=c.source_key(Path({str(package)!r})): key; c.configure();"
        "from kernels.kernel import scaled; print(scaled(10.0))"
    )
    env = {**os.environ, "XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    env["PYTHONDONTWRITEBYTECODE"] = "1"  # byte code goes by whole seconds and size: both edits would look the same
    answers = []
    for factor in (2.0, 3.0):
        (package / "constant.py").write_text(f"FACTOR = {factor}\n")
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=env)
        answers.append(float(done.stdout))
    assert answers == [20.0, 30.0]
    assert len(list(Path(tmp_path, "navfuse", "kernels").iterdir())) >= 2
