"""What axe-core finds on a page, and the contrasts inside the plots, which it does not look at."""

from __future__ import annotations

from importlib.resources import files
from typing import NamedTuple

from browser.visit import Visit

RANKS = ("minor", "moderate", "serious", "critical")
TEXT_CONTRAST, MARK_CONTRAST = 4.5, 3.0
"""WCAG 2.2, criteria 1.4.3 and 1.4.11."""


class Finding(NamedTuple):
    """A rule that is broken, how badly, and where."""

    impact: str
    rule: str
    places: tuple[str, ...]


def findings(visit: Visit) -> list[Finding]:
    """Every violation that axe-core reports, worst first; target sizes, which it leaves out by default, included."""
    visit.page.evaluate((files("axe_playwright_python") / "axe.min.js").read_text(encoding="utf-8"))
    found = visit.page.evaluate(
        """() => axe.run(document, { resultTypes: ["violations"], rules: { "target-size": { enabled: true } } })
          .then(({ violations }) => violations.map(({ impact, id, nodes }) =>
            [impact, id, nodes.map((node) => `${node.target.join(" ")}: ${node.failureSummary.split("\\n")[1]}`)]))"""
    )
    listed = [Finding(impact, rule, tuple(places)) for impact, rule, places in found]
    return sorted(listed, key=lambda finding: -RANKS.index(finding.impact))


def faint(visit: Visit) -> list[str]:
    """Texts, lines and marks of the plots drawn so far whose contrast with the page is too low."""
    return visit.page.evaluate(
        """([text, mark]) => {
          const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
          const rgb = (color) => {
            canvas.clearRect(0, 0, 1, 1);
            canvas.fillStyle = color;
            canvas.fillRect(0, 0, 1, 1);
            return [...canvas.getImageData(0, 0, 1, 1).data];
          };
          const light = (color) => {
            const linear = (x) => x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4;
            const [r, g, b] = rgb(color).map((x) => linear(x / 255));
            return 0.2126 * r + 0.7152 * g + 0.0722 * b;
          };
          const paper = light(getComputedStyle(document.body).backgroundColor), found = new Set();
          const check = (color, least, what) => {
            const ink = light(color), ratio = (Math.max(ink, paper) + 0.05) / (Math.min(ink, paper) + 0.05);
            if (ratio < least) found.add(`${what} in ${color}: ${ratio.toFixed(2)} < ${least}`);
          };
          for (const box of document.querySelectorAll(".js-plotly-plot")) {
            for (const node of box.querySelectorAll("svg text"))
              check(getComputedStyle(node).fill, text, `text ${node.textContent}`);
            for (const curve of box.data) {
              if (curve.opacity < 1) continue;  // a shade that lies below a line
              if (curve.mode === "lines" && curve.line.width) check(curve.line.color, mark, `line ${curve.name}`);
              const filled = curve.mode === "markers" && curve.marker.color;
              if (typeof filled === "string") check(filled, mark, `marks ${curve.name}`);
            }
          }
          return [...found];
        }""",
        [TEXT_CONTRAST, MARK_CONTRAST],
    )
