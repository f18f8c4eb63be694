"""Sigma points carried through the mechanization: geometry, moments, transition and noise against their slow twins."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from navfuse.core.unscented import SigmaSpread
from navfuse.data.nav_state import boxplus_navigation, to_ecef
from navfuse.mechanization import arc_errors, sigma_points
from navfuse.mechanization.arc_errors import (
    correction_turn,
    down_axis,
    draw_points,
    retract,
    turn_gone,
    turned,
    untwist,
)
from navfuse.mechanization.error_dynamics import ACC_TIME, imu_state_map
from navfuse.mechanization.point_tiles import load_points, tile_numbers
from navfuse.mechanization.propagate import Propagator, identity_transition
from navfuse.mechanization.sigma_points import (
    BEGUN,
    DCM,
    FORCE,
    GONE,
    ROOT,
    UnscentedPropagator,
    covariance_of_root,
    points_of,
    relax_vertical,
    settle,
)
from navfuse.simulation import car_drive, circle_flight
from reference.engine_runs import cut, nav_at, perfect_increments
from reference.error_runs import (
    BIASES,
    MOTIONS,
    NAMES,
    NOISE,
    RATES,
    SENSOR_ERRORS,
    SIZES,
    VARIANCE,
    WALK,
    N,
    by_van_loan,
    differences,
    effects,
    in_sigmas,
    start_covariance,
)

FRAMES = pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])
NAV = np.array(
    [0.79, 0.2, 300.0, 14.0, -6.0, 0.5, *Rotation.from_euler("ZYX", [2.1, 0.1, -0.2]).as_quat()[[3, 0, 1, 2]]]
)
GONE_THERE = np.array([30.0, -70.0, 40.0, 6.0, -9.0, 8.0])
"""Integrals Dw [m] and Du [m/s] of the specific force since an event."""
SPREADS = {
    "default": SigmaSpread,
    "cubature": SigmaSpread.cubature,
    "close": lambda n: SigmaSpread(n, 1e-2),
    "kappa": lambda n: SigmaSpread(n, 1.0, 2.0, 3.0 - n),
}
OF_SPREADS = pytest.mark.parametrize("name", SPREADS)


def there(ecef):
    return to_ecef(NAV) if ecef else NAV.copy()


def in_tiles(X):
    tiles = np.zeros(tile_numbers(len(X)))
    load_points(X, tiles)
    return tiles


def make(names, ecef, period=0.0, noise=(0.0, 0.0), stochastic=None, output=-1.0, spread=SigmaSpread):
    imu_map = imu_state_map(names)
    if stochastic is None:
        stochastic = np.zeros((len(imu_map), 3))
    return UnscentedPropagator(imu_map, np.array(noise), stochastic, ecef, period, output, spread(9 + len(imu_map)))


def run(propagator, increments, nav, sensor_errors, P, rows=0, cuts=(), track=True):
    """What is carried at the end, the transition, and what was put out."""
    n = propagator.size
    nav, s, P, x = nav.copy(), sensor_errors.copy(), P.copy(), np.zeros(n)
    F, acc, last = identity_transition(n) if track else np.empty((0, n)), propagator.accumulator(), np.zeros(6)
    out = propagator.buffers(rows, transitions=track)
    scale = np.sqrt(np.diagonal(P))
    scale[scale == 0.0] = 1.0
    values, vectors = np.linalg.eigh(P / np.outer(scale, scale))
    R = np.linalg.qr((scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))).T, mode="r")
    propagator.root(acc)[:] = R.T * np.where(np.diagonal(R) < 0.0, -1.0, 1.0)
    propagator.root(acc)[np.diagonal(P) == 0.0] = 0.0
    edges = [0, *cuts, len(increments)]
    t, filled = float(increments.time[0]), 0
    out_next = int(np.ceil(t / propagator.output_period - 1e-6)) if propagator.output_period > 0.0 else 0
    for first, last_ in pairwise(edges):
        block = cut(increments, first, last_)
        end = float(increments.time[-1]) + (1e-5 if last_ < len(increments) else 0.0)
        _, t, out_next, filled = propagator.advance(block, 0, t, end, nav, s, x, P, F, acc, out_next, out, last, filled)
    return nav, s, P, F, acc, [part[:filled] for part in out]


@given(
    y=st.floats(-3.1, 3.1),
    t=st.floats(0.0, 1.5),
    where=st.floats(0.0, 6.3),
    axis=st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
)
def test_a_heading_and_then_a_tilt_is_the_product_of_the_two_rotations(y, t, where, axis):
    u = np.array([*axis, 1.0])
    u /= np.linalg.norm(u)
    a = np.cross(u, [1.0, 0.0, 0.0])
    a /= np.linalg.norm(a)
    tilt = t * (np.cos(where) * a + np.sin(where) * np.cross(u, a))
    d = np.concatenate([np.zeros(6), tilt + y * u])
    product = Rotation.from_rotvec(y * u) * Rotation.from_rotvec(tilt)
    psi = turned(d, tuple(u))
    assert (Rotation.from_rotvec(psi) * product.inv()).magnitude() < 4e-8
    untwisted = d.copy()
    untwisted[6:] = psi
    untwist(untwisted, tuple(u))
    assert np.abs(untwisted - d).max() < 4e-8


@pytest.mark.parametrize("y", [0.02, 0.1, arc_errors.SMALL_TURN])
@pytest.mark.parametrize("t", [1e-4, arc_errors.SMALL_TILT])
@pytest.mark.parametrize("step", [1.0 - 1e-9, 1.0 + 1e-9], ids=["series", "quaternions"])
def test_the_series_meets_the_quaternions_where_they_change_over(y, t, step):
    d = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, step * t, 0.0, step * y])
    exact = (Rotation.from_rotvec([0.0, 0.0, d[8]]) * Rotation.from_rotvec([d[6], 0.0, 0.0])).as_rotvec()
    assert np.abs(np.array(turned(d, (0.0, 0.0, 1.0))) - exact).max() < 4e-8
    d[6:] = exact
    untwist(d, (0.0, 0.0, 1.0))
    assert np.abs(d[6:] - [step * t, 0.0, step * y]).max() < 4e-8


@pytest.mark.parametrize("y", [0.0, 0.2, -1.4])
def test_a_correction_turns_the_error_that_is_left(y):
    """exp(y u) exp(t) with t + y u = dx + e is exp(J e) times the rotation of dx, to first order in e."""
    u, step = (0.0, 0.0, 1.0), 1e-6
    dx = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3, -0.2, y])
    C = Rotation.from_rotvec(turned(dx, u))
    J = np.reshape(correction_turn(dx, u), (3, 3))
    for axis, column in zip(np.eye(3), J.T, strict=True):
        ahead, behind = (dx + np.concatenate([np.zeros(6), sign * step * axis]) for sign in (1.0, -1.0))
        turn = (Rotation.from_rotvec(turned(ahead, u)) * C.inv()).as_rotvec()
        back = (Rotation.from_rotvec(turned(behind, u)) * C.inv()).as_rotvec()
        np.testing.assert_allclose((turn - back) / (2.0 * step), column, atol=1e-8)


@FRAMES
@pytest.mark.parametrize("level", [1e-4, 0.01, 0.3])
@pytest.mark.parametrize("heading", [1e-3, 0.29, 1.0])
def test_points_are_drawn_where_their_deviations_say(level, heading, ecef):
    rng = np.random.default_rng(2)
    n = 15
    S = np.tril(rng.normal(size=(n, n)))
    S[:3], S[3:6], S[6:9], S[9:] = 20.0 * S[:3], 0.5 * S[3:6], level * S[6:9], 1e-3 * S[9:]
    nav, s = there(ecef), rng.normal(size=n - 9)
    u = np.array(down_axis(nav, ecef))
    S[6:9] += np.outer(u, heading * rng.uniform(-0.5, 0.5, n) * np.tri(n)[8])
    X, A = np.empty((2 * n + 1, n + 1)), np.empty((n, 2 * n + 1))
    draw_points(nav, s, GONE_THERE, S, np.zeros(n), 1.7, ecef, X)
    np.testing.assert_array_equal(X[0], np.concatenate([nav, s]))
    sigma_points._deviations(X, in_tiles(X), np.concatenate([nav, s]), GONE_THERE, ecef, A)
    expected = np.hstack([1.7 * S, -1.7 * S, np.zeros((n, 1))])
    # Four parts in 1e8 of a turn times a lever of 85 m, and the rounding of an Earth-centred position.
    bounds = np.repeat([4e-6, 1e-6, 5e-8, 1e-12], [3, 3, 3, n - 9])
    assert np.all(np.abs(A - expected) < bounds[:, None])


@FRAMES
def test_an_error_takes_what_has_been_integrated_with_it(ecef):
    """With psi there all the time, velocity and position go off by (exp(psi) - I) Du and Dw."""
    nav = there(ecef)
    u = np.array(down_axis(nav, ecef))
    d = np.concatenate([[1.0, 2.0, 3.0, 0.1, 0.2, 0.3], 1.1 * u])
    moved, expected = nav.copy(), d.copy()
    retract(moved, GONE_THERE, d, ecef)
    C = Rotation.from_rotvec(1.1 * u).as_matrix() - np.eye(3)
    expected[:3] += C @ GONE_THERE[:3]
    expected[3:6] += C @ GONE_THERE[3:]
    np.testing.assert_allclose(d, expected, atol=1e-12)
    boxplus_navigation(nav, expected, ecef)
    np.testing.assert_allclose(moved, nav, rtol=1e-14, atol=1e-13)
    turn_gone(GONE_THERE, tuple(1.1 * u), d, -1.0)
    np.testing.assert_allclose(d[:6], [1.0, 2.0, 3.0, 0.1, 0.2, 0.3], atol=1e-12)


@pytest.mark.parametrize("lat", [0.5 * np.pi, -0.5 * np.pi, 0.0, 0.8])
def test_down_is_the_normal_of_the_ellipsoid(lat):
    nav = NAV.copy()
    nav[0] = lat
    expected = -np.array([np.cos(lat) * np.cos(nav[1]), np.cos(lat) * np.sin(nav[1]), np.sin(lat)])
    np.testing.assert_allclose(down_axis(to_ecef(nav), True), expected, atol=1e-12)
    assert down_axis(nav, False) == (0.0, 0.0, 1.0)


@FRAMES
@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("period", [0.0, 0.1])
def test_points_without_spread_are_the_plain_mechanization(name, period, ecef):
    increments = perfect_increments(MOTIONS[name], 100.0, 10.0, 12.0)
    nav = nav_at(MOTIONS[name], 10.0, ecef)
    stochastic = np.column_stack([np.zeros(N - 9), np.zeros(N - 9), RATES])
    plain = Propagator(imu_state_map(NAMES), np.zeros(2), stochastic, ecef, period, -1.0)
    expected, s, P = nav.copy(), SENSOR_ERRORS.copy(), np.zeros((N, N))
    begin, end = float(increments.time[0]), float(increments.time[-1])
    last, found_last = np.zeros(6), np.zeros(6)
    empty, out = np.empty((0, N)), plain.buffers(0, transitions=False)
    plain.advance(increments, 0, begin, end, expected, s, np.zeros(N), P, empty, plain.accumulator(), 0, out, last)
    points = make(NAMES, ecef, period, stochastic=stochastic)
    found, found_s, P, x = nav.copy(), SENSOR_ERRORS.copy(), np.zeros((N, N)), np.zeros(N)
    points.advance(increments, 0, begin, end, found, found_s, x, P, empty, points.accumulator(), 0, out, found_last)
    # A metre is 1.6e-7 rad.
    scale = np.array([1e-9, 1e-9, 1.0, *[1e-3] * 3, *[1e-3] * 4]) if not ecef else np.array([1.0] * 3 + [1e-3] * 7)
    assert np.all(np.abs(found - expected) < 1e-8 * scale)
    np.testing.assert_allclose(found_s, s, rtol=1e-13)
    np.testing.assert_allclose(found_last, last, rtol=1e-9, atol=1e-12)
    # Nothing but the rounding of a position.
    assert np.sqrt(np.abs(P).max()) < 1e-7


@FRAMES
@pytest.mark.parametrize("blocks", [0, 2, 4, 6])
@pytest.mark.parametrize("name", ["car", "steep turns at 150 m/s", "steep turns at 86 degrees"])
def test_covariance_is_that_of_the_extended_filter_for_small_errors(name, blocks, ecef):
    motion, names = MOTIONS[name], NAMES[:blocks]
    increments = perfect_increments(motion, 100.0, 10.0, 14.0)
    n = 9 + len(imu_state_map(names))
    part = n - 9
    stochastic = np.column_stack([VARIANCE, WALK, RATES])[:part]
    P0 = start_covariance(0.3 * SIZES)[:n, :n]
    nav = nav_at(motion, 10.0, ecef)
    plain = Propagator(imu_state_map(names), np.array(NOISE), stochastic, ecef, 0.1, -1.0)
    x, P, empty = np.zeros(n), P0.copy(), np.empty((0, n))
    out = plain.buffers(0, transitions=False)
    plain.advance(
        increments, 0, 10.0, 14.0, nav.copy(), np.zeros(part), x, P, empty, plain.accumulator(), 0, out, np.zeros(6)
    )
    found = run(make(names, ecef, 0.1, NOISE, stochastic), increments, nav, np.zeros(part), P0)[2]
    assert np.array_equal(found, found.T)
    assert in_sigmas(found, P) < 5e-4


@FRAMES
@pytest.mark.parametrize("name", ["car", "steep turns at 150 m/s", "steep turns at 86 degrees"])
@pytest.mark.parametrize("start", [1.0, 0.0], ids=["from large errors", "from none"])
def test_covariance_follows_the_linear_error_equations(name, start, ecef):
    motion = MOTIONS[name]
    P0 = start_covariance(start * SIZES) if start else np.zeros((N, N))
    reference = by_van_loan(motion, 10.0, 14.0, P0, ecef)
    stochastic = np.column_stack([VARIANCE, WALK, RATES])
    increments = perfect_increments(motion, 100.0, 10.0, 14.0)
    off = []
    for period, bound in ((0.0, 2e-4), (0.1, 5e-4), (0.4, 5e-3)):
        propagator = make(NAMES, ecef, period, NOISE, stochastic)
        P = run(propagator, increments, nav_at(motion, 10.0, ecef), np.zeros(N - 9), P0)[2]
        off.append(in_sigmas(P, reference))
        assert off[-1] < bound, period


@FRAMES
def test_covariance_converges_with_the_square_of_the_step(ecef):
    motion = MOTIONS["steep turns at 150 m/s"]
    increments = perfect_increments(motion, 100.0, 10.0, 13.2)
    stochastic = np.column_stack([VARIANCE, WALK, RATES])
    nav, P0 = nav_at(motion, 10.0, ecef), np.zeros((N, N))
    exact, *rough = (
        run(make(NAMES, ecef, period, NOISE, stochastic), increments, nav, np.zeros(N - 9), P0)[2]
        for period in (0.0, 0.8, 0.4, 0.2)
    )
    off = [in_sigmas(P, exact) for P in rough]
    assert off[0] > 3.0 * off[1] > 9.0 * off[2]


@FRAMES
@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("sensor_errors", [BIASES, SENSOR_ERRORS], ids=["biases", "scale and coupling"])
def test_transition_is_the_derivative_of_the_mechanization(name, sensor_errors, ecef):
    """With estimated scale factors and couplings too, where the extended filter is off by their size."""
    motion = MOTIONS[name]
    increments = perfect_increments(motion, 100.0, 10.0, 11.0)
    nav = nav_at(motion, 10.0, ecef)
    for period in (0.0, 0.1):
        F = run(make(NAMES, ecef, period), increments, nav, sensor_errors, start_covariance(0.1 * SIZES))[3][:9]
        worst = effects(F, differences(increments, nav, sensor_errors, ecef))
        assert np.all(worst < [2e-6, 1e-6, 2e-7]), period


@OF_SPREADS
def test_transition_and_covariance_do_not_depend_on_where_the_points_are(name):
    motion = MOTIONS["car"]
    increments = perfect_increments(motion, 100.0, 10.0, 12.0)
    nav, P0 = nav_at(motion, 10.0, False), start_covariance(0.1 * SIZES)
    stochastic = np.column_stack([VARIANCE, WALK, RATES])
    default = run(make(NAMES, False, 0.1, NOISE, stochastic), increments, nav, np.zeros(N - 9), P0)
    other = run(make(NAMES, False, 0.1, NOISE, stochastic, spread=SPREADS[name]), increments, nav, np.zeros(N - 9), P0)
    assert in_sigmas(other[2], default[2]) < 1e-4
    assert np.all(effects(other[3][:9], default[3][:9]) < [1e-5, 1e-5, 1e-6])


def test_transition_of_a_state_known_for_certain_is_zero_and_of_no_consequence():
    motion = MOTIONS["car"]
    increments = perfect_increments(motion, 100.0, 10.0, 11.0)
    P0 = start_covariance(0.1 * SIZES)
    P0[12], P0[:, 12] = 0.0, 0.0
    _, _, P, F, _, _ = run(make(NAMES, False, 0.1), increments, nav_at(motion, 10.0, False), np.zeros(N - 9), P0)
    assert np.isfinite(F).all()
    known = np.delete(np.vstack([F[:9], np.diag(F[9])[9:]]) @ np.linalg.cholesky(P0 + np.diag(np.eye(N)[12])), 12, 0)
    known = np.delete(known, 12, 1)
    assert not P[12].any()
    assert in_sigmas(known @ known.T, np.delete(np.delete(P, 12, 0), 12, 1)) < 1e-4


def noise_of_a_step(T, f, bias_walk=0.0):
    """Covariance (15, 15) from the columns of :func:`sigma_points._add_noise` for a constant specific force."""
    n = 15
    acc = np.zeros(sigma_points.ROOT)
    acc[ACC_TIME], acc[FORCE : FORCE + 3], acc[DCM : DCM + 9] = T, T * np.asarray(f), np.eye(3).ravel()
    stochastic = np.column_stack([np.zeros(6), np.full(6, bias_walk), np.zeros(6)])
    A = np.full((n, 60), np.nan)
    imu_map = imu_state_map(("gyro_bias", "accel_bias"))
    end = sigma_points._add_noise(acc, imu_map, stochastic, np.ones(6), np.array(NOISE), tuple(np.eye(3).ravel()), A, 5)
    return A[:, 5:end] @ A[:, 5:end].T


def noise_by_quadrature(T, f, bias_walk=0.0):
    """The integral of Phi(a) Q Phi(a)^T over ages a up to T, with the matrix exponential and 40 Gauss points."""
    A = np.zeros((15, 15))
    A[0:3, 3:6] = np.eye(3)
    A[3:6, 6:9] = -np.array([[0, -f[2], f[1]], [f[2], 0, -f[0]], [-f[1], f[0], 0]])
    A[6:9, 9:12], A[3:6, 12:15] = -np.eye(3), -np.eye(3)
    Q = np.diag(np.repeat([0.0, NOISE[1], NOISE[0], bias_walk], [3, 3, 3, 6]))
    nodes, weights = np.polynomial.legendre.leggauss(40)
    total = np.zeros((15, 15))
    for age, weight in zip(0.5 * T * (nodes + 1.0), 0.5 * T * weights, strict=True):
        Phi = expm(A * age)
        total += weight * Phi @ Q @ Phi.T
    return total


F_HARD = (3.0, -12.0, -25.0)


def test_white_noise_of_a_step_is_its_integral_up_to_the_third_power_of_age():
    found, exact = noise_of_a_step(0.5, F_HARD), noise_by_quadrature(0.5, F_HARD)
    scale = np.sqrt(np.diagonal(exact))
    relative = np.abs(found - exact)[:9, :9] / np.outer(scale, scale)[:9, :9]
    assert np.max(relative[3:, :]) < 1e-13
    # Position through attitude goes with the fourth power, of which two Gauss points make 35/36.
    assert np.max(relative[:3, :3]) < 1.0 / 36.0


def test_white_noise_of_steps_adds_up_with_the_fifth_power_of_the_step():
    """What position lacks of its noise in a step falls by 32 with half the step."""
    off = [np.abs(noise_of_a_step(T, F_HARD) - noise_by_quadrature(T, F_HARD))[:3, :3].max() for T in (0.4, 0.2, 0.1)]
    assert off[0] / off[1] == pytest.approx(32.0, rel=1e-6)
    assert off[1] / off[2] == pytest.approx(32.0, rel=1e-3)


def test_walking_biases_of_a_step_are_right_to_leading_order():
    """The change stands in the middle of the step: covariance with attitude exact, of attitude 3/4 of T^3/3."""
    T, walk = 0.1, 1e-4
    found = noise_of_a_step(T, F_HARD, walk) - noise_of_a_step(T, F_HARD)
    exact = noise_by_quadrature(T, F_HARD, walk) - noise_by_quadrature(T, F_HARD)
    np.testing.assert_allclose(np.diagonal(found)[9:], walk * T, rtol=1e-9)
    np.testing.assert_allclose(found[6:9, 9:12], exact[6:9, 9:12], rtol=1e-6, atol=1e-16)
    np.testing.assert_allclose(found[3:6, 12:15], exact[3:6, 12:15], rtol=1e-6, atol=1e-16)
    np.testing.assert_allclose(np.diagonal(found)[6:9], 0.75 * np.diagonal(exact)[6:9], rtol=1e-6)


@FRAMES
@settings(max_examples=25)
@given(cuts=st.lists(st.integers(0, 300), max_size=12).map(sorted), period=st.sampled_from([0.0, 0.03, 0.1, 1.0]))
def test_blocks_of_any_size_give_the_same_bits(ecef, cuts, period):
    names = NAMES[:2]
    motion = MOTIONS["car"]
    increments = perfect_increments(motion, 100.0, 10.0, 13.0)
    nav, P0 = nav_at(motion, 10.0, ecef), start_covariance(SIZES)[:15, :15]
    stochastic = np.column_stack([VARIANCE, WALK, RATES])[:6]
    propagator = make(names, ecef, period, NOISE, stochastic, 0.25)
    whole = run(propagator, increments, nav, BIASES[:6], P0, 40)
    pieces = run(propagator, increments, nav, BIASES[:6], P0, 40, cuts)
    for one, other in zip((*whole[:5], *whole[5]), (*pieces[:5], *pieces[5]), strict=True):
        assert np.array_equal(one, other)


@FRAMES
def test_rows_are_put_out_at_multiples_of_the_period(ecef):
    motion = MOTIONS["car"]
    increments = perfect_increments(motion, 100.0, 10.003, 12.003)
    nav, P0 = nav_at(motion, 10.003, ecef), start_covariance(0.1 * SIZES)[:15, :15]
    propagator = make(NAMES[:2], ecef, 0.1, NOISE, None, 0.125)
    *_, F_end, _, (time, rows, x, P, F) = run(propagator, increments, nav, np.zeros(6), P0, 40)
    np.testing.assert_array_equal(time, 0.125 * np.arange(81, 97))
    assert not x.any()
    for k, t in enumerate(time):
        d = np.empty(9)
        sigma_points.boxminus_navigation(nav_at(motion, t, ecef), rows[k], ecef, d)
        assert np.all(np.abs(d) < np.repeat([1e-2, 1e-2, 1e-4], 3))
    assert np.all(P[:, range(9), range(9)] > 0.0)
    whole = np.eye(15)
    for step in (*F, F_end):
        whole = np.vstack([step[:9], np.diag(step[9])[9:]]) @ whole
    alone = run(make(NAMES[:2], ecef, 0.1), increments, nav, np.zeros(6), P0)
    assert np.all(np.abs(whole[:9] - alone[3][:9]) * SIZES[:15] < np.repeat([2e-5, 2e-5, 2e-6], 3)[:, None])


@FRAMES
def test_an_output_period_of_zero_puts_out_every_stamp_but_the_last(ecef):
    motion = MOTIONS["car"]
    increments = perfect_increments(motion, 100.0, 10.0, 11.0)
    nav, P0 = nav_at(motion, 10.0, ecef), start_covariance(0.1 * SIZES)[:15, :15]
    propagator = make(NAMES[:2], ecef, 0.1, NOISE, None, 0.0)
    *_, (time, rows, _, P, _) = run(propagator, increments, nav, np.zeros(6), P0, 200)
    np.testing.assert_array_equal(time, increments.time[1:-1])
    assert np.isfinite(rows).all()
    assert np.isfinite(P).all()


@FRAMES
@pytest.mark.parametrize("wide", [0.01, 0.2, 1.0])
def test_settling_gives_the_moments_of_the_arc(wide, ecef):
    """Mean and deviations of the plain errors against 20000 draws.

    Along the sagitta, where all is second order, the points are wider than the draws, by sqrt(1.2 / 0.5) with beta = 2,
    never narrower.
    """
    n = 15
    propagator = make(NAMES[:2], ecef, 0.1)
    rng = np.random.default_rng(5)
    acc, carried = propagator.accumulator(), np.zeros((n + 1) ** 2)
    nav = carried[:10]
    nav[:] = there(ecef)
    S = propagator.root(acc)
    S[:] = np.tril(0.1 * rng.normal(size=(n, n)))
    S[6:9] *= 1e-2
    S[6:9, :9] += np.outer(down_axis(nav, ecef), wide * np.eye(9)[6])
    S[:] = np.linalg.cholesky(S @ S.T)
    acc[GONE:BEGUN] = GONE_THERE
    before = nav.copy()
    draws = np.empty((20000, 9))
    for row, xi in zip(draws, rng.standard_normal((20000, n)) @ S[:9].T, strict=True):
        d = xi.copy()
        retract(before.copy(), GONE_THERE, d, ecef)
        row[:] = d
    X, A = np.empty((2 * n + 1, n + 1)), np.empty((n, 2 * n + 1))
    settle(carried, acc, propagator.weights, ecef, X, A)
    P, moved = carried[2 * n + 1 :].reshape(n, n), np.empty(9)
    assert not acc[GONE:BEGUN].any()
    np.testing.assert_allclose(P, propagator.root(acc) @ propagator.root(acc).T, atol=1e-12 * np.abs(P).max())
    assert np.linalg.eigvalsh(P).min() > 0.0
    sigma_points.boxminus_navigation(nav, before, ecef, moved)
    sd = np.std(draws, axis=0)
    assert np.all(np.abs(moved - draws.mean(axis=0))[:6] < (0.03 if wide < 0.5 else 0.2) * sd[:6])
    ratio = np.sqrt(np.diagonal(P))[:6] / sd[:6]
    assert np.all(ratio > (0.98 if wide < 0.5 else 0.8))
    assert np.all(ratio < (1.02 if wide < 0.1 else 1.6 if wide < 0.5 else 2.0))


@FRAMES
def test_letting_go_of_the_vertical_leaves_the_covariance(ecef):
    n, rng = 15, np.random.default_rng(3)
    nav = NAV.copy()
    gone = GONE_THERE.copy()
    if ecef:
        nav = np.array(to_ecef(NAV))
    acc = np.zeros(ROOT + n * n + (2 * n + 1) * (n + 1))
    acc[GONE:BEGUN] = gone
    root, _ = points_of(acc, n)
    root[:] = np.tril(rng.standard_normal((n, n))) * 0.1
    before, after = np.empty((n, n)), np.empty((n, n))
    covariance_of_root(acc, before)
    relax_vertical(nav, acc, ecef, np.empty((n, n)))
    covariance_of_root(acc, after)
    np.testing.assert_allclose(after, before, rtol=1e-9, atol=1e-9)
    u = np.array(down_axis(nav, ecef))
    for part in (slice(0, 3), slice(3, 6)):
        kept, was = acc[GONE:BEGUN][part], gone[part]
        assert kept @ u == pytest.approx(0.0, abs=1e-12)
        np.testing.assert_allclose(kept, was - u * (u @ was), atol=1e-12)
    assert np.array_equal(root, np.tril(root))


@FRAMES
def test_the_mean_of_points_is_found_however_wide_their_headings(ecef):
    """The deviations that are left have a weighted mean of zero: the root is that of the points."""
    n = 15
    spread = SigmaSpread(n)
    for wide in (0.1, 1.0, 1.7):
        rng = np.random.default_rng(6)
        nav, s = there(ecef), np.zeros(n - 9)
        S = np.tril(0.05 * rng.normal(size=(n, n)))
        S[6:9, :9] += np.outer(down_axis(nav, ecef), wide * np.eye(9)[6])
        X, A = np.empty((2 * n + 1, n + 1)), np.empty((n, 2 * n + 1))
        draw_points(nav, s, GONE_THERE, S, np.zeros(n), spread.distance, ecef, X)
        reference, shift = np.empty(n + 1), np.empty(n)
        sigma_points._mean_of_points(X, in_tiles(X), spread.weights()[1], np.zeros(6), ecef, reference, shift, A)
        w = spread.weights()[1]
        mean = w * A[:, : 2 * n].sum(axis=1) + (1.0 - 2 * n * w) * A[:, 2 * n]
        assert np.abs(mean[:3]).max() < 1e-5, wide
        assert np.abs(mean[3:6]).max() < 1e-5, wide
        assert np.abs(mean[6:9]).max() < 1e-8, wide
        assert np.abs(mean[9:]).max() < 1e-12, wide


def test_views_of_the_accumulator():
    propagator = make(NAMES[:2], False)
    acc = propagator.accumulator()
    S, X = points_of(acc, 15)
    assert S.shape == (15, 15)
    assert X.shape == (31, 16)
    assert np.shares_memory(S, propagator.root(acc))
    kept = propagator.keep(acc)
    assert kept.size < acc.size
    acc[ACC_TIME], acc[-1] = 0.05, 7.0
    assert np.array_equal(propagator.resume(propagator.keep(acc)), acc)
    assert not propagator.resume(None).any()


def test_a_motion_of_hours_keeps_the_quaternions_of_the_points_at_unit_length():
    motion = car_drive(60.0, seed=1)
    increments = perfect_increments(motion, 100.0)
    propagator = make(NAMES[:2], False, 3600.0)
    acc = run(
        propagator,
        cut(increments, 0, 5999),
        nav_at(motion, 0.0, False),
        np.zeros(6),
        start_covariance(SIZES)[:15, :15],
        cuts=[100],
    )[4]
    X = points_of(acc, 15)[1]
    np.testing.assert_allclose(np.linalg.norm(X[:, 6:10], axis=1), 1.0, atol=1e-12)


def test_an_arc_is_followed_by_points_of_an_unknown_heading():
    """Propagation without events: with psi constant the deviations stay those of the start in coordinates of Du."""
    motion = circle_flight(20.0, straight=2.0, lat=0.5)
    increments = perfect_increments(motion, 100.0, 5.0, 15.0)
    P0 = np.diag(np.square(np.repeat([1.0, 0.1, 1e-3, 1e-6, 1e-4], 3)))
    P0[8, 8] = np.radians(60.0) ** 2
    nav, _, P, _, acc, _ = run(make(NAMES[:2], False, 0.1), increments, nav_at(motion, 5.0, False), np.zeros(6), P0)
    d = np.empty(9)
    sigma_points.boxminus_navigation(nav_at(motion, 15.0, False), nav, False, d)
    assert np.abs(d[:3]).max() < 1.0
    S = points_of(acc, 15)[0]
    assert np.sqrt(np.sum(S[6:9] ** 2, axis=1))[2] == pytest.approx(np.radians(60.0), rel=1e-3)
    # Xi: what is left of velocity without the arc, 1 mrad of level over 10 s of 1 g and the start.
    assert np.all(np.sqrt(np.sum(S[3:6] ** 2, axis=1)) < 0.5)
    assert np.sqrt(np.diagonal(P)[3:6]).max() > 5.0
