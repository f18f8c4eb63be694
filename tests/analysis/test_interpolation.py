from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navfuse.analysis.interpolation import (
    EarthStates,
    check_epochs,
    conjugate,
    covered,
    earth_states,
    interpolate,
    interpolate_linear,
    multiply,
    ned_axes,
    ned_quaternion,
)
from navfuse.core.earth import dcm_en, geodetic_to_ecef
from navfuse.core.rotation import dcm_from_quat_batch, quat_from_rotvec
from navfuse.data.trajectory import Trajectory
from navfuse.errors import InputError

LATITUDES = np.radians([-90.0, -89.9999, -45.0, 0.0, 30.5, 89.9999, 90.0])
LONGITUDES = np.radians([-180.0, -179.9999, -90.0, 0.0, 114.3, 179.9999, 180.0])


def at(time, lat_deg, lon_deg, height=100.0, **more):
    time = np.asarray(time, dtype=float)
    lat, lon = np.broadcast_to(np.radians(lat_deg), time.shape), np.broadcast_to(np.radians(lon_deg), time.shape)
    return Trajectory(time, lat.copy(), lon.copy(), np.full(time.shape, height), **more)


def test_ned_axes_are_those_of_the_core():
    lat, lon = (grid.ravel() for grid in np.meshgrid(LATITUDES, LONGITUDES))
    expected = np.array([dcm_en(a, b) for a, b in zip(lat, lon, strict=True)]).reshape(-1, 3, 3)
    np.testing.assert_allclose(ned_axes(lat, lon), expected, atol=1e-15)
    np.testing.assert_allclose(dcm_from_quat_batch(ned_quaternion(lat, lon)), expected, atol=2e-15)


def test_quaternion_product_is_the_matrix_product():
    rng = np.random.default_rng(0)
    p, q = (q / np.linalg.norm(q, axis=1, keepdims=True) for q in rng.standard_normal((2, 20, 4)))
    product = dcm_from_quat_batch(multiply(p, q))
    np.testing.assert_allclose(product, dcm_from_quat_batch(p) @ dcm_from_quat_batch(q), atol=1e-14)
    np.testing.assert_allclose(multiply(p, conjugate(p)), np.tile([1.0, 0.0, 0.0, 0.0], (20, 1)), atol=1e-15)


def test_position_is_exact_on_a_cubic_with_velocities():
    coefficients = np.array([[4e6, 10.0, -0.5, 0.03], [1e6, -3.0, 1.5, -0.2], [5e6, 0.0, 2.0, 0.1]]).T
    powers = np.arange(4)

    def position(t):
        return (t[:, None] ** powers) @ coefficients

    def velocity(t):
        return (t[:, None] ** np.maximum(powers - 1, 0) * powers) @ coefficients

    epochs, time = np.array([0.0, 1.0, 2.5, 3.0]), np.linspace(0.0, 3.0, 31)
    found = interpolate(EarthStates(epochs, position(epochs), velocity(epochs)), time)
    np.testing.assert_allclose(found.r_e, position(time), atol=5e-9)


def test_position_is_a_chord_without_velocities():
    found = interpolate(
        EarthStates(np.array([0.0, 2.0]), np.array([[0.0, 0.0, 0.0], [4.0, -8.0, 2.0]])), np.array([0.5])
    )
    np.testing.assert_allclose(found.r_e, [[1.0, -2.0, 0.5]])
    assert found.v_e is None
    assert found.q_eb is None


def test_hermite_error_falls_with_the_fourth_power_of_the_step():
    """A circle of 50 m at 12 m/s: halving the step divides the error by 16; it stays below the docstring's bound."""
    radius, rate = 50.0, 12.0 / 50.0
    worst = []
    for step in (0.4, 0.2, 0.1):
        epochs = np.arange(0.0, 20.0 + step / 2, step)
        time = epochs[:-1] + 0.5 * step

        def circle(t):
            return radius * np.column_stack((np.cos(rate * t), np.sin(rate * t), 0.0 * t))

        def tangent(t):
            return radius * rate * np.column_stack((-np.sin(rate * t), np.cos(rate * t), 0.0 * t))

        found = interpolate(EarthStates(epochs, circle(epochs), tangent(epochs)), time)
        worst.append(np.linalg.norm(found.r_e - circle(time), axis=1).max())
        assert worst[-1] <= 1.01 * radius * rate**4 * step**4 / 384.0
    assert worst[0] / worst[1] == pytest.approx(16.0, rel=0.05)
    assert worst[1] / worst[2] == pytest.approx(16.0, rel=0.05)


@given(
    st.floats(0.0, np.pi - 1e-3),
    st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda axis: np.linalg.norm(axis) > 0.1),
    st.floats(0.0, 1.0),
    st.booleans(),
)
def test_attitude_turns_at_a_constant_rate(angle, axis, fraction, other_sign):
    axis = np.array(axis) / np.linalg.norm(axis)
    first = np.array(quat_from_rotvec((0.3, -0.7, 1.9)))
    turned = [
        multiply(first[None], np.array(quat_from_rotvec(tuple(s * angle * axis)))[None])[0] for s in (1.0, fraction)
    ]
    ends = np.array([first, -turned[0] if other_sign else turned[0]])
    zero = np.zeros((2, 3))
    found = interpolate(EarthStates(np.array([0.0, 1.0]), zero, zero, ends), np.array([fraction])).q_eb
    assert abs(abs(float(found[0] @ turned[1])) - 1.0) < 1e-14


def test_date_line_and_pole_need_no_special_case():
    across = at([0.0, 1.0], 0.0, [179.999, -179.999])
    found = interpolate(earth_states(across), np.array([0.5])).r_e[0]
    expected = np.array(geodetic_to_ecef(0.0, np.pi, 100.0))
    np.testing.assert_allclose(found, expected, atol=2e-3)
    over = at([0.0, 1.0], 89.999, [0.0, 180.0])
    found = interpolate(earth_states(over), np.array([0.5])).r_e[0]
    np.testing.assert_allclose(found[:2], [0.0, 0.0], atol=1e-6)
    assert found[2] == pytest.approx(geodetic_to_ecef(np.pi / 2, 0.0, 100.0)[2], abs=2e-3)


def test_columns_are_interpolated_linearly():
    values = np.array([[0.0, 10.0], [2.0, 20.0], [3.0, 50.0]])
    found = interpolate_linear(np.array([0.0, 1.0, 3.0]), values, np.array([0.0, 0.5, 2.0, 3.0]))
    np.testing.assert_allclose(found, [[0.0, 10.0], [1.0, 15.0], [2.5, 35.0], [3.0, 50.0]])


def test_covered_leaves_out_the_outside_and_gaps_but_keeps_epochs():
    epochs = np.concatenate((np.arange(0.0, 1.01, 0.1), [4.0, 4.1, 4.2]))
    time = np.array([-0.01, 0.0, 0.55, 1.0, 2.0, 4.0, 4.2, 4.21])
    np.testing.assert_array_equal(covered(epochs, time), [False, True, True, True, False, True, True, False])
    np.testing.assert_array_equal(covered(epochs, time, 5.0), [False, True, True, True, True, True, True, False])


def test_a_sparse_but_even_solution_has_no_gaps():
    assert covered(np.arange(0.0, 100.0, 10.0), np.array([5.0, 33.0])).all()


def test_epochs_must_be_two_and_increase():
    with pytest.raises(InputError, match=r"log\.csv: 1 epochs; a comparison needs at least two"):
        check_epochs(at([1.0], 0.0, 0.0, source="log.csv"))
    with pytest.raises(InputError, match=r"time does not increase at row 2 \(2\.000000 -> 1\.500000 s\)"):
        check_epochs(at([1.0, 2.0, 1.5], 0.0, 0.0))
    with pytest.raises(InputError, match="time does not increase at row 1"):
        check_epochs(at([1.0, 1.0], 0.0, 0.0))
    check_epochs(at([1.0, 2.0], 0.0, 0.0))
