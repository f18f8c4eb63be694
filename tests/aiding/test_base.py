from __future__ import annotations

import numpy as np
import pytest

from navfuse.aiding.base import AidingSensor, difference_steps, noise_covariance, numerical_jacobian
from navfuse.data.layout import Block, Layout
from navfuse.data.nav_state import NavState


class Compass(AidingSensor):
    """Measures the heading, which wraps."""

    name = "compass"
    states = (Block("bias", 1, 0.1, tau=60.0, walk=0.0, value=0.02),)
    times = np.array([1.0])

    def value(self, k):
        return np.array([6.28])

    def predict(self, nav, k):
        heading = np.arctan2(nav.C_nb[1, 0], nav.C_nb[0, 0])
        return np.array([(heading + nav.state("compass.bias")[0]) % (2.0 * np.pi)])

    def noise(self, k):
        return 0.05

    def subtract(self, measured, predicted):
        return (measured - predicted + np.pi) % (2.0 * np.pi) - np.pi


def state_heading(heading):
    layout = Layout.join([], Compass().state_blocks())
    q = np.array([np.cos(0.5 * heading), 0.0, 0.0, np.sin(0.5 * heading)])
    nav = np.concatenate([[0.7, 0.1, 50.0, 1.0, 2.0, 0.0], q])
    return NavState(1.0, nav, False, layout.per_state("value"), layout, np.zeros(3), np.zeros(3))


def test_three_methods_are_enough_to_linearize():
    z, H, R = Compass().linearize(state_heading(0.01), 0)
    np.testing.assert_allclose(z, [6.28 - 2.0 * np.pi - 0.03], atol=1e-12)
    np.testing.assert_allclose(H, [[0, 0, 0, 0, 0, 0, 0, 0, 1.0, 1.0]], atol=1e-6)
    assert R.tolist() == [[0.0025000000000000005]]


def test_differences_pass_the_wrap_of_an_angle():
    np.testing.assert_allclose(numerical_jacobian(Compass(), state_heading(-0.02), 0)[0, 8:], [1.0, 1.0], atol=1e-6)


def test_states_of_a_sensor_carry_its_name():
    (block,) = Compass().state_blocks()
    assert (block.name, block.size, block.sd, block.tau, block.value) == ("compass.bias", 1, 0.1, 60.0, 0.02)


def test_nothing_is_withheld_unless_a_sensor_says_so():
    assert not AidingSensor().withheld(0)


@pytest.mark.parametrize("method", ["value", "predict", "noise"])
def test_what_a_sensor_must_define_is_named(method):
    class Empty(AidingSensor):
        pass

    arguments = (None, 0) if method == "predict" else (0,)
    with pytest.raises(NotImplementedError, match=rf"Empty must define {method}\("):
        getattr(Empty(), method)(*arguments)


def test_noise_is_deviations_or_a_covariance():
    assert noise_covariance(2.0, 2).tolist() == [[4.0, 0.0], [0.0, 4.0]]
    assert noise_covariance(np.array([1.0, 3.0]), 2).tolist() == [[1.0, 0.0], [0.0, 9.0]]
    full = np.array([[2.0, 1.0], [1.0, 2.0]])
    assert np.array_equal(noise_covariance(full, 2), full)


def test_steps_fit_the_size_of_the_states():
    layout = Layout.join([Block("gyro_bias", 3, np.array([1e-4, 0.0, 1e-2]))])
    assert difference_steps(layout).tolist() == [1.0] * 3 + [1e-2] * 3 + [1e-4] * 3 + [1e-5, 1e-3, 1e-3]
