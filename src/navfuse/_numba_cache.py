"""Where numba keeps the compiled kernels: one folder for each state of the package source.

numba decides whether a cached kernel is current by looking at the file that defines it. It does not see an edit in a
file which that one imports (a constant, an inlined function), and would go on running the old arithmetic. So the
folder's name holds a hash of every source file a kernel can depend on: an edit there means a new folder and a fresh
compilation. The rooms above all kernels (command line, configuration, pipeline, report) are left out, so that editing
them costs no compilation.

:func:`configure` has to run before numba is imported; ``navfuse/__init__.py`` calls it first. It takes some
milliseconds.
"""

from __future__ import annotations

import os
import sys
import time
from importlib.util import find_spec, source_hash
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
OWN_CHOICE = "NAVFUSE_NUMBA_CACHE_DIR"
STALE_DAYS = 30.0
NO_KERNELS = ("cli", "config", "montecarlo", "report", "demo.py", "pipeline.py", "__main__.py")

_PACKAGE = Path(__file__).parent


def configure() -> Path:
    """Choose the folder of the compiled kernels and tell numba, unless the user has set ``NUMBA_CACHE_DIR``.

    Returns
    -------
    Path
        The folder in force. A child process inherits the choice, and makes it anew in case it runs another version.
    """
    given = os.environ.get(VARIABLE)
    if given and given != os.environ.get(OWN_CHOICE):
        return Path(given)
    chosen = _usable(user_cache_folder() / "kernels", source_key())
    os.environ[VARIABLE] = os.environ[OWN_CHOICE] = str(chosen)
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = str(chosen)
    _remove_stale(chosen)
    return chosen


def is_cold() -> bool:
    """Whether no kernel has been compiled yet, so that the first run has to wait for the compiler."""
    folder = os.environ.get(VARIABLE)
    return not folder or next(Path(folder).glob("*/*.nbc"), None) is None


def user_cache_folder() -> Path:
    """The user's cache folder for navfuse, by the custom of the operating system; it need not exist yet."""
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "navfuse"


def source_key(package: Path = _PACKAGE) -> str:
    """Name of the folder: a 64-bit hash of the sources and of numba's version, and the Python version.

    Parameters
    ----------
    package : Path
        Root folder of the package. Equal contents give equal keys, wherever and whenever it was installed.
    """
    parts: list[bytes] = []
    _collect(str(package), "", parts)
    numba = find_spec("numba")
    if numba is not None and numba.origin is not None:
        parts.append(_read(os.path.join(os.path.dirname(numba.origin), "_version.py")))
    return f"{source_hash(b''.join(parts)).hex()}-py{sys.version_info.major}{sys.version_info.minor}"


def _collect(folder: str, inside: str, parts: list[bytes]) -> None:
    with os.scandir(folder) as entries:
        listed = sorted(entries, key=lambda entry: entry.name)
    for entry in listed:
        name = entry.name
        if not inside and name in NO_KERNELS:
            continue
        if name.endswith(".py"):
            content = _read(entry.path)
            parts += [f"{inside}{name} {len(content)}\n".encode(), content]
        elif not name.startswith(("_", ".")) and entry.is_dir():
            _collect(entry.path, f"{inside}{name}/", parts)


def _read(path: str) -> bytes:
    with open(path, "rb") as file:
        return file.read()


def _usable(parent: Path, key: str) -> Path:
    """The folder `key` below `parent`, or below a private temporary folder where `parent` cannot be written."""
    folder = parent / key
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
    except OSError:
        return _temporary() / key
    return folder if os.access(folder, os.W_OK) else _temporary() / key


def _temporary() -> Path:
    """A folder for temporary files that belongs to this user alone: numba executes what it finds in its cache."""
    import tempfile

    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    folder = Path(tempfile.gettempdir()) / f"navfuse-{user}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        state = folder.lstat()
    except OSError:
        return Path(tempfile.mkdtemp(prefix="navfuse-"))
    private = not hasattr(os, "getuid") or (state.st_uid == os.getuid() and not state.st_mode & 0o022)
    return (
        folder if private and folder.is_dir() and not folder.is_symlink() else Path(tempfile.mkdtemp(prefix="navfuse-"))
    )


def _remove_stale(current: Path) -> None:
    """Delete the kernels of other package versions that have not been used for a month."""
    oldest = time.time() - STALE_DAYS * 86400.0
    try:
        with os.scandir(current.parent) as entries:
            stale = [entry.path for entry in entries if entry.name != current.name and _abandoned(entry, oldest)]
    except OSError:
        return
    if stale:
        import shutil

        for path in stale:
            shutil.rmtree(path, ignore_errors=True)


def _abandoned(entry: os.DirEntry[str], oldest: float) -> bool:
    is_ours = "-py" in entry.name and entry.is_dir(follow_symlinks=False)
    return is_ours and entry.stat(follow_symlinks=False).st_mtime < oldest
