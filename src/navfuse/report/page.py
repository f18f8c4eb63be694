"""The report of a run: one self-contained HTML file that works offline, from a file, on a phone, in light and dark.

The page holds plotly.js and the curves gzip-compressed in base64 and unpacks them in the browser. A content security
policy in it forbids every network access and every script but these two, told by their hashes. Verdict, numbers and
tables are plain HTML and show without any script.
"""

from __future__ import annotations

import gzip
from base64 import b64encode
from functools import cache
from hashlib import sha256
from importlib.resources import files
from itertools import groupby
from pathlib import Path
from string import Template

from navfuse.analysis.consistency import nis_summary
from navfuse.analysis.metrics import ErrorSeries, errors, summarize
from navfuse.analysis.separation import separation
from navfuse.data.result import Result
from navfuse.data.trajectory import Trajectory
from navfuse.errors import InputError
from navfuse.io.atomic import atomic_file
from navfuse.report import markup
from navfuse.report.clock import clock_of, utc_text
from navfuse.report.curves import Scene, solutions_of
from navfuse.report.packing import pack
from navfuse.report.panels import map_panel, page_panels, shading
from navfuse.report.quality import position_percentiles
from navfuse.report.series import excluded_windows
from navfuse.report.verdict import judge

SCRIPTS = ("page_base.js", "page_plots.js", "page_map.js", "page_window.js", "page_main.js")
TITLE = 200
POLICY = (
    "default-src 'none'; script-src {scripts}; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; "
    "form-action 'none'"
)


def write_report(
    path: str | Path,
    result: Result,
    truth: Trajectory | None = None,
    *,
    title: str = "navfuse run",
    skip_s: float = 0.0,
    until_s: float | None = None,
    bare: bool = False,
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
    skip_s, until_s : float [s]
        The error tables count from `skip_s` until before `until_s` after the common start; the curves show everything.
    bare : bool
        The result is a trajectory alone, not a run: what only a run has is not missed.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    OutputError
        When the file cannot be written.
    InputError
        When the truth cannot be compared with the result, or the result has no epochs.
    """
    target = Path(path)
    text = render(result, truth, title=title, skip_s=skip_s, until_s=until_s, bare=bare)
    with atomic_file(target) as part:
        part.write_text(text, encoding="utf-8")
    return target


def render(
    result: Result,
    truth: Trajectory | None = None,
    *,
    title: str = "navfuse run",
    skip_s: float = 0.0,
    until_s: float | None = None,
    bare: bool = False,
) -> str:
    """The report of a run as text; parameters as for :func:`write_report`."""
    if not len(result.forward):
        raise InputError(f"{result.forward.source}: no epochs, so there is nothing to report")
    scene = scene_of(result, truth, bare=bare)
    compared = _cut(scene, skip_s, until_s)
    metrics = {name: summarize(entry) for name, entry in compared.items()}
    circles = {name: position_percentiles(entry) for name, entry in compared.items()}
    verdict = judge(result, scene.consistency, metrics, scene.apart, bare=bare)
    panels, chart = page_panels(scene), map_panel(scene)
    start, end = float(result.forward.time[0]), float(result.forward.time[-1])
    data = {
        "start": start,
        "end": end,
        "clock": clock_of(result.epoch, start, end),
        "map": chart,
        "panels": [panel if panel["rows"] else {"title": panel["title"], "rows": []} for panel in panels],
        "shading": shading(result),
    }
    described, numbers = pack(data)
    library, library_hash = _library()
    script = '"use strict";\n{\n' + "".join(_asset(name) for name in SCRIPTS) + "}\n"
    sections = [(name, list(group)) for name, group in groupby(enumerate(panels), key=lambda item: item[1]["section"])]
    before = {"Measurements": markup.consistency(scene.consistency)}
    return Template(_asset("page.html")).substitute(
        policy=POLICY.format(scripts=f"{library_hash} {_hash(script.encode())}"),
        title=markup.text(str(title)[:TITLE]),
        subtitle=_subtitle(result, start),
        style=_asset("page.css"),
        verdict=markup.verdict(verdict),
        cards=markup.cards(verdict),
        metrics=markup.metrics(metrics, circles, skip_s),
        navigation="".join(f'<a href="#{name.lower()}">{name}</a>' for name, _ in sections),
        start=f"{start:.2f}",
        end=f"{end:.2f}",
        mapnote=markup.text(chart["note"]),
        maplabel=markup.text(f"Map of the tracks and the GNSS fixes in metres. {chart['numbers']}."),
        sections="".join(markup.section(name, before.get(name, ""), group) for name, group in sections),
        details=markup.details(result.summary),
        plotly=library,
        data=_pack(described),
        numbers=_pack(numbers),
        script=script,
    )


def scene_of(result: Result, truth: Trajectory | None = None, *, bare: bool = False) -> Scene:
    """A result with what the panels derive of it.

    Raises
    ------
    InputError
        When the truth cannot be compared with the result.
    """
    series = {} if truth is None else {role: errors(one, truth) for role, one in solutions_of(result).items()}
    windows = excluded_windows(result.innovations)
    apart, why = None, "a trajectory alone was given" if bare else "no smoother was run (smoother.method)"
    if result.smoothed is not None:
        try:
            apart = separation(result.forward, result.smoothed)
        except InputError as error:
            why = f"filter and smoother cannot be compared: {error}"
    return Scene(result, truth, series, apart, why, nis_summary(result.innovations, exclude=windows), bare)


def _cut(scene: Scene, skip_s: float, until_s: float | None) -> dict[str, ErrorSeries]:
    """Errors by name of the solution, of the time that the tables are about."""
    if scene.truth is None:
        return {}
    if skip_s <= 0.0 and until_s is None:
        return {scene.names[role]: series for role, series in scene.errors.items()}
    found = scene.solutions.items()
    return {scene.names[role]: errors(one, scene.truth, skip_s=skip_s, until_s=until_s) for role, one in found}


def _subtitle(result: Result, start: float) -> str:
    if result.epoch is None:
        return '<p class="subtitle">Times are log time; the log does not say when it began.</p>'
    week, tow = result.epoch
    begin = f"Begins {utc_text(result.epoch, start)} UTC. Log time 0 is GPS week {week}, {tow:.3f} s."
    return f'<p class="subtitle">{markup.text(begin)}</p>'


def _hash(script: bytes) -> str:
    return f"'sha256-{b64encode(sha256(script).digest()).decode('ascii')}'"


def _asset(name: str) -> str:
    return (files("navfuse.report") / "assets" / name).read_text(encoding="utf-8")


@cache
def _library() -> tuple[str, str]:
    """The plotting library as the page holds it, and its hash; kept, since packing it is most of the work."""
    content = (files("plotly") / "package_data" / "plotly.min.js").read_bytes()
    return _pack(content), _hash(content)


def _pack(content: bytes) -> str:
    return b64encode(gzip.compress(content, 6, mtime=0)).decode("ascii")
