"""How a key of the project file is declared: its unit, its range and its description travel with the field."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator
from pydantic.fields import FieldInfo

Number = Annotated[float, Field(strict=True)]
Week = Annotated[int, Field(strict=True)]
Vector = tuple[Number, Number, Number]
Matrix = tuple[Vector, Vector, Vector]

LARGEST = 1e12
"""No quantity of a project is larger; the square of one that is would overflow."""

_BOUNDS = {
    "minimum": (">=", lambda value, bound: value >= bound),
    "exclusiveMinimum": (">", lambda value, bound: value > bound),
    "maximum": ("<=", lambda value, bound: value <= bound),
    "exclusiveMaximum": ("<", lambda value, bound: value < bound),
}


def key(
    default: Any,
    unit: str,
    description: str,
    *,
    least: float | None = None,
    above: float | None = None,
    most: float | None = None,
    below: float | None = None,
    endless: bool = False,
    example: Any = None,
    shown: bool = False,
) -> Any:
    """Declare a key of the project file.

    Parameters
    ----------
    default : object
        Value where the file says nothing; ``...`` for a key that must be given, None for one that has no fixed default.
    unit : str
        As shown to people; empty for none.
    description : str
        What it is, in whole sentences.
    least, above, most, below : float, optional
        Allowed range: ``>=``, ``>``, ``<=``, ``<``. It holds for every number of the value.
    endless : bool
        Whether ``inf`` is allowed.
    example : object
        What the template shows where `default` is no value.
    shown : bool
        Whether the template writes the key out, not as a comment.
    """
    given = {"minimum": least, "exclusiveMinimum": above, "maximum": most, "exclusiveMaximum": below}
    extra: dict[str, Any] = {name: bound for name, bound in given.items() if bound is not None}
    return Field(
        default,
        description=description,
        json_schema_extra={"unit": unit, "endless": endless, "example": example, "shown": shown, **extra},
    )


def extra(field: FieldInfo) -> dict[str, Any]:
    """Unit, bounds and example of a field declared by :func:`key`."""
    return field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}


def allowed_range(field: FieldInfo) -> str:
    """The range of a field in words, e.g. ``>= -90 and <= 90``; empty when there is none."""
    known = extra(field)
    return " and ".join(f"{sign} {known[name]:g}" for name, (sign, _) in _BOUNDS.items() if name in known)


class Section(BaseModel):
    """A table of the project file: no unknown keys, numbers finite and in their range, not changeable afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=True)

    @field_validator("*", mode="after")
    @classmethod
    def _check_range(cls, value: Any, info: ValidationInfo) -> Any:
        field = cls.model_fields[str(info.field_name)]
        known = extra(field)
        for number in _numbers(value):
            if math.isnan(number) or (math.isinf(number) and not known.get("endless")):
                raise ValueError("must be a finite number")
            if math.isfinite(number) and abs(number) > LARGEST:
                raise ValueError(f"must be a number of sensible size, not beyond {LARGEST:g}")
            for name, (_, holds) in _BOUNDS.items():
                if name in known and not holds(number, known[name]):
                    raise ValueError(f"must be {allowed_range(field)}")
        return value


def _numbers(value: Any) -> Iterator[float]:
    """Every number of a value, at any depth."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        yield value
    elif isinstance(value, tuple):
        for item in value:
            yield from _numbers(item)
