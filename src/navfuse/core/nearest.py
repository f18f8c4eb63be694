"""The known word that was meant, for messages."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def nearest(word: object, known: Iterable[str], cutoff: float = 0.4) -> str | None:
    """The known word most like another.

    Parameters
    ----------
    word : object
        As it was given; compared as text.
    known : iterable of str
    cutoff : float
        Least likeness, 0 to 1 (:func:`difflib.get_close_matches`).

    Returns
    -------
    str or None
        None if none is alike.
    """
    close = difflib.get_close_matches(str(word), list(known), n=1, cutoff=cutoff)
    return close[0] if close else None
