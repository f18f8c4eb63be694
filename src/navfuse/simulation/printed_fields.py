"""Printed keys, whose names end in their unit, turned into checked fields in SI, for models of simulated sensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from navfuse.core.nearest import nearest
from navfuse.core.printed_keys import numbers, shown
from navfuse.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike

Array = np.ndarray


def to_fields(what: str, printed: Mapping[str, Any], units: Mapping[str, tuple[str, float]]) -> dict[str, Array]:
    """Fields in SI from keys in printed units.

    Parameters
    ----------
    what : str
        Name of the thing described, for messages.
    printed : mapping
        Key with its unit -> number or nested numbers.
    units : mapping
        Key with its unit -> (field, factor to SI).

    Raises
    ------
    ConfigError
        For a key that is not in `units` (the nearest one is named), a field given in two units, or a value that is not
        made of numbers.
    """
    fields: dict[str, Array] = {}
    for key, value in printed.items():
        if key not in units:
            raise unknown_key(what, key, units)
        name, factor = units[key]
        if name in fields:
            raise ConfigError(f"{what}: {key!r} sets {name} a second time; give it in one unit only")
        fields[name] = numbers(key, value) * factor
    return fields


def unknown_key(what: str, key: str, known: Iterable[str]) -> ConfigError:
    """The error that names the known key nearest to an unknown one."""
    known = list(known)
    close = nearest(key, known)
    hint = f"did you mean {close!r}?" if close else f"known: {', '.join(known)}"
    return ConfigError(f"{what}: unknown key or unit {key!r}: {hint}")


def one_number(
    name: str, value: ArrayLike, *, least: float = 0.0, infinite: bool = False, above: bool = False
) -> float:
    """One float of at least `least` (with `above`, beyond it), finite unless `infinite`.

    Raises
    ------
    ConfigError
    """
    number = numbers(name, value)
    if number.ndim != 0:
        raise ConfigError(f"{name} must be one number, not an array of shape {number.shape}")
    wanted = f"{'more than' if above else 'at least'} {least:g}" if least > -np.inf else "a number"
    inside = number > least if above else number >= least
    if not inside or not (infinite or np.isfinite(number)):
        raise ConfigError(f"{name} must be {wanted}{'' if infinite else ' and finite'}, not {shown(value)}")
    return float(number)


def three_sizes(name: str, value: ArrayLike) -> Array:
    """Three finite numbers that are not negative; one stands for three. Read-only.

    Raises
    ------
    ConfigError
    """
    sizes = numbers(name, value)
    if sizes.shape not in ((), (3,)):
        raise ConfigError(f"{name} must be one number or three, not an array of shape {sizes.shape}")
    if not np.all(np.isfinite(sizes)) or np.any(sizes < 0.0):
        raise ConfigError(f"{name} must be finite and not negative, not {shown(value)}")
    return frozen(np.broadcast_to(sizes, (3,)))


def any_number(name: str, value: ArrayLike) -> float:
    """One finite float of either sign.

    Raises
    ------
    ConfigError
    """
    return one_number(name, value, least=-np.inf)


def tau(name: str, value: ArrayLike) -> float:
    """A correlation time [s]: not negative, perhaps infinite.

    Raises
    ------
    ConfigError
    """
    return one_number(name, value, infinite=True)


def three_numbers(name: str, value: ArrayLike) -> Array:
    """Three finite numbers of either sign. Read-only.

    Raises
    ------
    ConfigError
    """
    vector = numbers(name, value)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise ConfigError(f"{name} must be three finite numbers, not {shown(value)}")
    return frozen(vector)


def one_or_several(name: str, value: ArrayLike, count: int, what: str, least: float = -np.inf) -> Array:
    """Finite numbers of at least `least`, one for each of `count` things; a single one stands for all. Read-only.

    Raises
    ------
    ConfigError
        `what` names the things in the message: "wheels".
    """
    values = numbers(name, value)
    if values.shape not in ((), (count,)):
        raise ConfigError(f"{name} must be one number or one for each of the {count} {what}, not {shown(value)}")
    if not np.all(np.isfinite(values) & (values >= least)):
        raise ConfigError(f"{name} must be finite{'' if least < 0.0 else ' and not negative'}, not {shown(value)}")
    return frozen(np.broadcast_to(values, (count,)))


def windows(name: str, value: ArrayLike) -> Array:
    """Windows [from, to) of time, (m, 2), m >= 0. Read-only.

    Raises
    ------
    ConfigError
    """
    pairs = numbers(name, value)
    pairs = pairs.reshape(0, 2) if pairs.size == 0 else pairs
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not np.all(pairs[:, 0] < pairs[:, 1]):
        raise ConfigError(f"{name} must be windows [from, to] with from < to, not {shown(value)}")
    return frozen(pairs)


def tables(name: str, value: Any, kind: type) -> list[Any]:
    """A list of tables, or of things of a kind that have been made of tables already.

    Raises
    ------
    ConfigError
    """
    entries = list(things(name, value))
    for entry in entries:
        if not isinstance(entry, Mapping | kind):
            raise ConfigError(f"{name} must be a list of tables, and one entry is {shown(entry)}")
    return entries


def things(name: str, value: Any, kind: type = object) -> tuple[Any, ...]:
    """A list of things of one kind, as a tuple.

    Raises
    ------
    ConfigError
    """
    if not isinstance(value, list | tuple):
        raise ConfigError(f"{name} must be a list of tables, not {shown(value)}")
    for entry in value:
        if not isinstance(entry, kind):
            raise ConfigError(f"{name} must hold {kind.__name__}, not {type(entry).__name__}")
    return tuple(value)


def yes_or_no(name: str, value: Any) -> bool:
    """True or False.

    Raises
    ------
    ConfigError
    """
    if not isinstance(value, bool):
        raise ConfigError(f"{name} must be true or false, not {shown(value)}")
    return value


def frozen(values: ArrayLike) -> Array:
    """A read-only copy."""
    copy = np.array(values, dtype=float)
    copy.flags.writeable = False
    return copy
