"""The report of a run: one self-contained HTML file that works offline, from a file, on a phone, in light and dark.

The page holds plotly.js and the curves gzip-compressed in base64 and unpacks them in the browser; a content security
policy in it forbids every network access. Verdict, numbers and tables are plain HTML and show without any script.
"""

from __future__ import annotations

import gzip
import json
from base64 import b64encode
from html import escape
from importlib.resources import files
from itertools import groupby
from pathlib import Path
from string import Template

from navfuse.analysis.consistency import nis_summary
from navfuse.analysis.metrics import ErrorMetrics, ErrorSeries, errors, summarize
from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.io.atomic import atomic_file
from navfuse.report import markup
from navfuse.report.panels import map_panel, shading, solutions_of, time_panels
from navfuse.report.series import NAMES, withheld_windows
from navfuse.report.verdict import judge


def write_report(
    path: str | Path,
    result: Result,
    truth: Trajectory | None = None,
    *,
    title: str = "navfuse run",
    skip_s: float = 0.0,
) -> Path:
    """Write the report of a run as one HTML file.

    Parameters
    ----------
    path : str or Path
        Appears whole or not at all.
    result : Result
    truth : Trajectory, optional
        Adds the errors, drawn inside their 3-sigma envelopes. Of the same point of the vehicle as the result.
    title : str
        Heading of the page; text, never markup.
    skip_s : float [s]
        Start of the run left out of the error table (the curves show everything).

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    OutputError
        When the file cannot be written.
    InputError
        When the truth cannot be compared with the result.
    """
    target = Path(path)
    text = render(result, truth, title=title, skip_s=skip_s)
    with atomic_file(target) as part:
        part.write_text(text, encoding="utf-8")
    return target


def render(result: Result, truth: Trajectory | None = None, *, title: str = "navfuse run", skip_s: float = 0.0) -> str:
    """The report of a run as text; parameters as for :func:`write_report`."""
    series, metrics = _against_truth(result, truth, skip_s)
    windows = [(window.start, window.end) for window in withheld_windows(result.innovations)]
    consistency = nis_summary(result.innovations, exclude=windows)
    verdict = judge(result, consistency, metrics)
    panels = time_panels(result, truth, series)
    data = {
        "start": float(result.forward.time[0]),
        "end": float(result.forward.time[-1]),
        "map": map_panel(result, truth),
        "panels": panels,
        "shading": shading(result),
    }
    sections = [(name, list(group)) for name, group in groupby(enumerate(panels), key=lambda item: item[1]["section"])]
    before = {"Measurements": markup.consistency(consistency)}
    return Template(_asset("page.html")).substitute(
        title=escape(title),
        style=_asset("page.css"),
        verdict=markup.verdict(verdict),
        cards=markup.cards(verdict),
        metrics=markup.metrics(metrics, skip_s),
        navigation="".join(f'<a href="#{name.lower()}">{name}</a>' for name, _ in sections),
        start=f"{data['start']:.2f}",
        end=f"{data['end']:.2f}",
        sections="".join(markup.section(name, before.get(name, ""), group) for name, group in sections),
        details=markup.details(result.summary),
        plotly=_pack(_plotly_source()),
        data=_pack(json.dumps(data, separators=(",", ":")).encode()),
        script=_asset("page.js"),
    )


def _against_truth(
    result: Result, truth: Trajectory | None, skip_s: float
) -> tuple[dict[str, ErrorSeries], dict[str, ErrorMetrics]]:
    if truth is None:
        return {}, {}
    series = {role: errors(trajectory, truth) for role, trajectory in solutions_of(result).items()}
    compared = series
    if skip_s > 0.0:
        compared = {role: errors(trajectory, truth, skip_s=skip_s) for role, trajectory in solutions_of(result).items()}
    metrics = {NAMES[role]: summarize(entry) for role, entry in compared.items()}
    return series, metrics


def _asset(name: str) -> str:
    return (files("navfuse.report") / "assets" / name).read_text(encoding="utf-8")


def _plotly_source() -> bytes:
    return (files("plotly") / "package_data" / "plotly.min.js").read_bytes()


def _pack(content: bytes) -> str:
    return b64encode(gzip.compress(content, 6, mtime=0)).decode("ascii")
