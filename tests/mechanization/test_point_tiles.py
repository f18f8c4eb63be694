"""Points side by side in tiles against the same points one by one."""

import numpy as np
import pytest

from navfuse.core.rotation import quat_from_euler
from navfuse.data.nav_state import boxminus_navigation, to_ecef
from navfuse.mechanization import point_tiles
from navfuse.mechanization.arc_errors import down_axis, draw_points, turn_gone, untwist
from navfuse.mechanization.ecef import step_ecef
from navfuse.mechanization.ned import step_ned
from navfuse.mechanization.point_tiles import (
    LANES,
    LEFT,
    SIZE,
    TABLE,
    deviations_of_tiles,
    draw_tiles,
    load_points,
    step_tiles,
    store_points,
    tile_numbers,
)

N = 21
GONE = np.array([30.0, -70.0, 40.0, 6.0, -9.0, 8.0])
PLACES = {
    "middle": (0.8, 0.3),
    "date line": (-0.5, np.pi - 1e-7),
    "high north": (np.radians(88.0), -2.0),
    "equator": (1e-9, 1.0),
}


def state(place, ecef):
    lat, lon = PLACES[place]
    nav = np.array([lat, lon, 250.0, 30.0, -12.0, 1.0, *quat_from_euler(0.1, -0.3, 2.5)])
    return to_ecef(nav) if ecef else nav


def root(seed, attitude=0.01, position=20.0):
    S = np.tril(np.random.default_rng(seed).normal(size=(N, N)))
    S[:3], S[3:6], S[6:9], S[9:] = position * S[:3], 0.5 * S[3:6], attitude * S[6:9], 1e-3 * S[9:]
    return S


def points(nav, S, ecef):
    X = np.empty((2 * N + 1, N + 1))
    draw_points(nav, np.zeros(N - 9), GONE, S, np.zeros(N), 1.7, ecef, X)
    return X


def close(found, expected, ecef, metres=2e-8):
    """Within rounding of an Earth-centred position; longitude counts round the date line."""
    difference = found[:, :10] - expected[:, :10]
    if not ecef:
        difference[:, 1] -= 2.0 * np.pi * np.rint(difference[:, 1] / (2.0 * np.pi))
        difference[:, :2] *= 6.4e6 * np.array([1.0, 0.0349])[None] if abs(expected[0, 0]) > 1.5 else 6.4e6
    assert np.abs(difference[:, :3]).max() < metres
    assert np.abs(difference[:, 3:6]).max() < 1e-9
    assert np.abs(difference[:, 6:]).max() < 1e-12


@pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])
@pytest.mark.parametrize("place", PLACES)
def test_points_drawn_into_tiles_are_those_drawn_one_by_one(place, ecef):
    nav, S = state(place, ecef), root(1, attitude=0.003, position=5.0)
    tiles, drawn = np.zeros(tile_numbers(2 * N + 1)), np.empty((2 * N + 1, N + 1))
    assert draw_tiles(nav, GONE, S, 1.7, down_axis(nav, ecef), ecef, tiles)
    store_points(tiles, drawn)
    close(drawn, points(nav, S, ecef), ecef, 1e-7)


@pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])
@pytest.mark.parametrize("place", PLACES)
def test_deviations_in_tiles_are_those_one_by_one(place, ecef):
    nav = state(place, ecef)
    X = points(nav, root(2, attitude=0.003, position=5.0), ecef)
    tiles = np.zeros(tile_numbers(len(X)))
    load_points(X, tiles)
    reference, u, d = X[5, :10].copy(), np.array(down_axis(X[5], ecef)), np.empty(9)
    assert deviations_of_tiles(reference, GONE, tuple(u), ecef, tiles)
    for p in range(len(X)):
        boxminus_navigation(X[p, :10], reference, ecef, d)
        turn_gone(GONE, (d[6], d[7], d[8]), d, -1.0)
        untwist(d, tuple(u))
        at = p // LANES * SIZE + LEFT + p % LANES
        found = tiles[at : at + 9 * LANES : LANES]
        assert np.abs(found - d)[:3].max() < 1e-7
        assert np.abs(found - d)[3:6].max() < 1e-8
        assert np.abs(found - d)[6:].max() < 1e-9


@pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])
def test_points_too_far_from_each_other_are_refused(ecef):
    nav, tiles = state("middle", ecef), np.zeros(tile_numbers(2 * N + 1))
    u = down_axis(nav, ecef)
    assert not draw_tiles(nav, GONE, root(3, attitude=0.5), 1.7, u, ecef, tiles)
    if not ecef:
        assert not draw_tiles(nav, GONE, root(3, position=1e5), 1.7, u, ecef, tiles)
    X = points(nav, root(3, attitude=0.5), ecef)
    load_points(X, tiles)
    assert not deviations_of_tiles(X[0, :10], GONE, u, ecef, tiles)


@pytest.mark.parametrize("small", [True, False])
@pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])
@pytest.mark.parametrize("place", PLACES)
def test_a_step_of_all_points_is_the_mechanization_of_each(place, ecef, small):
    rng = np.random.default_rng(4)
    X = points(state(place, ecef), root(4, attitude=0.01, position=5.0), ecef)
    tiles, moved = np.zeros(tile_numbers(len(X))), np.empty_like(X)
    load_points(X, tiles)
    dt, inc, push = 0.01, (0.03, -0.05, 0.02), (0.05, -0.02, -0.098)
    for p in range(tiles.size // SIZE * LANES):
        table = np.concatenate([(np.eye(3) + 1e-3 * rng.normal(size=(3, 3))).ravel(), 1e-3 * rng.normal(size=3)])
        table = np.concatenate([table, (np.eye(3) + 1e-3 * rng.normal(size=(3, 3))).ravel(), 0.1 * rng.normal(size=3)])
        at = p // LANES * SIZE + TABLE + p % LANES
        tiles[at : at + 24 * LANES : LANES] = table
        if p < len(X):
            theta = table[:9].reshape(3, 3) @ (np.array(inc) - table[9:12] * dt)
            dv = table[12:21].reshape(3, 3) @ (np.array(push) - table[21:] * dt)
            (step_ecef if ecef else step_ned)(X[p], dt, *theta, *dv)
    step_tiles(tiles, ecef, dt, inc, push, small)
    store_points(tiles, moved)
    close(moved, X, ecef)


def test_series_of_small_angles_are_right_to_the_last_digits():
    for a in (1e-9, 1e-3, 0.05, 0.0999):
        s, c = point_tiles._sin_cos(a)
        assert abs(s - np.sin(a)) < 1e-17 + 1e-16 * a
        assert abs(c - np.cos(a)) < 1.2e-16
