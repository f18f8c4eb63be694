"""The report page: its size, the time to write it, and the time until its plots are ready in Chromium.

python -m benchmarks.report_page

One hour at 200 Hz with its truth, and the real drive where it is; each figure is the least of several. Needs the
`dev` extra, and a Chromium for the last columns.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from benchmarks.logs import car_project, rtk_project
from navfuse import process, read_trajectory
from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.errors import NavfuseWarning
from navfuse.report.page import write_report

if TYPE_CHECKING:
    from playwright.sync_api import Browser

REPEATS = 5
PATIENCE_S = 60.0
WATCH = """
const watch = setInterval(() => {
  if (!document.body || document.body.dataset.ready !== "yes") return;
  globalThis.readyAt = performance.now();
  clearInterval(watch);
}, 5);
"""
BARS = {"size MB": "<= 4", "written s": "<= 3", "ready s": "< 2"}


def main() -> None:
    """Measure and print."""
    table = Table(title=f"Report page (least of {REPEATS})")
    for name in ("run", "size MB", "written s", "ready s"):
        table.add_column(name)
    table.add_row("bar", *BARS.values())
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", NavfuseWarning)
        pages = {}
        for label, result, truth in _runs(Path(folder)):
            path = Path(folder) / f"{len(pages)}.html"
            seconds = min(_seconds_to_write(path, result, truth) for _ in range(REPEATS))
            pages[label] = (path, seconds)
        shown = _shown([path for path, _ in pages.values()])
        for (label, (path, seconds)), ready in zip(pages.items(), shown, strict=True):
            table.add_row(label, f"{path.stat().st_size / 1e6:.2f}", f"{seconds:.2f}", ready)
    Console(width=None if sys.stdout.isatty() else 120).print(table)


def _runs(scratch: Path) -> list[tuple[str, Result, Trajectory | None]]:
    label, project, truth = car_project(scratch)
    found: list[tuple[str, Result, Trajectory | None]] = [(label, process(project), read_trajectory(truth))]
    drive = rtk_project()
    if drive is not None:
        found.append(("rtklibexplorer-drive", process(drive[0]), None))
    return found


def _seconds_to_write(path: Path, result: Result, truth: Trajectory | None) -> float:
    begin = time.perf_counter()
    write_report(path, result, truth)
    return time.perf_counter() - begin


def _shown(pages: list[Path]) -> list[str]:
    found = next(
        (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
    )
    if found is None:
        return ["no Chromium"] * len(pages)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=["--disable-gpu"])
        times = [min(_seconds_to_show(browser, page) for _ in range(REPEATS)) for page in pages]
        browser.close()
    return [f"{seconds:.2f}" for seconds in times]


def _seconds_to_show(browser: Browser, path: Path) -> float:
    """From the start of the navigation until the page says that its plots are ready [s]."""
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    page = context.new_page()
    page.add_init_script(WATCH)
    page.goto(path.as_uri(), wait_until="commit")
    end = time.monotonic() + PATIENCE_S
    while not (ready := page.evaluate("globalThis.readyAt")):
        if time.monotonic() > end:
            raise RuntimeError(f"{path.name} is not ready after {PATIENCE_S:g} s")
        time.sleep(0.1)
    context.close()
    return ready / 1000.0


if __name__ == "__main__":
    main()
