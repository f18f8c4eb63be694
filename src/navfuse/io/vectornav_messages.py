"""Decoded messages of a VectorNav sensor, whichever protocol they came in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Messages:
    """Messages of one kind, in the order of the file.

    Attributes
    ----------
    kind : str
        Header: "VNYMR", or the hexadecimal bytes of a binary one.
    values : mapping of str to (n,) or (n, k) array
        By the names of :mod:`navfuse.io.vectornav_fields`, in the units of the sensor. A field with rows has an object
        array of structured arrays.
    stamp : (n,) array [s]
        The file's own time beside each message; NaN where it has none.
    index : (n,) int array
        Number of the message among all of its kind, broken ones included.
    """

    kind: str
    values: Mapping[str, Any]
    stamp: Array
    index: Array

    def __len__(self) -> int:
        return self.index.size


@dataclass(frozen=True, slots=True, eq=False)
class Damage:
    """What could not be used of a file.

    Attributes
    ----------
    checksum : int
        Messages whose checksum is wrong.
    cut : int
        Messages that end early, or have another number of fields than their header promises.
    other : int
        Sound messages that hold no measurements: answers to commands, unknown headers.
    skipped_bytes : int
        Bytes that belong to no sound message (of binary files).
    first : str
        Where the first broken message is, "" for none.
    """

    checksum: int = 0
    cut: int = 0
    other: int = 0
    skipped_bytes: int = 0
    first: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class VectorNavLog:
    """A file of VectorNav messages.

    Attributes
    ----------
    messages : mapping of str to Messages
        By kind.
    damage : Damage
    source : str
    notes : tuple of str
        Text of every warning.
    """

    messages: Mapping[str, Messages]
    damage: Damage
    source: str
    notes: tuple[str, ...] = ()

    def counts(self) -> dict[str, int]:
        """Number of sound messages by kind."""
        return {kind: len(found) for kind, found in self.messages.items()}
