"""Filter states of an inertial sensor, as its error model calls for them."""

from __future__ import annotations

import numpy as np

from navfuse.data.layout import Block
from navfuse.imu.error_model import ImuErrorModel


def imu_blocks(model: ImuErrorModel) -> tuple[Block, ...]:
    """Blocks of states for the errors that the model gives a standard deviation or a walk; the others are not
    estimated.

    Order: gyro_bias [rad/s], accel_bias [m/s^2], gyro_scale, accel_scale [1], gyro_cross, accel_cross [rad].
    """
    blocks = []
    for name in ("gyro_bias", "accel_bias"):
        sd, walk = model.axes(f"{name}_sd"), model.axes(f"{name}_walk")
        if np.any(sd > 0) or np.any(walk > 0):
            blocks.append(Block(name, 3, sd, getattr(model, f"{name}_tau"), walk))
    for name in ("gyro_scale", "accel_scale"):
        sd = model.axes(f"{name}_sd")
        if np.any(sd > 0):
            blocks.append(Block(name, 3, sd, getattr(model, f"{name}_tau")))
    for name in ("gyro_cross", "accel_cross"):
        sd = getattr(model, f"{name}_sd")
        if sd > 0:
            blocks.append(Block(name, 6, sd))
    return tuple(blocks)
