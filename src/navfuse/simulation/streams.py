"""Streams of random numbers by name, so that switching one error on leaves the draws of all others alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


class Streams:
    """One stream for each name, children of a generator in the order of the names; made when first asked for.

    Parameters
    ----------
    rng : numpy Generator
        Advanced by spawning as many children as there are names, whether they are used or not.
    names : sequence of str
    """

    def __init__(self, rng: np.random.Generator, names: Sequence[str]) -> None:
        self._kind = type(rng.bit_generator)
        children = rng.bit_generator.seed_seq.spawn(len(names))  # pyright: ignore[reportAttributeAccessIssue]
        self._seeds = dict(zip(names, children, strict=True))
        self._made: dict[str, np.random.Generator] = {}

    def __getitem__(self, name: str) -> np.random.Generator:
        if name not in self._made:
            self._made[name] = np.random.Generator(self._kind(self._seeds[name]))
        return self._made[name]

    def normal(self, name: str, sd: np.ndarray) -> np.ndarray:
        """Independent normal draws with the deviations `sd`, of its shape; zeros without a draw where all are zero."""
        return sd * self[name].standard_normal(sd.shape) if sd.any() else np.zeros(sd.shape)
