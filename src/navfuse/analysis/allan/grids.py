"""Averaging factors: which averaging times a deviation is computed at."""

from __future__ import annotations

import re

import numpy as np

from navfuse.errors import ConfigError

Array = np.ndarray

NAMED = ("octave", "decade", "all")


def averaging_factors(grid: str | int, longest: int) -> Array:
    """Averaging factors in samples, from 1 up.

    Parameters
    ----------
    grid : str or int
        "octave": powers of two; "decade": 1, 2 and 4 times powers of ten; "all": every integer; a number, or text such
        as "20 per decade": that many in each decade, equally spaced in the logarithm and rounded to integers.
    longest : int
        Largest factor, >= 1.

    Returns
    -------
    (t,) int array
        Increasing, without repetition.

    Raises
    ------
    ConfigError
        For another word, or a number that is not from 1 to 10 000.
    """
    text = str(grid).strip().lower()
    if text == "all":
        return np.arange(1, longest + 1)
    if text == "octave":
        return 2 ** np.arange(int(np.log2(longest)) + 1)
    if text == "decade":
        powers = 10 ** np.arange(int(np.log10(longest)) + 1)
        factors = np.sort(np.outer(powers, (1, 2, 4)).ravel())
        return factors[factors <= longest]
    number = re.fullmatch(r"(\d+)(?:\s*(?:/|per[ -]?)\s*decade)?", text)
    if number is None or not 1 <= int(number[1]) <= 10_000:
        raise ConfigError(
            f"tau grid {grid!r}: give octave, decade, all, or a number from 1 to 10000 of averaging times per decade"
        )
    per = int(number[1])
    steps = np.arange(int(np.ceil(per * np.log10(max(longest, 1)))) + 1)
    factors = np.unique(np.rint(10.0 ** (steps / per)).astype(np.int64))
    return factors[factors <= longest]
