"""A page opened in a browser, with everything it says and asks for, and the report's plots to act upon."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from playwright.sync_api import BrowserContext, Locator, Route

PATIENCE_MS = 30_000
"""How long anything may take before it counts as never happening; a busy machine, not a page, needs this long."""


class Visit:
    """One visit to a page from a file.

    Attributes
    ----------
    page : playwright.sync_api.Page
    events : list of str
        Console messages, errors, dialogs, and requests for anything but the page itself. All requests fail.
    """

    def __init__(self, context: BrowserContext, path: Path) -> None:
        self.context, self.address = context, path.resolve().as_uri()
        self.events: list[str] = []
        context.set_default_timeout(PATIENCE_MS)
        context.route("**/*", self._route)
        self.page = page = context.new_page()
        page.on("console", lambda message: self.events.append(f"console {message.type}: {message.text}"))
        page.on("pageerror", lambda error: self.events.append(f"error: {error}"))
        page.on("dialog", self._dialog)
        page.on("popup", lambda window: self.events.append(f"window: {window.url}"))
        page.on("download", lambda file: self.events.append(f"download: {file.url[:60]}"))
        page.goto(self.address, wait_until="commit")

    def _route(self, route: Route) -> None:
        if route.request.url.partition("#")[0] == self.address:
            route.continue_()
        else:
            self.events.append(f"request: {route.request.url[:200]}")
            route.abort()

    def _dialog(self, dialog: Any) -> None:
        self.events.append(f"dialog: {dialog.message}")
        dialog.dismiss()

    def ready(self) -> Visit:
        """Wait until the page says that its plots are ready."""
        self.page.wait_for_selector("body[data-ready]", state="attached")
        assert self.page.evaluate("document.body.dataset.ready") == "yes", self.page.inner_text("#message")
        return self

    def whole_run(self) -> Visit:
        """Go back to what the page shows first."""
        self.page.evaluate("scrollTo(0, 0)")
        self.page.click("#all")
        return self

    def overflow(self) -> list[str]:
        """What reaches beyond the right edge without a container that scrolls."""
        return self.page.evaluate(
            """() => {
              const width = document.documentElement.clientWidth, found = [];
              if (document.documentElement.scrollWidth <= width) return found;
              for (const node of document.body.querySelectorAll("*")) {
                const box = node.getBoundingClientRect();
                if (box.right > width + 0.5) found.push(`${node.tagName}.${node.getAttribute("class")} ${box.right}`);
              }
              return found;
            }"""
        )


class Chart:
    """One plot of a report: the map or a panel."""

    def __init__(self, visit: Visit, box: Locator) -> None:
        self.visit, self.page, self.box = visit, visit.page, box
        self.title = box.get_attribute("aria-label") or ""

    def show(self) -> Chart:
        """Bring it into view and wait until it is drawn."""
        self.box.scroll_into_view_if_needed()
        handle = self.box.element_handle()
        self.page.wait_for_function("box => box.dataset.drawn === 'yes' && box._fullLayout", arg=handle)
        return self

    def frame(self) -> dict[str, float]:
        """Where its axes lie in the window [px], and what they span; x in the unit of the axis."""
        return self.box.evaluate(
            """box => {
              const l = box._fullLayout, at = box.getBoundingClientRect(), [from, to] = l.xaxis.range.map(Number);
              return { left: at.left + l.xaxis._offset, width: l.xaxis._length, top: at.top + l._size.t,
                height: l._size.h, from, to };
            }"""
        )

    @property
    def over_time(self) -> bool:
        """Whether its x axis is the time of the run."""
        return self.box.evaluate("box => box._fullLayout.xaxis.title.text.includes('time')")

    def range(self) -> tuple[float, float]:
        """Span of its x axis."""
        frame = self.frame()
        return frame["from"], frame["to"]

    def point(self, across: float, down: float = 0.5) -> tuple[float, float]:
        """A place in the plot by fractions of its width and height, in the window [px]."""
        frame = self.frame()
        return frame["left"] + across * frame["width"], frame["top"] + down * frame["height"]

    def drag(self, start: float, end: float) -> None:
        """Drag the mouse from one fraction of the width to another."""
        self.box.scroll_into_view_if_needed()
        down = self.visible_fraction()
        self.page.mouse.move(*self.point(start, down))
        self.page.mouse.down()
        self.page.mouse.move(*self.point(0.5 * (start + end), down), steps=3)
        self.page.mouse.move(*self.point(end, down), steps=3)
        self.page.mouse.up()

    def hover(self, across: float, down: float | None = None) -> None:
        """Put the mouse on a fraction of the width; plotly needs two moves to notice."""
        self.box.scroll_into_view_if_needed()
        down = self.visible_fraction() if down is None else down
        self.page.mouse.move(*self.point(across, down))
        self.page.mouse.move(*self.point(across + 0.001, down))
