"""A page opened in a browser, with everything it says and asks for, and the report's plots to act upon."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from playwright.sync_api import BrowserContext, Locator, Route

PATIENCE_MS = 30_000
"""How long anything may take before it counts as never happening; a busy machine, not a page, needs this long."""
INK = "box => getComputedStyle(box.querySelector('svg text')).fill"
"""The colour of the text in a plot."""


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

    def until(self, condition: str, given: Any = None) -> None:
        """Wait for a JavaScript function of `given` to be true, whatever the page's rate of drawing."""
        self.page.evaluate(
            """async ([condition, given, patience]) => {
              const holds = eval(condition), end = performance.now() + patience;
              while (!holds(given)) {
                if (performance.now() > end) throw new Error(`never true: ${condition} of ${JSON.stringify(given)}`);
                await new Promise((resolve) => setTimeout(resolve, 20));
              }
            }""",
            [condition, given, PATIENCE_MS],
        )

    def ready(self) -> Visit:
        """Wait until the page says that its plots are ready."""
        self.until("() => document.body && document.body.dataset.ready !== undefined")
        assert self.page.evaluate("document.body.dataset.ready") == "yes", self.page.inner_text("#message")
        return self

    def whole_run(self) -> Visit:
        """Go back to the whole run, in log time."""
        self.page.evaluate("scrollTo(0, 0); document.getElementById('all').click()")
        if self.page.locator("#scale").is_visible():
            self.page.select_option("#scale", "log")
        return self

    def map(self) -> Chart:
        """The map."""
        return Chart(self, "#map [role=img]")

    def charts(self) -> list[Chart]:
        """Every plot but the map, in page order."""
        places = self.page.evaluate("[...document.querySelectorAll('[data-panel]')].map((box) => box.dataset.panel)")
        return [Chart(self, f"[data-panel='{place}']") for place in places]

    def time_charts(self) -> list[Chart]:
        """The plots over the time of the run, drawn."""
        return [chart for chart in self.charts() if chart.show().over_time]

    def span(self) -> tuple[float, float]:
        """What the fields say is shown [s]."""
        return float(self.page.input_value("#from")), float(self.page.input_value("#to"))

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

    def __init__(self, visit: Visit, selector: str) -> None:
        self.visit, self.page, self.selector = visit, visit.page, selector
        self.box: Locator = visit.page.locator(selector)
        self.title = self.box.get_attribute("aria-label") or ""

    def show(self) -> Chart:
        """Bring it into view and wait until it is drawn."""
        self.box.evaluate("box => box.scrollIntoView({ block: 'center' })")
        self.until("box => box.dataset.drawn === 'yes'")
        return self

    def until(self, condition: str) -> None:
        """Wait for a JavaScript function of the plot's element to be true."""
        self.visit.until(f"selector => ({condition})(document.querySelector(selector))", self.selector)

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

    def wait_for(self, span: tuple[float, float], tolerance: float = 0.006) -> None:
        """Wait until the x axis spans this."""
        self.until(
            f"box => box._fullLayout.xaxis.range.every((x, k) => Math.abs(Number(x) - {list(span)}[k]) <= {tolerance})"
        )

    def points(self) -> int:
        """Number of points in the curves that are shown."""
        return self.box.evaluate(
            "box => box.data.reduce((n, curve) => n + (curve.visible === false ? 0 : curve.x.length), 0)"
        )

    def cursor(self) -> float | None:
        """Where the time cursor stands in it, in the unit of the axis; None while it is hidden."""
        return self.box.evaluate(
            """box => {
              const mark = box.parentElement.querySelector(".cursor"), { xaxis } = box._fullLayout;
              if (mark.hidden) return null;
              return xaxis.p2d(mark.getBoundingClientRect().left - box.getBoundingClientRect().left - xaxis._offset);
            }"""
        )

    def point_at(self, time: float) -> None:
        """On the map, put the mouse on the best track at a time of the log."""
        x, y = self.place_at(time)
        self.page.mouse.move(x - 3.0, y)
        self.page.mouse.move(x, y)

    def place_at(self, time: float) -> tuple[float, float]:
        """On the map, where the best track is at a time of the log, in the window [px]."""
        return tuple(
            self.box.evaluate(
                """(box, time) => {
                  const tracks = box.data.filter((curve) => curve.mode === "lines" && curve.customdata);
                  const best = tracks.find((curve) => /smooth/.test(curve.name)) || tracks[0], t = best.customdata;
                  const k = Math.max(1, t.findIndex((value) => value >= time));
                  const part = (time - t[k - 1]) / (t[k] - t[k - 1]);
                  const at = box.getBoundingClientRect(), { xaxis, yaxis } = box._fullLayout;
                  const along = (values) => values[k - 1] + part * (values[k] - values[k - 1]);
                  const x = at.left + xaxis._offset + xaxis.d2p(along(best.x));
                  return [x, at.top + yaxis._offset + yaxis.d2p(along(best.y))];
                }""",
                time,
            )
        )

    def legend(self) -> Locator:
        """The buttons of its legend that show and hide curves."""
        return self.box.locator("xpath=ancestor::figure").locator(".legend button[aria-pressed]")

    def ink(self) -> str:
        """The colour of its text."""
        return self.box.evaluate(INK)

    def focus(self) -> None:
        """Give it the keyboard."""
        self.box.locator("xpath=ancestor::*[@tabindex][1]").focus()

    def point(self, across: float, down: float = 0.1) -> tuple[float, float]:
        """A place in the plot by fractions of its width and height, brought to the middle of the window [px]."""
        self.page.evaluate("y => scrollBy(0, y - innerHeight / 2)", self._at(across, down)[1])
        return self._at(across, down)

    def _at(self, across: float, down: float) -> tuple[float, float]:
        frame = self.frame()
        return frame["left"] + across * frame["width"], frame["top"] + down * frame["height"]

    def drag(self, start: float, end: float) -> None:
        """Drag the mouse from one fraction of the width to another."""
        x, y = self.point(start)
        span = (end - start) * self.frame()["width"]
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        self.page.mouse.move(x + 0.5 * span, y, steps=3)
        self.page.mouse.move(x + span, y, steps=3)
        self.page.mouse.up()

    def hover(self, across: float, down: float = 0.1) -> None:
        """Put the mouse on a place; plotly takes a second move to notice."""
        x, y = self.point(across, down)
        self.page.mouse.move(x - 3.0, y)
        self.page.mouse.move(x, y)
