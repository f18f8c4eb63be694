"""Text from outside made harmless to show: names of columns, files, fixes, sensors, and warnings that quote them."""

from __future__ import annotations

import re

LONGEST = 2000
LABEL = 32

_UNPRINTABLE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b\u200e\u200f\u202a-\u202e\u2060-\u2069\ufeff\ufff0-\ufffc\ufffe\uffff\ud800-\udfff]"
)


def shown(text: object, longest: int = LONGEST) -> str:
    """Text to show, not yet escaped for HTML.

    Parameters
    ----------
    text : object
        Made a string.
    longest : int
        Of longer text the middle is left out.

    Returns
    -------
    str
        With U+FFFD for every control character, for what turns the direction of writing, and for halves of surrogate
        pairs, which no UTF-8 file can hold.
    """
    found = _UNPRINTABLE.sub("\ufffd", str(text))
    if len(found) <= longest:
        return found
    head = (longest - 1) * 2 // 3
    return f"{found[:head]}…{found[head - longest + 1 :]}"


def label(name: object) -> str:
    """A name, short enough for an axis or a legend, with blanks for underscores."""
    return shown(name, LABEL).replace("_", " ")
