"""The project file explained: a commented template and a list of every key."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Iterator
from typing import NamedTuple

from pydantic.fields import FieldInfo

from navfuse.config.keys import allowed_range, extra
from navfuse.config.messages import sections
from navfuse.config.project import Project, ProjectFile
from navfuse.config.toml_text import toml_value, type_words

_WIDTH = 100


class KeyHelp(NamedTuple):
    """One key of the project file; `default` is ``required`` for a key that must be given, empty for one without."""

    key: str
    unit: str
    type: str
    default: str
    description: str


def help_keys(model: type[ProjectFile] = Project) -> list[KeyHelp]:
    """Every key of the project file, in the order of the file."""
    return [_help(section, name, field) for section, name, field in _fields(model)]


def template(model: type[ProjectFile] = Project) -> str:
    """A project file with every key explained; keys that can stay as they are, are commented out.

    A line that starts with ``#`` and no space is a key to uncomment.
    """
    lines = [
        "# Project file of navfuse. Lines that begin with # and no space are keys with their default or an example."
    ]
    current = ""
    for section, name, field in _fields(model):
        if section != current:
            current = section
            lines += ["", *_comment(inspect.getdoc(sections(model)[section]) or ""), f"[{section}]"]
        known = extra(field)
        notes = (f"[{known['unit']}]", f"({allowed_range(field)})")
        lines += ["", *_comment(" ".join([str(field.description), *(note for note in notes if len(note) > 2)]))]
        value = known["example"] if field.is_required() or field.default is None else field.default
        lines.append(f"{'' if known['shown'] else '#'}{name} = {toml_value(value)}")
    return "\n".join(lines) + "\n"


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent="# ", subsequent_indent="# ", break_on_hyphens=False)


def _fields(project: type[ProjectFile]) -> Iterator[tuple[str, str, FieldInfo]]:
    for section, model in sections(project).items():
        for name, field in model.model_fields.items():
            yield section, name, field


def _help(section: str, name: str, field: FieldInfo) -> KeyHelp:
    bounds = allowed_range(field)
    kind = type_words(field.annotation) + (f", {bounds}" if bounds else "")
    default = "required" if field.is_required() else "" if field.default is None else toml_value(field.default)
    return KeyHelp(f"{section}.{name}", extra(field)["unit"], kind, default, str(field.description))
