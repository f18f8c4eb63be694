"""Which column of a table holds which quantity, in which unit.

A reader lists the fields it understands; :func:`match_columns` finds them among a file's column names, whatever known
unit each is given in, and says which columns nobody asked for. The rules are those of the file contract: an unknown
unit is an error, an unknown column is ignored with a warning, and a missing column is an error that names the column
it was probably meant to be.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher

from navfuse.errors import InputError
from navfuse.io.units import UNITS, known_units, unit_factor

_RESEMBLANCE = 0.6


@dataclass(frozen=True, slots=True)
class Field:
    """One quantity that a table may hold.

    Attributes
    ----------
    base : str
        Column name without its unit, e.g. "gyro_x".
    quantity : str or None
        Key of :data:`navfuse.io.units.UNITS`; None for a column without a unit.
    unit : str
        Suffix of the native column, "" without a unit.
    text : bool
        The column holds words, not numbers.
    """

    base: str
    quantity: str | None = None
    unit: str = ""
    text: bool = False

    @property
    def name(self) -> str:
        """Native column name, e.g. "gyro_x_radps"."""
        return f"{self.base}_{self.unit}" if self.unit else self.base


@dataclass(frozen=True, slots=True)
class Match:
    """Where the fields of a table were found.

    Attributes
    ----------
    column : dict of str to str
        Base name -> column name in the file.
    factor : dict of str to float
        Base name -> factor that takes the column to SI.
    unknown : tuple of str
        Columns that no field asks for.
    source : str
        File, for messages.
    """

    column: dict[str, str]
    factor: dict[str, float]
    unknown: tuple[str, ...]
    source: str

    def has(self, bases: Iterable[str]) -> bool:
        """Whether every one of these base names was found."""
        return all(base in self.column for base in bases)

    def note_unknown(self) -> list[str]:
        """One note for the columns that are ignored, or none."""
        names = ", ".join(f"'{name}'" for name in self.unknown if name and not name.startswith("__index_level_"))
        if not names:
            return []
        return [f"{self.source}: ignored columns that navfuse does not know: {names}"]


def fields(quantity: str, unit: str, *bases: str) -> tuple[Field, ...]:
    """Several fields of one quantity and unit.

    Parameters
    ----------
    quantity, unit : str
        As in :class:`Field`.
    *bases : str
        Base names.
    """
    return tuple(Field(base, quantity, unit) for base in bases)


def match_columns(names: Sequence[str], known: Sequence[Field], source: str) -> Match:
    """Find known fields among a file's column names.

    Parameters
    ----------
    names : sequence of str
        Column names of the file.
    known : sequence of Field
        What the reader understands, required or not.
    source : str
        File, for messages.

    Returns
    -------
    Match

    Raises
    ------
    InputError
        If a column has no unit or an unknown one, or two columns hold the same quantity.
    """
    column: dict[str, str] = {}
    factor: dict[str, float] = {}
    claimed: set[str] = set()
    suspects: list[tuple[Field, str]] = []
    for field in known:
        for name in names:
            if name in claimed or not _belongs(name, field):
                continue
            suffix = name[len(field.base) + 1 :]
            if field.quantity is not None and suffix not in UNITS[field.quantity]:
                suspects.append((field, name))
                continue
            if field.base in column:
                raise InputError(
                    f"{source}: columns '{column[field.base]}' and '{name}' hold the same quantity; remove one of them"
                )
            column[field.base] = name
            factor[field.base] = 1.0 if field.quantity is None else unit_factor(field.quantity, suffix)
            claimed.add(name)
    for field, name in suspects:
        if field.base not in column and name not in claimed:
            _refuse_unit(field, name, source)
    return Match(column, factor, tuple(name for name in names if name not in claimed), source)


def require(match: Match, needed: Sequence[Field], table: str) -> None:
    """Refuse a table that lacks a column.

    Parameters
    ----------
    match : Match
        What was found.
    needed : sequence of Field
        What has to be there.
    table : str
        What the file is read as, for the message: "a GNSS table".

    Raises
    ------
    InputError
        Naming every missing column, and for each the unknown column that resembles it most.
    """
    missing = [field.name for field in needed if field.base not in match.column]
    if not missing:
        return
    hints = [
        f"'{name}' is missing, is the column '{like}' meant to be it?" if like else f"'{name}' is missing"
        for name, like in _resemblances(missing, match.unknown)
    ]
    if match.unknown or match.column:
        present = ", ".join(f"'{name}'" for name in [*match.column.values(), *match.unknown][:20])
    else:
        present = "none"
    raise InputError(f"{match.source}: {table} needs more columns: {'; '.join(hints)} (columns present: {present})")


def require_all_or_none(match: Match, group: Sequence[Field], table: str) -> bool:
    """Tell whether an optional group of columns is present, and refuse half of one.

    Parameters
    ----------
    match : Match
        What was found.
    group : sequence of Field
        Columns that only make sense together, e.g. the three velocities.
    table : str
        What the file is read as, for the message.

    Returns
    -------
    bool
        True if the group is complete, False if it is absent.

    Raises
    ------
    InputError
        If only a part of the group is there.
    """
    if not any(field.base in match.column for field in group):
        return False
    require(match, group, table)
    return True


def refuse_repeated_names(names: Sequence[str], source: str) -> None:
    """Refuse a table in which two columns have the same name.

    Parameters
    ----------
    names : sequence of str
        Column names.
    source : str
        File, for the message.

    Raises
    ------
    InputError
        Naming the column.
    """
    for index, name in enumerate(names):
        if name in names[:index]:
            raise InputError(f"{source}: the column '{name}' is there twice; remove or rename one of them")


def _belongs(name: str, field: Field) -> bool:
    if field.quantity is None:
        return name == field.base
    return name == field.base or name.startswith(field.base + "_")


def _refuse_unit(field: Field, name: str, source: str) -> None:
    if name == field.base:
        raise InputError(
            f"{source}: column '{name}' has no unit; rename it to '{field.name}', or to end in another known unit of"
            f" {field.quantity}: {known_units(field.quantity or '')}"
        )
    unit_factor(field.quantity or "", name[len(field.base) + 1 :], name, source)


def _resemblances(missing: Sequence[str], unknown: Sequence[str]) -> list[tuple[str, str]]:
    """Pair every missing name with the unused unknown one most like it, best pairs first; "" where none is alike."""
    scores = sorted(
        (
            (SequenceMatcher(None, name.lower(), other.lower()).ratio(), name, other)
            for name in missing
            for other in unknown
        ),
        reverse=True,
    )
    pairs: dict[str, str] = {}
    for score, name, other in scores:
        if score >= _RESEMBLANCE and name not in pairs and other not in pairs.values():
            pairs[name] = other
    return [(name, pairs.get(name, "")) for name in missing]
