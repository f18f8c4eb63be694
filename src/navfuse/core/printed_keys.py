"""Values that users give under keys with a unit in their name: read as numbers, and shown again in messages."""

from __future__ import annotations

import math
import re
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from navfuse.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import ArrayLike

Array = np.ndarray

LARGEST = 1e100
"""Finite numbers may be this large in size: their squares and the sums of those are still floats."""

_NUMERIC_KINDS = "iuf"


def numbers(name: str, value: ArrayLike, wanted: str = "a number or an array of numbers") -> Array:
    """A value as an array of floats.

    Parameters
    ----------
    name : str
        For messages.
    value : array-like
        Numbers, nested or not; texts and truth values are none, though numpy would take them for some.
    wanted : str
        What the message asks for.

    Raises
    ------
    ConfigError
        If it is not made of numbers, or a finite one is larger than :data:`LARGEST` in size.
    """
    try:
        array = np.asarray(value, dtype=float) if _made_of_numbers(value) else None
    except OverflowError as error:
        raise ConfigError(f"{name} must be at most {LARGEST:g} in size, not {shown(value)}") from error
    except (TypeError, ValueError):
        array = None
    if array is None:
        raise ConfigError(f"{name} must be {wanted}, not {shown(value)}")
    if np.any(np.isfinite(array) & (np.abs(array) > LARGEST)):
        raise ConfigError(f"{name} must be at most {LARGEST:g} in size, not {shown(value)}")
    return array


def shown(value: Any) -> str:
    """A value for a message, as a user would write it: arrays as lists, numpy's numbers as plain ones."""
    return repr(_plain(value))


@contextmanager
def naming_keys(printed: Mapping[str, Any], units: Mapping[str, tuple[str, float]]) -> Iterator[None]:
    """Put key and value as they were given before the message of a model, which speaks of its own field in SI units.

    Parameters
    ----------
    printed : mapping
        Key with its unit -> value as given.
    units : mapping
        Key with its unit -> (field, factor to SI).

    Raises
    ------
    ConfigError
        That of the block, which begins with the name of a field.
    """
    try:
        yield
    except ConfigError as error:
        field = re.match(r"\w*", str(error))[0]  # pyright: ignore[reportOptionalSubscript]
        keys = [key for key in printed if key != field and key in units and units[key][0] == field]
        if len(keys) != 1:
            raise
        raise ConfigError(f"{keys[0]} = {shown(printed[keys[0]])}: {error}") from error


def _made_of_numbers(value: Any) -> bool:
    if isinstance(value, np.ndarray | np.generic):
        if value.dtype != object:
            return value.dtype.kind in _NUMERIC_KINDS
        value = value.tolist()
    if isinstance(value, list | tuple):
        return all(_made_of_numbers(entry) for entry in value)
    return not (value is None or isinstance(value, bool | str | bytes | complex))


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, int) and abs(value) > LARGEST:
        return _Digits(value)
    if type(value) is tuple:
        return tuple(map(_plain, value))
    return list(map(_plain, value)) if type(value) is list else value


class _Digits(int):
    """A whole number that nobody wants to read to its end."""

    def __repr__(self) -> str:
        return f"a whole number of some {math.ceil(math.log10(2.0) * self.bit_length())} digits"
