"""Tables of a scenario file, read key by key: what is not read in the end is unknown, and the nearest key is named."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from navfuse.core.nearest import nearest as nearest_word
from navfuse.core.printed_keys import LARGEST, shown
from navfuse.errors import ConfigError


class ScenarioTable:
    """One table of a scenario file.

    Parameters
    ----------
    where : str
        Name for messages, e.g. ``city-car: [motion]``.
    table : mapping

    Raises
    ------
    ConfigError
        From every method, naming table and key. A table that is none is refused on construction.
    """

    def __init__(self, where: str, table: Any) -> None:
        if not isinstance(table, Mapping):
            raise ConfigError(f"{where}: must be a table of keys, not {shown(table)}")
        self.where = where
        self._table = dict(table)
        self._known: list[str] = []

    def __contains__(self, key: str) -> bool:
        """Whether the key is there; asking makes it a known one."""
        self._known.append(key)
        return key in self._table

    def get(self, key: str, default: Any = None) -> Any:
        """The value of a key as it stands, or the default."""
        self._known.append(key)
        return self._table.get(key, default)

    def need(self, key: str) -> Any:
        """The value of a key that has to be there."""
        self._known.append(key)
        if key not in self._table:
            raise ConfigError(f"{self.where}: {key} is missing")
        return self._table[key]

    def number(self, key: str, default: float | None = None, factor: float = 1.0, *, above: float = -math.inf) -> float:
        """A finite number above a bound, times a factor; without a default it has to be there."""
        value = self.need(key) if default is None else self.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
            raise ConfigError(f"{self.where}: {key} must be a finite number{_bound(value)}, not {shown(value)}")
        if not value > above:
            raise ConfigError(f"{self.where}: {key} must be more than {above:g}, not {shown(value)}")
        return float(value) * factor

    def whole(self, key: str, default: int) -> int:
        """A whole number of at least 0."""
        value = self.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise ConfigError(f"{self.where}: {key} must be a whole number of at least 0, not {shown(value)}")
        return value

    def yes(self, key: str) -> bool:
        """Whether a key that is there is true."""
        value = self.need(key)
        if not isinstance(value, bool):
            raise ConfigError(f"{self.where}: {key} must be true or false, not {shown(value)}")
        return value

    def text(self, key: str, default: str | None = None, known: Iterable[str] | None = None) -> str:
        """A text, one of those known if any are given."""
        value = self.need(key) if default is None else self.get(key, default)
        if not isinstance(value, str):
            raise ConfigError(f"{self.where}: {key} must be a text, not {shown(value)}")
        if known is not None and value not in (known := list(known)):
            raise ConfigError(f"{self.where}: {key} = {value!r} is none of {', '.join(known)}{nearest(value, known)}")
        return value

    def three(
        self, key: str, default: tuple[float, float, float] | None = None, *, least: float = -math.inf
    ) -> tuple[float, float, float]:
        """Three finite numbers."""
        value = self.need(key) if default is None else self.get(key, default)
        numbers = value if isinstance(value, list | tuple) else ()
        good = [
            isinstance(x, int | float) and not isinstance(x, bool) and least <= x and abs(x) <= LARGEST for x in numbers
        ]
        if len(good) != 3 or not all(good):
            bound = f" of at least {least:g}" if least > -math.inf else ""
            large = next(filter(None, map(_bound, numbers)), "")
            raise ConfigError(f"{self.where}: {key} must be three finite numbers{bound}{large}, not {shown(value)}")
        x, y, z = map(float, numbers)
        return x, y, z

    def tables(self, key: str) -> list[Any]:
        """A list of tables."""
        value = self.need(key)
        if not isinstance(value, list) or not value or not all(isinstance(entry, Mapping) for entry in value):
            raise ConfigError(f"{self.where}: {key} must be a list of tables, not {shown(value)}")
        return value

    def rest(self) -> dict[str, Any]:
        """Every key that has not been read yet; now it has."""
        found = {key: value for key, value in self._table.items() if key not in self._known}
        self._known += found
        return found

    def finish(self) -> None:
        """Refuse the first key that nothing asked for."""
        for key in self._table:
            if key not in self._known:
                hint = nearest(key, self._known) or f"; it has {', '.join(dict.fromkeys(self._known))}"
                raise ConfigError(f"{self.where}: unknown key '{key}'{hint}")


def nearest(word: object, known: Iterable[str]) -> str:
    """The known word most like another, as the end of a sentence; nothing if there is none."""
    close = nearest_word(word, known, 0.5)
    return f"; did you mean {close}?" if close else ""


def _bound(value: object) -> str:
    """What is asked of a number that is finite and too large; nothing of anything else."""
    large = isinstance(value, int | float) and LARGEST < abs(value) < math.inf
    return f" of at most {LARGEST:g} in size" if large else ""
