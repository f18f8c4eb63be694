"""Files and folders that appear whole or not at all.

Output is written beside its destination and renamed at the end, so that an error, a full disk or Ctrl-C leaves neither
half a file nor a damaged earlier result. Only a killed process leaves something behind: a hidden ``.name.*.part``
entry, which can be removed.
"""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from navfuse.errors import ConfigError, OutputError


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path to write to, and move what was written to its place when the block ends well.

    Parameters
    ----------
    path : path-like
        Destination; replaced if it exists. Its folder has to exist.

    Yields
    ------
    Path
        A path in the same folder with the same extension, not yet existing.

    Raises
    ------
    OutputError
        If the block or the renaming fails with an OSError. Any other exception passes unchanged.
    """
    path = Path(path)
    part = path.with_name(_part_name(path))
    try:
        if path.is_dir():
            raise OutputError(f"{path}: is a folder, not a file; choose another name")
        yield part
        os.replace(part, path)
    except OutputError:
        raise
    except OSError as error:
        raise _cannot_write(path, error) from error
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def atomic_folder(path: str | os.PathLike[str], stale: Iterable[str] = ()) -> Iterator[Path]:
    """Give a temporary folder to fill, and move its files to their place together when the block ends well.

    A new folder appears by one rename. In an existing folder every file that was written replaces its namesake, the
    files named in `stale` go, and everything else stays; should that fail half-way, the earlier files are put back.

    Parameters
    ----------
    path : path-like
        Destination folder; made with its parents if it does not exist.
    stale : iterable of str
        Names of files of an earlier result that must not survive beside the new ones.

    Yields
    ------
    Path
        An empty folder on the same file system.

    Raises
    ------
    OutputError
        If the destination is no folder or cannot be written; raised before the block is entered, so that no work is
        lost.
    """
    path = Path(path)
    made: list[Path] = []
    staging: Path | None = None
    try:
        try:
            staging, made = _make_staging(path)
        except OSError as error:
            raise _cannot_write(path, error) from error
        yield staging
        try:
            if path.is_dir():
                _move_together(staging, path, tuple(stale))
            else:
                os.rename(staging, path)
        except OSError as error:
            raise _cannot_write(path, error) from error
        made = []
    finally:
        if staging is not None:
            shutil.rmtree(staging, ignore_errors=True)
        for folder in made:
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()


def check_folder(path: str | os.PathLike[str]) -> None:
    """Make sure that :func:`atomic_folder` can write to a folder, before long work; nothing is left behind.

    Raises
    ------
    OutputError
        If the destination is no folder or cannot be written.
    """
    path = Path(path)
    try:
        staging, made = _make_staging(path)
    except OSError as error:
        raise _cannot_write(path, error) from error
    staging.rmdir()
    for folder in made:
        folder.rmdir()


def refuse_to_replace(inputs: Iterable[Path], folder: str | os.PathLike[str], names: Iterable[str]) -> None:
    """Refuse an output folder in which one of the files to be written or removed is an input.

    Parameters
    ----------
    inputs : iterable of Path
    folder : path-like
    names : iterable of str
        Of the files that are written into the folder, or removed from it.

    Raises
    ------
    ConfigError
        Naming the input.
    """
    own, place = set(names), Path(folder).resolve()
    for file in inputs:
        if file.name in own and file.resolve().parent == place:
            raise ConfigError(f"{file} is read by this run and would be replaced by it; choose another output folder")


def _make_staging(path: Path) -> tuple[Path, list[Path]]:
    """Make the temporary folder; also returns the parents that had to be made, innermost first."""
    if path.exists() and not path.is_dir():
        raise OutputError(f"{path}: is a file, not a folder; choose another name")
    for folder in path.absolute().parents:
        if folder.exists() and not folder.is_dir():
            raise OutputError(f"{path}: '{folder}' is a file, not a folder; choose another place")
    missing = [folder for folder in path.absolute().parents if not folder.exists()]
    path.parent.mkdir(parents=True, exist_ok=True)
    staging = path / _part_name(path) if path.is_dir() else path.absolute().parent / _part_name(path)
    staging.mkdir()
    return staging, missing


def _move_together(staging: Path, target: Path, stale: tuple[str, ...]) -> None:
    """Replace files of `target` by those of `staging`, all or none."""
    new = sorted(entry.name for entry in staging.iterdir())
    old = [name for name in dict.fromkeys([*new, *stale]) if (target / name).exists()]
    backup = target / _part_name(target)
    backup.mkdir()
    try:
        for name in old:
            os.replace(target / name, backup / name)
        for name in new:
            os.replace(staging / name, target / name)
    except BaseException:
        for name in new:
            if not (staging / name).exists():
                os.replace(target / name, staging / name)
        for name in old:
            if (backup / name).exists():
                os.replace(backup / name, target / name)
        backup.rmdir()
        raise
    shutil.rmtree(backup, ignore_errors=True)


def _part_name(path: Path) -> str:
    name = Path(path.absolute().name)
    return f".{name.stem}.{secrets.token_hex(4)}.part{name.suffix}"


def _cannot_write(path: Path, error: OSError) -> OutputError:
    if isinstance(error, OutputError):
        return error
    reason = error.strerror or str(error)
    if isinstance(error, FileNotFoundError):
        reason = f"{reason} (the folder '{path.parent}' has to exist)"
    return OutputError(f"{path}: cannot be written: {reason}; choose another place")
