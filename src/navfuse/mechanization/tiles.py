"""How a covariance is laid out while it is propagated, so that the compiler can use vector instructions.

A covariance is cut into *tiles* of TILE columns: a row is a run of whole vectors, and the distance from row to row is a
constant that the compiler knows. From the top a tile has the nine navigation rows, then one row for every *place*.
Places are the states after the ninth: first the inertial sensor's in the sequence of
:func:`navfuse.mechanization.error_dynamics.imu_places`, whether the filter has them or not, then the aiding sensors'. A
place that no state takes stays zero. The first tile has the nine navigation columns, then the error estimate x, the
estimates of the states, one column unused, and from column FIRST on the places, which go on in the next tiles.

Everything lies in one flat array, the *work space*: a head of HEAD numbers, the tiles of the covariance, those of the
accumulated transition, those of the decay factors, and VALUES numbers for every place. A kernel takes the part of it
that begins HEAD numbers before its tile.
"""

from __future__ import annotations

import numpy as np

from navfuse.core.fused import fused
from navfuse.mechanization.error_dynamics import PAIR, imu_places

TILE = 24
FIRST = 12
ERROR, ESTIMATE = 9, 10
"""Columns of the first tile that hold the error estimate x and, in the place rows, the estimates of the states."""

RATES, STEP, NOISE, DECAY_STEP, BLOCK, HEAD = 0, 12, 31, 33, 34, 120
"""Head of the work space: what frame_rates writes (12); T w_im, T (2 w_ie + w_em), T w_em, T Gamma (six elements), half
the integral of f_m, T/2 (19); densities of the angular and velocity random walk; the step of the decay factors [s]; the
navigation block while it is put together (81)."""

R, V, PSI, PLACES = HEAD, HEAD + 3 * TILE, HEAD + 6 * TILE, HEAD + 9 * TILE
"""Where the rows of the first tile begin."""

VALUES = 5
DECAY, INVERSE_TAU, VARIANCE, WALK, DRIVE = range(VALUES)
"""What is kept for each place: decay factor of a step, 1/tau, steady-state variance, random-walk density, and half the
noise of a step."""


@fused(forceinline=True)
def regions(places):
    """Length of a tile, number of tiles, and where the values of the places begin. No checks are made."""
    size = (9 + places) * TILE
    tiles = (FIRST + places + TILE - 1) // TILE
    return size, tiles, HEAD + 3 * tiles * size


@fused
def pack(work, places, place, s, x, P, F):
    """Put sensor estimates s (m,), error estimate x (9 + m,), covariance P and transition F into the work space.

    `place` (m,) is the place of each state after the ninth; F (10, n) is as
    :func:`navfuse.mechanization.propagate.identity_transition` makes it, or has no rows. No checks are made.
    """
    size, tiles, _ = regions(places)
    n = x.size
    for c in range(n):
        column = c if c < 9 else FIRST + place[c - 9]
        first = column // TILE * size + column % TILE
        for i in range(9):
            work[first + R + i * TILE] = P[i, c]
        for i in range(n - 9):
            work[first + PLACES + place[i] * TILE] = P[9 + i, c]
        if F.shape[0] > 0:
            first += tiles * size
            for i in range(9):
                work[first + R + i * TILE] = F[i, c]
            if c >= 9:
                work[first + PLACES + place[c - 9] * TILE] = F[9, c]
    for i in range(9):
        work[R + i * TILE + ERROR] = x[i]
        work[R + i * TILE + ESTIMATE] = 0.0
    for i in range(n - 9):
        work[PLACES + place[i] * TILE + ERROR] = x[9 + i]
        work[PLACES + place[i] * TILE + ESTIMATE] = s[i]


@fused
def unpack(work, places, place, s, x, P, F):
    """The reverse of :func:`pack`. No checks are made."""
    size, _, _ = regions(places)
    m = s.size
    unpack_navigation(work, places, place, x, P)
    for c in range(9):
        for i in range(m):
            P[9 + i, c] = P[c, 9 + i]
    for i in range(m):
        row = PLACES + place[i] * TILE
        s[i] = work[row + ESTIMATE]
        for c in range(m):
            column = FIRST + place[c]
            P[9 + i, 9 + c] = work[column // TILE * size + row + column % TILE]
    if F.shape[0] > 0:
        unpack_transition(work, places, place, F)


@fused
def unpack_navigation(work, places, place, x, P):
    """Take the error estimate x (n,) and the navigation rows P (9, n) of the covariance out. No checks are made."""
    size = regions(places)[0]
    for i in range(9):
        x[i] = work[R + i * TILE + ERROR]
        for c in range(9):
            P[i, c] = work[R + i * TILE + c]
    for c in range(place.size):
        x[9 + c] = work[PLACES + place[c] * TILE + ERROR]
        column = FIRST + place[c]
        first = column // TILE * size + R + column % TILE
        for i in range(9):
            P[i, 9 + c] = work[first + i * TILE]


@fused
def unpack_transition(work, places, place, F):
    """Take the accumulated transition F (10, n) out. No checks are made."""
    size, tiles, _ = regions(places)
    for c in range(F.shape[1]):
        column = c if c < 9 else FIRST + place[c - 9]
        first = (tiles + column // TILE) * size + column % TILE
        for i in range(9):
            F[i, c] = work[first + R + i * TILE]
        F[9, c] = 1.0 if c < 9 else work[first + PLACES + place[c - 9] * TILE]


@fused
def reset_transition(work, places):
    """Make the accumulated transition the identity. No checks are made."""
    size, tiles, _ = regions(places)
    for i in range(tiles * size, 2 * tiles * size):
        work[HEAD + i] = 0.0
    for i in range(9):
        work[tiles * size + R + i * (TILE + 1)] = 1.0
    for i in range(places):
        column = FIRST + i
        work[(tiles + column // TILE) * size + PLACES + i * TILE + column % TILE] = 1.0


class Workspace:
    """Work space and arrangement of the states of one filter.

    Parameters
    ----------
    imu_map : (m, 3) int array
        From :func:`navfuse.mechanization.error_dynamics.imu_state_map`; the first m states after the ninth.
    noise : (2,) array
        Densities of the angular [rad^2/s] and the velocity [m^2/s^3] random walk.
    stochastic : (n - 9, 3) array
        Per state after the ninth: steady-state variance, random-walk density, 1/tau (0 = no decay).

    Attributes
    ----------
    inertial, places : int
        Places of the inertial sensor's states, and of all.
    place : (n - 9,) int array
        Where each state stands.
    work : array
    """

    def __init__(self, imu_map: np.ndarray, noise: np.ndarray, stochastic: np.ndarray):
        place = imu_places(imu_map)
        self.inertial = PAIR if place.max(initial=-1) < PAIR else 2 * PAIR
        rest = stochastic.shape[0] - place.size
        self.places = self.inertial + rest
        self.place = np.concatenate([place, self.inertial + np.arange(rest, dtype=np.int64)])
        at = regions(self.places)[2]
        self.work = at_a_cache_line(at + VALUES * self.places)
        self.work[NOISE : NOISE + 2] = noise
        values = self.work[at:].reshape(VALUES, self.places)
        decays = stochastic[:, 2] > 0.0
        values[VARIANCE, self.place] = np.where(decays, stochastic[:, 0], 0.0)
        values[WALK, self.place] = np.where(decays, 0.0, stochastic[:, 1])
        values[INVERSE_TAU, self.place] = stochastic[:, 2]


def at_a_cache_line(size: int) -> np.ndarray:
    """Zeros that begin at a cache line: vectors that straddle one cost twice the time."""
    raw = np.zeros(size + 8)
    return raw[-raw.ctypes.data % 64 // 8 :][:size]
