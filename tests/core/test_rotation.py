from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from navfuse.core import rotation as rot

HALF_PI = math.pi / 2
ANGLES = st.floats(-10.0, 10.0)
COMPONENT = st.floats(-4.0, 4.0)


def axes():
    rng = np.random.default_rng(0)
    fixed = [
        [1, 0, 0],
        [0, 1, 0],
        [0, 0, 1],
        [-1, 0, 0],
        [0, -1, 0],
        [0, 0, -1],
        [1, 1, 0],
        [-1, 1, 1],
        [1, -1e-9, 1e-9],
    ]
    directions = np.array([*fixed, *rng.normal(size=(20, 3))], dtype=float)
    return directions / np.linalg.norm(directions, axis=1)[:, None]


SMALL = [0.0, 1e-200, 1e-12, 1e-6, 0.0999, 0.1001, 0.1999, 0.2001, 1.0, HALF_PI, 2.99]
LARGE = [math.pi - 1e-3, math.pi - 1e-9, math.pi - 1e-15, math.pi, math.pi + 1e-9, 5.0, 2 * math.pi, 20.0]


def euler_angles():
    rng = np.random.default_rng(1)
    cases = list(rng.uniform([-math.pi, -HALF_PI, 0.0], [math.pi, HALF_PI, 2 * math.pi], (200, 3)))
    for pitch in (0.0, HALF_PI, HALF_PI - 1e-15, HALF_PI - 1e-9, HALF_PI - 1e-5, -HALF_PI, -HALF_PI + 1e-9):
        cases += [np.array([r, pitch, h]) for r in (0.0, 0.3, -3.1, math.pi) for h in (0.0, 1.0, math.pi, 6.28)]
    return cases


def matrix(C):
    return np.reshape(C, (3, 3))


def scipy_from_euler(roll, pitch, heading):
    return Rotation.from_euler("ZYX", [heading, pitch, roll])


def largest(a, b=0.0):
    return np.max(np.abs(np.subtract(a, b)))


def test_matrix_and_vector_products_against_numpy():
    rng = np.random.default_rng(2)
    A, B, v, u = rng.normal(size=9), rng.normal(size=9), rng.normal(size=3), rng.normal(size=3)
    assert largest(matrix(rot.mat_mul(A, B)), matrix(A) @ matrix(B)) < 2e-15
    assert largest(matrix(rot.mat_t_mul(A, B)), matrix(A).T @ matrix(B)) < 2e-15
    assert largest(matrix(rot.transpose(A)), matrix(A).T) == 0.0
    assert largest(rot.mat_vec(A, v), matrix(A) @ v) < 2e-15
    assert largest(rot.mat_t_vec(A, v), matrix(A).T @ v) < 2e-15
    assert largest(rot.cross(u, v), np.cross(u, v)) < 1e-15


def test_tuples_and_arrays_are_equal_arguments():
    q = rot.quat_from_euler(0.1, -0.2, 3.0)
    v = (0.5, -1.0, 2.0)
    C = rot.dcm_from_quat(q)
    pairs = [
        (rot.quat_rotate, (q, v)), (rot.quat_multiply, (q, q)), (rot.quat_conjugate, (q,)), (rot.quat_normalize, (q,)),
        (rot.quat_from_rotvec, (v,)), (rot.rotvec_from_quat, (q,)), (rot.rotvec_from_dcm, (C,)),
        (rot.quat_from_dcm, (C,)), (rot.dcm_from_quat, (q,)), (rot.dcm_from_rotvec, (v,)), (rot.euler_from_dcm, (C,)),
        (rot.euler_from_quat, (q,)), (rot.euler_from_rotvec, (v,)), (rot.mat_mul, (C, C)), (rot.mat_vec, (C, v)),
        (rot.cross, (v, v[::-1])),
    ]  # fmt: skip
    for function, arguments in pairs:
        result = function(*arguments)
        assert isinstance(result, tuple)
        # Not to the last bit: what a fused kernel was first to compile may fuse products.
        assert result == pytest.approx(function(*map(np.array, arguments)), abs=5e-16)


def test_positive_angles_turn_the_way_people_expect():
    quarter = math.pi / 2
    assert rot.mat_vec(rot.dcm_from_euler(0.0, 0.0, quarter), (1.0, 0.0, 0.0)) == pytest.approx((0, 1, 0), abs=1e-16)
    assert rot.mat_vec(rot.dcm_from_euler(0.0, quarter, 0.0), (1.0, 0.0, 0.0)) == pytest.approx((0, 0, -1), abs=1e-16)
    assert rot.mat_vec(rot.dcm_from_euler(quarter, 0.0, 0.0), (0.0, 1.0, 0.0)) == pytest.approx((0, 0, 1), abs=1e-16)


def test_euler_angles_against_scipy_and_back():
    for euler in euler_angles():
        expected = scipy_from_euler(*euler).as_matrix()
        C = rot.dcm_from_euler(*euler)
        q = rot.quat_from_euler(*euler)
        r = rot.rotvec_from_euler(*euler)
        assert largest(matrix(C), expected) < 1e-15
        assert largest(matrix(rot.dcm_from_quat(q)), expected) < 1e-15
        assert largest(matrix(rot.dcm_from_rotvec(r)), expected) < 2e-15
        for back in (rot.euler_from_dcm(C), rot.euler_from_quat(q), rot.euler_from_rotvec(r)):
            assert abs(back[1] - euler[1]) < 2e-15
            assert 0.0 <= back[2] < 2 * math.pi
            assert largest(matrix(rot.dcm_from_euler(*back)), expected) < 3e-15


def test_euler_angles_away_from_lock_come_back():
    for euler in (each for each in euler_angles() if abs(each[1]) < 1.5):
        bar = 1e-15 / math.cos(euler[1])
        for back in (rot.euler_from_dcm(rot.dcm_from_euler(*euler)), rot.euler_from_quat(rot.quat_from_euler(*euler))):
            assert abs(rot.wrap_pi(back[0] - euler[0])) < bar
            assert abs(rot.wrap_pi(back[2] - euler[2])) < bar


@pytest.mark.parametrize("below", [10.0**-k for k in range(1, 16)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_pitch_keeps_its_digits_next_to_lock(below, sign):
    pitch = sign * (HALF_PI - below)
    assert abs(rot.euler_from_dcm(rot.dcm_from_euler(0.4, pitch, 2.0))[1] - pitch) < 5e-16
    assert abs(rot.euler_from_quat(rot.quat_from_euler(0.4, pitch, 2.0))[1] - pitch) < 1e-15


@pytest.mark.parametrize("sign", [1, -1])
def test_at_lock_roll_is_zero_and_heading_carries_both(sign):
    roll, pitch, heading = rot.euler_from_dcm(rot.dcm_from_euler(0.4, sign * HALF_PI, 2.0))
    assert roll == 0.0
    assert pitch == pytest.approx(sign * HALF_PI, abs=2e-16)
    assert heading == pytest.approx(2.0 - sign * 0.4, abs=1e-15)


@pytest.mark.parametrize("angle", SMALL + LARGE)
def test_rotation_vectors_against_scipy(angle):
    bar = 5e-16 * max(1.0, angle)
    for r in angle * axes():
        expected = Rotation.from_rotvec(r).as_matrix()
        q = rot.quat_from_rotvec(r)
        C = rot.dcm_from_rotvec(r)
        assert sum(c * c for c in q) == pytest.approx(1.0, abs=1e-15)
        assert q[0] == pytest.approx(math.cos(angle / 2), abs=bar)
        assert largest(matrix(C), expected) < 2 * bar
        assert largest(matrix(rot.dcm_from_quat(q)), expected) < 2 * bar
        assert largest(matrix(C) @ matrix(C).T, np.eye(3)) < 2e-15
        for back in (rot.rotvec_from_quat(q), rot.rotvec_from_dcm(C), rot.rotvec_from_dcm(rot.dcm_from_quat(q))):
            assert np.linalg.norm(back) <= math.pi + 5e-16
            assert largest(matrix(rot.dcm_from_rotvec(back)), expected) < 2 * bar + 1e-15
            if angle in SMALL:
                assert largest(back, r) < 2e-15


@pytest.mark.parametrize("scale", [1e-3, 1e-8, 1e-14, 1e-16, 1e-100, 1e-200, 1e-300])
def test_small_rotations_keep_their_relative_precision(scale):
    r = scale * np.array([0.3, -0.8, 0.5])
    q = rot.quat_from_rotvec(r)
    C = rot.dcm_from_rotvec(r)
    assert q[1:] == pytest.approx(r / 2, rel=1.1 * scale**2 / 24 + 3e-16, abs=0.0)
    assert rot.rotvec_from_quat(q) == pytest.approx(r, rel=1e-15, abs=0.0)
    if scale < 1e-7:
        assert (C[7] - C[5]) / 2 == pytest.approx(r[0], rel=1e-15, abs=0.0)
        assert rot.rotvec_from_dcm(C) == pytest.approx(r, rel=1e-15, abs=0.0)


@pytest.mark.parametrize("n", [0.0999, 0.09999999, 0.10000001, 0.1001, 0.1999, 0.19999999, 0.20000001, 0.2001])
def test_series_meet_the_closed_forms(n):
    w, x, _, _ = rot.quat_from_rotvec((n, 0.0, 0.0))
    assert w == pytest.approx(math.cos(n / 2), abs=1.2e-16)
    assert x == pytest.approx(math.sin(n / 2), abs=3e-17)
    C = rot.dcm_from_rotvec((n, 0.0, 0.0))
    assert C[4] == pytest.approx(math.cos(n), abs=1.2e-16)
    assert C[7] == pytest.approx(math.sin(n), abs=6e-17)


@pytest.mark.parametrize("axis", axes())
def test_half_turn_has_one_canonical_vector(axis):
    leading = axis[np.flatnonzero(axis)[0]]
    expected = math.pi * axis * math.copysign(1.0, leading)
    for q in ((0.0, *axis), (0.0, *(-axis)), (-0.0, *(-axis))):
        assert largest(rot.rotvec_from_quat(q), expected) < 1e-15
    exact = 2.0 * np.outer(axis, axis) - np.eye(3)
    assert largest(np.abs(rot.rotvec_from_dcm(exact.ravel())), np.abs(expected)) < 2e-15
    assert largest(matrix(rot.dcm_from_quat(rot.quat_from_dcm(exact.ravel()))), exact) < 1e-15


def test_identity_is_exact():
    eye = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    zero = (0.0, 0.0, 0.0)
    assert rot.quat_from_rotvec(zero) == (1.0, 0.0, 0.0, 0.0) == rot.quat_from_dcm(eye)
    assert rot.dcm_from_rotvec(zero) == rot.dcm_from_quat((1.0, 0.0, 0.0, 0.0)) == rot.dcm_from_euler(*zero) == eye
    assert rot.rotvec_from_dcm(eye) == rot.euler_from_dcm(eye) == zero


@given(COMPONENT, COMPONENT, COMPONENT)
def test_round_trips_between_all_forms(x, y, z):
    r = (x, y, z)
    q = rot.quat_from_rotvec(r)
    C = rot.dcm_from_rotvec(r)
    q_of_C = rot.quat_from_dcm(C)
    assert q_of_C[0] >= 0.0
    assert abs(abs(sum(a * b for a, b in zip(q, q_of_C, strict=True))) - 1.0) < 2e-15
    assert largest(rot.dcm_from_quat(q_of_C), C) < 3e-15
    assert largest(rot.dcm_from_rotvec(rot.rotvec_from_dcm(C)), C) < 4e-15
    assert largest(rot.dcm_from_euler(*rot.euler_from_quat(q)), C) < 4e-15
    assert largest(rot.rotvec_from_quat(q), rot.rotvec_from_quat(tuple(-c for c in q))) == 0.0


@given(ANGLES, st.floats(-HALF_PI, HALF_PI), ANGLES)
def test_any_euler_angles_give_their_matrix_back(roll, pitch, heading):
    C = rot.dcm_from_euler(roll, pitch, heading)
    back = rot.euler_from_dcm(C)
    assert abs(back[1] - pitch) < 1e-15
    assert largest(rot.dcm_from_euler(*back), C) < 2e-15


def test_quaternion_algebra():
    rng = np.random.default_rng(3)
    for _ in range(50):
        p, q = (rot.quat_normalize(rng.normal(size=4)) for _ in range(2))
        v = rng.normal(size=3)
        of_p, of_q = (Rotation.from_quat(each, scalar_first=True) for each in (p, q))
        assert sum(c * c for c in p) == pytest.approx(1.0, abs=1e-15)
        product = np.array(rot.quat_multiply(p, q))
        expected = (of_p * of_q).as_quat(scalar_first=True)
        assert largest(product * np.sign(product @ expected), expected) < 1e-15
        assert largest(matrix(rot.dcm_from_quat(p)), of_p.as_matrix()) < 2e-15
        assert largest(rot.quat_rotate(q, v), of_q.apply(v)) < 3e-15
        assert largest(rot.quat_multiply(q, rot.quat_conjugate(q)), (1.0, 0.0, 0.0, 0.0)) < 1e-15


def test_normalizing_keeps_the_sign():
    assert rot.quat_normalize((-2.0, 0.0, 0.0, 0.0)) == (-1.0, 0.0, 0.0, 0.0)


def test_a_slightly_wrong_matrix_still_gives_a_unit_quaternion():
    C = np.array(rot.dcm_from_euler(0.2, 0.4, 3.0)) * (1.0 + 1e-6)
    assert sum(c * c for c in rot.quat_from_dcm(C)) == pytest.approx(1.0, abs=4e-16)


@pytest.mark.parametrize(
    ("x", "expected"),
    [
        (0.0, 0.0), (math.pi, math.pi), (-math.pi, math.pi), (3.0, 3.0), (-3.0, -3.0), (7.0, 7.0 - 2 * math.pi),
        (3 * math.pi, math.pi), (-7.0, 2 * math.pi - 7.0), (1e3, 1e3 - 318 * math.pi), (1e-300, 1e-300),
    ],
)  # fmt: skip
def test_wrap_pi(x, expected):
    assert rot.wrap_pi(x) == pytest.approx(expected, abs=2e-13 if abs(x) > 100 else 1e-15)


@pytest.mark.parametrize(
    ("x", "expected"),
    [
        (0.0, 0.0), (2 * math.pi, 0.0), (-1e-20, 0.0), (6.28, 6.28), (-1.0, 2 * math.pi - 1.0),
        (7.0, 7.0 - 2 * math.pi), (-1e3, 320 * math.pi - 1e3),
    ],
)  # fmt: skip
def test_wrap_two_pi(x, expected):
    assert rot.wrap_two_pi(x) == pytest.approx(expected, abs=2e-13 if abs(x) > 100 else 1e-15)


@given(st.floats(-1e6, 1e6))
def test_wrapped_angles_lie_in_their_interval_and_point_the_same_way(x):
    a, b = rot.wrap_pi(x), rot.wrap_two_pi(x)
    assert -math.pi < a <= math.pi
    assert 0.0 <= b < 2 * math.pi
    for wrapped in (a, b):
        assert math.hypot(math.cos(wrapped) - math.cos(x), math.sin(wrapped) - math.sin(x)) < 1e-9
    assert rot.wrap_pi(a) == a
    assert rot.wrap_two_pi(b) == b


def test_nan_is_not_hidden():
    assert math.isnan(rot.wrap_pi(math.nan))
    assert math.isnan(rot.wrap_two_pi(math.nan))
    assert math.isnan(rot.euler_from_quat((math.nan, 0.0, 0.0, 1.0))[2])


def test_batches_are_the_scalar_functions():
    euler = np.array(euler_angles())
    q = rot.quat_from_euler_batch(euler)
    back = rot.euler_from_quat_batch(q)
    C = rot.dcm_from_quat_batch(q)
    assert C.shape == (len(euler), 3, 3)
    for k in range(len(euler)):
        assert tuple(q[k]) == rot.quat_from_euler(*euler[k])
        assert tuple(back[k]) == rot.euler_from_quat(q[k])
        assert tuple(C[k].ravel()) == rot.dcm_from_quat(q[k])


def jacobian_by_differences(r, step=1e-5):
    """exp((r + e) x) exp(r x)^-1 for small e, by central differences of scipy's rotations."""
    C = Rotation.from_rotvec(r)
    columns = []
    for e in step * np.eye(3):
        ahead = (Rotation.from_rotvec(r + e) * C.inv()).as_rotvec()
        behind = (Rotation.from_rotvec(r - e) * C.inv()).as_rotvec()
        columns.append((ahead - behind) / (2.0 * step))
    return np.column_stack(columns)


@pytest.mark.parametrize("angle", SMALL + LARGE)
def test_left_jacobian_is_the_derivative_of_the_rotation(angle):
    for axis in axes():
        r = angle * axis
        assert np.abs(np.reshape(rot.left_jacobian(tuple(r)), (3, 3)) - jacobian_by_differences(r)).max() < 1e-8


@pytest.mark.parametrize("angle", SMALL + LARGE)
def test_left_jacobian_is_the_series_of_the_cross_product(angle):
    """J = sum of [r x]^k / (k + 1)!, in extended precision by summation of matrices."""
    for axis in axes():
        r = np.asarray(angle * axis, dtype=np.longdouble)
        K = np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]], dtype=np.longdouble)
        term, total = np.eye(3, dtype=np.longdouble), np.eye(3, dtype=np.longdouble)
        for k in range(1, 120):
            term = term @ K / (k + 1)
            total = total + term
        tolerance = 4e-15 if angle < 2.0 * math.pi + 1e-9 else 1e-10
        assert np.abs(np.reshape(rot.left_jacobian(tuple(map(float, r))), (3, 3)) - total).max() < tolerance


def test_left_jacobian_takes_the_rotation_vector_to_itself_and_its_transpose_turns_back():
    for axis in axes():
        r = 1.3 * axis
        J = np.reshape(rot.left_jacobian(tuple(r)), (3, 3))
        np.testing.assert_allclose(J @ r, r, atol=1e-15)
        C = Rotation.from_rotvec(r).as_matrix()
        np.testing.assert_allclose(C @ J.T, J, atol=1e-15)
