"""How fast a simulated sensor may sample, and how many rows or knots are made at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

from navfuse.core.printed_keys import shown
from navfuse.errors import ConfigError
from navfuse.simulation.printed_fields import one_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

FASTEST_HZ = 10_000.0
"""Largest sampling rate [Hz]."""

MOST_ROWS = 100_000_000
"""Rows of a log, knots of a motion or random events of one kind. A day at 1 kHz has 86.4 million rows."""


def sampling_rate(name: str, value: ArrayLike) -> float:
    """A rate [Hz] above 0 and at most :data:`FASTEST_HZ`.

    Raises
    ------
    ConfigError
    """
    rate = one_number(name, value, above=True)
    if rate > FASTEST_HZ:
        raise ConfigError(f"{name} must be at most {FASTEST_HZ:g} Hz, not {shown(value)}")
    return rate


def require_rows(count: float, what: str) -> None:
    """Refuse more than :data:`MOST_ROWS`, before any memory is asked for.

    Parameters
    ----------
    count : float
        May be infinite.
    what : str
        The begin of the message: what would have so many.

    Raises
    ------
    ConfigError
    """
    if not count <= MOST_ROWS:
        raise ConfigError(
            f"{what} would make {count:.3g} rows; at most {MOST_ROWS:,} are made (24 h at 1 kHz are 86.4 million): "
            "shorten the motion or lower the rate"
        )
