"""What a study hands over: tables, curves to draw, sentences; and how it is written into a folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from navfuse.errors import ConfigError, InputError
from navfuse.io.atomic import atomic_folder
from navfuse.io.json_file import write_json
from navfuse.report.study_figures import Picture, draw

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Wishes:
    """What whoever reproduces a study may choose.

    Attributes
    ----------
    data : Path or None
        Folder of the published data, for studies that need them.
    runs : int or None
        Simulated runs; None leaves it to the study.
    seed : int
        Of the first run.
    tell : callable
        Progress: name of a part, and the fraction of it done.
    """

    data: Path | None = None
    runs: int | None = None
    seed: int = 1
    tell: Progress = lambda part, fraction: None

    def number_of_runs(self, usual: int) -> int:
        """The runs asked for, or the study's own number.

        Raises
        ------
        ConfigError
            For less than one run.
        """
        if self.runs is None:
            return usual
        if self.runs < 1:
            raise ConfigError(f"runs = {self.runs}: a study takes at least one run")
        return self.runs

    def file(self, *parts: str) -> Path:
        """A file of the published data.

        Raises
        ------
        InputError
            Without a folder, or where the file is not in it.
        """
        if self.data is None:
            raise InputError(
                f"this study reads published data: give the folder that holds {'/'.join(parts)} with --data"
            )
        path = self.data.joinpath(*parts)
        if not path.is_file():
            raise InputError(f"{path}: there is no such file; --data has to name the folder that holds {parts[0]}")
        return path


@dataclass(frozen=True)
class Table:
    """A table of a study; cells are text.

    Attributes
    ----------
    title : str
    header : tuple of str
        With units.
    rows : tuple of tuple of str
    note : str
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    def text(self) -> str:
        """Aligned plain text: the first column to the left, the others to the right."""
        lines = [self.header, *self.rows]
        widths = [max(len(line[k]) for line in lines) for k in range(len(self.header))]
        body = [
            "  ".join(
                cell.ljust(w) if k == 0 else cell.rjust(w) for k, (cell, w) in enumerate(zip(line, widths, strict=True))
            )
            for line in lines
        ]
        return "\n".join(
            [self.title, "", *(line.rstrip() for line in body), *([f"\n{self.note}"] if self.note else [])]
        )

    def markdown(self) -> str:
        """The table for a page of the manual."""
        rows = ["| " + " | ".join(line) + " |" for line in (self.header, ("---",) * len(self.header), *self.rows)]
        return "\n".join([f"**{self.title}**", "", *rows, *(["", self.note] if self.note else [])])


@dataclass(frozen=True)
class Study:
    """Outcome of a study.

    Attributes
    ----------
    name, title : str
    source : str
        What was published, and where.
    tables : tuple of Table
    pictures : dict of str to Picture or Figure
        By the name of their file; described as data, or drawn already.
    notes : tuple of str
        What the figures say, and what differs from the publication.
    numbers : dict
        The figures of the tables, for programs; units in the keys.
    """

    name: str
    title: str
    source: str
    tables: tuple[Table, ...]
    pictures: Mapping[str, Picture | Figure] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    numbers: Mapping[str, Any] = field(default_factory=dict)

    def text(self) -> str:
        """Everything but the pictures, as plain text."""
        parts = [self.title, f"after {self.source}", *(table.text() for table in self.tables)]
        parts += ["\n".join(f"- {note}" for note in self.notes)] * bool(self.notes)
        return "\n\n".join(parts)

    def write(self, folder: Path, formats: tuple[str, ...] = ("png",)) -> list[Path]:
        """Write ``NAME.md``, ``NAME.json`` and the pictures into a folder; together or not at all.

        Raises
        ------
        OutputError
            If the folder cannot be written.
        """
        written = [f"{self.name}.md", f"{self.name}.json"]
        with atomic_folder(folder) as staging:
            page = [f"# {self.title}", f"After {self.source}.", *(table.markdown() for table in self.tables)]
            page += [f"![{name}]({name}.{formats[0]})" for name in self.pictures]
            page += ["\n".join(f"* {note}" for note in self.notes)] * bool(self.notes)
            (staging / written[0]).write_text("\n\n".join(page) + "\n", encoding="utf-8")
            write_json(staging / written[1], {"study": self.name, "source": self.source, **self.numbers})
            for name, picture in self.pictures.items():
                figure = draw(picture) if isinstance(picture, Picture) else picture
                for format_ in formats:
                    figure.savefig(staging / f"{name}.{format_}")
                    written.append(f"{name}.{format_}")
        return [folder / name for name in written]
