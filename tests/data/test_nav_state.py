from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from navfuse.core.constants import EARTH_RATE
from navfuse.data.layout import Block, Layout
from navfuse.data.nav_state import NavState, boxminus_navigation, boxplus_navigation, describe_rows, to_ecef, to_ned
from navfuse.data.start import Start, euler_axes
from reference.navigation_algebra import angle_between, corrected, dcm, earth_fixed, error, rotation_en

FRAMES = pytest.mark.parametrize("ecef", [False, True], ids=["ned", "ecef"])
D = np.array([300.0, -200.0, 50.0, 3.0, -2.0, 1.0, 0.2, -0.3, 0.4])
CAP = np.pi / np.sqrt(3.0)


def ned_array(lat=0.7, lon=-2.0, height=120.0, velocity=(12.0, -7.0, 2.0), roll=0.3, pitch=-0.4, heading=5.0):
    q = Rotation.from_euler("ZYX", [heading, pitch, roll]).as_quat(scalar_first=True)
    return np.array([lat, lon, height, *velocity, *q])


def array(ecef, **parts):
    nav = ned_array(**parts)
    return to_ecef(nav) if ecef else nav


def assert_same_place(nav, ecef, expected, metres=1e-8):
    r, v, C = earth_fixed(nav, ecef)
    assert np.linalg.norm(r - expected[0]) < metres
    assert np.linalg.norm(v - expected[1]) < 1e-9 * (1.0 + np.linalg.norm(expected[1]))
    assert angle_between(C, expected[2]) < 1e-12


PLACES = {
    "city": {},
    "equator and date line": {"lat": 0.0, "lon": np.pi},
    "just west of the date line": {"lat": -0.3, "lon": 3.1415926},
    "86 degrees north": {"lat": 1.5},
    "1 km from the pole": {"lat": 0.5 * np.pi - 1.6e-4},
    "straight up": {"pitch": 0.5 * np.pi},
    "on its back in space": {"roll": np.pi, "height": 4e5, "velocity": (7000.0, 2000.0, -10.0)},
}


@pytest.mark.parametrize("place", PLACES)
def test_a_navigation_state_is_the_same_in_both_frames(place):
    nav = ned_array(**PLACES[place])
    assert_same_place(to_ecef(nav), True, earth_fixed(nav, ecef=False))
    assert_same_place(to_ned(to_ecef(nav)), False, earth_fixed(nav, ecef=False))


@st.composite
def references(draw):
    """NED arrays anywhere: near the poles and on the date line as often as elsewhere, any attitude."""
    off = 10.0 ** draw(st.floats(-7.0, 0.1))
    lat = draw(st.sampled_from([0.0, 0.7, 0.5 * np.pi - off, off - 0.5 * np.pi]))
    lon = draw(st.one_of(st.sampled_from([-np.pi, np.pi, 0.0, np.pi - 1e-9, 1e-9 - np.pi]), st.floats(-3.1, 3.1)))
    velocity = draw(st.tuples(*[st.floats(-300.0, 300.0)] * 3))
    roll, heading = draw(st.floats(-np.pi, np.pi)), draw(st.floats(-np.pi, np.pi))
    pitch = draw(st.one_of(st.sampled_from([0.5 * np.pi, -0.5 * np.pi]), st.floats(-1.5, 1.5)))
    return ned_array(lat, lon, draw(st.floats(-400.0, 2e4)), velocity, roll, pitch, heading)


@st.composite
def large_errors(draw):
    """Errors of up to 100 km, 300 m/s and just less than half a turn."""
    d = np.array(draw(st.tuples(*[st.floats(-1.0, 1.0)] * 9)))
    d[:3] *= 10.0 ** draw(st.floats(-6.0, 5.0))
    d[3:6] *= 10.0 ** draw(st.floats(-6.0, 2.5))
    length = np.linalg.norm(d[6:])
    turn = draw(st.one_of(st.sampled_from([0.0, 3.1415, np.pi - 1e-6]), st.floats(0.0, 3.14)))
    d[6:] *= turn / length if length > 1e-3 else 0.0
    return d


@FRAMES
@given(nav=references(), d=large_errors())
def test_boxminus_undoes_boxplus(ecef, nav, d):
    reference = to_ecef(nav) if ecef else nav
    moved, found = reference.copy(), np.empty(9)
    boxplus_navigation(moved, d, ecef)
    boxminus_navigation(moved, reference, ecef, found)
    assert np.abs(found[:3] - d[:3]).max() < 2e-8
    assert np.abs(found[3:6] - d[3:6]).max() < 1e-9
    # A rotation close to half a turn is known to the rounding of its quaternion.
    assert np.abs(found[6:] - d[6:]).max() < 1e-11


@FRAMES
@given(nav=references(), d=large_errors())
def test_boxminus_is_the_error_of_earth_fixed_algebra(ecef, nav, d):
    reference = to_ecef(nav) if ecef else nav
    moved, found = reference.copy(), np.empty(9)
    boxplus_navigation(moved, d, ecef)
    boxminus_navigation(moved, reference, ecef, found)
    expected = error(moved, reference, ecef)
    assert np.abs(found[:3] - expected[:3]).max() < 1e-7
    assert np.abs(found[3:6] - expected[3:6]).max() < 1e-9
    assert np.abs(found[6:] - expected[6:]).max() < 1e-8


@FRAMES
@given(nav=references(), d=large_errors())
def test_boxplus_of_boxminus_reaches_the_state(ecef, nav, d):
    """Not only for errors that boxplus made: the two states here have nothing to do with each other."""
    reference = array(ecef)
    target = to_ecef(nav) if ecef else nav.copy()
    boxplus_navigation(target, d, ecef)
    difference = np.empty(9)
    boxminus_navigation(target, reference, ecef, difference)
    assert np.linalg.norm(difference[6:]) <= np.pi + 1e-12
    boxplus_navigation(reference, difference, ecef)
    assert_same_place(reference, ecef, earth_fixed(target, ecef), metres=2e-8)


@FRAMES
def test_boxminus_of_a_state_and_itself_is_zero(ecef):
    found = np.empty(9)
    boxminus_navigation(array(ecef), array(ecef), ecef, found)
    assert np.abs(found).max() < 1e-14


@FRAMES
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("size", [0.0, 1e-6, 1.0, 40.0])
def test_boxplus_is_exact_in_earth_fixed_algebra(place, size, ecef):
    nav = array(ecef, **PLACES[place])
    d = size * D
    expected = corrected(nav, d, ecef)
    boxplus_navigation(nav, d, ecef)
    assert_same_place(nav, ecef, expected)
    assert abs(np.linalg.norm(nav[6:]) - 1.0) < 1e-15


@given(
    lat=st.floats(-1.57, 1.57),
    lon=st.floats(-np.pi, np.pi),
    angles=st.tuples(*[st.floats(-4.0, 4.0)] * 3),
    psi=st.tuples(*[st.floats(-4.0, 4.0)] * 3),
    metres=st.tuples(*[st.floats(-1e6, 1e6)] * 3),
)
def test_boxplus_is_the_same_correction_in_both_frames(lat, lon, angles, psi, metres):
    nav = ned_array(lat=lat, lon=lon, roll=angles[0], pitch=angles[1], heading=angles[2])
    d_n = np.array([*metres, 5.0, -6.0, 7.0, *psi])
    C_en = rotation_en(lat, lon)
    d_e = np.concatenate([C_en @ part for part in d_n.reshape(3, 3)])
    earth = to_ecef(nav)
    boxplus_navigation(nav, d_n, False)
    boxplus_navigation(earth, d_e, True)
    assert_same_place(nav, False, earth_fixed(earth, ecef=True), metres=1e-7)


def test_boxplus_crosses_a_pole():
    nav = ned_array(lat=0.5 * np.pi - 1e-5, lon=0.4)
    expected = corrected(nav, np.array([200.0, 0, 0, 0, 0, 0, 0, 0, 0]), ecef=False)
    boxplus_navigation(nav, np.array([200.0, 0, 0, 0, 0, 0, 0, 0, 0]), False)
    assert_same_place(nav, False, expected)
    assert abs(nav[1] - (0.4 - np.pi)) < 1e-3


@FRAMES
def test_the_error_after_boxplus_with_the_error_is_zero(ecef):
    estimate, true = array(ecef), array(ecef, lat=0.70001, heading=5.3, velocity=(10.0, 0.0, 1.0))
    boxplus_navigation(estimate, error(true, estimate, ecef), ecef)
    assert_same_place(estimate, ecef, earth_fixed(true, ecef))


def layout():
    return Layout.join(
        [Block("gyro_bias", 3, 1e-3), Block("accel_bias", 3, 1e-2), Block("gyro_scale", 3, 1e-3)],
        [Block("odometer.scale", 1, 0.02)],
    )


def nav_state(ecef):
    states = np.linspace(-1e-3, 1e-3, 10)
    return NavState(5.0, array(ecef), ecef, states, layout(), np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, -9.7]))


@FRAMES
def test_properties_say_what_the_array_holds(ecef):
    nav, plain = nav_state(ecef), ned_array()
    r, v, C_eb = earth_fixed(plain, ecef=False)
    assert np.abs([nav.lat - plain[0], nav.lon - plain[1]]).max() < 1e-14
    assert abs(nav.height - plain[2]) < 1e-8
    np.testing.assert_allclose(nav.v_n, plain[3:6], atol=1e-12)
    np.testing.assert_allclose(nav.r_e, r, atol=1e-8)
    np.testing.assert_allclose(nav.v_e, v, atol=1e-12)
    np.testing.assert_allclose(nav.C_nb, dcm(plain[6:]), atol=1e-14)
    np.testing.assert_allclose(nav.C_en, rotation_en(plain[0], plain[1]), atol=1e-14)
    np.testing.assert_allclose(nav.C_eb, C_eb, atol=1e-14)
    np.testing.assert_allclose(nav.C_nm, rotation_en(plain[0], plain[1]).T if ecef else np.eye(3), atol=1e-14)
    w_eb_b = np.array([0.1, -0.2, 0.3]) - C_eb.T @ [0.0, 0.0, EARTH_RATE]
    np.testing.assert_allclose(nav.w_eb_b, w_eb_b, atol=1e-16)


def test_states_are_found_by_name():
    nav = nav_state(False)
    assert np.array_equal(nav.state("gyro_scale"), nav.states[6:9])
    assert np.array_equal(nav.state("odometer.scale"), nav.states[9:])
    with pytest.raises(KeyError):
        nav.state("baro.bias")


@FRAMES
def test_boxplus_returns_a_new_state_and_leaves_the_old(ecef):
    nav = nav_state(ecef)
    before = nav.array.copy(), nav.states.copy(), nav.w_ib_b.copy(), nav.f_b.copy()
    delta = np.concatenate([D, 1e-3 * np.arange(1.0, 11.0)])
    moved = nav.boxplus(delta)
    assert_same_place(moved.array, ecef, corrected(nav.array, D, ecef))
    np.testing.assert_allclose(moved.states, nav.states + delta[9:], rtol=0, atol=1e-18)
    for old, now in zip(before, (nav.array, nav.states, nav.w_ib_b, nav.f_b), strict=True):
        assert np.array_equal(old, now)
    assert moved.time == nav.time


def test_boxplus_takes_the_new_sensor_errors_out_of_rate_and_force():
    nav = nav_state(False)
    delta = np.zeros(19)
    delta[9:12], delta[12:15], delta[15:18] = 1e-3, 2e-2, (1e-3, 0.0, -2e-3)
    moved = nav.boxplus(delta)
    raw_w = (1.0 + nav.states[6:9]) * nav.w_ib_b + nav.states[:3]
    exact = (raw_w - nav.states[:3] - 1e-3) / (1.0 + nav.states[6:9] + delta[15:18])
    np.testing.assert_allclose(moved.w_ib_b, exact, atol=5e-6)
    np.testing.assert_allclose(moved.f_b, nav.f_b - 2e-2, atol=1e-12)


def described(nav, d, P, ecef):
    out = np.empty((1, 18))
    describe_rows(nav[None], d[None], P[None], ecef, out)
    return out[0]


def euler(C_nb):
    heading, pitch, roll = Rotation.from_matrix(C_nb).as_euler("ZYX")
    return np.array([roll, pitch, heading % (2.0 * np.pi)])


@FRAMES
def test_rows_hold_the_corrected_state(ecef):
    nav = array(ecef)
    r, v, C = corrected(nav, D, ecef)
    row = described(nav, D, np.zeros((9, 9)), ecef)
    C_en = rotation_en(row[0], row[1])
    assert_same_place(np.array([*row[:6], 1.0, 0.0, 0.0, 0.0]), False, (r, v, C_en))
    np.testing.assert_allclose(row[6:9], euler(C_en.T @ C), atol=1e-12)
    assert np.array_equal(row[9:], np.zeros(9))


def covariance(seed=0):
    root = np.random.default_rng(seed).standard_normal((9, 9)) + np.eye(9)
    sd = np.repeat([2.0, 0.1, 0.01], 3)
    P = root @ root.T
    return P * np.outer(sd, sd) / np.sqrt(np.outer(np.diagonal(P), np.diagonal(P)))


@FRAMES
@pytest.mark.parametrize("attitude", [(0.3, -0.4, 5.0), (-2.8, 1.2, 0.0), (0.0, 0.0, 3.1), (1.5, -1.45, 2.0)])
def test_deviations_of_a_row_are_those_of_differences(attitude, ecef):
    nav = array(ecef, **dict(zip(("roll", "pitch", "heading"), attitude, strict=True)))
    P = covariance()
    C_en = rotation_en(*to_ned(nav)[:2]) if ecef else rotation_en(nav[0], nav[1])
    to_n = C_en.T if ecef else np.eye(3)
    J = np.kron(np.eye(3), to_n)
    C_eb = earth_fixed(nav, ecef)[2]
    columns = []
    for axis in 1e-6 * np.eye(3):
        psi_e = axis if ecef else C_en @ axis
        ahead = euler(C_en.T @ Rotation.from_rotvec(psi_e).as_matrix() @ C_eb)
        behind = euler(C_en.T @ Rotation.from_rotvec(-psi_e).as_matrix() @ C_eb)
        columns.append(((ahead - behind + np.pi) % (2.0 * np.pi) - np.pi) / 2e-6)
    J[6:, 6:] = np.column_stack(columns)
    expected = np.sqrt(np.diagonal(J @ P @ J.T))
    np.testing.assert_allclose(described(nav, np.zeros(9), P, ecef)[9:], expected, rtol=1e-6)


@FRAMES
@pytest.mark.parametrize("pitch", [0.5 * np.pi, -0.5 * np.pi])
def test_roll_and_heading_are_unknown_at_gimbal_lock(pitch, ecef):
    row = described(array(ecef, pitch=pitch), np.zeros(9), 1e-4 * np.eye(9), ecef)
    assert row[15] == pytest.approx(CAP)
    assert row[16] == pytest.approx(0.01)
    assert row[17] == pytest.approx(CAP)


@FRAMES
def test_deviations_of_angles_are_capped_at_no_knowledge(ecef):
    row = described(array(ecef), np.zeros(9), 100.0 * np.eye(9), ecef)
    assert row[15:].tolist() == [CAP] * 3


@pytest.mark.parametrize("lat", [0.5 * np.pi, -0.5 * np.pi], ids=["north pole", "south pole"])
def test_a_row_on_a_pole_is_finite(lat):
    nav = to_ecef(ned_array(lat=0.5 * np.pi - 1e-3, lon=0.0))
    nav[:3] = (0.0, 0.0, np.sign(lat) * 6356752.314245179)
    row = described(nav, np.zeros(9), covariance(), True)
    assert np.isfinite(row).all()
    assert row[0] == pytest.approx(lat, abs=1e-12)
    assert abs(row[2]) < 1e-8


@pytest.mark.parametrize("attitude", [(0.0, 0.0, 0.0), (0.4, -1.1, 4.0), (-3.0, 0.2, 2.0)])
def test_a_start_states_the_deviations_that_it_was_given(attitude):
    position, velocity = np.array([0.7, -2.0, 120.0]), np.array([1.0, 2.0, 3.0])
    sd = np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3, 0.01, 0.02, 0.5])
    start = Start.from_parts(3.0, position, velocity, np.array(attitude), sd[:3], sd[3:6], sd[6:])
    row = described(start.nav, np.zeros(9), start.P, False)
    np.testing.assert_allclose(row[9:], sd, rtol=1e-12)
    np.testing.assert_allclose(row[:6], [*position, *velocity], atol=1e-14)
    np.testing.assert_allclose(row[6:9], attitude, atol=1e-12)
    assert start.time == 3.0


def test_euler_axes_turn_one_angle_at_a_time():
    attitude = np.array([0.4, -1.1, 4.0])
    axes = euler_axes(*attitude)
    C = Rotation.from_euler("ZYX", attitude[::-1]).as_matrix()
    for k in range(3):
        step = 1e-7 * np.eye(3)[k]
        moved = Rotation.from_euler("ZYX", (attitude + step)[::-1]).as_matrix()
        np.testing.assert_allclose(Rotation.from_matrix(moved @ C.T).as_rotvec() / 1e-7, axes[:, k], atol=1e-7)
