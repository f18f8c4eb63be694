"""One step of the error covariance.

With Phi = [A B; 0 D] a step is P' = Phi P Phi^T + Q: the rows W = [A B] P first, over all columns; then the nine
navigation columns W [A B]^T, of which symmetry leaves less than half to compute; then the decay D of the states after
the ninth. Process noise is added half before and half after (trapezoidal rule). For the layout see
:mod:`navfuse.mechanization.tiles`.

The loops over columns are written for the compiler's vectorizer: one array, distances that are constants, a number of
columns that is not.
"""

from __future__ import annotations

from math import exp

import numpy as np

from navfuse.core.fused import fused
from navfuse.mechanization.error_dynamics import ACC_CROSS, ACC_DCM, ACC_FORCE, ACC_SCALE, ACC_TIME, PAIR, frame_rates
from navfuse.mechanization.tiles import (
    BLOCK,
    DECAY,
    DECAY_STEP,
    DRIVE,
    ERROR,
    FIRST,
    INVERSE_TAU,
    NOISE,
    PLACES,
    PSI,
    STEP,
    TILE,
    VARIANCE,
    WALK,
    R,
    V,
    regions,
)

NANOSECONDS = 1e9
"""Decay factors are those of the step rounded to a nanosecond: the last digits of stamps do not call for new ones."""


@fused
def covariance_step(work, places, inertial, acc, nav, sin_lat, cos_lat, ecef, track):
    """Carry covariance, error estimate, sensor estimates and accumulated transition over the summed covariance step.

    Parameters
    ----------
    work : array
        Work space, in which :func:`navfuse.mechanization.tiles.pack` has put them.
    places, inertial : int
        From :class:`navfuse.mechanization.tiles.Workspace`.
    acc : array
        Sums of this step, from :func:`navfuse.mechanization.error_dynamics.accumulate`; zeroed on return.
    nav : (10,) array
        Navigation state at the end of the step.
    sin_lat, cos_lat : float
        Of its latitude; only used for an NED state.
    ecef : bool
    track : bool
        Whether the transition is accumulated.

    Notes
    -----
    No checks are made.
    """
    T = acc[ACC_TIME]
    size, tiles, at = regions(places)
    rounded = np.rint(T * NANOSECONDS) / NANOSECONDS
    if rounded != work[DECAY_STEP]:
        _new_decay(work, places, rounded)
    _half_noise(work, places, T)
    frame_rates(nav, sin_lat, cos_lat, ecef, work)
    _step_coefficients(work, acc)
    for tile in range(2 * tiles if track else tiles):
        columns = min(TILE, (FIRST + places - tile % tiles * TILE + 3) // 4 * 4)
        _transition_rows(work[tile * size :], work, acc, columns)
        if inertial > PAIR:
            _add_cross_rows(work[tile * size :], work, acc, columns)
    _transition_columns(work, size, acc, inertial > PAIR)
    for tile in range(tiles):
        _scale(work[tile * size :], work[(2 * tiles + tile) * size :], size)
    _take_block(work)
    for tile in range(tiles):
        column = FIRST if tile == 0 else 0
        place = tile * TILE + column - FIRST
        _mirror(work, tile * size + column, min(TILE - column, places - place), place)
    _half_noise(work, places, T)
    if track:
        for i in range(places):
            column = FIRST + i
            row = (tiles + column // TILE) * size + PLACES + i * TILE
            work[row + column % TILE] *= work[at + DECAY * places + i]
    for i in range(ACC_CROSS):
        acc[i] = 0.0
    for i in range(ACC_CROSS, acc.size):
        acc[i] = 0.0


@fused
def _new_decay(work, places, T):
    """Decay factors d and noise of the states after the ninth for a step of length `T`. No checks are made.

    The half h that is added to a Gauss-Markov state before and after a step is such that d^2 (v + h) + h = v for the
    steady-state variance v.
    """
    size, tiles, at = regions(places)
    work[DECAY_STEP] = T
    for i in range(places):
        d = exp(-T * work[at + INVERSE_TAU * places + i])
        work[at + DECAY * places + i] = d
        drive = work[at + VARIANCE * places + i] * (1.0 - d * d) / (1.0 + d * d)
        work[at + DRIVE * places + i] = drive + 0.5 * work[at + WALK * places + i] * T
    for tile in range(tiles):
        for column in range(TILE):
            place = tile * TILE + column - FIRST
            d = work[at + DECAY * places + place] if 0 <= place < places else 1.0
            first = (2 * tiles + tile) * size + column
            for i in range(9):
                work[first + R + i * TILE] = d
            for i in range(places):
                work[first + PLACES + i * TILE] = d * work[at + DECAY * places + i]
    for i in range(places):
        for column in range(ERROR):
            work[2 * tiles * size + PLACES + i * TILE + column] = 1.0


@fused(inline="always")
def _step_coefficients(work, acc):
    """Write what the transition needs from the sums and the rates. No checks are made."""
    T = acc[ACC_TIME]
    for i in range(3):
        work[STEP + i] = T * (work[i] + work[3 + i])
        work[STEP + 3 + i] = T * (2.0 * work[i] + work[3 + i])
        work[STEP + 6 + i] = T * work[3 + i]
        work[STEP + 15 + i] = 0.5 * acc[ACC_FORCE + i]
    for i in range(6):
        work[STEP + 9 + i] = T * work[6 + i]
    work[STEP + 18] = 0.5 * T


@fused(inline="always")
def _half_noise(work, places, T):
    """Add the process noise that comes before, or after, a step of length `T` to the diagonal. No checks are made."""
    size, tiles, at = regions(places)
    velocity, attitude = 0.5 * work[NOISE + 1] * T, 0.5 * work[NOISE] * T
    for i in range(3):
        work[V + 3 + i * (TILE + 1)] += velocity
        work[PSI + 6 + i * (TILE + 1)] += attitude
    for tile in range(tiles):
        diagonal = tile * (size - TILE) + PLACES + FIRST
        for i in range(max(0, tile * TILE - FIRST), min(places, (tile + 1) * TILE - FIRST)):
            work[diagonal + i * (TILE + 1)] += work[at + DRIVE * places + i]


@fused(inline="always")
def _transition_rows(tile, work, acc, count):
    """Navigation rows of a tile <- [A B] times the tile, over the first `count` columns, but for the cross-couplings.

    No checks are made.
    """
    ax, ay, az = work[STEP], work[STEP + 1], work[STEP + 2]
    cx, cy, cz = work[STEP + 3], work[STEP + 4], work[STEP + 5]
    ex, ey, ez = work[STEP + 6], work[STEP + 7], work[STEP + 8]
    g00, g01, g02 = work[STEP + 9], work[STEP + 10], work[STEP + 11]
    g11, g12, g22 = work[STEP + 12], work[STEP + 13], work[STEP + 14]
    fx, fy, fz, half = work[STEP + 15], work[STEP + 16], work[STEP + 17], work[STEP + 18]
    b = ACC_DCM
    b0, b1, b2, b3, b4, b5 = acc[b], acc[b + 1], acc[b + 2], acc[b + 3], acc[b + 4], acc[b + 5]
    b6, b7, b8 = acc[b + 6], acc[b + 7], acc[b + 8]
    b = ACC_SCALE
    g0, g1, g2, g3, g4, g5 = acc[b], acc[b + 1], acc[b + 2], acc[b + 3], acc[b + 4], acc[b + 5]
    g6, g7, g8 = acc[b + 6], acc[b + 7], acc[b + 8]
    b = ACC_SCALE + 9
    a0, a1, a2, a3, a4, a5 = acc[b], acc[b + 1], acc[b + 2], acc[b + 3], acc[b + 4], acc[b + 5]
    a6, a7, a8 = acc[b + 6], acc[b + 7], acc[b + 8]
    for c in range(count):
        px, py, pz = tile[PSI + c], tile[PSI + TILE + c], tile[PSI + 2 * TILE + c]
        x, y, z = tile[PLACES + c], tile[PLACES + TILE + c], tile[PLACES + 2 * TILE + c]
        u, v, w = tile[PLACES + 6 * TILE + c], tile[PLACES + 7 * TILE + c], tile[PLACES + 8 * TILE + c]
        nx = px - (ay * pz - az * py) - (b0 * x + b1 * y + b2 * z) - (g0 * u + g1 * v + g2 * w)
        ny = py - (az * px - ax * pz) - (b3 * x + b4 * y + b5 * z) - (g3 * u + g4 * v + g5 * w)
        nz = pz - (ax * py - ay * px) - (b6 * x + b7 * y + b8 * z) - (g6 * u + g7 * v + g8 * w)
        tile[PSI + c] = nx
        tile[PSI + TILE + c] = ny
        tile[PSI + 2 * TILE + c] = nz
        px, py, pz = px + nx, py + ny, pz + nz
        rx, ry, rz = tile[R + c], tile[R + TILE + c], tile[R + 2 * TILE + c]
        vx, vy, vz = tile[V + c], tile[V + TILE + c], tile[V + 2 * TILE + c]
        x, y, z = tile[PLACES + 3 * TILE + c], tile[PLACES + 4 * TILE + c], tile[PLACES + 5 * TILE + c]
        u, v, w = tile[PLACES + 9 * TILE + c], tile[PLACES + 10 * TILE + c], tile[PLACES + 11 * TILE + c]
        nx = (
            vx - (cy * vz - cz * vy) + (g00 * rx + g01 * ry + g02 * rz) + (py * fz - pz * fy)
            - (b0 * x + b1 * y + b2 * z) - (a0 * u + a1 * v + a2 * w)
        )  # fmt: skip
        ny = (
            vy - (cz * vx - cx * vz) + (g01 * rx + g11 * ry + g12 * rz) + (pz * fx - px * fz)
            - (b3 * x + b4 * y + b5 * z) - (a3 * u + a4 * v + a5 * w)
        )  # fmt: skip
        nz = (
            vz - (cx * vy - cy * vx) + (g02 * rx + g12 * ry + g22 * rz) + (px * fy - py * fx)
            - (b6 * x + b7 * y + b8 * z) - (a6 * u + a7 * v + a8 * w)
        )  # fmt: skip
        tile[V + c] = nx
        tile[V + TILE + c] = ny
        tile[V + 2 * TILE + c] = nz
        tile[R + c] = rx - (ey * rz - ez * ry) + half * (vx + nx)
        tile[R + TILE + c] = ry - (ez * rx - ex * rz) + half * (vy + ny)
        tile[R + 2 * TILE + c] = rz - (ex * ry - ey * rx) + half * (vz + nz)


@fused
def _add_cross_rows(tile, work, acc, count):
    """Add what the cross-couplings put into the navigation rows of a tile. No checks are made."""
    fx, fy, fz, half = work[STEP + 15], work[STEP + 16], work[STEP + 17], work[STEP + 18]
    for c in range(count):
        px = py = pz = vx = vy = vz = 0.0
        for j in range(6):
            at = PLACES + (PAIR + j // 3 * 6 + j % 3) * TILE + c
            g, a = tile[at], tile[at + 3 * TILE]
            m = ACC_CROSS + j // 3 * 18 + j % 3
            px -= acc[m] * g
            py -= acc[m + 3] * g
            pz -= acc[m + 6] * g
            vx -= acc[m + 9] * a
            vy -= acc[m + 12] * a
            vz -= acc[m + 15] * a
        vx += py * fz - pz * fy
        vy += pz * fx - px * fz
        vz += px * fy - py * fx
        tile[PSI + c] += px
        tile[PSI + TILE + c] += py
        tile[PSI + 2 * TILE + c] += pz
        tile[V + c] += vx
        tile[V + TILE + c] += vy
        tile[V + 2 * TILE + c] += vz
        tile[R + c] += half * vx
        tile[R + TILE + c] += half * vy
        tile[R + 2 * TILE + c] += half * vz


@fused(inline="always")
def _product(acc, m, work, at):
    """The 3 x 3 matrix acc[m:] times the vector work[at:], as a 3-tuple. No checks are made."""
    x, y, z = work[at], work[at + 1], work[at + 2]
    return (
        acc[m] * x + acc[m + 1] * y + acc[m + 2] * z,
        acc[m + 3] * x + acc[m + 4] * y + acc[m + 5] * z,
        acc[m + 6] * x + acc[m + 7] * y + acc[m + 8] * z,
    )


@fused(inline="always")
def _transition_columns(work, size, acc, cross):
    """New navigation block: navigation rows W of the tiles times [A B]^T, written row by row at BLOCK.

    The attitude columns are computed in the velocity and attitude rows, the velocity columns in the velocity rows, the
    position columns in all; symmetry gives the rest, see :func:`_take_block`. No checks are made.
    """
    k = STEP
    ax, ay, az, cx, cy, cz = work[k], work[k + 1], work[k + 2], work[k + 3], work[k + 4], work[k + 5]
    g00, g01, g02, g11, g12, g22 = work[k + 9], work[k + 10], work[k + 11], work[k + 12], work[k + 13], work[k + 14]
    fx, fy, fz = work[k + 15], work[k + 16], work[k + 17]
    for i in range(3, 9):
        row = R + i * TILE
        px, py, pz = work[row + 6], work[row + 7], work[row + 8]
        bx, by, bz = _product(acc, ACC_DCM, work, row + FIRST)
        sx, sy, sz = _product(acc, ACC_SCALE, work, row + FIRST + 6)
        if cross:
            mx, my, mz = _product(acc, ACC_CROSS, work, row + size)
            nx, ny, nz = _product(acc, ACC_CROSS + 18, work, row + size + 6)
            sx, sy, sz = sx + mx + nx, sy + my + ny, sz + mz + nz
        to = BLOCK + 9 * i
        work[to + 6] = px - (ay * pz - az * py) - bx - sx
        work[to + 7] = py - (az * px - ax * pz) - by - sy
        work[to + 8] = pz - (ax * py - ay * px) - bz - sz
    for i in range(3, 6):
        row = R + i * TILE
        to = BLOCK + 9 * i
        rx, ry, rz = work[row], work[row + 1], work[row + 2]
        vx, vy, vz = work[row + 3], work[row + 4], work[row + 5]
        px, py, pz = work[row + 6] + work[to + 6], work[row + 7] + work[to + 7], work[row + 8] + work[to + 8]
        bx, by, bz = _product(acc, ACC_DCM, work, row + FIRST + 3)
        sx, sy, sz = _product(acc, ACC_SCALE + 9, work, row + FIRST + 9)
        if cross:
            mx, my, mz = _product(acc, ACC_CROSS + 9, work, row + size + 3)
            nx, ny, nz = _product(acc, ACC_CROSS + 27, work, row + size + 9)
            sx, sy, sz = sx + mx + nx, sy + my + ny, sz + mz + nz
        work[to + 3] = vx - (cy * vz - cz * vy) + (g00 * rx + g01 * ry + g02 * rz) + (py * fz - pz * fy) - bx - sx
        work[to + 4] = vy - (cz * vx - cx * vz) + (g01 * rx + g11 * ry + g12 * rz) + (pz * fx - px * fz) - by - sy
        work[to + 5] = vz - (cx * vy - cy * vx) + (g02 * rx + g12 * ry + g22 * rz) + (px * fy - py * fx) - bz - sz
    v0, v1, v2 = BLOCK + 27, BLOCK + 36, BLOCK + 45
    for i in range(3):
        to = v0 + 9 * i
        _position_columns(work, V + i * TILE, work[to + 3], work[to + 4], work[to + 5], to)
        _position_columns(work, PSI + i * TILE, work[v0 + 6 + i], work[v1 + 6 + i], work[v2 + 6 + i], to + 27)
    for i in range(3):
        _position_columns(work, R + i * TILE, work[v0 + i], work[v1 + i], work[v2 + i], BLOCK + 9 * i)


@fused(inline="always")
def _position_columns(work, row, vx, vy, vz, to):
    """Position columns of one row of the new navigation block, from its new velocity columns. No checks are made."""
    ex, ey, ez, half = work[STEP + 6], work[STEP + 7], work[STEP + 8], work[STEP + 18]
    rx, ry, rz = work[row], work[row + 1], work[row + 2]
    work[to] = rx - (ey * rz - ez * ry) + half * (work[row + 3] + vx)
    work[to + 1] = ry - (ez * rx - ex * rz) + half * (work[row + 4] + vy)
    work[to + 2] = rz - (ex * ry - ey * rx) + half * (work[row + 5] + vz)


@fused(inline="always")
def _take_block(work):
    """Put the new navigation block in the place of the old, exactly symmetric. No checks are made."""
    for i in range(3):
        for j in range(3):
            for k in range(3):
                a, b = BLOCK + 9 * (3 * k + i) + 3 * k + j, BLOCK + 9 * (3 * k + j) + 3 * k + i
                work[R + (3 * k + i) * TILE + 3 * k + j] = 0.5 * (work[a] + work[b])
            vr, pr, vp = work[BLOCK + 27 + 9 * i + j], work[BLOCK + 54 + 9 * i + j], work[BLOCK + 27 + 9 * i + 6 + j]
            work[V + i * TILE + j] = vr
            work[R + j * TILE + 3 + i] = vr
            work[PSI + i * TILE + j] = pr
            work[R + j * TILE + 6 + i] = pr
            work[V + i * TILE + 6 + j] = vp
            work[PSI + j * TILE + 3 + i] = vp


@fused(inline="always")
def _scale(tile, factors, size):
    """Multiply a tile by factors of the same layout. No checks are made."""
    for c in range(size):
        tile[R + c] *= factors[R + c]


@fused(inline="always")
def _mirror(work, first, columns, place):
    """Copy the navigation rows of some place columns into the navigation columns of their rows.

    `first` is the first of those columns, counted from the first tile's HEAD, and `place` its place. No checks are
    made.
    """
    for c in range(columns):
        for i in range(9):
            work[PLACES + (place + c) * TILE + i] = work[R + first + c + i * TILE]
