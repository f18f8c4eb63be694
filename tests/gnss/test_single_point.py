"""Least squares of one epoch: published solutions of the exercises, exact answers, and its own covariance."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats
from scipy.io import loadmat

from navfuse.core.constants import EARTH_RATE, LIGHT_SPEED
from navfuse.core.earth import ecef_to_geodetic_batch, geodetic_to_ecef_batch
from navfuse.errors import InputError
from navfuse.gnss.orbits import gps_constellation, workshop_constellation
from navfuse.gnss.ranging import arriving_signals
from navfuse.gnss.single_point import single_point_position, single_point_velocity

DEGREE = 0.01745329252
"""One degree in the code of the exercises, short of the true one by 3 parts in 1e12, which is 45 um of longitude."""


def place(lat, lon, height):
    return geodetic_to_ecef_batch(np.array([lat]), np.array([lon]), np.array([height]))[0]


def workshop(folder, name):
    """Time, ranges, range rates, satellites in the axes of transmission."""
    table = np.loadtxt(folder / f"{name}_Pseudo_ranges.csv", delimiter=",")
    rates = np.loadtxt(folder / f"{name}_Pseudo_range_rates.csv", delimiter=",")
    constellation = workshop_constellation().take([f"{number:.0f}" for number in table[0, 1:]])
    return table[1:, 0], table[1:, 1:], rates[1:, 1:], *constellation.at(table[1:, 0])


def as_the_exercises(sat_r_e, r_e):
    """Satellites turned back so that the exact rotation brings them where the exercises' own one does.

    Theirs is the matrix [1, a; -a, 1] with the angle `a` of the range before rotation: it stretches by 0.5 mm, and the
    angle is off by what the rotation does to the range.
    """
    a = (EARTH_RATE / LIGHT_SPEED * np.linalg.norm(sat_r_e - r_e, axis=1))[:, None]
    x, y, z = (sat_r_e[:, axis : axis + 1] for axis in range(3))
    there = np.hstack([x + a * y, y - a * x, z])
    theta = (EARTH_RATE / LIGHT_SPEED * np.linalg.norm(there - r_e, axis=1))[:, None]
    c, s, (x, y, z) = np.cos(theta), np.sin(theta), (there[:, axis : axis + 1] for axis in range(3))
    return np.hstack([c * x - s * y, s * x + c * y, z])


@pytest.fixture(name="folder")
def _folder(shared_data):
    folder = shared_data / "ucl-comp0130" / "workshops"
    if not folder.is_dir():
        pytest.skip("the exercises are not among the shared data")
    return folder


def test_workshop_1_is_reproduced(folder):
    time, ranges, _, sat_r_e, _ = workshop(folder, "Workshop1")
    answer = loadmat(folder / "W1_answer_task_2.mat")["W1_answer_task_2"]
    exact = np.array([single_point_position(*epoch).vector_e for epoch in zip(ranges, sat_r_e, strict=True)])
    printed = np.array(
        [
            single_point_position(z, as_the_exercises(sat, r)).vector_e
            for z, sat, r in zip(ranges, sat_r_e, exact, strict=True)
        ]
    )
    wanted = geodetic_to_ecef_batch(*np.ascontiguousarray((answer * (DEGREE, DEGREE, 1.0)).T))
    assert time.tolist() == [60.0 * k for k in range(11)]
    assert np.abs(printed - wanted).max() < 1e-6
    assert 1e-5 < np.abs(exact - wanted).max() < 5e-4


def test_workshop_2_is_reproduced(folder):
    _, ranges, rates, sat_r_e, sat_v_e = workshop(folder, "Workshop2")
    printed = np.loadtxt(folder / "Workshop2_GNSS_Pos_ECEF.csv", delimiter=",")[:, 1:]
    fixes = [single_point_position(*epoch) for epoch in zip(ranges, sat_r_e, strict=True)]
    position = np.array([fix.vector_e for fix in fixes])
    assert np.abs(position - printed).max() < 1e-3
    velocity = np.array(
        [single_point_velocity(*epoch).vector_e for epoch in zip(rates, sat_r_e, sat_v_e, position, strict=True)]
    )
    moved = np.linalg.norm((position[-1] - position[0]) - np.trapezoid(velocity, dx=1.0, axis=0))
    assert moved < 30.0  # 36 km flown; single fixes scatter by metres
    clock = np.array([fix.clock for fix in fixes])
    assert 95.0 < np.polyfit(np.arange(181.0), clock, 1)[0] < 105.0


def test_the_coursework_has_49_epochs_with_outliers(folder):
    table = np.loadtxt(folder.parent / "cw1-A" / "Pseudo_ranges.csv", delimiter=",")
    sat_r_e, _ = workshop_constellation().take([f"{number:.0f}" for number in table[0, 1:]]).at(table[1:, 0])
    fixes = [single_point_position(*epoch) for epoch in zip(table[1:, 1:], sat_r_e, strict=True)]
    assert sum(np.abs(fix.residuals).max() > 20.0 for fix in fixes) == 49
    lat, lon, height = ecef_to_geodetic_batch(fixes[0].vector_e[None])
    assert [round(math.degrees(lat[0]), 5), round(math.degrees(lon[0]), 5)] == [51.50925, -0.16105]
    assert [round(height[0], 1), round(fixes[0].clock, 1)] == [38.8, 10008.8]


def epoch(where, v_a, constellation=None, mask=0.0):
    constellation = gps_constellation(32) if constellation is None else constellation
    r_a = place(*where)
    sat_r_e, sat_v_e, rho, rate, u_e = (x[0] for x in arriving_signals(constellation, [1234.5], [r_a], [v_a]))
    up = u_e @ (r_a / np.linalg.norm(r_a)) > math.sin(mask)
    return r_a, sat_r_e[up], sat_v_e[up], rho[up], rate[up]


@pytest.mark.parametrize(
    "where", [(0.9, 0.2, 100.0), (0.0, math.pi, 9e3), (math.pi / 2.0, 0.0, 0.0), (-1.2, -2.0, 3e3)]
)
def test_exact_measurements_give_the_exact_answer(where):
    v_a = np.array([200.0, -100.0, 50.0])
    r_a, sat_r_e, sat_v_e, rho, rate = epoch(where, v_a)
    fix = single_point_position(rho + 1e5, sat_r_e, sd=3.0)
    np.testing.assert_allclose(fix.vector_e, r_a, rtol=0, atol=1e-7)
    assert fix.clock == pytest.approx(1e5, abs=1e-7)
    assert np.abs(fix.residuals).max() < 1e-7
    moving = single_point_velocity(rate + 200.0, sat_r_e, sat_v_e, fix.vector_e)
    np.testing.assert_allclose(moving.vector_e, v_a, rtol=0, atol=1e-9)
    assert moving.clock == pytest.approx(200.0, abs=1e-9)
    near = single_point_position(rho + 1e5, sat_r_e, start=r_a + 10.0)
    np.testing.assert_allclose(near.vector_e, fix.vector_e, rtol=0, atol=1e-7)
    assert near.iterations < fix.iterations


def test_the_covariance_is_that_of_the_errors():
    """The chi-square of 400 fixes with 4 degrees of freedom each, and residuals with m - 4, within 99.9 %."""
    r_a, sat_r_e, sat_v_e, rho, rate = epoch((0.9, 0.2, 100.0), np.zeros(3))
    sd = np.linspace(1.0, 4.0, rho.size)
    rng = np.random.default_rng(3)
    position, velocity, leftover = 0.0, 0.0, 0.0
    for _ in range(400):
        fix = single_point_position(rho + sd * rng.standard_normal(rho.size), sat_r_e, sd, r_a)
        error = np.append(fix.vector_e - r_a, fix.clock)
        position += error @ np.linalg.solve(fix.covariance, error)
        leftover += np.sum((fix.residuals / sd) ** 2)
        moving = single_point_velocity(
            rate + 0.01 * sd * rng.standard_normal(rho.size), sat_r_e, sat_v_e, r_a, 0.01 * sd
        )
        error = np.append(moving.vector_e, moving.clock)
        velocity += error @ np.linalg.solve(moving.covariance, error)
    for value, freedom in ((position, 4), (velocity, 4), (leftover, rho.size - 4)):
        low, high = stats.chi2.ppf([0.0005, 0.9995], 400 * freedom)
        assert low < value < high


def test_four_satellites_do():
    r_a, sat_r_e, _, rho, _ = epoch((0.9, 0.2, 100.0), np.zeros(3))
    fix = single_point_position(rho[:4], sat_r_e[:4])
    np.testing.assert_allclose(fix.vector_e, r_a, rtol=0, atol=1e-6)


_draws = np.random.default_rng(0)
SCATTERED = (2e7 * _draws.standard_normal((5, 3)), 3e7 * _draws.standard_normal(5))[::-1]
GOOD = (np.full(5, 2.2e7), np.full((5, 3), 1e7) + 1e6 * np.eye(5, 3))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((GOOD[0][:3], GOOD[1][:3]), "3 pseudo-ranges does not determine .* 4 are needed"),
        ((GOOD[0], GOOD[1][:4]), r"m pseudo-ranges and sat_r_e \(m, 3\), not \(5,\) and \(4, 3\)"),
        ((GOOD[0], GOOD[1], 0.0), "one number or 5, positive and finite"),
        ((GOOD[0], GOOD[1], [1.0, 1.0]), "one number or 5, positive and finite"),
        ((np.full(5, np.nan), GOOD[1]), "must be finite; leave out"),
        ((*GOOD, 1.0, (0.0, np.inf, 0.0)), "start must be three finite numbers"),
        ((GOOD[0], np.full((5, 3), 1e7)), "the 5 satellites do not determine position and clock"),
        (
            SCATTERED,
            "found no position in 30 iterations",
        ),
    ],
)
def test_what_is_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        single_point_position(*arguments)


def test_what_is_refused_of_rates():
    r_a, sat_r_e, sat_v_e, _, rate = epoch((0.9, 0.2, 100.0), np.zeros(3))
    with pytest.raises(InputError, match=r"3 range rates does not determine"):
        single_point_velocity(rate[:3], sat_r_e[:3], sat_v_e[:3], r_a)
    with pytest.raises(InputError, match=r"need sat_v_e of shape"):
        single_point_velocity(rate, sat_r_e, sat_v_e[:4], r_a)
    with pytest.raises(InputError, match=r"r_e must be three finite numbers"):
        single_point_velocity(rate, sat_r_e, sat_v_e, [1.0, 2.0])
