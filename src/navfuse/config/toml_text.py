"""Values as TOML, and the types of keys in words."""

from __future__ import annotations

import json
import math
import types
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

_COUNTABLE = ("number", "whole number", "path", "list")
_WORDS = {float: "number", int: "whole number", bool: "true or false", str: "text", Path: "path"}
_PLURAL = {"number": "numbers", "text": "texts"}


def toml_value(value: Any) -> str:
    """A value as it would stand in a TOML file.

    Parameters
    ----------
    value : bool, int, float, str, Path, or nested tuples and lists of these; other objects as Python prints them.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(float(value))
    if isinstance(value, Path):
        return json.dumps(value.as_posix(), ensure_ascii=False)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, list | tuple):
        return f"[{', '.join(toml_value(item) for item in value)}]"
    return repr(value)


def type_words(annotation: Any) -> str:
    """What a key of this type takes, in words: ``number``, ``"rts" or "none"``, ``list of 3 numbers``."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return type_words(arguments[0])
    if origin in (Union, types.UnionType):
        return " or ".join(type_words(argument) for argument in arguments if argument is not type(None))
    if origin is Literal:
        return " or ".join(toml_value(argument) for argument in arguments)
    if origin is tuple:
        words = [type_words(argument) for argument in arguments if argument is not Ellipsis]
        if len(set(words)) > 1:
            return f"list of {', '.join(words)}"
        word = words[0].replace("list of", "lists of", 1)
        return f"list of {'' if Ellipsis in arguments else f'{len(words)} '}{_PLURAL.get(word, word)}"
    return _WORDS.get(annotation, getattr(annotation, "__name__", str(annotation)))


def with_article(words: str) -> str:
    """The type in words, as it stands in a sentence: ``a number``, ``"rts" or "none"``."""
    return " or ".join(f"a {part}" if part.startswith(_COUNTABLE) else part for part in words.split(" or "))
