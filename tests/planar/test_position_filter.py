"""Algorithm 3 against one least-squares problem of everything; its noise; dead reckoning; the flat Earth."""

import numpy as np
import pymap3d
import pytest

from navfuse.errors import ConfigError, InputError
from navfuse.planar import ChannelNoise, FlatEarth, dead_reckon, filter_positions, metres_per_degree

TOLD = ChannelNoise(jerk=0.7, accel=0.3, position=1.5, velocity=0.2, start_position=4.0, start_velocity=2.0,
                    start_accel=1.0)  # fmt: skip


def batch(time, accel, fix_time, position, velocity, told):
    """Mean and covariance of the state at the last time: weighted least squares over the states of all events."""
    events = np.unique(np.concatenate((time, fix_time)))
    n = events.size
    rows, values = [], []

    def add(blocks, value, root):
        """Root is a square root of the inverse covariance."""
        A = np.zeros((len(value), 3 * n))
        for at, block in blocks.items():
            A[:, 3 * at : 3 * at + 3] = block
        rows.append(root @ A)
        values.append(root @ np.asarray(value))

    start_sd = np.array([told.start_position, told.start_velocity, told.start_accel])
    add({0: np.eye(3)}, [position[0], velocity[0], 0.0], np.diag(1.0 / start_sd))
    for k in range(1, n):
        T = events[k] - events[k - 1]
        Phi = np.array([[1.0, T, 0.5 * T * T], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
        # Q by quadrature of its definition, not by the formula under test.
        s, weight = np.polynomial.legendre.leggauss(4)
        s, weight = 0.5 * T * (s + 1.0), 0.5 * T * weight
        G = np.column_stack((0.5 * s * s, s, np.ones_like(s)))
        Q = told.jerk**2 * (G.T * weight) @ G
        add({k: np.eye(3), k - 1: -Phi}, np.zeros(3), np.linalg.inv(np.linalg.cholesky(Q)))
    for k, t in enumerate(time):
        add({np.searchsorted(events, t): [[0.0, 0.0, 1.0]]}, [accel[k]], np.eye(1) / told.accel)
    for k, t in enumerate(fix_time):
        root = np.diag([1.0 / told.position, 1.0 / told.velocity])
        add({np.searchsorted(events, t): np.eye(3)[:2]}, [position[k], velocity[k]], root)
    A, b = np.vstack(rows), np.concatenate(values)
    x = np.linalg.lstsq(A, b, rcond=None)[0]
    root = np.linalg.inv(np.linalg.qr(A, mode="r"))[-3:]
    return x[-3:], root @ root.T


def test_filter_is_the_batch_solution():
    rng = np.random.default_rng(7)
    time = np.cumsum(rng.uniform(0.05, 0.2, 14))
    fix_time = np.array([time[0], 0.5 * (time[3] + time[4]), time[9], time[13]])
    accel, position, velocity = (rng.normal(0.0, s, (k, 2)) for s, k in ((1.0, 14), (5.0, 4), (2.0, 4)))
    found = filter_positions(time, accel, fix_time, position, velocity, TOLD)
    for axis in range(2):
        x, P = batch(time, accel[:, axis], fix_time, position[:, axis], velocity[:, axis], TOLD)
        state = [found.position[-1, axis], found.velocity[-1, axis], found.accel[-1, axis]]
        np.testing.assert_allclose(state, x, atol=1e-8)
        assert found.sd_position[-1, axis] == pytest.approx(np.sqrt(P[0, 0]), rel=1e-8)
        assert found.sd_velocity[-1, axis] == pytest.approx(np.sqrt(P[1, 1]), rel=1e-8)


def test_errors_are_those_the_filter_claims():
    """Its own model simulated: mean square of error over sigma is 1."""
    rng = np.random.default_rng(8)
    time, told = np.arange(4000) * 0.05, TOLD
    Q = told.jerk**2 * 0.05
    a = np.cumsum(rng.normal(0.0, np.sqrt(Q), (4000, 2)), axis=0)
    mean = 0.5 * (a[1:] + a[:-1])
    position, velocity = dead_reckon(time, np.vstack((a[:1], mean)))
    at = np.arange(0, 4000, 20)
    found = filter_positions(
        time,
        a + rng.normal(0.0, told.accel, a.shape),
        time[at],
        position[at] + rng.normal(0.0, told.position, (at.size, 2)),
        velocity[at] + rng.normal(0.0, told.velocity, (at.size, 2)),
        told,
    )
    ratio = ((found.velocity - velocity) / found.sd_velocity)[200::40]
    assert 0.8 < np.mean(ratio**2) < 1.2
    ratio = ((found.position - position) / found.sd_position)[200:]
    assert 0.5 < np.mean(ratio**2) < 1.6


def test_fixes_without_velocity_rows_without_acceleration_and_fixes_outside():
    time = np.arange(101) * 0.1
    accel = np.zeros((101, 2))
    accel[30:40] = np.nan
    fix_time = np.array([-1.0, 0.0, 5.0, 10.0, 11.0])
    position = np.column_stack((fix_time, 2.0 * fix_time))
    position[[0, 4]] = 1e6
    found = filter_positions(time, accel, fix_time, position)
    np.testing.assert_allclose(found.position[-1], [10.0, 20.0], atol=1.0)
    np.testing.assert_allclose(found.velocity[-1], [1.0, 2.0], atol=0.3)
    with pytest.raises(InputError, match="are both on one scale"):
        filter_positions(time, accel, fix_time + 100.0, position)
    with pytest.raises(InputError, match="accel has shape"):
        filter_positions(time, accel[:, 0], fix_time, position)
    with pytest.raises(ConfigError, match=r"jerk = 0.0"):
        ChannelNoise(jerk=0.0)


def test_dead_reckoning_of_a_constant_acceleration_is_exact():
    time = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.3, 50))
    position, velocity = dead_reckon(time, np.tile([0.4, -1.0], (50, 1)), [10.0, 20.0], [1.0, 2.0])
    T = time[-1] - time[0]
    np.testing.assert_allclose(velocity[-1], [1.0 + 0.4 * T, 2.0 - T], rtol=1e-13)
    np.testing.assert_allclose(position[-1], [10.0 + T + 0.2 * T * T, 20.0 + 2.0 * T - 0.5 * T * T], rtol=1e-13)


def test_metres_per_degree_of_the_tutorial():
    """Hampton, Virginia (37.09 N): it takes 110 980 and 88 892 m; WGS 84 has both within 30 m there."""
    north, east = metres_per_degree(np.radians(37.09))
    assert north == pytest.approx(110_980.0, abs=10.0)
    assert east == pytest.approx(88_892.0, abs=30.0)
    assert metres_per_degree(0.0)[1] == pytest.approx(111_319.491, abs=1e-3)
    assert metres_per_degree(np.pi / 2.0)[0] == pytest.approx(111_693.98, abs=0.01)


@pytest.mark.parametrize("lon", [-76.38, 179.9999])
def test_flat_earth_against_the_tangent_plane(lon):
    flat = FlatEarth(np.radians(37.1), np.radians(lon), -30.0)
    metres = np.array([[30.0, -20.0], [-300.0, 400.0], [0.0, 0.0]])
    lat, along = flat.to_geodetic(metres)
    wrapped = np.angle(np.exp(1j * along))
    np.testing.assert_allclose(flat.to_metres(lat, wrapped), metres, atol=1e-6)
    e, n, _ = pymap3d.geodetic2enu(np.degrees(lat), np.degrees(wrapped), -30.0, 37.1, lon, -30.0)
    assert np.abs(np.column_stack((n, e)) - metres)[0].max() < 1e-4
    assert np.abs(np.column_stack((n, e)) - metres)[1].max() < 0.025
    with pytest.raises(InputError, match="Are these degrees"):
        flat.to_metres([37.1], [lon])
