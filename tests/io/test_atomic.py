from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path

import pytest

from navfuse.errors import InputError, OutputError
from navfuse.io.atomic import atomic_file, atomic_folder, check_folder

ANY_ERROR = pytest.mark.parametrize("error", [KeyboardInterrupt(), InputError("bad row"), RuntimeError("x")])


def tree(folder):
    return {str(path.relative_to(folder)): path.read_text() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_file_appears_at_the_end(tmp_path):
    path = tmp_path / "out.csv"
    path.write_text("old")
    with atomic_file(path) as part:
        assert part.parent == tmp_path
        assert part.suffix == ".csv"
        part.write_text("new")
        assert path.read_text() == "old"
    assert tree(tmp_path) == {"out.csv": "new"}


def write_file(path, error):
    with atomic_file(path) as part:
        part.write_text("half")
        raise error


def write_folder(path, error, names=("forward.csv",), stale=()):
    with atomic_folder(path, stale) as part:
        for name in names:
            (part / name).write_text("half")
        raise error


@ANY_ERROR
def test_file_stays_as_it_was_when_the_block_fails(tmp_path, error):
    path = tmp_path / "out.csv"
    path.write_text("old")
    with pytest.raises(type(error)):
        write_file(path, error)
    assert tree(tmp_path) == {"out.csv": "old"}


def test_full_disk(tmp_path):
    with pytest.raises(OutputError, match=r"out\.csv: cannot be written: No space left on device"):
        write_file(tmp_path / "out.csv", OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    assert tree(tmp_path) == {}


def test_file_in_a_missing_folder(tmp_path):
    with pytest.raises(OutputError, match=r"the folder '.*no' has to exist"):
        write_file(tmp_path / "no" / "out.csv", RuntimeError())


def test_file_that_is_a_folder(tmp_path):
    with pytest.raises(OutputError, match="is a folder, not a file"), atomic_file(tmp_path):
        pass


def test_output_error_of_the_block_passes(tmp_path):
    with pytest.raises(OutputError, match="^inner$"):
        write_file(tmp_path / "out.csv", OutputError("inner"))


def test_new_folder(tmp_path):
    path = tmp_path / "a" / "b" / "run"
    with atomic_folder(path) as part:
        (part / "x.csv").write_text("1")
        assert not path.exists()
    assert tree(tmp_path) == {"a/b/run/x.csv": "1"}
    assert path.stat().st_mode & 0o777 == 0o777 & ~_umask()


def _umask():
    mask = os.umask(0)
    os.umask(mask)
    return mask


def test_relative_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with atomic_folder("run") as part:
        (part / "x").write_text("1")
    with atomic_folder(".") as part:
        (part / "y").write_text("2")
    assert tree(tmp_path) == {"run/x": "1", "y": "2"}


@ANY_ERROR
def test_new_folder_does_not_appear_when_the_block_fails(tmp_path, error):
    with pytest.raises(type(error)):
        write_folder(tmp_path / "a" / "run", error)
    assert list(tmp_path.iterdir()) == []


def test_made_parents_stay_if_something_else_went_into_them(tmp_path):
    with pytest.raises(InputError):
        write_folder(tmp_path / "a" / "run", InputError(), names=("../other",))
    assert tree(tmp_path) == {"a/other": "half"}


@pytest.fixture
def earlier(tmp_path):
    """A folder with an earlier result and a file of the user's."""
    folder = tmp_path / "run"
    folder.mkdir()
    for name in ("forward.csv", "smoothed.csv", "mine.txt"):
        (folder / name).write_text("old")
    (folder / "figures").mkdir()
    (folder / "figures" / "a.png").write_text("old")
    return folder


def test_existing_folder(earlier):
    with atomic_folder(earlier, stale=("smoothed.csv", "never.csv")) as part:
        (part / "forward.csv").write_text("new")
        (part / "figures").mkdir()
        (part / "figures" / "b.png").write_text("new")
        assert tree(earlier)["forward.csv"] == "old"
    assert tree(earlier) == {"forward.csv": "new", "mine.txt": "old", "figures/b.png": "new"}


@ANY_ERROR
def test_existing_folder_stays_when_the_block_fails(earlier, error):
    before = tree(earlier)
    with pytest.raises(type(error)):
        write_folder(earlier, error, stale=("smoothed.csv",))
    assert tree(earlier) == before
    assert not any(path.name.startswith(".") for path in earlier.iterdir())


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(errno.EIO, "Input/output error")])
@pytest.mark.parametrize("fails_at", range(1, 7))
def test_earlier_result_is_put_back_when_the_moving_fails(earlier, monkeypatch, fails_at, error):
    before = tree(earlier)
    calls = 0
    replace = os.replace

    def failing(source, target):
        nonlocal calls
        calls += 1
        if calls == fails_at:
            raise error
        replace(source, target)

    def run():
        with atomic_folder(earlier, stale=("smoothed.csv",)) as part:
            for name in ("forward.csv", "new.csv"):
                (part / name).write_text("new")
            (part / "figures").mkdir()
            monkeypatch.setattr(os, "replace", failing)

    with pytest.raises(OutputError if isinstance(error, OSError) else KeyboardInterrupt):
        run()
    monkeypatch.undo()
    assert tree(earlier) == before
    assert not any(path.name.startswith(".") for path in earlier.iterdir())


def test_folder_that_is_a_file(tmp_path):
    (tmp_path / "run").write_text("x")
    with pytest.raises(OutputError, match="is a file, not a folder"), atomic_folder(tmp_path / "run"):
        pass


def test_parent_that_is_a_file(tmp_path):
    (tmp_path / "a").write_text("x")
    with pytest.raises(OutputError, match=r"'.*a' is a file, not a folder"), atomic_folder(tmp_path / "a" / "run"):
        pass


def with_folder(path, entered):
    with atomic_folder(path) as part:
        entered.append(part)


@pytest.mark.parametrize("exists", [True, False])
def test_folder_that_cannot_be_written_is_refused_before_the_work(tmp_path, monkeypatch, exists):
    path = tmp_path / "run"
    if exists:
        path.mkdir()
    mkdir = Path.mkdir

    def refuse(self, *args, **kwargs):
        if self.name.endswith(".part"):
            raise PermissionError(errno.EACCES, "Permission denied")
        mkdir(self, *args, **kwargs)

    monkeypatch.setattr(Path, "mkdir", refuse)
    entered = []
    with pytest.raises(OutputError, match="run: cannot be written: Permission denied; choose another place"):
        with_folder(path, entered)
    assert not entered
    monkeypatch.undo()
    shutil.rmtree(path, ignore_errors=True)
    assert list(tmp_path.iterdir()) == []


def test_reading_error_in_the_block_is_not_taken_for_an_output_error(tmp_path):
    with pytest.raises(FileNotFoundError):
        write_folder(tmp_path / "run", FileNotFoundError(errno.ENOENT, "No such file or directory"))
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_checked_and_left_as_it_was(tmp_path):
    check_folder(tmp_path / "deep" / "out")
    (tmp_path / "old").mkdir()
    check_folder(tmp_path / "old")
    (tmp_path / "file").write_text("x")
    for path, message in ((tmp_path / "file", "is a file, not a folder"), (tmp_path / "file" / "out", "another place")):
        with pytest.raises(OutputError, match=message):
            check_folder(path)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["file", "old"]
    with pytest.raises(OutputError, match="cannot be written"):
        check_folder(tmp_path / ("n" * 300))
