from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from navfuse.errors import ConfigError
from navfuse.simulation import Motion, TableMove, rotating_table
from navfuse.simulation.pinned import pinned, runs_of

MOVES = [TableMove("x", 0.5 * math.pi, 4.0, 6.0), TableMove("z", -3.0, 5.0, 2.0), TableMove("x", 9.0, 10.0, 0.0, 1.0)]


def test_moves_follow_one_another_about_body_axes():
    motion = rotating_table(MOVES, roll=0.1, pitch=0.2, heading=0.3, rest=3.0)
    assert motion.end == pytest.approx(30.0)
    start = Rotation.from_matrix(motion.C_eb(0.0))
    for time, expected in (
        (7.0, Rotation.from_euler("X", 0.5 * math.pi)),
        (19.0, Rotation.from_euler("XZ", [0.5 * math.pi, -3.0])),
        (30.0, Rotation.from_euler("XZX", [0.5 * math.pi, -3.0, 9.0])),
    ):
        turned = start.inv() * Rotation.from_matrix(motion.C_eb(time))
        assert (turned.inv() * expected).magnitude() < 1e-12
    np.testing.assert_allclose(motion.w_eb_b(np.linspace(21.5, 28.5, 20)), [[1.0, 0.0, 0.0]] * 20, atol=1e-6)


def test_the_table_rests_exactly_and_its_fixed_point_stays():
    offset = np.array([0.2, -0.1, 0.05])
    motion = rotating_table(MOVES, lat=0.5 * math.pi, offset_b=offset, rest=3.0)
    for t in (np.linspace(0.0, 2.9, 30), np.linspace(7.05, 12.95, 30), np.linspace(18.05, 19.95, 30)):
        np.testing.assert_array_equal(motion.w_eb_b(t), 0.0)
        np.testing.assert_array_equal(motion.v_e(t), 0.0)
    t = np.arange(0.0, 30.0, 0.013)
    fixed = motion.r_e(t) - motion.C_eb(t) @ offset
    np.testing.assert_allclose(fixed, np.tile(fixed[0], (t.size, 1)), atol=1e-6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rotating_table([]), "needs at least one move"),
        (lambda: rotating_table(MOVES, rest=-1.0), "rest before the first move must be finite and not negative"),
        (lambda: rotating_table([MOVES[0], TableMove("w", 1.0, 1.0)]), "move 2: the axis is 'x', 'y' or 'z', not 'w'"),
        (lambda: rotating_table([TableMove("x", 1.0, 0.0)]), "move 1: angle, duration > 0 and pause >= 0"),
        (
            lambda: rotating_table([TableMove("x", 1.0, 1.0, ramp=0.6)]),
            r"ramp must lie in \(0, duration / 2\], not 0.6",
        ),
        (lambda: rotating_table([TableMove("x", 50.0, 1.0)]), "move 1: .* deg/s is too fast, the limit is 1146"),
    ],
)
def test_impossible_moves_are_refused(make, message):
    with pytest.raises(ConfigError, match=message):
        make()


def test_runs_are_at_least_two_long():
    assert runs_of(np.array([1, 1, 0, 1, 0, 0, 1, 1, 1], dtype=bool)) == [(0, 1), (6, 8)]
    assert runs_of(np.zeros(4, dtype=bool)) == []


def test_a_pinned_motion_stands_still_and_is_the_same_elsewhere():
    t = np.linspace(0.0, 10.0, 101)
    s = np.clip((t - 4.0) / 6.0, 0.0, 1.0)
    r_e = 6.4e6 + np.column_stack([s**4, 2.0 * s**5, -(s**3)])
    attitude = Rotation.from_rotvec(np.column_stack([s**4, s**3, 0.0 * s]))
    motion = Motion.from_knots(t, r_e, attitude.as_quat(scalar_first=True))
    still = pinned(motion, t, t <= 4.0)
    inside, beside, far = np.linspace(0.0, 3.99, 50), np.linspace(4.0, 4.3, 50), np.linspace(5.0, 10.0, 50)
    np.testing.assert_array_equal(still.v_e(inside), 0.0)
    np.testing.assert_array_equal(still.w_eb_b(inside), 0.0)
    assert np.abs(motion.v_e(inside)).max() > 1e-9
    np.testing.assert_allclose(still.r_e(beside), motion.r_e(beside), atol=1e-5)
    np.testing.assert_allclose(still.r_e(far), motion.r_e(far), atol=2e-9)
    np.testing.assert_allclose(still.f_b(far), motion.f_b(far), atol=1e-5)
    np.testing.assert_allclose(still.w_ib_b(far), motion.w_ib_b(far), atol=1e-9)
    inner = still.knots[1:-1]
    before, after = still.at(np.nextafter(inner, 0.0)), still.at(inner)
    np.testing.assert_allclose(before.a_e, after.a_e, atol=1e-6)
    assert pinned(motion, t, np.zeros(101, dtype=bool)) is motion
