"""JSON files: written whole or not at all, strict enough for any reader."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from navfuse.io.atomic import atomic_file


def write_json(path: str | os.PathLike[str], content: Mapping[str, Any]) -> None:
    """Write a mapping as indented JSON.

    Parameters
    ----------
    path : path-like
        Destination, replaced if it exists.
    content : mapping
        Nested mappings, sequences, dataclasses, numpy arrays and scalars, paths, strings, numbers. NaN and infinities,
        which JSON does not have, become null.

    Raises
    ------
    OutputError
        If the file cannot be written.
    TypeError
        If a value is of a type that has no JSON form.
    """
    text = json.dumps(to_plain(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    with atomic_file(path) as part:
        part.write_text(text, encoding="utf-8")


def to_plain(value: Any) -> Any:
    """Turn a value into what JSON can hold: dict, list, str, int, float, bool or None.

    Parameters
    ----------
    value : object
        See :func:`write_json`.

    Returns
    -------
    object

    Raises
    ------
    TypeError
        If the type has no JSON form.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return to_plain(asdict(value))
    if isinstance(value, Mapping):
        return {str(key): to_plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return to_plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [to_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int | bool):
        return value
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"a {type(value).__name__} cannot be written as JSON")
