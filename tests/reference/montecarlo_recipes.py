"""Recipes that misbehave, at the top level of a module so that other processes can import them."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

from navfuse.errors import InputError
from navfuse.montecarlo import Case, SimulatedRecipe

SHORT = SimulatedRecipe("car", duration=20.0, imu_rate=20.0, scale_states=False)


@dataclass(frozen=True)
class EverySecondBreaks:
    """The filter of every odd seed is fed a start long before its inertial data."""

    duration: float = 20.0

    def __call__(self, seed: int) -> Case:
        case = SHORT(seed)
        return replace(case, start=replace(case.start, time=-100.0)) if seed % 2 else case


def ends_its_process(seed: int) -> Case:
    os._exit(3)


def interrupted_at_five(seed: int) -> Case:
    if seed == 5:
        raise KeyboardInterrupt
    return SHORT(seed)


def longer_with_the_seed(seed: int) -> Case:
    return replace(SHORT, duration=20.0 + seed)(seed)


def refuses(seed: int) -> Case:
    raise InputError("the motion is not known here")
