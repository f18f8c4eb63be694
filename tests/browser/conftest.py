"""A real browser over the pages that navfuse writes: one Chromium a process, every page written once for all of them.

The Chromium of the system is driven, never one that a test tool brings. Without it or without Playwright these tests
are skipped; on the build server, which installs both, that is a failure.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import pytest
from benchmarks.logs import SHARED

from browser.cases import write_case
from browser.visit import Visit

if TYPE_CHECKING:
    from playwright.sync_api import Browser

Write = Callable[[Path], None]
Written = Callable[[str, Write], Path]
Open = Callable[..., Visit]

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = ("--disable-gpu", "--disable-background-networking", "--disable-component-update", "--disable-sync")
DESKTOP = {"width": 1280, "height": 900}
PHONE = {"width": 390, "height": 844}


def absent(what: str) -> NoReturn:
    """Skip for want of a tool; fail where it has to be there."""
    if os.environ.get("CI"):
        pytest.fail(f"{what}, and the build server must look at the pages", pytrace=False)
    pytest.skip(what)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """One Chromium for the tests of this process."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        absent("Playwright is not installed")
    found = next((path for name in NAMES if (path := shutil.which(name))), None)
    if found is None:
        absent(f"no browser is installed: none of {', '.join(NAMES)}")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=found, args=list(FLAGS))
        yield chromium
        chromium.close()


@pytest.fixture(scope="session")
def written(tmp_path_factory: pytest.TempPathFactory) -> Written:
    """Gives the path of a page, written by whichever process asks for it first."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "pages"
    folder.mkdir(exist_ok=True)

    def write_once(name: str, write: Write) -> Path:
        path = folder / f"{name}.html"
        with _alone(folder / f"{name}.lock"):
            if not path.exists():
                write(path)
        return path

    return write_once


@pytest.fixture(scope="session")
def case_page(written: Written, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Gives the report of one of the cases."""

    def page_of(name: str) -> Path:
        return written(name, lambda path: write_case(name, SHARED, tmp_path_factory.mktemp(name), path))

    return page_of


@pytest.fixture(scope="session")
def visits(browser: Browser) -> Iterator[Open]:
    """Opens pages that stay open for several tests."""
    yield from _opener(browser)


@pytest.fixture
def visit(browser: Browser) -> Iterator[Open]:
    """Opens pages for one test, which fails if one of them has said or asked for anything by its end."""
    yield from _opener(browser)


def _opener(browser: Browser) -> Iterator[Open]:
    opened: list[Visit] = []

    def open_page(path: Path, *, phone: bool = False, dark: bool = False, **options: Any) -> Visit:
        usual: dict[str, Any] = {"viewport": DESKTOP, "color_scheme": "dark" if dark else "light"}
        if phone:
            usual |= {"viewport": PHONE, "has_touch": True, "is_mobile": True, "device_scale_factor": 2}
        context = browser.new_context(**usual | options)
        opened.append(Visit(context, path))
        return opened[-1]

    yield open_page
    told = [event for entry in opened for event in entry.events]
    for entry in opened:
        entry.context.close()
    assert told == []


@contextmanager
def _alone(lock: Path) -> Iterator[None]:
    """Keeps other processes out while a page is being written; where files have no locks they may write it twice."""
    with lock.open("w") as file:
        with suppress(ImportError):
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX)
        yield
