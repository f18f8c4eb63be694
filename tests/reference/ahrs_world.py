"""A body whose motion, sensors and surroundings are exactly what the attitude and heading reference believes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from navfuse.attitude.ahrs_settings import AhrsSettings
from navfuse.data.aiding_logs import MagnetometerLog
from navfuse.data.logs import ImuLog

Array = np.ndarray

STEP, PER_BLOCK = 0.01, 4
FIELD_N = np.array([18e-6, 0.0, 45e-6])


def world_settings(**changes) -> AhrsSettings:
    """Settings that the world is made from: blocks of four samples, velocity white from block to block."""
    base = {
        "block": STEP * PER_BLOCK, "velocity_density": 0.02, "velocity_time": 0.0, "accel_scale": 0.0,
        "accel_noise": 0.003,
        "gyro_noise": 2e-3, "gyro_scale": 0.004, "field_n": FIELD_N, "field_sd": 5e-7, "disturbance_tau": 1.0,
        "rest_rate": 0.0,
        "accel_bias_sd": 0.02,
    }  # fmt: skip
    return AhrsSettings(**(base | changes))


@dataclass
class World:
    """Logs and truth; `q_nb` (n, 4) at every stamp."""

    imu: ImuLog
    magnetometer: MagnetometerLog
    q_nb: Array
    gyro_bias: Array
    delay: float


def make_world(settings: AhrsSettings, seconds: float, seed: int, disturbance=None) -> World:
    """Draw one.

    `disturbance` (optional) takes time [s] and gives an extra field in n [T].
    """
    rng = np.random.default_rng(seed)
    n = round(seconds / STEP)
    blocks = n // PER_BLOCK
    time = STEP * np.arange(n + 1)
    mid = time[1:] - 0.5 * STEP
    rate = sum(
        (rng.uniform(0.5, 1.2) * np.sin(2.0 * np.pi * f * mid[:, None] + rng.uniform(0.0, 6.0, 3)))
        for f in (0.11, 0.23, 0.41)
    )
    steps = Rotation.from_rotvec(rate * STEP)
    halves = Rotation.from_rotvec(0.5 * rate * STEP)
    start = rng.uniform(-0.3, 0.3, 3)
    start[0] = rng.uniform(-3.0, 3.0)
    q = [Rotation.from_euler("ZYX", start)]
    for step in steps:
        q.append(q[-1] * step)
    attitude = Rotation.concatenate(q)
    block_s = STEP * PER_BLOCK
    ramp = np.minimum(1.0, np.arange(blocks + 1) * block_s / 2.0)[:, None]
    v = ramp * settings.velocity_density / np.sqrt(block_s) * rng.standard_normal((blocks + 1, 3))
    accel = np.repeat(np.diff(v, axis=0) / block_s, PER_BLOCK, axis=0)
    C_mid = attitude[:-1] * halves
    bias_g, bias_a = settings.gyro_bias_sd * rng.standard_normal(3), settings.accel_bias_sd * rng.standard_normal(3)
    turn = rate * STEP
    noise = np.sqrt(settings.gyro_noise**2 * STEP + settings.gyro_scale**2 * (turn**2).sum(1) / STEP)
    theta = turn + bias_g * STEP + noise[:, None] * rng.standard_normal((n, 3))
    force = C_mid.inv().apply(accel - [0.0, 0.0, settings.gravity])
    dv = (force + bias_a) * STEP + settings.accel_noise * np.sqrt(STEP) * rng.standard_normal((n, 3))
    d = np.empty((blocks, 3))
    d[0] = settings.disturbance_sd * rng.standard_normal(3)
    decay = np.exp(-block_s / settings.disturbance_tau)
    for k in range(1, blocks):
        d[k] = decay * d[k - 1] + settings.disturbance_sd * np.sqrt(1.0 - decay**2) * rng.standard_normal(3)
    M = (
        np.array(FIELD_N)
        + settings.field_sd * rng.standard_normal(3) * [1.0, 0.0, 1.0]
        + np.repeat(d, PER_BLOCK, axis=0)
    )
    if disturbance is not None:
        M = M + disturbance(time[1:])
    delay = settings.mag_delay_sd * rng.standard_normal()
    late = attitude[1:] * Rotation.from_rotvec(-rate * delay)
    field = late.inv().apply(M) + settings.mag_bias_sd * rng.standard_normal(3)
    field += settings.mag_noise * rng.standard_normal((n, 3))
    pad = np.vstack([np.zeros((1, 3)), theta]), np.vstack([np.zeros((1, 3)), dv])
    imu = ImuLog(time, *pad, kind="increments", source="world")
    quats = attitude.as_quat()[:, [3, 0, 1, 2]]
    return World(imu, MagnetometerLog(time[1:], field, source="world"), quats, bias_g, delay)


def attitude_error(q_true: Array, q: Array) -> Array:
    """(n, 3) rotation vector in n [rad] that takes the estimates to the truth."""

    def rotation(x):
        return Rotation.from_quat(np.asarray(x)[:, [1, 2, 3, 0]])

    return (rotation(q_true) * rotation(q).inv()).as_rotvec()
