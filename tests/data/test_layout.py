from __future__ import annotations

import numpy as np
import pytest

from navfuse.data.layout import NAVIGATION_STATES, Block, Layout
from navfuse.errors import ConfigError
from navfuse.imu.error_model import ImuErrorModel
from navfuse.imu.grades import GRADES
from navfuse.imu.states import imu_blocks


def layout_of_three():
    bias = Block("gyro_bias", 3, np.array([1.0, 2.0, 3.0]), 100.0)
    scale = Block("odometer.scale", 1, 0.02, value=1.5)
    clock = Block("gnss.clock", 2, 4.0, walk=np.array([0.1, 0.2]), value=np.array([7.0, 8.0]))
    return Layout.join([bias], [scale, clock])


def test_blocks_follow_the_navigation_errors_in_order():
    layout = layout_of_three()
    assert layout.size == NAVIGATION_STATES + 6
    assert layout.names == ("position", "velocity", "attitude", "gyro_bias", "odometer.scale", "gnss.clock")
    assert [layout.offset(name) for name in layout.names] == [0, 3, 6, 9, 12, 13]
    assert layout.slice("gnss.clock") == slice(13, 15)
    assert layout.imu_count == 3


def test_the_empty_layout_has_the_nine_navigation_errors():
    layout = Layout.join([])
    assert layout.size == NAVIGATION_STATES
    assert layout.per_state("sd").size == 0
    assert "attitude" in layout
    assert "gyro_bias" not in layout


def test_attributes_come_one_per_state_after_the_ninth():
    layout = layout_of_three()
    assert layout.per_state("sd").tolist() == [1.0, 2.0, 3.0, 0.02, 4.0, 4.0]
    assert layout.per_state("tau").tolist() == [100.0, 100.0, 100.0, np.inf, np.inf, np.inf]
    assert layout.per_state("walk").tolist() == [0.0, 0.0, 0.0, 0.0, 0.1, 0.2]
    assert layout.per_state("value").tolist() == [0.0, 0.0, 0.0, 1.5, 7.0, 8.0]


@pytest.mark.parametrize("name", ["gyro_bias", "position", "attitude"])
def test_two_blocks_of_one_name_are_refused(name):
    with pytest.raises(ConfigError, match=f"two state blocks are named '{name}'"):
        Layout.join([Block("gyro_bias", 3, 1.0)], [Block(name, 1, 1.0)])


def test_an_unknown_name_is_a_key_error():
    layout = layout_of_three()
    with pytest.raises(KeyError):
        layout.offset("baro.bias")
    with pytest.raises(KeyError):
        layout.slice("baro.bias")


def test_a_block_does_not_fit_an_attribute_of_another_length():
    layout = Layout.join([Block("gyro_bias", 3, np.array([1.0, 2.0]))])
    with pytest.raises(ValueError, match="broadcast"):
        layout.per_state("sd")


SIZES = {
    9: ImuErrorModel(arw=1e-4, vrw=1e-3),
    15: ImuErrorModel(gyro_bias_sd=1e-3, accel_bias_sd=1e-2),
    21: ImuErrorModel(gyro_bias_sd=1e-3, accel_bias_sd=1e-2, gyro_scale_sd=1e-3, accel_scale_sd=1e-3),
    33: GRADES["consumer"].replace(gyro_cross_sd=7e-3, accel_cross_sd=7e-3),
}


@pytest.mark.parametrize("size", SIZES)
def test_error_models_make_layouts_of_the_usual_sizes(size):
    assert Layout.join(imu_blocks(SIZES[size])).size == size


def test_only_the_errors_that_the_model_names_are_states():
    model = ImuErrorModel(gyro_bias_walk=1e-6, accel_scale_sd=np.array([0.0, 0.0, 1e-3]), gyro_cross_sd=1e-3)
    layout = Layout.join(imu_blocks(model))
    assert layout.names[3:] == ("gyro_bias", "accel_scale", "gyro_cross")
    assert layout.per_state("sd")[:6].tolist() == [0.0, 0.0, 0.0, 0.0, 0.0, 1e-3]
    assert layout.per_state("walk")[:3].tolist() == [1e-6] * 3
    assert layout.size == 9 + 3 + 3 + 6
    assert layout.imu_count == 12


def test_time_constants_reach_the_states():
    model = ImuErrorModel(gyro_bias_sd=1e-3, gyro_bias_tau=50.0, accel_scale_sd=1e-3, accel_scale_tau=70.0)
    layout = Layout.join(imu_blocks(model))
    assert layout.per_state("tau").tolist() == [50.0] * 3 + [70.0] * 3
