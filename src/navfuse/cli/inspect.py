"""``navfuse inspect``: what a log is, and whether it can be what it says."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from navfuse.cli.progress import compilation
from navfuse.errors import InputError

if TYPE_CHECKING:
    from navfuse.inspection.findings import Finding, Inspection


def inspect(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Logs of one drive, in any order; or a project file.")
    ],
    draft: Annotated[
        Path | None,
        typer.Option("--draft", metavar="PROJECT.toml", help="Write a project file with what was found."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
) -> None:
    """Look at logs before any filter does: formats, rates, gaps, units, axes, clocks.

    Every check ends in ok, look, wrong or cannot tell, with its evidence and the setting to use. Exit code 1 if
    something is certainly wrong.
    """
    if draft is not None and draft.exists():
        raise InputError(f"{draft}: is there already; name another file for the draft, or remove it")
    with compilation(as_json):
        from navfuse.project_inspection import inspect as inspect_files

        found = inspect_files(files)
    if as_json:
        import json

        from navfuse.io.json_file import to_plain

        print(json.dumps(to_plain(found.to_dict()), indent=2))
    else:
        _print(found)
    if draft is not None:
        _write_draft(found, draft)
        if not as_json:
            print(f"draft in {draft}; run it with: navfuse run {draft} -o out")
    wrong = found.wrong()
    if wrong:
        more = "" if len(wrong) == 1 else f" (and {len(wrong) - 1} more, above)"
        raise InputError(f"{wrong[0]}{more}")


def _write_draft(found: Inspection, draft: Path) -> None:
    from navfuse.inspection.draft import draft_project
    from navfuse.io.atomic import atomic_file

    try:
        text = draft_project(found, draft.parent)
    except KeyError as error:
        raise InputError(f"{draft}: no draft without an inertial log; none of the files is one") from error
    with atomic_file(draft) as part:
        part.write_text(text, encoding="utf-8")


def _print(found: Inspection) -> None:
    import sys

    groups = [(f"{report.path}: {report.role}, {report.format}, {report.summary}".rstrip(", "), report.findings)
              for report in found.files]  # fmt: skip
    if found.between:
        groups.append(("between the logs", found.between))
    show = _table if sys.stdout.isatty() else _plain
    for title, findings in groups:
        show(title, findings)
    counts = {verdict: sum(one.verdict is verdict for one in found.findings) for verdict in type(found.verdict)}
    print("; ".join(f"{count} {verdict}" for verdict, count in counts.items() if count))


def _plain(title: str, findings: tuple[Finding, ...]) -> None:
    print(title)
    for one in findings:
        print(f"  {one.verdict:<11}  {one.check:<18}  {one.message}")
        if one.remedy:
            print(f"  {'':<11}  {'':<18}  -> {one.remedy}")


def _table(title: str, findings: tuple[Finding, ...]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, title=Text(title, style="bold"), title_justify="left")
    for column in ("verdict", "check", "evidence, and what to do"):
        table.add_column(column, no_wrap=column != "evidence, and what to do")
    styles = {"ok": "green", "cannot tell": "dim", "look": "yellow", "wrong": "bold red"}
    for one in findings:
        text = Text(one.message)
        if one.remedy:
            text.append(f"\n-> {one.remedy}", style="cyan")
        table.add_row(Text(str(one.verdict), style=styles[str(one.verdict)]), one.check, text)
    Console(highlight=False).print(table)
