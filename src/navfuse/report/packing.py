"""Arrays of the page as one block of bytes beside its JSON: about three bytes a value after compression.

A curve is drawn, not computed with: times and places are kept to a step (increments of integers), everything else to
16 significant bits. Bytes of equal weight stand together, so that gzip finds their likeness.
"""

from __future__ import annotations

import json
from typing import Any, NamedTuple

import numpy as np

Array = np.ndarray

LARGEST = 2**31 - 1


class Steps(NamedTuple):
    """Values kept as multiples of a step, which grows where the range asks for it."""

    values: Array
    step: float


def pack(tree: Any) -> tuple[bytes, bytes]:
    """JSON text of a tree of dictionaries, lists and numbers, and the bytes of the arrays in it.

    An array stands in the JSON as ``{"at", "n", "planes"}``, with ``{"step", "first"}`` if it is kept in steps;
    numbers that are not finite stand as null.

    Parameters
    ----------
    tree : nested dict, list or tuple
        Leaves are str, int, float, bool, None, arrays (m,), or :class:`Steps`.
    """
    block = bytearray()

    def plain(node: Any) -> Any:
        if isinstance(node, dict):
            return {key: plain(entry) for key, entry in node.items()}
        if isinstance(node, Steps):
            return _steps(node, block)
        if isinstance(node, np.ndarray):
            return _floats(node, block)
        if isinstance(node, (list, tuple)):
            return [plain(entry) for entry in node]
        if isinstance(node, float) and not np.isfinite(node):
            return None
        return node

    text = json.dumps(plain(tree), separators=(",", ":"), allow_nan=False)
    return text.encode(), bytes(block)


def _steps(node: Steps, block: bytearray) -> dict[str, Any]:
    values = np.asarray(node.values, dtype=np.float64)
    if not values.size or not np.isfinite(values).all():
        return _floats(values, block, planes=4)
    first = float(values[0])
    reach = float(np.abs(values - first).max())
    step = max(node.step, 2.1 * reach / LARGEST)
    ticks = np.rint((values - first) / step).astype(np.int64)
    words = np.diff(ticks, prepend=0).astype("<i4").view("<u4")
    return _planes(words, block, 4) | {"step": step, "first": first}


def _floats(values: Array, block: bytearray, planes: int = 3) -> dict[str, Any]:
    words = np.ascontiguousarray(values, dtype="<f4").view("<u4")
    if planes == 3:
        # Rounding up may carry from the largest number into infinity, and never out of a NaN.
        words = np.where(np.isfinite(words.view("<f4")), words + np.uint32(0x80), words)
    return _planes(words, block, planes)


def _planes(words: Array, block: bytearray, planes: int) -> dict[str, Any]:
    at = len(block)
    for k in range(planes):
        block += ((words >> np.uint32(24 - 8 * k)) & np.uint32(0xFF)).astype(np.uint8).tobytes()
    return {"at": at, "n": int(words.size), "planes": planes}


def unpack(entry: dict[str, Any], block: bytes) -> Array:
    """An array of :func:`pack` again, as the page's script reads it."""
    n = entry["n"]
    words = np.zeros(n, dtype="<u4")
    for k in range(entry["planes"]):
        plane = np.frombuffer(block, np.uint8, n, entry["at"] + k * n)
        words |= plane.astype("<u4") << np.uint32(24 - 8 * k)
    if "step" not in entry:
        return words.view("<f4").astype(np.float64)
    return entry["first"] + entry["step"] * np.cumsum(words.view("<i4").astype(np.int64))
