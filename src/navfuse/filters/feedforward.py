"""The unscented full-state filter of fifteen states: navigation, accelerometer and gyro biases."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from navfuse.aiding.base import AidingSensor
from navfuse.core.constants import STANDARD_GRAVITY
from navfuse.data.start import Start
from navfuse.errors import ConfigError
from navfuse.filters.feedback import POSITION_SENSOR, left_out, named
from navfuse.filters.settings import FilterSettings
from navfuse.filters.unscented import UnscentedFilter
from navfuse.imu.error_model import ImuErrorModel

OBSERVED = (POSITION_SENSOR, "gnss_velocity")


def feedforward_filter(
    start: Start,
    imu_model: ImuErrorModel,
    sensors: Sequence[AidingSensor] = (),
    settings: FilterSettings | None = None,
) -> UnscentedFilter:
    """An unscented filter of the whole state ``[L, lambda, h, roll, pitch, heading, v_N, v_E, v_D, b_a, b_g]``.

    GNSS position and, where there is one, velocity are observed; other sensors are left out, and so are the scale
    factors and cross-couplings of the error model. The bias of the accelerometer that points down has to stand for what
    its scale factor makes of gravity, and may be larger by that.

    Raises
    ------
    ConfigError
        Without a position sensor, or if the error model has not both biases.
    """
    named(sensors, POSITION_SENSOR, "ukf-feedforward-15")
    model = imu_model.replace(gyro_scale_sd=0.0, accel_scale_sd=0.0, gyro_cross_sd=0.0, accel_cross_sd=0.0)
    for sensor in ("gyro", "accel"):
        if not np.any(model.axes(f"{sensor}_bias_sd") > 0.0) and not np.any(model.axes(f"{sensor}_bias_walk") > 0.0):
            raise ConfigError(
                f'the estimator "ukf-feedforward-15" estimates the biases of both sensors, but {sensor}_bias_sd is 0; '
                'give it, or take estimator = "ukf", which has the states that the error model has'
            )
    down = imu_model.axes("accel_bias_sd")
    down[2] = np.hypot(down[2], imu_model.axes("accel_scale_sd")[2] * STANDARD_GRAVITY)
    used = [sensor for sensor in sensors if sensor.name in OBSERVED]
    built = UnscentedFilter(start, model.replace(accel_bias_sd=down), used, settings)
    built.record.notes += left_out(sensors, OBSERVED, "ukf-feedforward-15")
    return built
