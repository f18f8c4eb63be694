"""Named states: an ordered list of blocks, with offsets and the stochastic model of each state."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from navfuse.errors import ConfigError

NAVIGATION_STATES = 9
"""Position, velocity and attitude errors always come first."""

CROSS_PAIRS = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
"""Row and column in the error matrix M of an inertial sensor of its six cross-coupling states, in order."""


@dataclass(frozen=True, slots=True)
class Block:
    """A run of states that belong together.

    Attributes
    ----------
    name : str
        Unique in a layout, e.g. ``"gyro_bias"``; blocks of an aiding sensor are named ``"sensor.block"``.
    size : int
    sd : float or (size,) array
        Standard deviation at the start; for a Gauss-Markov state also in the steady state. Unit of the state.
    tau : float or (size,) array [s]
        Correlation time; ``inf`` for a random constant or random walk.
    walk : float or (size,) array
        Square root of the random-walk density, unit of the state per sqrt(s); only with ``tau = inf``.
    value : float or (size,) array
        Estimate at the start.
    """

    name: str
    size: int
    sd: float | np.ndarray
    tau: float | np.ndarray = np.inf
    walk: float | np.ndarray = 0.0
    value: float | np.ndarray = 0.0


@dataclass(frozen=True)
class Layout:
    """The state vector of a filter: navigation errors, inertial sensor states, then the aiding sensors' own states.

    Attributes
    ----------
    blocks : tuple of Block
        Blocks after the nine navigation errors (``position``, ``velocity``, ``attitude``), in order.
    imu_count : int
        How many of the states after the ninth belong to the inertial sensor.
    size : int
        Number of states.

    Notes
    -----
    The errors are true minus estimate. Position error [m], velocity error [m/s] and attitude error [rad] are
    those of the Earth-fixed position, velocity and attitude, resolved in the navigation frame of the *estimate* (n or
    e).
    """

    blocks: tuple[Block, ...]
    imu_count: int = 0
    size: int = field(init=False, repr=False, compare=False)
    _offsets: dict[str, tuple[int, int]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        offsets = {"position": (0, 3), "velocity": (3, 3), "attitude": (6, 3)}
        at = NAVIGATION_STATES
        for block in self.blocks:
            if block.name in offsets:
                raise ConfigError(f"two state blocks are named {block.name!r}; names of states must differ")
            offsets[block.name] = (at, block.size)
            at += block.size
        object.__setattr__(self, "_offsets", offsets)
        object.__setattr__(self, "size", at)

    @classmethod
    def join(cls, imu_blocks: Iterable[Block], aiding_blocks: Iterable[Block] = ()) -> Layout:
        """Layout of inertial sensor blocks (see :func:`navfuse.imu.states.imu_blocks`) and aiding blocks."""
        imu_blocks = tuple(imu_blocks)
        return cls(imu_blocks + tuple(aiding_blocks), sum(b.size for b in imu_blocks))

    @property
    def names(self) -> tuple[str, ...]:
        """Block names in order, the three navigation blocks included."""
        return tuple(self._offsets)

    def __contains__(self, name: str) -> bool:
        return name in self._offsets

    def offset(self, name: str) -> int:
        """Index of the first state of a block; KeyError if it is not in the layout."""
        return self._offsets[name][0]

    def find(self, name: str) -> int:
        """Index of the first state of a block; -1 if it is not in the layout."""
        found = self._offsets.get(name)
        return -1 if found is None else found[0]

    def slice(self, name: str) -> slice:
        """Where a block stands in the state vector; KeyError if it is not in the layout."""
        start, size = self._offsets[name]
        return slice(start, start + size)

    def per_state(self, attribute: str) -> np.ndarray:
        """An attribute of :class:`Block` (``sd``, ``tau``, ``walk``, ``value``) for every state after the ninth."""
        parts = [np.full(b.size, getattr(b, attribute), dtype=float) for b in self.blocks]
        return np.concatenate(parts) if parts else np.empty(0)
