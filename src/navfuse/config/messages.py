"""What pydantic found wrong, said in the words of the project file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from navfuse.config.toml_text import toml_value, type_words, with_article
from navfuse.core.nearest import nearest
from navfuse.errors import ConfigError

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError
    from pydantic_core import ErrorDetails


def config_error(error: ValidationError, project: type[BaseModel], data: Any, source: str) -> ConfigError:
    """One error for everything that is wrong, each key once.

    Parameters
    ----------
    error : ValidationError
    project : type of BaseModel
        The model that was filled.
    data : object
        What it was filled from.
    source : str
        Name of the file, for the message.
    """
    details = error.errors(include_url=False, include_context=True, include_input=False)
    unknown = [detail for detail in details if detail["type"] == "extra_forbidden"]
    found: dict[str, str] = {}
    for detail in unknown + [detail for detail in details if detail not in unknown]:
        found.setdefault(_name(detail), _message(detail, project, data))
    suggested = [line for line in found.values() if "did you mean" in line]
    lines = [line for name, line in found.items() if not (line == f"{name}: missing" and _hints_at(name, suggested))]
    if len(lines) == 1:
        return ConfigError(f"{source}: {lines[0]}")
    return ConfigError(f"{source}: {len(lines)} keys are wrong\n" + "\n".join(f"  {line}" for line in lines))


def _name(detail: ErrorDetails) -> str:
    return ".".join(str(part) for part in detail["loc"][:2])


def _hints_at(name: str, lines: list[str]) -> bool:
    return any(line.endswith(f"did you mean {name}?") for line in lines)


def _message(detail: ErrorDetails, project: type[BaseModel], data: Any) -> str:
    path = tuple(str(part) for part in detail["loc"][:2])
    name, kind = _name(detail), detail["type"]
    if kind == "extra_forbidden":
        return f"{name}: unknown {'section' if _is_table(data, path) else 'key'}; {_suggestion(path, project)}"
    if kind == "missing" and len(detail["loc"]) <= 2:
        return f"{name}: missing"
    reason = str(detail["ctx"]["error"]) if kind == "value_error" and "ctx" in detail else ""
    if len(path) < 2:
        return reason or (f"{name} must be a table, written as [{name}]" if path else "must be a table of sections")
    field = sections(project)[path[0]].model_fields[path[1]]
    value = toml_value(data[path[0]][path[1]])
    return f"{name} = {value}: {reason or 'must be ' + with_article(type_words(field.annotation))}"


def sections(project: type[BaseModel]) -> dict[str, type[BaseModel]]:
    """The tables of the project file by name."""
    return {name: cast("type[BaseModel]", field.annotation) for name, field in project.model_fields.items()}


def _is_table(data: Any, path: tuple[str, ...]) -> bool:
    return len(path) == 1 and isinstance(data.get(path[0]), dict)


def _suggestion(path: tuple[str, ...], project: type[BaseModel]) -> str:
    tables = sections(project)
    if len(path) == 1 and (close := nearest(path[0], tables, 0.6)):
        return f"did you mean [{close}]?"
    here = list(tables[path[0]].model_fields) if len(path) == 2 else []
    if close := _nearest(path[-1], here, 0.6):
        return f"did you mean {path[0]}.{close}?"
    for name, table in tables.items():
        if close := _nearest(path[-1], list(table.model_fields), 0.85):
            return f"did you mean {name}.{close}?"
    if here:
        return f"[{path[0]}] has {', '.join(here)}"
    return f"there are {', '.join(f'[{name}]' for name in tables)}"


def _nearest(word: str, known: list[str], cutoff: float) -> str | None:
    """The known key most like `word`: with a unit put behind it, or spelt nearly so."""
    without_unit = [name for name in known if name.startswith(f"{word}_")]
    return without_unit[0] if without_unit else nearest(word, known, cutoff)
